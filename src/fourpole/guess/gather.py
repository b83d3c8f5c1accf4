"""The contents of a folder: its recordings, with what they state and what their signals show, and its notes."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.errors import CampaignError, FourpoleError, UnitError
from fourpole.guess.channels import Column, column_of
from fourpole.guess.names import Token, read_header, read_name, without_ending
from fourpole.guess.signals import SignalShape, look, samples_of
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, SignalInfo
from fourpole.io.source import decode, read_bytes
from fourpole.units import shown

_MOST_FILES = 20_000
_MOST_CHANNELS = 64
_MOST_NOTES = 100_000  # bytes of a file of notes
_MOST_BYTES = 4_000_000_000
#: Names of files that are no recordings.
_OURS = frozenset({"campaign.toml", "tests.csv", "truth.csv"})
_NEVER = re.compile(
    r"\.(toml|py|m|r|pdf|png|jpe?g|svg|gif|html?|docx?|xlsx?|pptx?|zip|gz|7z|exe|tdms_index|parquet|db|ini)$", re.I
)
_NOTES = re.compile(r"\.(txt|md|json|ya?ml|rst|nfo|info|log)$|^(readme|notes?|notizen|liesmich|info)\b", re.I)


@dataclass(frozen=True)
class Seen:
    """One recording, or one group of a file.

    Attributes
    ----------
    file : str
        Its name in tests.csv.
    columns : tuple of Column
        Its channels without the time.
    clock : str or None
        Its column of the time.
    clock_unit : str
        Unit of this column.
    rate : float or None [Hz]
    text : bool
        Whether it is a table of text.
    timed : bool
        Whether the file itself states times or rates.
    looked : SignalShape or None
        What its samples show; None where they could not be read.
    name, header, folder : tuple of Token
        Tokens of its name, of its header and notes of the same name, and of the notes of its folders.
    problem : str
        Why its samples could not be read.
    """

    file: str
    columns: tuple[Column, ...]
    clock: str | None
    clock_unit: str
    rate: float | None
    text: bool
    timed: bool
    looked: SignalShape | None
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()
    problem: str = ""

    @property
    def frequency(self) -> float:
        """Frequency that its samples show [Hz]; not-a-number where they show none."""
        return float("nan") if self.looked is None else self.looked.frequency


@dataclass
class FolderContents:
    """All of a folder: recordings, files left out with the reason, and the tokens of the notes."""

    seen: list[Seen] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    notes: list[Token] = field(default_factory=list)


def gather(folder: Path, progress: Callable[[int, int], None] | None = None) -> FolderContents:
    """Read all files of a folder and of the folders in it."""
    found = FolderContents()
    paths = _paths(folder, found)
    notes: dict[str, tuple[Token, ...]] = {}
    for done, path in enumerate(paths, 1):
        try:
            name = path.relative_to(folder).as_posix()
            _look_at(path, name, found, notes)
        except FourpoleError as error:
            found.left_out.append((name, _without_name(str(error), name)))
        if progress is not None:
            progress(done, len(paths))
    found.notes = [token for tokens in notes.values() for token in tokens]
    found.seen = [_noted(one, notes) for one in found.seen]
    return found


def _paths(folder: Path, found: FolderContents) -> list[Path]:
    """Files that may be recordings or notes, in the order in which people count."""
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
    """Sorts D2 before D10."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"([0-9]{1,15})", name) if part]


def _trouble(folder: Path, path: Path) -> str:
    """Why a file cannot stand in tests.csv; empty where it can."""
    name = path.relative_to(folder).as_posix()
    if not name.isprintable() or name != name.strip():
        return "its name has control characters, or blanks at its ends: rename it"
    try:
        name.encode()
        within = path.resolve().is_relative_to(folder.resolve())
    except (UnicodeError, OSError, RuntimeError):
        return "its name cannot be written in UTF-8: rename it"
    return "" if within else "is a link to a place outside the folder: copy it into the folder"


def _look_at(path: Path, name: str, found: FolderContents, notes: dict[str, tuple[Token, ...]]) -> None:
    """One file: its recordings, or what it says as notes."""
    is_note = _NOTES.search(path.name) is not None
    try:
        info = survey(path, max_bytes=_MOST_BYTES, label=name)
        made = list(_recordings(path, name, info)) if _is_table(info) else []
    except FourpoleError:
        if not is_note:
            raise
        made = []
    strange = [one for one in made if one.problem and not any(column.quantity for column in one.columns)]
    found.left_out += [(one.file, one.problem) for one in strange]
    found.seen += [one for one in made if one not in strange]
    if made:
        return
    if is_note:
        notes[name] = tuple(read_header(_lines(path, name)))
        return
    found.left_out.append((name, "has no two channels of numbers"))


def _is_table(info: FileInfo) -> bool:
    """Whether a file has at least two channels with more than a few samples: text of notes has not."""
    return sum(signal.count >= 8 for signal in info.signals) >= 2


