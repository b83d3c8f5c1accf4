"""SAE J1085: dynamic properties of elastomeric isolators by forced vibration, up to 25 Hz."""

from __future__ import annotations

from math import isfinite, tan

import polars as pl

from fourpole import quantities as q
from fourpole.core.condition import AMPLITUDE, FREQUENCY, Axis
from fourpole.findings.summary import SummaryRow
from fourpole.quantities import LOSS_ANGLE, MODULUS
from fourpole.report.digits import number
from fourpole.report.standards import measures as m
from fourpole.report.standards.requirement import Requirement, Standard, ValueTable
from fourpole.study.study import Study

_SCOPE = "the scope of J1085 MAY1999 as a document exchange shows it"
_SUMMARY = "a summary of J1085:2017 by a test laboratory (tnlab.org)"
_ROOM = Axis(q.TEMPERATURE.head, absolute=2.0)


def _double_amplitude(results: Study, row: SummaryRow) -> str:
    """Lowest to highest double amplitude of the tests of a row [mm]."""
    table = results.dynamic.filter(pl.col(q.TEST.head).is_in(list(row.tests)))
    values = [2e3 * value for value in table[q.DEFLECTION_AMPLITUDE.head].drop_nulls() if isfinite(value)]
    if not values:
        return ""
    low, high = number(min(values), 3), number(max(values), 3)
    return low if low == high else f"{low} to {high}"


def _values(results: Study) -> ValueTable:
    """Spring rates, damping coefficient and loss of each condition at one frequency."""
    heads = (
        "specimen", "condition", q.FREQUENCY.label, "double amplitude [mm]", "complex spring rate K* [kN/m]",
        "dynamic spring rate K' [kN/m]", "damping coefficient K''/ω [N s/m]", LOSS_ANGLE.label, "tan δ [1]",
    )  # fmt: skip
    rows = []
    for row in m.rows_of(results):
        angle = row.values.get(LOSS_ANGLE.key)
        rows.append(
            (
                *m.place(row),
                _double_amplitude(results, row),
                m.with_expanded(row, MODULUS),
                m.with_expanded(row, q.STORAGE),
                m.with_expanded(row, q.LOSS, m.omega(row)),
                m.with_expanded(row, LOSS_ANGLE),
                "" if angle is None else number(tan(angle[0].value), 3),
            )
        )
    return ValueTable(heads, tuple(rows))


STANDARD = Standard(
    key="sae-j1085",
    title="SAE J1085, Testing dynamic properties of elastomeric isolators",
    terms=(
        "Dynamic spring rate is K', the part of K* in phase with the deflection; complex spring rate is |K*|.",
        "Damping coefficient is K''/ω. It is not C: K2 and C of Fourpole are spring and damper of an arm beside K1.",
        "Amplitude is double amplitude, twice the 0-to-peak amplitude of Fourpole's tables.",
        "U is the expanded uncertainty (k = 2).",
    ),
    requirements=(
        Requirement(
            "frequency range", "1", "Solid isolators are tested at frequencies up to 25 Hz.", "at most 25 Hz",
            _SCOPE, m.at_most(q.FREQUENCY, 25.0),
        ),
        Requirement(
            "reference frequency", "", "A single measurement is made at the reference frequency.",
            "15 Hz (the same within 2 %, our rule)", _SUMMARY, m.nearest_to(q.FREQUENCY, 15.0, FREQUENCY),
        ),
        Requirement(
            "reference amplitude", "", "A single measurement is made at the reference double amplitude.",
            "0.50 mm (the same within 5 %, our rule)", _SUMMARY,
            m.nearest_to(q.DEFLECTION_AMPLITUDE, 0.5e-3, AMPLITUDE, factor=2.0, name="double amplitude"),
        ),
        Requirement(
            "temperature", "", "The ambient temperature is that of a standard atmosphere.", "23 °C ± 2 °C",
            _SUMMARY, m.nearest_to(q.TEMPERATURE, 23.0, _ROOM),
        ),
        Requirement(
            "preload", "", "The preload is that of the application, and is stated.", "", _SUMMARY,
            m.stated_in_all(q.PRELOAD),
        ),
        Requirement(
            "separation", "", "The specimen does not separate from its fixture during a cycle.",
            "dynamic force below the preload (our criterion)", _SUMMARY, m.no_separation,
        ),
        Requirement(
            "stabilisation", "", "The test runs at its conditions before the reading, which follows within a minute.",
            "2 min at least", _SUMMARY, m.not_stated("a recording does not tell how long the test had run"),
        ),
        Requirement(
            "conditioning", "", "Conditioning of the specimen before the test is stated.", "", _SUMMARY,
            m.reported("conditioning"),
        ),
    ),
    values=_values,
)  # fmt: skip
