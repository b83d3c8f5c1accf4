"""TYDEX 1.3, the exchange format for measurements of tyres: a reader that tolerates usual deviations.

`fourpole.io.formats.tydex_file` describes the format, and has its objects and its writer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.door import read_bytes
from fourpole.io.formats.guard import afford, seconds, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format
from fourpole.io.formats.tydex_file import (
    ABSENT,
    SECTIONS,
    TydexChannel,
    TydexEntry,
    TydexFile,
    meaning,
    number_of,
    physical,
)
from fourpole.io.layout import is_missing, plain_numbers, split_lines
from fourpole.io.names import numbered
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.source import AnyPath, decode, name_of
from fourpole.units import shown

_KEYWORD = re.compile(r"\*\*\s*+([A-Za-z_]++)[ \t]*+(.*)")
_CHUNK = 10_000
_HEAD = 65_536
_TIME = "RUNTIME"


def read_tydex(path: AnyPath, *, max_bytes: int = 1_000_000_000, label: str | None = None) -> TydexFile:
    r"""Read a TYDEX file, release 1.3 or earlier.

    Accepted are also tabs between the entries, lines without their trailing blanks, Fortran's D exponents, decimal
    commas, and rows over several lines.

    Parameters
    ----------
    path : path
    max_bytes : int [byte]
        A larger file, or one whose data need more memory, is refused.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Returns
    -------
    TydexFile

    Raises
    ------
    FileError
        If the file is missing, no regular file or too large.
    TableError
        If the file is no TYDEX file, is cut off, or has text where a number must be.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from fourpole.io.formats.tydex_file import write_tydex
    >>> tyre = TydexFile(
    ...     constants=(TydexEntry("INFLPRES", "2.1", "bar", "Inflation pressure"),),
    ...     channels=(TydexChannel("RUNTIME", "s"), TydexChannel("FZW", "N", "Vertical force")),
    ...     data=np.array([[0.0, 3000.0], [0.001, 3010.5]]),
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "run1.tdx")
    ...     write_tydex(file, tyre)
    ...     again = read_tydex(file)
    >>> again.values("FZW").tolist(), again.constant("INFLPRES").number
    ([3000.0, 3010.5], 2.1)
    """
    name = name_of(path, label)
    content = read_bytes(path, max_bytes=max_bytes, label=label)
    if not BEGINS["tydex"](content[:_HEAD]):
        raise TableError(f"{name}: is no TYDEX file: it has no section **HEADER or **MEASURCHANNELS at its start")
    lines = [line.rstrip() for line in split_lines(decode(content, name)[0])]
    return _file(lines, name, max_bytes)


def _file(lines: list[str], name: str, max_bytes: int) -> TydexFile:
    """The content of a file, section by section."""
    heads = [(at, *found) for at, line in enumerate(lines) if (found := _keyword(line))]
    notes: list[str] = []
    entries: dict[str, list[TydexEntry]] = {"HEADER": [], "CONSTANTS": [], "MODELPARAMETERS": []}
    comments: list[str] = []
    channels: list[TydexChannel] = []
    models: list[tuple[str, tuple[str, ...]]] = []
    data: NDArray[np.float64] | None = None
    ends = [at for at, _, _ in heads[1:]] + [len(lines)]
    for (at, keyword, rest), last in zip(heads, ends, strict=False):
        if keyword == "END":
            break
        held = [(number, lines[number - 1]) for number in range(at + 2, last + 1)]
        plain = [(number, line) for number, line in held if line.strip() and "!" not in line[:10]]
        if keyword == "MEASURDATA":
            if not channels:
                raise TableError(f"{name}: has **MEASURDATA but no channels in **MEASURCHANNELS above it")
            if data is not None:
                raise TableError(f"{name}: has **MEASURDATA twice; split it into two files")
            data = _data(held, len(channels), name, max_bytes)
            _check_rows(rest, len(data), notes, name)
        elif keyword == "MEASURCHANNELS":
            if data is not None and plain:
                raise TableError(f"{name} line {plain[0][0]}: has a channel below the measured data; mend the file")
            channels += [_channel(line, f"{name} line {number}") for number, line in plain]
        elif keyword == "COMMENTS":
            comments += [line for _, line in held]
        elif keyword in entries:
            entries[keyword] += [_entry(line) for _, line in plain]
        elif keyword in SECTIONS:
            models.append((keyword, tuple(line for _, line in held)))
        else:
            notes.append(f"the section **{keyword} is not of TYDEX 1.3 and is passed over")
    else:
        notes.append("has no **END: it may be cut off")
    return TydexFile(
        header=tuple(entries["HEADER"]),
        constants=tuple(entries["CONSTANTS"]),
        channels=tuple(channels),
        data=np.empty((0, len(channels))) if data is None else data,
        comments=tuple(comments),
        parameters=tuple(entries["MODELPARAMETERS"]),
        models=tuple(models),
        notes=tuple(map(tidy, notes[:20])),
        label=name,
    )


def _check_rows(stated: str, there: int, notes: list[str], name: str) -> None:
    """Note the number of rows that the file states if it has more; TableError if it has fewer."""
    count, _, _ = stated.partition(" ")
    if count.isascii() and count.isdigit() and int(count[:18]) != there:
        what = f"says it has {count[:18]} rows and holds {there}"
        if int(count[:18]) > there:
            raise TableError(f"{name}: {what}; it is cut off, or the number wrong")
        notes.append(what)


def _data(lines: list[tuple[int, str]], count: int, name: str, max_bytes: int) -> NDArray[np.float64]:
    """The measured data, as (rows, channels)."""
    parts: list[NDArray[np.float64]] = []
    rows, held = _full_rows(lines, count, name), 0
    while chunk := list(islice(rows, max(_CHUNK // count, 1))):
        held += len(chunk)
        afford(16 * held * count, max_bytes, name, "its data")
        parts.append(_values(chunk, name))
    return np.concatenate(parts) if parts else np.empty((0, count))


def _full_rows(lines: list[tuple[int, str]], count: int, name: str) -> Iterator[tuple[int, list[str]]]:
    """Number of the line, and one cell per channel, of each row."""
    cells: list[str] = []
    first = 0
    for at, line in lines:
        found = line.partition("!")[0].split()
        if not found:
            continue
        first = first if cells else at
        if len(found) < count and not cells and len(line) >= 10 * (count - 1):
            found = _tens(line, count) or found
        cells += found
        if len(cells) > count:
            what = f"{len(cells)} values" if len(found) > count else f"{len(cells)} values over its lines"
            raise TableError(f"{name} row {first}: has {what} for {count} channels; mend or remove it")
        if len(cells) == count:
            yield first, cells
            cells = []
    if cells:
        what = f"{len(cells)} of {count} values"
        raise TableError(f"{name} row {first}: ends after {what}; the file is cut off, or the row wrong")


def _keyword(line: str) -> tuple[str, str] | None:
    if not line.startswith("**"):
        return None
    found = _KEYWORD.fullmatch(line)
    return (found[1].upper(), found[2].strip()) if found else None


def _tens(line: str, count: int) -> list[str] | None:
    """The cells of a row in fields of ten columns without blanks between them; None if it is no such row."""
    cells = [line[at : at + 10].strip() for at in range(0, len(line), 10)]
    return cells if len(cells) == count and all(number_of(cell) is not None for cell in cells) else None


def _values(rows: list[tuple[int, list[str]]], name: str) -> NDArray[np.float64]:
    """The numbers of some rows, as (rows, channels)."""
    values = plain_numbers([cell for _, cells in rows for cell in cells])
    if values is not None:
        return values.reshape(len(rows), -1)
    return np.array([[_value(cell, line, name) for cell in cells] for line, cells in rows])


def _value(cell: str, line: int, name: str) -> float:
    """The number of a cell, not-a-number if it is missing; TableError if it is text."""
    found = number_of(cell)
    if found is not None:
        return found
    if cell.upper() == ABSENT or is_missing(cell):
        return np.nan
    raise TableError(f"{name} row {line}: {shown(cell)} is no number; mend it, or write {ABSENT} if it is not known")


def _parts(line: str) -> tuple[str, str, str, str]:
    """Name, description, unit, and the text from column 51 on, of a line in columns or with tabs."""
    if "\t" in line:
        cells = [cell.strip() for cell in line.split("\t")]
        cells += [""] * (4 - len(cells))
        return cells[0], cells[1], cells[2], " ".join(cells[3:])
    called = line.split(maxsplit=1)[0] if line.split() else ""
    if not line[:10].strip():
        called = ""
    called = called if len(called) <= 10 else line[:10]
    begin = line.find(called) + len(called)
    edge = 50
    word = line.rfind(" ", 0, len(line[:edge].rstrip())) + 1
    early = line[word:].split(maxsplit=1)[0] if word > 40 and line[word:].split() else ""
    apart = line[word - 2 : word] == "  " and number_of(early) is not None
    if early and (apart or (len(line) > edge and " " not in line[edge - 1 : edge + 1])):
        edge = word  # the word is a value that begins before its column, not the end of a unit
    return called, line[begin:40].strip(), line[max(begin, 40) : edge].strip(), line[edge:].strip()


def _entry(line: str) -> TydexEntry:
    called, description, unit, value = _parts(line)
    return TydexEntry(called, value, unit, description)


def _channel(line: str, where: str) -> TydexChannel:
    called, description, unit, rest = _parts(line)
    if not called:
        raise TableError(f"{where}: a channel has no name in columns 1 to 10")
    fields = [line[at : at + 10] for at in (50, 60, 70)]
    shifted = "\t" in line or line[50:].strip() != rest
    if shifted or any(len(one.split()) > 1 or (one.strip() and number_of(one) is None) for one in fields):
        fields = rest.partition("!")[0].split()[:3]
    values = []
    for cell, usual in zip([*fields, "", "", ""], (1.0, 0.0, 0.0), strict=False):
        value = number_of(cell) if cell.strip() else usual
        if value is None:
            raise TableError(
                f"{where}: channel {shown(called)} has {shown(cell.strip())} where its factor or offset is"
            )
        values.append(value)
    return TydexChannel(called, unit, description, values[0], values[2], values[1])


def _description(one: TydexChannel) -> str:
    """The meaning of a channel's name, its description and its conversion, if it has one."""
    stored = f"(stored value {one.stored_offset:+g})" if one.stored_offset else "stored value"
    plain = (one.factor, one.offset, one.stored_offset) == (1.0, 0.0, 0.0)
    scaled = "" if plain else f"{stored} × {one.factor:g} {one.offset:+g}"
    return tidy("; ".join(filter(None, (meaning(one.name), one.description, scaled))))


