"""Results that stand: nothing is repeated where nothing has changed, and everything is where anything has."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.conftest import Folder
from tests.processes import environment
from typer.testing import CliRunner

from fourpole.app import standing
from fourpole.app.cli import app
from fourpole.io import userfolders
from fourpole.io.userfolders import user_key

pytestmark = pytest.mark.thorough

STANDS = "its results stand"


def run(folder, *more):
    done = CliRunner().invoke(app, ["analyse", str(folder.path), "--tables-only", "--route", "mobility", *more])
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture
def analysed(noisy):
    """A campaign whose recordings changed long ago, analysed once."""
    for path in noisy.path.rglob("*.*"):
        os.utime(path, ns=(10**18, 10**18))
    return noisy, run(noisy)


def test_a_second_run_says_the_same_and_does_nothing(analysed, monkeypatch):
    noisy, first = analysed
    before = {path: path.stat().st_mtime_ns for path in (noisy.path / "results").rglob("*")}
    monkeypatch.setitem(sys.modules, "fourpole.app.analysis", None)  # importing it would fail
    second = run(noisy)
    assert second.stdout == first.stdout
    assert STANDS in second.stderr
    assert {path: path.stat().st_mtime_ns for path in (noisy.path / "results").rglob("*")} == before
    assert run(noisy, "--json").stdout.startswith("{")


CHANGES = {
    "a recording": lambda folder: folder.cells("D3", slice(0, 1), 3, "0.0001"),
    "the statement": lambda folder: folder.edit("tests.csv", "1.7,1000,14", "1.7,1100,14"),
    "a rig": lambda folder: folder.edit("campaign.toml", 'title = "', 'title = "new '),
    "a result": lambda folder: (
        (folder.path / "results" / "rig.csv").unlink(missing_ok=True)
        or (folder.path / "results" / "dynamic.csv").unlink()
    ),
    "a recording that is gone": lambda folder: folder.recording("S1").unlink(),
}


@pytest.mark.parametrize("what", CHANGES)
@pytest.mark.sampled(4)
def test_whatever_changes_is_analysed_again(analysed, what):
    noisy, _ = analysed
    CHANGES[what](noisy)
    done = CliRunner().invoke(app, ["analyse", str(noisy.path), "--tables-only", "--route", "mobility"])
    assert STANDS not in done.stderr
    assert (noisy.path / "results" / "dynamic.csv").is_file()


def test_other_settings_are_analysed_again(analysed):
    assert STANDS not in run(analysed[0], "--monte-carlo", "0").stderr


def test_other_programs_are_analysed_again(analysed, monkeypatch):
    monkeypatch.setattr(standing, "_programs", standing._programs.__wrapped__)  # anew, as in another process
    monkeypatch.setattr(standing, "version", lambda name: "0.0")
    assert STANDS not in run(analysed[0]).stderr


def test_a_file_that_is_copied_back_stands_by_its_content(analysed):
    noisy, _ = analysed
    content = noisy.recording("D3").read_bytes()
    noisy.recording("D3").unlink()
    noisy.recording("D3").write_bytes(content)
    assert STANDS in run(noisy).stderr


def test_only_verify_sees_a_change_behind_the_same_size_time_and_inode(analysed):
    noisy, _ = analysed
    path = noisy.recording("D3")
    seen = path.stat()
    content = bytearray(path.read_bytes())
    content[-3] = ord("7") if content[-3] != ord("7") else ord("3")
    with path.open("r+b") as file:
        file.write(content)
    os.utime(path, ns=(seen.st_atime_ns, seen.st_mtime_ns))
    assert STANDS in run(noisy).stderr
    assert STANDS not in run(noisy, "--verify").stderr
    assert STANDS in run(noisy, "--verify").stderr


def test_a_second_run_loads_neither_numpy_nor_polars(analysed):
    noisy, _ = analysed
    code = "import sys; from fourpole.app.cli import app; app(standalone_mode=False); print(*sys.modules)"
    words = ["analyse", str(noisy.path), "--tables-only", "--route", "mobility"]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], check=True, capture_output=True, text=True, env=environment()
    )
    assert STANDS in done.stderr, done.stderr
    loaded = {name.partition(".")[0] for name in done.stdout.splitlines()[-1].split()}
    assert "typer" in loaded
    assert not {"numpy", "polars", "scipy", "pint"} & loaded


@pytest.mark.sampled(4)
def test_a_damaged_note_is_no_note(analysed):
    noisy, _ = analysed
    for content in ("", "{", "[]", '{"settings": 1}', "[" * 100_000, '{"signature": "é'):
        Path(noisy.path, "results", "cache", "standing.json").write_text(content)
        assert STANDS not in run(noisy).stderr


def note_of(folder):
    return folder.path / "results" / "cache" / "standing.json"


def test_the_note_is_json_and_an_edited_one_is_not_printed(analysed):
    noisy, first = analysed
    note = json.loads(note_of(noisy).read_text())
    note["note"]["outcome"]["lines"] = ["all tests are good"]
    for said in (json.dumps(note), json.dumps({**note, "signature": "0" * 64}), json.dumps(note["note"])):
        note_of(noisy).write_text(said)
        done = run(noisy)
        assert STANDS not in done.stderr
        assert done.stdout == first.stdout


def test_a_note_that_another_user_wrote_is_not_believed(analysed):
    noisy, _ = analysed
    user_key.cache_clear()
    key = userfolders.config_folder() / "key"
    mine = key.read_bytes()
    key.write_bytes(bytes(32))
    assert STANDS not in run(noisy).stderr
    assert STANDS in run(noisy).stderr
    key.write_bytes(mine)
    user_key.cache_clear()
    assert STANDS not in run(noisy).stderr


def test_a_note_of_another_folder_is_not_believed(analysed, tmp_path):
    """A renamed folder has the same files, with their inodes; an archive may bring a note of this user's along."""
    noisy, _ = analysed
    moved = Folder(noisy.path.rename(tmp_path / "moved"))
    assert STANDS not in run(moved).stderr


