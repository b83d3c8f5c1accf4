"""Numbers that decide a remark on a model, a level or a range: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole import quantities as q
from fourpole.core.condition import Sameness
from fourpole.core.sources import Kind, Source
from fourpole.errors import ModelError
from fourpole.fitting import byamplitude, mapping, measured, modelling, query, ranges, ridetyres, shifting, static
from fourpole.fitting.amplitude import levels_of, mixed
from fourpole.fitting.byamplitude import outside_levels
from fourpole.fitting.modelparts import check_covariance
from fourpole.fitting.rows import seconds_of_fits, usable
from fourpole.fitting.static import StaticFile, slowest
from fourpole.fitting.temperature import NO_SHIFT, TemperatureFile
from fourpole.models.data import StiffnessData
from fourpole.models.discrepancy import _with_enough
from fourpole.models.shift_law import ShiftLaw


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except ModelError:
            return False
        return True

    return decided


def remarks(discrepancy):
    """Number of remarks of a query on a model that is off by this."""
    with patch.object(query, "accuracy_of", lambda *given: SimpleNamespace(discrepancy=discrepancy, misfit="off")):
        return len(query._misfit(MagicMock(), "a", None))


def levels(ratio):
    """Number of tested amplitudes of a model, of which two inner ones have this ratio."""
    amplitude = np.array([1e-3, 2e-3, 2e-3 * ratio, 8e-3])
    one = SimpleNamespace(own=SimpleNamespace(amplitude=amplitude))
    return len(byamplitude.tested([one], SimpleNamespace(by_amplitude=True)))


def within(frequency):
    """Whether a frequency is within 8 to 10 Hz."""
    one = SimpleNamespace(frequency=np.array([frequency]), keys=[None], own=MagicMock(), shared=np.zeros(0))
    one.recorded = None
    with patch.object(measured, "replace", lambda one, **changed: one):
        return measured._within(one, (8.0, 10.0)) is one


def cut(_):
    """The end of a range without an end, over the modulus of K*."""
    data = StiffnessData.of(np.array([60.0, 100.0]), [3e5 + 4e5j, 3e5 + 4e5j], 1e3)
    with patch.object(ranges, "passive_range", lambda data, omega: np.full((omega.size, 2, 2), np.inf)):
        return ranges.ranges_of(data, low=1.0)[0].storage[1] / 5e5


def shifted(temperature):
    """A query at a temperature of a model of isotherms from 20 to 40 degC."""
    law = SimpleNamespace(
        range=(20.0, 40.0), shifts=None, constants=[], law="Arrhenius", reference=20.0, at=lambda there: NO_SHIFT
    )
    file = SimpleNamespace(model_entry=lambda tyre: SimpleNamespace(temperature=law))
    return query._shift_of(file, "a", SimpleNamespace(state={q.TEMPERATURE.head: temperature}, beyond=False))


def beyond(temperature):
    """Number of remarks on a shift beyond isotherms from 20 to 40 degC."""
    law = SimpleNamespace(
        shift_law=ShiftLaw("Arrhenius", 20.0, np.array([5e4]), np.eye(1)), vertical=None, range=(20.0, 40.0),
        shifts=SimpleNamespace(at=lambda there: NO_SHIFT), _beyond=lambda law: "beyond",
    )  # fmt: skip
    return len(TemperatureFile.at(law, temperature).remarks)


def ramp(time=10.0, k1=1e5):
    """The ramp of two static tests, of which one takes another time per branch, and of K1 in the table."""
    rows = [{q.K1.head: 1e5, q.CYCLE.head: 3, q.TEST.head: "S", "time": each} for each in (10.0, time)]
    one = SimpleNamespace(tyre="a", label="", own=SimpleNamespace(k1=k1))
    parts = {"_is_of": lambda row, one: True, "_branch_time": lambda where, row: row["time"]}
    with patch.multiple(static, **parts), patch.object(static._StaticTests, "_place", lambda self, row: 0.5):
        return static._StaticTests(rows, {}).ramp(one)


def one_isotherm(apart):
    """Whether two temperatures are of one isotherm."""
    with patch.object(shifting, "read_measured", return_value=MagicMock(source="")) as read:
        shifting.read_isotherms(["table.csv"])
    axis = next(axis for axis in read.call_args.kwargs["axes"] if axis.name == "temperature")
    return axis.same(20.0, 20.0 + apart)


def slow(frequency):
    """Whether nothing was measured so slowly, beside a static test of 10 s per branch."""
    return "nothing was measured" in StaticFile.remark(SimpleNamespace(branch_time=10.0), frequency)


def own(share):
    """Variance of a level of two that share K*, by the variance of its tests over that of K*."""
    made = SimpleNamespace(tyres=[0, 0], condition=np.zeros(2, int), source=measured._Source.COVARIANCE)
    made.numbers = dict.fromkeys((measured.COLUMN, *measured.STD), np.zeros(2))
    made.shared, made.covariance = np.zeros((2, 2, 0)), np.array([np.eye(2)] * 2)
    parts = {"levels_of": lambda sizes: np.arange(sizes.size), "covariances": lambda numbers: share * made.covariance}
    with patch.multiple(measured, replace=lambda one, **changed: changed["covariance"], **parts):
        return round(float(measured._Rows.by_level(made, np.zeros(2, int))[0, 0, 0]), 9)


def row(frequency=10.0, stiffness=2e5):
    """Whether a row is used, by its frequency and K*."""
    heads = "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]"
    numbers = dict(zip(heads, np.array([[frequency], [stiffness], [0.0]]), strict=True))
    return bool(usable(numbers, "a", stated=False, by_amplitude=False)[0][0])


def tyres(count):
    """Take a model file of so many tyres and conditions for a ride."""
    parts = dict.fromkeys(("resolved", "read_model_file", "model_in", "_tyre", "_with_common_errors"), MagicMock())
    with patch.multiple(ridetyres, placed_models=lambda *given, **how: [None] * count, **parts):
        ridetyres.tyres_for_ride("a")


def ends(_):
    """Lowest and highest frequency of the ranges beside a band of 10 to 20 Hz."""
    one = MagicMock(frequency=np.array([10.0, 20.0]), keys=[], tests=[])
    parts = {"ranges_of": lambda data, low, high: (low, high), "slowest": lambda loop: np.inf}
    parts |= {"ConditionFile": lambda **fields: fields["ranges"]}
    parts |= dict.fromkeys(("NamedValue", "StaticFile", "tested", "rest_of"), MagicMock())
    with patch.multiple(modelling, **parts):
        return modelling._condition_entry(one, MagicMock(), MagicMock(), np.zeros((0, 2)), None, ranged=True)


def errors(found):
    """Errors of a gain that are tried, with their uncertainties, and the one that is then taken of all conditions."""
    likelihood = MagicMock()
    likelihood.problem.errors, tried = [Source(Kind.GAIN, "V1")], []
    parts = {"_without_error": lambda likelihood, source, value, std: tried.append((round(value, 9), round(std, 9)))}
    with patch.multiple(mapping, _error_of=lambda one, near: found, **parts):
        mapping._common_error([None], likelihood, Source(Kind.GAIN, "V1"))
    return tried


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "model discrepancy that is named, 1 %": (remarks, {0.0099: 0, 0.0101: 1}),
    "amplitudes of one level, 5 %": (lambda x: int(levels_of(np.array([1.0, x])).max()), {1.049: 0, 1.051: 1}),
    "amplitudes mixed, a factor of 2": (
        lambda x: len(mixed(np.zeros(2, int), np.full(2, 10.0), np.array([1e-3, x * 1e-3]), Sameness())),
        {1.98: 0, 2.02: 1},
    ),
    "amplitude inside the tested ones, 2 %": (
        lambda x: len(outside_levels([1e-3, 2e-3], x * 1e-3, beyond=True)), {0.981: 0, 0.979: 1, 2.039: 0, 2.041: 1},
    ),
    "tested levels of a model, 20 %": (levels, {1.19: 3, 1.21: 4}),
    "degrees of freedom that show an uncertainty, 3": (
        taken(lambda dof: _with_enough(MagicMock(candidates=[SimpleNamespace(dof=dof)]))), {2: False, 3: True},
    ),
    "frequency within a band, 1 %": (within, {10.09: True, 10.11: False, 7.93: True, 7.91: False}),
    "range without an end, ten times K*": (cut, {"cut": 10.0}),
    "temperature inside the isotherms, 1 K": (taken(shifted), {40.99: True, 41.01: False, 19.01: True, 18.99: False}),
    "temperature that is shifted by the law, 0.1 K": (beyond, {40.099: 0, 40.101: 1, 19.901: 0, 19.899: 1}),
    "temperatures of one isotherm, 1 K": (one_isotherm, {0.99: True, 1.01: False}),
    "static tests of one duration, 10 %": (taken(ramp), {10.99: True, 11.01: False}),
    "static tests of one K1, 1e-6": (
        taken(lambda x: ramp(k1=1e5 * (1 + x))), {0.99e-6: True, 1.01e-6: False},
    ),
    "slower than a static test, 0.1 over the time of a branch": (slow, {0.0099: True, 0.0101: False}),
    "slowest that a static test says, 0.1 over the time of a branch": (
        lambda time: round(slowest(SimpleNamespace(ramp=SimpleNamespace(time=time))), 9), {10.0: 0.01},
    ),
    "levels that share K*, 90 % of its variance": (own, {0.891: 0.891, 0.909: 1.818}),
    "variance of a level, 1e-4 of that of K*": (own, {1.98e-4: 2e-4, 2.02e-4: 2.02e-4}),
    "largest K*, 1e25": (lambda x: row(stiffness=x), {0.99e25: True, 1.01e25: False}),
    "frequencies, 1e-100 to 1e100": (
        row, {0.99e-100: False, 1.01e-100: True, 0.99e100: True, 1.01e100: False},
    ),
    "tyres of a ride, 40": (taken(tyres), {40: True, 41: False}),
    "covariance of a model file, 1e240": (
        taken(lambda x: check_covariance("a", [[x]], 1)), {0.98e240: True, 1.02e240: False},
    ),
    "covariance of a model file, symmetric to 1e-6": (
        taken(lambda x: check_covariance("a", [[1.0, 0.0], [x, 1.0]], 2)), {0.98e-6: True, 1.02e-6: False},
    ),
    "frequencies of a range, 4 per decade and 50": (
        lambda decades: len(ranges._steps(1.0, 10.0**decades)), {2.0: 10, 11.9: 49, 13.0: 50},
    ),
    "ranges beside the band, ten times": (ends, {"10 to 20 Hz": (1.0, 200.0)}),
    "time of a fit, 0.5 s and 20 ms for each row": (seconds_of_fits, {0: 0.5, 100: 2.5}),
    "errors of a gain, up to 24 % by 6 %, and one value to 5 %": (
        errors, {None: [(0.0, 0.05)] + [(sign * size, 0.05) for size in (0.06, 0.12, 0.18, 0.24) for sign in (1, -1)],
                 0.2: [(0.0, 0.05), (0.2, 0.01)]},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
