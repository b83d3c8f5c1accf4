"""Figures against frequency: tests with the curve of the model through them, and the mass of a specimen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TypeAlias

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import with_std
from fourpole.core.specimen import Form
from fourpole.fitting.rows import bodies_in
from fourpole.plot.cards import points_of
from fourpole.plot.data import (
    MOST_LABELLED,
    AxisData,
    FigureData,
    Panel,
    Role,
    Scale,
    Series,
    counted,
    kept,
    lacking,
    look,
    shade,
)
from fourpole.plot.sheet import Sheet, few, means, not_all, read_sheet, rigs_stated, spread
from fourpole.plot.states import (
    DECADE,
    RESIDUALS,
    State,
    axis_shown,
    body_of,
    by_tyre,
    curve_of,
    differing,
    model_curve,
    model_rig,
    models_said,
    part_of,
    place_text,
    residual_panel,
    residual_points,
    residuals_said,
    stated_text,
    states,
    tested,
    title_of,
    values_of,
    values_on,
)
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: What is read as massless is not drawn where it is further from K* than this [1].
_FAR = 0.3
#: Line styles of what is read as massless, and of the peak of a model; preloads have those before them.
_DASH, _PEAK = 5, 2
#: The curves of the modes go from this share of the lowest to this multiple of the highest of their frequencies.
_BELOW, _ABOVE = 0.8, 1.25
_POINTS, _MOST_MODES, _MODE_COLUMNS = 500, 6, 2
#: The entry of the key.
MASSLESS_KEY = (look(Role.LINE, dash=_DASH), "read as massless")


def _stiffness(results: Study, state: State) -> tuple[FloatArray, ComplexArray]:
    """K* of the springs [N/m] at each tested frequency [Hz], as the mean of the tests in use."""
    sheet = read_sheet(results, texts_only=True)
    real, imag = sheet.values(q.STORAGE.head), sheet.values(q.LOSS.head)
    rows = state.rows & ~sheet.rejected & np.isfinite(real + imag) & (sheet.frequency >= 0)
    frequency, keys = sheet.values(q.FREQUENCY.head)[rows], sheet.frequency[rows].tolist()
    parts = [means(frequency, part[rows], keys) for part in (real, imag)]
    return parts[0][0], parts[0][1] + 1j * parts[1][1]


def massless_reading(results: Study, state: State, quantity: q.Quantity, like: Series) -> list[Series]:
    """What a reading that knows no mass would say of K* of a specimen that has one."""
    key = ("massless", int(np.flatnonzero(state.rows)[0]))
    frequency, read = kept(results, key, lambda: _read_as_massless(results, state))
    values = part_of(quantity, read)[0] / results.shown.of(quantity).scale
    return [replace(like, role=Role.LINE, x=frequency, y=values, dash=_DASH, label="")] if frequency.size else []


def _read_as_massless(results: Study, state: State) -> tuple[FloatArray, ComplexArray]:
    r"""Frequencies [Hz] and :math:`F_1/(x_1 - x_2)`; none of a specimen without a mass.

    On a rig of impedance :math:`Z_r` without an added mass, :math:`x_2/x_1 = -D_{21}/(D_{22} + j\omega Z_r)`. Where the
    far side is held, it is 0, and the reading is the stiffness at the driving point.
    """
    body, sheet = body_of(results, state), read_sheet(results, texts_only=True)
    rig = rigs_stated(results, sheet).get(sheet.rigs[int(np.flatnonzero(state.rows)[0])])
    frequency, stiffness = _stiffness(results, state)
    if body is None or rig is None or frequency.size < 2:
        return np.zeros(0), np.zeros(0, dtype=complex)
    specimen, curve = body.specimen(stiffness[stiffness.size // 2]), model_curve(results, state)
    if curve is not None:
        frequency, stiffness = curve.frequency, curve.stiffness
    omega = 2 * np.pi * frequency
    d = specimen.dynamic_stiffness(stiffness, omega)
    ratio = 0.0 if rig.blocked else -d[:, 1, 0] / (d[:, 1, 1] + 1j * omega * rig.impedance(omega))
    read = (d[:, 0, 0] + d[:, 0, 1] * ratio) / (1 - ratio)
    read[np.abs(read / stiffness - 1) > _FAR] = np.nan
    return frequency, read


def modes(results: Study) -> FigureData | None:
    """The stiffness at the driving point and to the held far end, over and beyond the tested frequencies.

    Each specimen is shown at the middle one of its conditions; K* of its springs is that at the middle frequency.
    """
    sheet = read_sheet(results, texts_only=True)
    groups = by_tyre(state for state in tested(results, ~sheet.rejected) if body_of(results, state) is not None)
    if not groups:
        return None
    notes: list[str] = []
    panels, several = [], False
    for tyre in few(list(groups), _MOST_MODES, "specimens", notes):
        own = groups[tyre]
        several |= len(own) > 1
        panels.append(_modes_panel(results, own[len(own) // 2], sheet.labels[tyre]))
    if several:
        notes.append("one of the tested conditions; the table of the report has all")
    key = [
        (look(Role.LINE, dash=0), "tested frequencies"), (look(Role.LINE, dash=1), "beyond them"),
        (look(hollow=True), "contact free, rim held"), (look(), "both held (± U, 95 %)"),
    ]  # fmt: skip
    return FigureData(
        tuple(panels), min(len(panels), _MODE_COLUMNS), sheet.labels, key=tuple(key), notes=tuple(notes),
        panel_height=2.6, shared=False,
    )  # fmt: skip


def _modes_panel(results: Study, state: State, title: str) -> Panel:
    body = body_of(results, state)
    assert body is not None
    tested_at, stiffness = _stiffness(results, state)
    middle = stiffness[stiffness.size // 2]
    marks = [body.pair(quantity) for quantity in (q.BELT_FREE, q.BELT_HELD)]
    x = np.linspace(_BELOW * tested_at[0], _ABOVE * max(tested_at[-1], marks[1][0]), _POINTS)
    x = np.union1d(x, [tested_at[0], tested_at[-1], *(value for value, _ in marks)])
    d = np.abs(body.specimen(middle).dynamic_stiffness(np.full(x.size, middle), 2 * np.pi * x))
    seen, series = results.shown.of(q.MODULUS), list[Series]()
    for place, name, (value, std), level in ((0, "driving point", marks[0], 1.0), (1, "transfer", marks[1], 0.4)):
        y = d[:, 0, place] / seen.scale
        like = look(Role.LINE, tyre=state.tyre, shade=level)
        for part, dash in ((x <= tested_at[0], 1), ((x >= tested_at[0]) & (x <= tested_at[-1]), 0)):
            series.append(replace(like, x=x[part], y=y[part], dash=dash))
        after = x >= tested_at[-1]
        series.append(replace(like, x=x[after], y=y[after], dash=1, label=name))
        at, high = np.array([value]), y[x == value]
        series.append(replace(like, role=Role.RANGE, x=at, y=high, across=np.array([COVERAGE_FACTOR * std])))
        said = " ± ".join(filter(None, with_std(value, COVERAGE_FACTOR * std))) + f" {q.BELT_FREE.unit}"
        series.append(replace(like, role=Role.POINTS, x=at, y=high, texts=(said,), hollow=place == 0))
    ordinate = AxisData("dynamic stiffness |k|", seen.shown, log=True)
    right = ", ".join(filter(None, ["a rod" if body.form is Form.ROD else "", stated_text(results, state.place)]))
    return Panel(AxisData.of(q.FREQUENCY), ordinate, tuple(series), title, right, state.tyre)


#: Largest number of specimens in a figure, of panels in a row, and of curves in a panel with a colour scale.
_MOST_TYRES, _MOST_COLUMNS, _MOST_CURVES = 6, 3, 12
#: Largest number of preloads in a panel with a colour scale.
_MOST_DASHES = 3
_STIFFNESS, _PARTS, _ARM = (q.MODULUS, q.LOSS_ANGLE), (q.STORAGE, q.LOSS), (q.K2, q.C)
#: Quantities beside which stands what a reading that knows no mass would say.
_MASSLESS = (*_STIFFNESS, *_PARTS)
#: Axes that have another name than their column.
_NAMED = {q.TR_MEASURED: q.TR}
#: Height of a figure of the first page [in].
_COMPACT = 2.4


@dataclass(frozen=True)
class Shown:
    """A condition that a figure shows, with the text at the end of its curve and its place on the colour scale."""

    state: State
    label: str = ""
    shade: float = 1.0
    dash: int = 0
    level: float = np.nan

    @property
    def look(self) -> Series:
        """Colour, marker and line style of its points and its curve."""
        tyre, marker = self.state.tyre, self.state.pressure
        return look(tyre=tyre, shade=self.shade, marker=marker, dash=self.dash, level=self.level)


#: The curves of each specimen, the colour scale, and the line styles that the key explains.
Chosen: TypeAlias = tuple[dict[int, list[Shown]], Scale | None, tuple[tuple[int, str], ...]]


def by_frequency(results: Study, quantities: Sequence[Quantity]) -> FigureData | None:
    """Quantities against frequency, a column of panels per specimen; None if no test has one of them.

    Up to six curves of a panel have their condition written at their ends; more have a colour scale.
    """
    sheet = read_sheet(results, texts_only=True)
    known, notes = _known(sheet, quantities)
    groups = by_tyre(tested(results, known))
    if not groups:
        return None
    shown = few(list(groups), _MOST_TYRES, "specimens", notes)
    chosen, scale, dashes = chosen_curves(results, {tyre: groups[tyre] for tyre in shown}, notes)
    curves = list(chain(*chosen.values()))
    log = _logarithmic(curves, sheet)
    massless = not {*quantities}.isdisjoint(_MASSLESS) and bool(bodies_in(results.tables))
    columns = next((n for n in (_MOST_COLUMNS, 2) if len(shown) % n == 0), min(len(shown), _MOST_COLUMNS))
    panels: list[Panel] = []
    for start in range(0, len(shown), columns):
        row = shown[start : start + columns]
        block = [
            condition_panel(results, one, chosen[tyre], known, log=log, massless=massless and one in _MASSLESS)
            for one in quantities
            for tyre in row
        ]
        panels += headed(results, block, row)
    alike = common(results, [curve.state for curve in curves])
    said = [*alike, *_models_said(results, sheet, panels, shown), *notes]
    return FigureData(
        panels=tuple(panels), columns=columns, names=sheet.labels, scale=scale, dashes=dashes,
        notes=(*said, *_tests_said(sheet, known, quantities[0])), panel_height=2.1 if len(shown) <= columns else 1.6,
        block=len(quantities), key=(*((MASSLESS_KEY,) if massless else ()), *peak_key(panels)),
    )  # fmt: skip


def headed(results: Study, panels: Sequence[Panel], tyres: Sequence[int]) -> list[Panel]:
    """The panels, with the names of these specimens above the first ones."""
    sheet = read_sheet(results, texts_only=True)
    first_row = zip(panels, tyres, strict=False)
    heads = [replace(panel, title=title_of(results, sheet, tyre), tyre=tyre) for panel, tyre in first_row]
    return [*heads, *panels[len(heads) :]]


def first(results: Study, quantities: Sequence[Quantity]) -> FigureData | None:
    """Quantities against frequency beside each other, with at most six curves of all specimens together."""
    sheet = read_sheet(results, texts_only=True)
    known, left_out = _known(sheet, quantities)
    known = known & ~sheet.rejected
    found = tested(results, known)
    if not found:
        return None
    chosen = _few(found)
    tyres, curves = by_tyre(chosen), []
    for tyre, own in tyres.items():
        columns = _reading(differing(own))
        for rank, state in enumerate(own):
            label = words(results, state, columns) or (sheet.labels[tyre] if len(tyres) > 1 else "")
            curves.append(Shown(state, label, shade(rank, len(own))))
    log = _logarithmic(curves, sheet)
    panels = [condition_panel(results, quantity, curves, known, log=log) for quantity in quantities]
    # The page has the models in words; a hint stands where there is none.
    drawn = any(one.role is Role.MODEL for one in panels[0].series)
    said = [*common(results, chosen), *([] if drawn else _models_said(results, sheet, panels, list(tyres)))]
    said += not_all(len(chosen), len(found), "conditions")
    said += ["without the tests with an added mass"] if left_out else []
    return FigureData(
        panels=tuple(panels), columns=len(panels), names=sheet.labels, shared=False, notes=tuple(said),
        keyed=tuple(tyres) if 1 < len(tyres) < len(chosen) else (), height=_COMPACT, key=peak_key(panels),
    )  # fmt: skip


def parts(results: Study) -> FigureData | None:
    """K' and K'', and below them what the models leave, if there are any."""
    found = [state.model for state in states(results) if state.model is not None]
    if results.models is None or not found:
        return by_frequency(results, _PARTS)
    data = by_frequency(results, (*_PARTS, *RESIDUALS))
    return data and replace(data, notes=(*data.notes, *residuals_said(results, found)), panel_height=1.5)


