"""The commands in a group: listed as commands.toml has them, built when they are called, their answers shown."""

from __future__ import annotations

import ast
import inspect
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import update_wrapper
from pathlib import Path
from pkgutil import resolve_name
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from fourpole.answer import Answer, Part, Rows, Table
from fourpole.app import events
from fourpole.app.console import GAP, fail, line_of, out, print_json, print_table, say, table_width

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from fourpole.quantities import ShownUnits


def show(answer: Answer, *, as_json: bool, indent: int | None = 2) -> int:
    """Print an answer, or its document and, on standard error, the files; returns its exit code."""
    if as_json and (document := answer.told):
        print_json(document, indent)
    if events.wanted(answer=True):
        events.tell(answer=answer.plain(), files=[str(path) for _, path in answer.files])
    for part in () if as_json else answer.shown:
        _print(part)
    for what, path in answer.files:
        if not as_json:
            out(f"{what}: {path}", fold=False)
        elif not events.wanted(answer=True):
            say(f"{what}: {path}")
    for further in answer.then():
        show(further, as_json=as_json, indent=None)
    return answer.code


def _print(part: Part) -> None:
    if isinstance(part, str):
        out(part)
    elif isinstance(part, Table) and part.remarks:
        _print_remarked(part)
    elif isinstance(part, Table):
        print_table(part.heads, part.rows, right=part.right)
    else:
        _print_rows(part)


def _print_remarked(table: Table) -> None:
    """Print a table with the remark of each row below it, or, where that is too wide, as one more column."""
    heads, rows = list(table.heads), [[str(cell) for cell in row] for row in table.rows]
    full = [row for row in rows if len(row) > 1]
    widths = [max(map(len, column)) for column in zip(heads, *full, strict=True)]
    if sum(widths) + GAP * (len(widths) - 1) > table_width():
        print_table([*heads, table.remark], [[*row, said] for row, said in zip(full, table.remarks, strict=True)])
        return
    remarks = iter(table.remarks)
    out(line_of(heads, widths))
    for row in rows:
        out(line_of(row, widths) if len(row) > 1 else f"\n{row[0]}")
        if len(row) > 1:
            out(f"    {next(remarks)}")
    out()


def _print_rows(rows: Rows) -> None:
    """Print rows as CSV in SI, or on a terminal as a table, each value with its uncertainty."""
    if not sys.stdout.isatty():
        out(rows.frame.write_csv().rstrip("\n"))
        return
    table = rows.table
    print_table(table.heads, table.rows, right=table.right)
    if note := rows.note:
        out(note)


def rows_answer(
    frame: pl.DataFrame,
    file: Path | None,
    units: ShownUnits,
    *,
    leave_out: Sequence[str] = (),
    whole: Mapping[str, str] | None = None,
    code: int = 0,
) -> Answer:
    """The answer of a command whose result is a table, which goes to `file` if it is given."""
    if file is not None:
        from fourpole.io.write import write_table

        path = file if file.suffix else file.with_suffix(".csv")
        write_table(path, frame, label=str(path))
        say(f"written: {path}")
    parts = [] if file is not None else [Rows(frame, units, leave_out, whole)]
    return Answer(parts, lambda: {"rows": frame.to_dicts()}, code=code)


def write_with_figure(folder: Path, key: str, figure: Figure, tables: Mapping[str, pl.DataFrame]) -> list[str]:
    """Write tables, and a figure as KEY.svg and KEY.png, into a folder; returns the names of the files."""
    from fourpole.io.write import write_bytes, write_table
    from fourpole.plot.layout import command_figure  # the room of figures takes a second to load

    for name, table in tables.items():
        write_table(folder / name, table)
    forms = ("svg", "png")
    for form in forms:
        write_bytes(folder / f"{key}.{form}", command_figure(figure, key, form))
    return [*tables, *(f"{key}.{form}" for form in forms)]


Run = TypeVar("Run", bound=Callable[..., Answer])
#: What commands.toml states of each command, by the heading of its group.
_STATED: dict[str, Any] = tomllib.loads(Path(__file__).with_name("commands.toml").read_text(encoding="utf-8"))
#: Names of the commands that a page of the app may start on a campaign.
BROWSER: list[str] = _STATED.pop("browser")
_COMMANDS: dict[str, dict[str, Any]] = {name: one for members in _STATED.values() for name, one in members.items()}
#: Functions of the commands by name; None for one of commands.toml that was not asked for yet.
_RUNS: dict[str, Callable[..., int] | None] = dict.fromkeys(_COMMANDS)
#: An example of each command by the heading of its group and its name.
GROUPS = {head: {name: one["example"] for name, one in members.items()} for head, members in _STATED.items()}
EXAMPLES = {name: example for members in GROUPS.values() for name, example in members.items()}

#: Former names of options, which the help does not show.
FORMER = {"--tyre": "--specimen"}
#: What stands in place of an option that was removed, by command and option.
REMOVED = {
    "static --load-column": '--column "load=NAME"',
    "static --deflection-column": '--column "deflection=NAME"',
    "shift --figure": "--out FOLDER, where the figure is shift.svg and shift.png",
    **{f"plan --{old}": f"--{now}" for old, now in (("K1", "k1"), ("K2", "k2"), ("C", "c"))},
    "plan --moving-mass": "--mass",
    "plan --frequencies": "--frequency",
}


