"""Workbooks: tables that real writers wrote come back; sheets that hold none, and hostile ones, are refused."""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io import child as children
from fourpole.io import recordings as formats
from fourpole.io.formats.workbook import FORMAT
from fourpole.io.recordings import format_of
from fourpole.io.signals import Request, Signal

pytest.importorskip("fastexcel")
openpyxl = pytest.importorskip("openpyxl")

Outcome = Callable[[Path, str], list[str]]
Rows = Sequence[Sequence[Any]]

LIMIT = 10**9
N = 300
TIME = np.arange(N) / 1000
FORCE = np.random.default_rng(2).normal(size=N) * 1e-7
TABLE: Rows = [["t [s]", "F1 [kN]"], *([float(t), float(f)] for t, f in zip(TIME, FORCE, strict=True))]


def write_xlsx(path: Path, **sheets: Rows) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    book.save(path)
    return path


def write_with_xlsxwriter(path: Path, **sheets: Rows) -> Path:
    book = pytest.importorskip("xlsxwriter").Workbook(path)
    for name, rows in sheets.items():
        sheet = book.add_worksheet(name)
        for at, row in enumerate(rows):
            sheet.write_row(at, 0, row)
    book.close()
    return path


def write_xls(path: Path, **sheets: Rows) -> Path:
    book = pytest.importorskip("xlwt").Workbook()
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for at, row in enumerate(rows):
            for column, cell in enumerate(row):
                sheet.write(at, column, cell)
    book.save(str(path))
    return path


def ods_cell(cell: object) -> str:
    if isinstance(cell, float):
        return f'<table:table-cell office:value-type="float" office:value="{cell!r}"/>'
    return f'<table:table-cell office:value-type="string"><text:p>{cell}</text:p></table:table-cell>'


def ods_rows(rows: Rows) -> str:
    return "".join(f"<table:table-row>{''.join(map(ods_cell, row))}</table:table-row>" for row in rows)


def ods(path: Path, **tables: str) -> Path:
    home = "urn:oasis:names:tc:opendocument:xmlns"
    spaces = " ".join(f'xmlns:{one}="{home}:{one}:1.0"' for one in ("office", "table", "text"))
    content = "".join(f'<table:table table:name="{name}">{rows}</table:table>' for name, rows in tables.items())
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        body = f"<office:body><office:spreadsheet>{content}</office:spreadsheet></office:body>"
        file.writestr("content.xml", f"<office:document-content {spaces}>{body}</office:document-content>")
        file.writestr("META-INF/manifest.xml", "<manifest/>")
    return path


def write_ods(path: Path, **sheets: Rows) -> Path:
    return ods(path, **{name: ods_rows(rows) for name, rows in sheets.items()})


def read(path: Path, *names: str, group: str = "") -> list[Signal]:
    return list(FORMAT.read(Request(path, names, group, path.name, LIMIT)))


#: These write 16 digits, and some numbers of 64 bits need 17.
SHORT = (write_xlsx, write_with_xlsxwriter)


@pytest.mark.parametrize("write", [write_xlsx, write_with_xlsxwriter, write_xls, write_ods])
def test_a_table_comes_back_to_the_last_digit(tmp_path: Path, write: Callable[..., Path]) -> None:
    path = write(tmp_path / "a.book", Run=TABLE)
    assert format_of(path, max_bytes=LIMIT) == FORMAT
    info = FORMAT.survey(path, "a.book", LIMIT)
    assert [(one.name, one.unit, one.group, one.count) for one in info.signals] == [
        ("t", "s", "Run", N),
        ("F1", "kN", "Run", N),
    ]
    time, force = read(path, "t", "f1")
    np.testing.assert_array_equal(time.samples, TIME)
    np.testing.assert_allclose(force.samples, FORCE, rtol=1e-15 if write in SHORT else 0)
    assert force.unit == "kN"
    chunks = list(FORMAT.blocks(Request(path, ("F1", "t"), "", "a", LIMIT), 70))
    np.testing.assert_array_equal(np.concatenate([one[0].samples for one in chunks]), force.samples)


def test_a_header_that_is_not_the_first_row(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet["C3"], sheet["C4"], sheet["D4"] = "Versuch 7", "Abtastrate", "2000 Hz"
    for at, (name, unit) in enumerate((("Zeit", "s"), (None, None), ("Kraft", "N"), ("Weg", "mm")), 3):
        sheet.cell(6, at, name)
        sheet.cell(7, at, unit)
    for at in range(20):
        sheet.cell(8 + at, 3, at / 2000)
        sheet.cell(8 + at, 5, f"{at},25")
        sheet.cell(8 + at, 6, at * 1e-3 if at != 4 else None)
    book.save(tmp_path / "a.xlsx")
    info = FORMAT.survey(tmp_path / "a.xlsx", "a.xlsx", LIMIT)
    assert [(one.name, one.unit) for one in info.signals] == [("Zeit", "s"), ("Kraft", "N"), ("Weg", "mm")]
    assert "Versuch 7" in info.notes
    force, travel = read(tmp_path / "a.xlsx", "Kraft", "Weg")
    np.testing.assert_array_equal(force.samples, np.arange(20) + 0.25)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(travel.samples)), [4])


def test_points_in_time_are_seconds_from_the_first(tmp_path: Path) -> None:
    begun = dt.datetime(2024, 2, 1, 23, 59, 59)  # noqa: DTZ001 - a workbook knows no zones
    rows = [[begun + dt.timedelta(milliseconds=500 * at), float(at)] for at in range(10)]
    path = write_xlsx(tmp_path / "a.xlsx", Run=[["when", "F1"], *rows])
    (when,) = read(path, "when")
    np.testing.assert_allclose(when.samples, np.arange(10) / 2, atol=1e-3)
    assert when.unit == "s"


