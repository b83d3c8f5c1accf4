"""Fits of many conditions at once: the truth within its uncertainty, a peer's optimum, bounds, and K1 as a datum."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import best_fit, fit
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.problem import start_of
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.paper1982.models import Structural

pytestmark = pytest.mark.thorough

NARROW = 2 * np.pi * np.linspace(5.0, 30.0, 28)
CASES = {
    "spring": (Spring(), [180e3], NARROW),
    "kelvin": (KelvinVoigt(), [180e3, 300.0], NARROW),
    "structural": (Structural(), [180e3, 0.1], NARROW),
    "zener": (Zener(), [180e3, 120e3, 700.0], NARROW),
    "fractional": (FractionalZener(), [150e3, 400e3, 2e-3, 0.4], 2 * np.pi * np.geomspace(0.3, 200.0, 40)),
    "fractional5": (FractionalZener5(), [150e3, 400e3, 2e-3, 0.5, 0.6], 2 * np.pi * np.geomspace(0.03, 2e3, 60)),
    "maxwell:2": (GeneralisedMaxwell(2), [150e3, 60e3, 80e3, 0.2, 4e-3], 2 * np.pi * np.geomspace(0.1, 200.0, 50)),
}
COUNT, NOISE = 300, 1e-3


def drawn(model, base, omega, count=COUNT, noise=NOISE, seed=0):
    rng = np.random.default_rng(seed)
    truth = np.array(base) * rng.uniform(0.85, 1.15, (count, len(base)))
    clean = model.stiffness(truth, omega)
    std = noise * np.abs(clean)
    seen = clean + std * (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape))
    return truth, StiffnessData.of(omega, seen, std)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.sampled(2)
def test_the_truth_lies_within_its_interval(name):
    """Of 300 cases 95 %, give or take three times sqrt(0.05 · 0.95/300) = 1.3 %; and chi-square is what noise gives."""
    model, base, omega = CASES[name]
    truth, data = drawn(model, base, omega)
    found = fit(model, data, start_of(model, data))
    assert found.converged.all()
    score = (found.values - truth) / found.std
    assert np.all(np.abs(np.mean(np.abs(score) < 1.96, axis=0) - 0.95) < 0.04)
    assert np.mean(found.chi2) == pytest.approx(found.dof, abs=5 * np.sqrt(2 * found.dof / COUNT))
    assert np.mean(found.chance < 1e-3) < 0.01


def test_the_optimum_is_that_of_a_peer():
    model, base, omega = CASES["zener"]
    truth, data = drawn(model, base, omega, count=20)
    found = fit(model, data, 0.7 * truth)
    for i in range(20):
        std = np.sqrt(data.covariance[i, :, 0, 0])

        def off(share, i=i, std=std):
            left = (model.stiffness(share * truth[i], omega) - data.stiffness[i]) / std
            return np.concatenate([left.real, left.imag])

        peer = least_squares(off, np.full(3, 0.7), method="lm", xtol=1e-14, ftol=1e-14)
        np.testing.assert_allclose(found.values[i], peer.x * truth[i], rtol=1e-6)
        scaled = np.linalg.inv(peer.jac.T @ peer.jac) * np.outer(truth[i], truth[i])
        np.testing.assert_allclose(found.covariance[i], scaled, rtol=1e-3)


def test_a_common_gain_is_not_averaged_away():
    """A gain known to 1 % in all frequencies: the diagonal would say 0.2 %, the whole covariance says 1 %."""
    model, base, omega = CASES["spring"]
    clean = model.stiffness(base, omega)
    pairs = np.stack([clean.real, clean.imag], axis=-1).ravel()
    whole = np.outer(pairs, pairs) * 0.01**2 + np.eye(pairs.size) * (1e-3 * base[0]) ** 2
    found = fit(model, StiffnessData.of(omega, clean, covariance=whole), base)
    assert found.std[0] == pytest.approx(0.01 * base[0], rel=0.01)


def test_k1_is_a_datum():
    """Where the band says little of K1, a static test of 0.1 % says it."""
    model, base, omega = CASES["zener"]
    truth, data = drawn(model, base, omega, count=5, noise=1e-2)
    with_k1 = StiffnessData(data.omega, data.stiffness, data.covariance, truth[:, 0], 1e-3 * truth[:, 0])
    free, tied = fit(model, data, truth), fit(model, with_k1, truth)
    assert tied.dof == free.dof + 1
    assert np.all(tied.std[:, 0] < 1.01e-3 * truth[:, 0])
    assert np.all(tied.std[:, 2] < free.std[:, 2])


def test_fixed_parameters_stay_and_bounds_hold():
    model, base, omega = CASES["zener"]
    truth, data = drawn(model, base, omega, count=3)
    held = fit(model, data, truth, fixed={"K1": 170e3})
    assert np.all(held.values[:, 0] == 170e3)
    assert np.all(held.std[:, 0] == 0)
    order = FractionalZener()
    wave = StiffnessData.of(omega, Zener().stiffness(base, omega), 50.0)
    found = fit(order, wave, start_of(order, wave))
    assert found.values[3] == pytest.approx(1.0, abs=1e-12)  # a Zener tyre is one of order 1, its largest
    assert found.on_bound[3]
    np.testing.assert_allclose(found.values[:2], [180e3, 300e3], rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda d: fit(GeneralisedMaxwell(30), d, GeneralisedMaxwell(30).defaults), "too few for 61 free parameters"),
        (lambda d: fit(Zener(), d, Zener().defaults, fixed=["K3"]), "no parameter 'K3': it has K1, K2, C"),
        (lambda d: StiffnessData.of(d.omega, d.stiffness[:-1], 1.0), "the frequencies \\(28,\\)"),
        (lambda d: StiffnessData.of(d.omega, d.stiffness), "one of the two"),
        (lambda d: StiffnessData.of(d.omega, d.stiffness * np.nan, 1.0), "must be known at every frequency"),
        (
            lambda d: StiffnessData.of(d.omega, d.stiffness, covariance=np.tile([[1.0, 2.0], [2.0, 1.0]], (28, 1, 1))),
            "negative eigenvalue",
        ),
    ],
)
def test_what_cannot_be_fitted_is_told(call, said):
    data = StiffnessData.of(NARROW, Zener().stiffness(Zener().defaults, NARROW), 100.0)
    with pytest.raises(ModelError, match=said):
        call(data)


def test_a_parameter_on_a_bound_or_without_effect_has_no_uncertainty():
    """Two arms for tyres with one: a time without effect may be any, however large."""
    model, omega = GeneralisedMaxwell(2), 2 * np.pi * np.geomspace(3.0, 60.0, 20)
    _, data = drawn(Zener(), [180e3, 120e3, 700.0], omega, count=60)
    found = fit(model, data, [180e3, 1e4, 120e3, 1e3, 6e-3])
    assert np.count_nonzero(found.on_bound) > 10
    assert np.all(found.covariance[found.on_bound] == 0.0)


def test_each_condition_may_have_frequencies_of_its_own():
    model, base, omega = CASES["zener"]
    own = np.stack([omega, 1.1 * omega])
    truth = np.array([base, np.array(base) * 1.1])
    data = StiffnessData.of(own, model.stiffness(truth, own), 10.0)
    np.testing.assert_allclose(fit(model, data, base).values, truth, rtol=1e-6)


def test_the_best_of_several_starts_is_kept_and_their_agreement_told():
    """A start at the far bound of tau leads nowhere; one that is near finds the truth."""
    model, base, omega = CASES["maxwell:2"]
    data = StiffnessData.of(omega, model.stiffness(base, omega), 100.0)
    bad = np.array([150e3, 60e3, 80e3, 1e6, 1e7])
    found = best_fit(model, data, [bad, base])
    np.testing.assert_allclose(found.values, base, rtol=1e-4)
    assert float(found.agreed) == 0.5
    assert float(best_fit(model, data, [base, np.array(base) * 1.05]).agreed) == 1.0


def test_what_the_data_do_not_see_is_said_and_has_no_uncertainty():
    """An arm that relaxes within months is a spring at 5 to 30 Hz: its time is not seen."""
    data = StiffnessData.of(NARROW, Spring().stiffness([180e3], NARROW), 100.0)
    found = fit(GeneralisedMaxwell(1), data, [90e3, 90e3, 1e7])
    assert bool(found.on_bound[2])
    assert found.std[2] == 0
    assert np.isfinite(found.covariance).all()
