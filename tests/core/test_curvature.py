"""u(K2) and u(C) to second order, against draws of K*, K1: where a first derivative vanishes, and where none does."""

import numpy as np
import pytest

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.confidence import NORMAL_95
from fourpole.core.curvature import Curvature, arm_covariance, largest_bend
from fourpole.core.identify import OUTPUTS, identify, variance_by_source
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import ROUTES, maxwell_arm

K1, OMEGA = 100e3, 2 * np.pi * 14.0
DRAWS = 200_000
#: K' - K1 and K'' [N/m]: the first derivative of K2 by K' and K1 vanishes, that of C by K'' vanishes, both small.
ARMS = {
    "dK2/dK1 = 0": (20e3, 20e3),
    "K'' small": (20e3, 2e3),
    "K' - K1 small": (2e3, 20e3),
    "both alike, nearly": (20e3, 19e3),
    "both small": (2e3, 2e3),
}
#: Uncertainties of K' - K1 and K'' over these themselves, and their correlation.
SPREADS = {
    "K1 alone": (0.05, 0.0, 0.0),
    "K'' alone": (0.0, 0.05, 0.0),
    "both": (0.04, 0.03, -0.6),
    "little": (1e-3, 1e-3, 1e-3),
}
LARGEST = 0.05


def spread_of(arm, spread):
    a, b = arm[0] * spread[0], arm[1] * spread[1]
    return np.array([[[a * a, spread[2] * a * b], [spread[2] * a * b, b * b]]])


