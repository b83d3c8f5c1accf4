"""Printing, progress, quantities and the end of every command."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import textwrap
import time
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal, NoReturn, TypeAlias

import typer

from fourpole.app import events
from fourpole.errors import FourpoleError, UnitError, out_of_memory

if TYPE_CHECKING:
    from rich.console import Console, JustifyMethod
    from rich.text import Text

Sign: TypeAlias = Literal["any", "not negative", "positive"]

#: Width of a table in characters where standard output is no terminal.
_WIDE = 150
#: Characters between two columns; longest word that is not folded; width at which text reads well; longest cell of a
#: table that is turned.
_BETWEEN, _LONG_WORD, _READABLE, _SHORT = 3, 24, 18, 22
#: Control characters, which could steer a terminal; line ends and tabs are not among them.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")

#: Blanks between two columns of a table of plain text.
GAP = 2

OK, UNREADABLE, SOME_REJECTED, STOPPED, TERMINATED, INTERNAL = 0, 2, 3, 130, 143, 70
#: Time between two lines of progress in a log [s].
_LINE_EVERY = 10.0
#: Time after which a signal is repeated that came while an object was deleted [s].
_SOON = 0.02
_STOPPED_TEXT = "stopped; no file is half-written; give the same command again: what is kept is not done twice"


#: What a progress bar is part of; empty for a command with one task.
_PART: ContextVar[str] = ContextVar("_PART", default="")


class Terminated(KeyboardInterrupt):
    """The process was asked to end by a signal other than Ctrl-C."""


def _console(stderr: bool) -> Console:
    from rich.console import Console  # only what prints loads it: a third of the time of a list of commands

    stream = sys.stderr if stderr else sys.stdout
    return Console(stderr=stderr, soft_wrap=not stream.isatty(), highlight=False)


def table_width() -> int:
    """Width of the terminal in characters, or a fixed width where standard output is no terminal."""
    return _tables().width


def _tables() -> Console:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else _WIDE, highlight=False, markup=False, emoji=False)


def print_table(heads: Iterable[str], rows: Iterable[Sequence[str | Text]], *, right: Collection[str] = ()) -> None:
    """Print a table; columns whose head is in `right` are aligned at the right and are not folded.

    Where the table does not fit without cutting a number or a word, its columns become lines.
    """
    from rich.text import Text

    heads, console = list(heads), _tables()
    lines = [[cell if isinstance(cell, Text) else Text(without_controls(cell)) for cell in row] for row in rows]
    widths = _widths(heads, lines, right, console.width)
    if widths:
        _print_columns(console, heads, lines, widths, right)
    elif max((_width_of(cell) for row in lines for cell in row[1:]), default=0) <= _SHORT:
        _print_turned(console, heads, lines)
    else:
        _print_blocks(console, heads, lines)


def _widths(heads: Sequence[str], lines: Sequence[Sequence[Text]], right: Collection[str], most: int) -> list[int]:
    """Least width of each column, with heads whole or else folded between words; empty if the table does not fit."""
    full = [row for row in lines if len(row) > 1]  # a single cell is the name of a group
    least = [
        max((_least_width(row[at], whole=head in right) for row in full if at < len(row)), default=0)
        for at, head in enumerate(heads)
    ]
    folded = [max(map(len, head.split()), default=0) for head in heads]
    for of_heads in ([len(head) for head in heads], folded):
        widths = [max(pair) for pair in zip(least, of_heads, strict=True)]
        if sum(widths) + _BETWEEN * (len(heads) - 1) <= most:
            return widths
    return []


def _print_columns(
    console: Console,
    heads: Sequence[str],
    lines: Sequence[Sequence[Text]],
    widths: Sequence[int],
    right: Collection[str],
) -> None:
    """Print a table that fits."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for head, width in zip(heads, widths, strict=True):
        number = head in right
        shown = Text("\n".join(textwrap.wrap(head, width)) if number else head)
        justify: JustifyMethod = "right" if number else "left"
        table.add_column(shown, justify=justify, min_width=width, no_wrap=number, overflow="fold")
    for row in lines:
        table.add_row(*row)
    console.print(table)


def _print_turned(console: Console, heads: Sequence[str], lines: Sequence[Sequence[Text]]) -> None:
    """Print a table of short cells with its columns as lines, as many rows beside each other as the terminal holds."""
    from rich.table import Table
    from rich.text import Text

    first = max(map(len, heads))
    place = 0
    while place < len(lines):
        grid = Table.grid(padding=(0, 2))
        grid.add_column(no_wrap=True)
        used, start = first, place
        while place < len(lines):
            width = max(_width_of(cell) for cell in lines[place])
            if used + 2 + width > console.width and place > start:
                break
            grid.add_column(justify="right", no_wrap=True, min_width=width)
            used, place = used + 2 + width, place + 1
        for at, head in enumerate(heads):
            grid.add_row(Text(head), *(row[at] if at < len(row) else Text() for row in lines[start:place]))
        if start:
            console.print()
        console.print(grid)


