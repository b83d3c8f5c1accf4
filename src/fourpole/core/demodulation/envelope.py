"""Envelopes: the amplitude of each channel at the excitation over short stretches, to see what is steady."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track

__all__ = ["Envelope", "envelope"]

#: Length of a stretch and distance of two, in cycles: under a Hann window, double frequency and mean leave nothing.
_LENGTH, _HOP = 4.0, 2.0
#: Share of a stretch that must be there: where more is missing, mean and harmonics leak.
_ENOUGH = 0.97


@dataclass(frozen=True, eq=False)
class Envelope(ByValue):
    """Amplitudes of channels over time.

    Attributes
    ----------
    time : (n,) float array [s]
        Middle of each stretch, from the middle of the recording.
    amplitudes : dict of str to (n,) complex array
        By role, in recorded units, against a phase that turns at `omega`; not-a-number where samples are missing.
    omega : float [rad/s]
    hop : float [s]
        Distance of two stretches.
    """

    time: FloatArray
    amplitudes: dict[str, ComplexArray]
    omega: float
    hop: float

    def phase(self, role: str) -> FloatArray:
        """Phase of a channel beyond omega·t, without jumps [rad]."""
        return np.unwrap(np.angle(self.amplitudes[role]))


def envelope(tracks: Sequence[Track], omega: float, turn: Callable[[FloatArray], FloatArray] | None = None) -> Envelope:
    """Amplitudes at a frequency in stretches of four cycles, two cycles apart; `turn` is phase beyond omega·t [rad]."""
    period = 2 * np.pi / omega
    first = max(float(track.time[0]) for track in tracks) + 0.5 * _LENGTH * period
    last = min(float(track.time[-1]) for track in tracks) - 0.5 * _LENGTH * period
    hop = _HOP * period
    centres = first + hop * np.arange(max(0, int((last - first) / hop) + 1))
    amplitudes = {}
    for track in tracks:
        phase = omega * track.time if turn is None else omega * track.time + turn(track.time)
        found = _short(track, np.exp(-1j * phase), centres, _LENGTH * period)
        amplitudes.update(dict(zip(track.names, found, strict=True)))
    return Envelope(centres, amplitudes, omega, hop)


def _short(track: Track, turning: ComplexArray, centres: FloatArray, length: float) -> ComplexArray:
    """Windowed means (channels, n) of the channels, turned back."""
    half = max(2, int(0.5 * length * track.rate))
    window = np.hanning(2 * half + 1)[1:-1]
    at = np.round((centres - track.time[0]) * track.rate).astype(int) - (half - 1)
    at = np.clip(at, 0, max(0, track.time.size - window.size))
    result = np.full((len(track.names), centres.size), complex(np.nan, np.nan))
    for k, start in enumerate(at):
        part = slice(start, start + window.size)
        weight = window[: track.time[part].size] * track.present[part]
        total = weight.sum()
        if total > _ENOUGH * window.sum():
            result[:, k] = 2.0 * (track.signals[:, part] * (weight * turning[part])).sum(axis=1) / total
    return result
