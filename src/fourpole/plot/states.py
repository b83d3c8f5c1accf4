"""The tested conditions as figures show them: their tests, their models and what these leave, and values of both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.condition import PRELOAD, PRESSURE, Axis
from fourpole.core.confidence import NORMAL_95
from fourpole.core.polar import polar
from fourpole.core.rig import Rig
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import COLUMN, amplitudes_of, levels_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile
from fourpole.fitting.query import response
from fourpole.fitting.rows import FoundBody, bodies_in, conditions_in, keys_of, rule_in
from fourpole.fitting.stated import rig_in
from fourpole.models.operating import Answer
from fourpole.models.realised import MASSLESS
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, Panel, Role, Series, kept, plain_text
from fourpole.plot.sheet import Sheet, read_sheet, texts
from fourpole.quantities import Quantity, ShownUnits
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
    return kept(results, key, lambda: _whitened_residuals(read_sheet(results, texts_only=True), fitted))


def _whitened_residuals(sheet: Sheet, fitted: Drawn) -> tuple[IntArray, FloatArray, FloatArray]:
    rows, frequency = np.flatnonzero(fitted.rows), sheet.values(q.FREQUENCY.head)
    rows = rows[np.argsort(frequency[rows], kind="stable")]
    amplitude = None if fitted.amplitude is None else amplitudes_of(sheet.table)[rows]
    predicted, covariance = response(fitted.entry, fitted.at, frequency[rows], amplitude)
    (real, u_real), (imag, u_imag) = (sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS))
    off = np.stack([real[rows], imag[rows]], axis=1) - np.stack([predicted.real, predicted.imag], 1) / _SCALE
    measured = _data_covariance(u_real[rows], u_imag[rows], np.nan_to_num(sheet.values(q.CORR_K.head)[rows]))
    return rows, frequency[rows], whitened(off, covariance / _SCALE**2 + measured)


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


#: Number of points of a model's curve.
_GRID = 181


@dataclass(frozen=True, eq=False)
class State(ByValue):
    """One condition of a specimen, at one level of the deflection if its model depends on it.

    Attributes
    ----------
    tyre, pressure, load : int
        Numbers of the groups in the sheet.
    place : mapping of str to float
        Values by the columns of the axes, in SI; not-a-number where not stated. Values that are the same are equal.
    rows : bool array
        The tests of the condition, rejected ones included.
    model : Drawn or None
        The condition of the model that was fitted to these tests.
    """

    tyre: int
    pressure: int
    load: int
    place: Mapping[str, float]
    rows: BoolArray
    model: Drawn | None = None

    def on(self, column: str) -> float:
        """Value on an axis in SI; not-a-number where it is not stated."""
        return self.place.get(column, np.nan)


def body_of(results: Study, state: State) -> FoundBody | None:
    """The mass that was found of the specimen at this condition."""
    tyre = str(results.dynamic[q.TYRE.head][int(np.flatnonzero(state.rows)[0])])
    return next((body for body in bodies_in(results.tables) if body.is_at(tyre, state.place)), None)


def tested(results: Study, tests: BoolArray) -> list[State]:
    """The conditions that have some of these tests."""
    return [state for state in states(results) if np.any(tests & state.rows)]


def by_tyre(conditions: Iterable[State]) -> dict[int, list[State]]:
    """The conditions of each specimen by its number, rising."""
    groups: dict[int, list[State]] = {}
    for state in sorted(conditions, key=lambda state: state.tyre):
        groups.setdefault(state.tyre, []).append(state)
    return groups


def states(results: Study) -> list[State]:
    """All conditions of the dynamic tests, by specimen, pressure and preload; made once for some results."""
    return kept(results, "states", lambda: _states(results, read_sheet(results, texts_only=True)))


def _states(results: Study, sheet: Sheet) -> list[State]:
    if not sheet.tyre.size:
        return []
    rule = rule_in(results.record)
    further = [axis for axis in rule.axes if not axis.text and axis not in (PRESSURE, PRELOAD)]
    groups = rule.groups(conditions_in(sheet.table, rule))
    firsts = {int(group): np.flatnonzero(groups == group) for group in np.unique(groups)}
    places = {
        axis.column: _same([sheet.values(axis.column)[rows] for rows in firsts.values()], axis) for axis in further
    }
    fitted = _fitted(results.models, sheet, groups)
    made = []
    for at, (group, rows) in enumerate(firsts.items()):
        tyre, pressure, load = (int(each[rows[0]]) for each in (sheet.tyre, sheet.pressure, sheet.load))
        place = {
            PRESSURE.column: sheet.pressures.values[pressure],
            PRELOAD.column: sheet.loads.values[load],
            **{column: values[at] for column, values in places.items()},
        }
        made += _by_model(State(tyre, pressure, load, place, groups == group), fitted.get(group, []))
    return sorted(made, key=lambda one: (one.tyre, *np.nan_to_num(list(one.place.values()), nan=np.inf)))


def _same(values: Sequence[FloatArray], axis: Axis) -> list[float]:
    """The value of each condition on an axis; values that are the same are replaced by their median."""
    groups, middles = axis.middles(np.array([_middle(one) for one in values]))
    return [middles[group] for group in groups.tolist()]


def _middle(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def _fitted(file: ModelFile | None, sheet: Sheet, groups: np.ndarray) -> dict[int, list[Drawn]]:
    """The conditions of the models by the group that most of their tests are in."""
    found: dict[int, list[Drawn]] = {}
    if file is None:
        return found
    for entry in file.models:
        for one in conditions_of(entry, sheet, file):
            own = groups[one.rows]
            if own.size:
                found.setdefault(int(np.bincount(own).argmax()), []).append(one)
    return found


def _by_model(state: State, fitted: Sequence[Drawn]) -> list[State]:
    """The condition with its model; once for each amplitude where the model depends on the amplitude."""
    if not fitted or fitted[0].amplitude is None:
        return [replace(state, model=fitted[0] if fitted else None)]
    parts = [
        replace(state, place={**state.place, COLUMN: dict(one.others)[COLUMN]}, rows=one.rows & state.rows, model=one)
        for one in fitted
    ]
    rest = state.rows & ~np.any([one.rows for one in parts], axis=0)
    return [*parts, replace(state, rows=rest)] if rest.any() else parts


def differing(found: Sequence[State]) -> list[str]:
    """The columns of the axes in which some conditions differ, that with the most values first."""
    counts = {column: len(values_on(found, column)) for column in dict.fromkeys(c for one in found for c in one.place)}
    return sorted((column for column, count in counts.items() if count > 1), key=lambda column: -counts[column])


def values_on(found: Sequence[State], column: str) -> list[float]:
    """The distinct values of some conditions on an axis, rising; not-a-number last."""
    values = {state.on(column) for state in found}
    known = sorted(value for value in values if not np.isnan(value))
    return [*known, *([np.nan] if len(known) < len({str(value) for value in values}) else [])]


def axis_shown(column: str, units: ShownUnits) -> tuple[str, str, float]:
    """Name and unit of an axis as shown, and the SI value of the unit.

    Examples
    --------
    >>> axis_shown("pressure [Pa]", ShownUnits()), axis_shown("camber [deg]", ShownUnits())
    (('pressure', 'bar', 100000.0), ('camber', 'deg', 1.0))
    """
    name, _, si = column.removesuffix("]").partition(" [")
    unit, scale = units.unit(si)
    return plain_text(name), plain_text(unit or "1"), scale


def place_text(results: Study, column: str, value: float) -> str:
    """A value on an axis with its unit; the name stands before it where the unit does not say what it is."""
    if np.isnan(value):
        return f"{axis_shown(column, results.shown)[0]} not stated"
    sheet = read_sheet(results, texts_only=True)
    for groups, quantity in ((sheet.pressures, q.PRESSURE), (sheet.loads, q.PRELOAD)):
        if quantity.head == column and quantity.unit not in results.shown.wanted and value in groups.values:
            return groups.labels[groups.values.index(value)]
    return plain_text(results.shown.setting(column, value), 40)


def stated_text(results: Study, place: Mapping[str, float]) -> str:
    """The values on some axes that are stated."""
    stated = ((column, value) for column, value in place.items() if not np.isnan(value))
    return ", ".join(place_text(results, column, value) for column, value in stated)


@dataclass(frozen=True, eq=False)
class ModelCurve(ByValue):
    """K* of the model of a condition over its band: frequencies [Hz], K* [N/m] and the covariance of Re, Im."""

    frequency: FloatArray
    stiffness: ComplexArray
    covariance: FloatArray


def model_curve(results: Study, state: State) -> ModelCurve | None:
    """K* of a condition's model at frequencies dense enough for a curve; None without a model of several."""
    one = state.model
    if one is None or one.band[1] <= one.band[0]:
        return None
    low, high = one.band
    grid = np.geomspace(low, high, _GRID) if high > DECADE * low else np.linspace(low, high, _GRID)
    moved = None if one.amplitude is None else np.full(grid.size, one.amplitude)
    key = ("curve", one.entry.tyre, one.at, one.amplitude)
    return kept(results, key, lambda: ModelCurve(grid, *response(one.entry, one.at, grid, moved)))


