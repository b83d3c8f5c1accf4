"""The figure of the uncertainty budget: shares of the variance by source, over frequency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.sources import Kind, Source
from fourpole.fitting.rows import KEY, keyed, keys_of
from fourpole.plot.figure import FigureSpec
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import few_ticks, tyre_heading
from fourpole.plot.rig import value_label
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.plot.style import Style
from fourpole.study.results import Results

_QUANTITIES = {one.column: one.name for one in (q.K2, q.C, q.STORAGE, q.LOSS)}
_MOST_SOURCES = 6
_MOST_TYRES = 3
#: Most cells along frequency; more frequencies than these share cells.
_MOST_CELLS = 24
OTHER = "other"
#: Smallest share of the variance for which a source is named in the key.
_LEAST = 0.005
#: Colours of sources; the sources of one kind have one hue, darker and lighter.
_COLOURS = {
    Source(Kind.NOISE): "#56b4e9",
    Source(Kind.FREQUENCY): "#4d4d4d",
    Source(Kind.GAIN, "F1"): "#e69f00",
    Source(Kind.GAIN, "V1"): "#f3cf80",
    Source(Kind.GAIN, "V2"): "#966700",
    Source(Kind.PHASE, "F1"): "#f0e442",
    Source(Kind.PHASE, "V1"): "#f8f2a1",
    Source(Kind.PHASE, "V2"): "#9c942b",
    Source(Kind.RIG_VALUE, "moving_mass"): "#009e73",
    Source(Kind.RIG_VALUE, "preload_stiffness"): "#66c5ab",
    Source(Kind.RIG_VALUE, "preload_damping"): "#005a42",
    Source(Kind.RIG_VALUE, "preload_loss_factor"): "#a8dccd",
    Source(Kind.RIG_VALUE, "tyre_mass"): "#117733",
    Source(Kind.RIG_VALUE, "frame_stiffness"): "#44aa99",
    Source(Kind.RIG_VALUE, "input_mass"): "#999933",
    Source(Kind.K1_GAP): "#0072b2",
    Source(Kind.K1_FIT): "#003f63",
    Source(Kind.K1_CYCLES): "#6a51a3",
    Source(Kind.K1_ZERO): "#4682b4",
    Source(Kind.K1_GAINS): "#b3aed6",
    Source(Kind.K1_STATED): "#332288",
    Source(Kind.ADDED_MASS): "#cc79a7",
    Source(Kind.RIG_MISFIT): "#d55e00",
}


def source_colour(source: Source, style: Style) -> str:
    """The colour of a source of uncertainty, the same in every figure.

    Examples
    --------
    >>> source_colour(Source(Kind.NOISE), Style()), source_colour(Source(Kind.OTHER, "no such source"), Style())
    ('#56b4e9', '#e3e6e9')
    """
    return _COLOURS.get(replace(source, mass=None, rig=""), style.look.grid)


def budget(results: Results, style: Style) -> Figure | None:
    """Stacked shares of the variance of K2, C, K' and K'' over frequency, a row per quantity, a column per tyre."""
    if q.SHARE.head not in results.budget.columns or "test" not in results.dynamic.columns:
        return None
    sheet = read_sheet(results)
    rows = _rows(results.budget, sheet)
    if rows.is_empty():
        return None
    notes, key = Notes(), Key()
    tyres = sorted(rows["tyre"].unique().to_list())
    columns = tyres if len(tyres) <= _MOST_TYRES else [-1]
    if columns == [-1]:
        notes.say(f"medians over the tests of all {len(tyres)} tyres")
    else:
        notes.say("medians over the tests of a tyre at each frequency")
    quantities = [name for name in _QUANTITIES if name in set(rows["quantity"].to_list())]
    sources = rows.group_by("source").agg(pl.col("share").sum()).sort("share", "source", descending=[True, False])
    some = set(rows.filter(pl.col("share") >= _LEAST)["source"].to_list())
    named = [name for name in sources["source"].to_list() if name in some][:_MOST_SOURCES]
    every = len(sheet.frequencies)
    count = min(every, _MOST_CELLS)
    if count < every:
        notes.say(f"{every} frequencies taken together in {count} groups")
    rows = rows.with_columns((pl.col("frequency") * count // every).alias("cell"))
    grid = Grid.of(len(quantities) * len(columns), len(columns), panel_height=1.25, style=style)
    for at, ax in enumerate(grid.panels):
        row, column = divmod(at, len(columns))
        part = rows.filter(pl.col("quantity") == quantities[row])
        part = part if columns[column] < 0 else part.filter(pl.col("tyre") == columns[column])
        _panel(ax, *_shares(part, named), [*named, OTHER], style)
    for ax, tyre in zip(grid.panels, columns, strict=False):
        if tyre < 0:
            ax.set_title("all tyres", loc="left", pad=4.5)
        else:
            tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), style=style, columns=len(columns))
    _one_abscissa(grid.panels, style)
    for source in map(Source.read, [*named, *([OTHER] if len(some) > len(named) else [])]):
        key.add(Patch(facecolor=source_colour(source, style), edgecolor=style.look.muted, linewidth=0.4),
                value_label(source))  # fmt: skip
    labels = [f"share of {_QUANTITIES[name]} [%]" for name in quantities]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="top")


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


