"""Amplitudes of F1, V1 and V2 at many frequencies of a recording under random excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.corrections import Correction, corrections_of, links_of, without_crosstalk
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import DERIVATIVES, Recording
from fourpole.core.spectra.average import CrossSpectra, cross_spectra
from fourpole.core.spectra.lines import thinned
from fourpole.core.spectra.ratios import CLOSURE, OF_V1, OF_V2, ratios
from fourpole.errors import RecordingError, TooShortError

#: Number of segments that a first estimate takes, and the fewest that are taken for finer lines.
_MANY, _FEW = 128, 32
#: Share of such lines above which the motion has separate sines.
_FOREIGN = 0.05
#: Number of segments that hold the power at a frequency, below which the excitation is a sweep.
_SWEPT = 8.0
#: Standard uncertainty of a phase that round-off leaves [rad].
_ROUND_OFF = 1e-12
#: Fewest cycles of the lowest frequency in a segment.
_CYCLES = 4.0
#: Segments are made longer while the mean square of the closure phase over its variance is above the first number, and
#: falls below this share of what it was.
_LEAKS, _BETTER = 1.5, 0.8


@dataclass(frozen=True)
class Line:
    """What the averaged spectra show of one line beside its amplitudes.

    Attributes
    ----------
    width : float [Hz]
        Width of the band that it stands for.
    averages : float [1]
        Number of independent averages.
    coherence : tuple of three floats [1]
        Coherence of F1 and V1, V1 and V2, V2 and F1; not-a-number without V2.
    closure, closure_std : float [rad]
        Closure phase and its standard uncertainty; not-a-number without V2.
    estimates : tuple of three complex numbers [m/(N s)]
        Mobility V1/F1 by H1, H2 and Hv.
    """

    width: float
    averages: float
    coherence: tuple[float, ...]
    closure: float
    closure_std: float
    estimates: tuple[complex, ...]


@dataclass(frozen=True, eq=False)
class Excited(ByValue):
    """Amplitudes of one recording at many frequencies, with figures of quality of each line.

    Attributes
    ----------
    phasors : Phasors
        Amplitudes (L,) of F1, V1, V2 of a sine whose deflection has the power of the whole band; the phase of V1 is
        zero. Only their ratios are measured: these have the uncertainty of the noise.
    coherence : (L, 3) float array [1]
        Coherence of F1 and V1, V1 and V2, V2 and F1; not-a-number without V2.
    closure : (L, 2) float array [rad]
        Closure phase and its standard uncertainty; not-a-number without V2.
    estimates : (L, 3) complex array [m/(N s)]
        Mobility V1/F1 by H1, H2 and Hv, their geometric mean.
    relative : (L, 2) float array [1]
        Standard uncertainties of F1/V1 and of V2/V1, relative to their moduli.
    misfit : float [1]
        Mean square of the closure phase over its variance; the covariance is enlarged by it where it exceeds 1.
        Not-a-number without V2.
    held : (L,) float array [1]
        Number of segments that hold the power of the motion.
    foreign : float [1]
        Share of the lines whose motion is that of a sine at another frequency.
    averages : (L,) float array [1]
        Number of independent averages.
    width : (L,) float array [Hz]
        Width of the band that a line stands for.
    segment : float [s]
        Length of the segments.
    deflection : float [m]
        Amplitude of the deflection, 0 to peak of a sine with the power of V1 - V2 in the band, or of V1 without V2.
    force_peak : float [N]
        Largest departure of F1 from its mean.
    corrections : tuple of tuple of Correction
        Effects of the measurement chain that were removed, for each line.
    """

    phasors: Phasors
    coherence: FloatArray
    closure: FloatArray
    estimates: ComplexArray
    relative: FloatArray
    misfit: float
    held: FloatArray
    foreign: float
    averages: FloatArray
    width: FloatArray
    segment: float
    deflection: float
    force_peak: float
    corrections: tuple[tuple[Correction, ...], ...] = ()

    def line(self, at: int) -> Line:
        """What the spectra show of one line."""
        closure, std = self.closure[at].tolist()
        return Line(
            float(self.width[at]), float(self.averages[at]), tuple(self.coherence[at].tolist()), closure, std,
            tuple(self.estimates[at].tolist()),
        )  # fmt: skip


def random_amplitudes(recording: Recording, band: tuple[float, float], segment: float | None = None) -> Excited:
    r"""Complex amplitudes of F1, V1, V2 at the lines of a band, from averaged cross spectra.

    .. math:: \frac{F_1}{V_1} = \frac{G_{F2}}{G_{12}}, \qquad \frac{V_2}{V_1} = \frac{G_{2F}}{G_{1F}}

    V2 is the instrument for F1/V1, and F1 that for V2/V1: noise that is independent between the channels leaves no
    bias. With only F1 and V1 the ratio is the geometric mean of H1 and H2.

    Parameters
    ----------
    recording : Recording
        Channels with the same sampling times.
    band : (float, float) [Hz]
        Lowest and highest frequency.
    segment : float [s], optional
        Length of the segments. By default the record has some 128 segments, and fewer, longer ones while the closure
        phase shows leakage.

    Raises
    ------
    RecordingError
        If the channels differ in their sampling times, a channel is constant, or no line lies in the band.
    TooShortError
        If the record has fewer than eight segments.

    References
    ----------
    J. S. Bendat and A. G. Piersol, "Random Data", 4th ed., 2010; A. Wicks and H. Vold, "The Hs frequency response
    function estimator", Proc. 4th IMAC, 1986.
    """
    names = [name for name in CHANNELS if name in recording.channels]
    if "force_in" not in names:
        raise RecordingError(f"{recording.label}: random excitation needs F1 (force_in)")
    tracks = tracks_of(recording, names)
    if len(tracks) > 1:
        raise RecordingError(
            f"{recording.label}: the channels differ in their sampling times: resample them to one rate for random "
            "excitation"
        )
    track = tracks[0]
    top = 0.45 * track.rate
    if band[0] >= top:
        raise RecordingError(f"{recording.label}: {track.rate:.6g} samples per second do not resolve {band[0]:.4g} Hz")
    inside = (band[0], min(band[1], top))
    length = track.time.size / track.rate
    if segment is not None:
        return _of_segment(recording, names, inside, segment)
    if length * inside[0] < 0.5 * _CYCLES * (_FEW + 1.0):
        raise TooShortError(
            f"{recording.label} is {length:.4g} s long, which is too short for lines from {band[0]:.4g} Hz on: record "
            f"{0.5 * _CYCLES * (_FEW + 1.0) / band[0]:.3g} s or more, or start the band higher"
        )
    found: Excited | None = None
    for count in (_MANY, _MANY // 2, _FEW):
        longer = max(2.0 * length / (count + 1.0), _CYCLES / inside[0])
        finer = _of_segment(recording, names, inside, longer)
        if found is not None and (finer.foreign > _FOREIGN or not finer.misfit < _BETTER * found.misfit):
            break
        found = finer
        if not found.misfit > _LEAKS:
            break
    assert found is not None
    if found.foreign > _FOREIGN:
        raise RecordingError(
            f"{recording.label}: the motion has separate sines, and nothing between them: test each as a dynamic test, "
            f"or put the sines of a multisine at most {0.5 / found.segment:.2g} Hz apart"
        )
    if np.median(found.held) < _SWEPT:
        raise RecordingError(
            f"{recording.label}: each frequency is excited in {np.median(found.held):.2g} of the segments of "
            f"{found.segment:.3g} s only, as by a sweep: excite all frequencies all the time"
        )
    return found


def _of_segment(recording: Recording, names: list[str], band: tuple[float, float], segment: float) -> Excited:
    """The amplitudes with segments of a length [s]."""
    (track,) = tracks_of(recording, names)
    segment = round(segment * track.rate) / track.rate
    every = cross_spectra(track, segment, band)
    segments = 2.0 * track.time.size / (segment * track.rate) - 1.0
    every = _true(recording, names, every)
    spectra = thinned(every, segments)
    shape = spectra.frequency.shape
    whole = len(names) == len(CHANNELS)
    found = ratios(spectra.matrix, spectra.averages, OF_V2 if whole else OF_V1)
    amplitudes = np.full((*shape, 3), complex(np.nan, np.nan))
    moved = _deflection(every)
    apart = np.abs(1.0 - found.values[:, 1]) if whole else 1.0
    level = 2 * np.pi * spectra.frequency * moved / apart
    amplitudes[:, 1] = level
    amplitudes[:, 0] = found.values[:, 0] * level
    coherence, closure = np.full((*shape, 3), np.nan), np.full((*shape, 2), np.nan)
    coherence[:, 0] = spectra.coherence(0, 1)
    if whole:
        amplitudes[:, 2] = found.values[:, 1] * level
        coherence[:, 1:] = np.stack([spectra.coherence(1, 2), spectra.coherence(2, 0)], axis=1)
        round_trip = ratios(spectra.matrix, spectra.averages, CLOSURE)
        std = np.sqrt(np.maximum(round_trip.covariance[:, 1, 1], _ROUND_OFF**2))
        closure = np.stack([np.angle(round_trip.values[:, 0]), std], axis=1)
    misfit = float(np.mean((closure[:, 0] / closure[:, 1]) ** 2))
    covariance = found.covariance * (max(1.0, misfit) if np.isfinite(misfit) else 1.0)
    relative = np.full((*shape, 2), np.nan)
    size = np.einsum("lii->li", covariance)
    relative[:, : size.shape[1] // 2] = np.sqrt(0.5 * (size[:, 0::2] + size[:, 1::2]))
    force = recording.channels["force_in"].samples
    phasors = Phasors(
        frequency=spectra.frequency,
        amplitudes=amplitudes,
        covariance=_covariance(amplitudes, covariance),
        frequency_std=np.zeros(shape),
        dof=2.0 * spectra.averages,
    )
    return Excited(
        phasors,
        coherence,
        closure,
        _estimates(spectra),
        relative,
        misfit,
        spectra.held,
        float(np.mean(every.foreign)),
        spectra.averages,
        spectra.width,
        segment,
        moved,
        float(np.nanmax(np.abs(force - np.nanmean(force)))),
        tuple(tuple(corrections_of(recording, names, 2 * np.pi * one)) for one in spectra.frequency.tolist()),
    )


def _true(recording: Recording, names: list[str], spectra: CrossSpectra) -> CrossSpectra:
    """Cross spectra of the force and the velocities, without delays, filters and cross-talk."""
    turned = np.empty((spectra.frequency.size, len(names), len(names)), dtype=complex)
    for at, omega in enumerate((2 * np.pi * spectra.frequency).tolist()):
        turned[at], _ = without_crosstalk(recording, names, omega)
    omega = 2 * np.pi * spectra.frequency
    for at, name in enumerate(names):
        channel = recording.channels[name]
        factor = (1j * omega) ** DERIVATIVES[channel.quantity]
        for link in links_of(channel):
            factor = factor / link.at(spectra.frequency)
        turned[:, :, at] *= factor[:, None]
    matrix = turned @ spectra.matrix @ turned.conj().transpose(0, 2, 1)
    return CrossSpectra(spectra.frequency, matrix, spectra.averages, spectra.width, spectra.held, spectra.foreign)


def _estimates(spectra: CrossSpectra) -> ComplexArray:
    """Mobility (L, 3) by H1, H2 and Hv."""
    cross = spectra.matrix[:, 1, 0]
    force, motion = spectra.matrix[:, 0, 0].real, spectra.matrix[:, 1, 1].real
    with np.errstate(divide="ignore", invalid="ignore"):
        h1, h2 = cross / force, motion / cross.conj()
        return np.stack([h1, h2, cross / np.abs(cross) * np.sqrt(motion / force)], axis=1)


def _deflection(spectra: CrossSpectra) -> float:
    """Amplitude of the deflection in the band [m], 0 to peak of a sine of the same power."""
    omega = 2 * np.pi * spectra.frequency
    power = spectra.matrix[:, 1, 1].real.copy()
    if spectra.matrix.shape[1] == len(CHANNELS):
        power += spectra.matrix[:, 2, 2].real - 2.0 * spectra.matrix[:, 1, 2].real
    return float(np.sqrt(2.0 * np.sum(power / omega**2 * spectra.width)))


def _covariance(amplitudes: ComplexArray, of_ratios: FloatArray) -> FloatArray:
    """Covariance (L, 6, 6) of the amplitudes from that of the logarithms of their ratios.

    The common factor of the amplitudes, the drive, has a variance as large as those of the ratios together. No ratio
    depends on it.
    """
    size = amplitudes.shape[0]
    turn = np.zeros((size, 6, of_ratios.shape[1] + 2))
    places = [0, 2][: of_ratios.shape[1] // 2]
    for at, place in enumerate(places):
        turn[:, 2 * place : 2 * place + 2, 2 * at : 2 * at + 2] = _as_matrix(amplitudes[:, place])
    for place in range(3):
        turn[:, 2 * place : 2 * place + 2, -2:] = _as_matrix(amplitudes[:, place])
    inner = np.zeros((size, turn.shape[2], turn.shape[2]))
    inner[:, :-2, :-2] = of_ratios
    inner[:, [-2, -1], [-2, -1]] = np.einsum("lii->l", of_ratios)[:, None]
    turn = np.nan_to_num(turn)
    return np.asarray(turn @ inner @ turn.transpose(0, 2, 1))


def _as_matrix(values: ComplexArray) -> FloatArray:
    """Complex factors (L,) as matrices (L, 2, 2) that act on Re and Im."""
    return np.stack([np.stack([values.real, -values.imag], -1), np.stack([values.imag, values.real], -1)], axis=-2)
