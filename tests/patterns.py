"""The regular expressions of the package, found by its syntax trees."""

from __future__ import annotations

import ast
import importlib
import re
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1] / "src"
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
    for path in sorted(ROOT.rglob("*.py")):
        tree = ast.parse(path.read_text())
        if any(isinstance(node, ast.Import) and any(one.name == "re" for one in node.names) for node in ast.walk(tree)):
            for use in _of_module(path, tree):
                found.setdefault(use.key, []).append(use)
    return found


def _of_module(path: Path, tree: ast.Module) -> Iterator[Use]:
    place = path.relative_to(ROOT).with_suffix("")
    module = importlib.import_module(".".join(place.parts).removesuffix(".__init__"))
    room = place.relative_to("fourpole").as_posix().removesuffix("/__init__")
    methods: dict[str, set[str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in FUNCTIONS:
            methods.setdefault(node.value.id, set()).add(node.attr)
    variables = {method for name, several in methods.items() if name.islower() and name != "re" for method in several}
    variables = variables or {"search", "fullmatch", "finditer"}
    named: set[ast.AST] = set()
    for statement in tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            for name in _stored(statement):
                patterns = list(_patterns(vars(module).get(name)))
                for pattern in patterns:
                    yield Use(f"{room}.{name}", pattern, frozenset(methods.get(name, variables)))
            named.update(ast.walk(statement))
    counts: Counter[str] = Counter()
    for function in (one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)):
        for node in ast.walk(function):
            if node not in named and isinstance(node, ast.Call) and _is_of_re(node.func):
                named.add(node)
                counts[function.name] += 1
                key = f"{room}.{function.name}" + (f"#{counts[function.name]}" if counts[function.name] > 1 else "")
                yield Use(key, _evaluated(node, module), frozenset({node.func.attr}))


def _stored(statement: ast.stmt) -> list[str]:
    names = (one for one in ast.walk(statement) if isinstance(one, ast.Name))
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
