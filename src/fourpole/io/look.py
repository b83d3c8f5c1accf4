"""Summary of the samples of each channel: range, gaps, standard deviation, strongest spectral line and outline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.core.demodulation.sums import hann
from fourpole.core.recording import uniform_time
from fourpole.errors import FourpoleError, RecordingError
from fourpole.io.signals import FileInfo, Progress, Signal, SignalInfo
from fourpole.io.stream import by_halves, surveyed_stream

FloatArray = NDArray[np.float64]

#: Number of equal parts of a recording of which the least and the greatest value are kept.
_PLACES = 1024
#: Samples from the middle of a recording whose spectrum is taken, and least share of their variance in one line.
_SPECTRUM, _CLEAR = 1 << 16, 0.5
#: A step of the times is a jump if it is longer than this multiple of the median step.
_JUMP = 1.5


@dataclass(frozen=True, eq=False)
class ChannelSummary(ByValue):
    """Summary of the samples of a channel, in its own unit.

    Attributes
    ----------
    count, missing, longest_gap : int
        Number of samples, of samples that are not-a-number or infinite, and the largest number of these in a row.
    least, greatest, mean, std : float
        Statistics of the finite samples; not-a-number if there is none.
    frequency : float or None [Hz]
        Frequency of the spectral line that has more than half of the variance; None if there is no such line.
    rate, start, duration : float or None [Hz], [s], [s]
        From the file, or from its column of times; the rate is also None if many steps are uneven.
    clock : str
        Name of the channel that has the times; empty if the file itself states them.
    jumps, stops : int
        Number of steps of the times longer than one and a half times the median, and of steps that are not positive.
    longest_step : float [s]
        Longest step of the times; 0 if the file states a rate.
    outline : (parts, 2) float array
        Least and greatest value in equal parts of the recording; not-a-number if all samples of a part are missing.
    """

    count: int
    missing: int
    longest_gap: int
    least: float
    greatest: float
    mean: float
    std: float
    frequency: float | None
    rate: float | None
    start: float | None
    duration: float | None
    clock: str
    jumps: int
    stops: int
    longest_step: float
    outline: FloatArray


def look_at(
    path: Path, found: FileInfo, chosen: Sequence[int], *, progress: Progress | None = None
) -> dict[int, ChannelSummary | str]:
    """Summaries of some channels, in one pass and limited memory if the format can be read in parts.

    Parameters
    ----------
    path : Path
        The file.
    found : FileInfo
        Its description by `survey`.
    chosen : sequence of int
        Indices of the channels in `found.signals`.
    progress : callable, optional
        Called with the number of samples that are done, and the number of all samples.

    Returns
    -------
    dict of int to ChannelSummary or str
        The summary of each channel by its index; the message of the error if the channel cannot be read.
    """
    result: dict[int, ChannelSummary | str] = {}
    total = sum(found.signals[one].count for one in chosen)

    def read(some: list[int]) -> dict[int, ChannelSummary]:
        run = surveyed_stream(path, found, some, label=path.name)
        tallies = [_Tally(found.signals[one].count) for one in some]
        done = sum(found.signals[one].count for one in result)
        for chunk in run.chunks:
            for tally, signal in zip(tallies, chunk, strict=True):
                tally.feed(signal)
            done += sum(signal.samples.size for signal in chunk)
            if progress is not None:
                progress(done, total)
        names = {one: found.signals[clock].name for one, clock in run.clocks.items()}
        return {one: tally.summary(names.get(one, "")) for one, tally in zip(some, tallies, strict=True)}

    for some, summaries in by_halves(chosen, read):
        if isinstance(summaries, FourpoleError):
            result[some[0]] = str(summaries).removeprefix(f"{path.name}: ")
        else:
            result |= summaries
    return {one: result[one] for one in chosen}


def rate_of(signal: Signal) -> float | None:
    """Sample rate of a signal, as stated or by its times [Hz]; None if it has neither, or if many steps are uneven."""
    if signal.rate or signal.time is None:
        return signal.rate
    steps = _Steps()
    steps.feed(signal.time)
    with suppress(RecordingError):  # steps of rounded times may differ by as much as lost samples
        return steps.rate if not steps.jumps + steps.stops else float(f"{1.0 / uniform_time(signal.time)[0]:.10g}")
    return steps.rate


@dataclass
class _Steps:
    """Statistics of the times of a channel, which are fed in parts."""

    first: float = math.nan
    last: float = math.nan
    middle: float = 0.0
    count: int = 0
    jumps: int = 0
    stops: int = 0
    longest: float = 0.0

    def feed(self, time: FloatArray) -> None:
        if not time.size:
            return
        steps = np.diff(time, prepend=[self.last] if self.count else [])
        if not self.count:
            self.first = float(time[0])
            self.middle = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        steps = steps[np.isfinite(steps)]
        self.jumps += int(np.count_nonzero(steps > _JUMP * self.middle))
        self.stops += int(np.count_nonzero(steps <= 0))
        self.longest = max(self.longest, float(steps.max(initial=0.0)))
        self.count += time.size
        self.last = float(time[-1])

    @property
    def rate(self) -> float | None:
        span = self.last - self.first
        if self.count < 2 or not span > 0 or not self.middle > 0 or self.jumps + self.stops > 0.1 * self.count:
            return None
        mean = 1.0 / self.middle if self.jumps + self.stops else (self.count - 1) / span
        return float(f"{mean:.10g}")  # more digits would show the rounding of the times


@dataclass(eq=False)
class _Tally:
    """Statistics of a channel, whose samples are fed in parts."""

    expected: int
    count: int = 0
    known: int = 0
    missing: int = 0
    gap: int = 0
    longest_gap: int = 0
    least: float = math.nan
    greatest: float = math.nan
    mean: float = 0.0
    square: float = 0.0
    rate: float | None = None
    start: float | None = None
    steps: _Steps = field(default_factory=_Steps)
    middle: list[FloatArray] = field(default_factory=list)
    outline: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.outline = np.full((max(1, min(_PLACES, self.expected)), 2), np.nan)

    def feed(self, signal: Signal) -> None:
        samples = signal.samples
        if not samples.size:
            return
        if signal.time is not None:
            self.steps.feed(signal.time)
        elif signal.rate and self.start is None:
            self.rate, self.start = signal.rate, signal.start
        there = np.isfinite(samples)
        self._gaps(there)
        self._moments(samples if there.all() else samples[there])
        self._extend_outline(np.where(there, samples, np.nan))
        begin = max(0, self.expected // 2 - _SPECTRUM // 2)
        low, high = (int(np.clip(edge - self.count, 0, samples.size)) for edge in (begin, begin + _SPECTRUM))
        if high > low:
            self.middle.append(samples[low:high].copy())
        self.count += samples.size

    def _gaps(self, there: NDArray[np.bool_]) -> None:
        """Count the missing samples; a gap may have begun in the samples before."""
        self.missing += int(np.count_nonzero(~there))
        gaps = np.diff(np.flatnonzero(there), prepend=-1 - self.gap, append=there.size) - 1
        self.gap, self.longest_gap = int(gaps[-1]), max(self.longest_gap, int(gaps.max()))

    @np.errstate(over="ignore", invalid="ignore")
    def _moments(self, samples: FloatArray) -> None:
        """Combine mean, sum of squares about the mean, and range with those of the samples before."""
        if not samples.size:
            return
        mean = float(samples.mean())
        shift, together = mean - self.mean, self.known + samples.size
        self.square += float(np.sum((samples - mean) ** 2)) + shift * shift * self.known * samples.size / together
        self.mean += shift * samples.size / together
        self.known = together
        self.least = float(np.fmin(self.least, samples.min()))
        self.greatest = float(np.fmax(self.greatest, samples.max()))

    def _extend_outline(self, samples: FloatArray) -> None:
        places = (self.count + np.arange(samples.size)) * len(self.outline) // max(self.expected, 1)
        places = np.minimum(places, len(self.outline) - 1)
        edges = np.flatnonzero(np.diff(places, prepend=-1))
        at = places[edges]
        self.outline[at, 0] = np.fmin(self.outline[at, 0], np.fmin.reduceat(samples, edges))
        self.outline[at, 1] = np.fmax(self.outline[at, 1], np.fmax.reduceat(samples, edges))

    def summary(self, clock: str) -> ChannelSummary:
        """The summary of all samples fed so far; `clock` names the channel with their times."""
        stamped = self.steps.count > 0
        rate = self.steps.rate if stamped else self.rate
        start = self.steps.first if stamped else self.start
        duration = self.steps.last - self.steps.first if stamped else (self.count - 1) / rate if rate else None
        known = self.known > 0
        return ChannelSummary(
            count=self.count,
            missing=self.missing,
            longest_gap=self.longest_gap,
            least=self.least,
            greatest=self.greatest,
            mean=self.mean if known else math.nan,
            std=math.sqrt(self.square / self.known) if known else math.nan,
            frequency=_line(np.concatenate(self.middle), rate) if rate and self.middle else None,
            rate=rate,
            start=start,
            duration=duration,
            clock=clock if stamped else "",
            jumps=self.steps.jumps,
            stops=self.steps.stops,
            longest_step=self.steps.longest,
            outline=self.outline,
        )


def filled(samples: FloatArray) -> FloatArray:
    """The samples of a channel; missing ones are interpolated between their neighbours."""
    there = np.isfinite(samples)
    if there.all():
        return samples
    at = np.arange(samples.size)
    return np.interp(at, at[there], samples[there])


def _line(samples: FloatArray, rate: float) -> float | None:
    """Frequency of the spectral line that has most of the variance [Hz]; None if no line has."""
    there = np.isfinite(samples)
    if there.sum() < 32:
        return None
    samples = filled(samples)
    power = np.abs(np.fft.rfft((samples - samples.mean()) * hann(samples.size))) ** 2
    total = float(np.sum(power[1:]))
    power[:2] = 0.0
    peak = int(np.argmax(power))
    inside = power[max(peak - 2, 0) : peak + 3]
    if peak < 3 or peak >= power.size - 1 or not inside.sum() > _CLEAR * total:
        return None
    side = 1 if power[peak + 1] > power[peak - 1] else -1
    ratio = math.sqrt(power[peak + side] / power[peak])
    # The ratio of the two highest lines of a sinusoid under a Hann window gives its frequency (Grandke 1983).
    return float((peak + side * (2 * ratio - 1) / (ratio + 1)) * rate / samples.size)


#: The classes of the description of a file.
OF_WORK = (FileInfo, SignalInfo)
