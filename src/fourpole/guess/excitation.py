"""Whether the samples of one channel show random excitation or a sweep, and in which band."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.spectra import random, sweep
from fourpole.core.spectra.average import bins_of, hann, lines_of, starts_of
from fourpole.core.spectra.excited import RESOLVED
from fourpole.core.spectra.motion import fine_spectrum, motion_of, segment_of
from fourpole.errors import FourpoleError

#: Segments of the spectrum that shows the band.
_FINE = 32
#: Least power in the band over the largest [1], and the least over the floor of the spectrum.
_POWER, _FLOOR = 1e-4, 10.0
#: Bins without power that a band may have.
_GAP = 3
#: Fewest cycles of the lowest frequency in a recording of many frequencies.
_CYCLES = 30.0
#: Least ratio of the ends of a band, and margin for the round-off of the sampling rate.
_WIDE, _MARGIN = 1.5, 1.01
#: Least share of the recording in which the power of a sweep lies [1]: an impact has far less.
_LASTING = 0.3


def excitation_of(samples: FloatArray, rate: float, derivative: int = 0) -> tuple[str, tuple[float, float]] | None:
    """Kind of a recording, "random" or "sweep", and its band [Hz]; None if it is neither.

    Parameters
    ----------
    samples : (N,) float array
        A motion or, without one, the force.
    rate : float [Hz]
    derivative : int
        Number of differentiations that turn the samples into a velocity.
    """
    signal = samples - samples.mean()
    track = Track(("motion_in",), signal[None], np.ones(signal.size, bool), np.arange(signal.size) / rate, rate)
    length = signal.size / rate
    try:
        band = _band(track, derivative)
        if band is None or length * band[0] < _CYCLES or band[1] < _WIDE * band[0]:
            return None
        motion = motion_of(track, segment_of(length, band[0]), band, fine_spectrum(track))
    except FourpoleError:
        return None
    if not motion.is_swept:
        band = _resolved(band, random.SHORTEST, length)
        return None if motion.has_sines or band is None else ("random", band)
    parts = np.array([np.mean(part**2) for part in np.array_split(signal, _FINE)])
    lasting = parts.sum() ** 2 / (parts.size * max(float(np.sum(parts**2)), 1e-300))
    band = _resolved(band, sweep.SHORTEST, length)
    return ("sweep", band) if lasting > _LASTING and band is not None else None


def _resolved(band: tuple[float, float], cycles: float, length: float) -> tuple[float, float] | None:
    """The part of a band [Hz] of whose lowest frequency a recording [s] has enough cycles; None if it is too narrow."""
    lowest = _MARGIN * cycles / length
    digits = 1 - int(np.floor(np.log10(lowest)))
    low = max(band[0], float(np.ceil(lowest * 10.0**digits) / 10.0**digits))
    return (low, band[1]) if band[1] > _WIDE * low else None


def _band(track: Track, derivative: int) -> tuple[float, float] | None:
    """The band [Hz] in which the velocity has power; None if it has none."""
    size = int(2 * track.time.size / (_FINE + 1))
    starts = starts_of(track.present, size)
    if size < 16 or starts.size < 2:
        return None
    frequency, inside = bins_of(size, track.rate, (0.0, track.rate))
    lines = lines_of(track.signals, starts, hann(size), inside)[0]
    power = np.mean(np.abs(lines) ** 2, axis=0) * frequency ** (2.0 * derivative)
    floor = float(np.quantile(power, 0.1))
    most = float(power.max())
    least = max(_POWER * most, _FLOOR * floor if floor * _FLOOR < 0.1 * most else 0.0)
    held = np.flatnonzero(power > least)
    if held.size == 0:
        return None
    parts = np.split(held, np.flatnonzero(np.diff(held) > _GAP) + 1)
    part = max(parts, key=lambda one: float(power[one].sum() / frequency[one[0]]) if one.size > 2 else 0.0)
    if part.size < 6:
        return None
    # the main lobe of the window widens the band by two bins on either side
    low, high = frequency[part[0] + 2], frequency[part[-1] - 2]
    return float(f"{low:.2g}"), min(float(f"{high:.2g}"), RESOLVED * track.rate)
