"""Recordings whose channels have times of their own, whose drive wanders, or that do not run from end to end."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.demodulation import wander as wander_room
from fourpole.core.demodulation.demodulate import demodulate, first_guess
from fourpole.core.demodulation.steady import steady_part
from fourpole.core.demodulation.wander import follow_wander
from fourpole.core.recording import Channel, Recording
from fourpole.core.reference import Reference

pytestmark = pytest.mark.thorough

F1, V1, V2 = AMPLITUDES = np.array([60 * np.exp(1.5j), 0.06 + 0j, 0.08 * np.exp(-0.3j)])
NAMES, KINDS = ("force_in", "motion_in", "motion_out"), ("force", "acceleration", "displacement")
POWER = {"force": 0, "acceleration": 1, "displacement": -1}


def channel(amplitude, kind, frequency, rate, start, seconds, noise=0.0, rng=None):
    time = start + np.arange(int(seconds * rate)) / rate
    factor = (2j * np.pi * frequency) ** POWER[kind]
    values = (amplitude * factor * np.exp(2j * np.pi * frequency * time)).real
    if noise:
        values = values + noise * abs(amplitude * factor) * rng.standard_normal(time.size)
    return Channel(values, kind, rate=rate, start=start)


@settings(max_examples=25)
@given(
    rates=st.tuples(*[st.sampled_from([137.3, 500.0, 1000.0, 4096.0])] * 3),
    starts=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    frequency=st.floats(6.0, 25.0),
)
def test_channels_at_different_rates_are_met_exactly(rates, starts, frequency):
    channels = {
        name: channel(a, kind, frequency, rate, start, 4.0)
        for name, a, kind, rate, start in zip(NAMES, AMPLITUDES, KINDS, rates, starts, strict=True)
    }
    found = demodulate(Recording(1.0, channels)).phasors
    ratios = found.amplitudes / found.amplitudes[1] / (AMPLITUDES / V1)
    np.testing.assert_allclose(ratios, np.ones(3), atol=1e-9)
    assert found.frequency == pytest.approx(frequency, abs=1e-8)


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_their_noise_is_as_large_as_stated():
    """Ratios of amplitudes from 60 records, each against its own uncertainty; common noise would show in V1/F1."""
    rng = np.random.default_rng(0)
    scores = []
    for _ in range(60):
        channels = {
            name: channel(a, kind, 11.3, rate, start, 4.0, 0.01, rng)
            for name, a, kind, rate, start in zip(
                NAMES, AMPLITUDES, KINDS, (5000.0, 1000.0, 211.0), (0.02, 0.0, -0.3), strict=True
            )
        }
        found = demodulate(Recording(1.0, channels)).phasors
        for over in (0, 2):
            ratio = found.amplitudes[over] / found.amplitudes[1] / (AMPLITUDES[over] / V1) - 1
            turned = [1 / found.amplitudes[i] for i in range(3)]
            row = np.zeros(6)
            row[2 * over], row[2 * over + 1] = turned[over].real, -turned[over].imag
            row[2], row[3] = -turned[1].real, turned[1].imag
            scores.append(ratio.real / np.sqrt(row @ found.covariance @ row))
    # 3.3 standard deviations of the rms of as many numbers; each u itself is known to 1/sqrt(2·60), which adds 2 %
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.02, abs=3.3 / np.sqrt(2 * len(scores)))


def wandering(depth, period, seconds=10.0, rate=1000.0, noise=0.0):
    """F1 follows the drive through a known, curved response, with the lag that has; V1 and V2 are its cam's."""
    time = np.arange(int(seconds * rate)) / rate
    slow = 2 * np.pi / period
    mean = 2 * np.pi * 12.0
    phase = mean * (time + depth / slow * np.sin(slow * time + 0.4))
    off = depth * np.cos(slow * time + 0.4)
    change = -depth * slow * np.sin(slow * time + 0.4)
    # (1 + 3 D + 20 D²) applied to the drive, D = -j d/dt / w0 - 1: what a resonance does to a wandering drive
    response = F1 * (1 + 3 * off + 20 * (off**2 - 1j * change / mean))
    turning = np.exp(1j * phase)
    rng = np.random.default_rng(0)
    rows = [(response * turning).real, (V1 * turning).real, (V2 * turning).real]
    channels = {
        name: Channel(row + noise * np.std(row) * rng.standard_normal(row.size), kind)
        for name, row, kind in zip(NAMES, rows, ("force", "velocity", "velocity"), strict=True)
    }
    knots = np.arange(0.0, seconds, 1 / 12.0)
    return Recording(rate, channels), Reference(knots, np.interp(knots, time, phase))


def response_at(omega):
    """F1/V1 at a steady speed, the mean of a stretch being no whole number of periods."""
    off = omega / (2 * np.pi * 12.0) - 1
    return F1 * (1 + 3 * off + 20 * off**2) / V1


@pytest.mark.parametrize(("depth", "period"), [(0.01, 7.3), (0.01, 3.1), (0.003, 5.0)])
@pytest.mark.sampled(3)
def test_along_a_reference_amplitudes_are_those_at_the_mean_speed(depth, period):
    recording, reference = wandering(depth, period)
    found = demodulate(replace(recording, reference=reference)).phasors
    mean = reference.omega(*replace(recording, reference=reference).span)
    assert found.omega == pytest.approx(mean, rel=1e-12)
    assert found.amplitudes[0] / found.amplitudes[1] == pytest.approx(response_at(mean), rel=3e-5)
    assert found.frequency_std == 0


