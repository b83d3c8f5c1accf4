"""Laboratories for elastomer and tyre dynamics whose truth is known, and a score for those who estimate it."""

__version__ = "1.0"
