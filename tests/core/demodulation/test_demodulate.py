"""Demodulation: exact on clean signals, unbiased by hum, and as uncertain as it says."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.recording import Channel, Recording
from fourpole.errors import RecordingError

pytestmark = pytest.mark.thorough

F1, V1, V2 = AMPLITUDES = np.array([60 * np.exp(1.5j), 0.06 + 0j, 0.08 * np.exp(-0.3j)])
SIZES = np.abs(AMPLITUDES)

# The frequency stops moving at 1e-9 of a bin; amplitudes belong to the middle of the record, where a wrong frequency
# turns nothing, and carry the round-off of some 2000 samples and of a Gram matrix that is all but diagonal.
EXACT_AMPLITUDE = 1e-10


def exactly(found, amplitudes, frequency, duration):
    np.testing.assert_allclose(found.phasors.amplitudes / amplitudes, np.ones(len(amplitudes)), atol=EXACT_AMPLITUDE)
    assert found.phasors.frequency == pytest.approx(frequency, abs=2e-9 / duration)


def parts(amplitudes):
    """Re, Im, Re, Im ..."""
    return np.stack([amplitudes.real, amplitudes.imag], axis=-1).reshape(*amplitudes.shape[:-1], -1)


def root_mean_square_limits(count, probability=1e-3):
    """Two-sided limits of the rms of `count` standard normal numbers."""
    return np.sqrt(stats.chi2.ppf([probability / 2, 1 - probability / 2], count) / count)


# Clean signals --------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(
    frequency=st.floats(4.0, 40.0),
    cycles=st.floats(3.1, 60.0),
    rate=st.sampled_from([500.0, 1000.0, 2048.0]),
    phases=st.tuples(*[st.floats(-np.pi, np.pi)] * 3),
    offset=st.floats(-5.0, 5.0),
    drift=st.floats(-0.3, 0.3),
)
def test_clean_sines_are_met_exactly(record, frequency, cycles, rate, phases, offset, drift):
    samples = int(cycles / frequency * rate)
    truth = SIZES * np.exp(1j * np.array(phases))
    place = np.linspace(-1, 1, samples)
    extra = SIZES[:, None] * (offset + drift * (place - place**2 + place**3))
    found = demodulate(record(truth, frequency, rate=rate, samples=samples, extra=extra))
    exactly(found, truth, frequency, samples / rate)
    assert found.cycles == pytest.approx(frequency * samples / rate, rel=1e-9)
    assert found.lines.size == 0
    assert found.missing == 0.0


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("delay", [0.0, 2e-4, -1.7e-3, 0.021])
def test_every_motion_becomes_a_velocity_and_delays_are_undone(record, quantity, delay):
    found = demodulate(
        record(AMPLITUDES, 10.37, quantities=("force", quantity, "acceleration"), delays=(-0.5 * delay, delay, 1e-3))
    )
    exactly(found, AMPLITUDES, 10.37, 2.0)


@pytest.mark.parametrize("harmonics", [2, 5, 10])
def test_harmonics_are_kept_apart(record, harmonics):
    rng = np.random.default_rng(harmonics)
    higher = 0.2 * SIZES * (rng.standard_normal((harmonics - 1, 3)) + 1j * rng.standard_normal((harmonics - 1, 3)))
    # the sixth of 10.37 Hz lies four bins from 60 Hz and on: none of these can be taken for hum
    found = demodulate(record(np.vstack([AMPLITUDES, higher / np.arange(2, harmonics + 1)[:, None]]), 10.37))
    exactly(found, AMPLITUDES, 10.37, 2.0)


@pytest.mark.parametrize("samples", [310, 333, 1000, 1017, 2000])
def test_cycles_need_not_be_whole(record, samples):
    found = demodulate(record(AMPLITUDES, 10.0, samples=samples))
    exactly(found, AMPLITUDES, 10.0, samples / 1000.0)


def test_a_frequency_that_is_given_is_kept(record):
    found = demodulate(record(AMPLITUDES, 10.37), frequency=10.37)
    np.testing.assert_allclose(found.phasors.amplitudes, AMPLITUDES, rtol=EXACT_AMPLITUDE)
    assert found.phasors.frequency == 10.37
    assert found.phasors.frequency_std == 0.0


def test_two_channels_are_enough(record):
    found = demodulate(record(AMPLITUDES, 10.37).without("motion_out"))
    exactly(
        replace(found, phasors=replace(found.phasors, amplitudes=found.phasors.amplitudes[:2])), [F1, V1], 10.37, 2.0
    )
    assert np.isnan(found.phasors.motion_out)
    assert np.isnan(found.distortion[2])
    assert np.isnan(found.noise_ratio[2])
    assert not found.phasors.covariance[4:].any()
    no_force = demodulate(record(AMPLITUDES, 10.37).without("force_in"))
    assert np.isnan(no_force.phasors.force_in)
    assert np.isnan(no_force.force_peak)
    np.testing.assert_allclose(no_force.phasors.amplitudes[1:], AMPLITUDES[1:], rtol=EXACT_AMPLITUDE)


def test_a_strong_line_elsewhere_needs_near(record):
    """A vibration faster and stronger than the excitation: `near` says which of them the cam is."""
    time = (np.arange(2000) - 999.5) / 1000.0
    recording = record(AMPLITUDES, 10.37, extra=2 * SIZES[:, None] * np.cos(2 * np.pi * 77.3 * time + 1.0))
    assert demodulate(recording).phasors.frequency == pytest.approx(77.3, abs=1e-6)
    found = demodulate(recording, near=10.2)
    exactly(found, AMPLITUDES, 10.37, 2.0)
    assert found.lines == pytest.approx([77.3], abs=1e-6)


def test_near_does_not_find_what_is_not_there(record):
    """Stated 22 Hz, turning at 10.37: the recording counts."""
    found = demodulate(record(AMPLITUDES, 10.37), near=22.0)
    exactly(found, AMPLITUDES, 10.37, 2.0)


# Hum ------------------------------------------------------------------------------------------------------------


def hum(frequency, size=0.05, phase=0.7):
    time = (np.arange(2000) - 999.5) / 1000.0
    return size * SIZES[:, None] * np.cos(2 * np.pi * frequency * time + phase + np.arange(3)[:, None])


@pytest.mark.parametrize("mains", [None, 50.0])
@pytest.mark.parametrize("frequency", [10.37, 13.0, 24.0])
def test_hum_between_harmonics_is_found_and_removed(record, frequency, mains):
    found = demodulate(record(AMPLITUDES, frequency, extra=hum(50.0)), mains=mains)
    exactly(found, AMPLITUDES, frequency, 2.0)
    assert np.abs(found.lines - 50.0).min() < 1e-6


def test_stated_mains_are_removed_with_their_harmonics(record):
    extra = hum(60.0) + hum(120.0, 0.03) + hum(180.0, 0.02)
    found = demodulate(record(AMPLITUDES, 13.1, extra=extra), mains=60.0)
    exactly(found, AMPLITUDES, 13.1, 2.0)
    for multiple in (60.0, 120.0, 180.0):
        assert np.abs(found.lines - multiple).min() < 1e-6


@pytest.mark.parametrize("mains", [None, 50.0])
@pytest.mark.parametrize("phase", [0.0, 1.0, 2.5, 4.0])
def test_hum_on_the_fifth_harmonic_touches_nothing_else(record, phase, mains):
    """10 Hz and 50 Hz: the hum is the harmonic's, the frequency is the fundamental's."""
    found = demodulate(record(AMPLITUDES, 10.0, extra=hum(50.0, 0.3, phase)), mains=mains)
    exactly(found, AMPLITUDES, 10.0, 2.0)


@pytest.mark.parametrize("off", [0.01, -0.2, 0.4, 1.0])
@pytest.mark.sampled(2)
def test_hum_beside_the_fifth_harmonic_biases_nothing(record, off):
    """50 Hz and up to two bins off it, with noise of 0.5 %: errors have no bias, and amplitudes scatter as stated."""
    seeds, errors, in_frequency, stated = 40, [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        noise = 0.005 * SIZES[:, None] * rng.standard_normal((3, 2000))
        found = demodulate(record(AMPLITUDES, 10.0, extra=hum(50.0 + off, phase=rng.uniform(0, 6.28)) + noise))
        errors.append(parts(found.phasors.amplitudes - AMPLITUDES))
        stated.append(found.phasors.std)
        in_frequency.append((found.phasors.frequency - 10.0) / found.phasors.frequency_std)
    errors = np.array(errors)
    assert (np.abs(errors.mean(axis=0)) < 4 * errors.std(axis=0) / np.sqrt(seeds)).all()
    low, high = root_mean_square_limits(3 * seeds) * np.sqrt(26 / 24)
    assert low < np.sqrt(np.mean((errors / stated) ** 2)) < high
    # Hum from half a bin to two off leaves a residue that the frequency's uncertainty does not know: twice it at most.
    known = 1.0 if abs(off) < 0.5 / 2.0 else 2.0
    assert abs(np.mean(in_frequency)) < 4 * known / np.sqrt(seeds)
    assert np.sqrt(np.mean(np.square(in_frequency))) < known * root_mean_square_limits(seeds)[1]


def test_hum_does_not_pull_the_frequency_of_a_pure_sine(record):
    """Hum 0.02 bins off the fifth harmonic, clean otherwise: were it to inform, it would pull by 1e-4 Hz."""
    found = demodulate(record(AMPLITUDES, 10.0, extra=hum(50.01)))
    assert found.phasors.frequency == pytest.approx(10.0, abs=1e-6)
    np.testing.assert_allclose(found.phasors.amplitudes, AMPLITUDES, rtol=1e-5)


# Noise ----------------------------------------------------------------------------------------------------------


def noisy(record, seeds, noise, *, samples, frequency=10.3, mixing=None, present=1.0, **kwargs):
    """Demodulate `seeds` records in white noise, `noise` of each amplitude, mixed between the channels."""
    mixing = np.eye(3) if mixing is None else mixing
    results = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        extra = noise * SIZES[:, None] * (mixing @ rng.standard_normal((3, samples)))
        if present < 1:
            extra = np.where(rng.random((1, samples)) < present, extra, np.nan)
        results.append(demodulate(record(AMPLITUDES, frequency, samples=samples, extra=extra), **kwargs))
    return results


SAMPLES, NOISE, SEEDS = 4000, 0.005, 150


@pytest.fixture(scope="module")
def in_noise(record):
    """Records of 4 s in white noise, demodulated."""
    return noisy(record, SEEDS, NOISE, samples=SAMPLES)


@pytest.mark.sampled(4)
def test_frequency_reaches_its_cramer_rao_bound(in_noise):
    samples, noise, seeds, found = SAMPLES, NOISE, SEEDS, in_noise
    frequency = np.array([float(one.phasors.frequency) for one in found])
    stated = np.array([float(one.phasors.frequency_std) for one in found])
    # three channels of the same signal to noise; sines only
    bound = np.sqrt(24 * noise**2 / (3 * samples * (samples**2 - 1))) * 1000.0 / (2 * np.pi)
    # Each channel's noise is known from 60 degrees of freedom, so each statement to 1/sqrt(2 · 180) = 5 %, their mean
    # to 0.5 %; weights that follow the noise take another 60/58, or 2 %, off.
    assert stated.mean() == pytest.approx(bound, rel=0.04)
    assert stated.std() < 0.1 * bound
    low, high = root_mean_square_limits(seeds)
    assert low < np.sqrt(np.mean(((frequency - 10.3) / bound) ** 2)) < high
    assert low < np.sqrt(np.mean(((frequency - 10.3) / stated) ** 2)) < 1.04 * high


def test_amplitudes_scatter_as_stated(in_noise):
    samples, seeds, found = SAMPLES, SEEDS, in_noise
    dof = found[0].phasors.dof
    assert dof == 60.0
    errors = np.array([parts(one.phasors.amplitudes - AMPLITUDES) / one.phasors.std for one in found])
    low, high = root_mean_square_limits(errors.size) * np.sqrt(dof / (dof - 2))  # Student's t
    assert low < np.sqrt(np.mean(errors**2)) < high
    # and the statement itself is the bound: 2 s²/N for each part
    stated = np.array([one.phasors.std for one in found]) / (NOISE * np.repeat(SIZES, 2) * np.sqrt(2 / samples))
    assert np.mean(stated**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / dof / (3 * seeds)))


@pytest.mark.parametrize("samples", [400, 1000])
@pytest.mark.sampled(2)
def test_amplitudes_scatter_as_stated_with_missing_samples(record, samples):
    """400 samples: too short for the noise beside the line, so it is that of the residual."""
    seeds = 80
    found = noisy(record, seeds, 0.01, samples=samples, present=0.87)
    dof = np.median([one.phasors.dof for one in found])
    errors = np.array([parts(one.phasors.amplitudes - AMPLITUDES) / one.phasors.std for one in found])
    low, high = root_mean_square_limits(seeds * 3) * np.sqrt(dof / (dof - 2))  # parts of a channel share one estimate
    assert low < np.sqrt(np.mean(errors**2)) < high


@pytest.mark.sampled(4)
def test_students_t_covers_what_it_says(record):
    """Intervals of 95 % on a short record with eight degrees of freedom, where 1.96 would cover 91.4 %."""
    seeds = 300
    found = noisy(record, seeds, 0.01, samples=800)
    assert {float(one.phasors.dof) for one in found} == {8.0}
    inside, inside_normal = [], []
    for one in found:
        error = np.abs(parts(one.phasors.amplitudes - AMPLITUDES)) / one.phasors.std
        inside.append(error < one.phasors.coverage_factor(0.95))
        inside_normal.append(error < 1.96)
    # Re and Im of a channel share their estimate: count 3 channels as independent, at the least
    low, high = stats.binom.ppf([5e-4, 1 - 5e-4], 3 * seeds, 0.95) / (3 * seeds)
    assert low <= np.mean(inside) <= high
    assert np.mean(inside_normal) < low


def test_noise_that_two_channels_share_stays_common(record):
    """Noise common to V1 and V2, 1 % of each, and a tenth of it of their own: their ratio does not see the former."""
    seeds, samples = 80, 2000
    common = np.array([[1.0, 0, 0], [0, 1.0, 0.1], [0, np.exp(0), 0]])
    in_phase = np.array([F1, V1, 0.08 + 0j])
    errors, naive, correlation = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        extra = 0.01 * SIZES[:, None] * (common @ rng.standard_normal((3, samples)))
        phasors = demodulate(record(in_phase, 10.3, samples=samples, extra=extra)).phasors
        ratio = phasors.transmissibility
        # T = V2/V1: dT = (dV2 - T dV1)/V1, real and imaginary parts by the real inputs
        by = np.array(
            [-ratio / phasors.motion_in, -1j * ratio / phasors.motion_in, 1 / phasors.motion_in, 1j / phasors.motion_in]
        )
        jacobian = np.stack([by.real, by.imag])
        covariance = phasors.covariance[2:, 2:]
        std = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))
        error = ratio - 0.08 / 0.06
        errors.append([error.real / std[0], error.imag / std[1]])
        alone = np.sqrt(np.diag(jacobian @ np.diag(np.diag(covariance)) @ jacobian.T))
        naive.append(alone / std)
        correlation.append(covariance[0, 2] / np.sqrt(covariance[0, 0] * covariance[2, 2]))
    low, high = root_mean_square_limits(seeds) * np.sqrt(28 / 26)
    assert low < np.sqrt(np.mean(np.square(errors))) < high
    # without the correlation it would be sqrt(2 + 0.01)/0.1 = 14 times too large
    assert 10 < np.median(naive) < 20
    assert np.median(correlation) == pytest.approx(1 / np.sqrt(1.01), abs=0.005)


def test_noise_that_is_common_out_of_phase_stands_in_the_cross_parts(record):
    """The same noise on F1 and V1, a quarter of a cycle of 10 Hz later: Re F1 goes with Im V1."""
    delay, rate, seeds = 25, 1000.0, 60
    mean = np.zeros((6, 6))
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        source = rng.standard_normal(2000 + delay)
        extra = 0.01 * SIZES[:, None] * np.stack([source[delay:], source[:-delay], rng.standard_normal(2000)])
        phasors = demodulate(record(AMPLITUDES, 10.0, rate=rate, extra=extra)).phasors
        mean += phasors.covariance / np.outer(phasors.std, phasors.std) / seeds
    # V1 is late by 90°: its amplitude is -j times that of F1, so Im V1 = -Re F1 and Re V1 = Im F1. The band of ±4 Hz
    # around 10 Hz spreads the phase by ±36°, which leaves sin(0.63)/0.63 = 0.93 of it.
    assert mean[0, 3] == pytest.approx(-0.93, abs=0.03)
    assert mean[1, 2] == pytest.approx(0.93, abs=0.03)
    assert abs(mean[0, 2]) < 0.1
    assert np.abs(mean[4:, :4]).max() < 5 / np.sqrt(14 * seeds)


@pytest.mark.parametrize(
    ("samples", "frequency", "dof", "band"),
    [
        (2000, 10.3, 28.0, (6.3, 14.3)),  # 0.4 of 10.3 Hz is 8.2 bins: 2 to 8 either way
        (4000, 10.3, 60.0, (6.3, 14.3)),  # 16 bins
        (20000, 10.3, 60.0, (9.5, 11.1)),  # 16 bins at most
        (800, 10.3, 8.0, (10.3 - 3.75, 10.3 + 3.75)),  # 3 bins
    ],
)
def test_band_and_degrees_of_freedom_of_the_noise(record, samples, frequency, dof, band):
    (found,) = noisy(record, 1, 0.001, samples=samples, frequency=frequency)
    assert found.phasors.dof == dof
    assert found.band == pytest.approx(band, abs=1e-3)


def test_a_short_record_takes_its_noise_from_everywhere(record):
    (found,) = noisy(record, 1, 0.001, samples=400)
    assert found.band == (0.0, 500.0)
    assert found.phasors.dof == 400 - (2 * 10 + 4)


def test_noise_ratio(record):
    (found,) = noisy(record, 1, 0.02, samples=4000)
    # noise of 2 % rms over a sine's 1/sqrt(2); known to 1/sqrt(2 · 4000)
    np.testing.assert_allclose(found.noise_ratio, 0.02 * np.sqrt(2), rtol=0.05)


# Quality --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_distortion_is_that_of_the_displacement_whatever_was_measured(record, quantity):
    """The cam's second and third harmonics are 10 and 5 % of its stroke, those of the force 20 %."""
    rows = np.array([AMPLITUDES, [0.2 * F1, 2 * 0.1j * V1, 0], [0, 3 * 0.05 * V1, 0]])
    found = demodulate(record(rows, 10.37, quantities=("force", quantity, "velocity")))
    np.testing.assert_allclose(found.distortion, [0.2, np.hypot(0.1, 0.05), 0], atol=1e-9)


