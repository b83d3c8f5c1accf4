"""Figures of the rig as found: its residuals, its shared values, and the gain of an added mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.condition import FREQUENCY, Axis
from fourpole.core.sources import Kind, Role
from fourpole.fitting.rows import keys_of
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.names import counted, plain_text, value_label
from fourpole.plot.panels import Extent, Marks, curve, limit, rejected_tests, rows_of_names, span
from fourpole.plot.sheet import Sheet, floats, grouped, means, read_sheet, texts
from fourpole.plot.spec import FigureSpec
from fourpole.plot.stiffness import phasors, rigs_stated
from fourpole.plot.style import Marker, Style
from fourpole.study.results import Results
from fourpole.study.rig_estimate import RigEstimate, RigFinding, SharedValue

_MOST_RIGS = 4
#: Rule of equal added masses; equal masses have one marker.
_MASS = Axis("added mass", relative=1e-3)
_MASS_MARKERS: tuple[Marker, ...] = ("o", "^", "s", "D", "v", "P")
#: Marker of each finding, whether it is filled, its colour (grey where None), and its label in the key.
_FINDINGS: dict[RigFinding, tuple[Marker, bool, str | None, str]] = {
    RigFinding.FOUND: ("o", True, "#0072B2", "found"),
    RigFinding.NOT_DETERMINED: ("o", False, None, "not determined: as stated"),
    RigFinding.CONTRADICTED: ("D", True, "#D55E00", "contradicts the statement"),
    RigFinding.NOT_CALIBRATED: ("s", False, "#E69F00", "not calibrated: the rig does not fit"),
    RigFinding.UNSTATED: ("D", False, "#D55E00", "not stated: size as written"),
}
_GROUPS = {
    Role.RIG: "rig",
    Role.CHANNEL: "channels",
    Role.RATIO: "ratios that K* needs",
    Role.MASS: "added masses",
    Role.SPECIMEN: "specimens",
}
#: Errors that are shares of a whole, shown in per cent.
_SHARES = (Kind.DRIFT, Kind.GAIN_DRIFT, Kind.CROSSTALK)
#: A value farther than this from its statement [stated standard uncertainties] is shown at the edge with its distance.
_EDGE = 6.0
_ROW = 0.17
_MISFIT = "#D55E00"


@dataclass(frozen=True, eq=False)
class _Tests:
    """The rows of residuals.csv, with the groups of rig, tyre and added mass of each row."""

    rigs: tuple[str, ...]
    rig: np.ndarray
    tyre: np.ndarray
    mass: np.ndarray
    masses: tuple[str, ...]
    frequency: FloatArray
    parts: tuple[FloatArray, FloatArray]
    stds: tuple[FloatArray, FloatArray]
    outlier: BoolArray
    as_stated: tuple[FloatArray, FloatArray]


def residual(results: Results, style: Style) -> Figure | None:
    """Real and imaginary part of F1/V2 - Zr against frequency, a row per rig, a marker per added mass."""
    if q.RESIDUAL_RE.head not in results.residuals.columns:
        return None
    sheet = read_sheet(results)
    tests = _tests(results, sheet)
    known = np.isfinite(tests.parts[0]) & np.isfinite(tests.frequency)
    if not known.any():
        return None
    notes, key = Notes(), Key()
    rigs = [at for at in range(len(tests.rigs)) if np.any(known & (tests.rig == at))]
    rigs = notes.first(rigs, _MOST_RIGS, "rigs are")
    grid = Grid.of(2 * len(rigs), 2, panel_height=2.6 if len(rigs) == 1 else 1.9, style=style)
    estimates = [results.rig_named(tests.rigs[at]) for at in rigs]
    for row, (at, estimate) in enumerate(zip(rigs, estimates, strict=True)):
        here = known & (tests.rig == at)
        for column in (0, 1):
            _residual_panel(grid.panels[2 * row + column], tests, column, here, style, notes, fits=estimate.fits)
        _residual_heading(grid.panels[2 * row], estimate, style)
        if not estimate.fits:
            which = f" of {plain_text(tests.rigs[at])}" if tests.rigs[at] else ""
            notes.say(f"the rig{which} as stated does not fit: its line should be at zero")
    _residual_key(key, tests, sheet, known, style)
    if not all(estimate.fits for estimate in estimates):
        key.line("mean with rig and sensors as stated", _MISFIT, 2.0)
    lacking = int(np.sum(~known))
    if lacking:
        notes.say(f"{counted(lacking, 'test')} {'has' if lacking == 1 else 'have'} no F1 or no V2")
    figure = grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=[""], share_y=False)
    for at, ax in enumerate(grid.panels):
        ax.set_ylabel(f"{('Re', 'Im')[at % 2]} (F1/V2 − Zr) [N s/m]")
    return figure


def _tests(results: Results, sheet: Sheet) -> _Tests:
    """The rows of residuals.csv as arrays."""
    rows = results.residuals
    names = texts(rows, "rig")
    rigs = tuple(dict.fromkeys(names))
    tyre_of = dict(zip(keys_of(sheet.table), sheet.tyre, strict=True))
    masses, mass = grouped(np.nan_to_num(floats(rows, q.ADDED_MASS.head)), _MASS, lambda value, n: f"{value:.{n}g} kg")
    return _Tests(
        rigs=rigs,
        rig=np.array([rigs.index(name) for name in names], dtype=np.int64),
        tyre=np.array([tyre_of.get(key, -1) for key in keys_of(rows)], dtype=np.int64),
        mass=mass,
        masses=masses.labels,
        frequency=floats(rows, q.FREQUENCY.head),
        parts=(floats(rows, q.RESIDUAL_RE.head), floats(rows, q.RESIDUAL_IM.head)),
        stds=(floats(rows, q.RESIDUAL_RE.u_head), floats(rows, q.RESIDUAL_IM.u_head)),
        outlier=floats(rows, q.OUTLIER.head) > 1,
        as_stated=_as_stated(results, sheet),
    )


def _as_stated(results: Results, sheet: Sheet) -> tuple[FloatArray, FloatArray]:
    """F1/V2 - Zr [N s/m] of each row of residuals.csv with rig and sensors as stated; not-a-number if not stated."""
    omega = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    names = np.array(sheet.rigs, dtype=object)
    residuals = np.full(omega.size, np.nan, dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for name, rig in rigs_stated(results, sheet).items():
            if rig is not None and not rig.blocked:
                at = np.flatnonzero(names == name)
                f1, _, v2 = phasors(sheet, rig, at)
                residuals[at] = f1 / v2 - rig.impedance(omega[at], sheet.added[at])
    of_test = dict(zip(keys_of(sheet.table), residuals.tolist(), strict=True))
    rows = np.array([of_test.get(key, np.nan) for key in keys_of(results.residuals)], dtype=complex)
    return rows.real, rows.imag


def _residual_panel(
    ax: Axes, tests: _Tests, column: int, here: BoolArray, style: Style, notes: Notes, *, fits: bool
) -> None:
    """Draw the real part, column 0, or the imaginary part, column 1, of the residuals of one rig."""
    x, y, std = tests.frequency, tests.parts[column], tests.stds[column]
    good = here & ~tests.outlier
    ax.axhline(0.0, color=style.look.ink, linewidth=0.8, zorder=1.0)
    for tyre in np.unique(tests.tyre[good]):
        for mass in np.unique(tests.mass[good & (tests.tyre == tyre)]):
            mask = good & (tests.tyre == tyre) & (tests.mass == mass)
            curve(ax, x[mask], y[mask], marks=_marks(style, int(tyre), int(mass)), std=std[mask])
    rejected_tests(ax, x[here & tests.outlier], y[here & tests.outlier], style=style)
    extent = Extent()
    shown = good if np.any(good) else here
    extent.add(np.append(y[shown], 0.0), np.append(std[shown], 0.0))
    hold = Extent()  # the axes hold bars and zero, as the figure shows whether the bars reach zero
    reach = np.minimum(np.nan_to_num(std[shown]), 5 * np.nanmedian(np.append(std[shown], 0.0)))
    hold.add(np.concatenate([y[shown] - reach, y[shown] + reach, np.zeros(1)]))
    if not fits:
        stated = tests.as_stated[column]
        hold.add(_misfit_line(ax, x[good], (stated if np.any(np.isfinite(stated)) else y)[good]))
    limits = hold.limits()
    limit(ax, span([x[here]]), limits, style=style)
    beyond = int(np.sum(here & tests.outlier & ((y < min(limits)) | (y > max(limits)))))
    if beyond:
        part, verb = ("real", "imaginary")[column], "lies" if beyond == 1 else "lie"
        notes.say(f"the {part} part of {counted(beyond, 'outlier')} {verb} beyond the axes")
    notes.cut(extent, limits, style)


def _misfit_line(ax: Axes, x: FloatArray, y: FloatArray) -> FloatArray:
    """Draw a line through the means of the tests at each frequency; returns the means."""
    _, groups = grouped(x, FREQUENCY, lambda value, n: f"{value:.{n}g}")
    line = means(x, y, groups.tolist())
    ax.plot(*line, color=_MISFIT, linewidth=2.0, label="_misfit", zorder=4.0)
    return line[1]


def _marks(style: Style, tyre: int, mass: int) -> Marks:
    colour = style.colour(tyre) if tyre >= 0 else style.look.muted
    face = colour if mass == 0 else style.look.paper
    return Marks(colour, _MASS_MARKERS[mass % len(_MASS_MARKERS)], face, joined=False)


def _residual_heading(ax: Axes, rig: RigEstimate, style: Style) -> None:
    """Write the name of the rig and chi-square per degree of freedom, in a warning colour if the rig does not fit."""
    parts = [f"rig {plain_text(rig.rig)}"] if rig.rig else []
    if rig.chi2_per_dof is not None:
        parts.append(f"χ²/dof = {rig.chi2_per_dof:.3g} (as stated; {rig.chi2:.4g} / {rig.dof:.4g})")
    if not rig.fits:
        parts.append("does not fit")
    ax.set_title(", ".join(parts), loc="left", pad=4.5, color=style.look.ink if rig.fits else _MISFIT)


def _residual_key(key: Key, tests: _Tests, sheet: Sheet, known: BoolArray, style: Style) -> None:
    """Add tyres, added masses and outliers to the key."""
    key.tyres(sheet, [int(tyre) for tyre in np.unique(tests.tyre[known]) if tyre >= 0], style)
    for mass in np.unique(tests.mass[known]):
        marks = _marks(style, -1, mass)
        key.marker(f"{tests.masses[mass]} added", marks.marker, marks.colour, marks.face or marks.colour)
    key.rejected(style, known & tests.outlier, "test that does not go with the others")


def found(results: Results, style: Style) -> Figure | None:
    """Each shared value as stated and as found, in its stated standard uncertainty; a panel per rig."""
    rigs = [rig for rig in results.rigs if rig.values]
    if not rigs:
        return None
    notes, key = Notes(), Key()
    rigs = notes.first(rigs, _MOST_RIGS, "rigs are")
    grouped_values = [_by_group(rig.values) for rig in rigs]
    most = max(len(groups) + sum(map(len, groups.values())) for groups in grouped_values)
    grid = Grid.of(len(rigs), 1, panel_height=_ROW * (most + 1), style=style)
    for ax, rig, groups in zip(grid.panels, rigs, grouped_values, strict=False):
        _found_panel(ax, groups, style)
        if rig.rig:
            ax.set_title(f"rig {plain_text(rig.rig)}", loc="left", pad=4.5)
        ax.text(1.015, 1.0, "u found /\nu stated", transform=ax.transAxes, va="bottom", fontsize=style.font(7.0),
                color=style.look.muted)  # fmt: skip
    key.line("as stated, ± u", style.look.grid, 5.0)
    present = {value.finding for rig in rigs for value in rig.values}
    for finding, (marker, filled, colour, label) in _FINDINGS.items():
        if finding in present:
            ink = colour or style.look.muted
            key.line(label, ink, marker=marker, markerfacecolor=ink if filled else style.look.paper)
    label = "found less stated, in stated standard uncertainties [1]"
    figure = grid.finish(key=key, notes=notes, x_label=label, y_labels=[""])
    figure.subplots_adjust(left=style.font(1.7) / style.width, right=1 - style.font(0.75) / style.width)
    return figure


def _by_group(values: Sequence[SharedValue]) -> dict[Role, list[SharedValue]]:
    """The values by group; an unstated part, or a value of an unknown kind, stands with the rig's values."""
    groups: dict[Role, list[SharedValue]] = {role: [] for role in _GROUPS}
    for value in values:
        groups[value.source.role if value.source.role in groups else Role.RIG].append(value)
    return {role: members for role, members in groups.items() if members}


