"""Commands in children of one process that has all modules loaded; strace may count their calls.

The calls of the first thread are counted: those of the threads of libraries are not ours.
"""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TextIO

ROOT = Path(__file__).resolve().parents[1]
#: Calls that write; calls that name a file; all that change or read files and folders.
WRITING = ("write", "pwrite64", "sendfile", "copy_file_range", "mkdir", "mkdirat")
NAMING = ("openat", "rename", "renameat", "renameat2", "unlink", "unlinkat", "mkdir", "mkdirat", "rmdir")
CHANGING = (*WRITING, *NAMING, "fsync", "fdatasync", "ftruncate", "truncate", "link", "linkat", "symlinkat", "chmod")
CALLS = (
    *CHANGING,
    "read",
    "pread64",
    "stat",
    "lstat",
    "newfstatat",
    "fstat",
    "statx",
    "getdents64",
    "flock",
    "readlink",
)
KILLED = -9


class Call(NamedTuple):
    """A call of the system: its name, its number among those of this name, and its line in the log."""

    name: str
    number: int
    line: str


@dataclass(frozen=True)
class Run:
    """How a command ended: exit code, standard output and error, and its calls."""

    code: int
    out: str
    err: str
    log: Sequence[str] = ()

    def calls(self, below: Path) -> list[tuple[Call, Mapping[str, int]]]:
        """The calls of the command below a folder, each with the number of calls of each name before it."""
        counts: Counter[str] = Counter()
        found = []
        for line in self.log:
            if begun := re.match(r"(\w+)\(", line):
                before = dict(counts)
                counts[begun[1]] += 1
                if str(below) in line:
                    found.append((Call(begun[1], counts[begun[1]], line), before))
        return found

    def struck(self, below: Path) -> bool:
        """Whether the fault came at a call below the folder."""
        return any(str(below) in line for line in self.log if "(INJECTED)" in line) or self.code == KILLED


class Commands:
    """Runs commands of Fourpole in children of one process that has all modules loaded."""

    def __init__(self, line: TextIO, folder: Path) -> None:
        self._line, self._log = line, folder / "log"
        self.cpu = 0.0  # of all commands [s]

    def run(self, *command: str | Path, injections: Sequence[str] | None = None) -> Run:
        """Run a command; with injections, even none, its calls are counted and logged."""
        process = self._ask([str(word) for word in command])
        with self._traced(process, injections) if injections is not None else nullcontext():
            *done, self.cpu = self._ask("go")
        return Run(*done, self._log.read_text(errors="replace").splitlines() if injections is not None else ())

    def _ask(self, asked: Any) -> Any:
        self._line.write(json.dumps(asked) + "\n")
        self._line.flush()
        return json.loads(self._line.readline())

    @contextmanager
    def _traced(self, process: int, injections: Sequence[str]) -> Iterator[None]:
        """Attach strace to the first thread of a process; those of libraries are not counted."""
        words = ["-y", "-s", "300", "-o", str(self._log), "-e", "trace=" + ",".join(f"?{name}" for name in CALLS)]
        words += [word for injection in injections for word in ("-e", f"inject={injection}")]
        with subprocess.Popen(["strace", *words, "-p", str(process)], stderr=subprocess.PIPE, text=True) as strace:
            assert strace.stderr is not None
            said = strace.stderr.readline()
            assert " attached" in said, said
            yield


@contextmanager
def commands(modules: Sequence[str] = ()) -> Iterator[Commands]:
    """A process that runs commands; it has loaded these modules."""
    here, there = socket.socketpair()
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1", "COLUMNS": "1000"}
    command = [sys.executable, "-m", "tests.forked", str(there.fileno())]
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(here)
        line = stack.enter_context(here.makefile("rw", encoding="utf-8"))
        stack.enter_context(subprocess.Popen(command, cwd=ROOT, env=environment, pass_fds=[there.fileno()]))
        stack.callback(here.shutdown, socket.SHUT_RDWR)
        there.close()
        line.write(json.dumps(list(modules)) + "\n")
        line.flush()
        yield Commands(line, folder)


# ---- the process that forks


def serve(descriptor: int) -> None:
    """Fork a child for each command; all that is said goes through sockets, whose calls are not among `CALLS`."""
    with socket.socket(fileno=descriptor) as asked, asked.makefile("rw", encoding="utf-8") as lines:
        for name in json.loads(lines.readline()):
            with suppress(ImportError):
                __import__(name)
        while command := lines.readline():
            serve_one(json.loads(command), lines)


def serve_one(command: Sequence[str], lines: TextIO) -> None:
    """Fork a child, say its number, let it begin when that is asked, and say how it ended."""

    def answer(said: Any) -> None:
        lines.write(json.dumps(said) + "\n")
        lines.flush()

    (out, out_there), (err, err_there), (gate, gate_there) = (socket.socketpair() for _ in range(3))
    process = os.fork()
    if process == 0:
        code = 70
        try:
            sys.stdout, sys.stderr = out_there.makefile("w"), err_there.makefile("w")
            allow_tracing()
            gate_there.send(b"?")
            gate_there.recv(1)
            code = called(command)
        except BaseException:  # noqa: BLE001 - the child ends here, whatever happened
            sys.excepthook(*sys.exc_info())
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    gate.recv(1)
    answer(process)
    lines.readline()
    gate.send(b"!")
    for there in (out_there, err_there, gate_there):
        there.close()
    said = [b"".join(iter(lambda: end.recv(65536), b"")).decode() for end in (out, err)]  # noqa: B023
    for end in (out, err, gate):
        end.close()
    answer([os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), *said, sum(os.times()[:4])])


def allow_tracing() -> None:
    """Let strace attach to this process, also where by default only those above it may."""
    import ctypes

    ctypes.CDLL(None).prctl(0x59616D61, ctypes.c_ulong(2**64 - 1), 0, 0, 0)  # PR_SET_PTRACER, PR_SET_PTRACER_ANY


def called(command: Sequence[str]) -> int:
    """Run a command, or a function by its module and name, in this process; returns its exit code."""
    sys.argv = ["fourpole", *command]
    try:
        if ":" in command[0]:
            module, _, name = command[0].partition(":")
            getattr(import_module(module), name)(command[1:])
        else:
            from fourpole.__main__ import main

            main()
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


def loaded(command: Sequence[str]) -> None:
    """Run a command, and print the modules that are loaded then."""
    called(command)
    sys.stdout.write("\n" + json.dumps(sorted(sys.modules)))


if __name__ == "__main__":
    serve(int(sys.argv[1]))