def _shares(rows: pl.DataFrame, named: list[str]) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] of the cells, and median shares (cells, sources) over their tests; the sum of a row is 1.

    The sources that are not named are one source.
    """
    frequency, shares = [], []
    for _, part in rows.sort("cell").group_by("cell", maintain_order=True):
        keys = keys_of(part)
        tests = {key: at for at, key in enumerate(dict.fromkeys(keys))}
        table = np.zeros((len(tests), len(named) + 1))
        columns = [named.index(source) if source in named else len(named) for source in part["source"].to_list()]
        lines = [tests[key] for key in keys]
        np.add.at(table, (lines, columns), part["share"].to_numpy())
        middle = np.median(table, axis=0)
        if middle.sum() <= 0:
            middle = table.mean(axis=0)
        frequency.append(float(np.median(part["hertz"].to_numpy())))
        shares.append(middle / max(float(middle.sum()), 1e-300))
    return np.array(frequency), np.array(shares).reshape(len(frequency), len(named) + 1)


def _panel(ax: Axes, frequency: FloatArray, share: FloatArray, sources: list[str], style: Style) -> None:
    """Draw the stacked shares of one quantity and tyre."""
    ax.set_ylim(0.0, 103.0)  # the bar in the tyre's colour needs the space above 100 %
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2.5, 5, 10]))
    few_ticks(ax, 6)
    ax.set_axisbelow(False)
    ax.grid(visible=False)
    if not frequency.size:
        ax.text(0.5, 0.5, "no value", transform=ax.transAxes, ha="center", va="center", color=style.look.muted)
        return
    edges = _edges(frequency)
    x = np.repeat(edges, 2)[1:-1]
    tops = np.zeros((frequency.size, len(sources) + 1))
    tops[:, 1:] = 100 * np.cumsum(share, axis=1)
    for at, source in enumerate(sources):
        if np.any(share[:, at] > 1e-6):
            low, high = np.repeat(tops[:, at], 2), np.repeat(tops[:, at + 1], 2)
            colour = source_colour(Source.read(source), style)
            ax.fill_between(x, low, high, facecolor=colour, edgecolor=style.look.paper, linewidth=0.5,
                            label=f"_{source}")  # fmt: skip
    ax.set_xlim(edges[0], edges[-1])


def _one_abscissa(panels: list[Axes], style: Style) -> None:
    """Give all panels the abscissa that holds every panel with shares."""
    limits = [ax.get_xlim() for ax in panels if ax.collections]
    if limits:
        low, high = min(low for low, _ in limits), max(high for _, high in limits)
        for ax in panels:
            ax.set_xlim(style.xlim or (low, high))


def _edges(frequency: FloatArray) -> FloatArray:
    """Edges of the cells [Hz], midway between frequencies; an outer cell is symmetric about its frequency."""
    if frequency.size == 1:
        return np.array([0.97 * frequency[0], 1.03 * frequency[0]])
    middle = 0.5 * (frequency[1:] + frequency[:-1])
    return np.concatenate([[2 * frequency[0] - middle[0]], middle, [2 * frequency[-1] - middle[-1]]])


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "budget",
        "What the uncertainty is made of",
        "Shares of the variance of K2, C and K* by source against frequency.",
        budget,
        apart=True,
    ),
)
