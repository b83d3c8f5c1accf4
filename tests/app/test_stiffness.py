"""fourpole stiffness: recordings of a bench in, K* of each sine out, and the campaign if it is wanted."""

import json

import numpy as np
import polars as pl
import pytest

MASS, RATE = 0.4, 2000.0
FREQUENCIES = (1.0, 5.0, 20.0, 45.0)


def stiffness(f):
    """K* of a Zener body [N/m]."""
    return 200e3 + 1.0 / (1.0 / 120e3 + 1.0 / (2j * np.pi * f * 900.0))


def bench(path, offset=0.0, unit="N", mass=MASS):
    """A procedure of sines with rests, a mass of 0.4 kg between force cell and specimen."""
    parts = []
    for f in FREQUENCIES:
        wave = 0.3e-3 / f**0.5 * np.exp(2j * np.pi * f * np.arange(int(max(10 / f, 2.0) * RATE)) / RATE)
        through = (stiffness(f) - mass * (2 * np.pi * f) ** 2) * wave
        parts += [np.zeros((2, 1000)), np.stack([wave.imag, through.imag])]
    motion, force = np.concatenate(parts, axis=1)
    noise = np.random.default_rng(7).standard_normal((2, motion.size))
    scale = {"N": 1.0, "kN": 1e3}[unit]
    force = (force + 0.05 * noise[0] + offset) / scale
    table = {
        "Zeit [s]": np.arange(motion.size) / RATE,
        f"Kraft [{unit}]": force,
        "Weg [mm]": 1e3 * motion + 1e-5 * noise[1],
    }
    pl.DataFrame(table).write_csv(path)
    return path


