"""simulate: a campaign to analyse, said where it is."""

from pathlib import Path

import polars as pl
import pytest

from fourpole.app.analysis import run_simulate
from fourpole.virtual import simulate_campaign


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """The whole campaign has 210 tests; here it has six."""

    def small(folder, **settings):
        few = {"pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 24.0]}
        return simulate_campaign(folder, **few | settings)

    monkeypatch.setattr("fourpole.virtual.simulate_campaign", small)


@pytest.mark.parametrize("clean", [False, True])
@pytest.mark.sampled(2)
def test_the_campaign_it_makes_is_analysed_without_a_remark(run, tmp_path, clean):
    made = run("simulate", tmp_path / "c", "--seed", 3, *(["--clean"] if clean else []))
    assert (made.exit_code, made.stderr) == (0, "")
    assert made.stdout == f"6 tests recorded in {tmp_path / 'c'} (seed 3); next: fourpole analyse {tmp_path / 'c'}\n"
    assert (", clean" in (tmp_path / "c" / "campaign.toml").read_text()) == clean
    ran = run("analyse", tmp_path / "c", "--tables-only")
    assert ran.exit_code == 0
    # no remark but that there are no ordinary errors, what K' rests on, and what so few tests of belts cannot show
    said = ("note: [unstated] ordinary", "note: [rig]: K' rests on", "note: [rig]: these tests would not show")
    assert [line for line in ran.stderr.splitlines() if not line.startswith(said)] == []
    assert "6 tests, 6 ok, 0 with a warning, 0 rejected" in ran.stdout


def test_a_program_gets_the_files(tmp_path):
    answer = run_simulate(tmp_path / "c", seed=3)
    made = answer.told
    assert (made["folder"], made["seed"], made["tests"]) == (str(tmp_path / "c"), 3, 6)
    names = {str(Path(name).relative_to(tmp_path / "c")) for name in made["files"]}
    assert {"campaign.toml", "tests.csv", "truth.csv", str(Path("recordings", "D1.csv"))} <= names
    assert all(Path(name).is_file() for name in made["files"])
    assert answer.shown[0].startswith("6 tests recorded in ")


def test_the_same_seed_gives_the_same_files(run, tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        run("simulate", tmp_path / name, "--seed", seed)
    a, b, c = ((tmp_path / name / "recordings" / "D1.csv").read_bytes() for name in "abc")
    assert a == b != c


def test_the_tyres_have_belts_and_a_weight_unless_they_are_to_be_massless(run, tmp_path):
    run("simulate", tmp_path / "c")
    truth = pl.read_csv(tmp_path / "c" / "truth.csv", infer_schema_length=None)
    assert truth["belt mass [kg]"].drop_nulls().to_list() == [2.5, 2.5, 3.0, 3.0]
    assert (tmp_path / "c" / "campaign.toml").read_text().count("specimen_mass") == 2
    run("simulate", tmp_path / "m", "--massless")
    assert "belt mass [kg]" not in (tmp_path / "m" / "truth.csv").read_text()
    assert "specimen_mass" not in (tmp_path / "m" / "campaign.toml").read_text()
    both = run("simulate", tmp_path / "b", "--car", "--massless")
    assert (both.exit_code, both.stdout) == (2, "")
    assert "contradict each other" in both.stderr


def test_a_cars_tyre_on_request(run, tmp_path):
    assert run("simulate", tmp_path / "c", "--car").stdout.startswith("5 tests recorded")
    truth = pl.read_csv(tmp_path / "c" / "truth.csv", infer_schema_length=None)
    assert set(truth["tyre"]) == {"car-tyre"}
    assert truth["belt mass [kg]"].drop_nulls().to_list() == [7.0] * 4
    assert truth["added mass [kg]"].drop_nulls().to_list() == [0.0, 0.0, 10.0, 10.0]
