"""What a command answers: lines and tables for a reader, and the document of the same for programs.

A command makes an `Answer` and prints nothing of it. The terminal, ``--json`` and the app show it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import polars as pl
    from rich.text import Text

    from fourpole.quantities import ShownUnits


@dataclass(frozen=True, eq=False)
class Table:
    """A table of cells in words.

    Attributes
    ----------
    heads : sequence of str
    rows : sequence of sequence of str
        A row with one cell is the name of a group.
    right : collection of str
        Heads of columns that are aligned at the right and not folded: those of numbers.
    remarks : sequence of str
        A sentence for each row that is no group; empty for a table without.
    remark : str
        Head of the remarks.
    """

    heads: Iterable[str]
    rows: Iterable[Sequence[str | Text]]
    right: Collection[str] = ()
    remarks: Sequence[str | Text] = ()
    remark: str = ""


class Rows:
    """Rows of a result table: CSV in SI, or on a screen a table in the units that people use.

    Attributes
    ----------
    frame : DataFrame
    units : ShownUnits
    leave_out : sequence of str
        Heads of columns that a screen does not show.
    whole : mapping of str to str
        Heads of uncertainties that a screen shows in place of others, by the heads of these.
    """

    def __init__(
        self,
        frame: pl.DataFrame,
        units: ShownUnits,
        leave_out: Sequence[str] = (),
        whole: Mapping[str, str] | None = None,
    ) -> None:
        self.frame, self.units, self.leave_out, self.whole = frame, units, leave_out, whole or {}

    @property
    def table(self) -> Table:
        """The rows in words, each value with its uncertainty, without columns that are blank."""
        from fourpole.report.digits import cell

        rows = [{**row, **{head: row[of] for head, of in self.whole.items()}} for row in self.frame.to_dicts()]
        heads = [one for one in self.frame.columns if one not in self.leave_out and not one.startswith(("u(", "corr("))]
        used = [head for head in heads if any(row[head] not in (None, "") for row in rows)]
        labels = {head: _label(head, self.units) for head in used}
        numbers = [labels[head] for head in used if any(isinstance(row[head], float) for row in rows)]
        return Table(labels.values(), [[cell(row, head, self.units) for head in used] for row in rows], numbers)

    @property
    def note(self) -> str:
        """What a number after a sign of plus and minus is; empty where the rows have no uncertainty."""
        from fourpole.report.digits import PLUS_MINUS

        return PLUS_MINUS if any(head.startswith("u(") for head in self.frame.columns) else ""


def _label(head: str, units: ShownUnits) -> str:
    """Head of a column with the unit shown."""
    name, _, si = head.removesuffix("]").partition(" [")
    unit, _ = units.unit(si)
    return f"{name} [{unit}]" if unit else name


#: A line or a paragraph, a table, or rows of numbers.
Part: TypeAlias = str | Table | Rows


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer of a command.

    Attributes
    ----------
    parts : iterable of Part
        What a reader sees, in its order; made when it is shown, and once.
    document : callable
        Makes the document for programs, in SI; without one it is the files, by what is said of them.
    files : sequence of (str, path)
        The files that were written, or an address, each after what is said of it.
    code : int
        Exit code.
    then : callable
        Does what is left when the answer is shown, such as drawing a report, and gives further answers as they come.
        Each that has a document gives a line to a program.

    Examples
    --------
    >>> answer = Answer(iter(["K1 = 180 kN/m"]), lambda: {"K1 [N/m]": 180e3})
    >>> answer.shown, answer.document()
    (['K1 = 180 kN/m'], {'K1 [N/m]': 180000.0})
    """

    parts: Iterable[Part] = ()
    document: Callable[[], Any] = field(default=dict)
    files: Sequence[tuple[str, Path | str]] = ()
    code: int = 0
    then: Callable[[], Iterable[Answer]] = field(default=tuple)

    @cached_property
    def shown(self) -> list[Part]:
        """The parts, made once."""
        return list(self.parts)

    @property
    def told(self) -> Any:
        """What a program gets; empty where there is nothing to tell."""
        return self.document() or {what: str(path) for what, path in self.files}

    def plain(self) -> list[str | dict[str, Any]]:
        """The parts as texts, and as tables of texts, for a page that another process makes."""
        plain: list[str | dict[str, Any]] = []
        for part in self.shown:
            one = part.table if isinstance(part, Rows) else part
            if isinstance(one, str):
                plain.append(one)
                continue
            rows = [[str(cell) for cell in row] for row in one.rows]
            remarks = [str(remark) for remark in one.remarks]
            plain.append({"heads": list(one.heads), "rows": rows, "right": list(one.right), "remarks": remarks})
            if isinstance(part, Rows) and part.note:
                plain.append(part.note)
        return plain
