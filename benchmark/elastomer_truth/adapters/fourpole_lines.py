"""The lines of a spectrum around a frequency, and their weights in a parabola."""

from __future__ import annotations

from collections.abc import Callable
from math import prod


def lines_around(lines: list[dict[str, str]], frequency: float) -> list[dict[str, str]]:
    """The line at a frequency, or the two or three nearest ones that are not rejected; lines are sorted by distance."""
    nearest = float(lines[0]["frequency [Hz]"])
    used = [line for line in lines if line["verdict"] != "rejected"]
    for count in (3, 2) if abs(nearest / frequency - 1) >= 1e-3 and len(used) > 2 else ():
        # A gap in the spectrum is no place to interpolate, and nothing is known beyond its ends.
        places = [float(line["frequency [Hz]"]) / frequency for line in used[:count]]
        if min(places) < 1.02 and max(places) > 0.98 and max(abs(place - 1) for place in places) < 0.5:
            return used[:count]
    return lines[:1]


def weights_of(frequencies: list[float], frequency: float, scale: Callable[[float], float]) -> list[float]:
    """Weights of values at some frequencies in the polynomial through them over a scale of these, at a frequency."""
    places, at = [scale(f) for f in frequencies], scale(frequency)
    return [prod((at - other) / (own - other) for other in places if other != own) for own in places]
