"""What results say of a requirement: functions that several standards use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, log10, pi

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import Axis
from fourpole.findings.summary import SummaryRow, summary
from fourpole.quantities import MODULUS, Quantity, ShownUnits
from fourpole.report.digits import expanded, number
from fourpole.report.standards.requirement import Answer, Found
from fourpole.study.record import section
from fourpole.study.study import Study

NOTHING = "no dynamic test in use"


def used(results: Study) -> pl.DataFrame:
    """The dynamic tests with K* that were not rejected; no row where there are none."""
    table = results.dynamic
    if q.STORAGE.head not in table.columns:
        return pl.DataFrame()
    return table.filter(pl.col(q.VERDICT.head) != Verdict.REJECTED, pl.col(q.STORAGE.head).is_not_null())


def not_stated(text: str) -> Callable[[Study], Found]:
    """The answer to what no test records and no campaign states."""
    return lambda _: Found(text, Answer.NOT_STATED)


def judged(text: str, met: bool) -> Found:
    """An answer from a measured value."""
    return Found(text, Answer.MET if met else Answer.NOT_MET)


def at_most(quantity: Quantity, limit: float) -> Callable[[Study], Found]:
    """Whether a column does not exceed a limit, in SI."""

    def measure(results: Study) -> Found:
        values = _values(results, quantity)
        if not values:
            return Found(NOTHING, Answer.NOT_STATED)
        return judged(spread(values, quantity), max(values) <= limit * (1.0 + 1e-9))

    return measure


def nearest_to(
    quantity: Quantity, wanted: float, axis: Axis, *, factor: float = 1.0, name: str = ""
) -> Callable[[Study], Found]:
    """Whether a test has a wanted value, `factor` times that of the column, which is the same on an axis."""

    def measure(results: Study) -> Found:
        values = [factor * value for value in _values(results, quantity)]
        if not values:
            return Found(f"{quantity.name} is not known", Answer.NOT_STATED)
        near = min(values, key=lambda one: abs(one - wanted))
        text = f"{name or quantity.name} {spread(values, quantity)}; nearest {shown(near, quantity)}"
        return judged(text, axis.same(near, wanted))

    return measure


def stated_in_all(quantity: Quantity) -> Callable[[Study], Found]:
    """Whether every test states a value."""

    def measure(results: Study) -> Found:
        table = used(results)
        if table.is_empty():
            return Found(NOTHING, Answer.NOT_STATED)
        values = _values(results, quantity)
        if len(values) < table.height:
            return Found(f"{table.height - len(values)} of {table.height} tests do not state it", Answer.NOT_STATED)
        return judged(spread(values, quantity), met=True)

    return measure


def reported(*keys: str) -> Callable[[Study], Found]:
    """Whether [report] of campaign.toml states something; the answer repeats its text."""

    def measure(results: Study) -> Found:
        stated = section(results.record, "stated", "report")
        texts = [str(stated[key]) for key in keys if stated.get(key)]
        if len(texts) < len(keys):
            lacking = ", ".join(key for key in keys if not stated.get(key))
            return Found(f"[report] of campaign.toml does not state {lacking}", Answer.NOT_STATED)
        return judged("; ".join(texts), met=True)

    return measure


def calibrated(results: Study) -> Found:
    """Whether [report] lists equipment with certificates."""
    listed = section(results.record, "stated", "report").get("equipment")
    items = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    named = [one for one in items if one.get("certificate")]
    if not items:
        return Found("[report] of campaign.toml lists no equipment", Answer.NOT_STATED)
    text = f"{len(named)} of {len(items)} instruments listed with a certificate"
    return judged(text, len(named) == len(items))


def input_masses(results: Study) -> list[float]:
    """The masses between force cell and contact that the rigs state [kg]."""
    stated = [section(one, "input_mass").get("value") for one in section(results.record, "stated", "rigs").values()]
    return [float(value) for value in stated if isinstance(value, int | float)]


def no_separation(results: Study) -> Found:
    """Whether the dynamic force stays below the preload in every test."""
    table = used(results)
    if table.is_empty() or table[q.PRELOAD.head].null_count() == table.height:
        return Found("no preload is stated", Answer.NOT_STATED)
    row = table.with_columns((pl.col(q.F1.head) / pl.col(q.PRELOAD.head)).alias("share")).filter(
        pl.col("share").is_finite()
    )
    if row.is_empty():
        return Found("the force of no test is known", Answer.NOT_STATED)
    largest = row.sort("share", descending=True).row(0, named=True)
    return judged(
        f"largest force amplitude {100 * largest['share']:.0f} % of the preload (test {largest[q.TEST.head]})",
        largest["share"] < 1.0,
    )


def static_curve(results: Study) -> Found:
    """Whether each specimen of a dynamic test has a static test."""
    dynamic = set(used(results)[q.TYRE.head]) if not used(results).is_empty() else set()
    static = set(results.static[q.TYRE.head]) if q.TYRE.head in results.static.columns else set()
    if not dynamic:
        return Found(NOTHING, Answer.NOT_STATED)
    lacking = sorted(dynamic - static)
    if lacking:
        return Found(f"no static test of {', '.join(lacking)}", Answer.NOT_STATED)
    return judged(f"static load-deflection curve of {len(dynamic)} specimens", met=True)


def shown(value: float, quantity: Quantity, digits: int = 3) -> str:
    """An SI value with the usual unit."""
    one = ShownUnits().of(quantity)
    return f"{number(float(f'{value / one.scale:.{digits}g}'), digits)} {one.suffix}".rstrip()


def spread(values: Sequence[float], quantity: Quantity) -> str:
    """Lowest to highest of SI values with the usual unit."""
    low, high = shown(min(values), quantity), shown(max(values), quantity)
    return low if low == high else f"{low.rpartition(' ')[0] or low} to {high}"


def _values(results: Study, quantity: Quantity) -> list[float]:
    table = used(results)
    if quantity.head not in table.columns:
        return []
    return [
        float(value) for value in table[quantity.head].to_list() if isinstance(value, int | float) and isfinite(value)
    ]


def level(ratio: float) -> float:
    """A ratio of amplitudes in decibel."""
    return 20.0 * log10(ratio)


def rows_of(results: Study) -> tuple[SummaryRow, ...]:
    """Each condition at one frequency: that of [report], else the tested one nearest to 15 Hz."""
    return tuple(row for row in summary(results, most=None) if MODULUS.key in row.values)


def place(row: SummaryRow) -> tuple[str, str, str]:
    """Specimen, state and frequency of a row as texts."""
    parts = [
        ShownUnits().text(quantity, ends[0])
        for ends, quantity in ((row.pressure, q.PRESSURE), (row.preload, q.PRELOAD), (row.temperature, q.TEMPERATURE))
        if ends is not None
    ]
    return row.specimen, ", ".join(parts), number(row.at, 3)


def with_expanded(row: SummaryRow, quantity: Quantity, scale: float | None = None) -> str:
    """A quantity of a row with U (k = 2), over a scale in SI; blank where it has none."""
    found = row.values.get(quantity.key)
    if found is None:
        return ""
    scale = ShownUnits().of(quantity).scale if scale is None else scale
    value, u = expanded(found[0].value / scale, found[0].std / scale)
    return f"{value} ± {u}" if u else value


def omega(row: SummaryRow) -> float:
    """Angular frequency of a row [rad/s]."""
    return 2.0 * pi * row.at
