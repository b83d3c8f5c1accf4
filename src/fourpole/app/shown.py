"""Numbers and tables in the terminal: in the units that people use, to the digits that their uncertainty allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fourpole.app.console import out, print_table
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.quantities import ShownUnits
from fourpole.report.digits import number, with_std

#: A relative standard uncertainty below this is not shown.
_NEGLIGIBLE = 1e-8
#: What stands after a number.
PLUS_MINUS = "± is U (k = 2)"


def with_u(value: float | None, std: float | None, scale: float = 1.0) -> str:
    """A value with U in the unit shown, both to the second digit of U.

    Examples
    --------
    >>> with_u(435012.3, 59.0, 1e3), with_u(0.30366, None)
    ('435.01 ± 0.12', '0.3037')
    """
    if value is None:
        return ""
    std = std if std is not None and std > _NEGLIGIBLE * abs(value) else None
    text, u = with_std(value / scale, None if std is None else COVERAGE_FACTOR * std / scale)
    return f"{text} ± {u}" if u else text


def print_rows(rows: Sequence[Mapping[str, Any]], units: ShownUnits, leave_out: Sequence[str] = ()) -> None:
    """Print rows of a result table, whose heads have SI units, each value with its uncertainty."""
    heads = [head for head in rows[0] if head not in leave_out and not head.startswith(("u(", "corr("))]
    used = [head for head in heads if any(row[head] not in (None, "") for row in rows)]
    labels = {head: _label(head, units) for head in used}
    numbers = [labels[head] for head in used if any(isinstance(row[head], float) for row in rows)]
    print_table(labels.values(), [[cell(row, head, units) for head in used] for row in rows], right=numbers)
    if any(head.startswith("u(") for head in rows[0]):
        out(PLUS_MINUS)


def cell(row: Mapping[str, Any], head: str, units: ShownUnits) -> str:
    """A value of a row by the head of its column, with U where the row has an uncertainty."""
    value = row[head]
    if value is None or isinstance(value, str):
        return value or ""
    name, _, si = head.removesuffix("]").partition(" [")
    std = row.get(f"u({name}) [{si}]")
    scale = units.unit(si)[1]
    if std is not None:
        return with_u(value, std, scale)
    text = number(value / scale, 5)
    return text.rstrip("0").rstrip(".") if "." in text and "×" not in text else text


def _label(head: str, units: ShownUnits) -> str:
    """Head of a column with the unit shown."""
    name, _, si = head.removesuffix("]").partition(" [")
    unit, _ = units.unit(si)
    return f"{name} [{unit}]" if unit else name
