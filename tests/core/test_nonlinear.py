"""Random excitation: distortion by a specimen is told from the noise of the sensors, with a simulator of its own."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.checks import Code
from fourpole.core.recording import Channel, Recording
from fourpole.core.spectra.checks import NONLINEAR, check_line, check_linearity
from fourpole.core.spectra.nonlinear import nonlinear_share
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.words import said

RATE, BAND, STEP = 600.0, (4.0, 100.0), 1e-3


def random_motion(rng, seconds=20.0):
    """Displacement [m] of 1 mm, cut out of Gaussian noise whose spectrum falls with the square of the frequency."""
    frequency = np.fft.rfftfreq(int(2 * seconds * RATE), 1 / RATE)
    spectrum = rng.normal(size=(2, frequency.size)) * (frequency > 3) * (frequency < 120) / (1 + frequency / 20) ** 2
    motion = np.fft.irfft(spectrum[0] + 1j * spectrum[1])[: int(seconds * RATE)]
    return STEP * motion / motion.std()


def through(motion, stiffness):
    """Force of a linear specimen, through its spectrum."""
    omega = 2 * np.pi * np.fft.rfftfreq(motion.size, 1 / RATE)
    return np.fft.irfft(stiffness(np.maximum(omega, 1e-9)) * np.fft.rfft(motion), motion.size)


def slipping(motion, travel):
    """Deflection of a spring behind a dry friction that slips beyond a travel."""
    slid, deflection = 0.0, np.empty_like(motion)
    for at, x in enumerate(motion):
        slid = min(max(slid, x - travel), x + travel)
        deflection[at] = x - slid
    return deflection


def bouc_wen(motion, travel):
    z, hysteresis = 0.0, np.empty_like(motion)
    for at, step in enumerate(np.repeat(np.diff(motion, prepend=motion[0]) / 4, 4)):
        z += step - 0.5 * (abs(step) * abs(z) * z + step * z * z) / travel**2
        hysteresis[at // 4] = z
    return hysteresis


LINEAR = {
    "Kelvin-Voigt": lambda omega: 1.2e5 + 300j * omega,
    "Maxwell": lambda omega: 4e4 + 8e4 * 0.01j * omega / (1 + 0.01j * omega),
    "fractional": lambda omega: 8e4 + 3e4 * (1j * omega / 50) ** 0.4,
}
BENT = {
    "cubic spring": lambda x, v: 1e5 * x * (1 + 0.05 * (x / STEP) ** 2) + 200 * v,
    "Coulomb": lambda x, v: 1e5 * x + 200 * v + 30 * np.sign(v),
    "MR damper": lambda x, v: 2e3 * x + 400 * v + 150 * np.tanh((v + 8 * x) / (0.15 * v.std())),
    "Bouc-Wen": lambda x, v: 6e4 * x + 8e4 * bouc_wen(x, 0.5 * STEP) + 100 * v,
    "stick-slip": lambda x, v: 4e4 * x + 1e5 * slipping(x, 0.6 * STEP) + 100 * v,
    "gap": lambda x, v: 1e5 * x + 5e4 * np.maximum(x - 0.7 * STEP, 0) + 200 * v,
}


def noisy(rng, signal, coherence, slope=0.0):
    """The signal with noise by which two channels have a coherence, and whose spectrum is a power of the frequency."""
    frequency = np.fft.rfftfreq(signal.size)
    spectrum = rng.normal(size=(2, frequency.size)) / np.maximum(frequency, 0.003) ** slope
    noise = np.fft.irfft(spectrum[0] + 1j * spectrum[1], signal.size)
    return signal + np.sqrt(1 / np.sqrt(coherence) - 1) * signal.std() / noise.std() * noise


def measured(*signals, find=random_amplitudes, motion="displacement"):
    recording = Recording.from_arrays(
        np.arange(signals[0].size) / RATE,
        **dict(zip(("force_in", "motion_in", "motion_out"), signals, strict=False)),
        motion=motion,
    )
    lines = find(recording, BAND)
    return nonlinear_share(recording, BAND, lines), lines


@pytest.mark.parametrize("name", BENT)
def test_a_specimen_that_is_not_linear_is_found_below_noise(name):
    """At a coherence of 0.9 by the noise of the sensors."""
    rng = np.random.default_rng(1)
    motion = random_motion(rng)
    force = BENT[name](motion, np.gradient(motion) * RATE)
    share, _ = measured(noisy(rng, force, 0.9), noisy(rng, motion, 0.9, slope=0.5))
    assert NONLINEAR < share < 0.5


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", LINEAR)
def test_noise_of_the_sensors_is_no_fault_of_a_linear_specimen(name):
    rng, told = np.random.default_rng(2), 0
    for coherence in (0.7, 0.85, 0.99):
        for slope in (0.0, 0.5):
            motion = random_motion(rng)
            force = through(motion, LINEAR[name])
            hum = 0.2 * np.sin(2 * np.pi * 50.01 * np.arange(motion.size) / RATE)
            drift = 5.0 * np.linspace(-1, 1, motion.size)
            signals = (force + force.std() * (hum + drift), motion + motion.std() * hum)
            told += measured(*(noisy(rng, one, coherence, slope) for one in signals))[0] > NONLINEAR
    assert told == 0


@pytest.mark.parametrize("kind", ["bursts", "clipped", "heavy tails", "levels"])
def test_a_motion_that_is_not_gaussian_is_no_fault_of_a_linear_specimen(kind):
    """The noise of V1 is in the functions of the motion too, and correlates with their error."""
    rng = np.random.default_rng(3)
    motion = random_motion(rng)
    time = np.arange(motion.size) / RATE
    motion = {
        "bursts": motion * (time % 2 < 1.4),
        "clipped": np.clip(motion, -1.2 * STEP, 1.2 * STEP),
        "heavy tails": motion * np.sqrt(np.abs(motion) / STEP),
        "levels": motion * np.exp(0.6 * np.sin(time)),
    }[kind]
    force = through(motion, LINEAR["Kelvin-Voigt"])
    share, _ = measured(noisy(rng, force, 0.8, 0.5), noisy(rng, motion, 0.8, 0.5))
    assert not share > NONLINEAR


def on_rig(law, seconds=20.0, fine=4):
    """F1, V1 and V2 of a specimen below a mass of 15 kg on a spring, by steps in time."""
    rng = np.random.default_rng(4)
    motion = np.fft.irfft(np.fft.rfft(random_motion(rng, seconds)), int(seconds * RATE * fine)) * fine
    step, x2, v2, rows = 1 / (RATE * fine), 0.0, 0.0, []
    for x1, v1 in zip(motion.tolist(), np.gradient(motion, step).tolist(), strict=True):
        force = float(law(x1 - x2, v1 - v2))
        rows.append((force, v1, v2))
        v2 += step * (force - 12440.0 * x2 - 40.0 * v2) / 15.0
        x2 += step * v2
    signals = np.array(rows)[::fine].T
    return [noisy(rng, one, 0.9) for one in signals]


@pytest.mark.parametrize(("newton", "bent"), [(0.0, False), (60.0, True)])
def test_a_specimen_on_a_rig_with_three_channels(newton, bent):
    share, lines = measured(*on_rig(lambda x, v: 1e5 * x + 200 * v + newton * np.tanh(v / 0.004)), motion="velocity")
    assert bool(share > NONLINEAR) is bent
    checks = list(check_linearity(replace(lines, nonlinear=share)))
    assert [(check.code, str(check.verdict)) for check in checks] == [(Code.LINEARITY, "warning" if bent else "ok")]


@pytest.mark.parametrize("cubic", [0.0, 0.4])
def test_a_sweep(cubic):
    time = np.arange(int(30 * RATE)) / RATE
    motion = STEP * np.sin(2 * np.pi * (4.0 * time + 1.6 * time**2)) / (1 + time / 10)
    rng = np.random.default_rng(5)
    force = 1e5 * motion * (1 + cubic * (motion / STEP) ** 2) + 200 * np.gradient(motion) * RATE
    share, _ = measured(noisy(rng, force, 0.98), noisy(rng, motion, 0.98), find=sweep_amplitudes)
    assert bool(share > NONLINEAR) is bool(cubic)


def test_a_longer_recording_is_no_remedy_for_distortion():
    rng = np.random.default_rng(6)
    motion = random_motion(rng)
    force = BENT["MR damper"](motion, np.gradient(motion) * RATE)
    share, lines = measured(force + 0.5 * force.std() * rng.normal(size=force.size), motion)
    bent = replace(lines, nonlinear=share)
    worst = int(np.nanargmax(lines.relative[:, 0]))
    assert "record longer" in said(check_line(lines, worst)).remedy
    assert "record longer" not in said(check_line(bent, worst)).remedy
    (check,) = check_linearity(bent)
    assert said(check).cause.startswith("the specimen is not linear: distortion of at least -1")


@pytest.mark.parametrize(("missing", "judged"), [(slice(2000, 2010), True), (slice(0, None, 1000), False)])
def test_a_recording_with_missing_samples_is_judged_by_its_longest_part(missing, judged):
    rng = np.random.default_rng(7)
    motion = random_motion(rng)
    force = BENT["cubic spring"](motion, np.gradient(motion) * RATE)
    force[missing] = np.nan
    channels = {"force_in": Channel(force, "force"), "motion_in": Channel(motion, "displacement")}
    recording = Recording(RATE, channels)
    share = nonlinear_share(recording, BAND, random_amplitudes(recording, BAND))
    assert share > NONLINEAR if judged else np.isnan(share)


@pytest.mark.parametrize("bent", [False, True])
def test_distortion_of_a_motion_that_repeats_is_in_the_uncertainty(bent):
    """It repeats too, so that the averages of all periods do not show it."""
    rng, period, times = np.random.default_rng(8), 4.0, 12
    frequency = np.fft.rfftfreq(int(period * RATE), 1 / RATE)
    sines = np.exp(2j * np.pi * rng.random(frequency.size)) * (frequency > 3) * (frequency < 120) / (1 + frequency / 20)
    motion = np.tile(np.fft.irfft(sines), times)
    motion *= STEP / motion.std()
    law = BENT["MR damper"] if bent else lambda x, v: 2e4 * x + 400 * v
    force = law(motion, np.gradient(motion) * RATE)
    share, lines = measured(noisy(rng, force, 0.95), noisy(rng, motion, 0.95, 0.5))
    assert lines.period == pytest.approx(period)
    assert bool(share > NONLINEAR) is bent
    wider = lines.with_distortion(share)
    added = wider.relative[:, 0] ** 2 - lines.relative[:, 0] ** 2
    np.testing.assert_allclose(added, share**2 / 2, atol=1e-12)
    of_force = wider.phasors.covariance[:, 0, 0] - lines.phasors.covariance[:, 0, 0]
    np.testing.assert_allclose(of_force, share**2 / 2 * np.abs(lines.phasors.amplitudes[:, 0]) ** 2, rtol=1e-9)
