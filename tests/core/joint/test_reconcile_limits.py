"""Each limit by which statement and tests are reconciled: just below it one decision, just above it the other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from fourpole.core.joint import reconcile, specimens
from fourpole.core.joint.misfit import Candidate
from fourpole.core.joint.reconcile import _Diagnosis
from fourpole.core.joint.scatter import MEDIAN
from fourpole.core.joint.specimens import Misfit, SpecimenState
from fourpole.core.sources import Kind, Source

BELOW, ABOVE = 0.99, 1.01


MASS = Source(Kind.UNSTATED, "mass")


def candidate(explains=100.0, source=MASS, released=False):
    return Candidate("a cause", 1.0, 0.1, "kg", explains, source, size=1.0, form="mass", released=released)


def diagnosis(level=0.01, **changes):
    """A rig and a tyre that fit, unless told otherwise."""
    given = {
        "left": SimpleNamespace(rig=np.full(20, 2.0), rig_dof=np.full(20, 2.0)),
        "rig_chi2": 100.0,
        "rig_dof": 100.0,
        "tyre_chi2": 100.0,
        "tyre_dof": 100.0,
        "named": [],
        "size": np.ones(20),
        "effect": 0.01,
    } | changes
    found = _Diagnosis(**given)
    found.__dict__["level"] = level
    return found


def state(**changes):
    tests = SimpleNamespace(whiten=np.ones((20, 6, 6)))
    problem = SimpleNamespace(observed=tests, reweighted=lambda whiten: problem)
    solution = SimpleNamespace(z=np.zeros(3), stiffness=np.ones(20, dtype=complex))
    own = {name: changes.pop(name) for name in ("negligible", "finished") if name in changes}
    return SpecimenState(problem, solution, solution.stiffness, np.ones(20), misfit=Misfit(0.0, 0.0, **changes), **own)


@pytest.fixture
def mended(monkeypatch):
    """One remedy for a diagnosis; the solver is left out, what is applied is noted."""
    noted = SimpleNamespace(causes=[])

    def solved(self, problem, **misfit):
        self.misfit = replace(self.misfit, **misfit)

    def applied(state, found):
        noted.causes += [one.source.text for one in found.causes]

    monkeypatch.setattr(SpecimenState, "solve", solved)
    monkeypatch.setattr(reconcile, "_apply", applied)
    monkeypatch.setattr(reconcile, "without_rig", lambda problem, z, stiffness, level: problem)
    monkeypatch.setattr(reconcile, "_unsteady_drive", lambda *arguments: None)

    def mending(found, **changes):
        here = state(**changes)
        monkeypatch.setattr(reconcile, "_diagnosed", lambda *arguments: found)
        assert reconcile._remedied(here, found.left)
        return here, noted

    return mending


# Causes: stated values without their statement, and what nobody stated.

GAIN = Source(Kind.GAIN, "F1")
CROSSED = Source(Kind.CROSSTALK, "V2 in F1")


@pytest.mark.parametrize(("factor", "cause"), [(BELOW, False), (ABOVE, True)])
def test_a_statement_is_a_cause_beyond_three_standard_uncertainties(factor, cause):
    found = diagnosis(named=[candidate(explains=factor * 9.0, source=GAIN, released=True)])
    assert bool(found.causes) == cause


@pytest.mark.parametrize(("factor", "cause"), [(BELOW, False), (ABOVE, True)])
@pytest.mark.parametrize("source", [MASS, CROSSED])
def test_what_nobody_stated_is_a_cause_beyond_five_standard_uncertainties(factor, cause, source):
    """There are many such errors, so that chance finds one beyond three of them."""
    assert bool(diagnosis(named=[candidate(explains=factor * 25.0, source=source)]).causes) == cause


@pytest.mark.parametrize(("factor", "cause"), [(BELOW, False), (ABOVE, True)])
def test_where_the_misfit_is_large_a_cause_must_explain_more(factor, cause):
    """Three standard uncertainties times the root of the chi-square per degree of freedom that is left without it."""
    explains = factor * 9.0 * 4.0
    one = candidate(explains=explains, source=GAIN, released=True)
    found = diagnosis(rig_chi2=4.0 * 199 + explains - 400.0, tyre_chi2=400.0, named=[one])
    assert found.rest == pytest.approx(4.0)
    assert bool(found.causes) == cause


@pytest.mark.parametrize(("factor", "cause"), [(BELOW, False), (ABOVE, True)])
def test_what_nobody_stated_is_a_cause_of_a_misfit_from_three_tenths_of_it_on(factor, cause):
    """Where so much else is left that it is not plain by itself."""
    found = diagnosis(rig_chi2=2100.0, tyre_chi2=10_000.0, named=[candidate(explains=factor * 0.3 * 2000.0)])
    assert found.named[0].explains < 25.0 * found.rest
    assert bool(found.causes) == cause


@pytest.mark.parametrize(("effect", "cause"), [(BELOW * 1e-4, False), (ABOVE * 1e-4, True)])
def test_a_part_smaller_than_a_ten_thousandth_of_zr_is_none(effect, cause):
    assert bool(diagnosis(named=[candidate()], effect=effect).causes) == cause


@pytest.mark.parametrize(("behind", "tied"), [(3.99, True), (4.01, False)])
def test_causes_that_explain_the_misfit_within_two_standard_uncertainties_are_tied(behind, tied):
    """In units of the chi-square per degree of freedom that the best one leaves."""
    named = [candidate(explains=100.0), candidate(explains=100.0 - behind, source=GAIN)]
    found = diagnosis(named=named, rig_chi2=199.0, tyre_chi2=100.0)
    assert found.rest == pytest.approx(1.0)
    assert [one.source for one in found.causes] == ([MASS, GAIN] if tied else [MASS])


def test_all_tied_causes_are_applied(mended):
    named = [candidate(explains=100.0), candidate(explains=99.0, source=GAIN), candidate(explains=50.0, source=CROSSED)]
    assert mended(diagnosis(named=named))[1].causes == ["unstated mass", "gain F1"]


# Tests that do not go with the others.


def outliers(whole, label=None, rigid=None, before=None):
    """The tests that are flagged; None where too many would be."""
    count = len(whole)
    observed = SimpleNamespace(
        rigid=np.zeros(count, dtype=bool) if rigid is None else rigid, mass_at=np.full(count, -1)
    )
    label = np.arange(count) if label is None else np.array(label)
    conditions = SimpleNamespace(label=label, sizes=np.bincount(label))
    here = SimpleNamespace(
        problem=SimpleNamespace(observed=observed, conditions=conditions),
        outlier=np.ones(count) if before is None else before,
    )
    found, many = specimens._outliers(here, SimpleNamespace(whole=np.array(whole, dtype=float)))
    assert not (many and found.any())
    return None if many else np.flatnonzero(found).tolist()


@pytest.mark.parametrize(("usual", "limit"), [(0.5, 50.0), (MEDIAN, 50.0), (2 * MEDIAN, 100.0)])
def test_an_outlier_is_fifty_times_the_usual_residual(usual, limit):
    """The usual one is the median, but no smaller than that of chance."""
    rest = [usual] * 19
    assert outliers([*rest, BELOW * limit]) == []
    assert outliers([*rest, ABOVE * limit]) == [19]


def test_more_than_a_tenth_of_all_are_no_outliers():
    assert outliers([1.0] * 18 + [60.0] * 2) == [18, 19]
    assert outliers([1.0] * 17 + [60.0] * 3) is None


def test_most_of_a_kind_are_no_outliers():
    """More than 0.35 of the rigid blocks: 7 of 20 are that, 8 are not."""
    rigid = np.arange(100) >= 80
    assert outliers([1.0] * 93 + [60.0] * 7, rigid=rigid) == [*range(93, 100)]
    assert outliers([1.0] * 92 + [60.0] * 8, rigid=rigid) is None


def test_of_three_tests_of_a_condition_the_worst_goes_first():
    assert outliers([1.0] * 37 + [60.0, 60.0, 70.0], label=[*range(37), 37, 37, 37]) == [39]


@pytest.mark.parametrize(("share", "both"), [(0.99 * 0.5, False), (1.01 * 0.5, True)])
def test_of_two_tests_that_disagree_both_are_flagged_unless_the_data_say_which(share, both):
    """They disagree with each other alone: one residual is that of the other, but for the weights."""
    whole = [1.0] * 38 + [share * 200.0, 200.0]
    assert outliers(whole, label=[*range(38), 38, 38]) == ([38, 39] if both else [39])


def test_two_tests_have_no_outlier_and_three_may_have_one():
    assert outliers([1.0, 100.0]) == []
    assert outliers([1.0, 1.0, 100.0]) == [2]


# What chance cannot explain: an error of the rig, noise.

#: Chi-square of 100 degrees of freedom that chance exceeds once in a thousand times.
RARE = float(stats.chi2.isf(1e-3, 100))


@pytest.mark.parametrize(("chi2", "bad"), [(RARE - 0.1, False), (RARE + 0.1, True)])
def test_chance_exceeds_a_misfit_once_in_a_thousand_times(chi2, bad):
    assert diagnosis(rig_chi2=chi2).rig_bad == bad


@pytest.mark.parametrize(("level", "rig_error"), [(BELOW * 1e-4, 0.0), (ABOVE * 1e-4, ABOVE * 1e-4)])
def test_a_misfit_that_a_cause_leaves_is_an_error_of_the_rig_beyond_a_ten_thousandth(mended, level, rig_error):
    here, _ = mended(diagnosis(rig_chi2=300.0, level=level), added=(MASS,))
    assert here.misfit.rig_error == pytest.approx(rig_error)
    assert (here.misfit.inflation > 1) == (rig_error == 0)


@pytest.mark.parametrize(("level", "negligible"), [(BELOW * 1e-4, True), (ABOVE * 1e-4, False)])
def test_noise_that_is_less_than_a_ten_thousandth_of_zr_is_negligible(mended, level, negligible):
    assert mended(diagnosis(rig_chi2=300.0, level=level))[0].negligible == negligible


@pytest.mark.parametrize(("ratio", "rig_error"), [(3.99, False), (4.01, True)])
def test_noise_of_more_than_twice_what_the_recordings_say_is_an_error_of_the_rig(mended, ratio, rig_error):
    here, _ = mended(diagnosis(rig_chi2=100.0 * ratio))
    assert (here.misfit.rig_error > 0) == rig_error
    assert (here.misfit.inflation > 1) != rig_error


@pytest.mark.parametrize(
    ("negligible", "inflation", "fits"), [(False, 1.99, True), (False, 2.01, False), (True, 9.0, True)]
)
def test_the_rig_is_doubted_where_noise_is_twice_what_the_recordings_say(negligible, inflation, fits):
    assert state(negligible=negligible, inflation=inflation).fits == fits


@pytest.mark.parametrize("change", [{"conflicts": (0,)}, {"added": (MASS,)}, {"rig_error": 1e-4}, {"finished": False}])
def test_a_rig_fits_only_as_stated(change):
    assert state().fits
    assert not state(**change).fits


@pytest.mark.parametrize(("residual", "factor"), [(2.0, 1.0), (0.0, 4 / 6), (50.0, 54 / 6)])
def test_the_noise_of_a_test_follows_that_of_all_with_four_degrees_of_freedom(residual, factor):
    left = SimpleNamespace(rig=np.array([residual]), rig_dof=np.array([2.0]))
    assert reconcile._each(left, 1.0)[0] == pytest.approx(factor)


# A drive whose speed wanders.


@dataclass
class Columns:
    """What is asked of a problem."""

    columns: Callable
    by_log_frequency: Callable
    scatter: float = 0.0

    @property
    def without_spread(self):
        return self


def drive(excess_factor=0.5, level=1e-7):
    """What is found of a drive, with errors of each frequency in the residuals and nothing else.

    `excess_factor` times what they explain is the rig's excess; `level` is the size that the errors have.
    """
    rng = np.random.default_rng(1)
    count = 50
    by_k, by_frequency = rng.standard_normal((count, 6, 2)), rng.standard_normal((count, 6)) / level
    errors = 30.0 * level * rng.standard_normal(count)
    residual = by_frequency * errors[:, None]
    free = by_frequency - np.einsum("nij,njk,nk->ni", by_k, np.linalg.pinv(by_k), by_frequency)
    explained = np.sum((free * errors[:, None]) ** 2) - count
    given = {"by_stiffness": by_k, "residual": residual}
    problem = Columns(
        columns=lambda name, z, stiffness: given[name], by_log_frequency=lambda z, stiffness: by_frequency
    )
    here = SimpleNamespace(problem=problem, solution=SimpleNamespace(z=None, stiffness=None))
    left = SimpleNamespace(rig_dof=np.full(count, 2.0))
    found = diagnosis(rig_chi2=100.0 + excess_factor * explained)
    return reconcile._unsteady_drive(here, left, found)


@pytest.mark.parametrize(("share", "unsteady"), [(0.69, False), (0.71, True)])
def test_an_unsteady_drive_explains_seven_tenths_of_a_misfit(share, unsteady):
    assert (drive(excess_factor=1 / share) is not None) == unsteady


def test_a_drive_whose_frequency_is_off_by_more_than_a_ten_thousandth_is_not_just_unsteady():
    found = drive(level=1e-7)
    assert found is not None
    scale = 1e-7 * 1e-4 / found[0]
    assert drive(level=BELOW * scale) is not None
    assert drive(level=ABOVE * scale) is None
