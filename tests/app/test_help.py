"""Help: there for every command and every option, and there at once."""

import os
import subprocess
import sys
import time

import pytest
import typer
from rich.text import Text

from fourpole.app.cli import app

COMMANDS = typer.main.get_command(app).commands


def spent():
    """Seconds that the processes that ended have worked; by the clock where the system does not count them."""
    times = os.times()
    return times.children_user + times.children_system or times.elapsed or time.perf_counter()


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_comes_within_two_seconds(fourpole, command):
    start = spent()
    ran = fourpole(*command.split(), "--help")
    assert spent() - start < 2.0
    assert (ran.returncode, ran.stderr) == (0, "")
    assert f"fourpole {command}".strip() in ran.stdout
    if not command:
        assert all(name in ran.stdout for name in COMMANDS)


@pytest.mark.parametrize("module", ["numpy", "scipy", "polars", "pint", "pydantic"])
def test_help_loads_nothing_slow(loaded_by_help, module):
    assert "typer" in loaded_by_help
    assert module not in loaded_by_help


@pytest.fixture(scope="module")
def loaded_by_help():
    code = (
        "import sys\n"
        "from fourpole.app.cli import main\n"
        "sys.argv = ['fourpole', '--help']\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "print('loaded:', *sorted({name.partition('.')[0] for name in sys.modules}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, encoding="utf-8")
    return set(done.stdout.splitlines()[-1].split()[1:])


def test_one_thread_of_linear_algebra_is_asked_for_before_numpy_is_loaded():
    """The library reads the environment once, as it is loaded; what the user set stays."""
    code = (
        "import os, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy':\n"
        "            print('threads:', os.environ.get('OPENBLAS_NUM_THREADS'), os.environ.get('OMP_NUM_THREADS'))\n"
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


def test_the_main_command_has_a_help_text_for_all_its_options():
    main = typer.main.get_command(app)
    assert main.help
    assert all(parameter.help for parameter in main.params)


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_the_short_option_says_the_same(run, command):
    assert run(*command.split(), "-h").stdout == run(*command.split(), "--help").stdout


def test_the_default_of_out_is_shown(run):
    assert "CAMPAIGN/results" in run("analyse", "--help").stdout


def test_brackets_of_a_metavar_stand_once(run):
    usage = run("demo", "--help").stdout.strip().splitlines()[0]
    assert "[[" not in usage


def test_the_version_is_that_of_the_package(run):
    from importlib.metadata import version

    assert run("--version").stdout == f"fourpole {version('fourpole')}\n"


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
    """Rich would take an unescaped [deg] for markup and leave it out."""
    assert '"camber [deg]"' in run("fit", "--help").stdout.replace("\n", " ")
    for command in COMMANDS.values():
        for parameter in command.params:
            assert Text.from_markup(parameter.help).plain.replace("\\", "") == parameter.help.replace("\\", "")


@pytest.mark.parametrize("module", ["fourpole", "fourpole.app.cli"])
def test_the_command_runs_as_a_module(module):
    said = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout.startswith("fourpole ")
