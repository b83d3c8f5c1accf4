"""analyse: what it prints and writes, what it says of a campaign that it cannot read, and how it stops."""

import importlib
import json
import os
import re
import shutil
import signal
import sys
import time

import numpy as np
import polars as pl
import pytest
from tests.entries import entries_of

from fourpole.io.packed import unpack
from fourpole.study import cache as cache_room
from fourpole.study import static
from fourpole.virtual import CROSS_PLY, simulate_campaign

TABLES = ("static.csv", "dynamic.csv", "dynamic.parquet", "phasors.parquet", "study.json")


def tree(folder):
    """All below a folder, with the content of the files."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")
    }


def edit(path, old, new):
    text = path.read_text()
    assert text.count(old) >= 1, old
    path.write_text(text.replace(old, new, 1))


def errors(ran):
    """The lines on stderr, without the note that a virtual rig has no ordinary errors."""
    zero = 'note: [unstated] ordinary = "zero"'
    return [line for line in ran.stderr.splitlines() if not line.startswith(zero)]


# -- what it prints --------------------------------------------------------------------------------------------------


def test_a_good_campaign_ends_with_its_table_and_exit_0(run, campaign):
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 0
    (rests,) = errors(ran)  # one line, whatever its length
    assert rests.startswith("note: [rig]: K' rests on ")
    assert "; these tests would not show " in rests
    *table, count, place = ran.stdout.splitlines()
    assert table[0] == "At 17 Hz; ± is U (k = 2):"
    assert re.split(r" {2,}", table[1].strip())[:3] == ["K1 [kN/m]", "|K*| [kN/m]", "δ [°]"]
    assert len(table) <= 22
    assert max(map(len, table)) <= 80
    assert [count, place] == [
        "4 tests, 4 ok, 0 with a warning, 0 rejected (route: joint)",
        f"results: {campaign / 'results'}",
    ]
    assert set(TABLES) <= {path.name for path in (campaign / "results").iterdir()}


def test_what_is_rejected_is_said_and_is_exit_3(run, campaign):
    (campaign / "recordings" / "D2.csv").unlink()
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 3
    assert errors(ran)[:-1] == ["rejected: D2: recordings/D2.csv: there is no such file; check its name"]
    assert "4 tests, 3 ok, 0 with a warning, 1 rejected" in ran.stdout


def test_assumptions_are_notes_on_stderr(run, campaign):
    edit(campaign / "campaign.toml", ", std = 0.5 }", " }")
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 0
    said = "note: [rig] preload_damping: no std stated, taken as 2 % (exact = true if it is exact)"
    assert errors(ran)[1:] == [said]


@pytest.mark.parametrize("route", ["joint", "mobility", "relative", "transmissibility"])
def test_the_summary_for_programs_is_one_json_document(run, campaign, route):
    (campaign / "recordings" / "D2.csv").unlink()
    ran = run("analyse", campaign, "--json", "--route", route, "--tables-only")
    assert ran.exit_code == 3
    said = json.loads(ran.stdout)
    assert said["route"] == route
    assert said["results"] == str(campaign / "results")
    assert said["verdicts"] == {"ok": 3, "warning": 0, "rejected": 1}
    (rejected,) = said["rejected"]
    assert rejected["test"] == "D2"
    assert "there is no such file" in rejected["remarks"]
    (zero,) = said["assumptions"]
    assert zero.startswith('[unstated] ordinary = "zero"')
    assert [" rests on " in text for text in said["notes"]] == [True] * (route == "joint")


def test_many_tests_rejected_alike_are_one_line(run, campaign):
    rows = (campaign / "tests.csv").read_text().splitlines()
    rows += [f"X{i},recordings/X{i}.csv,dynamic,radial-ply,1.7,1000,10" for i in range(40)]
    (campaign / "tests.csv").write_text("\n".join(rows) + "\n")
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 3
    lines = ran.stderr.splitlines()
    assert lines[0].startswith("rejected: 40 tests (X0, X1, X2, X3, X4, X5 and 34 more): recordings/X0.csv")
    assert "44 tests, 4 ok, 0 with a warning, 40 rejected" in ran.stdout


def test_results_go_where_out_says(run, campaign, tmp_path):
    before = tree(campaign)
    ran = run("analyse", campaign, "--out", tmp_path / "a" / "b", "--tables-only")
    assert ran.exit_code == 0
    assert tree(campaign) == before
    assert set(TABLES) <= {path.name for path in (tmp_path / "a" / "b").iterdir()}
    run("analyse", campaign, "--tables-only")
    for name in TABLES:
        there, here = (folder / name for folder in (tmp_path / "a" / "b", campaign / "results"))
        assert content_of(there) == content_of(here)


def content_of(path):
    """The bytes of a result; of study.json without the path of the campaign, and the seal over it."""
    if path.name != "study.json":
        return path.read_bytes()
    record = json.loads(path.read_text())
    return {key: value for key, value in record.items() if key not in ("campaign", "seal")}


@pytest.mark.sampled(4)
def test_figures_and_report_come_with_the_tables_also_of_a_hurt_campaign(run, campaign):
    for path in (campaign / "recordings").glob("[SD][12].csv"):
        path.unlink()
    ran = run("analyse", campaign)
    assert ran.exit_code == 3
    report = (campaign / "results" / "report.html").read_text(encoding="utf-8")
    assert "there is no such file" in report
    assert list((campaign / "results" / "figures").glob("*.svg"))


def test_names_in_the_campaign_cannot_steer_the_terminal(run, campaign):
    edit(campaign / "tests.csv", "D2,recordings/D2.csv", "\x1b[31mD2\x07,recordings/\x1b]0;x\x07.csv")
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 3
    assert not {"\x1b", "\x07"} & set(ran.output)


def test_brackets_in_names_are_no_markup(run, campaign):
    edit(campaign / "tests.csv", "D2,recordings/D2.csv", "[bold]D2[/bold],recordings/[red].csv")
    ran = run("analyse", campaign, "--tables-only")
    assert "rejected: [bold]D2[/bold]: recordings/[red].csv: there is no such file" in ran.stderr


# -- campaigns that cannot be read -----------------------------------------------------------------------------------


def toml(old, new):
    return lambda folder: edit(folder / "campaign.toml", old, new)


def listed(old, new):
    return lambda folder: edit(folder / "tests.csv", old, new)


def content(name, text):
    return lambda folder: (folder / name).write_bytes(text)


def cut(name, mark, *, keep):
    """Of a file, only what is before a mark, or only what is from it on."""

    def make(folder):
        text = (folder / name).read_text()
        at = text.index(mark)
        (folder / name).write_text(text[:at] if keep == "before" else text[at:])

    return make


def pipe(folder):
    (folder / "campaign.toml").unlink()
    os.mkfifo(folder / "campaign.toml")


FAULTS = {
    # campaign.toml as a file
    "broken": (content("campaign.toml", b"[rig\nx = 1"), [], ["campaign.toml", "not valid TOML", "line 1"]),
    "twice": (toml("[rig]", "[rig]\n[rig]"), [], ["campaign.toml", "not valid TOML"]),
    "missing": (lambda f: (f / "campaign.toml").unlink(), [], ["no campaign yet", "fourpole init"]),
    "latin-1": (
        content("campaign.toml", 'title = "a"\n# Prüfung'.encode("latin-1")),
        [],
        ["line 2 is not UTF-8", "save"],
    ),
    "utf-16": (content("campaign.toml", "[rig]".encode("utf-16")), [], ["campaign.toml: line 1 is not UTF-8", "save"]),
    "empty": (content("campaign.toml", b""), [], ["campaign.toml: is empty"]),
    "blank": (content("campaign.toml", b"\n"), [], ["campaign.toml", "channels", "is missing"]),
    "a pipe": (pipe, [], ["campaign.toml: is a pipe or device"]),
    "very deep": (
        content("campaign.toml", b"a = " + b"[" * 9999 + b"]" * 9999),
        [],
        ["campaign.toml", "not valid TOML"],
    ),
    # its keys
    "unknown key": (toml("[rig]", "[rgi]"), [], ["campaign.toml: rgi: unknown key; did you mean 'rig'?"]),
    "unknown key of the rig": (
        toml("moving_mass ", "moving_mas "),
        [],
        ["campaign.toml: [rig]", "'moving_mas'", "did you mean 'moving_mass'?"],
    ),
    "unknown key of a value": (
        toml("std = 0.01", "sdt = 0.01"),
        [],
        ["[rig]", "moving_mass", "'sdt'", "did you mean 'std'?"],
    ),
    "unknown channel": (toml("motion_out", "motion_oot"), [], ["[channels] motion_oot", "did you mean 'motion_out'?"]),
    "unknown key of a channel": (toml("delay =", "delya ="), [], ["motion_in.delya", "did you mean 'delay'?"]),
    "no channels": (cut("campaign.toml", "[channels]", keep="before"), [], ["campaign.toml", "channels", "is missing"]),
    "no rig": (
        cut("campaign.toml", "[channels]", keep="after"),
        ["--route", "mobility"],
        ["[rig] is missing", "moving_mass", "--route relative"],
    ),
    "no mass": (
        toml("moving_mass ", "tyre_mass "),
        [],
        ["[rig]", 'moving_mass is missing: state it, as moving_mass = "15 kg"'],
    ),
    "no motion": (toml("motion_in ", "# motion_in "), [], ["[channels] motion_in is missing, dynamic tests need it"]),
    "no load": (toml("load ", "# load "), [], ["[channels] load is missing, static tests need it"]),
    "no time": (toml("time ", "# time "), [], ["[channels] time is missing", 'sample_rate = "2 kHz"']),
    "two clocks": (toml("time ", 'sample_rate = "1 kHz"\ntime '), [], ["time and sample_rate", "keep one"]),
    "no column": (toml('column = "F1", ', ""), [], ["[channels] force_in.column", "is missing"]),
    # its values
    "zero mass": (toml("value = 15.0,", "value = 0.0,"), [], ["[rig]", "moving_mass is 0 kg", "positive"]),
    "negative mass": (toml("value = 15.0,", "value = -15.0,"), [], ["[rig]", "moving_mass is -15 kg", "positive"]),
    "mass without number": (toml("value = 15.0,", "value = nan,"), [], ["[rig]", "moving_mass", "finite number"]),
    "negative spring": (toml("value = 12.44,", "value = -12.44,"), [], ["preload_stiffness is -12440 N/m"]),
    "negative std": (toml("std = 0.01", "std = -0.01"), [], ["moving_mass", "std is negative"]),
    "wrong kind of unit": (toml('unit = "kg"', 'unit = "N"'), [], ["moving_mass", "'N' is a force; a mass is needed"]),
    "unknown unit": (
        toml('unit = "kN/m"', 'unit = "kN/em"'),
        [],
        ["preload_stiffness", "unknown unit", "did you mean"],
    ),
    "channel of another kind": (
        toml('unit = "kN"', 'unit = "mm"'),
        [],
        ["force_in", "'mm' is a length; a force is needed"],
    ),
    "no unit": (toml('unit = "kN", ', ""), [], ["force_in", 'unit is missing: write it, as unit = "N"']),
    "bare mass": (toml('{ value = 15.0, unit = "kg", std = 0.01 }', "15"), [], ["moving_mass", 'as "15 kg"']),
    "bare delay": (toml('"0.2 ms"', "0.2"), [], ["motion_in.delay", "has no unit; write it as in '0.2 ms'"]),
    "gain in words": (toml("gain = 1.02", 'gain = "much"'), [], ["force_in.gain", "number", "'much'"]),
    "gain of zero": (toml("gain = 1.02", "gain = 0"), [], ["force_in", "gain is zero"]),
    "negative range": (toml('range = "1 kN"', 'range = "-1 kN"'), [], ["force_in", "range must be positive"]),
    "exact and not": (
        toml('std_gain = "0.02 %"', "exact = true, std_gain = 1"),
        [],
        ["force_in", "contradict", "keep one"],
    ),
    "free output": (toml("[rig]", '[rig]\noutput = "free"'), [], ["[rig] output", "'blocked'", "'free'"]),
    # tests.csv
    "no list of tests": (lambda f: (f / "tests.csv").unlink(), [], ["has campaign.toml, but no tests.csv"]),
    "empty list": (content("tests.csv", b""), [], ["tests.csv: is empty"]),
    "blank list": (content("tests.csv", b"\n \n"), [], ["tests.csv: has no row of names", "test,file,kind,tyre"]),
    "no test": (
        content("tests.csv", b"test,file,kind,tyre\n"),
        [],
        ["tests.csv: lists no test below its row of names"],
    ),
    "binary list": (content("tests.csv", b"PK\x03\x04\x00\x00"), [], ["tests.csv: is binary", "CSV"]),
    "same name twice": (listed("D2,", "D1,"), [], ["tests.csv row 4: test 'D1' stands in row 3 already"]),
    "no name": (listed("D2,", ","), [], ["tests.csv row 4: the test has no name: fill in the column 'test'"]),
    "no column tyre": (listed("tyre", "tyer"), [], ["tests.csv row 1: column 'tyre' is missing; did you mean 'tyer'?"]),
    "column twice": (listed("tyre", "kind"), [], ["tests.csv row 1: column 'kind' stands twice"]),
    "no unit of a column": (
        listed("pressure [bar]", "pressure"),
        [],
        ["row 1: column 'pressure' has no unit: write 'pressure [bar]'"],
    ),
    "column of another kind": (listed("[bar]", "[kg]"), [], ["row 1: column 'pressure [kg]'", "a pressure is needed"]),
    "unknown unit of a column": (listed("[bar]", "[baar]"), [], ["'pressure [baar]'", "did you mean 'bar'?"]),
    # the call
    "out is a file": (content("file", b"x"), ["--out", "file"], ["is a file", "name a folder for the results"]),
    "out below a file": (content("file", b"x"), ["--out", "file/below"], ["file", "name a folder for the results"]),
    "results is a file": (
        content("results", b"x"),
        [],
        ["results: is a file: name a folder for the results with --out"],
    ),
    "unknown route": (lambda f: None, ["--route", "relativ"], ["'relativ'", "mobility, relative, transmissibility"]),
    "blocked": (
        toml("[rig]", '[rig]\noutput = "blocked"'),
        ["--route", "transmissibility"],
        ["blocked", "--route mobility"],
    ),
    "no folder": (shutil.rmtree, [], ["there is no such folder"]),
    "file for a folder": (lambda f: (shutil.rmtree(f), f.write_text("x")), [], ["campaign is a file: name its folder"]),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.sampled(4)
def test_a_campaign_that_cannot_be_read_is_one_message_and_nothing_is_written(run, campaign, fault):
    make, more, said = FAULTS[fault]
    if make is pipe and not hasattr(os, "mkfifo"):
        pytest.skip("this system has no pipes among its files")
    make(campaign)
    before = tree(campaign.parent)
    more = [str(campaign / word) if word.startswith("file") else word for word in more]
    ran = run("analyse", campaign, *more)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr.startswith("error: ")
    assert "Traceback" not in ran.stderr
    assert len(ran.stderr.splitlines()) <= 10
    assert len(ran.stderr) <= 1000
    assert [part for part in said if part not in ran.stderr] == [], ran.stderr
    assert tree(campaign.parent) == before


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [("[tyres.radial-ply]", "[specimens.radial-ply]\n[tyres.radial-ply]", ["'radial-ply'", "keep one of them"])],
)
def test_a_fault_of_the_whole_file_is_one_message_too(run, campaign, old, new, said):
    edit(campaign / "campaign.toml", old, new)
    ran = run("analyse", campaign)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert [part for part in said if part not in ran.stderr] == []


def test_many_faults_are_a_few_lines(run, campaign):
    edit(campaign / "campaign.toml", "[channels]", "[channels]\n" + "".join(f"wrong{i} = 1\n" for i in range(30)))
    ran = run("analyse", campaign)
    assert ran.exit_code == 2
    assert 2 <= len(ran.stderr.splitlines()) <= 10
    assert "more" in ran.stderr.splitlines()[-1]


@pytest.mark.sampled(4)
def test_the_process_ends_as_said_too(fourpole, campaign):
    edit(campaign / "campaign.toml", "value = 15.0,", "value = -15.0,")
    ran = fourpole("analyse", campaign)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.splitlines() == [
        "error: campaign.toml: [rig]: moving_mass is -15 kg: it must be a finite, positive number"
    ]


@pytest.mark.skipif(os.name != "posix" or not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_folder_that_cannot_be_written_is_exit_2(run, campaign):
    campaign.chmod(0o500)
    try:
        ran = run("analyse", campaign, "--tables-only")
    finally:
        campaign.chmod(0o700)
    assert ran.exit_code == 2
    assert "results" in ran.stderr


# -- how it stops ----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent in another way there")
@pytest.mark.sampled(8)
def test_an_interrupted_run_ends_at_once_and_the_next_one_completes_it(start, run, tmp_path):
    folder = simulate_campaign(
        tmp_path / "whole",
        tyres=[CROSS_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=np.linspace(10.0, 24.0, 15),
    ).folder
    campaign = tmp_path / "campaign"
    shutil.copytree(folder, campaign)
    command = ("analyse", campaign, "--tables-only", "--route", "mobility")
    assert run("analyse", folder, "--out", tmp_path / "all", *command[2:]).exit_code == 0
    process = start(*command)
    try:
        cache = campaign / "results" / "cache"
        while not len(entries_of(cache)) > 2:
            assert process.poll() is None, "it was done before it could be interrupted"
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate()
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert out == ""
    said = "stopped; no file is half-written; give the same command again: what is kept is not done twice"
    assert err.splitlines() == [said]
    # no table, whole or half, and no leftovers of writing
    assert [path.name for path in (campaign / "results").iterdir()] == ["cache"]
    done = entries_of(cache)
    assert 2 < len(done) < 15
    assert all(unpack(content, (*cache_room._CLASSES, *static.CURVE_CLASSES)) for _, content in done.values())

    again = run(*command)
    assert (again.exit_code, errors(again)) == (0, [])
    assert list(entries_of(cache).items())[: len(done)] == list(done.items())
    for name in ("static.csv", "dynamic.csv"):
        places = (campaign / "results", tmp_path / "all")
        found, undisturbed = ((place / name).read_text() for place in places)
        assert found == undisturbed


def test_results_that_cannot_be_written_leave_the_old_ones(run, campaign, monkeypatch):
    """A disk that is full when the tables are written: the message names the file, no half table is left."""
    assert run("analyse", campaign, "--tables-only").exit_code == 0
    before = tree(campaign / "results")
    edit(campaign / "tests.csv", "1.7,1000,17", "1.7,1100,17")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pl.DataFrame, "write_csv", full)
    ran = run("analyse", campaign, "--tables-only")
    assert ran.exit_code == 2
    assert "static.csv: cannot be written: No space left on device" in ran.stderr
    after = tree(campaign / "results")
    assert {name: after[name] for name in TABLES} == {name: before[name] for name in TABLES}
    assert not [name for name in after if name.endswith(".tmp")]


# -- former results stay whole ---------------------------------------------------------------------------------------


def without_cache(folder):
    return {name: content for name, content in tree(folder).items() if not name.startswith(("cache", ".store"))}


@pytest.fixture
def analysed(run, campaign):
    """A campaign with former results, a file of the user among them, and one thing changed since."""
    assert run("analyse", campaign, "--tables-only").exit_code == 0
    for name in ("report.html", "model.json", "notes.txt", "figures/fig05.svg", "figures/mine.svg"):
        (campaign / "results" / "figures").mkdir(exist_ok=True)
        (campaign / "results" / name).write_text("former")
    edit(campaign / "tests.csv", "1.7,1000,17", "1.7,1001,17")
    return campaign


@pytest.mark.parametrize("where", ["fourpole.app.report.save_figures", "fourpole.app.report.write_report"])
@pytest.mark.sampled(2)
def test_an_old_report_never_stands_beside_new_tables(run, analysed, monkeypatch, where):
    former = without_cache(analysed / "results")

    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(where, stopped)
    if where.endswith("write_report"):
        monkeypatch.setattr("fourpole.app.report.save_figures", lambda *_, **__: {})
    assert run("analyse", analysed).exit_code == 130
    assert without_cache(analysed / "results") == former


def test_a_report_that_is_stopped_leaves_the_former_figures(run, analysed, monkeypatch):
    former = without_cache(analysed / "results")

    def stopped(_, folder, **__):
        folder.mkdir()
        (folder / "fig05.svg").write_text("new")
        raise KeyboardInterrupt

    monkeypatch.setattr("fourpole.app.report.save_figures", stopped)
    (analysed / "results" / "model.json").unlink()  # it is none, which is said
    assert run("report", analysed / "results").exit_code == 130
    assert without_cache(analysed / "results") == {name: former[name] for name in former if name != "model.json"}


def test_a_report_of_other_tables_goes_where_none_is_made(run, analysed):
    results = analysed / "results"
    edit(analysed / "tests.csv", "1.7,1001,17", "1.7,1000,17")
    former = without_cache(results)
    assert run("analyse", analysed, "--tables-only").exit_code == 0
    assert without_cache(results) == former  # the tables are the same ones, so the report is of them
    edit(analysed / "tests.csv", "1.7,1000,17", "1.7,1001,17")
    assert run("analyse", analysed, "--tables-only").exit_code == 0
    gone = {name for name in former if name not in without_cache(results)}
    assert gone == {"report.html", "figures/fig05.svg"}  # model.json says of which tables it is


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent in another way there")
@pytest.mark.parametrize(("number", "code"), [("SIGKILL", -9), ("SIGTERM", 143)])
@pytest.mark.sampled(4)
def test_a_process_that_is_ended_while_it_writes_leaves_the_former_results(start, run, analysed, number, code):
    results, command = analysed / "results", ("analyse", analysed, "--tables-only")
    former, undisturbed = without_cache(results), analysed.with_name("undisturbed")
    shutil.copytree(analysed, undisturbed)
    assert run("analyse", undisturbed, "--tables-only").exit_code == 0
    process = start(*command)
    try:
        while not list(results.glob(".store/new-*")) and process.poll() is None:
            time.sleep(1e-4)
        process.send_signal(getattr(signal, number))
        process.communicate()
    finally:
        process.kill()
        process.wait()
    assert process.returncode in (code, 0)
    if process.returncode:
        assert without_cache(results) == former
        assert not list(results.glob(".store/new-*")) or number == "SIGKILL"
    assert run(*command).exit_code == 0
    assert without_cache(results) == without_cache(undisturbed / "results")


@pytest.mark.skipif(sys.platform == "win32", reason="there is no limit of files there")
@pytest.mark.parametrize(("room", "named"), [(0, "static.csv"), (10_000, "dynamic.parquet")])
@pytest.mark.sampled(2)
def test_where_files_have_no_room_the_former_results_stay_and_one_message_says_so(run, analysed, room, named):
    """A real limit of the system, as a full disk is: the cache has no room either, and no test is rejected for it."""
    results = analysed / "results"
    shutil.rmtree(results / "cache")
    former = without_cache(results)
    resource = importlib.import_module("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        ran = run("analyse", analysed, "--tables-only")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr.splitlines()[-1] == (
        f"error: {named}: cannot be written: File too large; free some space and run it again"
    )
    assert without_cache(results) == former
    kept = list((results / "cache").iterdir())
    assert all(path.stat().st_size <= room for path in kept)
    assert not [path for path in kept if path.suffix not in (".fpp", ".jsonl")]
