"""UFF 58, also binary (58b): time signals as channels; other functions are described, see `io.tables.responses`.

A channel is called by the function's description (ID line 1) if all time signals have different descriptions, or else
by its response: entity, node and direction, as in `12+Z`. Its unit is the label of its axis, or else the unit that the
file's unit system (data set 164) has for the kind of the ordinate. The header rounds the time step to six digits: if a
whole number of Hz rounds to the same step, it is the rate.
"""

from __future__ import annotations

import contextlib
import mmap
import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats import tracks
from fourpole.io.formats.guard import floats, guard, tidy
from fourpole.io.source import name_of
from fourpole.units import shown
from fourpole.words import first_of

_KIND = "a UFF file"
_MARK = re.compile(rb"    -1[ ]*(?=\r|\n|$)")
#: Lines of a data set 58 before its values, with the mark.
_HEADER = 13
_LONGEST_HEADER = 1 << 14
_TIME_RESPONSE, _GENERAL = 1, 0
_TIME_AXIS = (0, 1, 17)
_DIRECTIONS = {1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}
_FUNCTIONS = {
    0: "general function",
    1: "time signal",
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response function",
    5: "transmissibility",
    6: "coherence",
    7: "auto correlation",
    8: "cross correlation",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
    24: "shock response spectrum",
    27: "order function",
}
#: Data sets that say something of the others.
_ABOUT = (b"151", b"164", b"1858")
_LENGTHS = {1: "m", 2: "ft", 3: "m", 4: "ft", 5: "mm", 6: "cm", 7: "in", 8: "mm", 10: "mm"}
_FORCES = {1: "N", 2: "lbf", 3: "kgf", 5: "mN", 6: "cN", 7: "lbf", 8: "kgf", 10: "N"}
_ORDINATES = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}


@dataclass(frozen=True)
class DataSet:
    """A data set: the bytes of the file that hold it, and its header."""

    start: int
    stop: int
    header: Mapping[str, Any]

    @property
    def is_signal(self) -> bool:
        """Whether it holds samples over time."""
        kind, axis = self.header["func_type"], self.header.get("abscissa_spec_data_type", 0)
        return axis in _TIME_AXIS if kind == _TIME_RESPONSE else kind == _GENERAL and axis == _TIME_AXIS[-1]

    @property
    def is_complex(self) -> bool:
        """Whether its values are complex."""
        return int(self.header["ord_data_type"]) in (5, 6)

    @property
    def count(self) -> int:
        """Number of values that it declares."""
        return int(self.header["num_pts"])

    @property
    def even(self) -> bool:
        """Whether its abscissa has equal steps."""
        return int(self.header["abscissa_spacing"]) == 1

    @property
    def step(self) -> float:
        """Step of its abscissa [s] or [Hz]."""
        return float(self.header.get("abscissa_inc", 0.0))

    @property
    def words(self) -> str:
        """Kind of the function in words."""
        kind = int(self.header["func_type"])
        return _FUNCTIONS.get(kind, f"function of type {kind}")


def _blocks(content: mmap.mmap, name: str) -> Iterator[tuple[int, int]]:
    """First and last byte of each data set, with its marks."""
    position, number = 0, 0
    while (mark := _at_line_start(content, position)) is not None:
        number += 1
        head = content[mark.end() : mark.end() + _LONGEST_HEADER].lstrip(b"\r\n").splitlines(keepends=True)
        after = mark.end()
        binary = bool(head) and head[0][6:7].lower() == b"b"
        if binary:  # binary samples may contain the bytes of a mark, so they are skipped by their stated size
            after += sum(map(len, head[: _HEADER - 1])) + int(head[0][31:43].strip() or b"0")
        end = _MARK.search(content, after) if binary else _at_line_start(content, after)
        if end is None:
            raise TableError(f"{name}: is cut short: data set {number} does not end; copy or export it again")
        yield mark.start(), end.end()
        position = end.end()


def _at_line_start(content: mmap.mmap, position: int) -> re.Match[bytes] | None:
    marks = _MARK.finditer(content, position)
    return next((one for one in marks if one.start() == 0 or content[one.start() - 1] in b"\r\n"), None)


