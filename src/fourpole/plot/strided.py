"""Some lines of the tests with many, so that a figure or a table has hundreds of marks, not thousands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray, IntArray
from fourpole.core.checks import Verdict
from fourpole.fitting.rows import KEY, keyed
from fourpole.plot.cardids import MANY, dynamic_cards, of_lines
from fourpole.plot.part import parted_rows
from fourpole.study.study import Study

#: Number of lines that all tests with lines show together; each of them shows at least `MANY`.
_TOGETHER = 300
_KEY = "strided"


def strided(results: Study) -> Study:
    """The results with a few lines of each test under random excitation or a sweep, evenly over log frequency.

    Lines that are rejected are left out where the test has others. The ids of the cards are those of the whole results.
    """
    if _KEY not in results.derived:
        results.derived[_KEY] = _strided(results)
    found: Study = results.derived[_KEY]
    return found


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
    of_lines(made, [cards[at] for at in rows.tolist()])
    return made


def shown_rows(results: Study) -> IntArray:
    """The rows of dynamic.csv that are shown."""
    table = results.dynamic
    if q.POINT.head not in table.columns:
        return np.arange(table.height)
    starts: dict[str, list[int]] = {}
    for at, test in enumerate(table[q.TEST.head].to_list()):
        starts.setdefault(test, []).append(at)
    frequency = table[q.FREQUENCY.head].cast(pl.Float64).fill_null(np.nan).to_numpy()
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