def test_force_peak_has_the_harmonics(record):
    rows = np.array([[60.0, V1, V2], [20.0, 0, 0], [10.0, 0, 0]])
    assert demodulate(record(rows, 10.37)).force_peak == pytest.approx(90.0, rel=1e-9)
    opposed = demodulate(record(rows * np.array([1, -1, 1])[:, None], 10.37)).force_peak
    assert opposed == pytest.approx(90.0, rel=1e-9)  # half a turn later they add up again
    turned = demodulate(record(rows * np.exp(0.3j * np.arange(1, 4))[:, None], 10.37)).force_peak
    # 512 places in a turn miss a top of curvature sum k² a_k = 230 N by half a step at most
    assert turned == pytest.approx(90.0, abs=0.5 * 230 * (np.pi / 512) ** 2 * 1.01)


def test_missing_samples_are_bridged_and_counted(record):
    recording = record(AMPLITUDES, 10.37)
    samples = recording.channels["motion_in"].samples.copy()
    samples[100:200] = np.nan
    samples[np.random.default_rng(0).random(2000) < 0.05] = np.inf
    gaps = replace(recording, channels={**recording.channels, "motion_in": Channel(samples, "velocity")})
    found = demodulate(gaps)
    exactly(found, AMPLITUDES, 10.37, 2.0)
    assert found.missing == pytest.approx(np.mean(~np.isfinite(samples)), rel=1e-12)


