"""Means of repeated tests, with an uncertainty that holds however many repeats there are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
import scipy

from fourpole.core.arrays import FloatArray
from fourpole.findings.facts import Measured

#: Probability below value + 2 u of a normal distribution.
_BELOW_TWO = 0.97725


@dataclass(frozen=True)
class Scatter:
    """How far repeats of one quantity of a specimen scatter: relative standard deviation [1], degrees of freedom."""

    relative: float = 0.0
    dof: int = 0


def scatter_in(groups: Iterable[Sequence[float]]) -> Scatter:
    r"""The scatter of repeats within groups, pooled over the groups.

    .. math:: s^2 = \sum_i (n_i - 1) (s_i/\bar x_i)^2 / \sum_i (n_i - 1)

    Source: JCGM 100:2008, 4.2.4, here of relative standard deviations.

    >>> scatter_in([[1.0, 1.2], [2.0], [3.0, 3.6]]).dof
    2
    """
    squares, dof = 0.0, 0
    for values in (np.asarray(group) for group in groups if len(group) > 1):
        if mean := float(values.mean()):
            squares += float(((values / mean - 1) ** 2).sum())
            dof += values.size - 1
    return Scatter(sqrt(squares / dof) if dof else 0.0, dof)


def mean_of_repeats(repeats: Sequence[tuple[float, float, str]], pooled: Scatter | None = None) -> Measured:
    r"""Mean of values with their standard uncertainties and tests, such that twice its u is a 95 % interval.

    .. math:: u^2 = \bar u^2 + (t/2)^2 s^2/n

    with the mean u of the n repeats, which their common errors make, the standard deviation s of the repeats, and
    Student's t: few repeats do not tell how far their mean is off. Where other conditions of the specimen have repeats,
    too, s is that of all of them, at least that of these. Source of t: JCGM 100:2008, G.3.2.

    >>> mean_of_repeats([(2.0, 0.1, "D1"), (2.0, 0.1, "D2")]).pair
    (2.0, 0.1)
    """
    values = np.array([value for value, _, _ in repeats])
    stated = float(np.mean([std for _, std, _ in repeats]))
    std = hypot(stated, 0.5 * reach_of_scatter(values, pooled))
    return Measured(float(values.mean()), std, tuple(test for *_, test in repeats))


def reach_of_scatter(values: FloatArray, pooled: Scatter | None = None) -> float:
    """Half the 95 % interval of a mean by the scatter of repeats alone; 0 for one value."""
    if values.size < 2:
        return 0.0
    own = float(values.std(ddof=1))
    scatter, dof = own, values.size - 1
    if pooled is not None and pooled.dof > dof:
        scatter, dof = pooled.relative * abs(float(values.mean())), pooled.dof
    t = float(scipy.special.stdtrit(dof, _BELOW_TWO))
    return max(t * scatter, 2.0 * own) / sqrt(values.size)
