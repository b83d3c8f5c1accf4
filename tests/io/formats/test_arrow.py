"""Arrow files: what polars and pyarrow wrote comes back, with units and times; what is damaged is refused."""

from __future__ import annotations

import base64
import datetime as dt
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.arrow import FORMAT
from fourpole.io.recordings import format_of
from fourpole.io.signals import Request, Signal

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 3000
FORCE = np.random.default_rng(2).normal(size=N)
# Written by pyarrow 26: F1 with the metadata unit=kN, rate=1000 of the table.
PYARROW = {
    "feather": (
        "QVJST1cxAAD/////4AAAABAAAAAAAAoADgAGAAUACAAKAAAAAAEEABAAAAAAAAoADAAAAAQACAAKAAAANAAAAAQAAAABAAAABAAAAJT/"
        "//8UAAAABAAAAAQAAAAxMDAwAAAAAAQAAAByYXRlAAAAAAEAAAAYAAAAAAASABgACAAGAAcADAAAABAAFAASAAAAAAABAxQAAABMAAAA"
        "CAAAABAAAAAAAAAAAgAAAEYxAAABAAAADAAAAAgADAAEAAgACAAAABAAAAAEAAAAAgAAAGtOAAAEAAAAdW5pdAAABgAIAAYABgAAAAAA"
        "AgAAAAAA/////5gAAAAUAAAAAAAAAAwAGAAGAAUACAAMAAwAAAAAAwQAHAAAAEgAAAAAAAAAAAAAAAwAHAAQAAQACAAMAAwAAABIAAAA"
        "HAAAABQAAAADAAAAAAAAAAAAAAAEAAQABAAAAAIAAAAAAAAAAAAAABgAAAAAAAAAGAAAAAAAAAAsAAAAAAAAAAAAAAABAAAAAwAAAAAA"
        "AAABAAAAAAAAAAEAAAAAAAAABCJNGGBAggEAAIADAAAAABgAAAAAAAAABCJNGGBAghUAAAARAAEAIfA/BwCwAABAAAAAAAAAAAAAAAAA"
        "AAAAAP////8AAAAAEAAAAAwAFAAGAAgADAAQAAwAAAAAAAQAPAAAACgAAAAEAAAAAQAAAPAAAAAAAAAAoAAAAAAAAABIAAAAAAAAAAAA"
        "AAAAAAAAAAAKAAwAAAAEAAgACgAAADQAAAAEAAAAAQAAAAQAAACU////FAAAAAQAAAAEAAAAMTAwMAAAAAAEAAAAcmF0ZQAAAAABAAAA"
        "GAAAAAAAEgAYAAgABgAHAAwAAAAQABQAEgAAAAAAAQMUAAAATAAAAAgAAAAQAAAAAAAAAAIAAABGMQAAAQAAAAwAAAAIAAwABAAIAAgA"
        "AAAQAAAABAAAAAIAAABrTgAABAAAAHVuaXQAAAYACAAGAAYAAAAAAAIACAEAAEFSUk9XMQ=="
    ),
    "arrows": (
        "/////+AAAAAQAAAAAAAKAA4ABgAFAAgACgAAAAABBAAQAAAAAAAKAAwAAAAEAAgACgAAADQAAAAEAAAAAQAAAAQAAACU////FAAAAAQA"
        "AAAEAAAAMTAwMAAAAAAEAAAAcmF0ZQAAAAABAAAAGAAAAAAAEgAYAAgABgAHAAwAAAAQABQAEgAAAAAAAQMUAAAATAAAAAgAAAAQAAAA"
        "AAAAAAIAAABGMQAAAQAAAAwAAAAIAAwABAAIAAgAAAAQAAAABAAAAAIAAABrTgAABAAAAHVuaXQAAAYACAAGAAYAAAAAAAIAAAAAAP//"
        "//+IAAAAFAAAAAAAAAAMABYABgAFAAgADAAMAAAAAAMEABgAAAAgAAAAAAAAAAAACgAYAAwABAAIAAoAAAA8AAAAEAAAAAMAAAAAAAAA"
        "AAAAAAIAAAAAAAAAAAAAAAEAAAAAAAAACAAAAAAAAAAYAAAAAAAAAAAAAAABAAAAAwAAAAAAAAABAAAAAAAAAAMAAAAAAAAAAAAAAAAA"
        "8D8AAAAAAAAAQAAAAAAAAAAA/////wAAAAA="
    ),
}


def read(path: Path, *names: str, most: int = LIMIT) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, "", path.name, most)))


def write_file(frame: pl.DataFrame, path: Path, **more: Any) -> None:
    frame.write_ipc(path, **more)


