"""The group of all commands: it lists them by their docstrings, and builds a command when it is called."""

from __future__ import annotations

import functools
import inspect
import tomllib
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from fourpole.answer import Answer
from fourpole.app.console import fail
from fourpole.app.show import show

Run = TypeVar("Run", bound=Callable[..., "Answer | int | None"])
#: Functions of the commands by name.
_RUNS: dict[str, Callable[..., int | None]] = {}
#: Names of the commands that a page of the app may start on a campaign.
BROWSER: list[str] = []
#: An example of each command by the heading of its group and its name.
GROUPS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("commands.toml").read_text(encoding="utf-8"))
EXAMPLES = {name: example for members in GROUPS.values() for name, example in members.items()}

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


def registered(place: str = "", *, browser: bool = False) -> Callable[[Run], Run]:
    """Make a function a command of its name.

    With `place`, the function is the signature and the help alone: the function at this place in the room takes the
    same arguments by their names, but for `remote`, and does the work. Its module is loaded when the command runs.
    An `Answer` is shown as `as_json` says; a function that prints by itself takes this argument, too. With `browser`,
    the app asks it of a campaign, whose folder is its argument.
    """

    def register(stated: Run) -> Run:
        @functools.wraps(stated)
        def run(**given: Any) -> int | None:
            from fourpole.app.options import allow_remote

            allow_remote(given.pop("remote", False))
            work = resolve_name(f"fourpole.app.{place}") if place else stated
            asked = inspect.signature(work).parameters
            found = work(**{name: value for name, value in given.items() if name in asked})
            return show(found, as_json=given.get("as_json", False)) if isinstance(found, Answer) else found

        name = stated.__name__.rstrip("_")
        _RUNS[name] = run
        if browser:
            BROWSER.append(name)
        return stated

    return register


class Command(TyperCommand):
    """A command that says what stands in place of an option that was removed."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """The arguments as parameters."""
        for word in args:
            name = word.partition("=")[0]
            if instead := REMOVED.get(f"{self.name} {name}"):
                fail(f"{name} was removed: state {instead}")
        return super().parse_args(ctx, args)


class Group(TyperGroup):
    """The group; a command is built when it is called, because to build all takes longer than to load their list."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - the interface of click
        """Names of the commands."""
        return list(_RUNS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The command of a name; None if there is none."""
        if cmd_name in _RUNS and cmd_name not in self.commands:
            self.commands[cmd_name] = _built(cmd_name, _RUNS[cmd_name])
        return self.commands.get(cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, and its arguments."""
        if args[0] not in _RUNS:  # the message names the nearest of the commands that are built
            for name in _RUNS:
                self.get_command(ctx, name)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write the list of commands of the help."""
        for head, names in groups_of(list(_RUNS)).items():
            if names:
                with formatter.section(head):
                    formatter.write_dl([(name, about(name)) for name in names])


def _built(name: str, run: Callable[..., int | None]) -> Any:
    """The command of a function, for the command line. The options are imported here, for the list needs none."""
    from fourpole.app.options import command

    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    example = f"\b\nExample:\n  {EXAMPLES[name]}" if name in EXAMPLES else None
    alone.command(name, cls=Command, epilog=example)(command(run))
    return typer.main.get_command(alone)


def about(name: str) -> str:
    """The first paragraph of the docstring of a command, on one line."""
    return " ".join((inspect.getdoc(_RUNS[name]) or "").partition("\n\n")[0].split())


def signature_of(name: str) -> inspect.Signature:
    """The signature of a command, with each option of its groups."""
    from fourpole.app.options import command

    return inspect.signature(command(_RUNS[name]))
