"""Processes that tests start."""

from __future__ import annotations

import os
import sys


def environment(**more: str) -> dict[str, str]:
    """Environment of a process that finds the same modules as this one, with further variables."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path), **more}
