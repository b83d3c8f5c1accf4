"""The table of previews: a few cycles of each recording, and the loops of the static tests, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.demodulation.preview import BLOCKS, POINTS
from fourpole.core.phasor import SYMBOLS
from fourpole.fitting.rows import KEY
from fourpole.study.table_rows import Analysed

#: The columns of a static test, the loop and its mean, and those of a dynamic test: signal, fit and residual.
LOOP = tuple(one.head for one in (q.DEFLECTION, q.LOAD, q.MEAN_DEFLECTION, q.MEAN_LOAD))
_SHOWN = ("", " fit", " residual")
_TIMES = (q.TIME.head, q.RESIDUAL_TIME.head)
#: Samples and, two for each block, extremes of the residual that a row has room for.
_ROOM = {what: 2 * BLOCKS if what in (q.RESIDUAL_TIME.head, " residual") else POINTS for what in (*_TIMES, *_SHOWN)}
_SIGNALS = {f"{name}{what}": _ROOM[what] for name in SYMBOLS.values() for what in _SHOWN}
#: Room of each column of a dynamic test.
ROOM = {**{name: _ROOM[name] for name in _TIMES}, **_SIGNALS}
#: Types of all columns. An array has not-a-number after its last sample, and where the test has no such channel.
PREVIEW_COLUMNS: dict[str, Any] = {
    q.TEST.head: pl.String,
    **dict.fromkeys(LOOP, pl.List(pl.Float32)),
    **{name: pl.Array(pl.Float32, room) for name, room in ROOM.items()},
}


def preview_table(analysed: Analysed) -> pl.DataFrame:
    """The table previews.parquet: the static tests with a curve, then the points of the dynamic tests.

    Signals are less their mean, in the SI unit of the quantity that each channel recorded. No number becomes a Python
    object on the way, so that the memory is that of the table.
    """
    statics = [one for one in analysed.statics if one.curve is not None]
    seen = [(key, one) for key, one in zip(analysed.keys, analysed.points, strict=True) if one.preview is not None]
    count = len(statics) + len(seen)
    loops = [(*one.curve.loop(), *one.curve.mean_curve()) for one in statics if one.curve is not None]
    arrays = {name: np.full((count, room), np.nan, dtype=np.float32) for name, room in ROOM.items()}
    for at, (_, point) in enumerate(seen, start=len(statics)):
        if (shown := point.preview) is None:
            continue
        _put(arrays[q.TIME.head], at, shown.time)
        _put(arrays[q.RESIDUAL_TIME.head], at, shown.blocks)
        for role, *parts in zip(point.channels, shown.signals, shown.fit, shown.residual, strict=True):
            for what, part in zip(_SHOWN, parts, strict=True):
                _put(arrays[f"{SYMBOLS[role]}{what}"], at, part)
    keys = [{q.TEST.head: one.test.name, q.POINT.head: 1} for one in statics] + [key for key, _ in seen]
    columns = [
        pl.Series(q.TEST.head, [key[q.TEST.head] for key in keys], dtype=pl.String),
        pl.Series(q.POINT.head, [key.get(q.POINT.head, 1) for key in keys], dtype=pl.Int64),
        *(_lists(name, [one[place] for one in loops], count) for place, name in enumerate(LOOP)),
        *(pl.Series(name, array, dtype=PREVIEW_COLUMNS[name]) for name, array in arrays.items()),
    ]
    return pl.DataFrame(columns).select(*KEY, *LOOP, *ROOM)


def _put(array: np.ndarray, at: int, values: np.ndarray) -> None:
    """One row of a column; what it has no room for is left out."""
    room = min(array.shape[1], values.size)
    array[at, :room] = values[:room]


def _lists(name: str, values: Sequence[np.ndarray], count: int) -> pl.Series:
    """A column of lists, without values after the first rows."""
    held = [pl.Series(one.astype(np.float32)) for one in values]
    return pl.Series(name, [*held, *([None] * (count - len(held)))], dtype=pl.List(pl.Float32))
