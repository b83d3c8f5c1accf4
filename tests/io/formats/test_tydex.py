"""TYDEX: files as test rigs write them, round trips, and what is said of files that are wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.errors import FileError, TableError
from fourpole.io.formats.tydex import FORMAT, read_tydex
from fourpole.io.formats.tydex_file import TydexChannel, TydexEntry, TydexFile, meaning, write_tydex
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

NAN = float("nan")

RIG = """\
!# made by a rig
**HEADER
!-------!-------------------------------!---------!---------!
RELEASE  Release of TYDEX-Format                   1.3
SUPPLIER  Data supplier                           DEMO
**COMMENTS
! new tyre
measured on the drum
**CONSTANTS
w!---------!-----------------------------!---------!---------!
! Key     !   Comment                   !  Unit   !  value  !
MANUFACT  Manufacturer of the tyre                  ACME Rubber
NOMWIDTH  Nominal section width of tyre mm        225
INFLPRES  Inflation pressure            bar       2,1
AMBITEMP  Ambient temperature           deg C     2.5D+01
**MEASURCHANNELS
RUNTIME   Running time                  s         0.001     0         0
FZW       Vertical force                N         2         0         100
DSTGRWHC  Distance to the ground        m
**MEASURDATA
         0      1000    0.3101
         1    1000.5  3.102D-1
         2  NOTAVAIL    0,3103
