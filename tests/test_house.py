"""The habits of the house that no linter knows."""

import ast
import doctest
import inspect
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from tests.sources import modules, name_of, nodes_of

import fourpole
from fourpole.quantities import QUANTITIES

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LOCKS = [ROOT / f"requirements{name}.lock" for name in ("", "-lowest", "-demo")]
HEAVY = {"matplotlib", "pint", "polars", "pydantic", "rich", "typer"}
#: Files that are longer than 500 lines still; this list only shrinks.
LONG = {"guess/together.py", "study/tables.py"}
SPEAKING = [
    name
    for name in fourpole.__all__
    if callable(obj := getattr(fourpole, name)) and not (isinstance(obj, type) and issubclass(obj, Exception))
]


def in_source(path):
    return path.relative_to(ROOT).as_posix()


def called_names(nodes):
    return (name_of(node.func) for node in nodes if isinstance(node, ast.Call))


def imported_names(nodes):
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def pinned(lock):
    """Name -> versions: a lock for several Pythons may hold more than one."""
    versions = {}
    for name, version in re.findall(r"^([a-z0-9-]+)==(\S+)", lock.read_text(), flags=re.M):
        versions.setdefault(name, []).append(version)
    return versions


def base_requirements():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return [Requirement(text) for text in project["dependencies"]]


#: The table of quantities, what campaign.toml states, and the names of a foreign format's own columns.
HEADS_AT_HOME = {"quantities.py", "campaign/schema.py"}


def literals(nodes):
    """Texts of a module, its docstrings left out."""
    said = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and isinstance(node.body[0], ast.Expr)
    }
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.value


def test_a_head_stands_in_one_file_besides_the_table_of_quantities():
    """A column's head is taken from `fourpole.quantities`; one of a single file's own may stand there."""
    known = {head for one in QUANTITIES for head in (*one.heads, one.stated_head, one.label) if " [" in head}
    places = {}
    for name, module in modules().items():
        for text in set(literals(module.nodes)) if name not in HEADS_AT_HOME else ():
            if text in known or re.fullmatch(r"[^\s,:;][^:;]{0,40} \[[^\[\]\s][^\[\]]{0,11}\]", text):
                places.setdefault(text, set()).add(name)
    assert {head: names for head, names in places.items() if len(names) > 1} == {}
    assert {head: names for head, names in places.items() if head in known} == {}


def test_importing_the_package_loads_nothing_heavy():
    code = "import sys, fourpole; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "fourpole" in loaded
    assert not loaded & HEAVY


FACE = """
    analyse Channel ChannelUncertainty compare demodulate draw fit FourpoleError Identification identify identify_joint
    LoadCurve maxwell_arm models Phasors plan quantity read_campaign read_recording read_results Recording Rig
    simulate_campaign Study
"""


def test_the_face_is_exactly_what_is_promised():
    assert sorted(fourpole.__all__) == sorted(FACE.split())
    assert set(dir(fourpole)) == {*fourpole.__all__, "twoport"}
    assert all(getattr(fourpole, name) is not None for name in dir(fourpole))
    assert inspect.isfunction(fourpole.plan)
    assert inspect.ismodule(fourpole.models)


@pytest.mark.parametrize("room", ["findings", "plot", "study"])
def test_each_name_that_a_room_offers_is_there(room):
    module = import_module(f"fourpole.{room}")
    assert all(hasattr(module, name) for name in module.__all__)


def test_the_four_poles_have_a_module_at_the_top():
    from fourpole.core import twoport
    from fourpole.twoport import __all__ as names

    assert sorted(names) == sorted(twoport.__all__)
    assert all(getattr(fourpole.twoport, name) is getattr(twoport, name) for name in names)


@pytest.mark.parametrize(
    ("name", "home"),
    [
        ("cascade", "twoport"),
        ("energy_loss", "core.tyre"),
        ("identify_mobility", "core.reduced"),
        ("mass", "twoport"),
        ("predict", "core.reduced"),
        ("transmissibility", "core.tyre"),
        ("zener_stiffness", "core.tyre"),
    ],
)
def test_a_name_that_left_the_face_says_where_it_is(name, home):
    with pytest.raises(AttributeError, match=rf"use fourpole\.{home}\.{name}$"):
        getattr(fourpole, name)
    assert callable(getattr(import_module(f"fourpole.{home}"), name))


def test_a_name_that_never_was_is_only_unknown():
    with pytest.raises(AttributeError, match=r"has no attribute 'nothing'$"):
        _ = fourpole.nothing


@pytest.mark.parametrize("name", SPEAKING)
def test_public_names_come_with_an_example(name):
    text = inspect.getdoc(getattr(fourpole, name)) or ""
    _, heading, examples = text.partition("\nExamples\n--------\n")
    assert heading, f"the docstring of fourpole.{name} has no Examples"
    assert ">>> " in examples


def test_every_module_says_what_it_is_and_keeps_quiet():
    assert [name for name, module in modules().items() if not ast.get_docstring(module.tree)] == []
    called = {name: set(called_names(module.nodes)) for name, module in modules().items()}
    barred = {"eval", "exec", "builtins.eval", "builtins.exec"}
    assert {name: bad for name, several in called.items() if (bad := barred & several)} == {}
    assert [name for name, several in called.items() if "print" in several and "app" not in name.split("/")] == []
    unsafe = {"pickle", "cPickle", "cloudpickle", "dill", "joblib", "marshal", "shelve"}
    imported = {
        name: {one.partition(".")[0] for one in imported_names(module.nodes)} for name, module in modules().items()
    }
    assert {name: bad for name, several in imported.items() if (bad := unsafe & several)} == {}