def common(results: Study, found: Sequence[State]) -> list[str]:
    """The note with the stated values that all conditions share, if there are any."""
    differ = set(differing(found))
    alike = _reading([column for column in found[0].place if column not in differ])
    shared = stated_text(results, {column: found[0].place[column] for column in alike})
    return [f"at {shared}"] if shared else []


def _known(sheet: Sheet, quantities: Sequence[Quantity]) -> tuple[BoolArray, list[str]]:
    """True for tests with a frequency and a quantity that no added mass has changed, and notes on the others."""
    frequency = sheet.values(q.FREQUENCY.head)
    known = np.any([np.isfinite(values_of(sheet, one)[0]) for one in quantities], axis=0) & np.isfinite(frequency)
    if not {q.TR_MEASURED, q.TR_PREDICTED} & set(quantities):
        return np.asarray(known), []
    bare, said = sheet.bare("TR")
    return np.asarray(known & bare), said


def condition_panel(
    results: Study, quantity: Quantity, curves: Sequence[Shown], known: BoolArray, *, log: bool, massless: bool = False
) -> Panel:
    """The panel of one quantity: for each condition the model's curve, the tests and the rejected tests.

    With `massless`, what a reading that knows no mass would say stands beside K* of the springs.
    """
    sheet = read_sheet(results, texts_only=True)
    frequency, (values, stds) = sheet.values(q.FREQUENCY.head), values_of(sheet, quantity)
    seen = results.shown.of(_NAMED.get(quantity, quantity))
    unit, series = quantity.scale / seen.scale, list[Series]()
    for one in curves:
        state, marks = one.state, one.look
        if quantity in RESIDUALS:
            series += [residual_points(results, state.model, quantity, marks)] if state.model is not None else []
            continue
        line = curve_of(results, state, quantity)
        if line is not None:
            x, y, half = line
            series.append(replace(marks, role=Role.MODEL, x=x, y=unit * y, spread=unit * half, label=one.label))
            series += _peak(series[-1]) if seen.key == q.TR.key else []
        label = one.label if line is None else ""
        for like, mask in (
            (replace(marks, label=label), ~sheet.rejected),
            (replace(marks, role=Role.REJECTED), sheet.rejected),
        ):
            rows = mask & known & state.rows
            series += points_of(results, rows, (frequency, unit * values), like, stds=(None, unit * stds))
        series += massless_reading(results, state, quantity, marks) if massless else []
    if quantity in RESIDUALS:
        return residual_panel(quantity, series, log=log)
    return Panel(AxisData.of(q.FREQUENCY, log=log), AxisData.of(seen), tuple(series))


