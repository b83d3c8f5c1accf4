"""Writers of recordings in other formats: one file per format, which adds a remark on whatever it cannot keep."""
