"""twoport: what is printed, what is written, what a laboratory is told that lacks something."""

import json
import shutil

import polars as pl
import pytest
from tests.belted_rig import BeltedRig

FREQUENCIES = [20.0, 50.0, 80.0, 100.0]
FILES = ["twoport.csv", "twoport.svg", "twoport.png", "twoport.uff"]


@pytest.fixture(scope="module")
def belted(tmp_path_factory):
    return BeltedRig().write(tmp_path_factory.mktemp("belted") / "car", FREQUENCIES)


@pytest.mark.sampled(4)
def test_the_poles_are_printed_with_reciprocity_and_belt_and_written(run, belted):
    ran = run("twoport", belted)
    assert ran.exit_code == 0, ran.stderr
    said = " ".join(ran.stdout.split())
    for text in (
        "car, 2.2 bar, 4000 N",
        "Re k11",
        "Re k12",
        "Re k22",
        "Reciprocity holds",
        "A belt of 7.00",
        "rim held",
    ):
        assert text in said
    assert "no tyre_mass is stated" in " ".join(ran.stderr.split())
    assert sorted(path.name for path in (belted / "twoport").iterdir()) == sorted(FILES)
    assert pl.read_csv(belted / "twoport" / "twoport.csv").height == 4
    assert not (belted / "results").exists()


@pytest.mark.sampled(4)
def test_one_json_document_has_the_rows_and_the_files(run, belted, tmp_path):
    ran = run("twoport", belted, "--out", tmp_path / "poles", "--json")
    document = json.loads(ran.stdout)
    assert [row["frequency [Hz]"] for row in document["rows"]] == pytest.approx(FREQUENCIES, rel=1e-4)
    assert document["lacks"] == []
    assert document["written"] == [str(tmp_path / "poles" / name) for name in FILES]
    assert "Infinity" not in ran.stdout


def specimens_csv(folder, form, mass=None, std=None):
    heads = ["tyre", "rig", "pressure [Pa]", "preload [N]", "form", "belt mass [kg]", "u(belt mass) [kg]",
             "share of springs [1]"]  # fmt: skip
    (folder / "results").mkdir(exist_ok=True)
    row = ("car", "", 2.2e5, 4000.0, form, mass, std, 0.2)
    pl.DataFrame([row], schema=heads, orient="row").write_csv(folder / "results" / "specimens.csv")
    (folder / "results" / "study.json").write_text("{}")


@pytest.mark.sampled(4)
def test_broken_reciprocity_is_said_with_its_causes(run, tmp_path):
    ran = run("twoport", BeltedRig(active=0.05).write(tmp_path / "car", FREQUENCIES))
    assert ran.exit_code == 0
    said = " ".join(ran.stdout.split())
    assert "Reciprocity is broken: k12/k21 differs from 1 by 4." in said
    assert "p-value below 0.001" in said
    assert "check that the sensors" in said
    assert "belt" not in said


@pytest.mark.sampled(8)
def test_recordings_that_analyse_has_reduced_are_not_read_again_and_its_belt_is_held_against_the_poles(
    run, belted, tmp_path, monkeypatch
):
    campaign = shutil.copytree(belted, tmp_path / "car")
    (campaign / "results").mkdir()
    ran = run("twoport", campaign)
    assert ran.exit_code == 0
    assert "joint route" not in ran.stdout
    monkeypatch.setattr("fourpole.study.workers.run_batch", None)
    both = (
        (7.01, 0.05, "7.01 ± 0.10", "they agree"),
        (7.3, 0.05, "7.30 ± 0.10", "they differ by 6 u of their difference"),
    )
    for mass, std, by_tests, said in both:
        specimens_csv(campaign, "belt", mass, std)
        ran = run("twoport", campaign)
        assert ran.exit_code == 0
        line = f"{by_tests} kg by the joint route (results/specimens.csv): {said}"
        assert line in " ".join(ran.stdout.split())


@pytest.mark.sampled(6)
def test_without_the_library_of_uff_the_rest_is_written(run, belted, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyuff", None)
    ran = run("twoport", belted, "--out", tmp_path / "poles")
    assert ran.exit_code == 0
    assert "no UFF" in ran.stderr
    assert 'pip install "fourpole[formats]"' in ran.stderr
    assert sorted(path.name for path in (tmp_path / "poles").iterdir()) == sorted(FILES[:3])


@pytest.mark.parametrize(("letter", "add"), [("B2", "kind = calibration"), ("D2", "another weighed mass")])
def test_a_laboratory_that_lacks_something_is_told_what_to_add(run, belted, tmp_path, letter, add):
    campaign = shutil.copytree(belted, tmp_path / "car")
    rows = (campaign / "tests.csv").read_text().splitlines()
    (campaign / "tests.csv").write_text("\n".join(row for row in rows if not row.startswith(letter)) + "\n")
    ran = run("twoport", campaign)
    assert ran.exit_code == 2
    said = " ".join(ran.stderr.split())
    assert "four poles cannot be found. car, 2.2 bar, 4000 N: 1 of 2" in said
    assert add in said
    assert "Traceback" not in said
