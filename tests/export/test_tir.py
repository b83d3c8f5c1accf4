"""The .tir file, read by a parser of its layout and evaluated by the equations of MF-Tyre 6.1 that are in print."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from tests.export.vehicle import LOAD, PRESSURE, stiffness, table

from fourpole.errors import ModelError
from fourpole.export import export_results
from fourpole.export.tir import vertical
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import map_of, read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file

F0, R0 = 20.0, 0.316


def read(path):
    """Blocks of a TeimOrbit file: KEY = value, texts in quotes; ! and $ begin comments."""
    blocks, comments, keys = {}, [], None
    for line in path.read_text("ascii").splitlines():
        assert len(line) < 200
        if line.startswith("!"):
            comments.append(line[1:].strip())
        elif line.startswith("["):
            keys = blocks.setdefault(line.strip()[1:-1], {})
        elif not line.startswith("$"):
            key, _, value = line.partition("=")
            assert key.strip() not in keys
            value = value.partition("$")[0].strip()
            keys[key.strip()] = value[1:-1] if value.startswith("'") else float(value)
    return blocks, " ".join(comments)


def tangent(blocks, load, pressure):
    """dFz/drho at a load, of Fz = (1 + PFZ1 dpi) (q1 rho/R0 + Q_FZ2 (rho/R0)^2) FNOMIN, by its deflection."""
    own = blocks["VERTICAL"]
    r0, f0 = blocks["DIMENSION"]["UNLOADED_RADIUS"], own["FNOMIN"]
    nominal = blocks["OPERATING_CONDITIONS"]["NOMPRES"]
    scale = f0 * (1 + own["PFZ1"] * (pressure - nominal) / nominal)
    q1 = np.sqrt((own["VERTICAL_STIFFNESS"] * r0 / f0) ** 2 - 4 * own["Q_FZ2"])
    roots = np.roots([own["Q_FZ2"] * scale, q1 * scale, -load])
    x = min(one.real for one in roots if one.real > 0)
    return scale / r0 * (q1 + 2 * own["Q_FZ2"] * x)


def percent(text, before):
    return float(text.partition(before)[2].partition("%")[0])


@pytest.mark.parametrize("name", ["model.json", "map.json"])
def test_stiffness_over_load_and_pressure_and_the_stated_damping(files, name, tmp_path):
    exported = export_results(files / name, "tir", tmp_path / "a.tir", frequency=F0, radius=R0)
    blocks, comments = read(exported.path)
    own = blocks["VERTICAL"]
    assert (own["FNOMIN"], blocks["OPERATING_CONDITIONS"]["INFLPRES"]) == (3.5e3, 2e5)
    exact = stiffness([F0], 2e5, 3.5e3)[0]
    if name == "map.json":
        exact = map_of(read_model_file(files / name).maps[0]).ask([[2e5, 3.5e3]], [F0]).stiffness[0]
    assert own["VERTICAL_STIFFNESS"] == pytest.approx(exact.real, rel=1e-6)
    assert own["VERTICAL_DAMPING"] * 2 * np.pi * F0 == pytest.approx(exact.imag, rel=1e-5)
    off = [
        tangent(blocks, load, pressure) / stiffness([F0], pressure, load)[0].real - 1
        for pressure in (1.7e5, 2.0e5, 2.4e5)
        for load in (2e3, 3.5e3, 5e3)
    ]
    stated = percent(" ".join(exported.notes), "its stiffness differs by up to ")
    assert 100 * np.abs(off).max() == pytest.approx(stated, rel=0.06, abs=0.06)
    assert (blocks["INFLATION_PRESSURE_RANGE"], blocks["VERTICAL_FORCE_RANGE"]) == (
        {"PRESMIN": 1.7e5, "PRESMAX": 2.4e5},
        {"FZMIN": 2e3, "FZMAX": 5e3},
    )
    for note in exported.notes:
        assert note in comments
    without = export_results(files / name, "tir", tmp_path / "b.tir", frequency=F0)
    assert any("UNLOADED_RADIUS and Q_FZ2, the change over load; state --radius" in note for note in without.notes)
    assert "Q_FZ2" not in read(without.path)[0]["VERTICAL"]


def test_the_curve_that_made_the_stiffness_is_found_again():
    """Stiffnesses of the equations themselves come back exactly, whatever the nominal point."""
    load, pressure = (one.ravel() for one in np.meshgrid([1e3, 3e3, 6e3], [1.8e5, 2.2e5, 2.6e5]))
    blocks = {
        "VERTICAL": {"FNOMIN": 3e3, "VERTICAL_STIFFNESS": 2.1e5, "Q_FZ2": 40.0, "PFZ1": 0.7},
        "DIMENSION": {"UNLOADED_RADIUS": R0},
        "OPERATING_CONDITIONS": {"NOMPRES": 2.2e5},
    }
    k = np.array([tangent(blocks, *one) for one in zip(load, pressure, strict=True)])
    found = vertical(k, load, pressure, int(np.flatnonzero((load == 3e3) & (pressure == 2.2e5))[0]))
    assert found.stiffness == pytest.approx(2.1e5, rel=1e-12)
    assert found.load_term == pytest.approx(4 * 40.0 * 3e3 / R0**2, rel=1e-6)
    assert found.pressure_term == pytest.approx(0.7, rel=1e-6)
    assert found.departure < 1e-7


def test_units_and_the_loss_elsewhere_stand_in_the_file(files, tmp_path):
    exported = export_results(files / "model.json", "tir", tmp_path / "a.tir", frequency=F0, radius=R0)
    blocks, comments = read(exported.path)
    assert blocks["UNITS"] == {
        "LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second",
    }  # fmt: skip
    assert blocks["MDI_HEADER"]["FILE_TYPE"] == "tir"
    assert blocks["MODEL"]["FITTYP"] == 61
    low, mid = stiffness([1.0, F0], 2e5, 3.5e3)
    less = 100 * (1 - mid.imag / F0 / low.imag)
    note = next(one for one in exported.notes if one.startswith("stiffness and damping are those at 20 Hz"))
    assert percent(note, "at 1 Hz the file has ") == pytest.approx(less, rel=0.06)
    assert note.partition("at 1 Hz")[2].partition("%")[2].startswith(" less loss")
    assert "VERTICAL_DAMPING is that of the nominal point: over all conditions" in comments
    assert "longitudinal, lateral" in comments
    rows = [line.split()[1:] for line in exported.path.read_text("ascii").splitlines() if line.startswith("!")]
    (row,) = (list(map(float, one)) for one in rows if one and one[0] == "20")
    assert row == pytest.approx([F0, mid.real, mid.real, mid.imag, mid.imag], rel=2e-5)


def test_a_stated_point_is_the_nominal_one(files, tmp_path):
    point = {PRESSURE: 2.2e5, LOAD: 4.1e3}
    blocks, _ = read(
        export_results(files / "map.json", "tir", tmp_path / "a.tir", points=[point], frequency=F0, radius=R0).path
    )
    exact = map_of(read_model_file(files / "map.json").maps[0]).ask([[2.2e5, 4.1e3]], [F0]).stiffness[0]
    assert blocks["VERTICAL"]["VERTICAL_STIFFNESS"] == pytest.approx(exact.real, rel=1e-9)
    assert blocks["VERTICAL"]["VERTICAL_DAMPING"] * 2 * np.pi * F0 == pytest.approx(exact.imag, rel=1e-9)
    assert tangent(blocks, 4.1e3, 2.2e5) == pytest.approx(exact.real, rel=1e-9)
    with pytest.raises(ModelError, match=r"is outside what was measured.*: state that point or measure there$"):
        export_results(files / "map.json", "tir", tmp_path / "b.tir", points=[{PRESSURE: 4e5, LOAD: 3e3}], frequency=F0)


def test_one_point_says_so_and_what_is_not_known_is_left_out(tmp_path):
    plain = table((2e5,), (3.5e3,)).drop(PRESSURE, LOAD).with_columns(tyre=pl.lit('m "A" \n [VERTICAL] <b>タイヤ'))
    measured = measured_of(plain, std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    exported = export_results(tmp_path / "model.json", "tir", frequency=F0)
    blocks, comments = read(exported.path)
    assert set(blocks) == {"MDI_HEADER", "UNITS", "MODEL", "VERTICAL"}
    exact = stiffness([F0], 2e5, 3.5e3)[0]
    own = blocks["VERTICAL"]
    assert own == pytest.approx(
        {"VERTICAL_STIFFNESS": exact.real, "VERTICAL_DAMPING": exact.imag / (2 * np.pi * F0)}, rel=1e-5
    )
    assert "the only one: no change over load and pressure" in comments
    assert "left out, for these tests do not know the radius: UNLOADED_RADIUS; state --radius" in exported.notes
    assert "the tests state no preload: FNOMIN and Q_FZ2 are left out" in exported.notes
    assert "the tests state no pressure: INFLPRES, NOMPRES and PFZ1 are left out" in exported.notes


def test_what_is_not_stated_or_outside_is_refused(files, tmp_path):
    def made(**stated):
        return export_results(files / "model.json", "tir", tmp_path / "a.tir", **stated)

    with pytest.raises(ModelError, match=r"state its frequency, --frequency"):
        made()
    with pytest.raises(ModelError, match=r"80 Hz is outside the measured band of .*, 1 to 60 Hz"):
        made(frequency=80.0)
    measured = measured_of(pl.concat([table((2e5,), (2e3,), tyre=one) for one in "ab"]), std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "two.json")
    with pytest.raises(ModelError, match="state --specimen, one of 'a', 'b'"):
        export_results(tmp_path / "two.json", "tir", frequency=F0)
    assert [one.name for one in tmp_path.iterdir()] == ["two.json"]
