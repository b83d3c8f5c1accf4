"""Smooth surfaces over pressure, preload and other axes: polynomials of low order, and the hull of tested points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.interface import Link

#: Exponents of each axis, term by term.
Terms = tuple[tuple[int, ...], ...]
#: Highest exponent of one axis.
_MOST_DEGREE = 3
#: Largest number of terms, as a fraction of the number of conditions. The rest estimates the leave-one-out error.
_MOST_TERMS = 0.75
#: Values of an axis are one level if they differ by less than this fraction of its span, or 0.1 % of themselves.
_SAME = 0.02
#: A point is inside the hull up to this distance from it, in half spans. Weight of the condition "sum of weights = 1".
_ON_HULL = 1e-6
_HEAVY = 1e4
#: Standard deviation of a bend half way between two levels, as a fraction of the change between the levels.
BEND = 1.0 / 24.0
#: A larger surface must have an error below this fraction of that of a smaller one; least value of 1 - leverage.
_BETTER, _LEAST_REMAINDER = 0.98, 1e-6


@dataclass(frozen=True, eq=False)
class Axes(ByValue):
    """The axes of an operating map, and the values of the tested conditions on them.

    Attributes
    ----------
    names : tuple of str
        Columns with units, such as "pressure [Pa]".
    points : (B, d) float array
        Values of each condition.
    constant : dict of str to float
        Columns that have one value in all conditions, with that value.
    logarithmic : tuple of str
        Names of the axes that are scaled by their logarithm; all values on them are positive.
    """

    names: tuple[str, ...]
    points: FloatArray
    constant: dict[str, float]
    logarithmic: tuple[str, ...] = ()

    @classmethod
    def of(cls, names: Sequence[str], points: ArrayLike, logarithmic: Sequence[str] = ()) -> Axes:
        """Axes from the columns and their values (B, columns); columns that do not vary become `constant`.

        Examples
        --------
        >>> Axes.of(["pressure [Pa]", "preload [N]"], [[1.7e5, 1e3], [2.0e5, 1e3]]).constant
        {'preload [N]': 1000.0}
        """
        array = np.asarray(points, dtype=float)
        array = array.reshape(len(array), len(names))
        varied = [at for at in range(len(names)) if _levels(array[:, at]) > 1]
        fixed = {name: float(np.mean(array[:, at])) for at, name in enumerate(names) if at not in varied}
        axes = tuple(names[at] for at in varied)
        return cls(axes, array[:, varied], fixed, tuple(name for name in logarithmic if name in axes))

    @property
    def middle(self) -> FloatArray:
        """Middle of the span of each axis (d,), of the logarithm of a logarithmic one."""
        ends = self._measured(self.points)
        return np.asarray((ends.min(axis=0) + ends.max(axis=0)) / 2)

    @property
    def half(self) -> FloatArray:
        """Half the span of each axis (d,), of the logarithm of a logarithmic one."""
        ends = self._measured(self.points)
        return np.asarray((ends.max(axis=0) - ends.min(axis=0)) / 2)

    def _measured(self, points: FloatArray) -> FloatArray:
        """The points (Q, d) with the logarithm of their values on logarithmic axes."""
        if not self.logarithmic:
            return points
        logs = np.isin(self.names, self.logarithmic)
        return np.where(logs, np.log(np.where(logs, points, 1.0)), points)

    @property
    def levels(self) -> tuple[int, ...]:
        """Number of different values of each axis."""
        return tuple(_levels(self.points[:, at]) for at in range(len(self.names)))

    @property
    def straight(self) -> tuple[int, ...]:
        """Places of the axes with two levels, which cannot show a curvature between them."""
        return tuple(at for at, levels in enumerate(self.levels) if levels == 2)

    def scaled(self, points: ArrayLike) -> FloatArray:
        """Points (Q, d) [1] in units of half the span from the middle; tested values are between -1 and 1."""
        array = np.atleast_2d(np.asarray(points, dtype=float))
        return np.asarray((self._measured(array) - self.middle) / self.half)

    def tested(self, point: ArrayLike) -> int | None:
        """Place of the condition that was tested at a point (d,), within the tolerance of a level; None if none was."""
        off = np.max(np.abs(self.scaled(self.points) - self.scaled(point)), axis=1, initial=0.0)
        return int(np.argmin(off)) if np.min(off) <= _SAME else None

    def outside(self, point: ArrayLike) -> tuple[float, FloatArray]:
        """Distance of a point (d,) from the convex hull of the tested conditions, and the nearest point of the hull.

        Returns
        -------
        distance : float [1]
            Distance in half spans of the axes; 0 inside.
        nearest : (d,) float array

        Examples
        --------
        >>> axes = Axes.of(["pressure [Pa]", "preload [N]"], [[1e5, 1e3], [2e5, 1e3], [1e5, 2e3], [2e5, 2e3]])
        >>> axes.outside([1.5e5, 1.5e3])[0], axes.outside([2.5e5, 1.5e3])
        (0.0, (1.0, array([2.0e+05, 1.5e+03])))
        """
        if not self.names:
            return 0.0, np.zeros(0)
        corners, target = self.scaled(self.points), self.scaled(point)[0]
        # The nearest point is a mean of the corners with weights >= 0. One heavy row makes the weights add up to 1.
        rows = np.vstack([corners.T, np.full(len(corners), _HEAVY)])
        weights, _ = scipy.optimize.nnls(rows, np.append(target, _HEAVY))
        nearest = corners.T @ (weights / weights.sum())
        distance = float(np.linalg.norm(nearest - target))
        if distance < _ON_HULL:
            return 0.0, np.asarray(point, dtype=float)
        place = np.asarray(np.round(nearest, 6) * self.half + self.middle)
        return float(np.round(distance, 6)), np.exp(place, out=place, where=np.isin(self.names, self.logarithmic))


@dataclass(frozen=True, eq=False)
class ValueSurface(ByValue):
    """A positive value, such as K1, or its logarithm, as a polynomial of the scaled axes.

    Attributes
    ----------
    terms : Terms
    coefficients : (K,) float array
    covariance : (K, K) float array
    scatter : float [1]
        Relative standard deviation of the conditions about the surface.
    std : float [1]
        Relative standard uncertainty that all values share; averaging over conditions does not reduce it.
    link : Link
        Whether the polynomial is that of the logarithm.
    """

    terms: Terms
    coefficients: FloatArray
    covariance: FloatArray
    scatter: float
    std: float
    link: Link = "log"

    def at(
        self, scaled: FloatArray, straight: Sequence[int] = (), *, scattered: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """The value (Q,) and its standard uncertainty at scaled points (Q, d).

        `straight` are the axes with two levels; `scattered` says whether the scatter of the conditions counts.
        """
        basis = design(self.terms, scaled)
        linked = basis @ self.coefficients
        value = np.exp(linked) if self.link == "log" else linked
        unit = 1.0 if self.link == "log" else 1.0 / value
        variance = np.einsum("qi,ij,qj->q", basis, self.covariance, basis) * unit**2 + self.std**2
        variance = variance + scattered * self.scatter**2
        for share, low, high in bends(scaled, straight):
            change = (design(self.terms, high) - design(self.terms, low)) @ self.coefficients
            variance = variance + (share * change * unit) ** 2
        return value, value * np.sqrt(variance)


def bends(scaled: FloatArray, straight: Sequence[int]) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """For each axis with two levels: the uncertainty of a straight line between them, and the points (Q, d) on them.

    The uncertainty (Q,) [1] is a fraction of the change between the levels. A bend of one standard deviation makes the
    slope 1.4 times as steep at one level as at the other; a bend of two makes it three times as steep.
    """
    for axis in straight:
        low, high = scaled.copy(), scaled.copy()
        low[:, axis], high[:, axis] = -1.0, 1.0
        yield BEND * np.maximum(1.0 - scaled[:, axis] ** 2, 0.0), low, high


def value_surface(axes: Axes, values: ArrayLike, stds: ArrayLike, link: Link = "log") -> ValueSurface:
    """The surface of values (B,) with standard uncertainties (B,) that has the least relative leave-one-out error.

    Examples
    --------
    >>> axes = Axes.of(["pressure [Pa]"], [[1.0e5], [1.5e5], [2.0e5], [2.5e5]])
    >>> found = value_surface(axes, [100e3, 110e3, 121e3, 133.1e3], [1e3, 1.1e3, 1.21e3, 1.331e3])
    >>> value, std = found.at(axes.scaled([[1.75e5]]))
    >>> value.round(-1).tolist(), (std / value).round(4).tolist()
    ([115370.0], [0.01])
    """
    given = np.asarray(values, dtype=float)
    linked, unit = (np.log(given), np.ones(given.size)) if link == "log" else (given, 1.0 / given)
    common = float(np.sqrt(np.mean((np.asarray(stds, dtype=float) / given) ** 2)))
    scaled = axes.scaled(axes.points)
    best: tuple[float, ValueSurface] | None = None
    for terms in term_sets(axes.levels, given.size):
        basis = design(terms, scaled) * unit[:, None]
        inverse = np.linalg.pinv(basis.T @ basis, hermitian=True)
        off = linked * unit - basis @ (inverse @ basis.T @ (linked * unit))
        remainder = np.maximum(1.0 - np.einsum("bi,ij,bj->b", basis, inverse, basis), _LEAST_REMAINDER)
        error = float(np.sqrt(np.mean((off / remainder) ** 2)))
        scatter = float(np.sqrt(np.mean(off**2 / remainder)))
        if best is None or error < _BETTER * best[0]:
            coefficients = inverse @ basis.T @ (linked * unit)
            best = error, ValueSurface(terms, coefficients, scatter**2 * inverse, scatter, common, link)
    assert best is not None  # `term_sets` always has a constant
    return best[1]


def design(terms: Terms, scaled: FloatArray) -> FloatArray:
    """Basis functions (Q, K): products of powers of scaled points (Q, d), one product per term.

    Examples
    --------
    >>> design(((0,), (1,), (2,)), np.array([[0.5]])).tolist()
    [[1.0, 0.5, 0.25]]
    """
    if not terms:
        raise ModelError("a surface needs at least one term")
    powers = np.asarray(terms, dtype=int).reshape(len(terms), -1)
    return np.asarray(np.prod(scaled[:, None, :] ** powers[None], axis=2))


def term_sets(levels: Sequence[int], count: int) -> list[Terms]:
    """Candidate surfaces for the number of levels of each axis and the number of conditions, the smallest first.

    The degree of an axis is at most 3. It is 1 with two levels and 2 with three, which such a polynomial meets exactly.
    With more levels there is at least one more than the polynomial needs, so that a law that is no polynomial shows.
    Products of axes are omitted, limited to the highest degree, or all included. With fewer than two conditions for
    each term of the linear surface this is the only one: so few do not show whether an axis matters.

    Examples
    --------
    >>> term_sets([3], 3), term_sets([3], 4)
    ([((0,), (1,))], [((0,),), ((0,), (1,)), ((0,), (1,), (2,))])
    """
    if 1 < count < 2 * (len(levels) + 1):
        return [tuple(tuple(int(at == axis) for at in range(len(levels))) for axis in range(-1, len(levels)))[:count]]
    most = max(int(_MOST_TERMS * count), 1)
    found: dict[Terms, None] = {}
    for degrees in product(*(range(_degree(level) + 1) for level in levels)):
        every = sorted(product(*(range(degree + 1) for degree in degrees)), key=lambda one: (sum(one), one[::-1]))
        additive = tuple(one for one in every if sum(power > 0 for power in one) <= 1)
        limited = tuple(one for one in every if sum(one) <= max(degrees, default=0))
        for terms in (additive, limited, tuple(every)):
            if len(terms) <= most:
                found[terms] = None
    return sorted(found, key=len)


def _degree(levels: int) -> int:
    """Highest degree of an axis with a number of levels."""
    return min(levels - 1, max(levels - 2, 2), _MOST_DEGREE)


def _levels(values: FloatArray) -> int:
    """Number of different values, within the tolerance."""
    rising = np.unique(values)
    if rising.size < 2:
        return int(rising.size)
    least = np.maximum(_SAME * (rising[-1] - rising[0]), 1e-3 * np.abs(rising[1:]))
    return 1 + int(np.sum(np.diff(rising) > least))
