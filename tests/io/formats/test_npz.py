"""NumPy files: what numpy wrote comes back, pickles stay closed, and what an array only declares is never made."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.npz import FORMAT
from fourpole.io.recordings import format_of
from fourpole.io.signals import Request

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 3000
TABLE = np.random.default_rng(2).normal(size=(N, 3))
TIME = np.arange(N) / 1000


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_come_back_by_their_names(tmp_path: Path, save: Callable[..., None]) -> None:
    path = tmp_path / "a.npz"
    save(path, F1=TABLE[:, 0], V1=TABLE[:, 1].astype("f4"), M=TABLE, flat=TABLE[:100].T, fs=500.0, title="Rig 2")
    assert format_of(path, max_bytes=LIMIT) == FORMAT
    info = FORMAT.survey(path, "a.npz", LIMIT)
    found = {one.name: one for one in info.signals}
    assert set(found) == {"F1", "V1", "M.1", "M.2", "M.3", "flat.1", "flat.2", "flat.3"}
    assert {"fs: 500.0", "title: Rig 2"} <= set(info.notes)
    assert (found["F1"].rate, found["F1"].count, found["flat.2"].count) == (500.0, N, 100)
    force, speed, column, row = FORMAT.read(asked(path, "F1", "v1", "M.3", "flat.2"))
    np.testing.assert_array_equal(force.samples, TABLE[:, 0])
    np.testing.assert_array_equal(speed.samples, TABLE[:, 1].astype("f4"))
    np.testing.assert_array_equal(column.samples, TABLE[:, 2])
    np.testing.assert_array_equal(row.samples, TABLE[:100, 1])


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("order", ["C", "F"])
def test_chunks_together_are_the_recording(tmp_path: Path, save: Callable[..., None], order: str) -> None:
    path = tmp_path / "a.npz"
    save(path, M=np.asarray(TABLE, order=order), names=["F1", "V1", "V2"], units=["kN", "mm/s", "m/s"], t=TIME)
    chunks = list(FORMAT.blocks(asked(path, "V2", "F1"), 700))
    assert max(one.samples.size for chunk in chunks for one in chunk) == 700
    for at, column in enumerate((2, 0)):
        np.testing.assert_array_equal(np.concatenate([one[at].samples for one in chunks]), TABLE[:, column])
        np.testing.assert_array_equal(np.concatenate([one[at].time for one in chunks]), TIME)
    assert [one.unit for one in chunks[0]] == ["m/s", "kN"]


@pytest.mark.parametrize("order", ["C", "F"])
def test_the_columns_of_one_array_go_by_their_numbers(tmp_path: Path, order: str) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.asarray(TABLE, order=order))
    assert [one.name for one in FORMAT.survey(path, "a.npy", LIMIT).signals] == ["1", "2", "3"]
    (third,) = FORMAT.read(asked(path, "3"))
    np.testing.assert_array_equal(third.samples, TABLE[:, 2])
    assert (third.rate, third.time) == (None, None)
    np.save(path, TABLE[:, 1])
    (only,) = FORMAT.read(asked(path, "1"))
    np.testing.assert_array_equal(only.samples, TABLE[:, 1])


@pytest.mark.filterwarnings("ignore:Stored array in format")
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_records_have_fields_and_points_in_time(tmp_path: Path, unit: str) -> None:
    kinds = [("when", f"M8[{unit}]"), ("Kraft [N]", ">f4"), ("力", "<i2"), ("pair", "f8", 2), ("who", "U5")]
    table = np.zeros(N, dtype=kinds)
    table["when"] = np.datetime64("2024-02-01T10:00", unit) + (5 * np.arange(N)).astype("m8[ms]")
    table["when"][7] = np.datetime64("NaT")
    table["Kraft [N]"], table["力"] = TABLE[:, 0], np.arange(N)
    np.save(tmp_path / "a.npy", table)
    force, count = FORMAT.read(asked(tmp_path / "a.npy", "Kraft", "力"))
    np.testing.assert_array_equal(force.samples, TABLE[:, 0].astype("f4"))
    np.testing.assert_array_equal(count.samples, np.arange(N))
    assert force.unit == "N"
    expected = 0.005 * np.arange(N)
    expected[7] = np.nan
    np.testing.assert_allclose(force.time, expected, rtol=1e-12)
    np.savez(tmp_path / "b.npz", run=table)
    (same,) = FORMAT.read(asked(tmp_path / "b.npz", "run.力"))
    np.testing.assert_allclose(same.time, expected, rtol=1e-12)


def test_pickles_stay_closed(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "opened",))

    objects = np.array([Trap()], dtype=object)
    np.savez(tmp_path / "a.npz", o=objects, F1=TIME)
    np.save(tmp_path / "a.npy", objects)
    info = FORMAT.survey(tmp_path / "a.npz", "a.npz", LIMIT)
    assert [one.name for one in info.signals] == ["F1"]
    assert "'o' holds Python objects, which are never opened" in info.notes
    with pytest.raises(TableError, match=r"^a\.npy: holds Python objects"):
        FORMAT.survey(tmp_path / "a.npy", "a.npy", LIMIT)
    assert not (tmp_path / "opened").exists()


def test_what_is_not_there_or_too_large(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", F1=np.zeros(2_000_000), z=np.zeros(5, dtype=complex))
    assert (tmp_path / "a.npz").stat().st_size < 100_000
    with pytest.raises(FileError, match=r"needs .* more than"):
        FORMAT.read(asked(tmp_path / "a.npz", "F1", most=2_000_000))
    with pytest.raises(TableError, match="no channel 'F2'; did you mean 'F1'"):
        FORMAT.read(asked(tmp_path / "a.npz", "F2"))
    with pytest.raises(TableError, match="no channel 'z'"):
        FORMAT.read(asked(tmp_path / "a.npz", "z"))


def archived(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return path


def test_hostile_files_give_one_message(tmp_path: Path, outcome: Outcome) -> None:
    held = io.BytesIO()
    np.save(held, TABLE[:, 0])
    whole = held.getvalue()
    lies = [
        whole[:-100],
        whole[:60],
        whole.replace(b"(3000,)", b"(9**9,)"),
        whole.replace(b"(3000,)", b"(3000,1000000,9)")[: len(whole)],
        whole.replace(b"(3000,)", b"(-300,)"),
        whole.replace(b"'<f8'", b"'<f9'"),
        whole[:10] + b"(" * 110 + whole[120:],
        b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + whole[10:],
    ]
    for at, content in enumerate(lies):
        (tmp_path / "b.npy").write_bytes(content)
        assert all(outcome(tmp_path / "b.npy", "1")), at
        assert outcome(archived(tmp_path / "b.npz", F1=content), "F1")[1], at
    path = archived(tmp_path / "c.npz", F1=whole)
    content = path.read_bytes()
    path.write_bytes(content[:-40])
    assert outcome(path, "F1")[1]
