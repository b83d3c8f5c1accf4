"""Which libraries open a file by its path: they are in one list, and a file that is exchanged meanwhile is refused."""

import ctypes
import json
import os
import runpy
import struct
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.io.formats.test_damage import WRITERS
from tests.study.test_formats import as_tydex

from fourpole.errors import FileError
from fourpole.io import door
from fourpole.io.recordings import BEGINS, BY_PATH
from fourpole.io.signals import Request

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[2]
ENDINGS = {"mdf": "mf4", "tdms": "tdms", "hdf5": "h5", "matlab": "mat", "uff": "uff", "wav": "wav", "tydex": "tdx"}
ENDINGS |= {"parquet": "parquet", "text": "csv", "npz": "npz", "arrow": "arrow", "workbook": "xlsx"}
ENDINGS |= {"json_columns": "json", "famos": "raw", "rpc": "rsp", "lvm": "lvm"}
#: Bits of inotify: a file is opened; read or closed, too, since two equal events in a row count as one.
OPENED, READ, CLOSED = 0x20, 0x01, 0x18


def sample(module, folder):
    """A recording of a format."""
    path = folder / f"D1.{ENDINGS[module]}"
    time = np.arange(60) / 100
    table = pl.DataFrame({"t": time, "F1": np.sin(9 * time)})
    if module in ("famos", "rpc", "lvm"):
        path.write_bytes(runpy.run_path(str(ROOT / "fuzz" / "fuzz_readers.py"))[module.upper()])
    elif module == "npz":
        np.savez(path, t=time, F1=np.sin(9 * time))
    elif module == "arrow":
        table.write_ipc(path)
    elif module == "workbook":
        table.write_excel(path)
    elif module == "json_columns":
        path.write_text(json.dumps(table.to_dict(as_series=False)))
    elif module == "tydex":
        as_tydex(path, table.with_columns(V1="F1", V2="F1"))
    elif module == "text":
        table.rename({"t": "t [s]", "F1": "F1 [N]"}).write_csv(path)
    else:
        WRITERS[{"parquet": "pq"}.get(module, ENDINGS[module])](path)
    return path


def read(module, path):
    """Survey a file, and read its first channel, whole and in blocks."""
    reader = import_module(f"fourpole.io.formats.{module}").FORMAT
    info = reader.survey(path, path.name, 10**9)
    request = Request(path, (info.signals[0].name,), info.signals[0].group, path.name, 10**9)
    reader.read(request)
    if reader.blocks is not None:
        list(reader.blocks(request, 10))


class Watched:
    """How often the system opens a file while this is entered."""

    def __init__(self, path):
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._watch = self._libc.inotify_init1(os.O_NONBLOCK)
        assert self._libc.inotify_add_watch(self._watch, os.fsencode(path), OPENED | READ | CLOSED) >= 0

    def count(self):
        try:
            events = os.read(self._watch, 1 << 16)
        except BlockingIOError:
            return 0
        number = at = 0
        while at < len(events):
            _, kind, _, length = struct.unpack_from("=iIII", events, at)
            number += bool(kind & OPENED)
            at += 16 + length
        return number

    def close(self):
        os.close(self._watch)


@pytest.mark.skipif(sys.platform != "linux", reason="another system counts otherwise")
@pytest.mark.parametrize("module", BEGINS)
def test_a_library_opens_a_file_by_its_path_only_if_its_format_is_in_the_list(tmp_path, monkeypatch, module):
    path = sample(module, tmp_path)
    read(module, path)
    watched, opened = Watched(path), []
    true = os.open

    def counted(name, *more, **told):
        opened.append(os.fsdecode(name))
        return true(name, *more, **told)

    monkeypatch.setattr(os, "open", counted)
    try:
        read(module, path)
        by_the_door, count = opened.count(str(path)), watched.count()
    finally:
        watched.close()
    assert by_the_door > 0
    assert (count > by_the_door) == (module in BY_PATH), (count, by_the_door)


@pytest.mark.parametrize("module", BY_PATH)
def test_a_file_that_is_exchanged_before_its_library_opens_it_is_refused(tmp_path, monkeypatch, module):
    path = sample(module, tmp_path)
    (tmp_path / "other").mkdir()
    other = sample(module, tmp_path / "other")
    true = door.open_regular

    def exchanged(name, **settings):
        file = true(name, **settings)
        if Path(name) == path and other.exists():
            other.replace(path)
        return file

    monkeypatch.setattr("fourpole.io.formats.tracks.open_regular", exchanged)
    with pytest.raises(FileError, match="was replaced while it was read"):
        read(module, path)
