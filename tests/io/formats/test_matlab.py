"""MATLAB files: what scipy and h5py wrote comes back, and what a file only declares is never made."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from fourpole.errors import FileError, TableError
from fourpole.io.formats.matlab import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 3000
FORCE = np.random.default_rng(1).normal(size=N)
TABLE = np.random.default_rng(2).normal(size=(N, 3))


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


def cell(*texts: str) -> np.ndarray:
    made = np.empty(len(texts), dtype=object)
    made[:] = texts
    return made


def contents() -> dict[str, object]:
    return {
        "F1": FORCE,
        "fs": 2048.0,
        "title": "Rig 2",
        "data": {
            "F1": FORCE[:100].astype("f4"),
            "time": np.arange(100) / 500.0,
            "more": {"x": np.arange(50, dtype="i2"), "dt": 0.01},
        },
        "M": TABLE,
        "flat": np.ascontiguousarray(TABLE[:100].T),
    }


@pytest.mark.parametrize("packed", [False, True])
def test_vectors_columns_and_fields_come_back(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, contents(), do_compression=packed)
    assert BEGINS["matlab"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, "a.mat", LIMIT)
    assert info.format == "MATLAB 5"
    assert {"fs: 2048.0", "title: Rig 2"} <= set(info.notes)
    found = {one.name: one for one in info.signals}
    assert set(found) == {
        "F1",
        *("data.F1", "data.time", "data.more.x"),
        *(f"M[:,{column}]" for column in (1, 2, 3)),
        *(f"flat[{row},:]" for row in (1, 2, 3)),
    }
    assert (found["F1"].rate, found["F1"].count, found["data.more.x"].rate) == (2048.0, N, 100.0)
    force, field, column, same, row, whole = FORMAT.read(
        asked(path, "F1", "data.F1", "M[:,3]", "M(:,3)", "flat[2,:]", "data.more.X")
    )
    np.testing.assert_array_equal(force.samples, FORCE)
    assert (force.rate, force.time) == (2048.0, None)
    np.testing.assert_allclose(field.samples, FORCE[:100], rtol=1e-6)
    np.testing.assert_array_equal(field.time, np.arange(100) / 500.0)
    np.testing.assert_array_equal(column.samples, TABLE[:, 2])
    np.testing.assert_array_equal(same.samples, TABLE[:, 2])
    np.testing.assert_array_equal(row.samples, TABLE[:100, 1])
    np.testing.assert_array_equal(whole.samples, np.arange(50.0))


def test_a_matrix_with_names_and_units(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    table = np.column_stack([np.arange(N) * 0.5, TABLE[:, :2]])
    savemat(path, {"M": table, "names": cell("t", "F1", "V1"), "units": cell("ms", "N", "m/s")}, oned_as="column")
    force, speed = FORMAT.read(asked(path, "F1", "v1"))
    assert (force.unit, speed.unit) == ("N", "m/s")
    np.testing.assert_array_equal(speed.samples, TABLE[:, 1])
    np.testing.assert_allclose(force.time, np.arange(N) * 0.5e-3, rtol=1e-12)


def test_each_matrix_has_the_times_of_its_own_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    slow, fast = np.arange(N) * 0.5, np.arange(N) * 0.125 + 3.0

    def run(time: np.ndarray, channel: str, at: int) -> dict[str, object]:
        return {"M": np.column_stack([time, TABLE[:, at]]), "names": cell("t", channel), "units": cell("s", "N")}

    savemat(path, {"run1": run(slow, "F1", 0), "run2": run(fast, "F2", 1)}, oned_as="column")
    first, second = FORMAT.read(asked(path, "F1", "F2"))
    np.testing.assert_array_equal(first.time, slow)
    np.testing.assert_array_equal(second.time, fast)
    np.testing.assert_array_equal(second.samples, TABLE[:, 1])


def test_version_7_3(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(where: object, name: str, values: object, kind: str) -> object:
            where[name] = values
            where[name].attrs["MATLAB_class"] = np.bytes_(kind)
            return where[name]

        def text(words: str) -> np.ndarray:
            return np.array([ord(sign) for sign in words], dtype="u2").reshape(-1, 1)

        put(file, "F1", FORCE.reshape(1, -1), "double")
        put(file, "fs", np.array([[2048.0]]), "double")
        put(file, "title", text("Rig 2"), "char")
        put(file, "M", TABLE[:2000].T.astype("f4"), "single")
        refs = file.create_group("#refs#")
        for variable, texts in (("names", ("Fz", "Vz", "Vy")), ("units", ("kN", "m/s", "mm/s"))):
            handles = [put(refs, f"{variable}{at}", text(one), "char").ref for at, one in enumerate(texts)]
            file.create_dataset(variable, data=np.array(handles, dtype=h5py.ref_dtype).reshape(-1, 1))
            file[variable].attrs["MATLAB_class"] = np.bytes_("cell")
        data = file.create_group("data")
        data.attrs["MATLAB_class"] = np.bytes_("struct")
        put(data, "V1", TABLE[:40, :1].T, "double")
        put(data, "t", np.arange(40.0).reshape(1, -1), "double")
        put(file, "when", np.zeros((1, 6), "u4"), "datetime")
        file["away"] = h5py.ExternalLink("secret.h5", "/x")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(head)
    assert BEGINS["matlab"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, "a.mat", LIMIT)
    assert info.format == "MATLAB 7.3"
    assert "title: Rig 2" in info.notes
    assert {(one.name, one.unit, one.count, one.rate) for one in info.signals} == {
        ("F1", None, N, 2048.0),
        ("Fz", "kN", 2000, 2048.0),
        ("Vz", "m/s", 2000, 2048.0),
        ("Vy", "mm/s", 2000, 2048.0),
        ("data.V1", None, 40, None),
        ("data.t", None, 40, None),
    }
    force, speed, inner = FORMAT.read(asked(path, "F1", "Vy", "data.v1"))
    np.testing.assert_array_equal(force.samples, FORCE)
    np.testing.assert_allclose(speed.samples, TABLE[:2000, 2], rtol=1e-6)
    np.testing.assert_array_equal(inner.samples, TABLE[:40, 0])
    np.testing.assert_array_equal(inner.time, np.arange(40.0))
    with pytest.raises(TableError, match="'away' leads to another file"):
        FORMAT.read(asked(path, "away"))


def test_names_that_are_not_there(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", contents())
    with pytest.raises(TableError, match=r"no channel 'data\.F2'; did you mean 'data\.F1'"):
        FORMAT.read(asked(tmp_path / "a.mat", "data.F2"))
    with pytest.raises(TableError, match="has no groups"):
        FORMAT.read(asked(tmp_path / "a.mat", "F1", group="data"))
    with pytest.raises(TableError, match="no channel 'title'"):
        FORMAT.read(asked(tmp_path / "a.mat", "title"))


def test_memory_is_asked_for_before_it_is_used(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"F1": np.zeros(200_000)}, do_compression=True)
    with pytest.raises(FileError, match=r"needs .* more than"):
        FORMAT.read(asked(tmp_path / "a.mat", "F1", most=2_000_000))


@pytest.mark.sampled(2)
def test_a_variable_that_unpacks_to_zeros(tmp_path: Path, outcome: Outcome) -> None:
    savemat(tmp_path / "a.mat", {"F1": np.zeros(200)}, do_compression=True)
    bomb = zlib.compress(bytes(200_000_000), 9)
    whole = (tmp_path / "a.mat").read_bytes()[:128] + struct.pack("<II", 15, len(bomb)) + bomb
    (tmp_path / "b.mat").write_bytes(whole)
    refused = ("cannot be read as a MATLAB file", "declares more than it holds")  # the second where memory is short
    assert all(any(one in said for one in refused) for said in outcome(tmp_path / "b.mat", "F1"))


def nested(depth: int) -> bytes:
    """A variable of cells within cells."""
    head = struct.pack("<IIII", 6, 8, 1, 0) + struct.pack("<IIii", 5, 8, 1, 1) + struct.pack("<II", 1, 0)
    sizes = (len(head) + (8 + len(head)) * below for below in reversed(range(depth)))
    return b"".join(struct.pack("<II", 14, size) + head for size in sizes)


@pytest.mark.sampled(2)
def test_what_is_cut_short_or_lies_is_refused(tmp_path: Path, outcome: Outcome) -> None:
    savemat(tmp_path / "a.mat", {"F1": FORCE})
    whole = (tmp_path / "a.mat").read_bytes()
    rows = 128 + 8 + 16 + 8
    wrong = [
        whole[:-100],
        whole[:200],
        whole[:130],
        whole[:rows] + struct.pack("<ii", 2**30, 2**30) + whole[rows + 8 :],
        whole[:128] + nested(100_000),
    ]
    for content in wrong:
        (tmp_path / "b.mat").write_bytes(content)
        assert all(outcome(tmp_path / "b.mat", "F1"))
    repeated = [
        whole[:rows] + struct.pack("<ii", -1, N) + whole[rows + 8 :],
        whole[:132] + struct.pack("<I", 0xFFFFFF00) + whole[136:],
    ]
    for content in repeated:  # what the header says is also said by the data
        (tmp_path / "b.mat").write_bytes(content)
        (force,) = FORMAT.read(asked(tmp_path / "b.mat", "F1"))
        np.testing.assert_array_equal(force.samples, FORCE)


@pytest.mark.parametrize("compressed", [False, True])
def test_a_tyre_test_rig_with_its_units_in_a_struct(tmp_path: Path, compressed: bool) -> None:
    """Columns of numbers by their names, and `channel.name` and `channel.units` beside them."""
    names, units = ("ET", "FZ", "P", "NFX"), ("sec", "N", "kPa", "none")
    columns = {name: np.random.default_rng(1).normal(size=(6000, 1)).astype("f4") for name in names}
    columns["ET"] = 3.0 + np.arange(6000.0)[:, None] / 100
    channel = {key: np.array(texts, dtype=object)[None, :] for key, texts in (("name", names), ("units", units))}
    more = {"channel": channel, "source": "a rig", "testid": "cornering", "tireid": "radial"}
    savemat(tmp_path / "run1.mat", columns | more, do_compression=compressed)
    info = FORMAT.survey(tmp_path / "run1.mat", "run1.mat", LIMIT)
    assert [(one.name, one.unit, one.count) for one in info.signals] == [
        (name, unit, 6000) for name, unit in zip(names, units, strict=True)
    ]
    assert {(one.start, one.duration, one.note) for one in info.signals[1:]} == {(3.0, 59.99, "time from ET")}
    assert {"source: a rig", "testid: cornering", "tireid: radial"} <= set(info.notes)
    force, pressure = FORMAT.read(Request(tmp_path / "run1.mat", ("FZ", "P"), "", "run1.mat", LIMIT))
    np.testing.assert_array_equal(force.samples, columns["FZ"].ravel())
    np.testing.assert_array_equal(force.time, columns["ET"].ravel())
    assert (force.unit, pressure.unit) == ("N", "kPa")


def test_a_complex_array_is_two_channels(tmp_path: Path) -> None:
    values = np.array([2e5 + 3e4j, 2.1e5 + 4e4j])
    savemat(tmp_path / "a.mat", {"f": np.array([1.0, 2.0]), "K": values, "s": {"Z": values}})
    read = FORMAT.read(asked(tmp_path / "a.mat", "Re K", "Im K"))
    np.testing.assert_array_equal(read[0].samples + 1j * read[1].samples, values)
    found = {one.name for one in FORMAT.survey(tmp_path / "a.mat", "a.mat", LIMIT).signals}
    assert {"Re K", "Im K"} < found
