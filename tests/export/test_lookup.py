"""Look-up tables, read by Python's own reader and interpolated by scipy: K* of the model at and between their rows."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import RegularGridInterpolator
from tests.export.vehicle import FREQUENCY, LOAD, PRESSURE, stiffness, table

from fourpole.core.condition import AMPLITUDE
from fourpole.errors import CampaignError, ModelError
from fourpole.export import export_results
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import map_of, read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.models import profile

RE, IM, ERROR = "Re K* [N/m]", "Im K* [N/m]", "interpolation error [1]"


def read(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(one[name] or "nan") for one in rows])


def gridded(rows, names):
    """Sides of a full grid, and K* on it."""
    sides = [np.unique(column(rows, name)) for name in names]
    assert len(rows) == np.prod([one.size for one in sides])
    k = (column(rows, RE) + 1j * column(rows, IM)).reshape([one.size for one in sides])
    return sides, k


@pytest.mark.sampled(4)
def test_a_map_is_interpolated_over_pressure_preload_and_frequency(files, tmp_path):
    exported = export_results(files / "map.json", "table", tmp_path / "a.csv")
    rows = read(exported.path)
    names = [PRESSURE, LOAD, "frequency [Hz]"]
    sides, k = gridded(rows, names)
    error = column(rows, ERROR)[0]
    assert 0 < error < 2e-3
    assert exported.notes == (
        f"linear interpolation of Re K* and Im K* differs from the model by up to {100 * error:.2g} % of |K*|",
    )
    found = map_of(read_model_file(files / "map.json").maps[0])
    points = np.random.default_rng(5).uniform([one[0] for one in sides], [one[-1] for one in sides], (500, 3))
    exact = found.ask(points[:, :2], points[:, 2]).stiffness
    between = RegularGridInterpolator(sides, k)(points)
    assert np.abs(between / exact - 1).max() < 1.05 * error
    at_rows = found.ask(np.stack([column(rows, name) for name in names[:2]], 1), column(rows, names[2]))
    assert np.abs((column(rows, RE) + 1j * column(rows, IM)) / at_rows.stiffness - 1).max() < 1e-12
    assert column(rows, f"u({RE.partition(' [')[0]}) [N/m]") == pytest.approx(
        np.sqrt(at_rows.covariance[:, 0, 0]), rel=1e-9
    )


def test_fits_have_a_block_per_condition(files, tmp_path):
    rows = read(export_results(files / "model.json", "table", tmp_path / "a.csv").path)
    states = {(float(one[PRESSURE]), float(one[LOAD])) for one in rows}
    assert len(states) == 9
    for pressure, load in states:
        own = [one for one in rows if (float(one[PRESSURE]), float(one[LOAD])) == (pressure, load)]
        sides, k = gridded(own, ["frequency [Hz]"])
        inside = np.random.default_rng(1).uniform(FREQUENCY[0], FREQUENCY[-1], 200)
        between = np.interp(inside, sides[0], k)
        exact = stiffness(inside, pressure, load)
        assert np.abs(between / exact - 1).max() < 1.05 * column(own, ERROR)[0] + 1e-6


@pytest.mark.sampled(4)
def test_rows_outside_tests_that_fill_no_rectangle_are_blank_and_counted(files, tmp_path):
    frame = table().filter(~((pl.col(PRESSURE) > 2.2e5) & (pl.col(LOAD) > 4e3)))
    measured = measured_of(frame, std=1e-3)
    model_file(measured, maps=map_tyres(measured, "zener")).write(tmp_path / "map.json")
    exported = export_results(tmp_path / "map.json", "table")
    rows = read(exported.path)
    corner = [one for one in rows if float(one[PRESSURE]) > 2.39e5 and float(one[LOAD]) > 4.9e3]
    assert corner
    assert all(one[RE] == one[IM] == "" for one in corner)
    blank = sum(one[RE] == "" for one in rows)
    assert any(note.startswith(f"{blank} of {len(rows)} rows are blank") for note in exported.notes)
    assert {one[ERROR] for one in rows} == {rows[0][ERROR]}


def test_a_model_that_is_not_causal_and_one_frequency_have_a_table_too(tmp_path):
    measured = measured_of(table(), std=1e-3)
    measured = replace(measured, conditions=measured.conditions[:1])
    model_file(measured, fit_tyres(measured, "structural")).write(tmp_path / "model.json")
    rows = read(export_results(tmp_path / "model.json", "table").path)
    assert float(rows[0][ERROR]) < 1e-12  # K* of this model is the same at all frequencies
    one = measured_of(table().filter(pl.col("frequency [Hz]") == FREQUENCY[0]), std=1e-3)
    model_file(one, fit_tyres(one, "kelvin")).write(tmp_path / "single.json")
    rows = read(export_results(tmp_path / "single.json", "table", tmp_path / "b.csv").path)
    assert len(rows) == 9
    assert {float(each["frequency [Hz]"]) for each in rows} == {FREQUENCY[0]}


def test_k_star_of_a_model_that_depends_on_the_amplitude_is_over_amplitude_too(tmp_path, monkeypatch):
    rows = []
    for amplitude in (1e-4, 5e-4, 2e-3):
        y = (amplitude / 4.5e-4) ** 0.55
        k = 145e3 + 95e3 / (1 + y**2) + 1j * (9e3 + 42e3 * y / (1 + y**2))
        rows += [
            {"tyre": "mount", "frequency [Hz]": f, RE: k.real, IM: k.imag, AMPLITUDE.column: amplitude}
            for f in (5.0, 10.0, 20.0)
        ]
    measured = measured_of(pl.DataFrame(rows), std=0.01, by_amplitude=True)
    monkeypatch.setattr(profile, "_MOST_WORK", 0)  # intervals by profile likelihood would take seconds
    model_file(measured, fit_tyres(measured, "kraus")).write(tmp_path / "model.json")
    found = read(export_results(tmp_path / "model.json", "table").path)
    sides, k = gridded(found, [AMPLITUDE.column, "frequency [Hz]"])
    assert sides[0][[0, -1]] == pytest.approx([1e-4, 2e-3])
    assert sides[0].size > 3
    query = Query(list(sides[1]), {AMPLITUDE.column: sides[0][2]})
    asked = ask(read_model_file(tmp_path / "model.json"), query)
    assert k[2] == pytest.approx([complex(one[RE], one[IM]) for one in asked], rel=1e-12)


def test_another_specimen_and_a_use_for_nothing_are_said(files, tmp_path):
    with pytest.raises(ModelError, match=r"the model file: is of 'tyre', not of 'tire'"):
        export_results(files / "map.json", "table", tmp_path / "a.csv", specimen="tire")
    with pytest.raises(CampaignError, match="table has no use for a frequency: leave out --frequency"):
        export_results(files / "map.json", "table", tmp_path / "a.csv", frequency=20.0)
    assert not list(tmp_path.iterdir())
