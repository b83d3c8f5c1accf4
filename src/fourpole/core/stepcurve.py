"""The curve through the rests of a stepped record, of which each rest is one observation.

What is not held, as a slip angle or a camber, differs between rests by more than the noise of their samples. So the
scatter of the rests about the curve, not that of the samples, is the measure of the uncertainty.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from fourpole.core.arrays import FloatArray, IntArray
from fourpole.core.branches import means, ranks, rests
from fourpole.core.meancurve import MeanCurve, fit_mean_curve

_HIGHEST_ORDER = 9
#: Relative round-off of a load.
_ROUND_OFF = 1e-13
#: Largest number of terms of half the gap of the branches.
_GAPS = 3
#: Least weight of a fit.
_LEAST_WEIGHT = 1e-2
#: Fewest degrees of freedom for which Student's t has a standard deviation.
_FEWEST_DOF = 3


def fit_curve(deflection: FloatArray, load: FloatArray, side: FloatArray | None, *, whole: bool = True) -> MeanCurve:
    """Fit F = P(x) + side H(x) to the points, or to the rests of a stepped record; see `fit_mean_curve`."""
    number = rests(deflection, load)
    if number is None:
        return fit_mean_curve(deflection, load, side, whole=whole)
    return _fit_rests(deflection, load, side, number)


def _fit_rests(deflection: FloatArray, load: FloatArray, side: FloatArray | None, number: IntArray) -> MeanCurve:
    """The curve through the means of the rests, each with the weight of its samples.

    The orders have the least AICc, that of P of as many observations as there are levels: repeats of a level tell its
    scatter, not the shape between levels.
    """
    low, high = float(deflection.min()), float(deflection.max())
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    at, held = (means(number, deflection) - centre) / half, means(number, load)
    branch = np.zeros(at.size) if side is None else np.sign(means(number, side))
    level = ranks(number, deflection, load)
    count = int(level.max()) + 1
    samples = np.bincount(number[number >= 0])
    samples = samples[samples > 0]
    root = np.sqrt(samples / samples.mean())

    highest = int(np.clip(count // 2, 1, _HIGHEST_ORDER))
    choices = [(gap, order) for gap in range(1 if side is None else _GAPS + 1) for order in range(1, highest + 1)]
    choices = [choice for choice in choices if sum(choice) + 1 < at.size]
    fits = [_one(at, held, branch, root, level, *choice) for choice in choices]
    floor = at.size * (_ROUND_OFF * float(np.max(np.abs(load)))) ** 2
    score = np.array([count * np.log(max(misfit, floor)) for _, misfit, *_ in fits])
    score += [_penalty(count, order + 1) + _penalty(at.size, gap) for gap, order in choices]
    weights = np.exp(-0.5 * (score - score.min()))
    kept = [int(one) for one in np.argsort(-weights) if weights[one] >= _LEAST_WEIGHT]

    gap = choices[kept[0]][0]
    first = fits[kept[0]][0]
    place = np.clip((deflection - centre) / half, -1.0, 1.0)
    fitted = chebyshev.chebval(place, first[gap:])
    if gap and side is not None:
        fitted = fitted + side * chebyshev.chebval(place, first[:gap])
    residual = load - fitted
    noise = _noise(residual, number) / float(samples.mean())
    return MeanCurve(
        centre=centre,
        half=half,
        fits=[fits[one][0][choices[one][0] :] for one in kept],
        covariances=[_covariances(fits[one], at.size, count, noise, choices[one][0]) for one in kept],
        weights=weights[kept] / weights[kept].sum(),
        gap=first[:gap] if gap else np.zeros(1),
        round_gap=np.zeros(1),
        residual=residual,
        stepped=True,
    )


def _one(
    at: FloatArray, held: FloatArray, branch: FloatArray, root: FloatArray, level: IntArray, gap: int, order: int
) -> tuple[FloatArray, float, float, FloatArray]:
    """Coefficients of H and P, sums of squares [N²] of rests and of levels, and inverse of the normal matrix."""
    columns = chebyshev.chebvander(at, order)
    if gap:
        columns = np.concatenate([branch[:, None] * chebyshev.chebvander(at, gap - 1), columns], axis=1)
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


def _covariances(
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


def _noise(residual: FloatArray, number: IntArray) -> float:
    """Variance of the samples about the means of their rests [N²]."""
    held = number >= 0
    own = np.bincount(number[held], residual[held]) / np.maximum(np.bincount(number[held]), 1)
    left = residual[held] - own[number[held]]
    return float(left @ left) / max(left.size - np.unique(number[held]).size, 1)
