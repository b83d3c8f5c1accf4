"""The mean of the loading and unloading branches, as a polynomial whose order is selected by BIC."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray

_HIGHEST_ORDER = 9
_GAP_ORDER = 8
_ROUND_GAP_ORDER = 3
#: Least number of independent residuals that correlated ones count as.
_FEWEST_INDEPENDENT = 20
_ROUND_OFF = 1e-13


@dataclass(frozen=True, eq=False)
class MeanCurve(ByValue):
    """A fitted mean curve P(x), with half the gap of the branches H(x).

    Attributes
    ----------
    centre, half : float [m]
        Centre and half width of the deflections.
    fits : dict of int to (float array, float array)
        Chebyshev coefficients of P and their covariance, by the order.
    weights : dict of int to float
        Weight of each order, from its BIC; the sum of all weights is 1.
    gap, round_gap : float arrays
        Chebyshev coefficients of the plain part of H, and of the part that a half circle over the span multiplies.
    residual : (N,) float [N]
        Load minus fit at each point.
    """

    centre: float
    half: float
    fits: dict[int, tuple[FloatArray, FloatArray]]
    weights: dict[int, float]
    gap: FloatArray
    round_gap: FloatArray
    residual: FloatArray

    @property
    def order(self) -> int:
        """The order of least BIC."""
        return max(self.weights, key=lambda order: self.weights[order])

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest deflection [m]."""
        return self.centre - self.half, self.centre + self.half

    def _place(self, deflection: ArrayLike) -> FloatArray:
        return (np.asarray(deflection, dtype=float) - self.centre) / self.half

    def value(self, deflection: ArrayLike) -> FloatArray:
        """Mean load P at a deflection [m], in N."""
        return chebyshev.chebval(self._place(deflection), self.fits[self.order][0])

    def slope(self, deflection: float, order: int | None = None) -> float:
        """Slope P' [N/m] at a deflection [m], for the order of least BIC or another one."""
        coefficients = self.fits[self.order if order is None else order][0]
        return float(chebyshev.chebval(self._place(deflection), chebyshev.chebder(coefficients))) / self.half

    def bend(self, deflection: float) -> float:
        """Second derivative P'' [N/m²] at a deflection [m]."""
        coefficients = chebyshev.chebder(self.fits[self.order][0], 2)
        return float(chebyshev.chebval(self._place(deflection), coefficients)) / self.half**2

    def slope_std(self, deflection: float) -> float:
        """Standard uncertainty of P' [N/m] from the scatter of the points and the choice of the order."""
        _, covariance = self.fits[self.order]
        by_coefficient = chebyshev.chebval(self._place(deflection), chebyshev.chebder(np.eye(covariance.shape[0])))
        scatter = float(by_coefficient @ covariance @ by_coefficient) / self.half**2
        best = self.slope(deflection)
        choice = sum(w * (self.slope(deflection, order) - best) ** 2 for order, w in self.weights.items())
        return float(np.sqrt(max(scatter, 0.0) + choice))

    @property
    def scatter(self) -> float:
        """Standard deviation of the residuals [N]."""
        return float(np.std(self.residual))

    def gap_at(self, deflection: float) -> float:
        """Load of the loading branch minus that of the unloading branch, 2 H [N]."""
        at = np.clip(self._place(deflection), -1.0, 1.0)
        half_gap = chebyshev.chebval(at, self.gap) + np.sqrt(1 - at**2) * chebyshev.chebval(at, self.round_gap)
        return float(2 * half_gap)

    def slope_gap(self, deflection: float) -> float:
        """Slope of the loading branch minus that of the unloading branch, 2 H' [N/m]."""
        step = 1e-4
        at = np.clip(self._place(deflection), -1 + 2 * step, 1 - 2 * step) + np.array([-step, step])
        half_gap = chebyshev.chebval(at, self.gap) + np.sqrt(1 - at**2) * chebyshev.chebval(at, self.round_gap)
        return float(2 * (half_gap[1] - half_gap[0]) / (2 * step * self.half))