def _print_blocks(console: Console, heads: Sequence[str], lines: Sequence[Sequence[Text]]) -> None:
    """Print each row as a block: its first cell, and below it each other cell after its head."""
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    widest = max(map(len, heads[1:]), default=0)
    for row in lines:
        console.print(row[0])
        grid = Table.grid(padding=(0, 2))
        grid.add_column(no_wrap=True, min_width=widest)
        grid.add_column(overflow="fold")
        for head, cell in zip(heads[1:], row[1:], strict=False):
            if cell.plain:
                grid.add_row(Text(head), cell)
        if grid.row_count:
            console.print(Padding(grid, (0, 0, 0, 2)))


def _width_of(cell: Text) -> int:
    """Width of the longest line of a cell."""
    return max((line.cell_len for line in cell.split("\n", allow_blank=True)), default=0)


def _least_width(cell: Text, *, whole: bool) -> int:
    """Width below which a cell loses a part of a number or of a word, or is hard to read; a path may be folded."""
    if whole:
        return _width_of(cell)
    return max(min(max(map(len, cell.plain.split()), default=0), _LONG_WORD), min(cell.cell_len, _READABLE))


def line_of(cells: Sequence[str], widths: Sequence[int]) -> str:
    """A line of a table of plain text: its first cell is aligned at the left, the others at the right."""
    places = enumerate(zip(cells, widths, strict=True))
    return (" " * GAP).join(cell.rjust(width) if at else cell.ljust(width) for at, (cell, width) in places).rstrip()


def counted(count: int, noun: str) -> str:
    """A number with its noun, which has an s in the plural."""
    return f"{count} {noun}{'s' * (count != 1)}"


def counted_tests(counts: Mapping[str, int], rejected: str = "rejected") -> str:
    """The number of tests, and how many have each verdict."""
    listed = f"{counts['ok']} ok, {counts['warning']} with a warning, {counts['rejected']} {rejected}"
    return f"{counted(sum(counts.values()), 'test')}, {listed}"


def without_controls(text: str) -> str:
    """Text from a file with a replacement sign in place of each control character but line ends and tabs."""
    return _CONTROL.sub("\ufffd", text)


def out(text: str = "", *, fold: bool = True) -> None:
    """Print a result on standard output; on a terminal, long lines are folded between words, but a path to copy."""
    text = without_controls(text)
    if fold and sys.stdout.isatty():
        text = "\n".join(_folded(line, table_width()) for line in text.split("\n"))
    typer.echo(text)


def _folded(line: str, width: int) -> str:
    """A line folded between words, the parts indented as it is; a longer word, such as a path, stays whole."""
    if len(line) <= width:
        return line
    mark = " -" if line[:1] != " " else " ->.0123456789"  # that of an item of a list, or its number
    indent = line[: len(line) - len(line.lstrip(mark))]
    return textwrap.fill(
        line, width, subsequent_indent=" " * len(indent), break_long_words=False, break_on_hyphens=False
    )


def say(*texts: str) -> None:
    """Print on standard error what is not the result, each text on a line of its own."""
    _print_marked("", *texts)


def note(*texts: str) -> None:
    """Print notes on standard error."""
    _print_marked("note: ", *texts)


def warn(*texts: str) -> None:
    """Print warnings on standard error."""
    _print_marked("[yellow]warning:[/yellow] ", *texts)


def more(texts: Sized, most: int, said: str = "") -> list[str]:
    """The line that ends a list of which `most` are shown, with what is said of the others; none if all are shown."""
    return [f"... and {len(texts) - most} more{said}"] if len(texts) > most else []


def fail(text: str, code: int = UNREADABLE) -> NoReturn:
    """Print an error on standard error and end with this exit code; a program that asked for events gets it, too."""
    events.tell(error=text)
    _print_marked("[red]error:[/red] ", text)
    raise typer.Exit(code)


def _print_marked(mark: str, *texts: str) -> None:
    """Print texts on standard error, each after a mark in rich's markup."""
    from rich.markup import escape

    for text in texts:
        _console(stderr=True).print(f"{mark}{escape(without_controls(text))}")


def print_json(document: Any, indent: int | None = 2) -> None:
    """Print one JSON document; a number that is not finite is null."""
    out(json.dumps(_plain(document), indent=indent, ensure_ascii=False, allow_nan=False), fold=False)


@contextmanager
def one_of_several(part: str) -> Iterator[None]:
    """Let progress bars say what they are part of, as "2 of 3: campaign"."""
    token = _PART.set(part)
    try:
        yield
    finally:
        _PART.reset(token)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


def option(text: str, kind: str, name: str, sign: Sign = "any") -> float:
    """A quantity of the command line in SI; the error names its option.

    Raises
    ------
    UnitError
        If the text is no quantity of this kind, or its value has another sign.
    """
    from fourpole.units import quantity, shown

    try:
        value = quantity(text, kind)
    except UnitError as error:
        raise UnitError(f"{name}: {error}") from None
    if (value < 0 and sign != "any") or (value == 0 and sign == "positive"):
        raise UnitError(f"{name}: {shown(text)} must be {'positive' if sign == 'positive' else 'zero or positive'}")
    return value


