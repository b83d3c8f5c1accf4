"""Ride: vehicles that drive over roads on tyres of a causal model; SI arrays in and out."""
