"""State space and Modelica, read back by json and a reader of Modelica: K* of the model."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import scipy
from tests.export.modelica import read_modelica
from tests.export.vehicle import LOAD, PRESSURE, table

from fourpole.errors import FileError, ModelError
from fourpole.export import export_results
from fourpole.fitting.accuracy import WARNED
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import map_of, read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.models import FractionalZener, Zener
from fourpole.models.families import model_named
from fourpole.models.realised import Realised

KINDS = ("statespace", "modelica")
FREQUENCY = np.geomspace(1e-3, 1e4, 60)


def matrices(kind, path):
    """A, B, C, D of each system of a file, by a reader that does not know this package."""
    if kind == "statespace":
        systems = json.loads(path.read_text("utf-8"))["systems"]
        found = [[np.array(one[name], dtype=float) for name in "ABCD"] for one in systems]
        for one in found:  # an empty matrix has no number of columns in JSON
            n = len(one[0])
            one[0], one[1], one[2] = one[0].reshape(n, n), one[1].reshape(n, 2), one[2].reshape(1, n)
        return found
    return [one.matrices() for one in read_modelica(path.read_text("utf-8"))[1].values()]


def k_star(found, frequency=FREQUENCY):
    """K* (N,) of matrices, by solving for the states at each frequency."""
    a, b, c, d = found
    drive = np.array([np.ones(frequency.size), 2j * np.pi * frequency])
    states = [
        scipy.linalg.solve(2j * np.pi * f * np.eye(len(a)) - a, b @ drive[:, at]) if len(a) else np.zeros(0)
        for at, f in enumerate(frequency)
    ]
    return np.array([(c @ one + d @ drive[:, at])[0] for at, one in enumerate(states)])


@pytest.fixture(scope="module", params=["spring", "kelvin", "zener", "maxwell:3", "prony:3"])
def fitted(request, tmp_path_factory):
    """The file of a model fitted at two pressures."""
    measured = measured_of(table((1.7e5, 2.0e5), (2e3,)), std=1e-2)
    path = tmp_path_factory.mktemp("fitted") / "model.json"
    model_file(measured, fit_tyres(measured, request.param)).write(path)
    return path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sampled(2)
def test_k_star_is_that_of_the_model(kind, fitted, tmp_path):
    exported = export_results(fitted, kind, tmp_path / "a.x")
    (entry,) = read_model_file(fitted).models
    model = model_named(entry.model).with_parameters(len(entry.parameters))
    systems = matrices(kind, exported.path)
    assert len(systems) == len(entry.conditions) == 2
    for found, one in zip(systems, entry.conditions, strict=True):
        assert np.abs(k_star(found) / model.stiffness(one.values, 2 * np.pi * FREQUENCY) - 1).max() < 1e-9
        poles = np.linalg.eigvals(found[0])
        assert np.all(poles.real < 0)
    assert len(exported.notes) == (entry.discrepancy >= WARNED)  # a spring has no loss


@pytest.mark.parametrize("kind", KINDS)
def test_a_map_is_exported_at_points_inside_it(files, kind, tmp_path):
    points = [{PRESSURE: 1.83e5, LOAD: 2.2e3}, {PRESSURE: 2.35e5, LOAD: 4.9e3}]
    path = export_results(files / "map.json", kind, tmp_path / "a.x", points=points).path
    found = map_of(read_model_file(files / "map.json").maps[0])
    values = found.parameters([[one[PRESSURE], one[LOAD]] for one in points])
    for system, own in zip(matrices(kind, path), values, strict=True):
        assert np.abs(k_star(system) / Zener().stiffness(own, 2 * np.pi * FREQUENCY) - 1).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_points_outside_and_models_that_are_not_causal_are_refused_with_the_remedy(files, kind, tmp_path):
    path = tmp_path / "a.x"
    with pytest.raises(ModelError, match=r"is outside what was measured.*: state that point or measure there$"):
        export_results(files / "map.json", kind, path, points=[{PRESSURE: 3e5, LOAD: 3e3}])
    with pytest.raises(ModelError, match=r'the model file: is a map over pressure, preload: state .*--at "pressure='):
        export_results(files / "map.json", kind, path)
    measured = measured_of(table(), std=1e-2)
    measured = replace(measured, conditions=measured.conditions[:1])
    model_file(measured, fit_tyres(measured, "structural")).write(tmp_path / "model.json")
    with pytest.raises(ModelError, match=r"not causal.* fourpole fit --model prony"):
        export_results(tmp_path / "model.json", kind, path)
    with pytest.raises(FileError, match="does its folder exist"):
        export_results(files / "model.json", kind, tmp_path / "no" / "a.x")
    assert [one.name for one in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.parametrize("kind", KINDS)
def test_an_approximation_is_as_good_as_its_note_says(kind, tmp_path):
    frequency = np.geomspace(2.0, 80.0, 12)
    k = FractionalZener().stiffness([150e3, 400e3, 2e-3, 0.4], 2 * np.pi * frequency)
    frame = (
        table((2e5,), (2e3,))[: frequency.size].clear().select("tyre", "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]")
    )
    rows = [("tyre", f, one.real, one.imag) for f, one in zip(frequency, k, strict=True)]
    measured = measured_of(frame.vstack(type(frame)(rows, schema=frame.schema, orient="row")), std=1e-3)
    model_file(measured, fit_tyres(measured, "fractional")).write(tmp_path / "model.json")
    exported = export_results(tmp_path / "model.json", kind)
    (note,) = exported.notes
    assert note.startswith("the file has an approximation of the fractional model: from 2 to 80 Hz, its K* differs")
    stated = float(note.partition("by up to ")[2].partition(" ")[0])
    (found,) = matrices(kind, exported.path)
    (entry,) = read_model_file(tmp_path / "model.json").models
    inside = np.geomspace(2.0, 80.0, 300)
    exact = FractionalZener().stiffness(entry.conditions[0].values, 2 * np.pi * inside)
    assert np.abs(k_star(found, inside) / exact - 1).max() < 1.2 * stated <= 1.2e-6


HOSTILE = 'mount "A\\" \n end; // <b>タイヤ\u202e\x1b[31m "; equation'


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("names", [(HOSTILE,), ("block", "block "), ("タイヤ", "轮胎", "1")])
@pytest.mark.sampled(2)
def test_names_of_specimens_harm_no_file(kind, names, tmp_path):
    measured = measured_of(pl.concat([table((2e5,), (2e3,), tyre=one) for one in names]), std=1e-2)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    exported = export_results(tmp_path / "model.json", kind, tmp_path / "my models; end.mo")
    systems = matrices(kind, exported.path)
    assert len(systems) == len(read_model_file(tmp_path / "model.json").models)
    exact = Zener().stiffness(read_model_file(tmp_path / "model.json").models[0].conditions[0].values, 20 * np.pi)
    assert k_star(systems[0], np.array([10.0])) == pytest.approx(exact, rel=1e-9)
    if kind == "modelica":
        package, blocks = read_modelica(exported.path.read_text("utf-8"))
        assert package == "my_models_end"
        assert all(name.isascii() and name.isidentifier() for name in blocks)
        assert all(one.about.isprintable() for one in blocks.values())
    again = export_results(tmp_path / "model.json", kind, tmp_path / "again.mo").path
    if kind != "modelica":  # whose package has the name of its file
        assert again.read_bytes() == exported.path.read_bytes()


def test_pairs_of_branches_and_no_branches_are_valid_modelica(tmp_path, monkeypatch):
    """A model with inertia inside has pairs, whose states ring."""
    pairs = np.array([30e3 + 4e3j, -8e3 + 1e3j]), np.array([20.0 + 400.0j, 35.0 + 900.0j])
    ringing = Realised(180e3, 25.0, np.array([40e3]), np.array([3e-3]), *pairs)
    monkeypatch.setattr("fourpole.export.systems.realised", lambda *_: ringing)
    measured = measured_of(table((2e5,), (2e3,)), std=1e-2)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    for kind in KINDS:
        (found,) = matrices(kind, export_results(tmp_path / "model.json", kind, tmp_path / "a.x").path)
        assert found[0].shape == (5, 5)
        assert np.abs(k_star(found) / ringing.stiffness(2 * np.pi * FREQUENCY) - 1).max() < 1e-9


def test_the_files_say_what_they_hold(files, tmp_path):
    document = json.loads(
        export_results(files / "model.json", "statespace", tmp_path / "a.json").path.read_text("utf-8")
    )
    assert document["inputs"] == ["deflection x [m]", "rate v of the deflection [m/s]"]
    first = document["systems"][0]
    assert first["name"] == "tyre_1_7_bar_2000_N"
    assert first["state"] == {PRESSURE: 1.7e5, LOAD: 2e3}
    assert first["band_Hz"] == pytest.approx([1.0, 60.0])
    assert first["about"].startswith("tyre, 1.7 bar, 2000 N; model zener of ")
    _, blocks = read_modelica(
        export_results(files / "model.json", "modelica", tmp_path / "M.mo").path.read_text("utf-8")
    )
    first = blocks["tyre_1_7_bar_2000_N"]
    assert (first.inputs, first.outputs) == (["x", "v"], ["F"])
    assert (first.units["x"], first.units["v"], first.units["F"], first.units["C"]) == ("m", "m/s", "N", "N.s/m")
