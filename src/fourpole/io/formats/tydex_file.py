"""The content of a TYDEX 1.3 file as Python objects, and its writer, which keeps to the letter of the format.

A file is lines of text in sections; a keyword opens each section. In most sections columns 1 to 10 of a line hold a
name, 11 to 40 a description, 41 to 50 a unit, and a value begins in column 51. For a measured channel, columns 51 to 60
hold a factor, 61 to 70 the offset of the stored values and 71 to 80 the offset of the physical ones. Lines that begin
with `!` are comments. The measured data follow as rows of one number per channel.

References
----------
Unrau, Zamow, "TYDEX-Format, Description and Reference Manual, Release 1.3", initiated by the TYDEX
Workshop, Universität Karlsruhe, 1997.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.io.layout import find_column, number
from fourpole.io.source import AnyPath, name_of
from fourpole.io.write import replacing
from fourpole.units import shown

ABSENT = "NOTAVAIL"
"""The text that marks a missing value in the data."""
_OF_MODELS = ("DEFINITION", "PARAMETERS", "COEFFICIENTS", "CHANNELS", "OUTPUTS", "END")
SECTIONS = frozenset(
    {"HEADER", "COMMENTS", "CONSTANTS", "MEASURCHANNELS", "MEASURDATA", "END", *(f"MODEL{one}" for one in _OF_MODELS)}
)
"""The keywords of the format."""

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
        As written, without leading and trailing blanks.
    """

    name: str
    value: str
    unit: str = ""
    description: str = ""

    @property
    def number(self) -> float | None:
        """The value as a number in the entry's unit; None if it is no number."""
        return number_of(self.value)


@dataclass(frozen=True)
class TydexChannel:
    """A measured channel.

    Attributes
    ----------
    name, description, unit : str
    factor : float
    offset : float [unit]
    stored_offset : float
        Physical value = (stored value + stored_offset) · factor + offset. The format does not say that the stored
        offset is added; it is zero in every file known to us.
    """

    name: str
    unit: str = ""
    description: str = ""
    factor: float = 1.0
    offset: float = 0.0
    stored_offset: float = 0.0


@dataclass(frozen=True, eq=False)
class TydexFile(ByValue):
    """The content of a TYDEX file.

    Attributes
    ----------
    header, constants, parameters : tuple of TydexEntry
        Entries of these sections; `parameters` are those of a tyre model.
    comments : tuple of str
        Lines of free text.
    channels : tuple of TydexChannel
    data : (rows, channels) float array
        Stored values, to which factor and offset are not applied; not-a-number where a value is missing. See `values`.
    models : tuple of (str, tuple of str)
        Keyword and lines of each other section of a model, such as MODELCOEFFICIENTS.
    notes : tuple of str
        Warnings of the reader, such as a missing end or an unknown section.
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
        """The constant of this name, or else the header's entry; None if there is neither."""
        return next((one for one in (*self.constants, *self.header) if one.name.upper() == name.upper()), None)

    def values(self, name: str) -> NDArray[np.float64]:
        """The physical values of a channel, in its unit.

        Raises
        ------
        TableError
            If the channel is missing or ambiguous, or cannot be converted.
        """
        index = find_column([one.name for one in self.channels], name, self.label)
        return physical(self.data[:, index], self.channels[index], self.label)


def meaning(name: str) -> str:
    """The quantity that a standard name stands for, with its axis system; empty if the name is not known.

    Examples
    --------
    >>> meaning("FZW"), meaning("DSTGRWHC"), meaning("MY_RIG")
    ('vertical force, W-axis system', 'distance from the ground to the wheel centre', '')
    """
    upper = name.upper()
    if len(upper) == 3 and upper[:2] in _LOADS and upper[2] in "CHW":
        return f"{_LOADS[upper[:2]]}, {upper[2]}-axis system"
    return _QUANTITIES.get(upper, "")


def write_tydex(path: AnyPath, tyre: TydexFile, *, label: str | None = None) -> None:
    """Write a TYDEX file of release 1.3, in one step.

    Numbers are kept with a relative error of at most 5e-13. The data stand in fields of 10 columns if all values fit,
    or else of 20 or 30. See `read_tydex` for an example.

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
    before = ["**HEADER", *(_entry_line(one, name) for one in header)]
    before += ["**COMMENTS", *(_comment_line(one, name) for one in tyre.comments)]
    before += ["**CONSTANTS", *(_entry_line(one, name) for one in tyre.constants)]
    after: list[str] = []
    if tyre.channels:
        before += ["**MEASURCHANNELS", *(_channel_line(one, name) for one in tyre.channels), "**MEASURDATA"]
    if tyre.parameters:
        after += ["**MODELPARAMETERS", *(_entry_line(one, name) for one in tyre.parameters)]
    for keyword, lines in tyre.models:
        if keyword not in SECTIONS or not keyword.startswith("MODEL"):
            raise TableError(f"{name}: {shown(keyword)} is no section of a model")
        after += [f"**{keyword}", *(_comment_line(one, name) for one in lines)]
    with replacing(path, label=label) as file:
        file.write("".join(f"{line}\n" for line in before).encode("ascii"))
        _write_rows(file, data)
        file.write("".join(f"{line}\n" for line in (*after, "**END")).encode("ascii"))


def _write_rows(file: BinaryIO, data: NDArray[np.float64]) -> None:
    longest = max((len(_digits(value)) for row in data for value in row), default=0)
    width = 10 * (longest // 10 + 1)  # leaves at least one blank between values
    for row in data:
        file.write(("".join(f"{_digits(value):>{width}}" for value in row) + "\n").encode("ascii"))


def _digits(value: float) -> str:
    """A value with 13 significant digits."""
    return ABSENT if np.isnan(value) else f"{value + 0.0:.13g}"


def _held(text: str, longest: int, what: str, name: str) -> str:
    """The text itself; TableError if it does not fit in its columns."""
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


def number_of(text: str) -> float | None:
    """A number with a decimal point or comma, and E or D before its exponent; None if the text is none."""
    cell = text.strip()
    if "d" in cell or "D" in cell:
        cell = cell.replace("D", "E").replace("d", "e")
    return number(cell, "," if "," in cell else ".")


def physical(stored: NDArray[np.float64], channel: TydexChannel, name: str) -> NDArray[np.float64]:
    """The physical values of a channel, in its unit; TableError if its factor is 0 or makes them infinite."""
    if channel.factor == 0:
        raise TableError(
            f"{name}: channel {shown(channel.name)} has the factor 0, so all its values would be 0;"
            " store the physical values, with factor 1 and offset 0"
        )
    with np.errstate(over="ignore"):
        values = (stored + channel.stored_offset) * channel.factor + channel.offset
    if np.isinf(values).any():
        raise TableError(
            f"{name}: channel {shown(channel.name)} is infinite after its factor is applied; correct the factor"
        )
    return values