def test_along_the_phase_of_v1_it_is_nearly_as_good():
    recording, _ = wandering(0.01, 7.3, noise=1e-3)
    steady = demodulate(recording)
    followed, wander = follow_wander(recording, steady)
    assert wander.speed == pytest.approx(0.01, rel=0.25)  # about the mean of what is not a whole period
    wrong, right = (
        f.phasors.amplitudes[0] / f.phasors.amplitudes[1] / response_at(f.phasors.omega) - 1 for f in (steady, followed)
    )
    assert abs(right) < 0.1 * abs(wrong)
    assert abs(right) < 3e-4


@pytest.mark.parametrize("period", [7.3, 9.1])
@pytest.mark.sampled(2)
def test_the_look_at_one_envelope_drops_no_drive_that_would_be_followed(monkeypatch, period):
    followed = []
    for depth in np.geomspace(3e-4, 2e-2, 8):  # with this noise, from no drive that is followed to one that clearly is
        recording, _ = wandering(depth, period, noise=0.05)
        found = demodulate(recording)
        looked = follow_wander(recording, found)
        with monkeypatch.context() as patch:
            patch.setattr(wander_room, "_may_wander", lambda *given: True)
            followed.append(follow_wander(recording, found) is not None)
        assert (looked is not None) == followed[-1]
    assert not followed[0]
    assert followed[-1]


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.05])
def test_a_steady_drive_is_left_alone(noise):
    recording, _ = wandering(0.0, 7.3, noise=noise)
    assert follow_wander(recording, demodulate(recording)) is None


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize(("before", "after"), [(0.0, 0.0), (2.0, 0.0), (0.0, 3.0), (4.0, 4.0)])
def test_the_steady_part_is_what_runs(before, after, noise):
    """Silence before and after 8 s at 12 Hz."""
    rng = np.random.default_rng(1)
    seconds = before + 8.0 + after
    channels = {}
    for name, amplitude in zip(NAMES, AMPLITUDES, strict=True):
        time = np.arange(int(seconds * 1000)) / 1000.0
        runs = (time >= before) & (time <= before + 8.0)
        values = np.where(runs, (amplitude * np.exp(2j * np.pi * 12 * time)).real, 0.0)
        values += noise * abs(amplitude) * rng.standard_normal(time.size)
        channels[name] = Channel(values, "force" if name == "force_in" else "velocity")
    recording = Recording(1000.0, channels)
    part = steady_part(recording, first_guess(recording))
    if before == after == 0:
        assert part is None
        return
    first, last = part
    hop = 2 / 12.0
    assert first == pytest.approx(before + 2 * hop * (before > 0), abs=3 * hop)
    assert last == pytest.approx(before + 8.0 - 2 * hop * (after > 0), abs=3 * hop)
    assert first >= before - 1e-3
    assert last <= before + 8.0 + 1e-3


def test_between_keeps_the_samples_of_a_stretch():
    recording = Recording.from_arrays(np.arange(1000) / 100.0, force_in=np.arange(1000.0), motion_in=np.arange(1000.0))
    part = recording.between(2.0, 3.0)
    assert part.channels["force_in"].samples.tolist() == list(range(200, 301))
    assert part.channels["force_in"].start == pytest.approx(2.0, abs=1e-12)
    assert part.span == pytest.approx((1.995, 3.005))


@pytest.mark.parametrize(("before", "after"), [(2.0, 0.0), (0.0, 2.0), (1.3, 1.7), (0.0, 0.0)])
@pytest.mark.parametrize("fading", [0.0, 0.025])
def test_a_short_recording_is_cut_where_the_drive_rests(before, after, fading):
    """Ten cycles at 1 Hz between rests, of an amplitude that may fade: too few for an envelope."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, before + 10.0 + after, 0.01)
    runs = (time >= before) & (time < before + 10.0)
    since = np.where(runs, time - before, 0.0)
    size = np.where(runs, 1.0 - fading * since, 0.0)
    motion = 8e-3 * size * np.sin(2 * np.pi * since) + 1e-5 * rng.standard_normal(time.size)
    force = 500.0 * size * np.cos(2 * np.pi * since) + rng.standard_normal(time.size)
    recording = Recording(100.0, {"force_in": Channel(force, "force"), "motion_in": Channel(motion, "displacement")})
    part = steady_part(recording, 1.0)
    if not before and not after:
        assert part is None
        return
    assert part is not None
    low, high = recording.span
    start, end = part[0] - low, part[1] - low
    # A half cycle in which the drive starts or stops counts as moving; one cycle follows for the start.
    assert start == 0.0 if not before else before + 0.4 <= start <= before + 1.1
    assert end == pytest.approx(high - low) if not after else before + 10.0 - 0.1 <= end <= before + 10.5


def test_a_wander_that_shows_in_the_harmonics_of_an_acceleration_is_followed():
    """The fourth, sixth and tenth harmonic turn so far that the fundamental has a small share of what wanders."""
    rate, frequency, samples = 1000.0, 24.0, 5000
    time = np.arange(samples) / rate
    turn = 2 * np.pi * frequency * time + 0.11 * np.sin(2 * np.pi * 0.4 * time)
    shape = sum(np.cos(n * turn + n) for n in (1, 4, 6, 10))
    noise = 3e-4 * np.random.default_rng(46).standard_normal((3, samples))
    f1, v1, v2 = shape + noise
    recording = Recording.from_arrays(time, force_in=60 * f1, motion_in=v1, motion_out=0.8 * v2, motion="acceleration")
    assert follow_wander(recording, demodulate(recording)) is not None