def _found_panel(ax: Axes, groups: Mapping[Role, Sequence[SharedValue]], style: Style) -> None:
    """Dots and whiskers from the top down under the names of their groups."""
    labels, reach = [], 1.6
    for group, values in groups.items():
        labels.append((_GROUPS[group], True))
        for value in values:
            reach = max(reach, _dot(ax, len(labels), value, style))
            labels.append((value_label(value.source), False))
    ax.axvline(0.0, color=style.look.ink, linewidth=0.8, zorder=1.0)
    rows_of_names(ax, [text for text, _ in labels])
    for tick, (_, heading) in zip(ax.get_yticklabels(), labels, strict=True):
        tick.set_color(style.look.muted if heading else style.look.ink)
        tick.set_fontsize(7.5)
        tick.set_fontstyle("italic" if heading else "normal")
    edge = min(reach, _EDGE) * 1.06
    ax.set_xlim(style.xlim or (-edge, edge))
    ax.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))


def _dot(ax: Axes, at: int, shared: SharedValue, style: Style) -> float:
    """Draw one value, and return the distance from zero that its marks reach [stated standard uncertainties]."""
    numbers = (shared.stated, shared.found, shared.stated_std, shared.found_std, shared.ratio)
    stated, value, prior, std, ratio = (np.nan if x is None else x for x in numbers)
    if np.isfinite(ratio):
        ax.text(1.015, at, f"{ratio:.2g}", transform=ax.get_yaxis_transform(), va="center", fontsize=style.font(7.0),
                color=style.look.ink)  # fmt: skip
    if shared.finding is RigFinding.UNSTATED and np.isfinite(value):
        marker, _, colour, _ = _FINDINGS[shared.finding]
        ax.plot([0.0], [at], linestyle="none", marker=marker, markersize=5.0, color=colour, zorder=3.0,
                markerfacecolor=style.look.paper, label="_value")  # fmt: skip
        ax.text(0.15, at, _size(shared, value, std), va="center", fontsize=style.font(7.0), color=style.look.ink)
        return 1.0
    if not prior > 0:
        return 0.0
    ax.plot([-1, 1], [at, at], color=style.look.grid, linewidth=5.0, solid_capstyle="butt", label="_stated", zorder=1.5)
    off, wide = (value - stated) / prior, std / prior
    if not np.isfinite(off):
        return 1.0
    marker, filled, colour, _ = _FINDINGS.get(shared.finding, _FINDINGS[RigFinding.NOT_DETERMINED])
    colour = colour or style.look.muted
    beyond = abs(off) > _EDGE
    place = float(np.clip(off, -_EDGE, _EDGE))
    if beyond:
        text = f"{off:+.0f}".replace("-", "−")
        ax.text(
            place - np.sign(off) * 0.25,
            at,
            text,
            va="center",
            ha="right" if off > 0 else "left",
            fontsize=style.font(7.0),
        )
        marker = ">" if off > 0 else "<"
    elif np.isfinite(wide):
        ax.plot([off - wide, off + wide], [at, at], color=colour, linewidth=1.3, label="_found", zorder=2.5)
    ax.plot([place], [at], linestyle="none", marker=marker, markersize=5.0, color=colour, zorder=3.0, label="_value",
            markerfacecolor=colour if filled else style.look.paper)  # fmt: skip
    return abs(place) + (0.0 if beyond or not np.isfinite(wide) else min(wide, _EDGE))


