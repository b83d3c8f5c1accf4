"""What the rides of several tyres show: which difference is told, and where their numbers have a limit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.ride.compare import RideComparison
from fourpole.ride.contact import LoadDeflection

#: Share of the weighted mean square outside the tested frequencies above which a note says so [1].
_OUTSIDE = 0.05
#: Relative difference of the preload from the static load of a wheel, and of the curve's tangent from the model at
#: rest, above which a note says so [1].
_PRELOAD, _TANGENT = 0.1, 0.1
#: Standard deviations of a wheel load at which a linear ride on a spectrum pulls the wheel down.
_DEVIATIONS = 3.0
#: Time of one cycle of the lowest frequency of Wk [s].
_SHORTEST = 2.5


def is_told(difference: float, std: float) -> bool:
    """Whether a difference exceeds its expanded uncertainty, U with k = 2."""
    return abs(difference) > COVERAGE_FACTOR * std


def most_outside(rides: RideComparison, bands: Sequence[tuple[float, float]]) -> tuple[int, float] | None:
    """The tyre with the largest share of a_w² outside its tested frequencies [Hz], with this share; None if small."""
    shares = [float(ride.share_outside(*band)) for (ride, _), band in zip(rides.spectra, bands, strict=False)]
    if not shares or max(shares) <= _OUTSIDE:
        return None
    return int(np.argmax(shares)), max(shares)


def other_preloads(preloads: Sequence[float | None], loads: FloatArray) -> list[float]:
    """The preloads of tyres that are not the static load of each wheel [N], rising."""
    apart = {p for p in preloads if p and any(abs(p / load - 1) > _PRELOAD for load in loads.tolist())}
    return sorted(apart)


def other_tangents(curve: LoadDeflection, at_rest: float, loads: FloatArray) -> Iterator[tuple[float, float]]:
    """Static loads [N] at which the tangent of a curve [N/m] is not the stiffness of a model at rest; the tangents."""
    for load in loads.tolist():
        tangent = curve.tangent_at(load)
        if abs(tangent - at_rest) > _TANGENT * tangent:
            yield load, tangent


def is_pulled(rides: RideComparison, loads: FloatArray) -> bool:
    """Whether the road pulls a wheel down in a linear ride: at some sample, or at three standard deviations."""
    if rides.series:
        return any(bool(np.any(ride.load < -loads[:, None])) for ride in rides.series)
    wheels = [column for column, name in enumerate(rides.names) if name.startswith("wheel load")]
    return bool(np.any(_DEVIATIONS * rides.values[:, wheels] > loads))


def too_short(rides: RideComparison) -> float | None:
    """Duration [s] of rides in time that are shorter than a cycle of the lowest frequency of Wk; else None."""
    if not rides.series:
        return None
    duration = rides.series[0].step * rides.series[0].weighted.size
    return duration if duration < _SHORTEST else None
