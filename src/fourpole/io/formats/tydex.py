"""TYDEX 1.3, the exchange format for measurements of tyres: read with tolerance, written to the letter.

A file is lines of text in sections, each opened by a keyword. Of a line in most sections, columns 1 to 10
hold a name, 11 to 40 a description, 41 to 50 a unit, and 51 on a value; of a measured channel, 51 to 60
hold a factor, 61 to 70 the offset of the stored values and 71 to 80 that of the physical ones. Lines that
begin with `!` are comments. The measured data follow as rows of one number per channel.

References
----------
Unrau, Zamow, "TYDEX-Format, Description and Reference Manual, Release 1.3", initiated by the TYDEX
Workshop, Universität Karlsruhe, 1997.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.io.formats.guard import afford, seconds, tidy
from fourpole.io.layout import find_column, is_missing, number
from fourpole.io.signals import FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.source import encoding_of, name_of, open_regular
from fourpole.io.write import replacing
from fourpole.units import shown

__all__ = ["FORMAT", "TydexChannel", "TydexEntry", "TydexFile", "meaning", "read_tydex", "write_tydex"]

_SECTIONS = frozenset(
    {
        "HEADER",
        "COMMENTS",
        "CONSTANTS",
        "MEASURCHANNELS",
        "MEASURDATA",
        "MODELDEFINITION",
        "MODELPARAMETERS",
        "MODELCOEFFICIENTS",
        "MODELCHANNELS",
        "MODELOUTPUTS",
        "MODELEND",
        "END",
    }
)
_KEYWORD = re.compile(r"\*\*\s*([A-Za-z_]+)[ \t]*(.*)")
_LONGEST_LINE = 1_000_000
_MOST_LINES = 100_000  # outside the measured data
_CHUNK = 10_000
_HEAD = 65_536
_TIME = "RUNTIME"
_ABSENT = "NOTAVAIL"

_QUANTITIES = {
    "RUNTIME": "running time",
    "MEASNUMB": "number of the measurement point",
    "LONGVEL": "longitudinal velocity",
    "WHROTSPD": "rotational speed of the wheel",
    "SLIPANGL": "slip angle",
    "INCLANGL": "inclination angle",
    "LONGSLIP": "longitudinal slip",
    "INFLPRES": "inflation pressure",
    "FX": "longitudinal force",
    "DSTGRWHC": "distance from the ground to the wheel centre",
    "TYREDEFW": "deflection of the tyre, W-axis system",
    "VERTVELW": "vertical velocity, W-axis system",
    "LGFCCOEF": "coefficient of longitudinal force",
    "LTFCCOEF": "coefficient of lateral force",
    "TRCKTEMP": "temperature of the track",
    "TRDTEMP": "temperature of the tread's surface",
    "AMBITEMP": "ambient temperature",
}
_LOADS = {
    "FX": "longitudinal force",
    "FY": "lateral force",
    "FZ": "vertical force",
    "MX": "overturning moment",
    "MY": "rolling moment",
    "MZ": "aligning moment",
}


@dataclass(frozen=True)
class TydexEntry:
    """A line of a header, of the constants or of a model's parameters.

    Attributes
    ----------
    name, description, unit, value : str
        As written, without blanks around them.
    """

    name: str
    value: str
    unit: str = ""
    description: str = ""

    @property
    def number(self) -> float | None:
        """The value as a number in the entry's unit, None if it is none."""
        return _number(self.value)


@dataclass(frozen=True)
class TydexChannel:
    """A measured channel.

    Attributes
    ----------
    name, description, unit : str
    factor : float
    offset : float [unit]
    stored_offset : float
        Physical value = (stored value + stored_offset) · factor + offset. The format names both offsets; that the
        first is added, as the second is, is our reading: it is zero in every file known to us.
    """

    name: str
    unit: str = ""
    description: str = ""
    factor: float = 1.0
    offset: float = 0.0
    stored_offset: float = 0.0


