"""Shared by all formats: a guard around a library that reads a foreign file, limits of memory, units and times."""

from __future__ import annotations

import importlib
import re
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import FileError, FourpoleError, TableError, UnitError
from fourpole.io.names import Place, in_group, only
from fourpole.io.signals import Request
from fourpole.io.source import name_of
from fourpole.units import column_unit, shown, unit_scale

Item = TypeVar("Item")

#: Names of the attributes of a file or a channel that state unit, rate and step of time.
UNITS = ("unit", "units", "Unit", "Units")
RATES = ("rate", "sample_rate", "sampling_rate", "samplerate", "fs", "Fs", "sampling_frequency")
STEPS = ("dt", "increment", "step", "sample_interval")
_TIME = re.compile(
    r"t|time|times|timestamps?|zeit|temps|tiempo|time_s|et|(?:elapsed|running|run|test|total)[ _]?time|"
    r"(?:lauf|mess|prüf|test)zeit|jikan|时间|時間|時刻|经过时间|経過時間",
    re.IGNORECASE,
)


@contextmanager
def guard(name: str, kind: str) -> Iterator[None]:
    """A context in which any exception becomes a TableError that says what to do, and numpy does not warn.

    Parameters
    ----------
    name : str
        The file's name in messages.
    kind : str
        The kind of file that is expected, such as "an NI TDMS file".
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except FourpoleError:
        raise
    except MemoryError:
        raise FileError(
            f"{name}: needs more memory than there is, or declares more than it holds; read fewer of its "
            "channels, or export it again"
        ) from None
    except Exception as error:  # noqa: BLE001 - whatever a damaged file makes a library raise
        what = f"cannot be read as {kind}{_detail(error)}"
        raise TableError(f"{name}: {what}; it may be cut short or damaged: copy or export it again") from None


def guarded(items: Generator[Item], name: str, kind: str) -> Iterator[Item]:
    """The items of a generator; the guard is entered while an item is made, and left while the caller uses it."""
    try:
        while True:
            with guard(name, kind):
                item = next(items, None)
            if item is None:
                return
            yield item
    finally:
        with guard(name, kind):
            items.close()


def need(module: str, name: str, kind: str) -> Any:
    """A module of the extra `formats`; FileError, with the command that installs it, if it is missing."""
    try:
        return importlib.import_module(module)
    except ImportError:
        library = module.partition(".")[0]
        raise FileError(
            f"{name}: {kind} is read by the library {library}, which is not installed; pip install 'fourpole[formats]'"
        ) from None


def _detail(error: Exception) -> str:
    """The first line of a library's message in brackets; empty if it has none. Further lines name places on disk."""
    text = str(error).strip().partition("\n")[0].rpartition("error: ")[2]
    return f" ({shown(text, 120)[1:-1]})" if text else ""


def tidy(text: object, limit: int = 200) -> str:
    """A text of the file as a note: one line without control characters, cut to `limit` characters."""
    return shown(" ".join(str(text).split()), limit)[1:-1]


def of_name(name: str, unit: object) -> str | None:
    """The unit that the file states for a channel, or else the unit in the brackets of its name; None if neither."""
    stated = unit.strip() if isinstance(unit, str) else ""
    return stated or column_unit(name)[1]


def is_time(name: str) -> bool:
    """Whether a channel of this name states times, such as `t`, `time` or `Zeit [s]`."""
    return _TIME.fullmatch(column_unit(name)[0].rpartition(".")[2]) is not None


def seconds(unit: str | None) -> float | None:
    """Seconds in one unit of time; 1 if the unit is None, None if it is no unit of time."""
    if unit is None:
        return 1.0
    try:
        return unit_scale(unit, "time")
    except UnitError:
        return None


def time_scale(unit: str | None, channel: str, name: str) -> float:
    """Seconds in the unit of a time channel; TableError if the unit is none of time."""
    scale = seconds(unit)
    if scale is None:
        raise TableError(f"{name}: the time {shown(channel)} has the unit {shown(unit)}; state it in s, ms or µs")
    return scale


def afford(needed: int, max_bytes: int, name: str, what: str = "the request") -> None:
    """FileError if `needed` bytes are more than the memory allowed."""
    if needed > max_bytes:
        much = f"{needed / 1e6:.4g} MB of memory, more than the {max_bytes / 1e6:.4g} MB allowed"
        raise FileError(f"{name}: {what} needs {much}; read fewer channels, split the file or raise the limit")


def floats(samples: Any, channel: str, name: str) -> NDArray[np.float64]:
    """One-dimensional samples as floats; TableError if they are no numbers, or have more dimensions."""
    values = np.asarray(samples)
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        what = "complex numbers" if values.dtype.kind == "c" else "no numbers"
        if values.ndim > 1:
            what = f"an array of {values.ndim} dimensions"
        raise TableError(f"{name}: channel {shown(channel)} holds {what}; name another channel")
    return np.ascontiguousarray(values, dtype=np.float64)


def find(places: Sequence[Place], request: Request) -> list[int]:
    """Indices of the channels of a request, in its order; TableError if one is missing or ambiguous."""
    label = name_of(request.path, request.label)
    chosen = in_group(places, request.group, label)
    return [only(places, chosen, wanted, label) for wanted in request.names]
