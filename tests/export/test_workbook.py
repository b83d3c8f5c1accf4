"""The workbook, read back by openpyxl and as the XML that it is."""

from __future__ import annotations

import re
import zipfile

import openpyxl
import polars as pl
import pytest
from tests.export.conftest import rejected, repeated, table

from fourpole.export import export_results, workbook
from fourpole.plot.style import Style
from fourpole.version import VERSION

TABLES = ("static", "dynamic", "rig", "residuals", "budget")


@pytest.fixture(scope="module")
def book(analysed, tmp_path_factory):
    return openpyxl.load_workbook(export_results(analysed, "xlsx", tmp_path_factory.mktemp("book") / "a.xlsx").path)


@pytest.mark.parametrize("name", TABLES)
def test_every_cell_of_every_table_is_there_to_the_last_bit(book, analysed, name):
    """Numbers are compared as they are, not closely: the CSV's digits name one float only."""
    frame = table(analysed, name)
    rows = list(book[name].iter_rows(values_only=True))
    assert list(rows[0]) == frame.columns
    assert len(rows) == frame.height + 1
    for row, cells in zip(frame.iter_rows(), rows[1:], strict=True):
        assert [cell if cell not in ("", None) else None for cell in row] == list(cells)


def test_the_digits_in_the_file_are_those_of_the_csv(results):
    """Seventeen where it takes seventeen: the reader above might round."""
    text = zipfile.ZipFile(export_results(results, "xlsx").path).read("xl/worksheets/sheet4.xml").decode()
    written = set(re.findall(r"<v>([^<]+)</v>", text))
    frame = table(results)
    assert {repr(value) for value in frame["K2 [N/m]"].to_list()} <= written
    assert any(len(digits.replace(".", "").strip("0")) == 17 for digits in written)


def test_sheets_begin_with_what_this_is_and_the_charts(book):
    assert book.sheetnames == ["about", "charts", *TABLES, "chart data", "chart data K1"]
    said = {row[0]: row[1] for row in book["about"].iter_rows(min_row=2, values_only=True) if row[0]}
    assert book["about"]["A1"].value.startswith("Radial-ply, virtual")
    assert said["results of"].startswith(f"fourpole {VERSION}, analysed 20")
    assert said["route to K*"] == "joint"
    assert said["tests"] == "11 ok, 0 warning, 0 rejected"
    assert "numpy" in said["versions"]
    assert "e^{+jwt}" in said["numbers"]


def test_heads_stay_and_columns_are_wide_enough(book):
    sheet = book["dynamic"]
    assert sheet.freeze_panes == "B2"
    assert sheet.auto_filter.ref == "A1:AO10"
    assert sheet.column_dimensions["D"].width > len("radial-ply (virtual)")
    assert sheet["AD2"].number_format == "0.0"


def test_verdicts_are_coloured_by_their_word(changed):
    book = openpyxl.load_workbook(export_results(changed(rejected("D2")), "xlsx").path)
    sheet = book["dynamic"]
    at = [cell.value for cell in sheet[1]].index("verdict") + 1
    good, bad = sheet.cell(2, at), sheet.cell(3, at)
    assert (good.value, good.fill.fgColor.rgb) == ("ok", "FFDCF1EA")
    assert (bad.value, bad.fill.fgColor.rgb) == ("rejected", "FFF7D9C7")
    about = [row[1] for row in book["about"].iter_rows(values_only=True) if row[0] == "rejected"]
    assert about == ["D2: lift-off: less drive"]


def test_no_name_of_a_tyre_becomes_a_formula_of_a_chart(changed):
    def change(frame):
        return frame.with_columns(tyre=pl.lit("=cmd|' /C calc'!A0"))

    file = zipfile.ZipFile(export_results(changed(change, change), "xlsx").path)
    charts = [file.read(name).decode() for name in file.namelist() if name.startswith("xl/charts/chart")]
    formulas = [formula for chart in charts for formula in re.findall(r"<c:f>(.*?)</c:f>", chart)]
    assert len(charts) == 6
    assert formulas
    assert all(re.fullmatch(r"'chart data( K1)?'!\$[A-Z]+\$\d+(:\$[A-Z]+\$\d+)?", formula) for formula in formulas)


def test_rejected_tests_are_rows_but_no_points(changed):
    book = openpyxl.load_workbook(export_results(changed(rejected("D2")), "xlsx").path)
    assert "D2" in [cell.value for cell in book["dynamic"]["A"]]
    assert "D2" not in [cell.value for cell in book["chart data"]["B"]]
    assert "D1" in [cell.value for cell in book["chart data"]["B"]]


