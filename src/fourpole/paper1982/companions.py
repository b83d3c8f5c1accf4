"""Figures that go with those of the paper: TR measured and predicted, the Nyquist plot, the routes, the mobility."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fourpole.core.rig import Rig
from fourpole.core.routes import mobility_route, relative_route, transmissibility_route
from fourpole.core.tyre import zener_stiffness
from fourpole.plot.cards import line_of, points_of, zero_line
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Series, Tone, look
from fourpole.plot.sheet import (
    Groups,
    Sheet,
    few,
    leading,
    means,
    phasors,
    present,
    read_sheet,
    rigs_stated,
    spread,
    tests_said,
    texts,
)
from fourpole.quantities import Quantity
from fourpole.study.study import Study

_MOST_LOADS, _MOST_TYRES, _MOST_COLUMNS = 2, 12, 4
#: Rank of the marker and of the line style of each route.
_ROUTE_RANKS = {"mobility": (0, 0), "relative": (2, 1), "transmissibility": (1, 2)}
#: Number of pressures in the key of a figure.
MOST_NAMED = 8


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


def _is_stated(groups: Groups) -> bool:
    """False if the only group is that of the tests that state no value."""
    return len(groups) > 1 or groups.stated() > 0


def _named(name: str, label: str) -> str:
    """A label with its number, or "not stated" with the name of the axis before it."""
    return label if label[0].isdigit() else f"{name} {label}"


@dataclass(frozen=True, eq=False)
class _Choice:
    """What a figure of many curves shows: tyres, pairs of pressure and preload, their tests, entries of the key."""

    tyres: list[int]
    conditions: list[tuple[int, int]]
    tests: BoolArray
    key: tuple[tuple[Series, str], ...]


def _choose(sheet: Sheet, visible: BoolArray, notes: list[str]) -> _Choice:
    """The conditions to show among those of the visible tests: as many curves as a panel may have."""
    loads = few(list(present(sheet.load, visible)), _MOST_LOADS, "preloads", notes)
    tyres = few(list(present(sheet.tyre, visible)), _MOST_TYRES, "tyres", notes)
    pressures = few(list(present(sheet.pressure, visible)), MOST_LABELLED // len(loads), "pressures", notes)
    here = np.isin(sheet.tyre, tyres) & np.isin(sheet.pressure, pressures) & np.isin(sheet.load, loads)
    conditions = [(pressure, load) for load in loads for pressure in pressures]
    return _Choice(tyres, conditions, visible & here, (*pressure_key(sheet, pressures), *load_key(sheet, loads)))


def mobility(results: Study) -> FigureData | None:
    """R and I as measured, with the curve that K1, K2 and C and the rig as stated give; a column per specimen."""
    sheet = read_sheet(results)
    frequency, _ = sheet.shown(q.FREQUENCY)
    bare, notes = sheet.bare("mobility")
    visible = np.isfinite(frequency) & np.isfinite(sheet.shown(q.R)[0]) & bare
    if not np.any(visible):
        return None
    rigs = rigs_stated(results, sheet)
    choice = _choose(sheet, visible, notes)
    tyres = leading(choice.tyres, _MOST_COLUMNS, "tyres", notes)
    panels = [_mobility_panel(results, sheet, rigs, choice, tyre, part) for part in (q.R, q.I) for tyre in tyres]
    notes += tests_said(sheet.rejected[bare], visible[bare], "R and I")
    return FigureData(tuple(panels), len(tyres), sheet.labels, key=choice.key, notes=tuple(notes), panel_height=1.95,
                      aligned=True, block=2)  # fmt: skip


def _mobility_panel(
    results: Study, sheet: Sheet, rigs: Mapping[str, Rig | None], choice: _Choice, tyre: int, quantity: Quantity
) -> Panel:
    """R or I of one specimen."""
    frequency, (values, stds) = sheet.shown(q.FREQUENCY)[0], sheet.shown(quantity)
    series: list[Series] = []
    for pressure, load in choice.conditions:
        here = choice.tests & ~sheet.rejected & sheet.where(tyre=tyre, pressure=pressure, load=load)
        marks = tyre_look(tyre, pressure, load)
        for setting in present(sheet.setting, here):
            found = _model_curve(sheet, rigs, here & (sheet.setting == setting))
            if found is not None:
                x, both = found
                series.append(Series(Role.MODEL, x, both[0 if quantity is q.R else 1], tyre=tyre, dash=load))
        series += points_of(results, here, (frequency, values), marks, stds=(None, stds))
    lost = choice.tests & sheet.rejected & (sheet.tyre == tyre)
    series += rejected_of(results, lost, (frequency, values))
    title, head = (sheet.labels[tyre], tyre) if quantity is q.R else ("", -1)
    return Panel(AxisData.of(q.FREQUENCY), AxisData.of(quantity), tuple(series), title, "", head)


def _model_curve(
    sheet: Sheet, rigs: Mapping[str, Rig | None], mask: BoolArray
) -> tuple[FloatArray, list[FloatArray]] | None:
    """Frequencies [Hz] with R and I [mm/(N s)] of the Zener model; K1, K2 and C are interpolated between the tests."""
    at = np.flatnonzero(mask)
    rig = rigs.get(sheet.rigs[at[0]]) if at.size else None
    if rig is None:
        return None
    frequency = sheet.values(q.FREQUENCY.head)[mask]
    keys = sheet.frequency[mask].tolist()
    x, k1 = means(frequency, sheet.values(q.K1.head)[mask], keys)
    x2, k2 = means(frequency, sheet.values(q.K2.head)[mask], keys)
    _, c = means(frequency, sheet.values(q.C.head)[mask], keys)
    if x2.size < 2 or x.size != x2.size:
        return None
    grid = np.linspace(x2[0], x2[-1], 61)
    omega = 2 * np.pi * grid
    tyre = zener_stiffness(np.interp(grid, x, k1), np.interp(grid, x2, k2), np.interp(grid, x2, c), omega)
    # The measured force also accelerates the mass between the force transducer and the contact.
    inner = 1j * omega / tyre + rig.mobility(omega, float(sheet.added[at[0]]))
    whole = 1.0 / (1.0 / inner + 1j * omega * rig.input_mass) * 1e3
    return grid, [whole.real, whole.imag]


def nyquist(results: Study) -> FigureData | None:
    """K'' against K' along frequency, a panel per specimen."""
    sheet = read_sheet(results)
    real, real_std = sheet.shown(q.STORAGE)
    imag, std = sheet.shown(q.LOSS)
    visible = np.isfinite(real) & np.isfinite(imag)
    if not np.any(visible):
        return None
    notes: list[str] = []
    choice = _choose(sheet, visible, notes)
    used, lost = choice.tests & ~sheet.rejected, choice.tests & sheet.rejected
    panels = []
    for tyre in choice.tyres:
        series: list[Series] = []
        for pressure, load in choice.conditions:
            here = used & sheet.where(tyre=tyre, pressure=pressure, load=load)
            marks = tyre_look(tyre, pressure, load)
            series += _along_frequency(sheet, real, imag, here, marks)
            series += points_of(results, here, (real, imag), marks, stds=(real_std, std))
        series += rejected_of(results, lost & (sheet.tyre == tyre), (real, imag))
        right = _frequency_range(sheet, used, tyre)
        panels.append(
            Panel(AxisData.of(q.STORAGE), AxisData.of(q.LOSS), tuple(series), sheet.labels[tyre], right, tyre)
        )
    notes += tests_said(sheet.rejected, visible, "K*")
    columns = min(3, len(panels))
    return FigureData(
        tuple(panels), columns, sheet.labels, notes=tuple(notes), aligned=True,
        key=choice.key,
        panel_height=2.6 if len(panels) <= columns else 2.1,
    )  # fmt: skip


