"""The tests of a figure as series: points that lead to their cards, lines through their means, and rejected tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray, IntArray
from fourpole.plot.cards import linked
from fourpole.plot.data import Role, Series, Tone, look
from fourpole.plot.sheet import Groups, Sheet, means, spread
from fourpole.study.study import Study

#: Number of pressures in the key of a figure.
MOST_NAMED = 8


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


def rejected_of(results: Study, rows: BoolArray, values: tuple[FloatArray, FloatArray]) -> list[Series]:
    """The rejected tests of a mask."""
    return points_of(results, rows, values, look(Role.REJECTED))


def curve_of(
    results: Study,
    rows: BoolArray,
    values: tuple[FloatArray, FloatArray],
    std: FloatArray,
    keys: IntArray,
    like: Series,
) -> list[Series]:
    """The tests of a mask with bars, and the line through the means of those of equal key."""
    x, y = values
    line = line_of(x[rows], y[rows], keys[rows], like, std[rows])
    return [*line, *points_of(results, rows, values, like, stds=(None, std))]


def line_of(x: FloatArray, y: FloatArray, keys: IntArray, like: Series, std: FloatArray | None = None) -> list[Series]:
    """A line through the means of the points of equal key, with the look of another series; none without points.

    Values that are known to no better than 100 % by their uncertainties `std` are left out.
    """
    sure = np.ones(y.size, dtype=bool) if std is None else ~(std > np.abs(y))
    xs, ys = means(x[sure], y[sure], keys[sure].tolist())
    return [replace(like, role=Role.LINE, x=xs, y=ys)] if xs.size else []


def tyre_look(tyre: int, pressure: int, load: int) -> Series:
    """Colour, marker and line style of a specimen at a pressure and a preload, by their numbers."""
    return look(tyre=tyre, marker=pressure, dash=load)


def pressure_key(sheet: Sheet, which: Sequence[int]) -> list[tuple[Series, str]]:
    """The markers of pressures; of many pressures, some."""
    shown = [which[at] for at in spread(len(which), MOST_NAMED)] if _is_stated(sheet.pressures) else []
    return [(look(marker=rank), _named("pressure", sheet.pressures.labels[rank])) for rank in shown]


def load_key(sheet: Sheet, which: Sequence[int]) -> list[tuple[Series, str]]:
    """The line styles of preloads."""
    shown = which if _is_stated(sheet.loads) else []
    return [(look(Role.LINE, dash=rank), _named("preload", sheet.loads.labels[rank])) for rank in shown]


def zero_line(x: FloatArray) -> Series:
    """A line at zero over some values of the abscissa, or about the only one."""
    low, high = float(x.min()), float(x.max())
    ends = (low, high) if high > low else (low - 0.1 * abs(low), low + 0.1 * abs(low))
    return Series(Role.LINE, np.array(ends), np.zeros(2), tone=Tone.INK)


def _is_stated(groups: Groups) -> bool:
    """False if the only group is that of the tests that state no value."""
    return len(groups) > 1 or groups.stated() > 0


def _named(name: str, label: str) -> str:
    """A label with its number, or "not stated" with the name of the axis before it."""
    return label if label[0].isdigit() else f"{name} {label}"
