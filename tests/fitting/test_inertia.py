"""Fits of specimens with inertia, from a table to an answer; the truth is networks that are solved by hand."""

import json

import numpy as np
import polars as pl
import pytest

from fourpole.app.cli import app
from fourpole.errors import ModelError
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.fitting.ranges import rest_of
from fourpole.models.data import StiffnessData

NOISE = 0.003


def springs(w):
    return 2e5 * (1j * w / 60) ** 0.06


def track(w):
    """A hydromount whose K' is negative above the resonance of its fluid, at 20 Hz."""
    inner = -(w**2) * 60.0 + 1j * w * 250.0
    return springs(w) + 9e5 * inner / (9e5 + inner)


def driven(w, belt=7.0):
    return 1 / (1 / (6 * springs(w)) + 1 / (1.2 * springs(w) - w**2 * belt))


def transfer(w, belt=7.0):
    return 6 * 1.2 * springs(w) ** 2 / (7.2 * springs(w) - w**2 * belt)


def table(folder, truth, low, high, count, seed=1):
    """A table of K* with noise and its uncertainty."""
    hertz = np.linspace(low, high, count)
    exact, rng = truth(2 * np.pi * hertz), np.random.default_rng([7, seed])
    std = NOISE * np.abs(exact)
    k = exact + std * (rng.normal(size=count) + 1j * rng.normal(size=count))
    heads = ("frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]", "u(Re K*) [N/m]", "u(Im K*) [N/m]")
    pl.DataFrame(dict(zip(heads, (hertz, k.real, k.imag, std, std), strict=True))).write_csv(folder / "k.csv")
    return folder / "k.csv"


def errors(rows, truth):
    """Errors of an answer over their standard uncertainties, K' and K''."""
    exact = truth(2 * np.pi * np.array([row["frequency [Hz]"] for row in rows]))
    pairs = (("Re K* [N/m]", "u(Re K*) [N/m]", exact.real), ("Im K* [N/m]", "u(Im K*) [N/m]", exact.imag))
    return np.array([[(row[k] - one) / row[u] for row, one in zip(rows, part, strict=True)] for k, u, part in pairs])


@pytest.mark.sampled(8)
def test_a_belt_that_is_known_is_looked_for_where_a_smaller_kind_would_do(tmp_path):
    measured = read_measured(table(tmp_path, lambda w: driven(w, 0.8), 8, 24, 24))
    assert fit_tyres(measured)[0].measured[0].inertia is None
    (found,) = fit_tyres(measured, "belt")
    belt = found.verdicts[0].belt
    assert abs(belt.mass - 0.8) < 2.5 * belt.mass_std
    assert found.measured[0].inertia.mass == belt.mass
    row = ask(model_file(measured, [found]), Query(frequency=[15.0]))
    assert np.abs(errors(row, springs)).max() < 3
    few = read_measured(table(tmp_path, driven, 8, 24, 9))
    with pytest.raises(ModelError, match="a belt needs 10 frequencies or more, not 9"):
        fit_tyres(few, "belt")


@pytest.mark.sampled(8)
def test_an_inertia_track_is_a_specimen_with_one_resonance(tmp_path):
    measured = read_measured(table(tmp_path, track, 1, 40, 20))
    for name in ("inertia track", "resonant"):
        (found,) = fit_tyres(measured, name)
        assert found.model.name == "resonant:1"
        assert found.discrepancy == 0
    (found,) = fit_tyres(read_measured(table(tmp_path, driven, 5, 60, 24)), "inertia track")
    assert found.verdicts[0].belt is not None
    assert found.measured[0].inertia is None  # the resonance is fitted, not taken off


@pytest.mark.sampled(8)
def test_a_hydromount_is_fitted_where_k_is_negative_too(tmp_path, run):
    path = table(tmp_path, track, 1, 40, 40)
    measured = read_measured(path)
    assert measured.conditions[0].own.count == 40
    assert measured.conditions[0].own.stiffness.real.min() < 0
    (found,) = fit_tyres(measured)
    assert found.model.name == "resonant:1"
    assert found.discrepancy == 0
    made = model_file(measured, [found])
    made.write(tmp_path / "model.json")
    rows = ask(read_model_file(tmp_path / "model.json"), Query(frequency=np.linspace(1.7, 39.0, 30).tolist()))
    assert np.mean(np.abs(errors(rows, track)) < 1.96) > 0.85
    (verdict,) = json.loads(run("causality", str(path), "--json").stdout)["conditions"]
    assert (verdict["holds"], verdict["possible"]) == ("resonant", True)
    assert verdict["resonances [Hz]"] == pytest.approx([np.sqrt(9e5 / 60) / 2 / np.pi], rel=0.01)