def _peak(curve: Series) -> list[Series]:
    """A line down from the peak of a model's curve; none where it is at an end."""
    top = int(np.argmax(curve.y))
    if not 0 < top < curve.y.size - 1 or not np.isnan(curve.level):
        return []
    ends = np.array([float(np.min(curve.y)), float(curve.y[top])])
    return [replace(curve, role=Role.LINE, x=np.full(2, curve.x[top]), y=ends, spread=None, label="", dash=_PEAK)]


def peak_key(panels: Sequence[Panel]) -> tuple[tuple[Series, str], ...]:
    """The entry of the key for the peaks of models, if one is drawn."""
    drawn = any(one.role is Role.LINE and one.dash == _PEAK for panel in panels for one in panel.series)
    return ((look(Role.LINE, dash=_PEAK), "peak of the model"),) if drawn else ()


def chosen_curves(results: Study, groups: dict[int, list[State]], notes: list[str]) -> Chosen:
    """The curves of each specimen: few with the condition at their ends, many on a colour scale."""
    many = max(map(len, groups.values())) > MOST_LABELLED
    return _scaled(results, groups, notes) if many else _labelled(results, groups)


def _labelled(results: Study, groups: dict[int, list[State]]) -> Chosen:
    """Few curves per panel: the colour of the specimen, and the condition at the end of each curve."""
    made = {}
    for tyre, each in groups.items():
        columns = _reading(differing(each))
        loads = sorted({one.load for one in each})
        made[tyre] = [
            Shown(one, words(results, one, columns), shade(at, len(each)), loads.index(one.load))
            for at, one in enumerate(each)
        ]
    return made, None, ()


