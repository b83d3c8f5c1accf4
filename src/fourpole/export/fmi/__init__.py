"""FMUs: the variables of a model, its description in FMI 2.0 and 3.0, its C source, and the compiler."""
