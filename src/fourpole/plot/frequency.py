"""Figures against frequency: |K*| and loss angle, K' and K'', K2 and C, TR; the model's curve through the tests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray
from fourpole.plot.cardids import dynamic_cards
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Scale, Series, shade
from fourpole.plot.fitted import DECADE
from fourpole.plot.names import counted
from fourpole.plot.residuals import RESIDUALS, models_said, residual_panel, residual_points, residuals_said, title_of
from fourpole.plot.sheet import Sheet, read_sheet, spread, texts
from fourpole.plot.spec import FigureSpec
from fourpole.plot.states import (
    State,
    axis_shown,
    curve_of,
    differing,
    model_rig,
    place_text,
    states,
    values_of,
    values_on,
)
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: Largest number of specimens in a figure, of panels in a row, and of curves in a panel with a colour scale.
_MOST_TYRES, _MOST_COLUMNS, _MOST_CURVES = 6, 3, 12
#: Largest number of preloads in a panel with a colour scale.
_MOST_DASHES = 3
_STIFFNESS, _PARTS, _ARM = (q.MODULUS, q.LOSS_ANGLE), (q.STORAGE, q.LOSS), (q.K2, q.C)
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


#: The curves of each specimen, the colour scale, and the line styles that the key explains.
Chosen: TypeAlias = tuple[dict[int, list[Shown]], Scale | None, tuple[tuple[int, str], ...]]


def by_frequency(results: Study, quantities: Sequence[Quantity]) -> FigureData | None:
    """Quantities against frequency, a column of panels per specimen; None if no test has one of them.

    Up to six curves of a panel have their condition written at their ends; more have a colour scale.
    """
    sheet = read_sheet(results, texts_only=True)
    known, notes = _known(sheet, quantities)
    found = [one for one in states(results) if np.any(known & one.rows)]
    if not found:
        return None
    tyres = sorted({one.tyre for one in found})
    shown = [tyres[at] for at in spread(len(tyres), _MOST_TYRES)]
    if len(shown) < len(tyres):
        notes.append(f"{len(shown)} of {len(tyres)} specimens shown")
    by_tyre = {tyre: [one for one in found if one.tyre == tyre] for tyre in shown}
    chosen, scale, dashes = chosen_curves(results, by_tyre, notes)
    log = _logarithmic([one for each in chosen.values() for one in each], sheet)
    columns = next((n for n in (_MOST_COLUMNS, 2) if len(shown) % n == 0), min(len(shown), _MOST_COLUMNS))
    panels = []
    for at in range(0, len(shown), columns):
        for quantity in quantities:
            for tyre in shown[at : at + columns]:
                made = condition_panel(results, quantity, chosen[tyre], known, log=log)
                headed = quantity is quantities[0]
                panels.append(replace(made, title=title_of(results, sheet, tyre), tyre=tyre) if headed else made)
    alike = common(results, [one.state for each in chosen.values() for one in each])
    said = [*([f"at {alike}"] if alike else []), *_models_said(results, sheet, panels, shown), *notes]
    return FigureData(
        panels=tuple(panels), columns=columns, names=sheet.labels, scale=scale, dashes=dashes,
        notes=(*said, *_tests_said(sheet, known, quantities[0])), panel_height=2.1 if len(shown) <= columns else 1.6,
        block=len(quantities),
    )  # fmt: skip


def first(results: Study, quantities: Sequence[Quantity]) -> FigureData | None:
    """Quantities against frequency beside each other, with at most six curves of all specimens together."""
    sheet = read_sheet(results, texts_only=True)
    known, left_out = _known(sheet, quantities)
    found = [one for one in states(results) if np.any(known & one.rows & ~sheet.rejected)]
    if not found:
        return None
    chosen, notes = _few(found), []
    if len(chosen) < len(found):
        notes.append(f"{len(chosen)} of {len(found)} conditions shown")
    tyres = list(dict.fromkeys(one.tyre for one in chosen))
    alone = len(tyres) == len(chosen) > 1
    curves = []
    for tyre in tyres:
        own = [one for one in chosen if one.tyre == tyre]
        columns = _reading(differing(own))
        for at, one in enumerate(own):
            label = words(results, one, columns) or (sheet.labels[tyre] if len(tyres) > 1 else "")
            curves.append(Shown(one, label, shade(at, len(own))))
    log = _logarithmic(curves, sheet)
    panels = [condition_panel(results, quantity, curves, known & ~sheet.rejected, log=log) for quantity in quantities]
    alike = common(results, chosen)
    # The page has the models in words; a hint stands where there is none.
    hint = (
        [] if any(one.role is Role.MODEL for one in panels[0].series) else _models_said(results, sheet, panels, tyres)
    )
    bare = ["without the tests with an added mass"] if left_out else []
    said = [*([f"at {alike}"] if alike else []), *hint, *notes, *bare]
    return FigureData(
        panels=tuple(panels), columns=len(panels), names=sheet.labels, shared=False, notes=tuple(said),
        keyed=tuple(tyres) if len(tyres) > 1 and not alone else (), height=_COMPACT,
    )  # fmt: skip


def parts(results: Study) -> FigureData | None:
    """K' and K'', and below them what the models leave, if there are any."""
    if results.models is None or not any(one.model is not None for one in states(results)):
        return by_frequency(results, _PARTS)
    data = by_frequency(results, (*_PARTS, *RESIDUALS))
    found = [one.model for one in states(results) if one.model is not None]
    return data and replace(data, notes=(*data.notes, *residuals_said(results, found)), panel_height=1.5)


