"""A filled rubber mount on a bench, at three amplitudes and without a preload, from recordings to K*(f, x).

The recordings follow from a formula of their own; no part of the program has a share in them.
"""

import numpy as np
import polars as pl
import pytest

import fourpole as fp
from fourpole.errors import ModelError
from fourpole.fitting.modelling import model_file
from fourpole.fitting.query import Query, ask
from fourpole.models import profile

CAMPAIGN = """
title = "Filled rubber mount"
[unstated]
ordinary = "zero"
[rig]
output = "blocked"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F", unit = "N", std_gain = "0.2 %", std_phase = "0.05 deg" }
motion_in = { column = "x", unit = "mm", std_gain = "0.2 %", std_phase = "0.05 deg" }
load = { column = "F", unit = "N", std_gain = "0.2 %" }
deflection = { column = "x", unit = "mm", std_gain = "0.2 %" }
[specimens.mount]
"""
FREQUENCY, LEVELS, NOISE = np.array([2.0, 4.0, 7.0, 11.0, 17.0, 26.0, 37.0, 47.0]), (0.1e-3, 0.45e-3, 2e-3), 0.002


def k_star(f, x):
    """Kraus's law with plateaus that grow with ln f, and a loss that grows with frequency at all amplitudes."""
    y = (x / 0.4e-3) ** 0.6
    small, large = 230e3 * (1 + 0.05 * np.log(f / 10)), 140e3 * (1 + 0.03 * np.log(f / 10))
    peak, rest = 28e3 * (f / 10) ** 0.05, 9e3 * (f / 10) ** 0.1
    return large + (small - large) / (1 + y**2) + 1j * (rest + 2 * (peak - rest) * y / (1 + y**2))


def recording(path, t, x, force, rng):
    parts = {"F": force, "x": 1e3 * x}
    noisy = {name: one + NOISE * np.ptp(one) / 2 * rng.normal(size=t.size) for name, one in parts.items()}
    pl.DataFrame({"t": t, **noisy}).write_csv(path, float_precision=9)


def bench(folder, settings):
    """A campaign of the mount: a static test through zero, and a dynamic test for each frequency and amplitude."""
    rng = np.random.default_rng(11)
    folder.mkdir()
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    t = np.arange(0.0, 180.0, 0.1)
    x = 1.5e-3 * np.sin(2 * np.pi * t / 60)
    recording(folder / "S1.csv", t, x, 140e3 * x + 10 * np.sign(np.cos(2 * np.pi * t / 60)), rng)
    rows = ["test,file,kind,specimen,preload [N],frequency [Hz]", "S1,S1.csv,static,mount,,"]
    for at, (f, level) in enumerate(settings):
        t = np.arange(0.0, max(20 / f, 1.0), 1 / 1000)
        turn = np.exp(2j * np.pi * f * t + 1j * rng.uniform(0, 6))
        recording(folder / f"D{at}.csv", t, level * turn.real, (level * k_star(f, level) * turn).real, rng)
        rows.append(f"D{at},D{at}.csv,dynamic,mount,0,{f}")
    (folder / "tests.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")
    return fp.analyse(folder)


@pytest.mark.sampled(2)
def test_recordings_at_three_amplitudes_predict_a_fourth_within_two_per_cent(tmp_path, monkeypatch):
    monkeypatch.setattr(profile, "_MOST_WORK", 0)  # intervals by profile likelihood would take seconds
    study = bench(tmp_path / "bench", [(f, level) for level in LEVELS for f in FREQUENCY])
    assert study.counts["rejected"] == 0
    k1 = study.static.filter(pl.col("preload [N]") == 0.0)["K1 [N/m]"].item()
    assert k1 == pytest.approx(140e3, rel=0.01)
    assert study.dynamic["deflection amplitude [m]"].to_numpy() == pytest.approx(np.repeat(LEVELS, 8), rel=1e-3)
    file = model_file(study.measured, study.fit("kraus"))
    for level in (0.2e-3, 0.9e-3):
        for row in ask(file, Query(FREQUENCY, {"preload [N]": 0.0, "deflection amplitude [m]": level})):
            shown = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
            assert abs(shown / k_star(row["frequency [Hz]"], level) - 1) < 0.02


def test_one_amplitude_per_frequency_gives_no_number_of_the_payne_effect(tmp_path):
    study = bench(tmp_path / "cam", [(f, 3e-5 * f) for f in FREQUENCY])
    with pytest.raises(ModelError, match="amplitude and frequency cannot be told apart"):
        study.fit("kraus")