@dataclass(frozen=True, eq=False)
class TydexFile(ByValue):
    """What a TYDEX file holds.

    Attributes
    ----------
    header, constants, parameters : tuple of TydexEntry
        Parameters are those of a tyre model.
    comments : tuple of str
        Lines of free text.
    channels : tuple of TydexChannel
    data : (rows, channels) float array
        As stored, before factor and offset; not-a-number where a value is missing. See `values`.
    models : tuple of (str, tuple of str)
        Other sections with their keyword, such as MODELCOEFFICIENTS, in lines as written.
    notes : tuple of str
        What a reader should know: a missing end, an unknown section.
    label : str
        The file's name in messages.
    """

    header: tuple[TydexEntry, ...] = ()
    constants: tuple[TydexEntry, ...] = ()
    channels: tuple[TydexChannel, ...] = ()
    data: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    comments: tuple[str, ...] = ()
    parameters: tuple[TydexEntry, ...] = ()
    models: tuple[tuple[str, tuple[str, ...]], ...] = ()
    notes: tuple[str, ...] = ()
    label: str = "TYDEX file"

    def constant(self, name: str) -> TydexEntry | None:
        """The constant, or else the header's entry, of this name; None if there is none."""
        return next((one for one in (*self.constants, *self.header) if one.name.upper() == name.upper()), None)

    def values(self, name: str) -> NDArray[np.float64]:
        """The physical values of a channel, in its unit.

        Raises
        ------
        TableError
            If the channel is missing or ambiguous, or cannot be converted.
        """
        index = find_column([one.name for one in self.channels], name, self.label)
        return _physical(self.data[:, index], self.channels[index], self.label)


def meaning(name: str) -> str:
    """What a standard name stands for, with its axis system where it tells one; empty if it is not known.

    Examples
    --------
    >>> meaning("FZW"), meaning("DSTGRWHC"), meaning("MY_RIG")
    ('vertical force, W-axis system', 'distance from the ground to the wheel centre', '')
    """
    upper = name.upper()
    if len(upper) == 3 and upper[:2] in _LOADS and upper[2] in "CHW":
        return f"{_LOADS[upper[:2]]}, {upper[2]}-axis system"
    return _QUANTITIES.get(upper, "")


