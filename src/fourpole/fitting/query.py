"""Queries of a model file: K*, K2, C and TR at an operating point and a frequency, with their uncertainties.

A query outside the tested conditions or frequencies is refused. With `beyond` it is answered, with the distance from
them in a column and in the remarks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray, parts
from fourpole.core.condition import AMPLITUDE, AXES, Axis
from fourpole.core.confidence import NORMAL_95
from fourpole.core.polar import polar
from fourpole.core.rig import Rig
from fourpole.core.specimen import Specimen
from fourpole.errors import ModelError
from fourpole.fitting.accuracy import POOR, accuracy_of
from fourpole.fitting.byamplitude import (
    answer_at,
    around,
    depends_on_amplitude,
    in_own_unit,
    levels_of_map,
    outside_levels,
)
from fourpole.fitting.inertia import InertiaFile, mean_inertia
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile, map_of, map_of_condition, model_of
from fourpole.fitting.ranges import IN_RANGE, wider
from fourpole.fitting.rows import tyre_columns
from fourpole.fitting.stated import rig_in
from fourpole.fitting.temperature import Shift
from fourpole.models.families import has_inertia
from fourpole.models.ladder import Rung
from fourpole.models.operating import Answer, OperatingMap, Purpose
from fourpole.models.realised import MASSLESS
from fourpole.models.surface import Axes
from fourpole.quantities import ShownUnits
from fourpole.units import shown

_TEMPERATURE = q.TEMPERATURE.head
#: Absolute zero [°C], where the Arrhenius law ends.
_ABSOLUTE_ZERO = -273.15
#: A temperature this far [K] outside the isotherms, whose temperatures are measured ones, counts as inside.
_NOMINAL = 1.0
#: What the uncertainty is for, as a word of `--for` and as a sentence.
PURPOSE, INTERVAL = "interval for", "interval"
#: Column of the frequency on the master curve.
_REDUCED = "reduced frequency [Hz]"
#: Option of `fourpole query` that states an axis, by the column of the axis.
_OPTIONS = {axis.column: axis.name for axis in (*AXES, AMPLITUDE)}


@dataclass(frozen=True)
class Query:
    """A query of a model file.

    Attributes
    ----------
    frequency : sequence of float [Hz]
    state : mapping of str to float
        Values on the axes, by column: {"pressure [Pa]": 1.85e5}.
    tyre : str, optional
        Needed if the file has several tyres.
    rig : Rig, optional
        Rig for TR; by default that of the tests.
    beyond : bool
        Whether to answer outside the tested conditions and frequencies.
    units : ShownUnits
        Units of the remarks and errors.
    purpose : Purpose, optional
        What the intervals are for: by default the next mounting of such a specimen, or of fits at single conditions,
        which do not know the scatter between mountings, the specimen as it was tested.
    """

    frequency: Sequence[float]
    state: Mapping[str, float] = field(default_factory=dict)
    tyre: str | None = None
    rig: Rig | None = None
    beyond: bool = False
    units: ShownUnits = field(default_factory=ShownUnits)
    purpose: Purpose | None = None


def ask(file: ModelFile, query: Query) -> list[dict[str, Any]]:
    """The answer, one row per frequency, values by column with unit; None replaces not-a-number.

    Raises
    ------
    ModelError
        If the file does not have the tyre, the query does not state an axis, or a condition or a frequency is outside
        the tests.
    """
    tyre = _tyre_of(file, query.tyre)
    shift = _shift_of(file, tyre, query)
    state = dict(query.state) if shift is None else {**query.state, _TEMPERATURE: shift.reference}
    amplitude = state.pop(AMPLITUDE.column, None) if depends_on_amplitude(file, tyre) else None
    state = in_own_unit(file, tyre, state)
    found = maps_of(file, tyre, state, query.units)
    point, outside, remarks = place_of(file, found, state, query.units, beyond=query.beyond)
    purpose = _purpose_of(file, tyre, found, point, query)
    levels: list[float] = []
    if depends_on_amplitude(file, tyre):
        levels = levels_of_map(file, tyre, found)
        remarks = (*remarks, *outside_levels(levels, amplitude, beyond=query.beyond))
    frequency = np.asarray(query.frequency, dtype=float)
    reduced = frequency if shift is None else frequency * shift.shift.factor
    far = _beyond_band(found, reduced, beyond=query.beyond)
    points = np.repeat(point[None], frequency.size, axis=0)
    if amplitude is not None:
        answer = answer_at(found, points, frequency, amplitude, levels, purpose)
    else:
        answer = (
            found.ask(points, frequency, purpose) if shift is None else shift.shift.answer(found, points, frequency)
        )
    condition = file.condition_at(tyre, found.axes.constant)
    entry = file.map_entry(tyre) or file.model_entry(tyre)
    given, held = None if entry is None else entry.put_back, interval_words(purpose)
    remarks = (*remarks, *_misfit(file, tyre, condition), *_taken_off(file, tyre, condition))
    if given is not None and given.low:
        remarks = (*remarks, given.sentence)
    elif given is not None:
        held = f"{held} {given.sentence}"
    if condition is not None and (far.any() or (condition.rest is not None and shift is None)):
        answer = _wider(answer, condition, reduced, frequency)
    inertia = inertia_of(file, tyre, condition)
    specimen = MASSLESS if inertia is None else inertia.specimen
    columns = _columns(answer, query.rig or rig_in(file.rig), frequency, specimen)
    apart, moved = (outside, ()) if shift is None else (max(outside, shift.outside), shift.remarks)
    place = found.axes.constant | dict(zip(found.axes.names, point.tolist(), strict=True))
    place |= {} if amplitude is None else {AMPLITUDE.column: amplitude}
    rows = []
    for at in range(frequency.size):
        row: dict[str, Any] = {"tyre": tyre, **place}
        row |= {q.FREQUENCY.head: float(frequency[at])}
        row |= {} if shift is None else {_TEMPERATURE: shift.temperature, _REDUCED: float(reduced[at])}
        row |= {head: float(one[at]) for head, one in columns.items()}
        beyond = _remarks_beyond(found, condition, float(far[at]), float(reduced[at]))
        row |= {
            PURPOSE: purpose,
            INTERVAL: held,
            q.OUTSIDE.head: apart,
            "remarks": "; ".join([*remarks, *moved, *beyond]),
        }
        rows.append(_finite(row))
    return rows


def _purpose_of(file: ModelFile, tyre: str, found: OperatingMap, point: FloatArray, query: Query) -> Purpose:
    """What the intervals are for, checked."""
    if file.map_entry(tyre) is None:
        if query.purpose not in (None, "specimen"):
            raise ModelError(
                "fits at single conditions do not know the scatter between mountings: their intervals are for the "
                "specimen as it was tested. Make a map of the results with fourpole map, or state --for specimen"
            )
        return "specimen"
    if query.purpose == "specimen" and (found.offsets is None or found.axes.tested(point) is None):
        why = "the map has no errors of its conditions" if found.offsets is None else "nothing was tested at this point"
        raise ModelError(
            f"--for specimen: {why}, and the specimen as it was mounted is known at its tested conditions only: state "
            "one of them, make the map again if it is of an earlier version, or state --for next or --for mean"
        )
    return query.purpose or "next"


def interval_words(purpose: Purpose) -> str:
    """What an interval is for, as a sentence."""
    said = {
        "mean": "the mean surface of such specimens: coefficients and errors that all tests share, without the scatter "
        "between mountings",
        "next": "the next mounting of such a specimen: the mean surface and the scatter between mountings",
        "specimen": "the specimen as it was mounted in the test at this condition",
    }
    return f"Intervals are for {said[purpose]}."


def _wider(answer: Answer, condition: ConditionFile, reduced: FloatArray, frequency: FloatArray) -> Answer:
    """An answer whose intervals reach the ends of the range of K* beyond the band and of K1, if the file has them."""
    ranges = [*(condition.static.passive if condition.static is not None else []), *condition.ranges]
    covariance = wider(ranges, condition.band, reduced, answer.stiffness, answer.covariance)
    if condition.rest is not None and reduced is frequency:
        far = np.max(np.abs(np.subtract.outer(answer.k1, condition.rest)), axis=1) / NORMAL_95
        was = covariance[:, 2, 2].copy()
        wide = np.maximum(was, far**2)
        factor = np.sqrt(np.divide(wide, was, out=np.ones(was.size), where=was > 0))
        covariance[:, 2, :] *= factor[:, None]
        covariance[:, :, 2] *= factor[:, None]
        covariance[:, 2, 2] = wide
    return Answer.of(answer.stiffness, answer.k1, covariance, 2 * np.pi * frequency)


def inertia_of(file: ModelFile, name: str, fitted: ConditionFile | None) -> InertiaFile | None:
    """The inertia of a specimen: that of the condition, or else the mean of all conditions."""
    mapped, entry = file.map_entry(name), file.model_entry(name)
    if fitted is None and entry is not None:
        return mean_inertia([one.inertia for one in entry.conditions])
    one = fitted or mapped
    return None if one is None else one.inertia


def _columns(answer: Answer, rig: Rig | None, frequency: FloatArray, specimen: Specimen) -> dict[str, FloatArray]:
    """Values (Q,) of an answer by column, with TR on a rig, which is not-a-number without one."""
    tr = np.full((2, frequency.size), np.nan) if rig is None else answer.transmissibility(rig, frequency, specimen)
    return {**tyre_columns(answer), **dict(zip(q.TR.heads, tr, strict=True))}


def _remarks_beyond(found: OperatingMap, fitted: ConditionFile | None, far: float, frequency: float) -> list[str]:
    """Remarks on a frequency that is so many octaves outside the band."""
    if not far:
        return []
    said = [f"{far:.3g} octaves outside the measured band"]
    if fitted is not None and fitted.static is not None and frequency < found.band[0]:
        return [*said, fitted.static.remark(frequency)]
    return [*said, IN_RANGE] if fitted is not None and fitted.ranges else said


def polar_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, FloatArray]:
    """Modulus of K* and loss angle (N,) of the rows of an answer, with their standard uncertainties, by column."""
    heads = (*q.STORAGE.heads, *q.LOSS.heads, q.CORR_K.head)
    real, u_real, imag, u_imag, cross = (np.array([one[head] for one in rows], dtype=float) for head in heads)
    values, slopes = polar(real + 1j * imag)
    cross = np.nan_to_num(cross) * u_real * u_imag
    covariance = np.stack([np.stack([u_real**2, cross], -1), np.stack([cross, u_imag**2], -1)], -2)
    stds = np.sqrt(np.maximum(np.einsum("nij,njk,nik->ni", slopes, covariance, slopes), 0.0))
    found: dict[str, FloatArray] = {}
    for at, one in enumerate((q.MODULUS, q.LOSS_ANGLE)):
        found |= dict(zip(one.heads, (values[:, at], stds[:, at]), strict=True))
    return found


@dataclass(frozen=True)
class _Shift:
    """The shift of a model to the temperature of a query, `outside` so many half spans beyond the isotherms."""

    reference: float
    temperature: float
    outside: float
    remarks: tuple[str, ...]
    shift: Shift


def _shift_of(file: ModelFile, tyre: str, query: Query) -> _Shift | None:
    """The shift to the stated temperature; None without shift factors in the model, or without a temperature."""
    entry, temperature = file.model_entry(tyre), query.state.get(_TEMPERATURE)
    law = None if entry is None else entry.temperature
    if law is not None and law.shifts is not None and temperature is None:
        temperature = law.reference
    if law is None or temperature is None:
        return None
    low, high = law.range
    off = max(low - temperature, temperature - high)
    outside = 0.0 if off <= _NOMINAL else off / max(0.5 * (high - low), 1e-9)
    remarks = []
    if outside:
        remark = (
            f"{temperature:.5g} degC is outside the isotherms, by {outside:.3g} half spans; they go from {low:.5g} to "
            f"{high:.5g} degC"
        )
        if not query.beyond:
            raise ModelError(f"{remark}: state a temperature inside, measure there, or state --beyond")
        remarks.append(remark)
    values = [one.value for one in law.constants]
    ends = law.reference - values[1] if law.law == "WLF" else _ABSOLUTE_ZERO
    if temperature <= ends:
        raise ModelError(f"the {law.law} law ends at {ends:.4g} °C: it has no value at {temperature:.5g} °C")
    shift = law.at(temperature)
    return _Shift(law.reference, temperature, outside, (*remarks, *shift.remarks), shift)


def maps_of(file: ModelFile, tyre: str, state: Mapping[str, float], units: ShownUnits) -> OperatingMap:
    """The map of a tyre, or else its model at the condition that `state` names, as a map of one point."""
    mapped = file.map_entry(tyre)
    return _condition(file, tyre, state, units) if mapped is None else map_of(mapped)


def _tyre_of(file: ModelFile, name: str | None) -> str:
    """The tyre of a query, checked; without a name the only tyre of the file."""
    tyres = file.tyres
    if name is None:
        if len(tyres) != 1:
            raise ModelError(
                f"the file has {len(tyres)} specimens: state --specimen, one of {', '.join(map(shown, tyres))}"
            )
        return tyres[0]
    if name not in tyres:
        raise ModelError(f"the file is of {', '.join(map(shown, tyres)) or 'no specimen'}, not of {shown(name)}")
    return name


def _condition(file: ModelFile, tyre: str, state: Mapping[str, float], units: ShownUnits) -> OperatingMap:
    """The model at the one condition that `state` names, as a map of one point."""
    entry = file.model_entry(tyre)
    assert entry is not None
    axes = {column: file.axis(column) for column in state}
    good = [one for one in entry.conditions if _is_at(axes, one, state)]
    if len(good) != 1:
        there = "; ".join(sorted({_words(one.coordinates, units) for one in entry.conditions})[:12])
        what = "no condition is" if not good else f"{len(good)} conditions are"
        raise ModelError(
            f"{what} the same as the stated one: the file has fits at {there}. State one of these or make a map of "
            "the results with fourpole map"
        )
    return map_of_condition(entry, good[0])


def _is_at(axes: Mapping[str, Axis], one: ConditionFile, state: Mapping[str, float]) -> bool:
    """Whether a condition has the values of `state` within the tolerances of the axes."""
    own = one.coordinates
    return all(column in own and axes[column].same(value, own[column]) for column, value in state.items())


def _misfit(file: ModelFile, tyre: str, condition: ConditionFile | None) -> tuple[str, ...]:
    """A remark if the model is off by more than a limit."""
    entry = file.map_entry(tyre) or file.model_entry(tyre)
    accuracy = None if entry is None else accuracy_of(entry, condition)
    return () if accuracy is None or accuracy.discrepancy < POOR else (accuracy.misfit,)


def _taken_off(file: ModelFile, tyre: str, condition: ConditionFile | None) -> tuple[str, ...]:
    """A remark if K* as measured had a mass or a belt that the fit took off, so that K* of the answer is another."""
    entry, verdict = file.model_entry(tyre), None if condition is None else condition.verdict
    if condition is None or verdict is None or entry is None or has_inertia(entry.model):
        return ()
    if verdict.mass and verdict.holds == Rung.MASS:
        return (f"K* is without the mass of {verdict.mass:.3g} kg at the driven end that K* as measured has",)
    if condition.inertia is not None and verdict.holds == Rung.RESONANT:
        return ("K* is that of the springs, without the belt that K* as measured has",)
    return ()


def place_of(
    file: ModelFile, found: OperatingMap, state: Mapping[str, float], units: ShownUnits, *, beyond: bool | None
) -> tuple[FloatArray, float, tuple[str, ...]]:
    """The point (d,) of a state, its distance [half spans] from the tested conditions, and remarks on it.

    A point outside needs `beyond`; None says that the command has no such option.
    """
    axes = found.axes
    for column, value in state.items():
        if column in axes.names:
            continue
        known = axes.constant.get(column)
        over = ", ".join(_name(one) for one in axes.names) or "no axis"
        if known is None:
            how = "; make one with --model kraus or --over amplitude" if column == AMPLITUDE.column else ""
            raise ModelError(f"the tests do not state {_name(column)}: the map is over {over} and frequency{how}")
        if not file.axis(column).same(value, known):
            had, wanted = (_value(column, number, units) for number in (known, value))
            raise ModelError(
                f"all tests had the {_name(column)} {had}, not {wanted}: the map is over {over} and frequency"
            )
    _check_stated(axes, state, units)
    point = np.array([state[column] for column in axes.names], dtype=float)
    outside, nearest = axes.outside(point)
    if not outside:
        return point, 0.0, ()
    near, stated = (_words(dict(zip(axes.names, one.tolist(), strict=True)), units) for one in (nearest, point))
    remark = f"{stated} is outside what was measured, by {outside:.3g} half spans; the nearest point inside is {near}"
    if not beyond:
        further = " or measure there" if beyond is None else ", measure there, or state --beyond"
        raise ModelError(f"{remark}: state that point{further}")
    return point, outside, (remark,)


def _check_stated(axes: Axes, state: Mapping[str, float], units: ShownUnits) -> None:
    """ModelError if the state lacks an axis of the map."""
    lacking = [column for column in axes.names if column not in state]
    if lacking:
        at = axes.names.index(lacking[0])
        low, high = float(axes.points[:, at].min()), float(axes.points[:, at].max())
        option = _OPTIONS.get(lacking[0])
        how = f"--{option}" if option else f'--at "{lacking[0]} = ..."'
        raise ModelError(
            f"state {how}: the map is over {_name(lacking[0])} from {_value(lacking[0], low, units)} to "
            f"{_value(lacking[0], high, units)}"
        )


def _beyond_band(found: OperatingMap, frequency: FloatArray, *, beyond: bool) -> FloatArray:
    """Distance of each frequency from the band in octaves; ModelError if one is outside and `beyond` is not set."""
    if not (np.all(np.isfinite(frequency)) and np.all(frequency > 0)):
        raise ModelError("the frequency must be positive [Hz]")
    far = found.octaves_beyond(frequency)
    if far.any() and not beyond:
        low, high = found.band
        worst = float(frequency[int(np.argmax(far))])
        raise ModelError(
            f"{worst:.6g} Hz is outside the measured band, {low:.4g} to {high:.4g} Hz: state a frequency inside it, or "
            "--beyond"
        )
    return far


def _finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None in place of not-a-number."""
    return {name: None if isinstance(one, float) and not np.isfinite(one) else one for name, one in row.items()}


