"""The figure of rides: spectra of the acceleration with their bands, or acceleration and wheel load over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series
from fourpole.plot.drawn import figure_of
from fourpole.plot.figure import figure_bytes
from fourpole.plot.style import Style, drawing
from fourpole.ride.comfort import weighting
from fourpole.ride.compare import RideComparison

#: Key of the figure in its files, and its title.
KEY, TITLE = "ride", "Ride"
#: Largest number of tyres that are drawn, of points of a curve, and range of spectra that is shown.
_MOST, _POINTS, _DECADES = 6, 5000, 1e-3
#: Length of a ride that is shown whole, and of the part that is shown of a longer one [s].
_WHOLE, _PART = 6.0, 3.0
#: Share of the largest weighted acceleration until which a short ride is shown.
_LEFT = 0.005
_FREQUENCY = AxisData("frequency", "Hz", log=True)
_TIME = AxisData("time", "s")


def ride_figure(found: RideComparison, labels: Sequence[str], notes: Sequence[str] = ()) -> FigureData:
    """The rides as data: of spectra where the road has one, otherwise over time."""
    shown = list(range(min(len(labels), _MOST)))
    left_out = [f"{len(shown)} of {len(labels)} tyres shown"] if len(shown) < len(labels) else []
    part, said = (slice(None), "") if found.spectra else _shown_part(found)
    left_out += filter(None, [said])
    panels = _spectra(found, shown) if found.spectra else _series(found, shown, part)
    return FigureData(
        panels=panels, columns=1 if found.series else 2, names=tuple(labels), keyed=tuple(shown),
        notes=(*notes, *left_out), panel_height=2.0 if found.series else 3.0, shared=False,
    )  # fmt: skip


def _spectra(found: RideComparison, shown: Sequence[int]) -> tuple[Panel, ...]:
    """Spectra of the acceleration, as it is and weighted, with the bands that the model's uncertainty gives them."""
    plain: list[Series] = []
    weighted: list[Series] = []
    for at in shown:
        one, std = found.spectra[at]
        weight = np.abs(weighting(one.frequency)) ** 2
        for series, factor in ((plain, np.ones(weight.size)), (weighted, weight)):
            y = one.spectrum * factor
            there = y > _DECADES * y.max()
            series.append(
                Series(Role.MODEL, one.frequency[there], y[there], NORMAL_95 * (std * factor)[there], tyre=at)
            )
    names = (("acceleration at the seat", plain), ("weighted by Wk", weighted))
    ordinate = AxisData("spectrum", "m²/s³", log=True)
    return tuple(Panel(_FREQUENCY, ordinate, tuple(series), title=name) for name, series in names)


def _shown_part(found: RideComparison) -> tuple[slice, str]:
    """The samples to show, and what is said of those left out.

    Of a short ride all until hardly any acceleration is left; of a longer one those about the largest acceleration.
    """
    one = found.series[0]
    count, wanted = one.weighted.size, round(_PART / one.step)
    if count * one.step <= _WHOLE:
        moves = np.max([np.abs(each.weighted) for each in found.series], axis=0)
        end = 1 + int(np.flatnonzero(moves >= _LEFT * moves.max())[-1])
        return slice(0, end), f"until {100 * _LEFT:g} % of the largest is left" if end < count else ""
    first = int(np.argmax(np.abs(one.weighted))) - wanted // 2
    first = min(max(first, 0), count - wanted)
    return slice(first, first + wanted), f"the {_PART:g} s about the largest weighted acceleration of the first tyre"


def _series(found: RideComparison, shown: Sequence[int], part: slice) -> tuple[Panel, ...]:
    """Weighted acceleration and dynamic load of the first wheel over time."""
    acceleration, load = [], []
    for at in shown:
        one = found.series[at]
        time = one.step * np.arange(one.weighted.size)
        time, weighted, force = (_thinned(each[part]) for each in (time, one.weighted, one.load[0]))
        acceleration.append(Series(Role.LINE, time, weighted, tyre=at))
        load.append(Series(Role.LINE, time, force / 1e3, tyre=at))
    return (
        Panel(_TIME, AxisData("weighted acceleration", "m/s²", signed=True), tuple(acceleration)),
        Panel(_TIME, AxisData("dynamic wheel load", "kN", signed=True), tuple(load)),
    )


def _thinned(values: FloatArray) -> FloatArray:
    """Values with as many points as a figure shows."""
    return values[:: -(-values.size // _POINTS)]


def ride_figure_bytes(data: FigureData, form: str, style: Style | None = None) -> bytes:
    """The content of a file of the figure, as svg, png or pdf; CampaignError for another format."""
    look = style or Style()
    with drawing(look, KEY):
        return figure_bytes(figure_of(data, look), KEY, TITLE, form, look)
