"""Result tables as HTML for a notebook: how many tests are used, and the range of each quantity by condition."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES, Sameness
from fourpole.core.digits import number
from fourpole.core.notebook import notebook_html
from fourpole.fitting.rows import conditions_in
from fourpole.quantities import Quantity, ShownUnits
from fourpole.study.tables import verdict_counts

_SHOWN = (q.K1, q.STORAGE, q.LOSS_FACTOR, q.K2, q.C, q.TR_MEASURED)
_RULE = Sameness(AXES)


def tables_html(title: str, tables: Mapping[str, pl.DataFrame], route: str, units: ShownUnits) -> str:
    """The tests by verdict, and a row for each condition of dynamic.csv.

    Parameters
    ----------
    title, route : str
    tables : mapping of str to polars.DataFrame
        Tables by the name of their file.
    units : ShownUnits
        The units to show.
    """
    dynamic = tables.get("dynamic", pl.DataFrame())
    counts = verdict_counts(tables.get("static", pl.DataFrame()), dynamic)
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    lines = [f"{sum(counts.values())} tests: {said}; {route or 'unknown'} route", "lowest to highest of each condition"]
    shown = [units.of(quantity) for quantity in _SHOWN if quantity.head in dynamic.columns]
    quantities = [f"{quantity.symbol} [{quantity.suffix}]".replace(" []", "") for quantity in shown]
    heads = ["condition", "tests", q.FREQUENCY.head, *quantities]
    return notebook_html(title, lines, heads, list(_rows(dynamic, shown, units)))


def _rows(dynamic: pl.DataFrame, shown: list[Quantity], units: ShownUnits) -> Iterator[list[str]]:
    if q.TYRE.head not in dynamic.columns:
        return
    used = dynamic.filter(pl.col(q.VERDICT.head) != Verdict.REJECTED)
    conditions = conditions_in(used, _RULE)
    groups = _RULE.groups(conditions).tolist()
    for group in dict.fromkeys(groups):
        members = [row for row, other in enumerate(groups) if other == group]
        first, part = conditions[members[0]], used[members]
        values = [(axis, value) for axis, value in zip(AXES, first.values, strict=True) if isinstance(value, float)]
        stated = ", ".join([first.specimen, *(units.setting(axis.column, value) for axis, value in values)])
        ranges = [_range(part, quantity) for quantity in (q.FREQUENCY, *shown)]
        yield [stated, str(part[q.TEST.head].n_unique()), *ranges]


def _range(table: pl.DataFrame, quantity: Quantity) -> str:
    values = table[quantity.head].drop_nulls().drop_nans()
    if values.is_empty():
        return ""
    low, high = (number(float(end) / quantity.scale) for end in (values.min(), values.max()))  # type: ignore[arg-type]
    return low if low == high else f"{low} .. {high}"