def write_stream(frame: pl.DataFrame, path: Path, **more: Any) -> None:
    frame.write_ipc_stream(path, **more)


@pytest.mark.parametrize("compression", ["lz4", "zstd", "uncompressed"])
@pytest.mark.parametrize("write", [write_file, write_stream])
def test_columns_come_back_with_units_and_time(tmp_path: Path, write: Callable[..., None], compression: str) -> None:
    path = tmp_path / "a[1].arrow"
    frame = pl.DataFrame({"time [ms]": np.arange(N) * 0.5, "F1 [N]": FORCE, "n": np.arange(N, dtype="i2"), "who": "me"})
    write(frame.with_columns(gaps=pl.when(pl.col("n") != 7).then("n")), path, compression=compression)
    assert format_of(path, max_bytes=LIMIT) == FORMAT
    found = {one.name: one for one in FORMAT.survey(path, path.name, LIMIT).signals}
    force = found["F1 [N]"]
    assert (force.unit, force.count, force.note) == ("N", N, "time from time [ms]")
    assert (force.start, force.duration) == (0.0, pytest.approx((N - 1) * 5e-4))
    assert found["who"].note == "holds no numbers"
    one, count, gaps = read(path, "f1", "n", "gaps")
    np.testing.assert_array_equal(one.samples, FORCE)
    np.testing.assert_array_equal(count.samples, np.arange(N))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(gaps.samples)), [7])
    np.testing.assert_allclose(one.time, np.arange(N) * 5e-4, rtol=1e-14)
    chunks = list(FORMAT.blocks(Request(path, ("F1",), "", "a", LIMIT), 700))
    np.testing.assert_array_equal(np.concatenate([chunk[0].samples for chunk in chunks]), FORCE)
    with pytest.raises(TableError, match="channel 'who' holds no numbers"):
        read(path, "who")


def test_timestamps_are_seconds_from_the_first(tmp_path: Path) -> None:
    begun = dt.datetime(2024, 2, 1, 10, tzinfo=dt.UTC)
    when = pl.Series([begun + dt.timedelta(milliseconds=5 * at) for at in range(N)]).cast(pl.Datetime("us", "UTC"))
    pl.DataFrame({"when": when, "F1": FORCE}).write_ipc(tmp_path / "a.arrow")
    np.testing.assert_array_equal(read(tmp_path / "a.arrow", "F1")[0].time, np.arange(N) * 5 / 1000)


@pytest.mark.parametrize("kind", ["feather", "arrows"])
def test_units_and_rate_that_pyarrow_wrote(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"a.{kind}"
    path.write_bytes(base64.b64decode(PYARROW[kind]))
    (force,) = read(path, "F1")
    assert (force.unit, force.rate) == ("kN", 1000.0)
    np.testing.assert_array_equal(force.samples, [1.0, 2.0, np.nan])
    assert FORMAT.survey(path, path.name, LIMIT).signals[0].rate == 1000.0


def test_what_lies_is_refused(tmp_path: Path, outcome: Outcome) -> None:
    path = tmp_path / "a.arrow"
    pl.DataFrame({"F1": FORCE}).write_ipc(path)
    whole = path.read_bytes()
    footer = len(whole) - 10
    wrong = [
        whole[:-1],
        whole[: len(whole) // 2],
        b"ARROW1\0\0",
        b"FEA1" + whole[4:],
        whole[:footer] + struct.pack("<i", 2**31 - 1) + whole[footer + 4 :],
        whole[:footer] + struct.pack("<i", -1) + whole[footer + 4 :],
    ]
    for content in wrong:
        path.write_bytes(content)
        assert all(outcome(path, "F1"))
    pl.DataFrame({"F1": FORCE}).write_ipc_stream(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:4] + b"\xff\xff\xff\x7f" + whole[8:])
    assert all(outcome(path, "F1"))


def test_a_description_that_lies_gives_no_units(tmp_path: Path) -> None:
    path = tmp_path / "a.arrow"
    pl.DataFrame({"F1": FORCE}).write_ipc(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:12] + b"\xff\xff\xff\xff\xff\xff\xff\x7f" + whole[20:])
    (force,) = read(path, "F1")
    assert force.unit is None
    np.testing.assert_array_equal(force.samples, FORCE)


def test_samples_that_need_more_memory_than_allowed_are_refused(tmp_path: Path) -> None:
    pl.DataFrame({"F1": np.zeros(500_000)}).write_ipc(tmp_path / "a.arrow", compression="zstd")
    with pytest.raises(FileError, match=r"needs .* more than"):
        read(tmp_path / "a.arrow", "F1", most=3_000_000)
