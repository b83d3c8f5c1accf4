"""Prony series with fixed times: one optimum, intervals that hold, and any band."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from fourpole.errors import ModelError
from fourpole.models.choice import choose, fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.families import automatic, model_named
from fourpole.models.fit import fit
from fourpole.models.maxwell import Prony
from fourpole.models.nonnegative import least_squares
from fourpole.models.profile import profile_intervals

WIDE = 2 * np.pi * np.geomspace(1e-2, 1e4, 60)
RUBBER = model_named("fractional").stiffness([1e5, 1e7, 1e-3, 0.5], WIDE)
#: A series with an arm at zero, seven times over six decades.
OWN = Prony(1, 1 / np.geomspace(1e-1, 1e5, 7))
SPRINGS = np.array([1e5, 2e5, 4e5, 0.0, 8e5, 1e6, 5e5, 2e5])
TRUTH = np.concatenate([SPRINGS, OWN.times])


def noisy(rng, clean, omega, share, **k1):
    """K* with an error of each point, relative to |K*|."""
    error = rng.standard_normal((2, omega.size))
    return StiffnessData.of(omega, clean + share * abs(clean) * (error[0] + 1j * error[1]), share * abs(clean), **k1)


def test_without_noise_the_terms_are_found_again():
    data = StiffnessData.of(WIDE, OWN.stiffness(TRUTH, WIDE), 10.0)
    found = fit(OWN, data, TRUTH, fixed=OWN.usually_fixed)
    assert found.values == pytest.approx(TRUTH, rel=1e-6, abs=1.0)
    assert found.on_bound.sum() <= 1


def test_the_times_are_so_many_per_decade_over_the_band():
    data = StiffnessData.of(WIDE, RUBBER, 0.01 * abs(RUBBER))
    for per_decade in (1, 2, 3):
        times = Prony(per_decade).placed([data]).times
        assert times.size == 6 * per_decade + 1
        assert np.ptp(np.diff(np.log(times))) < 1e-9
        assert 1 / WIDE.min() <= times[0] * (1 + 1e-9)
        assert times[0] <= 10**0.51 / WIDE.min()
        assert 10**-0.51 / WIDE.max() <= times[-1] <= 1 / WIDE.max() * (1 + 1e-9)


def test_the_fit_is_the_optimum_of_another_solver():
    """Bounded least squares by a trust region finds no smaller chi-square at the same times."""
    data = noisy(np.random.default_rng(3), RUBBER, WIDE, 0.01)
    (found,) = fit_conditions(model_named("prony:2"), [data])
    w = 1j * WIDE[:, None] * found.model.times
    rows = np.concatenate([np.ones((WIDE.size, 1)), w / (1 + w)], axis=1) / (0.01 * abs(RUBBER))[:, None]
    target = data.stiffness / (0.01 * abs(RUBBER))
    other = optimize.lsq_linear(
        np.vstack([rows.real, rows.imag]), np.append(target.real, target.imag), (0, np.inf), method="bvls", tol=1e-14
    )
    assert float(found.chi2) == pytest.approx(2 * other.cost, rel=1e-6)
    assert found.dof == 2 * WIDE.size - int((found.values[: found.model.arms + 1] > 0).sum())


def test_k1_is_a_datum():
    rng = np.random.default_rng(5)
    free = fit_conditions(Prony(2), [noisy(rng, RUBBER, WIDE, 0.01)])[0]
    held = fit_conditions(Prony(2), [noisy(rng, RUBBER, WIDE, 0.01, k1=1e5, k1_std=100.0)])[0]
    assert abs(held.values[0] - 1e5) < 400.0
    assert held.std[0] < 101.0 < free.std[0]
    assert held.residuals.size == free.residuals.size + 1


@pytest.mark.statistical
def test_predictions_and_terms_are_inside_their_intervals():
    """95 % of K* with the covariance of the terms above zero, and of the terms by profile likelihood, zero included.

    300 predictions or terms that are partly correlated: their share scatters by about 2 %.
    """
    rng = np.random.default_rng(1)
    inside, terms = [], []
    clean = OWN.stiffness(TRUTH, WIDE)
    for _ in range(40):
        data = noisy(rng, RUBBER, WIDE, 0.01)
        (found,) = fit_conditions(Prony(3), [data])
        off = found.model.stiffness(found.values, WIDE) - RUBBER
        slopes = found.model.derivative(found.values, WIDE)
        for part, slope in ((off.real, slopes.real), (off.imag, slopes.imag)):
            inside.append(np.abs(part) < 1.96 * np.sqrt(np.einsum("ni,ij,nj->n", slope, found.covariance, slope)))
        data = noisy(rng, clean, WIDE, 0.02)
        own = fit(OWN, data, TRUTH, fixed=OWN.usually_fixed)
        ends = profile_intervals(own, data, fixed=OWN.usually_fixed)[:8]
        terms.append((ends[:, 0] <= SPRINGS) & (ends[:, 1] >= SPRINGS))
    assert 0.90 < np.mean(inside) < 0.98
    assert 0.91 < np.mean(terms) < 0.99


def test_the_interval_of_a_term_at_zero_is_one_sided():
    data = noisy(np.random.default_rng(0), OWN.stiffness(TRUTH, WIDE), WIDE, 0.01)
    found = fit(OWN, data, TRUTH, fixed=OWN.usually_fixed)
    ends = profile_intervals(found, data, fixed=OWN.usually_fixed)
    zero = np.flatnonzero(found.values[:8] == 0)
    assert (ends[zero, 0] == 0).all()
    assert (ends[zero, 1] > 0).all()
    assert (ends[8:, 0] == ends[8:, 1]).all()  # the times are given


def test_the_end_of_an_interval_has_the_stated_rise():
    """The profile of each term, fitted anew by hand, has risen by 3.84 at both ends, to the tolerance of the search."""
    data = noisy(np.random.default_rng(2), OWN.stiffness(TRUTH, WIDE), WIDE, 0.02)
    found = fit(OWN, data, TRUTH, fixed=OWN.usually_fixed)
    ends = profile_intervals(found, data, fixed=OWN.usually_fixed)
    whiten = data.whitener()
    rows = data.whitened(whiten, OWN.derivative(TRUTH, WIDE)[:, :8])
    target = data.whitened(whiten, data.stiffness[:, None])[:, 0]
    for at in range(8):
        for end in ends[at][ends[at] > 0]:
            chi2 = least_squares(np.delete(rows, at, axis=1), target - end * rows[:, at])[1]
            assert np.sqrt(chi2 - float(found.chi2)) == pytest.approx(1.96, rel=0.02)


def test_a_band_of_any_width():
    omega = 2 * np.pi * np.geomspace(1e-40, 1e40, 80)
    clean = model_named("fractional").stiffness([1e5, 1e8, 1.0, 0.1], omega)
    (found,) = fit_conditions(Prony(1), [noisy(np.random.default_rng(0), clean, omega, 0.01)])
    assert found.model.arms == 81
    assert float(found.chi2) < 2 * found.dof
    with pytest.raises(ModelError, match="more than 300: state fewer per decade, as prony:3"):
        Prony(4).placed([StiffnessData.of(omega, clean, 1.0)])


def test_auto_tries_it_on_a_wide_band_only():
    assert "prony" in automatic(4.1)
    assert "prony" not in automatic(3.9)
    narrow = StiffnessData.of(WIDE[:12], RUBBER[:12], 0.01 * abs(RUBBER[:12]))
    assert not any(one.name.startswith("prony") for one in choose(narrow).candidates)


@pytest.mark.parametrize("name", ["prony:0", "prony:13", "prony:x", "prony:"])
def test_sizes_that_are_none(name):
    with pytest.raises(ModelError):
        model_named(name)


def test_the_bare_name_has_three_per_decade():
    assert model_named("prony").name == "prony:3"


def test_the_series_in_time_is_the_series_in_frequency():
    assert OWN.state_space(TRUTH).stiffness(WIDE) == pytest.approx(OWN.stiffness(TRUTH, WIDE), rel=1e-12)
    assert len(OWN.state_space(TRUTH).a) == 6  # the arm at zero has no state
