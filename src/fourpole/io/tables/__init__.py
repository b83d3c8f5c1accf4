"""Tables of K*, and of load and deflection, of any format: which column is what, and its values in SI."""
