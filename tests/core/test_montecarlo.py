"""Intervals of K2 and C by drawing: quantiles of a known law, what has no upper limit, K* as its routes have it."""

import numpy as np
import pytest

from fourpole.core.confidence import LEVELS
from fourpole.core.curvature import arm_intervals, draw_around, draw_route
from fourpole.core.identify import ChannelUncertainty, identify
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.tyre import zener_stiffness

K1, K2, C, OMEGA = 180e3, 120e3, 700.0, 20 * np.pi
DRAWS = 20_000
RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.15, "preload_stiffness": 120.0})
CHANNELS = ChannelUncertainty(gain=np.array([0.01, 0.012, 0.014]), phase=np.array([0.004, 0.005, 0.006]))


def rng():
    return np.random.default_rng(1982)


def arm(k2, c):
    """K* of springs and dampers k2, c beside K1."""
    return K1 + 1 / (1 / k2 + 1 / (1j * OMEGA * c))


def test_the_levels_are_those_of_95_percent():
    assert LEVELS == (0.025, 0.5, 0.975)


@pytest.mark.parametrize("which", ["K2", "C"])
def test_the_limits_hold_95_of_100_draws(which):
    """K2 or C at the even quantiles of any law: the limits are its own quantiles, to one of a thousand draws."""
    drawn = np.linspace(50e3, 150e3, 1001) if which == "K2" else np.linspace(500.0, 900.0, 1001)
    k2, c = arm_intervals(arm(drawn, C) if which == "K2" else arm(K2, drawn), np.full(1001, K1), OMEGA)
    found = k2 if which == "K2" else c
    low, middle, high = drawn[[25, 500, 975]]
    step = drawn[1] - drawn[0]
    assert found.quantiles == pytest.approx([low, middle, high], abs=0.01 * step)
    assert found.non_passive_share == 0.0
    other, expected = (c, C) if which == "K2" else (k2, K2)
    assert other.quantiles == pytest.approx([expected] * 3)


@pytest.mark.parametrize(("beyond", "limited"), [(24, True), (26, False)])
def test_where_more_than_one_in_forty_draws_is_beyond_the_pole_there_is_no_upper_limit(beyond, limited):
    """1/K2 falls through zero: 1000 even steps of it, so that 2.5 % of the draws are 25."""
    inverse = (np.arange(1001) - beyond + 0.5) * 1e-8
    stiffness = K1 + 1 / (inverse + 1 / (1j * OMEGA * C))
    k2, _ = arm_intervals(stiffness, np.full(1001, K1), OMEGA)
    assert np.isfinite(k2.quantiles[2]) == limited
    assert np.isfinite(k2.quantiles[:2]).all()
    assert k2.non_passive_share == pytest.approx(beyond / 1001)


def test_k_star_is_drawn_with_its_covariance():
    stiffness = complex(zener_stiffness(K1, K2, C, OMEGA))
    covariance = np.array([[4e6, 1e6], [1e6, 2e6]])
    drawn = draw_around(stiffness, covariance, DRAWS, rng())
    found = np.cov(np.stack([drawn.real, drawn.imag]))
    mean = drawn.mean() - stiffness
    deviations = 4 / np.sqrt(DRAWS)
    assert abs(mean) < deviations * np.sqrt(np.trace(covariance))
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.all(np.abs(found - covariance) < deviations * np.sqrt(2) * scale)


@pytest.mark.parametrize("route", ["relative", "mobility", "transmissibility"])
def test_a_route_is_drawn_as_it_is_propagated(route):
    """All of what it rests on is small, so draws and linear propagation agree within the scatter of the draws."""
    stiffness = complex(zener_stiffness(K1, K2, C, OMEGA))
    impedance = complex(RIG.impedance(OMEGA, 5.0))
    ratio = stiffness / (stiffness + 1j * OMEGA * impedance)
    amplitudes = 0.06 * np.array([impedance * ratio, 1.0, ratio])
    noise = np.kron(np.diag(np.abs(amplitudes) ** 2), np.eye(2)) * 1e-3**2
    phasors = Phasors(OMEGA / (2 * np.pi), amplitudes, noise, 0.0, np.inf)
    drawn = draw_route(phasors, RIG, route, CHANNELS, DRAWS, rng(), added_mass=5.0, added_mass_std=0.05)
    found = identify(
        Phasors(*(np.asarray(getattr(phasors, name))[None] for name in Phasors.__dataclass_fields__)),
        RIG,
        K1,
        route=route,
        added_mass=5.0,
        added_mass_std=0.05,
        channels=CHANNELS,
    )
    assert complex(found.stiffness[0]) == pytest.approx(stiffness)
    expected = found.stiffness_covariance[0]
    covariance = np.cov(np.stack([drawn.real, drawn.imag]))
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # Four standard deviations of a covariance from draws, and the square of 2 %, the relative uncertainty of K*.
    assert np.all(np.abs(covariance - expected) < (4 * np.sqrt(2 / DRAWS) + 5 * 0.02**2) * scale)
    spread = np.sqrt(np.trace(expected))
    assert abs(drawn.mean() - stiffness) < 4 * spread / np.sqrt(DRAWS) + 0.05 * spread
