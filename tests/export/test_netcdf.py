"""The grid, read back by the C library of NetCDF."""

from __future__ import annotations

import itertools
import json
import shutil

import numpy as np
import polars as pl
import pytest
from tests.export.conftest import change_tables, rejected, repeated, table
from tests.export.grid import read_grid

from fourpole.errors import TableError
from fourpole.export import export_results, netcdf
from fourpole.version import VERSION

GRID = ("tyre", "pressure", "preload", "frequency", "setting", "repeat")


@pytest.fixture(scope="module")
def grid(analysed, tmp_path_factory):
    """What an export of the whole analysis holds."""
    return read_grid(export_results(analysed, "netcdf", tmp_path_factory.mktemp("grid") / "grid.nc").path)


@pytest.fixture(scope="module")
def edited(analysed, tmp_path_factory):
    """The folder and its export, after a warning of D3, a repeat of D1, further columns and a second static test."""
    more = {"torque [N m]": pl.lit("2.5"), "operator": pl.lit("=Ada"), "tyre_2": pl.lit("x"), "repeat": pl.lit("3")}
    warned = pl.when(pl.col("test") == "D3").then(pl.lit("warning")).otherwise("verdict").alias("verdict")
    folder = change_tables(
        shutil.copytree(analysed, tmp_path_factory.mktemp("edited") / "results"),
        lambda frame: repeated(frame.with_columns(warned, **more)),
        lambda frame: pl.concat([frame, frame[:1].with_columns(pl.lit("S9").alias("test"))]),
    )
    return folder, read_grid(export_results(folder, "netcdf", folder.parent / "grid.nc").path)


def rows_of(grid, frame):
    """The cell of each test, by its name."""
    names = grid["test"].values
    return {name: tuple(int(at) for at in np.argwhere(names == name)[0]) for name in frame["test"].to_list()}


def test_dimensions_are_those_of_the_campaign(grid):
    sizes = grid.dimensions
    assert sizes == dict(zip((*GRID, "static_test"), (1, 2, 1, 3, 2, 1, 1), strict=True))
    assert grid["K2"].dimensions == GRID
    assert list(grid["tyre"].values) == ["radial-ply"]
    np.testing.assert_array_equal(grid["pressure"].values, [135e3, 170e3])
    np.testing.assert_allclose(grid["frequency"].values, [10.0, 17.0, 24.0], rtol=0.01)
    assert list(grid["setting"].values) == ["0 kg added", "10 kg added"]
    assert grid["construction"].dimensions == ("tyre",)


def test_every_test_is_in_its_cell_to_the_last_bit(grid, analysed):
    frame = table(analysed)
    cells = rows_of(grid, frame)
    assert len(set(cells.values())) == frame.height
    columns = {
        "K2": "K2 [N/m]",
        "u_C": "u(C) [N s/m]",
        "Re_K": "Re K* [N/m]",
        "Im_K": "Im K* [N/m]",
        "R": "R [m/(N s)]",
    }
    columns |= {"frequency_found": "frequency [Hz]", "corr_K2_C": "corr(K2,C) [1]", "TR_measured": "TR measured [1]"}
    for row in frame.iter_rows(named=True):
        cell = cells[row["test"]]
        assert grid["pressure"].values[cell[1]] == row["pressure [Pa]"]
        assert grid["frequency"].values[cell[3]] == pytest.approx(row["frequency [Hz]"], rel=0.02)
        assert grid["setting"].values[cell[4]] == f"{row['added mass [kg]']:g} kg added"
        for field, column in columns.items():
            assert grid[field].values[cell] == row[column]


def test_where_no_test_was_made_is_missing(grid, analysed):
    frame = table(analysed)
    held = set(rows_of(grid, frame).values())
    whole = grid["K2"].values
    assert np.ma.getmaskarray(whole).sum() == whole.size - frame.height
    for cell in itertools.product(*map(range, whole.shape)):
        assert np.ma.is_masked(whole[cell]) == (cell not in held)
        assert (grid["test"].values[cell] == "") == (cell not in held)
        assert np.ma.is_masked(grid["verdict"].values[cell]) == (cell not in held)


