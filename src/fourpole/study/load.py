"""The file of a test becomes channels in SI units on their own time bases, as campaign.toml states its columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.campaign.channels import ChannelFile, ChannelsFile, Conversion, DriveFile, ReferenceFile
from fourpole.campaign.place import group_of, inside
from fourpole.campaign.row import Test
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.demodulation.demodulate import first_guess
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.recording import Channel, Decimator, Recording, uniform_time
from fourpole.core.recordingchecks import clipped_share
from fourpole.core.reference import PulseTrain, Reference
from fourpole.errors import FileError, FourpoleError, Message, RecordingError, TableError
from fourpole.io.signals import Signal
from fourpole.io.stream import Chunk, Stream, StreamSource, agreed, stream, times_of
from fourpole.study.response import MeanOfSensors, read_response

#: Number of samples per chunk where only the first part of a recording is loaded.
_ROWS_OF_PART = 1 << 14
#: Relative tolerance within which the reference turns at the frequency of V1.
_SAME_SPEED = 0.03
#: Number of samples above which a channel is thinned: the sine fit keeps some thirty values per sample in memory.
_MOST_SAMPLES = 1 << 19
#: Thinning keeps at least this many samples per excitation cycle.
_PER_CYCLE = 4.0
#: Relative tolerance within which a nominal sample rate agrees with the times of the samples.
_SAME_NOMINAL = 1e-3
#: Number of angles of an encoder that are kept per chunk, about.
_MOST_ANGLES = 1 << 17


def load_recording(
    folder: Path,
    path: Path,
    test: Test,
    channels: ChannelsFile,
    roles: Sequence[str],
    *,
    part: float | None = None,
    read: Callable[[StreamSource], Stream] = stream,
) -> tuple[Recording, list[Message]]:
    """The channels `roles` of a dynamic test and the reference of the drive, with remarks on their times.

    With `part` [s], the recording ends this long after its own start, or after the start of the window. `read` gives
    the samples of the file.
    """
    loaded, remarks, reference = _gathered(path, test, channels, roles, channels.reference, part=part, read=read)
    for role, channel in loaded.items():
        stated = channels.named(role)
        if isinstance(stated, ChannelFile) and stated.response is not None:
            response = read_response(inside(folder, stated.response), stated.response)
            loaded[role] = replace(channel, chain=(*channel.chain, response))
    return Recording(loaded["motion_in"].rate or 1.0, loaded, test.file, reference), remarks


def load_curve(path: Path, test: Test, channels: ChannelsFile) -> LoadCurve:
    """The load-deflection curve of a static test.

    Channels with different times are interpolated at the times of the channel with the lower sample rate. The curve has
    times where the file or campaign.toml states them.
    """
    roles = ("load", "deflection")
    loaded = _gathered(path, test, channels, roles, None, timed=test.window is not None)[0]
    for name, channel in loaded.items():
        if channel.limits is not None and clipped_share(channel) > 0:
            raise TableError(f"{name} reaches the end of its stated range: repeat the test with a larger range")
    force, travel = (loaded[role] for role in roles)
    load, deflection = force.samples, travel.samples
    if (force.rate, force.start, load.size) != (travel.rate, travel.start, deflection.size):
        slow, quick = sorted((force, travel), key=lambda channel: channel.rate or 0.0)
        time, quick_time = (line.start + np.arange(line.samples.size) / (line.rate or 1.0) for line in (slow, quick))
        within = (time >= quick_time[0]) & (time <= quick_time[-1])
        brought, kept = np.interp(time[within], quick_time, quick.samples), slow.samples[within]
        load, deflection = (kept, brought) if slow is force else (brought, kept)
        return LoadCurve(deflection, load, time[within])
    timed = force
    if test.window is None:
        try:
            timed = _gathered(path, test, channels, roles, None)[0]["load"]
        except FileError:
            raise
        except FourpoleError:  # the times are unknown or not uniform
            return LoadCurve(deflection, load)
    if timed.samples.size != load.size:
        return LoadCurve(deflection, load)
    return LoadCurve(deflection, load, timed.start + np.arange(load.size) / (timed.rate or 1.0))


def _gathered(
    path: Path,
    test: Test,
    channels: ChannelsFile,
    roles: Sequence[str],
    turning: ReferenceFile | None,
    *,
    timed: bool = True,
    part: float | None = None,
    read: Callable[[StreamSource], Stream] = stream,
) -> tuple[dict[str, Channel], list[Message], Reference | None]:
    """Channels by role, remarks, and the reference.

    If not `timed`, channels with equal numbers of samples count as sampled at the same times.
    """
    stated = {role: channel for role in roles if (channel := channels.line(role)) is not None}
    timing = Timing(test.window, test.value("frequency") if test.band is None else test.band[1], test.file)
    further = {role: getattr(channel, "beside", ()) for role, channel in stated.items()}
    besides = [stated[role].model_copy(update={"column": name}) for role, names in further.items() for name in names]
    columns = [*stated.values(), *besides, *([turning] if turning is not None else [])]
    source = source_of(path, test, channels, columns, timed=timed)
    turn = ReferenceBuilder(turning, timing) if turning is not None else None
    run = read(source if part is None else replace(source, rows=_ROWS_OF_PART))
    means = {role: MeanOfSensors(1 + len(names)) for role, names in further.items() if names}
    lines = _fed(run, channels, stated, means, turn, timing, part)
    built = {role: line.channel() for role, line in lines.items()}
    built |= {role: replace(built[role], tilt=mean.tilt) for role, mean in means.items()}
    remarks = [Message("time base", "", line.base.remark) for line in lines.values() if line.base.remark]
    reference = None
    if turn is not None:
        try:
            reference = _checked(turn.reference(), built["motion_in"], timing)
        except RecordingError as error:
            remarks.append(Message("reference", error.site, f"[channels] reference is not used: {error}"))
    return built, list(dict.fromkeys(remarks)), reference


def _fed(
    run: Stream,
    channels: ChannelsFile,
    stated: Mapping[str, ChannelFile | DriveFile],
    means: Mapping[str, MeanOfSensors],
    turn: ReferenceBuilder | None,
    timing: Timing,
    part: float | None,
) -> dict[str, ChannelBuilder]:
    """The channels by role with all their chunks; `timing` gets the times that are found."""
    lines: dict[str, ChannelBuilder] = {}
    for chunk in run.chunks:
        signals, first = dict(zip(stated, chunk, strict=False)), len(stated)
        for role, mean in means.items():
            last = first + mean.sensors - 1
            signals[role], first = mean.feed([signals[role], *chunk[first:last]]), last
        if not lines:
            if part is not None:
                timing.window = _part_of(chunk, timing.window, part)
            if run.count and timing.near is None and "motion_in" in stated:
                timing.near = _about(signals["motion_in"], channels, timing)
            for role, channel in stated.items():
                conversion = channels.conversion(role, signals[role].unit)
                lines[role] = ChannelBuilder(
                    channel.column, conversion, channel.plain_unit, TimeBase(timing), run.count
                )
        for role, line in lines.items():
            line.feed(signals[role])
        if turn is not None:
            turn.feed(chunk[-1])
        if part is not None and timing.window is not None:
            ends = [time[-1] for time in _known_times(chunk)]
            if ends and min(ends) > timing.window[1]:
                break
    return lines


def _part_of(chunk: Chunk, window: tuple[float, float] | None, part: float) -> tuple[float, float]:
    """Start and end of the first part of a recording, or of its window [s]."""
    start = window[0] if window is not None else max(float(time[0]) for time in _known_times(chunk))
    return start, min(start + part, window[1] if window is not None else np.inf)


def _known_times(chunk: Chunk) -> list[FloatArray]:
    return [time for signal in chunk if signal.samples.size and (time := times_of(signal)) is not None]


def source_of(
    path: Path,
    test: Test,
    channels: ChannelsFile,
    columns: Sequence[ChannelFile | DriveFile | ReferenceFile],
    *,
    timed: bool = True,
) -> StreamSource:
    """The columns that are read of a recording, and the stated times."""
    names = tuple(channel.column for channel in columns)
    source = StreamSource(path, names, test.file, group_of(path, test.file), needs="times" if timed else "order")
    if not timed or channels.rate is not None or channels.time is None:
        return replace(source, rate=channels.rate if timed else None)
    return replace(source, clock=channels.time.column, unit=channels.time.unit)


def _checked(reference: Reference, motion: Channel, timing: Timing) -> Reference:
    """The reference; RecordingError where its speed differs from the frequency of V1."""
    recording = Recording(motion.rate or 1.0, {"motion_in": motion}, timing.label, reference)
    first, last = recording.span
    turned = reference.omega(first, last) / (2 * np.pi)
    moved = first_guess(recording.between(first, last), timing.near)
    if abs(turned / moved - 1) > _SAME_SPEED:
        raise RecordingError(
            f"it turns at {turned:.5g} Hz, V1 at {moved:.5g} Hz: check pulses and cycles, and that no pulse is lost to "
            "the sample rate"
        )
    return reference


def _about(signal: Signal, channels: ChannelsFile, timing: Timing) -> float | None:
    """Approximate frequency of the excitation [Hz], from V1 in the first chunk of a long recording."""
    role = channels.named("motion_in")
    assert role is not None
    line = ChannelBuilder(role.column, channels.conversion("motion_in", signal.unit), role.plain_unit, TimeBase(timing))
    try:
        line.feed(signal)
        return first_guess(Recording(1.0, {"motion_in": line.channel()}))
    except FourpoleError:
        return None  # the builder of the channel raises the same error


# --- one channel, chunk by chunk --------------------------------------------------------------------------------------


@dataclass(eq=False)
class Timing(ByValue):
    """The times of a recording that all its channels share.

    Attributes
    ----------
    window : (float, float) or None [s]
        Start and end of the part that is used; None for the whole recording.
    near : float or None [Hz]
        Approximate frequency of the excitation.
    label : str
        Name of the file in messages.
    stamps : float array or None [s]
        The stamps that were looked at last: channels with the same stamps follow one another.
    grid : (float, str)
        Interval of these stamps [s], and a remark on them.
    """

    window: tuple[float, float] | None
    near: float | None
    label: str
    stamps: FloatArray | None = None
    grid: tuple[float, str] = (float("nan"), "")


@dataclass
class TimeBase:
    """The time base of one channel, found from its chunks in their order.

    Attributes
    ----------
    timing : Timing
        The times that are stated.
    kept : int
        Number of samples in the window so far.
    start, rate : float [s], [Hz]
        Time of the first sample in the window; samples per second.
    remark : str
        Remark on the times; empty where they are as stated.
    """

    timing: Timing
    kept: int = 0
    start: float = float("nan")
    rate: float = float("nan")
    remark: str = ""
    _last: float = float("nan")
    _span: tuple[float, float] = (float("inf"), float("-inf"))

    def feed(self, signal: Signal) -> slice:
        """Take the times of the next chunk, and return which of its samples lie in the window."""
        stamps, window = signal.time, self.timing.window
        if stamps is None:
            return self._by_rate(signal)
        if stamps.size:
            self._span = min(self._span[0], float(stamps[0])), max(self._span[1], float(stamps[-1]))
        low, high = (0, stamps.size) if window is None else (int(edge) for edge in np.searchsorted(stamps, window))
        if high - low > 1 or (high > low and not self.kept):
            self._join(stamps[low:high])
        if signal.rate is not None and self.kept > 1 and abs(self.rate / signal.rate - 1) > _SAME_NOMINAL:
            self.remark = self.remark or (
                f"the file says {signal.rate:.6g} samples per second, its times {self.rate:.6g}: these were taken; "
                "if the rate is right, state sample_rate in campaign.toml in place of time"
            )
        return slice(low, high)

    def _by_rate(self, signal: Signal) -> slice:
        """The samples of a chunk in the window, by its start and its rate."""
        assert signal.rate is not None
        count, first, rate = signal.samples.size, signal.start, signal.rate
        if count:
            self._span = min(self._span[0], first), max(self._span[1], first + (count - 1) / rate)
        low, high = 0, count
        if self.timing.window is not None:
            low, high = (int(np.clip(np.ceil((edge - first) * rate - 1e-6), 0, count)) for edge in self.timing.window)
        if high > low and not self.kept:
            self.start, self.rate = first + low / rate, rate
        self.kept += high - low
        return slice(low, high)

    def _join(self, stamps: FloatArray) -> None:
        """Take the stamps of a chunk in the window; RecordingError where they do not continue the former ones."""
        timing = self.timing
        if timing.stamps is None or timing.stamps.__array_interface__ != stamps.__array_interface__:
            timing.stamps, timing.grid = stamps, uniform_time(stamps)
        step, remark = timing.grid
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
        window = self.timing.window
        if window is None or self._span[1] < self._span[0]:
            return f"{self.timing.label} holds no samples: record the test again"
        return (
            f"window {window[0]:g}..{window[1]:g} s holds no samples: the recording runs "
            f"{self._span[0]:g} to {self._span[1]:g} s"
        )


@dataclass
class ChannelBuilder:
    """One channel, built chunk by chunk: SI values on its time base, with fewer samples where there are many.

    Attributes
    ----------
    name : str
        Its column.
    conversion : Conversion
    unit : str or None
        The unit that campaign.toml states.
    base : TimeBase
    count : int
        Number of samples of the recording; 0 if it is not known.
    """

    name: str
    conversion: Conversion
    unit: str | None
    base: TimeBase
    count: int = 0
    _thin: Decimator | None = None
    _clipped: list[tuple[int, float]] = field(default_factory=list)

    def feed(self, signal: Signal) -> None:
        """Take the samples of the next chunk; the first decides by what factor their number is reduced."""
        conversion, base = self.conversion, self.base
        if self.unit is not None:
            agreed(self.name, signal.unit, self.unit, conversion.kind)
        samples = signal.samples[base.feed(signal)]
        if not samples.size:
            return
        with np.errstate(invalid="ignore", over="ignore"):  # the checks report samples that are no numbers
            values = conversion.slope * (samples - conversion.offset)
        if self._thin is None:
            window, near, longest = base.timing.window, base.timing.near, max(self.count, samples.size)
            if window is not None:
                longest = min(longest, int((window[1] - window[0]) * base.rate) + 2)
            most = longest // 16 if near is None else int(base.rate / (_PER_CYCLE * near))
            self._thin = Decimator(max(1, min(-(-longest // _MOST_SAMPLES), most)))
        if self._thin.factor > 1:
            whole = Channel(values, conversion.kind, limits=conversion.limits)
            self._clipped.append((values.size, clipped_share(whole)))
        self._thin.feed(values)

    def channel(self) -> Channel:
        """The channel on its own time base."""
        if self._thin is None:
            raise TableError(self.base.empty())
        weight = sum(size for size, _ in self._clipped)
        conversion = self.conversion
        return Channel(
            samples=self._thin.samples(),
            quantity=conversion.kind,
            delay=conversion.delay,
            limits=conversion.limits,
            rate=self.base.rate / self._thin.factor,
            start=self.base.start + self._thin.shift / self.base.rate,
            chain=conversion.chain,
            crosstalk=conversion.crosstalk,
            clipped=sum(size * share for size, share in self._clipped) / weight if weight else None,
        )


class ReferenceBuilder:
    """The reference of the drive, built chunk by chunk: pulses of a tacho, or the angle of an encoder."""

    def __init__(self, stated: ReferenceFile, timing: Timing) -> None:
        self._stated, self._window = stated, timing.window
        self._base = TimeBase(replace(timing, window=None))
        self._train = PulseTrain()
        self._angles: list[tuple[FloatArray, FloatArray]] = []
        self._refused: RecordingError | None = None

    def feed(self, signal: Signal) -> None:
        """Take the samples of the next chunk; `reference` raises an error that occurs here."""
        if self._refused is not None:
            return
        first = self._base.kept
        try:
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
        except RecordingError as error:
            self._refused = error

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
