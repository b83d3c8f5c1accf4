"""One shell for several pressures, held against an inflated ring that is simulated without shell theory."""

from functools import cache

import numpy as np
import pytest
from scipy import stats
from tests.models.ring import ring

from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, real_columns
from fourpole.models.over_pressure import fit_over_pressures
from fourpole.models.tyre_shell import Shell

OMEGA = 2 * np.pi * np.linspace(8.0, 45.0, 10)
PRESSURES = (1.0e5, 1.5e5, 2.0e5, 2.5e5)
#: k [N/m³], mu [kg/m²], tau [s].
TRUTH = np.array([8e6, 16.0, 6e-4])
TYRE = Shell(around=40, across=1, moving=(12, 1))  # a ring has one harmonic across
FIXED = ["R", "B", "S", "D", "p", "l", "beta"]
NOISE, NOISE_K1 = 1e-3, 3e-3


@cache
def simulated(pressure, springs):
    """K* over `OMEGA` and static stiffness [N/m] of the simulated ring."""
    return ring(OMEGA, pressure, 0.28, 0.11, 1e7, 10.0, springs, TRUTH[1], TRUTH[2], 0.06)


def sets(pressures):
    """Start values: the geometry as simulated, the fitted parameters far off."""
    return np.array([[0.28, 0.11, 1e7, 10.0, p, 5e6, 8.0, 1e-3, 0.06, 1.0] for p in pressures])


def data(seed, springs=lambda pressure: TRUTH[0], pressures=PRESSURES, gain=0.0, k1=True):
    """Measured conditions: own noise of K* and K1, and an error of the gain that all K* share."""
    rng = np.random.default_rng(seed)
    common, found = 1 + gain * rng.standard_normal(), []
    for pressure in pressures:
        clean, rest = simulated(pressure, springs(pressure))
        std = NOISE * np.abs(clean)
        seen = common * clean + std * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
        known = {"k1": rest * (1 + NOISE_K1 * rng.standard_normal()), "k1_std": NOISE_K1 * rest} if k1 else {}
        found.append(StiffnessData.of(OMEGA, seen, std, **known))
    return found


@pytest.mark.parametrize("pressure", PRESSURES)
def test_the_shell_has_the_stiffness_of_the_chain_within_their_discretisations(pressure):
    values = [0.28, 0.11, 1e7, 10.0, pressure, *TRUTH, 0.06, 1.0]
    clean, rest = simulated(pressure, TRUTH[0])
    assert np.abs(Shell().stiffness(values, OMEGA) / clean - 1).max() < 3e-4
    assert Shell().static_stiffness(values) == pytest.approx(rest, rel=3e-4)


def test_the_parameters_of_the_simulation_are_found_and_the_effect_of_the_pressure_agrees():
    conditions = data(1)
    found = fit_over_pressures(TYRE, conditions, PRESSURES, sets(PRESSURES), FIXED)
    one = found.fits[0]
    assert np.all(np.abs(one.values[5:8] - TRUTH) < 3.5 * one.std[5:8] + 3e-4 * TRUTH)  # 3e-4: two discretisations
    assert found.agrees
    assert not found.scatter.any()
    assert abs(found.trend) < 3.5 * found.trend_std
    assert found.chi2 < found.dof + 4 * np.sqrt(2 * found.dof)
    assert (found.dof, found.separate_dof) == (4 * 21 - 3, 4 * (21 - 3))
    assert np.all(found.left_out < 3 * NOISE * np.sqrt(2))
    assert [fit.values[4] for fit in found.fits] == list(PRESSURES)
    assert all(fit.std[4] == 0.0 for fit in found.fits)


@pytest.mark.statistical
def test_the_uncertainties_are_as_large_as_the_parameters_scatter():
    """Root mean square of z over draws within 3.5 of its own standard uncertainties, 1/sqrt(2 x draws)."""
    scores, pressures, draws = [], PRESSURES[::3], 16
    for seed in range(draws):
        found = fit_over_pressures(TYRE, data(seed, pressures=pressures), pressures, sets(pressures), FIXED)
        scores.append((found.fits[0].values[5:8] - TRUTH) / found.fits[0].std[5:8])
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all(np.abs(spread - 1) < 3.5 / np.sqrt(2 * draws))


def stiffening(pressure):
    """Springs that are 25 % stiffer per bar, as those of sidewalls under tension."""
    return TRUTH[0] * (1 + 0.25 * (pressure / 1e5 - 1.75))


def test_a_sidewall_that_stiffens_with_pressure_is_not_the_shells_effect():
    found = fit_over_pressures(TYRE, data(2, stiffening), PRESSURES, sets(PRESSURES), FIXED)
    assert not found.agrees
    assert found.separate_chi2 < found.separate_dof + 4 * np.sqrt(2 * found.separate_dof)
    assert found.trend > 20 * found.trend_std
    ends = [np.log(simulated(p, stiffening(p))[1] / simulated(p, TRUTH[0])[1]) for p in PRESSURES[::3]]
    assert found.trend == pytest.approx((ends[1] - ends[0]) / 1.5, rel=0.15)
    springs = np.log([stiffening(p) for p in PRESSURES])
    assert found.scatter[0] == pytest.approx(np.std(springs, ddof=1), rel=0.1)
    assert np.all(found.scatter[1:] < 0.02)
    assert np.all(found.left_out > 5 * found.own_error)
    # K* at each pressure is within what the scatter allows for.
    one = found.fits[0]
    assert np.all(np.abs(springs - np.log(one.values[5])) < 2 * one.std[5] / one.values[5])
    assert sum(float(fit.chi2) for fit in found.fits) < found.dof + 4 * np.sqrt(2 * found.dof)


def test_a_scatter_from_few_pressures_is_as_uncertain_as_students_t():
    found = fit_over_pressures(TYRE, data(2, stiffening), PRESSURES, sets(PRESSURES), FIXED)
    one, many = found.fits[0], len(PRESSURES)
    wanted = found.scatter[0] * np.sqrt(1 + 1 / many) * stats.t.ppf(0.975, many - 1) / stats.norm.ppf(0.975)
    assert one.std[5] / one.values[5] == pytest.approx(wanted, rel=0.02)


def test_a_gain_that_all_tests_share_is_no_effect_of_the_pressure():
    """Gain 3 %, K1 not measured. As the tension is known, the effect of the pressure itself tells the gain."""
    conditions = data(3, gain=0.03, k1=False)
    shared = [real_columns(0.03 * one.stiffness[:, None]) for one in conditions]
    found = fit_over_pressures(TYRE, conditions, PRESSURES, sets(PRESSURES), FIXED, shared)
    assert found.agrees
    one = found.fits[0]
    assert np.all(np.abs(one.values[5:8] - TRUTH) < 3.5 * one.std[5:8])
    assert not fit_over_pressures(TYRE, conditions, PRESSURES, sets(PRESSURES), FIXED).agrees


@pytest.mark.parametrize(
    ("pressures", "fixed", "said"),
    [
        ((1.5e5, 1.5e5), FIXED, "two pressures at least"),
        (PRESSURES[:2], FIXED[:4], "no known parameter of the pressure"),
        (PRESSURES[:2], Shell().symbols, "leave at least one free"),
    ],
)
def test_what_cannot_be_fitted_is_said(pressures, fixed, said):
    with pytest.raises(ModelError, match=said):
        fit_over_pressures(TYRE, data(4, pressures=pressures), pressures, sets(pressures), fixed)
