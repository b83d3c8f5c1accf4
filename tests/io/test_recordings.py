"""Files that no reader takes are called by their names, with what to do."""

from __future__ import annotations

import bz2
import gzip
import lzma
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fourpole.errors import TableError
from fourpole.io.recordings import format_of

LIMIT = 10**9
TABLE = b"t,F1\n0,1\n1,2\n"


def refused(path: Path) -> str:
    with pytest.raises(TableError) as error:
        format_of(path, max_bytes=LIMIT)
    return str(error.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (gzip.compress(TABLE, mtime=0), "is packed by gzip; unpack it"),
        (bz2.compress(TABLE), "is packed by bzip2; unpack it"),
        (lzma.compress(TABLE), "is packed by xz; unpack it"),
        (pickle.dumps({"F1": [1.0, 2.0]}), "is a pickle of Python, which is never opened"),
        (pickle.dumps(np.zeros(3), protocol=4), "is a pickle of Python, which is never opened"),
        (b"<!DOCTYPE html>\n<html><body>Sign in</body></html>", "is a web page, perhaps one for logging in"),
        (b"\xef\xbb\xbf\n<html lang='de'>", "is a web page"),
        (b"<?xml version='1.0'?>\n<usi:tdm xmlns:usi='x' version='1.0'>", "is a header of DIAdem (.tdm)"),
        (b"<?xml version='1.0'?><a/>", "is XML; export its table as CSV"),
        (b"DIAEXTENDED  {@:ENGLISH\n#BEGINGLOBALHEADER\n", "is a header of DIAdem"),
        (b"PK\x03\x04" + bytes(22) + b"\x05\0\0\0a.tdmpacked", "is a packed recording of DIAdem (.tdm)"),
        (b"{\\rtf1\\ansi t\tF1\n0\t1\n}", "is a document (RTF)"),
        (b"7z\xbc\xaf\x27\x1c\0\4", "is a 7z archive"),
        (b"SQLite format 3\0" + bytes(100), "is a data base (SQLite)"),
    ],
)
def test_a_kind_is_known_by_its_first_bytes(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    assert refused(tmp_path / "a.csv").startswith(f"a.csv: {says}")


@pytest.mark.parametrize(
    ("kind", "says"), [("png", "image (PNG)"), ("jpg", "image (JPEG)"), ("pdf", "is a PDF"), ("svg", "is XML")]
)
def test_a_figure_is_no_recording(tmp_path: Path, kind: str, says: str) -> None:
    Figure(figsize=(1, 1)).savefig(tmp_path / f"a.{kind}")
    assert says in refused(tmp_path / f"a.{kind}")


def test_an_archive_of_recordings_is_no_recording(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as file:
        file.writestr("D1.csv", TABLE)
    assert refused(tmp_path / "a.zip") == "a.zip: is a zip archive; unpack it, and name a file in it"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("a.dxd", "is a recording of Dewesoft"),
        ("a.D7D", "is a recording of Dewesoft"),
        ("a.tdx", "holds the samples of a recording of DIAdem"),
        ("a.dac", "is a recording of nCode; export it from nCode as RPC III or CSV"),
        ("a.s3t", "is a recording of nCode"),
        ("a.bin", "is binary, not text"),
    ],
)
def test_a_binary_file_is_known_by_its_ending(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / name).write_bytes(bytes(range(256)) * 20)
    assert refused(tmp_path / name).startswith(f"{name}: {says}")
    (tmp_path / name).write_bytes(TABLE)
    assert format_of(tmp_path / name, max_bytes=LIMIT).name == "text"
