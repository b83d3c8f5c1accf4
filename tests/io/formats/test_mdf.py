"""ASAM MDF: what asammdf wrote comes back, and blocks that lie are refused."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.selection import share

from fourpole.errors import FileError, TableError
from fourpole.io.formats.mdf import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    asammdf = pytest.importorskip("asammdf")

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 3000
FORCE = np.random.default_rng(1).normal(size=N)
TIMES = np.arange(N) / 2000.0 + 0.125
SLOW = np.arange(40) * 0.1 + 0.001 * np.random.default_rng(3).uniform(size=40)


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


def signal(name: str, values: np.ndarray, times: np.ndarray, unit: str = "", **more: object) -> object:
    return asammdf.Signal(samples=values, timestamps=times, name=name, unit=unit, **more)


def written(path: Path, version: str, groups: dict[str, list[object]], compression: int = 0) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mdf = asammdf.MDF(version=version)
        for name, signals in groups.items():
            mdf.append(signals, comment=name, acq_name=name)
        mdf.save(path, overwrite=True, compression=compression)
        mdf.close()
    return path


def example(path: Path, version: str = "4.10", compression: int = 0) -> Path:
    counts = np.arange(N, dtype="u2")
    linear = {"a": 0.25, "b": -3.0}
    invalid = np.zeros(N, dtype=bool)
    invalid[[3, 17]] = True
    more = {"invalidation_bits": invalid} if version >= "4" else {}
    return written(
        path,
        version,
        {
            "fast": [
                signal("F1", FORCE, TIMES, "N"),
                signal("V1", FORCE.astype("f4") / 2, TIMES, "m/s", **more),
                signal("raw", counts, TIMES, "bar", conversion=linear),
            ],
            "slow": [signal("F1", np.arange(40.0), SLOW, "kN"), signal("T", np.arange(40, dtype="i2"), SLOW, "degC")],
        },
        compression,
    )


VERSIONS = [("3.00", 0), ("3.30", 0), ("4.00", 0), ("4.10", 0), ("4.10", 1), ("4.10", 2), ("4.20", 0)]


@pytest.mark.parametrize(("version", "compression"), VERSIONS)
def test_groups_times_units_and_scaling_come_back(tmp_path: Path, version: str, compression: int) -> None:
    path = example(tmp_path / ("a.mf4" if version >= "4" else "a.mdf"), version, compression)
    assert BEGINS["mdf"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, path.name, LIMIT)
    assert info.format == f"ASAM MDF {version}"
    found = {(one.group, one.name): one for one in info.signals}
    assert {("fast", "F1"), ("fast", "V1"), ("fast", "raw"), ("slow", "F1"), ("slow", "T")} <= set(found)
    force = found["fast", "F1"]
    assert (force.unit, force.count, force.start) == ("N", N, 0.125)
    assert force.rate == pytest.approx(2000.0)
    assert force.duration == pytest.approx((N - 1) / 2000)
    assert found["slow", "T"].rate == pytest.approx(10.0, rel=1e-3) or found["slow", "T"].rate is None
    force, raw, speed = FORMAT.read(asked(path, "F1", "RAW", "V1", group="fast"))
    np.testing.assert_array_equal(force.samples, FORCE)
    np.testing.assert_allclose(force.time, TIMES, rtol=1e-12)
    assert (force.rate, force.unit, raw.unit) == (None, "N", "bar")
    np.testing.assert_allclose(raw.samples, 0.25 * np.arange(N) - 3.0, rtol=1e-12)
    expected = FORCE / 2
    if version >= "4":
        expected[[3, 17]] = np.nan
    np.testing.assert_allclose(speed.samples, expected, rtol=1e-6)
    (load,) = FORMAT.read(asked(path, "F1", group="SLOW"))
    np.testing.assert_array_equal(load.samples, np.arange(40.0))
    np.testing.assert_allclose(load.time, SLOW, rtol=1e-12)
    (same,) = FORMAT.read(asked(path, "F1", group="1"))
    np.testing.assert_array_equal(same.samples, load.samples)


def test_plain_numbers_are_taken_from_the_file_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = np.random.default_rng(5).integers(0, 100, N)
    kinds = ("u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8", "f4", "f8", ">f8", ">i2")
    path = written(tmp_path / "a.mf4", "4.10", {"": [signal(kind, numbers.astype(kind), TIMES) for kind in kinds]})
    monkeypatch.setattr("asammdf.blocks.mdf_v4.MDF4._load_data", None)  # the library can read no sample
    assert FORMAT.blocks is not None
    chunks = list(FORMAT.blocks(asked(path, *kinds), 700))
    for at, kind in enumerate(kinds):
        np.testing.assert_array_equal(np.concatenate([chunk[at].samples for chunk in chunks]), numbers, kind)
        np.testing.assert_array_equal(np.concatenate([chunk[at].time for chunk in chunks]), TIMES)


def test_columns_stored_apart_and_a_virtual_master(tmp_path: Path) -> None:
    invalid = np.zeros(N, dtype=bool)
    invalid[5] = True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mdf = asammdf.MDF(version="4.20", column_storage=True)
        mdf.append([signal("F1", FORCE, TIMES, "N", invalidation_bits=invalid), signal("V1", FORCE, TIMES, "m/s")])
        mdf.save(tmp_path / "a.mf4", overwrite=True)
        mdf.close()
        mdf = asammdf.MDF(version="4.10")
        mdf.append([signal("F1", FORCE, TIMES, "N")])
        mdf.groups[0].channels[0].channel_type = 3
        mdf.groups[0].channels[0].conversion = asammdf.blocks.v4_blocks.ChannelConversion(
            conversion_type=1, a=5e-4, b=0.125
        )
        mdf.save(tmp_path / "b.mf4", overwrite=True)
        mdf.close()
    force, speed = FORMAT.read(asked(tmp_path / "a.mf4", "F1", "V1"))
    np.testing.assert_array_equal(force.samples, np.where(invalid, np.nan, FORCE))
    np.testing.assert_array_equal(speed.samples, FORCE)
    np.testing.assert_allclose(speed.time, TIMES, rtol=1e-12)
    (even,) = FORMAT.read(asked(tmp_path / "b.mf4", "F1"))
    assert (even.rate, even.start, even.time) == (2000.0, 0.125, None)
    np.testing.assert_array_equal(even.samples, FORCE)
    assert FORMAT.survey(tmp_path / "b.mf4", "b.mf4", LIMIT).signals[1].rate == 2000.0


def test_names_that_are_not_there_or_not_unique(tmp_path: Path) -> None:
    path = example(tmp_path / "a.mf4")
    with pytest.raises(TableError, match=r"'F1' is in the groups 'fast', 'slow'; say which, as in a\.mf4#fast"):
        FORMAT.read(asked(path, "F1"))
    with pytest.raises(TableError, match="no channel 'V2'; did you mean 'V1'"):
        FORMAT.read(asked(path, "V2"))
    with pytest.raises(TableError, match="no group 'fats'; did you mean 'fast'"):
        FORMAT.read(asked(path, "F1", group="fats"))


def test_a_formula_of_the_file_is_not_computed(tmp_path: Path) -> None:
    formula = {"formula": "__import__('os').system('true') + X1"}
    path = written(tmp_path / "a.mf4", "4.10", {"g": [signal("F1", np.arange(9), np.arange(9.0), conversion=formula)]})
    assert "formula" in next(one.note for one in FORMAT.survey(path, "a.mf4", LIMIT).signals if one.name == "F1")
    with pytest.raises(TableError, match="'F1' is scaled by a formula"):
        FORMAT.read(asked(path, "F1"))


def test_texts_are_no_samples(tmp_path: Path) -> None:
    words = signal("state", np.array([b"on", b"off"]), np.arange(2.0), encoding="utf-8")
    table = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on", "default": b"?"}
    states = signal("gear", np.array([0, 1], dtype="u1"), np.arange(2.0), conversion=table)
    path = written(tmp_path / "a.mf4", "4.10", {"g": [words, states]})
    for name in ("state", "gear"):
        with pytest.raises(TableError, match=f"'{name}' holds no"):
            FORMAT.read(asked(path, name))


def test_memory_is_asked_for_before_it_is_used(tmp_path: Path) -> None:
    path = example(tmp_path / "a.mf4", compression=1)
    with pytest.raises(FileError, match=r"needs .* more than"):
        FORMAT.read(asked(path, "V1", most=50_000))


def patched(whole: bytes, *changes: tuple[int, bytes]) -> bytes:
    made = bytearray(whole)
    for at, content in changes:
        made[at : at + len(content)] = content
    return bytes(made)


def lies(path: Path) -> Iterator[bytes]:
    whole = path.read_bytes()
    group, cells, channel = (whole.index(kind) for kind in (b"##DG", b"##CG", b"##CN"))
    yield whole[:-100]
    yield whole[: len(whole) // 2]
    yield whole[:70]
    yield whole[:30]
    yield b"t,F1\n0,1\n"
    yield patched(whole, (group + 24, struct.pack("<Q", group)))  # circles
    yield patched(whole, (cells + 24, struct.pack("<Q", cells)))
    yield patched(whole, (channel + 24, struct.pack("<Q", channel)))
    yield patched(whole, (channel + 32, struct.pack("<Q", channel)))
    yield patched(whole, (group + 24, struct.pack("<Q", 2**62)))
    yield patched(whole, (channel + 8, struct.pack("<Q", 2**63)))
    yield patched(whole, (cells + 24 + 48 + 8, struct.pack("<Q", 2**40)))  # cycles
    place = channel + 24 + 8 * struct.unpack("<Q", whole[channel + 16 : channel + 24])[0]
    yield patched(whole, (place + 4, struct.pack("<I", 60_000)))  # outside the record
    yield patched(whole, (place + 8, struct.pack("<I", 60_000)))
    yield patched(whole, (0, b"UnFinMF "), (60, b"\x01\0"))


def test_what_is_cut_short_or_lies_is_refused(tmp_path: Path, outcome: Outcome) -> None:
    other = tmp_path / "b.mf4"
    made = lies(example(tmp_path / "a.mf4"))
    for content in (one for number, one in enumerate(made) if share(number, 4)):
        other.write_bytes(content)
        _, samples = outcome(other, "V1")
        assert samples
        assert "was not read within" not in samples  # no circle is walked until the time limit


@pytest.mark.parametrize("declared", [60_000_000, 2**36])
def test_a_block_that_unpacks_to_another_size_than_it_declares(tmp_path: Path, outcome: Outcome, declared: int) -> None:
    whole = example(tmp_path / "a.mf4", compression=1).read_bytes()
    at = whole.index(b"##DZ")
    bomb = zlib.compress(bytes(60_000_000), 9)
    lengths = struct.pack("<QQ", declared, len(bomb))
    made = patched(whole, (at + 8, struct.pack("<Q", 48 + len(bomb))), (at + 32, lengths))
    (tmp_path / "b.mf4").write_bytes(made[: at + 48] + bomb + made[at + 48 :])
    assert outcome(tmp_path / "b.mf4", "V1")[1]


def test_version_3_is_guarded_too(tmp_path: Path, outcome: Outcome) -> None:
    whole = example(tmp_path / "a.mdf", "3.30").read_bytes()
    (group,) = struct.unpack("<I", whole[68:72])
    (cells,) = struct.unpack("<I", whole[group + 8 : group + 12])
    (channel,) = struct.unpack("<I", whole[cells + 8 : cells + 12])
    other = tmp_path / "b.mdf"
    made = (
        whole[:-50_000],
        whole[:100],
        patched(whole, (group + 4, struct.pack("<I", group))),
        patched(whole, (channel + 4, struct.pack("<I", channel))),
        patched(whole, (cells + 4 + 18, struct.pack("<I", 2**31))),
        patched(whole, (channel + 186, struct.pack("<H", 60_000))),
        patched(whole, (group + 20, struct.pack("<H", 60_000))),
    )
    for content in (one for number, one in enumerate(made) if share(number, 3)):
        other.write_bytes(content)
        assert outcome(other, "V1")[1]


def test_many_links_to_one_text_are_no_circle(tmp_path: Path) -> None:
    signals = [signal(f"c{at}", np.zeros(1), np.zeros(1), "N", comment="the same") for at in range(200)]
    path = written(tmp_path / "a.mf4", "4.10", {"g": signals})
    assert len(FORMAT.survey(path, "a.mf4", LIMIT).signals) == 201
