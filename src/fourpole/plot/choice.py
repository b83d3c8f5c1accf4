"""The figure of the choice of a model: the candidates of each tyre by three criteria."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.fitting.modelfile import CandidateFile, ModelEntry
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.models import heading
from fourpole.plot.names import plain_text
from fourpole.plot.panels import few_ticks, numbered, rows_of_names, span
from fourpole.plot.sheet import read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style
from fourpole.study.results import Results

#: Difference of BIC within which models are equally good, and difference up to which its axis is linear.
_ALIKE, _LINEAR = 6.0, 10.0
_MOST_CANDIDATES, _MOST_TYRES = 14, 8
_ROW, _MARGIN = 0.17, 0.2


def choice(results: Results, style: Style) -> Figure | None:
    """Candidates by BIC, chi-square per degree of freedom and cross-validation error, a row of panels per tyre."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    entries = [one for one in results.models.models if len(one.candidates) > 1 and one.tyre in sheet.names]
    if not entries:
        return None
    notes, key = Notes(), Key()
    entries = notes.first(entries, _MOST_TYRES, "tyres")
    most = min(max(len(one.candidates) for one in entries), _MOST_CANDIDATES)
    grid = Grid.of(3 * len(entries), 3, panel_height=_ROW * most + _MARGIN, style=style)
    for row, entry in enumerate(entries):
        tyre = sheet.names.index(entry.tyre)
        panels = grid.panels[3 * row : 3 * row + 3]
        _draw_choice(panels, entry, style.colour(tyre), style)
        heading(panels[0], sheet, entry.model, tyre, "", style, 1)
        if len(entry.candidates) > _MOST_CANDIDATES:
            notes.say(f"the best {_MOST_CANDIDATES} models shown")
    _same_abscissa(grid.panels)
    _choice_keys(key, entries, style)
    notes.say("cross-validation error: root mean square over the frequencies, in standard uncertainties")
    if any(one.cross_validation is None for entry in entries for one in entry.candidates[:_MOST_CANDIDATES]):
        notes.say("n: not tried, for the model is far from the best or too few frequencies are left")
    figure = grid.finish(key=key, notes=notes, x_label="", y_labels=[""])
    labels = ("BIC less the best [1]", "chi-square / dof [1]", q.CROSS_VALIDATION.label)
    for ax, label in zip(grid.panels[-3:], labels, strict=True):
        ax.set_xlabel(label)
    # The names of models need a wider margin than numbers.
    figure.subplots_adjust(left=style.font(0.98) / style.width)
    return figure


def _draw_choice(panels: Sequence[Axes], entry: ModelEntry, colour: str, style: Style) -> None:
    """Draw the candidates of one tyre in its three panels."""
    tried = entry.candidates[:_MOST_CANDIDATES]
    least = min(one.bic for one in entry.candidates)
    columns: tuple[list[float | None], ...] = (
        [one.bic - least for one in tried],
        [one.chi2 / max(one.dof, 1) for one in tried],
        [one.cross_validation for one in tried],
    )
    for ax, values in zip(panels, columns, strict=True):
        for place, (one, value) in enumerate(zip(tried, values, strict=True)):
            if value is None:
                ax.text(0.02, place, "n", color=style.look.muted, fontsize=style.font(7.0), va="center",
                        transform=ax.get_yaxis_transform())  # fmt: skip
                continue
            _draw_candidate(ax, value, place, one, colour if one.model == entry.model else "", style)
        rows_of_names(ax, [plain_text(one.model, 12) for one in tried])
    panels[0].axvspan(0.0, _ALIKE, color=style.look.muted, alpha=0.16, linewidth=0.0, label="_alike", zorder=0.5)
    for ax in panels[1:]:
        ax.axvline(1.0, color=style.look.muted, linewidth=0.8, linestyle=(0.0, (4.0, 2.0)), label="_one", zorder=1.1)


def _draw_candidate(
    ax: Axes, value: float, place: int, one: CandidateFile, chosen: str, style: Style
) -> None:  # fmt: skip
    """Draw the criterion of one candidate; `chosen` is the tyre's colour for the chosen model, otherwise empty."""
    colour = chosen or style.look.muted
    size, face, label = (6.5, colour, "_chosen") if chosen else (4.5, style.look.paper, "_candidate")
    ax.plot([value], [place], linestyle="none", marker="o" if one.causal else "^", markersize=size, color=colour,
            markerfacecolor=face, label=label, zorder=3.0, clip_on=False)  # fmt: skip


def _same_abscissa(panels: Sequence[Axes]) -> None:
    """Give each column of panels the same abscissa for all tyres."""
    for column in range(3):
        own = list(panels[column::3])
        seen = np.concatenate(
            [np.asarray(line.get_xdata(), dtype=float) for ax in own for line in ax.lines
             if line.get_label() in ("_chosen", "_candidate")] or [np.ones(1)]
        )  # fmt: skip
        for ax in own:
            if column == 0:
                _from_the_best(ax, float(seen.max()))
            else:
                _about_one(ax, seen[seen > 0])


def _about_one(ax: Axes, values: FloatArray) -> None:
    """Set the abscissa of a criterion that is ideally 1; it is logarithmic if the values span a decade."""
    low, high = min(float(values.min(initial=1.0)), 0.9), max(float(values.max(initial=1.0)), 1.1)
    if high > 10 * low:
        ax.set_xscale("log")
        ax.set_xlim(low / 1.25, high * 1.25)
        numbered(ax, "x", most=4)
    else:
        ax.set_xlim(*span([np.array([low, high])], 0.12))
        few_ticks(ax, 4)


def _from_the_best(ax: Axes, top: float) -> None:
    """Set the abscissa of the difference of BIC: linear up to a limit, logarithmic beyond it."""
    if top > 5 * _LINEAR:
        ax.set_xscale("symlog", linthresh=_LINEAR, linscale=0.8)
        ax.set_xlim(-0.6, 1.6 * top)
        decades = [10.0**power for power in range(1, int(np.log10(top)) + 1)]
        ax.set_xticks([0.0, *decades[:: -(-len(decades) // 4)]])
        ax.minorticks_off()
    else:
        ax.set_xlim(-0.03 * max(top, _LINEAR), 1.1 * max(top, _LINEAR))
        few_ticks(ax, 4)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _choice_keys(key: Key, entries: Sequence[ModelEntry], style: Style) -> None:
    """Add the marks of candidates to the key."""
    look = style.look
    key.marker("chosen, in the tyre's colour", "o", look.muted, look.muted, markersize=6.5)
    key.marker("causal", "o", look.muted, look.paper, markersize=4.5)
    if any(not one.causal for entry in entries for one in entry.candidates[:_MOST_CANDIDATES]):
        key.marker("not causal", "^", look.muted, look.paper, markersize=4.5)
    key.add(Patch(facecolor=style.look.muted, alpha=0.3, linewidth=0.0), f"alike: BIC within {_ALIKE:g} of the best")


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "model-choice",
        "Which model, and why",
        "Models that were tried on each tyre, the best first: BIC less the best, chi-square per degree of freedom, and "
        "the cross-validation error over the frequencies.",
        choice,
    ),
)
