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
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import afford, floats
from fourpole.io.formats.tracks import OpenFile, Part, track_format
from fourpole.io.formats.variables import LONGEST_TEXT, MOST_TEXTS, Channel, Node, Variables

_KIND = "a JSON file of columns or records"
#: Largest file [byte], which is read whole, and memory of its content per byte.
_MOST_BYTES, _PER_BYTE = 100_000_000, 20
_DEEPEST = 20


def _content(opened: OpenFile) -> Any:
    """The value that the file holds; a list, if it has one value on each line."""
    size = os.fstat(opened.file.fileno()).st_size
    if size > _MOST_BYTES:
        raise TableError(f"{opened.name}: has {size / 1e6:.4g} MB; save so much as CSV, Parquet or HDF5")
    afford(_PER_BYTE * size, opened.max_bytes, opened.name)
    content = opened.file.read().decode("utf-8-sig")
    try:
        return json.loads(content)
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
        return [json.loads(line) for line in content.splitlines() if line.strip()]


def _columns(records: Sequence[Any]) -> dict[str, Any]:
    """The columns of records: objects by their keys, lists by the number of the column."""
    keys: dict[str, None] = {}
    rows = []
    for one in records:
        row = one if isinstance(one, dict) else dict(enumerate(one, 1)) if isinstance(one, list) else None
        if row is None:
            return {}
        rows.append({str(key): value for key, value in row.items()})
        keys |= dict.fromkeys(rows[-1])
    return {key: [row.get(key) for row in rows] for key in keys}


def _numbers(values: Sequence[Any]) -> NDArray[np.float64] | None:
    """The numbers of a list with not-a-number where it has none; None if it holds anything else."""
    if not all(type(one) in (float, int, bool, type(None)) for one in values):
        return None
    return np.array([np.nan if one is None else one for one in values], dtype=np.float64)


def _matrix(values: Sequence[Any]) -> NDArray[np.float64] | None:
    """The matrix that a list of lists is; None if it is none."""
    rows = [_numbers(one) if isinstance(one, list) else None for one in values]
    if any(one is None for one in rows) or len({len(one) for one in rows if one is not None}) != 1:
        return None
    return np.array(rows)


def _nodes(content: Mapping[str, Any], depth: int) -> Iterator[Node]:
    for name, value in content.items():
        node = Node(name, numbered=(".{}", ".{}"))
        if (
            isinstance(value, dict) and value and all(map(str.isdecimal, value))
        ):  # a column by its rows, as pandas has it
            value = list(value.values())  # noqa: PLW2901 - the same column
        if isinstance(value, dict) and depth < _DEEPEST:
            node.kind, node.dims, node.below = "struct", (1, 1), list(_nodes(value, depth + 1))
        elif isinstance(value, str):
            node.kind, node.value = "text", value if len(value) <= LONGEST_TEXT else None
        elif type(value) in (int, float):
            node.kind, node.dims, node.value = "numbers", (1, 1), float(value)
        elif isinstance(value, list) and value:
            _fill(node, value)
        yield node


def _fill(node: Node, values: list[Any]) -> None:
    """Make a node of a list: numbers, a matrix, texts or records."""
    texts = len(values) <= MOST_TEXTS and all(isinstance(one, str) for one in values)
    samples = None if texts else _numbers(values)
    if texts:
        node.kind, node.below = "cells", [Node("", kind="text", value=one[:LONGEST_TEXT]) for one in values]
    elif samples is None and isinstance(values[0], dict):
        node.kind, node.dims, node.below = "struct", (1, 1), list(_nodes(_columns(values), _DEEPEST))
    else:
        samples = _matrix(values) if samples is None else samples[:, None]
        if samples is not None:
            node.kind, node.dims, node.samples = "numbers", samples.shape, samples


class _Content(Variables):
    """The channels of an open file."""

    format = "JSON"

    def __init__(self, opened: OpenFile) -> None:
        content = _content(opened)
        columns = content if isinstance(content, dict) else _columns(content) if isinstance(content, list) else {}
        super().__init__(opened, list(_nodes(columns, 0)))
        if not self._channels:
            raise TableError(f'{opened.name}: holds no columns of numbers; name a file such as {{"t": [0, 1], ...}}')

    def reader(self, one: Channel, /) -> Part:
        """The function that reads a part of a channel."""
        table: NDArray[np.float64] = one.node.samples
        long = table.shape[0] >= table.shape[1]
        values = table.ravel() if one.column is None else table[:, one.column] if long else table[one.column]
        return lambda first, last: floats(values[first:last], one.name, self._name)


FORMAT = track_format("json_columns", "JSON", (".json", ".jsonl", ".ndjson"), _KIND, _Content, by_library=True)
