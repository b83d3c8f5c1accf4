"""Functions of the package made slightly wrong for a time: their code is exchanged wherever they are imported."""

from __future__ import annotations
import __future__

import inspect
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module


@contextmanager
def mutated(place: str, old: str, new: str) -> Iterator[None]:
    """The function "module:name" or "module:Class.name" with one passage of its source exchanged."""
    module_name, _, name = place.partition(":")
    module = import_module(f"fourpole.{module_name}")
    function = module
    for part in name.split("."):
        function = inspect.getattr_static(function, part)
    function = getattr(function, "func", getattr(function, "fget", None)) or function
    source = textwrap.dedent(inspect.getsource(function))
    assert source.count(old) == 1, f"{old!r} stands {source.count(old)} times in {place}"
    lines = source.replace(old, new).splitlines(keepends=True)
    while lines[0].lstrip().startswith("@"):
        del lines[0]
    made: dict[str, object] = {}
    exec(compile("".join(lines), place, "exec", __future__.annotations.compiler_flag), dict(vars(module)), made)  # noqa: S102
    (changed,) = made.values()
    former = function.__code__
    function.__code__ = changed.__code__
    try:
        yield
    finally:
        function.__code__ = former
