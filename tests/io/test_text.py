"""Tables of text: every way to write them, and what is kept and said of what is odd in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.errors import FileError, TableError
from fourpole.io.text import TextTable, read_table
from fourpole.units import quantity

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
NAN = float("nan")


def table(folder: Path, content: str | bytes, name: str = "curve.csv") -> TextTable:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_table(path)


@pytest.mark.parametrize(
    "content",
    [
        "x [mm],F [kN]\n0,0\n1.5,0.25\n",
        "x [mm];F [kN]\r\n0;0\r\n1,5;0,25\r\n",
        "x [mm]\tF [kN]\r0\t0\r1.5\t0.25",
        "x[mm] F[kN]\n0 0\n1,5 0,25\n",
        "x [mm]   F [kN]\n0        0\n1.5      0.25\n",
        "  x      F\n [mm]   [kN]\n  0      0\n 1.5     0.25\n",
        "x,F\nmm,kN\n0,0\n1.5,0.25\n",
        "x,F\n(mm),(kN)\n\n0,0\n1.5,0.25\n",
        "x [mm],F\n[mm],[kN]\n0,0\n1.5,0.25\n",
        "\ufeffx (mm),F (kN)\n0,0\n1.5,0.25\n",
        "# rig 2\n% and more\nx_[mm],F_[kN]\n0,0\n# a pause\n1.5,0.25\n",
        "# x [mm], F [kN]\n0,0\n1.5,0.25\n",
        "# x F\n# [mm] [kN]\n0 0\n1.5 0.25\n",
        "Logger: 7, 8, 9\nDate: today\n\nx [mm],F [kN]\n0,0\n1.5,0.25\n",
        '"x [mm]","F [kN]"\n"0","0"\n"1.5","0.25"\n',
        "x [mm],F [kN],\n0,0,\n1.5,0.25,\n",
        "x [mm],F [kN]\n0,0,\n1.5,0.25,\n",
    ],
)
def test_every_layout_gives_the_same_curve(tmp_path: Path, content: str) -> None:
    curve = table(tmp_path, content)
    assert curve.names[:2] == ["x", "F"]
    assert curve.units[:2] == ["mm", "kN"]
    assert curve.column("x").tolist() == [0.0, 1.5]
    assert curve.column("F").tolist() == [0.0, 0.25]
    assert curve.unit("F") == "kN"
    assert (len(curve.lines), curve.skipped) == (2, [])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252", "latin-1"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    curve = table(tmp_path, "Weg [µm];Größe\n1,5;früh\n2,5;spät\n".encode(encoding))
    assert curve.units == ["µm", None]
    assert curve.columns[curve.index("größe")] == ["früh", "spät"]
    assert curve.column("Weg").tolist() == [1.5, 2.5]


def test_a_column_without_a_name(tmp_path: Path) -> None:
    curve = table(tmp_path, "\tx\tF\n\t[mm]\t\n0\t1\t2\n1\t3\t4\n")
    assert (curve.names, curve.units) == (["", "x", "F"], [None, "mm", None])
    assert curve.column("x").tolist() == [1.0, 3.0]


def test_bytes_that_cp1252_has_not_are_latin1(tmp_path: Path) -> None:
    assert table(tmp_path, b"x,note\n1,\x81\n").columns == [["1"], ["\x81"]]


def test_a_table_like_the_polymer_bench_writes_it(tmp_path: Path) -> None:
    names = ["Index", "Ts", "f", "F", "x", "Phase", "tan_delta", "G*"]
    units = ["[#]", "[°C]", "[Hz]", "[N]", "[µm]", "[rad]", "[]", "[MPa]"]
    rows = [[str(i), *(f"{(i + 1) * (k + 0.5):.5e}" for k in range(7))] for i in range(24)]
    lines = ["".join(f"{cell:>14}" for cell in row) for row in [names, units, *rows]]
    reduced = table(tmp_path, ("\n".join(lines) + "\n\xa3]8[JJA01-02\x1b\n").encode("latin-1"), "T20.txt")
    assert reduced.names == names
    assert reduced.units == ["#", "°C", "Hz", "N", "µm", "rad", "1", "MPa"]
    assert (len(reduced.lines), reduced.lines[0]) == (24, 3)
    assert reduced.skipped == [(27, r"'£]8[JJA01-02\x1b'")]
    np.testing.assert_array_equal(reduced.column("x"), [float(row[4]) for row in rows])
    assert [quantity(1, "length", default_unit=reduced.unit("x"))] == [1e-6]


def test_a_bad_cell_is_not_a_number(tmp_path: Path) -> None:
    curve = table(tmp_path, "x [mm],F [N],who\n0,1,a\n1,1.2.3,b\n2,,c\n\n3,inf,d\n4,5,e\n5,6,f\n")
    np.testing.assert_array_equal(curve.column("F"), [1.0, NAN, NAN, NAN, 5.0, 6.0])
    assert curve.lines == [2, 3, 4, 6, 7, 8]
    with pytest.raises(TableError, match=r"curve\.csv row 2, column 'who': 'a' is no number, nor is any other"):
        curve.column("who")


@pytest.mark.parametrize("word", ["", "NaN", "nan", "NA", "n/a", "-", "null"])
def test_what_is_missing_is_nan(tmp_path: Path, word: str) -> None:
    curve = table(tmp_path, f"x,F\n0,1\n1,{word}\n2,3\n")
    np.testing.assert_array_equal(curve.column("F"), [1.0, NAN, 3.0])


@pytest.mark.parametrize(
    ("end", "skipped"),
    [
        ("end of test\n", [(4, "'end of test'")]),
        ("2,3,4\n", [(4, "'2,3,4'")]),
        ("2\n", [(4, "'2'")]),
        ("end,of test\n\n# done\nreally\n", [(4, "'end of test'"), (7, "'really'")]),
        ("\x1b[31m" + "z" * 99 + "\n", [(4, r"'\x1b[31m" + "z" * 34 + "…'")]),
    ],
)
def test_lines_after_the_table_are_kept_aside(tmp_path: Path, end: str, skipped: list[tuple[int, str]]) -> None:
    curve = table(tmp_path, f"x,F\n0,1\n1,2\n{end}")
    assert curve.column("F").tolist() == [1.0, 2.0]
    assert curve.skipped == skipped


def test_a_short_row_is_blank_at_its_end_but_not_as_the_last(tmp_path: Path) -> None:
    tests = table(tmp_path, "test,file,tyre,p [bar]\nS1,a.csv,radial\nD1,b.csv,radial,1.7\nD2,c.csv\n")
    assert tests.columns[tests.index("test")] == ["S1", "D1"]
    np.testing.assert_array_equal(tests.column("p"), [NAN, 1.7])
    assert tests.skipped == [(4, "'D2,c.csv'")]


def test_a_list_of_tests_with_words_blanks_and_quotes(tmp_path: Path) -> None:
    content = (
        "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],note\n"
        'S1,recordings/S1.csv,static,radial,,,,"first, of all"\n'
        'D1,recordings/D1.csv,dynamic,radial,1.7,1000,10,"two\nlines, ""quoted"""\n'
        "D2,recordings/D2.csv,dynamic,radial,,,,\n"
    )
    tests = table(tmp_path, content, "tests.csv")
    assert tests.columns[tests.index("test")] == ["S1", "D1", "D2"]
    assert tests.columns[tests.index("note")] == ["first, of all", 'two\nlines, "quoted"', ""]
    assert tests.lines == [2, 3, 5]
    np.testing.assert_array_equal(tests.column("pressure"), [NAN, 1.7, NAN])
    assert tests.skipped == []