def drawn(arm, covariance, draws=DRAWS):
    """K2 and C (2, draws) from normal deviations of K' - K1 and K''; about half of them are the other half turned."""
    values, vectors = np.linalg.eigh(covariance[0])
    half = np.random.default_rng(1982).standard_normal((draws // 2, 2))
    off = (np.concatenate([half, -half]) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return np.stack(maxwell_arm(K1 + arm[0] + off[:, 0] + 1j * (arm[1] + off[:, 1]), K1, OMEGA))


def stated(arm, covariance):
    stiffness, k1, omega = np.array([K1 + complex(*arm)]), np.array([K1]), np.array([OMEGA])
    value = np.concatenate(maxwell_arm(stiffness, k1, omega))
    bend = largest_bend(stiffness, k1, omega, covariance)[0]
    return value, arm_covariance(stiffness, k1, omega, covariance)[0], bend


@pytest.mark.parametrize("spread", SPREADS)
@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.sampled(4)
def test_u_is_the_root_mean_square_deviation_from_the_value(arm, spread):
    """K2 = a (2 + f e + e² - e³ + e⁴ ...) near its minimum, e = da/a; what is left out has two parts.

    Beside e², the mean squares of e³ and of e² e⁴ are 15 e². The product of f e and e³ is at most sqrt(3) e of all.
    """
    covariance = spread_of(ARMS[arm], SPREADS[spread])
    value, found, _ = stated(ARMS[arm], covariance)
    off = drawn(ARMS[arm], covariance) - value[:, None]
    expected = off @ off.T / DRAWS
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # a square of a normal deviation, of kurtosis up to 12: five standard errors of its mean square
    left_out = 15 * LARGEST**2 + np.sqrt(3) * LARGEST
    assert np.all(np.abs(found - expected) <= (left_out + 5 * np.sqrt(12 / DRAWS)) * scale)


@pytest.mark.parametrize("spread", SPREADS)
@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.sampled(4)
def test_intervals_hold_the_share_that_they_say_or_are_called_bent(arm, spread):
    covariance = spread_of(ARMS[arm], SPREADS[spread])
    value, found, bend = stated(ARMS[arm], covariance)
    std = np.sqrt(np.diag(found))
    values = drawn(ARMS[arm], covariance)
    ends = np.quantile(values, [0.025, 0.975], axis=1)
    off = np.abs(ends - value - NORMAL_95 * np.outer([-1, 1], std)).max(axis=0)
    # Five times the scatter of a 97.5 % quantile of DRAWS normal values; higher powers are a geometric series.
    scatter = 5 * np.sqrt(0.025 * 0.975 / DRAWS) / 0.0584
    assert np.all(off <= (bend / (1 - NORMAL_95 * LARGEST) + scatter) * std)
    inside = np.mean(np.abs(values - value[:, None]) < NORMAL_95 * std[:, None], axis=1)
    assert np.all(inside > 0.92)  # s z² about zero with u = sqrt(3) s has 0.934
    assert np.all(inside < 0.96)


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("relative", [0.1, 0.2])
def test_u_is_not_far_below_the_scatter_where_the_arm_is_hardly_known(arm, relative):
    covariance = spread_of(ARMS[arm], (relative, relative, 0.3))
    _, found, _ = stated(ARMS[arm], covariance)
    values = drawn(ARMS[arm], covariance)
    # at five standard uncertainties a draw may come to the pole: what lies beyond 99.9 % is left out
    low, high = np.quantile(values, [5e-4, 0.9995], axis=1)
    kept = [np.std(row[(row > a) & (row < b)]) for row, a, b in zip(values, low, high, strict=True)]
    assert np.all(np.sqrt(np.diag(found)) > 0.75 * np.array(kept))


def test_the_bend_is_that_of_second_differences():
    a, b, step = 30e3, 20e3, 10.0

    def arm(da, db):
        return np.array(maxwell_arm(K1 + a + da + 1j * (b + db), K1, OMEGA))

    bent = Curvature.of(np.array([K1 + a + 1j * b]), np.array([K1]), np.array([OMEGA]))
    for da, db in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (a / b, 1.0), (1.0, b / a)):
        half = (arm(da * step, db * step) - 2 * arm(0.0, 0.0) + arm(-da * step, -db * step)) / (2 * step**2)
        w = bent.by(np.array([[da + 1j * db]]))[0, 0]
        # fourth derivatives: (step/a)²; round-off of the values over the step's square
        assert half == pytest.approx(bent.bend[0] * w**2, rel=1e-5, abs=1e-15 * 100e3 / step**2)


def phasors_at(stiffness, rig):
    ratio = stiffness / (stiffness + 1j * OMEGA * rig.impedance(OMEGA))
    amplitudes = 0.06 * np.array([[rig.impedance(OMEGA) * ratio, 1.0, ratio]])
    noise = np.kron(np.diag(np.abs(amplitudes[0]) ** 2), np.eye(2))[None] * 1e-8
    return Phasors(np.array([14.0]), amplitudes, noise, np.array([1e-4]), np.array([np.inf]))


@pytest.mark.parametrize("route", ROUTES)
def test_every_route_has_the_second_order_and_its_budget_adds_up(route):
    """K1 to 2 %, sensors to 1e-5: without the second order u(K2) is 0.02 %, drawn it is 1 %."""
    rig = Rig(15.0, 12440.0, 15.0, std={"moving_mass": 1e-4})
    phasors = phasors_at(K1 + 20e3 + 20e3j, rig)
    given = {"k1_std": 2e3, "route": route, "channels": ChannelUncertainty(np.full(3, 1e-5), np.full(3, 1e-5))}
    found = identify(phasors, rig, K1, **given)
    k1 = K1 + 2e3 * np.random.default_rng(1982).standard_normal(20_000)
    k2, _ = maxwell_arm(found.stiffness[0], k1, OMEGA)
    assert np.sqrt(found.arm_covariance[0, 0, 0]) > 0.95 * np.std(k2)
    sources = variance_by_source(phasors, rig, K1, **given)
    whole = dict(zip(OUTPUTS, np.sum(list(sources.values()), axis=0)[0], strict=True))
    assert whole["K2"] == pytest.approx(found.arm_covariance[0, 0, 0], rel=1e-9)
    assert whole["C"] == pytest.approx(found.arm_covariance[0, 1, 1], rel=1e-9)
    assert whole["Re K*"] == pytest.approx(found.stiffness_covariance[0, 0, 0], rel=1e-9)


def test_an_arm_that_does_not_exist_has_no_uncertainty_and_warns_of_nothing():
    stiffness = np.array([K1 + 0j, K1 + 1e4j, complex(np.nan, np.nan), K1 - 1e4 + 1e4j])
    k1, omega = np.array([K1, K1, K1, np.nan]), np.full(4, OMEGA)
    found = arm_covariance(stiffness, k1, omega, np.tile(1e6 * np.eye(2), (4, 1, 1)))
    assert not np.isfinite(found[:, 0, 0]).any()
