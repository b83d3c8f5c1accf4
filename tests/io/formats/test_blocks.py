"""Reading in blocks: the pieces of a channel, put together, are bit for bit what is read at once."""

from __future__ import annotations

import importlib
import struct
import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat, wavfile

from fourpole.errors import FileError, TableError
from fourpole.io import rows as room
from fourpole.io.formats import famos, hdf5, matlab, mdf, parquet, tdms, text, wav
from fourpole.io.formats import tdms as tdms_room
from fourpole.io.formats.tracks import Track, in_step
from fourpole.io.signals import Format, Request, Signal

LIMIT = 10**9
N = 1000
RNG = np.random.default_rng(11)
FORCE, SPEED, SLOW = RNG.normal(size=N), RNG.normal(size=N), RNG.normal(size=77)
FORMATS = {
    "csv": text,
    "h5": hdf5,
    "mat": matlab,
    "mat5": matlab,
    "tdms": tdms,
    "mf4": mdf,
    "mdf": mdf,
    "wav": wav,
    "pq": parquet,
    "raw": famos,
}
LIBRARIES = {"h5": "h5py", "mat": "h5py", "tdms": "nptdms", "mf4": "asammdf", "mdf": "asammdf"}


def library(kind: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if kind in LIBRARIES:
            pytest.importorskip(LIBRARIES[kind])


def write_csv(path: Path) -> None:
    rows = (f"{i / 100!r},{float(FORCE[i])!r},{float(SPEED[i])!r}" for i in range(N))
    path.write_text("Sample rate: 100 Hz\nt [s],F1 [N],V1 [m/s]\n" + "\n".join(rows) + "\n\n")


def write_h5(path: Path) -> None:
    with importlib.import_module("h5py").File(path, "w") as file:
        group = file.create_group("g")
        group.attrs["rate"] = 100.0
        group.create_dataset("F1", data=FORCE, chunks=(64,), compression="gzip").attrs["unit"] = "N"
        group.create_dataset("V1", data=SPEED.reshape(1, N).astype("f4"))
        group.create_dataset("slow", data=SLOW).attrs.update({"rate": 7.0, "start": 3.0})
        group.create_dataset("none", data=np.empty(0))
        group.create_dataset("jumpy", data=SLOW).attrs["time"] = "when"
        group.create_dataset("when", data=np.sort(RNG.uniform(0, 12, 77)))


def write_mat(path: Path) -> None:
    with importlib.import_module("h5py").File(path, "w", userblock_size=512) as file:
        table = np.stack([np.arange(N) / 100, FORCE, SPEED])
        for name, values in {"M": table, "F1": FORCE[:, None], "V1": SPEED[None, :], "t": np.arange(N) / 100}.items():
            file.create_dataset(name, data=values if values.ndim > 1 else values[None, :], chunks=True)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def write_mat5(path: Path) -> None:
    savemat(path, {"F1": FORCE, "V1": SPEED, "slow": SLOW, "fs": 100.0})


def write_tdms(path: Path) -> None:
    nptdms = importlib.import_module("nptdms")
    fast, slow = {"wf_increment": 0.01, "unit_string": "N"}, {"wf_increment": 0.1, "wf_start_offset": 0.5}
    scaled = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 0.37}
    scaled |= {"NI_Scale[0]_Linear_Y_Intercept": 1.1, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF, **fast}
    with nptdms.TdmsWriter(path) as file:
        for part in (slice(0, 300), slice(300, 300), slice(300, N)):
            raw = np.round(1000 * SPEED[part]).astype("i2")
            channels = [
                nptdms.ChannelObject("g", "F1", FORCE[part], fast),
                nptdms.ChannelObject("g", "V1", raw, scaled),
            ]
            if part.start == 0:
                channels.append(nptdms.ChannelObject("g", "slow", SLOW, slow))
            file.write_segment(channels)