def _name(column: str) -> str:
    return _OPTIONS.get(column) or shown(column)


def _value(column: str, value: float, units: ShownUnits) -> str:
    """A value with its unit, without the name of its axis."""
    return units.setting(column, value).removeprefix(f"{column.partition(' [')[0]} ")


def _words(state: Mapping[str, float], units: ShownUnits) -> str:
    return ", ".join(units.setting(column, value) for column, value in state.items()) or "one condition"


def response(
    entry: ModelEntry, at: int, frequency: FloatArray, amplitude: FloatArray | None = None
) -> tuple[ComplexArray, FloatArray]:
    """K* (N,) of one condition's parameters at frequencies (N,) [Hz], and its covariance (N, 2, 2), Re and Im.

    A model whose K* depends on the amplitude of the deflection needs amplitudes (N,) [m]. The model discrepancy and the
    uncertainty of the law between the tested amplitudes are part of the covariance.
    """
    model, one = model_of(entry), entry.conditions[at]
    model = model if amplitude is None else model.at_amplitude(amplitude)
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    stiffness = model.stiffness(one.values, omega)
    slopes = model.derivative(one.values, omega)
    rows = parts(slopes, axis=1)
    covariance = rows @ np.array(one.covariance) @ np.swapaxes(rows, 1, 2)
    if amplitude is not None and one.amplitude is not None:
        share, *ends = around(amplitude, one.amplitude)
        below, above = (model.at_amplitude(end).stiffness(one.values, omega) for end in ends)
        bend = np.stack([(above - below).real, (above - below).imag], axis=1) * share[:, None]
        covariance = covariance + bend[:, :, None] * bend[:, None, :]
    return stiffness, covariance + ((entry.discrepancy * np.abs(stiffness)) ** 2)[:, None, None] * np.eye(2)
