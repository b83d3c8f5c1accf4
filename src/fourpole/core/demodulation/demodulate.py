"""Demodulation: a recording becomes the complex amplitudes of F1, V1 and V2 at the excitation frequency."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.corrections import Correction, corrections_of, links_of, response_std, without_crosstalk
from fourpole.core.demodulation.halves import changes_of
from fourpole.core.demodulation.preview import Preview, preview
from fourpole.core.demodulation.sinefit import SineFit, fit_sines, refine
from fourpole.core.demodulation.spectrum import (
    LINE_GAP,
    Noise,
    find_lines,
    noise_beside,
    off_multiples,
    sharpened,
    strongest_lines,
)
from fourpole.core.demodulation.spoilt import without_spoilt
from fourpole.core.demodulation.tracks import Track, following, named, tracks_of
from fourpole.core.demodulation.words import word_variance
from fourpole.core.phasor import CHANNELS, Phasors, circular_covariance
from fourpole.core.recording import DERIVATIVES, Channel, Recording
from fourpole.errors import RecordingError, TooShortError

_HARMONICS = 10
#: Number of harmonics that are kept, with the fundamental; higher ones are weak, and a specimen has modes there.
_KEPT = 5
#: Samples of a cycle in which the peak of a periodic signal is looked for.
_OF_A_CYCLE = 512
_MOST_LINES = 12
_LINE_PASSES = 4
#: A line below this share of the fundamental's amplitude is not fitted: it cannot change the result.
_NEGLIGIBLE = 1e-9
_FEWEST_CYCLES = 3.0
#: A line within this share of a stated frequency is taken as the first guess.
_NEAR = 0.05
#: Lines within this share of the fundamental from a harmonic are sidebands of a wandering drive.
_SIDE = 0.35


@dataclass(frozen=True, eq=False)
class Harmonics(ByValue):
    """Harmonics of F1, V1, V2 of one recording, the fundamental first: what a linear specimen and rig must explain.

    Attributes
    ----------
    amplitudes : (3, H) complex array [N], [m/s], [m/s]
        Amplitudes of F1, V1, V2; not-a-number for an absent channel.
    std : (3, H) float array [N], [m/s], [m/s]
        Standard uncertainty of the real and of the imaginary part, from the noise beside each harmonic.
    clear : (H,) bool array
        False where hum of the mains is too close to the harmonic.
    """

    amplitudes: ComplexArray
    std: FloatArray
    clear: BoolArray


@dataclass(frozen=True, eq=False)
class Demodulation(ByValue):
    """Amplitudes of one recording, with their covariance and figures of quality.

    Attributes
    ----------
    phasors : Phasors
        Amplitudes of F1, V1 and V2 of one test (shape ()), with the covariance of the noise.
    cycles : float [1]
        Length of the record in cycles; it need not be whole.
    band : (float, float) [Hz]
        Lowest and highest frequency at which the noise was estimated.
    distortion : (3,) float [1]
        Root of the summed squares of the harmonics over the fundamental, of F1 and of the displacements behind V1, V2.
    noise_ratio : (3,) float [1]
        Root mean square of the residual over root mean square of the fundamental.
    force_peak : float [N]
        Largest dynamic force, harmonics included; not-a-number without F1.
    lines : (L,) float [Hz]
        Interfering lines that were found, or stated, and removed.
    missing : float [1]
        Share of missing samples.
    spoilt : (3,) float [1]
        Share of drop-outs and spikes in each channel; the fit leaves them out of all channels.
    changes : (3, 2) float [1], [rad]
        Changes of amplitude and phase from the first half to the second.
    speed_change : float [1]
        Relative change of the speed between the halves.
    channels : tuple of str
        Roles of the channels demodulated, in the order of `preview`.
    preview : Preview
        A few cycles of signal and fit, and the extremes of the residual.
    harmonics : Harmonics
        The first harmonics with their noise; declared cross-talk is not removed from them.
    corrections : tuple of Correction
        Effects of the measurement chain that were removed from the amplitudes.
    """

    phasors: Phasors
    cycles: float
    band: tuple[float, float]
    distortion: FloatArray
    noise_ratio: FloatArray
    force_peak: float
    lines: FloatArray
    missing: float
    spoilt: FloatArray
    changes: FloatArray
    speed_change: float
    channels: tuple[str, ...]
    preview: Preview
    harmonics: Harmonics
    corrections: tuple[Correction, ...] = ()

    @property
    def response_std(self) -> FloatArray:
        """Standard uncertainties of gain [1] and phase [rad] from the calibrated responses of F1, V1, V2, (3, 2)."""
        return response_std(self.corrections)


def demodulate(
    recording: Recording,
    *,
    frequency: float | None = None,
    near: float | None = None,
    start: float | None = None,
    mains: float | None = None,
    harmonics: int = _HARMONICS,
) -> Demodulation:
    r"""Complex amplitudes of F1, V1, V2 at the excitation frequency, with their 6×6 covariance.

    Least squares with harmonics of the excitation, mean, a cubic drift and interfering lines. All channels share one
    frequency, and each has its own times. If the recording has a reference, the sines follow its phase, and amplitudes
    are those at the mean speed. Delays, filters and cross-talk are corrected at the amplitudes. The covariance comes
    from the spectrum and cross-spectra of the residual beside the frequency, so that it includes common noise.

    Parameters
    ----------
    recording : Recording
        A recording of at least three cycles.
    frequency : float [Hz], optional
        The excitation frequency, if it is known exactly. Otherwise it is the mean speed of the recording's reference,
        or it is estimated.
    near : float [Hz], optional
        The search for the excitation prefers a line within 5 % of this value. The estimate comes from the recording.
    start : float [Hz], optional
        First guess of the frequency, if it was made before, as by `first_guess`.
    mains : float [Hz], optional
        Mains frequency to remove with its harmonics. Lines that stand out of the noise are found without it.
    harmonics : int
        Most multiples of the excitation that are fitted; a low sampling rate allows fewer.

    Returns
    -------
    Demodulation
        Amplitudes at the middle of the record, with figures of quality.

    Raises
    ------
    RecordingError
        If the record is too short, a channel is constant or has too many gaps, or nothing is excited.

    Notes
    -----
    A harmonic of the excitation within 2.5 bins (1/T) of a multiple of 50 Hz, 60 Hz or `mains`, or of a line found,
    does not inform the frequency, so hum at that harmonic does not bias the frequency. The harmonic includes such hum.

    Samples are gone through once, as sums over blocks times powers of the time, from which the sums at all frequencies
    that are tried near by follow; gaps and interfering lines are held exactly. Along a reference, and along the phase
    of a wandering drive, sines have no such sums: a table of them is made for each set of frequencies, which takes
    several times as long (`fourpole.core.demodulation.terms.rows_of`).

    References
    ----------
    IEEE Std 1057-2017, sine fits of three and four parameters; S. M. Kay, "Fundamentals of Statistical Signal
    Processing", vol. I, 1993, ch. 7.

    Examples
    --------
    >>> t = np.arange(5000) / 1000.0
    >>> wave = np.exp(2j * np.pi * 10.3 * t)
    >>> result = demodulate(Recording.from_arrays(t, force_in=(60j * wave).real, motion_in=(0.06 * wave).real))
    >>> result.phasors.frequency.round(9), abs(result.phasors.mobility).round(12)
    (np.float64(10.3), np.float64(0.001))
    """
    names = [name for name in CHANNELS if name in recording.channels]
    tracks = tracks_of(recording, names)
    if recording.reference is not None and frequency is None:
        tracks, omega = following(tracks, recording.reference, recording.span)
        frequency = omega / (2 * np.pi)
    free = frequency is None
    if frequency is None:
        frequency = start if start is not None else _strongest(recording, tracks[0], near)
    _check_length(recording, tracks, frequency, given=not free)
    if free:
        frequency = sharpened(tracks[0].spectrum, tracks[0].rate / tracks[0].time.size, frequency)
    fits, informing = [], []
    for track in tracks:
        count = max(1, min(harmonics, int(0.45 * track.rate / frequency)))
        informing.append(_informing(frequency, count, track.rate / track.time.size, mains))
        fits.append(fit_sines(track, 2 * np.pi * frequency, count, np.empty(0)))
    if free:
        fits, _ = refine(fits, informing=informing)
    fits = without_spoilt(fits, informing, free=free)
    fits = _remove_lines(fits, informing, mains, free=free)

    noise = noise_beside(fits, min(_KEPT, *(fit.harmonics for fit in fits)))
    fits, omega_std = refine(fits, informing=informing, free=free, weights=_weights(fits, noise[0]))
    return _assemble(recording, fits, noise, omega_std)


def _weights(fits: list[SineFit], noise: Noise) -> list[FloatArray]:
    """Inverse variances of the samples of each channel, for white noise of the level beside the frequency."""
    weights, variances = [], noise.covariance.diagonal().real
    for fit in fits:
        track, variance = fit.track, variances[: len(fit.track.signals)]
        variances = variances[variance.size :]
        weights.append(1.0 / np.maximum(variance * (track.known / 4.0), track.energy * (1e-30 / track.known) + 1e-300))
    return weights


def first_guess(recording: Recording, near: float | None = None) -> float:
    """A rough estimate of the excitation's frequency [Hz]; `demodulate` documents `near` and the errors.

    Examples
    --------
    >>> t = np.arange(5000) / 1000.0
    >>> round(first_guess(Recording.from_arrays(t, force_in=t, motion_in=np.sin(2 * np.pi * 10.3 * t))), 1)
    10.3
    """
    with suppress(RecordingError):
        tracks = tracks_of(recording, [name for name in CHANNELS if name in recording.channels])
        if len(tracks) == 1 and tracks[0].known == tracks[0].time.size:
            return _strongest(recording, tracks[0], near)
    return _strongest(recording, tracks_of(recording, ["motion_in"])[0], near)


def _strongest(recording: Recording, track: Track, near: float | None) -> float:
    """Frequency of the strongest line of V1 [Hz], or of a strong line near the stated frequency."""
    if near is not None:
        _check_resolved(recording, track, near)
    order = DERIVATIVES[recording.channels["motion_in"].quantity]
    lines = strongest_lines(track.spectrum, track.rate / track.time.size, order=order)
    beside = [] if near is None else [line.bin for line in lines if abs(line.bin - near) <= _NEAR * near]
    return beside[0] if beside else lines[0].frequency


def _check_length(recording: Recording, tracks: list[Track], frequency: float, *, given: bool) -> None:
    """Raise RecordingError if the sampling is too slow or the recording too short for a frequency [Hz]."""
    slowest = min(tracks, key=lambda track: track.rate)
    _check_resolved(recording, slowest, frequency, f" of {named(slowest.names[0])}" if len(tracks) > 1 else "")
    cycles = frequency * recording.duration
    if cycles < _FEWEST_CYCLES - (1e-6 if given else 0.02):
        raise TooShortError(
            f"{recording.label} holds {cycles:.2g} cycles of {frequency:.4g} Hz, "
            f"at least {_FEWEST_CYCLES:g} are needed: record longer"
        )


def _check_resolved(recording: Recording, track: Track, frequency: float, which: str = "") -> None:
    """Raise RecordingError if the sampling rate of a track is too low for a frequency [Hz]."""
    if not 0 < frequency < 0.45 * track.rate:
        raise RecordingError(
            f"{recording.label}: an excitation at {frequency:.6g} Hz is not resolved by "
            f"{track.rate:.6g} samples per second{which}; sample faster"
        )


def _informing(frequency: float, count: int, resolution: float, mains: float | None) -> BoolArray:
    """Flags (count,) of the harmonics that inform the frequency: the fundamental, and those that cannot be hum."""
    multiples = frequency * np.arange(1, count + 1)
    clear = np.ones(count, dtype=bool)
    for base in {50.0, 60.0, mains or 50.0}:
        clear &= off_multiples(multiples, base) > (LINE_GAP + 1.0) * resolution
    clear[0] = True
    return clear


def _remove_lines(fits: list[SineFit], informing: list[BoolArray], mains: float | None, *, free: bool) -> list[SineFit]:
    """Fit the stated mains and the lines that stand out of the residual, each at its own free frequency.

    If a line is too close to a harmonic to be separated from it, that harmonic becomes unsteady instead.
    """
    for number in range(_LINE_PASSES):
        wider = [_with_lines(fit, mains if number == 0 else None) for fit in fits]
        if all(more is None for more in wider):
            break
        fits = [fit if more is None else more for fit, more in zip(fits, wider, strict=True)]
        fits, _ = refine(fits, informing=informing, free=free)
    return fits


def _with_lines(fit: SineFit, mains: float | None) -> SineFit | None:
    """The fit with the lines of its residual and of `mains`; None if there are no lines or too few samples."""
    rate = fit.track.exact_rate
    stated = np.empty(0) if mains is None else mains * np.arange(1, max(1, min(5, int(0.45 * rate / mains))) + 1)
    size = np.hypot(*fit.coefficients[:2])
    shown = find_lines(fit.residual, rate, _NEGLIGIBLE * size)
    lines, unsteady = _new_terms(
        fit, np.concatenate([stated, shown if fit.track.course is None else _foreign(shown, fit, mains)])
    )
    more = 2 * lines.size + 4 * (len(unsteady) - len(fit.unsteady))
    if not more or fit.dof < 4 * (fit.size + more):
        return None
    return fit.at(fit.omega, np.concatenate([fit.lines, 2 * np.pi * lines]), unsteady)


def _foreign(lines: FloatArray, fit: SineFit, mains: float | None) -> FloatArray:
    """Lines [Hz] that are not sidebands of a followed drive: those of the mains, and those far from any harmonic."""
    fundamental = fit.omega / (2 * np.pi)
    beside = off_multiples(lines, fundamental) < _SIDE * fundamental
    gap = LINE_GAP * fit.resolution
    hum = [off_multiples(lines, base) < gap for base in (50.0, 60.0, mains or 50.0)]
    return lines[~beside | np.any(hum, axis=0)]


def _new_terms(fit: SineFit, shown: FloatArray) -> tuple[FloatArray, tuple[int, ...]]:
    """The lines shown [Hz] that can be fitted as lines, and the numbers of the unsteady harmonics."""
    lines: list[float] = []
    unsteady = set(fit.unsteady)
    fundamental, gap = fit.omega / (2 * np.pi), LINE_GAP * fit.resolution
    for line in shown:
        multiple = round(line / fundamental)
        others = np.concatenate([fit.lines / (2 * np.pi), lines, [0.0, 0.5 * fit.track.exact_rate]])
        if 1 <= multiple <= fit.harmonics and abs(line - multiple * fundamental) < gap:
            unsteady |= {multiple} - {1}
        elif np.min(np.abs(others - line)) >= gap and fit.lines.size + len(lines) < _MOST_LINES:
            lines.append(float(line))
    return np.array(lines), tuple(sorted(unsteady))


def _assemble(recording: Recording, fits: list[SineFit], noises: list[Noise], omega_std: float) -> Demodulation:
    """The amplitudes of F1, V1, V2 and their figures of quality, from the final fits of all tracks."""
    omega, noise = fits[0].omega, noises[0]
    names = [name for fit in fits for name in fit.track.names]
    places = [CHANNELS.index(name) for name in names]
    recorded = [row for fit in fits for row in fit.amplitudes()]
    true = [
        row * _to_velocity(recording.channels[name], omega, row.size) for name, row in zip(names, recorded, strict=True)
    ]
    distortion, noise_ratio, spoilt = np.full((3, 3), np.nan)
    distortion[places] = [_distortion(name, row) for name, row in zip(names, true, strict=True)]
    sizes, inflation = np.abs([row[0] for row in recorded]), []
    squares = [np.vecdot(fit.residual, fit.residual) / fit.track.time.size for fit in fits]
    noise_ratio[places] = np.sqrt(2.0 * np.concatenate(squares)) / sizes
    spoilt[places] = 0.0
    for fit in fits:  # the standard deviation of the fundamental over that of a sine fitted alone to as many samples
        inflation += [np.sqrt(fit.amplitude_variance() * fit.track.known / 2.0)] * len(fit.track.names)
        if fit.track.spoilt is not None:
            spoilt[[CHANNELS.index(name) for name in fit.track.names]] = np.mean(fit.track.spoilt, axis=1)
    mixed, talk = without_crosstalk(recording, names, omega)
    to_true = mixed * np.array([row[0] / raw[0] for row, raw in zip(true, recorded, strict=True)])
    wider = to_true * np.array(inflation)
    amplitudes = np.full(3, complex(np.nan, np.nan))
    amplitudes[places] = mixed @ np.array([row[0] for row in true])
    whole = np.zeros((3, 3), dtype=complex)
    whole[np.ix_(places, places)] = wider @ noise.covariance @ wider.conj().T
    signals, roots = [signal for fit in fits for signal in fit.track.signals], np.sqrt(np.concatenate(squares))
    steps = [word_variance(*one) for one in zip(signals, sizes.tolist(), roots.tolist(), strict=True)]
    whole[np.ix_(places, places)] += 2.0 * (to_true * np.array(steps)) @ to_true.conj().T
    order = np.argsort(places).tolist()
    changes, speed_change = changes_of(fits, places)
    return Demodulation(
        phasors=Phasors(
            frequency=np.asarray(omega / (2 * np.pi)),
            amplitudes=amplitudes,
            covariance=circular_covariance(whole),
            frequency_std=np.asarray(omega_std / (2 * np.pi)),
            dof=np.asarray(noise.dof),
        ),
        cycles=omega * recording.duration / (2 * np.pi),
        band=noise.band,
        distortion=distortion,
        noise_ratio=noise_ratio,
        force_peak=_peak_of(true[names.index("force_in")]) if "force_in" in names else float("nan"),
        lines=np.concatenate([fit.lines for fit in fits]) / (2 * np.pi),
        missing=1.0 - min(np.count_nonzero(fit.track.recorded) / fit.track.time.size for fit in fits),
        spoilt=spoilt,
        changes=changes,
        speed_change=speed_change,
        channels=tuple(names[i] for i in order),
        preview=preview(fits, order),
        harmonics=_harmonics(fits, noises, places, recorded, true),
        corrections=(*corrections_of(recording, names, omega), *talk),
    )


def _distortion(role: str, amplitudes: ComplexArray) -> float:
    """Root of the summed squares of the harmonics over the fundamental, of a force or a displacement [1]."""
    sizes = np.abs(amplitudes)
    # Harmonic n of a velocity is n times that of its displacement, both over their fundamentals.
    over = sizes[1:] if role == "force_in" else sizes[1:] / np.arange(2.0, sizes.size + 1)
    return float(np.sqrt(over @ over) / sizes[0])


def _harmonics(
    fits: list[SineFit],
    noises: list[Noise],
    places: list[int],
    recorded: Sequence[ComplexArray],
    true: Sequence[ComplexArray],
) -> Harmonics:
    """As many harmonics as there are noises, from the amplitudes of each channel: in recorded units, and true."""
    count = len(noises)
    amplitudes, std = np.full((3, count), complex(np.nan, np.nan)), np.full((3, count), np.nan)
    stds = np.sqrt(0.5 * np.abs([noise.covariance.diagonal() for noise in noises])).T
    raw, whole = (np.array([row[:count] for row in rows]) for rows in (recorded, true))
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.abs(whole / raw)
    scale[~np.isfinite(scale)] = 0.0
    amplitudes[places], std[places] = whole, stds * scale
    # Only hum of the mains can stand at a harmonic: other lines are in the fit themselves.
    multiples = fits[0].omega / (2 * np.pi) * np.arange(1, count + 1)
    gap = (LINE_GAP + 1.0) * max(fit.resolution for fit in fits)
    hum = [off_multiples(multiples, base) < gap for base in (50.0, 60.0)]
    return Harmonics(amplitudes, std, np.asarray(~np.any(hum, axis=0)))


def _to_velocity(channel: Channel, omega: float, harmonics: int) -> ComplexArray:
    """Factors (harmonics,) that turn recorded amplitudes into those of the force or velocity at the sensor."""
    each = omega * np.arange(1, harmonics + 1)
    factors = (1j * each) ** DERIVATIVES[channel.quantity]
    for link in links_of(channel):
        factors = factors / link.at(each / (2 * np.pi))
    return np.asarray(factors)


def _peak_of(amplitudes: ComplexArray) -> float:
    """Largest absolute value of a periodic signal, from the complex amplitudes of its harmonics."""
    spectrum = np.concatenate([[0.0], 0.5 * _OF_A_CYCLE * amplitudes])
    return float(np.max(np.abs(np.fft.irfft(spectrum, _OF_A_CYCLE))))
