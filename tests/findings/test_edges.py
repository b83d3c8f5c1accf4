"""Numbers that decide what a finding claims: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from math import inf
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest

from fourpole import quantities as q
from fourpole.core.condition import AXES, Condition
from fourpole.findings import points, trends
from fourpole.findings.compared import NOT_SEEN, _pairs, _row
from fourpole.findings.conformity import is_pulled, is_told, most_outside, other_preloads, other_tangents, too_short
from fourpole.findings.facts import Curve, Estimate, Holds, known, pairs
from fourpole.findings.list import by_size
from fourpole.findings.points import Readings, _step, differences
from fourpole.findings.resonances import Crossing, peak
from fourpole.findings.summary import SummaryRow, departing, wanted_frequency
from fourpole.findings.trends import Comparison, Effect, along, linearity


def shown(effect, std):
    """Number of findings that are shown of a comparison with this effect."""
    detail = Comparison("a", "b", {})
    return len(by_size([SimpleNamespace(topic="K2", detail=detail, effect=effect, std=std)]))


def bent(departure):
    """What a load-deflection curve is called, by its departure from a straight line."""
    values = {"a": {(1.7e5,): Estimate(departure, 0.0)}}
    return linearity(SimpleNamespace(by_tyre=lambda quantity: values))[0].holds


def dof(stated):
    """Degrees of freedom of a trend without scatter, by those that the tests have."""
    return along(np.arange(3.0), np.ones(3), np.ones(3), 0.0, stated).dof


def readings(factor=1.0, frequency=10.0):
    """A point with a K* that is larger by a factor."""
    numbers = {"frequency": frequency, "stiffness": factor * (2e5 + 4e4j), "k1": 1e5, "k2": 1e5, "c": 700.0}
    matrices = {"covariance": np.eye(2), "std": np.ones(3), "shared": np.zeros((2, 0)), "k1_gain": 1.0, "group": 0}
    each = {name: np.array([value]) for name, value in (numbers | matrices).items()}
    return Readings(keys=((("D1", 1),),), effects={}, **each)


def unlike(factor):
    """Whether no error is taken as common to two campaigns, by the ratio of their K*."""
    here = np.array([0])
    return bool(differences(readings(), readings(factor), (here, here), lambda source: 1.0).unlike[0])


def paired(frequency=10.0, temperature=20.0):
    """Number of points that two campaigns have in common, by frequency [Hz] and temperature [degC] of the second."""
    states = [[Condition("a", (1.7e5, 1e3, value))] for value in (20.0, temperature)]
    assert [axis.name for axis in AXES] == ["pressure", "preload", "temperature"]
    return len(_pairs([readings(), readings(frequency=frequency)], states)[0])


def seen(difference):
    """Whether a difference is seen, in its standard uncertainties."""
    (row,) = _row({}, q.K1, (100.0, 1.0, 100.0 + difference, 1.0), 1.0, ("D1", "D2"))
    return row["verdict"] != NOT_SEEN


def pulled(load):
    """Whether a wheel is pulled down at a static load [N], by one newton of standard deviation."""
    rides = SimpleNamespace(series=(), names=("comfort", "wheel load"), values=np.array([[9.0, 1.0]]))
    return is_pulled(rides, np.array([load]))


def top(lowest):
    """Whether a parabola locates the resonance, by the lowest of the three highest TR over the largest."""
    return peak(Curve((10.0, 12.0, 14.0), (lowest, 1.0, 0.9), (0.0, 0.0, 0.0))).top is not None


def outside(share):
    rides = SimpleNamespace(spectra=[(SimpleNamespace(share_outside=lambda low, high: share), None)])
    return most_outside(rides, [(8.0, 24.0)]) is not None


def tangents(at_rest):
    """Number of loads at which the tangent of a curve, 100 N/m, is not the stiffness of a model at rest."""
    return len(list(other_tangents(SimpleNamespace(tangent_at=lambda load: 100.0), at_rest, np.ones(1))))


def short(duration):
    rides = SimpleNamespace(series=[SimpleNamespace(step=duration / 10, weighted=np.zeros(10))])
    return too_short(rides) is not None


def stepped(far):
    """Whether a point at this distance in ln f gives the slope of a condition, of two others."""
    at = readings()
    others = SimpleNamespace(
        frequency=10.0 * np.exp(np.array([0.0, far])), group=np.zeros(2, int), values=np.ones((2, 8))
    )
    with patch.object(points, "_step", lambda x, values, end: (float(x.size), 0.0)):
        return points._steps(at, others, np.array([0]))[0][0, 1] == 2


def highest(count):
    """Whether a curve of so many points has a maximum."""
    x = np.arange(float(count))
    values = 1.0 + np.where(x == 1, 1.0, 0.0)
    made = SimpleNamespace(lines={0: (x, values, np.full(count, 1e-6))}, scatter=lambda free: (0.0, inf))
    return trends.Lines.extremum(made) is not None


def repeated(scatter, single=0.0):
    """Whether repeats scatter, by their standard deviation and the uncertainty of one."""
    return SummaryRow.scatters.fget(SimpleNamespace(scatter=scatter, single=single))


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "effect that is small, 1 %": (lambda x: shown(x, 1.0), {0.0099: 0, 0.0101: 1}),
    "small effect that is sure, 3 u": (lambda x: shown(0.005, 0.005 / x), {2.97: 0, 3.03: 1}),
    "curve, nearly linear to 1 % and markedly bent from 3 %": (
        bent,
        {0.0099: Holds.NEARLY_LINEAR, 0.0101: Holds.NON_LINEAR, 0.0297: Holds.NON_LINEAR,
         0.0303: Holds.MARKEDLY_NON_LINEAR},
    ),
    "effect that is claimed, 2 u": (lambda x: Effect(x, 1.0).claimed(), {1.98: False, 2.02: True, -2.02: True}),
    "effect that is searched in two, 1 % by chance": (
        lambda x: Effect(x, 1.0).claimed(2), {2.79: False, 2.82: True},
    ),
    "effect of round-off, 1e-9": (lambda x: Effect(x, 0.0).claimed(), {0.99e-9: False, 1.01e-9: True}),
    "degrees of freedom of Student's factor, 3": (dof, {2.97: inf, 3.03: 3.03}),
    "specimens that are compared in pairs, 3": (
        lambda count: len(pairs(dict.fromkeys(range(count), 1.0))), {3: 3, 4: 1},
    ),
    "uncertainty that is not stated, 2 %": (lambda x: known({q.K1.head: x}, q.K1), {100.0: (100.0, 2.0)}),
    "error common to two campaigns, K* within 20 %": (unlike, {1.19: False, 1.21: True, 0.83: True, 0.84: False}),
    "slope over the frequency, from 2 % on": (
        lambda x: bool(np.isfinite(_step(np.array([0.0, x]), np.ones(2), 0.01)[0])), {0.0198: False, 0.0202: True},
    ),
    "frequency in common, 1 %": (lambda f: paired(frequency=f), {10.09: 1, 10.11: 0, 9.91: 1, 9.89: 0}),
    "temperature in common, 5 K": (lambda t: paired(temperature=t), {24.9: 1, 25.1: 0, 15.1: 1, 14.9: 0}),
    "difference that is seen, 2 u": (seen, {1.98: False, 2.02: True, -2.02: True}),
    "ride that differs, 2 u": (lambda x: is_told(x, 1.0), {1.98: False, 2.02: True}),
    "ride outside the tested frequencies, 5 %": (outside, {0.0495: False, 0.0505: True}),
    "preload other than the load of a wheel, 10 %": (
        lambda x: other_preloads([x], np.array([1000.0])), {1099.0: [], 1101.0: [1101.0], 899.0: [899.0], 901.0: []},
    ),
    "tangent other than a model at rest, 10 %": (tangents, {109.0: 0, 111.0: 1, 91.0: 0, 89.0: 1}),
    "wheel that is pulled down, three deviations": (pulled, {3.03: False, 2.97: True}),
    "ride that is short, 2.5 s": (short, {2.48: True, 2.52: False}),
    "crossing that is resolved, 15 %": (
        lambda x: Crossing(10.0, 10.0, 10.0 * x, 1).resolved, {1.149: True, 1.151: False},
    ),
    "resonance by a parabola, half power": (top, {0.700: False, 0.714: True}),
    "resonance, three frequencies": (
        lambda count: peak(Curve((10.0, 12.0, 14.0)[:count], (1.0, 2.0, 1.0)[:count], ())) is not None,
        {2: False, 3: True},
    ),
    "point that gives a slope, 0.7 in ln f": (stepped, {0.693: True, 0.707: False, -0.707: False}),
    "model that is not to be trusted, 1 %": (
        lambda x: len(departing(SimpleNamespace(models=SimpleNamespace(models=[SimpleNamespace(discrepancy=x)])))),
        {0.0099: 0, 0.0101: 1},
    ),
    "repeats that scatter, 1 %": (repeated, {0.0099: False, 0.0101: True}),
    "repeats that scatter, twice their uncertainty": (lambda x: repeated(0.1 * x, 0.1), {1.98: False, 2.02: True}),
    "frequency of a summary, 15 Hz": (
        lambda record: wanted_frequency(SimpleNamespace(record=dict(record))), {(): 15.0},
    ),
    "points of a maximum, 4": (highest, {3: False, 4: True}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
