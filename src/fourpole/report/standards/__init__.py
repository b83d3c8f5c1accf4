"""SAE J1085, ISO 7626-2 and ISO 10846-2 as data: their requirements, what results say of them, and the page of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import combinations
from math import atan2, degrees, floor, hypot, inf, log10, pi, tan
from operator import itemgetter
from typing import Any

import numpy as np
import polars as pl
from markupsafe import Markup

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY, Axis, axis_of
from fourpole.core.digits import number
from fourpole.errors import CampaignError
from fourpole.findings.facts import Facts
from fourpole.findings.summary import SummaryRow, summary
from fourpole.quantities import LOSS_ANGLE, MODULUS, QUANTITIES, Quantity, ShownUnits
from fourpole.report.digits import counted, expanded
from fourpole.report.html import packaged, rendered
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study
from fourpole.units import shown
from fourpole.version import VERSION
from fourpole.words import package_toml

#: What standards.toml says: a note, the words of what is measured, and the standards by their names.
STATED: dict[str, Any] = package_toml("fourpole.report.standards", "standards.toml")
#: What the answers are worth, in the page and in the terminal.
NOTE: str = STATED["note"]


class Answer(StrEnum):
    """Whether a requirement is met."""

    MET = "met"
    NOT_MET = "not met"
    NOT_STATED = "not stated"


@dataclass(frozen=True)
class Found:
    """What the results say of a requirement: the measured value in words, and the answer."""

    text: str
    answer: Answer


@dataclass(frozen=True)
class Requirement:
    """One requirement of a standard.

    Attributes
    ----------
    key : str
        Its name in JSON.
    clause : str
        Number of the clause; empty where it is not known.
    text : str
        The requirement in words of our own.
    limit : str
        The limit in words; empty where there is none, or it is not known.
    source : str
        Where clause, text and limit are from.
    measure : callable
        What the results say of it, with further arguments.
    given : tuple
        Those arguments.
    read : bool
        Whether the clause was read in the standard itself.
    """

    key: str
    clause: str
    text: str
    limit: str
    source: str
    measure: Callable[..., Found]
    given: tuple[Any, ...] = ()
    read: bool = False

    @property
    def place(self) -> str:
        """The clause with a mark if it was not read: "6.1, not read", or "clause not read"."""
        if not self.clause:
            return "clause not read"
        return self.clause if self.read else f"{self.clause}, not read"

    @property
    def origin(self) -> str:
        """Where the requirement is from."""
        return self.source if self.read else f"from secondary sources: {self.source}"


@dataclass(frozen=True)
class ValueTable:
    """The standard's own quantities: heads with units, and a row of texts for each condition."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Standard:
    """One standard.

    Attributes
    ----------
    key : str
        Its name in the command, as "sae-j1085".
    title : str
    terms : tuple of str
        How its quantities follow from those of Fourpole, as sentences.
    requirements : tuple of Requirement
    values : callable
        Its own quantities of the results.
    """

    key: str
    title: str
    terms: tuple[str, ...]
    requirements: tuple[Requirement, ...]
    values: Callable[[Study], ValueTable]


def answered(standard: Standard, results: Study) -> list[tuple[Requirement, Found]]:
    """Each requirement with what the results say of it."""
    return [(one, one.measure(results, *one.given)) for one in standard.requirements]


def counts(found: Sequence[tuple[Requirement, Found]]) -> dict[Answer, int]:
    """Number of requirements by answer."""
    return {answer: sum(one.answer is answer for _, one in found) for answer in Answer}


#: Class of the badge of an answer.
_BADGES = dict(zip(Answer, (Verdict.OK, Verdict.REJECTED, Verdict.WARNING), strict=True))


def render_standard(standard: Standard, results: Study) -> str:
    """The page as text; whatever the results state is escaped, and the page loads and runs nothing."""
    found = answered(standard, results)
    return rendered(
        {"page": packaged("standard.html", "fourpole.report.standards")},
        standard=standard,
        title=str(results.record.get("title") or "") or "Campaign without a title",
        counts=counts(found),
        requirements=found,
        badges=_BADGES,
        values=standard.values(results),
        note=NOTE,
        style=Markup(packaged("page.css")),
        version=VERSION,
    )


_QUANTITY = {one.key: one for one in QUANTITIES}
#: Difference of the levels of which the stiffness is compared [dB].
_CHANGE = 10.0
#: Finite values of what is measured, each with the name of its test or place.
Measured = list[tuple[float, str]]


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


