"""The shape of the house: imports run in no circle, checks hold values and no words, no room parses a sentence."""

import ast
from enum import Enum
from functools import cache

import numpy as np
import pytest
from tests.faulty import change, copy, drop_out, exchange, invert_v2
from tests.sources import modules, name_of, nodes_of

from fourpole.campaign.row import condition_words
from fourpole.core.checks import Check
from fourpole.core.joint.misfit import Candidate
from fourpole.errors import Message
from fourpole.study import analysis
from fourpole.study.selection import select_tables
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough


@cache
def names():
    """Names of all modules; read where a test asks, for all processes collect the tests and one runs them."""
    return {module.name for module in modules().values()}


def imports_of(nodes):
    """Modules of the house that a module imports: at its top, inside functions, and for types only."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                within = f"{node.module}.{alias.name}"
                yield within if within in names() else node.module
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
    assert not circles({module.name: list(imports_of(module.nodes)) for module in modules().values()})


#: Functions that make a check; their arguments by name are its values.
MAKERS = {"reported", "judged", "Check"}


def worded_values(nodes):
    """Values of checks that are made of text where the check is made."""
    for node in nodes:
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
    assert list(worded_values(nodes_of(ast.parse(code))))


def test_checks_are_made_with_values_and_no_words():
    found = {place: made for place, module in modules().items() if (made := list(worded_values(module.nodes)))}
    assert not found


def words_in(value, names):
    """Texts in a value of a check that are neither names nor what an error says."""
    if isinstance(value, Message | Enum | Candidate | int | float | complex | np.number | np.ndarray | type(None)):
        return []
    if isinstance(value, str):
        return [] if value in names else [value]
    if isinstance(value, Check):
        value = value.values
    return [text for part in (value.values() if isinstance(value, dict) else value) for text in words_in(part, names)]


def loose_and_zero(folder):
    """Another gain of V1 in one test, another zero of the load, and drop-outs of V2."""
    change(folder, "V1", lambda v: 1.2 * v, ["D5"])
    change(folder, "F", lambda load: load + 150.0)
    change(folder, "V2", drop_out)


def exchanged_and_clipped(folder):
    """Two recordings of other pressures and two static tests exchanged; F1 [kN] clipped softly."""
    exchange(folder, "D2", "D5")
    exchange(folder, "S1", "S2")
    change(folder, "F1", lambda force: 0.5 * np.tanh(force / 0.5))


def copied(folder):
    """The recording of a test filed for its repeat, too."""
    copy(folder, "D2", "D8")


def inverted_and_mislabelled(folder):
    """V2 with the other sign, and a wrong pressure of one test."""
    invert_v2(folder)
    rows = (folder / "tests.csv").read_text()
    (folder / "tests.csv").write_text(
        rows.replace("D2,recordings/D2.csv,dynamic,radial-ply,1.35", "D2,recordings/D2.csv,dynamic,radial-ply,2.05")
    )


@pytest.mark.parametrize(
    ("route", "faulty", "rig_error"),
    [
        ("joint", loose_and_zero, {}),
        ("mobility", exchanged_and_clipped, {}),
        ("mobility", copied, {"moving_mass": 1 / 15}),
        ("joint", inverted_and_mislabelled, {}),
    ],
)
def test_values_of_checks_are_numbers_names_codes_and_errors(route, faulty, rig_error, tmp_path, monkeypatch):
    """Laboratories with faults, one of whose recordings is no table, and one of whose static tests is missing.

    Each campaign has checks of 23 codes.
    """
    seen = []
    monkeypatch.setattr(analysis, "select_tables", lambda *given: seen.append(given) or select_tables(*given))
    made = simulate_campaign(
        tmp_path / "made", tyres=[RADIAL_PLY], pressures=[135e3, 205e3], preloads=[1000.0],
        frequencies=[11.0, 14.0, 17.0], repeats=2, rig_error=rig_error,
    )  # fmt: skip
    faulty(made.folder)
    (made.folder / "recordings" / "D3.csv").write_text("t,F1,V1,V2\n0,1,2,x\n")
    (made.folder / "recordings" / "S2.csv").unlink()
    study = analysis.analyse(made.folder, route=route)
    ((campaign, statics, points, _, _, conditions, _),) = seen
    checks = [check for row in statics for check in row.checks] + [check for row in points.checks for check in row]
    checks += [check for _, check in conditions]
    names = {name for test in campaign.tests for name in (test.name, test.file, test.tyre)}
    names |= {"F1", "V1", "V2", "load", "deflection", "pressure", "preload", "temperature", "K2", "C"}
    conditions_named = {condition_words(test) for test in campaign.of_kind("dynamic")} | {
        name for name, _ in conditions
    }
    names |= {part for name in conditions_named for part in (name, *name.split(", "))}
    words = {(check.code, text) for check in checks for text in words_in(check.values, names)}
    assert study.checks.height
    assert not words


#: What takes a text apart, as a method of it or as a function of `re`; trimming an end decides nothing.
TAKES_APART = {
    "partition", "rpartition", "split", "rsplit", "splitlines", "startswith", "endswith", "find", "index", "replace",
    "match", "search", "fullmatch", "sub", "findall", "finditer",
}  # fmt: skip
#: Names of texts that people read.
SENTENCES = ("remark", "sentence", "remedy", "remedies", "cause", "message")
#: A reason without a short form is shown by its first remark; no decision rests on it.
SHOWN = {("fourpole.findings.list", "remarks.split('; ', maxsplit=1)")}


def parsed_sentences(nodes):
    """Calls that take a sentence apart."""
    for node in nodes:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in TAKES_APART:
            for part in (node.func.value, *(node.args if name_of(node.func.value) == "re" else ())):
                named = part.attr if isinstance(part, ast.Attribute) else getattr(part, "id", "")
                if any(word in named.lower() for word in SENTENCES):
                    yield ast.unparse(node)


@pytest.mark.parametrize("code", ["remarks.split('; ')", "re.sub('[0-9]', '', check.remark)", "cause.find(':')"])
def test_a_parsed_sentence_is_seen(code):
    assert list(parsed_sentences(nodes_of(ast.parse(code))))


def test_no_room_parses_a_sentence():
    found = {(module.name, call) for module in modules().values() for call in parsed_sentences(module.nodes)}
    assert found == SHOWN
