"""The workbook, read back by openpyxl and as the XML that it is."""

from __future__ import annotations

import re
import zipfile

import openpyxl
import polars as pl
import pytest
from tests.export.conftest import rejected, table

from fourpole.export import export_results, workbook
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
    text = zipfile.ZipFile(export_results(results, "xlsx").path).read("xl/worksheets/sheet3.xml").decode()
    written = set(re.findall(r"<v>([^<]+)</v>", text))
    frame = table(results)
    assert {repr(value) for value in frame["K2 [N/m]"].to_list()} <= written
    assert any(len(digits.replace(".", "").strip("0")) == 17 for digits in written)


def test_sheets_begin_with_what_this_is(book):
    assert book.sheetnames == ["about", *TABLES]
    said = {row[0]: row[1] for row in book["about"].iter_rows(min_row=2, values_only=True) if row[0]}
    assert book["about"]["A1"].value.startswith("Radial-ply, virtual")
    assert said["results of"].startswith(f"fourpole {VERSION}, analysed 20")
    assert said["route to K*"] == "joint"
    assert said["tests"] == "11 ok, 0 warning, 0 rejected"
    assert "numpy" in said["versions"]
    assert "e^{+jwt}" in said["numbers"]
    assert "fourpole plot" in said["figures"]


def test_heads_stay_and_columns_are_wide_enough(book):
    sheet = book["dynamic"]
    assert sheet.freeze_panes == "B2"
    assert sheet.auto_filter.ref == "A1:AT10"
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
