"""Marching in exact steps: modes against plain recursion, and against solutions by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from fourpole.virtual import Bench, Cam, Zener, state_matrices
from fourpole.virtual.dynamic_rig import held_force, march, recur, respond

TYRE = Zener(k1=150e3, k2=190e3, c=1400.0)


@pytest.mark.parametrize("tyre", [TYRE, Zener(k1=2e3, k2=1e3, c=2e4)], ids=["oscillating", "overdamped"])
def test_modes_and_plain_marching_agree(tyre):
    a, b = state_matrices(tyre, Bench(preload_stiffness=0.0, preload_damping=2e4 if tyre.k1 < 1e4 else 0.0))
    assert np.isrealobj(np.linalg.eigvals(a)) == (tyre.k1 < 1e4)
    x1, v1 = Cam(15.0).motion(np.arange(400) * 2e-4)
    by_modes = respond(a, b, x1, v1, 2e-4, slice(0, None))
    transition = expm(a * 2e-4)
    # the pushes, found as what the first step from rest adds for each end of the motion in turn
    ends = np.stack([x1[:-1], v1[:-1], x1[1:], v1[1:]])
    unit = [
        respond(a, b, np.array([e[0], e[2]]), np.array([e[1], e[3]]), 2e-4, slice(0, None))[:, 1] for e in np.eye(4)
    ]
    marched = march(transition, np.transpose(unit) @ ends)
    np.testing.assert_allclose(by_modes, marched, atol=1e-10 * abs(marched).max())


def test_coinciding_modes_are_marched():
    # a mass on nothing but two dampers in a row of equal decay: no set of independent modes
    a = np.array([[-5.0, 1.0, 0.0], [0.0, -5.0, 1.0], [0.0, 0.0, -5.0]])
    b = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    t = np.arange(2001) * 1e-3
    states = respond(a, b, np.ones_like(t), np.zeros_like(t), 1e-3, slice(0, None))
    np.testing.assert_allclose(states[2], (1.0 - np.exp(-5.0 * t)) / 5.0, atol=1e-12)


def test_force_is_held_straight_between_the_points():
    # v' = -r v + f with f = t: v = (t - 1/r)/r + e^{-rt}/r^2, exact at any step
    rate, step = 5.0, 0.1
    a = np.array([[-rate]])
    time = np.arange(20) * step
    push = held_force(a, np.array([[1.0]]), step)
    speed = recur(a, push, np.stack([time[:-1], time[1:]]), step, slice(0, None))[0]
    np.testing.assert_allclose(speed, (time - 1.0 / rate) / rate + np.exp(-rate * time) / rate**2, atol=1e-14)
