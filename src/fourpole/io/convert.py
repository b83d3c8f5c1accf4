"""Writes a recording of any format in another one, with a remark on everything that is changed or not kept."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from fourpole.core.arrays import same_value
from fourpole.core.recording import uniform_time
from fourpole.errors import FileError, RecordingError, TableError
from fourpole.io.child import read_apart
from fourpole.io.formats.guard import tidy
from fourpole.io.recordings import chosen_of, survey
from fourpole.io.signals import FileInfo, Progress, Signal, SignalInfo
from fourpole.io.stream import Chunk, by_halves, surveyed_stream, times_of
from fourpole.io.write import beside, why
from fourpole.io.writers import CSV, MDF, PARQUET, Block, FloatArray, Group, Remarks, Writer, WrittenChannel
from fourpole.units import shown

#: The writers of all formats, by kind.
WRITERS = {one.kind: one for one in (CSV, PARQUET, MDF)}
#: Tools that write a format which is not written here, by the endings of its files.
_TOOLS = {
    "npTDMS, or LabVIEW": (".tdms",),
    "scipy.io.savemat, or asammdf from .mf4": (".mat",),
    "h5py, or asammdf from .mf4": (".h5", ".hdf5", ".hdf"),
    "pyuff": (".uff", ".unv", ".uf58"),
    "soundfile": (".wav",),
    "a program of the tyre laboratory; fourpole export writes results as TYDEX": (".tdx",),
}
#: Tolerance at the ends of a window, and largest drift of a rate that is rounded to whole Hz; fractions of a time step.
_INTO_STEP, _DRIFT = 1e-6, 0.1
#: Largest number of groups in a message.
_NAMED = 8
#: Notes that the readers of Fourpole add, which are not notes of the file.
_OURS = re.compile(
    r"time from .*|time signal|[0-9]+|[0-9]+ bit .*|scaled by the file|times of day.*|seconds from the first"
    r"|running time"
)


@dataclass(frozen=True)
class Choice:
    """The part of a recording that is converted, and the format that is written.

    Attributes
    ----------
    group : str
        Only the channels of this group; empty: all channels.
    channels : tuple of str
        Only these channels; empty: all channels.
    window : (float, float) or None [s]
        First and last time of the samples that are kept.
    kind : str
        Kind of writer; empty: by the ending of the file's name.
    force : bool
        Whether an existing file is replaced.
    """

    group: str = ""
    channels: tuple[str, ...] = ()
    window: tuple[float, float] | None = None
    kind: str = ""
    force: bool = False


@dataclass(frozen=True)
class Converted:
    """The result of a conversion.

    Attributes
    ----------
    format : str
        Name of the written format.
    groups : tuple of str
        Samples, rate and channels of each group, as phrases.
    lost : tuple of str
        Remarks on what was changed, left out, or not kept.
    """

    format: str
    groups: tuple[str, ...]
    lost: tuple[str, ...]


def convert(
    path: str | Path, out: str | Path, choice: Choice | None = None, *, progress: Progress | None = None
) -> Converted:
    r"""Write a recording in another format.

    Samples are written as 64-bit floats in the unit that the file states; missing samples stay missing.

    Parameters
    ----------
    path : path
        A recording in any format that Fourpole reads.
    out : path
        The file to write; its ending selects the format.
    choice : Choice, optional
        Channels and part of the recording to write; by default the whole recording.
    progress : callable, optional
        Called with the number of samples that are done, and the number of all samples.

    Returns
    -------
    Converted

    Raises
    ------
    FileError
        If `out` exists already, or cannot be written.
    TableError
        If the recording cannot be read, or the format cannot hold it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     recording = Path(folder, "D1.csv")
    ...     _ = recording.write_text("t [s],F1 [N]\n0,1.5\n0.001,2\n0.002,2.5\n")
    ...     made = convert(recording, Path(folder, "D1.parquet"))
    >>> made.groups, made.lost
    (('3 samples at 1000 Hz (F1)',), ())
    """
    source, target, choice = Path(path), Path(out).absolute(), choice or Choice()
    _writer(target, choice.kind)
    with beside(target) as new:  # here, where it is deleted even if the worker ends
        made: Converted = read_apart(_convert, source, target, new, choice, classes=(Converted,), progress=progress)
        return made


#: The classes of what a worker process is told of a conversion.
OF_WORK = (Choice,)


def _convert(source: Path, target: Path, new: Path, choice: Choice, *, progress: Progress | None = None) -> Converted:
    """The conversion, as a worker process runs it: the file `new` is written, which then replaces `target`."""
    writer = _writer(target, choice.kind)
    found = survey(source)
    if target.exists() and target.samefile(source):
        raise FileError(f"{target.name}: is the file that is read; name another one")
    if target.exists() and not choice.force:
        raise FileError(f"{target.name}: is there already; name another file, or replace it with --force")
    places = chosen_of(found, choice.group, choice.channels, source.name)
    # The note on a WAV file is about reading and does not apply to the copy.
    remarks = Remarks(() if found.format == "WAV" else found.notes)
    places = places if choice.channels else _readable(source, found, places, remarks)
    run = surveyed_stream(source, found, places, label=source.name)
    first = next(iter(run.chunks))
    channels = [(found.signals[place], signal) for place, signal in zip(places, first, strict=True)]
    clocks = {places.index(at) for one, at in run.clocks.items() if at != one and at in places}
    plan = _Plan(channels, clocks, choice, remarks, source.name)
    _check_groups(target, writer, plan.groups)
    if writer.one_table and plan.groups[0].name and len(plan.groups) == 1:
        remarks.lost.append(f"the name of the group, {plan.groups[0].name}, is not kept")
    _write(new, writer, plan, chain([first], run.chunks), remarks, progress)
    return Converted(writer.name, tuple(group.words for group in plan.counted()), tuple(dict.fromkeys(remarks.lost)))


def _check_groups(target: Path, writer: Writer, groups: Sequence[Group]) -> None:
    """TableError if the format holds only one group and there are several."""
    if writer.one_table and len(groups) > 1:
        bases = "; ".join(group.words for group in groups[:_NAMED])
        bases += f"; and {len(groups) - _NAMED} more" if len(groups) > _NAMED else ""
        raise TableError(
            f"{target.name}: {writer.name} holds channels of one group and one rate, and there are {len(groups)}: "
            f"{bases}. Choose with --group or --channels, or write .mf4"
        )


def _write(
    new: Path, writer: Writer, plan: _Plan, chunks: Iterable[Chunk], remarks: Remarks, progress: Progress | None
) -> None:
    done = 0
    try:
        with writer.open(new, plan.groups, remarks) as add:
            for chunk in chunks:
                for at, block in plan.blocks(chunk):
                    add(at, block)
                done += sum(signal.samples.size for signal in chunk)
                if progress is not None:
                    progress(done, plan.total)
            plan.check_not_empty()
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{new.name}: cannot be written: {why(error)}") from error


def _writer(target: Path, kind: str) -> Writer:
    """The writer of this kind; if it is empty, the writer for the ending of the file's name."""
    if kind:
        if kind not in WRITERS:
            raise TableError(f"--to {shown(kind)} is no format that is written; known are {', '.join(WRITERS)}")
        return WRITERS[kind]
    for one in WRITERS.values():
        if target.suffix.lower() in one.endings:
            return one
    endings = ", ".join(ending for one in WRITERS.values() for ending in one.endings)
    tool = next((name for name, of in _TOOLS.items() if target.suffix.lower() in of), None)
    hint = "or state --to" if tool is None else f"it is written by {tool}"
    raise TableError(f"{target.name}: its ending is none of those that are written ({endings}); {hint}")


