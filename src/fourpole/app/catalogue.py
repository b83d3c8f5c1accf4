"""The commands that the app may start, with their options, made from the signatures that the command line has."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, get_args, get_origin

from typer.models import OptionInfo

from fourpole.app.group import BROWSER, about, signature_of
from fourpole.served.asked import Asked, AskedOption

#: Options that are for the terminal, or that the app states itself.
_LEFT_OUT = {"as_json", "remote", "workers", "force"}


def catalogue() -> tuple[Asked, ...]:
    """The commands that take a campaign's folder and may be started from a browser."""
    return tuple(Asked(name, about(name), tuple(_options(name))) for name in BROWSER)


def _options(name: str) -> Iterator[AskedOption]:
    """The options of a command that are no path."""
    for one in signature_of(name).parameters.values():
        kind, option = _stated(one)
        if option is None or Path in _kinds(kind) or one.name in _LEFT_OUT:
            continue
        long = next((each for each in option.param_decls or () if each.startswith("--")), f"--{one.name}")
        yield AskedOption(long.partition("/")[0].replace("_", "-"), option.help or "", flag=bool in _kinds(kind))


def _stated(one: inspect.Parameter) -> tuple[Any, OptionInfo | None]:
    """The type of a parameter, and what the command line says of it; None for an argument."""
    if isinstance(one.default, OptionInfo):
        return one.annotation, one.default
    if get_origin(one.annotation) is Annotated:
        kind, *more = get_args(one.annotation)
        return kind, next((each for each in more if isinstance(each, OptionInfo)), None)
    return one.annotation, None


def _kinds(kind: Any) -> tuple[Any, ...]:
    """The types of which a value may be."""
    return get_args(kind) if isinstance(kind, UnionType) else (kind,)