# Errors ---------------------------------------------------------------------------------------------------------


def with_channel(recording, name, samples, quantity="velocity"):
    return replace(recording, channels={**recording.channels, name: Channel(samples, quantity)}, label="S1")


def test_too_few_cycles(record):
    with pytest.raises(RecordingError, match=r"holds 2\.5 cycles of 10\.01 Hz, at least 3 are needed: record longer"):
        demodulate(record(AMPLITUDES, 10.0, samples=250))
    with pytest.raises(RecordingError, match=r"holds 2\.9 cycles of 10 Hz"):
        demodulate(record(AMPLITUDES, 10.0, samples=290), frequency=10.0)
    exactly(demodulate(record(AMPLITUDES, 10.0, samples=300), frequency=10.0), AMPLITUDES, 10.0, 0.3)


def test_too_few_samples(record):
    with pytest.raises(RecordingError, match="has 15 samples, at least 16 are needed"):
        demodulate(record(AMPLITUDES, 10.0, rate=50.0, samples=15))


@pytest.mark.parametrize("name", ["force_in", "motion_in", "motion_out"])
@pytest.mark.parametrize("value", [0.0, 3.2, -1e9])
def test_constant_channels(record, name, value):
    symbol = {"force_in": "F1", "motion_in": "V1", "motion_out": "V2"}[name]
    with pytest.raises(RecordingError, match=f"{symbol} \\({name}\\) is constant .* the sensor was off, unplugged"):
        demodulate(with_channel(record(AMPLITUDES, 10.0), name, np.full(2000, value), "force"))


