"""The contents of a folder: its recordings with their statements and the shapes of their signals, and its notes."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.core.recording import DERIVATIVES
from fourpole.core.segments import TESTS, Segment, labelled
from fourpole.errors import CampaignError, FourpoleError, TableError, UnitError
from fourpole.guess.names import Token, read_header, read_name, without_ending
from fourpole.guess.signals import (
    ALL_ROWS,
    ENOUGH_ROWS,
    SignalShape,
    parts_of,
    samples_of,
    segments_of,
    signal_shape,
    within,
)
from fourpole.io.child import read_apart
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, Signal, SignalInfo
from fourpole.io.source import decode
from fourpole.units import MOTIONS, shown
from fourpole.words.heads import Column, column_of

#: Largest number of files in a folder.
_MOST_FILES = 20_000
#: Number of channels that are read of a recording.
_MOST_CHANNELS = 64
#: Number of bytes that are read of a file of notes.
_MOST_NOTES = 100_000
#: Largest size of a file [bytes].
_MOST_BYTES = 4_000_000_000
#: Names of files of a campaign folder that are no recordings.
_OURS = frozenset({"campaign.toml", "tests.csv", "tests.xlsx", "truth.csv"})
_NEVER = re.compile(
    r"\.(toml|py|m|r|pdf|png|jpe?g|svg|gif|html?|docx?|pptx?|zip|gz|7z|exe|tdms_index|parquet|db|ini)$", re.I
)
#: Wide and unbreakable blanks, which a name may have.
_BLANKS = {0x3000: " ", 0xA0: " "}
_NOTES = re.compile(r"\.(txt|md|json|ya?ml|rst|nfo|info|log)$|^(readme|notes?|notizen|liesmich|info)\b", re.I)


@dataclass(frozen=True)
class FolderRecording:
    """One recording of a folder: a file, or one group of a file.

    Attributes
    ----------
    file : str
        Name of the recording in tests.csv.
    columns : tuple of Column
        Channels without the time.
    clock : str or None
        Column of the time; None if there is none.
    clock_unit : str
        Unit of the column of the time.
    rate : float or None [Hz]
        Sample rate; None if it is not known.
    text : bool
        Whether the file is a table of text.
    timed : bool
        Whether the file itself states times or rates.
    shape : SignalShape or None
        Shape of the signals; None if the samples could not be read.
    name, header, folder : tuple of Token
        Tokens of the name; of the header and of notes with the name of the recording; of the notes of its folders.
    problem : str
        Reason why the samples could not be read; empty if they could.
    window : (float, float) or None [s]
        The part of the file that the test is; None for the whole file.
    segment : str
        Kind and number of that part among those of the file, as "sine 3".
    """

    file: str
    columns: tuple[Column, ...]
    clock: str | None
    clock_unit: str
    rate: float | None
    text: bool
    timed: bool
    shape: SignalShape | None
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()
    problem: str = ""
    window: tuple[float, float] | None = None
    segment: str = ""

    @property
    def frequency(self) -> float:
        """Frequency of the excitation by the samples [Hz]; not-a-number if it is not known, or no single one."""
        return float("nan") if self.shape is None or self.shape.band is not None else self.shape.frequency


#: The classes of which a recording of a folder is made.
_OF_RECORDING = (FolderRecording, Column, Token, SignalShape)


@dataclass
class FolderContents:
    """Recordings of a folder, files that are left out with the reason, and tokens of the notes."""

    recordings: list[FolderRecording] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    notes: list[Token] = field(default_factory=list)


def gather(folder: Path, progress: Callable[[int, int], None] | None = None) -> FolderContents:
    """The contents of a folder and of the folders in it; `progress` is called with the files read and their number."""
    contents = FolderContents()
    paths = _paths(folder, contents)
    notes: dict[str, tuple[Token, ...]] = {}
    for done, path in enumerate(paths, 1):
        _read(folder, path, contents, notes)
        if progress is not None:
            progress(done, len(paths))
    contents.notes = [token for tokens in notes.values() for token in tokens]
    contents.recordings = [_noted(recording, notes) for recording in contents.recordings]
    return contents


def gather_more(folder: Path, paths: Sequence[Path]) -> FolderContents:
    """The contents of some files of a folder, such as those that were written since it was looked at."""
    contents = FolderContents()
    for path in paths:
        if trouble := _trouble(folder, path):
            contents.left_out.append((path.relative_to(folder).as_posix(), trouble))
        else:
            _read(folder, path, contents, {})
    return contents


def recording_files(folder: Path) -> list[Path]:
    """The files of a folder that may be recordings, sorted by name with D2 before D10."""
    return [path for path in _paths(folder, FolderContents()) if not _NOTES.search(path.name)]


def _paths(folder: Path, found: FolderContents) -> list[Path]:
    """Paths of files that may be recordings or notes, sorted by name with D2 before D10."""
    paths: list[Path] = []
    for place, folders, files in os.walk(folder):
        here = Path(place)
        kept = [one for one in folders if not one.startswith((".", "__")) and not (one == "results" and here == folder)]
        folders[:] = sorted(kept, key=_counting)
        for name in sorted(files, key=_counting):
            if name.startswith((".", "~")) or name in _OURS or _NEVER.search(name):
                continue
            if len(paths) >= _MOST_FILES:
                raise CampaignError(f"{folder}: holds more than {_MOST_FILES} files: name a folder of recordings alone")
            path = here / name
            trouble = _trouble(folder, path)
            if trouble:
                found.left_out.append((path.relative_to(folder).as_posix(), trouble))
            else:
                paths.append(path)
    return paths


def _counting(name: str) -> list[tuple[int, int, str]]:
    """Key that sorts D2 before D10."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"([0-9]{1,15})", name) if part]


