"""The figure of the operating map: its curves over pressure at constant frequency and preload, and the tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.condition import FREQUENCY, Axis
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import amplitudes_of
from fourpole.fitting.modelfile import MapEntry, ModelFile, map_of
from fourpole.models.operating import Answer, OperatingMap
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.models import heading, model_of, share, steep
from fourpole.plot.names import plain_text
from fourpole.plot.panels import Extent, Marks, band, curve, limit, span, steep_limits
from fourpole.plot.sheet import Sheet, read_sheet, spread
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style, load_dashes, load_marker
from fourpole.quantities import Quantity
from fourpole.study.results import Results

_MOST_COLUMNS = 4
_FREQUENCIES = 3
_GRID = 41
#: Distance of a point from the tested conditions, in half spans, up to which it counts as tested.
_NEAR = 0.02
_PRESSURE, _PRELOAD = q.PRESSURE.head, q.PRELOAD.head
#: Name, unit and scale of an axis as shown.
_SHOWN = {one.head: (one.suffix, 1 / one.scale) for one in (q.PRESSURE, q.TEMPERATURE, q.DEFLECTION_AMPLITUDE)}
#: Tests at an amplitude of the deflection within this ratio of that of a panel are shown.
_ALIKE = 1.2
_Pair: TypeAlias = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class _Panel:
    """The map of one tyre along one axis, with the other axes at constant values; `rank` is that of the first value."""

    entry: MapEntry
    found: OperatingMap
    tyre: int
    along: int
    axes: tuple[Axis, ...]
    held: dict[int, float] = field(default_factory=dict)
    rank: int = 0

    @property
    def amplitude(self) -> float | None:
        """Amplitude of the deflection that is shown [m]: the middle of the tested ones if the map depends on it."""
        tested = self.entry.amplitude
        return None if tested is None else float(np.sqrt(tested[0] * tested[-1]))

    @property
    def column(self) -> str:
        """Head of the column of the abscissa."""
        return self.found.axes.names[self.along]

    def points(self) -> FloatArray:
        """Points (Q, d) along the abscissa within the tested conditions."""
        axes = self.found.axes
        rows = np.tile([self.held.get(at, 0.0) for at in range(len(axes.names))], (_GRID, 1))
        own = axes.points[:, self.along]
        rows[:, self.along] = np.linspace(own.min(), own.max(), _GRID)
        kept = []
        for row in rows:
            far, nearest = axes.outside(row)
            if far <= _NEAR:  # the tests of one setting are not all at quite the same value of it
                kept.append(nearest)
        return np.array(kept).reshape(-1, len(axes.names))

    def tests(self, sheet: Sheet) -> BoolArray:
        """True for tests at the constant values of the panel."""
        mask = sheet.tyre == self.tyre
        for at, value in self.held.items():
            own = sheet.values(self.found.axes.names[at]).tolist()
            mask = mask & np.array([self.axes[at].same(one, value) for one in own], dtype=bool)
        if self.amplitude is not None:
            off = np.abs(np.log(np.maximum(amplitudes_of(sheet.table), 1e-300) / self.amplitude))
            mask = mask & (off <= np.log(_ALIKE))
        return np.asarray(mask)


@dataclass(frozen=True, eq=False)
class _Series:
    """One frequency of a panel: the curve of the map and the tests, for both quantities, in the units of the axes."""

    panel: int
    colour: str
    x: FloatArray
    line: _Pair
    half: _Pair
    at: FloatArray
    values: _Pair
    stds: _Pair


def operating(results: Results, style: Style) -> Figure | None:
    """K2 and C over pressure or, without pressure, the first axis of the map; K' and K'' if K2 and C are unknown."""
    if results.maps is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    known = [entry for entry in results.maps.maps if entry.axes and entry.tyre in sheet.names]
    every = (one for entry in known for one in _panels(entry, sheet, results.maps))
    panels = sorted(every, key=lambda one: (one.rank, one.tyre))
    if not panels:
        return None
    notes, key = Notes(), Key()
    panels = notes.first(panels, _MOST_COLUMNS, "pairs of tyre and condition")
    columns = len(panels)
    pair = (q.K2, q.C) if _has_arm(sheet, panels) else (q.STORAGE, q.LOSS)
    groups = _frequencies(sheet, panels, notes)
    series = [one for at, panel in enumerate(panels) for one in _series(at, panel, sheet, groups, pair, style)]
    grid = Grid.of(2 * columns, columns, panel_height=2.2, style=style)
    for row in range(2):
        extent = Extent(positive=True)
        for one in series:
            extent.add(one.line[row], one.half[row])
            extent.add(one.values[row], one.stds[row])
        for column, panel in enumerate(panels):
            ax = grid.panels[row * columns + column]
            load = _load(panel, sheet)
            for one in series:
                if one.panel == column:
                    _draw(ax, one, row, Marks(one.colour, load_marker(load), dashes=load_dashes(load), joined=False))
            if row == 0:
                heading(ax, sheet, panel.entry.model, panel.tyre, _held(panel), style, columns)
            x = span([one.x for one in series if panels[one.panel].column == panel.column])
            limits, log = steep_limits(extent)
            limit(ax, x, limits, style=style, ticks=6 if columns < 3 else 4)
            if log:
                steep(ax, limits, style)
        notes.cut(extent, steep_limits(extent)[0], style, "band or uncertainty")
    _keys(key, panels, groups, sheet, style)
    _say(notes, panels, pair)
    labels = [quantity.label for quantity in pair]
    figure = grid.finish(key=key, notes=notes, x_label=_label(panels[0].column), y_labels=labels, headings="top")
    for ax, panel in zip(grid.panels[columns:], panels, strict=True):
        ax.set_xlabel(_label(panel.column))
    return figure