def _values(table: pl.DataFrame, value: pl.Expr) -> Measured:
    """The finite values of an expression with their tests; none where the table lacks a column."""
    if not {q.TEST.head, *value.meta.root_names()} <= set(table.columns):
        return []
    return table.select(value.alias("value"), q.TEST.head).filter(pl.col("value").is_finite()).rows()


def _of_tests(value: pl.Expr, results: Study) -> Measured:
    """The values of an expression of the tests in use."""
    return _values(_used(results), value)


def _blocks(results: Study) -> Measured:
    """Departure of each calibration with a rigid block from the impedance of known masses [1]."""
    dynamic = results.dynamic
    specimens = set(dynamic.filter(pl.col(q.TYRE.head) != "")[q.TEST.head]) if dynamic.height else set()
    share = _size(q.RESIDUAL_RE.head, q.RESIDUAL_IM.head) / _size(*q.ZR.parts)
    return [one for one in _values(results.residuals, share) if one[1] not in specimens]


def _input_masses(results: Study) -> Measured:
    """The masses between force cell and contact that the rigs state [kg]."""
    rigs = section(results.record, "stated", "rigs").items()
    stated = [(section(rig, "input_mass").get("value"), name) for name, rig in rigs]
    return [(float(value), name) for value, name in stated if isinstance(value, int | float)]


def _inertia_over_force(results: Study) -> Measured:
    """Inertia of the largest mass between force cell and specimen, as a share of the force of each test [1]."""
    mass = max((mass for mass, _ in _input_masses(results)), default=0.0)
    inertia = 2 * np.pi * pl.col(q.FREQUENCY.head) * pl.col(q.V1.head) * mass
    return _of_tests(inertia / pl.col(q.F1.head), results) if mass > 0 else []


def _far_side(results: Study) -> Measured:
    """The tests that measure V2; where none does, the rigs unless one of them is stated as blocked."""
    rigs = section(results.record, "stated", "rigs")
    blocked = any(stated_blocked(results.record, name) for name in rigs)
    return _of_tests(1.0 / pl.col(q.V2.head), results) or ([] if blocked else [(0.0, "")])


def _lines_per_band(results: Study) -> Measured:
    """The number of tested frequencies in each one-third-octave band that a condition touches."""
    facts = Facts.of(results)
    groups: dict[tuple[object, ...], list[float]] = {}
    for row in facts.used_dynamic:
        groups.setdefault((row[q.TYRE.head], *facts.key(row, ("pressure", "load"))), []).append(row[q.FREQUENCY.head])
    found: Measured = []
    for key, frequencies in groups.items():
        numbers = FREQUENCY.groups(frequencies)
        distinct = [float(np.mean(np.array(frequencies)[numbers == one])) for one in np.unique(numbers)]
        bands = [floor(10.0 * log10(one / 1000.0) + 0.5) for one in distinct]
        found += [
            (bands.count(band), f"band about {number(1000.0 * 10 ** (band / 10.0), 2)} Hz, {key[0]}")
            for band in set(bands)
        ]
    return found


def _linearity(results: Study) -> Measured:
    """The changes of force over deflection in dB between two levels of one condition that are 10 dB apart."""
    facts = Facts.of(results)
    cells: dict[tuple[object, ...], list[tuple[float, float]]] = {}
    for row in facts.used_dynamic:
        force, deflection = (row.get(one.head) for one in (q.F1, q.DEFLECTION_AMPLITUDE))
        if force and deflection:
            key = (row[q.TYRE.head], *facts.key(row, ("pressure", "load", "frequency")))
            cells.setdefault(key, []).append((float(deflection), float(force) / float(deflection)))
    return [
        (abs(_level(b[1] / a[1])), "")
        for cell in cells.values()
        for a, b in combinations(cell, 2)
        if abs(_level(b[0] / a[0])) >= _CHANGE
    ]


def _level(ratio: float) -> float:
    """A ratio of amplitudes in decibel."""
    return 20.0 * log10(ratio)


def _size(re: str, im: str) -> pl.Expr:
    """Modulus of a complex value by the heads of its parts."""
    return (pl.col(re) ** 2 + pl.col(im) ** 2).sqrt()


