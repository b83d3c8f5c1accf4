"""The conditions of a model file as figures show them: their tests, the model's curve with its band, the residuals."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import COLUMN, amplitudes_of, levels_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile
from fourpole.fitting.query import response
from fourpole.fitting.rows import keys_of
from fourpole.plot.sheet import Sheet, texts

#: Amplitudes of the deflection within this ratio are one series.
_LEVEL = 1.3
#: Ratio of the ends of the axis of frequency beyond which it is logarithmic.
DECADE = 10.0
#: Number of points of a model's line over more than a decade of frequency, and over less.
_GRID_WIDE, _GRID = 121, 51
_STATED = (q.PRESSURE.head, q.PRELOAD.head)


@dataclass(frozen=True, eq=False)
class Drawn(ByValue):
    """A condition of a model: its groups in the sheet, its values on further axes, and the tests it was fitted to."""

    entry: ModelEntry
    at: int
    tyre: int
    pressure: int
    load: int
    others: tuple[tuple[str, float], ...]
    rows: BoolArray
    amplitude: float | None = None

    @property
    def series(self) -> tuple[int, tuple[float, ...]]:
        """Index of the pressure and values on further axes, in which the conditions of a panel differ."""
        return self.pressure, tuple(value for _, value in self.others)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency fitted [Hz]."""
        return self.entry.conditions[self.at].band


@dataclass(frozen=True, eq=False)
class Curves(ByValue):
    """One condition: points, line and half-width of the band of the model in the units of the axes; residuals."""

    frequency: FloatArray
    values: tuple[FloatArray, FloatArray]
    stds: tuple[FloatArray, FloatArray]
    residuals: tuple[FloatArray, FloatArray]
    grid: FloatArray
    line: tuple[FloatArray, FloatArray]
    half: tuple[FloatArray, FloatArray]


def conditions_of(entry: ModelEntry, sheet: Sheet, file: ModelFile) -> list[Drawn]:
    """The conditions of a model; none if its tyre is in no table."""
    if entry.tyre not in sheet.names:
        return []
    tyre = sheet.names.index(entry.tyre)
    found = []
    for at, one in enumerate(entry.conditions):
        state = {each.column: each.value for each in one.state}
        others = tuple((column, value) for column, value in state.items() if column not in _STATED)
        pressure, load = (
            groups.nearest(state[column]) if column in state else len(groups) - 1
            for groups, column in zip((sheet.pressures, sheet.loads), _STATED, strict=True)
        )
        rows = _rows(one, state, sheet, file) & (sheet.tyre == tyre)
        drawn = Drawn(entry, at, tyre, pressure, load, others, rows)
        found += _by_level(drawn, sheet) if one.amplitude is not None else [drawn]
    return found


def _by_level(drawn: Drawn, sheet: Sheet) -> list[Drawn]:
    """A condition of a model that depends on the amplitude of the deflection, once for each level of it."""
    amplitude = amplitudes_of(sheet.table)
    rows = np.flatnonzero(drawn.rows & np.isfinite(amplitude) & (np.nan_to_num(amplitude) > 0))
    level, found = levels_of(amplitude[rows], _LEVEL), []
    for one in np.unique(level):
        here = np.zeros(amplitude.size, dtype=bool)
        here[rows[level == one]] = True
        middle = float(np.exp(np.mean(np.log(amplitude[here]))))
        found.append(
            replace(drawn, others=(*drawn.others, (COLUMN, float(f"{middle:.2g}"))), rows=here, amplitude=middle)
        )
    return found


def _rows(one: ConditionFile, state: dict[str, float], sheet: Sheet, file: ModelFile) -> BoolArray:
    """The rows that a condition was fitted to: by the names of tests, or, for tests without a name, by the state.

    If the model file does not have the points, those of a test with several points are those in the band fitted.
    """
    frequency = sheet.values(q.FREQUENCY.head)
    mask = (frequency >= one.band[0] * (1 - 1e-9)) & (frequency <= one.band[1] * (1 + 1e-9))
    if one.tests:
        if one.points:
            used = {*zip(one.tests, one.points, strict=True)}
            return np.array([key in used for key in keys_of(sheet.table)], dtype=bool)
        names = np.array(texts(sheet.table, q.TEST.head), dtype=object)
        points = Counter(names.tolist())
        single = np.array([points[name] == 1 for name in names], dtype=bool)
        return np.isin(names.astype(str), one.tests) & (single | (mask & ~sheet.rejected))
    for column, value in state.items():
        mask &= np.array([file.axis(column).same(own, value) for own in sheet.values(column).tolist()], dtype=bool)
    return np.asarray(mask)


def curves_of(one: Drawn, sheet: Sheet) -> Curves:
    """Points, line, band and residuals of a condition."""
    rows = np.flatnonzero(one.rows)
    frequency = sheet.values(q.FREQUENCY.head)
    rows = rows[np.argsort(frequency[rows], kind="stable")]
    frequency = frequency[rows]
    (real, real_std), (imag, imag_std) = (
        (value[rows], std[rows]) for value, std in (sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS))
    )
    low, high = one.band
    grid = np.geomspace(low, high, _GRID_WIDE) if high > DECADE * low else np.linspace(low, high, _GRID)
    moved = None if one.amplitude is None else np.full(grid.size, one.amplitude)
    line, line_covariance = response(one.entry, one.at, grid, moved)
    own = None if one.amplitude is None else amplitudes_of(sheet.table)[rows]
    predicted, covariance = response(one.entry, one.at, frequency, own)
    correlation = np.nan_to_num(sheet.values(q.CORR_K.head)[rows])
    off = np.stack([real - predicted.real / q.STORAGE.scale, imag - predicted.imag / q.STORAGE.scale], axis=1)
    residuals = whitened(off, covariance / q.STORAGE.scale**2 + _data_covariance(real_std, imag_std, correlation))
    half = NORMAL_95 / q.STORAGE.scale * np.sqrt(np.diagonal(line_covariance, axis1=1, axis2=2))
    return Curves(
        frequency=frequency,
        values=(real, imag),
        stds=(real_std, imag_std),
        residuals=(residuals[:, 0], residuals[:, 1]),
        grid=grid,
        line=(line.real / q.STORAGE.scale, line.imag / q.STORAGE.scale),
        half=(half[:, 0], half[:, 1]),
    )


def _data_covariance(first: FloatArray, second: FloatArray, correlation: FloatArray) -> FloatArray:
    """Covariance (N, 2, 2) of K' and K''; zero for uncertainties that are not stated."""
    a, b = np.nan_to_num(first), np.nan_to_num(second)
    cross = correlation * a * b
    return np.stack([np.stack([a**2, cross], -1), np.stack([cross, b**2], -1)], -2)


def whitened(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Pairs (N, 2) divided by the symmetric square root of their correlation: uncorrelated, in standard uncertainties.

    Examples
    --------
    >>> whitened(np.array([[2.0, 3.0]]), np.array([[[4.0, 0.0], [0.0, 9.0]]]))
    array([[1., 1.]])
    """
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        own = off / std
        rho = np.clip(covariance[:, 0, 1] / (std[:, 0] * std[:, 1]), -1 + 1e-9, 1 - 1e-9)
        both = (own[:, 0] + own[:, 1]) / np.sqrt(1 + rho)
        between = (own[:, 0] - own[:, 1]) / np.sqrt(1 - rho)
    return np.asarray(np.stack([both + between, both - between], axis=1) / 2)
