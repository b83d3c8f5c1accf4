"""Envelopes: the amplitude of each channel at the excitation over time, from short stretches of the recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track

Turn: TypeAlias = Callable[[FloatArray], FloatArray]

#: Length and distance of stretches, in cycles: a Hann window of this length suppresses mean and double frequency.
_LENGTH, _HOP = 4.0, 2.0
#: Where a recording keeps the envelope of its channels at a first guess of the frequency.
ENVELOPE = "envelope"
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


def envelope(tracks: Sequence[Track], omega: float, turn: Turn | None = None) -> Envelope:
    """Amplitudes in stretches of four cycles, two cycles apart; `turn(time)` is the phase minus omega·t [rad]."""
    period = 2 * np.pi / omega
    first = max(float(track.time[0]) for track in tracks) + 0.5 * _LENGTH * period
    last = min(float(track.time[-1]) for track in tracks) - 0.5 * _LENGTH * period
    hop = _HOP * period
    centres = first + hop * np.arange(max(0, int((last - first) / hop) + 1))
    amplitudes = {}
    for track in tracks:
        means = _windowed(track, omega, turn, centres, _LENGTH * period)
        amplitudes.update(dict(zip(track.names, means, strict=True)))
    return Envelope(centres, amplitudes, omega, hop)


def _windowed(track: Track, omega: float, turn: Turn | None, centres: FloatArray, length: float) -> ComplexArray:
    """Windowed means (channels, n) of the channels against the phase omega·t + turn, around each of the centres [s]."""
    half = max(2, int(0.5 * length * track.rate))
    whole = np.hanning(2 * half + 1)
    window = whole[1 : track.time.size + 1][: 2 * half - 1]
    starts = np.round((centres - track.time[0]) * track.rate).astype(int) - (half - 1)
    starts = np.clip(starts, 0, max(0, track.time.size - window.size))
    # The turn inside a stretch is the same in all stretches; each has the phase of its first sample besides.
    inside = window * np.exp(-1j * omega / track.rate * np.arange(window.size))
    table = np.ascontiguousarray(inside).view(float).reshape(-1, 2)
    first = np.exp(-1j * omega * track.time[starts])
    signals: FloatArray | ComplexArray = track.signals
    if turn is not None:
        signals = track.signals * np.exp(-1j * turn(track.time))
    stretches = sliding_window_view(signals, window.size, axis=1)[:, starts]
    rows = (stretches @ table).view(complex)[..., 0] if turn is None else stretches @ inside
    total = np.full(starts.size, window.sum())
    if track.known < track.time.size:
        total = sliding_window_view(track.present, window.size)[starts] @ window
    enough = total > _ENOUGH * whole.sum()
    return np.where(enough, 2.0 * first * rows / np.where(enough, total, 1.0), complex(np.nan, np.nan))
