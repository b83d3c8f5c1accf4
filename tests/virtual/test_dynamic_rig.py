"""The dynamic rig against other roads to the same motion: transfer functions, an ODE solver, the energy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.integrate import solve_ivp

from fourpole.virtual import Bench, Cam, Conditions, Laboratory, Zener, run, run_block, simulate_phasors, state_matrices

pytestmark = pytest.mark.thorough

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


@pytest.mark.parametrize(
    ("tyre", "bench", "options"),
    [
        (Zener(1e5, 0.0, 1e3), BENCH, {}),
        (Zener(1e5, 1e5, -1.0), BENCH, {}),
        (TYRE, Bench(mass=0.0), {}),
        (TYRE, Bench(preload_damping=-1.0), {}),
        (TYRE, Bench(leaf_friction=-1.0), {}),
        (TYRE, Bench(frame_stiffness=0.0), {}),
        (TYRE, BENCH, {"oversampling": 0}),
        (TYRE, BENCH, {"duration": 0.0}),
    ],
)
def test_rigs_without_a_settled_motion_are_refused(tyre, bench, options):
    with pytest.raises(ValueError, match="must be"):
        run(Cam(10.0), tyre, bench, **{"duration": 0.1, **options})


PARTS = {
    "tyre mass": {"tyre_mass": 0.8},
    "frame": {"frame_stiffness": 4e5},
    "stiff frame": {"frame_stiffness": 4e7},
    "frame without damper": {"frame_stiffness": 4e6, "preload_damping": 0.0},
    "loss factor": {"preload_loss_factor": 0.03},
    "input mass": {"input_mass": 0.5},
    "all": {"tyre_mass": 0.8, "frame_stiffness": 4e6, "preload_loss_factor": 0.03, "input_mass": 0.5},
}


def lines(motion, frequency):
    """Complex amplitudes of F1, V1, V2 at the cam's frequency, odd harmonics of friction fitted beside it."""
    turns = [np.exp(2j * np.pi * frequency * order * motion.time) for order in (1, 3, 5, 7)]
    columns = np.stack([part for turn in turns for part in (turn.real, -turn.imag)], axis=1)
    found, *_ = np.linalg.lstsq(columns, np.stack([motion.force, motion.v1, motion.v2], axis=1), rcond=None)
    return found[0] + 1j * found[1]


def in_frequency(tyre, bench, frequency, **options):
    """F1, V1, V2 of the same rig by the equations of motion at one frequency."""
    names = ("preload_stiffness", "preload_damping", "preload_loss_factor", "tyre_mass", "frame_stiffness")
    stated = {name: (getattr(bench, name), 0.0) for name in (*names, "input_mass")}
    laboratory = Laboratory(
        moving_mass=(bench.mass, 0.0), **stated, undeclared={"leaf_friction": bench.leaf_friction}, std_added=0.0
    )
    tests = Conditions(frequency, k1=tyre.k1, k2=tyre.k2, c=tyre.c, **options)
    return simulate_phasors(laboratory, tests, np.random.default_rng(0)).true_amplitudes[0]


@pytest.mark.parametrize("parts", PARTS.values(), ids=PARTS)
@pytest.mark.parametrize("frequency", [10.0, 24.0])
def test_every_part_moves_as_in_the_frequency_domain(parts, frequency):
    bench = Bench(**{"preload_damping": 15.0, **parts})
    motion = run(Cam(frequency), TYRE, bench, duration=1.0, oversampling=10)
    expected = in_frequency(TYRE, bench, frequency)
    found = lines(motion, frequency) * expected[1] / lines(motion, frequency)[1]
    np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.parametrize("parts", PARTS.values(), ids=PARTS)