@pytest.mark.parametrize(("truth", "of"), [(driven, "driving point"), (transfer, "blocked transfer")])
@pytest.mark.sampled(4)
def test_a_belt_is_taken_off_and_the_springs_are_fitted(tmp_path, run, truth, of):
    path = table(tmp_path, truth, 5, 60, 30)
    done = run("fit", str(path), "--of", of, "--out", str(tmp_path / "model.json"))
    assert done.exit_code == 0
    entry = read_model_file(tmp_path / "model.json").models[0]
    assert not entry.model.startswith("resonant")
    assert entry.discrepancy == 0
    body = entry.conditions[0].inertia
    through = 7.0 * 6 * 1.2 / 7.2**2 * (springs(1.0) / springs(1.0)).real  # m12, which both ways show
    assert body.mass / (body.share + 2 + 1 / body.share) == pytest.approx(through, rel=0.02)
    if of == "driving point":
        assert (body.mass, body.share) == pytest.approx((7.0, 5.0), rel=0.05)
    rows = ask(read_model_file(tmp_path / "model.json"), Query(frequency=[6.0, 12.0, 24.0, 40.0]))
    assert np.all(np.abs(errors(rows, lambda w: 1.0 * springs(w))) < 4)


def test_a_specimen_is_not_said_to_be_impossible_for_kinds_that_were_not_tried(tmp_path, run):
    path = table(tmp_path, lambda w: springs(w) - 2 * w**2, 8, 24, 12)
    assert "possible with a mass of" in run("causality", str(path)).stdout
    said = run("causality", str(path), "--of", "springs").stdout
    assert "NOT possible for relaxing springs" in said
    assert "mass" not in said


@pytest.mark.parametrize(
    ("truth", "high", "said"),
    [
        (lambda w: springs(w) - 2 * w**2, 24, "without the mass of"),
        (driven, 60, "without the belt"),
        (springs, 24, None),
    ],
)
@pytest.mark.sampled(3)
def test_an_answer_says_what_was_taken_off_k_as_measured(tmp_path, truth, high, said):
    measured = read_measured(table(tmp_path, truth, 8, high, 20))
    (row,) = ask(model_file(measured, fit_tyres(measured, "zener")), Query(frequency=[16.0]))
    assert (said or "") in row["remarks"]
    assert ("without" in row["remarks"]) == (said is not None)


def test_what_k_is_of_is_asked_for_by_its_name(tmp_path, run):
    done = run("fit", str(table(tmp_path, springs, 5, 60, 12)), "--of", "tyre")
    assert done.exit_code == 2
    assert "none of springs, driving point, blocked transfer" in done.stderr


@pytest.mark.sampled(2)
def test_beyond_the_band_the_interval_is_that_of_all_relaxing_specimens(tmp_path):
    """Three arms, of which the band shows two: 95 % intervals, at least 90 % asked for; K1, which is at rest, too."""

    def arms(w):
        parts = [(30e3, 0.1), (50e3, 0.01), (60e3, 0.001)]
        return 150e3 + sum(k * 1j * w * t / (1 + 1j * w * t) for k, t in parts)

    inside, at_rest = [], []
    for seed in range(20):
        measured = read_measured(table(tmp_path, arms, 5, 40, 12, seed))
        found = model_file(measured, fit_tyres(measured, "prony:3"))
        rows = ask(found, Query(frequency=[1.25, 2.5, 80.0, 160.0], beyond=True))
        inside.append(np.abs(errors(rows, arms)) < 1.96)
        assert "all massless, relaxing specimens" in rows[0]["remarks"]
        (row,) = ask(found, Query(frequency=[15.0]))
        at_rest.append(abs(row["K1 [N/m]"] - 150e3) < 1.96 * row["u(K1) [N/m]"])
    assert np.mean(inside) > 0.85  # 90 % less twice the scatter of 20 independent draws
    assert sum(at_rest) >= 17


def test_the_range_of_k1_always_has_an_end():
    """Where no relaxing specimen fits, any K1 does as badly: it is cut at ten times the largest modulus."""
    data = StiffnessData.of(np.array([60.0, 90.0]), np.array([2e5 + 9e3j, -2e5 + 9e3j]), 2e3)
    assert rest_of(data) == pytest.approx((0.0, 10 * abs(2e5 + 9e3j)))


@pytest.fixture
def run():
    from typer.testing import CliRunner

    runner = CliRunner()
    return lambda *arguments: runner.invoke(app, list(arguments))
