"""plan: what to expect before testing, said, written and advised."""

import csv
import json

import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.core.plan.remedies import remedies

RIG = ["--mass", "15 kg", "--preload-stiffness", "12.44 kN/m", "--frequency", "10:24:7 Hz"]
TYRE = ["--k1", "110 kN/m", "--k2", "100 kN/m", "--c", "800 N s/m"]


@pytest.fixture
def folder(tmp_path):
    """A campaign without a single recording."""
    (tmp_path / "campaign.toml").write_text(
        '[unstated]\nordinary = "zero"\n'
        '[rig]\nmoving_mass = "15 kg"\npreload_stiffness = "12.44 kN/m"\n[channels]\nsample_rate = "2 kHz"\n'
        'force_in = { column = "F1", unit = "N" }\nmotion_in = { column = "V1", unit = "m/s" }\n'
        'motion_out = { column = "V2", unit = "m/s" }\nload = { column = "F", unit = "N" }\n'
        'deflection = { column = "x", unit = "mm" }\n[tyres.winter]\n'
    )
    rows = "".join(f"D{f},r/D{f}.csv,dynamic,winter,1.7,1000,{f}\n" for f in (10, 16, 24))
    head = "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz]\nS1,r/S1.csv,static,winter,1.7,,\n"
    (tmp_path / "tests.csv").write_text(head + rows)
    return tmp_path


def test_a_campaign_gets_table_figure_advice_and_run_sheet(run, folder):
    sheet = folder / "order.csv"
    options = ["--added-mass", "10 kg", "--wanted", "1 %", "--std-k1", "0.1 %", "--run-sheet", sheet]
    ran = run("plan", folder, *TYRE, *options)
    assert ran.exit_code == 0, ran.stderr
    for text in ("U(K*) [%]", "U(K2) [%]", "U(C) [%]", "joint+10 kg", "16 Hz", "reaches it", "10 kg added at"):
        assert text in ran.stdout
    frame = pl.read_csv(folder / "plan" / "plan.csv")
    assert set(frame["route"]) == {"mobility", "relative", "transmissibility", "joint"}
    assert (folder / "plan" / "plan.svg").read_text().startswith("<?xml")
    assert (folder / "plan" / "plan.png").read_bytes()[1:4] == b"PNG"
    sheet.rename(folder / "tests.csv")
    assert [test.problem for test in read_campaign(folder).tests] == [""] * 7
    assert "seed 1982" in ran.stderr


@pytest.mark.sampled(2)
def test_a_rig_and_a_guessed_tyre_are_enough(run, tmp_path):
    ran = run("plan", *RIG, *TYRE, "--out", tmp_path / "plan")
    assert ran.exit_code == 0, ran.stderr
    assert "joint+20 kg" in ran.stdout
    assert "taken as 2 %" in ran.stderr
    with (tmp_path / "plan" / "plan.csv").open() as file:
        assert {row["frequency [Hz]"] for row in csv.DictReader(file)} == {"10.0", "17.0", "24.0"}


def test_without_a_place_nothing_is_written(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("plan", *RIG, *TYRE).exit_code == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.sampled(4)
def test_programs_get_one_document(run):
    ran = run("plan", *RIG, *TYRE, "--wanted", "0.5 %", "--std-k1", "0.01 %", "--json")
    document = json.loads(ran.stdout)
    (advice,) = document["advice"]
    assert advice["wanted [1]"] == 0.005
    assert advice["reaching"][0]["u(C)/C [1]"] <= 0.005
    assert advice["reaching"][0]["effort [min]"] <= advice["reaching"][-1]["effort [min]"]
    assert {row["plan"] for row in document["rows"]} == {"as stated", *(f"with {m} kg" for m in (2, 5, 10, 20))}


@pytest.fixture
def few_remedies(monkeypatch):
    """One remedy of each kind: all combinations of all of them take seconds."""
    monkeypatch.setattr(
        "fourpole.core.plan.advice.remedies",
        lambda *given: {kind: listed[:1] for kind, listed in remedies(*given).items()},
    )


@pytest.mark.usefixtures("few_remedies")
def test_it_is_said_when_nothing_reaches_it(run):
    ran = run("plan", *RIG, *TYRE, "--wanted", "0.0001 %", "--added-mass", "10 kg")
    assert "no remedy tried reaches it; nearest" in ran.stdout
    assert "K1 alone leaves U of 8.8 %" in ran.stdout


@pytest.mark.usefixtures("few_remedies")
def test_it_is_said_when_nothing_is_needed(run):
    ran = run("plan", *RIG, *TYRE, "--wanted", "50 %", "--added-mass", "10 kg")
    assert "reached: nothing more is needed" in ran.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "--mass is missing"),
        ([*RIG, *TYRE[:4]], "--c is missing"),
        ([*RIG, *TYRE, "--k1", "110 kg"], "--k1: 'kg' is a mass"),
        ([*RIG, *TYRE, "--k2", "-5 kN/m"], "--k2: '-5 kN/m' must be positive"),
        ([*RIG, *TYRE, "--wanted", "1 m"], "--wanted: "),
        ([*RIG, *TYRE, "--wanted", "0 %"], "--wanted: '0 %' must be positive"),
        ([*RIG, *TYRE, "--added-mass", "10"], "--added-mass: '10' has no unit"),
        ([*RIG, *TYRE, "--noise", "1 N"], "--noise: "),
        ([*RIG, *TYRE, "--cycles", "0"], "--cycles: 0 must be 1 or more"),
        ([*RIG, *TYRE, "--repeats", "0"], "--repeats: 0 must be 1 or more"),
        ([*RIG, *TYRE, "--std-gain", "1 deg"], "--std-gain: "),
        ([*RIG[:4], "--frequency", "10..24 Hz", *TYRE], "--frequency: "),
        (["nowhere", *TYRE], "nowhere: there is no such folder"),
        (["nowhere", *TYRE, "--mass", "15 kg"], "--mass: the campaign states this itself"),
    ],
)
def test_mistakes_get_one_message(run, arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ran = run("plan", *arguments)
    assert ran.exit_code == 2
    assert said in ran.stderr
    assert "Traceback" not in ran.stderr
    assert "fault in Fourpole" not in ran.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_tyre_that_nobody_knows_is_asked_for(run, folder):
    ran = run("plan", folder)
    assert ran.exit_code == 2
    assert "specimen 'winter' is not known yet: guess its K1, K2 and C, K1 at least (--k1, --k2, --c)" in ran.stderr
    assert not (folder / "plan").exists()
