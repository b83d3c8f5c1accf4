"""When a difference or a slope may be claimed.

The tables give each value y its standard uncertainty u(y). Tests have most of it in common (rig, gains, K1). A common
error does not average out over tests, and it acts only in part on their differences. Hence three rules:

- **A line of three points or more**, as K2 against frequency: the random part of each test is the scatter about the
  straight line, and counts with Student's factor. The scatter includes the bend of the curve. The shared part is u(y),
  as an error of one sign that varies along the line as u(y) does. With fewer than three degrees of freedom u(y) counts
  in full as each test's own, unless the scatter is larger. The larger scatter then counts with the factor of three
  degrees of freedom: it is mostly the bend of the curve, and the factor of one degree, 12.7 or more, hides any effect.
- **Two single values**, as of two tyres or two loads: both u count in full.
- **A mean over conditions** has the uncertainty of one of them.

An effect is claimed if it exceeds two standard uncertainties, a chance of 4.6 %; if they come from scatter, Student's
factor of the same chance takes the place of two. If several effects are searched for any claim, the chance of a false
one is 1 % in all. The rule misses an error that follows the pressure or the frequency and is not in u(y) as such. An
example is a hysteresis that biases K1 more at one end of the pressures than at the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import hypot, inf, sqrt

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import CLAIM_CHANCE, SEARCH_CHANCE

#: No relative effect below this is claimed, because it may be round-off.
_ROUND_OFF = 1e-9
#: Below this many degrees of freedom Student's factor is too large to be of use.
_FEW = 3.0


@dataclass(frozen=True)
class Effect:
    """A relative difference with its uncertainty.

    Attributes
    ----------
    value : float [1]
    own, shared : float [1]
        Standard uncertainty from errors of each test, and from errors that tests share.
    dof : float
        Degrees of freedom of `own`.
    """

    value: float
    own: float
    shared: float = 0.0
    dof: float = inf

    @property
    def std(self) -> float:
        """Standard uncertainty [1]."""
        return hypot(self.own, self.shared)

    def reach(self, searched: int = 1) -> float:
        """The value that an effect must exceed to be claimed [1], if `searched` effects are searched for any claim."""
        return max(hypot(factor(self.dof, searched) * self.own, factor(inf, searched) * self.shared), _ROUND_OFF)

    def claimed(self, searched: int = 1) -> bool:
        """Whether the value exceeds its uncertainty, if `searched` effects are searched for any claim."""
        return abs(self.value) > self.reach(searched)

    @property
    def sign(self) -> int:
        """1 or -1 for a claimed effect, else 0."""
        return int(np.sign(self.value)) if self.claimed() else 0


@lru_cache(maxsize=1000)
def factor(dof: float = inf, searched: int = 1) -> float:
    """Coverage factor [1] that a claim must exceed, of Student's distribution with `dof` degrees of freedom."""
    chance = 0.5 * (CLAIM_CHANCE if searched == 1 else SEARCH_CHANCE / searched)
    return float(stats.norm.isf(chance) if dof == inf else stats.t.isf(chance, dof))


def along(x: FloatArray, y: FloatArray, u: FloatArray, variance: float, dof: float) -> Effect:
    """Relative change of the straight line over the range of x; `variance` is that of the relative residuals."""
    level = float(np.mean(y))
    offset = x - x.mean()
    weights = offset / float(offset @ offset) * float(np.ptp(x)) / level
    own, shared = sqrt(variance) * level * float(np.sqrt(weights @ weights)), abs(float(weights @ u))
    stated = max(float(np.linalg.norm(weights * u)), shared)
    if dof < _FEW and own <= stated:
        return Effect(float(weights @ y), stated)
    return Effect(float(weights @ y), own, shared, max(dof, _FEW))


def residual_squares(x: FloatArray, y: FloatArray, order: int = 1) -> float:
    """Sum of the squared residuals about a polynomial, relative to the mean."""
    x = (x - x.mean()) / float(np.ptp(x))
    basis = np.vander(x, order + 1)
    relative = y / float(np.mean(y))
    left = relative - basis @ np.linalg.lstsq(basis, relative, rcond=None)[0]
    return float(left @ left)


def between(first: tuple[float, float], second: tuple[float, float]) -> Effect:
    """Second value less the first, relative to the first; each is a pair of value and standard uncertainty."""
    (a, u_a), (b, u_b) = first, second
    return Effect(b / a - 1.0, b / a * hypot(u_a / a, u_b / b))


def mean_effect(effects: Sequence[Effect]) -> Effect:
    """Mean over conditions, with the uncertainty of one of them."""
    value = float(np.mean([effect.value for effect in effects]))
    own = sqrt(float(np.mean([effect.own**2 for effect in effects])))
    return Effect(value, own, float(np.mean([effect.shared for effect in effects])), min(e.dof for e in effects))
