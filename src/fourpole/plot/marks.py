"""The tests of a figure as series: points that lead to their cards, and lines through their means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray, IntArray
from fourpole.plot.cards import linked
from fourpole.plot.data import Role, Series, Tone
from fourpole.plot.sheet import means
from fourpole.study.study import Study


def points_of(
    results: Study,
    rows: BoolArray,
    values: tuple[FloatArray, FloatArray],
    like: Series,
    *,
    stds: tuple[FloatArray | None, FloatArray | None] = (None, None),
) -> list[Series]:
    """The tests of a mask as points with the look and the role of another series; none if none has both values.

    `values` and `stds` are those of all tests along the abscissa and the ordinate, in the units of the axes.
    """
    x, y = values
    at = np.flatnonzero(rows & np.isfinite(x) & np.isfinite(y))
    if not at.size:
        return []
    at = at[np.argsort(x[at], kind="stable")]
    across, spread = (None if std is None else std[at] for std in stds)
    return [linked(results, replace(like, x=x[at], y=y[at], spread=spread, across=across), at)]


def line_of(x: FloatArray, y: FloatArray, keys: IntArray, like: Series, std: FloatArray | None = None) -> list[Series]:
    """A line through the means of the points of equal key, with the look of another series; none without points.

    Values that are known to no better than 100 % by their uncertainties `std` are left out.
    """
    sure = np.ones(y.size, dtype=bool) if std is None else ~(std > np.abs(y))
    xs, ys = means(x[sure], y[sure], keys[sure].tolist())
    return [replace(like, role=Role.LINE, x=xs, y=ys)] if xs.size else []


def zero_line(x: FloatArray) -> Series:
    """A line at zero over some values of the abscissa, or about the only one."""
    low, high = float(x.min()), float(x.max())
    ends = (low, high) if high > low else (low - 0.1 * abs(low), low + 0.1 * abs(low))
    return Series(Role.LINE, np.array(ends), np.zeros(2), tone=Tone.INK)
