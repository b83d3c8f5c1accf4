"""The figure of the uncertainty budget: shares of the variance by source, the largest first."""

from __future__ import annotations

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray, IntArray
from fourpole.core.sources import Source
from fourpole.fitting.rows import KEY, keyed, keys_of
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series
from fourpole.plot.names import value_label
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.study.study import Study

_QUANTITIES = {one.column: one.name for one in (q.K2, q.C, q.STORAGE, q.LOSS)}
_MOST_TYRES, _MOST_SOURCES = 4, 8
#: Sources with a smaller share in the median of the tests of every specimen are joined [1].
_LEAST = 0.01
#: Least share that the logarithmic axis shows [%].
_FLOOR = 0.1
#: Height of a row, and distance of the specimens in it as a share of the row.
_ROW, _APART = 0.17, 0.17


def budget(results: Study) -> FigureData | None:
    """Shares of the variance of K2, C, K' and K'' by source, a panel per quantity: median and range of each specimen.

    Sources below 1 % of the variance are joined.
    """
    if q.SHARE.head not in results.budget.columns or "test" not in results.dynamic.columns:
        return None
    sheet = read_sheet(results, texts_only=True)
    rows = _rows(results.budget, sheet)
    if rows.is_empty():
        return None
    there = set(rows["quantity"].to_list())
    tyres = sorted(rows["tyre"].unique().to_list())
    notes = ["points: median over the tests, lines: their range; sources below 1 % are joined as others"]
    if len(tyres) > _MOST_TYRES:
        notes.append(f"tests of all {len(tyres)} specimens together")
    panels = [
        _panel(name, rows.filter(pl.col("quantity") == column), tyres)
        for column, name in _QUANTITIES.items()
        if column in there
    ]
    keyed_tyres = tuple(tyres) if 1 < len(tyres) <= _MOST_TYRES else ()
    most = max(len(panel.names) for panel in panels)
    return FigureData(
        tuple(panels), min(2, len(panels)), sheet.labels, keyed=keyed_tyres, notes=tuple(notes), shared=False,
        panel_height=_ROW * (most + 1), left=1.75,
    )  # fmt: skip


def _rows(table: pl.DataFrame, sheet: Sheet) -> pl.DataFrame:
    """Rows of budget.csv with the tyre and the frequency group of their test; without rejected tests."""
    groups = pl.DataFrame({"tyre": sheet.tyre, "frequency": sheet.frequency, "rejected": sheet.rejected})
    hertz = pl.Series("hertz", sheet.values(q.FREQUENCY.head))
    tests = keyed(sheet.table).select(KEY).hstack([*groups, hertz]).unique(KEY, maintain_order=True)
    kept = tests.filter(~pl.col("rejected") & (pl.col("frequency") >= 0)).drop("rejected")
    share = pl.col(q.SHARE.head).cast(pl.Float64, strict=False).fill_nan(None).clip(lower_bound=0.0).alias("share")
    return (
        keyed(table)
        .select(*KEY, "quantity", "source", share)
        .drop_nulls()
        .filter(pl.col("quantity").is_in(list(_QUANTITIES)))
        .join(kept, on=KEY, how="inner")
    )


def _shares(rows: pl.DataFrame) -> tuple[list[str], IntArray, FloatArray]:
    """Sources, specimen of each test, and shares (tests, sources); 0 where a test does not have a source."""
    sources, keys = rows["source"].unique(maintain_order=True).to_list(), keys_of(rows)
    tests = {key: index for index, key in enumerate(dict.fromkeys(keys))}
    table, tyre = np.zeros((len(tests), len(sources))), np.zeros(len(tests), dtype=np.int64)
    lines, columns = [tests[key] for key in keys], [sources.index(source) for source in rows["source"].to_list()]
    np.add.at(table, (lines, columns), rows["share"].to_numpy())
    tyre[lines] = rows["tyre"].to_numpy()
    return sources, tyre, table


def _panel(name: str, rows: pl.DataFrame, tyres: list[int]) -> Panel:
    """The sources of one quantity in falling order, the joined ones last."""
    sources, tyre_of, table = _shares(rows)
    masks = {tyre: tyre_of == tyre for tyre in tyres}
    if len(tyres) > _MOST_TYRES:
        masks = {-1: np.ones(tyre_of.size, dtype=bool)}
    medians = np.array([np.median(table[mask], axis=0) for mask in masks.values() if mask.any()]).max(axis=0)
    order = [int(at) for at in np.argsort(-medians, kind="stable") if medians[at] >= _LEAST][:_MOST_SOURCES]
    rest = [at for at in range(len(sources)) if at not in order]
    shares, names = table[:, order], [value_label(Source.read(sources[at])) for at in order]
    if rest:
        shares = np.column_stack([shares, table[:, rest].sum(axis=1)])
        names.append(f"{len(rest)} others" if len(rest) > 1 else value_label(Source.read(sources[rest[0]])))
    series = []
    for place, (tyre, mask) in enumerate(masks.items()):
        if not mask.any():
            continue
        own = 100 * shares[mask]
        middle, low, high = np.median(own, axis=0), own.min(axis=0), own.max(axis=0)
        y = np.arange(len(names)) + _APART * (place - 0.5 * (len(masks) - 1))
        for row in np.flatnonzero(high > _FLOOR):
            ends = np.array([max(low[row], _FLOOR), high[row]])
            series.append(Series(Role.LINE, ends, np.full(2, y[row]), tyre=tyre))
        shown = middle >= _FLOOR
        series.append(Series(Role.POINTS, middle[shown], y[shown], tyre=tyre))
    axis = AxisData("share of the variance", "%", log=True)
    return Panel(axis, AxisData("source", "1"), tuple(series), title=name, names=tuple(names))


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"budget": budget}
