"""Findings, models and rigs in words."""
