"""Numbers and tables in the terminal: in the units that people use, to the digits that their uncertainty allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fourpole.app.console import out, print_table
from fourpole.quantities import ShownUnits
from fourpole.report.digits import PLUS_MINUS, cell


def print_rows(rows: Sequence[Mapping[str, Any]], units: ShownUnits, leave_out: Sequence[str] = ()) -> None:
    """Print rows of a result table, whose heads have SI units, each value with its uncertainty."""
    heads = [head for head in rows[0] if head not in leave_out and not head.startswith(("u(", "corr("))]
    used = [head for head in heads if any(row[head] not in (None, "") for row in rows)]
    labels = {head: _label(head, units) for head in used}
    numbers = [labels[head] for head in used if any(isinstance(row[head], float) for row in rows)]
    print_table(labels.values(), [[cell(row, head, units) for head in used] for row in rows], right=numbers)
    if any(head.startswith("u(") for head in rows[0]):
        out(PLUS_MINUS)


def _label(head: str, units: ShownUnits) -> str:
    """Head of a column with the unit shown."""
    name, _, si = head.removesuffix("]").partition(" [")
    unit, _ = units.unit(si)
    return f"{name} [{unit}]" if unit else name
