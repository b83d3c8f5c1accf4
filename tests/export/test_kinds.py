"""What all kinds share: which there are, what is refused, and that a file is there whole or not at all."""

from __future__ import annotations

import re
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.export.conftest import rejected
from tests.export.grid import read_grid

from fourpole.errors import CampaignError, FileError, TableError
from fourpole.export import KINDS, export_results
from fourpole.export.kinds import ABOUT, ExportKind, Takes
from fourpole.export.source import field_names, read_source, typed
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.models.shape import Shape

KINDS_OF_RESULTS = [name for name, kind in KINDS.items() if kind.takes is Takes.RESULTS]
NAMES = {"xlsx": "results.xlsx", "mat": "results.mat", "tydex": "tydex", "uff": "results.uff", "netcdf": "results.nc"}


def test_the_kinds_and_their_names():
    assert {kind: KINDS[kind].file for kind in KINDS_OF_RESULTS} == NAMES


def content_of(kind, path):
    """What is the same in each file of the same results; the library of NetCDF may stamp its objects with the time."""
    if kind == "netcdf":
        return [(name, str(one)) for name, one in read_grid(path).variables.items()]
    return [(one.name, one.read_bytes()) for one in (sorted(path.iterdir()) if path.is_dir() else [path])]


@pytest.mark.parametrize("kind", KINDS_OF_RESULTS)
@pytest.mark.sampled(5)
def test_each_is_written_beside_the_tables_by_default_leaves_nothing_else_and_is_the_same_again(results, kind):
    before = {path.name for path in results.iterdir()}
    exported = export_results(results, kind)
    assert exported.path == results / NAMES[kind]
    assert exported.notes == ()
    assert {path.name for path in results.iterdir()} - before == {NAMES[kind]}
    first = content_of(kind, exported.path)
    assert export_results(results, kind).path == exported.path  # in place of the earlier one
    assert content_of(kind, exported.path) == first
    assert {path.name for path in results.iterdir()} - before == {NAMES[kind]}


@pytest.mark.parametrize("kind", [kind for kind in KINDS_OF_RESULTS if kind != "tydex"])
def test_a_place_that_cannot_be_written_is_one_message(results, kind, tmp_path):
    with pytest.raises(FileError, match=r"a\.x: cannot be written: .*does its folder exist"):
        export_results(results, kind, tmp_path / "no" / "a.x")


@pytest.mark.parametrize(
    ("kind", "more"),
    [("abaqus", {"shape": Shape("shear", 0.01, 5e-4, 0.49)}), ("prony", {}), ("table", {}), ("modelica", {})],
)
def test_a_name_without_a_suffix_gets_that_of_the_kind(files, kind, more, tmp_path):
    exported = export_results(files / "model.json", kind, tmp_path / "mine", **more)
    assert exported.path == tmp_path / f"mine{Path(KINDS[kind].file).suffix}"
    assert exported.path.is_file()


@pytest.mark.parametrize(("kind", "said"), [("xls", "did you mean xlsx"), ("hdf", "it is one of"), ("MAT", "mean mat")])
def test_an_unknown_kind_names_the_known_ones(results, kind, said):
    with pytest.raises(CampaignError, match=rf"no kind of file '{kind}'.*{said}.*xlsx, mat, tydex, uff, netcdf"):
        export_results(results, kind)


def test_a_kind_that_was_removed_names_what_replaces_it(results):
    with pytest.raises(CampaignError, match="statespace-mat was removed: statespace has the same matrices as JSON"):
        export_results(results, "statespace-mat")


@pytest.mark.parametrize("kind", KINDS_OF_RESULTS)
def test_a_folder_without_results_is_said_to_be_none(kind, tmp_path):
    with pytest.raises(CampaignError, match="holds neither results nor a campaign"):
        export_results(tmp_path, kind)
    with pytest.raises(CampaignError, match="there is no such folder of results"):
        export_results(tmp_path / "none", kind)


