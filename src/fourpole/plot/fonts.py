"""The list of fonts that matplotlib makes once for a user, by a program that it finds on PATH."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from fourpole.io.processes import output_of, python_command

#: Time that the list may take [s].
_LONGEST = 60.0


def list_fonts() -> None:
    """Have that list made by a further process, where there is none: it is not made in the working folder then."""
    if "matplotlib.font_manager" in sys.modules or sys.platform == "win32":
        return
    with suppress(OSError):
        folder = _cache()
        if not any(folder.glob("fontlist-v*.json")):
            folder.mkdir(parents=True, exist_ok=True)  # where that fails, matplotlib keeps no list
            output_of(python_command("matplotlib.font_manager"), seconds=_LONGEST)


def _cache() -> Path:
    """Folder in which matplotlib keeps it."""
    if stated := os.environ.get("MPLCONFIGDIR"):
        return Path(stated)
    if sys.platform == "darwin":
        return Path.home() / ".matplotlib"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "matplotlib")