def test_values_that_are_no_measurement(record):
    wild = np.random.default_rng(0).standard_normal(2000) * 1e200
    with pytest.raises(RecordingError, match=r"V2 \(motion_out\) reaches .* no measurement"):
        demodulate(with_channel(record(AMPLITUDES, 10.0), "motion_out", wild))


def test_too_many_gaps(record):
    recording = record(AMPLITUDES, 10.0)
    samples = recording.channels["motion_out"].samples.copy()
    samples[:500] = np.nan
    with pytest.raises(RecordingError, match=r"V2 \(motion_out\): 25% of the samples are missing .* at most 20%"):
        demodulate(with_channel(recording, "motion_out", samples))
    nothing = np.full(2000, np.nan)
    with pytest.raises(RecordingError, match="100% of the samples are missing"):
        demodulate(with_channel(recording, "motion_out", nothing))


def test_gaps_of_different_channels_add_up(record):
    recording = record(AMPLITUDES, 10.0)
    for name, start in (("force_in", 0), ("motion_in", 500), ("motion_out", 1000)):
        samples = recording.channels[name].samples.copy()
        samples[start : start + 200] = np.nan
        recording = with_channel(recording, name, samples, recording.channels[name].quantity)
    with pytest.raises(RecordingError, match=r"10% of the samples are missing \(30% in any channel\)"):
        demodulate(recording)


