"""The table with which an analysis ends in the terminal: each condition in a line of at most 80 characters."""

from __future__ import annotations

from collections.abc import Sequence
from math import isinf

from fourpole import quantities as q
from fourpole.findings.conformity import Judged
from fourpole.findings.facts import Measured
from fourpole.findings.summary import SummaryRow, summary
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity, ShownUnits
from fourpole.report.conformity import verdict_line
from fourpole.report.digits import number
from fourpole.study.results import Results

_SHOWN = (q.K1, MODULUS, LOSS_ANGLE, q.K2, q.C)
#: Width of a terminal, and blanks between columns.
_WIDTH, _GAP = 80, 2
#: Most specimens that have a row; the tables have them all.
_MOST = 15
#: Lines of the table; conditions that need more are shown as ranges.
_MOST_LINES = 22
#: Coverage factor of the uncertainty shown.
_COVERAGE = 2.0


def summary_lines(results: Results) -> list[str]:
    """The lines of the table; none without a dynamic test in use."""
    lines = _lines(summary(results), results.shown)
    return lines if len(lines) <= _MOST_LINES else _lines(summary(results, most=0), results.shown)


def limit_lines(results: Results, held: Sequence[Judged]) -> list[str]:
    """The verdict on the limits in one line; none where no limits are stated."""
    if not held:
        return []
    verdict = verdict_line(results, held)
    return [f"limits: {verdict.word}: {verdict.text}"]


def _lines(rows: Sequence[SummaryRow], units: ShownUnits) -> list[str]:
    if not rows:
        return []
    ranges = any(low is not high for row in rows for low, high in row.values.values())
    shown, quantities = rows[:_MOST], [units.of(one) for one in _SHOWN]
    alone = ranges and len({row.specimen for row in rows}) == len(rows)
    heads = ["", *(f"{one.symbol} [{one.suffix or one.shown}]" for one in quantities)]
    made = ([_condition(row, units), *(_cell(row, one, ranges=ranges) for one in quantities)] for row in shown)
    table = [heads, *made]
    lines = [_title(rows, ranges=ranges)]
    for part in _fitting(table, [at for at, cells in enumerate(zip(*table[1:], strict=True)) if at == 0 or any(cells)]):
        widths = [max(len(row[at]) for row in table) for at in part]
        before = None
        for named, row in zip([None, *(one.specimen for one in shown)], table, strict=True):
            if named != before and not alone:
                lines.append(named or "")
            before = named
            cells = [row[0].ljust(widths[0]), *(row[at].rjust(w) for at, w in zip(part[1:], widths[1:], strict=True))]
            lines.append((" " * _GAP).join(cells).rstrip())
    if len(rows) > _MOST:
        lines.append(f"... and {len(rows) - _MOST} more specimens: see the report")
    return lines


def _title(rows: Sequence[SummaryRow], *, ranges: bool) -> str:
    """What the numbers are: their frequency and uncertainty."""
    low, high = min(row.frequency[0] for row in rows), max(row.frequency[1] for row in rows)
    at = f"{low:.4g} Hz" if low == high else f"{low:.4g} to {high:.4g} Hz"
    return f"At {at}, lowest to highest of all conditions:" if ranges else f"At {at}; ± is U (k = 2):"


def _condition(row: SummaryRow, units: ShownUnits) -> str:
    """The condition in words; of several conditions the specimen and their number of tests."""
    parts = []
    for stated, quantity in ((row.pressure, q.PRESSURE), (row.preload, q.PRELOAD)):
        if stated is not None and stated[0] == stated[1]:
            parts.append(units.text(quantity, stated[0]))
    count = len(row.tests)
    return f" {' '.join(parts) or row.specimen}{f' ({count})' if count > 1 else ''}"


def _cell(row: SummaryRow, quantity: Quantity, *, ranges: bool) -> str:
    """A value with U, a skewed interval, or the lowest and the highest value."""
    if quantity.key not in row.values:
        return ""
    low, high = row.values[quantity.key]
    if ranges:
        first, last = (_with_expanded(one, quantity)[0] for one in (low, high))
        return first if first == last else "..".join(_as_exact(first, last))
    if quantity.key in row.intervals:
        least, most = (one / quantity.scale for one in row.intervals[quantity.key])
        return f">{number(least, 3)}" if isinf(most) else f"{number(least, 3)}..{number(most, 3)}"
    value, expanded = _with_expanded(low, quantity)
    return f"{value}±{expanded}" if expanded else value


def _as_exact(first: str, last: str) -> tuple[str, str]:
    """Two numbers to the decimals of the one that has fewer."""
    if "×" in first + last:
        return first, last
    decimals = min(len(one.partition(".")[2]) for one in (first, last))
    rounded = (f"{float(one.replace('−', '-')):.{decimals}f}".replace("-", "−") for one in (first, last))
    return next(rounded), next(rounded)


def _with_expanded(measured: Measured, quantity: Quantity) -> tuple[str, str]:
    """A value and U in the unit shown, to the second digit of U if its first is 1 or 2, otherwise to the first."""
    value, expanded = measured.value / quantity.scale, _COVERAGE * measured.std / quantity.scale
    if not 1e-9 < expanded < 1e7:
        return number(value), ""
    leading = f"{expanded:.0e}"
    decimals = max(0, -int(leading[2:]) + (leading[0] in "12"))
    return f"{value:.{decimals}f}".replace("-", "−"), f"{expanded:.{decimals}f}"


def _fitting(table: Sequence[Sequence[str]], used: Sequence[int]) -> list[list[int]]:
    """The columns in as many parts as a terminal needs; each part begins with the first column."""
    first, *others = used
    parts: list[list[int]] = [[first]]
    for at in others:
        widths = [max(len(row[one]) for row in table) + _GAP for one in (*parts[-1], at)]
        if sum(widths) - _GAP > _WIDTH and len(parts[-1]) > 1:
            parts.append([first])
        parts[-1].append(at)
    return parts
