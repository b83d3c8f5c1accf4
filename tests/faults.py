"""Commands whose n-th call of the system fails, or kills them: `python -m tests.faults` goes through every n.

strace lets one call of a command fail (https://strace.io: `inject=...:when=n`). It sees every call, also those of
libraries, and neither the command nor Python knows of it. Only calls below the campaign are chosen: what Python or the
C library does elsewhere is not ours.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from tests.forked import CALLS, CHANGING, KILLED, NAMING, ROOT, WRITING, Call, Commands, Run, commands

from fourpole.errors import FourpoleError
from fourpole.io.published import LIST, STORE, published, without_list
from fourpole.virtual import RADIAL_PLY, simulate_campaign

#: What happens at a call: the process is killed, or the call fails; with a full disk, so do all that write from there.
KINDS: Mapping[str, Sequence[str]] = {
    "SIGKILL": CHANGING,
    "EIO": CALLS,
    "EACCES": NAMING,
    "ENOSPC": (*WRITING, "openat", "rename", "renameat", "renameat2", "fsync"),
    "full": WRITING,
}


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


FORMER = {"dynamic.csv": "former", "gone.csv": "former", "figures/a.svg": "former"}
NEW = {"dynamic.csv": "new", "figures/a.svg": "new", "figures/b.svg": "also new"}


def publish(words: Sequence[str], files: Mapping[str, str] = NEW) -> None:
    """Publish a few files over the former results of a campaign, as a command does that ends with one message."""
    import typer

    from fourpole.app.console import run_to_exit, show_warnings
    from fourpole.io.published import publishing

    def write() -> None:
        with publishing(Path(words[0], "results"), ["gone.csv", "never.csv"]) as new:
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
        if "results stand" in run.err:  # nothing was written, so what could not be deleted waits for the next writer
            kept = {name for name in kept if not name.startswith("new-")}
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
        publish([str(results.parent)], FORMER)
    modules = ["fourpole.app.console", "fourpole.io.published", "rich.console", "rich.markup", "tests.faults", "typer"]
    with commands(modules) as loaded:
        yield Experiment.of(loaded, results.parent, "tests.faults:publish", "campaign")


@contextmanager
def analysis_experiment(folder: Path) -> Iterator[Experiment]:
    """A campaign is analysed over results of other inputs, of which the cache has two recordings of three."""
    campaign, words = folder / "template", ("--tables-only", "--workers", "1")
    simulate_campaign(campaign, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 14.0])
    with commands() as fresh:
        analysed = fresh.run("tests.forked:loaded", "analyse", campaign, *words)
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
    sys.exit(main())
