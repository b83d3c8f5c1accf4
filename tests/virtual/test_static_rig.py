"""The static rig: branches about the law, a loop of known area, and rubber that is conditioned."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from fourpole.virtual import CROSS_PLY, RADIAL_PLY, load_cycles

TYRES = pytest.mark.parametrize("tyre", [CROSS_PLY, RADIAL_PLY], ids=lambda tyre: tyre.name)
PRESSURE = 170e3
PER_CYCLE = 1000  # samples: 20 s at 50 Hz


def cycle(slow, number):
    part = slice((number - 1) * PER_CYCLE, number * PER_CYCLE + 1)
    return slow.deflection[part], slow.load[part]


@TYRES
@pytest.mark.parametrize("number", [3, 4])
def test_mean_of_the_branches_is_the_law_once_conditioned(tyre, number):
    x, load = cycle(load_cycles(tyre, PRESSURE), number)
    mean = 0.5 * (load + load[::-1])  # the sweep is symmetric, so sample k and its mirror have one deflection
    np.testing.assert_allclose(x, x[::-1], atol=1e-15)
    np.testing.assert_allclose(mean, tyre.load(x, PRESSURE), atol=1e-9)
    assert (load[1 : PER_CYCLE // 2] > load[::-1][1 : PER_CYCLE // 2]).all()


@TYRES
def test_loop_area_is_that_of_the_hysteresis(tyre):
    x, load = cycle(load_cycles(tyre, PRESSURE), 4)
    expected = 4.0 / 3.0 * tyre.hysteresis * 3500.0 * x.max()  # twice the integral of h F_p 4u(1-u)
    assert trapezoid(load, x) == pytest.approx(expected, rel=1e-4)


@TYRES
def test_first_loading_takes_more_force_and_the_unloading_does_not(tyre):
    slow = load_cycles(tyre, PRESSURE)
    half = slice(1, PER_CYCLE // 2)
    loads = [cycle(slow, number)[1] for number in (1, 2, 3, 4)]
    assert (loads[0][half] > loads[1][half]).all()
    assert (loads[1][half] > loads[2][half]).all()
    np.testing.assert_allclose(loads[2], loads[3], atol=1e-9)
    np.testing.assert_allclose(loads[0][PER_CYCLE // 2 :], loads[3][PER_CYCLE // 2 :], atol=1e-9)
    excess = (loads[0] - loads[3])[half].max() / loads[3].max()
    assert 0.005 < excess < 0.05


def test_sweep_is_slow_smooth_and_complete():
    slow = load_cycles(RADIAL_PLY, PRESSURE, cycles=5)
    assert slow.time[-1] == 100.0
    assert abs(slow.deflection[::PER_CYCLE]).max() < 1e-15
    assert abs(slow.load[::PER_CYCLE]).max() < 1e-9
    assert slow.load.max() == pytest.approx(3500.0, rel=0.01)
    assert abs(np.diff(slow.load)).max() < 0.01 * 3500.0


@pytest.mark.parametrize("wrong", [{"peak_load": 0.0}, {"cycles": 0}, {"period": -1.0}, {"sample_rate": 0.0}])
def test_impossible_sweeps_are_refused(wrong):
    with pytest.raises(ValueError, match="must be > 0"):
        load_cycles(RADIAL_PLY, PRESSURE, **wrong)
