"""Smooth surfaces over pressure, preload and other axes: polynomials of low order, and the hull of what was seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError

__all__ = ["Axes", "Terms", "ValueSurface", "bends", "design", "term_sets", "value_surface"]

#: Exponents of each axis, term by term.
Terms = tuple[tuple[int, ...], ...]
_MOST_DEGREE = 3
#: Largest number of terms as a fraction of the number of conditions; the rest serves to estimate the error.
_MOST_TERMS = 0.75
#: Two values of an axis are equal if they differ by less than this fraction of its span or of the values.
_SAME = 0.02
#: Largest distance from the convex hull, in half spans, at which a point counts as on it.
_ON_HULL = 1e-6
_HEAVY = 1e4
#: Bend half way between two levels, as a share of the change from one to the other: c in x + c (1 - x²), halved.
_BEND = 1.0 / 24.0
#: Largest ratio of the error of a surface to that of a simpler one that is replaced; least value of 1 - leverage.
_BETTER, _ALL_LEVERAGE = 0.98, 1e-6


@dataclass(frozen=True, eq=False)
class Axes(ByValue):
    """The quantities in which conditions differ, and the measured points.

    Attributes
    ----------
    names : tuple of str
        Columns with units: "pressure [Pa]". Those with one value everywhere are `constant`.
    points : (B, d) float array
        Value of each condition.
    constant : dict of str to float
        Axes that were not varied, each with its value.
    """

    names: tuple[str, ...]
    points: FloatArray
    constant: dict[str, float]

    @classmethod
    def of(cls, names: Sequence[str], points: ArrayLike) -> Axes:
        """Axes of conditions (B, d); those that do not vary are set apart.

        Examples
        --------
        >>> Axes.of(["pressure [Pa]", "preload [N]"], [[1.7e5, 1e3], [2.0e5, 1e3]]).constant
        {'preload [N]': 1000.0}
        """
        array = np.asarray(points, dtype=float)
        array = array.reshape(len(array), len(names))
        varied = [at for at in range(len(names)) if _levels(array[:, at]) > 1]
        fixed = {name: float(np.mean(array[:, at])) for at, name in enumerate(names) if at not in varied}
        return cls(tuple(names[at] for at in varied), array[:, varied], fixed)

    @property
    def middle(self) -> FloatArray:
        """Middle of the measured span of each axis (d,)."""
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2)

    @property
    def half(self) -> FloatArray:
        """Half the span of each axis (d,)."""
        return np.asarray((self.points.max(axis=0) - self.points.min(axis=0)) / 2)

    @property
    def levels(self) -> tuple[int, ...]:
        """Number of different values of each axis."""
        return tuple(_levels(self.points[:, at]) for at in range(len(self.names)))

    @property
    def straight(self) -> tuple[int, ...]:
        """Indices of axes with two levels only; the curvature between two levels is unknown."""
        return tuple(at for at, levels in enumerate(self.levels) if levels == 2)

    def scaled(self, points: ArrayLike) -> FloatArray:
        """Points (Q, d) scaled so that the measured span of each axis is from -1 to 1."""
        array = np.atleast_2d(np.asarray(points, dtype=float))
        return np.asarray((array - self.middle) / self.half)

    def outside(self, point: ArrayLike) -> tuple[float, FloatArray]:
        """How far a point (d,) is from the convex hull of what was measured, and the nearest point of it.

        Returns
        -------
        distance : float [1]
            In half spans of the axes; 0 inside.
        nearest : (d,) float array

        Examples
        --------
        >>> axes = Axes.of(["pressure [Pa]", "preload [N]"], [[1e5, 1e3], [2e5, 1e3], [1e5, 2e3], [2e5, 2e3]])
        >>> axes.outside([1.5e5, 1.5e3])[0], axes.outside([2.5e5, 1.5e3])
        (0.0, (1.0, array([2.0e+05, 1.5e+03])))
        """
        if not self.names:
            return 0.0, np.zeros(0)
        corners, wanted = self.scaled(self.points), self.scaled(point)[0]
        # Weights >= 0 that add up to one, and come as near as they can: the sum is asked for with much weight.
        heavy = np.vstack([corners.T, np.full(len(corners), _HEAVY)])
        weights, _ = optimize.nnls(heavy, np.append(wanted, _HEAVY))
        nearest = corners.T @ (weights / weights.sum())
        distance = float(np.linalg.norm(nearest - wanted))
        if distance < _ON_HULL:
            return 0.0, np.asarray(point, dtype=float)
        return float(np.round(distance, 6)), np.asarray(np.round(nearest, 6) * self.half + self.middle)


@dataclass(frozen=True, eq=False)
class ValueSurface(ByValue):
    """The logarithm of a positive value that each condition has, as a polynomial of the scaled axes.

    Attributes
    ----------
    terms : Terms
    coefficients : (K,) float array
    covariance : (K, K) float array
    scatter : float [1]
        Of conditions about it, relative.
    std : float [1]
        Relative uncertainty that the conditions' values have in common: no number of them averages it away.
    """

    terms: Terms
    coefficients: FloatArray
    covariance: FloatArray
    scatter: float
    std: float

    def at(self, scaled: FloatArray, straight: Sequence[int] = ()) -> tuple[FloatArray, FloatArray]:
        """The value (Q,) and its standard uncertainty at scaled points (Q, d); see `bends` for `straight`."""
        basis = design(self.terms, scaled)
        value = np.exp(basis @ self.coefficients)
        variance = np.einsum("qi,ij,qj->q", basis, self.covariance, basis) + self.scatter**2 + self.std**2
        for share, low, high in bends(scaled, straight):
            change = (design(self.terms, high) - design(self.terms, low)) @ self.coefficients
            variance = variance + (share * change) ** 2
        return value, value * np.sqrt(variance)


def bends(scaled: FloatArray, straight: Sequence[int]) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Along each axis with two levels: how far a value may bend from the straight line between them, and their points.

    The share (Q,) of the change between the levels that is one standard deviation: with it the slope is 1.4 times as
    steep at one level as at the other, with two of it three times.
    """
    for axis in straight:
        low, high = scaled.copy(), scaled.copy()
        low[:, axis], high[:, axis] = -1.0, 1.0
        yield _BEND * np.maximum(1.0 - scaled[:, axis] ** 2, 0.0), low, high