def test_frequencies_that_the_sampling_does_not_hold(record):
    for frequency in (460.0, 900.0):
        with pytest.raises(RecordingError, match="is not resolved by 1000 samples per second"):
            demodulate(record(AMPLITUDES, 10.0), frequency=frequency)
    with pytest.raises(RecordingError, match="is not resolved"):
        demodulate(record(AMPLITUDES, 10.0), frequency=-10.0)


def test_a_recording_of_its_own_kind_is_left_as_it_was(record):
    recording = record(AMPLITUDES, 10.37)
    before = {name: channel.samples.copy() for name, channel in recording.channels.items()}
    demodulate(recording)
    for name, samples in before.items():
        np.testing.assert_array_equal(recording.channels[name].samples, samples)


def test_scaling_a_channel_scales_its_amplitude_and_nothing_else(record):
    rng = np.random.default_rng(0)
    recording = record(AMPLITUDES, 10.3, extra=0.01 * SIZES[:, None] * rng.standard_normal((3, 2000)))
    force = recording.channels["force_in"]
    scaled = Recording(1000.0, {**recording.channels, "force_in": replace(force, samples=1e6 * force.samples)})
    one, other = demodulate(recording).phasors, demodulate(scaled).phasors
    scale = np.array([1e6, 1.0, 1.0])
    np.testing.assert_allclose(other.amplitudes, one.amplitudes * scale, rtol=1e-9)
    np.testing.assert_allclose(other.std, one.std * np.repeat(scale, 2), rtol=1e-6)
    assert other.frequency == pytest.approx(one.frequency, rel=1e-9)