def curve_of(results: Study, state: State, quantity: Quantity) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Frequencies [Hz], values and half-widths of the 95 % band of the model's curve, in the unit of the axis.

    K2 and C follow from K* of the model and K1 of the tests; TR follows from K* and the rig, whose uncertainty is in
    the band. None where the model or what else is needed is not known.
    """
    found = model_curve(results, state)
    if found is None:
        return None
    k, covariance = found.stiffness, found.covariance
    if quantity in (q.K2, q.C):
        made = _arm(results, state, found, quantity)
    elif quantity in (q.TR_MEASURED, q.TR_PREDICTED):
        made = _transmissibility(results, state, found)
    elif quantity not in (q.MODULUS, q.LOSS_ANGLE, q.STORAGE, q.LOSS):
        return None
    else:
        value, by = part_of(quantity, k)
        made = value, np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", by, covariance, by), 0.0))
    if made is None or not np.any(np.isfinite(made[0])):
        return None
    return found.frequency, made[0] / quantity.scale, NORMAL_95 * made[1] / quantity.scale


def part_of(quantity: Quantity, k: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """A part of K* (N,) and its derivatives (N, 2) by Re and Im."""
    if quantity in (q.MODULUS, q.LOSS_ANGLE):
        values, slopes = polar(k)
        at = 0 if quantity is q.MODULUS else 1
        return values[:, at], slopes[:, at]
    one, zero = np.ones(k.size), np.zeros(k.size)
    if quantity is q.STORAGE:
        return k.real, np.stack([one, zero], axis=1)
    return k.imag, np.stack([zero, one], axis=1)


def _answer(found: ModelCurve, k1: float, k1_std: float) -> Answer:
    covariance = np.zeros((found.frequency.size, 3, 3))
    covariance[:, :2, :2], covariance[:, 2, 2] = found.covariance, k1_std**2
    level = np.full(found.frequency.size, k1)
    return Answer.of(found.stiffness, level, covariance, 2 * np.pi * found.frequency)


def _arm(results: Study, state: State, found: ModelCurve, quantity: Quantity) -> tuple[FloatArray, FloatArray] | None:
    sheet = read_sheet(results, texts_only=True)
    k1, std = (_middle(sheet.values(head)[state.rows & ~sheet.rejected]) for head in q.K1.heads)
    if not np.isfinite(k1):
        return None
    answer = _answer(found, k1, float(np.nan_to_num(std)))
    at = 0 if quantity is q.K2 else 1
    return (answer.k2, answer.c)[at], np.sqrt(answer.arm_covariance[:, at, at])


def _transmissibility(results: Study, state: State, found: ModelCurve) -> tuple[FloatArray, FloatArray] | None:
    rig = model_rig(results)
    if rig is None or rig.blocked:
        return None
    assert state.model is not None
    inertia = state.model.entry.conditions[state.model.at].inertia
    specimen = MASSLESS if inertia is None else inertia.specimen
    return _answer(found, 0.0, 0.0).transmissibility(rig, found.frequency, specimen)


def model_rig(results: Study) -> Rig | None:
    """The rig with which TR of a model is computed; None for several rigs, or where none is known."""
    try:
        return rig_in(results.models.rig) if results.models is not None else None
    except ModelError:
        return None


def values_of(sheet: Sheet, quantity: Quantity) -> tuple[FloatArray, FloatArray]:
    """Values and standard uncertainties of all tests in the unit of the axis, also of |K*| and the loss angle."""
    if quantity not in (q.MODULUS, q.LOSS_ANGLE):
        return sheet.shown(quantity)
    (real, u_real), (imag, u_imag) = ((sheet.values(one.head), sheet.values(one.u_head)) for one in (q.STORAGE, q.LOSS))
    cross = np.nan_to_num(sheet.values(q.CORR_K.head)) * u_real * u_imag
    with np.errstate(divide="ignore", invalid="ignore"):
        value, by = part_of(quantity, real + 1j * imag)
        variance = (by[:, 0] * u_real) ** 2 + (by[:, 1] * u_imag) ** 2 + 2 * by[:, 0] * by[:, 1] * cross
    return value / quantity.scale, np.sqrt(np.maximum(variance, 0.0)) / quantity.scale
