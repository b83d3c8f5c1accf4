"""Chunks of a recording become channels: SI values on their own time base, with fewer samples where there are many."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fourpole import units
from fourpole.campaign.channels import Conversion, ReferenceFile
from fourpole.core.arrays import FloatArray
from fourpole.core.decimate import Decimator
from fourpole.core.recording import Channel, uniform_time
from fourpole.core.recordingchecks import clipped_share
from fourpole.core.reference import PulseTrain, Reference
from fourpole.errors import RecordingError, TableError
from fourpole.io.signals import Signal
from fourpole.io.stream import agreed

#: Number of samples above which a channel is thinned: the sine fit keeps some thirty values per sample in memory.
_MOST_SAMPLES = 1 << 19
#: Thinning keeps at least this many samples per excitation cycle.
_PER_CYCLE = 4.0
#: Relative tolerance within which a nominal sample rate agrees with the times of the samples.
_SAME_NOMINAL = 1e-3
#: Number of angles of an encoder that are kept per chunk, about.
_MOST_ANGLES = 1 << 17


class Grids:
    """The uniform grid of the last stamps asked for: channels that share their stamps ask for the same one."""

    def __init__(self) -> None:
        self._stamps: FloatArray | None = None
        self._found = (float("nan"), "")

    def of(self, stamps: FloatArray) -> tuple[float, str]:
        """The interval of some stamps [s], and a remark; see `uniform_time`."""
        last = self._stamps
        if last is None or last.__array_interface__ != stamps.__array_interface__:
            self._stamps, self._found = stamps, uniform_time(stamps)
        return self._found


@dataclass(frozen=True)
class Timing:
    """The stated times of a test.

    Attributes
    ----------
    window : (float, float) or None [s]
        Start and end of the part that is used; None for the whole recording.
    near : float or None [Hz]
        Approximate frequency of the excitation.
    label : str
        Name of the file in messages.
    grids : Grids
        Grids of stamps, found once for all channels.
    """

    window: tuple[float, float] | None
    near: float | None
    label: str
    grids: Grids = field(default_factory=Grids, compare=False)

    def longest(self, count: int, rate: float) -> int:
        """Largest number of samples that the window can hold, for a channel with `count` samples."""
        if self.window is None:
            return count
        return min(count, int((self.window[1] - self.window[0]) * rate) + 2)


class ChannelBuilder:
    """One channel, built chunk by chunk."""

    def __init__(self, name: str, conversion: Conversion, unit: str | None, timing: Timing, count: int) -> None:
        self._name, self._conversion, self._unit, self._timing, self._count = name, conversion, unit, timing, count
        self._base = TimeBase(timing)
        self._thin: Decimator | None = None
        self._clipped: list[tuple[int, float]] = []

    def feed(self, signal: Signal) -> None:
        """Take the samples of the next chunk."""
        if self._unit is not None:
            agreed(self._name, signal.unit, self._unit, self._conversion.kind)
        kept = self._base.feed(signal)
        samples = signal.samples[kept]
        if not samples.size:
            return
        with np.errstate(invalid="ignore", over="ignore"):  # the checks report samples that are no numbers
            values = self._conversion.slope * (samples - self._conversion.offset)
        if self._thin is None:
            self._thin = Decimator(self._factor(samples.size))
        if self._thin.factor > 1:
            whole = Channel(values, self._conversion.kind, limits=self._conversion.limits)
            self._clipped.append((values.size, clipped_share(whole)))
        self._thin.feed(values)

    def _factor(self, size: int) -> int:
        """Factor by which the number of samples is reduced."""
        rate = self._base.rate
        longest = self._timing.longest(max(self._count, size), rate)
        most = longest // 16 if self._timing.near is None else int(rate / (_PER_CYCLE * self._timing.near))
        return max(1, min(-(-longest // _MOST_SAMPLES), most))

    def channel(self) -> tuple[Channel, str]:
        """The channel on its own time base, and a remark on its times."""
        if self._thin is None:
            raise TableError(self._base.empty())
        start, rate = self._base.start, self._base.rate
        weight = sum(size for size, _ in self._clipped)
        made = self._conversion
        channel = Channel(
            samples=self._thin.samples(),
            quantity=made.kind,
            delay=made.delay,
            limits=made.limits,
            rate=rate / self._thin.factor,
            start=start + self._thin.shift / rate,
            chain=made.chain,
            crosstalk=made.crosstalk,
            clipped=sum(size * share for size, share in self._clipped) / weight if weight else None,
        )
        return channel, self._base.remark


class ReferenceBuilder:
    """The reference of the drive, built chunk by chunk: pulses of a tacho, or the angle of an encoder."""

    def __init__(self, stated: ReferenceFile, timing: Timing) -> None:
        self._stated = stated
        self._base = TimeBase(replace(timing, window=None))
        self._window = timing.window
        self._train = PulseTrain()
        self._angles: list[tuple[FloatArray, FloatArray]] = []
        self._refused: RecordingError | None = None

    def feed(self, signal: Signal) -> None:
        """Take the samples of the next chunk; `reference` raises an error that occurs here."""
        if self._refused is not None:
            return
        try:
            self._take(signal)
        except RecordingError as error:
            self._refused = error

    def _take(self, signal: Signal) -> None:
        first = self._base.kept
        self._base.feed(signal)
        if not signal.samples.size:
            return
        rate = self._base.rate
        start = self._base.start + first / rate if signal.time is None else float(signal.time[0])
        if self._stated.is_angle:
            step = max(1, signal.samples.size // _MOST_ANGLES)
            times = start + np.arange(0, signal.samples.size, step) / rate
            unit = agreed(signal.name, signal.unit, self._stated.unit, "angle")
            self._angles.append((times, signal.samples[::step] * units.unit_scale(unit, "angle")))
        else:
            self._train.feed(signal.samples, rate, start)

    def reference(self) -> Reference:
        """The reference from all chunks; RecordingError where it does not turn."""
        if self._refused is not None:
            raise self._refused
        low, high = self._window or (-np.inf, np.inf)
        if self._stated.is_angle:
            time, angle = (np.concatenate(parts) for parts in zip(*self._angles, strict=True))
            kept = (time >= low) & (time <= high)
            return Reference.from_angle(time[kept], angle[kept], cycles=self._stated.cycles)
        times = self._train.times()
        times = times[(times >= low) & (times <= high)]
        return Reference.from_pulses(times, pulses=self._stated.pulses, cycles=self._stated.cycles)


class TimeBase:
    """The time base of one channel, found from its chunks in their order.

    Attributes
    ----------
    kept : int
        Number of samples in the window so far.
    start, rate : float [s], [Hz]
        Time of the first sample in the window; samples per second.
    remark : str
        Remark on the times; empty where they are as stated.
    """

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self.kept = 0
        self.start = self._last = float("nan")
        self.remark = ""
        self._span = (float("inf"), float("-inf"))
        self.rate = float("nan")

    def feed(self, signal: Signal) -> slice:
        """Take the times of the next chunk, and return which of its samples lie in the window."""
        if signal.time is not None:
            kept = self._by_stamps(signal.time)
            self._compare_rate(signal.rate)
            return kept
        assert signal.rate is not None
        count, first, rate = signal.samples.size, signal.start, signal.rate
        if count:
            self._span = min(self._span[0], first), max(self._span[1], first + (count - 1) / rate)
        low, high = 0, count
        if self._timing.window is not None:
            low, high = (int(np.clip(np.ceil((edge - first) * rate - 1e-6), 0, count)) for edge in self._timing.window)
        if high > low and not self.kept:
            self.start, self.rate = first + low / rate, rate
        self.kept += high - low
        return slice(low, high)

    def _compare_rate(self, nominal: float | None) -> None:
        """Add a remark if the times contradict the sample rate that the file states, too."""
        if nominal is not None and self.kept > 1 and abs(self.rate / nominal - 1) > _SAME_NOMINAL:
            self.remark = self.remark or (
                f"the file says {nominal:.6g} samples per second, its times {self.rate:.6g}: these were taken; "
                "if the rate is right, state sample_rate in campaign.toml in place of time"
            )

    def _by_stamps(self, stamps: FloatArray) -> slice:
        if stamps.size:
            self._span = min(self._span[0], float(stamps[0])), max(self._span[1], float(stamps[-1]))
        window = self._timing.window
        low, high = (0, stamps.size) if window is None else (int(x) for x in np.searchsorted(stamps, window))
        kept = stamps[low:high]
        if kept.size > 1 or (kept.size and not self.kept):
            self._join(kept)
        return slice(low, high)

    def _join(self, stamps: FloatArray) -> None:
        step, remark = self._timing.grids.of(stamps)
        self.remark = self.remark or remark
        if self.kept:
            gap = float(stamps[0]) - self._last
            if abs(gap * self.rate - 1) > 0.5 or abs(step * self.rate - 1) * stamps.size > 0.5:
                raise RecordingError(
                    f"time is not uniform: {gap:.6g} s after {self._last:.9g} s where the interval was "
                    f"{1 / self.rate:.6g} s; samples were lost or the rate changed: cut with window [s]"
                )
        else:
            self.rate = 1.0 / step
            self.start = float(np.mean(stamps)) - 0.5 * (stamps.size - 1) * step
        self.kept += stamps.size
        self._last = float(stamps[-1])
        if self._last > self.start and self.kept > stamps.size:
            self.rate = (self.kept - 1) / (self._last - self.start)

    def empty(self) -> str:
        """Message that says why the channel has no samples."""
        window = self._timing.window
        if window is None or self._span[1] < self._span[0]:
            return f"{self._timing.label} holds no samples: record the test again"
        return (
            f"window {window[0]:g}..{window[1]:g} s holds no samples: the recording runs "
            f"{self._span[0]:g} to {self._span[1]:g} s"
        )
