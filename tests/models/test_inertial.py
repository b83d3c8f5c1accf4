"""Springs about a mass, from one end or from both: elimination of the mass by hand is the other way round."""

import numpy as np
import pytest
from scipy.stats import chi2

from fourpole.models.data import StiffnessData
from fourpole.models.inertial import Of, carried, springs_of
from fourpole.models.ladder import Rung, verdict_of, without_inertia

OMEGA = 2 * np.pi * np.linspace(5.0, 60.0, 30)
MASS, SHARE = 7.0, 0.4


def springs(w):
    return 2.5e5 * (1j * w / 60) ** 0.07


def contact_and_rim(w):
    """The two springs in series that are K*, the first softer by the share."""
    return (1 + SHARE) * springs(w), (1 + 1 / SHARE) * springs(w)


def driven(w):
    contact, rim = contact_and_rim(w)
    return contact - contact**2 / (contact + rim - w**2 * MASS)


def transfer(w):
    contact, rim = contact_and_rim(w)
    return contact * rim / (contact + rim - w**2 * MASS)


@pytest.mark.parametrize(("measured", "share"), [(driven, SHARE), (transfer, None)])
def test_the_springs_follow_from_what_is_measured_and_the_other_way_round(measured, share):
    inertia = OMEGA**2 * MASS / (SHARE + 2 + 1 / SHARE)
    np.testing.assert_allclose(springs_of(measured(OMEGA), inertia, share), springs(OMEGA), rtol=1e-10)
    shown, slope = carried(springs(OMEGA), inertia, share)
    np.testing.assert_allclose(shown, measured(OMEGA), rtol=1e-12)
    step = 1e-6 * springs(OMEGA)
    np.testing.assert_allclose(slope, (carried(springs(OMEGA) + step, inertia, share)[0] - shown) / step, rtol=1e-4)


def drawn(measured, seed, noise=0.003):
    truth, rng = measured(OMEGA), np.random.default_rng([2, seed])
    std = noise * np.abs(truth)
    return StiffnessData.of(OMEGA, truth + std * (rng.normal(size=30) + 1j * rng.normal(size=30)), std)


@pytest.mark.sampled(6)
def test_a_belt_is_found_with_its_mass_and_taken_off_with_its_uncertainty():
    """The errors of 16 masses, over their uncertainties, have the sum of squares that they have in 99.8 % of trials."""
    off, left = [], []
    for seed in range(16):
        data = drawn(driven, seed)
        found = verdict_of(data)
        if found.belt is None:
            continue
        off.append((found.belt.mass - MASS) / found.belt.mass_std)
        rest = without_inertia(data, found)
        std = np.sqrt(np.diagonal(rest.covariance)).reshape(-1, 2)
        error = rest.stiffness - springs(OMEGA)
        left.append(np.stack([error.real, error.imag], axis=1) / std)
    assert len(off) >= 15
    assert chi2.ppf(1e-3, len(off)) < np.sum(np.square(off)) < chi2.isf(1e-3, len(off))
    assert 0.85 < np.sqrt(np.mean(np.square(left))) < 1.15


@pytest.mark.sampled(4)
def test_a_blocked_transfer_is_told_apart_and_springs_have_no_inertia():
    data = drawn(transfer, 1)
    found = verdict_of(data, Of.BLOCKED_TRANSFER)
    assert found.holds is Rung.RESONANT
    rest = without_inertia(data, found)
    off = (rest.stiffness - springs(OMEGA)).real / np.sqrt(np.diagonal(rest.covariance))[::2]
    assert np.sqrt(np.mean(off**2)) < 1.5
    assert verdict_of(data).holds is Rung.NONE  # no driving point has this
    assert verdict_of(drawn(driven, 1), Of.SPRINGS).holds is Rung.NONE
    assert verdict_of(drawn(springs, 1), Of.SPRINGS).holds is Rung.RELAXING
