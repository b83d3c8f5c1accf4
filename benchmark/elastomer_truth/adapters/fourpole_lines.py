"""The lines of a spectrum around a frequency, and their weights in a parabola."""

from __future__ import annotations

from math import prod


def lines_around(lines: list[dict[str, str]], frequency: float) -> list[dict[str, str]]:
    """The line at a frequency, or the three nearest ones that are not rejected; lines are sorted by their distance."""
    nearest = float(lines[0]["frequency [Hz]"])
    used = [line for line in lines if line["verdict"] != "rejected"]
    if abs(nearest / frequency - 1) < 1e-3 or len(used) < 3:
        return lines[:1]
    near = used[:3]
    # A gap in the spectrum is no place to interpolate, and nothing is known beyond its ends.
    places = [float(line["frequency [Hz]"]) / frequency for line in near]
    inside = min(places) < 1.02 and max(places) > 0.98 and max(abs(place - 1) for place in places) < 0.5
    return near if inside else lines[:1]


def weights_of(frequencies: list[float], frequency: float) -> list[float]:
    """Weights of values at some frequencies in the polynomial of f^2 through them, at a frequency."""
    squares, at = [f * f for f in frequencies], frequency * frequency
    return [prod((at - other) / (own - other) for other in squares if other != own) for own in squares]
