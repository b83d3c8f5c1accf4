"""Fits of models to measured K*, operating maps, model files, and queries to them."""
