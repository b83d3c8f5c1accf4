"""Any quantity over any axis: the tests with their uncertainties, a curve for each of the other conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import partial
from itertools import chain

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import AMPLITUDE, AXES, FREQUENCY, PRELOAD, PRESSURE, Axis
from fourpole.errors import CampaignError
from fourpole.fitting.rows import rule_in
from fourpole.plot.cards import dynamic_cards, line_of, static_cards
from fourpole.plot.data import AxisData, FigureData, FigureSpec, Panel, Role, Series, counted
from fourpole.plot.frequency import Shown, by_frequency, chosen_curves, common
from fourpole.plot.sheet import Sheet, few, floats, read_sheet, texts
from fourpole.plot.states import State, axis_shown, by_tyre, values_of
from fourpole.quantities import Quantity
from fourpole.study.study import Study
from fourpole.units import shown as quoted

#: Largest number of specimens in a figure, and of panels in a row.
_MOST_TYRES, _MOST_COLUMNS = 6, 3
#: Joins the quantity and the axis in the key of a figure.
_OVER = "-over-"
#: The axis that is the place of a test in tests.csv.
ORDER = "order"
#: What lines are, on other axes and over frequency.
_LINES = ("lines join tests that differ in nothing else", "curves are the model's, with their 95 % band")
_ORDER = AxisData("number of the test in its table", "1")
#: Axes by the names that commands take.
OVER: dict[str, Axis | None] = {one.name: one for one in (FREQUENCY, *AXES, AMPLITUDE)} | {ORDER: None}
#: Quantities of dynamic tests, and of static ones; K1 is in both tables.
_DYNAMIC = (
    q.MODULUS, q.LOSS_ANGLE, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C, q.TR_MEASURED, q.TR_PREDICTED, q.R, q.I, q.F1,
    q.V1, q.V2, q.PHASE_F1, q.PHASE_V2, q.DEFLECTION_AMPLITUDE, q.TEMPERATURE, q.PRESSURE, q.PRELOAD, *q.DERIVED,
)  # fmt: skip
_STATIC = (q.K1, q.SECANT, q.K1_LOADING, q.K1_UNLOADING, q.GAP, q.CYCLE_LOSS, q.NONLINEARITY, q.BRANCH_TIME)
#: Quantities that a figure may show, by their keys.
SHOWN: dict[str, Quantity] = {one.key: one for one in (*_DYNAMIC, *_STATIC)}


def quantity_named(text: str) -> Quantity:
    """A quantity by its key, symbol, column or name on an axis: "k2", "K2", "Re K*", "K'".

    Raises
    ------
    CampaignError
        If there is none, with the nearest name.

    Examples
    --------
    >>> quantity_named("Re K*").key, quantity_named("loss factor").key, quantity_named("TR").key
    ('storage', 'loss_factor', 'tr_measured')
    """
    names: dict[str, Quantity] = {}
    for one in SHOWN.values():
        for name in (one.key, one.symbol, one.column, one.name):
            names.setdefault(name, one)
    found = names.get(text) or {name.lower(): one for name, one in reversed(names.items())}.get(text.lower())
    if found is None:
        near = get_close_matches(text, names, n=1)
        hint = (
            f"did you mean {near[0]}?" if near else f"choose one of {', '.join(one.symbol for one in SHOWN.values())}"
        )
        raise CampaignError(f"no quantity {quoted(text)}: {hint}")
    return found


def key_over(quantity: str, axis: str) -> str:
    """The key of the figure of a quantity over an axis, by their names.

    Raises
    ------
    CampaignError
        If there is no such quantity or axis.

    Examples
    --------
    >>> key_over("K2", "pressure")
    'k2-over-pressure'
    """
    if axis not in OVER:
        near = get_close_matches(axis, OVER, n=1)
        hint = f"did you mean {near[0]}?" if near else f"choose one of {', '.join(OVER)}"
        raise CampaignError(f"no axis {quoted(axis)}: {hint}")
    return f"{quantity_named(quantity).key}{_OVER}{axis}"


def spec_over(key: str) -> FigureSpec | None:
    """The figure of a key that `key_over` made; None for another key."""
    name, mark, axis = key.partition(_OVER)
    if not mark or name not in SHOWN or axis not in OVER:
        return None
    quantity = SHOWN[name]
    over = OVER[axis]
    abscissa = "the order of the tests" if over is None else axis_shown(over.column, q.ShownUnits())[0]
    return FigureSpec(
        key,
        f"{quantity.start} over {abscissa}",
        f"Each test with U (k = 2) where it is known; {_LINES[axis == FREQUENCY.name]}.",
        data=partial(quantity_over, quantity=quantity, over=axis),
    )


def quantity_over(results: Study, *, quantity: Quantity, over: str) -> FigureData | None:
    """A quantity of the tests over an axis, a panel per specimen; None if no test has both.

    Over frequency the model's curve is drawn through the tests. On other axes a line joins the tests of which all else
    is the same; up to six have their condition at their ends, more have a colour scale.

    Parameters
    ----------
    results : Study
    quantity : Quantity
        One of `SHOWN`.
    over : str
        One of `OVER`.
    """
    if over == FREQUENCY.name and quantity not in _STATIC[1:]:
        return by_frequency(results, (quantity,))
    tests = _tests(results, quantity, over)
    sheet = read_sheet(results, texts_only=True)
    found, joined = _lines(results, sheet, tests, over)
    if not found:
        return None
    notes: list[str] = []
    groups = by_tyre(found)
    tyres = few(list(groups), _MOST_TYRES, "specimens", notes)
    curves, scale, dashes = chosen_curves(results, {tyre: groups[tyre] for tyre in tyres}, notes)
    panels = [_panel(results, tests, quantity, curves[tyre], over, joined=joined) for tyre in tyres]
    headed = tuple(
        replace(panel, title=sheet.labels[tyre], tyre=tyre) for panel, tyre in zip(panels, tyres, strict=True)
    )
    said = [*common(results, [curve.state for curve in chain(*curves.values())]), *notes]
    lost, lacking = int(tests.rejected.sum()), int(np.sum(~tests.known & ~tests.rejected))
    said += [f"{counted(lost, 'test')} rejected"] if lost else []
    said += [f"{counted(lacking, 'test')} without a value on both axes"] if lacking else []
    return FigureData(
        headed, min(_MOST_COLUMNS, len(headed)), sheet.labels, scale=scale, dashes=dashes if joined else (),
        notes=tuple(said), aligned=True, panel_height=2.6 if len(headed) <= _MOST_COLUMNS else 1.9,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Tests:
    """The tests of one table: values on both axes in SI and in the unit of the ordinate, and what they are."""

    table: pl.DataFrame
    x: FloatArray
    y: FloatArray
    std: FloatArray
    rejected: BoolArray
    names: list[str]
    cards: list[str]

    @property
    def known(self) -> BoolArray:
        return np.asarray(np.isfinite(self.x) & np.isfinite(self.y))


def _tests(results: Study, quantity: Quantity, over: str) -> _Tests:
    """The tests that have the quantity: static ones where it is theirs, else dynamic ones."""
    sheet = read_sheet(results, texts_only=True)
    own = floats(sheet.static, quantity.head)
    dynamic_only = over in (FREQUENCY.name, AMPLITUDE.name)
    if quantity in _STATIC and not dynamic_only and (np.isfinite(own).any() or quantity is not q.K1):
        ids = static_cards(results)
        table, y, std = sheet.static, own / quantity.scale, floats(sheet.static, quantity.u_head) / quantity.scale
        cards = [ids.get(name, "") for name in texts(table, q.TEST.head)]
    else:
        table, (y, std), cards = sheet.table, values_of(sheet, quantity), dynamic_cards(results)
    axis = OVER[over]
    names = texts(table, q.TEST.head)
    x = _numbers(names) if axis is None else _values(table, axis)
    rejected = np.array([one == Verdict.REJECTED for one in texts(table, q.VERDICT.head)], dtype=bool)
    return _Tests(table, x, y, std, rejected, names, cards)


def _numbers(names: Sequence[str]) -> FloatArray:
    """The number of each row's test, from 1."""
    places = {name: float(at) for at, name in enumerate(dict.fromkeys(names), start=1)}
    return np.array([places[name] for name in names])


