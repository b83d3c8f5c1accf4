"""Limits of worker processes: processor time and standing still, whatever the clock says; and which files they read."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.errors import FileError
from fourpole.io import child as children
from fourpole.io.child import Child, Late, Piece, Stalled, read_apart
from fourpole.io.packed import unpack

WORK = """
import ctypes, os, time
def folder():
    return os.getcwd()
def compute(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return "done"
def stand(seconds):
    ctypes.PyDLL(None).usleep(int(seconds * 1e6))  # holds Python all the time
    return "done"
def told(progress):
    progress(1, 2)
    return "done"
def trickle(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        compute(0.05)
        time.sleep(0.1)
    return "done"
"""


@pytest.fixture
def work(tmp_path, monkeypatch):
    """A module with functions for a worker, and a worker."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "work_of_tests.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(library))
    import work_of_tests

    work_of_tests.worker = Child()
    yield work_of_tests
    work_of_tests.worker.close()
    sys.modules.pop("work_of_tests")


def answer(work, function, *args, **limits):
    return unpack(work.worker.call(getattr(work, function), *args, **limits))


@pytest.mark.thorough
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be pinned here")
@pytest.mark.sampled(8)
def test_a_sound_file_is_read_on_a_busy_machine(work):
    """The worker shares its core with five loops: the clock runs beyond the limit, the processor time does not."""
    assert answer(work, "compute", 0.0) == "done"
    core = min(os.sched_getaffinity(0))
    os.sched_setaffinity(work.worker._process.pid, {core})
    pin = f"import os; os.sched_setaffinity(0, {{{core}}})\nwhile True: pass"
    loops = [subprocess.Popen([sys.executable, "-c", pin]) for _ in range(5)]
    try:
        time.sleep(0.5)
        began = time.monotonic()
        assert answer(work, "compute", 0.8, seconds=1.0) == "done"
        assert time.monotonic() - began > 2.0  # what a limit by the clock would have ended
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


@pytest.mark.sampled(6)
def test_the_limit_begins_anew_with_each_piece_of_work(work):
    assert [answer(work, "compute", 0.7, seconds=1.0) for _ in range(4)] == ["done"] * 4
    with pytest.raises(Late, match=r"took more than 1 s of processor time"):
        answer(work, "compute", 600.0, seconds=1.0)
    assert answer(work, "compute", 0.0) == "done"  # in another worker


def test_several_pieces_of_work_have_one_answer_each(work):
    pieces = [Piece((0.0,)), Piece(("soon",)), Piece((0.0,))]
    first, wrong, last = work.worker.calls(work.compute, pieces)
    assert (unpack(first), unpack(last)) == ("done", "done")
    assert isinstance(wrong, RuntimeError)
    assert "TypeError" in str(wrong)


@pytest.mark.sampled(6)
def test_each_of_several_pieces_has_a_limit_of_its_own(work):
    each = [Piece((0.7,), seconds=1.0) for _ in range(3)]
    assert [*map(unpack, work.worker.calls(work.compute, each))] == ["done"] * 3
    answers = work.worker.calls(work.compute, [*each, Piece((600.0,), seconds=1.0), *each])
    assert [type(one) for one in answers] == [Late] * 7  # the answers that were there went with the worker
    assert answer(work, "compute", 0.0) == "done"  # in another worker


@pytest.mark.thorough
@pytest.mark.sampled(4)
def test_work_that_stands_still_is_ended_and_slow_work_is_not(work, monkeypatch):
    monkeypatch.setattr(children, "STALLED", 3.0)
    assert answer(work, "trickle", 6.0) == "done"
    with pytest.raises(Stalled, match="made no progress for 3 s"):
        answer(work, "stand", 600.0, seconds=1.0)
    assert answer(work, "stand", 4.5, seconds=10.0) == "done"  # who allows more time allows that, too


def test_a_worker_has_an_empty_folder_which_goes_with_it(work):
    folder = Path(answer(work, "folder"))
    assert list(folder.iterdir()) == []
    work.worker.close()
    assert not folder.exists()


def test_the_folder_of_a_worker_goes_though_its_parent_is_killed(tmp_path):
    code = (
        "import os, signal\nfrom fourpole.io.child import Child\nfrom fourpole.served.signals import load\n"
        "from fourpole.io.recordings import endings\nworker = Child()\nworker.call(load, ['.csv'])\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, env=environment)
    assert ran.returncode == -9, ran.stderr
    until = time.monotonic() + 60
    while list(tmp_path.iterdir()):
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.fixture
def asked(monkeypatch):
    """The functions that workers are asked for."""
    names = []
    true = Child.calls

    def calls(self, function, *args):
        names.append(function.__name__)
        return true(self, function, *args)

    monkeypatch.setattr(Child, "calls", calls)
    return names


@pytest.mark.sampled(4)
def test_large_text_is_read_in_a_worker_and_small_text_here(noisy, asked, monkeypatch):
    here = noisy.analyse(route="mobility")
    assert asked == []
    monkeypatch.setattr(children, "OWN_BYTES", 1000)
    there = noisy.analyse(route="mobility", cache=None)
    assert sorted(asked) == ["curve_of", *["demodulate_packed"] * 4]
    assert there.sha256 == here.sha256
    for name in ("verdict", "remarks"):
        assert there.dynamic[name].equals(here.dynamic[name])
    assert there.dynamic["C [N s/m]"].to_numpy() == pytest.approx(here.dynamic["C [N s/m]"].to_numpy(), rel=1e-9)


def test_commands_read_large_text_in_a_worker(noisy, asked, monkeypatch):
    monkeypatch.chdir(noisy.path / "recordings")
    small = CliRunner().invoke(app, ["info", "D1.csv"])
    assert asked == []
    monkeypatch.setattr(children, "OWN_BYTES", 1000)
    large = CliRunner().invoke(app, ["info", "D1.csv"])
    assert asked == ["survey", "look_at", "motion_of"]
    assert (small.exit_code, large.exit_code) == (0, 0)
    assert large.stdout == small.stdout


def test_what_is_slow_is_not_called_damaged(noisy, monkeypatch):
    monkeypatch.setattr(children, "OWN_BYTES", 1000)

    def calls(self, function, pieces, progress=None):
        return [Late("took more than 60 s of processor time")] * len(pieces)

    monkeypatch.setattr(Child, "calls", calls)
    with pytest.raises(
        FileError, match=r"D1\.csv took more than 60 s of processor time; it is slow to read, not damaged"
    ):
        read_apart(len, noisy.recording("D1"))
    study = noisy.analyse(route="mobility", cache=None)
    assert set(study.dynamic["verdict"]) == {"rejected"}
    remark = study.dynamic["remarks"][0]
    assert "D1.csv took more than 60 s of processor time; allow more with --time-limit" in remark
    assert "allow more with --time-limit" in " ".join(study.static["remarks"])
    assert "damaged" not in remark.replace("not damaged", "")


def test_a_console_that_breaks_while_progress_is_shown_ends_the_call_and_no_later_one(work):
    def broken(done, total):
        raise BrokenPipeError(f"{done} of {total}")

    with pytest.raises(BrokenPipeError, match="1 of 2"):
        work.worker.call(work.told, progress=broken)
    seen = []
    assert answer(work, "told", progress=lambda *numbers: seen.append(numbers)) == "done"
    assert seen == [(1, 2)]
    assert answer(work, "compute", 0.01) == "done"
