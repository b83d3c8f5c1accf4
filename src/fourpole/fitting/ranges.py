"""The range of K* beyond the measured band over all massless, relaxing specimens that fit, in a model file.

A model whose order the data chose has the arms that the band needs. Beyond the band its covariance says nothing of the
arms that are not there; the range over all non-negative relaxation spectra does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.modelparts import Strict
from fourpole.models.causality import passive_range
from fourpole.models.data import MASTER_DECADES, StiffnessData

#: Frequencies per decade, and their largest number below and above the band.
_PER_DECADE, _MOST = 4, 50
#: The range reaches so many times beyond an end of the band.
REACH = 10.0
#: An interval that has no end is cut at so many times the largest modulus of K*.
_CUT = 10.0
_ROUND_OFF = 1e-9
#: So slow, as a fraction of the lowest frequency, that no arm of the range's spectra acts.
_AT_REST = 1e-9
#: What u of a query beyond the band is.
IN_RANGE = "u reaches the ends of the range of all massless, relaxing specimens that fit the data"


class RangeFile(Strict):
    """The 95 % intervals of K* at a frequency over all massless, relaxing specimens that fit the data."""

    frequency: float = Field(gt=0, description="Frequency [Hz].")
    storage: tuple[float, float] = Field(description="Least and largest K' [N/m].")
    loss: tuple[float, float] = Field(description="Least and largest K'' [N/m].")


def ranges_of(data: StiffnessData, low: float = np.inf, high: float = np.inf) -> list[RangeFile]:
    """The ranges of K* of one condition from `low` [Hz] to its band, and from there to `high` [Hz], rising."""
    band = float(data.omega.min()) / (2 * np.pi), float(data.omega.max()) / (2 * np.pi)
    below = [] if low >= band[0] else _steps(low, band[0])
    above = [] if not band[1] < high < np.inf else _steps(band[1], high)
    parts = [(data, [*below, *above])]
    if band[1] > 10.0**MASTER_DECADES * band[0]:  # so far from an end, data say nothing of what is beyond it
        far = 10.0**MASTER_DECADES
        near = data.omega < far * data.omega.min(), data.omega > data.omega.max() / far
        parts = [(data.part(np.flatnonzero(rows)), side) for rows, side in zip(near, (below, above), strict=True)]
    found = []
    for some, side in parts:
        ends = passive_range(some, 2 * np.pi * np.array(side)) if side else np.zeros((0, 2, 2))
        rows = zip(side, np.minimum(ends, np.abs(data.stiffness).max() * _CUT).tolist(), strict=True)
        found += [RangeFile(frequency=one, storage=tuple(storage), loss=tuple(loss)) for one, (storage, loss) in rows]
    return found


def rest_of(data: StiffnessData) -> tuple[float, float] | None:
    """The 95 % interval of K1 [N/m] of one condition over all specimens that fit; None if K1 was measured."""
    if np.any(np.isfinite(data.k1)):
        return None
    ((least, largest), _) = passive_range(data, np.array([data.omega.min() * _AT_REST]))[0].tolist()
    return least, min(largest, float(np.abs(data.stiffness).max()) * _CUT)


def _steps(low: float, high: float) -> list[float]:
    count = min(int(np.log10(high / low) * _PER_DECADE) + 2, _MOST)
    return [float(one) for one in np.geomspace(low, high, count)]


def wider(
    ranges: Sequence[RangeFile],
    band: tuple[float, float],
    frequency: FloatArray,
    stiffness: ComplexArray,
    covariance: FloatArray,
) -> FloatArray:
    """A covariance (F, 3, 3) of Re K*, Im K* and K1 whose 95 % intervals reach the ends of the range beyond a band.

    Frequencies and band are in [Hz]. Beyond the first and the last range it is that of these.
    """
    out = covariance.copy()
    sides = ((frequency < band[0] * (1 - _ROUND_OFF), 0), (frequency > band[1] * (1 + _ROUND_OFF), 1))
    middle = float(np.sqrt(band[0] * band[1]))
    for beyond, side in sides:
        own = [one for one in ranges if (one.frequency > middle) == bool(side)]
        if not own:
            continue
        places = np.log([one.frequency for one in own])
        for part, value in enumerate((stiffness.real, stiffness.imag)):
            ends = np.array([(one.storage, one.loss)[part] for one in own])
            there = [np.interp(np.log(frequency), places, end) for end in ends.T]
            far = np.max([np.abs(one - value) for one in there], axis=0) / NORMAL_95
            out[:, part, part] = np.where(beyond, np.maximum(out[:, part, part], far**2), out[:, part, part])
    return out
