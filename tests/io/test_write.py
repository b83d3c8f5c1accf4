"""Writing: whole or not at all, and back to the last bit."""

from __future__ import annotations

import math
import os
from pathlib import Path

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.errors import FileError
from fourpole.io.columns import read_columns
from fourpole.io.write import beside, replacing, write_bytes, write_table, write_text


def test_text_as_it_is_and_over_an_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("old")
    write_text(path, "µ = 1\r\n")
    assert path.read_bytes() == "µ = 1\r\n".encode()
    assert list(tmp_path.iterdir()) == [path]


def fail_while_writing(path: Path) -> None:
    with replacing(path) as file:
        file.write(b"half")
        raise RuntimeError("out of ink")


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="out of ink"):
        fail_while_writing(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_errors_name_the_file_by_its_label(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"^results/a\.csv: cannot be written: .*does its folder exist"):
        write_text(tmp_path / "none" / "a.csv", "x", label="results/a.csv")
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match="cannot be written"):
        write_text(tmp_path / "file" / "a.csv", "x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileError, match=r"^folder: cannot be written"):
        write_bytes(tmp_path / "folder", b"x")
    with pytest.raises(FileError, match="cannot be written"):
        write_bytes(tmp_path / "a\0b", b"x")
    with pytest.raises(FileError, match=r"as \.csv or \.parquet"):
        write_table(tmp_path / "a.xlsx", pl.DataFrame({"x": [1]}))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


@pytest.mark.skipif(os.name != "posix", reason="permissions as in POSIX")
def test_others_may_read_it_as_the_umask_says(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        write_text(tmp_path / "a.txt", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o644


def test_null_and_nan_are_blank_in_csv_and_kept_apart_in_parquet(tmp_path: Path) -> None:
    frame = pl.DataFrame({"test": ["S1", None, 'a,"b'], "K1 [N/m]": [1.5, None, math.nan]})
    write_table(tmp_path / "a.csv", frame)
    assert (tmp_path / "a.csv").read_text() == 'test,K1 [N/m]\nS1,1.5\n,\n"a,""b",\n'
    write_table(tmp_path / "a.parquet", frame)
    assert pl.read_parquet(tmp_path / "a.parquet").equals(frame)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.one_of(st.none(), st.floats(allow_infinity=False)), min_size=1, max_size=20))
def test_floats_come_back_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, values: list[float | None]) -> None:
    path = tmp_path_factory.getbasetemp() / "floats.csv"
    rows = range(len(values))
    write_table(path, pl.DataFrame({"row": rows, "x [m]": pl.Series(values, dtype=pl.Float64)}))
    read = read_columns(path, ["x", "row"])
    assert len(read) == len(values)
    for wrote, found in zip(values, read["x"].tolist(), strict=True):
        if wrote is None or math.isnan(wrote):
            assert math.isnan(found)
        else:
            assert math.copysign(1, found) == math.copysign(1, wrote)
            assert found == wrote


def folder_of(path: Path, *names: str) -> None:
    with beside(path) as new:
        new.mkdir()
        for name in names:
            (new / name).write_text("new")
        if not names:
            raise RuntimeError("out of ink")


def test_a_folder_replaces_a_folder_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "tydex"
    folder_of(path, "a", "b")
    with pytest.raises(RuntimeError, match="out of ink"):
        folder_of(path)
    assert sorted(one.name for one in path.iterdir()) == ["a", "b"]
    folder_of(path, "c")
    assert [one.name for one in path.iterdir()] == ["c"]
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_never_replaces_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    folder_of(path, "kept")
    with pytest.raises(FileError, match="cannot be written"):
        write_text(path, "new")
    assert [one.name for one in path.iterdir()] == ["kept"]
    assert list(tmp_path.iterdir()) == [path]
