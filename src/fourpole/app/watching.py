"""The command that judges each recording as a logger writes it."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from fourpole import quantities as q
from fourpole.answer import Answer
from fourpole.app import events
from fourpole.app.console import counted_tests, say
from fourpole.core.checks import Verdict
from fourpole.errors import TableError
from fourpole.io.documents import json_of
from fourpole.io.processes import DEVNULL, Process, interrupt, start_module
from fourpole.quantities import ShownUnits
from fourpole.report.rows import DYNAMIC, STATIC, condition, words
from fourpole.study.watch import Watch, WatchedFile

#: Time between two looks [s].
_EVERY = 0.5
#: Time without a new recording after which all tests are analysed together [s].
_QUIET = 5.0
_MARKS: dict[str, str] = {Verdict.OK: "ok", Verdict.WARNING: "WARNING", Verdict.REJECTED: "REJECTED"}


def run_watch(campaign: Path) -> Answer:
    """Judge each new recording until Ctrl-C: an answer each."""
    watch = Watch(campaign)
    watch.warm()
    return Answer(then=lambda: _judgements(watch, campaign))


def _judgements(watch: Watch, campaign: Path) -> Iterator[Answer]:
    events.tell(watching=str(campaign))
    say(f"watching {campaign}; Ctrl-C ends it")
    joint = _Joint(campaign)
    try:
        while True:
            new = False
            for one in watch.look():
                new = True
                events.tell(judged=document(one))
                yield Answer(_lines(one), partial(document, one))
            for text in joint.follow(new):
                events.tell(together=text)
                say(text)
            time.sleep(_EVERY)
    finally:
        joint.stop()


class _Joint:
    """The analysis of all tests, in a process of its own whenever new ones are judged and no more come."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._last, self._due = folder, 0.0, False
        self._process: Process | None = None
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - a pipe that is not read would fill

    def follow(self, new: bool) -> list[str]:
        """Start it when it is time; its last line when it is done."""
        now = time.monotonic()
        if new:
            self._last, self._due = now, True
        if self._process is not None and self._process.poll() is not None:
            self._process = None
            self._said.seek(0)
            try:
                done = json_of(self._said.read(), "analyse")
            except TableError:
                return []  # it failed, and said nothing here
            counts = f"{counted_tests(done['verdicts'])} (route: {done['route']})"
            lines = [counts, *([f"report: {done['report']}"] if done["report"] else [])]
            return [f"all tests together: {line}" for line in lines]
        if self._process is None and self._due and now - self._last > _QUIET:
            self._due = False
            words = ("analyse", str(self._folder.absolute()), "--json")
            self._said.seek(0)  # the process writes on from here
            self._said.truncate()
            self._process = start_module("fourpole", *words, stdout=self._said.fileno(), stderr=DEVNULL, group=True)
        return []

    def stop(self) -> None:
        """End it as Ctrl-C does."""
        if self._process is not None:
            interrupt(self._process)
            self._process.wait()
        self._said.close()


def document(one: WatchedFile) -> dict[str, Any]:
    """A judgement as plain data, with its results in words."""
    return {**asdict(one), "condition": _condition(one), "results": _results(one)}


def _condition(one: WatchedFile) -> str:
    if not one.row:
        return ""
    where = condition(one.row, ShownUnits(), dynamic=q.FREQUENCY.head in one.row)
    return ", ".join(part for part in (str(one.row.get("tyre") or ""), where) if part)


def _results(one: WatchedFile) -> list[str]:
    """The results of the test in words, each with its unit."""
    shown = DYNAMIC if q.FREQUENCY.head in one.row else STATIC
    return [
        f"{column.symbol} {said}" for column in shown[4:8] if one.row and (said := words(column, one.row, ShownUnits()))
    ]


def _lines(one: WatchedFile) -> list[str]:
    """A judgement for a reader."""
    where = _condition(one)
    more = (*one.remarks, *_results(one), *(f"guessed: {text}" for text in one.doubts))
    first = f"{_MARKS[one.verdict]:<9} {one.test}{f': {where}' if where else ''}"
    return [first, *(f"          {text}" for text in more)]