def write_mdf(path: Path, version: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asammdf = importlib.import_module("asammdf")
        made = asammdf.MDF(version=version)
        times = np.arange(N) * 0.01
        more = {"invalidation_bits": np.arange(N) % 7 == 3} if version >= "4" else {}
        raw = asammdf.Signal(np.arange(N, dtype="u2"), times, name="V1", conversion={"a": 0.25, "b": -3.0}, **more)
        made.append([asammdf.Signal(FORCE, times, name="F1", unit="N"), raw], comment="fast", acq_name="fast")
        made.append([asammdf.Signal(SLOW, np.arange(77) * 0.125 + 1, name="slow")], comment="slow", acq_name="slow")
        made.save(path, overwrite=True, compression=1)
        made.close()


def write_pq(path: Path) -> None:
    frame = pl.DataFrame({"t": np.arange(N) / 100, "F1 [N]": FORCE, "V1": SPEED.astype("f4"), "n": np.arange(N)})
    frame.with_columns(n=pl.when(pl.col("n") % 9 != 4).then("n")).write_parquet(path, row_group_size=300)


def write_famos(path: Path) -> None:
    content, data = b"", FORCE.tobytes() + SLOW.tobytes()
    for name, begin, count, step in (("F1", 0, N, 0.01), ("slow", 8 * N, 77, 0.125)):
        for key, said in {
            "CG": "1,1,1",
            "CD": f"{step},1,1,s,0,0,0",
            "CC": "1,1",
            "CP": "1,8,8,64,0,0,1,0",
            "Cb": f"1,0,1,1,{begin},{8 * count},0,{8 * count},1,0.5,0,",
            "CN": f"0,0,0,{len(name)},{name},0,",
        }.items():
            content += f"|{key},1,{len(said)},{said};".encode()
    path.write_bytes(b"|CF,2,1,1;" + content + b"|CS,1,%d,1," % (len(data) + 2) + data + b";")


WRITERS: dict[str, Callable[[Path], None]] = {
    "csv": write_csv,
    "h5": write_h5,
    "mat": write_mat,
    "mat5": write_mat5,
    "tdms": write_tdms,
    "mf4": lambda path: write_mdf(path, "4.10"),
    "mdf": lambda path: write_mdf(path, "3.30"),
    "pq": write_pq,
    "raw": write_famos,
    "wav": lambda path: wavfile.write(path, 100, np.stack([FORCE, SPEED], 1)),
}
NAMES: dict[str, list[tuple[str, ...]]] = {
    "csv": [("t", "F1", "V1"), ("V1",), ("F1", "F1 [N]")],
    "h5": [("F1", "V1"), ("F1", "slow", "none"), ("jumpy", "F1", "when"), ("none",)],
    "mat": [("F1", "V1"), ("M[:,1]", "M[:,3]"), ("t", "F1")],
    "mat5": [("F1", "V1"), ("F1", "slow")],
    "tdms": [("F1", "V1"), ("slow", "F1")],
    "mf4": [("F1", "V1"), ("F1", "slow"), ("slow",)],
    "mdf": [("F1", "V1"), ("slow", "F1")],
    "wav": [("1", "2"), ("2",)],
    "raw": [("F1",), ("slow", "F1")],
    "pq": [("F1", "V1"), ("n", "t")],
}


def pieces(format_: Format, request: Request, rows: int) -> list[Sequence[Signal]]:
    assert format_.blocks is not None
    return list(format_.blocks(request, rows))


def together(format_: Format, request: Request, rows: int, whole: Sequence[Signal] = ()) -> None:
    """The pieces are what is read at once, which is `whole` if it was read before."""
    whole = whole or format_.read(request)
    found = pieces(format_, request, rows)
    assert found
    assert all(len(piece) == len(whole) for piece in found)
    assert all(any(len(one.samples) for one in piece) for piece in found[1:])
    for at, one in enumerate(whole):
        parts = [piece[at] for piece in found]
        assert all(len(part.samples) <= rows for part in parts)
        assert {(part.name, part.unit, part.rate) for part in parts} == {(one.name, one.unit, one.rate)}
        np.testing.assert_array_equal(np.concatenate([part.samples for part in parts]), one.samples)
        assert parts[0].start == one.start or not len(parts[0].samples)
        if one.time is not None:
            np.testing.assert_array_equal(np.concatenate([part.time for part in parts]), one.time)
        done = 0
        for part in parts:
            if one.rate is not None:
                assert part.start == pytest.approx(one.start + done / one.rate, rel=1e-12)
            done += len(part.samples)


@pytest.fixture(scope="module")
def folder() -> Path:
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@pytest.mark.parametrize("kind", sorted(FORMATS))
@settings(max_examples=3, deadline=None)
@example(rows=2 * N)
@given(rows=st.one_of(st.integers(1, 40), st.integers(41, 2 * N)))
@pytest.mark.sampled(10)
def test_pieces_are_the_whole(folder: Path, kind: str, rows: int) -> None:
    library(kind)
    path = folder / f"a.{kind}"
    if not path.exists():
        WRITERS[kind](path)
    for names in NAMES[kind]:
        together(FORMATS[kind].FORMAT, Request(path, names, "", path.name, LIMIT), rows)


@pytest.mark.parametrize("kind", sorted(FORMATS))
def test_less_memory_is_needed_than_for_the_whole(folder: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    library(kind)
    path = folder / f"a.{kind}"
    if not path.exists():
        WRITERS[kind](path)
    names = NAMES[kind][0]
    least = Request(path, names, "", path.name, 8 * N)
    with pytest.raises(FileError, match=r"needs .* more than"):
        FORMATS[kind].FORMAT.read(least)
    assert sum(len(piece[0].samples) for piece in pieces(FORMATS[kind].FORMAT, least, 50)) == N
    for module in ("tracks", "text"):
        monkeypatch.setattr(f"fourpole.io.formats.{module}.MAX_FILE_BYTES", 100)
    with pytest.raises(FileError, match="more than the 100 bytes allowed"):
        pieces(FORMATS[kind].FORMAT, Request(path, names, "", path.name, LIMIT), 50)


@pytest.mark.parametrize("kind", sorted(FORMATS))
def test_nothing_is_held_back_between_the_pieces(folder: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    library(kind)
    path = folder / f"a.{kind}"
    if not path.exists():
        WRITERS[kind](path)
    blocks = FORMATS[kind].FORMAT.blocks(Request(path, NAMES[kind][0], "", path.name, LIMIT), 100)
    next(blocks)
    before = sys.stdout
    sys.stdout.write("heard\n")
    with pytest.warns(UserWarning, match="seen"):
        warnings.warn("seen", UserWarning, stacklevel=1)
    next(blocks)
    assert sys.stdout is before
    blocks.close()
    assert capsys.readouterr().out == "heard\n"


def test_channels_of_other_rates_go_on_together(folder: Path) -> None:
    library("tdms")
    path = folder / "rates.tdms"
    write_tdms(path)
    done = [0, 0]
    for fast, slow in pieces(tdms.FORMAT, Request(path, ("F1", "slow"), "", "a", LIMIT), 100):
        assert len(slow.samples) <= 11
        ends = [one.start + len(one.samples) / one.rate for one in (fast, slow)]
        if done[1] and done[1] + len(slow.samples) < 77:
            assert abs(ends[0] - ends[1]) <= 0.2
        done = [done[0] + len(fast.samples), done[1] + len(slow.samples)]
    assert done == [N, 77]


def test_a_late_start_or_a_time_that_jumps_ends() -> None:
    def track(time: np.ndarray) -> Track:
        return Track("x", None, len(time), lambda a, b: time[a:b] * 2, time=lambda a, b: time[a:b])

    even = Track("e", None, 50, lambda a, b: np.arange(float(a), b), rate=10.0, start=1e9)
    bare = Track("b", None, 9, lambda a, b: np.arange(float(a), b))
    for time in (np.arange(40.0), np.arange(40.0)[::-1], np.full(40, np.nan), np.zeros(40), RNG.normal(size=40)):
        for rows in (1, 3, 7, 100):
            found = list(in_step([track(time), even, bare], rows))
            assert len(found) <= 200
            for at, whole in enumerate((time * 2, np.arange(50.0), np.arange(9.0))):
                np.testing.assert_array_equal(np.concatenate([one[at].samples for one in found]), whole)


def interleaved(path: Path, *, order: str, count: int, repeats: int, mixed: bool) -> np.ndarray:
    """A TDMS file of one segment, its samples interleaved or one channel after the other."""

    def told(text: str) -> bytes:
        return struct.pack(f"{order}I", len(text)) + text.encode()

    kinds = {"F1": ("f4", 9), "V1": ("i2", 2)}
    meta = struct.pack(f"{order}I", 2)
    for name, (_, code) in kinds.items():
        meta += told(f"/'g'/'{name}'") + struct.pack(f"{order}IIIQI", 20, code, 1, count, 0)
    table = np.zeros(count * repeats, dtype=[(name, order + kind) for name, (kind, _) in kinds.items()])
    table["F1"], table["V1"] = RNG.normal(size=len(table)), RNG.integers(-99, 99, len(table))
    if mixed:
        data = table.tobytes()
    else:
        parts = (table[at : at + count] for at in range(0, len(table), count))
        data = b"".join(part[name].tobytes() for part in parts for name in kinds)
    flags = 2 | 4 | 8 | (32 if mixed else 0) | (64 if order == ">" else 0)
    lead = b"TDSm" + struct.pack("<I", flags) + struct.pack(f"{order}IQQ", 4713, len(meta) + len(data), len(meta))
    path.write_bytes(lead + meta + data)
    return table


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("repeats", [1, 3])
def test_chunks_of_tdms_that_are_interleaved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: str, mixed: bool, repeats: int
) -> None:
    library("tdms")
    table = interleaved(tmp_path / "a.tdms", order=order, count=500, repeats=repeats, mixed=mixed)
    request = Request(tmp_path / "a.tdms", ("V1", "F1"), "", "a", LIMIT)
    for most in (tdms_room._AT_ONCE, 64):
        monkeypatch.setattr(tdms_room, "_AT_ONCE", most)
        speed, force = tdms.FORMAT.read(request)
        np.testing.assert_array_equal(speed.samples, table["V1"])
        np.testing.assert_array_equal(force.samples, table["F1"])
        together(tdms.FORMAT, request, 37)


@pytest.mark.parametrize("version", ["3.30", "4.10", "4.20"])
def test_blocks_of_mdf_are_read_in_parts(tmp_path: Path, version: str) -> None:
    library("mf4")
    path = tmp_path / ("a.mf4" if version >= "4" else "a.mdf")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asammdf = importlib.import_module("asammdf")
        made = asammdf.MDF(version=version, column_storage=version == "4.20")
        times = np.arange(N) * 0.01
        made.append(
            [asammdf.Signal(FORCE, times, name="F1"), asammdf.Signal(np.arange(N, dtype="u1"), times, name="n")]
        )
        made.save(path, overwrite=True)
        made.close()
    request = Request(path, ("F1", "n"), "", "a", LIMIT)
    whole = mdf.FORMAT.read(request)
    np.testing.assert_array_equal(whole[0].samples, FORCE)
    together(mdf.FORMAT, request, 37)


TEXTS = {
    "plain": "t,F1\n" + "".join(f"{i},{i / 7!r}\n" for i in range(200)),
    "blank lines": "t,F1\n" + "".join(f"{i},{i / 7!r}\n" + "\n" * (i % 50 == 9) for i in range(200)) + "\n \n",
    "words": "t,F1\n" + "".join(f"{i},{'NaN' if i % 31 == 5 else repr(i / 7)}\n" for i in range(200)),
    "quotes": "t,F1,note\n"
    + "".join(f"{i},{i},{chr(34) + 'a' + chr(10) + 'b' + chr(34) if i == 120 else 'x'}\n" for i in range(200)),
    "decimal comma": "t;F1\r\n" + "".join(f"{i};{i},25\r\n" for i in range(200)),
    "white space": "t F1\n" + "".join(f" {i}   {i / 7!r}\n" for i in range(200)),
    "CR": "t,F1\r" + "".join(f"{i},{i / 7!r}\r" for i in range(200)),
    "no end": "t,F1\n" + "".join(f"{i},{i / 7!r}\n" for i in range(200)) + "200,1",
    "clock": "t,F1\n" + "".join(f"2024-02-{1 + i // 100:02}T{i % 24:02}:00:00.{i:03},{i}\n" for i in range(200)),
    "midnights": "t,F1\n" + "".join(f"{(i * 5) % 24:02}:{i % 60:02}:00.{i:03},{i}\n" for i in range(200)),
    "midnights and gaps": "t,F1\n"
    + "".join(f"{'' if i % 17 == 3 else f'{(i * 5) % 24:02}:{i % 60:02}:00.{i:03}'},{i}\n" for i in range(200)),
    "day or month": "t,F1\n" + "".join(f"{2 + i // 150:02}/01/2024 10:{i % 60:02}:00,{i}\n" for i in range(200)),
    "month or day": "t,F1\n" + "".join(f"01/{2 + i // 150:02}/2024 10:{i % 60:02}:00,{i}\n" for i in range(200)),
}


@pytest.mark.parametrize("part", [256, 1000, 1 << 20])
@pytest.mark.parametrize("what", sorted(TEXTS))
@pytest.mark.sampled(4)
def test_text_in_parts_is_the_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, part: int) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(TEXTS[what].encode())
    request = Request(path, ("t", "F1"), "", "a.csv", LIMIT)
    whole = text.FORMAT.read(request)
    monkeypatch.setattr(room, "PART", part)
    monkeypatch.setattr(room, "_CHUNK", 30)
    for one, other in zip(whole, text.FORMAT.read(request), strict=True):
        np.testing.assert_array_equal(one.samples, other.samples)
    for rows in (1, 64, 1000):
        together(text.FORMAT, request, rows, whole)
    assert text.FORMAT.survey(path, "a.csv", LIMIT).signals[0].count >= len(whole[0].samples)
    if what == "month or day":
        assert whole[0].samples[150] - whole[0].samples[0] < 2 * 86400


@pytest.mark.parametrize("part", [256, 1 << 20])
@pytest.mark.parametrize("bad", ["150,x", "150", "150,1,2", "150,1e999"])
def test_the_row_that_is_wrong_is_named_when_it_is_reached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: int, bad: str
) -> None:
    monkeypatch.setattr(room, "PART", part)
    path = tmp_path / "a.csv"
    path.write_text(
        "Rig 7\nt,F1\n" + "".join(f"{i},{i}\n\n" if i == 20 else f"{i},{i}\n" for i in range(150)) + bad + "\n1,2\n"
    )
    request = Request(path, ("t", "F1"), "", "a.csv", LIMIT)
    with pytest.raises(TableError, match=r"^a\.csv row 154\b"):
        text.FORMAT.read(request)
    with pytest.raises(TableError, match=r"^a\.csv row 154\b"):
        pieces(text.FORMAT, request, 10)


def test_a_row_with_too_few_cells_is_not_mended_by_one_with_too_many(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,F1,V1\n" + "".join(f"{i},1,2\n" for i in range(50)) + "50,1\n51,1,2,3\n")
    with pytest.raises(TableError, match="row 52: has 2 cells"):
        text.FORMAT.read(Request(path, ("t",), "", "a.csv", LIMIT))


@pytest.mark.parametrize("delimiter", [",", " "])
def test_a_line_without_an_end_is_not_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, delimiter: str) -> None:
    monkeypatch.setattr(room, "PART", 1 << 16)
    path = tmp_path / "a.csv"
    rows = "".join(f"{at}{delimiter}{at}\n" for at in range(20_000))
    path.write_text(f"t{delimiter}F1\n{rows}{'1' * 200_000}{delimiter}2\n")
    with pytest.raises(TableError, match="has a line of more than 65536 bytes"):
        text.FORMAT.read(Request(path, ("F1",), "", "a.csv", LIMIT))
