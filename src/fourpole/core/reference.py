r"""A reference of the drive: the phase of the excitation over time, from tacho pulses or an encoder's angle.

The phase has one point per revolution, the mean over its pulses or angles. Unequal teeth and variations of the speed
within a revolution therefore have no influence; the latter are harmonics of the force. A smooth curve joins the points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import RecordingError

#: Least number of revolutions: a cubic through the marks needs four points.
_FEWEST = 4
_FEWEST_SMOOTHED = 8
_TREND = 3
#: Weights of the second differences that are compared in the smoothing.
_WEIGHTS = np.logspace(-2, 14, 81)
#: Number of times for which all weights are tried at once.
_AT_ONCE = 4096
#: Half width of the hysteresis about the middle of a pulse, as a share of its height.
_HYSTERESIS = 0.2
#: Angles per revolution that are read from an encoder.
_TICKS = 16
#: A pulse is missing or doubled if a gap is longer or shorter than these multiples of the usual gap.
_LONG, _SHORT = 1.5, 0.5


@dataclass(frozen=True, eq=False)
class Reference(ByValue):
    """The phase of the excitation over time.

    Parameters
    ----------
    time : (n,) float array [s]
        Times, about one per revolution, rising; n >= 4.
    phase : (n,) float array [rad]
        Phase of the excitation's fundamental, without jumps.

    Examples
    --------
    >>> Reference(np.arange(5.0), 20 * np.arange(5.0)).omega(1.0, 3.0)
    20.0
    """

    time: FloatArray
    phase: FloatArray

    @classmethod
    def from_pulses(cls, times: FloatArray, *, pulses: int = 1, cycles: float = 1.0) -> Reference:
        """A reference from the times of a tacho's pulses.

        Parameters
        ----------
        times : (n,) float array [s]
            Times of the pulses, as `PulseTrain` gives them.
        pulses : int
            Pulses per revolution.
        cycles : float
            Cycles of the excitation per revolution.

        Raises
        ------
        RecordingError
            If there are fewer than four revolutions, or pulses are missing.

        Examples
        --------
        >>> Reference.from_pulses(np.arange(300) / 600.0, pulses=60).omega(0.1, 0.3) / (2 * np.pi)
        10.0
        """
        turns = times.size // pulses
        if turns < _FEWEST:
            raise RecordingError(
                f"the reference has {times.size} pulses, {turns} revolutions at {pulses} per revolution, "
                f"{_FEWEST} are needed: check its column and the pulses stated"
            )
        _check_steady(times, pulses)
        middle = times[: turns * pulses].reshape(turns, pulses).mean(axis=1)
        return cls(middle, 2 * np.pi * cycles * np.arange(turns))

    @classmethod
    def from_angle(cls, time: FloatArray, angle: FloatArray, *, cycles: float = 1.0) -> Reference:
        """A reference from the angle of an encoder.

        Parameters
        ----------
        time : (n,) float array [s]
            Times of the angles.
        angle : (n,) float array [rad]
            Rising or falling angle, with or without jumps of whole revolutions.
        cycles : float
            Cycles of the excitation per revolution.

        Raises
        ------
        RecordingError
            If there are fewer than five revolutions.

        Examples
        --------
        >>> t = np.arange(2000) / 1000.0
        >>> Reference.from_angle(t, (60 * t) % (2 * np.pi)).omega(0.5, 1.5)
        60.0
        """
        there = np.isfinite(angle)
        run = np.unwrap(angle[there])
        run = np.maximum.accumulate(run * np.sign(run[-1] - run[0])) if run.size else run
        turned = float(run[-1] - run[0]) / (2 * np.pi) if run.size else 0.0
        if turned < _FEWEST + 1:
            raise RecordingError(
                f"the reference turns {turned:.3g} times in the recording, {_FEWEST + 1} are needed: "
                "check its column and unit"
            )
        rising = np.concatenate([[True], np.diff(run) > 0])
        marks = run[0] + 2 * np.pi * np.arange(int(turned) * _TICKS) / _TICKS
        return cls.from_pulses(np.interp(marks, run[rising], time[there][rising]), pulses=_TICKS, cycles=cycles)

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the known phase [s], half a revolution beyond the first and the last point."""
        return (
            float(self.time[0] - 0.5 * (self.time[1] - self.time[0])),
            float(self.time[-1] + 0.5 * (self.time[-1] - self.time[-2])),
        )

    @cached_property
    def curve(self) -> Callable[..., FloatArray]:
        """Phase [rad] as a function of time [s]; a second argument is the order of a derivative by time."""
        spline: Callable[..., FloatArray] = scipy.interpolate.make_interp_spline(self._smooth, self.phase)
        return spline

    @cached_property
    def _smooth(self) -> FloatArray:
        """Times of the points without jitter [s]."""
        return _smoothed(self.time)

    def departure(self, *, smooth: bool = True) -> float:
        """Largest departure of the speed between two points from its mean, relative [1], `smooth` without jitter."""
        speed = np.diff(self.phase) / np.diff(self._smooth if smooth else self.time)
        return float(np.max(np.abs(speed / np.mean(speed) - 1.0)))

    def omega(self, first: float, last: float) -> float:
        """Mean speed between two times [s], in rad/s."""
        low, high = self.curve(np.array([first, last]))
        return float((high - low) / (last - first))


