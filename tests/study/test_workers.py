"""Worker processes: a file that hangs, crashes or floods its reader rejects its own test, wherever it is read.

The library that misbehaves is a module h5py of the test's own, found before the real one: worker processes have the
same paths as this one.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from tests.entries import entries_of
from tests.processes import environment
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.errors import CampaignError, FileError
from fourpole.io import child as children
from fourpole.study import workers
from fourpole.study.recording import read_recording
from fourpole.study.workers import Workers

pytestmark = pytest.mark.thorough

HURTING = r"""
import ctypes, os, time
class File:
    def __init__(self, file, *args, **settings):
        file.seek(8)
        what = file.read(5).strip(b"\0")
        if what == b"hang":
            while True:
                pass
        if what == b"sleep":
            ctypes.PyDLL(None).usleep(3_600_000_000)  # holds Python all the time
        if what == b"bomb":
            held = [bytearray(1 << 28) for _ in range(100)]
        if what == b"abort":
            os.abort()
        if what == b"crash":
            ctypes.string_at(0)
        raise OSError("is no file")
"""


@pytest.fixture
def hurting(noisy, tmp_path, monkeypatch):
    """A campaign whose test D2 has a recording for a library that does what the file says."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "h5py.py").write_text(HURTING)
    monkeypatch.syspath_prepend(str(library))
    children.child().close(for_good=False)
    noisy.edit("tests.csv", "recordings/D2.csv", "recordings/D2.h5")

    def make(what):
        (noisy.path / "recordings" / "D2.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + what.encode() + bytes(100))
        return noisy

    yield make
    children.child().close(for_good=False)


SAYS = {
    "hang": "recordings/D2.h5 took more than 1 s of processor time; allow more with --time-limit",
    "sleep": "recordings/D2.h5 made no progress for 3 s",
    "abort": "recordings/D2.h5 needs more memory than a file of its size may, or crashed the library that reads it",
    "crash": "recordings/D2.h5 crashed the library that reads it",
    "bomb": "needs more memory than there is",
}


@pytest.mark.parametrize("what", ["hang", "sleep", "abort", "bomb"])
@pytest.mark.sampled(4)
def test_a_file_that_hurts_its_reader_is_one_rejected_row(hurting, what, monkeypatch):
    monkeypatch.setattr(children, "SPARE", 600_000_000)  # filling the usual 3 GB takes long
    monkeypatch.setattr(children, "STALLED", 3.0)
    began = time.monotonic()
    study = hurting(what).analyse(time_limit=60.0 if what == "bomb" else 1.0, route="mobility")
    assert study.dynamic["verdict"].to_list() == ["ok", "rejected", "ok", "ok"]
    assert SAYS[what] in study.dynamic["remarks"][1]
    assert ("export it again" in study.dynamic["remarks"][1]) == (what in ("abort", "bomb"))
    assert ("damaged" in study.dynamic["remarks"][1]) == (what == "abort")
    assert time.monotonic() - began < 120  # `hang` and `sleep` would go on for ever


@pytest.mark.sampled(8)
def test_the_same_rows_come_from_processes_and_from_threads(hurting):
    folder = hurting("crash")
    found = [
        folder.analyse(route="mobility", workers=2),
        folder.analyse(route="mobility", executor=ThreadPoolExecutor(2)),
        folder.analyse(route="mobility", workers=1),
    ]
    assert found[0].dynamic["verdict"].to_list() == ["ok", "rejected", "ok", "ok"]
    assert SAYS["crash"] in found[0].dynamic["remarks"][1]
    assert found[0].dynamic.equals(found[1].dynamic)
    assert found[0].dynamic.equals(found[2].dynamic)
    assert found[0].previews.equals(found[2].previews)
    assert found[0].sha256 == found[2].sha256


@pytest.mark.parametrize("what", ["hang", "crash"])
@pytest.mark.sampled(4)
def test_a_file_that_hurts_its_reader_costs_no_other_of_its_task(hurting, what, monkeypatch):
    monkeypatch.setattr(workers, "_TASKS", 1e-3)  # all recordings in one task
    asked = []
    true = children.Child.calls

    def calls(self, function, pieces, progress=None):
        asked.append(len(pieces))
        return true(self, function, pieces, progress)

    monkeypatch.setattr(children.Child, "calls", calls)
    study = hurting(what).analyse(time_limit=1.0, route="mobility", workers=2)
    assert asked == [4, 1, 1, 1, 1]
    assert study.dynamic["verdict"].to_list() == ["ok", "rejected", "ok", "ok"]
    assert SAYS[what] in study.dynamic["remarks"][1]


@pytest.mark.sampled(6)
def test_a_worker_that_is_killed_once_costs_nothing(noisy, monkeypatch):
    """The recording in its hands is run again."""
    with Workers(2) as pool:
        killed = []

        def kill(done, total):
            if not killed:
                process = next(one._process for one in pool._children if one._process is not None)
                killed.append(process.pid)
                os.kill(process.pid, signal.SIGKILL)

        found = noisy.analyse(route="mobility", executor=pool, progress=kill)
    assert killed
    assert found.dynamic.equals(noisy.analyse(route="mobility").dynamic)


def test_an_executor_that_stops_is_one_error(noisy):
    class Lost(ThreadPoolExecutor):
        def submit(self, *args, **more):
            future = super().submit(time.sleep, 0)
            future.result()
            lost = type(future)()
            lost.cancel()
            lost.set_running_or_notify_cancel()
            return lost

    with pytest.raises(CampaignError, match="run the command again"), Lost(1) as pool:
        noisy.analyse(executor=pool)


@pytest.mark.sampled(4)
def test_few_files_need_no_process_and_many_are_shared(noisy, monkeypatch):
    monkeypatch.setattr(workers, "_MOST", 8)
    monkeypatch.setattr(workers, "processors", lambda: 2)
    made = []
    true = Workers.__init__
    monkeypatch.setattr(Workers, "__init__", lambda self, count: (made.append(count), true(self, count))[1])
    noisy.analyse(route="mobility", cache=None)
    assert made == []
    monkeypatch.setattr(workers, "_PAYS", 0.01)
    noisy.analyse(route="mobility", cache=None)
    assert made == [2]


@pytest.mark.sampled(8)
def test_a_plain_script_needs_no_main(noisy, tmp_path):
    """The workers do not import the script, so its last line is reached once."""
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(f"""
        import fourpole as fp
        study = fp.analyse({str(noisy.path)!r}, workers=2)
        print("counts", study.counts)
        """)
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=100)
    assert done.stdout.count("counts") == 1
    assert done.stderr == ""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -9)])
