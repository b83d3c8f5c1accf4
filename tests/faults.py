"""Commands whose n-th call of the system fails, or kills them: `python -m tests.faults` goes through every n.

A process with all modules loaded forks a child for each command. strace is attached to it, counts the calls of the
child, and lets one of them fail (https://strace.io: `inject=...:when=n`). It sees every call, also those of libraries,
and neither the command nor Python knows of it. Only calls below the campaign are chosen: what Python or the C library
does elsewhere is not ours.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from fourpole.errors import FourpoleError
from fourpole.io.published import LIST, STORE, published, without_list
from fourpole.virtual import RADIAL_PLY, simulate_campaign

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
#: What happens at a call: the process is killed, or the call fails; with a full disk, so do all that write from there.
KINDS: Mapping[str, Sequence[str]] = {
    "SIGKILL": CHANGING,
    "EIO": CALLS,
    "EACCES": NAMING,
    "ENOSPC": (*WRITING, "openat", "rename", "renameat", "renameat2", "fsync"),
    "full": WRITING,
}
KILLED = -9


class Call(NamedTuple):
    """A call of the system: its name, its number among those of this name, and its line in the log."""

    name: str
    number: int
    line: str


class Fault(NamedTuple):
    """What happens at a call: a kind of `KINDS`, and how many calls of each name were before it."""

    kind: str
    call: Call
    before: Mapping[str, int]

    @property
    def injections(self) -> list[str]:
        if self.kind == "full":
            return [f"?{name}:error=ENOSPC:when={self.before.get(name, 0) + 1}+" for name in WRITING]
        said = "signal=SIGKILL" if self.kind == "SIGKILL" else f"error={self.kind}"
        return [f"{self.call.name}:{said}:when={self.call.number}"]

    def __str__(self) -> str:
        return f"{self.kind} at {self.call.name} {self.call.number}, {self.call.line}"


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
    command = [sys.executable, "-m", "tests.faults", "--serve", str(there.fileno())]
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
    """Run a command in this process; returns its exit code."""
    sys.argv = ["fourpole", *command]
    try:
        if command[0] == "publish":
            publish(Path(command[1], "results"))
        elif command[0] == "modules":
            called(command[1:])
            sys.stdout.write("\n" + json.dumps(sorted(sys.modules)))
        else:
            from fourpole.__main__ import main

            main()
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


FORMER = {"dynamic.csv": "former", "gone.csv": "former", "figures/a.svg": "former"}
NEW = {"dynamic.csv": "new", "figures/a.svg": "new", "figures/b.svg": "also new"}


def publish(folder: Path, files: Mapping[str, str] = NEW) -> None:
    """Publish a few files over the former results, as a command does that ends with one message."""
    import typer

    from fourpole.app.console import run_to_exit, show_warnings
    from fourpole.io.published import publishing

    def write() -> None:
        with publishing(folder, ["gone.csv", "never.csv"]) as new:
            for name, text in {**files, LIST: json.dumps({"title": files["dynamic.csv"]})}.items():
                (new / name).parent.mkdir(exist_ok=True)
                (new / name).write_text(text)

    show_warnings()
    try:
        run_to_exit(write)
    except typer.Exit as ended:
        raise SystemExit(ended.exit_code) from None


# ---- what must hold afterwards


def faults_of(counted: Run, below: Path) -> list[Fault]:
    """Every kind of fault at every call of a command below a folder, in the order of the calls.

    Opening a file that is there changes nothing: so no process is killed there, and no disk is too full for it.
    """
    return [
        Fault(kind, call, before)
        for call, before in counted.calls(below)
        for kind, names in KINDS.items()
        if call.name in names and (call.name != "openat" or kind in ("EIO", "EACCES") or "O_CREAT" in call.line)
    ]


class Content(NamedTuple):
    """What a reader takes of results: the listed files, and study.json without what names the moment."""

    files: Mapping[str, bytes]
    record: Mapping[str, Any]


def content_of(results: Path) -> Content:
    """The results as a reader takes them; a warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = published(results)
        files = {name: found.read(name) for name in found.files or ()}
    return Content(files, without_list(found.record))


def usual(results: Path) -> dict[str, bytes]:
    """The files under their usual names, and whatever else lies there but the store, the cache and study.json."""
    names = {path.relative_to(results): path for path in results.rglob("*") if path.is_file()}
    others = (STORE, "cache", LIST)
    return {str(name): path.read_bytes() for name, path in names.items() if name.parts[0] not in others}


