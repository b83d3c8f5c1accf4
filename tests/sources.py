"""The source of the package as syntax trees: each process parses a module once, whichever tests ask for it."""

from __future__ import annotations

import ast
import gc
from dataclasses import dataclass
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
PACKAGE = SOURCE / "fourpole"


@dataclass(frozen=True)
class Module:
    """A module: its file, its text, its tree and, in the order of `ast.walk`, all nodes of the tree."""

    path: Path
    text: str
    tree: ast.Module
    nodes: tuple[ast.AST, ...]

    @property
    def place(self) -> str:
        """Its file in the package, as `io/door.py`."""
        return self.path.relative_to(PACKAGE).as_posix()

    @property
    def name(self) -> str:
        """Its name, as `fourpole.io.door`."""
        return ".".join(self.path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")


@cache
def modules() -> dict[str, Module]:
    """The modules of the package by their places."""
    gc.disable()  # all of it stays; to look for what could be freed takes longer than to parse
    try:
        found = [_parsed(path) for path in sorted(PACKAGE.rglob("*.py"))]
    finally:
        gc.enable()
    return {module.place: module for module in found}


def _parsed(path: Path) -> Module:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return Module(path, text, tree, nodes_of(tree))


def nodes_of(tree: ast.AST) -> tuple[ast.AST, ...]:
    """What `ast.walk` gives, in less time."""
    found = [tree]
    for node in found:
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                found.append(value)
            elif isinstance(value, list):
                found.extend(one for one in value if isinstance(one, ast.AST))
    return tuple(found)


def name_of(node: ast.expr) -> str:
    """The text of an expression as `ast.unparse` gives it, in less time for a name with attributes."""
    attributes: list[str] = []
    inner = node
    while isinstance(inner, ast.Attribute):
        attributes.append(inner.attr)
        inner = inner.value
    return ".".join([inner.id, *reversed(attributes)]) if isinstance(inner, ast.Name) else ast.unparse(node)