@contextlib.contextmanager
def copied(parts: Sequence[bytes]) -> Iterator[str]:
    """A temporary file that holds only some data sets: the library reads whole files, and only by name."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "sets.uff")
        with path.open("wb") as file:
            file.writelines(parts)
        yield str(path)


def _headers(pyuff: Any, content: mmap.mmap, name: str) -> tuple[list[DataSet], int, Mapping[bytes, int]]:
    """The data sets 58 of a file, the number of the unit system that it states (0: none), and what its other sets hold.

    TableError, which says what they hold, if none is a data set 58.
    """
    places, heads, system = [], [], 0
    others = Counter[bytes]()
    for start, stop in _blocks(content, name):
        lines = content[start : min(stop, start + _LONGEST_HEADER)].lstrip(b"\r\n").splitlines(keepends=True)
        tag = lines[1][:6].strip()
        if tag == b"58":
            places.append((start, stop))
            heads.append(b"".join([*lines[:_HEADER]]).rstrip(b"\r\n") + b"\n    -1\n")
            continue
        others[tag] += 1
        if tag == b"164":
            with contextlib.suppress(IndexError, ValueError):
                system = int(lines[2][:10])
    if not places:
        what = f"only data sets {_held(others)}" if others else "nothing"
        raise TableError(f"{name}: holds no function (data set 58), {what}; export the time signals too")
    with copied(heads) as path:
        uff = pyuff.UFF(path)
        found = uff.read_sets(header_only=True)
    found = found if isinstance(found, list) else [found]
    if len(found) != len(places) or any(one.get("type") != 58 or one["num_pts"] < 0 for one in found):
        raise TableError(f"{name}: is damaged: of {len(places)} data sets {len(found)} can be read; export it again")
    sets = [DataSet(start, stop, head) for (start, stop), head in zip(places, found, strict=True)]
    return sets, system, {tag: count for tag, count in others.items() if tag not in _ABOUT}


def _held(others: Mapping[bytes, int]) -> str:
    """The numbers of some data sets."""
    return first_of([tidy(one.decode("ascii", "replace"), 6) for one in others], 12)


def dof(header: Mapping[str, Any], which: str) -> str:
    """Node and direction of the response (rsp) or the reference (ref) of a function, as 12+Z."""
    direction = int(header.get(f"{which}_dir", 0))
    sign = "" if direction == 0 else ("+" if direction > 0 else "-") + _DIRECTIONS.get(abs(direction), "?")
    return f"{header.get(f'{which}_node', 0)}{sign}"


def _response(header: Mapping[str, Any]) -> str:
    """Entity, node and direction of the response."""
    return ":".join(filter(None, (label_of(header, "rsp_ent_name"), dof(header, "rsp"))))


def label_of(header: Mapping[str, Any], key: str) -> str:
    """A text of a header; empty where it says NONE."""
    text = str(header.get(key, "")).strip()
    return "" if text.upper() == "NONE" else text


def _names(sets: Sequence[DataSet]) -> list[str]:
    """The names of the functions, by the rule that the module's docstring states."""
    titles = [label_of(one.header, "id1") for one in sets]
    signals = [title for title, one in zip(titles, sets, strict=True) if one.is_signal]
    titled = all(signals) and len(set(signals)) == len(signals)
    names = [
        title if titled and one.is_signal else _response(one.header) for title, one in zip(titles, sets, strict=True)
    ]
    often = Counter(names)
    return [name if often[name] == 1 else f"{name} ({number})" for number, name in enumerate(names, 1)]


def _unit(header: Mapping[str, Any], system: int) -> str | None:
    if stated := label_of(header, "ordinate_axis_units_lab"):
        return stated
    length, force = _LENGTHS.get(system), _FORCES.get(system)
    kind = _ORDINATES.get(int(header.get("ordinate_spec_data_type", 0)))
    rotates = abs(int(header.get("rsp_dir", 0))) > 3
    if rotates or length is None:
        return None
    units = {"displacement": length, "velocity": f"{length}/s", "acceleration": f"{length}/s^2", "force": force}
    return units.get(kind or "")