@pytest.mark.parametrize(
    "texts",
    [["=1+1", "+1", "-1 or so", "@SUM(A1)", "\t=1", "{=1}", "https://a.b", "007", "TRUE"], ["+1"] * 9, ["007"] * 9],
    ids=["all", "a sign", "zeros"],
)
def test_no_text_becomes_a_formula_a_link_or_a_number(changed, texts):
    column = pl.Series(texts)
    folder = changed(lambda frame: frame.with_columns(column.alias("remarks"), column.alias("=1+2 [m]")))
    book = openpyxl.load_workbook(export_results(folder, "xlsx").path)
    sheet = book["dynamic"]
    heads = [cell.value for cell in sheet[1]]
    for row, text in enumerate(texts, start=2):
        cell = sheet.cell(row, heads.index("remarks") + 1)
        assert (cell.value, cell.data_type, cell.hyperlink) == (text, "s", None)
        assert cell.quotePrefix is (text[0] in "=+-@\t")
    assert sheet.cell(1, heads.index("=1+2 [m]") + 1).data_type == "s"
    formulas = [cell for sheet in book for row in sheet.iter_rows() for cell in row if cell.data_type == "f"]
    assert formulas == []


def charts_of(book):
    return {"".join(run.t for run in chart.title.tx.rich.p[0].r): chart for chart in book["charts"]._charts}


def title_of(axis):
    return "".join(run.t for run in axis.title.tx.rich.p[0].r)


def test_the_charts_are_native_and_say_quantity_and_unit(book):
    charts = charts_of(book)
    assert list(charts) == [
        "K2, 1000 N", "C, 1000 N", "K', 1000 N", "loss factor, 1000 N", "TR measured, 1000 N", "Static stiffness K1",
    ]  # fmt: skip
    axes = {name: (title_of(chart.x_axis), title_of(chart.y_axis)) for name, chart in charts.items()}
    assert axes["K2, 1000 N"] == ("frequency [Hz]", "K2 [kN/m]")
    assert axes["C, 1000 N"] == ("frequency [Hz]", "C [N s/m]")
    assert axes["TR measured, 1000 N"] == ("frequency [Hz]", "TR measured [1]")
    assert axes["Static stiffness K1"] == ("pressure [bar]", "K1 [kN/m]")


def cells(book, reference):
    sheet, _, area = reference.rpartition("!")
    return [cell.value for row in book[sheet.strip("'")][area.replace("$", "")] for cell in row]


def named(book, curve):
    sheet, _, cell = curve.tx.strRef.f.rpartition("!")
    return book[sheet.strip("'")][cell.replace("$", "")].value


def test_the_curves_show_the_table(book, analysed):
    """Each curve's cells are the tests of its condition, in rising frequency, in the unit of the axis."""
    frame = table(analysed)
    series = charts_of(book)["K2, 1000 N"].series
    assert [named(book, curve) for curve in series] == [
        "radial-ply, 1.35 bar, 0 kg added", "radial-ply, 1.7 bar, 0 kg added", "radial-ply, 1.7 bar, 10 kg added",
    ]  # fmt: skip
    for curve, (pressure, mass) in zip(series, ((135e3, 0.0), (170e3, 0.0), (170e3, 10.0)), strict=True):
        mine = frame.filter((pl.col("pressure [Pa]") == pressure) & (pl.col("added mass [kg]") == mass))
        mine = mine.sort("frequency [Hz]")
        assert mine.height == 3
        assert cells(book, curve.xVal.numRef.f) == mine["frequency [Hz]"].to_list()
        assert cells(book, curve.yVal.numRef.f) == (mine["K2 [N/m]"].to_numpy() / 1e3).tolist()
        assert cells(book, curve.errBars.plus.numRef.f) == (mine["u(K2) [N/m]"].to_numpy() / 1e3).tolist()
        assert f"#{curve.graphicalProperties.line.solidFill.srgbClr}" == Style().colour(0)


def test_a_repeat_is_a_curve_of_its_own(changed):
    book = openpyxl.load_workbook(export_results(changed(repeated), "xlsx").path)
    names = [named(book, curve) for curve in charts_of(book)["K2, 1000 N"].series]
    assert "radial-ply, 1.35 bar, 0 kg added, repeat 2" in names


def test_a_table_that_is_too_long_goes_on_on_the_next_sheet():
    frame = pl.DataFrame({"a": [1.0, 2.0, 3.0]})
    parts = list(workbook._parts("budget", frame, most=2))
    assert [(name, part["a"].to_list()) for name, part in parts] == [("budget", [1.0, 2.0]), ("budget (2)", [3.0])]
    assert [name for name, _ in workbook._parts("static", frame[:0])] == ["static"]


def test_a_text_beyond_what_a_cell_holds_is_cut_and_not_lost(changed):
    folder = changed(lambda frame: frame.with_columns(pl.lit("x" * 40_000).alias("remarks")))
    sheet = openpyxl.load_workbook(export_results(folder, "xlsx").path)["dynamic"]
    longest = max(len(cell.value) for cell in sheet[2] if isinstance(cell.value, str))
    assert longest == 32_767


def test_no_dynamic_tests_is_a_workbook_too(changed):
    book = openpyxl.load_workbook(export_results(changed(lambda frame: frame[:0]), "xlsx").path)
    assert book["dynamic"].max_row == 1
    assert book["charts"]._charts