def found(ran):
    assert ran.exit_code == 0, ran.output
    rows = json.loads(ran.stdout)
    return rows, np.array([row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"] for row in rows])


def test_one_file_one_command(run, tmp_path):
    rows, seen = found(run("stiffness", bench(tmp_path / "Lager A.csv"), "--input-mass", "0.4 kg", "--json"))
    assert [row["frequency [Hz]"] for row in rows] == pytest.approx(FREQUENCIES, rel=1e-6)
    assert [row["deflection amplitude [m]"] for row in rows] == pytest.approx(
        0.3e-3 * np.array(FREQUENCIES) ** -0.5, rel=1e-2
    )
    assert np.abs(seen / stiffness(np.array(FREQUENCIES)) - 1.0).max() < 2e-3
    assert {row["verdict"] for row in rows} == {"ok"}
    assert all(row["u(Re K*) [N/m]"] > 0.0 for row in rows)
    assert [path.name for path in tmp_path.iterdir()] == ["Lager A.csv"]


def test_without_the_mass_k_falls_with_the_square_of_the_frequency(run, tmp_path):
    _, seen = found(run("stiffness", bench(tmp_path / "a.csv"), "--json"))
    f = np.array(FREQUENCIES)
    assert seen == pytest.approx(stiffness(f) - MASS * (2 * np.pi * f) ** 2, rel=2e-3)


def test_the_table_has_u_and_names_the_frequency_at_which_the_mass_tells(run, tmp_path):
    ran = run("stiffness", bench(tmp_path / "a.csv"), "--input-mass", "0.4 kg")
    assert ran.exit_code == 0
    assert ran.stdout.count("±") == 4 * len(FREQUENCIES) + 1
    hertz = np.sqrt(0.01 * abs(stiffness(1.0)) / MASS) / (2 * np.pi)
    assert f"takes 1 % of |K*| at {hertz:.3g} Hz" in ran.stdout
    assert "no K1" not in ran.output


def test_preloads_of_a_machine_whose_compression_is_negative(run, tmp_path):
    files = [bench(tmp_path / f"{name}.csv", offset=load) for name, load in (("a", -500.0), ("b", -900.0))]
    rows, _ = found(run("stiffness", *files, "--json"))
    assert [row["preload [N]"] for row in rows] == pytest.approx([500.0] * 4 + [900.0] * 4, rel=0.01)


@pytest.mark.usefixtures("without_figures")
def test_the_campaign_that_is_kept_gives_the_same_to_the_last_bit(run, tmp_path):
    files = [bench(tmp_path / "a.csv", offset=500.0), bench(tmp_path / "b.csv", offset=900.0)]
    rows, seen = found(run("stiffness", *files, "--campaign", tmp_path / "kept", "--json"))
    assert [round(row["preload [N]"], -1) for row in rows] == [500.0] * 4 + [900.0] * 4
    again = pl.read_csv(tmp_path / "kept" / "results" / "dynamic.csv")
    assert again["Re K* [N/m]"].to_list() == seen.real.tolist()
    assert (tmp_path / "kept" / "results" / "report.html").is_file()
    ran = run("stiffness", *files, "--campaign", tmp_path / "kept")
    assert ran.exit_code == 2
    assert "there is a campaign.toml and a tests.csv already" in " ".join(ran.stderr.split())


def test_a_file_with_other_units_is_rejected_and_says_why(run, tmp_path):
    ran = run("stiffness", bench(tmp_path / "a.csv"), bench(tmp_path / "b.csv", unit="kN"), "--json")
    assert ran.exit_code == 3
    rows = json.loads(ran.stdout)
    assert [row["verdict"] for row in rows] == ["ok"] * 4 + ["rejected"] * 4
    assert all("kN" in row["remarks"] for row in rows[4:])


def test_what_is_no_bench_is_said(run, tmp_path):
    t = np.arange(20_000) / RATE
    wave = {"t [s]": t, "F1 [N]": np.sin(30 * t), "V1 [m/s]": np.cos(30 * t), "V2 [m/s]": np.cos(30 * t + 1)}
    pl.DataFrame(wave).write_csv(tmp_path / "rig.csv")
    ran = run("stiffness", tmp_path / "rig.csv")
    assert ran.exit_code == 2
    assert "a second motion: put the recordings into a folder and run fourpole init" in " ".join(ran.stderr.split())
    ran = run("stiffness", tmp_path / "none.csv")
    assert ran.exit_code == 2


def test_a_report_and_a_picture_are_left_where_they_are_wanted_and_nothing_else(run, tmp_path):
    wanted = [tmp_path / "page.html", tmp_path / "k.svg"]
    ran = run("stiffness", bench(tmp_path / "a.csv"), "--report", wanted[0], "--picture", wanted[1])
    assert ran.exit_code == 0, ran.output
    assert "loss angle" in wanted[0].read_text(encoding="utf-8")
    assert wanted[1].read_text(encoding="utf-8").startswith("<?xml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "k.svg", "page.html"]


def test_a_mass_that_makes_k_fall_is_named_and_any_mass_is_asked_for(run, tmp_path):
    rows, _ = found(run("stiffness", bench(tmp_path / "a.csv", mass=1.5), "--json"))
    assert [row["verdict"] for row in rows] == ["ok", "ok", "ok", "warning"]
    assert "a mass before the force cell" in rows[-1]["remarks"]
    said = run("stiffness", tmp_path / "a.csv").stdout
    assert "a mass that moves is part of K*: 0.1 kg before the specimen takes 1 % of |K*| at" in " ".join(said.split())


def test_a_file_without_a_force_and_a_statement_among_the_files_are_said(run, tmp_path):
    table = pl.read_csv(bench(tmp_path / "a.csv"))
    table.drop("Kraft [N]").with_columns(pl.col("Weg [mm]").alias("U [V]")).write_csv(tmp_path / "b.csv")
    ran = run("stiffness", tmp_path / "b.csv")
    assert (ran.exit_code, "no force is recorded" in " ".join(ran.stderr.split())) == (2, True)
    (tmp_path / "tests.csv").write_text("test,file\n")
    ran = run("stiffness", tmp_path / "a.csv", tmp_path / "tests.csv")
    assert (ran.exit_code, "is a statement of a campaign" in " ".join(ran.stderr.split())) == (2, True)
    (tmp_path / "x.py").write_text("print(1)\n")
    ran = run("stiffness", tmp_path / "x.py", "--campaign", tmp_path / "new")
    assert (ran.exit_code, "x.py" in ran.stderr, "/tmp/fourpole-" in ran.stderr) == (2, True, False)
    assert not (tmp_path / "new").exists()
