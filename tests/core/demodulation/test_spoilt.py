"""Drop-outs and spikes are left out of the fit; noise, hum, clipping, a wander and the kinks of friction are not."""

import numpy as np
import pytest

from fourpole.core.demodulation.demodulate import demodulate

HERTZ, COUNT = 16.3, 4000
TRUE = np.array([250.0, 0.08 * np.exp(0.4j), 0.17 * np.exp(-1.2j)])
NOISE = np.array([0.4, 2e-4, 2e-4])
TIME = (np.arange(COUNT) - 0.5 * (COUNT - 1)) / 1000.0


@pytest.fixture
def samples(record):
    def make(seed=0):
        rng = np.random.default_rng(seed)
        return record(TRUE, HERTZ, samples=COUNT, extra=NOISE[:, None] * rng.normal(size=(3, COUNT))), rng

    return make


def off(found):
    return np.abs(found.phasors.amplitudes / TRUE - 1.0)


def drop(row, share, rng, value=lambda row, at: 0.0):
    """Runs of 5 to 40 samples at one value, until a share of the samples has it; the share that has."""
    gone = np.zeros(COUNT, dtype=bool)
    while gone.mean() < share:
        at, size = int(rng.integers(COUNT)), int(rng.integers(5, 40))
        row[at : at + size] = value(row, at)
        gone[at : at + size] = True
    return gone.mean()


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("share", [0.01, 0.12])
@pytest.mark.parametrize("held", [False, True])
def test_drop_outs_are_left_out(samples, channel, share, held):
    recording, rng = samples()
    rows = list(recording.channels.values())
    gone = drop(rows[channel].samples, share, rng, (lambda row, at: row[at]) if held else (lambda row, at: 0.0))
    found = demodulate(recording)
    assert found.spoilt[channel] == pytest.approx(gone, rel=0.15)  # a held sample near a crest is no drop-out
    assert np.delete(found.spoilt, channel).max() == 0.0
    assert found.missing == 0.0
    # The amplitude of a sine in white noise has the relative standard uncertainty noise/amplitude sqrt(2/N).
    assert np.all(off(found) < 6 * NOISE / np.abs(TRUE) * np.sqrt(2 / COUNT))


@pytest.mark.parametrize("times", [0.1, 1.0, 50.0])
def test_spikes_are_left_out(samples, times):
    recording, rng = samples()
    force = recording.channels["force_in"].samples
    at = rng.choice(COUNT, 20, replace=False)
    force[at] += times * 250.0 * rng.choice([-1, 1], 20)
    found = demodulate(recording)
    assert found.spoilt.tolist() == [20 / COUNT, 0.0, 0.0]
    assert np.all(off(found) < 6 * NOISE / np.abs(TRUE) * np.sqrt(2 / COUNT))


def test_a_tenth_of_the_samples_each_in_another_channel(samples):
    """No single fit shows which samples are good where more than 20 % are spoilt: nothing is left out."""
    recording, rng = samples()
    for channel in recording.channels.values():
        drop(channel.samples, 0.15, rng)
    assert demodulate(recording).spoilt.max() == 0.0


def kinked(recording):
    """A friction force: square, with 10 harmonics fitted the rest has a peak at each reversal."""
    force = recording.channels["force_in"].samples
    force += 100 * np.sign(np.cos(2 * np.pi * HERTZ * TIME))


def hummed(recording):
    force = recording.channels["force_in"].samples
    force += 100 * np.sin(2 * np.pi * 50 * TIME)


def clipped(recording):
    row = recording.channels["motion_out"].samples
    np.clip(row, -0.12, 0.12, out=row)


def wandering(recording):
    for row, amplitude in zip(recording.channels.values(), TRUE, strict=True):
        row.samples[:] = (amplitude * np.exp(2j * np.pi * HERTZ * TIME + 1j * np.sin(2 * TIME))).real


def coarse(recording):
    """Eight levels."""
    row = recording.channels["motion_out"].samples
    row[:] = np.round(row / 0.04) * 0.04


def plain(recording):
    pass


@pytest.mark.parametrize("change", [plain, kinked, hummed, clipped, wandering, coarse])
def test_what_belongs_to_the_signal_stays(samples, change):
    for seed in range(3):
        recording, _ = samples(seed)
        change(recording)
        assert demodulate(recording).spoilt.max() == 0.0
