"""Linearity: harmonics of the motion are no fault; harmonics of the specimen, the rig and F1 are told apart."""

import numpy as np
import pytest

from fourpole.core.checks import Code
from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.recordingchecks import excess, judged_excess
from fourpole.core.rig import Rig

HERTZ, MASS, SPRING, DAMPER = 13.7, 15.0, 12440.0, 30.0
RIG = Rig(moving_mass=MASS, preload_stiffness=SPRING, preload_damping=DAMPER)
NUMBER = np.arange(1, 6)
JW = 2j * np.pi * HERTZ * NUMBER
ZR = JW * MASS + DAMPER + SPRING / JW
NOISE = np.array([0.4, 2e-4, 2e-4])


def stiffness(tau=0.004):
    """Zener body."""
    return 1e5 * (1 + 0.9 * JW * tau / (1 + JW * tau))


def amplitudes(motion, own=0.0, guide=0.0):
    """F1, V1, V2 (5, 3) for harmonics of the contact [m]; `own`, `guide`: forces of specimen and rig [N]."""
    k, z = stiffness(), JW * ZR
    x1 = np.zeros(5, complex)
    x1[: len(motion)] = motion
    # k (x1 - x2) + own = z x2 + guide
    x2 = (k * x1 + own - guide) / (k + z)
    return np.stack([k * (x1 - x2) + own, JW * x1, JW * x2], axis=1)


def third(share, force):
    return share * abs(force) * (NUMBER == 3) * np.exp(0.7j)


def verdicts(recording, rig=RIG):
    found = demodulate(recording)
    return {row.code: row.verdict for row in judged_excess(excess(found.harmonics, 2 * np.pi * HERTZ, rig, 0.0))}


@pytest.fixture
def recorded(record):
    def make(rows, seed=0):
        noise = np.random.default_rng(seed).normal(size=(rows.shape[1], 4000)) * NOISE[: rows.shape[1], None]
        return record(rows, HERTZ, samples=4000, extra=noise)

    return make


FORCE = abs(amplitudes([8e-4])[0, 0])
ALL_OK = {Code.LINEARITY: "ok", Code.RIG_LINEARITY: "ok"}


@pytest.mark.parametrize("motion", [[8e-4], [8e-4, 1e-5j, 4e-6], [8e-4, 1.6e-4, -8e-5j, 4e-5, 4e-5]])
def test_harmonics_of_the_cam_are_no_fault_of_a_linear_specimen_and_rig(recorded, motion):
    assert verdicts(recorded(amplitudes(motion))) == ALL_OK


@pytest.mark.parametrize(("share", "verdict"), [(0.01, "ok"), (0.06, "warning"), (0.33, "warning")])
def test_a_specimen_that_is_not_linear(recorded, share, verdict):
    rows = amplitudes([8e-4, 8e-6], own=third(share, FORCE))
    assert verdicts(recorded(rows)) == {Code.LINEARITY: verdict, Code.RIG_LINEARITY: "ok"}


def test_without_v2_the_rig_gives_its_motion(recorded):
    bent, clean = (amplitudes([8e-4, 8e-6], own=third(share, FORCE))[:, :2] for share in (0.2, 0.0))
    assert verdicts(recorded(bent)) == {Code.LINEARITY: "warning"}
    assert verdicts(recorded(clean)) == {Code.LINEARITY: "ok"}
    assert verdicts(recorded(bent), rig=None) == {}


def test_a_specimen_on_a_bench_with_blocked_output(recorded):
    """Dry friction: a third harmonic of 1/3 and a fifth of 1/5 on a motion with harmonics of 1 %."""
    bench = Rig(blocked=True)
    x1 = 5e-3 * np.array([1.0, 0.01, 0.008j, 0, 0])
    square = 400.0 * np.array([1, 0, 1 / 3, 0, 1 / 5])
    for k, force, verdict in ((stiffness(), 0.0, "ok"), (200 * JW, 0.0, "ok"), (200 * JW, square, "warning")):
        rows = np.stack([k * x1 + force, JW * x1], axis=1)
        assert verdicts(recorded(rows), bench) == {Code.LINEARITY: verdict}


