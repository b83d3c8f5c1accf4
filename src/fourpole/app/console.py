"""What every command shares: where it prints, how it ends, how it shows progress."""

from __future__ import annotations

import functools
import json
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn, ParamSpec

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from fourpole.errors import FourpoleError, UnitError

__all__ = [
    "OK",
    "SOME_REJECTED",
    "UNREADABLE",
    "ends_well",
    "fail",
    "harmless",
    "option",
    "out",
    "print_json",
    "progress",
    "say",
    "table_console",
    "warn",
]

P = ParamSpec("P")

#: Columns of a table where nothing says how wide the reader's page is.
_WIDE = 150
_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")

OK, UNREADABLE, SOME_REJECTED, STOPPED, OURS = 0, 2, 3, 130, 70


def _console(stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    return Console(stderr=stderr, soft_wrap=not stream.isatty(), highlight=False)


def table_console() -> Console:
    """Where tables are printed: as wide as the terminal, wide where there is none."""
    return Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False, markup=False, emoji=False)


def harmless(text: str) -> str:
    """Text from a file without what would steer the terminal: control characters but line ends and tabs."""
    return _STEERING.sub("\ufffd", text)


def out(text: str = "") -> None:
    """Print a result."""
    typer.echo(harmless(text))


def say(text: str) -> None:
    """Tell the user something that is not the result."""
    _console(stderr=True).print(escape(harmless(text)))


def warn(text: str) -> None:
    """Tell the user what to look at."""
    _console(stderr=True).print(f"[yellow]warning:[/yellow] {escape(harmless(text))}")


def fail(text: str, code: int = UNREADABLE) -> NoReturn:
    """Say what is wrong, and end."""
    _console(stderr=True).print(f"[red]error:[/red] {escape(harmless(text))}")
    raise typer.Exit(code)


def print_json(document: Any) -> None:
    """Print one JSON document; a number that does not exist is null."""
    out(json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def option(text: str, kind: str, name: str) -> float:
    """A quantity given on the command line, in SI; the error names the option."""
    from fourpole.units import quantity

    try:
        return quantity(text, kind)
    except UnitError as error:
        raise UnitError(f"{name}: {error}") from None


def ends_well(command: Callable[P, None]) -> Callable[P, None]:
    """Turn what may go wrong in a command into one message and an exit code."""

    @functools.wraps(command)
    def ending(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            command(*args, **kwargs)
        except (typer.Exit, typer.BadParameter):
            raise
        except FourpoleError as error:
            fail(str(error))
        except KeyboardInterrupt:
            say("stopped; nothing is half-written; recordings done are kept: the same command goes on from there")
            raise typer.Exit(STOPPED) from None
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(OK) from None
        except Exception as error:  # noqa: BLE001 - the last line of defence: a fault of ours, said as such
            if os.environ.get("FOURPOLE_DEBUG"):
                traceback.print_exc()
            kind = type(error).__name__
            fail(f"a fault in Fourpole itself ({kind}: {error}); please report it, with FOURPOLE_DEBUG=1 set", OURS)

    return ending


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar with the time left, on a terminal; the callable takes what is done and all."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = _console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