def _along_frequency(sheet: Sheet, real: FloatArray, imag: FloatArray, mask: BoolArray, like: Series) -> list[Series]:
    """A line through the means of repeats in rising order of frequency."""
    frequency, keys = sheet.values(q.FREQUENCY.head)[mask], sheet.frequency[mask].tolist()
    if not frequency.size:
        return []
    x, y = (means(frequency, part[mask], keys)[1] for part in (real, imag))
    return [Series(Role.LINE, x, y, tyre=like.tyre, dash=like.dash)]


def _frequency_range(sheet: Sheet, used: BoolArray, tyre: int) -> str:
    """Lowest and highest frequency of a tyre, as a heading."""
    found = [at for at in present(sheet.frequency, used & (sheet.tyre == tyre)) if at >= 0]
    if not found:
        return ""
    first, last = sheet.frequencies.labels[found[0]], sheet.frequencies.labels[found[-1]]
    return first if first == last else f"{first.removesuffix(' Hz')} to {last}"


def route_stiffness(results: Study, sheet: Sheet) -> dict[str, ComplexArray]:
    """K* [N/m] of every test by each route; not-a-number if the test lacks a phasor or the rig that a route needs."""
    every = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    names = np.array(sheet.rigs, dtype=object)
    found = {route: np.full(every.size, np.nan, dtype=complex) for route in _ROUTE_RANKS}
    with np.errstate(all="ignore"):
        for name, rig in rigs_stated(results, sheet).items():
            at = np.flatnonzero((names == name) & np.isfinite(every))
            omega, added = every[at], sheet.added[at]
            f1, v1, v2 = phasors(sheet, rig, at)
            found["relative"][at] = relative_route(f1, v1, v2, omega)
            if rig is None:
                continue
            found["mobility"][at] = mobility_route(v1 / f1, rig.mobility(omega, added), omega)
            if not rig.blocked:
                found["transmissibility"][at] = transmissibility_route(v2 / v1, rig.impedance(omega, added), omega)
    return {route: value for route, value in found.items() if np.any(np.isfinite(value))}


