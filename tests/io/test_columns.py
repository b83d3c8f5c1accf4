"""Recordings: the columns that come out, and what is said of files that are wrong."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.errors import FileError, TableError
from fourpole.io import rows as room
from fourpole.io.columns import read_columns
from fourpole.io.layout import find_layout, plain_layout

NAN = float("nan")


def written(folder: Path, content: str | bytes, name: str = "D1.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def same(values: np.ndarray, expected: list[float]) -> None:
    assert values.dtype == np.float64
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize("slow", [False, True])
@pytest.mark.parametrize(
    "content",
    [
        "t,F1,V1\n0,1.5,2\n1e-3,,-3\n",
        "t;F1;V1\r\n0;1.5;2\r\n1e-3;;-3\r\n",
        "t\tF1\tV1\n0\t1.5\t2\n1e-3\t\t-3\n",
        "t;F1;V1\n0;1,5;2\n0,001;;-3\n",
        "t,F1,V1\r0,1.5,2\r1e-3,,-3\r",
        "\ufefft,F1,V1\n0,1.5,2\n1e-3,NaN,-3",
        "t [s],F1_[N],V1 (m/s)\n0,1.5,2\n1e-3,nan,-3\n\n\n",
        "t,F1,V1\n[s],[N],[m/s]\n0,1.5,2\n1e-3,NA,-3\n",
        "t,F1,V1\ns,N,m/s\n0,1.5,2\n1e-3,-,-3\n \n",
        "# rig 2\n# sampled at 2 kHz\nt,F1,V1\n0,1.5,2\n1e-3,,-3\n",
        'Logger 7\nOperator: "A\n\nt,F1,V1\n0,1.5,2\n1e-3,,-3\n',
        "# t F1 V1\n0 1.5 2\n1e-3 nan -3\n",
        " t , F1 , V1 \n 0 , 1.5 , 2 \n 1e-3 ,  , -3 \n",
        't,F1,V1\n"0","1.5","2"\n1e-3,"",-3\n',
        "t,F1,V1,\n0,1.5,2,\n1e-3,,-3,\n",
        "t,F1,V1\n0,1.5,2,\n1e-3,,-3,\n",
        "t,F1,V1\n0,1.5,2\n\n1e-3,,-3\n",
        "t,F1,V1\n0,1.5,2\n# paused\n1e-3,,-3\n",
        "t,note,F1,V1\n0,ok,1.5,2\n1e-3,odd,,-3\n",
        "t,F1,V1,remark\n0,1.5,2,\n1e-3,,-3,späte Probe\n",
    ],
)
def test_every_layout_gives_the_same_columns(
    tmp_path: Path, content: str, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if slow:
        monkeypatch.setattr(room, "_quickly", lambda *_: None)
    read = read_columns(written(tmp_path, content), ["t", "F1", "V1"])
    same(read["t"], [0.0, 1e-3])
    same(read["F1"], [1.5, NAN])
    same(read["V1"], [2.0, -3.0])
    assert len(read) == 2


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_encodings_and_units_of_the_header(tmp_path: Path, encoding: str) -> None:
    content = "Zeit [s];Weg [µm];Größe\n0;1,5;ä\n1;2,5;ö\n".encode(encoding)
    read = read_columns(written(tmp_path, content), ["Weg", "Zeit"])
    same(read["Weg"], [1.5, 2.5])
    assert read.units == {"Weg": "µm", "Zeit": "s"}
    assert read.first_row == 2


def test_big_endian_utf16(tmp_path: Path) -> None:
    content = b"\xfe\xff" + "t,F1\n0,1\n".encode("utf-16-be")
    same(read_columns(written(tmp_path, content), ["F1"])["F1"], [1.0])


def test_units_row_below_the_header_is_told(tmp_path: Path) -> None:
    read = read_columns(written(tmp_path, "t,F1,x\n[s],,[-]\n0,1,2\n"), ["t", "F1", "x"])
    assert read.units == {"t": "s", "F1": None, "x": "1"}
    assert read.first_row == 3


@pytest.mark.parametrize(
    ("header", "wanted", "expected"),
    [
        ("V1,V1 [m/s],v1", "V1", 0.0),
        ("v1,V1 [m/s],V2", "V1", 1.0),
        ("v1 [m/s],V2,V3", "V1", 0.0),
        ("a,b,V1 [m/s]", "V1 [m/s]", 2.0),
        ("a,b,V1", "v1 [mm/s]", 2.0),
        ('a,"b,c",V1', "b,c", 1.0),
    ],
)
def test_names_match_as_written_then_without_unit_then_in_any_case(
    tmp_path: Path, header: str, wanted: str, expected: float
) -> None:
    same(read_columns(written(tmp_path, f"{header}\n0,1,2\n"), [wanted])[wanted], [expected])


@pytest.mark.parametrize("header", ["V1,V1,t", "V1 [m/s],V1 [mm/s],t", "v1,V1 [m],t"])
def test_an_ambiguous_name_is_refused(tmp_path: Path, header: str) -> None:
    wanted = "v1 [s]" if header.startswith("v1,") else "V1"
    with pytest.raises(TableError, match=r"D1\.csv: column .* is ambiguous: .*\(column 1\).*\(column 2\)"):
        read_columns(written(tmp_path, f"{header}\n0,1,2\n"), [wanted])


def test_the_same_name_twice_matters_only_where_it_is_wanted(tmp_path: Path) -> None:
    same(read_columns(written(tmp_path, "x,x,t\n0,1,2\n"), ["t"])["t"], [2.0])


def test_a_missing_column_names_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"no column 'F1'; did you mean 'F_1'\? it has F_1, t, V2$"):
        read_columns(written(tmp_path, "t,V2,F_1\n0,1,2\n"), ["F1"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("t,F1,V1\n0,1,2\n1,abc,3\n", r"D1\.csv row 3, column 'F1': 'abc' is no number"),
        ("pre\n\nt,F1,V1\n[s],[N],[m/s]\n\n0,1,2\n\n1,1_0,3\n", r"row 8, column 'F1': '1_0' is no number"),
        ("t,F1,V1\n0,1,2\n1,inf,3\n", r"row 3, column 'F1': 'inf' is no number"),
        ("t,F1,V1\n0,1,2\n1,1e999,3\n", r"row 3, column 'F1': '1e999' is no number"),
        ("t,F1,V1\n0,1,2\n1,\x00,3\n" + "1,2,3\n" * 9999, r"binary"),
        ("t,F1,V1\n" + "1,2,3\n" * 9999 + "1,\x00,3\n", r"row 10001, column 'F1': '\\x00' is no number"),
        ("t,F1,V1\n" + "1,2,3\n" * 50000 + "1,x\n" + "1,2,3\n", r"row 50002: has 2 cells \('1,x'\) where .* 3"),
        ("t,F1,V1\n1,2,3\n1,2\n", r"row 3: has 2 cells"),
        ("t,F1,V1\n1,2,3\n1,2,3,4\n", r"row 3: has 4 cells \('1,2,3,4'\) where the header has 3"),
        ("t,F1,V1\n1,2,3\n1,2,3\nend of file\n", r"row 4: has 1 cell \('end of file'\)"),
        ("t,F1,V1\n1,2,3\n1,\x1b[2J,3\n", r"row 3, column 'F1': '\\x1b\[2J' is no number"),
        ("t;F1;V1\n0,1;1,5;2\n1,2;1.000,5;3\n", r"row 3, column 'F1': '1\.000,5' is no number"),
        ("t,F1,V1\n0,1,2\n1,\xff,3\n".encode("latin-1"), r"row 3, column 'F1': 'ÿ' is no number"),
        ("t,F1,V1\n", r"only|no row below"),
        ("t,F1,V1\n[s],[N],[m/s]\n", r"no row below"),
        ("\n\n\n", r"no table"),
        ("# only\n# comments\n", r"no table"),
        ("", r"is empty"),
        ("0,1,2\n1,2,3\n", r"there is no column 'F1'.* it has 1, 2, 3"),
        ("t,F1\n0,1,2\n1,2,3\n2,3,4\n", r"line 1: the header has 2 names, but the rows 3 cells"),
        (bytes(range(256)) * 64, r"binary"),
        (b"\xff\xfe\x00\x00t\x00\x00\x00", r"UTF-32"),
        (b"\xff\xfet", r"D1\.csv: has no table"),
        (b"\xff\xfe" + "t,F1\n0,\x00".encode("utf-16-le"), r"binary"),
        ("t,F1,V1 " + "x" * 10_000_000, r"D1\.csv.*no table of text"),
        ("x" * 5_000_000 + "\nt,F1,V1\n1,2,3\n1,2,3\n", r"D1\.csv.*no table of text"),
        ('t,F1,V1\n1,2,3\n1,"2,3\n', r"row 3: has 2 cells"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(tmp_path: Path, content: str | bytes, said: str) -> None:
    with pytest.raises(TableError, match=said) as raised:
        read_columns(written(tmp_path, content), ["F1"])
    message = str(raised.value)
    assert message.startswith("D1.csv")
    assert str(tmp_path) not in message
    assert message.isprintable()
    assert len(message) < 400


def test_the_label_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"^recordings/D1\.csv row 2, column 'F1'"):
        read_columns(written(tmp_path, "t,F1\n0,x\n"), ["F1"], label="recordings/D1.csv")
    with pytest.raises(FileError, match=r"^recordings/D2\.csv: there is no such file"):
        read_columns(tmp_path / "D2.csv", ["F1"], label="recordings/D2.csv")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"is a folder"):
        read_columns(tmp_path, ["F1"])


def test_a_name_with_a_nul_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot be opened"):
        read_columns(f"{tmp_path}/a\0b", ["F1"])


def test_too_large_a_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate(5_000_000_000)
    with pytest.raises(FileError, match=r"huge\.csv: has 5 GB, more than the 4 GB allowed"):
        read_columns(path, ["F1"])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match=r"pipe or device"):
        read_columns(tmp_path / "pipe", ["F1"])


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no devices here")
def test_a_device_is_refused() -> None:
    with pytest.raises(FileError, match=r"pipe or device"):
        read_columns("/dev/zero", ["F1"])


def test_a_name_that_looks_like_a_pattern_or_an_address_is_a_file_name(tmp_path: Path) -> None:
    written(tmp_path, "t,F1\n0,1\n", "Dx.csv")
    path = written(tmp_path, "t,F1\n0,2\n", "D*.csv")
    same(read_columns(path, ["F1"])["F1"], [2.0])
    with pytest.raises(FileError, match=r"no such file"):
        read_columns("https://example.org/D1.csv", ["F1"])


def test_ten_thousand_columns(tmp_path: Path) -> None:
    names = [f"channel {index} [mm/s]" for index in range(10_000)]
    content = "\n".join([",".join(names), *[",".join(map(str, range(10_000)))] * 3])
    read = read_columns(written(tmp_path, content), ["channel 9998", "Channel 17"])
    same(read["channel 9998"], [9998.0] * 3)
    same(read["Channel 17"], [17.0] * 3)
    with pytest.raises(TableError, match=r"and 9988 more$"):
        read_columns(written(tmp_path, content), ["F1"])


def test_blank_cells_of_the_last_column_do_not_need_the_slow_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(room, "_slowly")
    read = read_columns(written(tmp_path, "t,F1,mark\n0,1,\n1,2,x\n2,3,\n\n\r\n"), ["F1"])
    same(read["F1"], [1.0, 2.0, 3.0])


def test_two_kinds_of_line_end(tmp_path: Path) -> None:
    same(read_columns(written(tmp_path, "note\rt,F1\n0,1\n1,2\n"), ["F1"])["F1"], [1.0, 2.0])


def test_many_rows_come_back_to_the_last_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(1).standard_normal((60_000, 3))
    lines = ["a,b,c", *(",".join(map(repr, row)) for row in values.tolist())]
    quick = read_columns(written(tmp_path, "\n".join(lines)), ["a", "c"])
    np.testing.assert_array_equal(quick["a"], values[:, 0])
    lines[30_000] = lines[30_000].replace(",", " , ")
    slow = read_columns(written(tmp_path, "\n".join(lines)), ["a", "c"])
    np.testing.assert_array_equal(slow["c"], values[:, 2])


CELLS = st.one_of(
    st.floats(allow_infinity=False).map(repr),
    st.sampled_from(["", " ", "NaN", "x", "1,5", "inf", '"', '"1"', "\x00", "é", "1 ", "-", "1;2", "\r"]),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.lists(CELLS, min_size=1, max_size=4), min_size=1, max_size=6))
def test_whatever_stands_in_a_file_is_read_or_refused_in_one_clear_line(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]]
) -> None:
    content = "t,F1,V1\n0,1,2\n" + "\n".join(",".join(row) for row in rows)
    path = written(tmp_path_factory.getbasetemp(), content, "any.csv")
    refusal, read = "any.csv", None
    try:
        read = read_columns(path, ["t", "F1"])
    except TableError as error:
        refusal = str(error)
    assert refusal.startswith("any.csv")
    assert refusal.isprintable()
    if read is not None:
        assert len(read["t"]) == len(read["F1"]) >= 1
        assert not np.isinf(read["F1"]).any()


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=400))
def test_no_bytes_break_it(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = written(tmp_path_factory.getbasetemp(), content, "any.bin")
    with pytest.raises(TableError):
        read_columns(path, ["a wanted column"])


@pytest.mark.parametrize("comment", ['"a\nb"', '5"', '"a, b"', '"x\n\ny ""z"""'])
@pytest.mark.parametrize("part", [64, 100, 4096])
def test_rows_around_a_quote_are_read_quickly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, comment: str, part: int
) -> None:
    slow: list[int] = []
    slowly = room._slowly

    def counted(file: io.BytesIO, line: int, table: room.Table) -> Iterator[room.Values]:
        for values in slowly(file, line, table):
            slow.append(room.length(values))
            yield values

    path = tmp_path / "a.csv"
    plain = "".join(f"{at},{at}.5,ok\n" for at in range(300))
    path.write_text(f"t [s],F1 [N],note\n{plain}300,300.5,{comment}\n301,301.5,ok\n{plain}")
    monkeypatch.setattr(room, "PART", part)
    monkeypatch.setattr(room, "_slowly", counted)
    found = read_columns(path, ["t", "F1"])
    expected = np.concatenate([np.arange(302), np.arange(300)])
    np.testing.assert_array_equal(found["t"], expected)
    np.testing.assert_array_equal(found["F1"], expected + 0.5)
    assert 1 <= sum(slow) <= 3


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("above", [[], ["Messung 7", "rate;2000;Hz", ""], ["note"] * 8])
def test_the_first_lines_give_the_layout_of_a_sound_table(above: list[str], decimal: str) -> None:
    rows = [f"{n}{decimal}5;{-n}e-3;7" for n in range(250)]
    lines = [*above, "t [s];F1 [N];V1", "s;N;m/s", *rows]
    assert plain_layout(lines, "a.csv") == find_layout(lines, "a.csv")
    first = len(lines) - len(rows)
    for odd in ("1;2", "1;2;3;4", "1;x;3", "12:00:01;2;3", "", "# paused", '1;"2";3', f"1;2{'.,'[decimal == '.']}5;3"):
        assert plain_layout([*lines[: first + 90], odd, *lines[first + 90 :]], "a.csv") is None, odd