def fit_mean_curve(deflection: FloatArray, load: FloatArray, side: FloatArray | None) -> MeanCurve:
    """Fit F = P(x) + side H(x); `side` is +1 on loading, -1 on unloading, None for a single branch."""
    low, high = float(deflection.min()), float(deflection.max())
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    place = np.clip((deflection - centre) / half, -1.0, 1.0)
    gap_columns, plain = _gap_columns(place, side)

    # Half the number of deflections allows a few points read by hand to show a curvature.
    highest = int(max(1, min(_HIGHEST_ORDER, np.unique(place).size // 2)))
    columns = np.concatenate([gap_columns, chebyshev.chebvander(place, highest).T])
    squares, independent = _residuals(columns, load, gap_columns.shape[0])
    floor = load.size * (_ROUND_OFF * np.max(np.abs(load))) ** 2
    orders = range(1, highest + 1)
    bic = {p: independent * np.log(max(squares[p], floor)) + (p + 1) * np.log(independent) for p in orders}
    least = min(bic.values())
    raw = {p: float(np.exp(-0.5 * (bic[p] - least))) for p in orders}
    weights = {p: w / sum(raw.values()) for p, w in raw.items() if w > 1e-4}

    fits: dict[int, tuple[FloatArray, FloatArray]] = {}
    best = max(weights.values())
    count = gap_columns.shape[0]
    gap: FloatArray = np.zeros(count)
    residual: FloatArray = load
    for p, weight in weights.items():
        coefficients, covariance = _least_squares(columns[: count + p + 1], load, independent)
        fits[p] = coefficients[count:], covariance[count:, count:]
        if weight == best:
            gap, residual = coefficients[:count], load - coefficients @ columns[: count + p + 1]
    return MeanCurve(
        centre=centre,
        half=half,
        fits=fits,
        weights=weights,
        gap=gap[:plain] if plain else np.zeros(1),
        round_gap=gap[plain:] if gap.size > plain else np.zeros(1),
        residual=residual,
    )


def _gap_columns(place: FloatArray, side: FloatArray | None) -> tuple[FloatArray, int]:
    """Columns of H, limited by the number of points on a branch, and the number of plain polynomials among them."""
    if side is None:
        return np.empty((0, place.size)), 0
    fewest = int(min(np.sum(side > 0), np.sum(side < 0)))
    plain = max(1, min(_GAP_ORDER + 1, fewest // 4))
    rounded = min(_ROUND_GAP_ORDER + 1, fewest // 10)
    half_circle = np.sqrt(1.0 - place**2)
    columns = [side * chebyshev.chebvander(place, plain - 1).T]
    if rounded:
        columns.append(side * half_circle * chebyshev.chebvander(place, rounded - 1).T)
    return np.concatenate(columns), plain


def _residuals(columns: FloatArray, load: FloatArray, first: int) -> tuple[dict[int, float], float]:
    """Sum of squared residuals for each order of P, and the effective number of independent points."""
    residual = load.copy()
    basis = np.empty_like(columns)
    squares: dict[int, float] = {}
    for i, column in enumerate(columns):
        rest = column.copy()
        for _ in range(2):
            rest -= basis[:i].T @ (basis[:i] @ rest)
        norm = np.linalg.norm(rest)
        basis[i] = rest / norm if norm > 1e-9 * np.linalg.norm(column) else 0.0
        for _ in range(2):
            residual = residual - basis[i] * (basis[i] @ residual)
        squares[i - first] = float(residual @ residual)
    count = load.size
    if count <= 2 * _FEWEST_INDEPENDENT or not squares[len(columns) - 1 - first] > 0:
        return squares, float(count)
    correlation = float(np.clip(residual[1:] @ residual[:-1] / (residual @ residual), 0.0, 1.0))
    return squares, max(count * (1 - correlation) / (1 + correlation), float(_FEWEST_INDEPENDENT))


def _least_squares(columns: FloatArray, load: FloatArray, independent: float) -> tuple[FloatArray, FloatArray]:
    """Coefficients and their covariance, for an effective number of `independent` points."""
    coefficients, _, rank, _ = np.linalg.lstsq(columns.T, load, rcond=1e-10)
    residual = load - coefficients @ columns
    dof = max(load.size - int(rank), 1)
    variance = float(residual @ residual) / dof * load.size / independent
    return coefficients, variance * np.linalg.pinv(columns @ columns.T, rcond=1e-14, hermitian=True)
