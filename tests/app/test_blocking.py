"""Two accelerometers and a mass in place of a force cell: bare recordings to K* in two commands, or in one."""

import json

import numpy as np
import polars as pl
import pytest

MASS, SPRING, DAMPER, RATE = 12.5, 7.9e3, 30.0, 2048.0
FREQUENCIES = (6.0, 12.0, 21.0, 34.0, 54.0, 86.0, 137.0, 218.0)
NAMES = {
    "above": ("acc_base [g]", "acc_mass [m/s2]"),
    "below": ("Beschl. oben [m/s²]", "Beschl. unten [m/s²]"),
    "unsaid": ("CH1 [g]", "CH2 [g]"),
}


def stiffness(f):
    """K* of rubber with a fractional damper [N/m]."""
    return 180e3 * (1.0 + 0.35 * (2j * np.pi * np.asarray(f) * 2e-3) ** 0.25)


def ratio(f, mass=MASS):
    """Motion of the mass over that of the input."""
    w = 2 * np.pi * np.asarray(f)
    return stiffness(f) / (stiffness(f) + SPRING + 1j * w * DAMPER - mass * w**2)


def recorded(path, names, f, mass=MASS, gains=(1.012, 0.99), noise=2e-3):
    """A sine of 1 m/s² at the input, with errors of the gains and with noise."""
    t = np.arange(int(max(3.0, 20 / f) * RATE)) / RATE
    rng = np.random.default_rng(int(10 * f))
    columns = {"Time [s]": t}
    for name, gain, motion in zip(names, gains, (1.0, ratio(f, mass)), strict=True):
        signal = gain * (motion * np.exp(2j * np.pi * f * t)).real + noise * rng.standard_normal(t.size)
        columns[name] = signal / (9.80665 if "[g]" in name else 1.0)
    pl.DataFrame(columns).write_csv(path)
    return path


def laboratory(folder, names, **given):
    folder.mkdir()
    return [recorded(folder / f"mount_{f:g}Hz.csv", names, f, **given) for f in FREQUENCIES]