@dataclass(frozen=True)
class Experiment:
    """A command over former results, which is disturbed again and again in a copy of one folder.

    Attributes
    ----------
    commands : Commands
        Where it runs.
    template, folder : Path
        The folder with the former results, and its copy.
    command : sequence of str
        The command.
    former, new : Content
        What a reader takes before the command, and after it.
    lying : mapping of str to bytes
        The files under their usual names after the command.
    counted : Run
        The command without a fault.
    """

    commands: Commands
    template: Path
    folder: Path
    command: Sequence[str]
    former: Content
    new: Content
    lying: Mapping[str, bytes]
    counted: Run

    @classmethod
    def of(cls, commands: Commands, template: Path, *command: str) -> Experiment:
        """The experiment of a command on a campaign or results; "campaign" stands for the folder's path in it."""
        folder = template.with_name("disturbed")
        words = [str(folder) if word == "campaign" else word for word in command]
        renew(template, folder)
        counted = commands.run(*words, injections=[])
        assert counted.code == 0, counted.err
        results = folder / "results"
        former, new = content_of(template / "results"), content_of(results)
        assert former != new
        return cls(commands, template, folder, words, former, new, usual(results), counted)

    @property
    def faults(self) -> list[Fault]:
        return faults_of(self.counted, self.folder)

    def complaint(self, fault: Fault) -> str:
        """What does not hold after a fault; empty if all does."""
        renew(self.template, self.folder)
        run = self.commands.run(*self.command, injections=fault.injections)
        said = self._wrong(run) or self._wrong_again() if run.struck(self.folder) else "the fault did not come"
        return said and f"{fault}: {said}\n  exit code {run.code}: {run.err.strip()}"

    def _wrong(self, run: Run) -> str:
        """What does not hold after the command."""
        errors = [line for line in run.err.splitlines() if line.startswith("error:")]
        if run.code not in (0, 2, 3, KILLED) or "Traceback" in run.err:
            return "no exit code of a message"
        if len(errors) != (run.code == 2):
            return "not one message"
        try:
            found = content_of(self.folder / "results")
        except (FourpoleError, Warning) as error:
            return f"a reader is refused: {error}"
        if run.code == 3:  # a recording could not be read: the new results say it
            return ""
        if found not in (self.former, self.new):
            return "a reader finds neither the former nor the new results"
        if run.code == 0 and found != self.new:
            return "the command ended well, and the results are the former ones"
        if "former ones" in run.err and found != self.former:
            return "the message says that the results are the former ones, and they are new"
        return ""

    def _wrong_again(self) -> str:
        """What does not hold after the same command without a fault."""
        here = content_of(self.folder / "results")
        run = self.commands.run(*self.command)
        if run.code:
            return f"a second run ends with {run.code}: {run.err}"
        if content_of(self.folder / "results") != self.new:
            return "a second run does not give the new results"
        if usual(self.folder / "results") != self.lying:
            return f"a second run leaves other files: {sorted(usual(self.folder / 'results'))}"
        kept = {path.name for path in (self.folder / "results" / STORE).iterdir()}
        known = {
            hashlib.sha256(file).hexdigest() for one in (here, self.former, self.new) for file in one.files.values()
        }
        return f"the store keeps {sorted(kept - known)}" if kept - known else ""


def renew(template: Path, folder: Path) -> None:
    """Make a folder a copy of the template again."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(template, folder)


@contextmanager
def publishing_experiment(folder: Path) -> Iterator[Experiment]:
    """A few files are published over former results."""
    results = folder / "template" / "results"
    results.mkdir(parents=True)
    (results / "mine.txt").write_text("mine")
    with suppress(SystemExit):
        publish(results, FORMER)
    with commands(["fourpole.app.console", "fourpole.io.published", "rich.console", "rich.markup", "typer"]) as loaded:
        yield Experiment.of(loaded, results.parent, "publish", "campaign")


@contextmanager
def analysis_experiment(folder: Path) -> Iterator[Experiment]:
    """A campaign is analysed over results of other inputs, of which the cache has two recordings of three."""
    campaign, words = folder / "template", ("--tables-only", "--workers", "1")
    simulate_campaign(campaign, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 14.0])
    with commands() as fresh:
        analysed = fresh.run("modules", "analyse", campaign, *words)
    recording = campaign / "recordings" / "D2.csv"
    recording.write_text("".join(recording.read_text().splitlines(keepends=True)[:-100]))
    with commands(json.loads(analysed.out.splitlines()[-1])) as loaded:
        yield Experiment.of(loaded, campaign, "analyse", "campaign", *words)


# ---- every n


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main() -> int:
    """Go through the faults of both experiments that were not yet tried, as far as the time allows."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description="Disturb two commands at every call.")
    parser.add_argument("--minutes", type=float, default=20.0, help="CPU time of the commands; by default 20")
    parser.add_argument("--state", type=Path, default=ROOT / "build" / "faults.json", help="where to go on")
    asked = parser.parse_args()
    sources = sorted((ROOT / "src").rglob("*.py"))
    mark = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    state = {"sources": mark, "publish": 0, "analyse": 0}
    with suppress(OSError, ValueError):
        kept = json.loads(asked.state.read_text())
        state = kept if kept["sources"] == mark else state
    asked.state.parent.mkdir(parents=True, exist_ok=True)
    spent, wrong = 0.0, 0
    for name, experiment in (("publish", publishing_experiment), ("analyse", analysis_experiment)):
        with tempfile.TemporaryDirectory() as folder, experiment(Path(folder)) as made:
            faults = made.faults
            for number in range(state[name], len(faults)):
                if spent + made.commands.cpu > 60 * asked.minutes:
                    break
                if said := made.complaint(faults[number]):
                    wrong += 1
                    say(f"{name} {number}: {said.replace(folder, '')}")
                state[name] = number + 1
                asked.state.write_text(json.dumps(state))
            spent += made.commands.cpu
            say(f"{name}: {state[name]} of {len(faults)} faults were tried, {spent:.0f} s of CPU time so far")
    say(f"{wrong} of them broke a promise" if wrong else "every promise held")
    return bool(wrong)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(int(sys.argv[2]))
    else:
        sys.exit(main())
