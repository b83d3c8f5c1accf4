"""The universal file, read back by the columns of the published layout of data set 58."""

from __future__ import annotations

from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.export.conftest import repeated, table

from fourpole.export import export_results
from fourpole.version import VERSION


def fields(line: str, *widths: int) -> list[str]:
    """A record in fixed columns; nothing but blanks may stand beyond them."""
    found, at = [], 0
    for width in widths:
        found.append(line[at : at + width].strip())
        at += width
    assert not line[at:].strip()
    return found


def data_sets(text: str) -> list[tuple[int, list[str]]]:
    """Blocks between lines of -1, by their number."""
    lines, found = text.split("\n"), []
    assert lines.pop() == ""
    marks = [at for at, line in enumerate(lines) if line == "    -1"]
    assert len(marks) % 2 == 0
    assert marks[0] == 0
    assert marks[-1] == len(lines) - 1
    for start, end in zip(marks[::2], marks[1::2], strict=True):
        found.append((int(fields(lines[start + 1], 6)[0]), lines[start + 2 : end]))
    return found


def function(lines: list[str]) -> dict[str, Any]:
    """A data set 58 of complex values, double precision."""
    dof = fields(lines[5], 5, 10, 5, 10, 1, 10, 10, 4, 1, 10, 10, 4)
    form = fields(lines[6], 10, 10, 10, 13, 13, 13)
    axes = [fields(line, 10, 5, 5, 5, 1, 20, 1, 20) for line in lines[7:11]]
    even = form[2] == "1"
    widths = (20, 20) if even else (13, 20, 20)
    rows = [[float(one) for one in fields(line, *widths)] for line in lines[11:]]
    return {
        "id": [line.rstrip() for line in lines[:5]],
        "type": int(dof[0]),
        "number": int(dof[1]),
        "version": int(dof[2]),
        "load case": int(dof[3]),
        "response": (dof[5], int(dof[6]), int(dof[7])),
        "reference": (dof[9], int(dof[10]), int(dof[11])),
        "data type": int(form[0]),
        "count": int(form[1]),
        "even": even,
        "start": (float(form[3]), float(form[4])),
        "axes": [(int(one[0]), one[5], one[7]) for one in axes],
        "x": np.array([float(form[3])] if even else [row[0] for row in rows]),
        "y": np.array([complex(*row[-2:]) for row in rows]),
    }


def read(folder, kind="uff"):
    sets = data_sets(export_results(folder, kind).path.read_text("ascii"))
    return sets, [function(lines) for number, lines in sets if number == 58]


def test_the_file_says_what_it_is_and_that_it_is_in_si(results):
    sets, functions = read(results)
    assert [number for number, _ in sets] == [151, 164] + [58] * 6
    header, units = sets[0][1], sets[1][1]
    assert header[0].strip() == "results.uff"
    assert header[2].strip() == header[5].strip() == f"fourpole {VERSION}"
    assert fields(units[0], 10, 20, 10) == ["1", "SI: Meter (newton)", "2"]
    assert [float(one.replace("D", "E")) for one in fields(units[1], 25, 25, 25)] == [1.0, 1.0, 1.0]
    assert [one["number"] for one in functions] == list(range(1, 7))


@pytest.mark.parametrize(
    ("first", "real", "imag", "above", "below"),
    [
        ("Mobility V1/F1", "R [m/(N s)]", "I [m/(N s)]", (11, "V1", "m/s"), (13, "F1", "N")),
        ("Dynamic stiffness K*", "Re K* [N/m]", "Im K* [N/m]", (13, "Force on the tyre", "N"), (8, "Deflection", "m")),
    ],
)
def test_functions_hold_the_table_in_rising_frequency(results, first, real, imag, above, below):
    frame = table(results)
    functions = [one for one in read(results)[1] if one["id"][0].startswith(first)]
    conditions = [(135e3, 0.0), (170e3, 0.0), (170e3, 10.0)]
    named = ["1.35 bar, 1000 N, 0 kg added", "1.7 bar, 1000 N, 0 kg added", "1.7 bar, 1000 N, 10 kg added"]
    assert [one["id"][1] for one in functions] == [f"radial-ply, {name}" for name in named]
    for one, (pressure, mass) in zip(functions, conditions, strict=True):
        mine = frame.filter((pl.col("pressure [Pa]") == pressure) & (pl.col("added mass [kg]") == mass))
        mine = mine.sort("frequency [Hz]")
        assert (one["type"], one["data type"], one["count"], one["even"]) == (4, 6, 3, False)
        assert one["start"] == (0.0, 0.0)
        assert one["response"] == one["reference"] == ("NONE", 1, 3)
        assert one["load case"] == 0
        assert one["axes"] == [(18, "Frequency", "Hz"), above, below, (0, "NONE", "NONE")]
        # Six digits of the abscissa and twelve of the values are what the layout holds.
        np.testing.assert_allclose(one["x"], mine["frequency [Hz]"].to_numpy(), rtol=5.1e-6)
        np.testing.assert_allclose(one["y"].real, mine[real].to_numpy(), rtol=5.1e-12)
        np.testing.assert_allclose(one["y"].imag, mine[imag].to_numpy(), rtol=5.1e-12)


def test_lines_say_route_campaign_and_uncertainty(results):
    one = read(results)[1][0]
    largest = table(results).filter(pl.col("pressure [Pa]") == 135e3)["u(R) [m/(N s)]"].max()
    assert all(len(line) <= 80 for line in one["id"])
    assert one["id"][3].startswith(f"fourpole {VERSION}, route joint; Radial-ply, virtual")
    assert one["id"][4].startswith(f"e^(+jwt); standard uncertainty up to {largest:.3g} (Re)")
    day, clock = one["id"][2].split()
    assert len(day) == 9
    assert len(clock) == 8


def test_a_repeat_is_a_function_of_its_own_with_one_value(changed):
    functions = read(changed(repeated))[1]
    again = [one for one in functions if one["version"] == 1]
    assert [one["id"][1] for one in again] == ["radial-ply, 1.35 bar, 1000 N, 0 kg added, repeat 2"] * 2
    assert all(one["even"] and one["count"] == 1 and one["start"][1] == 1.0 for one in again)
    frame = table(changed())
    np.testing.assert_allclose(again[1]["x"], frame["frequency [Hz]"][0], rtol=5.1e-6)
    np.testing.assert_allclose(again[1]["y"].real, frame["Re K* [N/m]"][0], rtol=5.1e-12)


def test_a_value_that_is_missing_is_no_zero(changed):
    folder = changed(
        lambda frame: frame.with_columns(
            pl.when(pl.col("test") == "D2").then(None).otherwise("Im K* [N/m]").alias("Im K* [N/m]")
        )
    )
    exported = export_results(folder, "uff")
    assert exported.notes == ("1 test has no Dynamic stiffness K*: D2",)
    counts = [one["count"] for one in read(folder)[1]]
    assert counts == [3, 3, 3, 2, 3, 3]
    assert all((one["y"] != 0).all() for one in read(folder)[1])


def test_the_packages_own_reader_takes_it(results):
    import pyuff

    sets = pyuff.UFF(str(export_results(results, "uff").path)).read_sets()
    assert [one["type"] for one in sets] == [151, 164] + [58] * 6
    assert sets[2]["func_type"] == 4