def _values(table: pl.DataFrame, axis: Axis) -> FloatArray:
    own = f"{axis.column} (tests.csv)"
    return floats(table, own if own in table.columns else axis.column)


def _lines(results: Study, sheet: Sheet, tests: _Tests, over: str) -> tuple[list[State], bool]:
    """The tests of each line, with the values on the other axes, and whether a line joins them.

    A line has the tests that differ in nothing but the axis. Where few differ in nothing else, as amplitudes that come
    as they do, the frequency may differ, too, and no line is drawn.
    """
    wanted = OVER[over]
    axes = [axis for axis in rule_in(results.record).axes if not axis.text and axis != wanted]
    if wanted is not None:
        found = _by_condition(sheet, tests, axes if wanted == FREQUENCY else [*axes, FREQUENCY])
        several = [np.unique(tests.x[one.rows & tests.known]).size > 1 for one in found]
        if wanted != AMPLITUDE or 2 * sum(several) > len(several):
            return found, True
    return _by_condition(sheet, tests, axes), False


def _by_condition(sheet: Sheet, tests: _Tests, axes: Sequence[Axis]) -> list[State]:
    """The tests that are the same on some axes."""
    stated = [(axis, values) for axis in axes if np.isfinite(values := _values(tests.table, axis)).any()]
    grouped = [axis.middles(values) for axis, values in stated]
    index = {name: at for at, name in enumerate(sheet.names)}
    tyres = np.array([index.get(name, 0) for name in texts(tests.table, q.TYRE.head)], dtype=np.int64)
    keys = np.stack([tyres, *(groups for groups, _ in grouped)], axis=1)
    made = []
    for key in np.unique(keys, axis=0):
        middles = (values[at] for (_, values), at in zip(grouped, key[1:].tolist(), strict=True))
        place = dict(zip((axis.column for axis, _ in stated), middles, strict=True))
        rows = np.all(keys == key, axis=1)
        if np.any(tests.known & rows):
            made.append(State(int(key[0]), *_ranks(sheet, place), place, rows))
    return made


