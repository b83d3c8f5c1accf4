"""What a command says to a program that runs it: one JSON document a line on standard error, after a record separator.

A program that sets FOURPOLE_EVENTS=1 gets the progress of each task, and each test as its recording is reduced; with
FOURPOLE_EVENTS=answer also what the command would print for a reader. Lines without the separator are the messages that
a person would see. If it gives the command a pipe as standard input, the end of that pipe ends the command as Ctrl-C
does: so no command stays behind when the program is killed.
"""

from __future__ import annotations

import json
import os
import signal
import stat
import sys
import threading
import time
from typing import Any

#: The sign before each document, as in JSON text sequences (RFC 7464).
MARK = "\x1e"
#: The variable of the environment that asks for events.
VARIABLE = "FOURPOLE_EVENTS"
#: Least time between two events of one task's progress [s].
_EVERY = 0.2


def wanted(*, answer: bool = False) -> bool:
    """Whether a program asked for events, or for those with the `answer`."""
    return os.environ.get(VARIABLE) in (("answer",) if answer else ("1", "answer"))


def end_with_caller() -> None:
    """End this process as Ctrl-C does when the program that asked for events, and holds its input open, is gone."""
    if wanted() and not stat.S_ISCHR(os.fstat(0).st_mode):
        threading.Thread(target=_wait_for_caller, name="caller", daemon=True).start()


def _wait_for_caller() -> None:
    with open(0, "rb", buffering=0, closefd=False) as told:
        while told.read(4096):
            pass
    if sys.platform == "win32":  # there, os.kill ends the process at once
        signal.raise_signal(signal.SIGINT)
    else:
        os.kill(os.getpid(), signal.SIGINT)


def tell(**event: Any) -> None:
    """Print an event, if a program asked for events."""
    if wanted():
        sys.stderr.write(f"{MARK}{json.dumps(event)}\n")
        sys.stderr.flush()


class Task:
    """Progress of a task as events: what it is, the numbers done and of all, and the time left [s]."""

    def __init__(self, what: str) -> None:
        self._what, self._start, self._last = what, time.monotonic(), 0.0

    def __call__(self, done: int, total: int) -> None:
        """Tell how far it is, not too often."""
        now = time.monotonic()
        if now - self._last < _EVERY and done < total:
            return
        self._last = now
        left = (now - self._start) / done * (total - done) if done else None
        tell(task=self._what, done=done, total=total, left=left)