def rate_of_step(step: float) -> float | None:
    """The rate by a step that is written with six digits [Hz]: a whole number if this has the same digits."""
    if not (np.isfinite(step) and step > 0):
        return None
    whole = round(1.0 / step) if step > 1e-12 else 0
    return float(whole) if whole and f"{1.0 / whole:.5E}" == f"{step:.5E}" else 1.0 / step


@dataclass(frozen=True)
class Content:
    """The data sets 58 of an open file, with their names and the file's unit system."""

    pyuff: Any
    content: mmap.mmap
    sets: list[DataSet]
    names: list[str]
    system: int
    others: Mapping[bytes, int]


@contextlib.contextmanager
def opened(path: Path, label: str, _: int) -> Iterator[Content]:
    """The data sets 58 of a file, while it is open."""
    name = name_of(path, label)
    with guard(name, _KIND), tracks.opened("uff", _KIND, path, name) as file:
        yield _sets(file)


def _sets(file: tracks.OpenFile) -> Content:
    """The data sets 58 of an open file."""
    pyuff = file.load("pyuff")
    content = file.closing.enter_context(mmap.mmap(file.file.fileno(), 0, access=mmap.ACCESS_READ))
    sets, system, others = _headers(pyuff, content, file.name)
    return Content(pyuff, content, sets, _names(sets), system, others)


def read_set(found: Content, one: DataSet, called: str, name: str) -> dict[str, Any]:
    """A data set as pyuff reads it; TableError if it has fewer values than it states."""
    with copied([found.content[one.start : one.stop], b"\n"]) as path:
        read = found.pyuff.UFF(path).read_sets()
    if not isinstance(read, dict) or len(np.atleast_1d(read.get("data", ()))) < one.count:
        raise TableError(f"{name}: is cut short: {shown(called)} has not its {one.count} values; export it again")
    return read


def _track(found: Content, one: DataSet, called: str, name: str) -> tracks.Track:
    """A function as a channel; what is none is barred."""
    texts = [one.words, label_of(one.header, "id1"), _response(one.header)]
    notes = list(dict.fromkeys(tidy(text) for text in texts if text and text != called))

    @tracks.remembered
    def values(*_: int) -> NDArray[np.float64]:
        read = read_set(found, one, called, name)
        keys = ["data"] if one.even else ["data", "x"]
        return np.array([floats(read[key][: one.count], called, name) for key in keys])

    def column(at: int) -> tracks.Part:
        return lambda first, last: values(0, 0)[at, first:last]

    if not one.is_signal or one.is_complex:
        what = f"is a {'complex ' if one.is_signal else ''}{one.words}, no recording; name a time signal"
        return tracks.Track(called, None, one.count, column(0), note="; ".join(notes[1:]), barred=what)
    if axis := label_of(one.header, "ordinate_axis_lab"):
        notes.append(tidy(axis))
    rate, time = (rate_of_step(one.step), None) if one.even else (None, column(1))
    start, unit = float(one.header["abscissa_min"]), _unit(one.header, found.system)
    return tracks.Track(called, unit, one.count, column(0), rate, start, time, note="; ".join(notes))


def _content(file: tracks.OpenFile) -> tracks.Content:
    """The functions of an open file."""
    found = _sets(file)
    sets = found.sets
    notes = [tidy(label_of(sets[0].header, key)) for key in ("id2", "id3", "id4", "id5")]
    if found.others:
        notes.append(f"no signals: data sets {_held(found.others)}")
    form = "UFF 58b" if any(one.header.get("binary") for one in sets) else "UFF 58"
    every = [_track(found, one, called, file.name) for one, called in zip(sets, found.names, strict=True)]
    return tracks.Content(form, every, [note for note in notes if note], sample_bytes=24)


FORMAT = tracks.track_format("uff", "UFF 58", (".uff", ".unv", ".ufb", ".bunv"), _KIND, _content)
