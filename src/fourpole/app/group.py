"""The group of all commands: it lists them by their docstrings, and builds a command when it is called."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import typer
from typer.core import TyperGroup

from fourpole.app.examples import EXAMPLES, groups_of
from fourpole.app.options import command


def group_of(runs: Mapping[str, Callable[..., int | None]]) -> type[TyperGroup]:
    """Class of a group with these commands, by name, in the order of the help.

    To build all commands takes longer than to load the command line, and the list of commands needs none of them.
    """

    class Group(TyperGroup):
        def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - the interface of click
            return list(runs)

        def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
            if cmd_name in runs and cmd_name not in self.commands:
                self.commands[cmd_name] = _built(cmd_name, runs[cmd_name])
            return self.commands.get(cmd_name)

        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            if args[0] not in runs:  # the message names the nearest of the commands that are built
                for name in runs:
                    self.get_command(ctx, name)
            return super().resolve_command(ctx, args)

        def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
            for head, names in groups_of(list(runs)).items():
                if names:
                    with formatter.section(head):
                        formatter.write_dl([(name, _about(runs[name])) for name in names])

    return Group


def _built(name: str, run: Callable[..., int | None]) -> Any:
    """The command of a function, for the command line."""
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    example = f"\b\nExample:\n  {EXAMPLES[name]}" if name in EXAMPLES else None
    alone.command(name, epilog=example)(command(run))
    return typer.main.get_command(alone)


def _about(run: Callable[..., int | None]) -> str:
    """The first paragraph of a docstring, on one line."""
    return " ".join((inspect.getdoc(run) or "").partition("\n\n")[0].split())