#: Modules by which processes are started, and names by which other modules start them.
STARTERS = {"_posixsubprocess", "_winapi", "multiprocessing", "posix", "pty", "subprocess", "webbrowser"}
STARTS = re.compile("create_subprocess_(exec|shell)|subprocess_(exec|shell)|ProcessPoolExecutor|LocalCluster|startfile")
OF_SYSTEM = re.compile("exec[lv]p?e?|fork|forkpty|popen|posix_spawnp?|spawn[lv]p?e?|system")
#: Where a name of an executor is only asked for: whether that of the user is one of processes.
ASKED = {("study/workers.py", "ProcessPoolExecutor")}


def starts_of(nodes):
    """Names in a module by which it could start a process."""
    yield from (name for name in imported_names(nodes) if name.partition(".")[0] in STARTERS)
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            module, names = node.module or "", [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute):
            module, names = name_of(node.value) if OF_SYSTEM.fullmatch(node.attr) else "", [node.attr]
        else:
            continue
        yield from filter(STARTS.fullmatch, names)
        yield from filter(OF_SYSTEM.fullmatch, names if module == "os" else ())


def test_processes_are_started_by_one_module():
    """`fourpole.io.processes` is the door out: every other start would have the working folder and all variables."""
    starts = {(name, start) for name, module in modules().items() for start in starts_of(module.nodes)}
    assert {start for name, start in starts if name == "io/processes.py"} >= {"subprocess", "create_subprocess_exec"}
    assert {one for one in starts if one[0] != "io/processes.py"} <= ASKED


@pytest.mark.parametrize(
    "code",
    [
        "import subprocess as s", "from multiprocessing import get_context", "import pty", "import webbrowser",
        "import os\nos.system('x')", "import os\nos.posix_spawn('x')", "from os import execv", "os.startfile('x')",
        "asyncio.create_subprocess_exec('x')", "loop.subprocess_exec(f)", "from asyncio import create_subprocess_shell",
        "from asyncio.subprocess import create_subprocess_exec", "concurrent.futures.ProcessPoolExecutor()",
        "from concurrent.futures import ProcessPoolExecutor as P",
    ],
)  # fmt: skip
def test_each_way_to_start_a_process_is_seen(code):
    assert list(starts_of(nodes_of(ast.parse(code))))


_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
#: A number that ends with its decimal point; the end of a sentence is none.
BARE_FLOAT = re.compile(r"(?<![\w.])\d+\.(?![\d.]|\s+[A-Z])")


def bare_floats(text):
    """Expected outputs of the examples of a text that have a float without decimals: any other within 1 matches it."""
    return [one.want for one in doctest.DocTestParser().get_examples(text) if BARE_FLOAT.search(one.want)]


@pytest.mark.parametrize("want", ["0.", "array([0.  , 0.05])", "(200000.+0j)", "-1.\n"])
def test_a_float_without_decimals_is_seen(want):
    assert bare_floats(f">>> x\n{want}")
    assert not bare_floats(">>> x\n[0.0, 12, 1e3, 2..12] maxwell:4. The data")


def docstrings(module):
    """Docstrings of a module, its classes and functions, which have examples."""
    found = (ast.get_docstring(node) for node in module.nodes if isinstance(node, _DOCUMENTED))
    return "\n\n".join(said for said in found if said and ">>>" in said)


def test_examples_have_no_float_without_decimals():
    """pytest's NUMBER compares to the decimals written: `0.` also matches 0.9; write 0.000 or print a list."""
    said = {in_source(path): path.read_text(encoding="utf-8") for path in PAGES}
    said |= {in_source(module.path): docstrings(module) for module in modules().values()}
    assert {path: found for path, text in said.items() if (found := bare_floats(text))} == {}


def test_no_file_is_longer_than_500_lines():
    assert {place for place, module in modules().items() if len(module.text.splitlines()) > 500} <= LONG


@pytest.mark.parametrize("lock", LOCKS, ids=in_source)
def test_a_lock_holds_versions_and_hashes_and_no_address(lock):
    pin = re.compile(r"[a-z0-9-]+==[\w.!+]+( ; [\w.'<>=!* ]+)? \\|    --hash=sha256:[0-9a-f]{64}( \\)?")
    comment = re.compile(r" *#[^/]*")
    strange = [line for line in lock.read_text().splitlines() if not (pin.fullmatch(line) or comment.fullmatch(line))]
    assert strange == []


@pytest.mark.parametrize("lock", LOCKS, ids=in_source)
def test_the_locks_follow_the_project(lock):
    versions = pinned(lock)
    for requirement in base_requirements():
        held = versions.get(requirement.name, [])
        assert held, f"{requirement.name} is not in {lock.name}: run make lock"
        assert all(version in requirement.specifier for version in held), f"{requirement}: run make lock"


def test_the_demonstration_has_the_versions_of_the_developers():
    """So that `make test` after `make demo` installs nothing twice."""
    every, few = (pinned(ROOT / f"requirements{name}.lock") for name in ("", "-demo"))
    assert {name: every.get(name) for name in few} == few
    assert len(few) < 0.3 * len(every)


def test_the_lowest_lock_is_at_the_lower_bounds():
    versions = pinned(ROOT / "requirements-lowest.lock")
    for requirement in base_requirements():
        (bound,) = (part.version for part in requirement.specifier if part.operator == ">=")
        held = versions[
            requirement.name
        ]  # several where a Python too new for the lowest tests has no wheel of the bound
        at_bound = [version for version in held if re.fullmatch(rf"{re.escape(bound)}(\.0)*", version)]
        assert at_bound, f"{requirement} is tested with {held}"


def test_continuous_integration_runs_everything():
    script = ROOT / ".ci" / "run"
    lines = script.read_text().splitlines()
    assert "set -euo pipefail" in lines
    assert lines[-1] == "make test"
    assert script.stat().st_mode & 0o111, "not executable"