**END
"""


def written(folder: Path, content: str | bytes, name: str = "run.tdx") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def asked(path: Path, *names: str, group: str = "", max_bytes: int = 10**8) -> Request:
    return Request(path, names, group, path.name, max_bytes)


def test_a_file_of_a_rig(tmp_path: Path) -> None:
    tyre = read_tydex(written(tmp_path, RIG))
    np.testing.assert_array_equal(tyre.values("FZW"), [2100.0, 2101.0, NAN])
    np.testing.assert_array_equal(tyre.values("dstgrwhc"), [0.3101, 0.3102, 0.3103])
    assert tyre.header[0] == TydexEntry("RELEASE", "1.3", "", "Release of TYDEX-Format")
    assert tyre.constant("SUPPLIER").value == "DEMO"
    assert (tyre.constant("inflpres").number, tyre.constant("INFLPRES").unit) == (2.1, "bar")
    assert (tyre.constant("AMBITEMP").number, tyre.constant("AMBITEMP").unit) == (25.0, "deg C")
    assert tyre.constant("MANUFACT").value == "ACME Rubber"
    assert tyre.constant("MANUFACT").number is None
    assert [one.name for one in tyre.constants] == ["MANUFACT", "NOMWIDTH", "INFLPRES", "AMBITEMP"]
    assert tyre.comments == ("! new tyre", "measured on the drum")
    assert tyre.notes == ()


def test_signals_have_units_and_the_running_time(tmp_path: Path) -> None:
    path = written(tmp_path, RIG)
    force, distance = FORMAT.read(asked(path, "fzw", "DSTGRWHC"))
    assert (force.name, force.unit, distance.unit) == ("FZW", "N", "m")
    np.testing.assert_allclose(force.time, [0.0, 0.001, 0.002], rtol=1e-15)
    info = FORMAT.survey(path, path.name, 10**8)
    assert info.format == "TYDEX 1.3"
    assert [one.count for one in info.signals] == [3, 3, 3]
    assert (info.signals[1].start, info.signals[1].duration) == (0.0, 0.002)
    assert info.signals[1].note == "vertical force, W-axis system; Vertical force; stored value × 2 +100"
    assert "INFLPRES (Inflation pressure): 2,1 bar" in info.notes
    assert "new tyre" in info.notes


def test_the_axis_system_is_said_and_nothing_turned() -> None:
    assert meaning("FZC") == "vertical force, C-axis system"
    assert meaning("MXH") == "overturning moment, H-axis system"
    assert meaning("FZ") == meaning("FZX") == meaning("RIGX") == ""


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: ("\ufeff" + text).encode(),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("ACME", "Kölner").encode("latin-1").replace(b"K\xf6lner", b"ACME"),
        lambda text: text.replace("**END\n", "").encode(),
        lambda text: text.replace("**END\n", "**END").encode(),
        lambda text: text.replace("**MEASURDATA", "**MEASURDATA 3").encode(),
        lambda text: text.replace("**MEASURDATA", "**MeasurData   ").encode(),
        lambda text: text.replace("2  NOTAVAIL    0,3103", "2\n  NOTAVAIL\n    0,3103").encode(),
        lambda text: text.replace("         1    1000.5  3.102D-1", "\n! pause\n1\t1000.5\t3.102D-1 ! late").encode(),
        lambda text: text.replace("         0      1000    0.3101", "0.000000001000.00000    0.3101").encode(),
        lambda text: text.replace(
            "FZW       Vertical force                N         2  ", "FZW\tForce\tN\t2\t"
        ).encode(),
        lambda text: text.replace("  N         2         0         100", "  N        2 0 100").encode(),
        lambda text: text.replace("**COMMENTS", "**NOVELTY\nanything\n**COMMENTS").encode(),
        lambda text: text.replace("**COMMENTS", "**MODELNOVELTY\nanything\n**COMMENTS").encode(),
    ],
)
def test_other_ways_to_write_the_same(tmp_path: Path, change) -> None:
    tyre = read_tydex(written(tmp_path, change(RIG)))
    np.testing.assert_array_equal(tyre.values("FZW"), [2100.0, 2101.0, NAN])
    np.testing.assert_array_equal(tyre.values("DSTGRWHC"), [0.3101, 0.3102, 0.3103])
    assert tyre.constant("INFLPRES").number == 2.1


def test_what_is_odd_is_noted(tmp_path: Path) -> None:
    odd = RIG.replace("**END\n", "").replace("**COMMENTS", "**NOVELTY\nanything\n**COMMENTS")
    (novel, end) = read_tydex(written(tmp_path, odd)).notes
    assert "NOVELTY" in novel
    assert "cut off" in end
    fewer = RIG.replace("**MEASURDATA", "**MEASURDATA 2")
    assert read_tydex(written(tmp_path, fewer)).notes == ("says it has 2 rows and holds 3",)


def test_a_model_is_kept_as_written(tmp_path: Path) -> None:
    text = (
        "**HEADER\nRELEASE   Release                                 1.3\n**MODELPARAMETERS\n"
        "FNOMIN    Nominal vertical load         N         4000\n**MODELDEFINITION\n  any text\n"
        "**MODELCOEFFICIENTS\nC1                                                1.3\n**MODELEND\n**END\n"
    )
    tyre = read_tydex(written(tmp_path, text))
    assert tyre.parameters == (TydexEntry("FNOMIN", "4000", "N", "Nominal vertical load"),)
    assert [keyword for keyword, _ in tyre.models] == ["MODELDEFINITION", "MODELCOEFFICIENTS", "MODELEND"]
    assert tyre.models[0][1] == ("  any text",)
    write_tydex(tmp_path / "again.tdx", tyre)
    again = read_tydex(tmp_path / "again.tdx")
    assert (again.parameters, again.models) == (tyre.parameters, tyre.models)
    with pytest.raises(TableError, match=r"run\.tdx: there is no channel 'FZW'; it has none"):
        FORMAT.read(asked(tmp_path / "run.tdx", "FZW"))


def test_the_columns_are_those_of_the_manual(tmp_path: Path) -> None:
    write_tydex(
        tmp_path / "run.tdx",
        TydexFile(
            constants=(TydexEntry("INFLPRES", "2.1", "bar", "Inflation pressure"),),
            channels=(TydexChannel("RUNTIME", "s", "Running time", 0.001), TydexChannel("FZW", "N")),
            data=np.array([[0, 1000.5], [1, NAN]]),
        ),
    )
    lines = (tmp_path / "run.tdx").read_bytes().decode("ascii").split("\n")
    assert lines[1] == "RELEASE   Release of TYDEX-Format                 1.3"
    assert lines[lines.index("**CONSTANTS") + 1] == "INFLPRES  Inflation pressure            bar       2.1"
    at = lines.index("**MEASURCHANNELS")
    assert lines[at + 1] == "RUNTIME   Running time                  s         0.001     0         0"
    assert lines[at + 3 : at + 6] == ["**MEASURDATA", "         0    1000.5", "         1  NOTAVAIL"]
    assert lines[-2:] == ["**END", ""]


names = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", min_size=1, max_size=8)
plain = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=0, max_size=9)
words = st.lists(plain, max_size=3).map(lambda parts: " ".join(filter(None, parts)))
entries = st.builds(TydexEntry, names, words, plain, words).filter(
    lambda one: len(one.value) <= 30 and len(one.description) <= 30
)
numbers = st.floats(allow_nan=True, allow_infinity=False)
factors = st.sampled_from([1.0, 0.001, -2.5, 1e-6, 12345.0])


@st.composite
def files(draw: st.DrawFn) -> TydexFile:
    called = draw(st.lists(names, min_size=1, max_size=5, unique=True))
    channels = tuple(
        TydexChannel(one, draw(plain), draw(words.filter(lambda text: len(text) <= 30)), draw(factors), draw(factors))
        for one in called
    )
    rows = draw(st.integers(1, 4))
    data = [[draw(numbers) for _ in called] for _ in range(rows)]
    header = (TydexEntry("RELEASE", "1.3", "", "Release"), *draw(st.lists(entries, max_size=2)))
    return TydexFile(
        header,
        tuple(draw(st.lists(entries, max_size=3))),
        channels,
        np.array(data),
        tuple(draw(st.lists(words.filter(lambda text: not text.startswith("**")), max_size=2))),
        tuple(draw(st.lists(entries, max_size=2))),
    )


@pytest.mark.thorough
@settings(max_examples=60, deadline=None)
@given(tyre=files())
def test_what_is_written_is_read(tyre: TydexFile, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("tydex") / "run.tdx"
    write_tydex(path, tyre)
    again = read_tydex(path)
    np.testing.assert_allclose(again.data, tyre.data, rtol=1e-12, atol=0)
    told = replace(again, data=tyre.data, label=tyre.label)
    assert told == replace(tyre, data=tyre.data)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"channels": (TydexChannel("MUCHTOOLONG", "N"),)}, "name 'MUCHTOOLONG' has 11 characters; TYDEX holds 8"),
        ({"channels": (TydexChannel("FZ W", "N"),)}, "'FZ W' cannot be a name"),
        ({"channels": (TydexChannel("FZW", "kilonewtons"),)}, "unit 'kilonewtons' has 11 characters"),
        ({"channels": (TydexChannel("FZW", "°C"),)}, "is not plain ASCII"),
        ({"channels": (TydexChannel("FZW", "N", factor=1 / 3),)}, "factor 0.333.*cannot hold in 10 columns"),
        ({"channels": ()}, "0 channels but data"),
        ({"data": np.array([[np.inf]])}, "infinite"),
        ({"constants": (TydexEntry("TYRE", "Größe"),)}, "is not plain ASCII"),
        ({"constants": (TydexEntry("TYRE", "x" * 31),)}, "has 31 characters"),
        ({"constants": (TydexEntry("TYRE", "a\nb"),)}, "is not plain ASCII"),
        ({"comments": ("**END",)}, r"begins with \*\*"),
        ({"models": (("MEASURDATA", ()),)}, "is no section of a model"),
    ],
)
def test_what_the_format_cannot_hold_is_refused(tmp_path: Path, change: dict, message: str) -> None:
    tyre = replace(TydexFile(channels=(TydexChannel("FZW", "N"),), data=np.array([[1.0]])), **change)
    with pytest.raises(TableError, match=message):
        write_tydex(tmp_path / "run.tdx", tyre)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("t,F1\n0,1\n", "is not a TYDEX file"),
        (b"\x89PNG\r\n\x1a\n\x00\x00**HEADER", "is not a TYDEX file"),
        (RIG.replace("1000.5", "10x0.5"), r"row 22: '10x0\.5' is no number"),
        (RIG.replace("1000.5", "1_0"), "'1_0' is no number"),
        (RIG[: RIG.index("1000.5")], r"row 22: ends after 1 of 3 values; the file is cut off"),
        (RIG.replace("    0.3101\n", "    0.3101 4\n"), "row 21: has 4 values for 3 channels"),
        (RIG.replace("**MEASURDATA", "**MEASURDATA 999999999999"), "says it has 999999999999 rows and holds 3"),
        (RIG.replace("**MEASURCHANNELS", "!"), "no channels in"),
        (RIG.replace("**END", "**MEASURDATA\n1 2 3\n**END"), r"has \*\*MEASURDATA twice"),
        (RIG.replace("**END", "**MEASURCHANNELS\nFX\n**END"), "channel below the measured data"),
        (RIG.replace("0         100", "0         1.0.0"), "line 18: channel 'FZW' has '1.0.0'"),
        (RIG.replace("     2         0 ", "     0         0 "), "the factor 0"),
        (RIG.replace("DSTGRWHC", "FZW     "), "no channel 'FZW'; did you mean 'FZW.2'"),
        (RIG[:60] + "\x00" + RIG[60:], "is binary"),
        (RIG.replace("1000.5", "1000\x00"), "is binary"),
    ],
)
def test_wrong_files_are_refused_once_and_clearly(tmp_path: Path, content: str | bytes, message: str) -> None:
    with pytest.raises(TableError, match=message):
        FORMAT.read(asked(written(tmp_path, content), "FZW"))


def test_both_offsets_are_applied_and_said(tmp_path: Path) -> None:
    """Stored 1000.5 and on, 5 added before the factor 2, 100 after it."""
    path = written(tmp_path, RIG.replace("     2         0 ", "     2         5 "))
    plain = FORMAT.read(asked(written(tmp_path, RIG, "plain.tdx"), "FZW"))[0].samples
    np.testing.assert_allclose(FORMAT.read(asked(path, "FZW"))[0].samples, plain + 10.0, rtol=1e-15)
    assert FORMAT.survey(path, "run.tdx", 10**8).signals[1].note.endswith("(stored value +5) × 2 +100")


def test_duplicate_channels_have_numbers(tmp_path: Path) -> None:
    path = written(tmp_path, RIG.replace("DSTGRWHC", "FZW     "))
    (second,) = FORMAT.read(asked(path, "FZW.2"))
    assert second.name == "FZW.2"
    np.testing.assert_array_equal(second.samples, [0.3101, 0.3102, 0.3103])
    assert [one.name for one in FORMAT.survey(path, "run.tdx", 10**8).signals] == ["RUNTIME", "FZW.1", "FZW.2"]


def test_limits_groups_and_missing_channels(tmp_path: Path) -> None:
    path = written(tmp_path, RIG)
    with pytest.raises(TableError, match="did you mean 'FZW'"):
        FORMAT.read(asked(path, "FZ"))
    with pytest.raises(TableError, match="has no groups"):
        FORMAT.read(asked(path, "FZW", group="1"))
    with pytest.raises(FileError, match="more than the"):
        FORMAT.read(asked(path, "FZW", max_bytes=10))


def test_it_is_known_by_its_content() -> None:
    assert BEGINS["tydex"](RIG.encode())
    assert BEGINS["tydex"](RIG.encode("utf-16"))
    assert not BEGINS["tydex"](b"# **HEADER in a comment\nt,F1\n")
    assert not BEGINS["tydex"](b"")
