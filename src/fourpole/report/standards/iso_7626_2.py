"""ISO 7626-2: mechanical mobility by single-point translation excitation with an attached exciter."""

from __future__ import annotations

from math import atan2, degrees, hypot

import polars as pl

from fourpole import quantities as q
from fourpole.report.digits import number
from fourpole.report.standards import measures as m
from fourpole.report.standards.requirement import Answer, Found, Requirement, Standard, ValueTable
from fourpole.study.study import Study

_PHONOMETRY = "phonometry, open source, which cites the clause of ISO 7626-2:2015"
_SCOPE = "the abstract of ISO 7626-2:2015 in a standards catalogue"
_GENERAL = "general knowledge of the series; neither clause nor limit was seen"
_BLOCK, _RANDOM = 0.05, 0.05


def _mobilities(results: Study) -> pl.DataFrame:
    """The tests in use with R and I."""
    table = m.used(results)
    return table if table.is_empty() else table.filter(pl.col(q.R.head).is_finite(), pl.col(q.I.head).is_finite())


def _one_point(results: Study) -> Found:
    """Whether force and motion at the contact are measured."""
    if _mobilities(results).is_empty():
        return Found("no mobility is known", Answer.NOT_STATED)
    return m.judged("F1 and V1 at the contact", met=True)


def _rigid_block(results: Study) -> Found:
    """Departure of calibrations with a rigid block from the impedance of known masses."""
    table, dynamic = results.residuals, results.dynamic
    specimens = dynamic.filter(pl.col(q.TYRE.head) != "")[q.TEST.head].to_list() if dynamic.height else []
    blocks = table.filter(~pl.col(q.TEST.head).is_in(specimens)) if q.TEST.head in table.columns else table
    if blocks.is_empty():
        return Found("no test with a rigid block (kind = calibration)", Answer.NOT_STATED)
    worst, test = max(
        (
            hypot(row[q.RESIDUAL_RE.head], row[q.RESIDUAL_IM.head]) / hypot(*(row[one] for one in q.ZR.parts)),
            row["test"],
        )
        for row in blocks.rows(named=True)
    )
    text = f"F/V departs from that of the stated masses by up to {100 * worst:.2g} % (test {test})"
    return m.judged(text, worst <= _BLOCK)


def _random_error(results: Study) -> Found:
    """The largest relative standard uncertainty of the mobility, random and systematic together."""
    table = _mobilities(results)
    if table.is_empty():
        return Found("no mobility is known", Answer.NOT_STATED)
    relative = (pl.col(q.R.u_head) ** 2 + pl.col(q.I.u_head) ** 2) / (pl.col(q.R.head) ** 2 + pl.col(q.I.head) ** 2)
    rows = table.with_columns(relative.sqrt().alias("u")).filter(pl.col("u").is_finite())
    if rows.is_empty():
        return Found("the uncertainty of no mobility is known", Answer.NOT_STATED)
    worst = rows.sort("u", descending=True).row(0, named=True)
    text = f"u(Y)/|Y| up to {100 * worst['u']:.2g} %, calibration included (test {worst[q.TEST.head]})"
    return m.judged(text, worst["u"] < _RANDOM)


def _phase(results: Study) -> Found:
    """Whether the phase of the driving-point mobility stays within a quarter turn."""
    table = _mobilities(results)
    if table.is_empty():
        return Found("no mobility is known", Answer.NOT_STATED)
    rows = table.select(q.R.head, q.I.head, q.TEST.head).rows()
    worst, test = max(((degrees(atan2(im, re)), test) for re, im, test in rows), key=lambda one: abs(one[0]))
    return m.judged(f"largest phase {number(worst, 3)}° (test {test})", abs(worst) <= 90.0)


def _input_mass(results: Study) -> Found:
    """Whether the mass between force cell and contact is stated, so that its force is taken off."""
    known = m.input_masses(results)
    if not known:
        return Found("input_mass of the rig is not stated: taken as none", Answer.NOT_STATED)
    return m.judged(f"input_mass {number(max(known), 3)} kg, taken off", met=True)


def _values(results: Study) -> ValueTable:
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
    for row in m.rows_of(results):
        own = table.filter(pl.col(q.TEST.head).is_in(list(row.tests))) if not table.is_empty() else table
        if own.is_empty():
            continue
        re, im = (float(own[one.head].mean()) for one in (q.R, q.I))  # type: ignore[arg-type]
        size = hypot(re, im)
        phase, mass = degrees(atan2(im, re)), 1.0 / (m.omega(row) * size)
        rows.append((*m.place(row), number(1e3 * size, 4), number(phase, 4), number(mass, 4)))
    return ValueTable(heads, tuple(rows))


STANDARD = Standard(
    key="iso-7626-2",
    title="ISO 7626-2, Mechanical mobility by single-point translation excitation with an attached exciter",
    terms=(
        "Mobility is velocity over force. Here it is Y = V1/F1 = R + jI of specimen and rig together, at the contact.",
        "K* follows after the rig is taken off, which the standard does not treat.",
    ),
    requirements=(
        Requirement(
            "single point", "1", "Force and motion are of one point, in one direction of translation.", "", _SCOPE,
            _one_point,
        ),
        Requirement(
            "rigid block", "7.5.2", "The measuring chain finds the mass of a rigid block.", "within 5 %", _PHONOMETRY,
            _rigid_block,
        ),
        Requirement(
            "random error", "8.1.3, annex A", "The random error of the mobility is small.",
            "below 5 % (here of the whole uncertainty)", _PHONOMETRY, _random_error,
        ),
        Requirement(
            "coherence", "8.1.3", "The coherence of force and motion is examined.", "", _PHONOMETRY,
            m.not_stated("checks.csv has the residual of a sine, lines.csv the coherence of random tests and sweeps"),
        ),
        Requirement(
            "phase", "A.4", "The phase of a driving-point mobility stays within a quarter turn.", "within ±90°",
            _PHONOMETRY, _phase,
        ),
        Requirement(
            "mass loading", "", "The mass between force transducer and structure is taken off.", "", _GENERAL,
            _input_mass,
        ),
        Requirement(
            "exciter attachment", "", "The exciter does not restrain the structure in other directions.", "", _GENERAL,
            m.not_stated("no channel records it"),
        ),
        Requirement(
            "calibration", "", "Transducers are calibrated.", "", _GENERAL, m.calibrated,
        ),
    ),
    values=_values,
)  # fmt: skip
