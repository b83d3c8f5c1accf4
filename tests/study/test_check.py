"""check: what the analysis would reject, said before it."""

from __future__ import annotations

import shutil

import numpy as np
import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.errors import CampaignError
from fourpole.study import analyse, reduce
from fourpole.study.check import check_campaign
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def origin(tmp_path_factory):
    return simulate_campaign(
        tmp_path_factory.mktemp("origin"),
        clean=True,
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[10.0, 14.0],
    ).folder


@pytest.fixture
def folder(origin, tmp_path):
    """S1, D1 at 10 Hz and D2 at 14 Hz, to change."""
    return shutil.copytree(origin, tmp_path / "campaign")


def edit(folder, name, old, new):
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new))


def problems(folder, **options):
    checked = check_campaign(read_campaign(folder), **options)
    return [(problem.test, problem.about, problem.verdict, problem.message) for problem in checked.problems]


def rejected_by_analysis(folder, **options):
    study = analyse(folder, monte_carlo=0, **options)
    return {
        name
        for table in (study.static, study.dynamic)
        for name, verdict in table.select("test", "verdict").iter_rows()
        if verdict == "rejected"
    }


def agrees(folder, **options):
    """The one problem there is, which is rejected by check and by the analysis alike."""
    ((test, about, verdict, message),) = [one for one in problems(folder, **options) if one[2] == "rejected"]
    assert verdict == "rejected"
    assert rejected_by_analysis(folder, **options) == {test}
    return test, about, message


def test_nothing_is_wrong_and_nothing_is_written(folder):
    before = sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*"))
    seen = []
    checked = check_campaign(read_campaign(folder), progress=lambda done, whole: seen.append((done, whole)))
    assert checked.counts == {"ok": 3, "warning": 0, "rejected": 0}
    assert checked.problems == ()
    assert checked.notes == tuple(read_campaign(folder).stated.assumptions())
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*")) == before


def test_a_file_that_is_not_there(folder):
    (folder / "recordings" / "D2.csv").unlink()
    assert agrees(folder) == ("D2", "file", "there is no such file; check its name")


def test_a_file_outside_the_folder(folder):
    edit(folder, "tests.csv", "recordings/D2.csv", "../D2.csv")
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "file")
    assert "lies outside the campaign folder" in message


def test_a_file_that_is_no_recording(folder):
    (folder / "recordings" / "D2.csv").write_bytes(b"\x00\x01\x02" * 100)
    assert agrees(folder)[:2] == ("D2", "channels")


def test_a_row_with_a_fault(folder):
    edit(folder, "tests.csv", "D2,recordings/D2.csv,dynamic,radial-ply", "D2,recordings/D2.csv,dynamic,radail-ply")
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "tests.csv")
    assert "did you mean 'radial-ply'" in message


@pytest.mark.parametrize("name", ["S1", "D2"])
def test_a_channel_that_is_not_there(folder, name):
    path = folder / "recordings" / f"{name}.csv"
    table = pl.read_csv(path)
    table.rename({"F": "Fq"} if name == "S1" else {"F1": "F1q"}).write_csv(path)
    test, about, message = agrees(folder)
    assert (test, about) == (name, "static test" if name == "S1" else "channels")
    assert "there is no column 'F" in message
    assert "did you mean 'F" in message


def test_a_channel_that_can_be_spared_warns(folder):
    path = folder / "recordings" / "D2.csv"
    pl.read_csv(path).rename({"V2": "V3"}).write_csv(path)
    ((test, about, verdict, message),) = problems(folder)
    assert (test, about, verdict) == ("D2", "use of V2", "warning")
    assert message.startswith("V2 was left out: ")
    assert rejected_by_analysis(folder) == set()
    assert agrees(folder, route="relative")[0] == "D2"


def test_a_unit_that_the_file_contradicts(folder):
    path = folder / "recordings" / "D2.csv"
    pl.read_csv(path).rename({"F1": "F1 [kN]"}).write_csv(path)
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "channels")
    assert message == "column 'F1' is in 'kN' by the file, in 'N' by campaign.toml: correct the unit in campaign.toml"


def test_a_group_in_a_table_of_text(folder):
    edit(folder, "tests.csv", "recordings/D2.csv", "recordings/D2.csv#warm")
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "channels")
    assert "no groups" in message