@pytest.mark.parametrize("near", [None, 10.3])
def test_an_accelerometer_that_drifts(record, near):
    """0.6 cycles of a drift half as large as the acceleration: nothing that the fit could not take."""
    time = np.arange(2000) / 1000.0
    drift = 0.5 * SIZES[1] * 2 * np.pi * 10.3 * np.cos(2 * np.pi * 0.3 * time + 1.0)
    recording = record(
        AMPLITUDES, 10.3, quantities=("force", "acceleration", "velocity"), extra=np.array([0, 1, 0])[:, None] * drift
    )
    assert demodulate(recording, near=near).phasors.frequency == pytest.approx(10.3, abs=1e-3)


def test_a_noisy_displacement(record):
    """10 % of noise at 10 kHz, spread so thinly that the line stands 250 times above its largest bin."""
    rng = np.random.default_rng(0)
    stroke = SIZES[1] / (2 * np.pi * 10.3)
    noise = np.array([0, 0.1 * stroke, 0])[:, None] * rng.standard_normal(40_000)
    recording = record(
        AMPLITUDES, 10.3, rate=10e3, samples=40_000, quantities=("force", "displacement", "velocity"), extra=noise
    )
    try:
        frequency = float(demodulate(recording).phasors.frequency)
    except RecordingError:
        frequency = np.nan
    assert frequency == pytest.approx(10.3, abs=1e-3)


