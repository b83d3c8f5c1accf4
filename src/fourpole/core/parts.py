"""Parts of a load curve: the tangent at a load from the part with the smallest uncertainty of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from fourpole.core.arrays import FloatArray
from fourpole.core.branches import levels
from fourpole.core.meancurve import MeanCurve, fit_mean_curve
from fourpole.errors import LoadCurveError

#: A measured load may lie on the mean of the branches up to this share of the span beyond the fitted deflections.
_EDGE = 0.02
#: Parts of the span round a load that are tried for the tangent; the least number of points on each branch there, and
#: of twentieths of the part in which these lie.
_PARTS, _FEWEST_IN_PART, _FEWEST_LEVELS = (0.6, 0.36), 15, 10
#: A part is taken if its uncertainty is below this share of that of the larger one.
_SURER = 0.6
#: No part is tried if the relative uncertainty is below this.
_SURE = 1e-5


class Points(NamedTuple):
    """Deflection [m], load [N] and side (+1 loading, -1 unloading; None for a single branch) of points."""

    deflection: FloatArray
    load: FloatArray
    side: FloatArray | None


class Local(NamedTuple):
    """The tangent at a load from a part of a curve.

    Attributes
    ----------
    curve : MeanCurve
        The fit of the part.
    place : float [m]
        Deflection at the load.
    slope, std : float [N/m]
        Tangent and its standard uncertainty.
    middle, reach : float [m]
        Middle and half width of the part; the reach is 0 for the whole.
    """

    curve: MeanCurve
    place: float
    slope: float
    std: float
    middle: float = 0.0
    reach: float = 0.0


def surest(points: Points, whole: MeanCurve, place: float, load: float) -> Local:
    """The tangent at a load [N] from the part of the points with the smallest uncertainty of it.

    A part around the load needs no model of the turns, where friction and relaxation bend the branches; the whole has
    more points. A part is used if its uncertainty is clearly smaller. If the tangents of the parts differ by more than
    their uncertainties, the uncertainty of the tangent is enlarged. A curve through rests is always used whole.
    """
    low, high = whole.span
    found = [Local(whole, place, *whole.tangent(place))]
    for share in _PARTS if found[0].std > _SURE * found[0].slope and not whole.stepped else ():
        reach = 0.5 * share * (high - low)
        local = in_part(points, float(np.clip(place, low + reach, high - reach)), reach, load)
        found += [local] if local is not None else []
    best = found[0]
    for one in found[1:]:
        best = one if one.std < _SURER * best.std else best
    others = [(one.slope - best.slope) ** 2 / max(one.std, best.std) ** 2 for one in found if one is not best]
    spread = float(np.sqrt(max(1.0, float(np.mean(others)) if others else 0.0)))
    return best._replace(std=best.std * spread)


def in_part(points: Points, middle: float, reach: float, load: float) -> Local | None:
    """The tangent at a load [N] from the points of a part; None if it has too few, or does not rise to the load."""
    x, f, side = points
    part = np.abs(x - middle) <= reach
    side = None if side is None else side[part]
    if not _enough(x[part], side):
        return None
    local = fit_mean_curve(x[part], f[part], side, whole=False)
    try:
        place = deflection_at(local, load)
    except LoadCurveError:
        return None
    return Local(local, place, *local.tangent(place), middle, reach) if local.slope(place) > 0 else None


def _enough(deflection: FloatArray, side: FloatArray | None) -> bool:
    """Whether each branch has enough points, at enough deflections."""
    branches = [deflection] if side is None else [deflection[side > 0], deflection[side < 0]]
    return all(one.size >= _FEWEST_IN_PART and levels(one) >= _FEWEST_LEVELS for one in branches)


def deflection_at(curve: MeanCurve, load: float) -> float:
    """Deflection at a load on the rising mean curve, at most `_EDGE` of the span past its ends."""
    low, high = curve.span
    margin = _EDGE * (high - low)
    x = np.linspace(low - margin, high + margin, 801)
    above = curve.value(x) - load
    crossing = np.flatnonzero((above[:-1] <= 0) & (above[1:] > 0))
    if not crossing.size:
        raise LoadCurveError(f"the mean of the branches does not reach {load:g} N: no extrapolation")
    inside = crossing[np.argmin(np.abs(x[crossing] - np.clip(x[crossing], low, high)))]
    return float(scipy.optimize.brentq(lambda at: float(curve.value(at)) - load, x[inside], x[inside + 1], xtol=1e-15))
