"""The tests of a campaign as arrays, grouped by tyre, pressure, preload and frequency."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY, PRELOAD, PRESSURE, Axis
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.errors import RigError
from fourpole.plot.data import counted, kept, lacking, short_names
from fourpole.plot.part import Part, part_of, shown_name
from fourpole.quantities import Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

IntArray = NDArray[np.int64]
_T = TypeVar("_T")
#: Fields of a sheet with an entry for each test.
_BY_TEST = ("tyre", "pressure", "load", "frequency", "setting", "rejected")


@dataclass(frozen=True)
class Groups:
    """Distinct values of one axis of the condition in rising order, with their labels.

    The last value is not-a-number if there are tests that do not state the axis.
    """

    values: tuple[float, ...]
    labels: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.values)

    def stated(self) -> int:
        """Number of groups whose value is stated."""
        return sum(not math.isnan(value) for value in self.values)

    def nearest(self, value: float) -> int:
        """Number of the group whose value is nearest; 0 if no value is stated."""
        off = [abs(own - value) if not math.isnan(own) else math.inf for own in self.values]
        return off.index(min(off))


@dataclass(frozen=True, eq=False)
class Sheet(ByValue):
    """Dynamic tests of a campaign; the arrays have one entry per row of dynamic.csv.

    Attributes
    ----------
    table, static : polars.DataFrame
        dynamic.csv and static.csv; specimens tested at several temperatures have a name for each of them.
    names, labels : tuples of str
        Tyres in the order of their first appearance in the tables, and their names as figures show them.
    pressures, loads, frequencies : Groups
        Groups of the axes of the condition.
    tyre, pressure, load, frequency, setting : int arrays
        Number of the group of each test; frequency is -1 if the test has none. A setting is a rig with an added mass.
    settings : tuple of str
        Names of the settings; empty if there is only one.
    rejected : bool array
        True for tests with the verdict "rejected".
    """

    table: pl.DataFrame
    static: pl.DataFrame
    names: tuple[str, ...]
    labels: tuple[str, ...]
    pressures: Groups
    loads: Groups
    frequencies: Groups
    tyre: IntArray
    pressure: IntArray
    load: IntArray
    frequency: IntArray
    setting: IntArray
    settings: tuple[str, ...]
    rejected: BoolArray

    @cached_property
    def rigs(self) -> list[str]:
        """Name of the rig of each test."""
        return texts(self.table, "rig")

    @property
    def added(self) -> FloatArray:
        """Added mass of each test [kg]; 0 if the cell is blank."""
        return np.nan_to_num(self.values(q.ADDED_MASS.head))

    def where(self, **groups: int) -> BoolArray:
        """True for tests of the given groups: `tyre`, `pressure`, `load`, `frequency` or `setting`, by number."""
        mask = np.ones(self.tyre.size, dtype=bool)
        for name, group in groups.items():
            mask &= getattr(self, name) == group
        return mask

    def values(self, column: str) -> FloatArray:
        """A column of dynamic.csv as floats; a blank cell is not-a-number."""
        if column not in self._values:
            self._values[column] = floats(self.table, column)
            self._values[column].flags.writeable = False
        return self._values[column]

    @cached_property
    def _values(self) -> dict[str, FloatArray]:
        return {}

    def shown(self, quantity: Quantity) -> tuple[FloatArray, FloatArray]:
        """Values and standard uncertainties of a quantity in the unit of its axis."""
        return self.values(quantity.head) / quantity.scale, self.values(quantity.u_head) / quantity.scale

    @cached_property
    def massed(self) -> BoolArray:
        """True for tests whose condition was also tested with a smaller added mass: these tests show the rig."""
        added = self.added
        places = list(zip(self.tyre, self.pressure, self.load, self.rigs, strict=True))
        least: dict[object, float] = {}
        for place, mass in zip(places, added, strict=True):
            least[place] = min(mass, least.get(place, np.inf))
        return np.array([mass > least[place] for place, mass in zip(places, added, strict=True)], dtype=bool)

    def bare(self, what: str) -> tuple[BoolArray, list[str]]:
        """True for tests that are not `massed`, and a note on the others, if any; the added mass changes `what`."""
        massed = self.massed
        said = f"tests with an added mass have another {what} and are left out"
        return ~massed, [said] if np.any(massed) else []

    def name_of_load(self, at: int) -> str:
        """A load as a heading; empty if the tests state none."""
        return self.loads.labels[at] if self.loads.stated() or len(self.loads) > 1 else ""


def read_sheet(results: Study, *, texts_only: bool = False) -> Sheet:
    """The tests of a campaign in groups.

    A specimen tested at several temperatures, or at several values of a further axis, becomes several specimens;
    with `texts_only`, only axes whose values are texts part a specimen.
    """
    part = part_of(results)
    return kept(
        results,
        ("sheet", texts_only),
        lambda: (
            _sheet_of(results, texts_only=texts_only)
            if part is None
            else _rows_of(read_sheet(part.whole, texts_only=texts_only), part)
        ),
    )


def _rows_of(sheet: Sheet, part: Part) -> Sheet:
    """Some tests of a sheet; the numbers of specimens, pressures, preloads and frequencies stay."""
    arrays = {name: getattr(sheet, name)[part.rows] for name in _BY_TEST}
    names = [shown_name(part, name, label) for name, label in zip(sheet.names, sheet.labels, strict=True)]
    return replace(
        sheet, table=sheet.table[part.rows], static=sheet.static[part.static_rows], labels=short_names(names), **arrays
    )


def _sheet_of(results: Study, *, texts_only: bool) -> Sheet:
    """The tests in groups, as `read_sheet` has them."""
    results = results.apart(texts_only=texts_only)
    dynamic, static = results.dynamic, results.static
    names = tuple(dict.fromkeys([*texts(static, "tyre"), *texts(dynamic, "tyre")]))
    index = {name: at for at, name in enumerate(names)}
    count = dynamic.height
    both = np.concatenate([floats(dynamic, q.PRESSURE.head), floats(static, q.PRESSURE.head)])
    pressures, pressure = grouped(both, PRESSURE, _bar)
    loads, load = grouped(floats(dynamic, q.PRELOAD.head), PRELOAD, _newton)
    frequencies, frequency = grouped(floats(dynamic, q.FREQUENCY.head), FREQUENCY, _hertz)
    stated = frequencies.stated()
    setting, settings = _settings(dynamic)
    return Sheet(
        table=dynamic,
        static=static,
        names=names,
        labels=short_names(names),
        pressures=pressures,
        loads=loads,
        frequencies=Groups(frequencies.values[:stated], frequencies.labels[:stated]),
        tyre=np.array([index[name] for name in texts(dynamic, "tyre")], dtype=np.int64),
        pressure=pressure[:count],
        load=load,
        frequency=np.where(frequency < stated, frequency, -1),
        setting=setting,
        settings=settings,
        rejected=np.array([verdict == Verdict.REJECTED for verdict in texts(dynamic, "verdict")], dtype=bool),
    )


def grouped(values: FloatArray, axis: Axis, label: Callable[[float, int], str]) -> tuple[Groups, IntArray]:
    """Groups of values that are the same on an axis, and the number of the group of each value.

    The value of a group is the median of its members; `label` makes a text of it with a number of digits.
    """
    groups, middles = axis.middles(values)
    stated = [middle for middle in middles if not math.isnan(middle)]
    labels = [*_distinct_labels(stated, label), *["not stated"] * (len(middles) - len(stated))]
    return Groups(tuple(middles), tuple(labels)), groups


def _distinct_labels(values: Sequence[float], label: Callable[[float, int], str]) -> list[str]:
    """Labels with as few digits as make them different."""
    labels: list[str] = []
    for digits in (3, 4, 5, 6, 8, 12):
        labels = [label(value, digits) for value in values]
        if len(set(labels)) == len(labels):
            break
    return labels


def _bar(value: float, digits: int) -> str:
    return f"{value * 1e-5:.{digits}g} bar"


def _newton(value: float, digits: int) -> str:
    shown = f"{value:.{digits}g}"
    return f"{float(shown):.10g} N"


def _hertz(value: float, digits: int) -> str:
    """Frequency rounded to 0.5 Hz, if that changes it by at most 0.5 %: a drive runs slightly off its setting."""
    if digits == 3 and abs(round(2 * value) / 2 - value) <= 0.005 * abs(value):
        value = round(2 * value) / 2
    return f"{value:.{digits}g} Hz"


def _settings(table: pl.DataFrame) -> tuple[IntArray, tuple[str, ...]]:
    """Number of the setting of each test, and the names of the settings."""
    rigs = texts(table, "rig")
    added = np.nan_to_num(floats(table, q.ADDED_MASS.head))
    found = list(zip(rigs, [float(f"{mass:.4g}") for mass in added], strict=True))
    distinct = list(dict.fromkeys(found))
    if len(distinct) < 2:
        return np.zeros(len(found), dtype=np.int64), ()
    shown = dict(zip(dict.fromkeys(rigs), short_names(list(dict.fromkeys(rigs)), 14), strict=True))
    several = len(shown) > 1
    names = [", ".join([*([shown[rig]] if several else []), f"{mass:g} kg added"]) for rig, mass in distinct]
    return np.array([distinct.index(key) for key in found], dtype=np.int64), tuple(names)


def floats(table: pl.DataFrame, column: str) -> FloatArray:
    """A column as floats; a blank cell, and a column that does not exist, are not-a-number."""
    if column not in table.columns:
        return np.full(table.height, np.nan)
    values: FloatArray = np.array(table[column].cast(pl.Float64, strict=False).to_numpy(), dtype=float)
    values[~np.isfinite(values)] = np.nan
    return values


def texts(table: pl.DataFrame, column: str) -> list[str]:
    """A column as texts; a blank cell, and a column that does not exist, are empty texts."""
    if column not in table.columns:
        return [""] * table.height
    return [text or "" for text in table[column].to_list()]


def spread(count: int, most: int) -> list[int]:
    """At most `most` of the numbers below `count`, evenly spaced, with the first and the last."""
    if count <= most:
        return list(range(count))
    return sorted({round(i * (count - 1) / (most - 1)) for i in range(most)})


def few(values: Sequence[_T], most: int, what: str, notes: list[str]) -> list[_T]:
    """At most `most` of some values, evenly spaced; adds a note if these are not all."""
    shown = [values[index] for index in spread(len(values), most)]
    notes += not_all(len(shown), len(values), what)
    return shown


def leading(values: Sequence[_T], most: int, what: str, notes: list[str]) -> list[_T]:
    """The first of some values, at most `most`; adds a note if these are not all."""
    notes += not_all(min(most, len(values)), len(values), what)
    return list(values[:most])


def not_all(shown: int, number: int, what: str) -> list[str]:
    """The note that only some of several conditions are drawn, if so."""
    return [f"{shown} of {number} {what} shown"] if shown < number else []


def tests_said(rejected: BoolArray, visible: BoolArray, what: str) -> list[str]:
    """The numbers of rejected tests and of tests without a value; both masks have all tests of the figure."""
    count, hidden = int(rejected.sum()), int(np.sum(rejected & ~visible))
    lost = f"{counted(count, 'test')} rejected" + (f", {hidden} not shown: no value" if hidden else "")
    return [*([lost] if count else []), *lacking(int(np.sum(~rejected & ~visible)), what)]


def present(groups: IntArray, mask: BoolArray) -> Iterator[int]:
    """Numbers of the groups that occur among the tests of a mask, in rising order."""
    return (int(group) for group in np.unique(groups[mask]))


def means(x: FloatArray, y: FloatArray, keys: Iterable[int] | None = None) -> tuple[FloatArray, FloatArray]:
    """Means of the points with equal key, in rising order of x; without keys, the points themselves."""
    known = np.isfinite(x) & np.isfinite(y)
    if keys is None:
        x, y = x[known], y[known]
    else:
        groups = np.asarray(list(keys))[known]
        _, place = np.unique(groups, return_inverse=True)
        count = np.bincount(place) if place.size else np.ones(0)
        x = np.bincount(place, x[known]) / count if place.size else x[known]
        y = np.bincount(place, y[known]) / count if place.size else y[known]
    order = np.argsort(x, kind="stable")
    return x[order], y[order]


def rig_stated(stated: Mapping[str, Any]) -> Rig | None:
    """A rig from its statement in study.json; None if the statement is not valid."""
    try:
        values: dict[str, Any] = {name: float(stated[name]["value"]) for name in PARAMETERS if stated.get(name)}
        return Rig(**values, blocked=stated.get("output") == "blocked")
    except (RigError, AttributeError, KeyError, TypeError, ValueError):
        return None


def rigs_stated(results: Study, sheet: Sheet) -> dict[str, Rig | None]:
    """The stated rig of each name in dynamic.csv; None if there is no valid statement."""
    stated = section(results.record, "stated", "rigs")
    return {name: rig_stated(stated[name]) if name in stated else None for name in set(sheet.rigs)}


def phasors(sheet: Sheet, rig: Rig | None, at: IntArray) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """F1 at the contact [N], V1 and V2 [m/s] of some tests; V1 has the phase 0.

    The force transducer also accelerates the input mass of the rig, so its inertia force is subtracted.
    """
    omega, v1 = 2 * np.pi * sheet.values(q.FREQUENCY.head)[at], sheet.values(q.V1.head)[at]
    cell, v2 = (
        (sheet.values(size.head) * np.exp(1j * sheet.values(phase.head)))[at]
        for size, phase in ((q.F1, q.PHASE_F1), (q.V2, q.PHASE_V2))
    )
    return cell - 1j * omega * v1 * (rig.input_mass if rig else 0.0), v1, v2
