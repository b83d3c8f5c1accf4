"""Curves packed into few characters, for the script of a page."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Two of these characters are one sample of a curve: 4095 levels between its extremes, and one for a missing sample.
ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
_LEVELS = 4094
_PAIRS = np.array([a + b for a in ALPHABET for b in ALPHABET])


def extremes(values: NDArray[np.float64]) -> tuple[float, float]:
    """Least and largest value; zeros if none is known."""
    seen = values[np.isfinite(values)]
    return (float(seen.min()), float(seen.max())) if seen.size else (0.0, 0.0)


def packed(values: NDArray[np.float64], low: float | None = None, high: float | None = None) -> list[float | str]:
    """A curve as its extremes and two characters per sample.

    Parameters
    ----------
    values : (n,) float array
        Not-a-number is kept as missing.
    low, high : float, optional
        Extremes to share with other curves; by default the curve's own.

    Returns
    -------
    list
        Least value, value of one level, text.
    """
    if low is None or high is None:
        low, high = extremes(values)
    step = (high - low) / _LEVELS
    level = np.zeros(values.size) if step == 0 else (values - low) / step
    index = np.where(np.isfinite(values), np.clip(np.rint(level), 0, _LEVELS), _LEVELS + 1).astype(int)
    return [float(f"{low:.8g}"), float(f"{step:.8g}"), "".join(_PAIRS[index].tolist())]
