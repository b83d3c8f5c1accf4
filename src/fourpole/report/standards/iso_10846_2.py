"""ISO 10846-2: dynamic transfer stiffness of resilient supports by the direct method."""

from __future__ import annotations

from itertools import combinations
from math import floor, log10

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.condition import FREQUENCY
from fourpole.findings.facts import Facts
from fourpole.quantities import LOSS_ANGLE, MODULUS
from fourpole.report.digits import number
from fourpole.report.standards import measures as m
from fourpole.report.standards.requirement import Answer, Found, Requirement, Standard, ValueTable
from fourpole.report.words.phrases import counted
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study

_CONTENTS = "table of contents in a standards catalogue (EN ISO 10846-2:2008)"
_INEQUALITY = f"{_CONTENTS}; phonometry, open source, whose errata quote clause and inequality"
_LINES = f"{_CONTENTS}; phonometry, open source, which quotes the five lines"
_LINEARITY = f"{_CONTENTS}; phonometry, open source, which cites clause 7.7 with both figures"
_BLOCKED, _MASS_SHARE, _CHANGE, _LINEAR, _PER_BAND = 20.0, 0.06, 10.0, 1.5, 5


def _output_blocked(results: Study) -> Found:
    """The least level difference of input and output motion."""
    table = m.used(results)
    if table.is_empty():
        return Found(m.NOTHING, Answer.NOT_STATED)
    measured = table.filter(pl.col(q.V2.head).is_finite() & (pl.col(q.V2.head) > 0.0))
    if measured.is_empty():
        blocked = any(stated_blocked(results.record, name) for name in section(results.record, "stated", "rigs"))
        return Found(f"V2 is not measured{'; the far side is stated as blocked' if blocked else ''}", Answer.NOT_STATED)
    ratio = (
        measured.with_columns((pl.col(q.V1.head) / pl.col(q.V2.head)).alias("ratio")).sort("ratio").row(0, named=True)
    )
    least = m.level(ratio["ratio"])
    return m.judged(f"least 20 lg(V1/V2) is {number(least, 3)} dB (test {ratio[q.TEST.head]})", least >= _BLOCKED)


def _mass_at_cell(results: Study) -> Found:
    """The inertia of the mass between force cell and specimen as a share of the force."""
    masses = [mass for mass in m.input_masses(results) if mass > 0]
    table = m.used(results)
    if not masses or table.is_empty():
        return Found("no mass between specimen and force cell is stated (input_mass of the rig)", Answer.NOT_STATED)
    inertia = 2 * np.pi * pl.col(q.FREQUENCY.head) * pl.col(q.V1.head) * max(masses) / pl.col(q.F1.head)
    row = table.with_columns(inertia.alias("share")).sort("share", descending=True).row(0, named=True)
    text = f"m a / F up to {100 * row['share']:.2g} % at the contact (test {row[q.TEST.head]})"
    return m.judged(text, row["share"] <= _MASS_SHARE)


def _lines_per_band(results: Study) -> Found:
    """The least number of tested frequencies in a one-third-octave band that a condition touches."""
    table = m.used(results)
    if table.is_empty():
        return Found(m.NOTHING, Answer.NOT_STATED)
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
    return m.judged(f"{least} in the {where}", least >= _PER_BAND)


def _linear(results: Study) -> Found:
    """The largest change of force over deflection in dB between two levels of one condition that are 10 dB apart."""
    facts = Facts.of(results)
    cells: dict[tuple[object, ...], list[tuple[float, float]]] = {}
    for row in facts.used_dynamic:
        force, deflection = (row.get(one.head) for one in (q.F1, q.DEFLECTION_AMPLITUDE))
        if force and deflection:
            key = (row[q.TYRE.head], *facts.key(row, ("pressure", "load", "frequency")))
            cells.setdefault(key, []).append((float(deflection), float(force) / float(deflection)))
    changes = [
        abs(m.level(b[1] / a[1]))
        for cell in cells.values()
        for a, b in combinations(cell, 2)
        if abs(m.level(b[0] / a[0])) >= _CHANGE
    ]
    if not changes:
        return Found("no condition was tested at two levels 10 dB apart", Answer.NOT_STATED)
    pairs = counted(len(changes), "pair")
    text = f"force over deflection changes by up to {number(max(changes), 2)} dB in {pairs}"
    return m.judged(text, max(changes) <= _LINEAR)


def _values(results: Study) -> ValueTable:
    """Level of the dynamic transfer stiffness and loss factor of each condition at one frequency."""
    heads = ("specimen", "condition", q.FREQUENCY.label, "|k2,1| [kN/m]", "level Lk [dB re 1 N/m]", q.LOSS_FACTOR.label)
    rows = []
    for row in m.rows_of(results):
        modulus, angle = row.values.get(MODULUS.key), row.values.get(LOSS_ANGLE.key)
        found = "" if modulus is None else f"{m.level(modulus[0].value):.1f}"
        loss = "" if angle is None else number(np.tan(angle[0].value), 3)
        rows.append((*m.place(row), m.with_expanded(row, MODULUS), found, loss))
    return ValueTable(heads, tuple(rows))


STANDARD = Standard(
    key="iso-10846-2",
    title="ISO 10846-2, Vibro-acoustic transfer properties of resilient elements, direct method",
    terms=(
        "Dynamic transfer stiffness k2,1 is the blocking force at the output over the displacement at the input.",
        "K* of Fourpole is force over deflection of the specimen: it is k2,1 while its inertia is negligible.",
        "The level Lk is 20 lg(|k2,1| / 1 N/m); the loss factor is Im k2,1 / Re k2,1.",
        "U is the expanded uncertainty (k = 2).",
    ),
    requirements=(
        Requirement(
            "blocked output", "6.1", "The output is at rest against the input.", "20 lg(a1/a2) at least 20 dB",
            _INEQUALITY, _output_blocked,
        ),
        Requirement(
            "mass at the force cell", "6.2",
            "The mass between specimen and force transducers takes little of the force.",
            "m a at most 6 % of F (0.5 dB)", _INEQUALITY, _mass_at_cell,
        ),
        Requirement(
            "flanking", "6.3", "Vibration that passes the specimen by is negligible.", "", _CONTENTS,
            m.not_stated("no channel records it"),
        ),
        Requirement(
            "unwanted input", "6.4", "The input moves in the direction of the excitation.",
            "other directions at least 15 dB lower", _INEQUALITY, m.not_stated("one direction is recorded"),
        ),
        Requirement(
            "transducers", "6.5, 6.6", "Accelerometers and force transducers are calibrated.", "", _CONTENTS,
            m.calibrated,
        ),
        Requirement(
            "lines per band", "6.8", "Each one-third-octave band has enough frequencies.", "5 at least", _LINES,
            _lines_per_band,
        ),
        Requirement(
            "preload", "7.1", "The specimen is tested under a stated preload.", "", _CONTENTS,
            m.stated_in_all(q.PRELOAD),
        ),
        Requirement(
            "linearity", "7.7", "The stiffness does not change with the level of the input.",
            "1.5 dB for input levels 10 dB apart", _LINEARITY, _linear,
        ),
        Requirement(
            "temperature", "9, 10", "The temperature of the test is recorded.", "", _CONTENTS,
            m.stated_in_all(q.TEMPERATURE),
        ),
        Requirement(
            "static curve", "annex A", "The static load-deflection curve is given (informative).", "", _CONTENTS,
            m.static_curve,
        ),
    ),
    values=_values,
)  # fmt: skip
