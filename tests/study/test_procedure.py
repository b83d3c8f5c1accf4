"""One recording of a whole procedure: its rows are read at once, and are parts of one run."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.campaign import read_campaign
from fourpole.campaign.row import begun_at
from fourpole.io import stream as streams
from fourpole.study import analyse, reduce

RATE, FREQUENCIES = 1000.0, (2.0, 5.0, 10.0, 20.0)
CAMPAIGN = """
[rig]
output = "blocked"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F", unit = "N" }
motion_in = { column = "x", unit = "mm" }
[specimens.mount]
"""


@pytest.fixture
def procedure(tmp_path):
    """Four sines with rests in one file, with the window of each."""
    rng, motion, force, windows = np.random.default_rng(5), [], [], []
    for hertz in FREQUENCIES:
        turn = 2 * np.pi * hertz * np.arange(int(6 * RATE)) / RATE
        begun = sum(map(len, motion)) / RATE + 1.0
        windows.append((begun + 0.5, begun + 5.5))
        motion += [np.zeros(int(RATE)), 0.5 * np.sin(turn)]
        force += [np.zeros(int(RATE)), 100.0 * np.sin(turn + 0.1)]
    x, f = np.concatenate(motion), np.concatenate(force)
    x, f = x + 1e-3 * rng.normal(size=x.size), f + 0.1 * rng.normal(size=x.size)
    columns = np.c_[np.arange(x.size) / RATE, x, f]
    np.savetxt(tmp_path / "run.csv", columns, delimiter=",", header="t,x,F", comments="", fmt="%.7g")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    return tmp_path, windows


def state(folder, windows, names=None):
    rows = ["test,file,kind,specimen,frequency [Hz],window [s],segment"]
    for at, (low, high) in enumerate(windows):
        file, hertz = (names or ["run.csv"] * len(windows))[at], FREQUENCIES[at % len(FREQUENCIES)]
        rows.append(f"D{at + 1},{file},dynamic,mount,{hertz:g},{low:g}..{high:g},sine {at + 1}")
    (folder / "tests.csv").write_text("\n".join(rows) + "\n")


def test_the_file_is_opened_hashed_and_read_once_and_the_numbers_are_those_of_each_by_itself(procedure, monkeypatch):
    folder, windows = procedure
    read, hashed, true, hashing = [], [], streams.stream, reduce.sha256_of
    for room in (streams, reduce):  # with further jobs of a file, and without
        monkeypatch.setattr(room, "stream", lambda source: (read.append(source.label), true(source))[1])
    monkeypatch.setattr(reduce, "sha256_of", lambda path, **more: (hashed.append(path.name), hashing(path, **more))[1])
    state(folder, windows)
    together = analyse(folder).dynamic
    assert (read, hashed) == (["run.csv"], ["run.csv"])
    assert together["segment"].to_list() == ["sine 1", "sine 2", "sine 3", "sine 4"]
    for at in range(4):
        (folder / f"copy{at}.csv").write_bytes((folder / "run.csv").read_bytes())
    state(folder, windows, [f"copy{at}.csv" for at in range(4)])
    apart = analyse(folder).dynamic
    assert len(read) == 5
    for name in ("Re K* [N/m]", "u(Im K*) [N/m]", "frequency [Hz]", "verdict"):
        assert together[name].to_list() == apart[name].to_list()


def test_what_is_kept_of_one_row_is_not_that_of_another(procedure):
    folder, windows = procedure
    state(folder, windows)
    first = analyse(folder, cache=folder / "kept").dynamic
    again = analyse(folder, cache=folder / "kept").dynamic
    assert first.equals(again)
    state(folder, [(low + 0.5, high) for low, high in windows])
    moved = analyse(folder, cache=folder / "kept").dynamic
    assert not set(moved["Re K* [N/m]"]) & set(first["Re K* [N/m]"])


def test_copies_are_windows_that_overlap(procedure):
    folder, windows = procedure
    low, high = windows[0]
    state(folder, [*windows, (low + 1.0, high)])
    remarks = analyse(folder).dynamic["remarks"].to_list()
    assert ["that of" in remark for remark in remarks] == [True, False, False, False, True]
    state(folder, [(low, low + 2.5), *windows[1:], (low + 2.5, high)])
    assert not any("that of" in remark for remark in analyse(folder).dynamic["remarks"])


def test_rows_follow_one_another_in_time(procedure, monkeypatch):
    folder, windows = procedure
    monkeypatch.setattr(reduce, "began_at", lambda path: 1.7e9)
    state(folder, windows)
    began, points_of = [], reduce.points_of
    monkeypatch.setattr(
        "fourpole.study.workers.points_of",
        lambda job, done: (began.append(points_of(job, done).began[0]), points_of(job, done))[1],
    )
    analyse(folder)
    assert [time - 1.7e9 for time in began] == pytest.approx([low for low, _ in windows], abs=1e-4)


def test_one_stated_time_of_a_recording_is_that_of_its_start(procedure):
    folder, windows = procedure
    state(folder, windows)
    rows = (folder / "tests.csv").read_text().splitlines()
    (folder / "tests.csv").write_text("\n".join([rows[0] + ",time [s]", *(row + ",100" for row in rows[1:])]) + "\n")
    assert begun_at(read_campaign(folder).tests) == pytest.approx([100 + low for low, _ in windows])
    apart = [f"{row},{100 + at}" for at, row in enumerate(rows[1:])]
    (folder / "tests.csv").write_text("\n".join([rows[0] + ",time [s]", *apart]) + "\n")
    assert begun_at(read_campaign(folder).tests) == pytest.approx([100, 101, 102, 103])
