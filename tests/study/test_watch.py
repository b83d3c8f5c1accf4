"""A folder that a logger writes into: what is judged, when, and what is written of it."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from fourpole.app.analysis import run_analysis
from fourpole.app.options import RunOptions, Wanted
from fourpole.campaign import read_campaign
from fourpole.errors import CampaignError
from fourpole.study.watch import SETTLED, Watch
from fourpole.virtual import simulate_campaign


class Clock:
    """A time that the test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An analysed campaign of one specimen."""
    folder = tmp_path_factory.mktemp("whole") / "campaign"
    simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 12.0, 14.0, 16.0, 18.0, 20.0])
    run_analysis(folder, None, "joint", 0, RunOptions(workers=1), Wanted(tables_only=True), as_json=True)
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    """The same, without two of its recordings and their rows."""
    shutil.copytree(whole, tmp_path / "campaign")
    tests = tmp_path / "campaign" / "tests.csv"
    rows = tests.read_text().splitlines()
    tests.write_text("\n".join(row for row in rows if row.split(",")[0] not in ("D3", "D4")) + "\n")
    for name in ("D3", "D4"):
        (tmp_path / "campaign" / "recordings" / f"{name}.csv").unlink()
    return tmp_path / "campaign"


def stated(whole: Path, name: str) -> dict[str, str]:
    """The row of a test in the whole campaign."""
    with (whole / "tests.csv").open(newline="") as file:
        return next(row for row in csv.DictReader(file) if row["test"] == name)


def recorded(whole: Path, name: str) -> bytes:
    return (whole / "recordings" / f"{name}.csv").read_bytes()


def after(watch: Watch, clock: Clock, seconds: float) -> list:
    clock.now += seconds
    return list(watch.look())


def test_a_recording_is_judged_once_when_it_is_all_there(folder: Path, whole: Path) -> None:
    clock = Clock()
    watch = Watch(folder, clock=clock)
    assert after(watch, clock, 10) == []
    row, content = stated(whole, "D3"), recorded(whole, "D3")
    target = folder / "recordings" / f"{row['tyre']}_1.7bar_1000N_{row['frequency [Hz]']}Hz.csv"
    half = content[: content.index(b"\n", len(content) // 2) + 1]
    target.write_bytes(half)
    assert after(watch, clock, 0.5) == []
    assert after(watch, clock, SETTLED - 0.5) == []
    target.write_bytes(content)
    assert after(watch, clock, 0.5) == []
    (judged,) = after(watch, clock, SETTLED)
    assert judged.verdict == "ok", judged.remarks
    assert judged.row["tyre"] == row["tyre"]
    assert judged.row["frequency [Hz]"] == pytest.approx(float(row["frequency [Hz]"]), rel=0.01)
    assert after(watch, clock, 10) == []
    assert read_campaign(folder).tests[-1].file == target.relative_to(folder).as_posix()


def test_it_has_the_stiffness_of_the_whole_campaign(folder: Path, whole: Path) -> None:
    import polars as pl

    clock = Clock()
    watch = Watch(folder, clock=clock)
    row = stated(whole, "D4")
    name = f"{row['tyre']}_1.7bar_1000N_{row['frequency [Hz]']}Hz.csv"
    (folder / "recordings" / name).write_bytes(recorded(whole, "D4"))
    after(watch, clock, 0.5)
    (judged,) = after(watch, clock, SETTLED)
    truth = pl.read_csv(whole / "results" / "dynamic.csv").filter(pl.col("test") == "D4").row(0, named=True)
    for part in ("Re K* [N/m]", "Im K* [N/m]"):
        assert judged.row[part] == pytest.approx(truth[part], abs=4 * judged.row[f"u({part[:5]}) [N/m]"])


def test_a_planned_recording_keeps_its_row(folder: Path, whole: Path) -> None:
    tests = folder / "tests.csv"
    before = tests.read_text()
    line = next(line for line in (whole / "tests.csv").read_text().splitlines() if line.startswith("D3,"))
    tests.write_text(f"{before}{line}\n")
    clock = Clock()
    watch = Watch(folder, clock=clock)
    (folder / "recordings" / "D3.csv").write_bytes(recorded(whole, "D3"))
    after(watch, clock, 0.5)
    (judged,) = after(watch, clock, SETTLED)
    assert (judged.test, judged.verdict, judged.doubts) == ("D3", "ok", ())
    assert tests.read_text() == f"{before}{line}\n"


def test_a_file_that_stays_cut_is_answered_and_again_when_it_is_whole(folder: Path, whole: Path) -> None:
    clock = Clock()
    watch = Watch(folder, clock=clock)
    row, content = stated(whole, "D3"), recorded(whole, "D3")
    target = folder / "recordings" / f"{row['tyre']}_1.7bar_1000N_{row['frequency [Hz]']}Hz.csv"
    target.write_bytes(content[: len(content) // 2 - 3])
    before = (folder / "tests.csv").read_text()
    assert after(watch, clock, 0.1) == []
    (judged,) = [*after(watch, clock, SETTLED), *after(watch, clock, SETTLED)]
    assert judged.verdict == "rejected"
    assert "judged again" in judged.remarks[0]
    assert (folder / "tests.csv").read_text() == before
    target.write_bytes(content)
    after(watch, clock, 0.1)
    (judged,) = after(watch, clock, SETTLED)
    assert judged.verdict == "ok"


def test_a_clipped_recording_is_told_with_its_remedy(folder: Path, whole: Path) -> None:
    clock = Clock()
    watch = Watch(folder, clock=clock)
    lines = recorded(whole, "D3").decode().splitlines()
    at = lines[0].split(",").index("F1")
    highest = max(abs(float(line.split(",")[at])) for line in lines[1:])

    def clipped(line: str) -> str:
        cells = line.split(",")
        cells[at] = str(min(0.6 * highest, max(-0.6 * highest, float(cells[at]))))
        return ",".join(cells)

    row = stated(whole, "D3")
    text = "\n".join([lines[0], *map(clipped, lines[1:])])
    (folder / "recordings" / f"{row['tyre']}_1.7bar_1000N_{row['frequency [Hz]']}Hz.csv").write_text(text)
    after(watch, clock, 0.1)
    (judged,) = [*after(watch, clock, SETTLED), *after(watch, clock, SETTLED)]
    assert judged.verdict in ("warning", "rejected")
    assert judged.remarks


def test_rows_are_added_in_the_units_and_signs_of_the_table(folder: Path, whole: Path) -> None:
    tests = folder / "tests.csv"
    rows = [line.split(",") for line in tests.read_text().splitlines()]
    at = rows[0].index("pressure [bar]")
    rows[0][at] = "pressure [kPa]"
    for cells in rows[1:]:
        cells[at] = f"{100 * float(cells[at]):g}" if cells[at] else ""
    tests.write_text("\n".join(";".join(cells) for cells in rows) + "\n")
    clock = Clock()
    watch = Watch(folder, clock=clock)
    row = stated(whole, "D3")
    name = f"{row['tyre']}_1.7bar_1000N_{row['frequency [Hz]']}Hz.csv"
    (folder / "recordings" / name).write_bytes(recorded(whole, "D3"))
    after(watch, clock, 0.1)
    (judged,) = after(watch, clock, SETTLED)
    assert judged.verdict == "ok"
    assert read_campaign(folder).tests[-1].value("pressure") == pytest.approx(1.7e5)


def test_a_folder_without_a_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=r"campaign\.toml"):
        Watch(tmp_path)
