"""Draws of a model from its uncertainty, as linear systems of one structure, for simulations that vary the specimen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import fit
from fourpole.models.fractional import arms_at
from fourpole.models.laws import root_of
from fourpole.models.operating import OperatingMap
from fourpole.models.realised import Realised, realised
from fourpole.models.surface import design

#: Number of draws that an export keeps, of those made, some of which may have another structure; their seed.
COUNT, _MADE, SEED = 64, 96, 1
#: Times so far below the band are a damper in it; springs so far below the largest are none.
_FAST, _IDLE = 0.01, 1e-9
#: Frequencies of the band at which a draw of K* is made, and step of its direction in standard uncertainties.
_FREQUENCIES, _STEP = 24, 1e-3
#: Relative weight of K* in the fit of its parameters; smaller ones are not told apart.
_CLOSE = 1e-4


def drawn_values(found: OperatingMap, point: FloatArray, count: int = _MADE, seed: int = SEED) -> FloatArray:
    r"""Parameters (count, P) of a map at a point (d,), drawn from its uncertainty.

    A draw of K* over the band is :math:`K^* + \partial K^*/\partial c\,\delta`, the coefficients c having their
    covariance, times a factor with the scatter of conditions and the discrepancy of the model; its parameters are those
    that suit it best. So K* of the draws scatters as the map says where parameters are hardly known each, and their
    distribution is far from normal.

    Examples
    --------
    >>> from fourpole.models.linearised import Scatter
    >>> from fourpole.models.springs import KelvinVoigt
    >>> from fourpole.models.surface import Axes
    >>> from fourpole.models.together import LeaveOneOut
    >>> linked = KelvinVoigt().link(np.array([180e3, 700.0]))[:, None]
    >>> found = OperatingMap(
    ...     KelvinVoigt(),
    ...     Axes((), np.zeros((1, 0)), {}),
    ...     ((),),
    ...     linked,
    ...     np.diag([1e-4, 4e-4]),
    ...     Scatter(),
    ...     (5.0, 50.0),
    ...     LeaveOneOut(),
    ... )
    >>> drawn = drawn_values(found, np.zeros(0))
    >>> (drawn.std(axis=0) / drawn.mean(axis=0)).round(2)
    array([0.01, 0.02])
    """
    rng = np.random.default_rng(seed)
    moves = rng.standard_normal((count, len(found.covariance))) @ root_of(found.covariance).T
    spread = np.hypot(max(found.scatter.condition), max(found.scatter.frequency))
    factor = np.exp(spread * rng.standard_normal(count))
    omega = 2 * np.pi * np.geomspace(*found.band, _FREQUENCIES)
    basis = design(found.terms, found.axes.scaled(point[None]))[0]
    linked, moved = found.coefficients @ basis, moves.reshape(count, *found.coefficients.shape) @ basis
    best, *ends = (found.model.unlink(one)[0] for one in (linked, linked + _STEP * moved, linked - _STEP * moved))
    above, below = (found.model.stiffness(one, omega) for one in ends)
    target = (found.model.stiffness(best, omega) + (above - below) / (2 * _STEP)) * factor[:, None]
    still = np.all(ends[0] == ends[1], axis=0)
    held = [symbol for symbol, one in zip(found.model.symbols, still, strict=True) if one]
    if len(held) == best.size:
        return np.tile(best, (count, 1))
    data = StiffnessData.of(omega, target, _CLOSE * np.abs(target))
    return fit(found.model, data, np.tile(best, (count, 1)), fixed=held).values


def drawn_systems(found: OperatingMap, point: FloatArray, like: Realised) -> Iterator[Realised]:
    """Draws of the model as linear systems with as many branches and pairs as that of the estimate; see `drawn_values`.

    More than `COUNT` draws are made, for some may have no such system.
    """
    least = _FAST / (2 * np.pi * found.band[1])
    rates = 1.0 / like.times if like.times.size else np.ones(1)
    omega = np.geomspace(rates.min(), rates.max(), 3 * rates.size)
    for values in drawn_values(found, point):
        try:
            if like.error and not like.pair_springs.size:  # an approximation by arms keeps their times
                rest, *springs = arms_at(omega, found.model.stiffness(values, omega), like.times)
                one = replace(like, rest=float(rest), springs=np.array(springs))
            else:
                one = _slowed(realised(found.model, values, found.band), least)
            yield alike(one, like)
        except (ModelError, RuntimeError):
            continue


def alike(system: Realised, like: Realised) -> Realised:
    """The system with as many branches as another one, some of them idle; ModelError if it has more, or other pairs."""
    kept = np.abs(system.springs) > _IDLE * np.abs(system.springs).max(initial=0.0)
    more = like.springs.size - int(kept.sum())
    if more < 0 or system.pair_springs.size != like.pair_springs.size:
        raise ModelError("the system has another structure")
    springs, times = np.append(system.springs[kept], np.zeros(more)), np.append(system.times[kept], np.ones(more))
    return replace(system, springs=springs, times=times)


def _slowed(system: Realised, least: float) -> Realised:
    """The system with times of at least `least` [s]; faster branches keep their damping."""
    slow = np.maximum(system.times, least)
    return replace(system, springs=system.springs * system.times / slow, times=slow)
