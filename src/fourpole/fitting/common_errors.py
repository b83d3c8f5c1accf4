"""covariance.parquet: the errors of K* that tests have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.errors import TableError
from fourpole.fitting.rows import Key, keys_of

MOST_BYTES = 2_000_000_000
COVARIANCE = "covariance.parquet"
#: Columns of covariance.parquet.
COVARIANCE_COLUMNS = tuple(
    one.head for one in (q.TEST, q.RIG, q.CONDITION, q.OWN_COVARIANCE, q.SHARED_STORAGE, q.SHARED_LOSS)
)


def joined(
    keys: Sequence[Key], covariance: pl.DataFrame
) -> tuple[FloatArray, FloatArray, np.ndarray, list[tuple[str, int]]]:
    """Own covariance (N, 2, 2), effect of the shared errors (N, 2, p), and number of its K* (N,), for each key.

    Also the rig of each key, and the number of its K* among those of the rig.
    """
    own_name, re_name, im_name = (one.head for one in (q.OWN_COVARIANCE, q.SHARED_STORAGE, q.SHARED_LOSS))
    place = {key: at for at, key in enumerate(keys_of(covariance))}
    part = covariance[[place[key] for key in keys]]
    own = np.array(part[own_name].to_list(), dtype=float).reshape(-1, 2, 2)
    rigs = part["rig"].to_list()
    lengths = {rig: max(map(len, part.filter(pl.col("rig") == rig)[re_name].to_list())) for rig in dict.fromkeys(rigs)}
    starts = dict(zip(lengths, np.cumsum([0, *lengths.values()])[:-1].tolist(), strict=True))
    shared = np.zeros((len(rigs), 2, sum(lengths.values())))
    columns = (part[re_name].to_list(), part[im_name].to_list())
    for at, rig in enumerate(rigs):
        for side, values in enumerate(columns):
            shared[at, side, starts[rig] : starts[rig] + len(values[at])] = values[at]
    numbers: dict[tuple[str, int], int] = {}
    places = list(zip(rigs, part["condition"].to_list(), strict=True))
    condition = np.array([numbers.setdefault(one, len(numbers)) for one in places])
    return own, shared, condition, places


def covariance_of(content: bytes) -> pl.DataFrame:
    """The table of covariance.parquet from its bytes; TableError if another program wrote it."""
    try:
        frame = pl.read_parquet(content)
    except pl.exceptions.PolarsError as error:
        raise TableError(f"{COVARIANCE}: cannot be read ({error}): run fourpole analyse again") from None
    if [name for name in frame.columns if name != q.POINT.head] != list(COVARIANCE_COLUMNS):
        raise TableError(f"{COVARIANCE}: is not one that fourpole wrote: run fourpole analyse again")
    return frame
