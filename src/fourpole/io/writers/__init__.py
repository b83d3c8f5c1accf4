"""Recordings in other formats: a file for each, which says what it cannot keep."""
