"""Demodulation: a recording becomes the complex amplitudes of F1, V1 and V2 at the excitation frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.preview import Preview, preview
from fourpole.core.recording import DERIVATIVES, Channel, Recording
from fourpole.core.sinefit import SineFit, fit_sines, refine
from fourpole.core.spectrum import LINE_GAP, Noise, find_lines, noise_beside, strongest_line
from fourpole.errors import RecordingError

__all__ = ["Demodulation", "demodulate"]


_HARMONICS = 10
_MOST_LINES = 12
_LINE_PASSES = 4
_NEGLIGIBLE = 1e-9  # of the fundamental: a line that small cannot matter
_FEWEST_CYCLES = 3.0
_FEWEST_SAMPLES = 16
_MOST_MISSING = 0.2
_LARGEST = 1e30  # beyond any measurement, and safe to square
_NEAR = 0.05


@dataclass(frozen=True)
class Demodulation:
    """Amplitudes of one recording, and how good they are.

    Attributes
    ----------
    phasors : Phasors
        Of shape (): F1, V1, V2 with noise covariance.
    cycles : float [1]
        Length of the record in cycles; it need not be whole.
    band : (float, float) [Hz]
        Where the noise was taken.
    distortion : (3,) float [1]
        Root of the summed squares of the harmonics over the fundamental, of F1 and of the displacements behind V1, V2.
    noise_ratio : (3,) float [1]
        Root mean square of the residual over that of the fundamental.
    force_peak : float [N]
        Largest dynamic force, harmonics included; not-a-number without F1.
    lines : (L,) float [Hz]
        Interfering lines that were found, or stated, and removed.
    missing : float [1]
        Share of the samples that were missing.
    channels : tuple of str
        The channels demodulated, in the order of `preview`.
    preview : Preview
        A few cycles of signal and fit, and the residual's extremes.
    """

    phasors: Phasors
    cycles: float
    band: tuple[float, float]
    distortion: FloatArray
    noise_ratio: FloatArray
    force_peak: float
    lines: FloatArray
    missing: float
    channels: tuple[str, ...]
    preview: Preview


def demodulate(
    recording: Recording,
    *,
    frequency: float | None = None,
    near: float | None = None,
    mains: float | None = None,
    harmonics: int = _HARMONICS,
) -> Demodulation:
    r"""Complex amplitudes of F1, V1, V2 at the excitation frequency, with their 6×6 covariance.

    Least squares with harmonics of the excitation, mean, a cubic drift and interfering lines; one frequency for all
    channels. The noise is that of the residual's spectrum beside the frequency, cross-spectra included, so that what
    channels have in common stays common.

    Parameters
    ----------
    recording : Recording
        At least three cycles.
    frequency : float [Hz], optional
        The excitation frequency, if it is known exactly; otherwise it is estimated.
    near : float [Hz], optional
        Where a line within 5 % is looked for first; the estimate itself comes from the recording.
    mains : float [Hz], optional
        Mains frequency to remove with its harmonics. Lines that stand out of the noise are found without it.
    harmonics : int
        Most multiples of the excitation that are fitted; fewer where the sampling rate holds fewer.

    Returns
    -------
    Demodulation
        Amplitudes at the middle of the record, with quality figures.

    Raises
    ------
    RecordingError
        If the record is too short, a channel is constant or has too many gaps, or nothing is excited.

    Notes
    -----
    A harmonic of the excitation within 2.5 bins (1/T) of a multiple of 50 or 60 Hz, of `mains` or of a line found does
    not inform the frequency, so hum that falls on it biases nothing; such hum is left to the harmonic.

    References
    ----------
    IEEE Std 1057-2017 (sine fitting); S. M. Kay, "Fundamentals of Statistical Signal Processing", vol. I, 1993, ch. 7.

    Examples
    --------
    >>> t = np.arange(5000) / 1000.0
    >>> wave = np.exp(2j * np.pi * 10.3 * t)
    >>> found = demodulate(Recording.from_arrays(t, force_in=(60j * wave).real, motion_in=(0.06 * wave).real))
    >>> found.phasors.frequency.round(9), abs(found.phasors.mobility).round(12)
    (np.float64(10.3), np.float64(0.001))
    """
    names = [name for name in CHANNELS if name in recording.channels]
    signals, present = _signals(recording, names)
    rate = recording.sample_rate
    time = (np.arange(recording.size) - 0.5 * (recording.size - 1)) / rate
    start = frequency if frequency is not None else _start(signals[names.index("motion_in")], recording, near)
    _check_length(recording, start, given=frequency is not None)

    count = max(1, min(harmonics, int(0.45 * rate / start)))
    fit = fit_sines(signals, present, time, 2 * np.pi * start, count, np.empty(0))
    free = frequency is None
    informing = _informing(start, count, rate / recording.size, mains)
    if free:
        fit, _ = refine(fit, signals, informing=informing)
    fit = _remove_lines(fit, signals, informing, rate, mains, free=free)

    found = fit.omega / (2 * np.pi)
    noise = noise_beside(fit.residual, present, rate, found, fit.lines / (2 * np.pi), fit.dof)
    white = np.maximum(np.diag(noise.covariance).real, 0.0) * present.sum() / 4.0
    floor = np.max(np.abs(signals), axis=1) ** 2 * 1e-30 + 1e-300
    fit, omega_std = refine(fit, signals, informing=informing, free=free, weights=1.0 / np.maximum(white, floor))
    return _assemble(recording, names, signals, fit, noise, omega_std)


def _signals(recording: Recording, names: list[str]) -> tuple[FloatArray, BoolArray]:
    """Channels (C, N) less their means, missing samples set to 0; and which samples all channels have."""
    raw = np.stack([recording.channels[name].samples for name in names])
    if raw.shape[1] < _FEWEST_SAMPLES:
        raise RecordingError(
            f"{recording.label} has {raw.shape[1]} samples, at least {_FEWEST_SAMPLES} are needed: "
            "record three cycles or more"
        )
    there = np.isfinite(raw)
    present = np.asarray(there.all(axis=0))
    if np.mean(present) < 1.0 - _MOST_MISSING:
        worst = int(np.argmin(there.mean(axis=1)))
        raise RecordingError(
            f"{_named(names[worst])}: {1.0 - there[worst].mean():.0%} of the samples are missing "
            f"({1.0 - present.mean():.0%} in any channel), at most {_MOST_MISSING:.0%} can be bridged; "
            "record the test again"
        )
    signals = np.where(present, raw, 0.0)
    size = np.max(np.abs(signals), axis=1)
    for name, largest in zip(names, size, strict=True):
        if largest > _LARGEST:
            raise RecordingError(
                f"{_named(name)} reaches {largest:.3g} in SI units, which is no measurement: "
                "check its column, unit and gain"
            )
    signals -= np.where(present, signals.sum(axis=1, keepdims=True) / present.sum(), 0.0)
    for name, row, largest in zip(names, signals, size, strict=True):
        if np.max(np.abs(row)) <= 1e-12 * largest or largest == 0:
            raise RecordingError(
                f"{_named(name)} is constant ({largest:.6g} in SI units): "
                "the sensor was off, unplugged, or another column is meant"
            )
    return signals, present


def _named(role: str) -> str:
    return f"{SYMBOLS[role]} ({role})"


def _start(motion: FloatArray, recording: Recording, near: float | None) -> float:
    """First guess of the excitation frequency [Hz]: the strongest line of V1, or a strong one near the stated."""
    order = DERIVATIVES[recording.channels["motion_in"].quantity]
    index = np.arange(motion.size) - 0.5 * (motion.size - 1)
    trend = motion.mean() + index * (index @ motion / (index @ index))
    strongest, frequency, spectrum = strongest_line(motion - trend, recording.sample_rate, order=order)
    if near is not None:
        beside = np.flatnonzero(np.abs(frequency - near) <= _NEAR * near)
        if beside.size:
            best = beside[np.argmax(spectrum[beside])]
            peaks = 0 < best < spectrum.size - 1 and spectrum[best] >= max(spectrum[best - 1], spectrum[best + 1])
            if peaks and spectrum[best] >= 0.3 * spectrum.max():
                return float(frequency[best])
    return strongest


def _check_length(recording: Recording, frequency: float, *, given: bool) -> None:
    if not 0 < frequency < 0.45 * recording.sample_rate:
        raise RecordingError(
            f"{recording.label}: an excitation at {frequency:.6g} Hz is not resolved by "
            f"{recording.sample_rate:.6g} samples per second; sample faster"
        )
    cycles = frequency * recording.duration
    if cycles < _FEWEST_CYCLES - (1e-6 if given else 0.02):
        raise RecordingError(
            f"{recording.label} holds {cycles:.2g} cycles of {frequency:.4g} Hz, "
            f"at least {_FEWEST_CYCLES:g} are needed: record longer"
        )


def _informing(frequency: float, count: int, resolution: float, mains: float | None) -> BoolArray:
    """Which harmonics speak of the frequency: the fundamental, and those that cannot be hum."""
    multiples = frequency * np.arange(1, count + 1)
    clear = np.ones(count, dtype=bool)
    for base in {50.0, 60.0, mains or 50.0}:
        off = np.abs(multiples - base * np.maximum(np.round(multiples / base), 1.0))
        clear &= off > (LINE_GAP + 1.0) * resolution
    clear[0] = True
    return clear


def _remove_lines(
    fit: SineFit, signals: FloatArray, informing: BoolArray, rate: float, mains: float | None, *, free: bool
) -> SineFit:
    """Fit stated mains and whatever lines stand out of the residual, each at its own free frequency.

    A line too close to a harmonic to be told from it makes that harmonic unsteady instead.
    """
    found = np.empty(0) if mains is None else mains * np.arange(1, max(1, min(5, int(0.45 * rate / mains))) + 1)
    for _ in range(_LINE_PASSES):
        size = np.hypot(*fit.coefficients[:2])
        found = np.concatenate([found, find_lines(fit.residual, rate, _NEGLIGIBLE * size)])
        lines, unsteady = _new_terms(fit, found, rate / signals.shape[1], rate)
        wider = 2 * lines.size + 4 * (len(unsteady) - len(fit.unsteady))
        if not wider or fit.dof < 4 * (fit.basis.shape[0] + wider):
            break
        joined = np.concatenate([fit.lines, 2 * np.pi * lines])
        fit = fit_sines(signals, fit.present, fit.time, fit.omega, fit.harmonics, joined, unsteady)
        fit, _ = refine(fit, signals, informing=informing, free=free)
        found = np.empty(0)
    return fit


def _new_terms(fit: SineFit, found: FloatArray, resolution: float, rate: float) -> tuple[FloatArray, tuple[int, ...]]:
    """Which of the lines found can be fitted as such, and which harmonics they make unsteady."""
    lines: list[float] = []
    unsteady = set(fit.unsteady)
    for line in found:
        fundamental = fit.omega / (2 * np.pi)
        multiple = round(line / fundamental)
        others = np.concatenate([fit.lines / (2 * np.pi), lines, [0.0, 0.5 * rate]])
        if 1 <= multiple <= fit.harmonics and abs(line - multiple * fundamental) < LINE_GAP * resolution:
            unsteady |= {multiple} - {1}
        elif np.min(np.abs(others - line)) >= LINE_GAP * resolution and fit.lines.size + len(lines) < _MOST_LINES:
            lines.append(float(line))
    return np.array(lines), tuple(sorted(unsteady))


def _assemble(
    recording: Recording, names: list[str], signals: FloatArray, fit: SineFit, noise: Noise, omega_std: float
) -> Demodulation:
    amplitudes = fit.amplitudes()
    at = [CHANNELS.index(name) for name in names]
    to_si = np.array([_to_velocity(recording.channels[name], fit.omega) for name in names])

    inflation = fit.amplitude_variance() * fit.present.sum() / 2.0
    covariance = noise.covariance * inflation * np.outer(to_si, to_si.conj())
    whole = np.zeros((3, 3), dtype=complex)
    whole[np.ix_(at, at)] = covariance
    si_amplitudes = np.full(3, complex(np.nan, np.nan))
    si_amplitudes[at] = amplitudes[:, 0] * to_si

    quality = np.full((2, 3), np.nan)
    fundamental = np.abs(amplitudes[:, 0])
    # Harmonic n of a velocity is n times too large for a displacement, of an acceleration n² times.
    integrations = [1 - DERIVATIVES[q] if (q := recording.channels[name].quantity) != "force" else 0 for name in names]
    numbers = np.arange(1.0, fit.harmonics + 1) ** -np.array(integrations)[:, None]
    quality[0, at] = np.sqrt(np.sum(np.abs(amplitudes * numbers)[:, 1:] ** 2, axis=1)) / fundamental
    quality[1, at] = np.sqrt(2 * np.mean(fit.residual**2, axis=1)) / fundamental
    return Demodulation(
        phasors=Phasors(
            frequency=np.asarray(fit.omega / (2 * np.pi)),
            amplitudes=si_amplitudes,
            covariance=_real_covariance(whole),
            frequency_std=np.asarray(omega_std / (2 * np.pi)),
            dof=np.asarray(noise.dof),
        ),
        cycles=fit.omega * recording.duration / (2 * np.pi),
        band=noise.band,
        distortion=quality[0],
        noise_ratio=quality[1],
        force_peak=_peak_of(amplitudes[names.index("force_in")]) if "force_in" in names else float("nan"),
        lines=fit.lines / (2 * np.pi),
        missing=1.0 - float(np.mean(fit.present)),
        channels=tuple(names),
        preview=preview(fit, signals),
    )


def _to_velocity(channel: Channel, omega: float) -> complex:
    """Factor from a recorded amplitude to that of the force or velocity at the sensor, delay undone."""
    return complex((1j * omega) ** DERIVATIVES[channel.quantity] * np.exp(1j * omega * channel.delay))


def _real_covariance(gamma: ComplexArray) -> FloatArray:
    """Covariance (6, 6) of interleaved Re, Im from the E[dX dX*] (3, 3) of circular noise."""
    result = np.empty((6, 6))
    result[0::2, 0::2] = result[1::2, 1::2] = 0.5 * gamma.real
    result[1::2, 0::2] = 0.5 * gamma.imag
    result[0::2, 1::2] = -0.5 * gamma.imag
    return result


def _peak_of(amplitudes: ComplexArray) -> float:
    """Largest absolute value of a periodic wave given by its harmonics."""
    turn = np.exp(2j * np.pi * np.outer(np.arange(1, amplitudes.size + 1), np.arange(512) / 512))
    return float(np.max(np.abs((amplitudes @ turn).real)))