def routes(results: Study) -> FigureData | None:
    """K' by each route at one condition, and the relative differences of K' and K'' from the K* in use."""
    sheet = read_sheet(results)
    frequency, _ = sheet.shown(q.FREQUENCY)
    reference = sheet.values(q.STORAGE.head) + 1j * sheet.values(q.LOSS.head)
    visible = np.isfinite(frequency) & np.isfinite(reference)
    found = route_stiffness(results, sheet)
    used = visible & ~sheet.rejected
    if len(found) < 2 or not np.any(used):
        return None
    notes: list[str] = []
    tyres = leading(list(present(sheet.tyre, used)), _MOST_COLUMNS, "tyres", notes)
    panels = [_route_panel(results, sheet, found, used & (sheet.tyre == tyre), tyre) for tyre in tyres]
    for name, part in (("K'", np.real), ("K''", np.imag)):
        with np.errstate(divide="ignore", invalid="ignore"):
            off = {route: 100 * part(value - reference) / part(reference) for route, value in found.items()}
        panels += [_difference_panel(sheet, off, used & (sheet.tyre == tyre), tyre, name) for tyre in tyres]
    names = texts(sheet.table, "route")
    key = []
    for route in found:
        in_use = np.mean([text == route for text in names]) > 0.5
        key.append((look(marker=_ROUTE_RANKS[route][0]), f"{route} route" + (" (in use)" if in_use else "")))
    notes.append("ΔK' and ΔK'': difference from the K* in use, median and range over all conditions")
    notes += tests_said(sheet.rejected, used, "K*")
    return FigureData(tuple(panels), len(tyres), sheet.labels, key=tuple(key), notes=tuple(notes),
                      panel_height=1.8, aligned=True, block=3)  # fmt: skip


def _route_panel(results: Study, sheet: Sheet, found: Mapping[str, ComplexArray], own: BoolArray, tyre: int) -> Panel:
    """K' by each route at the condition of a specimen with the most tests."""
    frequency, _ = sheet.shown(q.FREQUENCY)
    pressure, load = _fullest(sheet, own)
    here, series = own & sheet.where(pressure=pressure, load=load), []
    for route, value in found.items():
        marker, dash = _ROUTE_RANKS[route]
        marks, y = look(tyre=tyre, marker=marker, dash=dash), value.real / q.STORAGE.scale
        series += line_of(frequency[here], y[here], sheet.frequency[here], marks)
        series += points_of(results, here, (frequency, y), marks)
    where = [sheet.pressures.labels[pressure], sheet.loads.labels[load]]
    right = ", ".join(part for part in where if part[0].isdigit())
    return Panel(AxisData.of(q.FREQUENCY), AxisData.of(q.STORAGE), tuple(series), sheet.labels[tyre], right, tyre)


