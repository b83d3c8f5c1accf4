"""Two results compared, in words: each row with its units, and what the rows show together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import erfc, sqrt
from typing import Any

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.findings.compared import COMPARED, RATIO, Compared
from fourpole.quantities import ShownUnits
from fourpole.report.digits import decimals_of, rounded
from fourpole.report.words.phrases import counted

_OF = {one.column: one for one in COMPARED}


@dataclass(frozen=True)
class ShownRow:
    """One row as text.

    Attributes
    ----------
    where : str
        Specimen and condition, with the frequency.
    quantity : str
        Symbol and unit.
    first, second : str
    difference : str
        The second less the first with U (k = 2).
    z : str
        Difference over its standard uncertainty.
    seen : bool
        Whether the difference is beyond U.
    """

    where: str
    quantity: str
    first: str
    second: str
    difference: str
    z: str
    seen: bool


def shown_rows(compared: Compared, most: int | None = None) -> list[ShownRow]:
    """The rows as text in the units that the first results want, the largest ratio first; at most `most` of them."""
    several = compared.rows["specimen"].n_unique() > 1
    return [_shown(row, compared.shown, several=several) for row in compared.rows[:most].rows(named=True)]


def _shown(row: Mapping[str, Any], units: ShownUnits, *, several: bool) -> ShownRow:
    quantity = units.of(_OF[row["quantity"]])
    first, second, difference, u = (
        row[head] / quantity.scale for head in ("first", "second", "difference", "u(difference)")
    )
    decimals = decimals_of(COVERAGE_FACTOR * u)
    sign = "+" if difference > 0 else ""
    return ShownRow(
        where=where(row, units, specimen=several),
        quantity=f"{quantity.symbol} {quantity.suffix}".rstrip(),
        first=rounded(first, decimals),
        second=rounded(second, decimals),
        difference=f"{sign}{rounded(difference, decimals)}±{rounded(COVERAGE_FACTOR * u, decimals)}",
        z=_ratio(row[RATIO]),
        seen=abs(row[RATIO]) > COVERAGE_FACTOR,
    )


def where(row: Mapping[str, Any], units: ShownUnits, *, specimen: bool) -> str:
    """The condition of a row: "1.7 bar, 1000 N, 10 Hz"."""
    parts = [str(row["specimen"])] if specimen else []
    for one, digits in ((q.PRESSURE, 3), (q.PRELOAD, 4), (q.TEMPERATURE, 3), (q.FREQUENCY, 3)):
        if row[one.head] is not None:
            parts.append(units.text(one, row[one.head], digits))
    return ", ".join(parts) or str(row["specimen"])


def _ratio(z: float) -> str:
    return (f"{z:+.1f}" if abs(z) < 99.5 else f"{z:+.0f}").replace("-", "−")


def outcome(compared: Compared) -> str:
    """How many differences are seen, and how many chance alone would show, as a sentence."""
    count = compared.rows.height
    chance = erfc(COVERAGE_FACTOR / sqrt(2.0)) * count
    few = f"about {chance:.0f}" if chance >= 1.5 else "one" if chance >= 0.5 else "none"
    return (
        f"{compared.beyond} of {counted(count, 'difference')} {'is' if compared.beyond == 1 else 'are'} beyond U = "
        f"{COVERAGE_FACTOR:g} u; {few} would be by chance if nothing differed. Rows of one campaign share errors, so "
        "several ratios of one sign may have one cause."
    )
