"""Measured K* becomes fits, maps, model files and answers to queries."""
