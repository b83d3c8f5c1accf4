"""When a difference or a slope may be claimed: the one rule behind the words.

The tables give each value y its standard uncertainty u(y), most of which tests have in common (rig, gains, K1), so
that it neither averages out over tests nor acts in full on their differences. Hence three plain rules:

- **Along a line of three points or more** (K2 against frequency, say) what each test has of its own shows in its
  scatter about the straight line, the bend of the curve included, and counts with Student's factor; what the tests
  share is taken from the column u, as an error of one sign that grows and shrinks along the line as u does. Where
  the points are so few that scatter says little, u counts in full as each test's own, unless the scatter is larger.
- **Between two single values** (two tyres, two loads) nothing shows what is shared: both u count in full.
- **A mean over conditions** is held to be no surer than one of them.

An effect is claimed where it exceeds two standard uncertainties, or Student's factor of the same probability (4.6 %)
where they come from scatter; where several effects are searched for any that stands out, chance is held to 1 % in all.
What this cannot see: an error that follows the pressure or the frequency itself and is not in u as such, like a
hysteresis that biases K1 more at one end of the pressures than at the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import hypot, inf, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["Effect", "along", "between", "factor", "mean_effect", "residual_squares"]

FloatArray = NDArray[np.float64]

_CHANCE = 0.0455  # outside of two standard uncertainties
_CHANCE_OF_ANY = 0.01  # where several effects are searched

_ROUND_OFF = 1e-9
_FEW = 3.0  # degrees of freedom below which Student's factor is too large to be of use


@dataclass(frozen=True)
class Effect:
    """A difference, relative to the level where it was seen.

    Attributes
    ----------
    value : float [1]
    own, shared : float [1]
        Standard uncertainty from what each test has of its own, and from what the tests share.
    dof : float
        Degrees of freedom of `own`.
    """

    value: float
    own: float
    shared: float = 0.0
    dof: float = inf

    @property
    def std(self) -> float:
        """Half of the interval that `claimed` looks at, so that twice this is what a claim must exceed."""
        return 0.5 * self.reach()

    def reach(self, looks: int = 1) -> float:
        """What the value must exceed where `looks` effects are searched."""
        return max(hypot(factor(self.dof, looks) * self.own, factor(inf, looks) * self.shared), _ROUND_OFF)

    def claimed(self, looks: int = 1) -> bool:
        """Whether the value is beyond its uncertainty."""
        return abs(self.value) > self.reach(looks)

    @property
    def sign(self) -> int:
        """1 or -1 where claimed, else 0."""
        return int(np.sign(self.value)) if self.claimed() else 0


@lru_cache(maxsize=1000)
def factor(dof: float = inf, looks: int = 1) -> float:
    """Standard uncertainties beyond which chance is held to be excluded."""
    chance = 0.5 * (_CHANCE if looks == 1 else _CHANCE_OF_ANY / looks)
    return float(stats.norm.isf(chance) if dof == inf else stats.t.isf(chance, dof))


def along(x: FloatArray, y: FloatArray, u: FloatArray, variance: float, dof: float) -> Effect:
    """Relative change of the straight line from first to last x; `variance` is that of the relative residuals."""
    level = float(np.mean(y))
    offset = x - x.mean()
    weights = offset / float(offset @ offset) * float(np.ptp(x)) / level
    own, shared = sqrt(variance) * level * float(np.sqrt(weights @ weights)), abs(float(weights @ u))
    stated = max(float(np.linalg.norm(weights * u)), shared)
    if dof < _FEW and own <= stated:
        return Effect(float(weights @ y), stated)
    return Effect(float(weights @ y), own, shared, dof)


def residual_squares(x: FloatArray, y: FloatArray, order: int = 1) -> float:
    """Sum of the squared residuals about a polynomial, relative to the mean."""
    x = (x - x.mean()) / float(np.ptp(x))
    basis = np.vander(x, order + 1)
    relative = y / float(np.mean(y))
    left = relative - basis @ np.linalg.lstsq(basis, relative, rcond=None)[0]
    return float(left @ left)


def between(first: tuple[float, float], second: tuple[float, float]) -> Effect:
    """How far the second value is above the first, relative to the first; each with its u, which counts in full."""
    (a, u_a), (b, u_b) = first, second
    return Effect(b / a - 1.0, b / a * hypot(u_a / a, u_b / b))


def mean_effect(effects: Sequence[Effect]) -> Effect:
    """Mean over conditions, no surer than one of them."""
    value = float(np.mean([effect.value for effect in effects]))
    own = sqrt(float(np.mean([effect.own**2 for effect in effects])))
    return Effect(value, own, float(np.mean([effect.shared for effect in effects])), min(e.dof for e in effects))