def _ranks(sheet: Sheet, place: Mapping[str, float]) -> tuple[int, int]:
    """Numbers of the pressure and of the preload, which set marker and line style."""
    return tuple(
        0 if np.isnan(place.get(axis.column, np.nan)) else groups.nearest(place[axis.column])
        for axis, groups in ((PRESSURE, sheet.pressures), (PRELOAD, sheet.loads))
    )  # type: ignore[return-value]


def _panel(
    results: Study, tests: _Tests, quantity: Quantity, curves: Iterable[Shown], over: str, *, joined: bool
) -> Panel:
    """The tests of one specimen, a line through those of each condition."""
    axis, seen = OVER[over], results.shown.of(quantity)
    abscissa, unit = _ORDER, 1.0
    if axis is not None:
        name, text, unit = axis_shown(axis.column, results.shown)
        abscissa = AxisData(name, text)
    scale = quantity.scale / seen.scale
    x, y, std = tests.x / unit, tests.y * scale, tests.std * scale
    series: list[Series] = []
    for one in curves:
        marks, here = one.look, tests.known & one.state.rows
        used, lost = here & ~tests.rejected, here & tests.rejected
        lines: list[Series] = []
        if joined and axis is not None and used.any():
            groups, _ = axis.middles(np.where(used, tests.x, np.nan))
            lines = [line for line in line_of(x[used], y[used], groups[used], marks) if line.x.size > 1]
        series += [replace(line, label=one.label) for line in lines]
        label = "" if lines else one.label
        series += _points(tests, used, x, y, std, replace(marks, label=label))
        series += _points(tests, lost, x, y, std, replace(marks, role=Role.REJECTED))
    return Panel(abscissa, AxisData.of(seen), tuple(series))


def _points(
    tests: _Tests, rows: BoolArray, x: FloatArray, y: FloatArray, std: FloatArray, like: Series
) -> list[Series]:
    """Some tests as points that lead to their cards, by rising abscissa."""
    at = np.flatnonzero(rows)
    if not at.size:
        return []
    at = at[np.argsort(x[at], kind="stable")]
    names, cards = tuple(tests.names[i] for i in at), tuple(tests.cards[i] for i in at)
    return [replace(like, x=x[at], y=y[at], spread=std[at], tests=names, cards=cards)]
