"""Commands that a page may start, and the jobs that run them in processes of their own, with their events."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fourpole.errors import CampaignError
from fourpole.io.processes import interrupt, running_module
from fourpole.served.workspace import Place
from fourpole.units import shown

#: Longest value of an option.
_LONGEST = 200


@dataclass(frozen=True)
class AskedOption:
    """An option of a command.

    Attributes
    ----------
    name : str
        As the command line has it, as "--wanted".
    help : str
    flag : bool
        Whether it takes no value.
    needed : bool
        Whether the command cannot do without it.
    """

    name: str
    help: str
    flag: bool
    needed: bool = False


@dataclass(frozen=True)
class Asked:
    """A command.

    Attributes
    ----------
    name : str
    about : str
        What it does, in a sentence.
    options : tuple of AskedOption
    """

    name: str
    about: str
    options: tuple[AskedOption, ...]

    def words(self, stated: Mapping[str, str]) -> list[str]:
        """The options of the command line for what a form states; each value is part of one word."""
        words = []
        for one in self.options:
            value = stated.get(one.name.strip("-"), "").strip()
            if len(value) > _LONGEST or not value.isprintable():
                raise CampaignError(f"{one.name}: {shown(value)} is no value")
            if value:
                words.append(one.name if one.flag else f"{one.name}={value}")
        return words


def asked_named(commands: Sequence[Asked], name: str) -> Asked:
    """The command of a name; CampaignError if a page may not start it."""
    found = next((one for one in commands if one.name == name), None)
    if found is None:
        raise CampaignError(f"no command {shown(name)} can be started here")
    return found


#: The sign before an event, and the variable that asks for events; see fourpole.app.events.
_MARK, _EVENTS = "\x1e", "FOURPOLE_EVENTS"
#: Messages and tests that are kept, largest document of a command [byte], finished jobs, and judgements.
_MOST_MESSAGES, _MOST_TESTS, _MOST_DOCUMENT, _MOST_DONE, _MOST_JUDGED = 200, 20_000, 20_000_000, 100, 500
#: Longest line of a command [byte].
_LINE = 4_000_000


class Phase(StrEnum):
    """How far a job is."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(eq=False)
class Job:
    """A command of a campaign.

    Attributes
    ----------
    place : Place
        The campaign.
    words : tuple of str
        The command's arguments but the last, the name of the command first.
    path : Path
        Its last argument: the folder of the campaign, or a file in it.
    folder : TemporaryDirectory or None
        A folder of its own for the files that it makes, which goes with the job.
    task : dict
        The last progress: task, done, total, left [s].
    tests : dict of str to dict
        Each test as it was reduced: verdict and remarks.
    judged : deque of dict
        Judgements of a watch, the last ones.
    together : deque of str
        What a watch says of all tests together.
    error : str
        The error with which the command ended; empty without one.
    messages : deque of str
        What the command said on standard error.
    document : dict
        The JSON document that it printed.
    answer : list
        Its answer for a reader: lines, and tables with heads, rows and the heads of numbers.
    files : list of Path
        The files that it made.
    code : int or None
        Its exit code.
    """

    place: Place
    words: tuple[str, ...]
    path: Path
    folder: TemporaryDirectory[str] | None = None
    phase: Phase = Phase.WAITING
    task: dict[str, Any] = field(default_factory=dict)
    tests: dict[str, dict[str, Any]] = field(default_factory=dict)
    judged: deque[dict[str, Any]] = field(default_factory=lambda: deque(maxlen=_MOST_JUDGED))
    together: deque[str] = field(default_factory=lambda: deque(maxlen=_MOST_MESSAGES))
    error: str = ""
    messages: deque[str] = field(default_factory=lambda: deque(maxlen=_MOST_MESSAGES))
    document: Any = None
    answer: list[Any] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    code: int | None = None
    _changed: asyncio.Condition = field(default_factory=asyncio.Condition, repr=False)
    _process: asyncio.subprocess.Process | None = field(default=None, repr=False)
    _asked: bool = field(default=False, repr=False)

    @property
    def name(self) -> str:
        """Name of the command."""
        return self.words[0]

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.phase not in (Phase.WAITING, Phase.RUNNING)

    async def changes(self) -> AsyncIterator[None]:
        """A step for each change, the first at once, the last when the job is over."""
        over = False
        while not over:
            over = self.over
            yield
            if not self.over:
                async with self._changed:
                    with suppress(TimeoutError):
                        await asyncio.wait_for(self._changed.wait(), 15)

    async def tell(self) -> None:
        """Wake those who wait for a change."""
        async with self._changed:
            self._changed.notify_all()

    def stop(self) -> None:
        """End it as Ctrl-C does: nothing is half-written, and what is done is kept."""
        self._asked = True
        if self.phase is Phase.WAITING:
            self.phase = Phase.STOPPED
        elif self._process is not None and self._process.returncode is None:
            interrupt(self._process)

    def forget(self) -> None:
        """Delete the folder of its own."""
        if self.folder is not None:
            self.folder.cleanup()


