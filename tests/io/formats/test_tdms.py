"""NI TDMS: what nptdms wrote comes back, and a list of segments that lies is refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.tdms import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

nptdms = pytest.importorskip("nptdms")
LIMIT = 10**9
FORCE = np.random.default_rng(1).normal(size=4000)
SLOW = np.linspace(0.0, 1.0, 50, dtype="f4")


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


def scaled() -> dict[str, object]:
    return {
        "NI_Scaling_Status": "unscaled",
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.25,
        "NI_Scale[0]_Linear_Y_Intercept": -3.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }


@pytest.fixture
def path(tmp_path: Path) -> Path:
    fast = {"wf_increment": 1 / 2048, "wf_start_offset": 0.5, "unit_string": "N"}
    begun = np.datetime64("2024-05-01T10:00:00")
    later = {"wf_increment": 0.1, "wf_start_offset": 0.0, "NI_UnitDescription": "m/s"}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        for part in (FORCE[:1000], FORCE[1000:]):
            file.write_segment(
                [
                    nptdms.RootObject({"operator": "me"}),
                    nptdms.ChannelObject("fast", "F1", part, {**fast, "wf_start_time": begun}),
                    nptdms.ChannelObject("fast", "raw", np.arange(len(part), dtype="i2"), scaled()),
                ]
            )
        file.write_segment(
            [
                nptdms.ChannelObject("slow", "V1", SLOW, {**later, "wf_start_time": begun + np.timedelta64(250, "ms")}),
                nptdms.ChannelObject("slow", "F1", SLOW.astype("f8"), {"unit_string": "kN"}),
                nptdms.ChannelObject("slow", "words", ["a", "b"]),
            ]
        )
    return tmp_path / "a.tdms"


def test_groups_rates_units_and_scaling_come_back(path: Path) -> None:
    assert BEGINS["tdms"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, "a.tdms", LIMIT)
    assert info.format.startswith("NI TDMS")
    assert "operator: me" in info.notes
    found = {(one.group, one.name): one for one in info.signals}
    assert found["fast", "F1"].rate == 2048.0
    assert found["fast", "F1"].unit == "N"
    assert found["fast", "F1"].count == 4000
    assert found["slow", "V1"].unit == "m/s"
    assert found["slow", "F1"].rate is None
    assert "no numbers" in found["slow", "words"].note
    force, raw = FORMAT.read(asked(path, "F1", "RAW", group="fast"))
    np.testing.assert_array_equal(force.samples, FORCE)
    assert (force.rate, force.start, force.unit) == (2048.0, 0.5, "N")
    np.testing.assert_allclose(raw.samples[:1000], 0.25 * np.arange(1000) - 3.0, rtol=1e-12)
    (speed,) = FORMAT.read(asked(path, "v1"))
    np.testing.assert_allclose(speed.samples, SLOW, rtol=1e-6)
    assert speed.rate == pytest.approx(10.0)


def test_channels_started_later_begin_later(tmp_path: Path) -> None:
    begun = np.datetime64("2024-05-01T10:00:00")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        for name, late in (("a", 0), ("b", 250)):
            timing = {"wf_increment": 0.01, "wf_start_time": begun + np.timedelta64(late, "ms"), "wf_start_offset": 0.0}
            file.write_segment([nptdms.ChannelObject("g", name, FORCE, timing)])
    first, second = FORMAT.read(asked(tmp_path / "a.tdms", "a", "b"))
    assert (first.start, second.start) == (0.0, pytest.approx(0.25, abs=1e-9))


def daqmx(counts: np.ndarray, slope: float) -> bytes:
    """A segment as NI-DAQmx logs it: raw counts, and a scale that turns them into a voltage."""

    def text(words: str) -> bytes:
        return struct.pack("<I", len(words)) + words.encode()

    scales = [("NI_Number_Of_Scales", 3, 2), ("NI_Scale[1]_Linear_Input_Source", 7, 0)]
    numbers = [("NI_Scale[1]_Linear_Slope", slope), ("NI_Scale[1]_Linear_Y_Intercept", 0.5), ("wf_increment", 1e-3)]
    properties = [text("NI_Scaling_Status") + struct.pack("<I", 0x20) + text("unscaled")]
    properties += [text("NI_Scale[1]_Scale_Type") + struct.pack("<I", 0x20) + text("Linear")]
    properties += [text(name) + struct.pack("<Ii", kind, value) for name, kind, value in scales]
    properties += [text(name) + struct.pack("<Id", 10, value) for name, value in numbers]
    index = struct.pack("<IIIQ", 0x1269, 0xFFFFFFFF, 1, len(counts))
    index += struct.pack("<IIIIII", 1, 3, 0, 0, 0, 0) + struct.pack("<II", 1, 2)
    objects = text("/'g'") + struct.pack("<II", 0xFFFFFFFF, 0)
    objects += text("/'g'/'ai0'") + index + struct.pack("<I", len(properties)) + b"".join(properties)
    metadata = struct.pack("<I", 2) + objects
    data = counts.astype("<i2").tobytes()
    lead = b"TDSm" + struct.pack("<IIQQ", 2 | 4 | 8 | 128, 4713, len(metadata) + len(data), len(metadata))
    return lead + metadata + data


def test_counts_of_daqmx_become_volts(tmp_path: Path) -> None:
    counts = np.arange(-500, 500)
    (tmp_path / "a.tdms").write_bytes(daqmx(counts, 0.25))
    (volts,) = FORMAT.read(asked(tmp_path / "a.tdms", "ai0"))
    np.testing.assert_allclose(volts.samples, 0.25 * counts + 0.5, rtol=1e-12)
    assert volts.rate == 1000.0


def test_the_index_beside_it_is_not_read(path: Path) -> None:
    path.with_suffix(".tdms_index").write_bytes(b"TDSh, and then nothing that could be read")
    (force,) = FORMAT.read(asked(path, "fast/F1"))
    np.testing.assert_array_equal(force.samples, FORCE)
    with pytest.raises(TableError, match="index"):
        FORMAT.survey(path.with_suffix(".tdms_index"), "a.tdms_index", LIMIT)


def test_names_that_are_not_there_or_not_unique(path: Path) -> None:
    with pytest.raises(TableError, match=r"'F1' is in the groups 'fast', 'slow'; say which, as in a\.tdms#fast"):
        FORMAT.read(asked(path, "F1"))
    with pytest.raises(TableError, match="no channel 'F2'; did you mean 'F1'"):
        FORMAT.read(asked(path, "F2", group="fast"))
    with pytest.raises(TableError, match="no group 'fats'; did you mean 'fast'"):
        FORMAT.read(asked(path, "F1", group="fats"))
    with pytest.raises(TableError, match="holds no"):
        FORMAT.read(asked(path, "words"))


def test_memory_is_asked_for_before_it_is_used(path: Path) -> None:
    with pytest.raises(FileError, match=r"needs .* more than the"):
        FORMAT.read(asked(path, "fast/F1", most=60_000))


def test_what_is_cut_short_or_lies_is_refused(path: Path) -> None:
    whole = path.read_bytes()
    objects = 28
    wrong = [
        whole[:-100],
        whole[:40],
        whole[:5],
        whole[:objects] + struct.pack("<I", 0xFFFFFFF0) + whole[objects + 4 :],
        whole[:12] + struct.pack("<Q", 2**60) + whole[20:],
        whole[: objects + 4] + struct.pack("<I", 0xFFFFFFF0) + whole[objects + 8 :],
        b"TDSm" + bytes(200),
        b"t,F1\n0,1\n",
    ]
    other = path.with_name("b.tdms")
    for content in wrong:
        other.write_bytes(content)
        for use in (lambda: FORMAT.survey(other, "b.tdms", LIMIT), lambda: FORMAT.read(asked(other, "V1"))):
            with pytest.raises(TableError, match=r"^b\.tdms: "):
                use()


def test_a_scaling_that_the_library_does_not_know_is_not_passed_over(tmp_path: Path) -> None:
    scaled = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Reciprocal", "NI_Scaling_Status": "unscaled"}
    done = scaled | {"NI_Scaling_Status": "scaled"}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([nptdms.ChannelObject("g", "F1", np.arange(9.0), scaled)])
        file.write_segment([nptdms.ChannelObject("g", "F2", np.arange(9.0), done)])
    notes = {one.name: one.note for one in FORMAT.survey(tmp_path / "a.tdms", "a", 10**9).signals}
    assert notes["F1"] == "is scaled by 'Reciprocal', which is not known; save its scaled values"
    with pytest.raises(TableError, match="'F1' is scaled by 'Reciprocal', which is not known; save its scaled values"):
        FORMAT.read(Request(tmp_path / "a.tdms", ("F1",), "", "a", 10**9))
    (given,) = FORMAT.read(Request(tmp_path / "a.tdms", ("F2",), "", "a", 10**9))
    np.testing.assert_array_equal(given.samples, np.arange(9.0))