def frequencies(text: str) -> list[float]:
    """The frequencies of ``--frequency`` [Hz]."""
    from fourpole.units import frequency_grid

    try:
        return frequency_grid(text)
    except UnitError as error:
        raise UnitError(f"--frequency: {error}") from None


def rising(text: str, name: str, example: str, read: Callable[[str], float] = float) -> tuple[float, float]:
    """Two rising values of an option with ".." or ":" between them; `read` makes a number of each."""
    from fourpole.units import shown

    try:
        low, high = (read(part) for part in text.split(".." if ".." in text else ":"))
    except (ValueError, UnitError):
        low, high = 1.0, 0.0
    if not low < high:
        raise UnitError(f"{name}: {shown(text)} is not two rising values, as in '{example}'")
    return low, high


def show_warnings() -> None:
    """Print what is warned of the results as other warnings are; Python would add a line of its source.

    That a number left its range is told by a check or an error of what it is a part of.
    """
    import warnings

    from fourpole.errors import ResultsWarning

    former = warnings.showwarning
    if not os.environ.get("FOURPOLE_DEBUG") and not sys.warnoptions:
        warnings.filterwarnings("ignore", category=RuntimeWarning, module="fourpole")

    def shown(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, ResultsWarning):
            warn(str(message))
        else:
            former(message, category, *place, **more)

    warnings.showwarning = shown


def run_to_exit(run: Callable[..., int | None], **given: Any) -> None:
    """Run a command; an error becomes one message and an exit code."""
    try:
        code = run(**given)
    except (typer.Exit, typer.BadParameter):
        raise
    except FourpoleError as error:
        fail(str(error))
    except Terminated:
        say(_STOPPED_TEXT)
        code = TERMINATED
    except KeyboardInterrupt:
        say(_STOPPED_TEXT)
        code = STOPPED
    except BrokenPipeError:  # the reader of standard output, as head, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = OK
    except OSError as error:
        from fourpole.io.write import is_full, is_of_system, why  # numpy comes with it

        name = error.filename or "a file"
        if is_full(error):
            fail(f"{name}: cannot be written: {why(error)}")
        if not is_of_system(error):
            _fault(error)
        fail(f"{name}: cannot be used: {why(error)}; check the disk and the permissions, and run it again")
    except BaseException as error:  # the last resort: a fault of Fourpole, reported as such; polars panics beside these
        if not isinstance(error, Exception) and not out_of_memory(error):
            raise
        _fault(error)
    raise typer.Exit(code or OK)


def _fault(error: BaseException) -> NoReturn:
    """End the command with the message that memory ran out, or else that Fourpole itself has a fault."""
    if out_of_memory(error):
        fail("not enough memory: close other programs, cut long recordings with window [s], or give fewer at a time")
    if os.environ.get("FOURPOLE_DEBUG"):
        traceback.print_exc()
    kind = type(error).__name__
    fail(f"a fault in Fourpole itself ({kind}: {error}); please report it, with FOURPOLE_DEBUG=1 set", INTERNAL)


def end_in_order() -> None:
    """Let SIGTERM, a closed terminal and Ctrl-Break end the command as Ctrl-C does: it leaves no hidden folders."""

    def end(*_: object) -> NoReturn:
        raise Terminated

    for name in ("SIGTERM", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) is signal.SIG_DFL:
            signal.signal(getattr(signal, name), end)
    sys.unraisablehook = _once_more


def _once_more(ignored: sys.UnraisableHookArgs) -> None:
    """Repeat a signal whose exception Python has ignored, because it came while an object was deleted."""
    if not (issubclass(ignored.exc_type, KeyboardInterrupt) and hasattr(signal, "setitimer")):
        sys.__unraisablehook__(ignored)
        return
    kind = ignored.exc_type

    def end(*_: object) -> NoReturn:
        raise kind

    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, _SOON)


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Progress with the time left; the callable takes the number done and the number of all.

    It is a bar on a terminal. In a log it is a line every ten seconds, and none for shorter work. For a program that
    asked for events, it is these.
    """
    part = _PART.get()
    named = f"{part}, {what}" if part else what
    if events.wanted():
        yield events.Task(named)
        return
    if not sys.stderr.isatty():
        yield _Log(named)
        return
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=_console(stderr=True), transient=True) as bar:
        task = bar.add_task(escape(named), total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


class _Log:
    """Progress in lines."""

    def __init__(self, what: str) -> None:
        self._what, self._start = what, time.monotonic()
        self._last = self._start

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if now - self._last < _LINE_EVERY or not 0 < done < total:
            return
        self._last = now
        left = (now - self._start) / done * (total - done)
        say(f"{self._what}: {done} of {total}, about {_duration(left)} left")


def _duration(seconds: float) -> str:
    """A time in seconds, minutes or hours."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
