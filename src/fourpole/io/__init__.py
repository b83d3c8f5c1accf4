"""Reading and writing of files, with one module per format."""