def test_a_result_that_was_put_back_with_the_same_size_time_and_inode_is_seen(analysed):
    noisy, _ = analysed
    table = noisy.path / "results" / "dynamic.csv"
    seen, content = table.stat(), table.read_bytes()
    with table.open("r+b") as file:
        file.write(content.replace(b"ok", b"ko"))
    os.utime(table, ns=(seen.st_atime_ns, seen.st_mtime_ns))
    assert table.stat().st_ino == seen.st_ino
    assert STANDS not in run(noisy).stderr
    assert table.read_bytes() == content


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes among the files here")
@pytest.mark.parametrize("place", ["fifo", "link", "folder"])
@pytest.mark.sampled(2)
def test_what_is_no_file_in_place_of_the_note_is_no_note(analysed, tmp_path, place):
    noisy, first = analysed
    outside = tmp_path / "standing.json"
    note_of(noisy).rename(outside)
    content = outside.read_bytes()
    {"fifo": os.mkfifo, "folder": os.mkdir, "link": lambda path: path.symlink_to(outside)}[place](note_of(noisy))
    done = run(noisy)
    assert STANDS not in done.stderr
    assert done.stdout == first.stdout
    assert outside.read_bytes() == content


def test_a_cache_behind_a_link_is_neither_read_nor_written(analysed, tmp_path):
    noisy, first = analysed
    outside = tmp_path / "outside"
    note_of(noisy).parent.rename(outside)
    before = {path: path.stat().st_mtime_ns for path in outside.iterdir()}
    note_of(noisy).parent.symlink_to(outside)
    for _ in range(2):
        done = run(noisy)
        assert STANDS not in done.stderr
        assert "nothing is kept there for a second run" in done.stderr
        assert done.stdout == first.stdout
    assert {path: path.stat().st_mtime_ns for path in outside.iterdir()} == before


@pytest.mark.sampled(2)
def test_without_a_home_folder_all_works_and_nothing_is_said(analysed, monkeypatch, tmp_path):
    noisy, first = analysed
    (tmp_path / "home").write_text("")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    for _ in range(2):
        user_key.cache_clear()
        done = run(noisy)
        assert STANDS not in done.stderr
        assert (done.stdout, done.stderr) == (first.stdout, first.stderr)
    user_key.cache_clear()