def common(results: Study, found: Sequence[State]) -> str:
    """The stated values that all conditions share."""
    differ = set(differing(found))
    place = {column: value for column, value in found[0].place.items() if column not in differ and not np.isnan(value)}
    return ", ".join(place_text(results, column, place[column]) for column in _reading(list(place)))


def _known(sheet: Sheet, quantities: Sequence[Quantity]) -> tuple[BoolArray, list[str]]:
    """True for tests with a frequency and a quantity that no added mass has changed, and notes on the others."""
    frequency = sheet.values(q.FREQUENCY.head)
    known = np.any([np.isfinite(values_of(sheet, one)[0]) for one in quantities], axis=0) & np.isfinite(frequency)
    if not {q.TR_MEASURED, q.TR_PREDICTED} & set(quantities):
        return np.asarray(known), []
    bare, said = sheet.bare("TR")
    return np.asarray(known & bare), [said] if said else []


def condition_panel(
    results: Study, quantity: Quantity, curves: Sequence[Shown], known: BoolArray, *, log: bool
) -> Panel:
    """The panel of one quantity: for each condition the model's curve, the tests and the rejected tests."""
    sheet = read_sheet(results, texts_only=True)
    frequency, (values, stds) = sheet.values(q.FREQUENCY.head), values_of(sheet, quantity)
    cards, names = dynamic_cards(results), texts(sheet.table, q.TEST.head)
    seen = results.shown.of(_NAMED.get(quantity, quantity))
    unit, series = quantity.scale / seen.scale, []
    for one in curves:
        state, none = one.state, np.zeros(0)
        look = Series(Role.POINTS, none, none, tyre=state.tyre, shade=one.shade, marker=state.pressure, dash=one.dash,
                      level=one.level)  # fmt: skip
        if quantity in RESIDUALS:
            series += [residual_points(results, state.model, quantity, look)] if state.model is not None else []
            continue
        line = curve_of(results, state, quantity)
        if line is not None:
            x, y, half = line
            series.append(replace(look, role=Role.MODEL, x=x, y=unit * y, spread=unit * half, label=one.label))
        for role, mask in ((Role.POINTS, ~sheet.rejected), (Role.REJECTED, sheet.rejected)):
            at = np.flatnonzero(mask & known & state.rows & np.isfinite(values))
            at = at[np.argsort(frequency[at], kind="stable")]
            if at.size:
                label = one.label if line is None and role is Role.POINTS else ""
                tests, ids = tuple(names[i] for i in at), tuple(cards[i] for i in at)
                points = replace(
                    look, role=role, x=frequency[at], y=unit * values[at], spread=unit * stds[at], label=label
                )
                series.append(replace(points, label=label, tests=tests, cards=ids))
    if quantity in RESIDUALS:
        return residual_panel(quantity, series, log=log)
    return Panel(AxisData.of(q.FREQUENCY, log=log), AxisData.of(seen), tuple(series))


def chosen_curves(results: Study, by_tyre: dict[int, list[State]], notes: list[str]) -> Chosen:
    """The curves of each specimen: few with the condition at their ends, many on a colour scale."""
    many = max(map(len, by_tyre.values())) > MOST_LABELLED
    return _scaled(results, by_tyre, notes) if many else _labelled(results, by_tyre)


def _labelled(results: Study, by_tyre: dict[int, list[State]]) -> Chosen:
    """Few curves per panel: the colour of the specimen, and the condition at the end of each curve."""
    made = {}
    for tyre, each in by_tyre.items():
        columns = _reading(differing(each))
        loads = sorted({one.load for one in each})
        made[tyre] = [
            Shown(one, words(results, one, columns), shade(at, len(each)), loads.index(one.load))
            for at, one in enumerate(each)
        ]
    return made, None, ()