def _scaled(results: Study, groups: dict[int, list[State]], notes: list[str]) -> Chosen:
    """Many curves per panel: a colour scale over the axis with the most values, line styles over the next axis."""
    every = list(chain(*groups.values()))
    colour, *others = differing(every)
    dash, kept = "", every
    for column in others[1:]:
        ((usual, _),) = Counter(state.on(column) for state in kept).most_common(1)
        kept = [state for state in kept if _equal(state.on(column), usual)]
    dashes: list[float] = []
    if others:
        dash, (dashes, kept) = others[0], _some(kept, others[0], _MOST_DASHES)
    _, kept = _some(kept, colour, max(_MOST_CURVES // max(len(dashes), 1), 4))
    notes += not_all(len(kept), len(every), "conditions")
    name, unit, size = axis_shown(colour, results.shown)
    known = [state.on(colour) / size for state in kept if not np.isnan(state.on(colour))]
    made: dict[int, list[Shown]] = {tyre: [] for tyre in groups}
    for state in kept:
        rank = next((rank for rank, value in enumerate(dashes) if _equal(value, state.on(dash))), 0)
        made[state.tyre].append(Shown(state, dash=rank, level=state.on(colour) / size))
    explained = tuple((at, place_text(results, dash, value)) for at, value in enumerate(dashes))
    return made, Scale(name, unit, min(known), max(known)), explained


def _some(found: Sequence[State], column: str, most: int) -> tuple[list[float], list[State]]:
    """Some values on an axis, evenly spaced, and the conditions that have them."""
    values = values_on(found, column)
    values = [values[at] for at in spread(len(values), most)]
    return values, [state for state in found if any(_equal(state.on(column), value) for value in values)]


def _equal(one: float, other: float) -> bool:
    return one == other or (np.isnan(one) and np.isnan(other))


def _few(found: Sequence[State]) -> list[State]:
    """At most six conditions of all specimens: of each as many, spread over the axis with the most values.

    On the other axes each specimen is shown at the value that most of its conditions have, of several the lowest.
    """
    if len(found) <= MOST_LABELLED:
        return list(found)
    groups = by_tyre(found)
    tyres = [list(groups)[index] for index in spread(len(groups), MOST_LABELLED)]
    each = MOST_LABELLED // len(tyres)
    columns = differing(found)
    chosen = []
    for tyre in tyres:
        own = groups[tyre]
        for column in columns[1:]:
            counts = Counter(str(state.place.get(column)) for state in own)
            top = max(counts.values())
            usual = next(value for value in values_on(own, column) if counts[str(value)] == top)
            own = [state for state in own if _equal(state.on(column), usual)]
        at = spread(len(own), each) if each > 1 else [len(own) // 2]
        chosen += [own[i] for i in at]
    return chosen


def words(results: Study, one: State, columns: Sequence[str]) -> str:
    """The values of a condition on some axes."""
    return ", ".join(place_text(results, column, one.on(column)) for column in columns)


def _reading(columns: Sequence[str]) -> list[str]:
    """Columns of axes in the order in which conditions are read: pressure, preload, others."""
    order = [q.PRESSURE.head, q.PRELOAD.head]
    return sorted(columns, key=lambda column: order.index(column) if column in order else len(order))


def _logarithmic(curves: Sequence[Shown], sheet: Sheet) -> bool:
    """Whether the tests of some curves span more than a decade of frequency."""
    rows = np.any([one.state.rows for one in curves], axis=0)
    frequency = sheet.values(q.FREQUENCY.head)[rows]
    frequency = frequency[frequency > 0]
    return bool(frequency.size and frequency.max() > DECADE * frequency.min())


def _models_said(results: Study, sheet: Sheet, panels: Sequence[Panel], tyres: Sequence[int]) -> list[str]:
    """The models of some specimens; a hint where no curve is drawn."""
    if not any(one.role is Role.MODEL for panel in panels for one in panel.series):
        if results.models is None:
            return ["no model of these tests"]
        lacking = panels[0].y.name == q.TR.name and model_rig(results) is None
        return ["no curve: TR of a model needs the rig, one for all tests"] if lacking else []
    return models_said(results, sheet, tyres)


def _tests_said(sheet: Sheet, known: BoolArray, quantity: Quantity) -> list[str]:
    """The numbers of rejected tests and of tests without a value."""
    said = [f"{counted(int(sheet.rejected.sum()), 'test')} rejected"] if sheet.rejected.any() else []
    what = {q.MODULUS: "K*", q.STORAGE: "K*", q.K2: "K2 and C"}.get(quantity, "TR")
    left_out = sheet.massed if what == "TR" else np.zeros_like(sheet.rejected)
    return said + lacking(int(np.sum(~known & ~sheet.rejected & ~left_out)), what)


def transmissibility(results: Study, make: Callable[..., FigureData | None]) -> FigureData | None:
    """TR as measured; TR that K* and the rig give where V2 was not measured."""
    sheet = read_sheet(results, texts_only=True)
    if np.any(np.isfinite(sheet.values(q.TR_MEASURED.head))):
        return make(results, (q.TR_MEASURED,))
    found = make(results, (q.TR_PREDICTED,))
    return found and replace(found, notes=(*found.notes, "predicted from K* and the rig: V2 was not measured"))


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {
    "modes": modes,
    "first-stiffness": partial(first, quantities=_STIFFNESS),
    "first-tr": partial(transmissibility, make=first),
    "stiffness": partial(by_frequency, quantities=_STIFFNESS),
    "storage-loss": parts,
    "arm": partial(by_frequency, quantities=_ARM),
    "tr": partial(transmissibility, make=by_frequency),
}