def test_every_number_says_unit_and_name_and_its_uncertainty(grid, analysed):
    frame = table(analysed)
    for name, variable in grid.variables.items():
        assert variable.attributes["long_name"]
        if variable.values.dtype != object and name != "verdict":
            assert variable.attributes["units"]
    assert (grid["K2"].attributes["units"], grid["C"].attributes["units"], grid["R"].attributes["units"]) == (
        "N/m",
        "N s/m",
        "m/(N s)",
    )
    assert grid["K2"].attributes["ancillary_variables"] == "u_K2 corr_K2_C verdict"
    assert grid["u_K2"].attributes["long_name"] == "standard uncertainty of K2"
    for name in (
        "K1",
        "K2",
        "C",
        "Re_K",
        "Im_K",
        "R",
        "I",
        "loss_factor",
        "TR_measured",
        "TR_predicted",
        "energy_per_cycle",
    ):
        linked = grid[name].attributes["ancillary_variables"].split()
        assert linked[0] == ("u_TR" if name.startswith("TR") else f"u_{name}")
        assert set(linked) <= set(grid.variables)
    assert len([column for column in frame.columns if column.startswith("u(")]) == 10


def test_the_verdict_is_a_flag(edited):
    folder, grid = edited
    flag = grid["verdict"]
    assert (flag.attributes["flag_values"], flag.attributes["flag_meanings"]) == ([0, 1], "ok warning")
    cells = rows_of(grid, table(folder))
    assert (flag.values[cells["D3"]], flag.values[cells["D2"]]) == (1, 0)


def test_the_file_says_what_it_is(grid, analysed):
    assert grid.attributes["Conventions"] == "CF-1.11"
    assert grid.attributes["title"].startswith("Radial-ply, virtual")
    assert grid.attributes["source"] == f"fourpole {VERSION}, route joint"
    assert "numpy" in grid.attributes["history"]
    assert json.loads(grid["study_json"].values.item()) == json.loads((analysed / "study.json").read_text("utf-8"))


def test_a_repeat_has_its_own_place(edited):
    folder, grid = edited
    frame = table(folder)
    assert grid.dimensions["repeat"] == 2
    cells = rows_of(grid, frame)
    assert cells["D1b"] == (*cells["D1"][:5], 1)
    assert [grid["K2"].values[cells[name]] for name in ("D1", "D1b")] == [frame["K2 [N/m]"][0], frame["K2 [N/m]"][-1]]


def test_static_tests_are_on_their_part_of_the_grid(edited):
    folder, grid = edited
    frame = table(folder, "static")
    assert grid["static_K1"].dimensions == ("tyre", "pressure", "preload", "static_test")
    assert grid["static_K1"].attributes["ancillary_variables"] == "static_u_K1"
    assert grid["static_test_name"].values[0, 0, 0].tolist() == ["S1", "S9"]
    assert grid["static_K1"].values[0, 1, 0, 0] == frame["K1 [N/m]"][1]
    assert np.ma.is_masked(grid["static_K1"].values[0, 1, 0, 1])


def test_static_tests_that_have_no_place_are_counted(changed):
    folder = changed(static=rejected("S1"))
    assert export_results(folder, "netcdf").notes == (
        "1 row of static tests, rejected or without a preload, left out: S1",
    )


def test_specimens_without_pressure_have_no_axis_of_blanks(changed, tmp_path):
    blank = pl.lit(None, pl.Float64).alias("pressure [Pa]")
    folder = changed(lambda frame: frame.with_columns(blank), lambda frame: frame.with_columns(blank))
    grid = read_grid(export_results(folder, "netcdf", tmp_path / "grid.nc").path)
    assert "pressure" not in grid.variables
    assert np.ma.getmaskarray(grid["pressure_stated"].values).all()
    assert grid.dimensions["repeat"] == 2  # without the pressure, they are the same condition


def test_a_list_of_tests_is_no_grid(changed, monkeypatch):
    monkeypatch.setattr(netcdf, "_MOST_CELLS", 11)
    with pytest.raises(
        TableError, match=r"a grid of 1 x 2 x 1 x 3 x 2 x 1 .* for 9 tests is too sparse; export as mat"
    ):
        export_results(changed(), "netcdf")


def test_further_columns_are_variables_too(edited):
    _, grid = edited
    assert grid["torque"].attributes["units"] == "N m"
    assert set(grid["operator"].values.ravel()) == {"", "=Ada"}
    assert grid["repeat_2"].values[0, 0, 0, 0, 0, 0] == 3.0
