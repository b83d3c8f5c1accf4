"""Faults of a channel that its statement lacks: on the way to the converter, and in the samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import FloatArray

#: A tone above half the sampling rate of 1000 Hz, such as that of a switching supply [Hz].
_TONE = 982.7
#: Amplitude for which hysteresis is stated [SI]; shortest and longest gap of a cable that loses contact [samples].
_FULL_LOOP, _GAPS = 300.0, (5, 40)


@dataclass(frozen=True)
class Flaw:
    r"""The faults of a channel beside its stated errors; by default it has none. Amplitudes are in SI units.

    Parameters
    ----------
    scale : float [1]
        Factor of the whole signal: a wrong gain, unit or sign.
    offset : float [SI]
        Error of the zero.
    delay, clock : float [s], [1]
        The samples are late by `delay`, and the clock of the channel is slower by the fraction `clock`.
    crosstalk : tuple of (channel, factor [SI/SI])
        Other channels, of which the signal contains a part.
    hysteresis : float [1]
        h: the loop of a force cell. Its half width is h A at an amplitude A of 300 N, and proportional to the square
        of the amplitude: :math:`y - h A^2/300\,N\,(1 - (y/A)^2)\,\mathrm{sign}(\dot y)`.
    limit : float [SI]
        L > 0 of a signal that saturates softly: :math:`L \tanh(y/L)`.
    loose : float [1]
        The signal is larger by this fraction in the second half of the recording.
    noise, hum, tone : float [SI]
        Root mean square of further noise; amplitude of further hum at 50 Hz and of a tone at 982.7 Hz, which aliases
        to 17.3 Hz at a sampling rate of 1000 Hz.
    spikes, spike : float [1/s], [SI]
        Number and size of spikes of one sample.
    dropouts : float [1]
        Fraction of the samples that are zero, in gaps of 5 to 40 samples.

    Examples
    --------
    >>> Flaw(scale=-1.0).heard("F1", {"F1": np.array([1.0, 2.0])}).tolist()
    [-1.0, -2.0]
    """

    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    clock: float = 0.0
    crosstalk: tuple[tuple[str, float], ...] = ()
    hysteresis: float = 0.0
    limit: float = 0.0
    loose: float = 0.0
    noise: float = 0.0
    hum: float = 0.0
    tone: float = 0.0
    spikes: float = 0.0
    spike: float = 0.0
    dropouts: float = 0.0

    def latest(self, duration: float) -> float:
        """The largest shift of the samples [s] in a recording of some `duration` [s]."""
        return abs(self.delay) + abs(self.clock) * duration

    def times(self, times: FloatArray) -> FloatArray:
        """The true times [s] of the samples that are filed under `times` [s]."""
        return times * (1.0 + self.clock) - self.delay

    def heard(self, channel: str, signals: Mapping[str, FloatArray]) -> FloatArray:
        """The signal [SI] of a `channel` before its converter; `signals` are the true ones on a fine time base."""
        y = signals[channel]
        for other, factor in self.crosstalk:
            y = y + factor * signals[other]
        if self.hysteresis:
            largest = np.abs(y).max()
            width = self.hysteresis * largest * largest / _FULL_LOOP
            y = y - width * (1.0 - (y / largest) ** 2) * np.sign(np.gradient(y))
        if self.loose:
            y = y * np.where(np.arange(y.size) >= y.size // 2, 1.0 + self.loose, 1.0)
        if self.limit:
            y = self.limit * np.tanh(y / self.limit)
        return self.scale * y + self.offset

    def disturbance(self, times: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Noise, hum, tone and spikes that are added to the samples before the converter [SI]."""
        added = np.zeros(times.size)
        if self.noise:
            added += self.noise * rng.standard_normal(times.size)
        for amplitude, frequency in ((self.hum, 50.0), (self.tone, _TONE)):
            if amplitude:
                added += amplitude * np.sin(2.0 * np.pi * (frequency * times + rng.random()))
        if self.spikes:
            count = max(1, rng.poisson(self.spikes * (times[-1] - times[0])))
            added[rng.integers(times.size, size=count)] += self.spike * rng.choice([-1.0, 1.0], count)
        return added

    def interrupted(self, record: FloatArray, rng: np.random.Generator) -> FloatArray:
        """The record with its drop-outs."""
        record = record.copy()
        lost = np.zeros(record.size, dtype=bool)
        while lost.mean() < self.dropouts:
            begin = int(rng.integers(record.size))
            lost[begin : begin + int(rng.integers(*_GAPS))] = True
        record[lost] = 0.0
        return record
