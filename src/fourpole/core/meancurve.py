"""The mean of the loading and unloading branches, as a polynomial whose order is selected by an information criterion.

Each rest of a stepped record is one observation. What is not held, as a slip angle or a camber, differs between rests
by more than the noise of their samples. So the scatter of the rests about the curve, not that of the samples, is the
measure of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, FloatArray, IntArray
from fourpole.core.branches import levels, means, ranks, rests, whitened
from fourpole.errors import LoadCurveError

_HIGHEST_ORDER = 9
_GAP_ORDER = 8
_ROUND_GAP_ORDER = 3
#: Relative round-off of a load, and the relative uncertainty of a slope that it makes.
_ROUND_OFF, _LEAST_STD = 1e-13, 1e-9
#: Consecutive points are averaged to about this many rows, unless a row would cover more than this share of the span.
_ROWS, _NARROW = 160, 0.05
#: Below this many rows, the residuals count as independent.
_FEWEST_FOR_MEMORY = 20
#: A point is an outlier beyond this many standard deviations, unless more than this share of the points are.
_FAR_OFF, _MOST_OUTLIERS = 10.0, 0.02
#: Least weight of a fit, and largest number of fits.
_LEAST_WEIGHT, _MOST_FITS = 1e-2, 16
#: Largest number of terms of half the gap of the branches through rests, and fewest degrees of freedom for which
#: Student's t has a standard deviation.
_GAPS, _FEWEST_DOF = 3, 3
#: A measured load may lie on the mean of the branches up to this share of the span beyond the fitted deflections.
_EDGE = 0.02
#: Parts of the span round a load that are tried for the tangent; the least number of points on each branch there, and
#: of twentieths of the part in which these lie.
_PARTS, _FEWEST_IN_PART, _FEWEST_LEVELS = (0.6, 0.36), 15, 10
#: A part is taken if its uncertainty is below this share of that of the larger one.
_SURER = 0.6
#: No part is tried if the relative uncertainty is below this.
_SURE = 1e-5


@dataclass(frozen=True, eq=False)
class MeanCurve(ByValue):
    """A fitted mean curve P(x), with half the gap of the branches H(x).

    Attributes
    ----------
    centre, half : float [m]
        Centre and half width of the deflections.
    fits : list of float arrays
        Chebyshev coefficients of P for several orders of P and H, the best first.
    covariances : list of tuples of float arrays
        Covariances of each fit, of which the largest counts: for the memory of the residuals that was found, and for
        any short one; of a stepped record, by the scatter of its rests, of their levels and of the samples.
    weights : (n,) float array
        Weight of each fit, from its BIC; the sum of all weights is 1.
    gap, round_gap : float arrays
        Chebyshev coefficients of the plain part of H, and of the part that a half circle over the span multiplies.
    residual : (N,) float [N]
        Load minus fit at each point.
    stepped : bool
        Whether the curve goes through the rests of a stepped record.
    """

    centre: float
    half: float
    fits: list[FloatArray]
    covariances: Sequence[tuple[FloatArray, ...]]
    weights: FloatArray
    gap: FloatArray
    round_gap: FloatArray
    residual: FloatArray
    stepped: bool = False

    @property
    def order(self) -> int:
        """The order of P of the best fit."""
        return self.fits[0].size - 1

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest deflection [m]."""
        return self.centre - self.half, self.centre + self.half

    def _place(self, deflection: ArrayLike) -> FloatArray:
        return (np.asarray(deflection, dtype=float) - self.centre) / self.half

    def value(self, deflection: ArrayLike) -> FloatArray:
        """Mean load P at a deflection [m], in N."""
        return chebyshev.chebval(self._place(deflection), self.fits[0])

    def slope(self, deflection: float) -> float:
        """Slope P' [N/m] at a deflection [m]."""
        by = chebyshev.chebder(self.fits[0])
        return float(chebyshev.chebval(self._place(deflection), by)) / self.half

    def bend(self, deflection: float) -> float:
        """Second derivative P'' [N/m²] at a deflection [m]."""
        coefficients = chebyshev.chebder(self.fits[0], 2)
        return float(chebyshev.chebval(self._place(deflection), coefficients)) / self.half**2

    def tangent(self, deflection: float) -> tuple[float, float]:
        """Slope at the load of this deflection, of the best fit, and its standard uncertainty [N/m].

        The uncertainty has the scatter of the points and the choice of the orders.
        """
        place, best = self._place(deflection), self.slope(deflection)
        follow = self.bend(deflection) / best if best else 0.0
        unit = np.eye(max(fit.size for fit in self.fits))
        rise = chebyshev.chebval(place, chebyshev.chebder(unit)) / self.half
        by = rise - follow * chebyshev.chebval(place, unit)
        slopes = np.array([rise[: fit.size] @ fit for fit in self.fits])
        variances = np.array(
            [max(0.0, *(by[: len(one)] @ one @ by[: len(one)] for one in every)) for every in self.covariances]
        )
        variance = float(self.weights @ (variances + (slopes - best) ** 2))
        return best, float(np.hypot(np.sqrt(variance), _LEAST_STD * best))

    def _half_gap(self, place: FloatArray) -> FloatArray:
        """H at places from -1 to 1 [N]."""
        circle = np.sqrt(1 - place**2)
        return np.asarray(chebyshev.chebval(place, self.gap) + circle * chebyshev.chebval(place, self.round_gap))

    def gap_at(self, deflection: float) -> float:
        """Load of the loading branch minus that of the unloading branch, 2 H [N]."""
        return float(2 * self._half_gap(np.clip(self._place(deflection), -1.0, 1.0)))

    def load(self, deflection: FloatArray, side: FloatArray | None) -> FloatArray:
        """Load of the branches, P + side H, at deflections [m], in N."""
        half_gap = self._half_gap(np.clip(self._place(deflection), -1.0, 1.0))
        return self.value(deflection) + (0.0 if side is None else side * half_gap)

    def slope_gap(self, deflection: float) -> float:
        """Slope of the loading branch minus that of the unloading branch, 2 H' [N/m]."""
        step = 1e-4
        middle = np.clip(self._place(deflection), -1 + 2 * step, 1 - 2 * step)
        low, high = self._half_gap(middle + np.array([-step, step]))
        return float(2 * (high - low) / (2 * step * self.half))


