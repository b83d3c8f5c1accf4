"""One file per format of recordings; each has a `FORMAT` that says how to know it and how to read it."""
