"""What a residual holds: lines that are real, no others, and the noise beside a frequency."""

from types import SimpleNamespace

import numpy as np
import pytest

from fourpole.core.demodulation.spectrum import find_lines, noise_beside, strongest_lines
from fourpole.core.demodulation.sums import hann
from fourpole.core.demodulation.terms import Terms, rows_of
from fourpole.core.demodulation.tracks import Track

RATE, SAMPLES = 1000.0, 2000
TIME = np.arange(SAMPLES) / RATE
EVERYTHING = np.ones(SAMPLES, dtype=bool)
NO_LINES = np.empty(0)


def left(residual, present, dof, frequency, lines=NO_LINES):
    """What the spectra take of a fit at a frequency, with a given residual."""
    samples = residual.shape[1]
    time = (np.arange(samples) - 0.5 * (samples - 1)) / RATE
    track = Track(("motion_in",) * len(residual), residual, present, time, RATE)
    return SimpleNamespace(
        residual=residual,
        track=track,
        rows=rows_of(track, Terms(2 * np.pi * frequency, 5, NO_LINES, ())),
        omega=2 * np.pi * frequency,
        lines=2 * np.pi * lines,
        dof=dof,
        resolution=RATE / samples,
    )


def beside(residual, frequency, present=EVERYTHING, dof=1900, lines=NO_LINES):
    return noise_beside([left(residual, present, dof, frequency, lines)])[0]


def lines_of(motion, order):
    return strongest_lines(np.fft.rfft(motion * hann(motion.size)), RATE / motion.size, order=order)


def strongest(motion, order):
    return lines_of(motion, order)[0].frequency


@pytest.mark.parametrize("frequency", [3.7, 10.0, 10.13, 10.25, 44.4])
def test_strongest_line_to_a_hundredth_of_a_bin(frequency):
    found = strongest(np.cos(2 * np.pi * frequency * TIME + 0.4), 0)
    assert found == pytest.approx(frequency, abs=0.01 * RATE / SAMPLES)


@pytest.mark.parametrize("samples", [SAMPLES, 4096, 9001])
def test_weaker_lines_are_listed_by_their_size(samples):
    time = np.arange(samples) / RATE
    motion = sum(size * np.cos(2 * np.pi * at * time) for size, at in ((0.5, 20.3), (1.0, 44.4), (0.25, 90.1)))
    lines = lines_of(motion, 0)
    assert [line.frequency for line in lines] == pytest.approx([44.4, 20.3], abs=0.1 * RATE / samples)
    assert [line.bin for line in lines] == pytest.approx([44.4, 20.3], abs=0.13 * RATE / samples)
    assert lines[1].amplitude / lines[0].amplitude == pytest.approx(0.5, rel=1e-3)


def test_strongest_line_is_that_of_the_velocity():
    fast, slow = np.cos(2 * np.pi * 40.0 * TIME), np.cos(2 * np.pi * 10.0 * TIME)
    mixed = 0.5 * fast + slow
    assert strongest(mixed, 0) == pytest.approx(10.0, abs=0.05)
    assert strongest(mixed, 1) == pytest.approx(40.0, abs=0.05)  # as a displacement
    assert strongest(slow + 2 * fast, -1) == pytest.approx(10.0, abs=0.05)  # as an acceleration


def test_less_than_a_cycle_is_drift():
    drift = 1.8 * np.cos(2 * np.pi * 0.2 * TIME + 0.4)  # the largest, were the bins below 1.2 cycles to count
    assert strongest(drift + np.cos(2 * np.pi * 10 * TIME), 0) == pytest.approx(10.0, abs=0.05)


def test_white_noise_has_no_lines():
    rng = np.random.default_rng(0)
    # 300 records of 3 channels and 1000 bins: chance 9e5 exp(-30) = 1e-7, and that of a low local floor
    assert all(find_lines(rng.standard_normal((3, SAMPLES)), RATE, np.zeros(3)).size == 0 for _ in range(300))


def test_coloured_noise_has_no_lines():
    rng = np.random.default_rng(1)
    for _ in range(100):
        noise = np.cumsum(rng.standard_normal((2, SAMPLES)), axis=1)
        noise -= noise.mean(axis=1, keepdims=True)
        found = find_lines(noise, RATE, np.zeros(2))
        assert (found < 20.0).all()  # a random walk is all low frequency: its first bins may look like lines


@pytest.mark.parametrize("frequency", [50.0, 50.13, 150.3, 333.3])
def test_lines_are_found_strongest_first(frequency):
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, SAMPLES))
    # amplitude a in noise of variance 1: power over noise at the peak is a² N / (4 · 1.5 · 1) = 333 a²
    noise[0] += 0.5 * np.cos(2 * np.pi * frequency * TIME)
    noise[1] += 1.0 * np.cos(2 * np.pi * 250.0 * TIME)
    found = find_lines(noise, RATE, np.zeros(2))
    assert found == pytest.approx([250.0, frequency], abs=0.2 * RATE / SAMPLES)