def _panels(entry: MapEntry, sheet: Sheet, file: ModelFile) -> list[_Panel]:
    """A panel for each value of the preload; without preload, of the first axis that is not the abscissa."""
    found = map_of(entry)
    names, points = found.axes.names, found.axes.points
    along = names.index(_PRESSURE) if _PRESSURE in names else 0
    others = [at for at in range(len(names)) if at != along]
    axes = tuple(map(file.axis, names))
    panel = _Panel(entry, found, sheet.names.index(entry.tyre), along, axes)
    if panel.amplitude is not None:
        panel = replace(panel, found=replace(found, model=found.model.at_amplitude(panel.amplitude)))
    if not others:
        return [panel]
    first = names.index(_PRELOAD) if _PRELOAD in names and names.index(_PRELOAD) in others else others[0]
    made = []
    for rank, (level, near) in enumerate(_levels(axes[first], points[:, first])):
        # Each further axis has the value of most tests.
        further = {at: _levels(axes[at], points[near, at]) for at in others if at != first}
        commonest = {at: max(found, key=lambda one: int(one[1].sum()))[0] for at, found in further.items()}
        made.append(replace(panel, held={first: level} | commonest, rank=rank))
    return made


def _levels(axis: Axis, values: FloatArray) -> list[tuple[float, BoolArray]]:
    """Distinct values on an axis in rising order, each with a mask of the points that have it."""
    groups = axis.groups(values.tolist())
    return [(float(np.median(values[groups == at])), groups == at) for at in np.unique(groups)]


def _has_arm(sheet: Sheet, panels: Sequence[_Panel]) -> bool:
    """Whether tests and maps both have K2."""
    if not np.any(np.isfinite(sheet.values(q.K2.head))):
        return False
    maps = [panel.found for panel in panels]
    middle = [one.ask(one.axes.points, np.full(len(one.axes.points), np.sqrt(np.prod(one.band)))) for one in maps]
    return all(np.mean(np.isfinite(one.k2)) > 0.5 for one in middle)


def _frequencies(sheet: Sheet, panels: Sequence[_Panel], notes: Notes) -> list[float]:
    """A few frequencies that were tested [Hz], within the bands of the maps."""
    low, high = min(one.found.band[0] for one in panels), max(one.found.band[1] for one in panels)
    tested = [value for value in sheet.frequencies.values if _in_band(value, (low, high))]
    if not tested:
        return list(dict.fromkeys([low, float(np.sqrt(low * high)), high]))
    shown = [tested[at] for at in spread(len(tested), _FREQUENCIES)]
    notes.chosen(len(shown), len(tested), "frequencies")
    return shown


def _in_band(frequency: float, band: tuple[float, float]) -> bool:
    """Whether a frequency lies in a band or is the same as one of its ends."""
    return band[0] <= frequency <= band[1] or any(FREQUENCY.same(frequency, end) for end in band)


def _colours(groups: Sequence[float], style: Style) -> list[str]:
    """Colours of frequencies by their logarithm."""
    places = np.log(groups)
    width = float(np.ptp(places))
    return [style.frequency_colour(float((one - places[0]) / width) if width > 0 else 0.5) for one in places]


