"""The card that the report has of each test, to which its points lead; which lines of a test with many are shown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray, IntArray
from fourpole.core.checks import Verdict
from fourpole.fitting.rows import KEY, keyed
from fourpole.plot.data import Role, Series, Tone, kept
from fourpole.plot.part import part_of, parted_rows
from fourpole.plot.sheet import floats, means, texts
from fourpole.study.study import Study

#: Number of rows of a test, lines of its spectrum, above which they share a card.
MANY = 12
#: Number of lines that all tests with lines show together; each of them shows at least `MANY`.
_TOGETHER = 300
_CARDS = "cards"


def dynamic_cards(results: Study) -> list[str]:
    """The id of the card of each row of dynamic.csv; rows of a part have the ids that the whole results give.

    A test with more rows than `MANY` has one card, that of its first row.

    Examples
    --------
    >>> import polars as pl
    >>> dynamic_cards(Study(dynamic=pl.DataFrame({"test": ["D1", "D2"]})))
    ['dynamic-1', 'dynamic-2']
    """
    return kept(results, _CARDS, lambda: _dynamic_cards(results))


def _dynamic_cards(results: Study) -> list[str]:
    part = part_of(results)
    whole = results if part is None else part.whole
    tests = texts(whole.dynamic, "test")
    counts = Counter(tests)
    first: dict[str, int] = {}
    for at, test in enumerate(tests):
        first.setdefault(test, at)
    rows = range(len(tests)) if part is None else part.rows.tolist()
    return [f"dynamic-{(first[tests[at]] if counts[tests[at]] > MANY else at) + 1}" for at in rows]


def static_cards(results: Study) -> dict[str, str]:
    """The id of the card of each static test by its name."""
    part = part_of(results)
    whole = results if part is None else part.whole
    return {test: f"static-{at}" for at, test in enumerate(dict.fromkeys(texts(whole.static, "test")), 1)}


def linked(results: Study, series: Series, rows: Sequence[int] | IntArray) -> Series:
    """The series with the name and the card of the test of each of its points, by their rows of dynamic.csv."""
    cards, names = dynamic_cards(results), kept(results, "tests", lambda: texts(results.dynamic, q.TEST.head))
    return replace(series, tests=tuple(names[row] for row in rows), cards=tuple(cards[row] for row in rows))


def strided(results: Study) -> Study:
    """The results with a few lines of each test under random excitation or a sweep, evenly over log frequency.

    Lines that are rejected are left out where the test has others. The ids of the cards are those of the whole results.
    """
    return kept(results, "strided", lambda: _strided(results))


def _strided(results: Study) -> Study:
    rows = shown_rows(results)
    if rows.size == results.dynamic.height:
        return results
    dynamic = results.dynamic[rows]
    tables, keys = {**results.tables, "dynamic": dynamic}, keyed(dynamic).select(KEY)
    tests = set(results.dynamic[q.TEST.head].to_list())
    for name, table in results.tables.items():
        if name != "dynamic" and q.POINT.head in table.columns:
            other = table.filter(~pl.col(q.TEST.head).is_in(list(tests)))
            tables[name] = pl.concat([other, table.join(keys, on=KEY, how="semi")])
    made = replace(results, tables=tables)
    parted_rows(results, made, rows)
    cards = dynamic_cards(results)
    made.derived[_CARDS] = [cards[row] for row in rows.tolist()]
    return made


def shown_rows(results: Study) -> IntArray:
    """The rows of dynamic.csv that are shown."""
    table = results.dynamic
    if q.POINT.head not in table.columns:
        return np.arange(table.height)
    starts: dict[str, list[int]] = {}
    for at, test in enumerate(table[q.TEST.head].to_list()):
        starts.setdefault(test, []).append(at)
    frequency = floats(table, q.FREQUENCY.head)
    usable = (table[q.VERDICT.head] != Verdict.REJECTED).to_numpy() & np.isfinite(frequency)
    many = sum(len(rows) > MANY for rows in starts.values())
    most = max(MANY, _TOGETHER // max(many, 1))
    kept = [_chosen(np.array(rows), frequency, usable, most) for rows in starts.values()]
    return np.sort(np.concatenate(kept)) if kept else np.arange(0)


def _chosen(rows: IntArray, frequency: np.ndarray, usable: np.ndarray, most: int) -> IntArray:
    """Some of the rows of a test, those nearest to frequencies in equal ratios."""
    if rows.size <= most:
        return rows
    rows = rows[usable[rows]] if usable[rows].any() else rows
    return np.asarray(rows[in_equal_ratios(frequency[rows], most)])


def in_equal_ratios(frequency: FloatArray, most: int) -> IntArray:
    """Indices of at most so many frequencies [Hz], those nearest to frequencies in equal ratios.

    Examples
    --------
    >>> in_equal_ratios(np.arange(1.0, 101.0), 3).tolist()
    [0, 9, 99]
    """
    if frequency.size <= most:
        return np.arange(frequency.size)
    own = np.log(np.maximum(np.nan_to_num(frequency), 1e-300))
    wanted = np.linspace(own.min(), own.max(), most)
    return np.unique(np.abs(own[:, None] - wanted).argmin(axis=0))


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


def line_of(x: FloatArray, y: FloatArray, keys: IntArray, like: Series, std: FloatArray | None = None) -> list[Series]:
    """A line through the means of the points of equal key, with the look of another series; none without points.

    Values that are known to no better than 100 % by their uncertainties `std` are left out.
    """
    sure = np.ones(y.size, dtype=bool) if std is None else ~(std > np.abs(y))
    xs, ys = means(x[sure], y[sure], keys[sure].tolist())
    return [replace(like, role=Role.LINE, x=xs, y=ys)] if xs.size else []


def zero_line(x: FloatArray) -> Series:
    """A line at zero over some values of the abscissa, or about the only one."""
    low, high = float(x.min()), float(x.max())
    ends = (low, high) if high > low else (low - 0.1 * abs(low), low + 0.1 * abs(low))
    return Series(Role.LINE, np.array(ends), np.zeros(2), tone=Tone.INK)