def _lines(path: Path, name: str) -> list[str]:
    """The lines of a file of notes; those of a JSON file are its pairs."""
    content = read_bytes(path, max_bytes=_MOST_BYTES, label=name)[:_MOST_NOTES]
    text = decode(content, name)[0]
    if path.suffix.lower() == ".json":
        try:
            return list(_flat(json.loads(text)))
        except (ValueError, RecursionError):
            pass
    return text.splitlines()


def _flat(document: object) -> Iterator[str]:
    """The pairs of a JSON document as lines, tables inside it too."""
    if isinstance(document, dict):
        for key, value in document.items():
            if isinstance(value, str | int | float):
                yield f"{key}: {value}"
            else:
                yield from _flat(value)


def _without_name(message: str, name: str) -> str:
    """A message without the name of the file before it."""
    return message.removeprefix(f"{shown(name, 200)[1:-1]}: ").removeprefix(f"{name}: ")


def _recordings(path: Path, name: str, info: FileInfo) -> Iterator[Seen]:
    """The recordings of a file: each group that has what a test needs, else the file as a whole."""
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
        yield _seen(path, name, group, signals, info)


def _sole(group: str, groups: dict[str, list[SignalInfo]]) -> bool:
    """Whether no other group has a channel of the same name."""
    names = {signal.name.casefold() for signal in groups[group]}
    return not any(
        signal.name.casefold() in names for other, more in groups.items() if other != group for signal in more
    )


def _enough(signals: list[SignalInfo]) -> bool:
    """Whether some channels make a test: two that are not the time."""
    columns = [column_of(signal.name, signal.unit) for signal in signals if signal.count >= 8]
    return sum(column.quantity != "time" for column in columns) >= 2


def _seen(path: Path, name: str, group: str, signals: list[SignalInfo], info: FileInfo) -> Seen:
    """One recording: the channels of a group of a file."""
    signals = signals[:_MOST_CHANNELS]
    columns = [column_of(signal.name, signal.unit) for signal in signals]
    clock = next((column for column in columns if column.quantity == "time"), None)
    own = tuple(column for column in columns if column.quantity != "time")
    looked, problem = None, ""
    try:
        looked = _looked(path, name, group, own, clock, _common_rate(signals))
    except FourpoleError as error:
        problem = _without_name(str(error), name)
    return Seen(
        file=f"{name}#{group}" if group else name,
        columns=own,
        clock=clock.name if clock else None,
        clock_unit=(clock and clock.unit) or "s",
        rate=(looked and looked.rate) or _common_rate(signals),
        text=info.format.startswith("text"),
        timed=all(signal.rate or signal.duration is not None for signal in signals),
        looked=looked,
        name=_tokens(name, group),
        header=(*read_header(info.notes), *_recorded(own, looked)),
        problem=problem,
    )


def _common_rate(signals: list[SignalInfo]) -> float | None:
    """The rate of all signals that state one [Hz]; None where they differ or state none."""
    rates = {signal.rate for signal in signals if signal.rate}
    return rates.pop() if len(rates) == 1 else None


def _tokens(name: str, group: str) -> tuple[Token, ...]:
    """Tokens of a file's name, of its group, and of its folders, the nearest folder first."""
    *folders, file = name.split("/")
    texts = (without_ending(file), group.replace("/", " "), *reversed(folders))
    return tuple(token for text in texts for token in read_name(text))


def _looked(
    path: Path, name: str, group: str, own: tuple[Column, ...], clock: Column | None, rate: float | None
) -> SignalShape:
    """What the samples show."""
    aside = frozenset(column.name for column in own if column.quantity in _ASIDE)
    stated = {"clock": clock.name, "unit": clock.unit or "s"} if clock is not None else {}
    signals = samples_of(path, [column.name for column in own], group=group, label=name, **stated)
    return look(signals, rate=rate, aside=aside)


#: Quantities whose channels do not show the excitation.
_ASIDE = frozenset({"temperature", "pressure", "frequency", "angle", "reference", "ratio"})
#: Recorded conditions, with the range of plausible means in SI.
_RECORDED = {"pressure": (3e4, 2e6), "temperature": (-60.0, 150.0)}


def _recorded(columns: tuple[Column, ...], looked: SignalShape | None) -> Iterator[Token]:
    """Pressure and temperature that were recorded beside the signals, where they are constant."""
    samples = looked.samples if looked is not None else {}
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


def _noted(one: Seen, notes: dict[str, tuple[Token, ...]]) -> Seen:
    """A recording with the notes beside it: notes of its name join its header, the others are those of its folders."""
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
    """Whether notes are of a folder, not of one recording among many that have notes."""
    return (
        re.match(r"readme|notes?\b|notizen|liesmich|info|rig|setup|campaign", title, re.I) is not None
        or len(notes) == 1
    )