@pytest.mark.parametrize(("newton", "verdict"), [(1.0, "ok"), (10.0, "warning")])
def test_friction_of_the_guide_is_the_rigs(recorded, newton, verdict):
    rows = amplitudes([8e-4, 8e-6], guide=newton * np.array([1, 0, 1 / 3, 0, 1 / 5]) * np.exp(0.4j * NUMBER))
    assert verdicts(recorded(rows)) == {Code.LINEARITY: "ok", Code.RIG_LINEARITY: verdict}


def test_harmonics_in_f1_alone_are_those_of_its_channel(recorded):
    rows = amplitudes([8e-4, 8e-6])
    rows[:, 0] += third(0.15, FORCE)
    assert verdicts(recorded(rows))[Code.FORCE_LINEARITY] == "warning"


def test_a_wrong_stiffness_of_the_rig_does_not_make_it_not_linear(recorded):
    """The cam's harmonics of 20 % against a rig that is stated with 13 % more mass."""
    rows = amplitudes([8e-4, 1.6e-4, 8e-5])
    assert verdicts(recorded(rows), Rig(moving_mass=17.0, preload_stiffness=12000.0)) == ALL_OK


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1 / 9.81, 1, 1], [1, 1, 1 / 9.81]])
def test_a_wrong_unit_or_sign_is_no_lack_of_linearity(recorded, scale):
    rows = amplitudes([8e-4, 8e-6, 3e-6]) * np.array(scale)
    assert verdicts(recorded(rows)) == {}


def test_a_harmonic_on_the_mains_is_not_used(record):
    """Hum of 20 % of the force at 50 Hz, the fifth harmonic of 10 Hz."""
    time = (np.arange(4000) - 1999.5) / 1000.0
    hum = np.stack([20 * np.sin(2 * np.pi * 50 * time), 0 * time])
    rows = np.array([[100.0, 0.06]])
    found = demodulate(record(rows, 10.0, samples=4000, extra=hum)).harmonics
    (check,) = judged_excess(excess(found, 2 * np.pi * 10.0, Rig(blocked=True), 0.0))
    assert check.verdict == "ok"


@pytest.mark.statistical
def test_noise_alone_is_never_a_harmonic(recorded):
    for seed in range(40):
        rows = amplitudes([2e-5])  # 6 N beside noise of 0.4 N, 2 mm/s beside 0.2 mm/s
        assert verdicts(recorded(rows, seed)) == ALL_OK


SLOW, STEP = 2j * np.pi * 1.0 * NUMBER, [1.0, 0.01, 0.05j, 0.004, 0.01]
BODIES = {
    "spring beside a damper": 1e5 + 1.5e4 * SLOW,
    "damper with a weak spring": 2e3 + 1.5e4 * SLOW,
    "spring behind a damper": 2e5 * SLOW * 0.1 / (1 + SLOW * 0.1),
    "rubber": 1e5 * SLOW**0.3,
    "Zener body": 1e5 * (1 + 3.0 * SLOW * 0.1 / (1 + SLOW * 0.1)),
}


def bench(record, force, motion, seed=0):
    """Checks of a slow test with blocked output, 20 cycles at 1 Hz."""
    rows = np.stack([force, SLOW * motion], axis=1)
    noise = np.random.default_rng(seed).normal(size=(2, 2000)) * np.array([[1e-3 * abs(force[0])], [1e-5]])
    found = demodulate(record(rows, 1.0, rate=100.0, samples=2000, extra=noise))
    return {row.code: row.verdict for row in judged_excess(excess(found.harmonics, 2 * np.pi, Rig(blocked=True), 0.0))}


@pytest.mark.parametrize("name", BODIES)
def test_a_linear_specimen_on_a_slow_bench_may_move_with_harmonics(record, name):
    motion = 8e-3 * np.array(STEP)
    assert bench(record, BODIES[name] * motion, motion) == {Code.LINEARITY: "ok"}


def test_a_friction_damper_is_not_linear_though_its_motion_has_harmonics_too(record):
    """A square wave of force, and a motion that its friction bends: 5 % of the third harmonic, as recordings have."""
    motion = 8e-3 * np.array([1.0, 0.0, 0.05, 0.0, 0.01])
    square = 500.0 * 1j * np.array([1.0, 0.0, 1 / 3, 0.0, 1 / 5])
    damper = 5e3 * SLOW * motion
    assert bench(record, square + damper, motion) == {Code.LINEARITY: "warning"}
