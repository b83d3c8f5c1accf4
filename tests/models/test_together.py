"""Many conditions in one fit: shared parameters, laws, and errors that the conditions have in common."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import fit
from fourpole.models.fractional import FractionalZener
from fourpole.models.maxwell import Zener
from fourpole.models.springs import Spring
from fourpole.models.together import Scatter, fit_together

OMEGA = 2 * np.pi * np.linspace(5.0, 30.0, 15)
TRUTH = np.array([[180e3, 120e3, 700.0], [180e3, 140e3, 800.0], [180e3, 160e3, 900.0]])


def conditions(noise, seed=0, truth=TRUTH):
    rng = np.random.default_rng(seed)
    found = []
    for values in truth:
        clean = Zener().stiffness(values, OMEGA)
        std = noise * np.abs(clean)
        draw = rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size)
        found.append(StiffnessData.of(OMEGA, clean + std * draw, std))
    return found


def test_without_laws_it_is_each_condition_by_itself():
    data = conditions(1e-3)
    together = fit_together(Zener(), data, TRUTH)
    for at, one in enumerate(data):
        alone = fit(Zener(), one, TRUTH[at])
        np.testing.assert_allclose(together.values[at], alone.values, rtol=1e-6)
    assert together.chi2 == pytest.approx(sum(float(fit(Zener(), one, TRUTH[0]).chi2) for one in data), rel=1e-6)
    np.testing.assert_allclose(together.fits()[0].std, fit(Zener(), data[0], TRUTH[0]).std, rtol=1e-4)


def test_a_shared_parameter_is_one_and_surer():
    """One K1 of three conditions: its uncertainty falls with their number, by the root of 3."""
    data = conditions(1e-3)
    shared = fit_together(Zener(), data, TRUTH, {"K1": np.ones((3, 1))})
    assert np.ptp(shared.values[:, 0]) == 0
    alone = fit(Zener(), data[0], TRUTH[0])
    std = np.sqrt(shared.covariance[0, 0]) * shared.values[0, 0]
    assert 0.4 < std / alone.std[0] < 0.75
    assert shared.dof == fit_together(Zener(), data, TRUTH).dof + 2


@pytest.mark.sampled(4)
def test_a_law_gives_the_truth_within_its_covariance():
    """log K2 linear over the conditions: chi-square of the coefficients over 200 draws has mean 2."""
    x = np.array([-1.0, 0.0, 1.0])
    truth = np.stack([np.full(3, 180e3), 140e3 * np.exp(0.1 * x), np.full(3, 800.0)], axis=1)
    basis = np.stack([np.ones(3), x], axis=1)
    one = np.ones((3, 1))
    scores = []
    for seed in range(200):
        found = fit_together(Zener(), conditions(1e-3, seed, truth), truth, {"K1": one, "K2": basis, "C": one})
        off = np.concatenate(found.coefficients) - [np.log(180e3), np.log(140e3), 0.1, np.log(800.0)]
        scores.append(off @ np.linalg.solve(found.covariance, off))
    assert np.mean(scores) == pytest.approx(4.0, abs=4 * np.sqrt(2 * 4 / 200))


def test_a_common_gain_is_not_averaged_away():
    """Springs of 5 conditions under a gain known to 1 %: their mean is not known to 1 %/sqrt(5)."""
    data = [StiffnessData.of(OMEGA, np.full(15, 180e3 + 0j), 100.0) for _ in range(5)]
    gain = [np.stack([one.stiffness.real, one.stiffness.imag], 1).reshape(-1, 1) * 0.01 for one in data]
    found = fit_together(Spring(), data, [180e3], {"K": np.ones((5, 1))}, shared=gain)
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(0.01, rel=1e-3)


def test_scatter_widens_what_is_said():
    data = conditions(1e-4)
    narrow = fit_together(Zener(), data, TRUTH, {"K1": np.ones((3, 1))})
    wide = fit_together(Zener(), data, TRUTH, {"K1": np.ones((3, 1))}, scatter=Scatter((0.01, 0.01)))
    assert wide.covariance[0, 0] > 100 * narrow.covariance[0, 0]


@pytest.mark.parametrize("parameter", [*FractionalZener().parameters, *Zener().parameters])
def test_links_go_there_and_back(parameter):
    value = 0.3 if parameter.high == 1.0 else parameter.default
    linked = parameter.link(value)
    back, slope = parameter.unlink(linked)
    assert back == pytest.approx(value, rel=1e-12)
    step = 1e-6
    assert slope == pytest.approx((parameter.unlink(linked + step)[0] - back) / step, rel=1e-4)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda d: fit_together(Zener(), d, TRUTH, {"K9": np.ones((3, 1))}), "no parameter 'K9'"),
        (lambda d: fit_together(Zener(), d, TRUTH, {"K1": np.ones((2, 1))}), "need as many rows"),
        (lambda d: fit_together(Zener(), [d[0].part(np.array([0]))], TRUTH[:1]), "too few"),
        (lambda d: fit_together(Zener(), [], np.zeros((0, 3))), "one condition at a time"),
    ],
)
def test_what_cannot_be_fitted_is_told(call, said):
    with pytest.raises(ModelError, match=said):
        call(conditions(1e-3))
