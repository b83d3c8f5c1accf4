"""What the formats share: a library kept quiet and in bounds on a foreign file, and channels found by their names."""

from __future__ import annotations

import difflib
import gc
import importlib
import io
import logging
import re
import threading
import traceback
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import FileError, FourpoleError, TableError, UnitError
from fourpole.io.signals import Request
from fourpole.io.source import name_of
from fourpole.units import column_unit, shown, unit_scale

__all__ = [
    "Guard",
    "Place",
    "afford",
    "find",
    "floats",
    "guarded",
    "is_time",
    "listed",
    "need",
    "of_name",
    "seconds",
    "tidy",
]

Given = TypeVar("Given")
Place = tuple[str, str]
"""Group and name of a channel."""

_TIME = re.compile(
    r"t|time|times|timestamps?|zeit|temps|tiempo|time_s|et|(?:elapsed|running|run)[ _]?time", re.IGNORECASE
)
_SHOWN = 12
#: Output, warnings and loggers are the process's: two threads that hush them in turn would leave them hushed.
_ONE_AT_A_TIME = threading.RLock()


class _Void(io.TextIOBase):
    """Where a library may print."""

    def write(self, text: str) -> int:
        return len(text)


class Guard:
    """While it is entered, a library is quiet, and what it raises becomes one error that says what to do.

    Parameters
    ----------
    name : str
        The file's name in messages.
    kind : str
        What it should be: "an NI TDMS file".
    library : str
        Whose loggers are silenced.
    """

    def __init__(self, name: str, kind: str, library: str = "") -> None:
        self._name, self._kind, self._library = name, kind, library
        self._loaded = False
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            stack.enter_context(_ONE_AT_A_TIME)
            stack.enter_context(warnings.catch_warnings())
            warnings.simplefilter("ignore")
            stack.enter_context(np.errstate(all="ignore"))
            stack.enter_context(redirect_stdout(_Void()))
            stack.enter_context(redirect_stderr(_Void()))
            self._stack = stack.pop_all()
        if self._loaded:
            self._hush()
        return self

    def load(self, module: str) -> Any:
        """A library that is not part of the base installation, loaded when it is needed."""
        loaded = need(module, self._name, self._kind)
        self._loaded = True
        self._hush()
        return loaded

    def _hush(self) -> None:
        """Keep the library's loggers quiet until the guard is left."""
        for name, logger in list(logging.root.manager.loggerDict.items()):
            ours = name == self._library or name.startswith(f"{self._library}.")
            if self._library and ours and isinstance(logger, logging.Logger) and not logger.disabled:
                logger.disabled = True
                self._stack.callback(setattr, logger, "disabled", False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._stack:
            if error is None or isinstance(error, FourpoleError) or not isinstance(error, Exception):
                return
            said = _said(error)
            traceback.clear_frames(trace)
            if self._library:
                gc.collect()  # what a library left half made is put away while it is quiet
        if isinstance(error, MemoryError):
            raise FileError(
                f"{self._name}: needs more memory than there is, or declares more than it holds; read fewer of its "
                "channels, or export it again"
            ) from None
        what = f"cannot be read as {self._kind}{said}"
        raise TableError(f"{self._name}: {what}; it may be cut short or damaged: copy or export it again") from None


def guarded(pieces: Generator[Given], guard: Guard) -> Iterator[Given]:
    """What a generator gives, each piece made under the guard, which is left while the piece is used."""
    try:
        while True:
            with guard:
                piece = next(pieces, None)
            if piece is None:
                return
            yield piece
    finally:
        with guard:
            pieces.close()


def need(module: str, name: str, kind: str) -> Any:
    """A library of the extra `formats`; FileError that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        library = module.partition(".")[0]
        raise FileError(
            f"{name}: {kind} is read by the library {library}, which is not installed; pip install 'fourpole[formats]'"
        ) from None


def _said(error: Exception) -> str:
    """What a library says of it, fit to be shown."""
    text = " ".join(str(error).split())
    return f" ({shown(text, 120)[1:-1]})" if text else ""


def tidy(text: object, limit: int = 200) -> str:
    """A text of the file as a note: one line, no control characters, not long."""
    return shown(" ".join(str(text).split()), limit)[1:-1]


def of_name(name: str, unit: object) -> str | None:
    """The unit that the file states for a channel, else the one in its name's brackets."""
    stated = unit.strip() if isinstance(unit, str) else ""
    return stated or column_unit(name)[1]


def is_time(name: str) -> bool:
    """Whether a name is that of a time base."""
    return _TIME.fullmatch(column_unit(name)[0].rpartition(".")[2]) is not None


def seconds(unit: str | None) -> float | None:
    """Seconds in the unit of a time base, 1 where it has none; None where it is no unit of time."""
    if unit is None:
        return 1.0
    try:
        return unit_scale(unit, "time")
    except UnitError:
        return None


def afford(needed: int, max_bytes: int, name: str, what: str = "what is asked of it") -> None:
    """FileError if something would take more memory than is allowed."""
    if needed > max_bytes:
        much = f"{needed / 1e6:.4g} MB of memory, more than the {max_bytes / 1e6:.4g} MB allowed"
        raise FileError(f"{name}: {what} needs {much}; read fewer channels, split the file or raise the limit")


def floats(samples: Any, channel: str, name: str) -> NDArray[np.float64]:
    """Samples as floats; TableError if they are no numbers in a row."""
    values = np.asarray(samples)
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        what = (
            "complex numbers" if values.dtype.kind == "c" else f"{values.ndim}-dimensional" if values.ndim > 1 else ""
        )
        raise TableError(f"{name}: channel {shown(channel)} holds {what or 'no numbers'}; name another channel")
    return np.ascontiguousarray(values, dtype=np.float64)


def find(places: Sequence[Place], request: Request) -> list[int]:
    """Where the channels of a request are.

    A name is taken as written, then in another case, then without the unit in its brackets; where the
    file has groups, `group/name` is a name too. TableError if it is not there, or there more than once.
    """
    name = name_of(request.path, request.label)
    chosen = _in_group(places, request.group, name) if request.group else list(range(len(places)))
    return [_one(places, chosen, wanted, name) for wanted in request.names]


def _in_group(places: Sequence[Place], group: str, name: str) -> list[int]:
    for groups in (
        {one for one, _ in places if one == group},
        {one for one, _ in places if one.casefold() == group.casefold()},
    ):
        if len(groups) == 1:
            return [index for index, (one, _) in enumerate(places) if one in groups]
    known = list(dict.fromkeys(one for one, _ in places if one))
    if not known:
        raise TableError(f"{name}: has no groups; leave out '#{shown(group)[1:-1]}' after the file")
    raise TableError(f"{name}: there is no group {shown(group)}{listed(known, group)}")


def _one(places: Sequence[Place], chosen: Sequence[int], wanted: str, name: str) -> int:
    bare = column_unit(wanted)[0].casefold()
    ways: tuple[Callable[[Place], bool], ...] = (
        lambda place: place[1] == wanted,
        lambda place: f"{place[0]}/{place[1]}" == wanted,
        lambda place: place[1].casefold() == wanted.casefold(),
        lambda place: f"{place[0]}/{place[1]}".casefold() == wanted.casefold(),
        lambda place: column_unit(place[1])[0].casefold() == bare,
    )
    for same in ways:
        found = [index for index in chosen if same(places[index])]
        if len(found) == 1:
            return found[0]
        if found:
            raise TableError(_ambiguous([places[index] for index in found], wanted, name))
    raise TableError(
        f"{name}: there is no channel {shown(wanted)}{listed([places[index][1] for index in chosen], wanted)}"
    )


def _ambiguous(found: Sequence[Place], wanted: str, name: str) -> str:
    groups = list(dict.fromkeys(group for group, _ in found))
    if len(groups) == len(found):
        which = ", ".join(shown(group) for group in groups[:_SHOWN])
        example = next((group for group in groups if group), groups[0])
        return f"{name}: channel {shown(wanted)} is in the groups {which}; say which, as in {name}#{tidy(example, 60)}"
    which = ", ".join(shown(one) for _, one in found[:_SHOWN])
    return (
        f"{name}: channel {shown(wanted)} is ambiguous: {len(found)} have that name ({which}); rename them in the file"
    )


def listed(names: Sequence[str], wanted: str) -> str:
    """The end of a message: the nearest of the names, and some of them."""
    if not names:
        return "; it has none"
    near = difflib.get_close_matches(wanted[:60], [one[:60] for one in names[:500]], n=1, cutoff=0.5)
    hint = f"; did you mean {shown(near[0])}?" if near else ";"
    ordered = list(dict.fromkeys([*(one for one in names if one[:60] in near), *names]))
    more = f" and {len(ordered) - _SHOWN} more" if len(ordered) > _SHOWN else ""
    return f"{hint} it has {', '.join(shown(one)[1:-1] for one in ordered[:_SHOWN])}{more}"
