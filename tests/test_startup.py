"""What a process loads before it does its work: every command and every worker waits for that."""

import os
import subprocess
import sys
from importlib.metadata import packages_distributions, version

import pytest
from typer.testing import CliRunner

from fourpole import __main__ as main
from fourpole.app.cli import app
from fourpole.version import VERSION

#: What the reduction of a recording has no use for.
NO_WORKERS = {
    *("fourpole.app", "fourpole.export", "fourpole.findings", "fourpole.planning", "fourpole.plot", "fourpole.report"),
    *("fourpole.core.joint", "fourpole.core.identify", "fourpole.guess", "fourpole.study.study", "fourpole.virtual"),
    *("fourpole.fitting.measured", "fourpole.fitting.modelfile", "fourpole.models.fit", "fourpole.models.interface"),
    *("jinja2", "matplotlib", "pint", "rich", "typer", "scipy.fft", "scipy.optimize", "scipy.signal"),
    *("scipy.special", "scipy.stats"),
}
#: What takes long to load, and is loaded where it is used.
SLOW = {"jinja2", "matplotlib", "pint", "scipy.interpolate", "scipy.optimize", "scipy.signal", "scipy.stats"}


def loaded_by(code):
    """Names of the modules that a new process has loaded after this code."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    code = f"import sys\n{code}\nprint(*sys.modules, sep=chr(10))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    return set(done.stdout.split())


def run(*arguments, code):
    """Code that runs the command and expects this exit code."""
    return (
        f"from fourpole.__main__ import main\nsys.argv = {['fourpole', *arguments]}\n"
        f"try:\n    main()\nexcept SystemExit as end:\n    assert end.code == {code}"
    )


#: Packages that a worker process loads, with those that they load themselves.
OF_WORKERS = {
    *("_polars_runtime_32", "_polars_runtime_64", "_polars_runtime_compat", "numpy", "polars", "scipy"),
    *("annotated_types", "pydantic", "pydantic_core", "typing_extensions", "typing_inspection"),
}
#: What an analysis that writes tables alone has no use for.
NO_ANALYSIS = {
    *("fourpole.fitting.modelparts", "fourpole.guess", "fourpole.plot", "fourpole.report.html"),
    *("fourpole.ride", "fourpole.served", "fourpole.virtual", "jinja2", "matplotlib", "multiprocessing", "pint"),
    *("scipy.fft", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.stats"),
}


def test_a_worker_loads_what_reading_and_demodulation_need():
    loaded = loaded_by("import fourpole.study.workers")
    assert "fourpole.core.demodulation.demodulate" in loaded
    assert not loaded & NO_WORKERS
    packages = {name.partition(".")[0] for name in loaded - loaded_by("pass")} & set(packages_distributions())
    assert packages - {"fourpole"} <= OF_WORKERS


def test_an_analysis_that_writes_tables_loads_no_models_figures_or_optimizers(bench):
    bench.dynamic("D1")
    folder = bench.write()
    words = run("analyse", str(folder), "--tables-only", code=0).replace("    main()", "    main(); sys.exit(0)")
    loaded_by(words)
    with (folder / "campaign.toml").open("a", encoding="utf-8") as statement:
        statement.write("# another statement: what the recording gave is in the cache\n")
    loaded = loaded_by(words)
    assert {"fourpole.study.selection", "fourpole.findings.list"} <= loaded
    if version("scipy") < "1.16":  # scipy.special of earlier ones loads linalg
        loaded -= {"scipy.linalg"}
    assert loaded & NO_ANALYSIS == set()


def test_the_app_begins_without_what_draws_and_what_fits():
    pytest.importorskip("starlette")
    loaded = loaded_by("import fourpole.served.application")
    assert {"fourpole.served.pages.explore", "fourpole.models.operating", "starlette"} <= loaded
    if version("scipy") < "1.16":  # scipy.special of earlier ones loads linalg
        loaded -= {"scipy.linalg"}
    assert not loaded & {"matplotlib", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.signal"}


@pytest.mark.parametrize("arguments", ["analyse", "fit", "report", "rig", "query --frequency=10Hz", "check", "verify"])
@pytest.mark.sampled(2)
def test_a_missing_file_is_said_before_anything_slow_is_loaded(arguments):
    words = arguments.split()
    loaded = loaded_by(run(words[0], "no-such-file", *words[1:], code=2))
    assert not loaded & (SLOW | {"typer", "numpy", "pathlib", "re"})


#: What a command asks for besides its first argument.
MORE = {
    "query": ["--frequency", "10 Hz"],
    "static": ["--load", "3 kN"],
    "export": ["--to", "xlsx"],
    "convert": ["a.csv"],
}


@pytest.mark.parametrize("command", [name for names in main._NOT_THERE.values() for name in names])
@pytest.mark.sampled(4)
def test_a_missing_file_is_said_as_the_command_says_it(command):
    words = [command, "no-such-file", *MORE.get(command, [])]
    ended = CliRunner().invoke(app, words)
    assert ended.exit_code == main._UNREADABLE
    assert ended.stderr == f"error: {main.missing_argument(words)}\n"


@pytest.mark.parametrize(
    "words", [["rig"], ["rig", "--help"], ["rig", "no", "--help"], ["analyse", "no", "."], ["rig", "."], ["no", "no"]]
)
def test_what_may_be_there_is_left_to_the_command_line(words):
    assert not main.missing_argument(words)


def test_the_version_is_printed_without_the_command_line():
    loaded = loaded_by("import fourpole.__main__ as main\nsys.argv = ['fourpole', '--version']\nmain.main()")
    assert {name for name in loaded if name.startswith("fourpole")} <= {
        "fourpole",
        "fourpole.__main__",
        "fourpole.io",
        "fourpole.io.kernel",
        "fourpole.version",
    }
    assert not loaded & {"typer", "numpy", "importlib.metadata", "typing", "pathlib", "hashlib"}


def test_the_list_of_commands_needs_nothing_and_in_a_narrow_terminal_neither_rich_nor_numpy(monkeypatch):
    code = run("--help", code=0)
    assert not loaded_by(code.replace("    main()", "    main(); raise SystemExit(0)")) & {"typer", "pathlib", "numpy"}
    monkeypatch.setenv("COLUMNS", "60")
    loaded = loaded_by(code)
    assert "typer" in loaded
    assert not loaded & {"rich", "numpy", "pydantic", "fourpole.words"}


def test_the_units_that_are_suggested_do_not_load_pint():
    code = (
        "from fourpole.units.kinds import TABLE\nfrom fourpole.units import is_unit, to_si\n"
        "assert all(to_si([1.0], unit, kind).size for kind, one in TABLE.items() for unit in one.units)"
    )
    assert "pint" not in loaded_by(code)


def test_the_package_is_installed_with_the_version_of_the_source():
    assert version("fourpole") == VERSION


def test_to_read_a_plain_table_does_not_load_pint(tmp_path):
    (tmp_path / "a.csv").write_text("t,F1,V1\n" + "".join(f"{i / 50},{i % 7},{i % 5}\n" for i in range(200)))
    code = f"""
from pathlib import Path
from fourpole.io.columns import read_columns
read_columns(Path({str(tmp_path / "a.csv")!r}), ("t", "F1"))
"""
    assert "pint" not in loaded_by(code)
