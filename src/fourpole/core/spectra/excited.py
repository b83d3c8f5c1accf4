"""Amplitudes of F1, V1 and V2 at many frequencies of one recording, by whichever method their ratios were found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, real_matrix
from fourpole.core.demodulation.corrections import Correction, corrections_of, links_of, without_crosstalk
from fourpole.core.demodulation.preview import Preview
from fourpole.core.demodulation.tracks import Track, named, tracks_of
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import DERIVATIVES, DRIVE, Channel, Recording
from fourpole.core.spectra.average import CrossSpectra, Ratios, with_bias
from fourpole.errors import ConstantError, RecordingError

#: Channels of the spectra in their order, and the pairs whose coherence is shown.
_ORDER = (*CHANNELS, DRIVE)
_COHERENT = (*zip(CHANNELS, (*CHANNELS[1:], CHANNELS[0]), strict=True), *((DRIVE, name) for name in CHANNELS))
#: Share of the sampling rate up to which lines are resolved.
RESOLVED = 0.45
#: Median of the square of a standard normal number, and the closure phase in its uncertainties from which on a line
#: alone is less certain than its noise says.
_MEDIAN, _ODD = 0.4549, 2.0
#: Coherence times the number of averages below which a channel has nothing but noise, and averages from which on this
#: can be told: its ratios are known to 35 % at best.
_NOTHING, _TELLING = 2.0, 3.0
#: Standard uncertainty of a phase that round-off leaves [rad].
_ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Excited(ByValue):
    """Amplitudes of one recording at many frequencies, with figures of quality of each line.

    Attributes
    ----------
    phasors : Phasors
        Amplitudes (L,) of F1, V1, V2 of a sine whose deflection has the power of the whole band; the phase of V1 is
        zero. Only their ratios are measured: these have the uncertainty of the noise.
    coherence : (L, 6) float array [1]
        Coherence of F1 and V1, V1 and V2, V2 and F1, and of the drive with F1, V1 and V2; not-a-number where a
        channel is not recorded.
    closure : (L, 2) float array [rad]
        Closure phase and its standard uncertainty; not-a-number without V2.
    estimates : (L, 3) complex array [m/(N s)]
        Mobility V1/F1 by H1, H2 and Hv, their geometric mean.
    relative : (L, 2) float array [1]
        Standard uncertainties of F1/V1 and of V2/V1, relative to their moduli.
    misfit : float [1]
        Mean square of the closure phase over its variance, from its median over the lines; not-a-number without V2. The
        covariance is enlarged by it where it exceeds 1; that of a line alone by its own square over four, if that is
        more.
    averages : (L,) float array [1]
        Number of independent averages.
    width : (L,) float array [Hz]
        Width of the band that a line stands for.
    length : float [s]
        Length of the segments that were averaged, or of the whole record.
    deflection : float [m]
        Amplitude of the deflection, 0 to peak of a sine with the power of V1 - V2 in the band, or of V1 without V2.
    force_peak : float [N]
        Largest departure of F1 from its mean.
    corrections : tuple of tuple of Correction
        Effects of the measurement chain that were removed, for each line.
    foreign : (L,) bool array or bool
        Lines whose power is that of another frequency, as beside a sine.
    shared : (3, 4) float array [1]
        Correlation of the noises of F1 and V1, V1 and V2, V2 and F1: modulus, standard uncertainty, the chi-square
        that it explains, and the relative error of the cross spectrum; zeros where it is not found.
    driven : bool
        Whether a recorded drive is the instrument of all ratios. The closure phase then enlarges no uncertainty.
    preview : Preview or None
        Samples of F1, V1 and, if it is recorded, V2, and their extremes over the record.
    nonlinear : float [1]
        Part of F1 that follows functions of the motion which are not linear, by `fourpole.core.spectra.nonlinear`; 0
        where noise explains it, not-a-number where it was not looked for.
    period : float [s]
        Period of the motion; not-a-number where it does not repeat.
    beyond : float [1]
        Mean square of the distance of a ratio outside of H1 and H2, over its variance; the larger one of F1/V1 and
        V2/V1.
    """

    phasors: Phasors
    coherence: FloatArray
    closure: FloatArray
    estimates: ComplexArray
    relative: FloatArray
    misfit: float
    averages: FloatArray
    width: FloatArray
    length: float
    deflection: float
    force_peak: float
    corrections: tuple[tuple[Correction, ...], ...] = ()
    foreign: BoolArray | bool = False
    shared: FloatArray = field(default_factory=lambda: np.zeros((3, 4)))
    driven: bool = False
    preview: Preview | None = None
    nonlinear: float = np.nan
    period: float = np.nan
    beyond: float = 0.0

    def with_distortion(self, share: float) -> Excited:
        """The amplitudes with the part of F1 that is not linear [1].

        Where the motion repeats, distortion repeats too, so that averages do not show it. It is then part of the
        uncertainty, as an error of F1 and of V2, which F1 makes.
        """
        if not (np.isfinite(self.period) and share > 0):
            return replace(self, nonlinear=share)
        along = np.nan_to_num(self.phasors.amplitudes * np.array([1.0, 0.0, 1.0]))
        turn = real_matrix(along[:, :, None])
        covariance = self.phasors.covariance + 0.5 * share**2 * turn @ turn.swapaxes(1, 2)
        return replace(
            self,
            phasors=replace(self.phasors, covariance=covariance),
            relative=np.hypot(self.relative, share / np.sqrt(2.0)),
            nonlinear=share,
        )


def prepared(recording: Recording, band: tuple[float, float]) -> tuple[Track, tuple[float, float]]:
    """F1, V1, V2 and the drive in this order, and the part of the band that their common sampling resolves [Hz].

    V2 takes the place of F1 where no force is recorded.
    """
    names = [name for name in _ORDER if name in recording.channels]
    if "force_in" not in names and "motion_out" in names:
        names = ["motion_out", *(name for name in names if name != "motion_out")]
    if not {"force_in", "motion_out"} & set(names):
        raise RecordingError(f"{recording.label}: many frequencies at once need F1 (force_in) or V2 (motion_out)")
    tracks = tracks_of(recording, names)
    if len(tracks) > 1:
        raise RecordingError(
            f"{recording.label}: the channels differ in their sampling times: resample them to one rate for many "
            "frequencies at once"
        )
    top = RESOLVED * tracks[0].rate
    if band[0] >= top:
        raise RecordingError(
            f"{recording.label}: {tracks[0].rate:.6g} samples per second do not resolve {band[0]:.4g} Hz"
        )
    track = tracks[0]
    order = [track.names.index(name) for name in names]
    ordered = replace(track, names=tuple(names), signals=track.signals[order])
    return ordered, (band[0], min(band[1], top))


def to_true(recording: Recording, names: Sequence[str], frequency: FloatArray) -> ComplexArray:
    """Matrices (L, C, C) from recorded lines to those of force and velocities, without delays, filters, cross-talk."""
    turned = np.empty((frequency.size, len(names), len(names)), dtype=complex)
    turned[:] = np.eye(len(names))
    if any(recording.channels[name].crosstalk for name in names):
        for line, omega in enumerate((2 * np.pi * frequency).tolist()):
            turned[line], _ = without_crosstalk(recording, names, omega)
    for place, name in enumerate(names):
        turned[:, :, place] *= factor_of(recording.channels[name], frequency)[:, None]
    return turned


def is_whole(names: Sequence[str]) -> bool:
    """Whether F1, V1 and V2 are all there, so that one of them is the instrument for the ratio of the others."""
    return set(CHANNELS) <= set(names)


def factor_of(channel: Channel, frequency: FloatArray) -> ComplexArray:
    """Force or velocity over the recorded line (L,) of a channel, without delays and filters."""
    factor = (2j * np.pi * frequency) ** DERIVATIVES[channel.quantity]
    for link in links_of(channel):
        factor = factor / link.at(frequency)
    return np.asarray(factor)


def pulls_of(closure: FloatArray) -> FloatArray:
    """Closure phases (L,) over their standard uncertainties, from both (L, 2)."""
    return np.asarray(closure[:, 0] / np.maximum(closure[:, 1], _ROUND_OFF))


def excited(
    recording: Recording,
    names: Sequence[str],
    spectra: CrossSpectra,
    estimate: Ratios,
    *,
    closure: FloatArray | None,
    bias: float,
    deflection: float,
    length: float,
    shared: FloatArray | None = None,
) -> Excited:
    """Amplitudes from the ratios F1/V1 and, with V2, V2/V1, and what the spectra of force and velocities show beside.

    Closure phase, deflection, length and correlations of the noises (if they are known) are those of `Excited`; `bias`
    is the share of `with_bias` for a ratio without an instrument.
    """
    shape, driven = spectra.frequency.shape, DRIVE in names
    if not is_whole(names) and not driven:
        estimate = with_bias(estimate, spectra.coherence(0, 1), bias)
    closure = np.full((*shape, 2), np.nan) if closure is None else closure
    pulls = pulls_of(closure)
    misfit = float(np.median(pulls**2) / _MEDIAN)
    larger = np.ones(shape) if driven else np.fmax(1.0, np.fmax(misfit, (pulls / _ODD) ** 2))
    covariance = estimate.covariance * larger[:, None, None]
    measured = [name for name in names if name != DRIVE]
    places = [CHANNELS.index(name) for name in measured if name != "motion_in"]
    apart = np.abs(1.0 - estimate.values[:, -1]) if "motion_out" in names else 1.0
    amplitudes = np.full((*shape, 3), complex(np.nan, np.nan))
    amplitudes[:, 1] = 2 * np.pi * spectra.frequency * deflection / apart
    for place, values in zip(places, estimate.values.T, strict=True):
        amplitudes[:, place] = values * amplitudes[:, 1]
    relative, size = np.full((*shape, 2), np.nan), np.einsum("lii->li", covariance)
    relative[:, [place // 2 for place in places]] = np.sqrt(np.maximum(0.5 * (size[:, 0::2] + size[:, 1::2]), 0.0))
    coherence = np.full((*shape, len(_COHERENT)), np.nan)
    for i, (a, b) in enumerate(_COHERENT):
        if a in names and b in names:
            coherence[:, i] = spectra.coherence(names.index(a), names.index(b))
    _check_common(measured, coherence, spectra.averages)
    return Excited(
        Phasors(
            frequency=spectra.frequency,
            amplitudes=amplitudes,
            covariance=_covariance(amplitudes, covariance, places),
            frequency_std=np.zeros(shape),
            dof=2.0 * spectra.averages,
        ),
        coherence,
        closure,
        _estimates(spectra) if "force_in" in names else np.full((*shape, 3), complex(np.nan, np.nan)),
        relative,
        misfit,
        spectra.averages,
        spectra.width,
        length,
        deflection,
        recording.force_peak,
        tuple(tuple(corrections_of(recording, measured, 2 * np.pi * hertz)) for hertz in spectra.frequency.tolist()),
        spectra.foreign,
        np.zeros((3, 4)) if shared is None else shared,
        driven,
    )


def _check_common(names: Sequence[str], coherence: FloatArray, averages: FloatArray) -> None:
    """ConstantError if a channel has no coherence with any other one, as that of a sensor that was off."""
    for name in names:
        others = coherence[:, [i for i, pair in enumerate(_COHERENT) if name in pair]]
        others = others[:, np.isfinite(others).any(axis=0)]
        if others.size and np.median(averages) > _TELLING and np.median(others.max(axis=1) * averages) < _NOTHING:
            raise ConstantError(
                f"{named(name)} has nothing in common with the other channels (coherence {np.nanmedian(others):.2g}): "
                "the sensor was off or unplugged, or another column is meant"
            )


def deflection_in(frequency: FloatArray, power: FloatArray, width: float) -> float:
    """Amplitude of the deflection in a band [m], 0 to peak of a sine of the same power, from densities of V1 - V2."""
    return float(np.sqrt(2.0 * np.sum(power / (2 * np.pi * frequency) ** 2) * width))


def _estimates(spectra: CrossSpectra) -> ComplexArray:
    """Mobility (L, 3) by H1, H2 and Hv."""
    cross = spectra.matrix[:, 1, 0]
    force, motion = spectra.matrix[:, 0, 0].real, spectra.matrix[:, 1, 1].real
    with np.errstate(divide="ignore", invalid="ignore"):
        h1, h2 = cross / force, motion / cross.conj()
        return np.stack([h1, h2, cross / np.abs(cross) * np.sqrt(motion / force)], axis=1)


def _covariance(amplitudes: ComplexArray, of_ratios: FloatArray, places: Sequence[int]) -> FloatArray:
    """Covariance (L, 6, 6) of the amplitudes from that of the logarithms of their ratios, at some places, to V1.

    The common factor of the amplitudes, the drive, has a variance as large as those of the ratios together. No ratio
    depends on it.
    """
    size = amplitudes.shape[0]
    by_log = np.zeros((size, 3, len(places) + 1), dtype=complex)
    by_log[:, places, range(len(places))] = amplitudes[:, places]
    by_log[:, :, -1] = amplitudes
    turn = np.nan_to_num(real_matrix(by_log))
    inner = np.zeros((size, turn.shape[2], turn.shape[2]))
    inner[:, :-2, :-2] = of_ratios
    inner[:, [-2, -1], [-2, -1]] = np.einsum("lii->l", of_ratios)[:, None]
    return np.asarray(turn @ inner @ turn.transpose(0, 2, 1))
