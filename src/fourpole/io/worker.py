"""The worker process: takes one piece of work after the other from its standard input and answers on standard output.

It is started by `fourpole.io.child`, which also says what a worker may need. Whatever a file does to the libraries that
read it happens here: a crash ends this process alone, memory and time are limited.

- Work is the name of a function of Fourpole with arguments, or several of them. Both they and the answers are made by
  `packed`, so that neither side makes any object but those that the function's module lists in `OF_WORK`. The answers
  to one message leave together: the parent shares the processors with its workers, and each time it wakes costs both.
- Limited is processor time, not the time of the clock, which says nothing on a busy machine: by the system
  (RLIMIT_CPU), on Windows by a thread that looks at it.
- A worker that makes no progress ends: on Linux the parent sees that it takes no processor time; elsewhere the watch of
  `faulthandler`, a thread of C, ends the process unless the thread that looks sees progress.
- Memory is limited by the system on Linux (RLIMIT_DATA); elsewhere the same thread looks at the memory in use.
- When the parent ends, standard input ends, and so does the worker.
"""

from __future__ import annotations

import faulthandler
import math
import os
import queue
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from fourpole.errors import FourpoleError, out_of_memory
from fourpole.io.packed import pack, unpack
from fourpole.io.processes import FOLDERS

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

#: Exit codes of a worker that used more memory or processor time than it may; that of `faulthandler` is 1.
TOO_MUCH, TOO_LATE = 77, 78
#: A worker that takes less processor time than this [s] between two looks or more makes no progress.
STILL = 0.05
#: A worker without work ends after this time [s].
_IDLE = 300.0
#: Interval at which the memory is looked at where the system has no limit [s].
_LOOK = 0.1
#: Time after which work ends in any case whose parent was killed while a library holds Python and stands still [s].
_FORSAKEN = 86400.0
#: Size of a block [byte] after whose release malloc of glibc keeps smaller ones; to ask the system for each anew takes
#: a tenth of the time of a Parquet recording.
_KEPT = 1 << 22
#: Answers of more bytes leave before all others are there.
_HELD = 1 << 20
#: Length of a message's own length [byte].
_LENGTH = 8


class Readable(Protocol):
    """What gives bytes, fewer than are asked for only at its end."""

    def read(self, count: int, /) -> bytes:
        """So many bytes."""


def send(pipe: BinaryIO, message: bytes, *, more: bool = False) -> None:
    """Write a message, its length first; it leaves at once unless there will be `more`."""
    pipe.write(len(message).to_bytes(_LENGTH, "little") + message)
    if not more:
        pipe.flush()


def receive(pipe: Readable) -> bytes | None:
    """The next message; None at the end of the pipe."""
    head = pipe.read(_LENGTH)
    if len(head) < _LENGTH:
        return None
    length = int.from_bytes(head, "little")
    message = pipe.read(length)
    return message if len(message) == length else None


def main() -> None:
    """Answer until the parent ends."""
    answers = _private_output()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    _first_to_go()
    bytearray(_KEPT)
    work: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(os.fdopen(os.dup(0), "rb"), work), daemon=True).start()
    limits = _Limits()
    while True:
        limits.watch(_IDLE)
        module, name, tells, pieces = unpack(work.get())
        for content, seconds, patience, spare in pieces:
            limits.watch(patience if limits.by_thread else _FORSAKEN + seconds)
            home = import_module(module)
            function, args = getattr(home, name), unpack(content, getattr(home, "OF_WORK", ()))
            if tells:
                function = partial(function, progress=lambda done, total: send(answers, b"P" + pack((done, total))))
            limits.allow(seconds, spare)
            answer = _answered(function, args)
            limits.allow(None, None)
            send(answers, answer, more=True)
        answers.flush()


def _answered(function: Callable[..., Any], args: tuple[Any, ...]) -> bytes:
    """The answer to a piece of work: its result, or the error that it raised."""
    try:
        result = function(*args)
        return b"R" + (result if isinstance(result, bytes) else pack(result))
    except FourpoleError as error:
        return b"E" + pack((type(error).__name__, str(error), error.site))
    except Exception as error:  # noqa: BLE001 - the parent says that this is a fault of ours
        if out_of_memory(error):
            return b"E" + pack(("MemoryError", "", ""))
        return b"E" + pack(("Exception", f"{type(error).__name__}: {error}", ""))


