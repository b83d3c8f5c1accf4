"""Parquet: what polars wrote comes back, with units and times; parts that lie are refused."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats import columnar, parquet
from fourpole.io.formats.parquet import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request, Signal

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 3000
FORCE = np.random.default_rng(2).normal(size=N)
# The schema of an Arrow table with the fields t (timestamp), F1 with the metadata unit=kN, V1 with units=m/s.
SCHEMA = (
    "/////2ABAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAMAAAAAAQAAkAAAAAQAAACK////AAABAxQAAABkAAAACAAA"
    "ABAAAAAAAAAAAgAAAFYxAAACAAAAJAAAAAQAAAB8////EAAAAAQAAAABAAAAeQAAAAEAAAB4AAAAmP///xAAAAAEAAAAAwAAAG0vcwAFAAAAdW5pdHMA"
    "BgAGAAQABgAAAAEAEgAYAAgABgAHAAwAAAAQABQAEgAAAAAAAQMUAAAASAAAAAgAAAAQAAAAAAAAAAIAAABGMQAAAQAAAAwAAAAIAAwABAAIAAgAAAAQ"
    "AAAABAAAAAIAAABrTgAABAAAAHVuaXQAAAAAyv///wAAAgAQABQACAAGAAcADAAAABAAEAAAAAAAAQoQAAAAGAAAAAQAAAAAAAAAAQAAAHQABgAIAAYA"
    "BgAAAAAAAgAAAAAA"
)


def read(path: Path, *names: str, most: int = LIMIT) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, "", path.name, most)))


def written(path: Path, frame: pl.DataFrame, **notes: str) -> Path:
    more = {"metadata": notes} if notes else {}
    frame.write_parquet(path, row_group_size=700, **more)
    return path


@pytest.mark.parametrize("compression", ["zstd", "snappy", "gzip", "lz4", "brotli", "uncompressed"])
def test_columns_come_back_with_units_and_time(tmp_path: Path, compression: str) -> None:
    kinds = {"n": pl.Int16, "F2": pl.Float32, "ok": pl.Boolean}
    frame = pl.DataFrame({"time [ms]": np.arange(N) * 0.5, "F1 [N]": FORCE, "F2": FORCE, "n": np.arange(N)})
    frame = frame.with_columns(ok=pl.col("n") % 2 == 0, who=pl.lit("me"), gaps=pl.when(pl.col("n") != 7).then("n"))
    frame = frame.cast({one: kind for one, kind in kinds.items() if one in frame.columns})
    path = tmp_path / "a.parquet"
    frame.write_parquet(path, compression=compression, row_group_size=700)
    assert BEGINS["parquet"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, path.name, LIMIT)
    found = {one.name: one for one in info.signals}
    force = found["F1 [N]"]
    assert (force.unit, force.count, force.rate, force.note) == ("N", N, None, "time from time [ms]")
    assert (force.start, force.duration) == (0.0, pytest.approx((N - 1) * 5e-4))
    assert found["who"].note == "holds no numbers"
    one, two, count, even, gaps = read(path, "f1", "F2", "n", "ok", "gaps")
    np.testing.assert_array_equal(one.samples, FORCE)
    np.testing.assert_array_equal(two.samples, FORCE.astype("f4"))
    np.testing.assert_array_equal(count.samples, np.arange(N))
    np.testing.assert_array_equal(even.samples, np.arange(N) % 2 == 0)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(gaps.samples)), [7])
    assert one.unit == "N"
    np.testing.assert_allclose(one.time, np.arange(N) * 5e-4, rtol=1e-14)
    (time,) = read(path, "time")
    assert (time.unit, time.time) == ("ms", None)
    with pytest.raises(TableError, match="channel 'who' holds no numbers"):
        read(path, "who")


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_timestamps_are_seconds_from_the_first(tmp_path: Path, unit: str) -> None:
    begun = dt.datetime(2024, 2, 1, 10, tzinfo=dt.UTC)
    stamps = pl.Series("t", [begun + dt.timedelta(milliseconds=5 * at) for at in range(N)])
    frame = pl.DataFrame({"when": stamps.cast(pl.Datetime(unit, "UTC")), "F1": FORCE})
    path = written(tmp_path / "a.parquet", frame)
    force, when = read(path, "F1", "when")
    np.testing.assert_array_equal(force.time, np.arange(N) * 5 / 1000)
    assert when.unit == "s"
    np.testing.assert_array_equal(when.samples, force.time)
    assert [one.duration for one in FORMAT.survey(path, "a", LIMIT).signals] == [None, (N - 1) * 5 / 1000]
    frame = frame.with_columns(when=pl.col("when") - pl.lit(begun).cast(pl.Datetime(unit, "UTC")))
    np.testing.assert_array_equal(read(written(path, frame), "F1")[0].time, np.arange(N) * 5 / 1000)


def test_units_and_rate_in_metadata(tmp_path: Path) -> None:
    assert columnar.stated_units({"pandas": json.dumps({"attributes": {"unit": {"F1": "N"}}})}) == {"F1": "N"}
    assert columnar._rate({"fs": "2e3"}) == 2000.0
    frame = pl.DataFrame({"F1": FORCE, "V1": FORCE, "X [mm]": FORCE})
    path = written(tmp_path / "a.parquet", frame, units=json.dumps({"F1": "N", "V1": "m/s"}), rate="2000")
    assert [one.unit for one in read(path, "F1", "V1", "X")] == ["N", "m/s", "mm"]
    assert {one.rate for one in FORMAT.survey(path, "a", LIMIT).signals} == {2000.0}
    attributes = json.dumps({"units": {"F1": "lbf"}})
    assert read(written(path, frame, PANDAS_ATTRS=attributes, dt="0.5"), "F1")[0].unit == "lbf"
    assert read(path, "F1")[0].rate == 2.0
    for broken in ("[", "5", '{"units": 5}', "[" * 10_000):
        assert read(written(path, frame, PANDAS_ATTRS=broken, pandas=broken, units=broken, rate=broken), "V1")


def test_units_of_arrow_fields() -> None:
    assert parquet._field_units(SCHEMA) == {"F1": "kN", "V1": "m/s"}
    rng = np.random.default_rng(1)
    for _ in range(300):
        made = bytearray(SCHEMA.encode())
        for at in rng.integers(0, len(made), 3):
            made[at] = rng.choice(list(b"A/8Zz"))
        assert isinstance(parquet._field_units(made.decode()), dict)


def test_what_lies_is_refused(tmp_path: Path, outcome: Outcome) -> None:
    path = written(tmp_path / "a.parquet", pl.DataFrame({"F1": FORCE}))
    whole = path.read_bytes()
    for made, what in (
        (whole[:-1], "does not end as"),
        (whole[: len(whole) // 2], "does not end as"),
        (whole[:-4] + b"PARE", "encrypted"),
        (whole[:-8] + b"\xff\xff\xff\x7fPAR1", "cannot be read as"),
        (b"PAR1" + whole[2000:], "cannot be read as"),
        (b"PAR1", "cannot be read as"),
    ):
        path.write_bytes(made)
        about, samples = outcome(path, "F1")
        assert what in samples
        assert what in about or made.startswith(b"PAR1" + whole[2000:2100])  # whose footer alone is good


def counted(number: int) -> bytes:
    """A number of rows in the footer: field of kind i64, one after the last field, its zigzag in parts of 7 bits."""
    parts = []
    number *= 2
    while number > 0x7F:
        parts.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([0x16, *parts, number])


@pytest.mark.parametrize("declared", [N - 1000, N - 1, N + 2000])
def test_another_number_of_rows_than_declared_is_refused(tmp_path: Path, declared: int) -> None:
    path = written(tmp_path / "a.parquet", pl.DataFrame({"F1": FORCE}))
    whole = path.read_bytes()
    begin = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    assert whole.count(counted(N), begin) == 1
    footer = whole[begin:-8].replace(counted(N), counted(declared))
    path.write_bytes(whole[:begin] + footer + len(footer).to_bytes(4, "little") + b"PAR1")
    request = Request(path, ("F1",), "", "a", LIMIT)
    for use in (lambda: [FORMAT.read(request)], lambda: list(FORMAT.blocks(request, 700))):
        why, samples = "", FORCE
        try:
            samples = np.concatenate([one.samples for (one,) in use()])
        except TableError as error:
            why = str(error)
        # A polars that counts the rows itself reads all of them.
        assert re.match("(a: is damaged: declares|a: is cut short: column|a: cannot be read|$)", why)
        np.testing.assert_array_equal(samples, FORCE)


def test_samples_that_need_more_memory_than_allowed_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.parquet", pl.DataFrame({"F1": np.zeros(500_000)}))
    with pytest.raises(FileError, match=r"needs .* more than"):
        read(path, "F1", most=3_000_000)


def test_a_name_is_no_pattern(tmp_path: Path) -> None:
    written(tmp_path / "a1.parquet", pl.DataFrame({"F1": [1.0]}))
    path = written(tmp_path / "a[1].parquet", pl.DataFrame({"F1": [2.0]}))
    assert read(path, "F1")[0].samples.tolist() == [2.0]
