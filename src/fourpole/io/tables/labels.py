"""Columns of words: labels that tell rows apart, and quantities in long form, which become columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole.errors import TableError
from fourpole.io.names import listed
from fourpole.io.tables.cells import Cells, Column, tables_in
from fourpole.io.tables.vocabulary import plain, readings
from fourpole.units import shown
from fourpole.words import first_of, vocabulary
from fourpole.words.heads import head_and_unit, words_of

_WORDS = {key: frozenset(text.split()) for key, text in vocabulary()["tables"]["labels"].items()}


def cells_of(column: Column) -> list[str]:
    """The cells of a column of labels as words; numbers of runs and of specimens count as words."""
    bad = dict(column.bad)
    numbers = [bad.get(at, "" if np.isnan(one) else f"{one:g}") for at, one in enumerate(column.values.tolist())]
    return [one.strip() for one in column.words or numbers]


def labels_in(cells: Cells) -> tuple[list[Column], list[Column]]:
    """The columns whose words, of several, name a specimen, direction or batch; and those of words of no known kind."""
    known, other = list[Column](), list[Column]()
    for column in cells.columns:
        kinds = _kinds(column)
        if len({*cells_of(column)} - {""}) < 2 or "repeat" in kinds:
            continue
        numbered = column.unit is None and not np.any(np.nan_to_num(column.values) % 1)
        if kinds & {"specimen", "apart"} and (column.words or numbered):
            known.append(column)
        elif column.words and not kinds:
            other.append(column)
    return known, other


def _kinds(column: Column) -> set[str]:
    """Kinds of label that a head names: specimen, apart, repeat, or part of a curve."""
    words = {*words_of(column.name), plain(column.name)}
    return {kind for kind, known in _WORDS.items() if known & words}


def joined(columns: Sequence[Column]) -> list[str]:
    """The labels of each row as one name: "A, radial"."""
    rows = zip(*map(cells_of, columns), strict=True)
    return [", ".join(word for word in row if word) for row in rows]


def labelled(path: Path, group: str, label: str | None) -> list[Cells]:
    """The tables of a file as `tables_in` has them; `group` may be a label of rows, too, which are a table then."""
    try:
        return tables_in(path, group=group, label=label)
    except TableError:
        if not group:
            raise
        parts = [part for one in tables_in(path, label=label) for part in parts_of(one) if part.group == group]
        if not parts:
            raise
        return parts


def parts_of(cells: Cells) -> list[Cells]:
    """The rows of each label as a table of their own; the whole table if it has no labels.

    Examples
    --------
    >>> column = Column("sample", "sample", None, np.full(3, np.nan), words=("A", "A", "B"))
    >>> [(one.group, one.lines) for one in parts_of(Cells("a.csv", "", (column,), [2, 3, 4]))]
    [('A', [2, 3]), ('B', [4])]
    """
    known, _ = labels_in(cells)
    if not known:
        return [cells]
    names = joined(known)
    return [_rows(cells, [at for at, one in enumerate(names) if one == name], name) for name in dict.fromkeys(names)]


def one_label(cells: Cells) -> list[str]:
    """Remarks on columns of words of no known kind; TableError if labels say that the rows are of several specimens."""
    known, other = labels_in(cells)
    if known:
        names = [*dict.fromkeys(joined(known))]
        heads = " and ".join(shown(one.head) for one in known)
        raise TableError(f"{cells.where}: {heads} tell {len(names)} sets of rows apart: name one with --group"
                         f"{listed(names, names[0])}")  # fmt: skip
    return [
        f"column {shown(one.head)} has the words {first_of([*dict.fromkeys(cells_of(one))], 3)}: all rows are taken "
        "together; where they are of several curves, leave one in the file"
        for one in other
    ]


def _rows(cells: Cells, rows: Sequence[int], group: str) -> Cells:
    place = {at: new for new, at in enumerate(rows)}
    columns = tuple(
        replace(
            one,
            values=one.values[[*rows]],
            words=tuple(one.words[at] for at in rows) if one.words else (),
            bad=tuple((place[at], text) for at, text in one.bad if at in place),
        )
        for one in cells.columns
    )
    return replace(cells, group=group, columns=columns, lines=[cells.lines[at] for at in rows])


def wide(cells: Cells) -> Cells:
    """A table in long form, with a column of names of quantities and one of their values, with a column of each.

    Examples
    --------
    >>> table = Cells(
    ...     "a.csv",
    ...     "",
    ...     (
    ...         Column("f [Hz]", "f", "Hz", np.array([1.0, 1.0])),
    ...         Column("quantity", "quantity", None, np.full(2, np.nan), words=("K' [N/mm]", "tan delta")),
    ...         Column("value", "value", None, np.array([200.0, 0.1])),
    ...     ),
    ...     [2, 3],
    ... )
    >>> [(one.name, one.unit, one.values.tolist()) for one in wide(table).columns]
    [('f', 'Hz', [1.0]), ("K'", 'N/mm', [200.0]), ('tan delta', None, [0.1])]
    """
    named = [one for one in cells.columns if one.words and sum(bool(_role(word)) for word in {*one.words}) > 1]
    values = [one for one in cells.columns if not one.words and plain(one.name) in _WORDS["value"]]
    if len(named) != 1 or len(values) != 1:
        return cells
    units = next((one for one in cells.columns if plain(one.name) in _WORDS["unit"]), None)
    keys = [one for one in cells.columns if one not in (named[0], values[0], units)]
    keyed = [*zip(*(one.words or one.values.tolist() for one in keys), strict=True)] or [()] * len(cells.lines)
    rows: dict[tuple[object, ...], int] = {}
    found: dict[tuple[str, str], dict[int, float]] = {}
    seen: dict[tuple[object, ...], int] = {}
    for at, (key, name) in enumerate(zip(keyed, cells_of(named[0]), strict=True)):
        of = (name, "" if units is None else cells_of(units)[at])
        turn = seen[*key, *of] = seen.get((*key, *of), -1) + 1
        row = rows.setdefault((*key, turn), at)
        found.setdefault(of, {})[row] = float(values[0].values[at])
    kept = _rows(cells, [*rows.values()], cells.group)
    columns = [one for one, old in zip(kept.columns, cells.columns, strict=True) if old in keys]
    for (name, unit), there in found.items():
        numbers = np.array([there.get(row, np.nan) for row in rows.values()])
        columns.append(Column(name, *head_and_unit(name, unit or values[0].unit), numbers))
    remark = f"long form: {shown(named[0].head)} names the quantities of {shown(values[0].head)}"
    return replace(kept, columns=tuple(columns), remarks=(*cells.remarks, remark))


def _role(name: str) -> bool:
    return bool(readings(head_and_unit(name)[0]))