def _trouble(folder: Path, path: Path) -> str:
    """Reason why tests.csv cannot name a file; empty if it can."""
    name = path.relative_to(folder).as_posix()
    if not name.translate(_BLANKS).isprintable() or name != name.strip():
        return "its name has control characters, or blanks at its ends: rename it"
    try:
        name.encode()
        within = path.resolve().is_relative_to(folder.resolve())
    except (UnicodeError, OSError, RuntimeError):
        return "its name cannot be written in UTF-8: rename it"
    return "" if within else "is a link to a place outside the folder: copy it into the folder"


def _read(folder: Path, path: Path, contents: FolderContents, notes: dict[str, tuple[Token, ...]]) -> None:
    """Add the recordings of a file to `contents`, or its tokens to `notes`; one that cannot be read is left out."""
    name, recordings = path.relative_to(folder).as_posix(), list[FolderRecording]()
    is_note, trouble = _NOTES.search(path.name) is not None, "has no two channels of numbers"
    try:
        recordings = read_apart(recordings_of, path, name, classes=_OF_RECORDING)
    except FourpoleError as error:
        trouble = _without_name(str(error), name)
    for recording in recordings:
        if recording.problem and not any(column.quantity for column in recording.columns):
            contents.left_out.append((recording.file, recording.problem))
        else:
            contents.recordings.append(recording)
    if recordings:
        return
    try:
        if is_note:
            notes[name] = tuple(read_header(_lines(path, name)))
            return
    except FourpoleError as error:
        trouble = _without_name(str(error), name)
    contents.left_out.append((name, trouble))


def recordings_of(path: Path, name: str) -> list[FolderRecording]:
    """The recordings of a file, as a worker process runs it; none if it is no table.

    A file of notes does not have two channels of eight samples.
    """
    info = survey(path, max_bytes=_MOST_BYTES, label=name)
    table = sum(signal.count >= 8 for signal in info.signals) >= 2
    return list(_recordings(path, name, info)) if table else []


def _lines(path: Path, name: str) -> list[str]:
    """The lines of a file of notes; those of a JSON file are its pairs."""
    content = read_bytes(path, max_bytes=_MOST_BYTES, label=name)[:_MOST_NOTES]
    text = decode(content, name)[0]
    if path.suffix.lower() == ".json":
        with suppress(TableError):
            return list(_flat(json_of(text, name)))
    return text.splitlines()


def _flat(document: object) -> Iterator[str]:
    """The pairs of a JSON document and of the tables in it, as lines "key: value"."""
    if isinstance(document, dict):
        for key, value in document.items():
            if isinstance(value, str | int | float):
                yield f"{key}: {value}"
            else:
                yield from _flat(value)


def _without_name(message: str, name: str) -> str:
    """A message without the name of the file at its beginning."""
    return message.removeprefix(f"{shown(name, 200)[1:-1]}: ").removeprefix(f"{name}: ")