def _size(shared: SharedValue, value: float, std: float) -> str:
    """A value without a statement, with its standard uncertainty and unit."""
    plain = "" if shared.unit == "1" else f" {shared.unit}"
    scale, shown = (100.0, " %") if shared.source.kind in _SHARES else (1.0, plain)
    return f"{scale * value:+.3g} ± {scale * std:.2g}{shown}".replace("-", "−")


def mass_gain(results: Results, style: Style) -> Figure | None:
    """Median relative uncertainty of K2 and C without and with the added mass, a panel per rig."""
    gains = {
        found.rig: {plain_text(name, 12).replace(", K1", ",\nK1"): pair for name, pair in found.mass_gain.items()}
        for found in results.rigs
        if found.mass_gain
    }
    if not gains:
        return None
    notes, key = Notes(), Key()
    shown = notes.first(list(gains.items()), _MOST_RIGS, "rigs are")
    most = max(len(pairs) for _, pairs in shown)
    grid = Grid.of(len(shown), min(2, len(shown)), panel_height=0.25 + 0.5 * most, style=style)
    bars = ((style.look.muted, "without the weighed mass"), (_FINDINGS[RigFinding.FOUND][2] or "", "with it"))
    for ax, (rig, pairs) in zip(grid.panels, shown, strict=True):
        _gain_panel(ax, pairs, [colour for colour, _ in bars], len(shown), style)
        if rig:
            ax.set_title(f"rig {plain_text(rig)}", loc="left", pad=4.5)
    for colour, text in bars:
        key.line(text, colour, 5.0)
    label = "median standard uncertainty of the tests without the mass [%]"
    figure = grid.finish(key=key, notes=notes, x_label=label, y_labels=[""], share_x=False, share_y=False)
    figure.subplots_adjust(left=style.font(0.95) / style.width)  # the names of the rows have two words
    return figure


