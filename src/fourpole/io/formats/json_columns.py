"""JSON: an object of columns, or a list of records, each column a channel.

`{"t": [0, 0.001], "F1": [1.5, 2.5], "fs": 1000}` is an object of columns, which may have further objects within;
`[{"t": 0, "F1": 1.5}, {"t": 0.001, "F1": 2.5}]` is a list of records; so is one such object on each line. Names, units
and times are as `variables` says. `null`, `NaN` and a key that a record lacks are missing values.

References
----------
RFC 8259, "The JavaScript Object Notation (JSON) Data Interchange Format".
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.tracks import Content, OpenFile, track_format
from fourpole.io.formats.variables import stated, table, tracks_in, words_in

#: Largest file [byte], which is read whole.
_MOST_BYTES = 100_000_000


def _value(opened: OpenFile) -> Any:
    """The value that the file holds; a list, if it has one value on each line."""
    content = opened.file.read(_MOST_BYTES + 1).decode("utf-8-sig")
    if len(content) > _MOST_BYTES:
        raise TableError(
            f"{opened.name}: has more than {_MOST_BYTES // 10**6} MB; save so much as CSV, Parquet or HDF5"
        )
    try:
        return json.loads(content)
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
        return [json.loads(line) for line in content.splitlines() if line.strip()]


def _columns(records: Sequence[Any]) -> dict[str, Any]:
    """The columns of records: objects by their keys, lists by the number of the column."""
    rows = [
        one if isinstance(one, dict) else dict(enumerate(one, 1)) for one in records if isinstance(one, dict | list)
    ]
    if len(rows) < len(records):
        return {}
    keys = dict.fromkeys(key for row in rows for key in row)
    return {str(key): [row.get(key) for row in rows] for key in keys}


def _numbers(values: Sequence[Any]) -> NDArray[np.float64] | None:
    """The numbers of a list with not-a-number where it has none; None if it holds anything else."""
    if not all(type(one) in (float, int, bool, type(None)) for one in values):
        return None
    return np.array([np.nan if one is None else one for one in values], dtype=np.float64)


def _variable(value: Any, name: str) -> Any:
    """A value as numbers, a number, texts, a text, or the fields of an object; None if it is none of these."""
    if isinstance(value, dict) and value and all(map(str.isdecimal, value)):  # a column by its rows, as pandas has it
        value = list(value.values())
    if isinstance(value, Mapping):
        return _variables(value, name)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, list) or not value:
        return value if isinstance(value, str) else None
    if any(isinstance(one, str) for one in value) and all(one is None or isinstance(one, str) for one in value):
        return [one or "" for one in value]
    if isinstance(value[0], dict):
        return _variables(_columns(value), name)
    rows = [_numbers(one) if isinstance(one, list) else None for one in value]
    known = [one for one in rows if one is not None]
    matrix = np.array(known) if len(known) == len(rows) and len(set(map(len, known))) == 1 else _numbers(value)
    return None if matrix is None else table(matrix, name)


def _variables(columns: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {key: _variable(value, name) for key, value in columns.items()}


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    value = _value(opened)
    columns = value if isinstance(value, dict) else _columns(value) if isinstance(value, list) else {}
    if {"columns", "data"} <= columns.keys() and isinstance(columns["data"], list):  # as pandas splits a table
        columns = dict(zip(map(str, columns["columns"]), _columns(columns["data"]).values(), strict=False))
    variables = _variables(columns, opened.name)
    tracks = tracks_in(variables, opened.name, (".{}", ".{}"))
    if not tracks:
        raise TableError(f'{opened.name}: holds no columns of numbers; name a file such as {{"t": [0, 1], ...}}')
    return Content("JSON", tracks, stated(variables), words=lambda: words_in(variables))


FORMAT = track_format(
    "json_columns", "JSON", (".json", ".jsonl", ".ndjson"), "a JSON file of columns or records", _content
)
