"""Two results compared, in words and as a page: each row with its units, what the rows show together, a figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import erfc, sqrt
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.findings.compared import COMPARED, DIFFERS, NOT_SEEN, RATIO, Comparison
from fourpole.quantities import LOSS_ANGLE, MODULUS, ShownUnits
from fourpole.report.digits import counted, decimals_of, rounded
from fourpole.version import VERSION

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


def shown_rows(compared: Comparison, most: int | None = None) -> list[ShownRow]:
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


def outcome(compared: Comparison) -> str:
    """How many differences are seen, and how many chance alone would show, as a sentence."""
    count = compared.rows.height
    chance = erfc(COVERAGE_FACTOR / sqrt(2.0)) * count
    few = f"about {chance:.0f}" if chance >= 1.5 else "one" if chance >= 0.5 else "none"
    return (
        f"{compared.beyond} of {counted(count, 'difference')} {'is' if compared.beyond == 1 else 'are'} beyond U = "
        f"{COVERAGE_FACTOR:g} u; {few} would be by chance if nothing differed. Rows of one campaign share errors, so "
        "several ratios of one sign may have one cause."
    )


#: The quantities of the figure, and the columns of a condition.
_FIGURE = (MODULUS, LOSS_ANGLE)
_STATE = ("specimen", q.PRESSURE.head, q.PRELOAD.head, q.TEMPERATURE.head)
#: Rows of the page; the file of all rows is CSV.
_MOST = 1000


def render_compared(compared: Comparison) -> str:
    """The page as text; whatever the results state is escaped, and the page loads and runs nothing."""
    from markupsafe import Markup  # this and the room of figures take a second, which words do not need

    from fourpole.report.html import packaged, rendered

    return rendered(
        {"page": packaged("compared.html"), "compared": packaged("parts/compared.html")},
        compared=compared_parts(compared),
        style=Markup(packaged("page.css")),
        version=VERSION,
    )


def compared_parts(compared: Comparison) -> dict[str, Any]:
    """What the template "compared" shows of a comparison."""
    shown = _most_different(compared)
    rows = shown_rows(compared, _MOST)
    return {
        "names": compared.names,
        "outcome": outcome(compared),
        "common": compared.common,
        "rows": rows,
        "more": compared.rows.height - len(rows),
        "differs": DIFFERS,
        "not_seen": NOT_SEEN,
        "figure": "",
        "where": "",
        **(_figure(shown, compared) if shown.height else {}),
    }


def _most_different(compared: Comparison) -> pl.DataFrame:
    """The rows of the condition with the largest ratio of |K*| or the loss angle, by rising frequency."""
    names = [one.column for one in _FIGURE]
    rows = compared.rows.filter(pl.col("quantity").is_in(names), pl.col(q.FREQUENCY.head).is_not_null())
    if rows.is_empty():
        return rows
    first = rows.row(0, named=True)
    return rows.filter(pl.col(head).eq_missing(first[head]) for head in _STATE).sort(q.FREQUENCY.head)


def _figure(shown: pl.DataFrame, compared: Comparison) -> dict[str, str]:
    """The figure as a data: URL, and its condition without a frequency."""
    from fourpole.plot.layout import figure_bytes
    from fourpole.plot.ride import draw_compared
    from fourpole.report.html import svg_address

    figure = draw_compared(shown, [compared.shown.of(one) for one in _FIGURE], compared.names)
    row = {**shown.row(0, named=True), q.FREQUENCY.head: None}
    several = compared.rows["specimen"].n_unique() > 1
    return {
        "figure": svg_address(figure_bytes(figure, "compared", "Two results compared", "svg")),
        "where": where(row, compared.shown, specimen=several),
    }
