"""Files with several headers: each header with its rows is a group, whoever made the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import TableError
from fourpole.io import stretches as scan
from fourpole.io.formats.text import FORMAT
from fourpole.io.look import look_at
from fourpole.io.signals import Request
from fourpole.io.text import read_table

#: A servohydraulic machine: a summary of two rows, and a buffer that another summary interrupts.
MACHINE = (
    "M793|DEU|1|,|.\n\nBediener Information\t\t\tZeit:\t20,4\ts\t13.03.2024 09:51:21\nDatum\t13.03.2024\n"
    "Breite [mm]:\t150\nHöhe [mm]:\t148,9\nBediener Information Ende\n\n"
    "Datenerfassung\t\t\tZeit:\t153,7\ts\t13.03.2024 09:53:35\nWeg\tPrüfkraft\nmm\tkN\n4,5\t2,5\n-1,25\t-999,5\n\n"
    "Datenerfassung\t\t\tZeit:\t153,8\ts\t13.03.2024 09:53:36\nDatum\tLaufzeit\tWeg\t1944 B\nd\ts\tmm\tkN\n"
    "45364\t0,5\t1e-3\t-15\n45364\t1,0\t-0,25\t-16,5\n\n"
    "Datenerfassung\t\t\tZeit:\t160\ts\t13.03.2024 09:53:39\nWeg\tPrüfkraft\nmm\tkN\n5,5\t3,5\n-2,25\t-1\n\n"
    "Datenerfassung\t\t\tZeit:\t161\ts\t13.03.2024 09:53:40\nDatum\tLaufzeit\tWeg\t1944 B\nd\ts\tmm\tkN\n"
    "45364\t1,5\t0,75\t-17\n45364\t2,0\t0,5\t-18\n"
)
#: A rheometer: names with a label, a blank line below them, units in brackets, a status behind the numbers.
RHEOMETER = (
    "Project:\tRubber\n\nTest:\tE3\n\nResult:\tFrequency sweep\n\nInterval and data points:\t1\t2\n"
    "Interval data:\tPoint No.\tAngular Frequency\tStorage Modulus\tStatus\n\t\t\t\t\n\t\t[rad/s]\t[kPa]\t\n"
    "\t1\t0.1\t1.5\tDy_auto\n\t2\t1\t2.5\tDy_auto\n\n"
    "Interval and data points:\t2\t2\n"
    "Interval data:\tPoint No.\tAngular Frequency\tStorage Modulus\tStatus\n\t\t\t\t\n\t\t[rad/s]\t[kPa]\t\n"
    "\t1\t0.1\t3.5\tDy_auto\n\t2\t1\t4.5\tDy_auto\n"
)
#: Steps of a rheometer of another make: a mark and the title of the step above the names, most units known.
STEPS = (
    "Filename\tx\nGap\t1.0 mm\n[Parameters]\nOperator\tA\nTemperature\t25 °C\n\n"
    "[step]\nAmplitude sweep - 1\nStep time\tStrain\tG'\nmin\t%\tMPa\n0.5\t0.1\t1\n1.5\t0.2\t2\n\n"
    "[step]\nFlow ramp - 2\nStep time\tTorque\nmin\tµN.m\n0.25\t7\n0.75\t8\n1.25\t9\n"
)


def written(folder: Path, content: str, encoding: str = "utf-8") -> Path:
    path = folder / "specimen.dat"
    path.write_bytes(content.encode(encoding))
    return path


def groups(path: Path) -> dict[str, list[tuple[str, str | None, int]]]:
    found: dict[str, list[tuple[str, str | None, int]]] = {}
    for one in FORMAT.survey(path, path.name, 10**9).signals:
        found.setdefault(one.group, []).append((one.name, one.unit, one.count))
    return found


def read(path: Path, group: str, *names: str) -> list[list[float]]:
    request = Request(path, names, group, path.name, 10**9)
    whole = [one.samples for one in FORMAT.read(request)]
    assert FORMAT.blocks is not None
    chunks = list(FORMAT.blocks(request, 1))
    for at, samples in enumerate(whole):
        np.testing.assert_array_equal(np.concatenate([chunk[at].samples for chunk in chunks]), samples)
    return [samples.tolist() for samples in whole]


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("part", [1 << 18, 7])
@pytest.mark.sampled(3)
def test_blocks_of_a_machine(
    tmp_path: Path, encoding: str, ending: str, part: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scan, "_CHUNK", part)
    path = written(tmp_path, MACHINE.replace("\n", ending), encoding)
    assert groups(path) == {
        "Datenerfassung.1": [("Weg", "mm", 2), ("Prüfkraft", "kN", 2)],
        "Datenerfassung.2": [("Datum", "d", 4), ("Laufzeit", "s", 4), ("Weg", "mm", 4), ("1944 B", "kN", 4)],
        "Datenerfassung.3": [("Weg", "mm", 2), ("Prüfkraft", "kN", 2)],
    }
    assert read(path, "Datenerfassung.2", "Laufzeit", "Weg") == [[0.5, 1.0, 1.5, 2.0], [0.001, -0.25, 0.75, 0.5]]
    assert read(path, "", "1944 B") == [[-15.0, -16.5, -17.0, -18.0]]
    assert read(path, "datenerfassung.3", "Prüfkraft") == [[3.5, -1.0]]
    with pytest.raises(
        TableError, match=r"'Weg' is in the groups .*; say which, as in specimen\.dat#Datenerfassung\.1"
    ):
        read(path, "", "Weg")
    with pytest.raises(TableError, match="there is no group 'Peak'"):
        read(path, "Peak", "Weg")


def test_intervals_of_a_rheometer(tmp_path: Path) -> None:
    path = written(tmp_path, RHEOMETER, "utf-16")
    assert list(groups(path)) == ["Frequency sweep 1", "2"]
    assert groups(path)["2"][2:4] == [("Angular Frequency", "rad/s", 2), ("Storage Modulus", "kPa", 2)]
    assert read(path, "2", "Angular Frequency", "Storage Modulus") == [[0.1, 1.0], [3.5, 4.5]]


def test_steps_with_titles(tmp_path: Path) -> None:
    path = written(tmp_path, STEPS)
    assert groups(path) == {
        "Amplitude sweep - 1": [("Step time", "min", 2), ("Strain", "%", 2), ("G'", "MPa", 2)],
        "Flow ramp - 2": [("Step time", "min", 3), ("Torque", "µN.m", 3)],
    }
    assert read(path, "", "G'", "Torque") == [[1.0, 2.0], [7.0, 8.0, 9.0]]


def test_rows_that_begin_with_a_word(tmp_path: Path) -> None:
    block = "[step]\nStep name\tSweep ({} °C)\nNumber of points\t2\nVariables\tTime\tG'\tG''\n\ts\tMPa\tMPa\n"
    rows = "Data point\t0.5\t{0}\t2\nData point\t1.5\t{0}\t3\n\n"
    path = written(tmp_path, "".join(block.format(one) + rows.format(one) for one in (150, 140)), "utf-16")
    path.write_bytes(path.read_bytes() + b"\n")  # half a character, as some programs leave it
    first, second = groups(path)
    assert (first, second) == ("Sweep (150 °C)", "Sweep (140 °C)")
    assert groups(path)[second][1:] == [("Time", "s", 2), ("G'", "MPa", 2), ("G''", "MPa", 2)]
    assert read(path, first, "G'") == [[150.0, 150.0]]
    assert read(path, second, "G'", "G''") == [[140.0, 140.0], [2.0, 3.0]]


def test_a_table_far_down_is_found(tmp_path: Path) -> None:
    head = "".join(f"Option {at}\t{at}.5 mm\n" for at in range(3000))
    path = written(tmp_path, head + "\n[step]\nSweep\nf\tF\nHz\tN\n" + "1\t2\n3\t4\n" * 40)
    assert groups(path) == {"": [("f", "Hz", 80), ("F", "N", 80)]}
    assert read(path, "", "F") == [[2.0, 4.0] * 40]


def test_tables_without_titles_are_numbered_unless_their_times_go_on(tmp_path: Path) -> None:
    first, on, again = "t,F\n0,1\n1,2\n", "t,F\n2,3\n3,4\n", "t,F\n0,5\n1,6\n"
    assert groups(written(tmp_path, first + on)) == {"": [("t", None, 4), ("F", None, 4)]}
    path = written(tmp_path, first + "\n" + again)
    assert groups(path) == {"1": [("t", None, 2), ("F", None, 2)], "2": [("t", None, 2), ("F", None, 2)]}
    assert read(path, "2", "F") == [[5.0, 6.0]]
    assert read(written(tmp_path, first + on), "", "F") == [[1.0, 2.0, 3.0, 4.0]]


def test_missing_values_and_comments_end_no_table(tmp_path: Path) -> None:
    rows = "".join(f"{at},NaN\n# paused\n{at}.5,7\n\n" for at in range(300))
    path = written(tmp_path, "t,F\n" + rows + "\nx,y\n1,2\n")
    assert {group: one[0][2] for group, one in groups(path).items()} == {"1": 1199, "2": 1}
    (samples,) = read(path, "1", "F")
    assert len(samples) == 600
    assert np.isnan(samples).sum() == 300


def test_a_remark_between_rows_is_said_and_no_table(tmp_path: Path) -> None:
    path = written(tmp_path, "t,F\n" + "0,1\n" * 100 + "pause\n" + "1,2\n" * 100)
    assert list(groups(path)) == [""]
    with pytest.raises(TableError, match=r"row 102: has 1 cell \('pause'\) where the header has 2"):
        read(path, "", "F")


def test_all_groups_are_looked_at(tmp_path: Path) -> None:
    path = written(tmp_path, "".join(f"Test {at}\nF,x\n{at},1\n{at},2\n\n" for at in range(40)))
    info = FORMAT.survey(path, path.name, 10**9)
    found = look_at(path, info, range(len(info.signals)))
    assert [found[at].mean for at in range(0, 80, 2)] == list(range(40))  # type: ignore[union-attr]


def test_too_many_headers_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scan, "_MOST_STRETCHES", 50)
    path = written(tmp_path, "".join(f"Test {at}\nF,x\n{at},1\n" for at in range(60)))
    with pytest.raises(TableError, match="more than 50 headers"):
        groups(path)


def test_a_small_table_is_named_by_its_title(tmp_path: Path) -> None:
    path = written(tmp_path, STEPS)
    found = read_table(path)  # the only one of more than two rows
    assert (found.names, found.column("Torque").tolist(), found.lines) == (
        ["Step time", "Torque"],
        [7, 8, 9],
        [18, 19, 20],
    )
    assert read_table(path, group="amplitude sweep - 1").unit("G'") == "MPa"
    apart = MACHINE.replace("45364\t1,5\t0,75", "45364\t0,5\t0,75")
    with pytest.raises(TableError, match=r"holds 4 tables: 'Datenerfassung\.1', .*; name one, as in specimen"):
        read_table(written(tmp_path, apart))
    with pytest.raises(TableError, match="has no groups"):
        read_table(written(tmp_path, "t,F\n0,1\n"), group="1")


#: A rheometer of a third make: a blank line after each line, and a second result that was stopped before its first row.
STOPPED = (
    "Test:\tA\n\nResult:\tSweep\n\nInterval:\t1\n\nAngular Frequency\tStorage Modulus\n\n\t\n\n[rad/s]\t[Pa]\n\n"
    "100\t225,5\n\n10\t200,25\n\n1\t100\n\n\n"
)


@pytest.mark.parametrize(("rows", "count"), [("\t\n\n\t\n", 1), ("50\t7,5\n\n5\t6,5\n", 2)])
def test_a_second_result_is_no_bad_row(tmp_path: Path, rows: str, count: int) -> None:
    second = STOPPED[: STOPPED.index("100\t")].replace("Interval:\t1", "Interval:\t2") + rows
    path = written(tmp_path, STOPPED + second, "utf-16")
    found = groups(path)
    assert len(found) == count
    first = next(iter(found))
    values = [one for one in read(path, first, "Storage Modulus")[0] if one == one]
    assert values == [225.5, 200.25, 100.0]
    if count == 2:
        assert [one for one in read(path, list(found)[1], "Storage Modulus")[0] if one == one] == [7.5, 6.5]


def test_a_header_of_more_names_than_cells_is_named(tmp_path: Path) -> None:
    about = "".join(f"setting{at}\ttext\n" for at in range(50))
    rows = "".join(f"{at}\t{2 * at}\t{3 * at}\n" for at in range(9))
    path = written(tmp_path, f"{about}[step]\nSweep\na\tb\tc\td\nPa\tPa\ts\tm\n{rows}")
    with pytest.raises(TableError, match=r"line 53: the header has 4 names, but the rows 3 cells"):
        groups(path)
    with pytest.raises(TableError, match=r"line 53: the header has 4 names, but the rows 3 cells"):
        read_table(path)


def test_a_last_column_without_a_name_has_its_number(tmp_path: Path) -> None:
    path = written(tmp_path, "t [s],F1 [N],\n0,1,5\n1,2,6\n2,3,7\n")
    assert [name for name, _, _ in groups(path)[""]] == ["t", "F1", "3"]
    assert read(path, "", "3") == [[5.0, 6.0, 7.0]]
    assert [name for name, _, _ in groups(written(tmp_path, "t [s],F1 [N],\n0,1,\n1,2,\n"))[""]] == ["t", "F1"]