def _smoothed(time: FloatArray) -> FloatArray:
    """Times of equal steps of the phase without jitter, whose size generalised cross-validation estimates.

    Second differences are penalised; cosine transforms of the times, mirrored at both ends, solve the equations.
    """
    # A cubic is subtracted first, because smoothing removes curvature at the ends, as of a rising speed.
    powers = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, time.size), min(_TREND, time.size - 1))
    trend = powers @ np.linalg.lstsq(powers, time)[0]
    beyond = time - trend
    if time.size < _FEWEST_SMOOTHED or np.max(np.abs(beyond)) < 1e-9 * (time[-1] - time[0]):
        return time
    wide = np.concatenate([2 * beyond[0] - beyond[:0:-1], beyond, 2 * beyond[-1] - beyond[-2::-1]])
    waves = scipy.fft.dct(wide, norm="ortho")
    stiff = (2 - 2 * np.cos(np.pi * np.arange(wide.size) / wide.size)) ** 2
    scores = []
    for weight in np.array_split(_WEIGHTS[:, None], min(_WEIGHTS.size, 1 + wide.size // _AT_ONCE)):
        lost = weight * stiff
        lost /= 1 + lost
        scores.append(lost**2 @ waves**2 / np.mean(lost, axis=1) ** 2)
    best = _WEIGHTS[int(np.argmin(np.concatenate(scores)))]
    smooth = scipy.fft.idct(waves / (1 + best * stiff), norm="ortho")
    return np.asarray(trend + smooth[time.size - 1 : 2 * time.size - 1])


def _check_steady(times: FloatArray, pulses: int) -> None:
    """Raise RecordingError if pulses are missing or doubled."""
    gaps = np.diff(times)
    if gaps.size < 2 * pulses:
        return
    usual = np.median(gaps)
    strange = np.flatnonzero((gaps > _LONG * usual) | (gaps < _SHORT * usual))
    # A missing tooth as a mark gives one long gap in every revolution.
    marks = pulses > 1 and strange.size >= times.size // pulses - 1 and bool(np.all(np.diff(strange) == pulses))
    if strange.size and not marks:
        first = int(strange[0])
        raise RecordingError(
            f"the reference's pulses are uneven: {gaps[first]:.4g} s between pulses at {times[first]:.5g} s, "
            f"{usual:.4g} s as a rule; check its level and cable, or cut with window [s]"
        )


class PulseTrain:
    """The pulses of a tacho, from successive chunks of its samples.

    The time of a pulse is that of its rise through the middle between the extremes of the first chunk, by linear
    interpolation. Before the rise, the signal must have been below a hysteresis band.

    Examples
    --------
    >>> train = PulseTrain()
    >>> train.feed(np.array([0.0, 0.0, 5.0, 5.0, 0.0]), 10.0, 0.0)
    >>> train.feed(np.array([0.0, 5.0]), 10.0, 0.5)
    >>> train.times().round(3).tolist()
    [0.15, 0.55]
    """

    def __init__(self) -> None:
        self._levels: tuple[float, float] | None = None
        self._held = np.empty(0)
        self._parts: list[FloatArray] = []

    def feed(self, samples: FloatArray, rate: float, start: float) -> None:
        """Add samples in any unit, the first at time `start` [s]; RecordingError if the first chunk is constant."""
        known = samples[np.isfinite(samples)]
        if self._levels is None:
            low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
            if not high > low:
                raise RecordingError(
                    "the reference is constant: the tacho was off, unplugged, or another column is meant"
                )
            self._levels = 0.5 * (low + high), _HYSTERESIS * (high - low)
        middle, reach = self._levels
        run = np.concatenate([self._held, np.where(np.isfinite(samples), samples, middle)])
        first = start - self._held.size / rate
        state = np.where(run > middle + reach, 1, np.where(run < middle - reach, -1, 0))
        outside = np.flatnonzero(state)
        rises = np.flatnonzero((state[outside][:-1] < 0) & (state[outside][1:] > 0))
        crossings = [_crossing(run, outside[i], outside[i + 1], middle) for i in rises]
        self._parts.append(np.array(crossings) / rate + first)
        self._held = run[outside[-1] :].copy() if outside.size else run

    def times(self) -> FloatArray:
        """Times of all pulses so far [s]."""
        return np.concatenate([np.empty(0), *self._parts])


def _crossing(samples: FloatArray, before: int, after: int, level: float) -> float:
    """Fractional index of the last rise of samples through a level between two indices."""
    below = before + int(np.flatnonzero(samples[before:after] <= level)[-1])
    return below + float((level - samples[below]) / (samples[below + 1] - samples[below]))