def read_tydex(path: str | PathLike[str], *, max_bytes: int = 1_000_000_000, label: str | None = None) -> TydexFile:
    r"""Read a TYDEX file, release 1.3 or earlier.

    Tabs between the entries, missing blanks at the ends of lines, Fortran's D exponents, decimal commas
    and rows over several lines are taken.

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
        If it is no TYDEX file, is cut off, or holds what is no number where one must be.

    Examples
    --------
    >>> import tempfile, pathlib
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
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        start = file.read(_HEAD)
        encoding, mark = encoding_of(start, name)
        if not _recognises(start):
            raise TableError(f"{name}: is no TYDEX file: it has no section **HEADER or **MEASURCHANNELS at its start")
        file.seek(mark)
        text = io.TextIOWrapper(file, encoding=encoding, errors="replace", newline=None)
        try:
            return _Reader(_lines(text, name), name, max_bytes).file()
        finally:
            text.detach()


def write_tydex(path: str | PathLike[str], tyre: TydexFile, *, label: str | None = None) -> None:
    """Write a TYDEX file of release 1.3, in one step.

    Numbers come back within 5e-13 of themselves. Rows are of fields of 10 columns where all values fit,
    else of 20 or 30. See `read_tydex` for an example.

    Parameters
    ----------
    path : path
        Replaced if it exists; its folder must.
    tyre : TydexFile
        Names have up to 8 characters, descriptions 30, units 9, values 30, all of ASCII.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Raises
    ------
    TableError
        If the format cannot hold what is given.
    FileError
        If it cannot be written; an old file is then as it was.
    """
    name = name_of(path, label)
    data = np.asarray(tyre.data, dtype=np.float64)
    if data.ndim != 2 or data.shape[1] != len(tyre.channels):
        raise TableError(f"{name}: has {len(tyre.channels)} channels but data of shape {data.shape}")
    if np.isinf(data).any():
        raise TableError(f"{name}: an infinite value cannot be written; make it not-a-number, for missing")
    header = tyre.header
    if not any(one.name.upper() == "RELEASE" for one in header):
        header = (TydexEntry("RELEASE", "1.3", "", "Release of TYDEX-Format"), *header)
    lines = ["**HEADER", *(_entry_line(one, name) for one in header)]
    lines += ["**COMMENTS", *(_comment_line(one, name) for one in tyre.comments)]
    lines += ["**CONSTANTS", *(_entry_line(one, name) for one in tyre.constants)]
    if tyre.channels:
        lines += ["**MEASURCHANNELS", *(_channel_line(one, name) for one in tyre.channels), "**MEASURDATA"]
    after: list[str] = []
    if tyre.parameters:
        after += ["**MODELPARAMETERS", *(_entry_line(one, name) for one in tyre.parameters)]
    for keyword, section in tyre.models:
        if keyword not in _SECTIONS or not keyword.startswith("MODEL"):
            raise TableError(f"{name}: {shown(keyword)} is no section of a model")
        after += [f"**{keyword}", *(_comment_line(one, name) for one in section)]
    with replacing(path, label=label) as file:
        file.write("".join(f"{line}\n" for line in lines).encode("ascii"))
        _write_rows(file, data)
        file.write("".join(f"{line}\n" for line in (*after, "**END")).encode("ascii"))


def _write_rows(file: BinaryIO, data: NDArray[np.float64]) -> None:
    longest = max((len(_digits(value)) for row in data for value in row), default=0)
    width = 10 * (longest // 10 + 1)  # at least one blank between
    for row in data:
        file.write(("".join(f"{_digits(value):>{width}}" for value in row) + "\n").encode("ascii"))


def _digits(value: float) -> str:
    """A value to 13 digits."""
    return _ABSENT if np.isnan(value) else f"{value + 0.0:.13g}"


def _held(text: str, longest: int, what: str, name: str) -> str:
    """A text if it fits in its columns."""
    if len(text) > longest:
        raise TableError(f"{name}: the {what} {shown(text)} has {len(text)} characters; TYDEX holds {longest}")
    if not text.isascii() or not text.isprintable() or text != text.strip():
        raise TableError(f"{name}: the {what} {shown(text)} is not plain ASCII without blanks at its ends")
    return text


def _named(text: str, name: str) -> str:
    if not text or " " in text or text.startswith(("!", "**")) or "!" in text:
        raise TableError(f"{name}: {shown(text)} cannot be a name: it must be of letters and digits, without blanks")
    return _held(text, 8, "name", name)


def _entry_line(one: TydexEntry, name: str) -> str:
    described = _described(one.name, one.description, one.unit, name)
    return f"{described}{_held(one.value, 30, 'value', name)}".rstrip()


def _described(called: str, description: str, unit: str, name: str) -> str:
    """Columns 1 to 50."""
    first = f"{_named(called, name):10}{_held(description, 30, 'description', name):30}"
    return f"{first}{_held(unit, 9, 'unit', name):10}"


def _channel_line(one: TydexChannel, name: str) -> str:
    numbers = []
    for value, what in ((one.factor, "factor"), (one.stored_offset, "offset"), (one.offset, "offset")):
        digits = f"{value:.17g}" if float(f"{value:.9g}") != value else f"{value:.9g}"
        if not np.isfinite(value) or len(digits) > 9:
            raise TableError(
                f"{name}: channel {shown(one.name)} has the {what} {value!r}, which TYDEX cannot hold in 10 columns;"
                " store the physical values, with factor 1 and offset 0"
            )
        numbers.append(f"{digits:10}")
    return (_described(one.name, one.description, one.unit, name) + "".join(numbers)).rstrip()


def _comment_line(text: str, name: str) -> str:
    if not text.isascii() or not (text.isprintable() or not text) or text.lstrip().startswith("**"):
        raise TableError(f"{name}: the line {shown(text)} is not plain ASCII, or begins with **")
    return text.rstrip()


def _lines(text: io.TextIOWrapper, name: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers; one without an end is refused before it fills the memory."""
    at = 0
    while line := text.readline(_LONGEST_LINE):
        at += 1
        if len(line) >= _LONGEST_LINE:
            raise TableError(f"{name} line {at}: has more than {_LONGEST_LINE} characters; this is no TYDEX file")
        if "\x00" in line:
            raise TableError(f"{name} line {at}: is binary, not text; export the file again")
        yield at, line.rstrip()


