"""The conditions of a model file as figures show them: their tests, and what the model leaves of these."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, FloatArray, IntArray
from fourpole.fitting.amplitude import COLUMN, amplitudes_of, levels_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile
from fourpole.fitting.query import response
from fourpole.fitting.rows import keys_of
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, Panel, Role, Series
from fourpole.plot.names import plain_text
from fourpole.plot.sheet import Sheet, read_sheet, texts
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: Amplitudes of the deflection within this ratio are one series.
_LEVEL = 1.3
#: Ratio of the ends of the axis of frequency beyond which it is logarithmic.
DECADE = 10.0
#: Residuals of K' and K'', in this order.
RESIDUALS = tuple(Quantity("", "", f"residual {part.name}", "1") for part in (q.STORAGE, q.LOSS))
#: Bound that about 95 % of residuals lie within [standard uncertainties].
_USUAL = 2.0
#: The unit in which the residuals are computed [N/m].
_SCALE = q.STORAGE.scale
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
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency fitted [Hz]."""
        return self.entry.conditions[self.at].band


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


def residual_points(results: Study, fitted: Drawn, which: Quantity, like: Series) -> Series:
    """The residuals of K' or K'' of the tests of a condition by rising frequency, with the look of another series."""
    rows, frequency, residuals = _residuals(results, fitted)
    own = residuals[:, RESIDUALS.index(which)]
    known = np.isfinite(own)
    points = Series(
        Role.POINTS, frequency[known], own[known], tyre=like.tyre, shade=like.shade, marker=like.marker,
        level=like.level,
    )  # fmt: skip
    return linked(results, points, rows[known])


def residual_panel(which: Quantity, series: Sequence[Series], *, log: bool) -> Panel:
    """A panel of residuals with lines at zero and at the bounds that about 95 % lie within."""
    every = np.concatenate([points.x for points in series]) if series else np.array([1.0, 2.0])
    ends = np.array([every.min(), every.max()])
    lines = [
        Series(Role.LINE, ends, np.full(2, level), dash=0 if level == 0 else 1) for level in (0.0, -_USUAL, _USUAL)
    ]
    return Panel(AxisData.of(q.FREQUENCY, log=log), AxisData.of(which), (*lines, *series))


def residuals_said(results: Study, conditions: Sequence[Drawn]) -> list[str]:
    """How many residuals of some conditions are beyond the usual bounds."""
    every = [_residuals(results, fitted)[2] for fitted in conditions]
    residuals = np.concatenate([np.zeros((0, 2)), *every])
    residuals = residuals[np.isfinite(residuals)]
    if not residuals.size:
        return []
    outside = int(np.sum(np.abs(residuals) > _USUAL))
    said = "residuals are in standard uncertainties of measurement and model together"
    return [f"{said}; {outside} of {residuals.size} are beyond ±{_USUAL:g}"]


def _residuals(results: Study, fitted: Drawn) -> tuple[IntArray, FloatArray, FloatArray]:
    """Rows of the tests of a condition by rising frequency, frequencies [Hz], and what the model leaves of K' and K''.

    The residuals (N, 2) are in standard uncertainties; they are made once for some results.
    """
    key = ("residuals", fitted.entry.tyre, fitted.at, fitted.amplitude)
    if key not in results.derived:
        sheet, rows = read_sheet(results, texts_only=True), np.flatnonzero(fitted.rows)
        frequency = sheet.values(q.FREQUENCY.head)
        rows = rows[np.argsort(frequency[rows], kind="stable")]
        amplitude = None if fitted.amplitude is None else amplitudes_of(sheet.table)[rows]
        predicted, covariance = response(fitted.entry, fitted.at, frequency[rows], amplitude)
        (real, u_real), (imag, u_imag) = (sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS))
        off = np.stack([real[rows], imag[rows]], axis=1) - np.stack([predicted.real, predicted.imag], 1) / _SCALE
        measured = _data_covariance(u_real[rows], u_imag[rows], np.nan_to_num(sheet.values(q.CORR_K.head)[rows]))
        residuals = whitened(off, covariance / _SCALE**2 + measured)
        results.derived[key] = (rows, frequency[rows], residuals)
    made: tuple[IntArray, FloatArray, FloatArray] = results.derived[key]
    return made


def _data_covariance(first: FloatArray, second: FloatArray, correlation: FloatArray) -> FloatArray:
    """Covariance (N, 2, 2) of K' and K''; zero for uncertainties that are not stated."""
    a, b = np.nan_to_num(first), np.nan_to_num(second)
    cross = correlation * a * b
    return np.stack([np.stack([a**2, cross], -1), np.stack([cross, b**2], -1)], -2)


def whitened(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Pairs (N, 2) divided by the symmetric square root of their correlation: uncorrelated, in standard uncertainties.

    Examples
    --------
    >>> whitened(np.array([[2.0, 3.0]]), np.array([[[4.0, 0.0], [0.0, 9.0]]])).tolist()
    [[1.0, 1.0]]
    """
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        own = off / std
        rho = np.clip(covariance[:, 0, 1] / (std[:, 0] * std[:, 1]), -1 + 1e-9, 1 - 1e-9)
        both = (own[:, 0] + own[:, 1]) / np.sqrt(1 + rho)
        between = (own[:, 0] - own[:, 1]) / np.sqrt(1 - rho)
    return np.asarray(np.stack([both + between, both - between], axis=1) / 2)


def models_said(results: Study, sheet: Sheet, tyres: Sequence[int]) -> list[str]:
    """The models of some specimens, each with its model discrepancy."""
    entries = {one.tyre: one for one in (results.models.models if results.models is not None else ())}
    parts = {}
    for tyre in tyres:
        if (entry := entries.get(sheet.names[tyre])) is not None:
            more = f" (model discrepancy {100 * entry.discrepancy:.2g} %)" if entry.discrepancy > 0 else ""
            parts[tyre] = f"{plain_text(entry.model)}{more}"
    if len(set(parts.values())) == 1:
        return [f"model: {next(iter(parts.values()))}"]
    return ["models: " + ", ".join(f"{text} of {sheet.labels[tyre]}" for tyre, text in parts.items())]


def title_of(results: Study, sheet: Sheet, tyre: int) -> str:
    """The name of a specimen, or that of the model of a table without names."""
    if sheet.names[tyre] or results.models is None:
        return sheet.labels[tyre]
    return next((one.model for one in results.models.models if not one.tyre), sheet.labels[tyre])
