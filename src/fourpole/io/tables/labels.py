"""Columns of words: labels that tell rows apart, and quantities in long form, which become columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole.errors import TableError
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
    """The columns whose words, of several, name a specimen, direction or batch; and those of no known kind.

    The latter are columns of words, and those of numbers that have few values, each in several rows. A column with
    another word in each row, as a number of the row, is none of them.
    """
    known, other = list[Column](), list[Column]()
    for column in cells.columns:
        kinds, words = _kinds(column), [word for word in cells_of(column) if word]
        if not 1 < len({*words}) < len(words) or "repeat" in kinds or not (column.words or _is_stepped(column)):
            continue
        whole = column.unit is None and not np.any(np.nan_to_num(column.values) % 1)
        if kinds & {"specimen", "apart"} and (column.words or whole):
            known.append(column)
        elif not kinds:
            other.append(column)
    return known, other


def _is_stepped(column: Column) -> bool:
    """Whether a column of numbers has few values, each in several rows, as a condition has."""
    _, counts = np.unique(column.values[np.isfinite(column.values)], return_counts=True)
    return not column.bad and bool(np.all(counts > 1))


def _kinds(column: Column) -> set[str]:
    """Kinds of label that a head names: specimen, apart, repeat, or part of a curve."""
    words = {*words_of(column.name), plain(column.name)}
    if {one.casefold() for one in cells_of(column) if one} <= _WORDS["branch"]:
        return {"part"}
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
        raise TableError(
            f"{cells.where}: {len(names)} sets of rows are told apart by {heads}: name one of them with --group: "
            f"{first_of(names, 8)}"
        )
    return [
        f"column {shown(one.head)} has the words {first_of([*dict.fromkeys(cells_of(one))], 3)}: all rows are taken "
        "together; where they are of several curves, leave one in the file"
        for one in other
        if one.words
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


def measured(cells: Cells) -> Cells:
    """The measured rows of a table: without those of a mean or deviation, blank names of merged cells filled.

    Quantities in long form become columns.
    """
    return wide(_without_summaries(_filled(cells)))


def _filled(cells: Cells) -> Cells:
    """The table with the name of a specimen or batch in each row below the one that states it."""
    columns, remarks = list(cells.columns), []
    for at, column in enumerate(columns):
        if column.words and column.words[0] and "" in column.words and _kinds(column) & {"specimen", "apart"}:
            names = [*column.words]
            for row in range(1, len(names)):
                names[row] = names[row] or names[row - 1]
            columns[at] = replace(column, words=tuple(names))
            remarks.append(f"blank cells of column {shown(column.head)} have the name above them")
    return replace(cells, columns=tuple(columns), remarks=(*cells.remarks, *remarks)) if remarks else cells


def _without_summaries(cells: Cells) -> Cells:
    """The table without rows whose words say that they are means, deviations or counts of the others."""
    for column in cells.columns:
        if not column.words and not column.bad:
            continue
        words = [one.casefold().strip(" .:") for one in cells_of(column)]
        lost = [at for at, one in enumerate(words) if one in _WORDS["summary"] | _WORDS["mean"]]
        if lost and 2 * len(lost) > len(words):  # a table of means and deviations
            lost = [at for at in lost if words[at] not in _WORDS["mean"]]
        if lost and len(lost) < len(words):
            lines = first_of([str(cells.lines[at]) for at in lost], 6)
            said = first_of([*dict.fromkeys(words[at] for at in lost)], 4)
            kept = _rows(cells, [at for at in range(len(words)) if at not in {*lost}], cells.group)
            return _without_summaries(replace(kept, remarks=(*kept.remarks, f"rows {lines} were left out: {said}")))
    return cells


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
    stated = [""] * len(cells.lines) if units is None else cells_of(units)
    keys = [one for one in cells.columns if one not in (named[0], values[0], units)]
    keyed = [*zip(*(one.words or one.values.tolist() for one in keys), strict=True)] or [()] * len(cells.lines)
    rows: dict[tuple[object, ...], int] = {}
    found: dict[tuple[str, str], dict[int, float]] = {}
    seen: dict[tuple[object, ...], int] = {}
    for at, (key, of) in enumerate(zip(keyed, zip(cells_of(named[0]), stated, strict=True), strict=True)):
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
