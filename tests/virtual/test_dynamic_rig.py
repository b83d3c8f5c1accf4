"""The dynamic rig against other roads to the same motion: transfer functions, an ODE solver, the energy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.integrate import solve_ivp

from fourpole.virtual import Bench, Cam, Zener, run, state_matrices
from fourpole.virtual.dynamic_rig import _exponential, _march, _respond

TYRE = Zener(k1=150e3, k2=190e3, c=1400.0)
BENCH = Bench(mass=15.0, preload_stiffness=12440.0, preload_damping=15.0)
WORN = {"profile": ((2, 0.006, 0.7), (3, 0.002, 2.1)), "ripple": ((1, 1.5e-3, 0.3), (2, 1e-3, 1.0)), "wander": 1e-4}


def transfer(tyre, bench, frequency):
    """x2/x1 and F1/x1, from polynomials in s multiplied out by hand."""
    arm = np.array([tyre.c, tyre.k2])
    force = np.polyadd(tyre.k1 * arm, [tyre.c * tyre.k2, 0.0])
    above = [bench.mass, bench.preload_damping, bench.preload_stiffness]
    whole = np.polyadd(np.polymul(above, arm), force)
    _, x2 = signal.freqs(force, whole, [2.0 * np.pi * frequency])
    _, f1 = signal.freqs(np.polymul(force, above), whole, [2.0 * np.pi * frequency])
    return x2[0], f1[0]


@settings(deadline=None, max_examples=25)
@given(
    k1=st.floats(80e3, 250e3),
    k2=st.floats(40e3, 300e3),
    c=st.floats(200.0, 3000.0),
    mass=st.floats(8.0, 30.0),
    damping=st.floats(0.0, 100.0),
    frequency=st.floats(8.0, 24.0),
)
def test_settled_motion_is_that_of_the_transfer_function(k1, k2, c, mass, damping, frequency):
    tyre, bench = Zener(k1, k2, c), Bench(mass, 12440.0, damping)
    motion = run(Cam(frequency), tyre, bench, duration=0.3)
    x2, f1 = transfer(tyre, bench, frequency)
    # x1 = e sin wt = Re(-j e exp(jwt)); the cubic hold errs by (wh)^4/384 at most: 2.2e-9 at 24 Hz in 0.2 ms
    turning = -1j * 1e-3 * np.exp(2j * np.pi * frequency * motion.time)
    limit = 5e-9 * max(1.0, abs(x2)) / min(1.0, abs(x2))
    np.testing.assert_allclose(motion.x2, (x2 * turning).real, atol=limit * abs(x2) * 1e-3)
    np.testing.assert_allclose(
        motion.v2, (2j * np.pi * frequency * x2 * turning).real, atol=limit * abs(x2) * 2 * np.pi * frequency * 1e-3
    )
    scale = (k1 + k2) * 1e-3 * (1.0 + abs(x2))  # of the forces of which F1 is the difference
    np.testing.assert_allclose(motion.force, (f1 * turning).real, atol=limit * scale)


def test_samples_are_accurate_to_1e_8_at_24_hz():
    cam = Cam(24.0, **WORN)
    coarse = run(cam, TYRE, BENCH, duration=1.0, guard=0)
    fine = run(cam, TYRE, BENCH, duration=1.0, guard=0, oversampling=40)
    np.testing.assert_allclose(coarse.time[::5], fine.time[::40], atol=1e-12)
    for name in ("x1", "v1", "x2", "v2", "force"):
        reference = getattr(fine, name)[::40]
        assert abs(getattr(coarse, name)[::5] - reference).max() < 1e-8 * abs(reference).max(), name


def test_motion_on_a_worn_cam_is_that_of_an_ode_solver():
    cam = Cam(17.0, **WORN)
    motion = run(cam, TYRE, BENCH, duration=0.5, guard=0, oversampling=20)

    def slope(t, z):
        (x1, _) = cam.motion(np.array([t]))
        x2, v2, y = z  # y is where the arm's spring meets its damper
        arm = TYRE.k2 * (x1[0] - x2 - y)
        force = TYRE.k1 * (x1[0] - x2) + arm
        pull = BENCH.preload_stiffness * x2 + BENCH.preload_damping * v2
        return [v2, (force - pull) / BENCH.mass, arm / TYRE.c]

    arm = motion.force[0] - TYRE.k1 * (motion.x1[0] - motion.x2[0])
    start = [motion.x2[0], motion.v2[0], motion.x1[0] - motion.x2[0] - arm / TYRE.k2]
    solved = solve_ivp(slope, (0.0, 0.499), start, method="DOP853", t_eval=motion.time[::200], rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(motion.x2[::200], solved.y[0], atol=1e-9 * abs(motion.x2).max())
    np.testing.assert_allclose(motion.v2[::200], solved.y[1], atol=1e-9 * abs(motion.v2).max())


def test_power_put_in_is_power_lost_in_the_dampers():
    motion = run(Cam(20.0), TYRE, BENCH, duration=1.001, guard=0)  # 20 whole turns and the point that closes them
    arm = motion.force - TYRE.k1 * (motion.x1 - motion.x2)
    put_in = np.mean((motion.force * motion.v1)[:-1])
    lost = np.mean((arm**2 / TYRE.c + BENCH.preload_damping * motion.v2**2)[:-1])
    assert put_in > 0.0
    assert lost == pytest.approx(put_in, rel=1e-8)


def test_start_is_forgotten():
    motion = run(Cam(16.0), TYRE, BENCH, duration=2.0, guard=0)
    turn = round(1000 * 5 / 16.0 * 2)  # samples in two turns
    late = motion.x2[8 * turn :]
    np.testing.assert_allclose(motion.x2[: late.size], late, atol=1e-13 * abs(late).max() + 1e-16)


def test_velocity_of_the_cam_is_the_slope_of_its_displacement():
    cam = Cam(13.0, **WORN)
    t, h = np.linspace(0.0, 4.0, 999), 1e-6
    slope = (cam.motion(t + h)[0] - cam.motion(t - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(cam.motion(t)[1], slope, atol=1e-7)


def test_mean_speed_of_the_cam_is_its_frequency():
    cam = Cam(10.0, wander=1e-3, wander_period=4.0)
    (ends, _) = cam.motion(np.array([0.0, 4.0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-15)


@pytest.mark.parametrize("tyre", [TYRE, Zener(k1=2e3, k2=1e3, c=2e4)], ids=["oscillating", "overdamped"])
def test_modes_and_plain_marching_agree(tyre):
    a, b = state_matrices(tyre, Bench(preload_stiffness=0.0, preload_damping=2e4 if tyre.k1 < 1e4 else 0.0))
    assert np.isrealobj(np.linalg.eigvals(a)) == (tyre.k1 < 1e4)
    x1, v1 = Cam(15.0).motion(np.arange(400) * 2e-4)
    by_modes = _respond(a, b, x1, v1, 2e-4, slice(0, None))
    transition = _exponential(a * 2e-4)
    # the pushes, found as what the first step from rest adds for each end of the motion in turn
    ends = np.stack([x1[:-1], v1[:-1], x1[1:], v1[1:]])
    unit = [
        _respond(a, b, np.array([e[0], e[2]]), np.array([e[1], e[3]]), 2e-4, slice(0, None))[:, 1] for e in np.eye(4)
    ]
    marched = _march(transition, np.transpose(unit) @ ends)
    np.testing.assert_allclose(by_modes, marched, atol=1e-10 * abs(marched).max())


def test_coinciding_modes_are_marched():
    # a mass on nothing but two dampers in a row of equal decay: no set of independent modes
    a = np.array([[-5.0, 1.0, 0.0], [0.0, -5.0, 1.0], [0.0, 0.0, -5.0]])
    b = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    t = np.arange(2001) * 1e-3
    states = _respond(a, b, np.ones_like(t), np.zeros_like(t), 1e-3, slice(0, None))
    np.testing.assert_allclose(states[2], (1.0 - np.exp(-5.0 * t)) / 5.0, atol=1e-12)


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        (np.diag([-800.0, 0.0, 1.5]), np.diag(np.exp([-800.0, 0.0, 1.5]))),
        (np.array([[0.0, 3.0], [-3.0, 0.0]]), np.array([[np.cos(3), np.sin(3)], [-np.sin(3), np.cos(3)]])),
    ],
)
def test_exponential(matrix, expected):
    np.testing.assert_allclose(_exponential(matrix), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("tyre", "bench", "options"),
    [
        (Zener(1e5, 0.0, 1e3), BENCH, {}),
        (Zener(1e5, 1e5, -1.0), BENCH, {}),
        (TYRE, Bench(mass=0.0), {}),
        (TYRE, Bench(preload_damping=-1.0), {}),
        (TYRE, BENCH, {"oversampling": 0}),
        (TYRE, BENCH, {"duration": 0.0}),
    ],
)
def test_rigs_without_a_settled_motion_are_refused(tyre, bench, options):
    with pytest.raises(ValueError, match="must be"):
        run(Cam(10.0), tyre, bench, **{"duration": 0.1, **options})