def fit_curve(deflection: FloatArray, load: FloatArray, side: FloatArray | None, *, alone: bool = False) -> MeanCurve:
    """Fit F = P(x) + side H(x) to the points, or to the rests of a stepped record; see `fit_mean_curve`."""
    number = rests(deflection, load)
    if number is None:
        return fit_mean_curve(deflection, load, side, alone=alone)
    return _fit_rests(deflection, load, side, number)


def fit_mean_curve(
    deflection: FloatArray, load: FloatArray, side: FloatArray | None, *, whole: bool = True, alone: bool = False
) -> MeanCurve:
    """Fit F = P(x) + side H(x); `side` is +1 on loading, -1 on unloading, None for a single branch.

    `whole` says whether the branches turn at the ends of the deflections, as they do not in a part of a cycle. The best
    fit `alone` is enough where no uncertainty is asked.
    """
    low, high = float(deflection.min()), float(deflection.max())
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    place = np.clip((deflection - centre) / half, -1.0, 1.0)
    # Half the number of deflections allows a few points read by hand to show a curvature.
    highest = int(np.clip(levels(place) // 2, 1, _HIGHEST_ORDER))
    powers = chebyshev.chebvander(place, _HIGHEST_ORDER)
    plain, rounded = (0, 0) if side is None else _gap_terms(place, side, whole=whole)
    turning = (np.zeros_like(place) if side is None else side)[:, None]
    circle = turning * np.sqrt(1.0 - place**2)[:, None]
    parts = turning * powers[:, :plain], circle * powers[:, :rounded], powers[:, : highest + 1], load[:, None]
    table = np.concatenate(parts, axis=1)
    rows, starts = _rows(table, place, side)
    ranked = _ranked(rows, starts, plain, rounded, float(np.max(np.abs(load))))[: 1 if alone else None]

    first, covariances = np.zeros(table.shape[1] - 1), []
    fits: list[FloatArray] = []
    for _, white, triangle, used in ranked:
        inverse = np.linalg.pinv(triangle[:, used], rcond=1e-12)
        free = inverse @ triangle[:, -1]
        if not fits:
            first[used] = free
        gap = sum(column < plain + rounded for column in used)
        fits.append(free[gap:])
        covariances.append(_covariances(white[:, used], white[:, -1] - white[:, used] @ free, inverse, gap))
    weights = np.array([weight for weight, *_ in ranked])
    return MeanCurve(
        centre=centre,
        half=half,
        fits=fits,
        covariances=covariances,
        weights=weights / weights.sum(),
        gap=first[:plain] if plain else np.zeros(1),
        round_gap=first[plain : plain + rounded] if rounded else np.zeros(1),
        residual=load - table[:, :-1] @ first,
    )


def _gap_terms(place: FloatArray, side: FloatArray, *, whole: bool) -> tuple[int, int]:
    """Terms of H that the points of a branch allow: of plain polynomials, and of those with a half circle."""
    fewest = min(levels(place[side > 0]), levels(place[side < 0]))
    plain = max(1, min(_GAP_ORDER + 1, fewest // 2))
    return plain, min(_ROUND_GAP_ORDER + 1, fewest // 4) if whole else 0


def _rows(table: FloatArray, place: FloatArray, side: FloatArray | None) -> tuple[FloatArray, BoolArray]:
    """Means of consecutive points, and whether each begins a stretch; a model of the points is one of their means.

    A stretch is a branch.
    """
    count = place.size
    changes = np.zeros(count, dtype=bool) if side is None else np.diff(side, prepend=side[0]) != 0
    branch = np.cumsum(changes)
    size = max(1, count // _ROWS)
    if size > 1:
        begins = np.flatnonzero(np.diff(branch, prepend=-1))
        edges = np.concatenate([np.arange(a, b, size) for a, b in zip(begins, [*begins[1:], count], strict=True)])
        lengths = np.diff(edges, append=count)
        means = np.add.reduceat(table, edges) / lengths[:, None]
        spread = np.add.reduceat(place**2, edges) / lengths - (np.add.reduceat(place, edges) / lengths) ** 2
        if np.sqrt(max(float(spread.mean()), 0.0)) < _NARROW:
            kept = np.sqrt(lengths / size)
            return means * kept[:, None], np.diff(branch[edges], prepend=-1) != 0
    return table, np.diff(branch, prepend=-1) != 0


def _ranked(
    rows: FloatArray, starts: BoolArray, plain: int, rounded: int, largest: float
) -> list[tuple[float, FloatArray, FloatArray, list[int]]]:
    """Weight, whitened rows, their triangle and columns in use of the models that count, the best first.

    The best has the least BIC. The weights are by the criterion of Hannan and Quinn, which keeps more terms: a term
    that the data do not require may still be there.
    """
    count, width = rows.shape[0], rows.shape[1] - 1
    floor = max(count * (_ROUND_OFF * largest) ** 2, float(np.finfo(np.float64).tiny))  # of a curve without any load
    exact = count > width and float(np.asarray(np.linalg.qr(rows, mode="r"))[-1, -1] ** 2) < 10.0 * floor
    tables, logs, parameters = whitened(rows, starts, plain=exact or count < _FEWEST_FOR_MEMORY)
    gaps = _gap_choices(plain, rounded)
    orders = np.arange(1, width - plain - rounded)
    misfit = np.full((len(tables), len(gaps), orders.size), np.inf)
    free = np.array([[len(gap) + order + 1 for order in orders] for gap in gaps])
    triangles = np.asarray(np.linalg.qr(tables, mode="r")) if count > width else tables
    both = plain + rounded
    lefts = _squares_left(triangles, range(plain), both, 0) + _squares_left(triangles, range(plain, both), both, 1)
    lefts += _squares_left(triangles, range(both), both, both) if rounded else []
    for n, left in enumerate(lefts):
        there = free[n] < min(count - 2, len(gaps[n]) + left.shape[1])
        squares = np.maximum(left[:, orders[there] + 1], floor)
        misfit[:, n, there] = count * np.log(squares) + logs[:, None]
    known = free + parameters[:, None, None]
    bic = (misfit + known * np.log(count)).min(axis=0)
    memory = np.argmin(misfit + known * np.log(count), axis=0)
    other = (misfit + 2.0 * known * np.log(np.log(count))).min(axis=0)
    weights = np.exp(-0.5 * (other - other.min()))
    first = np.unravel_index(int(np.argmin(bic)), bic.shape)
    listed = sorted(zip(*np.nonzero(weights > _LEAST_WEIGHT), strict=True), key=lambda choice: -weights[choice])
    ranked = []
    for n, k in [first, *(choice for choice in listed if choice != first)][:_MOST_FITS]:
        used = [*gaps[n], *range(plain + rounded, plain + rounded + int(orders[k]) + 1)]
        ranked.append((float(weights[n, k]), tables[memory[n, k]], triangles[memory[n, k]], used))
    return ranked


def _squares_left(triangles: FloatArray, gap: range, start: int, fewest: int) -> list[FloatArray]:
    """Sums of squares left (G, k) by the first `fewest` to all of these columns of H, with the first k columns of P.

    The columns of P begin at `start`. Each column of H that is omitted adds a row to the triangle of those of P.
    """
    columns, last, lefts = [*gap, *range(start, triangles.shape[2])], len(gap), []
    table = np.asarray(np.linalg.qr(triangles[:, :, columns], mode="r"))
    rest = table[:, last:, last:]
    for count in range(last, fewest - 1, -1):
        if count < last:
            rest = np.asarray(np.linalg.qr(np.concatenate([table[:, [count], last:], rest], axis=1), mode="r"))
        lefts.append(np.cumsum(rest[:, ::-1, -1] ** 2, axis=1)[:, ::-1])
    return lefts[::-1]


def _gap_choices(plain: int, rounded: int) -> list[list[int]]:
    """Columns of H to choose from: none, polynomials, polynomials with a half circle, and both."""
    if not plain:
        return [[]]
    choices = [list(range(count)) for count in range(plain + 1)]
    choices += [list(range(plain, plain + count)) for count in range(1, rounded + 1)]
    return [*choices, list(range(plain + rounded))] if rounded else choices


def _covariances(
    columns: FloatArray, residual: FloatArray, inverse: FloatArray, first: int
) -> tuple[FloatArray, FloatArray]:
    """Covariance of the coefficients from `first` on: for independent residuals, and for a correlation that fades.

    `inverse` is the pseudoinverse of the columns, or of their triangle. Sums of the scores over a moving window give
    the covariances at each lag the weights of Bartlett.
    """
    count, free = columns.shape
    dof = max(count - free, 1)
    reach = int(1.5 * count ** (1 / 3)) + 1 if count >= _FEWEST_FOR_MEMORY else 1
    sums = np.zeros((count + 2 * reach - 1, free))
    sums[reach : reach + count] = columns * residual[:, None]
    np.cumsum(sums, axis=0, out=sums)
    square = inverse @ inverse.T
    windows = (sums[reach:] - sums[:-reach]) @ square[:, first:]
    return float(residual @ residual) / dof * square[first:, first:], windows.T @ windows / reach * count / dof


def off_the_curve(curve: MeanCurve, load: FloatArray) -> BoolArray:
    """Flags of the points whose residual is far beyond the scatter of the others, if they are few."""
    scatter = 1.4826 * float(np.median(np.abs(curve.residual)))
    limit = max(_FAR_OFF * scatter, 0.01 * float(np.ptp(load)))
    off = np.abs(curve.residual) > limit
    return off if off.mean() <= _MOST_OUTLIERS else np.zeros_like(off)


def _fit_rests(deflection: FloatArray, load: FloatArray, side: FloatArray | None, number: IntArray) -> MeanCurve:
    """The curve through the means of the rests, each with the weight of its samples.

    The orders have the least AICc, that of P of as many observations as there are levels: repeats of a level tell its
    scatter, not the shape between levels.
    """
    low, high = float(deflection.min()), float(deflection.max())
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    places, held = (means(number, deflection) - centre) / half, means(number, load)
    gaps = [0] if side is None else range(_GAPS + 1)
    side = np.zeros(load.size) if side is None else side
    branch = np.sign(means(number, side))
    level = ranks(number, deflection, load)
    count = int(level.max()) + 1
    samples = np.bincount(number[number >= 0])
    samples = samples[samples > 0]
    root = np.sqrt(samples / samples.mean())

    highest = int(np.clip(count // 2, 1, _HIGHEST_ORDER))
    choices = [(gap, order) for gap in gaps for order in range(1, highest + 1) if gap + order + 1 < places.size]
    fits = [_of_orders(places, held, branch, root, level, *choice) for choice in choices]
    floor = places.size * (_ROUND_OFF * float(np.max(np.abs(load)))) ** 2
    score = np.array([count * np.log(max(misfit, floor)) for _, misfit, *_ in fits])
    score += [_penalty(count, order + 1) + _penalty(places.size, gap) for gap, order in choices]
    weights = np.exp(-0.5 * (score - score.min()))
    kept = [k for k in np.argsort(-weights).tolist() if weights[k] >= _LEAST_WEIGHT]

    gap = choices[kept[0]][0]
    first = fits[kept[0]][0]
    place = np.clip((deflection - centre) / half, -1.0, 1.0)
    fitted = chebyshev.chebval(place, first[gap:])
    if gap:
        fitted = fitted + side * chebyshev.chebval(place, first[:gap])
    residual = load - fitted
    # Variance of the mean of a rest by the scatter of its samples [N²].
    rest = number[number >= 0]
    left = residual[number >= 0] - (np.bincount(rest, residual[number >= 0]) / np.maximum(np.bincount(rest), 1))[rest]
    noise = float(left @ left) / max(left.size - samples.size, 1) / float(samples.mean())
    return MeanCurve(
        centre=centre,
        half=half,
        fits=[fits[k][0][choices[k][0] :] for k in kept],
        covariances=[_covariances_of_rests(fits[k], places.size, count, noise, choices[k][0]) for k in kept],
        weights=weights[kept] / weights[kept].sum(),
        gap=first[:gap] if gap else np.zeros(1),
        round_gap=np.zeros(1),
        residual=residual,
        stepped=True,
    )


def _of_orders(
    places: FloatArray, held: FloatArray, branch: FloatArray, root: FloatArray, level: IntArray, gap: int, order: int
) -> tuple[FloatArray, float, float, FloatArray]:
    """Coefficients of H and P, sums of squares [N²] of rests and of levels, and inverse of the normal matrix."""
    columns = chebyshev.chebvander(places, order)
    if gap:
        columns = np.concatenate([branch[:, None] * chebyshev.chebvander(places, gap - 1), columns], axis=1)
    table = columns * root[:, None]
    free = np.linalg.lstsq(table, held * root, rcond=1e-12)[0]
    left = held * root - table @ free
    common = np.bincount(level, root * left) ** 2 / np.bincount(level, root**2)
    inverse = np.linalg.pinv(table.T @ table, rcond=1e-14, hermitian=True)
    return free, float(left @ left), float(common.sum()), inverse


def _penalty(count: int, free: int) -> float:
    """Penalty of Akaike's criterion, corrected for a small count; very large where it does not carry the terms."""
    spare = count - free - 1
    return 2.0 * free * (1.0 + (free + 1.0) / spare) if spare > 0 else 1e9 + free


def _covariances_of_rests(
    fit: tuple[FloatArray, float, float, FloatArray], rests: int, levels: int, noise: float, first: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Covariance of the coefficients from `first` on: by the scatter of rests, of levels, and of samples.

    Repeats of a level share its misfit, so that of the levels counts by itself. Few rests know their scatter badly: the
    variance is that of Student's t (JCGM 101:2008, 6.4.9).
    """
    free, misfit, common, inverse = fit
    dof = max(rests - free.size, 1)
    wide = max(dof, _FEWEST_DOF) / (max(dof, _FEWEST_DOF) - 2.0)
    part = inverse[first:, first:]
    return wide * misfit / dof * part, common / max(levels - free.size + first, 1) * part, noise * part


class Pairs(NamedTuple):
    """Deflection [m], load [N] and side (+1 loading, -1 unloading; None for a single branch) of points."""

    deflection: FloatArray
    load: FloatArray
    side: FloatArray | None

    def part(self, flags: BoolArray) -> Pairs:
        """The points that are flagged."""
        return Pairs(self.deflection[flags], self.load[flags], None if self.side is None else self.side[flags])


class Local(NamedTuple):
    """The tangent at a load from a part of a curve.

    Attributes
    ----------
    curve : MeanCurve
        The fit of the part.
    place : float [m]
        Deflection at the load.
    slope, std : float [N/m]
        Tangent and its standard uncertainty.
    middle, reach : float [m]
        Middle and half width of the part; the reach is 0 for the whole.
    """

    curve: MeanCurve
    place: float
    slope: float
    std: float
    middle: float = 0.0
    reach: float = 0.0


def surest(points: Pairs, whole: MeanCurve, place: float, load: float) -> Local:
    """The tangent at a load [N] from the part of the points with the smallest uncertainty of it.

    A part around the load needs no model of the turns, where friction and relaxation bend the branches; the whole has
    more points. A part is used if its uncertainty is clearly smaller. If the tangents of the parts differ by more than
    their uncertainties, the uncertainty of the tangent is enlarged. A curve through rests is always used whole.
    """
    low, high = whole.span
    parts = [Local(whole, place, *whole.tangent(place))]
    for share in _PARTS if parts[0].std > _SURE * parts[0].slope and not whole.stepped else ():
        reach = 0.5 * share * (high - low)
        local = in_part(points, float(np.clip(place, low + reach, high - reach)), reach, load)
        parts += [local] if local is not None else []
    best = parts[0]
    for part in parts[1:]:
        best = part if part.std < _SURER * best.std else best
    others = [(part.slope - best.slope) ** 2 / max(part.std, best.std) ** 2 for part in parts if part is not best]
    spread = float(np.sqrt(max(1.0, float(np.mean(others)) if others else 0.0)))
    return best._replace(std=best.std * spread)


def in_part(points: Pairs, middle: float, reach: float, load: float, *, alone: bool = False) -> Local | None:
    """The tangent at a load [N] from the points of a part; None if it has too few, or does not rise to the load."""
    near = points.part(np.abs(points.deflection - middle) <= reach)
    if not _enough(near.deflection, near.side):
        return None
    local = fit_mean_curve(*near, whole=False, alone=alone)
    try:
        place = deflection_at(local, load)
    except LoadCurveError:
        return None
    return Local(local, place, *local.tangent(place), middle, reach) if local.slope(place) > 0 else None


def _enough(deflection: FloatArray, side: FloatArray | None) -> bool:
    """Whether each branch has enough points, at enough deflections."""
    branches = [deflection] if side is None else [deflection[side > 0], deflection[side < 0]]
    return all(branch.size >= _FEWEST_IN_PART and levels(branch) >= _FEWEST_LEVELS for branch in branches)


def deflection_at(curve: MeanCurve, load: float) -> float:
    """Deflection at a load on the rising mean curve, at most `_EDGE` of the span past its ends."""
    low, high = curve.span
    margin = _EDGE * (high - low)
    x = np.linspace(low - margin, high + margin, 801)
    for _ in range(3):
        above = curve.value(x) - load
        crossing = np.flatnonzero((above[:-1] <= 0) & (above[1:] > 0))
        if not crossing.size:
            raise LoadCurveError(f"the mean of the branches does not reach {load:g} N: no extrapolation")
        inside = crossing[np.argmin(np.abs(x[crossing] - np.clip(x[crossing], low, high)))]
        (a, b), (under, over) = x[inside : inside + 2], above[inside : inside + 2]
        x = np.linspace(a, b, 201)
    return float(a - under * (b - a) / (over - under))
