"""The table with which an analysis ends in the terminal: each condition in a line of at most 80 characters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from textwrap import wrap

from fourpole import quantities as q
from fourpole.app.console import GAP, line_of, more
from fourpole.findings.conformity import Decision
from fourpole.findings.summary import MOST_CONDITIONS, SummaryRow, bounded, summary
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity, ShownUnits
from fourpole.report.digits import in_unit, with_interval
from fourpole.report.words.sentence import short_lines
from fourpole.study.study import Study

_SHOWN = (q.K1, MODULUS, LOSS_ANGLE, q.K2, q.C)
#: Width of a terminal.
_WIDTH = 80
#: Most rows; the tables have them all.
_MOST = 15
#: Lines of the table; conditions that need more are shown as ranges.
_MOST_LINES = 22
#: Characters of a specimen's name that stands in a row.
_LONGEST = 24


def summary_lines(results: Study, of: str | None = None) -> list[str]:
    """The lines of the table, and a sentence for each specimen with a mass, or `of` one; none without a test in use."""
    every = [row for row in summary(results, most=None) if of in (None, row.specimen)]
    lines = _lines(bounded(every, MOST_CONDITIONS), results.shown)
    if len(lines) > _MOST_LINES:
        rows = bounded(every, 0)
        found = (_lines(rows, results.shown, most) for most in range(_MOST, 0, -1))
        lines = next(lines for lines in found if len(lines) <= _MOST_LINES)
    masses = [f"{line}; K* is that of its springs" for line in short_lines(results, of)]
    return [*lines, *(part for line in masses for part in wrap(line, _WIDTH, subsequent_indent=" "))]


def limit_lines(results: Study, held: Sequence[Decision]) -> list[str]:
    """The verdict on the limits in one line; none where no limits are stated."""
    if not held:
        return []
    from fourpole.report.front import verdict_line  # with the words of the report

    verdict = verdict_line(results, held)
    return [f"limits: {verdict.word}: {verdict.text}"]


def _lines(rows: Sequence[SummaryRow], units: ShownUnits, most: int = _MOST) -> list[str]:
    """A line for each of the first rows, below the name of its specimen if that has several rows."""
    if not rows:
        return []
    ranges = any(low is not high for row in rows for low, high in row.values.values())
    shown, quantities = rows[:most], [units.of(one) for one in _SHOWN]
    alone = len({_cut(row.specimen) for row in rows}) == len(rows) > 1
    heads = ["", *(f"{one.symbol} [{one.shown}]" for one in quantities)]
    made = ([_label(row, units, alone=alone), *(_cell(row, one, ranges=ranges) for one in quantities)] for row in shown)
    table = [heads, *made]
    lines = [_title(rows, units, ranges=ranges, alone=alone)]
    for part in _fitting(table, [at for at, cells in enumerate(zip(*table[1:], strict=True)) if at == 0 or any(cells)]):
        widths = [max(len(row[at]) for row in table) for at in part]
        before = None
        for named, row in zip([None, *(one.specimen for one in shown)], table, strict=True):
            if named != before and not alone:
                lines.append(" ".join(named.split())[:_WIDTH] if named else "")
            before = named
            lines.append(line_of([row[at] for at in part], widths))
    return [*lines, *more(rows, most, " rows: see the report")]


def _title(rows: Sequence[SummaryRow], units: ShownUnits, *, ranges: bool, alone: bool) -> str:
    """What the numbers are: their frequency and uncertainty, and the condition that all have if no row names it."""
    ends = [end for row in rows if row.frequency for end in row.frequency]
    low, high = min(ends, default=0.0), max(ends, default=0.0)
    at = f"{low:.4g} Hz" if low == high else f"{low:.4g} to {high:.4g} Hz"
    if not ends:
        at = "static tests"
    places = {tuple(_places(row, units)) for row in rows}
    if alone and len(places) == 1:
        at = ", ".join([at, *places.pop()])
    opening = f"At {at}" if ends else at[:1].upper() + at[1:]
    return f"{opening}, lowest to highest of all conditions:" if ranges else f"{opening}; ± is U (k = 2):"


def _label(row: SummaryRow, units: ShownUnits, *, alone: bool) -> str:
    """The specimen of a row that is its only one, otherwise the condition in words; and the number of tests if several.

    A long name is cut in the middle.
    """
    name = _cut(row.specimen)
    text = name if alone else f" {' '.join(_places(row, units)) or name}"
    return f"{text} ({len(row.tests)})" if len(row.tests) > 1 else text


def _cut(name: str) -> str:
    """A name in one line, a long one cut in the middle."""
    line = " ".join(name.split())
    return line if len(line) <= _LONGEST else f"{line[:14]}…{line[-8:]}"


def _places(row: SummaryRow, units: ShownUnits) -> list[str]:
    """Pressure and preload of a row in words; one that is not stated, or a range, is left out."""
    stated = ((row.pressure, q.PRESSURE), (row.preload, q.PRELOAD))
    return [units.text(quantity, ends[0]) for ends, quantity in stated if ends is not None and ends[0] == ends[1]]


def _cell(row: SummaryRow, quantity: Quantity, *, ranges: bool) -> str:
    """A value with U, a skewed interval, or the lowest and the highest value."""
    if quantity.key not in row.values:
        return ""
    low, high = row.values[quantity.key]
    if ranges:
        stds = [min(one.std, 0.25 * abs(one.value)) for one in (low, high)]
        made = (in_unit(replace(one, std=std), quantity)[0] for one, std in zip((low, high), stds, strict=True))
        first, last = _as_exact(*made)
        return first if first == last else f"{first}..{last}"
    if quantity.key in row.intervals:
        ends = (one / quantity.scale for one in row.intervals[quantity.key])
        return with_interval(low.value / quantity.scale, *ends)[1].replace("above ", ">").replace(" to ", "..")
    value, reach = in_unit(low, quantity)
    return f"{value}±{reach}" if reach else value


def _as_exact(first: str, last: str) -> tuple[str, str]:
    """Two numbers to the decimals of the one that has fewer, and to at most four figures."""
    if "×" in first + last:
        return first, last
    whole, _, _ = max(first.lstrip("−-"), last.lstrip("−-"), key=len).partition(".")
    decimals = min(max(4 - len(whole), 0), *(len(one.partition(".")[2]) for one in (first, last)))
    rounded = (f"{float(one.replace('−', '-')):.{decimals}f}".replace("-", "−") for one in (first, last))
    return next(rounded), next(rounded)


def _fitting(table: Sequence[Sequence[str]], used: Sequence[int]) -> list[list[int]]:
    """The columns in as many parts as a terminal needs; each part begins with the first column."""
    first, *others = used
    parts: list[list[int]] = [[first]]
    for at in others:
        widths = [max(len(row[one]) for row in table) + GAP for one in (*parts[-1], at)]
        if sum(widths) - GAP > _WIDTH and len(parts[-1]) > 1:
            parts.append([first])
        parts[-1].append(at)
    return parts