@pytest.mark.sampled(4)
def test_a_group_that_is_not_there(folder):
    nptdms = pytest.importorskip("nptdms")
    table = pl.read_csv(folder / "recordings" / "D2.csv")
    with nptdms.TdmsWriter(folder / "recordings" / "D2.tdms") as file:
        for group in ("warm", "test"):
            file.write_segment(
                [
                    nptdms.ChannelObject(group, name, table[name].to_numpy(), {"wf_increment": 1e-3})
                    for name in ("F1", "V1", "V2")
                ]
            )
    edit(folder, "tests.csv", "recordings/D2.csv", "recordings/D2.tdms#tset")
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "channels")
    assert "there is no group 'tset'" in message
    edit(folder, "tests.csv", "D2.tdms#tset", "D2.tdms#test")
    assert problems(folder) == []


def test_a_recording_without_time(folder):
    path = folder / "recordings" / "D2.csv"
    pl.read_csv(path).drop("t").write_csv(path)
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "channels")
    assert "'t'" in message


@pytest.mark.parametrize(
    ("window", "verdict", "said"),
    [
        ("1..3", None, ""),
        ("20..22", "rejected", "holds no samples: the recording runs 0 to "),
        ("1..99", "warning", "goes beyond the recording"),
        ("1..1.1", "rejected", "at least 3 are needed"),
    ],
)
@pytest.mark.sampled(2)
def test_a_window(folder, window, verdict, said):
    text = (folder / "tests.csv").read_text().splitlines()
    rows = [f"{line}," + (window if line.startswith("D2") else "") for line in text[1:]]
    (folder / "tests.csv").write_text("\n".join([f"{text[0]},window [s]", *rows]) + "\n")
    found = problems(folder)
    assert [(one[0], one[2]) for one in found] == ([("D2", verdict)] if verdict else [])
    assert not verdict or said in found[0][3]
    assert rejected_by_analysis(folder) == ({"D2"} if verdict == "rejected" else set())


def test_a_recording_too_short_for_its_frequency(folder):
    path = folder / "recordings" / "D2.csv"
    pl.read_csv(path).head(200).write_csv(path)
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "recording")
    assert message == "holds 2.7 cycles of 13.75 Hz, at least 3 are needed: record longer"


def test_a_rate_too_low_for_the_frequency(folder):
    path = folder / "recordings" / "D2.csv"
    pl.read_csv(path).gather_every(40).write_csv(path)
    found = problems(folder)
    assert [(one[0], one[1], one[2]) for one in found] == [("D2", "recording", "rejected")]
    assert "an excitation at 14 Hz is not resolved by 25 samples per second" in found[0][3]


def test_dynamic_tests_that_find_no_static_one(folder):
    edit(
        folder,
        "tests.csv",
        "D2,recordings/D2.csv,dynamic,radial-ply,1.7",
        "D2,recordings/D2.csv,dynamic,radial-ply,2.1",
    )
    ((test, about, verdict, message),) = problems(folder)
    assert (test, about, verdict) == ("D2", "K1", "warning")
    assert message.startswith("K2 and C would be left blank: no static test of specimen 'radial-ply' at this pressure")
    row = analyse(folder, monte_carlo=0).dynamic.filter(pl.col("test") == "D2").row(0, named=True)
    assert message.removeprefix("K2 and C would be left blank: ") in row["remarks"]


def test_a_static_test_that_fails_takes_its_k1_along(folder):
    (folder / "recordings" / "S1.csv").unlink()
    assert [one[:3] for one in problems(folder)] == [
        ("S1", "file", "rejected"),
        ("D1", "K1", "warning"),
        ("D2", "K1", "warning"),
    ]


def test_the_same_recording_twice(folder):
    edit(folder, "tests.csv", "recordings/D2.csv", "recordings/D1.csv")
    wrong, *found = problems(folder)
    assert wrong[:3] == ("D2", "stated frequency", "rejected")
    assert [one[:3] for one in found] == [("D2", "duplicate", "warning")]
    assert "is the recording of test 'D1' (row " in found[0][3]


def test_a_copy_under_another_name(folder):
    shutil.copy(folder / "recordings" / "D1.csv", folder / "recordings" / "D2.csv")
    wrong, *found = problems(folder)
    assert wrong[:3] == ("D2", "stated frequency", "rejected")
    assert [one[:3] for one in found] == [("D2", "duplicate", "warning")]
    assert "has the same content as 'recordings/D1.csv'" in found[0][3]


def test_without_a_rig_the_relative_route_is_looked_at(folder):
    text = (folder / "campaign.toml").read_text()
    start, end = text.index("[rig]"), text.index("[channels]")
    (folder / "campaign.toml").write_text(text[:start] + text[end:])
    checked = check_campaign(read_campaign(folder))
    assert checked.route == "relative"
    assert checked.counts["ok"] == 3
    assert checked.notes[0].startswith("no rig is stated: K* by the relative route")


def test_a_route_that_is_none(folder):
    with pytest.raises(CampaignError, match="no route 'best'"):
        check_campaign(read_campaign(folder), route="best")


