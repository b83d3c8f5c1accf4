"""Each limit by which statement and tests are reconciled: just below it one decision, just above it the other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from fourpole.core.joint import reconcile
from fourpole.core.joint.misfit import Candidate
from fourpole.core.joint.reconcile import Misfit, _Diagnosis, _State
from fourpole.core.sources import Kind, Source

BELOW, ABOVE = 0.99, 1.01


MASS = Source(Kind.UNSTATED, "mass")


def candidate(explains=100.0, source=MASS):
    return Candidate("tyre mass", 1.0, 0.1, "kg", explains=explains, source=source, size=1.0, text=source.text)


def diagnosis(level=0.01, **changes):
    """A rig and a tyre that fit, unless told otherwise."""
    given = {
        "left": SimpleNamespace(rig=np.full(20, 2.0), rig_dof=np.full(20, 2.0)),
        "rig_chi2": 100.0,
        "rig_dof": 100.0,
        "tyre_chi2": 100.0,
        "tyre_dof": 100.0,
        "departures": np.zeros(3),
        "named": [],
        "size": np.ones(20),
        "effect": 0.01,
    } | changes
    found = _Diagnosis(**given)
    found.__dict__["level"] = level
    return found


def state(**changes):
    tests = SimpleNamespace(whiten=np.ones((20, 6, 6)))
    problem = SimpleNamespace(
        observed=tests,
        reweighted=lambda whiten: problem,
        widened=lambda columns: problem,
        columns=lambda name, z, stiffness: np.ones((20, 6, 2)),
    )
    solution = SimpleNamespace(z=np.zeros(3), stiffness=np.ones(20, dtype=complex))
    own = {name: changes.pop(name) for name in ("negligible", "finished") if name in changes}
    return _State(problem, solution, np.ones(20), misfit=Misfit(0.0, 0.0, **changes), **own)


@pytest.fixture
def mended(monkeypatch):
    """One remedy for a diagnosis; the solver is left out, what is set aside or added is noted."""
    noted = SimpleNamespace(aside=[], parts=[])

    def solved(self, problem, **misfit):
        self.misfit = replace(self.misfit, **misfit)

    monkeypatch.setattr(_State, "solve", solved)
    monkeypatch.setattr(reconcile, "_set_aside", lambda state, at, pull: noted.aside.append(at))
    monkeypatch.setattr(reconcile, "_add_part", lambda state, candidate: noted.parts.append(candidate.source.of))
    monkeypatch.setattr(reconcile, "_unsteady_drive", lambda *arguments: None)

    def mending(found, **changes):
        here = state(**changes)
        monkeypatch.setattr(reconcile, "_diagnosed", lambda *arguments: found)
        assert reconcile._remedied(here, found.left)
        return here, noted

    return mending


# Statements that the tests contradict.


@pytest.mark.parametrize(("pull", "contradicted"), [(2.99, False), (3.01, True)])
def test_a_statement_is_contradicted_beyond_three_standard_uncertainties(pull, contradicted):
    assert diagnosis(departures=np.array([0.0, pull, 1.0])).contradicted == contradicted


@pytest.mark.parametrize(("factor", "contradicted"), [(BELOW, False), (ABOVE, True)])
def test_where_the_misfit_is_large_a_statement_must_be_drawn_further(factor, contradicted):
    """Three standard uncertainties times the root of the chi-square per degree of freedom that is left without it."""
    pull = factor * 3.0 * np.sqrt(4.0)
    found = diagnosis(rig_chi2=4.0 * 199 + pull**2 - 400.0, tyre_chi2=400.0, departures=np.array([pull]))
    assert found.rest == pytest.approx(4.0)
    assert found.contradicted == contradicted


@pytest.mark.parametrize(("factor", "contradicted"), [(BELOW, True), (ABOVE, False)])
def test_a_part_that_explains_a_quarter_more_than_a_statement_spares_it(factor, contradicted):
    """The statement explains its squared pull; less than 0.8 of the best explanation is not as good."""
    found = diagnosis(departures=np.array([4.0]), named=[candidate(explains=factor * 16.0 / 0.8)])
    assert found.contradicted == contradicted


@pytest.mark.parametrize(("pull", "aside"), [(4.99, False), (5.01, True)])
def test_a_statement_is_set_aside_beyond_five_standard_uncertainties(mended, pull, aside):
    here, noted = mended(diagnosis(departures=np.array([0.0, pull, 0.0])))
    assert here.misfit.conflicts == (1,)
    assert here.doubtful == ([] if aside else [1])
    assert noted.aside == ([1] if aside else [])


@pytest.mark.parametrize(("share", "blamed"), [(0.89, (0,)), (0.91, (0, 1))])
def test_statements_drawn_nearly_as_far_are_contradictd_alike(mended, share, blamed):
    assert mended(diagnosis(departures=np.array([4.0, 4.0 * share, 1.0])))[0].misfit.conflicts == blamed


# Tests that do not go with the others.


def outliers(whole, label=None, rigid=None, before=None):
    count = len(whole)
    observed = SimpleNamespace(
        rigid=np.zeros(count, dtype=bool) if rigid is None else rigid, mass_at=np.full(count, -1)
    )
    conditions = SimpleNamespace(label=np.arange(count) if label is None else np.array(label))
    here = SimpleNamespace(
        problem=SimpleNamespace(observed=observed, conditions=conditions),
        outlier=np.ones(count) if before is None else before,
    )
    return np.flatnonzero(reconcile._outliers(here, SimpleNamespace(whole=np.array(whole, dtype=float)))).tolist()


@pytest.mark.parametrize(("usual", "limit"), [(0.5, 50.0), (1.4, 50.0), (2.8, 100.0)])
def test_an_outlier_is_fifty_times_the_usual_residual(usual, limit):
    """The usual one is the median, but no smaller than the 1.4 of chance."""
    rest = [usual] * 19
    assert outliers([*rest, BELOW * limit]) == []
    assert outliers([*rest, ABOVE * limit]) == [19]


def test_more_than_a_tenth_of_all_are_no_outliers():
    assert outliers([1.0] * 18 + [60.0] * 2) == [18, 19]
    assert outliers([1.0] * 17 + [60.0] * 3) == []


def test_most_of_a_kind_are_no_outliers():
    """More than 0.35 of the rigid blocks: 7 of 20 are that, 8 are not."""
    rigid = np.arange(100) >= 80
    assert outliers([1.0] * 93 + [60.0] * 7, rigid=rigid) == [*range(93, 100)]
    assert outliers([1.0] * 92 + [60.0] * 8, rigid=rigid) == []


def test_of_each_condition_the_worst_goes_first():
    assert outliers([1.0] * 38 + [60.0, 70.0], label=[*range(38), 38, 38]) == [39]


def test_two_tests_have_no_outlier_and_three_may_have_one():
    assert outliers([1.0, 100.0]) == []
    assert outliers([1.0, 1.0, 100.0]) == [2]


# What chance cannot explain: scatter of the tyre, a part of the rig, noise.

#: Chi-square of 100 degrees of freedom that chance exceeds once in a thousand times.
RARE = float(stats.chi2.isf(1e-3, 100))


@pytest.mark.parametrize(("chi2", "bad"), [(RARE - 0.1, False), (RARE + 0.1, True)])
def test_chance_exceeds_a_misfit_once_in_a_thousand_times(chi2, bad):
    assert diagnosis(rig_chi2=chi2).rig_bad == bad
    assert diagnosis(tyre_chi2=chi2).tyre_bad == bad
    assert diagnosis(tyre_chi2=chi2).scattered == bad


@pytest.mark.parametrize(("share", "scattered"), [(0.49, True), (0.51, False)])
def test_scatter_is_what_no_gain_or_part_explains_half_of(share, scattered):
    found = diagnosis(tyre_chi2=300.0, named=[candidate(explains=share * 200.0)])
    assert found.scattered == scattered


@pytest.mark.parametrize(("rig_chi2", "scattered"), [(299.0, True), (301.0, False)])
def test_scatter_is_more_of_the_tyre_than_of_the_rig(rig_chi2, scattered):
    assert diagnosis(tyre_chi2=300.0, rig_chi2=rig_chi2).scattered == scattered


@pytest.mark.parametrize(("factor", "missing"), [(BELOW, False), (ABOVE, True)])
def test_a_missing_part_explains_three_tenths_of_a_misfit(factor, missing):
    """Where so much else is left that no part is plain by itself."""
    found = diagnosis(rig_chi2=2100.0, tyre_chi2=10_000.0, named=[candidate(explains=factor * 0.3 * 2000.0)])
    assert found.explained < 25.0 * found.rest
    assert found.part_missing == missing


@pytest.mark.parametrize(("factor", "missing"), [(BELOW, False), (ABOVE, True)])
def test_a_part_of_five_standard_uncertainties_is_plain_though_all_fits(factor, missing):
    assert diagnosis(named=[candidate(explains=factor * 25.0)]).part_missing == missing


@pytest.mark.parametrize(("effect", "missing"), [(BELOW * 1e-4, False), (ABOVE * 1e-4, True)])
def test_a_part_smaller_than_a_ten_thousandth_of_zr_is_none(effect, missing):
    assert diagnosis(named=[candidate()], effect=effect).part_missing == missing


def test_only_the_rig_has_missing_parts():
    assert not diagnosis(named=[candidate(source=Source(Kind.GAIN, "F1"))]).part_missing


@pytest.mark.parametrize(("level", "rig_error"), [(BELOW * 1e-4, 0.0), (ABOVE * 1e-4, ABOVE * 1e-4)])
def test_a_misfit_that_a_part_leaves_is_an_error_of_the_rig_beyond_a_ten_thousandth(mended, level, rig_error):
    here, _ = mended(diagnosis(rig_chi2=300.0, level=level), parts=("mass",))
    assert here.misfit.rig_error == pytest.approx(rig_error)
    assert (here.misfit.inflation > 1) == (rig_error == 0)


@pytest.mark.parametrize(("level", "negligible"), [(BELOW * 1e-4, True), (ABOVE * 1e-4, False)])
def test_noise_that_is_less_than_a_ten_thousandth_of_zr_is_negligible(mended, level, negligible):
    assert mended(diagnosis(rig_chi2=300.0, level=level))[0].negligible == negligible


@pytest.mark.parametrize(("share", "named"), [(0.29, False), (0.31, True)])
def test_a_cause_is_named_that_explains_three_tenths_of_what_is_taken_for_noise(mended, share, named):
    found = diagnosis(rig_chi2=300.0, named=[candidate(explains=share * 200.0, source=Source(Kind.GAIN, "F1"))])
    assert bool(mended(found)[0].misfit.candidates) == named


@pytest.mark.parametrize(
    ("negligible", "inflation", "fits"), [(False, 1.99, True), (False, 2.01, False), (True, 9.0, True)]
)
def test_the_rig_is_doubted_where_noise_is_twice_what_the_recordings_say(negligible, inflation, fits):
    assert state(negligible=negligible, inflation=inflation).fits == fits


@pytest.mark.parametrize(
    "change", [{"conflicts": (0,)}, {"parts": ("mass",)}, {"rig_error": 1e-4}, {"finished": False}]
)
def test_a_rig_fits_only_as_stated(change):
    assert state().fits
    assert not state(**change).fits


@pytest.mark.parametrize(("residual", "factor"), [(2.0, 1.0), (0.0, 4 / 6), (50.0, 54 / 6)])
def test_the_noise_of_a_test_follows_that_of_all_with_four_degrees_of_freedom(residual, factor):
    left = SimpleNamespace(rig=np.array([residual]), rig_dof=np.array([2.0]))
    assert reconcile._each(left, 1.0)[0] == pytest.approx(factor)


# A drive whose speed wanders.


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
    problem = SimpleNamespace(
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
