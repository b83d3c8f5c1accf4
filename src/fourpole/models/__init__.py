"""Models of a tyre's dynamic stiffness: values, derivatives, and, where causal, how they are stepped in time."""
