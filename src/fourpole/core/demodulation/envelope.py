"""Envelopes: the amplitude of each channel at the excitation over time, from short stretches of the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track

#: Length and distance of stretches, in cycles: a Hann window of this length suppresses mean and double frequency.
_LENGTH, _HOP = 4.0, 2.0
#: Least weighted share of samples present in a stretch: with more missing, mean and harmonics leak.
_ENOUGH = 0.97


@dataclass(frozen=True, eq=False)
class Envelope(ByValue):
    """Amplitudes of channels over time.

    Attributes
    ----------
    time : (n,) float array [s]
        Middle of each stretch, counted from the middle of the recording.
    amplitudes : dict of str to (n,) complex array
        Amplitudes by role, in recorded units, relative to a phase that advances at `omega`; not-a-number for a stretch
        with missing samples.
    omega : float [rad/s]
        Angular frequency of the reference phase.
    hop : float [s]
        Distance of two stretches.
    """

    time: FloatArray
    amplitudes: dict[str, ComplexArray]
    omega: float
    hop: float

    def phase(self, role: str) -> FloatArray:
        """Phase of a channel minus omega·t, without jumps [rad]."""
        return np.unwrap(np.angle(self.amplitudes[role]))


def envelope(tracks: Sequence[Track], omega: float, turn: Callable[[FloatArray], FloatArray] | None = None) -> Envelope:
    """Amplitudes in stretches of four cycles, two cycles apart; `turn(time)` is the phase minus omega·t [rad]."""
    period = 2 * np.pi / omega
    first = max(float(track.time[0]) for track in tracks) + 0.5 * _LENGTH * period
    last = min(float(track.time[-1]) for track in tracks) - 0.5 * _LENGTH * period
    hop = _HOP * period
    centres = first + hop * np.arange(max(0, int((last - first) / hop) + 1))
    amplitudes = {}
    for track in tracks:
        phase = omega * track.time if turn is None else omega * track.time + turn(track.time)
        found = _windowed(track, np.exp(-1j * phase), centres, _LENGTH * period)
        amplitudes.update(dict(zip(track.names, found, strict=True)))
    return Envelope(centres, amplitudes, omega, hop)


def _windowed(track: Track, turning: ComplexArray, centres: FloatArray, length: float) -> ComplexArray:
    """Windowed means (channels, n) of the channels times `turning`, around each of the centres [s]."""
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
