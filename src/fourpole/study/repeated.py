"""Two tables of one analysis compared cell by cell: as they were written, and as a second run writes them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q

#: Differences that do not count, because two machines round differently. A value with a standard uncertainty in its
#: row: this share of it, which changes no digit of a result as it is stated.
OF_UNCERTAINTY = 1e-3
#: Any other number: this share of itself, or of the largest number of its column for one that is nearly zero.
OF_ITSELF, OF_LARGEST = 1e-6, 1e-9
#: Texts of a test one of whose checks has a statistic this near its limit, relative: its verdict may be either.
ON_LIMIT = 1e-6
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Heads of the uncertainties by the heads of their values.
_STD = {quantity.head: quantity.u_head for quantity in q.QUANTITIES}
_MOST_SHOWN = 80
#: Columns of parts that stand for their sum of squares: another library may turn the parts into each other.
_TURNED = {q.SHARED_STORAGE.head, q.SHARED_LOSS.head}


@dataclass(frozen=True)
class Difference:
    """A column in which the rows of two tables differ.

    Attributes
    ----------
    column : str
        Head of the column; empty for rows that only one of the tables has.
    row : str
        The row with the largest difference, by its key: "D12", or "D12, K2".
    count : int
        Number of rows that differ.
    was, now : str
        The two cells.
    size : float
        Their difference in the unit of the column; not-a-number for texts and blanks.
    share : float [1]
        The difference over the one that does not count; infinite for texts and blanks.
    """

    column: str
    row: str
    count: int
    was: str
    now: str
    size: float
    share: float


def on_limit(checks: pl.DataFrame) -> frozenset[str]:
    """The tests one of whose checks stands on its limit, by the table of checks.

    Examples
    --------
    >>> on_limit(pl.DataFrame({"test": ["D1", "D2"], "statistic": [0.030000001, 0.0301], "limit": [0.03, 0.03]}))
    frozenset({'D1'})
    """
    statistic, limit = (pl.col(one.head) for one in (q.STATISTIC, q.LIMIT))
    return frozenset(checks.filter((statistic - limit).abs() < ON_LIMIT * limit.abs())["test"])


def differences(
    was: pl.DataFrame, now: pl.DataFrame, key: Sequence[str], loose: Collection[str] = ()
) -> list[Difference]:
    """The columns in which two tables differ by more than round-off, in the order of the first table.

    Parameters
    ----------
    was, now : polars.DataFrame
        The table as it was written, and that of the second run.
    key : sequence of str
        Columns that identify a row; those that a table lacks are left out. Without any, rows are matched by place.
    loose : collection of str
        Tests whose texts may differ, as of `on_limit`.

    Returns
    -------
    list of Difference
        Empty if the tables are the same.
    """
    heads = [head for head in key if head in was.columns and head in now.columns]
    rows, others = (_by_key(table, heads) for table in (was, now))
    differ = list(_of_rows(rows, others))
    both = [name for name in rows if name in others]
    for column in dict.fromkeys((*was.columns, *now.columns)):
        if column not in was.columns or column not in now.columns:
            state = ("no such column", "a column") if column in now.columns else ("a column", "no such column")
            differ.append(Difference(column, "", was.height, *state, np.nan, np.inf))
        else:
            pairs = [(name, rows[name], others[name]) for name in both]
            differ += _of_column(column, pairs, loose)
    return differ


def _by_key(table: pl.DataFrame, heads: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Rows by their name in messages, by which they are matched; a row that is there twice has its number, too."""
    rows: dict[str, dict[str, Any]] = {}
    for number, row in enumerate(table.iter_rows(named=True), start=1):
        name = ", ".join(_text(row[head]) for head in heads if row[head] is not None) or f"row {number}"
        rows[f"{name} (row {number})" if name in rows else name] = row
    return rows


def _text(cell: Any) -> str:
    """A cell as a text of limited length."""
    text = "blank" if cell is None else repr(cell) if isinstance(cell, float) else str(cell)
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def _of_rows(rows: dict[str, Any], others: dict[str, Any]) -> Iterator[Difference]:
    """Rows that only one table has."""
    for these, those, was, now in ((rows, others, "a row", "no such row"), (others, rows, "no such row", "a row")):
        if alone := [name for name in these if name not in those]:
            yield Difference("", alone[0], len(alone), was, now, np.nan, np.inf)


def _of_column(
    column: str, pairs: Sequence[tuple[str, dict[str, Any], dict[str, Any]]], loose: Collection[str]
) -> Iterator[Difference]:
    """The largest difference of a column, if any counts."""
    largest = max((_size(row[column]) for _, *rows in pairs for row in rows), default=0.0)
    std, differ = _STD.get(column, ""), []
    for name, row, other in pairs:
        was, now = row[column], other[column]
        if _bits(was, now) or (row.get("test") in loose and isinstance(_plain(was), str)):
            continue
        if column in _TURNED:
            was, now = float(np.linalg.norm(was)), float(np.linalg.norm(now))
        size, share = _apart(was, now, _size(row.get(std)), largest)
        if share > 1:
            differ.append(Difference(column, name, 1, _text(row[column]), _text(other[column]), size, share))
    if differ:
        yield replace(max(differ, key=lambda difference: difference.share), count=len(differ))


def _bits(was: Any, now: Any) -> bool:
    """Whether two cells are equal; not-a-number equals itself."""
    if isinstance(was, list) or isinstance(now, list):
        return False
    return bool(was == now or (was != was and now != now))


def _plain(cell: Any) -> Any:
    """The number that a text states; any other cell as it is."""
    with suppress(ValueError):
        return float(cell) if isinstance(cell, str) else cell
    return cell


def _size(cell: Any) -> float:
    """The largest finite number in a cell; 0 for a text or a blank."""
    cell = _plain(cell)
    if cell is None or isinstance(cell, str):
        return 0.0
    array = np.abs(np.atleast_1d(np.asarray(cell, dtype=float)))
    array = array[np.isfinite(array)]
    return float(array.max()) if array.size else 0.0


def _apart(was: Any, now: Any, std: float, largest: float) -> tuple[float, float]:
    """Difference of two cells, and the difference over the one that does not count."""
    was, now = _plain(was), _plain(now)
    if isinstance(was, str) and isinstance(now, str):
        return np.nan, 0.0 if _same_words(was, now) else np.inf
    if any(cell is None or isinstance(cell, str) for cell in (was, now)):
        return np.nan, np.inf
    first, second = (np.atleast_1d(np.asarray(cell, dtype=float)) for cell in (was, now))
    if first.shape != second.shape or not np.array_equal(np.isfinite(first), np.isfinite(second)):
        return np.nan, np.inf
    there = np.isfinite(first)
    if not there.any():
        return 0.0, 0.0
    size = float(np.max(np.abs(first[there] - second[there])))
    allowed = max(OF_UNCERTAINTY * std if std else OF_ITSELF * _size(was), OF_LARGEST * largest)
    return size, size / allowed if allowed else (0.0 if size == 0 else np.inf)


def _same_words(was: str, now: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by no more than one unit of their last digit."""
    if _NUMBER.sub("#", was) != _NUMBER.sub("#", now):
        return False
    pairs = zip(_NUMBER.findall(was), _NUMBER.findall(now), strict=True)
    return all(abs(float(a) - float(b)) <= 1.01 * max(_last_digit(a), _last_digit(b)) for a, b in pairs)


def _last_digit(number: str) -> float:
    """The value of one unit of the last digit that is written; 0 for a whole number."""
    mantissa, _, power = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 0.0 if not decimals and not power else 10.0 ** (int(power or 0) - decimals)
