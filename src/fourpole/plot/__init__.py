"""Figures from result tables: axes in, axes out."""