def _recordings(path: Path, name: str, info: FileInfo) -> Iterator[FolderRecording]:
    """Recordings of a file: each group with two channels that are not the time, else the whole file."""
    groups: dict[str, list[SignalInfo]] = {}
    for signal in info.signals:
        if signal.count >= 2 and "no numbers" not in signal.note:
            groups.setdefault(signal.group, []).append(signal)
    whole = {group: signals for group, signals in groups.items() if _enough(signals)}
    if not whole:
        whole = {"": [signal for signals in groups.values() for signal in signals]}
    elif len(whole) == 1 and _sole(next(iter(whole)), groups):
        whole = {"": next(iter(whole.values()))}
    for group, signals in whole.items():
        yield from _recording(path, name, group, signals, info)


def _sole(group: str, groups: dict[str, list[SignalInfo]]) -> bool:
    """Whether no other group has a channel with the name of a channel of `group`."""
    names = {signal.name.casefold() for signal in groups[group]}
    return not any(
        signal.name.casefold() in names for other, more in groups.items() if other != group for signal in more
    )


def _enough(signals: list[SignalInfo]) -> bool:
    """Whether at least two channels with eight samples are not the time."""
    columns = [column_of(signal.name, signal.unit) for signal in signals if signal.count >= 8]
    return sum(column.quantity != "time" for column in columns) >= 2


def _columns(signals: Sequence[SignalInfo]) -> tuple[tuple[Column, ...], str | None, str]:
    """The channels that are not the time; name, None if there is none, and unit of the likeliest one that is."""
    columns = [column_of(signal.name, signal.unit) for signal in signals]
    clock = max((one for one in columns if one.quantity == "time"), key=lambda one: one.likely, default=None)
    own = tuple(column for column in columns if column.quantity != "time")
    return own, clock.name if clock else None, (clock and clock.unit) or "s"


def _recording(path: Path, name: str, group: str, signals: list[SignalInfo], info: FileInfo) -> list[FolderRecording]:
    """The recording that the channels of a group of a file make, or one for each motion if it makes several."""
    signals = signals[:_MOST_CHANNELS]
    own, title, unit = _columns(signals)
    rate = _common_rate(signals)
    read = partial(samples_of, path, group=group, label=name, clock=title, unit=unit)
    shape, problem, samples = None, "", dict[str, Signal]()
    try:
        samples = read([column.name for column in own])
        shape = _shape(samples, own, rate)
    except FourpoleError as error:
        problem = _without_name(str(error), name)
    one = FolderRecording(
        file=f"{name}#{group}" if group else name,
        columns=own,
        clock=title,
        clock_unit=unit,
        rate=(shape and shape.rate) or rate,
        text=info.format.startswith("text"),
        timed=all(signal.rate or signal.duration is not None for signal in signals),
        shape=shape,
        name=_tokens(name, group),
        header=(*read_header(info.notes), *_recorded(own, shape)),
        problem=problem,
    )
    moving, longer = list(_motions(own)), max(each.count for each in signals) > ENOUGH_ROWS
    if shape is None or not moving or (shape.kind == "dynamic" and not longer):
        return [one]
    try:
        motions = read(moving, rows=ALL_ROWS) if longer else {of: samples[of] for of in moving}
    except FourpoleError:
        return [one]
    return _segments(one, motions) or [one]


def segments_in(path: Path) -> tuple[str, str, list[Segment]] | None:
    """Name and unit of the channel that shows the motion of a recording, and its segments; None if it is one test."""
    found: tuple[str, str, list[Segment]] | None = None
    with suppress(FourpoleError):
        found = read_apart(motion_of, path, path.name, classes=(Segment,))
    return found if found is not None and sum(one.kind in TESTS for one in found[2]) > 1 else None


def motion_of(path: Path, name: str) -> tuple[str, str, list[Segment]] | None:
    """The same of any number of segments, as a worker process finds it; None without a motion."""
    info = survey(path, max_bytes=_MOST_BYTES, label=name)
    first = [signal for signal in info.signals if signal.group == info.signals[0].group][:_MOST_CHANNELS]
    columns, title, unit = _columns(first)
    moving = next(iter(_motions(columns)), None)
    if moving is None:
        return None
    samples = samples_of(path, [moving], group=first[0].group, label=name, clock=title, unit=unit, rows=ALL_ROWS)
    found = parts_of(samples[moving], _common_rate(first))
    return moving, next(column.unit for column in columns if column.name == moving) or "", found


