"""What a command says to a program that runs it: one JSON document a line on standard error, after a record separator.

A program that sets FOURPOLE_EVENTS=1 gets the progress of each task, and each test as its recording is reduced. Lines
without the separator are the messages that a person would see.
"""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any

#: The sign before each document, as in JSON text sequences (RFC 7464).
MARK = "\x1e"
#: The variable of the environment that asks for events.
VARIABLE = "FOURPOLE_EVENTS"
#: Least time between two events of one task's progress [s].
_EVERY = 0.2


def wanted() -> bool:
    """Whether a program asked for events."""
    return os.environ.get(VARIABLE) == "1"


def tell(**event: Any) -> None:
    """Print an event."""
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