def changed(folder, change):
    """D2 at 14 Hz, its columns changed by a function of the table's time and columns."""
    path = folder / "recordings" / "D2.csv"
    table = pl.read_csv(path)
    columns = {name: table[name].to_numpy() for name in table.columns}
    table.with_columns(**change(columns["t"], columns)).write_csv(path)


def test_a_frequency_that_the_recording_does_not_have(folder):
    edit(folder, "tests.csv", "1.7,1000,14", "1.7,1000,80")
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "stated frequency")
    assert "the recording turns at 14" in message
    assert "80 Hz is stated" in message


def test_a_sensor_that_is_not_connected(folder):
    changed(folder, lambda t, columns: {"F1": pl.Series(1e-6 * np.random.default_rng(1).normal(size=t.size))})
    test, about, message = agrees(folder)
    assert (test, about) == ("D2", "excitation of F1")
    assert "hardly moves" in message


def test_a_tyre_that_lifts_off(folder):
    edit(folder, "tests.csv", "1.7,1000,14", "1.7,10,14")
    test, about, _ = agrees(folder)
    assert (test, about) == ("D2", "lift-off")


def test_what_lies_behind_the_first_part_is_not_looked_at(folder):
    """At 14 Hz the part is 2 s at most."""
    changed(folder, lambda t, columns: {"F1": pl.Series(np.where(t > 2.2, np.nan, columns["F1"]))})
    assert problems(folder) == []
    changed(folder, lambda t, columns: {"F1": pl.Series(np.where(t > 0.2, np.nan, columns["F1"]))})
    assert [one[:3] for one in problems(folder)] == [("D2", "recording", "rejected")]


def parts_read(folder, monkeypatch):
    """Lengths [s] of the parts that check reads of each recording; no test states its frequency."""
    edit(folder, "tests.csv", "1.7,1000,14", "1.7,1000,")
    edit(folder, "tests.csv", "1.7,1000,10", "1.7,1000,")
    lengths, load = {}, reduce.load_recording

    def loaded(place, path, *more, part, read):
        lengths.setdefault(path.stem, []).append(part)
        return load(place, path, *more, part=part, read=read)

    monkeypatch.setattr(reduce, "load_recording", loaded)
    problems(folder)
    return lengths


def test_without_a_stated_frequency_two_seconds_are_read(folder, monkeypatch):
    changed(folder, lambda t, columns: {"F1": pl.Series(np.where(t < 1.0, np.nan, columns["F1"]))})
    assert parts_read(folder, monkeypatch) == {"D1": [2.0], "D2": [2.0, 2.0]}


def test_of_a_slow_drive_twenty_cycles_are_read(folder, monkeypatch):
    """Two seconds hold 1.6 cycles; eight are the first part with four, which a frequency needs."""
    t, hertz, rng = np.arange(0.0, 60.0, 0.01), 0.8, np.random.default_rng(1)
    waves = {name: np.sin(2 * np.pi * hertz * t) + 0.01 * rng.normal(size=t.size) for name in ("F1", "V1", "V2")}
    pl.DataFrame({"t": t, **waves}).write_csv(folder / "recordings" / "D2.csv")
    *found, whole = parts_read(folder, monkeypatch)["D2"]
    assert found == [2.0, 4.0, 8.0]
    assert whole == pytest.approx(20 / hertz, rel=0.05)


@pytest.mark.parametrize("noise", [1e-5, 0.0])
@pytest.mark.parametrize("stated", ["14", ""])
@pytest.mark.sampled(2)
def test_a_lead_in_warns(folder, noise, stated):
    """The analysis cuts it; the check sees nothing else, and says so without a rejection."""
    edit(folder, "tests.csv", "1.7,1000,14", f"1.7,1000,{stated}")
    path = folder / "recordings" / "D2.csv"
    table = pl.read_csv(path)
    rng = np.random.default_rng(1)
    still = {"t": np.arange(2500) / 1000, **{name: noise * rng.normal(size=2500) for name in ("F1", "V1", "V2")}}
    shifted = table.with_columns(pl.col("t") + 2.5)
    pl.concat([pl.DataFrame(still), shifted.select(list(still))]).write_csv(path)
    assert {one[2] for one in problems(folder)} == {"warning"}
    assert rejected_by_analysis(folder) == set()


def test_a_plain_recording_is_not_demodulated(folder, monkeypatch):
    """A recording without a fault costs one fit of a sine, which keeps the check cheap."""

    def demodulate(*_, **__):
        raise AssertionError("a closer look at a plain recording")

    monkeypatch.setattr(reduce, "demodulate", demodulate)
    assert problems(folder) == []
