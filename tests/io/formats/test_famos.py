"""imc FAMOS: files built key by key, as imc's own have them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.famos import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request, Signal

LIMIT = 10**9
N = 600
FORCE = np.random.default_rng(4).normal(size=N)
KINDS = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "f4": 7, "f8": 8, "u8": 12, "i8": 14}


def key(name: str, content: bytes | str, version: int = 1) -> bytes:
    content = content.encode("cp1252") if isinstance(content, str) else content
    return f"|{name},{version},{len(content)},".encode() + content + b";"


def counted(*texts: str) -> str:
    return ",".join(f"{len(text)},{text}" for text in texts)


def component(
    place: tuple[int, int, int], kind: str, *, scale: str = "0,1,0", unit: str = "", start: float = 0.0, more: str = ""
) -> bytes:
    """Kind, place and scaling of samples: `place` is the block, the byte and the bytes."""
    block, begin, size = place
    width = np.dtype(kind).itemsize
    return (
        key("CC", "1,1")
        + key("CP", more or f"1,{width},{KINDS[kind]},{8 * width},0,0,1,0")
        + key("Cb", f"1,0,1,{block},{begin},{size},0,{size},1,{start!r},0,")
        + key("CR", f"{scale},1,{counted(unit)}")
    )


def head(order: str = "1") -> bytes:
    return key("CF", order, 2) + key("CK", "1,1") + key("NO", f"1,{counted('FAMOS', 'run 7')}")


def even(samples: np.ndarray, name: str = "F1", unit: str = "N", *, step: str = "5E-4,1,1,s", **more: object) -> bytes:
    data = samples.tobytes()
    return (
        key("CG", "1,1,1")
        + key("CD", f"{step},0,0,0")
        + key("NT", " 3,11,2018,21,24, 2.5")
        + component((1, 0, len(data)), samples.dtype.str[1:], unit=unit, **more)
        + key("CN", f"0,0,0,{counted(name, 'Prüfstand')}")
        + b"\r\n"
        + key("CS", b"1," + data)
    )


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def read(path: Path, *names: str, group: str = "", most: int = LIMIT) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, group, path.name, most)))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_each_kind_of_number_is_scaled(tmp_path: Path, kind: str, order: str) -> None:
    stored = np.round(50 + 10 * FORCE).astype(kind)
    content = head("1" if order == "<" else "2") + even(
        stored.astype(f"{order}{kind}"), scale="1,2.5E-1, -3.0", start=1.5
    )
    path = written(tmp_path / "a.dat", content)
    assert BEGINS["famos"](content[:4096])
    (force,) = read(path, "f1")
    np.testing.assert_array_equal(force.samples, stored * 0.25 - 3.0)
    assert (force.name, force.unit, force.rate, force.start, force.time) == ("F1", "N", 2000.0, 1.5, None)
    info = FORMAT.survey(path, path.name, LIMIT)
    assert info.format == "imc FAMOS 2"
    assert {"recorded 2018-11-03T21:24:00", "FAMOS", "run 7"} <= set(info.notes)
    (one,) = info.signals
    assert (one.count, one.rate, one.start, one.duration, one.note) == (N, 2000.0, 1.5, (N - 1) / 2000, "Prüfstand")


def test_a_scaling_that_is_switched_off_is_not_used(tmp_path: Path) -> None:
    path = written(tmp_path / "a.dat", head() + even(FORCE, scale="0,0,0"))
    np.testing.assert_array_equal(read(path, "F1")[0].samples, FORCE)


def test_a_step_that_is_no_time_is_no_rate(tmp_path: Path) -> None:
    path = written(tmp_path / "a.dat", head() + even(FORCE, step="0.5,1,2,Hz"))
    assert (read(path, "F1")[0].rate, FORMAT.survey(path, "a", LIMIT).signals[0].duration) == (None, None)
    path = written(tmp_path / "a.dat", head() + even(FORCE, step="0.5,1,2,ms"))
    assert read(path, "F1")[0].rate == 2000.0


def test_groups_bits_and_triggers(tmp_path: Path) -> None:
    words = (np.arange(N) % 4).astype("<u2")
    data = words.tobytes() + FORCE.tobytes()
    content = (
        head()
        + key("CB", f"1,{counted('fast')}")
        + key("CG", "1,1,1")
        + key("CD", "  1.0E-03,1,1,s,0,0,0,  0.0E+00,1", 2)
        + key("NT", "1,1,2020,0,0,0.0")
        + component((1, 0, len(words) * 2), "u2", more="1,2,11,16,0,0,1,0")
        + key("CN", f"1,0,1,{counted('brake', '')}")
        + key("CN", f"1,0,2,{counted('clutch', '')}")
        + key("CG", "1,1,1")
        + key("CD", "1.0E-02,1,1,s,0,0,0")
        + key("NT", "31,12,2019,23,59,58.5")
        + component((1, len(words) * 2, 8 * N), "f8", unit="N", start=0.25)
        + key("CN", f"1,0,0,{counted('F1', '')}")
        + key("CS", b"         1," + data)
    )
    path = written(tmp_path / "a.raw", content)
    brake, clutch, force = read(path, "brake", "clutch", "fast/F1")
    np.testing.assert_array_equal(brake.samples, np.arange(N) % 2)
    np.testing.assert_array_equal(clutch.samples, np.arange(N) % 4 // 2)
    np.testing.assert_array_equal(force.samples, FORCE)
    assert (brake.start, force.start, brake.rate, force.rate) == (1.5, 0.25, 1000.0, 100.0)
    assert {one.group for one in FORMAT.survey(path, "a", LIMIT).signals} == {"fast"}


def test_a_set_of_two_has_its_times(tmp_path: Path) -> None:
    counts = np.cumsum(np.random.default_rng(1).integers(1, 2**33, N)).astype(np.uint64)
    six = b"".join(struct.pack("<Q", int(one))[:6] for one in counts)
    data = FORCE.tobytes() + six
    content = (
        head()
        + key("CG", "2,2,2")
        + key("CD", "1,1,0,,0,0,0")
        + component((1, 0, 8 * N), "f8", unit="N")
        + key("CN", f"0,0,0,{counted('F1', '')}")
        + component((1, 8 * N, 6 * N), "u2", scale="1,1E-9,0", unit="s", more="2,6,13,48,0,0,1,0")
        + key("CS", b"1," + data)
    )
    path = written(tmp_path / "a.dat", content)
    (force,) = read(path, "F1")
    np.testing.assert_array_equal(force.samples, FORCE)
    np.testing.assert_array_equal(force.time, counts * 1e-9)
    (one,) = FORMAT.survey(path, "a", LIMIT).signals
    assert (one.start, one.duration) == (force.time[0], force.time[-1] - force.time[0])


def test_what_lies_or_cannot_be_read_is_refused(tmp_path: Path) -> None:
    whole = head() + even(FORCE)
    for content, what in (
        (whole[:-1], "is cut short"),
        (whole[:100], "is cut short|no key|cannot be read"),
        (whole.replace(b"|CN", b"*CN"), "there is no key"),
        (whole.replace(b"4800,0,4800", b"9900,0,9900"), "declares 9900 bytes from byte 0 on, of 4800"),
        (whole.replace(b"1,0,1,1,0,", b"1,0,1,1,9,"), "declares 4800 bytes from byte 9 on"),
        (whole.replace(b"|Cb,1,", b"|Cb,1,-"), "is cut short"),
        (whole.replace(b",8,64,0,0,1,0", b",8,64,0,4,1,9"), "between the samples of others"),
        (whole.replace(b",8,8,64", b",8,9,64"), "kind 9"),
        (whole.replace(b"|CF,2", b"|CF,1"), "FAMOS format 1"),
        (b"t,F1\n", "does not begin as one"),
    ):
        with pytest.raises(TableError, match=f"^a.dat: .*(?:{what})"):
            read(written(tmp_path / "a.dat", content), "F1")
    with pytest.raises(FileError, match=r"needs .* more than"):
        read(written(tmp_path / "a.dat", whole), "F1", most=5000)
