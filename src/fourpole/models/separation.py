"""How far tests tell the amplitude of the deflection from the frequency, before a model of both is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

#: Largest variance inflation with which two variables count as told apart.
MOST_INFLATION = 10.0
#: Least standard deviation of ln x that the frequency does not explain [1].
LEAST_SPREAD = 0.05
#: Least and largest number of terms of the curve of ln x over ln f; frequencies within this ratio count as one.
_FEWEST, _MOST, _SAME = 6, 12, 1.01


@dataclass(frozen=True)
class Separation:
    """How far the tests of one condition tell amplitude from frequency.

    Attributes
    ----------
    correlation : float [1]
        Multiple correlation of the logarithm of the amplitude with a smooth curve over the logarithm of frequency.
    inflation : float [1]
        Variance inflation of the amplitude exponents: by this factor the variance of an exponent of the amplitude is
        larger than if amplitude and frequency had been varied independently. Infinite if the curve explains all.
    spread : float [1]
        Standard deviation of ln x that the curve does not explain.
    """

    correlation: float
    inflation: float
    spread: float

    @property
    def possible(self) -> bool:
        """Whether amplitude and frequency can be told apart."""
        return self.inflation <= MOST_INFLATION and self.spread >= LEAST_SPREAD


def separation(frequency: ArrayLike, amplitude: ArrayLike) -> Separation:
    r"""How far tests tell the amplitude from the frequency.

    K* near one point is :math:`\ln K^* = c(\ln f) + (p + jq) \ln x` with a smooth c. The variance of p and of q is
    :math:`1/(1 - R^2)` times that of independent variables, where R is the multiple correlation of ln x with c.

    Parameters
    ----------
    frequency, amplitude : (N,) float arrays [Hz], [m]
        Frequency and 0-to-peak amplitude of the deflection of each test, > 0.

    References
    ----------
    D. W. Marquardt, "Generalized inverses, ridge regression, biased linear estimation, and nonlinear estimation",
    Technometrics 12, 1970: variance inflation, which should not be above 10.

    Examples
    --------
    >>> bench = separation([1.0, 1.0, 3.0, 3.0, 9.0, 9.0], [1e-4, 1e-3] * 3)
    >>> bench.possible, round(bench.inflation, 3)
    (True, 1.0)
    >>> cam = separation([10.0, 14.0, 18.0, 22.0], [1e-3, 2e-3, 3e-3, 1.5e-3])
    >>> cam.possible, cam.inflation
    (False, inf)
    """
    logs, moved = np.log(np.asarray(frequency, dtype=float)), np.log(np.asarray(amplitude, dtype=float))
    moved = moved - moved.mean()
    distinct = 1 + int(np.sum(np.diff(np.sort(logs)) > np.log(_SAME)))
    terms = min(max(_FEWEST, distinct // 2), _MOST, distinct)
    span = float(np.ptp(logs)) or 1.0
    rows = legendre.legvander(2 * (logs - logs.min()) / span - 1, terms - 1)
    left = moved - rows @ np.linalg.lstsq(rows, moved, rcond=None)[0]
    whole, rest = float(moved @ moved), float(left @ left)
    alone = logs.size <= terms or rest <= 1e-24 * max(whole, 1.0)
    share = 0.0 if alone else min(rest / whole, 1.0)  # a rest beyond the whole is round-off
    return Separation(
        correlation=float(np.sqrt(1 - share)),
        inflation=1 / share if share else float("inf"),
        spread=0.0 if alone else float(np.sqrt(rest / logs.size)),
    )