_MOBILITY = _size(q.R.head, q.I.head)
#: What is measured, by its name in standards.toml, which has the words for it.
_MEASURED: dict[str, Callable[[Study], Measured]] = {
    "tests in use": partial(_of_tests, pl.col(q.FREQUENCY.head)),
    "preload": partial(_of_tests, pl.col(q.PRELOAD.head)),
    "force over preload": partial(_of_tests, pl.col(q.F1.head) / pl.col(q.PRELOAD.head)),
    "mobility": partial(_of_tests, _MOBILITY),
    "uncertainty of mobility": partial(_of_tests, _size(q.R.u_head, q.I.u_head) / _MOBILITY),
    "phase of mobility": partial(_of_tests, pl.arctan2(pl.col(q.I.head), pl.col(q.R.head)).degrees()),
    "V2": _far_side,
    "level of V1 over V2": partial(_of_tests, 20.0 * (pl.col(q.V1.head) / pl.col(q.V2.head)).log10()),
    "inertia over force": _inertia_over_force,
    "input mass": _input_masses,
    "rigid block": _blocks,
    "lines per band": _lines_per_band,
    "linearity": _linearity,
}


def _largest(values: Measured) -> tuple[float, str]:
    return max(values, key=lambda one: abs(one[0]))


#: The worst value of what is measured, and whether it keeps a limit, by the word in standards.toml.
_BOUNDS: dict[str, tuple[Callable[[Measured], tuple[float, str]], Callable[[float, float], bool]]] = {
    "at_most": (_largest, lambda worst, limit: abs(worst) <= limit),
    "below": (_largest, lambda worst, limit: abs(worst) < limit),
    "at_least": (partial(min, key=itemgetter(0)), lambda worst, limit: worst >= limit),
    "known": (_largest, lambda *_: True),
}


def bounded(bound: str, results: Study, name: str, limit: float = 0.0) -> Found:
    """Whether the worst value of what is measured keeps a limit."""
    said, unknown, *needs = STATED["measured"][name]
    for needed in needs:
        if not _MEASURED[needed](results):
            return _unknown(STATED["measured"][needed][1])
    values = _MEASURED[name](results)
    if not values:
        return _unknown(unknown)
    worst_of, keeps = _BOUNDS[bound]
    worst, test = worst_of(values)
    shown = {"value": worst, "percent": 100 * worst, "two": number(worst, 2), "three": number(worst, 3)}
    return _judged(said.format(**shown, test=test, pairs=counted(len(values), "pair")), keeps(worst, limit))


def not_stated(_: Study, text: str) -> Found:
    """The answer to what no test records and no campaign states."""
    return _unknown(text)


def _range(values: Sequence[float]) -> str:
    """Lowest to highest value with three digits; blank without a value."""
    ends = dict.fromkeys(number(float(f"{value:.3g}"), 3) for value in (min(values), max(values))) if values else ()
    return " to ".join(ends)


def _shown(values: Sequence[float], quantity: Quantity) -> str:
    """Lowest to highest of SI values with the usual unit."""
    return f"{_range([value / quantity.scale for value in values])} {quantity.suffix}".rstrip()


def nearest_to(
    results: Study, key: str, wanted: float, within: float = 0.0, factor: float = 1.0, name: str = ""
) -> Found:
    """Whether a test has a wanted value, `factor` times that of the column, in SI.

    It is the same `within` a difference, or else as values of this column are the same condition.
    """
    quantity = _QUANTITY[key]
    values = [factor * value for value, _ in _of_tests(pl.col(quantity.head), results)]
    if not values:
        return _unknown(f"{quantity.name} is not known")
    own = FREQUENCY if quantity is q.FREQUENCY else axis_of(quantity.head)
    axis = Axis(quantity.head, absolute=within) if within else own
    near = min(values, key=lambda value: abs(value - wanted))
    text = f"{name or quantity.name} {_shown(values, quantity)}; nearest {_shown([near], quantity)}"
    return _judged(text, axis.same(near, wanted))


def stated_in_all(results: Study, key: str, most: float = inf) -> Found:
    """Whether every test states a value, and none is larger than a limit, in SI."""
    quantity, count = _QUANTITY[key], _used(results).height
    values = [value for value, _ in _of_tests(pl.col(quantity.head), results)]
    if not count:
        return _unknown(STATED["measured"]["tests in use"][1])
    if len(values) < count:
        return _unknown(f"{count - len(values)} of {count} tests do not state it")
    return _judged(_shown(values, quantity), max(values) <= most * (1.0 + 1e-9))


def reported(results: Study, key: str) -> Found:
    """Whether [report] of campaign.toml states something; the answer repeats its text."""
    text = section(results.record, "stated", "report").get(key)
    return _judged(str(text), met=True) if text else _unknown(f"[report] of campaign.toml does not state {key}")


