"""RPC III: files made from the description of the format come back, and a header that lies is refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.rpc import FORMAT
from fourpole.io.recordings import format_of
from fourpole.io.signals import Request, Signal

LIMIT = 10**9
FRAME, GROUP, FRAMES, CHANNELS = 256, 1024, 10, 3
COUNT = FRAME * FRAMES
SCALES = (0.01, 2e-5, 1.0)
RAW = np.random.default_rng(3).integers(-32768, 32768, (CHANNELS, COUNT))
RAW[:, :2] = [-32768, 32767]


def header(**more: object) -> bytes:
    """The records of a header, in pages of four."""
    keys: dict[str, object] = {"FORMAT": "BINARY", "NUM_HEADER_BLOCKS": 0, "NUM_PARAMS": 0}
    keys |= {"FILE_TYPE": "TIME_HISTORY", "TIME_TYPE": "RESPONSE", "DELTA_T": "4.882812E-04", "CHANNELS": CHANNELS}
    keys |= {"PTS_PER_FRAME": FRAME, "PTS_PER_GROUP": GROUP, "FRAMES": FRAMES, "PARTITIONS": 1, "BYPASS_FILTER": 0}
    for at, (name, unit) in enumerate((("Axial Force", "kN"), ("Axial Displ.", "mm"), ("Axial Force", "NONE")), 1):
        keys |= {f"DESC.CHAN_{at}": name, f"UNITS.CHAN_{at}": unit, f"SCALE.CHAN_{at}": f"{SCALES[at - 1]:E}"}
    keys |= more
    keys = {key: value for key, value in keys.items() if value is not None}
    pages = -(-len(keys) // 4)
    keys |= {"NUM_HEADER_BLOCKS": more.get("NUM_HEADER_BLOCKS", pages), "NUM_PARAMS": len(keys)}
    return b"".join(struct.pack("32s96s", k.encode(), str(v).encode()) for k, v in keys.items()).ljust(
        512 * pages, b"\0"
    )


def grouped(values: np.ndarray, kind: str, *, filled: bool = True) -> bytes:
    """The samples group by group, in each the channels one after the other."""
    parts = []
    for at in range(0, values.shape[1], GROUP):
        group = values[:, at : at + GROUP]
        if filled:
            group = np.pad(group, ((0, 0), (0, GROUP - group.shape[1])))
        parts += [channel.astype(kind).tobytes() for channel in group]
    return b"".join(parts)


def read(path: Path, *names: str, most: int = LIMIT) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, "", path.name, most)))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.rsp"


@pytest.mark.parametrize(
    ("kind", "stated"),
    [
        ("<i2", {}),
        ("<i2", {"FORMAT": "BINARY_IEEE_LITTLE_END", "DATA_TYPE": "SHORT_INTEGER", "INT_FULL_SCALE": 32768}),
        (">i2", {"FORMAT": "BINARY_IEEE_BIG_END", "DATA_TYPE": "SHORT_INTEGER"}),
        ("<f4", {"DATA_TYPE": "FLOATING_POINT"}),
        ("<f8", {"DATA_TYPE": "DOUBLE_PRECISION"}),
    ],
)
@pytest.mark.parametrize("filled", [True, False])
def test_samples_come_back(path: Path, kind: str, stated: dict[str, object], filled: bool) -> None:
    path.write_bytes(header(**stated) + grouped(RAW, kind, filled=filled))
    assert format_of(path, max_bytes=LIMIT) == FORMAT
    info = FORMAT.survey(path, "a.rsp", LIMIT)
    names = ["Axial Force.1", "Axial Displ.", "Axial Force.2"]
    assert [(one.name, one.unit, one.count) for one in info.signals] == [
        (name, unit, COUNT) for name, unit in zip(names, ("kN", "mm", None), strict=True)
    ]
    assert info.signals[0].rate == pytest.approx(2048, rel=1e-6)
    scales = np.ones(3) if "f" in kind else np.array(SCALES)
    for signal, raw, scale in zip(read(path, *names), RAW, scales, strict=True):
        np.testing.assert_array_equal(signal.samples, raw * scale)
    for rows in (100, 1024, 2000):
        chunks = list(FORMAT.blocks(Request(path, ("Axial Displ.",), "", "a", LIMIT), rows))
        np.testing.assert_array_equal(np.concatenate([one[0].samples for one in chunks]), RAW[1] * scales[1])
        np.testing.assert_allclose([one[0].start for one in chunks], np.arange(len(chunks)) * rows * 4.882812e-4)


def test_what_the_header_states_beside(path: Path) -> None:
    path.write_bytes(header(INT_FULL_SCALE=32752, OPERATION="run 7, 2 bar", SAMPLES=2000) + grouped(RAW, "<i2"))
    info = FORMAT.survey(path, "a.rsp", LIMIT)
    assert {"OPERATION: run 7, 2 bar", "TIME_TYPE: RESPONSE"} <= set(info.notes)
    assert any("INT_FULL_SCALE/32768 gives values that differ by -0.0488 %" in one for one in info.notes)
    assert info.signals[1].note == "16 bit integer times 2e-05"
    (displacement,) = read(path, "axial displ.")
    np.testing.assert_array_equal(displacement.samples, RAW[1, :2000] * 2e-5)


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ({"FORMAT": "ASCII"}, "export it as BINARY"),
        ({"DATA_TYPE": "COMPLEX"}, "export it as BINARY"),
        ({"FILE_TYPE": "RAINFLOW"}, "only a TIME_HISTORY"),
        ({"PARTITIONS": 2}, "export its channels in one"),
        ({"CHANNELS": 0}, "CHANNELS is '0'"),
        ({"CHANNELS": 10**9}, "CHANNELS is"),
        ({"CHANNELS": None}, "has no CHANNELS"),
        ({"CHANNELS": 4}, "is cut short"),
        ({"FRAMES": 10**14}, "FRAMES is"),
        ({"FRAMES": "-3"}, "FRAMES is '-3'"),
        ({"PTS_PER_FRAME": "²"}, "PTS_PER_FRAME is"),
        ({"PTS_PER_GROUP": 1000}, "PTS_PER_GROUP 1000"),
        ({"DELTA_T": "nan"}, "DELTA_T 'nan'"),
        ({"DELTA_T": "1e-400"}, "DELTA_T '1e-400'"),
        ({"DELTA_T": "0"}, "DELTA_T '0'"),
        ({"SCALE.CHAN_2": "1e999"}, "states no SCALE.CHAN_2"),
        ({"NUM_HEADER_BLOCKS": "9" * 30}, "a header of '9"),
        ({"NUM_HEADER_BLOCKS": "0"}, "a header of '0' blocks"),
    ],
)
def test_a_header_that_lies_is_refused(path: Path, stated: dict[str, object], says: str) -> None:
    path.write_bytes(header(**stated) + grouped(RAW, "<i2"))
    for use in (lambda: FORMAT.survey(path, "a.rsp", LIMIT), lambda: read(path, "Axial Displ.")):
        with pytest.raises(TableError, match=r"^a\.rsp: ") as error:
            use()
        assert says in str(error.value)


def test_what_is_cut_short_is_refused(path: Path) -> None:
    whole = header() + grouped(RAW, "<i2")
    for length in (128 * 2, 400, 600, len(header()), len(whole) - 2):
        path.write_bytes(whole[:length])
        with pytest.raises(TableError, match="is cut short"):
            FORMAT.survey(path, "a.rsp", LIMIT)


def test_memory_is_asked_for_before_it_is_used(path: Path) -> None:
    path.write_bytes(header() + grouped(RAW, "<i2"))
    with pytest.raises(FileError, match=r"needs .* more than the .* allowed"):
        read(path, "Axial Force.1", "Axial Displ.", most=30_000)