def _segments(one: FolderRecording, signals: Mapping[str, Signal]) -> list[FolderRecording]:
    """A recording for each of the motions that one makes one after the other; none if it has a single one."""
    found = list[FolderRecording]()
    cut = segments_of(next(iter(signals.values())), one.rate, banded=bool(one.shape and one.shape.band))
    for label, each in labelled(cut):
        if each.kind not in TESTS:
            continue
        window = (each.start, each.end)
        parts = {of: within(signal, window, one.rate) for of, signal in signals.items()}
        shape = signal_shape(parts, rate=one.rate, motions=_motions(one.columns))
        if each.kind in _KINDS:
            shape = replace(shape, kind=_KINDS[each.kind], band=None)
        elif shape.kind != each.kind:
            continue  # too short for its band
        stated = round(each.start, 4), round(each.end, 4)
        found.append(replace(one, shape=shape, window=stated, segment=label))
    return found


def _common_rate(signals: Sequence[SignalInfo]) -> float | None:
    """The sampling rate [Hz] if all signals that state one state the same."""
    rates = {signal.rate for signal in signals if signal.rate}
    return rates.pop() if len(rates) == 1 else None


def _shape(samples: Mapping[str, Signal], columns: Sequence[Column], rate: float | None) -> SignalShape:
    """The shape of the signals in some columns."""
    aside = frozenset(column.name for column in columns if column.quantity in _ASIDE)
    widest = all(column.quantity != "force" for column in columns)
    return signal_shape(samples, rate=rate, aside=aside, motions=_motions(columns), widest=widest)


def _motions(columns: Sequence[Column]) -> dict[str, int]:
    """Columns that may show the excitation, the likeliest first, and the differentiations to a velocity of each."""
    kinds = [*MOTIONS, "force"]
    moving = [column for column in columns if column.quantity in kinds]
    moving.sort(key=lambda one: (one.quantity == "force", one.side != "in", one.side == "out", -one.likely))
    return {one.name: DERIVATIVES[one.quantity] for one in moving}


def _tokens(name: str, group: str) -> tuple[Token, ...]:
    """Tokens of a file's name, of its group, and of its folders, the nearest folder first."""
    *folders, file = name.split("/")
    texts = (without_ending(file), group.replace("/", " "), *reversed(folders))
    return tuple(token for text in texts for token in read_name(text))


#: Kinds of tests of segments with one frequency.
_KINDS = {"loop": "static", "sine": "dynamic"}
#: Quantities whose channels do not decide on kind and frequency of a test.
_ASIDE = frozenset({"temperature", "pressure", "frequency", "angle", "reference", "drive", "other"})
#: Recorded conditions, with the range of plausible means in SI.
_RECORDED = {"pressure": (3e4, 2e6), "temperature": (-60.0, 150.0)}


def _recorded(columns: tuple[Column, ...], shape: SignalShape | None) -> Iterator[Token]:
    """Mean of each recorded pressure and temperature that is constant and plausible, as a token in SI units."""
    samples = shape.samples if shape is not None else {}
    for column in columns:
        if column.quantity not in _RECORDED or column.unit is None or column.name not in samples:
            continue
        try:
            values = units.to_si(samples[column.name], column.unit, column.quantity)
        except UnitError:
            continue
        low, high = _RECORDED[column.quantity]
        mean = float(np.mean(values))
        if low < mean < high and np.ptp(values) < 0.1 * max(abs(mean), 20.0):
            text = f"column {shown(column.name, 30)}, on average {mean:.4g} {units.si_unit(column.quantity)}"
            yield Token(column.quantity, text, float(f"{mean:.3g}"))


def _noted(one: FolderRecording, notes: dict[str, tuple[Token, ...]]) -> FolderRecording:
    """A recording with notes: those with its name join its header, those of its folders become `folder`."""
    place, _, name = one.file.partition("#")[0].rpartition("/")
    own: list[Token] = []
    shared: list[Token] = []
    for note, tokens in notes.items():
        beside, _, title = note.rpartition("/")
        if beside == place and title.rpartition(".")[0] in (without_ending(name), name):
            own += tokens
        elif (place == beside or place.startswith(f"{beside}/") or not beside) and _is_shared(notes, title):
            shared += tokens
    return replace(one, header=(*one.header, *own), folder=tuple(shared))


def _is_shared(notes: dict[str, tuple[Token, ...]], title: str) -> bool:
    """Whether a file of notes is about its folder: by its name, or because it is the only one."""
    return (
        re.match(r"readme|notes?\b|notizen|liesmich|info|rig|setup|campaign", title, re.I) is not None
        or len(notes) == 1
    )