def _scaled(results: Study, by_tyre: dict[int, list[State]], notes: list[str]) -> Chosen:
    """Many curves per panel: a colour scale over the axis with the most values, line styles over the next axis."""
    every = [one for each in by_tyre.values() for one in each]
    colour, *others = differing(every)
    dash, kept = "", every
    for column in others[1:]:
        counts = Counter(one.place.get(column, np.nan) for one in kept)
        usual = max(counts, key=lambda value: counts[value])
        kept = [one for one in kept if _equal(one.place.get(column, np.nan), usual)]
    dashes: list[float] = []
    if others:
        dash, (dashes, kept) = others[0], _some(kept, others[0], _MOST_DASHES)
    _, kept = _some(kept, colour, max(_MOST_CURVES // max(len(dashes), 1), 4))
    if len(kept) < len(every):
        notes.append(f"{len(kept)} of {len(every)} conditions shown")
    name, unit, size = axis_shown(colour, results.shown)
    levels = [one.place.get(colour, np.nan) / size for one in kept]
    known = [value for value in levels if not np.isnan(value)]
    made: dict[int, list[Shown]] = {tyre: [] for tyre in by_tyre}
    for one, level in zip(kept, levels, strict=True):
        rank = next((at for at, value in enumerate(dashes) if _equal(value, one.place.get(dash, np.nan))), 0)
        made[one.tyre].append(Shown(one, dash=rank, level=level))
    explained = tuple((at, place_text(results, dash, value)) for at, value in enumerate(dashes))
    return made, Scale(name, unit, min(known), max(known)), explained


def _some(found: Sequence[State], column: str, most: int) -> tuple[list[float], list[State]]:
    """Some values on an axis, evenly spaced, and the conditions that have them."""
    values = values_on(found, column)
    values = [values[at] for at in spread(len(values), most)]
    return values, [one for one in found if any(_equal(one.place.get(column, np.nan), value) for value in values)]


def _equal(one: float, other: float) -> bool:
    return one == other or (np.isnan(one) and np.isnan(other))


def _few(found: Sequence[State]) -> list[State]:
    """At most six conditions of all specimens: of each as many, spread over the axis with the most values.

    On the other axes each specimen is shown at the value that most of its conditions have, of several the lowest.
    """
    if len(found) <= MOST_LABELLED:
        return list(found)
    tyres = sorted({one.tyre for one in found})
    tyres = [tyres[at] for at in spread(len(tyres), MOST_LABELLED)]
    each = MOST_LABELLED // len(tyres)
    columns = differing(found)
    chosen = []
    for tyre in tyres:
        own = [one for one in found if one.tyre == tyre]
        for column in columns[1:]:
            counts = Counter(str(one.place.get(column)) for one in own)
            top = max(counts.values())
            usual = next(value for value in values_on(own, column) if counts[str(value)] == top)
            own = [one for one in own if _equal(one.place.get(column, np.nan), usual)]
        at = spread(len(own), each) if each > 1 else [len(own) // 2]
        chosen += [own[i] for i in at]
    return chosen


def words(results: Study, one: State, columns: Sequence[str]) -> str:
    """The values of a condition on some axes."""
    return ", ".join(place_text(results, column, one.place.get(column, np.nan)) for column in columns)


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
            return ["no model of these tests: fourpole fit makes one"]
        lacking = panels[0].y.name == q.TR.name and model_rig(results) is None
        return ["no curve: TR of a model needs the rig, one for all tests"] if lacking else []
    return models_said(results, sheet, tyres)


def _tests_said(sheet: Sheet, known: BoolArray, quantity: Quantity) -> list[str]:
    """The numbers of rejected tests and of tests without a value."""
    said = [f"{counted(int(sheet.rejected.sum()), 'test')} rejected"] if sheet.rejected.any() else []
    lacking = int(np.sum(~known & ~sheet.rejected))
    what = {q.MODULUS: "K*", q.STORAGE: "K*", q.K2: "K2 and C"}.get(quantity, "TR")
    return said + ([f"{counted(lacking, 'test')} {'has' if lacking == 1 else 'have'} no {what}"] if lacking else [])


def transmissibility(results: Study, make: Callable[..., FigureData | None]) -> FigureData | None:
    """TR as measured; TR that K* and the rig give where V2 was not measured."""
    sheet = read_sheet(results, texts_only=True)
    if np.any(np.isfinite(sheet.values(q.TR_MEASURED.head))):
        return make(results, (q.TR_MEASURED,))
    found = make(results, (q.TR_PREDICTED,))
    return found and replace(found, notes=(*found.notes, "predicted from K* and the rig: V2 was not measured"))


_THROUGH = "the model's curve with its 95 % band through the tests with their standard uncertainties"
#: The two figures of the first page of a report.
FIRST = (
    FigureSpec(
        "first-stiffness",
        "Stiffness and loss",
        f"|K*| and the loss angle against frequency, {_THROUGH}.",
        data=partial(first, quantities=_STIFFNESS),
    ),
    FigureSpec(
        "first-tr",
        "Transmissibility",
        f"TR, the ratio of the motions above and below the specimen, against frequency, {_THROUGH}.",
        data=partial(transmissibility, make=first),
    ),
)
#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "stiffness",
        "How stiff is it, and how much does it lose?",
        f"|K*| and the loss angle against frequency, {_THROUGH}.",
        data=partial(by_frequency, quantities=_STIFFNESS),
    ),
    FigureSpec(
        "storage-loss",
        "What stores, what loses?",
        f"K' and K'' against frequency, {_THROUGH}; below, what the model leaves, with lines at ±2.",
        data=parts,
    ),
    FigureSpec(
        "arm",
        "Which spring and damper?",
        f"K2 and C against frequency, {_THROUGH}; those of the curve follow from K* of the model and K1 of the tests.",
        data=partial(by_frequency, quantities=_ARM),
    ),
    FigureSpec(
        "tr",
        "What passes through?",
        f"TR, the ratio of the motions above and below the specimen, against frequency, {_THROUGH}.",
        data=partial(transmissibility, make=by_frequency),
    ),
)
