"""JSON: what json, polars and pandas write comes back; what is no table, or hostile, is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.json_columns import FORMAT
from fourpole.io.recordings import format_of
from fourpole.io.signals import Request, Signal

Outcome = Callable[[Path, str], list[str]]

LIMIT = 10**9
N = 300
TIME = np.arange(N) / 1000
FORCE = np.random.default_rng(2).normal(size=N)


def read(path: Path, *names: str, most: int = LIMIT) -> list[Signal]:
    return list(FORMAT.read(Request(path, names, "", path.name, most)))


def written(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def by_polars(path: Path) -> None:
    pl.DataFrame({"t": TIME, "F1 [kN]": FORCE}).write_json(path)


def by_polars_in_lines(path: Path) -> None:
    pl.DataFrame({"t": TIME, "F1 [kN]": FORCE}).write_ndjson(path)


def by_pandas(path: Path) -> None:
    """The content of pandas' `DataFrame.to_json` as it is without arguments."""
    columns = {"t": TIME.tolist(), "F1 [kN]": FORCE.tolist()}
    written(path, {key: {str(at): one for at, one in enumerate(values)} for key, values in columns.items()})


def by_pandas_split(path: Path) -> None:
    """The content of pandas' `DataFrame.to_json` with orient="split"."""
    table = np.column_stack([TIME, FORCE]).tolist()
    written(path, {"columns": ["t", "F1 [kN]"], "index": list(range(N)), "data": table})


def by_json(path: Path) -> None:
    columns = {"t": TIME.tolist(), "F1 [kN]": FORCE.tolist()}
    path.write_text(json.dumps({"title": "Rig 2", **columns}, indent=2), encoding="utf-8-sig")


@pytest.mark.parametrize("write", [by_json, by_polars, by_polars_in_lines, by_pandas, by_pandas_split])
def test_columns_come_back(tmp_path: Path, write: Callable[[Path], None]) -> None:
    path = tmp_path / "a.json"
    write(path)
    assert format_of(path, max_bytes=LIMIT) == FORMAT
    (force,) = read(path, "F1")
    np.testing.assert_array_equal(force.samples, FORCE)
    np.testing.assert_array_equal(force.time, TIME)
    assert force.unit == "kN"
    chunks = list(FORMAT.blocks(Request(path, ("f1",), "", "a", LIMIT), 70))
    np.testing.assert_array_equal(np.concatenate([one[0].samples for one in chunks]), FORCE)


def test_rates_units_and_objects_within(tmp_path: Path) -> None:
    run = {"F1": [1, None, 3], "V1": [0.5, float("nan"), True], "names": ["F1", "V1"], "units": ["N", "m/s"]}
    path = written(tmp_path / "a.json", {"fs": 500, "operator": "A. M.", "run": run, "x": [[1, 2], [3, 4], [5, 6]]})
    info = FORMAT.survey(path, "a.json", LIMIT)
    assert [(one.name, one.unit, one.rate, one.count) for one in info.signals] == [
        ("x.1", None, 500.0, 3),
        ("x.2", None, 500.0, 3),
        ("run.F1", "N", 500.0, 3),
        ("run.V1", "m/s", 500.0, 3),
    ]
    assert {"fs: 500.0", "operator: A. M."} <= set(info.notes)
    force, speed, column = read(path, "run.F1", "run.V1", "x.2")
    np.testing.assert_array_equal(force.samples, [1, np.nan, 3])
    np.testing.assert_array_equal(speed.samples, [0.5, np.nan, 1])
    np.testing.assert_array_equal(column.samples, [2, 4, 6])


def test_records_that_lack_a_key_and_lists_by_number(tmp_path: Path) -> None:
    path = written(
        tmp_path / "a.json", [{"t": 0, "F1": 1.5, "who": "me"}, {"t": 1, "V1": 2}, {"t": 2, "F1": 2.5, "V1": 3}]
    )
    force, speed = read(path, "F1", "V1")
    np.testing.assert_array_equal(force.samples, [1.5, np.nan, 2.5])
    np.testing.assert_array_equal(speed.samples, [np.nan, 2, 3])
    np.testing.assert_array_equal(force.time, [0, 1, 2])
    with pytest.raises(TableError, match="there is no channel 'who'"):
        read(path, "who")
    path = written(tmp_path / "a.json", [[0, 1.5], [1, 2.5], [2, 3.5]])
    np.testing.assert_array_equal(read(path, "2")[0].samples, [1.5, 2.5, 3.5])


@pytest.mark.parametrize(
    "content",
    ['{"a": 1, "b": "x"}', "{}", "[]", '["a", "b"]', '[{"a": "x"}, {"a": "y"}]', '{"K1": {"a": 3}}', "[1, [2]]"],
)
def test_what_holds_no_columns_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_text(content, encoding="utf-8")
    with pytest.raises(TableError, match=r"^a\.json: "):
        FORMAT.survey(tmp_path / "a.json", "a.json", LIMIT)


def test_hostile_files_give_one_message(tmp_path: Path, outcome: Outcome) -> None:
    path = tmp_path / "a.json"
    for content in (
        '{"t": ' + "[" * 100_000,
        '[{"t": ' * 50_000,
        '{"t": [0, 1], "F1": [1' + "0" * 5000 + ", 2]}",
        '{"F1": [1' + "0" * 400 + ", 2]}",
        '{"F1": [1, 2',
        '{"F1": [1, 2]}\n{"F1": oops}',
        "[{}" + ", {}" * 100_000 + "]",
    ):
        path.write_text(content, encoding="utf-8")
        assert all(outcome(path, "F1")), content[:20]
    path.write_bytes(b'{"F1": [1, \xff2]}')
    assert all(outcome(path, "F1"))


def test_memory_is_asked_for_before_it_is_used(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", {"F1": [0] * 500_000})
    with pytest.raises(FileError, match=r"needs .* more than"):
        read(path, "F1", most=5_000_000)