class _Reader:
    """Goes through the lines once, section by section."""

    def __init__(self, lines: Iterator[tuple[int, str]], name: str, max_bytes: int) -> None:
        self._lines, self._name, self._max_bytes = lines, name, max_bytes
        self._entries: dict[str, list[TydexEntry]] = {"HEADER": [], "CONSTANTS": [], "MODELPARAMETERS": []}
        self._comments: list[str] = []
        self._models: list[tuple[str, list[str]]] = []
        self._channels: list[TydexChannel] = []
        self._notes: list[str] = []
        self._data: NDArray[np.float64] | None = None
        self._plain = 0

    def file(self) -> TydexFile:
        section, said = "", ""
        ended = False
        while not ended:
            opened = self._data_until(said) if section == "MEASURDATA" else self._until_keyword(section)
            if opened is None:
                break
            section, said = opened
            if section not in _SECTIONS:
                self._note(f"the section **{section} is not of TYDEX 1.3 and is passed over")
                section = ""
            elif section.startswith("MODEL") and section != "MODELPARAMETERS":
                self._models.append((section, []))
            ended = section == "END"
        if not ended:
            self._note("has no **END: it may be cut off")
        data = self._data if self._data is not None else np.empty((0, len(self._channels)))
        return TydexFile(
            header=tuple(self._entries["HEADER"]),
            constants=tuple(self._entries["CONSTANTS"]),
            channels=tuple(self._channels),
            data=data,
            comments=tuple(self._comments),
            parameters=tuple(self._entries["MODELPARAMETERS"]),
            models=tuple((keyword, tuple(lines)) for keyword, lines in self._models),
            notes=tuple(self._notes),
            label=self._name,
        )

    def _note(self, text: str) -> None:
        if len(self._notes) < 20:
            self._notes.append(tidy(text))

    def _until_keyword(self, section: str) -> tuple[str, str] | None:
        """Take the lines of a section; the keyword of the next one, and what stands after it."""
        for at, line in self._lines:
            self._plain += 1
            if self._plain > _MOST_LINES:
                raise TableError(f"{self._name} line {at}: has too many lines outside its data; this is no TYDEX file")
            if opened := _keyword(line):
                return opened
            if section == "COMMENTS":
                self._comments.append(line)
            elif section.startswith("MODEL") and section != "MODELPARAMETERS":
                self._models[-1][1].append(line)
            elif not line.strip() or "!" in line[:10]:
                continue
            elif section == "MEASURCHANNELS":
                if self._data is not None:
                    raise TableError(f"{self._name} line {at}: has a channel below the measured data; mend the file")
                self._channels.append(_channel(line, f"{self._name} line {at}"))
            elif section in self._entries:
                self._entries[section].append(_entry(line))
        return None

    def _data_until(self, said: str) -> tuple[str, str] | None:
        """Take the measured data; the keyword of the next section, and what stands after it."""
        if not self._channels:
            raise TableError(f"{self._name}: has **MEASURDATA but no channels in **MEASURCHANNELS above it")
        if self._data is not None:
            raise TableError(f"{self._name}: has **MEASURDATA twice; split it into two files")
        count = len(self._channels)
        opened: list[tuple[str, str]] = []
        parts: list[NDArray[np.float64]] = []
        rows = self._full_rows(count, opened)
        held = 0
        while chunk := list(islice(rows, max(_CHUNK // count, 1))):
            held += len(chunk)
            afford(16 * held * count, self._max_bytes, self._name, "its data")
            parts.append(_values(chunk, self._name))
        self._data = np.concatenate(parts) if parts else np.empty((0, count))
        stated, _, _ = said.partition(" ")
        if stated.isascii() and stated.isdigit() and int(stated[:18]) != held:
            if int(stated[:18]) > held:
                cut = "it is cut off, or the number wrong"
                raise TableError(f"{self._name}: says it has {stated[:18]} rows and holds {held}; {cut}")
            self._note(f"says it has {stated} rows and holds {held}")
        return opened[0] if opened else None

    def _full_rows(self, count: int, opened: list[tuple[str, str]]) -> Iterator[tuple[int, list[str]]]:
        """Rows with a cell for each channel; the next section's keyword goes to `opened`."""
        cells: list[str] = []
        first = 0
        for at, line in self._lines:
            if line.startswith("**") and (keyword := _keyword(line)):
                opened.append(keyword)
                break
            found = line.partition("!")[0].split()
            if not found:
                continue
            first = first if cells else at
            if len(found) < count and not cells and len(line) >= 10 * (count - 1):
                found = _tens(line, count) or found
            cells += found
            if len(cells) > count:
                said = f"{len(cells)} values" if len(found) > count else f"{len(cells)} values over its lines"
                raise TableError(f"{self._name} row {first}: has {said} for {count} channels; mend or remove it")
            if len(cells) == count:
                yield first, cells
                cells = []
        if cells:
            said = f"{len(cells)} of {count} values"
            raise TableError(f"{self._name} row {first}: ends after {said}; the file is cut off, or the row wrong")


def _keyword(line: str) -> tuple[str, str] | None:
    if not line.startswith("**"):
        return None
    found = _KEYWORD.fullmatch(line)
    return (found[1].upper(), found[2].strip()) if found else None


def _tens(line: str, count: int) -> list[str] | None:
    """The cells of a row in fields of ten columns where no blank parts them."""
    cells = [line[at : at + 10].strip() for at in range(0, len(line), 10)]
    return cells if len(cells) == count and all(_number(cell) is not None for cell in cells) else None


def _number(text: str) -> float | None:
    """A number with a decimal point or comma, and E or D before its exponent."""
    cell = text.strip()
    if "d" in cell or "D" in cell:
        cell = cell.replace("D", "E").replace("d", "e")
    return number(cell, "," if "," in cell else ".")


def _values(rows: list[tuple[int, list[str]]], name: str) -> NDArray[np.float64]:
    """The numbers of some rows."""
    try:
        values = np.array([[float(cell) for cell in cells] for _, cells in rows])
        if np.isfinite(values).all() and not any("_" in cell for _, cells in rows for cell in cells):
            return values
    except ValueError:
        pass
    return np.array([[_value(cell, line, name) for cell in cells] for line, cells in rows])


def _value(cell: str, line: int, name: str) -> float:
    """The number of a cell of the data."""
    found = _number(cell)
    if found is not None:
        return found
    if cell.upper() == _ABSENT or is_missing(cell):
        return np.nan
    raise TableError(f"{name} row {line}: {shown(cell)} is no number; mend it, or write {_ABSENT} if it is not known")


def _parts(line: str) -> tuple[str, str, str, str]:
    """Name, description, unit and what is from column 51 on, of a line in columns or with tabs."""
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
    apart = line[word - 2 : word] == "  " and _number(early) is not None
    if early and (apart or (len(line) > edge and " " not in line[edge - 1 : edge + 1])):
        edge = word  # a value that begins before its column, not the end of a unit
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
    if shifted or any(len(one.split()) > 1 or (one.strip() and _number(one) is None) for one in fields):
        fields = rest.partition("!")[0].split()[:3]
    values = []
    for cell, usual in zip([*fields, "", "", ""], (1.0, 0.0, 0.0), strict=False):
        value = _number(cell) if cell.strip() else usual
        if value is None:
            raise TableError(
                f"{where}: channel {shown(called)} has {shown(cell.strip())} where its factor or offset is"
            )
        values.append(value)
    return TydexChannel(called, unit, description, values[0], values[2], values[1])


def _physical(stored: NDArray[np.float64], channel: TydexChannel, name: str) -> NDArray[np.float64]:
    """Values in the channel's unit."""
    if channel.factor == 0:
        raise TableError(
            f"{name}: channel {shown(channel.name)} has the factor 0, by which nothing is left of its values;"
            " store the physical values, with factor 1 and offset 0"
        )
    with np.errstate(over="ignore"):
        values = (stored + channel.stored_offset) * channel.factor + channel.offset
    if np.isinf(values).any():
        raise TableError(
            f"{name}: channel {shown(channel.name)} is beyond all numbers after its factor; mend the factor"
        )
    return values


def _recognises(head: bytes) -> bool:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        head = head.decode("utf-16", errors="ignore").encode("ascii", errors="ignore")
    lines = head.removeprefix(b"\xef\xbb\xbf").upper().replace(b"\r", b"\n").split(b"\n")
    return any(re.match(rb"\*\*\s*(HEADER|MEASURCHANNELS|MODELPARAMETERS|CONSTANTS)\b", line) for line in lines)


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    tyre = read_tydex(path, max_bytes=max_bytes, label=label)
    time = _running(tyre)
    start = duration = None
    if time is not None and len(time) and np.isfinite(time[[0, -1]]).all():
        start, duration = float(time[0]), float(time[-1] - time[0])
    signals = tuple(
        SignalInfo(called, one.unit or None, "", len(tyre.data), None, start, duration, _said(one))
        for called, one in zip(_numbered(tyre.channels), tyre.channels, strict=True)
    )
    entries = [f"{one.name} ({one.description}): {one.value} {one.unit}" for one in (*tyre.header, *tyre.constants)]
    comments = [line.lstrip("! ") for line in tyre.comments if any(map(str.isalnum, line))]
    release = tyre.constant("RELEASE")
    notes = tuple(tidy(note) for note in (*tyre.notes, *entries[:100], *comments[:20]))
    return FileInfo(tidy(f"TYDEX {release.value if release else ''}".strip()), signals, notes)


def _said(one: TydexChannel) -> str:
    """What a channel is: its meaning, its description, its conversion."""
    stored = f"(stored value {one.stored_offset:+g})" if one.stored_offset else "stored value"
    plain = (one.factor, one.offset, one.stored_offset) == (1.0, 0.0, 0.0)
    scaled = "" if plain else f"{stored} × {one.factor:g} {one.offset:+g}"
    return tidy("; ".join(filter(None, (meaning(one.name), one.description, scaled))))


def _numbered(channels: Sequence[TydexChannel]) -> list[str]:
    """The channels' names, numbered where several have the same."""
    often, seen = Counter(one.name for one in channels), Counter[str]()
    names = []
    for one in channels:
        seen[one.name] += 1
        names.append(f"{one.name}.{seen[one.name]}" if often[one.name] > 1 else one.name)
    return names


def _running(tyre: TydexFile) -> NDArray[np.float64] | None:
    """The running time in seconds, where one channel has it."""
    found = [at for at, one in enumerate(tyre.channels) if one.name.upper() == _TIME]
    if len(found) != 1:
        return None
    scale = seconds(tyre.channels[found[0]].unit or None)
    return None if scale is None else scale * _physical(tyre.data[:, found[0]], tyre.channels[found[0]], tyre.label)


def _read(request: Request) -> Sequence[Signal]:
    tyre = read_tydex(request.path, max_bytes=request.max_bytes, label=request.label)
    if request.group:
        raise TableError(f"{request.label}: has no groups; leave out '#{tidy(request.group)}' after the file")
    if not len(tyre.data):
        raise TableError(f"{request.label}: has no measured data")
    time = _running(tyre)
    names = [one.name for one in tyre.channels]
    signals = []
    for wanted in request.names:
        at = find_column(names, wanted, request.label)
        values = _physical(tyre.data[:, at], tyre.channels[at], request.label)
        signals.append(Signal(_numbered(tyre.channels)[at], tyre.channels[at].unit or None, values, time=time))
    return signals


FORMAT = Format(
    name="TYDEX",
    endings=(".tdx", ".tydex"),
    recognises=_recognises,
    survey=_survey,
    read=_read,
)
