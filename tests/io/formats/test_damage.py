"""Damaged files of every format: samples, or one error of ours that names the file; nothing printed, nothing left."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat, wavfile

from fourpole.errors import FileError, TableError
from fourpole.io import child as children
from fourpole.io.child import read_apart
from fourpole.io.convert import Choice, convert
from fourpole.io.formats import arrow, famos, hdf5, matlab, mdf, npz, parquet, tdms, uff, wav
from fourpole.io.look import ChannelSummary, look_at
from fourpole.io.recordings import BEGINS, survey
from fourpole.io.signals import FileInfo, Format, Request, SignalInfo

pytestmark = pytest.mark.thorough

LIMIT = 50_000_000
VALUES = np.random.default_rng(5).normal(size=300)
FORMATS: dict[str, Format] = {
    "wav": wav.FORMAT,
    "tdms": tdms.FORMAT,
    "uff": uff.FORMAT,
    "mat": matlab.FORMAT,
    "h5": hdf5.FORMAT,
    "mf4": mdf.FORMAT,
    "pq": parquet.FORMAT,
    "npz": npz.FORMAT,
    "arrow": arrow.FORMAT,
    "raw": famos.FORMAT,
}
LIBRARIES = {"tdms": "nptdms", "uff": "pyuff", "h5": "h5py", "mf4": "asammdf"}
NAMES = {"wav": "1"}
GROUPS = {"mf4": "0", "tdms": "g", "h5": "g"}


def write_wav(path: Path) -> None:
    wavfile.write(path, 2000, VALUES.astype("f4"))


def write_mat(path: Path) -> None:
    savemat(path, {"F1": VALUES, "s": {"a": VALUES[:20], "n": "text"}, "fs": 100.0}, do_compression=True)


def write_tdms(path: Path) -> None:
    nptdms = importlib.import_module("nptdms")
    with nptdms.TdmsWriter(path) as file:
        for part in (VALUES[:100], VALUES[100:]):
            file.write_segment([nptdms.ChannelObject("g", "F1", part, {"wf_increment": 0.01, "unit_string": "N"})])


def write_uff(path: Path) -> None:
    pyuff = importlib.import_module("pyuff")
    fields = {"func_type": 1, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "id1": "F1", "binary": 0}
    fields |= {"abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": 0.01, "ord_data_type": 4}
    fields |= {"ordinate_spec_data_type": 13, "abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0}
    pyuff.UFF(str(path)).write_sets(pyuff.prepare_58(**fields, data=VALUES, x=np.arange(300) * 0.01))


def write_h5(path: Path) -> None:
    with importlib.import_module("h5py").File(path, "w") as file:
        file.create_dataset("g/F1", data=VALUES, chunks=(100,), compression="gzip")
        file["g/F1"].attrs.update({"unit": "N", "rate": 100.0})


def write_mf4(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asammdf = importlib.import_module("asammdf")
        made = asammdf.MDF(version="4.10")
        made.append(
            [asammdf.Signal(VALUES, np.arange(300) * 0.01, name="F1", unit="N", conversion={"a": 2.0, "b": 1.0})]
        )
        made.save(path, overwrite=True, compression=1)
        made.close()


def write_famos(path: Path) -> None:
    keys = {"CG": "1,1,1", "CD": "0.01,1,1,s,0,0,0", "NT": " 3,11,2018,21,24, 2.5", "CC": "1,1"}
    keys |= {"CP": "1,8,8,64,0,0,1,0", "Cb": "1,0,1,1,0,2400,0,2400,1,0.5,0,", "CR": "1,2,1,1,1,N"}
    keys |= {"CN": "0,0,0,2,F1,0,", "NL": "1252,0x407", "CB": "0,3,run,0,"}
    content = "".join(f"|{key},1,{len(text)},{text};" for key, text in keys.items()).encode()
    path.write_bytes(b"|CF,2,1,1;" + content + b"|CS,1,2402,1," + VALUES.tobytes() + b";")


WRITERS: dict[str, Callable[[Path], None]] = {
    "wav": write_wav,
    "tdms": write_tdms,
    "uff": write_uff,
    "mat": write_mat,
    "h5": write_h5,
    "mf4": write_mf4,
    "raw": write_famos,
    "arrow": lambda path: pl.DataFrame({"t": np.arange(300), "F1": VALUES}).write_ipc(path),
    "npz": lambda path: np.savez_compressed(path, F1=VALUES, M=np.column_stack([VALUES, VALUES]), dt=0.01),
    "pq": lambda path: pl.DataFrame({"t": np.arange(300), "F1": VALUES}).write_parquet(path, row_group_size=100),
}


@pytest.fixture(params=sorted(FORMATS))
def kind(request: pytest.FixtureRequest) -> str:
    found = str(request.param)
    if found in LIBRARIES:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pytest.importorskip(LIBRARIES[found])
    return found


def errors_of(steps: Sequence[Callable[[], object]], path: Path) -> list[Exception]:
    """Our errors, each with a message that names the file."""
    said: list[Exception] = []
    for step in steps:
        try:
            step()
        except (TableError, FileError) as error:
            said.append(error)
    for message in map(str, said):
        assert path.name in message
        assert message.isprintable()
        assert len(message) < 1200
    return said


def use(kind: str, path: Path) -> bool:
    """Whether a file can be read by the reader of this format; if not, our error says so."""
    format_, name = FORMATS[kind], NAMES.get(kind, "F1")
    steps = (
        lambda: format_.survey(path, path.name, LIMIT),
        lambda: format_.read(Request(path, (name,), "", path.name, LIMIT)),
        lambda: format_.blocks and list(format_.blocks(Request(path, (name,), "", path.name, LIMIT), 64)),
    )
    said = errors_of(steps, path)
    assert all(error.__suppress_context__ or error.__context__ is None for error in said)
    return not said


def use_as_commands_do(kind: str, path: Path) -> bool:
    """Whether `info` and `convert` can read a file; if not, our error says so."""
    name, group = NAMES.get(kind, "F1"), GROUPS.get(kind, "")

    def info() -> None:
        found = read_apart(survey, path, classes=(FileInfo, SignalInfo))
        read_apart(
            look_at, path, found, list(range(len(found.signals))), classes=(ChannelSummary,), progress=lambda *_: None
        )

    out = path.with_name("out.csv")
    return not errors_of((info, lambda: convert(path, out, Choice(group, (name,), force=True))), path)


@pytest.mark.sampled(2)
def test_a_cut_or_flipped_file_gives_samples_or_our_error(
    kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(children, "SECONDS", 10.0)
    path, other = tmp_path / f"a.{kind}", tmp_path / f"b.{kind}"
    WRITERS[kind](path)
    capfd.readouterr()
    assert use_as_commands_do(kind, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(7)
    for length in rng.integers(1, len(whole), 4):
        other.write_bytes(whole[:length])
        use_as_commands_do(kind, other)
    for _ in range(8):
        made = bytearray(whole)
        head = len(made) if rng.random() < 0.5 else min(len(made), 400)
        for at in rng.integers(0, head, rng.integers(1, 6)):
            made[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, int(rng.integers(256))])
        other.write_bytes(made)
        use_as_commands_do(kind, other)
    assert capfd.readouterr() == ("", "")


def test_what_is_empty_or_something_else_is_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{kind}"
    for content in (b"", b"\0" * 5000, b"t,F1\n0,1\n", b"PK\x03\x04" + bytes(100), b"\x1f\x8b\x08" + bytes(100)):
        path.write_bytes(content)
        assert not use(kind, path)
    assert not use(kind, tmp_path / f"missing.{kind}")
    assert not use(kind, tmp_path)


def test_each_format_knows_its_own_files_only(kind: str, tmp_path: Path) -> None:
    WRITERS[kind](tmp_path / f"a.{kind}")
    head = (tmp_path / f"a.{kind}").read_bytes()[:4096]
    modules = {"mat": "matlab", "h5": "hdf5", "mf4": "mdf", "pq": "parquet", "raw": "famos"}
    assert [name for name in FORMATS if BEGINS[modules.get(name, name)](head)] == [kind]


def test_a_library_that_is_missing_is_named(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind not in LIBRARIES:
        pytest.skip("needs no further library")
    WRITERS[kind](tmp_path / f"a.{kind}")
    library = LIBRARIES[kind]
    found = importlib.import_module

    def without(name: str, package: str | None = None) -> object:
        if name == library:
            raise ImportError(name)
        return found(name, package)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(
        FileError, match=rf"^a: .* {library}, which is not installed; pip install 'fourpole\[formats\]'"
    ):
        FORMATS[kind].survey(tmp_path / f"a.{kind}", "a", LIMIT)
