"""Amplitudes under random excitation and in sweeps: against a rig simulated by its frequency responses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests import random_rig

from fourpole import Recording
from fourpole.core.chain import LowPass
from fourpole.core.checks import Code
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.phasor import CHANNELS
from fourpole.core.recording import DRIVE, Channel
from fourpole.core.routes import stiffness_by
from fourpole.core.spectra.average import (
    Ratios,
    beyond_bounds,
    cross_spectra,
    independent,
    with_bend,
    with_shared_noise,
)
from fourpole.core.spectra.checks import check_closure, check_line, check_shared_noise
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.errors import RecordingError, TooShortError

BAND = (5.0, 200.0)


def recorded(seed=1, **how):
    time, force, contact, wheel = random_rig.run(seed, **how)
    return Recording.from_arrays(time, force_in=force, motion_in=contact, motion_out=wheel)


def errors_of(found):
    """ln of K* found over the true one, and the standard uncertainties of its parts, by the relative route."""
    omega, (f1, v1, v2) = found.phasors.omega, found.phasors.amplitudes.T
    off = np.log(stiffness_by("relative", [f1, v1, v2], 0.0, omega) / random_rig.stiffness(omega))
    slopes = [1 / f1, -1 / (v1 - v2), 1 / (v1 - v2)]
    turn = np.concatenate(
        [np.stack([np.stack([d.real, -d.imag], -1), np.stack([d.imag, d.real], -1)], 1) for d in slopes], axis=2
    )
    covariance = turn @ found.phasors.covariance @ turn.transpose(0, 2, 1)
    return off, np.sqrt(np.einsum("lii->li", covariance))


@pytest.mark.parametrize(("coherence", "seeds"), [(0.99, (1, 2)), (0.7, (3, 4, 5, 19))])
def test_errors_have_the_stated_uncertainty_and_no_bias(coherence, seeds):
    """Lines are independent, so the mean of N errors over their uncertainties has the standard deviation N^-1/2."""
    pulls = []
    for seed in seeds:
        off, std = errors_of(random_amplitudes(recorded(seed, coherence=coherence), BAND))
        pulls.append(np.stack([off.real, off.imag], 1) / std)
    every = np.concatenate(pulls)
    count = every.shape[0]
    assert count > 300
    assert np.sqrt(np.mean(every**2)) == pytest.approx(1.0, abs=0.12)
    assert np.abs(every.mean(axis=0)).max() < 4.0 / np.sqrt(count)


def test_usual_estimates_have_a_bias_where_the_channels_are_noisy():
    """At coherence 0.7 H1 is low by the noise of F1 and H2 high by that of V1: the reason for instruments."""
    found = random_amplitudes(recorded(6, coherence=0.7), BAND)
    omega = found.phasors.omega
    rig = 1j * omega * random_rig.MASS + random_rig.SPRING / (1j * omega)
    true = 1 / rig + 1j * omega / random_rig.stiffness(omega)
    low, high, _ = np.mean(np.abs(found.estimates / true[:, None]), axis=0)
    assert low == pytest.approx(np.sqrt(0.7), abs=0.02)
    assert high == pytest.approx(1 / np.sqrt(0.7), abs=0.03)
    assert np.mean(np.abs(found.phasors.mobility / true)) == pytest.approx(1.0, abs=0.02)
    assert np.median(found.coherence[:, :3], axis=0) == pytest.approx(0.7, abs=0.05)


def test_noise_that_the_channels_share_is_told_by_the_closure_phase():
    for common, told in ((0.0, False), (0.3, True)):
        found = random_amplitudes(recorded(7, coherence=0.7, common=common), BAND)
        (check,) = check_closure(found)
        assert (check.verdict != "ok") is told
        assert check.code is Code.CLOSURE


def test_the_spectra_are_those_of_scipy():
    recording = recorded(8, length=20.0)
    (track,) = tracks_of(recording, CHANNELS)
    mine = cross_spectra(track, 1.0, BAND)
    for a in range(3):
        for b in range(3):
            f, other = signal.csd(track.signals[b], track.signals[a], fs=1000.0, window="hann", nperseg=1000)
            inside = (f >= BAND[0]) & (f <= BAND[1])
            scale = np.sqrt(np.abs(mine.matrix[:, a, a] * mine.matrix[:, b, b]))
            assert np.abs(mine.matrix[:, a, b] - other[inside]).max() < 1e-9 * scale.max()


def test_the_number_of_averages_is_that_of_the_scatter():
    """The power of white noise has the relative variance 1/n."""
    rng = np.random.default_rng(9)
    time = np.arange(400_000) / 1000.0
    noise = rng.normal(size=(2, time.size))
    (track,) = tracks_of(Recording.from_arrays(time, force_in=noise[0], motion_in=noise[1]), CHANNELS[:2])
    power = cross_spectra(track, 1.0, (1.0, 499.0)).matrix[:, 0, 0].real
    for bins in (1, 4):
        means = power[: power.size // bins * bins].reshape(-1, bins).mean(axis=1)
        scatter = means.var() / means.mean() ** 2
        assert scatter * independent(799, bins) == pytest.approx(1.0, abs=4 * np.sqrt(2.0 / means.size))


def test_delays_and_filters_are_taken_out_at_each_line():
    plain = recorded(10, length=40.0)
    found = random_amplitudes(plain, BAND, segment=1.0)
    link = LowPass(150.0, 2)
    late = replace(plain.channels["motion_out"], delay=2e-3, chain=(link,))
    other = random_amplitudes(replace(plain, channels={**plain.channels, "motion_out": late}), BAND, segment=1.0)
    omega = found.phasors.omega
    factor = np.exp(-1j * omega * 2e-3) * link.at(omega / (2 * np.pi))
    ratio = other.phasors.transmissibility / found.phasors.transmissibility
    assert ratio == pytest.approx(1 / factor, rel=1e-9)
    assert {row.name for row in other.corrections[0]} == {"delay", "low-pass"}


def test_lines_are_amplitudes_of_a_sine_with_the_whole_deflection():
    found = random_amplitudes(recorded(11), BAND)
    moved = np.abs(found.phasors.motion_in - found.phasors.motion_out) / found.phasors.omega
    assert moved == pytest.approx(found.deflection, rel=1e-9)


def test_a_ratio_outside_of_h1_and_h2_shows_what_the_instrument_shares():
    """Noise of F1 as large as its signal, of V2 a 25th of it, and of V1 none; a fifth of the signal is in both."""
    for common, off in ((0.0, 0.0), (0.03, 0.0), (0.2, np.log(1.2 / 1.04)), (-0.2, -np.log(0.8))):
        spectra = np.ones((1, 3, 3)) + np.diag([1.0, 0.0, 0.04]) + 0j
        spectra[0, [0, 2], [2, 0]] += common
        found, pull = beyond_bounds(spectra, np.array([100.0]))
        assert found[0, 1] == pytest.approx(off, abs=1e-12)
        assert (pull[0, 1] > 0) == (off > 0)
        plain = Ratios(np.ones((1, 2), dtype=complex), np.zeros((1, 4, 4)))
        both = with_shared_noise(plain, found, pull).covariance[0, ::2, ::2]
        assert both == pytest.approx(np.full((2, 2), found.max() ** 2 * (pull.max() > 2)))


def test_what_leaks_where_f1_vanishes_is_no_motion_of_v2():
    """The force is nil at the resonance of the rig, 4 Hz, and large at that of rig and specimen, 11.4 Hz, of Q 60.

    In segments of 1 s V2/V1 is off by 11 % at the lowest lines, in longer ones by less than 3 %; the closure phase is
    small in both.
    """
    rate, count, pulls = 256.0, 256 * 30, []
    for seed in range(4):
        rng = np.random.default_rng([12, seed])
        frequency = np.fft.rfftfreq(4 * count, 1 / rate)
        omega = 2 * np.pi * np.maximum(frequency, 0.1)
        drive = (rng.standard_normal((2, omega.size)) * [[1], [1j]]).sum(axis=0) * ((frequency > 4) & (frequency < 36))
        leaf, k = 42.8e3 + 39j * omega - 69.8 * omega**2, 3.2e5 * (1 + 0.02j)
        moved = k / (k + leaf)
        every = np.fft.irfft(np.stack([leaf * moved / (1j * omega), np.ones(omega.size), moved]) * drive)[
            :, count : 2 * count
        ]
        every += 2e-3 * np.std(every, axis=1)[:, None] * rng.standard_normal(every.shape)
        roles = dict(zip(CHANNELS, every, strict=True))
        found = random_amplitudes(Recording.from_arrays(np.arange(count) / rate, **roles), (4.0, 36.0))
        lines = found.phasors.frequency < 9
        ratio = (found.phasors.amplitudes[:, 2] / found.phasors.amplitudes[:, 1])[lines]
        true = np.interp(found.phasors.frequency[lines], frequency, np.abs(moved))
        off = np.log(np.abs(ratio) / true)
        assert found.length > 3
        assert np.abs(off).max() < 0.04
        pulls.append(off / found.relative[lines, 1])
    assert np.sqrt(np.mean(np.concatenate(pulls) ** 2)) < 1.5


def test_without_v2_the_ratio_is_the_mean_of_h1_and_h2():
    found = random_amplitudes(recorded(12).without("motion_out"), BAND)
    assert found.phasors.mobility == pytest.approx(found.estimates[:, 2], rel=1e-9)
    assert np.isnan(found.closure).all()
    bias = -np.log(found.coherence[:, 0]) / np.sqrt(12)
    assert (found.relative[:, 0] > 0.7 * bias).all()
    assert list(check_closure(found)) == []


def test_a_line_without_excitation_is_rejected():
    found = random_amplitudes(recorded(13, band=(3.0, 100.0)), (5.0, 200.0))
    above = found.phasors.frequency > 110.0
    verdicts = np.array([check_line(found, at).verdict for at in range(above.size)])
    assert set(verdicts[above]) == {"rejected"}
    assert set(verdicts[found.phasors.frequency < 90.0]) == {"ok"}


def _sines(frequencies, length=60.0):
    """Sines with 1 % of noise."""
    time, rng = np.arange(int(length * 1000)) / 1000.0, np.random.default_rng(14)
    waves = [np.exp(1j * (2 * np.pi * f * time + rng.uniform(0, 6.28))) for f in frequencies]
    total = np.sum(waves, axis=0) + 0.01 * random_rig.white(rng, time.size)
    return Recording.from_arrays(time, force_in=total.imag, motion_in=total.real, motion_out=(0.3j * total).real)


def _chirp(length, *, steps=0, logarithmic=False, rate=1000.0):
    """A motion from 4 to 220 Hz, in steps or without."""
    time = np.arange(int(length * rate)) / rate
    part = np.floor(time / length * steps) / steps if steps else time / length
    frequency = 4.0 * 55.0**part if logarithmic else 4.0 + 216.0 * part
    return np.sin(2 * np.pi * np.cumsum(frequency) / rate)


def swept(length=60.0, *, noise=0.01, seed=20, **how):
    motion = _chirp(length, **how)
    time, force, contact, wheel = random_rig.answered(motion, 1000.0, motion.size, noise=noise, seed=seed)
    return Recording.from_arrays(time, force_in=force, motion_in=contact, motion_out=wheel)


SWEEPS = {
    "linear, fast": {"length": 20.0},
    "linear": {"length": 60.0},
    "logarithmic": {"length": 120.0, "logarithmic": True},
    "stepped": {"length": 120.0, "steps": 60, "logarithmic": True},
}


@pytest.mark.parametrize("noise", [1e-3, 0.05])
@pytest.mark.parametrize("name", SWEEPS)
@pytest.mark.sampled(2)
def test_a_sweep_has_no_error_of_its_rate_or_its_steps(name, noise):
    """The errors of independent lines over their uncertainties have a root mean square of 1 and no mean."""
    found = sweep_amplitudes(swept(noise=noise, **SWEEPS[name]), BAND)
    off, std = errors_of(found)
    kept = found.relative.max(axis=1) < 0.1
    assert kept.sum() > 40
    pulls = (np.stack([off.real, off.imag], 1) / std)[kept]
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.2)
    assert np.abs(pulls.mean(axis=0)).max() < 4.0 / np.sqrt(kept.sum())


def test_random_excitation_taken_as_a_sweep_gives_the_same():
    recording = recorded(21, coherence=0.999)
    off, std = errors_of(sweep_amplitudes(recording, BAND))
    pulls = np.stack([off.real, off.imag], 1) / std
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.15)


def test_a_sweep_without_v2_and_with_a_delay():
    plain = swept(noise=0.0, logarithmic=True)
    late = replace(plain.channels["force_in"], delay=1e-3)
    channels = {**plain.channels, "force_in": late}
    both = [sweep_amplitudes(one.without("motion_out"), BAND) for one in (plain, replace(plain, channels=channels))]
    omega = both[0].phasors.omega
    ratio = both[0].phasors.mobility / both[1].phasors.mobility
    assert ratio == pytest.approx(np.exp(1j * omega * 1e-3), rel=1e-4)
    assert np.isnan(both[0].closure).all()


def repeated(period, length=60.0, *, noise=0.01, seed=30, lead=10.0, rate=1000.0):
    """A motion of noise that repeats, cut after the rig has settled."""
    rng, size = np.random.default_rng(seed), round(period * rate)
    frequency = np.fft.rfftfreq(size, 1 / rate)
    once = np.fft.irfft(random_rig.white(rng, frequency.size) * ((frequency > 3.0) & (frequency < 230.0)), size)
    motion = np.resize(once, int((length + lead) * rate))
    time, *signals = random_rig.answered(motion, rate, motion.size, noise=noise, seed=seed)
    force, contact, wheel = (one[int(lead * rate) :] for one in signals)
    return Recording.from_arrays(time[: force.size], force_in=force, motion_in=contact, motion_out=wheel)


@pytest.mark.parametrize("method", [random_amplitudes, sweep_amplitudes])
@pytest.mark.parametrize("period", [0.5, 2.0, 8.0])
def test_a_motion_that_repeats_is_known_at_the_multiples_of_its_frequency(method, period):
    """Between them is noise alone: segments that are no multiple of the period gave errors of twice the uncertainty."""
    found = method(repeated(period), BAND)
    off, std = errors_of(found)
    kept = found.relative.max(axis=1) < 0.1
    pulls = (np.stack([off.real, off.imag], 1) / std)[kept]
    assert kept.sum() > 60
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.2)
    if period < 5.0:
        sines = found.width == 1 / period
        multiples = found.phasors.frequency[sines] * period
        assert multiples == pytest.approx(np.round(multiples), abs=1e-3)


def test_a_sine_that_wanders_is_no_random_excitation():
    time = np.arange(60_000) / 1000.0
    wander = 0.5 * np.sin(2 * np.pi * 0.31 * time) + 0.4 * np.sin(2 * np.pi * 0.47 * time)
    _, *signals = random_rig.answered(np.sin(2 * np.pi * np.cumsum(20.0 + wander) / 1000.0), 1000.0, 60_000, noise=1e-3)
    recording = Recording.from_arrays(time, **dict(zip(CHANNELS, signals, strict=True)))
    with pytest.raises(RecordingError, match="separate sines"):
        random_amplitudes(recording, BAND)


@pytest.mark.parametrize(("common", "told"), [(0.0, False), (0.1, True)])
def test_a_small_correlation_of_noises_shows_over_all_lines(common, told):
    (check,) = check_shared_noise(random_amplitudes(recorded(31, coherence=0.7, common=common), BAND))
    assert (check.verdict == "warning") is told


@pytest.mark.parametrize("name", ["linear", "logarithmic"])
def test_a_sweep_without_noise_is_as_certain_as_its_polynomials(name):
    """The error of what the polynomials leave out is below its estimate, which is no round-off."""
    found = sweep_amplitudes(swept(noise=0.0, **SWEEPS[name]), BAND)
    off, std = errors_of(found)
    kept = found.relative.max(axis=1) < 0.1
    pulls = (np.stack([off.real, off.imag], 1) / std)[kept]
    assert kept.sum() > 200
    assert np.abs(pulls).max() < 3.0


def driven(seed, length=60.0, common=0.8, share=0.2):
    """A record with the drive, in which the noises of F1, V1 and V2 have a share of their power in common."""
    rng = np.random.default_rng(seed)
    frequency = np.fft.rfftfreq(int(length * 1000), 1e-3)
    motion = np.fft.irfft(random_rig.white(rng, frequency.size) * ((frequency > 3.0) & (frequency < 230.0)))
    drive = signal.lfilter([1.0], [1.0, -0.5], motion)  # the shaker is a filter of the drive
    time, *signals = random_rig.answered(motion, 1000.0, motion.size)
    shared = rng.normal(size=time.size)
    noises = [np.sqrt(common) * shared + np.sqrt(1 - common) * rng.normal(size=time.size) for _ in signals]
    noisy = [one + share * one.std() * noise for one, noise in zip(signals, noises, strict=True)]
    recording = Recording.from_arrays(time, **dict(zip(CHANNELS, noisy, strict=True)))
    own = drive + 0.1 * drive.std() * rng.normal(size=time.size)
    return replace(recording, channels={**recording.channels, DRIVE: Channel(7.0 * own, DRIVE)})


@pytest.mark.parametrize("method", [random_amplitudes, sweep_amplitudes])
def test_a_recorded_drive_is_free_of_the_noise_that_the_sensors_share(method):
    recording = driven(33)
    found = method(recording, BAND)
    off, std = errors_of(found)
    kept = found.relative.max(axis=1) < 0.1
    pulls = (np.stack([off.real, off.imag], 1) / std)[kept]
    assert kept.sum() > 30
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.2)
    assert np.abs(pulls.mean(axis=0)).max() < 4.0 / np.sqrt(kept.sum())
    assert list(check_closure(found)) == check_shared_noise(found) == []
    assert np.median(found.coherence[:, 4]) > 0.9
    (told,) = check_closure(method(recording.without(DRIVE), BAND))
    assert told.verdict == "warning"


def test_a_recorded_drive_serves_without_v2():
    recording = driven(34).without("motion_out")
    found = random_amplitudes(recording, BAND)
    omega = found.phasors.omega
    rig = 1j * omega * random_rig.MASS + random_rig.SPRING / (1j * omega) + 20.0
    off = np.log(found.phasors.mobility / (1 / rig + 1j * omega / random_rig.stiffness(omega)))
    kept = found.relative[:, 0] < 0.1
    pulls = np.concatenate([off.real, off.imag])[np.tile(kept, 2)] / np.tile(found.relative[kept, 0], 2)
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.2)


def _apart():
    recording = recorded(15, length=20.0)
    late = replace(recording.channels["motion_out"], rate=500.0, samples=recording.channels["motion_out"].samples[::2])
    return replace(recording, channels={**recording.channels, "motion_out": late})


@pytest.mark.parametrize(
    ("recording", "band", "error", "said"),
    [
        (lambda: _sines(5.03 * 2 ** (np.arange(16) / 3)), BAND, RecordingError, "separate sines"),
        (lambda: _sines([20.1]), BAND, RecordingError, "separate sines"),
        (swept, BAND, RecordingError, "state kind = sweep"),
        (lambda: recorded(16, length=8.0), BAND, TooShortError, "record 13.2 s or more"),
        (lambda: recorded(17, length=20.0), (600.0, 800.0), RecordingError, "do not resolve 600 Hz"),
        (_apart, BAND, RecordingError, "resample them to one rate"),
        (lambda: recorded(18, length=20.0), (50.001, 50.002), RecordingError, "no line of a spectrum"),
    ],
)
def test_what_is_not_random_or_too_short_is_said(recording, band, error, said):
    with pytest.raises(error, match=said):
        random_amplitudes(recording(), band)


@pytest.mark.parametrize(
    ("recording", "error", "said"),
    [
        (lambda: swept(length=10.0), TooShortError, "record 16.8 s or more"),
        (lambda: _with_a_gap(swept()), RecordingError, "a sweep needs all of them"),
        (_apart, RecordingError, "resample them to one rate"),
    ],
)
def test_what_a_sweep_cannot_be_is_said(recording, error, said):
    with pytest.raises(error, match=said):
        sweep_amplitudes(recording(), BAND)


def _with_a_gap(recording):
    samples = recording.channels["force_in"].samples.copy()
    samples[1000:1010] = np.nan
    force = replace(recording.channels["force_in"], samples=samples)
    return replace(recording, channels={**recording.channels, "force_in": force})


def _smeared(width):
    """A resonance of quality 30 at lines two bins apart, as Hann windows show it in white noise; its exact values."""
    middle, bin_width = 15.0, 15.0 / 30.0 / width
    frequency = middle + 2.0 * bin_width * np.arange(-15, 16)
    apart = np.linspace(-4.0, 4.0, 1601)
    window = (np.sinc(apart) + 0.5 * np.sinc(apart - 1.0) + 0.5 * np.sinc(apart + 1.0)) ** 2
    at = (frequency[:, None] + bin_width * apart) / middle

    def resonance(ratio):
        return 1.0 / (1.0 - ratio**2 + 1j * ratio / 30.0)

    weight = np.sum(window * at**-3, axis=1)
    found = np.sum(window * at**-3 * resonance(at), axis=1) / weight
    exact = Ratios(found[:, None], np.zeros((frequency.size, 2, 2)))
    return exact, weight[:, None].astype(complex), resonance(frequency / middle)


@pytest.mark.parametrize("width", [6.0, 12.0])
def test_the_bend_of_a_ratio_within_a_line_is_in_its_uncertainty(width):
    """With 6 bins in the resonance the error is up to 3 %; its estimate is right to a third where it matters."""
    found, weight, true = _smeared(width)
    off = np.abs(found.values[:, 0] / true - 1.0)
    stated = np.sqrt(np.einsum("lii->l", with_bend(found, weight).covariance))
    large = off[1:-1] > 0.2 * off.max()
    assert large.sum() > 3
    assert (stated / off)[1:-1][large] == pytest.approx(1.0, abs=0.34)
