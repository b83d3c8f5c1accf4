"""Readers of recordings: one file per format, whose `FORMAT` recognises a file, describes it and reads it."""