def calibrated(results: Study) -> Found:
    """Whether [report] lists equipment with certificates."""
    listed = section(results.record, "stated", "report").get("equipment")
    items = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    named = [one for one in items if one.get("certificate")]
    if not items:
        return _unknown("[report] of campaign.toml lists no equipment")
    text = f"{len(named)} of {len(items)} instruments listed with a certificate"
    return _judged(text, len(named) == len(items))


def static_curve(results: Study) -> Found:
    """Whether each specimen of a dynamic test has a static test."""
    dynamic, static = (
        set(table[q.TYRE.head]) if q.TYRE.head in table.columns else set() for table in (_used(results), results.static)
    )
    if not dynamic:
        return _unknown(STATED["measured"]["tests in use"][1])
    lacking = sorted(dynamic - static)
    if lacking:
        return _unknown(f"no static test of {', '.join(lacking)}")
    return _judged(f"static load-deflection curve of {len(dynamic)} specimens", met=True)


#: The functions that answer requirements, by the name that standards.toml has; further arguments stand there.
MEASURES: dict[str, Callable[..., Found]] = {
    **{bound: partial(bounded, bound) for bound in _BOUNDS},
    **{run.__name__: run for run in (not_stated, nearest_to, stated_in_all, reported, calibrated, static_curve)},
}


def value_table(columns: Sequence[tuple[str, str]], results: Study) -> ValueTable:
    """The quantities of a standard for each condition at one frequency: that of [report], else the nearest to 15 Hz."""
    rows = []
    for row in summary(results, most=None):
        cells = _cells(results, row) if MODULUS.key in row.values else {}
        found = [cells.get(name, "") for _, name in columns]
        if any(found):
            states = ((row.pressure, q.PRESSURE), (row.preload, q.PRELOAD), (row.temperature, q.TEMPERATURE))
            state = ", ".join(ShownUnits().text(quantity, ends[0]) for ends, quantity in states if ends is not None)
            rows.append((row.specimen, state, number(row.at, 3), *found))
    return ValueTable(("specimen", "condition", q.FREQUENCY.label, *(head for head, _ in columns)), tuple(rows))


def _cells(results: Study, row: SummaryRow) -> dict[str, str]:
    """The quantities of a condition by the names that standards.toml has; blank where they are not known."""
    omega, angle = 2.0 * pi * row.at, row.values.get(LOSS_ANGLE.key)
    tests = _used(results).filter(pl.col(q.TEST.head).is_in(list(row.tests)))
    cells = {
        "double amplitude": _range([2e3 * value for value, _ in _values(tests, pl.col(q.DEFLECTION_AMPLITUDE.head))]),
        "modulus": _with_u(row, MODULUS),
        "level": f"{_level(row.values[MODULUS.key][0].value):.1f}",
        "storage": _with_u(row, q.STORAGE),
        "damping coefficient": _with_u(row, q.LOSS, omega),
        "loss angle": _with_u(row, LOSS_ANGLE),
        "tan δ": "" if angle is None else number(tan(angle[0].value), 3),
    }
    parts = tests.select(q.R.head, q.I.head).filter(_MOBILITY.is_finite()).mean().row(0)
    if None not in parts:
        size, phase = hypot(*parts), degrees(atan2(parts[1], parts[0]))
        cells |= {"|Y|": number(1e3 * size, 4), "phase": number(phase, 4), "mass": number(1.0 / (omega * size), 4)}
    return cells


def _with_u(row: SummaryRow, quantity: Quantity, scale: float | None = None) -> str:
    """A quantity of a row with U (k = 2), over a scale in SI; blank where it has none."""
    found = row.values.get(quantity.key)
    if found is None:
        return ""
    scale = scale or quantity.scale
    value, u = expanded(found[0].value / scale, found[0].std / scale)
    return f"{value} ± {u}" if u else value


#: The standards by their name in the command, from standards.toml, which says what stands in it.
STANDARDS = {
    key: Standard(
        key,
        stated["title"],
        tuple(stated["terms"]),
        tuple(
            Requirement(name, clause, text, limit, stated["sources"][source], MEASURES[measure], tuple(given))
            for name, clause, text, limit, source, measure, *given in stated["requirements"]
        ),
        partial(value_table, stated["values"]),
    )
    for key, stated in STATED["standards"].items()
}
#: The page of each, in the folder of the results.
PAGES = {name: f"report-{name}.html" for name in STANDARDS}


def standard_named(name: str) -> Standard:
    """The standard of a name; CampaignError with the list for another name."""
    found = STANDARDS.get(name.strip().lower())
    if found is None:
        raise CampaignError(f"--standard {shown(name)}: no such standard: choose one of {', '.join(STANDARDS)}")
    return found
