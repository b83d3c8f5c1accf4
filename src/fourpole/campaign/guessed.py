"""Doubts on a guessed tests.csv, in its column "doubts", each until the cell that it is about is corrected."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

#: Head of the column in tests.csv.
DOUBTS = "doubts"
_BETWEEN = " | "
_ENTRY = re.compile(r"(?P<column>\w+) \[(?P<cell>.*?)\]: ")
#: Largest number of characters in a cell of doubts.
_MOST = 1500


def doubts_cell(doubts: Iterable[tuple[str, str, str]]) -> str:
    """The cell with some doubts: column, the cell that was guessed in it, and text; without a column, the text alone.

    Examples
    --------
    >>> doubts_cell([("pressure", "1.7", "'1p7' taken as bar"), ("preload", "", "not known")])
    "pressure [1.7]: '1p7' taken as bar | preload []: not known"
    """
    found = ""
    for column, cell, text in doubts:
        one = f"{column} [{cell}]: {text}" if column else text
        one = one.replace(_BETWEEN, " / ")
        if len(found) + len(_BETWEEN) + len(one) > _MOST:
            break
        found += f"{_BETWEEN if found else ''}{one}"
    return found


def still_open(doubts: str, cells: Mapping[str, str]) -> str:
    """A cell of doubts without those whose cell is no longer as it was guessed; `cells` are by name of column.

    Examples
    --------
    >>> still_open("pressure [1.7]: '1p7' taken as bar | preload []: not known", {"pressure": "1.7", "preload": "1000"})
    "pressure [1.7]: '1p7' taken as bar"
    """
    kept = []
    for one in doubts.split(_BETWEEN):
        entry = _ENTRY.match(one)
        if entry is None or cells.get(entry["column"], entry["cell"]) == entry["cell"]:
            kept.append(one)
    return _BETWEEN.join(kept)


def columns_in_doubt(doubts: str) -> tuple[str, ...]:
    """The columns that a cell of doubts is about; a doubt without a column counts as "other"."""
    entries = [_ENTRY.match(one) for one in doubts.split(_BETWEEN)] if doubts.strip() else []
    return tuple(dict.fromkeys("other" if entry is None else entry["column"] for entry in entries))