def test_a_lone_quote_does_not_swallow_the_rest(tmp_path: Path) -> None:
    rim = table(tmp_path, 'x,rim\n1,"13\n' + "".join(f"{i},14\n" for i in range(2, 200)))
    assert rim.column("x").tolist() == list(range(1, 200))


def test_names_by_other_spellings_and_ambiguity(tmp_path: Path) -> None:
    curve = table(tmp_path, "Load [N],x,x,X [mm]\n1,2,3,4\n")
    assert curve.column("load").tolist() == curve.column("Load [N]").tolist() == [1.0]
    with pytest.raises(TableError, match=r"column 'x' is ambiguous: 'x' \(column 2\), 'x' \(column 3\)"):
        curve.column("x")
    with pytest.raises(TableError, match=r"no column 'Laod'; did you mean 'Load'\?"):
        curve.column("Laod")


@pytest.mark.parametrize("header", ["t,F", "m;s", "N g"])
def test_a_header_that_could_be_units_is_a_header(tmp_path: Path, header: str) -> None:
    mark = header[1]
    curve = table(tmp_path, f"Test 5: of tyre\n{header}\n0{mark}1\n2{mark}3\n4{mark}5\n")
    assert curve.names == header.split(mark)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", r"curve\.csv: is empty"),
        (b"\xef\xbb\xbf", r"no table"),
        (b"\n \n", r"no table"),
        (b"x,F\n", r"has a header \(line 1\) but no row"),
        (b"x,F\n\x00,1\n", r"binary"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", r"binary"),
        (b"x" * 10_000_000, r"has a line of more than 8388608 bytes; this is no table of text"),
        (b"x,F,G,H\n1,2,3\n2,3,4\n", r"line 1: the header has 4 names, but the rows 3 cells"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    with pytest.raises(TableError, match=said):
        table(tmp_path, content)


def test_too_large_missing_or_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("x,F\n1,2\n")
    with pytest.raises(FileError, match=r"^static/curve\.csv: has 8 bytes, more than the 7 bytes allowed"):
        read_table(path, max_bytes=7, label="static/curve.csv")
    with pytest.raises(FileError, match=r"^other\.csv: there is no such file"):
        read_table(tmp_path / "other.csv")
    with pytest.raises(FileError, match="is a folder"):
        read_table(tmp_path)


def test_ten_thousand_columns(tmp_path: Path) -> None:
    wide = table(tmp_path, ",".join(f"c{i} [N]" for i in range(10_000)) + "\n" + ",".join(["1"] * 10_000))
    assert wide.column("c9999").tolist() == [1.0]


@settings(max_examples=100, deadline=None)
@given(
    values=st.lists(st.floats(-1e12, 1e12), min_size=2, max_size=8),
    delimiter=st.sampled_from(["; ", ";", "\t", "   "]),
    comma=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_numbers_come_back(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], delimiter: str, comma: bool, ending: str
) -> None:
    lines = [delimiter.join(["x", "F"]), *(delimiter.join([repr(one), repr(-one)]) for one in values)]
    content = ending.join(lines)
    curve = table(tmp_path_factory.getbasetemp(), content.replace(".", ",") if comma else content)
    assert curve.column("x").tolist() == values
    assert curve.column("F").tolist() == [-one for one in values]


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.binary(max_size=300), st.text(alphabet='1.,;\t "xF[]()#-\n', max_size=120).map(str.encode)))
def test_no_bytes_break_it(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    refusal, lengths = "", set()
    try:
        found = table(tmp_path_factory.getbasetemp(), content)
        lengths = {len(column) for column in found.columns} ^ {len(found.lines)}
    except TableError as error:
        refusal = str(error)
    assert refusal.isprintable()
    assert not lengths


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real files are not here")
def test_real_files() -> None:
    polymer = read_table(SHARED / "polymer-shear-dma-20C.txt")
    assert len(polymer.lines) == 24
    assert polymer.unit("x") == "µm"
    assert [line for line, _ in polymer.skipped] == [27]
    tyre = read_table(SHARED / "truck-tyre-335-65R22.5-414kPa.csv")
    assert (len(tyre.lines), tyre.column("load")[-1]) == (21, 54758.0)
    assert len(read_table(SHARED / "hmmwv-tyre-fiala.csv").lines) == 17
