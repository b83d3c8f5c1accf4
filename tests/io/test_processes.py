"""The one door out: which program is started, in which folder, with which variables, and how it ends."""

from __future__ import annotations

import ast
import asyncio
import os
import signal
import stat
import sys
import time
from pathlib import Path

import pytest

from fourpole.io import processes
from fourpole.io.processes import PIPE, interrupt, module_folders, output_of, program_path, start, start_module

ROOT = str(Path(processes.__file__).parents[2])
TELLS = "import os, sys; print((os.getcwd(), sorted(os.environ), os.listdir(), os.stat('.').st_mode))"
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the programs of the tests are scripts of a shell")


def told(**settings):
    """Working folder, names of variables, content and mode of the folder of a program."""
    code, printed, said = output_of([sys.executable, "-c", TELLS], seconds=60.0, **settings)
    assert code == 0, said
    return ast.literal_eval(printed.decode())


def program(folder, name="tool", script="exit 0"):
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)
    return folder / name


def test_a_program_begins_in_an_empty_folder_of_its_own():
    folder, _, content, mode = told()
    assert content == []
    assert stat.S_IMODE(mode) == 0o700
    assert Path(folder) != Path.cwd()
    assert not Path(folder).exists()
    assert told()[0] != folder


def test_a_program_has_named_variables_alone(monkeypatch):
    for name in (
        "AWS_SECRET_ACCESS_KEY",
        "HTTPS_PROXY",
        "https_proxy",
        "GITHUB_TOKEN",
        "GIT_DIR",
        "DISPLAY",
        "PYTHONSTARTUP",
    ):
        monkeypatch.setenv(name, "1")
    for name in ("FOURPOLE_DEBUG", "LC_ALL", "OMP_NUM_THREADS", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "C")
    monkeypatch.setenv("FOURPOLE_REMOTE", "")
    _, names, _, _ = told(variables={"OWN": "1"}, also=("DISPLAY",))
    assert {"FOURPOLE_DEBUG", "LC_ALL", "OMP_NUM_THREADS", "XDG_CACHE_HOME", "PATH", "OWN", "DISPLAY"} <= {*names}
    assert not {"AWS_SECRET_ACCESS_KEY", "HTTPS_PROXY", "https_proxy", "GITHUB_TOKEN", "GIT_DIR", "PYTHONSTARTUP"} & {
        *names
    }
    assert not {"PYTHONPATH"} & {*names}
    monkeypatch.setenv("FOURPOLE_REMOTE", "1")
    _, names, _, _ = told()
    assert {"AWS_SECRET_ACCESS_KEY", "HTTPS_PROXY", "https_proxy"} <= {*names}
    assert not {"GITHUB_TOKEN", "DISPLAY"} & {*names}


def test_a_relative_folder_of_a_variable_is_that_of_this_process(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", "temporary")
    monkeypatch.setenv("PATH", os.pathsep.join(["", ".", "bin", "/usr/bin", "/bin"]))
    code, printed, _ = output_of(["/bin/sh", "-c", "echo $TMPDIR; echo $PATH"], seconds=60.0)
    assert (code, printed.decode().split()) == (0, [str(tmp_path / "temporary"), "/usr/bin:/bin"])


def test_a_program_is_found_in_absolute_folders_alone(tmp_path, monkeypatch):
    place = program(tmp_path / "bin")
    monkeypatch.chdir(place.parent)
    for path in ("", ".", os.pathsep, "../bin", os.pathsep.join([".", str(tmp_path)])):
        monkeypatch.setenv("PATH", path)
        assert program_path("tool") is None
        assert program_path("./tool") is None
    assert program_path(str(place)) == str(place)
    monkeypatch.setenv("PATH", os.pathsep.join([".", str(place.parent)]))
    assert program_path("tool") == str(place)
    place.chmod(0o644)
    assert program_path("tool") is None


@pytest.mark.parametrize("name", ["sh", "./sh", "bin/sh"])
def test_a_program_without_an_absolute_path_is_not_started(name):
    with pytest.raises(ValueError, match="no absolute path"):
        start([name])


def test_a_program_that_cannot_be_started_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(OSError, match="No such file"):
        start([str(tmp_path / "none")])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.sampled(4)
def test_a_program_that_is_late_ends_with_all_that_it_started(tmp_path):
    place = program(tmp_path / "bin", script=f"sleep 600 &\necho $! > {tmp_path}/pid\nwait")
    with pytest.raises(TimeoutError, match="within 3 s"):
        output_of([str(place)], seconds=3.0)
    inner = int((tmp_path / "pid").read_text())
    until = time.monotonic() + 60
    while Path(f"/proc/{inner}/stat").exists() and Path(f"/proc/{inner}/stat").read_text().split()[2] != "Z":
        assert time.monotonic() < until
        time.sleep(0.05)


def test_an_interrupted_process_ends_as_by_ctrl_c():
    process = start(
        [sys.executable, "-c", "import time; print(1, flush=True); time.sleep(600)"],
        stdout=PIPE,
        stderr=PIPE,
        group=True,
    )
    assert os.getpgid(process.pid) == process.pid != os.getpgrp()
    assert process.stdout.readline() == b"1\n"
    interrupt(process)
    _, said = process.communicate()
    assert b"KeyboardInterrupt" in said
    assert process.returncode == -signal.SIGINT
    interrupt(process)  # it has ended: nothing happens


def test_modules_are_found_where_this_process_finds_them(tmp_path, monkeypatch):
    """The package first of all, and further folders; not the working folder, a relative one, a campaign, a script's."""
    more, script, campaign, guessed = (tmp_path / name for name in ("more", "script", "campaign", "guessed"))
    for folder in (more, script, campaign, guessed):
        folder.mkdir()
    (campaign / "campaign.toml").touch()
    (guessed / "tests.csv").symlink_to("nothing")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(script / "run.py"), raising=False)
    unwanted = ["", ".", "more", str(tmp_path), f"{tmp_path}/more/..", str(script), str(campaign), str(guessed)]
    monkeypatch.setattr(sys, "path", [*unwanted, str(more), *sys.path])
    folders = module_folders()
    assert str(more) in folders
    assert ROOT in folders
    assert not {*unwanted} & {*folders}
    monkeypatch.setattr(sys, "path", [])
    assert module_folders() == [ROOT]
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "path", ["", ROOT])
    assert module_folders() == [ROOT]


def test_a_further_process_runs_the_same_package(tmp_path, monkeypatch):
    for name in ("fourpole", "typer"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    process = start_module("fourpole", "--version", stdout=PIPE)
    printed, _ = process.communicate()
    assert printed.decode().startswith("fourpole ")

    async def version():
        async with processes.running_module("fourpole", "--version", limit=1000) as running:
            line = await running.stdout.read()
            return line, await running.wait()

    assert asyncio.run(version()) == (printed, 0)


def test_the_processor_time_of_a_process_is_known():
    if not Path("/proc/self/stat").exists():
        pytest.skip("the system does not tell")
    code = "import time\nwhile time.process_time() < 0.3: pass\nprint(1, flush=True)\ntime.sleep(600)"
    with start([sys.executable, "-c", code], stdout=PIPE) as process:
        process.stdout.readline()
        assert 0.25 < processes.cpu_time(process) < 5.0
        process.kill()
    assert processes.cpu_time(process) is None
