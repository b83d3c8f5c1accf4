"""compare.html: one file that opens offline, with two results compared."""

from __future__ import annotations

from typing import Any

import polars as pl
from markupsafe import Markup

from fourpole import quantities as q
from fourpole.findings.compared import DIFFERS, NOT_SEEN, Compared
from fourpole.plot.compared import draw_compared
from fourpole.plot.figure import figure_bytes
from fourpole.quantities import LOSS_ANGLE, MODULUS
from fourpole.report.html import packaged, rendered, svg_address
from fourpole.report.words.compared import outcome, shown_rows, where
from fourpole.version import VERSION

#: The quantities of the figure, and the columns of a condition.
_FIGURE = (MODULUS, LOSS_ANGLE)
_STATE = ("specimen", q.PRESSURE.head, q.PRELOAD.head, q.TEMPERATURE.head)
#: Rows of the page; the file of all rows is CSV.
_MOST = 1000


def render_compared(compared: Compared) -> str:
    """The page as text; whatever the results state is escaped, and the page loads and runs nothing."""
    return rendered(
        {"page": packaged("compared.html"), "compared": packaged("parts/compared.html")},
        compared=compared_parts(compared),
        style=Markup(packaged("page.css")),
        version=VERSION,
    )


def compared_parts(compared: Compared) -> dict[str, Any]:
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


def _most_different(compared: Compared) -> pl.DataFrame:
    """The rows of the condition with the largest ratio of |K*| or the loss angle, by rising frequency."""
    names = [one.column for one in _FIGURE]
    rows = compared.rows.filter(pl.col("quantity").is_in(names), pl.col(q.FREQUENCY.head).is_not_null())
    if rows.is_empty():
        return rows
    first = rows.row(0, named=True)
    return rows.filter(pl.col(head).eq_missing(first[head]) for head in _STATE).sort(q.FREQUENCY.head)


def _figure(shown: pl.DataFrame, compared: Compared) -> dict[str, str]:
    """The figure as a data: URL, and its condition without a frequency."""
    figure = draw_compared(shown, [compared.shown.of(one) for one in _FIGURE], compared.names)
    row = {**shown.row(0, named=True), q.FREQUENCY.head: None}
    several = compared.rows["specimen"].n_unique() > 1
    return {
        "figure": svg_address(figure_bytes(figure, "compared", "Two results compared", "svg")),
        "where": where(row, compared.shown, specimen=several),
    }
