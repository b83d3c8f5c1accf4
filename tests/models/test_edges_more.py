"""Numbers that decide terms, priors, intervals and limits of models: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models import (
    choice,
    discrepancy,
    fractional,
    ladder,
    overtime,
    profile,
    shift_law,
    surface,
    surface_choice,
)
from fourpole.models.data import StiffnessData, _check_covariance
from fourpole.models.kraus import separation
from fourpole.models.linearised import Scatter
from fourpole.models.maxwell import GeneralisedMaxwell, Prony
from fourpole.models.ramp import Ramp
from fourpole.models.surface import Axes, term_sets


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except ModelError:
            return False
        return True

    return decided


def terms(slope):
    """Number of terms of a surface over four levels, by its slope beside a scatter of 1 %."""
    axes = Axes.of(["pressure [Pa]"], [[1.0], [2.0], [3.0], [4.0]])
    values = np.exp(slope * np.array([-1.5, -0.5, 0.5, 1.5]) + 0.01 * np.array([1.0, -1.0, -1.0, 1.0]))
    with patch.object(surface, "term_sets", lambda *given: [((0,),), ((0,), (1,))]):
        return len(surface.value_surface(axes, values, np.full(4, 0.01)).terms)


def levels(apart):
    """Number of levels of an axis, by the distance of two values as a share of the span."""
    return surface._levels(np.array([0.0, apart, 1.0]))


def priors(unit):
    """Standard deviations of a level and of a change of a parameter of this unit, by the prior of a map."""
    few = SimpleNamespace(model=SimpleNamespace(parameters=[SimpleNamespace(unit=unit)]), shared=0, count=9)
    made = SimpleNamespace(middle=np.ones(1), units=np.ones(1), conditions=few, bases=MagicMock())
    with patch.object(surface_choice, "Laws", lambda *given: given[-1]):
        return (surface_choice.SurfaceChoice._laws(made, [((0,), (1,))]) ** -0.5).round(9).tolist()


def start(far):
    """The start of the farthest of three conditions, by its distance from the median."""
    model = MagicMock(link=lambda values: values, parameters=[SimpleNamespace(straight=False)])
    return float(surface_choice.started(model, np.array([[0.0], [0.0], [far]]), np.zeros((3, 1)))[0][2, 0])


def recorded(second):
    """Whether recordings are needed, by the second order of the shared errors over the discrepancy."""
    data = MagicMock(recorded=np.array([len], dtype=object), shared_variance=np.array([0.01 * second]))
    with patch.object(discrepancy, "replace", lambda data, recorded: recorded is not None):
        return discrepancy.with_error(data, 0.01)


def stale(second=0.0, moved=0.0, *, with_recordings=False):
    """Whether shared errors are taken anew, by their second order in u, or by how far K* moved in its uncertainties."""
    data = SimpleNamespace(
        relative=1, reference=1, recorded=with_recordings or None, shared_variance=np.full((1, 1), 1e-4)
    )
    data._nominal, data.whitener = np.ones(1), lambda: None
    data.whitened = lambda whitener, now: np.full((1, 1), second)
    return bool(StiffnessData._stale(data, np.array([1 + moved + 0j])))


def names(decades):
    """Whether data over so many decades are taken as a master curve."""
    data = StiffnessData.of(np.array([1.0, 10.0**decades]), [1e5 + 1e4j] * 2, 1.0)
    with patch.object(choice, "_fitted", side_effect=ModelError("stop")) as fitted:
        taken(choice.choose)(data)
    return fitted.call_args.args[0] == choice._OF_MASTER_CURVES


def tried(decades):
    """Whether resonances are looked for in data over so many decades."""
    relaxing = MagicMock(chi2=1e3, dof=4, possible=False)
    data = StiffnessData.of(np.array([1.0, 10.0**decades]), [1e5 + 1e4j] * 2, 1.0)
    with patch.multiple(ladder, check_possible=lambda *given: relaxing, Ladder=MagicMock(side_effect=KeyError)):
        try:
            ladder.verdict_of(data)
        except KeyError:
            return True
        return False


def farthest(column, sign):
    """Frequency or damping ratio of a resonance from 10 to 100 rad/s, where the lowest or highest is the best."""

    def with_pairs(places):
        return SimpleNamespace(chi2=sign * np.log(places[-1, column]) + 20.0, places=places)

    made = SimpleNamespace(data=SimpleNamespace(omega=np.array([10.0, 100.0])), with_pairs=with_pairs)
    found = ladder.Ladder.with_another(made, SimpleNamespace(places=np.zeros((0, 2))))
    return round(float(found.places[-1, column]), 6)


def suspects(count):
    """Number of frequencies, of so many, of which each may be the wrong one in place of a resonance."""
    made = MagicMock(data=SimpleNamespace(omega=np.arange(1.0, count + 1)))
    made.with_pairs.return_value.chance = 0.0
    ladder.Ladder.with_one_wrong(made, SimpleNamespace(belt=(), places=np.ones((1, 2))))
    return made.with_pairs.call_count


def first_step(_):
    """First step in the logarithms of a belt whose place is nearly known."""
    tried = []
    made = SimpleNamespace(count=9)
    made._belted = lambda belt: (tried.append(tuple(belt)), (float(np.sum(np.square(belt))), 0, None))[1]
    ladder.Ladder._moved_belt(made, (1.0, 2.0), near=True)
    return round(tried[1][0] - 1.0, 9)


def separable(degree, count=10, apart=1.0):
    """Whether an amplitude is told from the frequency whose logarithm is of this degree in that of the frequency.

    There are so many frequencies of two tests; those of a pair are apart by this factor.
    """
    logs = np.log(np.outer(2.0 ** np.arange(count), [1.0, apart]).ravel())
    place = 2 * (logs - logs.min()) / np.ptp(logs) - 1
    found = separation(np.exp(logs), np.exp(np.polynomial.legendre.legval(place, np.eye(degree + 1)[degree])))
    return bool(np.isfinite(found.inflation))


def by_profile(numbers):
    """Whether intervals are by profile likelihood, by the number of frequencies of a fit of ten parameters."""
    fit = SimpleNamespace(model=SimpleNamespace(linear=False, parameters=[None] * 10), std=np.ones(10))
    data = [SimpleNamespace(count=numbers)]
    with patch.multiple(profile, normal_ends=lambda one: None, _profiled=lambda *given: iter(())):
        return not profile.intervals([fit], data, (), MagicMock(), shared=False, stopped=False)[1]


def uncertain(relative):
    """Whether fresh starts are added, by the relative uncertainty of a parameter."""
    fit = SimpleNamespace(std=np.array([[relative]]), on_bound=np.zeros((1, 1), bool))
    made = SimpleNamespace(
        model=SimpleNamespace(parameters=[SimpleNamespace(log=True)]), fits=[fit], best=np.ones((1, 1))
    )
    return bool(profile._Profiles._uncertain.func(made)[0])


def reaches(far):
    """Whether an interval of a constant has an end at this distance, in standard uncertainties."""
    return bool(np.isfinite(shift_law._interval(lambda value: abs(value) - far, 0.0, 1.0, 0.0)[1]))


def one_time(alpha):
    """Whether a model with an order nearly 1 has one relaxation time."""
    model = MagicMock(parameters=[SimpleNamespace(symbol=name) for name in ("tau", "alpha")])
    model.checked = np.array
    return fractional._one_time(model, [1.0, alpha], 0.5, 2.0) is not None


def grid(decades):
    """Relaxation times per decade, first and last decade of the grid of a test over so many decades."""
    times = overtime._grid(np.array([1.0, 10.0**decades]), None)
    return overtime.density(np.array([1.0, 10.0**decades])), *np.log10(times[[0, -1]]).round(3).tolist()


EDGES = {
    "degree of an axis, 3": (lambda n: max(term_sets([n], 40)[-1])[0], {4: 2, 5: 3, 9: 3}),
    "terms of a surface, 75 % of the conditions": (lambda n: len(term_sets([9], n)[-1]), {5: 3, 6: 4}),
    "values of one level, 2 % of the span": (levels, {0.0198: 2, 0.0202: 3}),
    "condition that was tested, 2 % of half the span": (
        lambda x: Axes.of(["pressure [Pa]"], [[1.0], [3.0]]).tested([3 + x]), {0.0198: 1, 0.0202: None},
    ),
    "bend between two levels, 1/24 of the change": (
        lambda x: round(float(next(surface.bends(np.array([[x]]), [0]))[0][0]), 6), {0.0: 0.041667},
    ),
    "surface that is better, 2 %": (terms, {0.0150: 1, 0.0154: 2}),
    "surface that is chosen, 3 in log density": (
        lambda x: surface_choice.place_of_simplest([0.0, x], [1, 2]), {2.97: 0, 3.03: 1},
    ),
    "prior of a map, 10, 0.5 and 2": (priors, {"N/m": [10.0, 0.5], "s": [10.0, 2.0]}),
    "start of a map, 3 from the median": (start, {2.97: 2.97, 3.03: 3.0}),
    "prior of a scatter, 1 % within a factor of 3": (
        lambda x: round(Scatter((x, x)).log_prior, 6), {0.01: 0.0, 0.03: -1.0, 0.9e-4: -17.571242},
    ),
    "recordings that are needed, 0.3 of the discrepancy": (recorded, {0.297: False, 0.303: True}),
    "second order of shared errors, 0.1 u": (stale, {0.099: False, 0.101: True}),
    "K* that shared errors explain, 5 u": (
        lambda x: stale(1.0, 0.01 * x, with_recordings=True), {4.95: True, 5.05: False},
    ),
    "frequency of a static test, 10 times its lowest": (
        lambda x: StiffnessData.lowest.fget(SimpleNamespace(omega=np.array([x]), static_omega=np.array([1.0]))),
        {9.9: 9.9, 10.1: 10.0},
    ),
    "largest covariance, 1e60": (
        taken(lambda x: _check_covariance(x * np.eye(2)[None], (1,))), {0.99e60: True, 1.01e60: False},
    ),
    "master curve, 6 decades": (names, {5.94: False, 6.06: True}),
    "resonances, up to 6 decades": (tried, {5.94: True, 6.06: False}),
    "lowest resonance, 0.7 of the band": (lambda column: farthest(column, 1.0), {0: 7.0}),
    "highest resonance, 1.4 of the band": (lambda column: farthest(column, -1.0), {0: 140.0}),
    "least damping ratio of a resonance, 0.1 %": (lambda column: farthest(column, 1.0), {1: 1e-3}),
    "largest damping ratio of a resonance, 2": (lambda column: farthest(column, -1.0), {1: 2.0}),
    "frequencies that may be wrong in place of a resonance, 12": (suspects, {11: 11, 13: 12}),
    "first step of a belt that is nearly known, 0.5 %": (first_step, {"belt": 0.005}),
    "arms of a Maxwell model, 1 to 60": (taken(GeneralisedMaxwell), {0: False, 1: True, 60: True, 61: False}),
    "relaxation times per decade, 1 to 12": (taken(Prony), {0: False, 1: True, 12: True, 13: False}),
    "relaxation times, 300": (
        taken(lambda n: Prony(3, np.geomspace(1e-3, 1.0, n))), {300: True, 301: False},
    ),
    "amplitude by 6 to 12 terms of the frequency": (separable, {5: False, 6: True}),
    "amplitude by half as many terms as frequencies": (lambda n: separable(n, 20), {9: False, 10: True}),
    "amplitude by 12 terms at most": (lambda n: separable(n, 30), {11: False, 12: True}),
    "frequencies that are one, 1 %": (lambda x: separable(6, 8, x), {1.0099: True, 1.0101: False}),
    "intervals by profile, 600 frequencies of ten parameters": (by_profile, {599: True, 601: False}),
    "fresh starts, an uncertainty of 50 %": (uncertain, {0.495: False, 0.505: True}),
    "interval of a shift law, 60 u": (reaches, {31.0: True, 33.0: False}),
    "place of a static tangent, 5 to 95 %": (
        taken(lambda x: Ramp(10.0, 1, x)), {0.0495: False, 0.0505: True, 0.9495: True, 0.9505: False},
    ),
    "order that is nearly 1, 0.9": (one_time, {0.891: False, 0.909: True}),
    "grid of a test in time, 12 or 4 per decade": (grid, {5.94: (12, -0.25, 6.44), 6.06: (4, -0.25, 6.56)}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