def _running(tyre: TydexFile) -> NDArray[np.float64] | None:
    """The running time [s]; None unless exactly one channel has it, with a unit of time."""
    found = [at for at, one in enumerate(tyre.channels) if one.name.upper() == _TIME]
    if len(found) != 1:
        return None
    scale = seconds(tyre.channels[found[0]].unit or None)
    return None if scale is None else scale * physical(tyre.data[:, found[0]], tyre.channels[found[0]], tyre.label)


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    tyre = read_tydex(opened.path, max_bytes=MAX_FILE_BYTES, label=opened.name)
    time, count = _running(tyre), len(tyre.data)
    times = None if time is None else lambda first, last: time[first:last]
    barred = "" if count else "has no measured data"

    def samples(at: int) -> Part:
        return lambda first, last: physical(tyre.data[first:last, at], tyre.channels[at], opened.name)

    names = numbered([one.name for one in tyre.channels])
    tracks = [
        Track(name, one.unit or None, count, samples(at), time=times, note=_description(one), barred=barred)
        for at, (name, one) in enumerate(zip(names, tyre.channels, strict=True))
    ]
    entries = [f"{one.name} ({one.description}): {one.value} {one.unit}" for one in (*tyre.header, *tyre.constants)]
    comments = [line.lstrip("! ") for line in tyre.comments if any(map(str.isalnum, line))]
    release = tyre.constant("RELEASE")
    notes = [tidy(note) for note in (*tyre.notes, *entries[:100], *comments[:20])]
    return Content(tidy(f"TYDEX {release.value if release else ''}".strip()), tracks, notes)


FORMAT = track_format("tydex", "TYDEX", (".tdx", ".tydex"), "a TYDEX file", _content)