def groups_of(names: list[str]) -> dict[str, list[str]]:
    """Names of commands by their group; those without one at the end."""
    found = {head: [name for name in members if name in names] for head, members in GROUPS.items()}
    return {**found, "Further commands": [name for name in names if name not in EXAMPLES]}


def registered(*, browser: bool = False) -> Callable[[Run], Run]:
    """Make a function a command of its name, besides those of commands.toml.

    With `browser`, the app asks it of a campaign, whose folder is its argument.
    """

    def register(stated: Run) -> Run:
        from fourpole.app import options

        name, signature = stated.__name__.rstrip("_"), inspect.signature(stated, eval_str=True, locals=vars(options))
        _RUNS[name] = update_wrapper(_with_options(lambda: stated, signature), stated)
        if browser:
            BROWSER.append(name)
        return stated

    return register


def _run_of(name: str) -> Callable[..., int]:
    """The function of a command, with all its options; the module that does the work is loaded when it runs."""
    found = _RUNS[name]
    if found is None:
        stated = _COMMANDS[name]
        place, remote = f"fourpole.app.{stated['run']}", stated.get("remote", False)
        found = _RUNS[name] = _with_options(lambda: resolve_name(place), _signature_in(stated["run"]), remote=remote)
    return found


def _signature_in(place: str) -> inspect.Signature:
    """The signature of a function of this room, from its source: to load its module takes longer than a help may."""
    from fourpole.app import options

    module, _, name = place.rpartition(".")
    tree = ast.parse(Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8"))
    (stated,) = (one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name == name)
    own = stated.args
    hints = {one.arg: ast.unparse(one.annotation) for one in (*own.args, *own.kwonlyargs) if one.annotation}
    kinds = get_type_hints(SimpleNamespace(__annotations__=hints), vars(options))
    values = [*[None] * (len(own.args) - len(own.defaults)), *own.defaults, *own.kw_defaults]
    return inspect.Signature(
        [
            inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=_default(value), annotation=kind)
            for (key, kind), value in zip(kinds.items(), values, strict=True)
        ]
    )


def _default(stated: ast.expr | None) -> Any:
    """The default of a parameter: a literal, or a path."""
    if stated is None:
        return inspect.Parameter.empty
    return Path(*map(ast.literal_eval, stated.args)) if isinstance(stated, ast.Call) else ast.literal_eval(stated)


def _with_options(
    work_of: Callable[[], Callable[..., Answer]], signature: inspect.Signature, *, remote: bool = False
) -> Callable[..., int]:
    """A function that shows the answer of another one, with --json and --remote, which that one need not take."""
    own, also = signature.parameters, (*(("remote",) if remote else ()), "as_json")

    def run(**given: Any) -> int:
        from fourpole.app.options import allow_remote

        allow_remote(given.pop("remote", False))
        return show(work_of()(**{name: given[name] for name in own if name in given}), as_json=given["as_json"])

    flags = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=bool) for name in also]
    parameters = [one for name, one in own.items() if name not in also]
    run.__signature__ = signature.replace(parameters=[*parameters, *flags])  # type: ignore[attr-defined]
    return run


class Command(TyperCommand):
    """A command that takes options by their former names, and says what stands in place of one that was removed."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """The arguments as parameters."""
        options, words = {name for one in self.params for name in one.opts}, []
        for word in args:
            name, mark, value = word.partition("=")
            if instead := REMOVED.get(f"{self.name} {name}"):
                fail(f"{name} was removed: state {instead}")
            now = FORMER.get(name, name)
            words.append(f"{now}{mark}{value}" if now in options else word)
        return super().parse_args(ctx, words)


class Group(TyperGroup):
    """The group; a command is built when it is called, because to build all takes longer than to load their list."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - the interface of click
        """Names of the commands."""
        return list(_RUNS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The command of a name; None if there is none."""
        if cmd_name in _RUNS and self.commands.get(cmd_name) is None:
            self.commands[cmd_name] = _built(cmd_name)
        return self.commands.get(cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, and its arguments."""
        if args[0] not in _RUNS:  # the message names the nearest of these
            self.commands = {name: self.commands.get(name) for name in _RUNS}  # type: ignore[misc]
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write the list of commands of the help."""
        for head, names in groups_of(list(_RUNS)).items():
            if names:
                with formatter.section(head):
                    formatter.write_dl([(name, about(name)) for name in names])


def _built(name: str) -> Any:
    """The command of a name, for the command line. The options are imported here, for the list needs none."""
    from fourpole.app.options import command

    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    example = f"\b\nExample:\n  {EXAMPLES[name]}" if name in EXAMPLES else None
    alone.command(name, cls=Command, epilog=example, help=_help(name))(command(name, _run_of(name)))
    return typer.main.get_command(alone)


def about(name: str) -> str:
    """The first paragraph of the help of a command, on one line."""
    return " ".join(_help(name).partition("\n\n")[0].split())


def _help(name: str) -> str:
    """What a command does, by commands.toml or else the docstring of its function."""
    return str(_COMMANDS[name]["about"]) if name in _COMMANDS else inspect.getdoc(_RUNS[name]) or ""


def signature_of(name: str) -> inspect.Signature:
    """The signature of a command, with each option of its groups."""
    from fourpole.app.options import command

    return inspect.signature(command(name, _run_of(name)))