@pytest.mark.parametrize(
    ("kind", "package", "extra"),
    [
        ("xlsx", "xlsxwriter", "export"),
        ("uff", "pyuff", "formats"),
        ("netcdf", "xarray", "maps"),
        ("netcdf", "h5netcdf", "maps"),
    ],
)
def test_a_missing_package_is_named_with_what_installs_it(results, kind, package, extra, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(FileError, match=rf'{package}, which is not installed: pip install "fourpole\[{extra}\]"'):
        export_results(results, kind)
    assert not (results / NAMES[kind]).exists()
    assert KINDS[kind].extra == extra


def test_a_kind_that_takes_something_else_says_what(results, tmp_path, monkeypatch):
    """A kind is one module and one entry; what it takes is read for it, and anything else is refused by name."""
    k = 1.8e5 + 120.0 * 1j * np.arange(10.0, 20.0)
    spread = np.full(10, 100.0)
    measured = measured_of(
        pl.DataFrame(
            {"tyre": ["radial"] * 10, "frequency [Hz]": np.arange(10.0, 20.0), "Re K* [N/m]": k.real}
            | {"Im K* [N/m]": k.imag, "u(Re K*) [N/m]": spread, "u(Im K*) [N/m]": spread}
        )
    )
    model = tmp_path / "model.json"
    model_file(measured, fit_tyres(measured, "kelvin")).write(model)
    with pytest.raises(CampaignError, match=r"mat takes a results folder.*; model\.json is a model file"):
        export_results(model, "mat")
    (tmp_path / "campaign.toml").touch()
    with pytest.raises(CampaignError, match=r"mat takes a results folder.* is a campaign folder"):
        export_results(tmp_path, "mat")
    monkeypatch.setitem(KINDS, "names", ExportKind("names.txt", "names", "names of tyres", Takes.MODEL))
    module = types.ModuleType("fourpole.export.names")
    module.write = lambda source, path: tuple(source.tyres)
    monkeypatch.setitem(sys.modules, "fourpole.export.names", module)
    exported = export_results(model, "names")
    assert exported.path == tmp_path / "names.txt"
    assert exported.notes == ("radial",)
    with pytest.raises(CampaignError, match=r"names takes a model file.* is a results folder"):
        export_results(results, "names")


@pytest.mark.parametrize("kind", KINDS_OF_RESULTS)
def test_the_help_and_the_docs_name_every_kind(kind):
    assert f"{kind}: {KINDS[kind].about}" in ABOUT
    needs = rf'`pip install "fourpole\[{KINDS[kind].extra}\]"` ' if KINDS[kind].extra else ""
    docs = (Path(__file__).parents[2] / "docs" / "export.md").read_text(encoding="utf-8")
    assert re.search(rf"^\| `{kind}` \|.*\| {needs}\|$", docs, re.MULTILINE)


@pytest.mark.parametrize("kind", ["tydex", "uff", "netcdf"])
def test_rejected_tests_are_left_out_of_grids_and_that_is_said(changed, kind):
    assert export_results(changed(rejected("D1", "D2")), kind).notes == ("2 tests rejected left out: D1, D2",)


@pytest.mark.parametrize("kind", ["tydex", "uff", "netcdf"])
def test_nothing_to_put_into_a_grid_is_an_error(changed, kind):
    folder = changed(rejected(*(f"D{number}" for number in range(1, 10))))
    with pytest.raises(TableError, match="to export"):
        export_results(folder, kind)


@pytest.mark.parametrize("kind", KINDS_OF_RESULTS)
@pytest.mark.sampled(2)
def test_names_of_any_kind_and_a_study_that_is_not_trusted_do_no_harm(changed, kind):
    hostile = "=cmd|' /C calc'!A0\x1b[31m **END <ü&\u202e>" + "x" * 300
    folder = changed(
        lambda frame: frame.with_columns(tyre=pl.lit(hostile)),
        lambda frame: frame.with_columns(tyre=pl.lit(hostile)),
        title=hostile,
        assumptions=hostile,
        settings=[1],
        versions=None,
    )
    path = export_results(folder, kind).path
    assert path.parent == folder
    if kind == "tydex":
        assert all(file.name.isascii() and file.name.isprintable() for file in path.iterdir())


def test_a_failure_leaves_the_old_file(results, monkeypatch):
    old = export_results(results, "mat").path.read_bytes()

    def failing(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(FileError, match="No space left"):
        export_results(results, "mat")
    assert (results / "results.mat").read_bytes() == old
    assert [path.name for path in results.iterdir() if path.name.endswith(".tmp")] == []


def test_only_columns_of_plain_numbers_become_numbers():
    frame = typed(
        pl.DataFrame(
            {"serial": ["007", "8"], "torque": ["1.5", ""], "remarks": ["", ""], "test": ["1", "2"], "n": ["-3", "1e5"]}
        )
    )
    assert frame.schema["serial"] == frame.schema["remarks"] == frame.schema["test"] == pl.String
    assert frame["torque"].to_list() == [1.5, None]
    assert frame["n"].to_list() == [-3.0, 1e5]


def test_names_of_columns_are_names_in_matlab_and_each_its_own():
    names = list(
        field_names(["a b", "a-b", "1st", "end", "Länge [m]", "", "§", "units", "_x"], taken={"units"}).values()
    )
    assert names == ["a_b", "a_b_2", "x1st", "x_end", "Lange", "column", "column_2", "units_2", "x"]


@pytest.mark.sampled(4)
def test_the_room_loads_the_packages_it_writes_with_only_to_write():
    rooms = "kinds, matlab, netcdf, source, tydex, uff, workbook"
    code = f"import sys; from fourpole.export import {rooms}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "fourpole.export.netcdf" in loaded
    assert not {"xlsxwriter", "xarray", "h5netcdf", "h5py", "pandas", "pyuff", "scipy.io"} & set(loaded)


def test_a_hot_test_is_another_condition_and_no_repeat(changed):
    def twice(table):
        cold = table.with_columns(pl.lit(20.0).alias("temperature [degC]"))
        hot = cold.with_columns(pl.lit(60.0).alias("temperature [degC]"), pl.col("test") + "-hot")
        return pl.concat([cold, hot])

    source = read_source(changed(twice))
    assert {condition.repeat for condition in source.conditions} == {0}
    names = [source.name_of(condition) for condition in source.conditions]
    assert {name.partition(",")[0] for name in names} == {"radial-ply at 20 °C", "radial-ply at 60 °C"}
    assert len(set(names)) == len(names) == 6


def test_axes_of_study_json_are_those_of_the_exports(changed):
    def batches(table):
        first = table.with_columns(pl.lit("A").alias("batch"))
        return pl.concat([first, first.with_columns(pl.lit("B").alias("batch"), pl.col("test") + "-b")])

    plain = read_source(changed(batches))
    assert {condition.repeat for condition in plain.conditions} == {0, 1}
    axes = {"axes": [{"column": "batch", "text": True}]}
    source = read_source(changed(conditions=axes))
    assert {condition.repeat for condition in source.conditions} == {0}
    assert source.sheet.names == ("radial-ply", "radial-ply, batch A", "radial-ply, batch B")