@pytest.mark.statistical
@pytest.mark.sampled(6)
def test_noise_that_channels_share_makes_the_frequency_look_better_known_by_no_more_than_root_three(record):
    """A limit, said in docs/validation.md: channels inform the frequency as if their noise were independent.

    The same noise on V1 and V2 and four times as much on F1: two of three channels say one thing twice.
    """
    mixing = np.array([[4.0, 0, 0], [0, 1.0, 0.05], [0, 1.0, 0]])
    in_phase = np.array([F1, V1, 0.08 + 0j])
    errors = []
    for seed in range(200):
        extra = 0.01 * SIZES[:, None] * (mixing @ np.random.default_rng(seed).standard_normal((3, 2000)))
        found = demodulate(record(in_phase, 10.3, extra=extra)).phasors
        errors.append((found.frequency - 10.3) / found.frequency_std)
    _, high = root_mean_square_limits(200)
    assert high < np.sqrt(np.mean(np.square(errors))) < np.sqrt(3)


@pytest.mark.parametrize("phase", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
@pytest.mark.parametrize("drift", [-4.0, 4.0])
def test_a_drift_does_not_make_three_cycles_too_few(phase, drift):
    """The first guess is made of V1 without its slope, which would pull it by a fifth of a bin in so few cycles."""
    t = np.arange(121) / 400.0
    wave, slope = np.exp(1j * (2 * np.pi * 10.0 * t + phase)), drift * (t / t[-1] - 0.5)
    found = demodulate(Recording.from_arrays(t, force_in=60 * wave.real, motion_in=0.06 * (wave.real + slope)))
    assert found.cycles == pytest.approx(3.025, abs=1e-6)


def test_one_column_for_two_channels(record):
    same = record(AMPLITUDES, 10.0).channels["motion_in"].samples
    with pytest.raises(RecordingError, match=r"V1 \(motion_in\) and V2 \(motion_out\) have the same samples"):
        demodulate(with_channel(record(AMPLITUDES, 10.0), "motion_out", same))
