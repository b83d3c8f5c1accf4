"""The parent's side of a long-lived worker process: a file that crashes or floods its library ends the worker alone.

Each thread of this process has at most one worker, which is started when it is first needed and ends with the thread's
owner. It is started afresh, never forked (the threads of libraries would stand still in a fork), and it does not import
the main program, so a script needs no ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import atexit
import select
import signal
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, cast

from fourpole import errors
from fourpole.io.packed import pack, unpack
from fourpole.io.processes import PIPE, Process, cpu_time, start_module
from fourpole.io.recordings import format_of
from fourpole.io.remote import allowed
from fourpole.io.signals import MAX_FILE_BYTES, Format, Progress
from fourpole.io.source import name_of
from fourpole.io.worker import STILL, TOO_LATE, TOO_MUCH, receive, send

#: Memory that a file may need beyond the interpreter and the file itself, mapped [byte]: the samples of a request may
#: take 2 GB (`stream`), and half as much again is for what a library holds beside them.
SPARE = 3_000_000_000
#: Memory that a small file may need to be read [byte], of which libraries take up to 220 MB; and additional memory per
#: byte of it, since packed samples become numbers.
_SMALL, _UNPACKED = 370_000_000, 100
#: Processor time that a file may need [s], and the additional time per byte [s/byte].
SECONDS, _PER_BYTE = 60.0, 1e-6
#: Time without progress after which a worker is ended [s]. Its progress is looked at once a second, and the looks are
#: counted: while this process stands still, as after Ctrl-Z, so does the count.
STALLED, _LOOK = 60.0, 1.0
#: A file of more bytes is read in a worker in any format. Reading so much sound text takes as long as a worker takes to
#: start (0.3 s), so this at most doubles the time of one file; less text is done at once, however it is made.
OWN_BYTES = 8_000_000
#: Threads of linear algebra in a worker: one, because there are several workers; and those for reading tables.
_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
_OF_TABLES = "POLARS_MAX_THREADS"
#: The allocator of glibc keeps some memory [byte] for the next recording, instead of asking the system for each array.
_ALLOCATOR = {"MALLOC_ARENA_MAX": "2", "MALLOC_MMAP_THRESHOLD_": str(1 << 24), "MALLOC_TRIM_THRESHOLD_": str(1 << 26)}
_LOCAL = threading.local()
_ALL: weakref.WeakSet[Child] = weakref.WeakSet()


def _end() -> None:
    for one in list(_ALL):
        one.close()


class Died(Exception):  # noqa: N818 - it is a report
    """A worker ended before it answered; the text says why, and `remedy` what to do."""

    remedy = "it may be damaged: copy or export it again"

    @property
    def message(self) -> errors.Message:
        """What it says, as a value."""
        return errors.Message("reader", "", str(self))


class Late(Died):
    """A worker took longer than it may: the same work would take another worker as long."""

    remedy = "it is slow to read, not damaged: export a shorter part of it, or in another format"


class Stalled(Late):
    """A worker neither used the processor nor told of progress."""

    remedy = "check that the drive or server with it answers, or copy it to a drive of this machine"


@dataclass(frozen=True)
class Piece:
    """The arguments of a function, with the size of the file that it reads and what it may need; see `Child.call`."""

    args: tuple[Any, ...]
    size: int = 0
    seconds: float = 0.0
    spare: int = 0

    @property
    def limits(self) -> tuple[float, float, int]:
        """Limit of its processor time [s], time that it may stand still [s], and memory that it may need [byte]."""
        seconds = self.seconds or SECONDS
        return seconds + _PER_BYTE * self.size, max(STALLED, seconds), self.spare or SPARE + self.size

    @property
    def moved(self) -> tuple[Any, ...]:
        """The arguments for a process with another working folder."""
        return tuple(one.absolute() if isinstance(one, Path) else one for one in self.args)


class Child:
    """One worker process, which ends with this process at the latest, with some threads for reading tables."""

    def __init__(self, threads: int = 1) -> None:
        _ALL.add(self)
        self._threads = threads
        self._process: Process | None = None
        self._closed = False
        self._allowed = ""

    def call(
        self,
        function: Callable[..., Any],
        *args: Any,
        size: int = 0,
        seconds: float = 0.0,
        spare: int = 0,
        progress: Progress | None = None,
    ) -> bytes:
        """Run a function of Fourpole in the worker.

        Parameters
        ----------
        function : callable
            A function at the top of a module, which lists the classes of its arguments in `OF_WORK`.
        size : int [byte]
            Size of the file that it reads.
        seconds : float [s]
            Limit of the processor time of a small file; by default `SECONDS`.
        spare : int [byte]
            Memory that the file may need; by default `SPARE` and its size.
        progress : callable, optional
            The argument of this name that the function has.

        Returns
        -------
        bytes
            The result as `packed.pack` made it, or as the function returned it if it returned bytes.

        Raises
        ------
        Died
            If the worker ended before it answered.
        FourpoleError, MemoryError, RuntimeError
            What the function raised; RuntimeError stands for an error that is not one of Fourpole.
        """
        (answer,) = self.calls(function, [Piece(args, size, seconds, spare)], progress)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def calls(
        self, function: Callable[..., Any], pieces: Sequence[Piece], progress: Progress | None = None
    ) -> list[bytes | Exception]:
        """Run a function on several pieces of work, about which the worker is asked once.

        Each piece has limits of its own. The answers come together: if the worker ends, all pieces without an answer
        have its death.

        Returns
        -------
        list of bytes or Exception
            What `call` returns or raises for each piece.
        """
        work = [(pack(one.moved), *one.limits) for one in pieces]
        stated = (function.__module__, function.__name__, progress is not None, work)
        answers: list[bytes | Exception] = []
        try:
            process = self._running()
            with suppress(OSError, ValueError):
                send(cast("BinaryIO", process.stdin), pack(stated))
            for _, limit, patience, _ in work:
                began = time.monotonic()
                answer = _told(_Watched(process, patience), progress)
                if answer is None:
                    self.close(for_good=False)
                    raise _death(process.returncode, time.monotonic() - began, limit, patience)
                answers.append(answer[1:] if answer[:1] == b"R" else _error(*unpack(answer[1:])))
        except BaseException as error:  # Ctrl-C: the answer would be taken for that of the next call
            self.close(for_good=False)
            if not isinstance(error, Died):
                raise
            answers += [error] * (len(pieces) - len(answers))
        return answers

    def _running(self) -> Process:
        if self._process is not None and (self._process.poll() is not None or self._allowed != allowed()):
            self.close(for_good=False)
        if self._process is None:
            if self._closed:
                raise Died("it was stopped")
            self._allowed = allowed()  # its variables are those of its start
            variables = {**dict.fromkeys(_ONE_THREAD, "1"), _OF_TABLES: str(self._threads), **_ALLOCATOR}
            self._process = start_module("fourpole.io.worker", variables=variables, stdin=PIPE, stdout=PIPE)
            atexit.unregister(_end)  # workers end before their folders are deleted, which what was started first does
            atexit.register(_end)
        return self._process

    def close(self, *, for_good: bool = True) -> None:
        """End the process at once; any thread may do this. After `for_good` no other one is started."""
        self._closed = self._closed or for_good
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError, ValueError):
                    cast("BinaryIO", pipe).close()


def child(threads: int = 1) -> Child:
    """The worker of this thread; the first call says how many threads it has for reading tables."""
    found = getattr(_LOCAL, "child", None)
    if found is None:
        found = _LOCAL.child = Child(threads)
    return cast("Child", found)


def _told(pipe: _Watched, progress: Progress | None) -> bytes | None:
    """The next answer of a worker, after what it tells of its progress; None if it has ended."""
    while True:
        answer = None
        with suppress(OSError, ValueError):
            answer = receive(pipe)
        if not answer or answer[:1] != b"P":
            return answer
        if progress is not None:
            progress(*unpack(answer[1:]))


class _Watched:
    """The answers of a worker, which is ended if it makes no progress for a time [s]."""

    def __init__(self, process: Process, patience: float) -> None:
        self._process, self._patience = process, patience
        assert isinstance(process.stdout, BufferedReader)
        self._pipe = process.stdout.raw  # a buffer would hide bytes from `poll`

    def read(self, count: int) -> bytes:
        """So many bytes of the answer; fewer at its end."""
        content, place = memoryview(bytearray(count)), 0
        while place < count and (step := self._next_into(content[place:])):
            place += step
        return bytes(content[:place])

    def _next_into(self, content: memoryview) -> int | None:
        if hasattr(select, "poll"):
            self._wait()
        return self._pipe.readinto(content)

    def _wait(self) -> None:
        """Wait for bytes; Stalled if meanwhile the worker takes no processor time."""
        waiting = select.poll()
        waiting.register(self._pipe.fileno(), select.POLLIN)
        looks, seen = 0, 0.0
        while not waiting.poll(1000 * _LOOK):
            taken = cpu_time(self._process)
            if taken is None:  # a worker elsewhere than on Linux watches itself
                return
            looks, seen = (looks + 1, seen) if taken < seen + STILL else (0, taken)
            if looks * _LOOK >= self._patience:
                raise Stalled(f"made no progress for {self._patience:.0f} s")


def _death(code: int | None, took: float, limit: float, patience: float) -> Died:
    """The death with its reason, from the exit code of the process."""
    if code in (TOO_LATE, -getattr(signal, "SIGXCPU", TOO_LATE)):
        return Late(f"took more than {limit:.0f} s of processor time")
    if code == 1 and took >= patience:  # the code of `faulthandler`, and of nothing that a library does
        return Stalled(f"made no progress for {patience:.0f} s")
    if code == TOO_MUCH or code == -getattr(signal, "SIGKILL", 9):
        return Died("needed more memory than there is")
    if code == -getattr(signal, "SIGABRT", 6):  # so does a library end that is refused memory
        return Died("needs more memory than a file of its size may, or crashed the library that reads it")
    return Died("crashed the library that reads it")


def _error(kind: str, text: str, site: str) -> Exception:
    """The error that the worker reported."""
    if kind == "MemoryError":
        return MemoryError(text)
    named = getattr(errors, kind, None)
    if not (isinstance(named, type) and issubclass(named, errors.FourpoleError)):
        return RuntimeError(text)
    error = named(text)
    error.raised_at = site
    return error


def answer_of(function: Callable[..., Any], *args: Any, **settings: Any) -> bytes:
    """The answer of this thread's worker, see `Child.call`; after a death another worker is asked once.

    Died if there is no answer.
    """
    try:
        return child().call(function, *args, **settings)
    except Late:
        raise
    except Died:
        return child().call(function, *args, **settings)


def is_guarded(kind: Format, size: int) -> bool:
    """Whether a file of a format and size [byte] is read in a worker process."""
    return kind.by_library or size > OWN_BYTES


def read_apart(
    function: Callable[..., Any],
    path: Path,
    *args: Any,
    classes: Iterable[type] = (),
    label: str | None = None,
    progress: Progress | None = None,
) -> Any:
    """The result of a function that reads a file, run in the worker of this thread if the file is read in one.

    Parameters
    ----------
    function : callable
        A function at the top of a module; its first argument is the path.
    path : Path
        The file.
    classes : iterable of type
        The classes of which the result is made.
    label : str, optional
        The file's name in messages; by default the last part of the path.
    progress : callable, optional
        The argument of this name that the function has.

    Raises
    ------
    FileError
        If no worker answers, or the file cannot be opened.
    """
    told = {} if progress is None else {"progress": progress}
    kind, size = format_of(path, max_bytes=MAX_FILE_BYTES, label=label), path.stat().st_size
    if not is_guarded(kind, size):
        return function(path, *args, **told)
    try:
        most = size + min(SPARE, _SMALL + _UNPACKED * size)
        answer = answer_of(function, path, *args, size=size, spare=most, progress=progress)
    except Died as death:
        raise errors.FileError(f"{name_of(path, label)} {death}; {death.remedy}") from None
    return unpack(bytearray(answer), classes)  # arrays on a bytearray can be written
