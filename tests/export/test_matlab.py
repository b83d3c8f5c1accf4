"""The MAT-file, read back by scipy and by a reader of its own."""

from __future__ import annotations

import json
import re

import numpy as np
import polars as pl
import pytest
from scipy.io import loadmat
from tests.export.conftest import rejected, table
from tests.export.mat5 import read_mat5

from fourpole.export import export_results
from fourpole.version import VERSION

TABLES = ("static", "dynamic", "rig", "residuals", "budget")


@pytest.fixture(scope="module")
def file(analysed, tmp_path_factory):
    return export_results(analysed, "mat", tmp_path_factory.mktemp("mat") / "a.mat").path


@pytest.fixture(scope="module")
def found(file):
    return read_mat5(file.read_bytes())[1]


def test_the_head_is_one_of_level_5_and_says_what_the_file_is(file):
    head, _ = read_mat5(file.read_bytes())
    begin = re.escape(f"MATLAB 5.0 MAT-file, results of fourpole {VERSION}, ")
    assert re.fullmatch(begin + r"20\d\d-\d\d-\d\d \d\d:\d\d:\d\d UTC *", head)


def test_a_struct_per_table(found):
    assert list(found) == ["study", *TABLES, "phasors"]


@pytest.mark.parametrize("name", TABLES)
def test_every_column_is_there_to_the_last_bit_with_its_name_and_unit(found, analysed, name):
    frame, struct = table(analysed, name), found[name]
    fields = {original: field for field, original in struct["names"].items()}
    for column in frame.columns:
        field, values = fields[column], frame[column].to_list()
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", field)
        unit = re.search(r"\[(.*)\]$", column)
        assert struct["units"][field] == (unit.group(1) if unit else "")
        if isinstance(struct[field], list):
            assert struct[field] == [value or "" for value in values]
        else:
            assert struct[field].shape == (frame.height, 1)
            wanted = np.array([np.nan if value is None else value for value in values])
            np.testing.assert_array_equal(struct[field][:, 0], wanted)


def test_it_reads_in_matlab_as_one_would_type_it(found):
    dynamic = found["dynamic"]
    assert dynamic["units"]["K2"] == "N/m"
    assert dynamic["names"]["u_Re_K"] == "u(Re K*) [N/m]"
    assert list(dynamic)[-2:] == ["units", "names"]
    assert dynamic["test"][:2] == ["D1", "D2"]
    assert found["rig"]["value"][0] == "moving_mass"


def test_complex_values_with_their_covariance(found, analysed):
    frame, dynamic = table(analysed), found["dynamic"]
    for field, names in {"K": ("Re K*", "Im K*", "N/m", "Re,Im K*"), "mobility": ("R", "I", "m/(N s)", "R,I")}.items():
        real, imag, unit, pair = names
        stds = [frame[f"u({part}) [{unit}]"].to_numpy() for part in (real, imag)]
        np.testing.assert_array_equal(dynamic[field][:, 0].real, frame[f"{real} [{unit}]"].to_numpy())
        np.testing.assert_array_equal(dynamic[field][:, 0].imag, frame[f"{imag} [{unit}]"].to_numpy())
        covariance = dynamic[f"{field}_covariance"]
        assert covariance.shape == (2, 2, frame.height)
        for i in range(2):
            np.testing.assert_array_equal(covariance[i, i], stds[i] ** 2)
        # one product of three floats in another order: two roundings
        cross = frame[f"corr({pair}) [1]"].to_numpy() * stds[0] * stds[1]
        np.testing.assert_allclose(covariance[0, 1], cross, rtol=4 * np.finfo(float).eps)
        np.testing.assert_array_equal(covariance[0, 1], covariance[1, 0])
        assert dynamic["units"][field] == unit


def test_phasors_are_complex_with_the_covariance_of_their_parts(found, analysed):
    kept, phasors = pl.read_parquet(analysed / "phasors.parquet"), found["phasors"]
    assert phasors["test"] == kept["test"].to_list()
    for name, unit in (("F1", "N"), ("V1", "m/s"), ("V2", "m/s")):
        np.testing.assert_array_equal(phasors[name][:, 0].real, kept[f"Re {name} [{unit}]"].to_numpy())
        np.testing.assert_array_equal(phasors[name][:, 0].imag, kept[f"Im {name} [{unit}]"].to_numpy())
        assert phasors["units"][name] == unit
    listed = kept["covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2"].to_list()
    for at, one in enumerate(listed):
        np.testing.assert_array_equal(phasors["covariance"][:, :, at], np.array(one).reshape(6, 6))
    assert phasors["covariance"].shape == (6, 6, kept.height)


def test_the_study_says_how_it_was_made(found, analysed):
    study = found["study"]
    assert json.loads(study["json"]) == json.loads((analysed / "study.json").read_text("utf-8"))
    assert study["settings"]["route"] == "joint"
    assert study["settings"]["seed"] == 1982.0
    assert study["versions"]["fourpole"] == VERSION
    assert study["verdicts"]["ok"] == 11.0


def test_scipy_reads_the_same(file, found):
    """The library's own way back, as those without MATLAB go it."""
    loaded = loadmat(file, simplify_cells=True)
    np.testing.assert_array_equal(loaded["dynamic"]["K"], found["dynamic"]["K"][:, 0])
    assert loaded["dynamic"]["units"]["C"] == "N s/m"
    assert list(loaded["static"]["test"]) == found["static"]["test"]


def test_blanks_rejected_tests_and_further_columns_are_all_there(changed):
    def change(frame):
        blank = pl.when(pl.col("test") == "D2").then(None).otherwise("Re K* [N/m]").alias("Re K* [N/m]")
        more = {"K": pl.lit("k"), "units": pl.lit(""), "Länge [mm]": pl.lit("12.5"), "end": pl.lit("007")}
        return rejected("D2")(frame).with_columns(blank, **more)

    exported = export_results(changed(change), "mat")
    dynamic = read_mat5(exported.path.read_bytes())[1]["dynamic"]
    assert exported.notes == ()
    assert dynamic["verdict"][:3] == ["ok", "rejected", "ok"]
    assert np.isnan(dynamic["K"][1, 0].real)
    assert np.isfinite(dynamic["K"][1, 0].imag)
    assert dynamic["K_2"] == ["k"] * 9
    assert (dynamic["names"]["Lange"], dynamic["units"]["Lange"]) == ("Länge [mm]", "mm")
    np.testing.assert_array_equal(dynamic["Lange"][:, 0], 12.5)
    assert dynamic["x_end"] == ["007"] * 9


def test_no_dynamic_tests_and_no_phasors_is_a_file_too(changed):
    folder = changed(lambda frame: frame[:0])
    (folder / "phasors.parquet").unlink()
    found = read_mat5(export_results(folder, "mat").path.read_bytes())[1]
    assert "phasors" not in found
    assert found["dynamic"]["K2"].size == 0
