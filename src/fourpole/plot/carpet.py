"""Figure 5: load against deflection as a lattice (carpet) plot, a panel per specimen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.checks import Verdict
from fourpole.plot.cards import static_cards
from fourpole.plot.data import AxisData, FigureData, Panel, Place, Role, Series, Tone
from fourpole.plot.names import counted, plain_text
from fourpole.plot.sheet import read_sheet
from fourpole.plot.statics import LoadLine, load_lines
from fourpole.study.study import Study

#: Number of lines of constant deflection, about.
_LEVELS = 6


def load_deflection(results: Study) -> FigureData | None:
    """Curves of constant pressure with an offset in proportion to it, joined by lines of constant deflection."""
    sheet = read_sheet(results)
    lines = load_lines(results, sheet)
    if not lines:
        return None
    notes: list[str] = []
    rejected = results.static.filter(results.static["verdict"] == Verdict.REJECTED)["test"].n_unique()
    missing = len(set(results.static["test"].to_list()) - {line.test for line in lines})
    if rejected:
        count = counted(rejected, "static test")
        notes.append(f"{count} rejected" + (f", {missing} without a curve" if missing else ""))
    grey = sum(line.rejected for line in lines)
    if grey:
        notes.append(f"dotted grey: {grey} curves without K1" if grey > 1 else "dotted grey: a curve without K1")
    tyres, offset, cards = sorted({line.tyre for line in lines}), _Offset.of(lines), static_cards(results)
    several = offset.per_bar > 0
    axes = AxisData("deflection + offset" if several else "deflection", "mm"), AxisData("load", "kN", zero=True)
    panels = []
    for tyre in tyres:
        own = [line for line in lines if line.tyre == tyre]
        own.sort(key=lambda line: (np.isnan(line.pressure), line.pressure))
        series = [_curve(line, own, offset, cards[line.test]) for line in own]
        knots = [line for line in own if np.isfinite(line.pressure) and not line.rejected]
        if several and len({line.pressure for line in knots}) > 1:
            series += _cross_lines(knots, offset)
        panels.append(Panel(*axes, tuple(series), sheet.labels[tyre], "", tyre))
    if several:
        notes.append(f"the offset is {offset.per_bar:.3g} mm per bar above {offset.start:.3g} bar")
        notes.append("each coloured curve is a pressure, each dark line a deflection: read the load at their crossing")
    notes.append("deflection counts from the point of zero load")
    columns = min(3, len(tyres))
    return FigureData(
        tuple(panels), columns, sheet.labels, notes=tuple(notes), aligned=True,
        panel_height=3.4 if len(tyres) <= columns else 2.8,
    )  # fmt: skip


@dataclass(frozen=True)
class _Offset:
    """Shift of a curve [mm] in proportion to its pressure [Pa], which allows interpolation between curves."""

    start: float
    per_bar: float

    @classmethod
    def of(cls, lines: Sequence[LoadLine]) -> _Offset:
        """A shift with a round number of mm per bar; zero if all curves have one pressure."""
        known = [line.pressure * 1e-5 for line in lines if np.isfinite(line.pressure)]
        if not known or max(known) - min(known) < 0.02 * max(known):
            return cls(known[0] if known else 0.0, 0.0)
        reach = max(float(line.deflection.max()) for line in lines)
        raw = reach / (max(known) - min(known))
        size = 10.0 ** np.floor(np.log10(raw))
        steps = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5)
        return cls(min(known), float(size * max(step for step in steps if step * size <= raw)))

    def __call__(self, pressure: float) -> float:
        return self.per_bar * (pressure * 1e-5 - self.start) if np.isfinite(pressure) else 0.0


def _curve(line: LoadLine, own: Sequence[LoadLine], offset: _Offset, card: str) -> Series:
    """The curve of one pressure; the label of the highest one, or of the only one, has the unit."""
    stated = [one for one in own if np.isfinite(one.pressure)]
    if np.isfinite(line.pressure):
        label = f"{line.pressure * 1e-5:.3g}{' bar' if line is stated[-1] else ''}"
    else:
        label = plain_text(line.test, 12)
    return Series(
        Role.LINE, line.deflection + offset(line.pressure), line.load, label=label, place=Place.ABOVE,
        tyre=-1 if line.rejected else line.tyre, dash=2 if line.rejected else 0, tests=(line.test,), cards=(card,),
    )  # fmt: skip


def _cross_lines(lines: Sequence[LoadLine], offset: _Offset) -> list[Series]:
    """Lines of constant deflection, each with a label at the highest pressure that reaches it.

    The label is on the right, or on the left if the curve of the highest pressure ends at a smaller deflection.
    """
    reach = max(float(line.deflection.max()) for line in lines)
    found = []
    for level in _round_levels(reach):
        held = [line for line in lines if line.deflection[0] <= level <= line.deflection[-1]]
        if held:
            x = np.array([level + offset(line.pressure) for line in held])
            y = np.array([float(np.interp(level, line.deflection, line.load)) for line in held])
            place = Place.RIGHT if held[-1] is lines[-1] else Place.LEFT
            found.append(Series(Role.LINE, x, y, label=f"{level:g} mm", place=place, tone=Tone.INK))
    return found


def _round_levels(reach: float) -> list[float]:
    """Round deflections up to a reach, rising."""
    size = 10.0 ** np.floor(np.log10(reach / _LEVELS))
    step = float(size * next(one for one in (1.0, 2.0, 2.5, 5.0, 10.0) if one * size >= reach / _LEVELS))
    return [step * at for at in range(1, int(reach / step) + 1)]


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"fig05": load_deflection}