def _private_output() -> BinaryIO:
    """Standard output for answers alone: what a library prints goes nowhere."""
    answers = os.fdopen(os.dup(1), "wb", _HELD)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    if not os.environ.get("FOURPOLE_DEBUG"):
        os.dup2(nowhere, 2)
    return answers


def _listen(pipe: BinaryIO, work: queue.SimpleQueue[bytes]) -> None:
    """Pass the messages on; at the end of the pipe the process ends, even in the middle of its work."""
    while (message := receive(pipe)) is not None:
        work.put(message)
    with suppress(OSError):  # a parent that was killed does not delete the folder that it made
        folder = Path.cwd()
        os.chdir(folder.parent)
        if folder.name.startswith(FOLDERS):
            folder.rmdir()
    os._exit(0)


def _first_to_go() -> None:
    """Ask Linux to end this process before any other if the machine has no more memory."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")


class _Limits:
    """The limits of this process: memory above what it had before, processor time, and standing still."""

    def __init__(self) -> None:
        self.by_thread = not sys.platform.startswith("linux")
        self._nowhere = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - open as long as the process
        self._patience = _IDLE
        self._most: int | None = None
        self._latest: float | None = None
        if resource is not None:  # a process that is ended for its time leaves no image of its memory
            resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
        if self.by_thread:
            threading.Thread(target=self._look, daemon=True).start()

    def watch(self, patience: float) -> None:
        """End this process after a time [s], unless this is called again before."""
        self._patience = patience
        faulthandler.dump_traceback_later(patience, exit=True, file=self._nowhere)

    def allow(self, seconds: float | None, spare: int | None) -> None:
        """Allow this much processor time [s] from now on, and memory [byte] beyond what it has, or any."""
        latest = None if seconds is None else time.process_time() + seconds
        if resource is not None:
            _limit(resource.RLIMIT_CPU, None if latest is None else math.ceil(latest))
        if self.by_thread:
            self._most = None if spare is None else memory_in_use() + spare
            self._latest = latest
        else:
            _limit(resource.RLIMIT_DATA, None if spare is None else _data() + spare)

    def _look(self) -> None:
        seen = 0.0
        while True:
            time.sleep(_LOOK)
            most, latest, taken = self._most, self._latest, time.process_time()
            if most is not None and memory_in_use() > most:
                os._exit(TOO_MUCH)
            if latest is None:
                continue
            if taken > latest:
                os._exit(TOO_LATE)
            if taken > seen + STILL:
                seen = taken
                self.watch(self._patience)


def _limit(kind: int, most: int | None) -> None:
    """Set a limit of this process; None for the highest that it may have."""
    hard = resource.getrlimit(kind)[1]
    unlimited = hard == resource.RLIM_INFINITY
    with suppress(ValueError, OSError):
        resource.setrlimit(kind, (hard if most is None else most if unlimited else min(most, hard), hard))


def _data() -> int:
    """Memory of this process on Linux that it may write [byte], without the libraries, which are on the disk."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    return pages * os.sysconf("SC_PAGE_SIZE")


def memory_in_use() -> int:
    """Resident memory of this process [byte]: on Windows that in use, on others the most so far."""
    if sys.platform == "win32":
        import ctypes

        class Counters(ctypes.Structure):
            _fields_ = [
                ("size", ctypes.c_uint32),
                ("faults", ctypes.c_uint32),
                *((name, ctypes.c_size_t) for name in ("peak", "in_use", "a", "b", "c", "d", "pages", "peak_pages")),
            ]

        counters = Counters(size=ctypes.sizeof(Counters))
        kernel = ctypes.windll.kernel32
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        kernel.K32GetProcessMemoryInfo(
            ctypes.c_void_p(kernel.GetCurrentProcess()), ctypes.byref(counters), counters.size
        )
        return int(counters.in_use)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


if __name__ == "__main__":
    main()
