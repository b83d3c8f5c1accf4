"""Commands: each reads its input, calls the library and prints the result; this package has no formulas."""