def value_surface(axes: Axes, values: ArrayLike, stds: ArrayLike) -> ValueSurface:
    """The surface with the least leave-one-out error of values (B,) with standard uncertainties (B,).

    Examples
    --------
    >>> axes = Axes.of(["pressure [Pa]"], [[1.0e5], [1.5e5], [2.0e5], [2.5e5]])
    >>> found = value_surface(axes, [100e3, 110e3, 121e3, 133.1e3], [1e3, 1.1e3, 1.21e3, 1.331e3])
    >>> value, std = found.at(axes.scaled([[1.75e5]]))
    >>> value.round(-1), (std / value).round(4)
    (array([115370.]), array([0.01]))
    """
    logs = np.log(np.asarray(values, dtype=float))
    common = float(np.sqrt(np.mean((np.asarray(stds, dtype=float) / np.exp(logs)) ** 2)))
    scaled = axes.scaled(axes.points)
    best: tuple[float, ValueSurface] | None = None
    for terms in term_sets(axes.levels, logs.size):
        basis = design(terms, scaled)
        inverse = np.linalg.pinv(basis.T @ basis, hermitian=True)
        off = logs - basis @ (inverse @ basis.T @ logs)
        spare = np.maximum(1.0 - np.einsum("bi,ij,bj->b", basis, inverse, basis), _ALL_LEVERAGE)
        error = float(np.sqrt(np.mean((off / spare) ** 2)))  # leave-one-out error
        scatter = float(np.sqrt(np.mean(off**2 / spare)))
        if best is None or error < _BETTER * best[0]:
            coefficients = inverse @ basis.T @ logs
            best = error, ValueSurface(terms, coefficients, scatter**2 * inverse, scatter, common)
    assert best is not None  # a constant is always tried
    return best[1]


def design(terms: Terms, scaled: FloatArray) -> FloatArray:
    """Products of powers (Q, K) of scaled points (Q, d).

    Examples
    --------
    >>> design(((0,), (1,), (2,)), np.array([[0.5]]))
    array([[1.  , 0.5 , 0.25]])
    """
    if not terms:
        raise ModelError("a surface needs a term at least")
    powers = np.asarray(terms, dtype=int).reshape(len(terms), -1)
    return np.asarray(np.prod(scaled[:, None, :] ** powers[None], axis=2))


def term_sets(levels: Sequence[int], count: int) -> list[Terms]:
    """Surfaces worth trying for axes of so many levels and so many conditions, the simplest first.

    Of each axis a degree up to 3 and below its levels; no products of axes, those up to the highest degree, or all. No
    more conditions than axes and one leave no choice: straight lines between them.

    Examples
    --------
    >>> term_sets([3], 4)
    [((0,),), ((0,), (1,)), ((0,), (1,), (2,))]
    """
    if 1 < count <= len(levels) + 1:  # too few to judge by: straight between them
        return [tuple(tuple(int(at == axis) for at in range(len(levels))) for axis in range(-1, len(levels)))[:count]]
    most = max(int(_MOST_TERMS * count), 1)
    found: dict[Terms, None] = {}
    for degrees in product(*(range(min(level - 1, _MOST_DEGREE) + 1) for level in levels)):
        every = sorted(product(*(range(degree + 1) for degree in degrees)), key=lambda one: (sum(one), one[::-1]))
        additive = tuple(one for one in every if sum(power > 0 for power in one) <= 1)
        limited = tuple(one for one in every if sum(one) <= max(degrees, default=0))
        for terms in (additive, limited, tuple(every)):
            if len(terms) <= most:
                found[terms] = None
    return sorted(found, key=len)


def _levels(values: FloatArray) -> int:
    """Number of different values."""
    rising = np.unique(values)
    if rising.size < 2:
        return int(rising.size)
    least = np.maximum(_SAME * (rising[-1] - rising[0]), 1e-3 * np.abs(rising[1:]))
    return 1 + int(np.sum(np.diff(rising) > least))
