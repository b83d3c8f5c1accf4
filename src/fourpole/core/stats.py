r"""Tails and quantiles of the distributions that verdicts need, as `scipy.stats` names them.

They are the special functions that `scipy.stats` evaluates too. That package alone takes half a second to load, which
every command and every worker process would wait for.

Each distribution has `sf` (chance of more than x), `isf` (its inverse) and `ppf` (quantile); all broadcast.

Examples
--------
>>> float(chi2.sf(3.841, 1).round(4)), float(t.ppf(0.975, 9).round(3))
(0.05, 2.262)
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

__all__ = ["binomial_least", "chi2", "f", "norm", "share_within", "t"]


class _ChiSquared:
    """The chi-square distribution with `dof` > 0 degrees of freedom."""

    def sf(self, x: ArrayLike, dof: ArrayLike) -> Any:
        """Chance of more than `x`."""
        return scipy.special.chdtrc(dof, np.maximum(x, 0.0))

    def isf(self, chance: ArrayLike, dof: ArrayLike) -> Any:
        """Value that is exceeded with this chance."""
        return scipy.special.chdtri(dof, chance)

    def ppf(self, level: ArrayLike, dof: ArrayLike) -> Any:
        """Value below which this share lies."""
        return 2 * scipy.special.gammaincinv(np.asarray(dof) / 2, level)


class _Student:
    """Student's t with `dof` > 0 degrees of freedom, infinite ones too."""

    def ppf(self, level: ArrayLike, dof: ArrayLike) -> Any:
        """Value below which this share lies."""
        return scipy.special.stdtrit(dof, level)

    def isf(self, chance: ArrayLike, dof: ArrayLike) -> Any:
        """Value that is exceeded with this chance."""
        return -scipy.special.stdtrit(dof, chance)


class _Fisher:
    """The F distribution with `more` and `rest` degrees of freedom > 0."""

    def sf(self, x: ArrayLike, more: ArrayLike, rest: ArrayLike) -> Any:
        """Chance of more than `x`."""
        return scipy.special.fdtrc(more, rest, np.maximum(x, 0.0))

    def isf(self, chance: ArrayLike, more: ArrayLike, rest: ArrayLike) -> Any:
        """Value that is exceeded with this chance."""
        return scipy.special.fdtri(more, rest, 1 - np.asarray(chance))

    def ppf(self, level: ArrayLike, more: ArrayLike, rest: ArrayLike) -> Any:
        """Value below which this share lies."""
        return scipy.special.fdtri(more, rest, level)


class _Normal:
    """The standard normal distribution."""

    def isf(self, chance: ArrayLike) -> Any:
        """Value that is exceeded with this chance."""
        return -scipy.special.ndtri(chance)


chi2, t, f, norm = _ChiSquared(), _Student(), _Fisher(), _Normal()


def binomial_least(count: int, share: float, chance: float = 0.05) -> int:
    """The least number of successes in `count` trials of probability `share` below which fewer have less than `chance`.

    It is the quantile of the binomial distribution: fewer successes reject `share` at this level, so that the one-sided
    upper bound of Clopper and Pearson for the probability is below it.

    Examples
    --------
    >>> binomial_least(64, 0.95), binomial_least(1, 0.95)
    (58, 0)
    """
    number = np.arange(count + 1)
    return int(np.count_nonzero(scipy.special.bdtr(number, count, share) < chance))


def share_within(value: float, std: float, low: float = -np.inf, high: float = np.inf) -> float:
    """Probability that a normal quantity about a measured value is within two limits.

    Parameters
    ----------
    value, std : float
        Measured value and its standard uncertainty, in one unit.
    low, high : float
        Limits in that unit; infinite for a side without one.

    Returns
    -------
    float [1]
        1 or 0 where the uncertainty is zero.

    References
    ----------
    JCGM 106:2012, clause 7.

    Examples
    --------
    >>> round(share_within(196e3, 1.5e3, high=198e3), 4)
    0.9088
    """
    if std <= 0:
        return 1.0 if low <= value <= high else 0.0
    ends = scipy.special.ndtr([(low - value) / std, (high - value) / std])
    return float(ends[1] - ends[0])