class Jobs:
    """The jobs of a server: as many at a time as it has processors, the others wait their turn.

    `events` are those that the commands tell; see fourpole.app.events.
    """

    def __init__(self, at_once: int, events: str = "1") -> None:
        self._turn, self._events = asyncio.Semaphore(at_once), events
        self._jobs: dict[str, Job] = {}
        self._running: set[asyncio.Task[None]] = set()

    def of(self, place: Place) -> Job | None:
        """The last job of a campaign."""
        return self._jobs.get(place.key)

    def making(self, key: str) -> Place | None:
        """The place of a job that is not over, whose campaign need not be there yet."""
        job = self._jobs.get(key)
        return None if job is None or job.over else job.place

    def before(self, job: Job) -> int:
        """Number of jobs that were asked for before a waiting one and are not over."""
        others = list(self._jobs.values())
        return sum(not one.over for one in others[: others.index(job)])

    def start(
        self, place: Place, *words: str, path: Path | None = None, folder: TemporaryDirectory[str] | None = None
    ) -> Job:
        """Start a command on a campaign, or on a file in it; where one is running there, that job."""
        former = self._jobs.pop(place.key, None)
        if former is not None and not former.over:
            self._jobs[place.key] = former
            return former
        if former is not None:
            former.forget()
        job = self._jobs[place.key] = Job(place, words, path or place.folder, folder)
        for key in [key for key, one in self._jobs.items() if one.over][:-_MOST_DONE]:
            self._jobs.pop(key).forget()
        task = asyncio.create_task(self._run(job))
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        return job

    async def close(self) -> None:
        """End all jobs, and wait for them."""
        for job in self._jobs.values():
            job.stop()
        if self._running:
            await asyncio.wait(self._running, timeout=10)
        for job in self._jobs.values():
            job.forget()

    async def _run(self, job: Job) -> None:
        async with self._turn:
            if job.phase is Phase.WAITING:
                job.phase = Phase.RUNNING
                await job.tell()
                await _run(job, self._events)
        await job.tell()


async def _run(job: Job, events: str) -> None:
    """Run the command of a job to its end, with these events."""
    words = (*job.words, str(job.path.absolute()), "--json")
    try:
        async with running_module(
            "fourpole", *words, variables={_EVENTS: events, "NO_COLOR": "1"}, limit=_LINE
        ) as process:
            job._process = process  # noqa: SLF001 - the job is this module's own
            if job._asked:  # noqa: SLF001 - while the process was made, and has done nothing yet
                process.kill()
            printed, _ = await asyncio.gather(_printed(process), _said(process, job))
            job.code = await process.wait()
    except (OSError, ValueError) as error:
        job.error = f"the command could not be run: {error}"
        job.messages.append(f"error: {job.error}")
        job.phase = Phase.FAILED
        return
    with suppress(ValueError):
        job.document = json.loads(printed)
    stopped = job.code in (130, 143) or job.code < 0
    job.phase = Phase.DONE if job.code in (0, 3) else Phase.STOPPED if stopped else Phase.FAILED


async def _printed(process: asyncio.subprocess.Process) -> bytes:
    """What a command prints, up to a limit; the rest is read and forgotten."""
    assert process.stdout is not None
    parts: list[bytes] = []
    size = 0
    while part := await process.stdout.read(1 << 16):
        size += len(part)
        if size <= _MOST_DOCUMENT:
            parts.append(part)
    return b"".join(parts)


async def _said(process: asyncio.subprocess.Process, job: Job) -> None:
    """Take the events and messages of a command as they come."""
    assert process.stderr is not None
    async for line in process.stderr:
        text = line.decode(errors="replace").rstrip()
        if text.startswith(_MARK):
            with suppress(ValueError, KeyError, TypeError):
                _take(job, json.loads(text[1:]))
        elif text:
            job.messages.append(text[:2000])
        await job.tell()


def _take(job: Job, event: dict[str, Any]) -> None:
    if "task" in event or "watching" in event:
        job.task = event
    elif "judged" in event:
        job.judged.append(event["judged"])
    elif "answer" in event:
        job.answer += event["answer"]
        job.files += map(Path, event["files"])
    elif "together" in event:
        job.together.append(str(event["together"]))
    elif "error" in event:
        job.error = str(event["error"])
    elif "test" in event and len(job.tests) < _MOST_TESTS:
        job.tests[str(event["test"])] = {"verdict": event["verdict"], "remarks": event["remarks"]}
