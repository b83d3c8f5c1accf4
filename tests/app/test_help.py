"""Help: there for every command and every option, and there at once."""

import inspect
import json
import os
import subprocess
import sys
from pkgutil import resolve_name

import pytest
import typer
from tests.app.conftest import ENVIRONMENT

from fourpole.app import group
from fourpole.app.cli import app
from fourpole.app.group import _run_of
from fourpole.io.kernel import filling

GROUP = typer.main.get_command(app)
COMMANDS = {name: GROUP.get_command(None, name) for name in GROUP.list_commands(None)}


@pytest.fixture(scope="module")
def helped():
    """What each command prints as its help, one after the other in one new process, and how long that takes.

    Lists of the command, what it printed, its exit code, the seconds that the process has worked for the loading and
    this help, and the modules that are loaded then.
    """
    code = (
        "import contextlib, io, json, sys, time\n"
        "from fourpole.app.cli import main\n"
        "loading = time.process_time()\n"
        "for command in sys.argv[1:]:\n"
        "    start, said, code = time.process_time(), io.StringIO(), None\n"
        "    sys.argv = ['fourpole', *command.split(), '--help']\n"
        "    try:\n"
        "        with contextlib.redirect_stdout(said):\n"
        "            main()\n"
        "    except SystemExit as end:\n"
        "        code = end.code\n"
        "    worked = loading + time.process_time() - start\n"
        "    loaded = sorted({name.partition('.')[0] for name in sys.modules})\n"
        "    print(json.dumps([command, said.getvalue(), code, worked, loaded]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "", *COMMANDS],
        capture_output=True,
        text=True,
        check=True,
        encoding="utf-8",
        env=ENVIRONMENT,
    )
    assert done.stderr == ""
    return {line[0]: line[1:] for line in map(json.loads, done.stdout.splitlines())}


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_comes_within_two_seconds(helped, command):
    said, code, worked, _ = helped[command]
    assert worked < 2.0
    assert code == 0
    assert f"fourpole {command}".strip() in said


def test_the_installed_command_has_the_help(fourpole, helped):
    ran = fourpole("--help")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout == helped[""][0]
    assert all(name in ran.stdout for name in COMMANDS)


@pytest.mark.parametrize("module", ["numpy", "scipy", "polars", "pint"])
def test_no_help_loads_anything_slow(helped, module):
    for _, _, _, loaded in helped.values():
        assert "typer" in loaded
        assert module not in loaded


def test_the_list_of_commands_does_not_load_pydantic(helped):
    assert "pydantic" not in helped[""][3]


@pytest.mark.sampled(2)
def test_one_thread_of_linear_algebra_is_asked_for_before_numpy_is_loaded():
    """The library reads the environment once, as it is loaded; what the user set stays."""
    code = (
        "import os, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy':\n"
        "            print('threads:', os.environ.get('OPENBLAS_NUM_THREADS'), os.environ.get('OMP_NUM_THREADS'))\n"
        "            sys.exit(0)\n"
        "sys.meta_path.insert(0, Watch())\n"
        "from fourpole.app.cli import main\n"
        "words = '--k1=9 kN/m|--k2=9 kN/m|--c=70 N s/m|--mass=15 kg|--preload-stiffness=12 kN/m|--frequency=10 Hz'\n"
        "sys.argv = ['fourpole', 'predict', *words.split('|')]\n"
        "main()\n"
    )
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    for stated, expected in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")):
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            encoding="utf-8",
            env=environment | stated,
        )
        assert f"threads: {expected} 1" in done.stdout.splitlines()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_and_every_parameter_has_a_help_text(command):
    said = COMMANDS[command]
    assert said.help
    assert len(said.help.splitlines()[0]) > 20
    for parameter in said.params:
        assert getattr(parameter, "help", None), f"{command} {parameter.name}"


@pytest.mark.parametrize("command", COMMANDS)
def test_the_signature_that_is_read_is_that_of_the_function(command):
    """Each command is a function that gives an answer, which is shown as --json says."""
    place = group._COMMANDS[command]["run"]
    work = inspect.signature(resolve_name(f"fourpole.app.{place}"))
    read = inspect.signature(_run_of(command)).parameters
    assert {*work.parameters, "as_json"} <= {*read} <= {*work.parameters, "as_json", "remote"}
    assert all(read[name].default == one.default for name, one in work.parameters.items())
    assert work.return_annotation == "Answer"


def test_the_main_command_has_a_help_text_for_all_its_options():
    main = typer.main.get_command(app)
    assert main.help
    assert all(parameter.help for parameter in main.params)


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_the_short_option_says_the_same(run, command):
    assert run(*command.split(), "-h").stdout == run(*command.split(), "--help").stdout


def test_the_default_of_out_is_shown(run):
    assert "CAMPAIGN/results" in run("analyse", "--help").stdout


@pytest.mark.parametrize("command", ["fit", "map", "query", "ride", "causality", "shift", "export", "plot"])
def test_a_specimen_is_chosen_by_specimen_and_by_its_former_name(run, command):
    said = run(command, "--help").stdout
    assert "--specimen" in said
    assert "--tyre" not in said
    context = COMMANDS[command].make_context(command, ["x", "--tyre", "radial"], resilient_parsing=True)
    same = COMMANDS[command].make_context(command, ["x", "--specimen=radial"], resilient_parsing=True)
    assert context.params == same.params
    assert "radial" in str(context.params)


def test_brackets_of_a_metavar_stand_once(run):
    usage = run("demo", "--help").stdout.strip().splitlines()[0]
    assert "[[" not in usage


def test_the_version_is_that_of_the_package(run):
    from importlib.metadata import version

    assert run("--version").stdout == f"fourpole {version('fourpole')} (kernel: {filling()})\n"


@pytest.mark.parametrize(
    "arguments", [["analyze"], ["analyse"], ["analyse", "x", "--rout", "relative"], ["identify", "x"]]
)
def test_a_wrong_call_is_exit_2_without_a_traceback(run, arguments):
    ran = run(*arguments)
    assert ran.exit_code == 2
    assert ran.stdout == ""
    assert "Traceback" not in ran.stderr
    assert len(ran.stderr.splitlines()) <= 10


def test_text_in_brackets_stands_in_the_help(run):
    """The help has no markup, which would take [deg] for a style and leave it out."""
    said = " ".join(run("fit", "--help").stdout.split())
    assert '"camber [deg]"' in said
    assert "\\" not in said


@pytest.mark.parametrize("module", ["fourpole", "fourpole.app.cli"])
def test_the_command_runs_as_a_module(module):
    said = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout.startswith("fourpole ")