def test_lines_that_do_not_matter_are_left():
    clean = np.zeros((1, SAMPLES)) + 1e-6 * np.cos(2 * np.pi * 77.0 * TIME)
    assert find_lines(clean, RATE, np.array([1e-7])) == pytest.approx([77.0], abs=0.05)
    assert find_lines(clean, RATE, np.array([2e-6])).size == 0


def test_noise_beside_white_noise():
    rng = np.random.default_rng(3)
    mixing = np.array([[1.0, 0.0, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 2.0]])
    estimates = []
    for _ in range(300):
        noise = beside(mixing @ rng.standard_normal((3, SAMPLES)), 10.3)
        estimates.append(noise.covariance)
        assert noise.dof == 28.0  # offsets 2 to 8 bins either way: 8 is 0.4 of 10.3 Hz
        assert noise.band == pytest.approx((6.3, 14.3))
    expected = 4.0 / SAMPLES * mixing @ mixing.T
    mean = np.mean(estimates, axis=0)
    # 300 · 14 complex bins: an element is known to sqrt(S_ii S_jj / 4200) = 1.5 %, five of these
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.abs(mean - expected) < 0.08 * scale).all()


def test_noise_beside_follows_the_colour():
    """Noise that is four times stronger at 10 Hz than at 100 Hz is measured as what it is at each."""
    rng = np.random.default_rng(4)
    frequency = np.fft.rfftfreq(SAMPLES, 1 / RATE)
    levels = {10.3: [], 100.3: []}
    for _ in range(200):
        white = np.fft.rfft(rng.standard_normal((1, SAMPLES)))
        coloured = np.fft.irfft(white * np.where(frequency < 50.0, 2.0, 1.0), SAMPLES)
        for at, found in levels.items():
            found.append(beside(coloured, at).covariance[0, 0].real)
    # 200 · 14 and 200 · 30 bins: 2 %, five of these
    assert np.mean(levels[10.3]) == pytest.approx(4 * 4 / SAMPLES, rel=0.1)
    assert np.mean(levels[100.3]) == pytest.approx(4 / SAMPLES, rel=0.1)


def test_noise_beside_leaves_out_removed_lines_and_the_frequency_itself():
    quiet = 1e-9 * np.random.default_rng(5).standard_normal((1, SAMPLES))
    near = quiet + np.cos(2 * np.pi * 10.0 * TIME)  # in the very bin
    assert beside(near, 10.0).covariance[0, 0].real < 1e-17
    apart = quiet + np.cos(2 * np.pi * 12.0 * TIME)  # four bins off
    assert beside(apart, 10.0).covariance[0, 0].real > 0.01
    without = beside(apart, 10.0, lines=np.array([12.0]))
    assert without.covariance[0, 0].real < 1e-17
    assert without.dof == 2.0 * (14 - 3)  # the line's bin and its neighbours


def test_a_short_record_is_taken_as_white():
    rng = np.random.default_rng(6)
    samples = 400  # four cycles of 10 Hz: no bins to spare
    residual = rng.standard_normal((2, samples))
    noise = beside(residual, 10.0, np.ones(samples, dtype=bool), 376)
    np.testing.assert_allclose(noise.covariance, residual @ residual.T / 376 * 4 / samples, rtol=1e-12)
    assert noise.dof == 376.0
    assert noise.band == (0.0, 500.0)


def test_noise_beside_harmonics_is_that_of_the_bins():
    """The bins beside three harmonics, made as they are defined: sums of the residual times a rotation."""
    residual = np.random.default_rng(8).standard_normal((2, 2003))
    time = (np.arange(2003) - 1001.0) / RATE
    fit = left(residual, np.ones(2003, dtype=bool), 1900, 40.3)
    offsets = np.r_[-16:-1, 2:17]
    for k, noise in enumerate(noise_beside([fit], 3), start=1):
        turning = np.exp(-2j * np.pi * (k * 40.3 + offsets[:, None] * RATE / 2003) * time)
        bins = 2 / 2003 * residual @ turning.T
        np.testing.assert_allclose(noise.covariance, bins @ bins.conj().T / 30, rtol=0, atol=1e-4 * 4 / 2003)


def test_missing_samples_do_not_dilute_the_noise():
    rng = np.random.default_rng(7)
    found = []
    for _ in range(300):
        present = rng.random(SAMPLES) > 0.15
        residual = np.where(present, rng.standard_normal((1, SAMPLES)), 0.0)
        covariance = beside(residual, 10.3, present, 1600).covariance[0, 0].real
        found.append(covariance * present.sum() / 4)
    assert np.mean(found) == pytest.approx(1.0, rel=0.08)  # 1/sqrt(4200) = 1.5 %, five of these
