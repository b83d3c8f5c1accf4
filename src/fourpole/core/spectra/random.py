"""Random excitation: amplitudes of F1, V1 and V2 at many frequencies from averaged cross spectra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.recording import Recording
from fourpole.core.spectra.averaged import segment_amplitudes
from fourpole.core.spectra.excited import Excited, prepared, pulls_of
from fourpole.core.spectra.motion import CYCLES, MANY, Motion, fine_spectrum, motion_of, period_of, segment_of
from fourpole.core.spectra.sweep import fits_whole, repeated_amplitudes, whole_amplitudes
from fourpole.errors import RecordingError, TooShortError

#: Few segments, of which half are the fewest that are taken for finer lines.
_FEW = 32
#: Fewest cycles of the lowest frequency in a recording.
SHORTEST = 0.5 * CYCLES * (_FEW + 1.0)
#: Segments are made longer while the leakage is above the first number, and falls below this share of what it was.
_LEAKS, _BETTER = 1.5, 0.8
#: Numbers of segments that are tried, and the least change of their length.
_COUNTS, _LONGER = (MANY, MANY // 2, _FEW, _FEW // 2), 1.5


def random_amplitudes(recording: Recording, band: tuple[float, float], segment: float | None = None) -> Excited:
    r"""Complex amplitudes of F1, V1, V2 at the lines of a band, from averaged cross spectra.

    .. math:: \frac{F_1}{V_1} = \frac{G_{F2}}{G_{12}}, \qquad \frac{V_2}{V_1} = \frac{G_{2F}}{G_{1F}}

    V2 is the instrument for F1/V1, and F1 that for V2/V1: noise that is independent between the channels leaves no
    bias. A recorded drive d is the instrument for both, :math:`G_{Fd}/G_{1d}` and :math:`G_{2d}/G_{1d}`: noise that F1,
    V1 and V2 share leaves no bias then. With two of the three channels the ratio is the geometric mean of H1 and H2.

    Parameters
    ----------
    recording : Recording
        Channels with the same sampling times.
    band : (float, float) [Hz]
        Lowest and highest frequency.
    segment : float [s], optional
        Length of the segments. By default the record has some 128 segments, and without a drive fewer, longer ones, at
        least 16, while the closure phase or a modulus that is not between H1 and H2 shows leakage.

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
    track, inside = prepared(recording, band)
    length = track.time.size / track.rate
    if segment is not None:
        return segment_amplitudes(recording, track, inside, segment)
    if length * inside[0] < SHORTEST:
        raise TooShortError(
            f"{recording.label} is {length:.4g} s long, which is too short for lines from {band[0]:.4g} Hz on: record "
            f"{SHORTEST / band[0]:.3g} s or more, or start the band higher"
        )
    fine = fine_spectrum(track)
    segment = segment_of(length, inside[0])
    if (period := period_of(track, inside)) is not None:
        repeated = repeated_amplitudes(recording, track, inside, period, segment)
        if repeated is not None:
            return replace(repeated, period=period)
    _check_random(recording, motion_of(track, segment, inside, fine), segment)
    if period is not None and fits_whole(track, inside):
        return replace(whole_amplitudes(recording, track, inside), period=period)
    best: Excited | None = None
    for segment in (segment_of(length, inside[0], count) for count in _COUNTS):
        if best is not None and segment < _LONGER * best.length:
            continue
        if best is not None and motion_of(track, segment, inside, fine).has_gaps:
            break
        finer = segment_amplitudes(recording, track, inside, segment, fine)
        if best is not None and not _leakage(finer) < _BETTER * _leakage(best):
            break
        best = finer
        if best.driven or not _leakage(best) > _LEAKS:
            break
    assert best is not None
    return best


def _check_random(recording: Recording, motion: Motion, segment: float) -> None:
    """RecordingError if the motion is separate sines or a sweep."""
    if motion.is_swept:
        raise RecordingError(
            f"{recording.label}: each frequency is excited in {motion.held:.2g} of the segments of {segment:.3g} s "
            "only, as by a sweep: state kind = sweep"
        )
    if motion.has_sines:
        raise RecordingError(
            f"{recording.label}: the motion has separate sines, and nothing between them: test each as a dynamic test, "
            f"or put the sines of a multisine at most {0.5 / segment:.2g} Hz apart"
        )


def _leakage(lines: Excited) -> float:
    """Mean square over its variance of what leakage at a few lines raises: closure phase, or distance from H1 or H2."""
    return max(float(np.mean(pulls_of(lines.closure) ** 2)), lines.beyond)