def test_rigid_block_moves_as_in_the_frequency_domain(parts):
    bench = Bench(**{"preload_damping": 15.0, **parts})
    motion = run_block(Cam(24.0), bench, duration=1.0, oversampling=10)
    np.testing.assert_array_equal(motion.v1, motion.v2)
    expected = in_frequency(TYRE, bench, 24.0, calibration=True)
    found = lines(motion, 24.0) * expected[1] / lines(motion, 24.0)[1]
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_input_mass_adds_its_inertia_on_a_worn_cam():
    cam = Cam(17.0, **WORN)
    light, heavy = (run(cam, TYRE, Bench(input_mass=m), duration=0.5) for m in (0.0, 0.5))
    h = 1e-6
    acceleration = (cam.motion(heavy.time + h)[1] - cam.motion(heavy.time - h)[1]) / (2.0 * h)
    np.testing.assert_allclose(heavy.force - light.force, 0.5 * acceleration, atol=1e-7 * abs(acceleration).max())
    np.testing.assert_array_equal(heavy.x2, light.x2)


@pytest.mark.parametrize("friction", [1.0, 10.0, 60.0])
@pytest.mark.parametrize("frequency", [10.0, 24.0])
@pytest.mark.parametrize("frame", [np.inf, 4e6])
@pytest.mark.sampled(2)
def test_friction_is_near_its_describing_function(friction, frequency, frame):
    bench = Bench(preload_damping=15.0, frame_stiffness=frame, leaf_friction=friction)
    motion = run(Cam(frequency), TYRE, bench, duration=1.0)
    found, expected = lines(motion, frequency), in_frequency(TYRE, bench, frequency)
    without = in_frequency(TYRE, Bench(preload_damping=15.0, frame_stiffness=frame), frequency)
    found *= expected[1] / found[1]
    # the smoothed sign leaves out 0.5 % of what friction does, the harmonics a part that grows with the friction
    effect = abs(expected[2] - without[2])
    limit = 5e-3 + effect / abs(without[2])
    assert abs(found[2] - expected[2]) < limit * effect
    rubbing = found[0] / found[2] - without[0] / without[2]
    assert rubbing == pytest.approx(4.0 * friction / (np.pi * abs(found[2])), rel=limit)


def test_friction_solves_the_equation_of_motion():
    cam, friction = Cam(16.0, **WORN), 30.0
    bench = Bench(preload_damping=15.0, leaf_friction=friction)
    motion = run(cam, TYRE, bench, duration=0.5, guard=0, oversampling=40)
    step = motion.time[1] - motion.time[0]
    slope = (motion.v2[2:] - motion.v2[:-2]) / (2.0 * step)
    pull = motion.force - 12440.0 * motion.x2 - 15.0 * motion.v2
    rubbing = (pull[1:-1] - 15.0 * slope) / friction
    v2 = motion.v2[1:-1]
    peak = abs(v2).max()
    assert abs(rubbing - np.sign(v2))[abs(v2) > 0.2 * peak].max() < 2e-3
    assert abs(rubbing).max() < 1.002


def test_power_put_in_is_lost_in_the_dampers_and_in_the_friction():
    bench = Bench(preload_damping=15.0, leaf_friction=20.0)
    motion = run(Cam(20.0), TYRE, bench, duration=1.001, guard=0)
    arm = motion.force - TYRE.k1 * (motion.x1 - motion.x2)
    put_in = np.mean((motion.force * motion.v1)[:-1])
    lost = np.mean((arm**2 / TYRE.c + 15.0 * motion.v2**2 + 20.0 * abs(motion.v2))[:-1])
    # the smoothed sign loses pi^2/24 (v_s/V)^2 = 0.1 % of the friction's power less
    assert lost == pytest.approx(put_in, rel=2e-3)


def test_start_is_forgotten_with_friction():
    motion = run(Cam(16.0), TYRE, Bench(leaf_friction=60.0), duration=2.0, guard=0)
    turn = round(1000 * 5 / 16.0 * 2)
    late = motion.x2[8 * turn :]
    np.testing.assert_allclose(motion.x2[: late.size], late, atol=1e-9 * abs(late).max())


def test_loss_factor_needs_a_frequency():
    with pytest.raises(ValueError, match="by a damper"):
        state_matrices(TYRE, Bench(preload_loss_factor=0.01))