def _series(
    at: int, panel: _Panel, sheet: Sheet, groups: Sequence[float], pair: tuple[Quantity, Quantity], style: Style
) -> list[_Series]:
    """The curves of a panel; frequencies outside the map's band have none."""
    scale = _SHOWN.get(panel.column, ("", 1.0))[1]
    points, tests = panel.points(), panel.tests(sheet) & ~sheet.rejected & ~sheet.massed
    frequency = sheet.values(q.FREQUENCY.head)
    low, high = panel.found.band
    made = []
    for group, colour in zip(groups, _colours(groups, style), strict=True):
        if not _in_band(group, panel.found.band) or not len(points):
            continue
        answer = panel.found.ask(points, np.full(len(points), np.clip(group, low, high)))
        lines, stds = _shown(answer, pair)
        mask = tests & (np.abs(frequency - group) <= FREQUENCY.relative * group)
        drawn = [sheet.shown(quantity) for quantity in pair]
        made.append(
            _Series(
                panel=at,
                colour=colour,
                x=points[:, panel.along] * scale,
                line=lines,
                half=(NORMAL_95 * stds[0], NORMAL_95 * stds[1]),
                at=sheet.values(panel.column)[mask] * scale,
                values=(drawn[0][0][mask], drawn[1][0][mask]),
                stds=(drawn[0][1][mask], drawn[1][1][mask]),
            )
        )
    return made


def _shown(answer: Answer, pair: tuple[Quantity, Quantity]) -> tuple[_Pair, _Pair]:
    """Values and standard uncertainties of both quantities in the units of the axes."""
    arm = pair[0] is q.K2
    values = (answer.k2, answer.c) if arm else (answer.stiffness.real, answer.stiffness.imag)
    covariance = answer.arm_covariance if arm else answer.covariance
    first, second = (np.sqrt(covariance[:, at, at]) / pair[at].scale for at in range(2))
    return (values[0] / pair[0].scale, values[1] / pair[1].scale), (first, second)


def _draw(ax: Axes, one: _Series, row: int, marks: Marks) -> None:
    """Draw the curve of the map with its band, and the tests."""
    band(ax, one.x, one.line[row], one.half[row], marks.colour)
    ax.plot(one.x, one.line[row], color=marks.colour, linestyle=marks.dashes, linewidth=1.2, label="_map", zorder=2.0)
    curve(ax, one.at, one.values[row], marks=marks, std=one.stds[row])


def _load(panel: _Panel, sheet: Sheet) -> int:
    """Rank of the panel's preload, which sets its marker."""
    names = panel.found.axes.names
    loads = [value for at, value in panel.held.items() if names[at] == _PRELOAD]
    return sheet.loads.nearest(loads[0]) if loads else 0


def _held(panel: _Panel) -> str:
    """The values of the constant axes, as a heading."""
    return ", ".join(_value_in_words(panel.found.axes.names[at], value) for at, value in panel.held.items())


def _value_in_words(column: str, value: float) -> str:
    """The value of an axis with its name, if that is not obvious, and its unit."""
    name, _, unit = column.removesuffix("]").partition(" [")
    unit, scale = _SHOWN.get(column, ("" if unit == "1" else unit, 1.0))
    named = "" if column == _PRELOAD or column in _SHOWN else f"{name} "
    return plain_text(f"{named}{value * scale:.4g} {unit}".rstrip())


def _label(column: str) -> str:
    """Label of an axis of the map as abscissa."""
    name, _, unit = column.removesuffix("]").partition(" [")
    return f"{plain_text(name)} [{_SHOWN.get(column, (plain_text(unit or '1'), 1.0))[0]}]"


def _keys(key: Key, panels: Sequence[_Panel], groups: Sequence[float], sheet: Sheet, style: Style) -> None:
    """Add the models of the tyres, the frequencies and the band to the key."""
    for tyre, entry in {one.tyre: one.entry for one in sorted(panels, key=lambda one: one.tyre)}.items():
        causal = "" if entry.causal else ", not causal"
        key.line(f"{model_of(sheet, tyre)}{entry.model}{causal}", style.colour(tyre), 2.6)
    for group, colour in zip(groups, _colours(groups, style), strict=True):
        key.line(f"{float(f'{group:.3g}'):.10g} Hz", colour, 2.4)
    key.band(style)


def _say(notes: Notes, panels: Sequence[_Panel], pair: tuple[Quantity, Quantity]) -> None:
    errors = {one.entry.tyre: one.entry.leave_one_out[0] for one in panels}
    known = [share(error) + (f" ({plain_text(tyre)})" if tyre else "") for tyre, error in errors.items() if error]
    if known:
        notes.say(f"leave-one-out error of K* over the conditions: {', '.join(known)}")
    if pair[0] is not q.K2:
        notes.say("no K2 and C: K1 is not known, or no passive arm has this K*")
    moved = sorted({1e3 * one.amplitude for one in panels if one.amplitude is not None})
    if moved:
        notes.say(f"amplitude of the deflection: {', '.join(f'{one:.3g}' for one in moved)} mm, and tests near it")
    notes.say("curves end where the tests do")


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "map",
        "The operating map against the tests",
        "Values of the map over the tested conditions, with their 95 % band, and the tests with their standard "
        "uncertainties; each colour is a frequency.",
        operating,
    ),
)
