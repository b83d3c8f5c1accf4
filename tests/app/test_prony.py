"""From a table or a campaign to materials of FE programs, as a user types it."""

from __future__ import annotations

import json
import shutil

import numpy as np
import polars as pl
import pytest
from tests.export.fe import read_abaqus, read_dyna

from fourpole import analyse
from fourpole.models.families import model_named

FREQUENCY = np.geomspace(10.02, 23.93, 12)


@pytest.fixture
def table(tmp_path):
    k = model_named("fractional").stiffness([1e5, 5e5, 1e-3, 0.5], 2 * np.pi * FREQUENCY)
    path = tmp_path / "rubber.csv"
    pl.DataFrame({"frequency [Hz]": FREQUENCY, "Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}).write_csv(path)
    return path


def test_a_table_becomes_a_material(run, table, tmp_path):
    ran = run(
        "fit", table, "--model", "prony", "--std", "1 %", "--out", tmp_path / "a.json", "--figure", tmp_path / "a.png"
    )
    assert ran.exit_code == 0
    assert "fixed, not fitted: tau_1" in ran.stdout
    assert (tmp_path / "a-spectrum.png").is_file()
    shape = ("--mode", "shear", "--height", "10 mm", "--area", "5 cm^2", "--poisson", "0.49")
    ran = run("export", tmp_path / "a.json", "--to", "abaqus", *shape)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert read_abaqus((tmp_path / "prony.inp").read_text())["SPECIMEN"]["elastic"][1] == 0.49
    ran = run("export", tmp_path / "a.json", "--to", "abaqus")
    assert "no elastic moduli for 1 of 1 materials" in " ".join(ran.stderr.split())
    ran = run("export", tmp_path / "a.json", "--to", "abaqus", "--poisson", "0.49")
    assert ran.exit_code == 2
    assert "the model file states no shape" in ran.stderr
    ran = run("export", tmp_path / "a.json", "--to", "ansys", "--height", "10 mm")
    assert ran.exit_code == 2
    assert "--mode compression or --mode shear" in ran.stderr


def test_the_shape_of_a_table_of_moduli_is_not_stated_again(run, table, tmp_path):
    """K* by --mode, --height and --area of fit; the export gives the modulus of the table back."""
    frame, per = pl.read_csv(table), 0.01 / 5e-4
    moduli = frame.select(
        "frequency [Hz]",
        (pl.col("Re K* [N/m]") * per).alias("G' [Pa]"),
        (pl.col("Im K* [N/m]") * per).alias("G'' [Pa]"),
    )
    moduli.write_csv(tmp_path / "moduli.csv")
    shape = ("--mode", "shear", "--height", "10 mm", "--area", "5 cm^2")
    ran = run("fit", tmp_path / "moduli.csv", *shape, "--model", "prony", "--std", "1 %", "--out", tmp_path / "b.json")
    assert ran.exit_code == 0, ran.output
    entry = json.loads((tmp_path / "b.json").read_text())["models"][0]
    assert (entry["shape"]["mode"], entry["shape"]["height"]) == ("shear", 0.01)
    assert run("export", tmp_path / "b.json", "--to", "prony").exit_code == 0
    arms = pl.read_csv(tmp_path / "prony.csv")
    assert arms["G [Pa]"].to_list() == pytest.approx((arms["K [N/m]"] * per).to_list())
    ran = run("export", tmp_path / "b.json", "--to", "abaqus", "--poisson", "0.49")
    assert (ran.exit_code, ran.stderr) == (0, "")
    young, poisson = read_abaqus((tmp_path / "prony.inp").read_text())["SPECIMEN"]["elastic"]
    assert (young, poisson) == (pytest.approx(2.98 * arms["G [Pa]"].sum()), 0.49)


@pytest.mark.sampled(2)
def test_nominal_ends_of_a_band_are_inside(run, table, tmp_path):
    run("fit", table, "--model", "fractional", "--std", "1 %", "--out", tmp_path / "a.json")
    for frequency in ("10 Hz", "24 Hz", "10:24 Hz"):
        assert run("query", tmp_path / "a.json", "--frequency", frequency).exit_code == 0
    assert run("query", tmp_path / "a.json", "--frequency", "9.8 Hz").exit_code == 2
    for band, count in (("10:24 Hz", 12), ("10.1:23.8 Hz", 12), ("1e-3:1e5 Hz", 12), ("10 Hz", 1)):
        ran = run("fit", table, "--model", "spring", "--std", "1 %", "--band", band, "--json")
        assert json.loads(ran.stdout)["models"][0]["conditions"][0]["dof"] == 2 * count - 1


@pytest.mark.sampled(2)
def test_the_shape_in_campaign_toml_reaches_the_material(run, small_campaign, tmp_path):
    small_campaign = shutil.copytree(small_campaign, tmp_path / "campaign")
    statement = (small_campaign / "campaign.toml").read_text(encoding="utf-8")
    head = next(line for line in statement.splitlines() if line.startswith("[tyres."))
    shape = 'mode = "compression"\nheight = "20 mm"\narea = "3 cm^2"\npoisson = 0.49'
    (small_campaign / "campaign.toml").write_text(statement.replace(head, f"{head}\n{shape}"), encoding="utf-8")
    results = analyse(small_campaign, monte_carlo=0).write(tmp_path / "results")
    assert run("fit", results, "--model", "zener").exit_code == 0
    assert run("export", results, "--to", "lsdyna").exit_code == 0
    entry = json.loads((results / "model.json").read_text(encoding="utf-8"))["models"][0]
    k1, k2, _ = entry["conditions"][0]["values"]
    _, (_, _, rest, arm) = read_dyna((results / "prony.k").read_text())[0]
    per_stiffness = 0.02 / 3e-4 / 2.98
    assert [float(rest[0]), float(arm[0])] == pytest.approx([per_stiffness * k1, per_stiffness * k2], rel=1e-12)
