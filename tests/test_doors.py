"""The one door in: what opens files in the source code, and the few places that may do so beside `fourpole.io.door`."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator

import pytest
from tests.sources import modules, name_of, nodes_of

from fourpole.io.recordings import BY_PATH as FORMATS

pytestmark = pytest.mark.thorough

#: Formats whose libraries open paths by themselves, in the guarded worker alone.
BY_PATH = [f"io/formats/{name}.py" for name in FORMATS]
#: Calls by which bytes of a file come in, by the last part of their name.
READS = {
    "open", "fdopen", "read_text", "read_bytes", "open_code", "FileIO", "mmap", "fromfile", "memmap", "loadtxt",
    "genfromtxt", "load", "loadmat", "imread", "File", "MDF", "UFF", "TdmsFile", "ZipFile", "read_csv", "read_parquet",
    "read_ipc", "read_ipc_stream", "read_json", "read_ndjson", "read_excel", "read_database", "scan_csv", "read_wav",
    "scan_parquet", "scan_ipc", "scan_ndjson", "copyfile", "copy2", "copytree", "unpack_archive", "extractall",
}  # fmt: skip
#: Functions of these names that open no path: the door's own, and methods of what is open.
OPENS_NONE = {"read_bytes", "opened.load", "file.load", "self._last.load", "tyre.load", "load", "self.open"}
OPENS_NONE |= {"archive.open", "system.open", "writer.open", "webbrowser.open"}
#: What a library is given: bytes, or an open file.
IN_MEMORY = (
    "content",
    "part",
    "file",
    "opened.file",
    "opened.file.fileno()",
    "file.file.fileno()",
    "number",
    "version",
)
IN_MEMORY_BEGINS = ("io.BytesIO(", "results.read(", "files.read(", "buffer")
#: Where a call may stand, and why. A path with a colon names a function of the file.
MAY = {
    "io/door.py": "the door",
    "io/worker.py": "the worker's own pipes and what the system says of it",
    "io/processes.py": "what the system says of a process",
    "app/events.py": "standard input",
    # made by this process just now, in a new folder that nobody else knows
    "io/published.py": "a writer's own new files",
    "io/lock.py": "opens folders, to lock them, and keeps the former files",
    "io/formats/uff.py": "its own copies of data sets",
    "io/writers.py": "its own parts, and an empty MDF file",
    "export/uff.py": "what it writes",
    "virtual/folder.py": "truth.csv of the folder that it made",
    # package data
    "__main__.py": "the help",
    "report/html.py": "templates and styles, and what the browser printed",
    "app/group.py": "groups of commands",
    "app/options.py": "the words of options",
    "report/selftest/__init__.py": "the reference data",
    "served/site.py": "scripts and styles",
    "export/fmi/description.py": "the source of FMUs, and what the compiler made",
    "plot/lineart.py": "drawings",
    "words/__init__.py": "what a package states: sentences, captions, looks",
    "io/origin.py": "the package's own repository",
    "io/kernel.py": "the source of its library",
    # the user's own
    "served/signals.py": "samples in the user's own cache folder",
    "lab/dataset.py": "the data set",
}


def openings(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and text of each call that opens a path to read it."""
    for node in nodes:
        if not isinstance(node, ast.Call):
            continue
        name = name_of(node.func)
        last = name.rpartition(".")[2]
        if last not in READS or name in OPENS_NONE or (last == "File" and name == "File"):
            continue
        given = ast.unparse(node.args[0]) if node.args else ""
        in_memory = given in IN_MEMORY or given.startswith(IN_MEMORY_BEGINS)
        if not (in_memory and name != "open") and not is_write(node):
            yield node.lineno, ast.unparse(node)


def is_write(call: ast.Call) -> bool:
    """Whether a file is opened to be written, by the mode that stands in the call."""
    if any("O_WRONLY" in ast.unparse(one) or ast.unparse(one) == "_APPEND" for one in call.args):
        return True
    modes = [one.value for one in (*call.args, *(key.value for key in call.keywords)) if isinstance(one, ast.Constant)]
    return any(isinstance(mode, str) and set(mode) & set("wxa") and set(mode) <= set("wxab+t") for mode in modes)


def test_only_the_door_opens_files() -> None:
    found = {}
    for place, module in modules().items():
        if place not in MAY and place not in BY_PATH:
            found |= {f"{place}:{line}": text for line, text in openings(module.nodes)}
    assert found == {}


def test_each_exception_is_one() -> None:
    for place in (*MAY, *BY_PATH):
        assert list(openings(modules()[place].nodes)), place


@pytest.mark.parametrize(
    "line",
    [
        "open(path)",
        "open(path, 'rb')",
        "path.open()",
        "(folder / 'a.csv').read_text()",
        "path.read_bytes()",
        "os.open(path, os.O_RDONLY)",
        "pl.read_csv(path)",
        "pl.scan_parquet(folder / 'a.parquet')",
        "np.load(path)",
        "h5py.File(path, 'r')",
        "zipfile.ZipFile(path)",
        "tomllib.load(path.open('rb'))",
        "shutil.copyfile(path, target)",
    ],
)
def test_a_call_that_opens_a_path_is_seen(line: str) -> None:
    assert list(openings(nodes_of(ast.parse(line))))
