"""The range of K* between a static ramp and the measured band: that of all passive linear tyres that fit the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.models.data import StiffnessData, relaxation
from fourpole.models.nonnegative import Profile, least_squares
from fourpole.models.spectrum import each_whitened

#: Relaxation times per decade, and decades beyond the ends of the data.
_PER_DECADE, _BEYOND = 12, 1.0
#: Weight, in standard uncertainties per relative change of the value, by which a value is held.
_HELD = 1e5


@dataclass(frozen=True, eq=False)
class _Held(Profile):
    """Least chi-square as a function of a weighted sum of terms, of which `term` has the weights."""

    def height(self, value: float) -> float:
        """Square root of the rise of chi-square above its minimum."""
        scale = _HELD / max(abs(value), float(np.max(self.term)) * 1e-3)
        rows = np.vstack([self.others, scale * self.term])
        chi2 = least_squares(rows, np.append(self.target, scale * value))[1]
        return float(np.sqrt(max(chi2 - self.least, 0.0)))


def passive_range(data: StiffnessData, omega: FloatArray) -> FloatArray:
    """95 % intervals (F, 2, 2) [N/m] of K' and K'' over all passive linear tyres without inertia.

    An end of an interval is the value at which the least chi-square over all non-negative relaxation spectra has risen
    by 3.84. A model has a form; here only the sign of the terms is assumed.

    Parameters
    ----------
    data : StiffnessData
        Data of one condition, with K1 as the tangent of a ramp.
    omega : (F,) float array [rad/s]
        Angular frequencies.
    """
    (condition,) = each_whitened(data)
    low, high = data.lowest / 10**_BEYOND, float(data.omega.max()) * 10**_BEYOND
    times = 1.0 / np.geomspace(low, high, int(np.ceil(np.log10(high / low) * _PER_DECADE)) + 1)
    rows = condition.rows(_terms(data.omega, times), np.append(data.static_share(times), 0.0))
    found, least = least_squares(rows, condition.target)
    answers = _terms(omega, times)
    ends = np.empty((omega.size, 2, 2))
    for at, answer in enumerate(answers):
        for part, term in enumerate((answer.real, answer.imag)):
            profile = _Held(term, rows, condition.target, least)
            best = float(term @ found)
            step = 0.01 * float(np.abs(answer @ found))
            ends[at, part, 1] = profile.end(best, step, NORMAL_95)
            ends[at, part, 0] = max(profile.end(best, -min(step, best), NORMAL_95), 0.0) if best > 0 else 0.0
    return ends


def _terms(omega: FloatArray, times: FloatArray) -> np.ndarray:
    """K* (F, T + 2) of a unit spring, of unit arms and of a damper."""
    damper = 1j * omega[:, None] * times.min()
    return np.concatenate([np.ones((omega.size, 1)), relaxation(omega, times), damper], axis=1)