def _readable(path: Path, found: FileInfo, places: Sequence[int], remarks: Remarks) -> list[int]:
    """Indices of the channels that hold numbers; a remark is added on each of the others."""
    good: list[int] = []
    for some, chunk in by_halves(places, lambda some: next(surveyed_stream(path, found, some, label=path.name).chunks)):
        if isinstance(chunk, FileError) or (isinstance(chunk, TableError) and len(found.signals) == 1):
            raise chunk
        if isinstance(chunk, list):
            good += some
        else:
            why = str(chunk).removeprefix(f"{path.name}: ")
            remarks.lost.append(f"{found.signals[some[0]].name} is left out: {why}")
    if not good:
        raise TableError(f"{path.name}: {remarks.lost[0] if remarks.lost else 'has no channel that can be converted'}")
    return sorted(good)


class _Plan:
    """The groups of channels with the same times, and the blocks of each chunk that are written."""

    def __init__(
        self,
        channels: Sequence[tuple[SignalInfo, Signal]],
        clocks: Collection[int],
        choice: Choice,
        remarks: Remarks,
        label: str,
    ) -> None:
        self._window, self._remarks, self._label = choice.window, remarks, label
        self.total = sum(info.count for info, _ in channels)
        bases: dict[object, list[int]] = {}
        for at, channel in enumerate(channels):
            if at not in clocks:
                bases.setdefault(_base(*channel), []).append(at)
        self._members = list(bases.values())
        self.groups = [self._group([channels[at] for at in base]) for base in self._members]
        self._kept = [0] * len(bases)
        self._span = (np.inf, -np.inf)

    def _group(self, base: Sequence[tuple[SignalInfo, Signal]]) -> Group:
        infos, signal = [info for info, _ in base], base[0][1]
        names = [tidy(one.name) for one in infos]
        self._remarks.renamed([one.name for one in infos], names)
        channels = tuple(
            WrittenChannel(name, tidy(one.unit) if one.unit else None, _noted(one.note))
            for name, one in zip(names, infos, strict=True)
        )
        stamped = signal.time is not None
        rate, start = (signal.rate, signal.start) if signal.time is None else _even(signal.time)
        count = infos[0].count
        if self._window is not None and rate is None and not stamped:
            raise TableError(f"{self._label}: does not say when its samples were taken: leave out --window")
        if self._window is not None and rate is not None:
            start += max(0, int(np.ceil((self._window[0] - start) * rate - _INTO_STEP))) / rate
            count = min(count, int((self._window[1] - self._window[0]) * rate) + 2)
        return Group(infos[0].group, channels, rate, start, stamped, count)

    def blocks(self, chunk: Chunk) -> Iterable[tuple[int, Block]]:
        """The part of a chunk that is written to each group, with the number of the group."""
        for at, base in enumerate(self._members):
            signals = [chunk[one] for one in base]
            if len({signal.samples.size for signal in signals}) > 1:
                names = ", ".join(signal.name for signal in signals)
                raise TableError(f"{self._label}: {names} are not as long as each other; convert them one by one")
            low, high = self._inside(signals[0], self.groups[at].rate)
            if high <= low:
                continue
            stamps = signals[0].time[low:high] if signals[0].time is not None else None
            block = Block(self._kept[at], [signal.samples[low:high] for signal in signals], stamps)
            self._check(at, signals, block)
            self._kept[at] += high - low
            yield at, block

    def _inside(self, signal: Signal, rate: float | None) -> tuple[int, int]:
        """First and last index of the samples in the window, with a tolerance for the rounding of their times."""
        size = signal.samples.size
        time = times_of(signal)
        if self._window is None or time is None or not size:
            return 0, size
        self._span = min(self._span[0], float(time[0])), max(self._span[1], float(time[-1]))
        slack = _INTO_STEP / rate if rate else 0.0
        inside = np.flatnonzero((time >= self._window[0] - slack) & (time <= self._window[1] + slack))
        return (int(inside[0]), int(inside[-1]) + 1) if inside.size else (0, 0)

    def _check(self, at: int, signals: Sequence[Signal], block: Block) -> None:
        """TableError if a block contradicts the times that the first chunk has shown."""
        group = self.groups[at]
        for signal in signals[1:]:
            if not same_value(signals[0].time, signal.time):
                names = f"{shown(signals[0].name)} and {shown(signal.name)}"
                raise TableError(f"{self._label}: {names} are not sampled at the same times; convert them one by one")
        if block.stamps is not None and group.rate is not None:
            off = np.abs(block.stamps - group.even(block.first, len(block))) > 0.5 / group.rate
            if off.any():
                raise TableError(
                    f"{self._label}: its times are even at first, and no longer after "
                    f"{float(block.stamps[int(np.argmax(off))]):.9g} s; cut with --window"
                )

    def check_not_empty(self) -> None:
        """Raise TableError if no sample is within the window."""
        if not any(self._kept):
            if self._window is None:
                raise TableError(f"{self._label}: holds no samples")
            low, high = self._window
            there = f"the recording runs {self._span[0]:g} to {self._span[1]:g} s"
            raise TableError(f"{self._label}: no samples from {low:g} to {high:g} s; {there}")

    def counted(self) -> list[Group]:
        """The groups, with the number of samples that were written."""
        return [replace(group, count=kept) for group, kept in zip(self.groups, self._kept, strict=True)]


def _base(info: SignalInfo, signal: Signal) -> object:
    """What channels with the same group and the same times have in common, as far as their first chunk shows."""
    when = (signal.rate, signal.start) if signal.time is None else signal.time.tobytes()
    return info.group, info.count, when


def _even(time: FloatArray) -> tuple[float | None, float]:
    """Rate of even times [Hz], None if they are uneven, and first time [s]."""
    first = float(time[0]) if time.size else 0.0
    try:
        step, remark = uniform_time(time)
    except RecordingError:
        return None, first
    if remark:
        return None, first
    rate = 1.0 / step
    whole = round(rate)
    return (float(whole) if whole and abs(rate / whole - 1.0) * time.size < _DRIFT else rate), first


def _noted(note: str) -> str:
    """A note of the file on a channel, without the parts that its reader has added."""
    return "; ".join(part for part in tidy(note).split("; ") if part and not _OURS.fullmatch(part))