def _difference_panel(sheet: Sheet, off: Mapping[str, FloatArray], own: BoolArray, tyre: int, name: str) -> Panel:
    """The median at each frequency of what each route differs by [%], with its range."""
    frequency, series = sheet.values(q.FREQUENCY.head), [zero_line(sheet.values(q.FREQUENCY.head)[own])]
    for route, values in off.items():
        known, (marker, dash) = own & np.isfinite(values), _ROUTE_RANKS[route]
        groups = [known & (sheet.frequency == group) for group in present(sheet.frequency, known)]
        x = np.array([frequency[group].mean() for group in groups])
        median, low, high = (
            np.array([pick(values[group]) for group in groups]) for pick in (np.median, np.min, np.max)
        )
        look_of = Series(Role.POINTS, x, median, tyre=tyre, marker=marker, dash=dash)
        series += [*line_of(x, median, np.arange(x.size), look_of), look_of]
        series.append(Series(Role.RANGE, x, 0.5 * (high + low), 0.5 * (high - low), tyre=tyre))
    return Panel(AxisData.of(q.FREQUENCY), AxisData(f"Δ{name}", "%", signed=True), tuple(series))


def _fullest(sheet: Sheet, own: BoolArray) -> tuple[int, int]:
    """Pressure and preload with the most tests; if several have as many, the lowest preload and a middle pressure."""
    counts = Counter(zip(sheet.load[own].tolist(), sheet.pressure[own].tolist(), strict=True))
    alike = sorted(place for place, count in counts.items() if count == max(counts.values()))
    lowest = [pressure for load, pressure in alike if load == alike[0][0]]
    return lowest[len(lowest) // 2], alike[0][0]


def measured_against_predicted(results: Study) -> FigureData | None:
    """TR measured against TR predicted from K* and the rig; beside it their difference against frequency."""
    sheet = read_sheet(results)
    measured, _ = sheet.shown(q.TR_MEASURED)
    predicted, std = sheet.shown(q.TR_PREDICTED)
    frequency, _ = sheet.shown(q.FREQUENCY)
    visible = np.isfinite(measured) & np.isfinite(predicted) & (predicted > 0)
    if not np.any(visible):
        return None
    used, lost = visible & ~sheet.rejected, visible & sheet.rejected
    with np.errstate(divide="ignore", invalid="ignore"):
        difference, difference_std = 100 * (measured / predicted - 1), 100 * std / predicted
    tyres, pressures = list(present(sheet.tyre, visible)), list(present(sheet.pressure, visible))
    shown = used if np.any(used) else visible
    every = np.concatenate([measured[shown], predicted[shown]])
    ends = np.array([every.min(), every.max()])
    left, right = [Series(Role.LINE, ends, ends, tone=Tone.INK)], [zero_line(frequency[shown])]
    for tyre, pressure in product(tyres, pressures):
        mask, marks = used & sheet.where(tyre=tyre, pressure=pressure), tyre_look(tyre, pressure, 0)
        left += points_of(results, mask, (predicted, measured), marks)
        right += points_of(results, mask, (frequency, difference), marks, stds=(None, difference_std))
    left += rejected_of(results, lost, (predicted, measured))
    right += rejected_of(results, lost, (frequency, difference))
    notes = tests_said(sheet.rejected, visible, "TR measured and predicted")
    if len(pressures) > MOST_NAMED:
        notes.append("the key names some of the pressures")
    panels = (
        Panel(AxisData.of(q.TR_PREDICTED), AxisData.of(q.TR_MEASURED), tuple(left)),
        Panel(AxisData.of(q.FREQUENCY), AxisData("difference from predicted", "%", signed=True), tuple(right)),
    )
    return FigureData(
        panels, 2, sheet.labels, keyed=tuple(tyres), key=tuple(pressure_key(sheet, pressures)),
        notes=tuple(notes), panel_height=2.75, shared=False,
    )  # fmt: skip


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {
    "tr-measured-predicted": measured_against_predicted, "nyquist": nyquist, "routes": routes, "mobility": mobility,
}  # fmt: skip
