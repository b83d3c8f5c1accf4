"""Intervals by profile likelihood: the truth inside as often as said, normal where all is linear, open ends."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import fit
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.profile import profile_intervals
from fourpole.models.springs import KelvinVoigt, Spring

pytestmark = pytest.mark.thorough

OMEGA = 2 * np.pi * np.linspace(5.0, 30.0, 20)


def seen(model, values, noise, seed=0):
    rng = np.random.default_rng(seed)
    clean = model.stiffness(values, OMEGA)
    std = noise * np.abs(clean)
    return StiffnessData.of(OMEGA, clean + std * (rng.standard_normal(20) + 1j * rng.standard_normal(20)), std)


def test_where_all_is_linear_they_are_the_normal_ones():
    data = seen(KelvinVoigt(), [180e3, 300.0], 1e-3)
    found = fit(KelvinVoigt(), data, [180e3, 300.0])
    ends = profile_intervals(found, data)
    # between two looks at the profile its root is a chord: exact for a parabola, and a logarithm bends by 1e-3 here
    np.testing.assert_allclose(ends[:, 1] - found.values, 1.959964 * found.std, rtol=2e-3)
    np.testing.assert_allclose(found.values - ends[:, 0], 1.959964 * found.std, rtol=2e-3)


@pytest.mark.statistical
@pytest.mark.sampled(8)
def test_the_truth_is_inside_as_often_as_said():
    """60 cases of 5 % noise, where C is far from normal: 95 % give or take three times 2.8 %."""
    model, truth = Zener(), np.array([180e3, 120e3, 700.0])
    inside, cases = [], 60
    for at in range(cases):
        data = seen(model, truth, 0.05, seed=at)
        ends = profile_intervals(fit(model, data, truth), data)
        inside.append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 3 * np.sqrt(0.95 * 0.05 / cases))


def test_an_end_that_the_data_do_not_set_is_open():
    """A spring by itself fitted with an arm: the arm's spring may be nothing, and its time anything."""
    data = seen(Spring(), [180e3], 1e-3)
    found = fit(GeneralisedMaxwell(1), data, [170e3, 10e3, 0.01])
    ends = profile_intervals(found, data)
    assert ends[2, 0] == 0.0 or ends[2, 1] == np.inf
    assert ends[1, 0] == 0.0


def test_fixed_ones_have_no_width():
    data = seen(Zener(), [180e3, 120e3, 700.0], 1e-3)
    fixed = fit(Zener(), data, [180e3, 120e3, 700.0], fixed=["K1"])
    ends = profile_intervals(fixed, data, fixed=["K1"])
    assert ends[0].tolist() == [180e3, 180e3]
    assert ends[1, 0] < 120e3 * 1.01 < ends[1, 1] * 1.02


def test_k1_counts_where_it_is_all_that_is_known():
    """One frequency, everything else fixed: chi-square is of K1's datum and two numbers."""
    model = Zener()
    data = StiffnessData.of([60.0], model.stiffness([180e3, 120e3, 700.0], [60.0]), 1e3, k1=180e3, k1_std=1e3)
    found = fit(model, data, [180e3, 120e3, 700.0], fixed=["K2", "C"])
    ends = profile_intervals(found, data, fixed=["K2", "C"])
    assert ends[0, 1] - ends[0, 0] == pytest.approx(2 * 1.959964 * 1e3 / np.sqrt(2), rel=1e-2)


def test_one_condition_at_a_time():
    data = StiffnessData.of(OMEGA, np.full((2, 20), 180e3 + 0j), 100.0)
    with pytest.raises(ModelError, match="one condition"):
        profile_intervals(fit(Spring(), data, [180e3]), data)