def judged(rows):
    """Departure of K* and U (k = 2) over |K*|, and the verdict, by rising frequency."""
    rows = sorted(rows, key=lambda row: row["frequency [Hz]"])
    true = stiffness([row["frequency [Hz]"] for row in rows])
    seen = np.array([row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"] for row in rows])
    u = np.array([np.hypot(row["u(Re K*) [N/m]"], row["u(Im K*) [N/m]"]) for row in rows])
    return np.abs(seen / true - 1), 2 * u / np.abs(seen), [row["verdict"] for row in rows]


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize(("kind", "option"), [("above", "above"), ("below", "below"), ("unsaid", "above")])
def test_two_commands_from_bare_recordings_to_k(run, tmp_path, kind, option):
    laboratory(tmp_path / "rig", NAMES[kind])
    ran = run("init", tmp_path / "rig", f"--mass-{option}", "12.5 kg")
    assert ran.exit_code == 0, ran.output
    assert f"next: fourpole analyse {tmp_path / 'rig'}" in ran.stdout
    assert "force_in" not in ran.stdout
    assert 'moving_mass       = "12.5 kg"' in (tmp_path / "rig" / "campaign.toml").read_text(encoding="utf-8")
    ran = run("analyse", tmp_path / "rig", "--tables-only")
    assert ran.exit_code == 3, ran.output  # some tests are rejected: below the resonance
    rows = pl.read_csv(tmp_path / "rig" / "results" / "dynamic.csv").to_dicts()
    off, expanded, _ = judged(rows)
    assert np.all(off < expanded)
    checks = pl.read_csv(tmp_path / "rig" / "results" / "checks.csv").filter(pl.col("code") == "blocking mass")
    verdicts = dict(checks.select("test", "verdict").iter_rows())
    assert [verdicts[f"mount_{f:g}Hz"] for f in FREQUENCIES] == [
        "rejected", "rejected", "rejected", "warning", "warning", "ok", "ok", "ok",
    ]  # fmt: skip
    assert off[5:].max() < 0.045


def test_one_command_with_the_springs_stated(run, tmp_path):
    files = laboratory(tmp_path / "rig", NAMES["above"])
    ran = run("stiffness", *files, "--mass-above", "12.5 kg", "--preload-stiffness", "7.9 kN/m", "--json")
    assert ran.exit_code == 3, ran.output
    off, expanded, verdicts = judged(json.loads(ran.stdout))
    assert np.all(off < expanded)
    assert verdicts == ["rejected", "warning", *6 * ["ok"]]  # nobody says that the accelerometers have no low-cut
    assert expanded[3] < 0.08


def test_one_command_for_one_file_says_why_it_fails(run, tmp_path):
    file = recorded(tmp_path / "a.csv", NAMES["above"], 12.0)
    ran = run("stiffness", file, "--mass-above", "12.5 kg", "--json")
    assert ran.exit_code == 3
    (row,) = json.loads(ran.stdout)
    assert row["verdict"] == "rejected"
    assert row["remarks"].startswith("K* is not determined, U (k = 2) is 4.2e+02 % of |K*|: the auxiliary springs")


def test_without_a_mass_init_names_the_option(run, tmp_path):
    laboratory(tmp_path / "rig", NAMES["above"])
    ran = run("init", tmp_path / "rig")
    said = " ".join(ran.stdout.split())
    assert "K* follows from the mass behind the specimen, which is stated nowhere" in said
    assert '--mass-above "12.5 kg"' in said
    assert "not ready yet: campaign.toml: [rig] is missing" in said
    assert "--route relative" not in said


def test_masses_of_several_tests_stand_in_their_names(run, tmp_path):
    names = NAMES["above"]
    (tmp_path / "rig").mkdir()
    for added in (0, 10):
        for f in FREQUENCIES[4:]:
            recorded(tmp_path / "rig" / f"mount_m{added}kg_{f:g}Hz.csv", names, f, mass=MASS + added, gains=(1, 1))
    assert run("init", tmp_path / "rig", "--mass-above", "12.5 kg").exit_code == 0
    assert run("analyse", tmp_path / "rig", "--tables-only").exit_code == 0
    rows = pl.read_csv(tmp_path / "rig" / "results" / "dynamic.csv")
    assert sorted(set(rows["added mass [kg]"].to_list())) == [0.0, 10.0]
    for _, of_mass in rows.group_by("added mass [kg]"):
        off, expanded, _ = judged(of_mass.to_dicts())
        assert np.all(off < expanded)


@pytest.mark.parametrize(("sign", "verdict"), [(1.0, "warning"), (-1.0, "rejected")])
def test_two_sensors_on_the_mass_are_a_mean_and_their_tilt_is_said(run, tmp_path, sign, verdict):
    (tmp_path / "rig").mkdir()
    for file in laboratory(tmp_path / "one", ("acc_base [m/s2]", "acc_mass_left [m/s2]"))[4:]:
        table = pl.read_csv(file)
        left = pl.col("acc_mass_left [m/s2]")
        right = (0.75 * left).alias("acc_mass_right [m/s2]")
        table.with_columns(right).write_csv(tmp_path / "rig" / file.name)
    assert run("init", tmp_path / "rig", "--mass-above", "12.5 kg").exit_code == 0
    stated = (tmp_path / "rig" / "campaign.toml").read_text(encoding="utf-8")
    assert 'beside = ["acc_mass_right"]' in stated
    for file in (tmp_path / "rig").glob("*.csv") if sign < 0 else ():
        if file.name != "tests.csv":
            table = pl.read_csv(file)
            table.with_columns(-pl.col("acc_mass_right [m/s2]")).write_csv(file)
    run("analyse", tmp_path / "rig", "--tables-only")
    checks = pl.read_csv(tmp_path / "rig" / "results" / "checks.csv").filter(pl.col("code") == "tilt")
    assert checks["statistic"].to_list() == pytest.approx([1 / 7 if sign > 0 else 7.0] * 4, rel=1e-3)
    assert set(checks["verdict"]) == {verdict}


def test_random_excitation_needs_no_force_either(run, tmp_path):
    rate, size = 1024.0, 40 * 1024
    lines, rng = np.fft.rfftfreq(size, 1 / rate), np.random.default_rng(4)
    spectrum = np.fft.rfft(rng.standard_normal(size)) * ((lines > 12.0) & (lines < 250.0))
    moved = np.concatenate([[0.0], ratio(lines[1:])])
    signals = [np.fft.irfft(part, size) + 1e-3 * rng.standard_normal(size) for part in (spectrum, spectrum * moved)]
    columns = {"Time [s]": np.arange(size) / rate, **dict(zip(NAMES["below"], signals, strict=True))}
    (tmp_path / "rig").mkdir()
    pl.DataFrame(columns).write_csv(tmp_path / "rig" / "Lager rauschen.csv")
    assert run("init", tmp_path / "rig", "--mass-below", "12.5 kg").exit_code == 0
    assert run("analyse", tmp_path / "rig", "--tables-only").exit_code in (0, 3)
    rows = pl.read_csv(tmp_path / "rig" / "results" / "dynamic.csv").filter(pl.col("Re K* [N/m]").is_not_null())
    off, expanded, _ = judged(rows.to_dicts())
    assert len(off) > 50
    assert np.mean(off < expanded) > 0.9
    above = np.array(sorted(rows["frequency [Hz]"].to_list())) > 60.0
    assert np.median(off[above]) < 0.03


def test_a_mass_needs_two_motions_and_no_force(run, tmp_path):
    one = pl.read_csv(recorded(tmp_path / "a.csv", NAMES["above"], 86.0)).drop("acc_mass [m/s2]")
    one.write_csv(tmp_path / "a.csv")
    ran = run("stiffness", tmp_path / "a.csv", "--mass-above", "12.5 kg")
    assert ran.exit_code == 2
    assert "here is no second motion" in " ".join(ran.stderr.split())
    one.with_columns((pl.col("acc_base [g]") * 3).alias("F1 [N]"), pl.col("acc_base [g]").alias("acc_2 [g]")).write_csv(
        tmp_path / "a.csv"
    )
    ran = run("stiffness", tmp_path / "a.csv", "--mass-above", "12.5 kg")
    assert ran.exit_code == 2
    assert "here is a force" in " ".join(ran.stderr.split())


def test_two_masses_or_a_mass_before_a_force_cell_are_refused(run, tmp_path):
    file = recorded(tmp_path / "a.csv", NAMES["above"], 86.0)
    ran = run("init", tmp_path, "--mass-above", "1 kg", "--mass-below", "1 kg")
    assert ran.exit_code == 2
    assert "keep one of them" in ran.stderr
    ran = run("stiffness", file, "--mass-above", "1 kg", "--input-mass", "1 kg")
    assert ran.exit_code == 2
    assert "leave it out" in " ".join(ran.stderr.split())
