"""The least-squares fit of sines: exact on what it models, whatever the record's length, and where it stands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.demodulation.sinefit import fit_sines, refine
from fourpole.core.demodulation.tracks import Track

RATE = 500.0
pytestmark = pytest.mark.usefixtures("filling_of")


def times(samples):
    return (np.arange(samples) - 0.5 * (samples - 1)) / RATE


def track(signals, present, time):
    return Track(("motion_in",) * len(signals), signals, present, time, 1 / (time[1] - time[0]))


def everything(samples):
    return np.ones(samples, dtype=bool)


def wave(time, omega, amplitudes):
    return sum((a * np.exp(1j * k * omega * time)).real for k, a in enumerate(amplitudes, start=1))


@given(samples=st.integers(200, 900), frequency=st.floats(8.0, 40.0), seed=st.integers(0, 1000))
@settings(max_examples=50)
def test_harmonics_lines_and_drift_do_not_leak_into_one_another(samples, frequency, seed):
    rng = np.random.default_rng(seed)
    time, omega = times(samples), 2 * np.pi * frequency
    truth = rng.standard_normal((2, 3)) + 1j * rng.standard_normal((2, 3))
    line = 2 * np.pi * 3.7 * frequency  # between the third and the fourth harmonic, 4 bins and more off
    place = time / time[-1]
    drift = rng.standard_normal((2, 4)) @ np.stack([place**k for k in range(4)])
    signals = np.stack([wave(time, omega, row) for row in truth]) + np.cos(line * time + 0.3) + drift
    fit = fit_sines(track(signals, everything(samples), time), omega, 3, np.array([line]))
    # the Gram matrix of eleven nearly orthogonal columns is well conditioned: a few hundred round-offs
    np.testing.assert_allclose(fit.amplitudes(), truth, atol=1e-12)
    assert np.abs(fit.residual).max() < 1e-12
    assert fit.dof == samples - (2 * 3 + 2 + 4)


def test_variance_of_an_amplitude_is_two_over_the_samples():
    """For whole cycles; of Re and of Im alike, per unit variance of the samples."""
    time = times(1000)
    fit = fit_sines(track(np.zeros((1, 1000)), everything(1000), time), 2 * np.pi * 20.0, 2, np.empty(0))
    # the cubic drift correlates with 40 cycles by about 1/(pi 40), squared
    assert fit.amplitude_variance() == pytest.approx(2 / 1000, rel=2e-3)


def test_scatter_of_amplitudes_is_as_stated():
    rng = np.random.default_rng(2)
    samples, time, omega = 130, times(130), 2 * np.pi * 13.0  # 3.4 cycles
    noise = rng.standard_normal((4000, samples))
    fit = fit_sines(track(noise, everything(samples), time), omega, 2, np.empty(0))
    found = fit.amplitudes()[:, 0]
    # both parts of 4000 amplitudes: the mean square is known to sqrt(2/8000) = 1.6 %, five of these; and the variance
    # is the mean of both parts', which differ in such a short record
    assert np.mean(np.abs(found) ** 2) / 2 == pytest.approx(fit.amplitude_variance(), rel=0.08)


def test_missing_samples_change_nothing_in_a_clean_signal():
    rng = np.random.default_rng(3)
    time, omega = times(600), 2 * np.pi * 11.3
    present = rng.random(600) > 0.15
    present[100:160] = False
    truth = np.array([1.0 - 0.5j, 0.1j])
    signal = np.where(present, wave(time, omega, truth) + 0.5 + time, 0.0)[None]
    fit = fit_sines(track(signal, present, time), omega, 2, np.empty(0))
    np.testing.assert_allclose(fit.amplitudes()[0], truth, atol=1e-12)
    assert not fit.residual[:, ~present].any()
    assert fit.dof == present.sum() - 8


@pytest.mark.parametrize("off", [-0.45, -0.1, 0.2, 0.45])
def test_refine_finds_the_frequency_from_within_half_a_bin(off):
    samples = 800
    time, bin_ = times(samples), 2 * np.pi * RATE / samples
    omega = 2 * np.pi * 12.34
    truth = np.array([[1.0 + 1.0j, 0.2], [0.5j, 0.0]])
    signals = np.stack([wave(time, omega, row) for row in truth])
    start = fit_sines(track(signals, everything(samples), time), omega + off * bin_, 2, np.empty(0))
    (fit,), _ = refine([start], informing=[np.ones(2, dtype=bool)])
    assert fit.omega == pytest.approx(omega, rel=1e-12)
    np.testing.assert_allclose(fit.amplitudes(), truth, atol=1e-10)


def test_a_frequency_that_is_given_stays_and_lines_still_move():
    samples = 800
    time, omega, line = times(samples), 2 * np.pi * 12.0, 2 * np.pi * 50.0
    signals = (wave(time, omega, [1.0]) + 0.3 * np.cos(line * time))[None]
    start = fit_sines(track(signals, everything(samples), time), omega, 1, np.array([line + 1.0]))
    (fit,), std = refine([start], informing=[np.ones(1, dtype=bool)], free=False)
    assert fit.omega == omega
    assert std == 0.0
    assert fit.lines[0] == pytest.approx(line, rel=1e-10)


def test_a_harmonic_that_does_not_inform_leaves_the_frequency_alone():
    """Hum on the second harmonic, of another frequency than it: only the fundamental may say what turns."""
    samples = 1000
    time, omega = times(samples), 2 * np.pi * 12.0
    hum = 0.3 * np.cos(2 * (omega + 0.05) * time + 1.0)  # 0.03 bins off
    signals = (wave(time, omega, [1.0, 0.1]) + hum)[None]
    start = fit_sines(track(signals, everything(samples), time), omega, 2, np.empty(0))
    (wrong,), _ = refine([start], informing=[np.array([True, True])])
    (right,), _ = refine([start], informing=[np.array([True, False])])
    assert abs(right.omega - omega) < 0.02 * abs(wrong.omega - omega)


@pytest.mark.parametrize("amplitudes", [[1.0], [1.0, 0.0, 0.3]])
def test_frequency_uncertainty_is_the_cramer_rao_bound(amplitudes):
    """var(w) = 12 · 2 s² / (sum (k A_k)² N (N² - 1) dt²) for white noise s; the drift takes a little."""
    samples, noise = 1000, 0.01
    rng = np.random.default_rng(4)
    time, omega = times(samples), 2 * np.pi * 20.3
    signals = (wave(time, omega, amplitudes) + noise * rng.standard_normal(samples))[None]
    start = fit_sines(track(signals, everything(samples), time), omega, len(amplitudes), np.empty(0))
    (fit,), std = refine([start], informing=[np.ones(len(amplitudes), dtype=bool)], weights=[np.array([noise**-2])])
    power = sum((k * a) ** 2 for k, a in enumerate(amplitudes, start=1))
    bound = np.sqrt(24 * noise**2 / (power * samples * (samples**2 - 1))) * RATE
    assert std == pytest.approx(bound, rel=0.01)
    assert abs(fit.omega - omega) < 4 * std


def test_an_unsteady_harmonic_takes_a_parabola():
    samples = 1000
    time, omega = times(samples), 2 * np.pi * 12.0
    place = time / time[-1]
    signals = (wave(time, omega, [1.0]) + (0.2 + 0.1 * place - 0.3 * place**2) * np.cos(2 * omega * time))[None]
    steady = fit_sines(track(signals, everything(samples), time), omega, 2, np.empty(0))
    unsteady = fit_sines(track(signals, everything(samples), time), omega, 2, np.empty(0), (2,))
    assert np.abs(steady.residual).max() > 0.05
    assert np.abs(unsteady.residual).max() < 1e-12
    assert unsteady.dof == steady.dof - 4


def test_a_small_step_turns_the_harmonics_that_do_not_inform_the_frequency():
    """In few cycles the harmonics are not orthogonal: one that keeps its old frequency would enter all amplitudes."""
    rng, time, omega = np.random.default_rng(8), times(290), 2 * np.pi * 6.0  # 3.5 cycles
    signal = wave(time, omega, [1.0, 0.06, 0.05j, 0.04, 0.03j]) + 1e-5 * rng.standard_normal((3, 290))
    start = fit_sines(track(signal, everything(290), time), omega * (1 - 2e-6), 5, np.empty(0))
    (fit,), _ = refine([start], informing=[np.arange(5) == 0])
    exact = fit.at(fit.omega, fit.lines)
    # a step may leave a thousandth of a standard uncertainty; 0.017 remained when they did not turn
    off = np.abs(fit.coefficients - exact.coefficients) / np.sqrt(2 * exact.variance / 290)
    assert off.max() < 1e-3


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_line_in_coloured_noise_settles(seed):
    """The noise about the line is far above that of the whole residual, so that each step leaves much to the next."""
    rng, samples = np.random.default_rng(seed), 2000
    time, omega, line, bin_width = times(samples), 2 * np.pi * 20.0, 2 * np.pi * 6.0, 2 * np.pi * RATE / 2000
    band = np.exp(-0.5 * ((np.fft.rfftfreq(samples, 1 / RATE) - 6.0) / 0.5) ** 2)
    coloured = np.fft.irfft(np.fft.rfft(rng.standard_normal(samples)) * band, samples)
    signal = np.cos(omega * time) + 0.02 * np.cos(line * time + 0.4) + coloured + 0.05 * rng.standard_normal(samples)
    start = fit_sines(track(signal[None], everything(samples), time), omega, 2, np.array([line + 0.3 * bin_width]))
    informing = [np.ones(2, dtype=bool)]
    (fit,), _ = refine([start], informing=informing)
    settled = fit
    for _ in range(12):
        (settled,), _ = refine([settled.at(settled.omega, settled.lines)], informing=informing)
    # the uncertainty of the line is some hundredths of a bin
    assert abs(fit.lines[0] - settled.lines[0]) / bin_width < 1e-3
