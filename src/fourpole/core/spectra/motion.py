"""What kind of excitation the motion at the contact shows: random, a sweep, or separate sines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.demodulation.tracks import Track
from fourpole.core.spectra.average import bins_of, hann, lines_of, starts_of

#: Segments that are looked at.
_MOST = 256
#: Correlation of the motion in neighbouring segments above which it is one sine; that of noise is 1/6.
_STEADY = 0.7
#: Distance in bins from which on a sine belongs to another bin.
_AWAY = 0.6


@dataclass(frozen=True)
class Motion:
    """The kind of excitation.

    Attributes
    ----------
    foreign : float [1]
        Share of the bins at which the motion is that of a sine at another frequency, as between separate sines.
    single : float [1]
        Share of the power of V1 that these bins have; half of it or more if the motion is one sine.
    held : float [1]
        Number of segments that hold the power at a bin, in the median: all of them if the excitation is steady, a few
        in a sweep.
    """

    foreign: float
    single: float
    held: float


def motion_of(track: Track, segment: float, band: tuple[float, float]) -> Motion:
    r"""The kind of excitation, from the first segments of V1.

    If the phase of V1 advances alike from segment to segment, the motion is one sine, whose frequency the advance
    gives. The number of segments that hold the power P is :math:`2\,(\sum P)^2/\sum P^2`, at most all: the power of
    Gaussian noise has a mean square of twice its square.

    Parameters
    ----------
    track : Track
        Channels with the same sampling times.
    segment : float [s]
        Length of a segment.
    band : (float, float) [Hz]
        Lowest and highest frequency.
    """
    size = round(segment * track.rate)
    starts = starts_of(track.present, size)[:_MOST]
    frequency, inside = bins_of(size, track.rate, band)
    motion = track.signals[[track.names.index("motion_in")]]
    lines = lines_of(motion, starts, hann(size), inside)[0]
    power = lines.real**2 + lines.imag**2
    total = power.sum(axis=0)
    held = 2.0 * total**2 / np.maximum((power**2).sum(axis=0), 1e-300)
    advance = (lines[1:] * lines[:-1].conj()).sum(axis=0)
    hop = max(1, size // 2) / track.rate
    off = np.angle(advance * np.exp(-2j * np.pi * frequency * hop)) / (2 * np.pi * hop)
    foreign = (np.abs(advance) > _STEADY * total) & (np.abs(off) > _AWAY * track.rate / size)
    single = float(total[foreign].sum() / max(total.sum(), 1e-300))
    return Motion(float(foreign.mean()), single, float(min(np.median(held), starts.size)))
