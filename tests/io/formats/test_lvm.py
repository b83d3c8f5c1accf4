"""LabVIEW measurement files, built as the specification has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.lvm import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request, Signal


def header(*, x: str = "No", many: str = "Yes", separator: str = "Tab", decimal: str = ".") -> str:
    lines = [
        ("LabVIEW Measurement", ""),
        ("Writer_Version", "2"),
        ("Separator", separator),
        ("Decimal_Separator", decimal),
        ("Multi_Headings", many),
        ("X_Columns", x),
        ("Time_Pref", "Relative"),
        ("Operator", "A. Tester"),
        ("Date", "2024/02/01"),
        ("***End_of_Header***", ""),
        ("", ""),
    ]
    sign = {"Tab": "\t", "Comma": ","}[separator]
    return "".join(f"{tag}{sign}{value}\n" for tag, value in lines)


def segment(
    rows: list[str], *, start: float = 0.0, names: str = "X_Value\tF1\tV1\tComment", samples: int | None = None
) -> str:
    count = len(rows) if samples is None else samples
    return (
        f"Channels\t2\t\t\nSamples\t{count}\t{count}\t\nDate\t2024/02/01\t2024/02/01\nTime\t10:00:00.5\t10:00:00.5\n"
        f"Y_Unit_Label\tN\tm/s\nX_Dimension\tTime\tTime\nX0\t{start}\t{start}\nDelta_X\t0.001\t0.001\n"
        f"***End_of_Header***\t\t\n{names}\n" + "".join(f"{row}\n" for row in rows)
    )


ROWS = ["\t1.0\t2.0\tpaused", "\t1.5\t2.5", "\t2.0\t-3E0"]
PLAIN = header() + segment(ROWS)


def read(folder: Path, content: str | bytes, *names: str, group: str = "", max_bytes: int = 10**8) -> list[Signal]:
    path = folder / "D1.lvm"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    assert BEGINS["lvm"](path.read_bytes()[:4096])
    return list(FORMAT.read(Request(path, names, group, path.name, max_bytes)))


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        PLAIN.encode("utf-16"),
        "\ufeff" + PLAIN,
        header(many="No") + segment(ROWS[:2], samples=2) + ROWS[2] + "\n",
        header(x="One") + segment([f"{at / 1000}{row}" for at, row in enumerate(ROWS)]),
        header(separator="Comma") + segment(ROWS).replace("\t", ","),
        header(decimal=",") + segment(ROWS).replace(".", ","),
        PLAIN.replace("Channels", "***Start_Special***\n1\t2\n***End_Special***\nChannels"),
        header() + segment(ROWS[:1]) + "\n" + segment(ROWS[1:], start=0.001),
    ],
)
def test_every_way_gives_the_same_signals(tmp_path: Path, content: str | bytes) -> None:
    force, speed = read(tmp_path, content, "F1", "v1")
    np.testing.assert_array_equal(force.samples, [1.0, 1.5, 2.0])
    np.testing.assert_array_equal(speed.samples, [2.0, 2.5, -3.0])
    assert (force.unit, speed.unit) == ("N", "m/s")
    assert (force.start, force.rate, force.time) == (0.0, 1000.0, None)
    info = FORMAT.survey(tmp_path / "D1.lvm", "D1.lvm", 10**8)
    assert info.format == "LabVIEW measurement 2"
    assert "Operator: A. Tester" in info.notes
    assert [(one.name, one.count, one.rate, one.group) for one in info.signals] == [
        ("F1", 3, 1000.0, ""),
        ("V1", 3, 1000.0, ""),
    ]


def test_each_channel_with_its_own_x_column(tmp_path: Path) -> None:
    head = (
        "Channels\t2\t\t\t\nSamples\t3\t\t2\t\nX_Dimension\tTime\t\tTime\t\nX0\t0\t\t5\t\nDelta_X\t0.5\t\t1.0\t\n"
        "***End_of_Header***\t\nX_Value\tF1\tX_Value\tF1\tComment\n"
    )
    content = header(x="Multi") + head + "0\t1\t5\t10\n0.5\t2\t6.7\t20\n1\t3\t\t\n"
    first, second = read(tmp_path, content, "F1.1", "F1.2")
    np.testing.assert_array_equal(first.samples, [1.0, 2.0, 3.0])
    assert (first.start, first.rate) == (0.0, 2.0)
    np.testing.assert_array_equal(second.samples, [10.0, 20.0])
    np.testing.assert_array_equal(second.time, [5.0, 6.7])
    assert second.rate is None


def test_segments_that_do_not_follow_on_are_groups(tmp_path: Path) -> None:
    content = header() + segment(ROWS, start=0.0) + "\n" + segment(ROWS[::-1], start=7.0)
    (late,) = read(tmp_path, content, "F1", group="2")
    np.testing.assert_array_equal(late.samples, [2.0, 1.5, 1.0])
    assert late.start == 7.0
    with pytest.raises(TableError, match="is in the groups '1', '2'"):
        read(tmp_path, content, "F1")


def test_an_x_that_is_no_time(tmp_path: Path) -> None:
    (force,) = read(tmp_path, PLAIN.replace("X_Dimension\tTime", "X_Dimension\tFrequency"), "F1")
    assert (force.rate, force.time) == (None, None)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (PLAIN.replace("1.5", "1.x"), r"row \d+: '1\.x' is no number"),
        (PLAIN[: PLAIN.index("\t2.0\t-3E0")], "has 2 of the 3 samples that its header states; the file is cut off"),
        (PLAIN.replace("Samples\t3", "Samples\t999999999999"), "has 3 of the 999999999999 samples"),
        (PLAIN.replace("Channels\t2", "Channels\t999999999"), "has '999999999' as its number of channels"),
        (PLAIN.replace("Channels\t2", "Channels\t20"), "20 channels but names 4 columns"),
        (PLAIN.replace("Channels\t2", "Channels\t٣"), "write the file again"),
        (PLAIN.replace("Channels", "Chanels"), "no segment of channels"),
        (PLAIN[:60], "its header has no end"),
        (PLAIN[: PLAIN.index("Delta_X")], "segment 1 has no end of its header"),
        (PLAIN.replace("F1", "F2"), "there is no channel 'F1'"),
        (PLAIN[:200] + "\x00" + PLAIN[200:], "is binary"),
    ],
)
def test_wrong_files_are_refused_once_and_clearly(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(TableError, match=message):
        read(tmp_path, content, "F1")


def test_memory_is_bounded(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="of memory"):
        read(tmp_path, header() + segment(["\t1\t2"] * 1000), "F1", "V1", max_bytes=12_000)


def test_other_text_is_not_taken_for_it() -> None:
    assert not BEGINS["lvm"](b"t,F1\n0,1\n")
    assert not BEGINS["lvm"](b"")


@pytest.mark.parametrize("rate", [3000.0, 2048.0, 2000.0, 2999.7])
def test_a_rounded_step_is_mended_by_the_x_values(tmp_path: Path, rate: float) -> None:
    """LabVIEW writes the step with six decimals: 0.000333 stands for 3000 Hz, not for 3003."""
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\n"
        "X_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t1000\t\nX_Dimension\tTime\t\n"
        f"X0\t0.0\t\nDelta_X\t{1 / rate:.6f}\t\n***End_of_Header***\t\t\nX_Value\tF1\tComment\n"
    )
    values = np.round(np.random.default_rng(1).normal(size=6000), 6)
    path = tmp_path / "a.lvm"
    path.write_text(head + "".join(f"{at / rate:.6f}\t{value:.6f}\n" for at, value in enumerate(values)))
    (force,) = FORMAT.read(Request(path, ("F1",), "", "a.lvm", 10**9))
    (one,) = FORMAT.survey(path, "a.lvm", 10**9).signals
    np.testing.assert_array_equal(force.samples, values)
    assert (one.count, one.rate) == (6000, force.rate)
    assert force.rate == pytest.approx(rate, rel=0 if rate == round(rate) else 1e-6)
