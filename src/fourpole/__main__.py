"""The command `fourpole`, also as a module: ``python -m fourpole``."""

from __future__ import annotations

import gc
import os
import sys

#: Commands whose first argument must be there, by what is said where it is not; of a file by its name alone.
_NOT_THERE = {
    "there is no such folder": ("analyse", "check", "init", "plan", "twoport", "watch"),
    "there is no such folder of results": ("export", "plot", "report", "rig"),
    "there is no such file; check its name": (
        "causality", "convert", "fit", "identify", "info", "map", "query", "ride", "shift", "static", "stiffness",
        "verify",
    ),
}  # fmt: skip
#: Columns of the help that is kept beside this file; a narrower terminal has one of its own.
_WIDTH = 80
#: The exit code of an input that cannot be read; see `fourpole.app.console`.
_UNREADABLE = 2


def main() -> None:
    """Run the command; its version, help, and a first argument that is not there are told without the command line.

    To load the library of the command line takes most of the time of a help.
    """
    words = sys.argv[1:]
    if words == ["--version"]:
        from fourpole.io.kernel import said

        sys.stdout.write(f"{said()}\n")
        return
    if words in (["--help"], ["-h"]) and _columns() >= _WIDTH:
        with open(f"{__file__.rpartition(os.sep)[0]}/help.txt", encoding="utf-8") as file:  # noqa: PTH123, for pathlib is slow
            sys.stdout.write(file.read())
        return
    if missing := missing_argument(words):
        shown = sys.stderr.isatty() and not os.environ.get("NO_COLOR")
        mark = "\x1b[31merror:\x1b[0m" if shown else "error:"
        sys.stderr.write(f"{mark} {missing}\n")
        sys.exit(_UNREADABLE)
    # To look for cycles in all that is loaded, again and again, takes a tenth of the time.
    gc.set_threshold(50_000, 20, 20)
    from fourpole.app.cli import main as run

    run()


def _columns() -> int:
    """Columns of the terminal; those of the kept help where there is none."""
    try:
        return int(os.environ.get("COLUMNS") or 0) or os.get_terminal_size(sys.stdout.fileno()).columns
    except (OSError, ValueError):
        return _WIDTH


def missing_argument(words: list[str]) -> str:
    """What is missing, where the first argument of a command is a path that is not there; empty where it may be.

    A command with further paths, of which one may be there, is left to the command line, and so is one of a program
    that asked for events.

    Examples
    --------
    >>> missing_argument(["rig", "no-such-campaign"])
    'no-such-campaign: there is no such folder of results'
    """
    if len(words) < 2 or "FOURPOLE_EVENTS" in os.environ:
        return ""
    command, path, *rest = words
    several = rest and not rest[0].startswith("-") if command != "convert" else False
    asked = any(word in ("-h", "--help") for word in rest)
    if asked or several or path.startswith("-") or not path.isprintable() or os.path.lexists(path):
        return ""
    said = next((text for text, commands in _NOT_THERE.items() if command in commands), "")
    name = path.rpartition(os.sep)[2] if "file" in said else path
    return f"{name}: {said}" if said and name else ""


if __name__ == "__main__":
    main()