@pytest.mark.sampled(6)
def test_a_run_that_is_stopped_in_mid_batch_is_gone_on_with(hurting, number, code):
    """The reader of D2 hangs. Ctrl-C reaches the whole group of processes, as in a terminal; a kill the parent alone.

    However the parent ends, its workers end too.
    """
    folder = hurting("hang")
    command = [sys.executable, "-m", "fourpole", "analyse", str(folder.path), "--route", "mobility", "--workers", "2"]
    running = subprocess.Popen(
        [*command, "--tables-only"], stderr=subprocess.PIPE, text=True, start_new_session=True, env=environment()
    )
    kept = folder.path / "results" / "cache"
    wait_for(lambda: len(entries_of(kept)) == 4)  # one static curve, three recordings
    (os.killpg if number == signal.SIGINT else os.kill)(running.pid, number)
    _, said = running.communicate(timeout=10)
    assert running.returncode == code
    assert "what is kept is not done twice" in said or number == signal.SIGKILL
    assert not list(folder.path.glob("results/*.csv"))
    wait_for(lambda: not alive(running.pid))
    before = entries_of(kept)
    assert folder.analyse(route="mobility", cache=kept, time_limit=0.5).counts["rejected"] == 1
    assert entries_of(kept) == before


def wait_for(what, seconds=60.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.05)


def alive(group):
    """Whether a group of processes has a member."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize(("death", "asked"), [(children.Died, 2), (children.Late, 1)])
def test_a_worker_that_dies_is_asked_again_unless_it_was_late(death, asked, monkeypatch):
    calls = []

    def call(*args, **more):
        calls.append(args)
        raise death("ended")

    monkeypatch.setattr(children.Child, "call", call)
    with pytest.raises(death, match="ended"):
        children.answer_of(len, "a file")
    assert len(calls) == asked


@pytest.mark.sampled(4)
def test_check_names_a_crash(hurting):
    ran = CliRunner().invoke(app, ["check", str(hurting("crash").path)])
    assert ran.exit_code == 3
    assert "reader" in ran.stdout


@pytest.mark.sampled(8)
def test_all_routes_to_a_file_limit_the_time_of_its_reader(hurting, monkeypatch):
    monkeypatch.setattr(children, "SECONDS", 1.0)
    folder = hurting("hang")
    file, out = folder.path / "recordings" / "D2.h5", folder.path / "D2.csv"
    for command in (["info", str(file)], ["convert", str(file), str(out)]):
        ran = CliRunner().invoke(app, command)
        assert ran.exit_code == 2
        assert "D2.h5 took more than 1 s of processor time" in ran.stderr
    assert not [one for one in folder.path.iterdir() if "D2.csv" in one.name]
    with pytest.raises(FileError, match=r"D2\.h5 took more than 1 s of processor time"):
        read_recording(file, {"motion_in": "V1 [m/s]"})
    ran = CliRunner().invoke(app, ["check", str(folder.path)])
    assert ran.exit_code == 3
    assert "time" in ran.stdout
    ran = CliRunner().invoke(app, ["init", str(folder.path / "recordings"), "--json"])
    assert ran.exit_code == 0
    assert "D2.h5" in ran.output
