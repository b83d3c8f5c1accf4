"""Dialects of text: what loggers and spreadsheets write, as signals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io import rows as room
from fourpole.io.formats.text import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request, Signal
from fourpole.units import column_unit

NAN = float("nan")


def written(folder: Path, content: str | bytes, name: str = "D1.csv") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def read(path: Path, *names: str, group: str = "", max_bytes: int = 10**8) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, group, path.name, max_bytes)))


CATMAN = (
    "catman AP V5.2\nDatei:\tD1.bin\nT0 = 01.02.2024 10:00:00\n\n"
    "Zeit  1 - Standardmessrate\tKraft F1\tWeg\n"
    "2,00 ms (500 Hz)\t2,00 ms (500 Hz)\t2,00 ms (500 Hz)\nMX840\tU9C 12\tWA-T\ns\tN\tmm\n0\t1\t2\n"
)


@pytest.mark.parametrize("slow", [False, True])
@pytest.mark.parametrize(
    "content",
    [
        "Zeit;F1;V1\ns;N;m/s\n01.02.2024 10:00:00,000;1,5;2\n01.02.2024 10:00:00,500;;-3\n",
        "Zeit\tF1 [N]\tV1\n01.02.2024 10:00:00,000\t1,5\t2\n01.02.2024 10:00:00,500\t\t-3\n",
        "Prüfstand 7\nDatum;3\nRate;2000\n\nZeit;F1;V1\n;N;m/s\n23:59:59,75;1,5;2\n00:00:00,25;;-3\n",
        "Rig 7, test 3, again\nZeit,F1,V1\n[s],[N],[m/s]\n2024-02-01T10:00:00Z,1.5,2\n2024-02-01T10:00:00.5Z,,-3\n",
        "Datum;3;\nRate;2000;Hz\nZeit [s];F1 [N];V1\n0;1,5;2\n0,5;;-3\n",
        "sep=;\nZeit;F1 [N];V1\n2024-02-01 10:00:00.0;1.5;2\n2024-02-01 10:00:00.5;;-3\n",
        "Date;Zeit;F1 [N];V1\n1/31/2024;11:59:59.7 AM;1.5;2\n1/31/2024;12:00:00.2 PM;;-3\n",
        "[s];[N];[m/s]\nZeit;F1;V1\n0;1,5;2\n0,5;;-3\n",
        "Zeit  F1   V1\n[s]  [N]   [m/s]\n 0,0 1,5 2,0\n 0,5 nan -3,0\n",
        "Zeit [s] F1 [N] V1 [m/s]\n0,0 1,5 2,0\n0,5 NaN -3,0\n0,75 1,0 1,0\n",
        "\ufeffZeit [s];F1 [N];V1\n0;1,5;2\n0,5;;-3\n",
        "Zeit [s];Weg [µm];F1 [N];V1\n0;1;1,5;2\n0,5;2;;-3\n".encode("latin-1"),
        "Zeit [s];Weg [µm];F1 [N];V1\n0;1;1,5;2\n0,5;2;;-3\n".encode("utf-16"),
        "Zeit  1 - Standardmessrate [s]\tF1 [N]\tV1 [m/s]\n0\t1,5\t2\n0,5\t\t-3\n",
        "Zeit  1 - Standardmessrate\tF1\tV1\n500 ms (2 Hz)\t\t\nMX\tU9\tAcc\ns\tN\tm/s\n0\t1,5\t2\n0,5\t\t-3\n",
    ],
)
def test_every_dialect_gives_the_same_signals(
    tmp_path: Path, content: str | bytes, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if slow:
        monkeypatch.setattr(room, "_quickly", lambda *_: None)
    path = written(tmp_path, content)
    info = FORMAT.survey(path, path.name, 10**8)
    time = next(one for one in info.signals if one.name.startswith("Zeit"))
    when, force, speed = read(path, time.name, "F1", "V1")
    np.testing.assert_allclose(when.samples[:2], [0.0, 0.5], atol=1e-9)
    np.testing.assert_array_equal(force.samples[:2], [1.5, NAN])
    np.testing.assert_array_equal(speed.samples[:2], [2.0, -3.0])
    assert (when.unit, force.unit) == (time.unit, "N") == ("s", "N")
    assert time.count == len(when.samples)


@pytest.mark.parametrize(
    ("above", "rate"),
    [
        ("Sample rate: 2000 Hz", 2000.0),
        ("Abtastrate;2,5;kHz", 2500.0),
        ("Abtastrate [kHz];0,5", 500.0),
        ("sampling frequency (Hz) = 1024", 1024.0),
        ("Sampling interval [ms]\t0.5", 2000.0),
        ("dt=0.001", 1000.0),
        ("dT = 0,002 s", 500.0),
        ("SR: 50 kS/s", 50000.0),
        ('"Sample Rate","2000"', 2000.0),
        ("Messrate 20,00 ms (50 Hz)", 50.0),
        ("operator: dt", None),
        ("Sample rate: 0 Hz", None),
        ("Sample rate: fast", None),
        ("Sampling interval: 1e-320 us", None),
        ("Sample rate: 1e-320 Hz", None),
        ("Sample rate: 10 Hz\nSample rate: 20 Hz", None),
        ("Sample rate: 1000 Hz\ndt = 1 ms", 1000.0),
    ],
)
def test_a_rate_above_the_names(tmp_path: Path, above: str, rate: float | None) -> None:
    path = written(tmp_path, f"{above}\n\nF1 [N]\tV1\n1\t2\n3\t4\n5\t6\n7\t8\n9\t10\n11\t12\n13\t14\n")
    (force,) = read(path, "F1")
    assert force.rate == rate
    np.testing.assert_array_equal(force.samples, [1, 3, 5, 7, 9, 11, 13])
    info = FORMAT.survey(path, path.name, 10**8)
    assert [(one.name, one.count, one.rate) for one in info.signals] == [("F1", 7, rate), ("V1", 7, rate)]
    assert info.signals[0].duration == (None if rate is None else 6 / rate)
    assert info.notes[0] == above.partition("\n")[0].replace("\t", " ")


def test_catman_with_lines_about_the_channels(tmp_path: Path) -> None:
    path = written(tmp_path, CATMAN + "0,002\t1,5\t2,5\n0,004\t2\t3\n")
    info = FORMAT.survey(path, path.name, 10**8)
    assert [(one.name, one.unit, one.rate) for one in info.signals] == [
        ("Zeit  1 - Standardmessrate", "s", 500.0),
        ("Kraft F1", "N", 500.0),
        ("Weg", "mm", 500.0),
    ]
    (force,) = read(path, "Kraft F1")
    np.testing.assert_array_equal(force.samples, [1.0, 1.5, 2.0])


def test_columns_of_one_name_are_numbered(tmp_path: Path) -> None:
    path = written(tmp_path, "t,F1 [N],V1,F1 [kN]\n0,1,2,3\n1,4,5,6\n")
    assert [one.name for one in FORMAT.survey(path, path.name, 10**8).signals] == ["t", "F1.1", "V1", "F1.2"]
    first, second = read(path, "F1.1", "f1.2")
    assert (first.unit, second.unit) == ("N", "kN")
    np.testing.assert_array_equal(second.samples, [3.0, 6.0])
    with pytest.raises(TableError, match=r"'F1' is ambiguous: .*; write 'F1.1' for the first, 'F1.2' for the next"):
        read(path, "F1")
    for absent in ("F1.3", "F1.0", "V1.2", "V1.1"):
        with pytest.raises(TableError, match="there is no column"):
            read(path, absent)


@pytest.mark.parametrize(
    ("encoding", "text"),
    [
        ("gb18030", "时间(s),力(N),位移(mm)\n"),
        ("gb18030", "试样,橡胶衬套\n\n频率/Hz,动刚度(N/mm),加速度(m/s²)\n"),
        ("cp932", "時間(s),荷重(N),変位(mm)\n"),
        ("cp932", "ﾁｬﾝﾈﾙ1,ﾃﾞｰﾀ,チャンネル3\n"),
        ("cp1252", "Zeit,Prüfkraft,Dämpfung ü\n"),
        ("cp1252", "Größe °C,Weg µm,Öl ä\n"),
        ("cp1252", "Fréquence,Éprouvette n° 3,créée à l’arrêt\n"),
        ("cp1252", "Förskjutning,Läge,Tåg\n"),
    ],
)
def test_chinese_and_japanese_are_told_from_western_letters(tmp_path: Path, encoding: str, text: str) -> None:
    path = written(tmp_path, (text + "0,1,2\n1,2,3\n").encode(encoding))
    info = FORMAT.survey(path, path.name, 10**8)
    assert info.format.startswith(f"text in {encoding}")
    names = text.strip().rpartition("\n")[2].split(",")
    assert [one.name for one in info.signals] == [column_unit(name)[0] for name in names]
    np.testing.assert_array_equal(read(path, names[1])[0].samples, [1.0, 2.0])


@pytest.mark.parametrize(
    "content",
    [
        "# A title\n\nThis is prose, with commas, and so on.\nIt goes on, line by line, to its end.\n" * 20,
        "import os\n\ndef size(path):\n    return os.stat(path).st_size, 1\n\nvalues = [\n    1,\n    2,\n]\n" * 9,
        "2025-06-24 14:36:35 status unpacked less:amd64 590\n" * 50,
        "| Color | Hex |\n| ----- | --- |\n| red   | 1   |\n| blue  | 2   |\n",
        "name: rig\nversion: 3\nauthors:\n  - A. Miller\n",
        "Dear colleague\n\nthe file is attached.\n\n3\n",
    ],
)
def test_a_text_that_is_no_table_is_refused(tmp_path: Path, content: str) -> None:
    with pytest.raises(TableError, match="is text without a table of numbers"):
        FORMAT.survey(written(tmp_path, content), "notes.txt", 10**8)


def test_columns_without_names_have_numbers(tmp_path: Path) -> None:
    path = written(tmp_path, "# rig 7\n\nTest 3\n0;1,5;7\n0,5;2,5;8\n")
    assert [(one.name, one.count) for one in FORMAT.survey(path, path.name, 10**8).signals] == [
        ("1", 2), ("2", 2), ("3", 2),
    ]  # fmt: skip
    time, force = read(path, "1", "2")
    np.testing.assert_array_equal([time.samples, force.samples], [[0.0, 0.5], [1.5, 2.5]])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le", "cp1252"])
def test_the_survey_says_how_it_is_written(tmp_path: Path, encoding: str) -> None:
    text = "Weg [µm];F1\n0,5;1\n1;2\n"
    path = written(tmp_path, ("\ufeff" + text if encoding == "utf-16-le" else text).encode(encoding))
    info = FORMAT.survey(path, path.name, 10**8)
    assert info.format == f"text in {encoding}, semicolons between the cells, decimal commas"
    assert info.signals[0].unit == "µm"


def test_a_name_with_a_number_goes_before_a_count(tmp_path: Path) -> None:
    path = written(tmp_path, "F1,F1,F1.2\n1,2,3\n4,5,6\n")
    np.testing.assert_array_equal(read(path, "F1.2")[0].samples, [3.0, 6.0])


def test_a_remark_beside_the_numbers_is_no_preamble(tmp_path: Path) -> None:
    path = written(tmp_path, "F1;remark\n1,5;late\n2,5;\n3,5;\n")
    np.testing.assert_array_equal(read(path, "F1")[0].samples, [1.5, 2.5, 3.5])


@pytest.mark.parametrize(
    ("content", "names", "message"),
    [
        ("t,F1\n10:00:00,1\nlater,2\n", ("t",), r"D1\.csv row 3, column 't': 'later' is no time of day"),
        ("t,F1\n31.01.2024 10:00:00,1\n32.01.2024 10:00:00,2\n", ("t",), r"'32\.01\.2024 10:00:00' is no time of day"),
        ("t,F1\n10:00:00,1\n2024-01-01 10:00:00,2\n01.01.2024 10:00:00,2\n", ("t",), "not written as the first one"),
        ("t,F1\n0,1\n1,2\n", ("F2",), "there is no column 'F2'; did you mean 'F1'"),
        ("", ("t",), "is empty"),
        (b"\x00\x01\x02", ("t",), "is binary"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, content: str | bytes, names: tuple[str, ...], message: str) -> None:
    with pytest.raises(TableError, match=message):
        read(written(tmp_path, content), *names)


def test_groups_and_memory(tmp_path: Path) -> None:
    path = written(tmp_path, "t,F1\n" + "0,1\n" * 1000)
    with pytest.raises(TableError, match="has no groups"):
        read(path, "F1", group="1")
    with pytest.raises(FileError, match="of memory"):
        read(path, "t", "F1", max_bytes=5000)


def test_any_text_is_known_and_nothing_else() -> None:
    assert BEGINS["text"](b"t,F1\n0,1\n")
    assert BEGINS["text"]("Zeit;Größe".encode("latin-1"))
    assert BEGINS["text"]("Zeit;Größe".encode("utf-16"))
    assert not BEGINS["text"](b"PAR1\x00\x00")
    assert not BEGINS["text"](b"")
