"""Curves packed into few characters; the card of a test with many lines, as curves over frequency and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.core.checks import VERDICTS, Verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.findings.list import CheckRow, kind_of
from fourpole.fitting.rows import KEY, Key, keyed, keys_of
from fourpole.plot.cards import in_equal_ratios
from fourpole.quantities import Quantity
from fourpole.report.digits import known, number, shown_as
from fourpole.report.rows import texts, words

#: Two of these characters are one sample of a curve: 4095 levels between its extremes, and one for a missing sample.
ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
_LEVELS = 4094
_PAIRS = np.array([a + b for a in ALPHABET for b in ALPHABET])


def extremes(values: NDArray[np.float64]) -> tuple[float, float]:
    """Least and largest value; zeros if none is known."""
    seen = values[np.isfinite(values)]
    return (float(seen.min()), float(seen.max())) if seen.size else (0.0, 0.0)


def packed(values: NDArray[np.float64], low: float | None = None, high: float | None = None) -> list[float | str]:
    """A curve as its extremes and two characters per sample.

    Parameters
    ----------
    values : (n,) float array
        Not-a-number is kept as missing.
    low, high : float, optional
        Extremes to share with other curves; by default the curve's own.

    Returns
    -------
    list
        Least value, value of one level, text.
    """
    if low is None or high is None:
        low, high = extremes(values)
    step = (high - low) / _LEVELS
    level = np.zeros(values.size) if step == 0 else (values - low) / step
    index = np.where(np.isfinite(values), np.clip(np.rint(level), 0, _LEVELS), _LEVELS + 1).astype(int)
    return [float(f"{low:.8g}"), float(f"{step:.8g}"), "".join(_PAIRS[index].tolist())]


#: Most lines of a curve, and rows of the table of a card.
_CURVE, _ROWS = 400, 12
#: Most remarks of a card, those of most lines first.
_REMARKS = 6
#: Quantities over frequency with their expanded uncertainty, each a panel.
_PANELS = (q.STORAGE, q.LOSS, q.C)
#: Columns of the table, and values of a test that all of its lines have.
_TABLE = (q.FREQUENCY, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
_COMMON = (q.DEFLECTION_AMPLITUDE, q.K1)


def line_body(rows: pl.DataFrame, lines: pl.DataFrame, checks: Mapping[Key, Sequence[CheckRow]]) -> dict[str, Any]:
    """The data of the card: rows of dynamic.csv and of lines.csv of one test, which may have none, and its checks."""
    frequency = _floats(rows, q.FREQUENCY.head)
    kept = in_equal_ratios(frequency, _CURVE).tolist()
    panels = [one for quantity in map(shown_as, _PANELS) if (one := _panel(rows[kept], quantity))]
    seen = rows.select(KEY).join(lines, on=KEY, how="left") if lines.height else rows.select(KEY)
    panels += [one for one in (_coherence(seen[kept]), _closure(seen[kept])) if one]
    first = rows.row(0, named=True)
    counts = rows[q.VERDICT.head].to_list()
    facts = [["lines", str(rows.height)]]
    facts += [[f"lines {verdict}", str(counts.count(verdict))] for verdict in VERDICTS if verdict in counts]
    facts += [[name, said] for name, said in _ranges(seen)]
    facts += [[one.symbol, said] for one in _COMMON if (said := words(one, first))]
    facts += [[name, str(first[name])] for name in ("rig", "route") if first.get(name)]
    used = np.flatnonzero((rows[q.VERDICT.head] != Verdict.REJECTED).to_numpy())
    every = used if used.size else np.arange(rows.height)
    few = rows[every[in_equal_ratios(frequency[every], _ROWS)].tolist()].rows(named=True)
    columns = [one for one in _TABLE if any(known(row.get(one.head)) is not None for row in few)]
    return {
        "facts": facts,
        "remarks": _remarks(rows, checks),
        "lines": {"f": packed(np.log10(frequency[kept])), "panels": panels},
        "table": {
            "heads": [f"{one.symbol} [{one.shown}]" for one in map(shown_as, columns)] + ["verdict"],
            "rows": [[_cell(row, one) for one in columns] + [str(row[q.VERDICT.head])] for row in few],
            "of": rows.height,
        },
    }


def band_words(rows: pl.DataFrame) -> str:
    """The frequencies and the number of the lines of a test: 5.23 to 199.5 Hz, 257 lines."""
    frequency = _floats(rows, q.FREQUENCY.head)
    if not np.isfinite(frequency).any():
        return f"{rows.height} lines"
    return f"{number(np.nanmin(frequency))} to {number(np.nanmax(frequency))} Hz, {rows.height} lines"


def _panel(rows: pl.DataFrame, quantity: Quantity) -> dict[str, Any]:
    """A curve with the ends of its interval; empty if no line has a value. Rejected lines are missing."""
    used = (rows[q.VERDICT.head] != Verdict.REJECTED).to_numpy()
    value = np.where(used, _floats(rows, quantity.head), np.nan) / quantity.scale
    reach = COVERAGE_FACTOR * np.where(used, _floats(rows, quantity.u_head), np.nan) / quantity.scale
    if np.isfinite(value).sum() < 2:
        return {}
    room = _limits(value, reach)
    return {
        "title": f"{quantity.symbol} with U (k = {COVERAGE_FACTOR:g})", "unit": quantity.shown,
        "v": packed(value), "u": packed(reach), "room": room,
    }  # fmt: skip


def _limits(value: NDArray[np.float64], reach: NDArray[np.float64]) -> list[float]:
    """Ends of the axis: those of the well-known lines, so that one uncertain line does not flatten the rest."""
    sure = np.isfinite(value) & (reach <= 4.0 * np.nanmedian(reach)) if np.isfinite(reach).any() else np.isfinite(value)
    sure = sure if sure.sum() > 1 else np.isfinite(value)
    low, high = (value - np.nan_to_num(reach))[sure].min(), (value + np.nan_to_num(reach))[sure].max()
    return [float(f"{low:.6g}"), float(f"{high:.6g}")]


def _coherence(lines: pl.DataFrame) -> dict[str, Any]:
    found = [(one, _floats(lines, one.head)) for one in q.COHERENCES if one.head in lines.columns]
    curves = [{"name": one.symbol, "v": packed(values)} for one, values in found if np.isfinite(values).sum() > 1]
    return {"title": "coherence", "unit": "1", "curves": curves, "room": [0.0, 1.0]} if curves else {}


def _closure(lines: pl.DataFrame) -> dict[str, Any]:
    if q.CLOSURE_PHASE.head not in lines.columns:
        return {}
    value = np.degrees(_floats(lines, q.CLOSURE_PHASE.head))
    reach = COVERAGE_FACTOR * np.degrees(_floats(lines, q.CLOSURE_PHASE.u_head))
    if np.isfinite(value).sum() < 2:
        return {}
    most = float(np.nanquantile(np.abs(value) + reach, 0.9))
    return {
        "title": "closure phase with U about zero", "unit": "°", "v": packed(value), "u": packed(reach), "zero": True,
        "room": [-most, most],
    }  # fmt: skip


def _ranges(lines: pl.DataFrame) -> list[tuple[str, str]]:
    """Width and number of averages of the lines."""
    found = []
    for one in (q.WIDTH, q.AVERAGES):
        values = _floats(lines, one.head)
        if np.isfinite(values).any():
            ends = [number(float(end), 3) for end in (np.nanmin(values), np.nanmax(values))]
            unit = f" {one.suffix}" if one.suffix else ""
            found.append((one.symbol, (ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}") + unit))
    return found


def _remarks(rows: pl.DataFrame, checks: Mapping[Key, Sequence[CheckRow]]) -> list[str]:
    """The remarks of most lines, each with the number of its lines; those of one kind are one."""
    alike: dict[object, list[str]] = {}
    for key, remark in zip(keys_of(rows), rows[q.REMARKS.head].to_list(), strict=True):
        if remark:
            alike.setdefault(kind_of(checks.get(key, ()), str(remark)), []).append(str(remark))
    ranked = sorted(alike.values(), key=len, reverse=True)
    said = [_counted(found, rows.height) for found in ranked[:_REMARKS]]
    left = sum(map(len, ranked[_REMARKS:]))
    return said + ([f"the remarks of {left} more lines are in dynamic.csv"] if left else [])


def _counted(remarks: Sequence[str], height: int) -> str:
    """A remark that differs between lines in its numbers, with the number of its lines."""
    if len(remarks) == height and len(set(remarks)) == 1:
        return remarks[0]
    where = f"{len(remarks)} of {height} lines"
    return f"{where}: {remarks[0]}" if len(set(remarks)) == 1 else f"{where}, as: {remarks[0]}"


def _cell(row: Mapping[str, Any], quantity: Quantity) -> str:
    value, std = texts(quantity, row)
    return f"{value} ± {std}" if value and std else value


def _floats(table: pl.DataFrame, name: str) -> NDArray[np.float64]:
    if name not in table.columns:
        return np.full(table.height, np.nan)
    return table[name].cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()


def lines_of(table: pl.DataFrame) -> dict[str, pl.DataFrame]:
    """The rows of each test in a table of lines, by test."""
    if q.TEST.head not in table.columns:
        return {}
    return {str(name): part for (name,), part in keyed(table).partition_by(q.TEST.head, as_dict=True).items()}
