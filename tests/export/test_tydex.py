"""The TYDEX files, read back by the reader of the room io and by the columns of the manual."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from tests.export.conftest import rejected, repeated, table

from fourpole.errors import FileError
from fourpole.export import export_results
from fourpole.export.tydex import _CHANNELS
from fourpole.io.formats.tydex import read_tydex

FILES = {
    "radial-ply_1.35bar_1000N_0kgadded.tdx": (135e3, 0.0),
    "radial-ply_1.7bar_1000N_0kgadded.tdx": (170e3, 0.0),
    "radial-ply_1.7bar_1000N_10kgadded.tdx": (170e3, 10.0),
}


def rows_at(folder, pressure, mass):
    frame = table(folder).filter((pl.col("pressure [Pa]") == pressure) & (pl.col("added mass [kg]") == mass))
    return frame.sort("frequency [Hz]")


def test_a_file_for_each_condition(results):
    assert sorted(path.name for path in export_results(results, "tydex").path.iterdir()) == sorted(FILES)


@pytest.mark.parametrize("name", FILES)
def test_the_channels_hold_the_table(results, name):
    tyre = read_tydex(export_results(results, "tydex").path / name)
    frame = rows_at(results, *FILES[name])
    assert tyre.notes == ()
    np.testing.assert_array_equal(tyre.values("MEASNUMB"), [1.0, 2.0, 3.0])
    held = {column: called for column, called, _ in _CHANNELS if frame[column].is_not_null().any()}
    assert [one.name for one in tyre.channels] == ["MEASNUMB", *held.values()]
    for column, called in held.items():
        # thirteen digits are written
        np.testing.assert_allclose(tyre.values(called), frame[column].to_numpy(), rtol=5.1e-13)
    units = {one.name: one.unit for one in tyre.channels}
    assert (units["FREQUENC"], units["KDYN_RE"], units["C"], units["MOB_IM"]) == ("Hz", "N/m", "N s/m", "m/(N s)")


def test_constants_say_the_condition(results):
    tyre = read_tydex(export_results(results, "tydex").path / "radial-ply_1.7bar_1000N_10kgadded.tdx")
    frame = rows_at(results, 170e3, 10.0)
    found = {one.name: (one.value, one.unit) for one in tyre.constants}
    assert found["IDENTITY"] == ("radial-ply", "")
    assert found["INFLPRES"] == ("1.7", "bar")
    assert found["FZW"] == ("1000", "N")
    assert found["ADDMASS"] == ("10", "kg")
    assert tyre.constant("K1STAT").number == pytest.approx(frame["K1 [N/m]"][0], rel=5.1e-13)
    assert tyre.constant("RELEASE").value == "1.3"


def test_the_mean_temperature_is_a_constant_where_tests_state_one(results, changed):
    file = "radial-ply_1.7bar_1000N_10kgadded.tdx"
    assert read_tydex(export_results(results, "tydex").path / file).constant("MEANTEMP") is None
    degrees = 21.0 + pl.col("frequency [Hz]").rank("dense").over("pressure [Pa]", "added mass [kg]") / 2
    folder = changed(lambda frame: frame.with_columns(degrees.alias("temperature [degC]")))
    found = read_tydex(export_results(folder, "tydex").path / file).constant("MEANTEMP")
    assert (found.value, found.unit) == ("22", "deg C")


def test_bytes_stand_in_the_columns_of_the_manual(results):
    path = export_results(results, "tydex").path / "radial-ply_1.7bar_1000N_0kgadded.tdx"
    lines = path.read_bytes().decode("ascii").split("\n")
    sections = [line for line in lines if line.startswith("**")]
    assert sections == ["**HEADER", "**COMMENTS", "**CONSTANTS", "**MEASURCHANNELS", "**MEASURDATA", "**END"]
    at = {section: lines.index(section) for section in sections}
    pressure = next(line for line in lines if line.startswith("INFLPRES"))
    assert [pressure[:10], pressure[10:40].rstrip(), pressure[40:50].rstrip(), pressure[50:]] == [
        "INFLPRES  ", "Inflation pressure", "bar", "1.7",
    ]  # fmt: skip
    for line in lines[at["**MEASURCHANNELS"] + 1 : at["**MEASURDATA"]]:
        name, words, unit, numbers = line[:10], line[10:40], line[40:50], line[50:]
        assert name.rstrip().isidentifier()
        assert name[8:] == "  "
        assert words.endswith(" ")
        assert unit.strip()
        assert [numbers[:10].strip(), numbers[10:20].strip(), numbers[20:].strip()] == ["1", "0", "0"]
    frame = rows_at(results, 170e3, 0.0)
    second = lines[at["**MEASURDATA"] + 2]
    width = 20 if len(second) % 30 else 30
    cells = [float(second[start : start + width]) for start in range(0, len(second), width)]
    assert cells[:2] == [2.0, pytest.approx(frame["frequency [Hz]"][1], rel=5.1e-13)]
    assert len(cells) == at["**MEASURDATA"] - at["**MEASURCHANNELS"] - 1


def test_comments_name_the_tests_and_those_left_out(changed):
    folder = changed(rejected("D2"))
    tyre = read_tydex(export_results(folder, "tydex").path / "radial-ply_1.35bar_1000N_0kgadded.tdx")
    said = " ".join(tyre.comments)
    assert "MEASNUMB 1 is test D1, verdict ok" in said
    assert "Left out is test D2, rejected: lift-off: less drive" in said
    assert tyre.data.shape[0] == 2


def test_a_repeat_is_a_file_of_its_own(changed):
    folder = export_results(changed(repeated), "tydex").path
    tyre = read_tydex(folder / "radial-ply_1.35bar_1000N_0kgadded_repeat2.tdx")
    assert tyre.values("K2")[0] == pytest.approx(1.01 * table(changed())["K2 [N/m]"][0], rel=1e-12)


def test_an_earlier_export_is_replaced_as_a_whole(results, changed):
    folder = export_results(results, "tydex").path
    export_results(changed(rejected("D7", "D8", "D9", "D4", "D5", "D6")), "tydex")
    left = [path.name for path in folder.iterdir()]
    assert len(left) == 1
    assert [path.name for path in results.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("name", ["mine.tdx", "notes.txt"])
def test_files_of_others_are_never_touched(results, name):
    folder = export_results(results, "tydex").path
    mine = folder / name
    mine.write_text("**HEADER\nSUPPLIER  Data supplier                           me\n")
    with pytest.raises(FileError, match=f"holds {name}, which fourpole did not write: name a new folder"):
        export_results(results, "tydex")
    assert mine.read_text().endswith("me\n")
    with pytest.raises(FileError, match="is no folder"):
        export_results(results, "tydex", mine)


def test_a_folder_that_cannot_be_made_is_one_message(results, tmp_path):
    with pytest.raises(FileError, match=r"cannot be written: .*does its folder exist"):
        export_results(results, "tydex", tmp_path / "no" / "tydex")
