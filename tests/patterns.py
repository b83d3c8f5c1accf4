"""The regular expressions of the package, found by its syntax trees."""

from __future__ import annotations

import ast
import importlib
import re
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tests.sources import Module, modules, nodes_of

FUNCTIONS = ("compile", "match", "search", "fullmatch", "sub", "subn", "split", "findall", "finditer")


@dataclass(frozen=True)
class Use:
    """A regular expression of a module, with the methods by which it is applied; None if it is made while running."""

    key: str
    pattern: re.Pattern[Any] | None
    methods: frozenset[str]


def uses() -> dict[str, list[Use]]:
    """All regular expressions of the package: room/module.NAME, or room/module.function with #2 from the second on."""
    found: dict[str, list[Use]] = {}
    for module in modules().values():
        imports = (one for one in module.nodes if isinstance(one, ast.Import))
        if any(alias.name == "re" for one in imports for alias in one.names):
            for use in _of_module(module):
                found.setdefault(use.key, []).append(use)
    return found


def _of_module(module: Module) -> Iterator[Use]:
    imported = importlib.import_module(module.name)
    room = module.place.removesuffix(".py").removesuffix("/__init__")
    methods: dict[str, set[str]] = {}
    for node in module.nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in FUNCTIONS:
            methods.setdefault(node.value.id, set()).add(node.attr)
    variables = {method for name, several in methods.items() if name.islower() and name != "re" for method in several}
    variables = variables or {"search", "fullmatch", "finditer"}
    named: set[ast.AST] = set()
    for statement in module.tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            for name in _stored(statement):
                patterns = list(_patterns(vars(imported).get(name)))
                for pattern in patterns:
                    yield Use(f"{room}.{name}", pattern, frozenset(methods.get(name, variables)))
            named.update(nodes_of(statement))
    counts: Counter[str] = Counter()
    for function in (one for one in module.nodes if isinstance(one, ast.FunctionDef)):
        for node in nodes_of(function):
            if node not in named and isinstance(node, ast.Call) and _is_of_re(node.func):
                named.add(node)
                counts[function.name] += 1
                key = f"{room}.{function.name}" + (f"#{counts[function.name]}" if counts[function.name] > 1 else "")
                yield Use(key, _evaluated(node, imported), frozenset({node.func.attr}))


def _stored(statement: ast.stmt) -> list[str]:
    names = (one for one in nodes_of(statement) if isinstance(one, ast.Name))
    return [one.id for one in names if isinstance(one.ctx, ast.Store)]


def _is_of_re(node: ast.expr) -> bool:
    return (
        isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "re"
        and node.attr in FUNCTIONS
    )


def _evaluated(call: ast.Call, module: Any) -> re.Pattern[Any] | None:
    """The pattern of a call whose arguments are known when the module is imported."""
    flags = [one.value for one in call.keywords if one.arg == "flags"]
    flags += [one for one in call.args[2:] if re.match(r"re\.[A-Z]", ast.unparse(one))]
    try:
        pattern, *given = (
            eval(compile(ast.Expression(one), "", "eval"), vars(module))  # noqa: S307 - our own source
            for one in (call.args[0], *flags)
        )
    except NameError:
        return None
    return re.compile(pattern, sum(given))


def _patterns(value: object) -> Iterator[re.Pattern[Any]]:
    if isinstance(value, re.Pattern):
        yield value
    elif isinstance(value, tuple | list):
        for one in value:
            yield from _patterns(one)
    elif isinstance(value, dict):
        yield from _patterns(list(value.values()))


def seconds(use: Use, text: str, times: int = 1) -> float:
    """Processor time of the slowest method of a use on a text, so many times [s]."""
    whole = text.encode("utf-8") if isinstance(use.pattern.pattern, bytes) else text
    taken = []
    for method in use.methods:
        begun = time.process_time()
        for _ in range(times):
            if method in ("match", "search", "fullmatch"):
                getattr(use.pattern, method)(whole)
            else:
                deque(use.pattern.finditer(whole), maxlen=0)
        taken.append(time.process_time() - begun)
    return max(taken)
