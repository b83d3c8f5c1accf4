"""The shape of the house: imports run in no circle, checks hold values and no words, no room parses a sentence."""

import ast
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from fourpole.core.checks import Check
from fourpole.errors import Message

ROOT = Path(__file__).resolve().parents[1] / "src"
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): ast.parse(
        path.read_text(encoding="utf-8")
    )
    for path in sorted((ROOT / "fourpole").rglob("*.py"))
}


def imports_of(tree):
    """Modules of the house that a module imports: at its top, inside functions, and for types only."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                within = f"{node.module}.{alias.name}"
                yield within if within in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def circles(graph):
    """Modules that import each other, directly or through others, and modules between two such circles."""
    left = {module: set(imported) & set(graph) - {module} for module, imported in graph.items()}
    while done := {module for module in left if not left[module] or module not in set().union(*left.values())}:
        left = {module: imported - done for module, imported in left.items() if module not in done}
    return left


def test_a_circle_is_seen():
    assert circles({"a": ["b"], "b": ["c", "e"], "c": ["a"], "d": ["a"], "e": []}).keys() == {"a", "b", "c"}
    assert not circles({"a": ["b", "c"], "b": ["c"], "c": []})


def test_imports_run_in_no_circle():
    assert not circles({module: list(imports_of(tree)) for module, tree in MODULES.items()})


#: Functions that make a check; their arguments by name are its values.
MAKERS = {"reported", "judged", "Check"}


def worded_values(tree):
    """Values of checks that are made of text where the check is made."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS:
            for keyword in node.keywords:
                if is_worded(keyword.value):
                    yield node.lineno, ast.unparse(keyword)


def is_worded(node):
    """Whether a value is made of text; what an error says is a `Message`, which has its code."""
    if isinstance(node, ast.Call):
        made = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if made == "Message":
            return False
        if made in ("join", "format", "str"):
            return True
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str) and " " in node.value
    return any(map(is_worded, ast.iter_child_nodes(node)))


@pytest.mark.parametrize(
    "code", ["reported(Code.K1, v, why='no test is there')", "judged(c, 1.0, 2.0, names=', '.join(names))"]
)
def test_a_check_with_words_is_seen(code):
    assert list(worded_values(ast.parse(code)))


def test_checks_are_made_with_values_and_no_words():
    found = {module: made for module, tree in MODULES.items() if (made := list(worded_values(tree)))}
    assert not found


def words_in(values, names):
    """Texts in the values of a check that are neither names nor what an error says."""
    for value in values:
        if isinstance(value, str) and not isinstance(value, Enum):
            if value not in names:
                yield value
        elif isinstance(value, Check):
            yield from words_in(value.values.values(), names)
        elif isinstance(value, dict):
            yield from words_in(value.values(), names)
        elif isinstance(value, list | tuple | set):
            yield from words_in(value, names)
        elif hasattr(value, "__dataclass_fields__") and not isinstance(value, Message):
            yield from words_in(vars(value).values(), names)
        else:
            known = value is None or isinstance(value, Message | Enum | int | float | complex | np.number | np.ndarray)
            assert known, type(value)


#: What takes a text apart, as a method of it or as a function of `re`; trimming an end decides nothing.
TAKES_APART = {
    "partition", "rpartition", "split", "rsplit", "splitlines", "startswith", "endswith", "find", "index", "replace",
    "match", "search", "fullmatch", "sub", "findall", "finditer",
}  # fmt: skip
#: Names of texts that people read.
SENTENCES = ("remark", "sentence", "remedy", "remedies", "cause", "message")
#: A reason without a short form is shown by its first remark; no decision rests on it.
SHOWN = {("fourpole.findings.verdicts", "remarks.split('; ', maxsplit=1)")}


def parsed_sentences(tree):
    """Calls that take a sentence apart."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in TAKES_APART:
            for part in (node.func.value, *(node.args if ast.unparse(node.func.value) == "re" else ())):
                named = part.attr if isinstance(part, ast.Attribute) else getattr(part, "id", "")
                if any(word in named.lower() for word in SENTENCES):
                    yield ast.unparse(node)


@pytest.mark.parametrize("code", ["remarks.split('; ')", "re.sub('[0-9]', '', check.remark)", "cause.find(':')"])
def test_a_parsed_sentence_is_seen(code):
    assert list(parsed_sentences(ast.parse(code)))


def test_no_room_parses_a_sentence():
    assert {(module, call) for module, tree in MODULES.items() for call in parsed_sentences(tree)} == SHOWN
