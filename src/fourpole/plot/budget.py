"""The figure of the uncertainty budget: shares of the variance by source, the largest first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.sources import Source
from fourpole.fitting.rows import KEY, keyed, keys_of
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series
from fourpole.plot.names import value_label
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.study.study import Study

_QUANTITIES = {one.column: one.name for one in (q.K2, q.C, q.STORAGE, q.LOSS)}
_MOST_TYRES, _MOST_SOURCES = 4, 8
#: Sources with a smaller share in the median of the tests of every specimen are joined [1].
_LEAST = 0.01
#: Least share that the logarithmic axis shows [%].
_FLOOR = 0.1
#: Height of a row, and distance of the specimens in it as a share of the row.
_ROW, _APART = 0.17, 0.17


@dataclass(frozen=True, eq=False)
class _Shares(ByValue):
    """Shares of the variance of one quantity (tests, sources), with the sources and the specimen of each test."""

    sources: tuple[str, ...]
    tyre: np.ndarray
    table: FloatArray


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
    every = {name: _shares(rows.filter(pl.col("quantity") == name)) for name in _QUANTITIES if name in there}
    tyres = sorted(rows["tyre"].unique().to_list())
    notes = ["points: median over the tests, lines: their range; sources below 1 % are joined as others"]
    if len(tyres) > _MOST_TYRES:
        notes.append(f"tests of all {len(tyres)} specimens together")
    panels = [_panel(_QUANTITIES[name], one, tyres) for name, one in every.items()]
    keyed_tyres = tuple(tyres) if 1 < len(tyres) <= _MOST_TYRES else ()
    most = max(len(panel.names) for panel in panels)
    return FigureData(
        tuple(panels), min(2, len(panels)), sheet.labels, keyed=keyed_tyres, notes=tuple(notes), shared=False,
        panel_height=_ROW * (most + 1), left=1.25,
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


def _shares(rows: pl.DataFrame) -> _Shares:
    """The shares of one quantity; a source that a test does not have has the share 0."""
    sources, keys = list(dict.fromkeys(rows["source"].to_list())), keys_of(rows)
    tests = {key: at for at, key in enumerate(dict.fromkeys(keys))}
    table, tyre = np.zeros((len(tests), len(sources))), np.zeros(len(tests), dtype=np.int64)
    lines, columns = [tests[key] for key in keys], [sources.index(one) for one in rows["source"].to_list()]
    np.add.at(table, (lines, columns), rows["share"].to_numpy())
    tyre[lines] = rows["tyre"].to_numpy()
    return _Shares(tuple(sources), tyre, table)


def _panel(name: str, shares: _Shares, tyres: list[int]) -> Panel:
    """The sources of one quantity in falling order, the joined ones last."""
    groups = tyres if len(tyres) <= _MOST_TYRES else [-1]
    masks = {tyre: shares.tyre == tyre if tyre >= 0 else np.ones(shares.tyre.size, dtype=bool) for tyre in groups}
    medians = np.array([np.median(shares.table[mask], axis=0) for mask in masks.values() if mask.any()]).max(axis=0)
    order = [int(at) for at in np.argsort(-medians, kind="stable") if medians[at] >= _LEAST][:_MOST_SOURCES]
    rest = [at for at in range(len(shares.sources)) if at not in order]
    columns = [shares.table[:, at] for at in order] + ([shares.table[:, rest].sum(axis=1)] if rest else [])
    names = [value_label(Source.read(shares.sources[at])) for at in order]
    names += (
        [f"{len(rest)} others" if len(rest) > 1 else value_label(Source.read(shares.sources[rest[0]]))] if rest else []
    )
    series = []
    for place, (tyre, mask) in enumerate(masks.items()):
        if not mask.any():
            continue
        own = [100 * column[mask] for column in columns]
        middle, low, high = (np.array([pick(one) for one in own]) for pick in (np.median, np.min, np.max))
        y = np.arange(len(own)) + _APART * (place - 0.5 * (len(masks) - 1))
        for x_low, x_high, at in zip(low, high, y, strict=True):
            if x_high > _FLOOR:
                ends = np.array([max(x_low, _FLOOR), x_high])
                series.append(Series(Role.LINE, ends, np.full(2, at), tyre=tyre, label=""))
        shown = middle >= _FLOOR
        series.append(Series(Role.POINTS, middle[shown], y[shown], tyre=tyre))
    axis = AxisData("share of the variance", "%", log=True)
    return Panel(axis, AxisData("source", "1"), tuple(series), title=name, names=tuple(names))


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "budget",
        "What is the uncertainty made of?",
        "Shares of the variance of K2, C, K' and K'' by source, the largest first.",
        data=budget,
    ),
)