def test_each_sheet_with_a_table_is_a_group(tmp_path: Path) -> None:
    notes = [["Operator", "A. Müller"], ["Remark", 'cold, "wet"']]
    path = write_xlsx(tmp_path / "a.xlsx", Notes=notes, One=TABLE, Two=[["t", "F1"], [0.0, 5.0], [1.0, 6.0]], Empty=[])
    info = FORMAT.survey(path, "a.xlsx", LIMIT)
    assert [f"{one.group}/{one.name}" for one in info.signals] == ["One/t", "One/F1", "Two/t", "Two/F1"]
    said = " ".join(info.notes)
    assert "sheet 'Notes' is no table: it holds no column of numbers" in said
    assert "sheet 'Empty' is no table" in said
    np.testing.assert_array_equal(read(path, "F1", group="Two")[0].samples, [5.0, 6.0])
    both = read(path, "Two/F1", "One/F1", "Two/t")
    assert [one.samples.size for one in both] == [2, N, 2]
    with pytest.raises(TableError, match=r"channel 'F1' is in the groups 'One', 'Two'; say which"):
        read(path, "F1")
    with pytest.raises(TableError, match=r"^b\.xlsx: sheet 'Notes' is no table: it holds no column of numbers"):
        FORMAT.survey(write_xlsx(tmp_path / "b.xlsx", Notes=notes), "b.xlsx", LIMIT)


def test_formulas_have_the_values_that_were_saved(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    book = pytest.importorskip("xlsxwriter").Workbook(path)
    sheet = book.add_worksheet()
    sheet.write_row(0, 0, ["t", "F1"])
    for at in range(3):
        sheet.write(at + 1, 0, at)
        sheet.write_formula(at + 1, 1, f"=A{at + 2}*3", None, 3.0 * at)
    book.close()
    np.testing.assert_array_equal(read(path, "F1")[0].samples, [0.0, 3.0, 6.0])


def packed(path: Path, **members: str) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def test_what_is_no_workbook_is_called_by_its_name(tmp_path: Path, outcome: Outcome) -> None:
    types = {"[Content_Types].xml": "<Types/>"}
    path = packed(tmp_path / "a.docx", **types, **{"word/document.xml": "<w/>"})
    assert all("is a document of Word" in said for said in outcome(path, "F1"))
    path = packed(tmp_path / "a.xlsx", **types, **{"other.xml": "<w/>"})
    assert all("is an archive, not a workbook" in said for said in outcome(path, "F1"))
    path = packed(tmp_path / "a.odt", mimetype="application/vnd.oasis.opendocument.text", **{"content.xml": "<a/>"})
    assert all("not a table; save it as .ods or .xlsx" in said for said in outcome(path, "F1"))


WIDE, LONG = 'table:number-columns-repeated="16383"', 'table:number-rows-repeated="1048570"'


def test_cells_far_apart_are_refused(tmp_path: Path, outcome: Outcome) -> None:
    book = openpyxl.Workbook()
    for at in range(3):
        book.active.cell(1 + at, 1, at)
    book.active["XFD1048576"] = 5
    book.save(tmp_path / "a.xlsx")
    assert all(outcome(tmp_path / "a.xlsx", "F1"))
    blank = f"<table:table-cell {WIDE}/>"
    below = f"<table:table-row {LONG}>{blank}</table:table-row>"
    far = f"<table:table-row>{blank}{ods_cell(5.0)}</table:table-row>"
    path = ods(tmp_path / "a.ods", Run=ods_rows([["t"], [1.0]]) + below + far)
    assert all(outcome(path, "F1"))
    filled = f'<table:table-cell office:value-type="float" office:value="1" {WIDE}/>'
    path = ods(tmp_path / "b.ods", Run=f"<table:table-row {LONG}>{filled}</table:table-row>")
    assert all(outcome(path, "F1"))
    path = ods(tmp_path / "c.ods", Run=ods_rows(TABLE) + below)
    assert read(path, "F1")[0].samples.size == N


def test_damaged_workbooks_give_one_message(tmp_path: Path, outcome: Outcome, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(children, "SECONDS", 3.0)
    rng = np.random.default_rng(3)
    for write in (write_xlsx, write_xls, write_ods):
        whole = write(tmp_path / "a.book", Run=TABLE[:40]).read_bytes()
        damaged = [whole[: len(whole) // 2], whole[:600]]
        for _ in range(4):
            made = bytearray(whole)
            for at in rng.integers(30, len(made), 20):
                made[at] = int(rng.integers(256))
            damaged.append(bytes(made))
        for content in damaged:
            (tmp_path / "b.book").write_bytes(content)
            outcome(tmp_path / "b.book", "F1")


@pytest.mark.sampled(3)
def test_cells_far_apart_in_an_old_workbook_end_the_worker_alone(tmp_path: Path) -> None:
    book = pytest.importorskip("xlwt").Workbook()
    for at in range(8):
        sheet = book.add_sheet(f"S{at}")
        sheet.write(0, 0, 1.0)
        sheet.write(65535, 255, 2.0)
    path = tmp_path / "D1.xls"
    book.save(str(path))
    with pytest.raises(FileError, match="needs more memory than a file of its size may"):
        children.read_apart(formats.survey, path)