def _gain_panel(ax: Axes, pairs: dict[str, tuple[float, float]], colours: list[str], panels: int, style: Style) -> None:
    """Draw a pair of bars per quantity, and write the values beside them."""
    most = 100 * max(max(pair) for pair in pairs.values())
    for at, pair in enumerate(pairs.values()):
        for side, (share, colour) in enumerate(zip(pair, colours, strict=True)):
            place = at + (-0.19, 0.19)[side]
            ax.barh(place, 100 * share, height=0.34, color=colour, linewidth=0.0)
            text = f"{100 * share:#.2g}".rstrip(".") + " %" if share < 0.1 else f"{100 * share:.0f} %"
            if side and share < pair[0]:
                text += f", {float(f'{pair[0] / share:.2g}'):g} times smaller"
            ax.text(100 * share + 0.012 * most, place, text, va="center", fontsize=style.font(7.5))
    rows_of_names(ax, list(pairs), 0.5)
    ax.set_xlim(0.0, (1.3 if panels < 2 else 1.6) * most)  # the text beside the longest bar needs room


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "rig-found",
        "The rig and the sensors, as stated and as found",
        "Each value that the tests share, from what is stated of it, in its stated uncertainty; whiskers are the "
        "standard uncertainty after the tests.",
        found,
    ),
    FigureSpec(
        "rig-residual",
        "What the rig leaves unexplained",
        "F1/V2 less the rig's impedance Zr, with the gains found taken out, test by test with standard uncertainties "
        "of the noise: no tyre can explain it, so it should be zero.",
        residual,
        apart=True,
    ),
    FigureSpec(
        "mass-gain",
        "What the weighed mass gained",
        "Median standard uncertainties in the tests without an added mass, from these alone and from all tests.",
        mass_gain,
    ),
)
