"""Leave-one-out: each condition compared with the fit of the others, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.models.data import multiplication
from fourpole.models.laws import Normal
from fourpole.models.linearised import Rows, Weights
from fourpole.models.together import Together

#: Least value of 1 - leverage: the leverage is 1 in directions that no other condition determines.
_LEAST_REMAINDER = 1e-9


@dataclass(frozen=True)
class LeaveOneOut:
    """Comparison of each condition with the map of the other conditions; not-a-number if no condition can be omitted.

    Attributes
    ----------
    error : float [1]
        Leave-one-out error: root mean square difference between measured and predicted K*, relative.
    inside : float [1]
        Fraction of all K' and K'' that are inside the predicted 95 % intervals.
    conditions : float [1]
        Fraction of the conditions whose K' and K'' at the middle frequency are both inside.
    """

    error: float = float("nan")
    inside: float = float("nan")
    conditions: float = float("nan")

    @classmethod
    def of(cls, found: Together) -> LeaveOneOut:
        """The leave-one-out errors of a fit; changes of parameters and shared errors are of first order."""
        change, covariance = without_each(found.normal, found.inverse)
        size = found.linked.shape[1]
        errors = found.errors + change[:, size:]
        for part in found.conditions.errors_of_model:  # the map does not correct K* for the error of the model
            errors[:, part] = 0.0
            columns = slice(size + part.start, size + part.stop)
            covariance[:, columns] = covariance[:, :, columns] = 0.0
        variances = found.scatter.summed.variances
        moved = found.linked + change[:, :size], errors
        squares, scores, middle = [], [], []
        for rows, left in zip(found.rows, found.conditions.residuals(*moved, found.rows), strict=True):
            off, spread = _predicted(rows, variances, left, covariance[rows.places])
            squares.append(np.sum(off**2, axis=2).ravel())
            score = np.abs(off) / np.sqrt(spread)
            scores.append(score.ravel())
            middle.append(score[:, score.shape[1] // 2].max(axis=1))
        return cls(
            error=float(np.sqrt(np.mean(np.concatenate(squares)))),
            inside=float(np.mean(np.concatenate(scores) < NORMAL_95)),
            conditions=float(np.mean(np.concatenate(middle) < NORMAL_95)),
        )


def without_each(normal: Normal, inverse: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Changes (B, L) of the local vector of each condition when it is omitted, and its covariance (B, L, L) then.

    With the local covariance C, information A and gradient g they are -(1 - C A)^-1 C g and (1 - C A)^-1 C.
    """
    spread = normal.local_covariance(inverse)
    covariance = np.linalg.solve(_remainder(normal, spread), spread)
    return -(covariance @ normal.right[..., None])[..., 0], covariance


def _remainder(normal: Normal, spread: FloatArray) -> FloatArray:
    """1 - C A (B, L, L)."""
    return np.asarray((1.0 + _LEAST_REMAINDER) * np.eye(spread.shape[1]) - spread @ normal.gram)


def misfit_without_each(rows: Sequence[Rows], weights: Sequence[Weights], normal: Normal) -> tuple[float, float]:
    """Chi-square of each condition against the fit of the others, summed, and the leave-one-out error of K*, relative.

    The fit is that of linear equations.
    """
    whole, _, local = normal.solved()
    spread = normal.local_covariance(whole)
    gradient = normal.right[..., None] - normal.gram @ local[..., None]
    change = -np.linalg.solve(_remainder(normal, spread), spread @ gradient)[..., 0]
    total, squares = 0.0, []
    for one, weight in zip(rows, weights, strict=True):
        move = (local + change)[one.places]
        off = one.off - (one.columns @ move[..., None])[..., 0]
        total += weight.chi2(off)
        squares.append((off[:, : 2 * one.own.shape[1]] ** 2).ravel())
    return total, float(np.sqrt(2 * np.mean(np.concatenate(squares))))


def _predicted(
    rows: Rows, variances: FloatArray, left: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals (G, N, 2) of K' and K'' without the condition, from those (G, M) along K*, and their variance."""
    groups, count = rows.own.shape[:2]
    columns = rows.columns[:, : 2 * count]
    off = left[:, : 2 * count].reshape(groups, count, 2)
    pairs = columns.reshape(groups, count, 2, -1)
    spread = pairs @ covariance[:, None] @ np.swapaxes(pairs, 2, 3) + rows.own
    spread = spread + np.diag(variances[1:3] + variances[0])
    turn = multiplication(_direction(rows.scale))
    turned = (turn @ off[..., None])[..., 0]
    return turned, np.diagonal(turn @ spread @ np.swapaxes(turn, 2, 3), 0, 2, 3)


def _direction(values: ComplexArray) -> ComplexArray:
    """Complex numbers of modulus 1 in the directions of others."""
    return values / np.abs(values)
