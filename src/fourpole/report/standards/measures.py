"""What results say of the requirements of SAE J1085, ISO 7626-2 and ISO 10846-2, and the quantities of these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from math import atan2, degrees, floor, hypot, isfinite, log10, pi, tan

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY, Axis, axis_of
from fourpole.findings.facts import Facts
from fourpole.findings.summary import SummaryRow, summary
from fourpole.quantities import LOSS_ANGLE, MODULUS, QUANTITIES, Quantity, ShownUnits
from fourpole.report.digits import expanded, number
from fourpole.report.standards.requirement import Answer, Found, ValueTable
from fourpole.report.words.phrases import counted
from fourpole.study.compare import LINEAR
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study

#: The functions that answer requirements, by the name that standards.toml has; further arguments stand there.
MEASURES: dict[str, Callable[..., Found]] = {}
_NOTHING = "no dynamic test in use"
_QUANTITY = {one.key: one for one in QUANTITIES}
#: Limits of ISO 10846-2: level difference of a blocked output [dB]; share of the force that accelerates the mass at the
#: cell [1]; levels that are compared [dB]; frequencies in a one-third-octave band.
_BLOCKED, _MASS_SHARE, _CHANGE, _PER_BAND = 20.0, 0.06, 10.0, 5
#: Limits of ISO 7626-2: departure from the mass of a rigid block, and random error [1].
_BLOCK, _RANDOM = 0.05, 0.05


def _measure(run: Callable[..., Found]) -> Callable[..., Found]:
    MEASURES[run.__name__] = run
    return run


def _unknown(text: str) -> Found:
    return Found(text, Answer.NOT_STATED)


def _judged(text: str, met: bool) -> Found:
    """An answer from a measured value."""
    return Found(text, Answer.MET if met else Answer.NOT_MET)


def _used(results: Study) -> pl.DataFrame:
    """The dynamic tests with K* that were not rejected; no row where there are none."""
    table = results.dynamic
    if q.STORAGE.head not in table.columns:
        return pl.DataFrame()
    return table.filter(pl.col(q.VERDICT.head) != Verdict.REJECTED, pl.col(q.STORAGE.head).is_not_null())


def _known_values(results: Study, quantity: Quantity) -> list[float]:
    table = _used(results)
    if quantity.head not in table.columns:
        return []
    return [
        float(value) for value in table[quantity.head].to_list() if isinstance(value, int | float) and isfinite(value)
    ]


def _shown(value: float, quantity: Quantity, digits: int = 3) -> str:
    """An SI value with the usual unit."""
    usual = ShownUnits().of(quantity)
    return f"{number(float(f'{value / usual.scale:.{digits}g}'), digits)} {usual.suffix}".rstrip()


def _spread(values: Sequence[float], quantity: Quantity) -> str:
    """Lowest to highest of SI values with the usual unit."""
    low, high = _shown(min(values), quantity), _shown(max(values), quantity)
    return low if low == high else f"{low.rpartition(' ')[0] or low} to {high}"


def _level(ratio: float) -> float:
    """A ratio of amplitudes in decibel."""
    return 20.0 * log10(ratio)


@_measure
def not_stated(_: Study, text: str) -> Found:
    """The answer to what no test records and no campaign states."""
    return _unknown(text)


@_measure
def at_most(results: Study, key: str, limit: float) -> Found:
    """Whether a column does not exceed a limit, in SI."""
    values = _known_values(results, _QUANTITY[key])
    if not values:
        return _unknown(_NOTHING)
    return _judged(_spread(values, _QUANTITY[key]), max(values) <= limit * (1.0 + 1e-9))


@_measure
def nearest_to(
    results: Study, key: str, wanted: float, within: float = 0.0, factor: float = 1.0, name: str = ""
) -> Found:
    """Whether a test has a wanted value, `factor` times that of the column, in SI.

    It is the same `within` a difference, or else as values of this column are the same condition.
    """
    quantity = _QUANTITY[key]
    values = [factor * value for value in _known_values(results, quantity)]
    if not values:
        return _unknown(f"{quantity.name} is not known")
    own = FREQUENCY if quantity is q.FREQUENCY else axis_of(quantity.head)
    axis = Axis(quantity.head, absolute=within) if within else own
    near = min(values, key=lambda value: abs(value - wanted))
    text = f"{name or quantity.name} {_spread(values, quantity)}; nearest {_shown(near, quantity)}"
    return _judged(text, axis.same(near, wanted))


@_measure
def stated_in_all(results: Study, key: str) -> Found:
    """Whether every test states a value."""
    table = _used(results)
    if table.is_empty():
        return _unknown(_NOTHING)
    values = _known_values(results, _QUANTITY[key])
    if len(values) < table.height:
        return _unknown(f"{table.height - len(values)} of {table.height} tests do not state it")
    return _judged(_spread(values, _QUANTITY[key]), met=True)


@_measure
def reported(results: Study, key: str) -> Found:
    """Whether [report] of campaign.toml states something; the answer repeats its text."""
    text = section(results.record, "stated", "report").get(key)
    return _judged(str(text), met=True) if text else _unknown(f"[report] of campaign.toml does not state {key}")


@_measure
def calibrated(results: Study) -> Found:
    """Whether [report] lists equipment with certificates."""
    listed = section(results.record, "stated", "report").get("equipment")
    items = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    named = [one for one in items if one.get("certificate")]
    if not items:
        return _unknown("[report] of campaign.toml lists no equipment")
    text = f"{len(named)} of {len(items)} instruments listed with a certificate"
    return _judged(text, len(named) == len(items))


def _input_masses(results: Study) -> list[float]:
    """The masses between force cell and contact that the rigs state [kg]."""
    stated = [section(one, "input_mass").get("value") for one in section(results.record, "stated", "rigs").values()]
    return [float(value) for value in stated if isinstance(value, int | float)]


@_measure
def no_separation(results: Study) -> Found:
    """Whether the dynamic force stays below the preload in every test."""
    table = _used(results)
    if table.is_empty() or table[q.PRELOAD.head].null_count() == table.height:
        return _unknown("no preload is stated")
    row = table.with_columns((pl.col(q.F1.head) / pl.col(q.PRELOAD.head)).alias("share")).filter(
        pl.col("share").is_finite()
    )
    if row.is_empty():
        return _unknown("the force of no test is known")
    largest = row.sort("share", descending=True).row(0, named=True)
    return _judged(
        f"largest force amplitude {100 * largest['share']:.0f} % of the preload (test {largest[q.TEST.head]})",
        largest["share"] < 1.0,
    )


@_measure
def static_curve(results: Study) -> Found:
    """Whether each specimen of a dynamic test has a static test."""
    dynamic = set(_used(results)[q.TYRE.head]) if not _used(results).is_empty() else set()
    static = set(results.static[q.TYRE.head]) if q.TYRE.head in results.static.columns else set()
    if not dynamic:
        return _unknown(_NOTHING)
    lacking = sorted(dynamic - static)
    if lacking:
        return _unknown(f"no static test of {', '.join(lacking)}")
    return _judged(f"static load-deflection curve of {len(dynamic)} specimens", met=True)


def _mobilities(results: Study) -> pl.DataFrame:
    """The tests in use with R and I."""
    table = _used(results)
    return table if table.is_empty() else table.filter(pl.col(q.R.head).is_finite(), pl.col(q.I.head).is_finite())


@_measure
def one_point(results: Study) -> Found:
    """Whether force and motion at the contact are measured."""
    if _mobilities(results).is_empty():
        return _unknown("no mobility is known")
    return _judged("F1 and V1 at the contact", met=True)


@_measure
def rigid_block(results: Study) -> Found:
    """Departure of calibrations with a rigid block from the impedance of known masses."""
    table, dynamic = results.residuals, results.dynamic
    specimens = dynamic.filter(pl.col(q.TYRE.head) != "")[q.TEST.head].to_list() if dynamic.height else []
    blocks = table.filter(~pl.col(q.TEST.head).is_in(specimens)) if q.TEST.head in table.columns else table
    if blocks.is_empty():
        return _unknown("no test with a rigid block (kind = calibration)")
    worst, test = max(
        (
            hypot(row[q.RESIDUAL_RE.head], row[q.RESIDUAL_IM.head]) / hypot(*(row[one] for one in q.ZR.parts)),
            row["test"],
        )
        for row in blocks.rows(named=True)
    )
    text = f"F/V departs from that of the stated masses by up to {100 * worst:.2g} % (test {test})"
    return _judged(text, worst <= _BLOCK)


@_measure
def random_error(results: Study) -> Found:
    """The largest relative standard uncertainty of the mobility, random and systematic together."""
    table = _mobilities(results)
    if table.is_empty():
        return _unknown("no mobility is known")
    relative = (pl.col(q.R.u_head) ** 2 + pl.col(q.I.u_head) ** 2) / (pl.col(q.R.head) ** 2 + pl.col(q.I.head) ** 2)
    rows = table.with_columns(relative.sqrt().alias("u")).filter(pl.col("u").is_finite())
    if rows.is_empty():
        return _unknown("the uncertainty of no mobility is known")
    worst = rows.sort("u", descending=True).row(0, named=True)
    text = f"u(Y)/|Y| up to {100 * worst['u']:.2g} %, calibration included (test {worst[q.TEST.head]})"
    return _judged(text, worst["u"] < _RANDOM)


@_measure
def phase(results: Study) -> Found:
    """Whether the phase of the driving-point mobility stays within a quarter turn."""
    table = _mobilities(results)
    if table.is_empty():
        return _unknown("no mobility is known")
    rows = table.select(q.R.head, q.I.head, q.TEST.head).rows()
    worst, test = max(((degrees(atan2(im, re)), test) for re, im, test in rows), key=lambda one: abs(one[0]))
    return _judged(f"largest phase {number(worst, 3)}° (test {test})", abs(worst) <= 90.0)


@_measure
def input_mass(results: Study) -> Found:
    """Whether the mass between force cell and contact is stated, so that its force is taken off."""
    known = _input_masses(results)
    if not known:
        return _unknown("input_mass of the rig is not stated: taken as none")
    return _judged(f"input_mass {number(max(known), 3)} kg, taken off", met=True)


@_measure
def output_blocked(results: Study) -> Found:
    """The least level difference of input and output motion."""
    table = _used(results)
    if table.is_empty():
        return _unknown(_NOTHING)
    measured = table.filter(pl.col(q.V2.head).is_finite() & (pl.col(q.V2.head) > 0.0))
    if measured.is_empty():
        blocked = any(stated_blocked(results.record, name) for name in section(results.record, "stated", "rigs"))
        return _unknown(f"V2 is not measured{'; the far side is stated as blocked' if blocked else ''}")
    ratio = (
        measured.with_columns((pl.col(q.V1.head) / pl.col(q.V2.head)).alias("ratio")).sort("ratio").row(0, named=True)
    )
    least = _level(ratio["ratio"])
    return _judged(f"least 20 lg(V1/V2) is {number(least, 3)} dB (test {ratio[q.TEST.head]})", least >= _BLOCKED)


@_measure
def mass_at_cell(results: Study) -> Found:
    """The inertia of the mass between force cell and specimen as a share of the force."""
    masses = [mass for mass in _input_masses(results) if mass > 0]
    table = _used(results)
    if not masses or table.is_empty():
        return _unknown("no mass between specimen and force cell is stated (input_mass of the rig)")
    inertia = 2 * np.pi * pl.col(q.FREQUENCY.head) * pl.col(q.V1.head) * max(masses) / pl.col(q.F1.head)
    row = table.with_columns(inertia.alias("share")).sort("share", descending=True).row(0, named=True)
    text = f"m a / F up to {100 * row['share']:.2g} % at the contact (test {row[q.TEST.head]})"
    return _judged(text, row["share"] <= _MASS_SHARE)


@_measure
def lines_per_band(results: Study) -> Found:
    """The least number of tested frequencies in a one-third-octave band that a condition touches."""
    table = _used(results)
    if table.is_empty():
        return _unknown(_NOTHING)
    facts, least, where = Facts.of(results), 10**9, ""
    groups: dict[tuple[object, ...], list[float]] = {}
    for row in facts.used_dynamic:
        groups.setdefault((row[q.TYRE.head], *facts.key(row, ("pressure", "load"))), []).append(row[q.FREQUENCY.head])
    for key, frequencies in groups.items():
        numbers = FREQUENCY.groups(frequencies)
        distinct = [float(np.mean(np.array(frequencies)[numbers == one])) for one in np.unique(numbers)]
        bands = [floor(10.0 * log10(one / 1000.0) + 0.5) for one in distinct]
        for band in set(bands):
            if bands.count(band) < least:
                least, where = bands.count(band), f"band about {number(1000.0 * 10 ** (band / 10.0), 2)} Hz, {key[0]}"
    return _judged(f"{least} in the {where}", least >= _PER_BAND)


@_measure
def linearity(results: Study) -> Found:
    """The largest change of force over deflection in dB between two levels of one condition that are 10 dB apart."""
    facts = Facts.of(results)
    cells: dict[tuple[object, ...], list[tuple[float, float]]] = {}
    for row in facts.used_dynamic:
        force, deflection = (row.get(one.head) for one in (q.F1, q.DEFLECTION_AMPLITUDE))
        if force and deflection:
            key = (row[q.TYRE.head], *facts.key(row, ("pressure", "load", "frequency")))
            cells.setdefault(key, []).append((float(deflection), float(force) / float(deflection)))
    changes = [
        abs(_level(b[1] / a[1]))
        for cell in cells.values()
        for a, b in combinations(cell, 2)
        if abs(_level(b[0] / a[0])) >= _CHANGE
    ]
    if not changes:
        return _unknown("no condition was tested at two levels 10 dB apart")
    text = f"force over deflection changes by up to {number(max(changes), 2)} dB in {counted(len(changes), 'pair')}"
    return _judged(text, max(changes) <= LINEAR)


def _rows_of(results: Study) -> tuple[SummaryRow, ...]:
    """Each condition at one frequency: that of [report], else the tested one nearest to 15 Hz."""
    return tuple(row for row in summary(results, most=None) if MODULUS.key in row.values)


def _place(row: SummaryRow) -> tuple[str, str, str]:
    """Specimen, state and frequency of a row as texts."""
    parts = [
        ShownUnits().text(quantity, ends[0])
        for ends, quantity in ((row.pressure, q.PRESSURE), (row.preload, q.PRELOAD), (row.temperature, q.TEMPERATURE))
        if ends is not None
    ]
    return row.specimen, ", ".join(parts), number(row.at, 3)


def _with_expanded(row: SummaryRow, quantity: Quantity, scale: float | None = None) -> str:
    """A quantity of a row with U (k = 2), over a scale in SI; blank where it has none."""
    found = row.values.get(quantity.key)
    if found is None:
        return ""
    scale = ShownUnits().of(quantity).scale if scale is None else scale
    value, u = expanded(found[0].value / scale, found[0].std / scale)
    return f"{value} ± {u}" if u else value


def _double_amplitude(results: Study, row: SummaryRow) -> str:
    """Lowest to highest double amplitude of the tests of a row [mm]."""
    table = results.dynamic.filter(pl.col(q.TEST.head).is_in(list(row.tests)))
    values = [2e3 * value for value in table[q.DEFLECTION_AMPLITUDE.head].drop_nulls() if isfinite(value)]
    if not values:
        return ""
    low, high = number(min(values), 3), number(max(values), 3)
    return low if low == high else f"{low} to {high}"


def _spring_rates(results: Study) -> ValueTable:
    """Spring rates, damping coefficient and loss of each condition at one frequency."""
    heads = (
        "specimen", "condition", q.FREQUENCY.label, "double amplitude [mm]", "complex spring rate K* [kN/m]",
        "dynamic spring rate K' [kN/m]", "damping coefficient K''/ω [N s/m]", LOSS_ANGLE.label, "tan δ [1]",
    )  # fmt: skip
    rows = []
    for row in _rows_of(results):
        angle = row.values.get(LOSS_ANGLE.key)
        rows.append(
            (
                *_place(row),
                _double_amplitude(results, row),
                _with_expanded(row, MODULUS),
                _with_expanded(row, q.STORAGE),
                _with_expanded(row, q.LOSS, 2.0 * pi * row.at),
                _with_expanded(row, LOSS_ANGLE),
                "" if angle is None else number(tan(angle[0].value), 3),
            )
        )
    return ValueTable(heads, tuple(rows))


def _mobility_values(results: Study) -> ValueTable:
    """Driving-point mobility of each condition at one frequency."""
    heads = (
        "specimen",
        "condition",
        q.FREQUENCY.label,
        "|Y| [mm/(N s)]",
        "phase [°]",
        "free effective mass |F/a| [kg]",
    )
    table, rows = _mobilities(results), []
    for row in _rows_of(results):
        own = table.filter(pl.col(q.TEST.head).is_in(list(row.tests))) if not table.is_empty() else table
        if own.is_empty():
            continue
        re, im = (float(own[one.head].mean()) for one in (q.R, q.I))  # type: ignore[arg-type]
        size = hypot(re, im)
        phase, mass = degrees(atan2(im, re)), 1.0 / (2.0 * pi * row.at * size)
        rows.append((*_place(row), number(1e3 * size, 4), number(phase, 4), number(mass, 4)))
    return ValueTable(heads, tuple(rows))


def _transfer_values(results: Study) -> ValueTable:
    """Level of the dynamic transfer stiffness and loss factor of each condition at one frequency."""
    heads = ("specimen", "condition", q.FREQUENCY.label, "|k2,1| [kN/m]", "level Lk [dB re 1 N/m]", q.LOSS_FACTOR.label)
    rows = []
    for row in _rows_of(results):
        modulus, angle = row.values.get(MODULUS.key), row.values.get(LOSS_ANGLE.key)
        found = "" if modulus is None else f"{_level(modulus[0].value):.1f}"
        loss = "" if angle is None else number(np.tan(angle[0].value), 3)
        rows.append((*_place(row), _with_expanded(row, MODULUS), found, loss))
    return ValueTable(heads, tuple(rows))


#: The quantities of each standard in its own terms, by its name.
VALUES = {"sae-j1085": _spring_rates, "iso-7626-2": _mobility_values, "iso-10846-2": _transfer_values}
