"""Previews: what they show is what was recorded and fitted, and they stay small."""

import numpy as np
import pytest

from fourpole.core.demodulation.demodulate import demodulate

AMPLITUDES = np.array([60 * np.exp(1.5j), 0.06, 0.08 * np.exp(-0.3j)])


@pytest.mark.parametrize(("rate", "samples"), [(1000.0, 2000), (20e3, 40_000), (100.0, 64), (50.0, 18)])
def test_a_preview_shows_the_middle_of_the_record(record, rate, samples):
    rng = np.random.default_rng(0)
    noise = 0.01 * np.abs(AMPLITUDES)[:, None] * rng.standard_normal((3, samples))
    recording = record(AMPLITUDES, 10.3, rate=rate, samples=samples, extra=noise)
    found = demodulate(recording)
    shown = found.preview
    assert found.channels == ("force_in", "motion_in", "motion_out")
    assert shown.time.size <= 96
    assert shown.signals.shape == shown.fit.shape == (3, shown.time.size)
    assert np.diff(shown.time) == pytest.approx(shown.time[1] - shown.time[0])
    # three cycles, or as many as eight samples either way need
    assert np.ptp(shown.time) == pytest.approx(max(3 / 10.3, 16 / rate), abs=0.05 + 2 / rate)

    time = (np.arange(samples) - 0.5 * (samples - 1)) / rate
    at = np.argmin(np.abs(time[:, None] - shown.time), axis=0)
    for i, name in enumerate(found.channels):
        whole = recording.channels[name].samples
        np.testing.assert_allclose(shown.signals[i], (whole - whole.mean())[at], atol=1e-12 * np.abs(whole).max())
        # what the fit misses of the wave is the noise it follows: 24 parameters of it
        wave = (found.phasors.amplitudes[i] * np.exp(2j * np.pi * found.phasors.frequency * shown.time)).real
        off = shown.fit[i] - wave
        assert np.abs(off - off.mean()).max() < 0.06 * np.abs(AMPLITUDES[i])  # the mean of broken cycles is not 0


def test_the_residuals_extremes_are_in_their_blocks(record):
    # In noise of a 20th of its size a spike holds too little of the residual's energy to be left out.
    spike = np.array([[0.0], [5e-4], [1e-3]]) * np.random.default_rng(1).normal(size=(3, 2000))
    spike[1, 1234] = 0.01
    spike[2, 77] = -0.02
    shown = demodulate(record(AMPLITUDES, 10.3, extra=spike)).preview
    assert shown.blocks.shape == (120,)
    assert shown.residual.shape == (3, 120)
    assert (shown.residual[:, 0::2] <= shown.residual[:, 1::2]).all()
    # the fit takes about 30 of 2000 parts of a spike, more of them near the ends
    assert shown.residual[1].max() == pytest.approx(0.01, rel=0.1)
    assert shown.blocks[np.argmax(shown.residual[1])] == pytest.approx(1234 / 1000 - 0.9995, abs=0.017)
    assert shown.residual[2].min() == pytest.approx(-0.02, rel=0.15)
    assert shown.blocks[np.argmin(shown.residual[2])] == pytest.approx(77 / 1000 - 0.9995, abs=0.017)
    assert np.abs(shown.residual[0]).max() < 1e-9
