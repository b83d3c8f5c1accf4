"""HDF5: what h5py wrote comes back, and nothing outside the file is read."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import TableError
from fourpole.io import child as children
from fourpole.io.formats.hdf5 import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

h5py = pytest.importorskip("h5py")
Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
FORCE = np.random.default_rng(1).normal(size=5000)
SPEED = np.random.default_rng(2).normal(size=700).astype("f4")


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["title"] = "Rig 2"
        run = file.create_group("run1")
        run["F1"] = FORCE
        run["F1"].attrs.update({"unit": "N", "rate": 2048.0, "start": 0.25, "note": "front cell"})
        run.create_dataset("V1", data=SPEED, chunks=(100,), compression="gzip", shuffle=True, fletcher32=True)
        run["V1"].attrs.update({"units": np.bytes_("mm/s"), "time": "when"})
        run["when"] = np.arange(700) * 2.0
        run["when"].attrs["unit"] = "ms"
        other = file.create_group("run2")
        other.attrs["sample_rate"] = 100
        other["F1 [kN]"] = FORCE[:10].reshape(1, -1)
        other["V1"] = np.arange(10, dtype="i2")
        more = other.create_group("deeper")
        more["t"] = np.linspace(0, 1, 20)
        more["x"] = np.arange(20.0)
        file["table"] = np.zeros((3, 4))
        file["words"] = np.array([b"a", b"b"])
        file["again"] = h5py.SoftLink("/run2/V1")
    return tmp_path / "a.h5"


def test_the_layout_comes_back(path: Path) -> None:
    assert BEGINS["hdf5"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, "a.h5", LIMIT)
    assert "title: Rig 2" in info.notes
    assert any("table" in note for note in info.notes)
    found = {(one.group, one.name): one for one in info.signals}
    assert set(found) == {
        *(("run1", name) for name in ("F1", "V1", "when")),
        *(("run2", name) for name in ("F1 [kN]", "V1")),
        *(("run2/deeper", name) for name in ("t", "x")),
        ("", "again"),
    }
    force = found["run1", "F1"]
    assert (force.unit, force.rate, force.start, force.count, force.note) == ("N", 2048.0, 0.25, 5000, "front cell")
    assert found["run1", "V1"].duration == pytest.approx(1.398)
    assert found["run2", "F1 [kN]"].unit == "kN"
    assert found["run2", "V1"].rate == 100.0
    signals = FORMAT.read(asked(path, "v1", "F1", group="run1"))
    np.testing.assert_allclose(signals[0].samples, SPEED, rtol=1e-6)
    np.testing.assert_allclose(signals[0].time, np.arange(700) * 2e-3, rtol=1e-12)
    assert (signals[0].unit, signals[0].rate) == ("mm/s", None)
    np.testing.assert_array_equal(signals[1].samples, FORCE)
    assert (signals[1].rate, signals[1].start, signals[1].time) == (2048.0, 0.25, None)
    (load,) = FORMAT.read(asked(path, "F1", group="run2"))
    np.testing.assert_array_equal(load.samples, FORCE[:10])
    (beside,) = FORMAT.read(asked(path, "run2/deeper/x"))
    np.testing.assert_array_equal(beside.time, np.linspace(0, 1, 20))


def test_names_that_are_not_there_or_not_unique(path: Path) -> None:
    with pytest.raises(TableError, match=r"'V1' is in the groups 'run1', 'run2'; say which, as in a\.h5#run1"):
        FORMAT.read(asked(path, "V1"))
    with pytest.raises(TableError, match="no channel 'F2'; did you mean 'F1'"):
        FORMAT.read(asked(path, "F2", group="run1"))
    with pytest.raises(TableError, match="no group 'run3'"):
        FORMAT.read(asked(path, "F1", group="run3"))
    with pytest.raises(TableError, match="'words' holds no numbers"):
        FORMAT.read(asked(path, "words"))


def test_nothing_outside_the_file_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.full(8, 42.0)
    (tmp_path / "secret.bin").write_bytes(np.full(8, 42.0).tobytes())
    layout = h5py.VirtualLayout(shape=(8,), dtype="f8")
    layout[:] = h5py.VirtualSource("secret.h5", "x", shape=(8,))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["ok"] = np.arange(8.0)
        file["link"] = h5py.ExternalLink("secret.h5", "/x")
        file["soft"] = h5py.SoftLink("/folder/x")
        file["folder"] = h5py.ExternalLink("secret.h5", "/")
        file["lost"] = h5py.SoftLink("/nowhere")
        file["round"] = h5py.SoftLink("/round")
        file["up"] = h5py.SoftLink("../../ok")
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("raw", shape=(8,), dtype="f8", external=[(str(tmp_path / "secret.bin"), 0, 64)])
        file["self"] = file["/"]
    info = FORMAT.survey(tmp_path / "a.h5", "a.h5", LIMIT)
    assert [one.name for one in info.signals] == ["ok"]
    for name in ("link", "soft", "virtual", "raw", "lost", "round", "up", "folder"):
        with pytest.raises(TableError, match=rf"a\.h5: channel '{name}' .*(file|nowhere)"):
            FORMAT.read(asked(tmp_path / "a.h5", name))


def test_what_is_declared_and_not_there_is_not_made(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("huge", shape=(10**14,), dtype="f8", chunks=(1024,))
        file.create_dataset("empty", shape=(10**6,), dtype="f8", chunks=(1024,))
        file.create_dataset("chunk", shape=(10**6,), maxshape=(None,), dtype="f8", chunks=(10**8,))
        file["few"] = np.empty(0)
    FORMAT.survey(tmp_path / "a.h5", "a.h5", LIMIT)
    for name in ("huge", "empty", "chunk"):
        with pytest.raises(TableError, match="holds none"):
            FORMAT.read(asked(tmp_path / "a.h5", name))
    (few,) = FORMAT.read(asked(tmp_path / "a.h5", "few"))
    assert len(few.samples) == 0


@pytest.mark.sampled(2)
def test_a_part_that_unpacks_to_more_than_the_memory(
    tmp_path: Path, outcome: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    children.child().close(for_good=False)  # another worker, in which no other test has loaded a library
    monkeypatch.setattr(children, "SPARE", 50_000_000)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        bomb = file.create_dataset("bomb", shape=(1024,), dtype="f8", chunks=(1024,), compression="gzip")
        bomb.id.write_direct_chunk((0,), zlib.compress(bytes(100_000_000), 9))
    about, samples = outcome(tmp_path / "a.h5", "bomb")
    assert not about
    assert "cannot be read as an HDF5 file" in samples


def test_filters_of_others_are_not_loaded(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_chunk((16,))
        plan.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, (1, 2))
        h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((16,)), plan)
    with pytest.raises(TableError, match="filter 32001"):
        FORMAT.read(asked(tmp_path / "a.h5", "x"))


def test_what_is_cut_short_is_refused(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    whole = path.read_bytes()
    other = path.with_name("b.h5")
    for content in (whole[:-2000], whole[: len(whole) // 2], whole[:100], whole[:9], b"t,F1\n0,1\n"):
        other.write_bytes(content)
        for use in (lambda: FORMAT.survey(other, "b.h5", LIMIT), lambda: FORMAT.read(asked(other, "run1/F1"))):
            with pytest.raises(TableError, match=r"^b\.h5: "):
                use()
    assert capfd.readouterr() == ("", "")
