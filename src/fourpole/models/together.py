r"""One fit to many conditions whose parameters follow common laws: shared values, or surfaces over the conditions.

A link function g of each parameter of each condition follows a linear law,

.. math:: g(\theta_{cp}) = \sum_k \Phi^{(p)}_{ck}\,\beta^{(p)}_k .

The matrix of a law is a column of ones for a parameter that all conditions share, and it holds powers of the pressure
for a surface. A parameter without a law is an unknown of each condition, which is eliminated. Errors that all tests
share, such as gains of sensors, are parameters of the fit with their stated uncertainty: averaging over tests does not
reduce them. They act on K* of the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, multiplication
from fourpole.models.fit import Fit
from fourpole.models.interface import Model
from fourpole.models.laws import Laws, Normal
from fourpole.models.linearised import Conditions, Rows, Scatter, Weights

#: Maximum number of steps; start, factors after a good and a bad step, and maximum of the damping.
_STEPS, _DAMPING, _LOWER, _RAISE, _MOST_DAMPING = 100, 1e-3, 0.1, 8.0, 1e10
#: The search ends when the predicted reduction of chi-square is smaller than this, or that of the last steps together.
_SMALL_GAIN, _FLAT, _WINDOW = 1e-11, 1e-3, 10
#: Chi-square that a step may add by round-off, as a fraction of itself.
_ROUND_OFF = 1e-12
#: Least value of 1 - leverage: the leverage is 1 in directions that no other condition determines.
_LEAST_REMAINDER = 1e-9


@dataclass(frozen=True, eq=False)
class Together(ByValue):
    """The fit of a model to B conditions whose parameters follow laws.

    Attributes
    ----------
    conditions : Conditions
    laws : Laws
    scatter : Scatter
    linked : (B, P) float array
        Linked parameters of each condition.
    unknowns : (U + p,) float array
        Coefficients of all laws in turn, then the shared errors in standard uncertainties.
    rows : tuple of Rows
        The conditions, linearised at the fit.
    normal : Normal
        The normal equations at the fit.
    chi2, dof : float, int
    converged : bool
    """

    conditions: Conditions
    laws: Laws
    scatter: Scatter
    linked: FloatArray
    unknowns: FloatArray
    rows: tuple[Rows, ...]
    normal: Normal
    chi2: float
    dof: int
    converged: bool

    @property
    def model(self) -> Model:
        """The model."""
        return self.conditions.model

    @property
    def values(self) -> FloatArray:
        """Parameters (B, P) of each condition."""
        return self.model.unlink(self.linked)[0]

    @property
    def coefficients(self) -> list[FloatArray]:
        """Coefficients of each law in turn."""
        return [self.unknowns[part] for part in self.laws.parts]

    @property
    def errors(self) -> FloatArray:
        """Shared errors (p,) in standard uncertainties."""
        return self.unknowns[self.laws.coefficients :]

    @cached_property
    def inverse(self) -> FloatArray:
        """Covariance (U + p, U + p) of the coefficients of all laws in turn, and of the shared errors."""
        return self.normal.covariance()

    @property
    def covariance(self) -> FloatArray:
        """Covariance (U, U) of the coefficients of all laws in turn."""
        size = self.laws.coefficients
        return self.inverse[:size, :size]

    def offsets(self) -> tuple[FloatArray, FloatArray]:
        """Errors (B, 2) of the conditions, Re and Im of log K*, and the covariance (B, P + 2, P + 2) of the linked
        parameters and these.

        Given the changes of a local vector, the errors of its condition are expected at `Weights.offsets` of what is
        left of the residuals.
        """
        size, count = self.linked.shape[1], len(self.linked)
        errors, covariance = np.zeros((count, 2)), np.zeros((count, size + 2, size + 2))
        local = self.normal.local_covariance(self.inverse)
        covariance[:, :size, :size] = local[:, :size, :size]
        for rows in self.rows:
            weight, at = Weights.of(rows, self.scatter.variances), rows.places
            slope = weight.offsets(rows.columns)
            across = -slope @ local[at]
            errors[at] = weight.offsets(rows.off[..., None])[..., 0]
            covariance[at, size:, :size] = across[..., :size]
            covariance[at, :size, size:] = np.swapaxes(across[..., :size], 1, 2)
            covariance[at, size:, size:] = weight.inner - across @ np.swapaxes(slope, 1, 2)
        return errors, covariance

    def fits(self) -> list[Fit]:
        """One fit per condition, with the covariance of its parameters and an equal part of the degrees of freedom."""
        values, slopes = self.model.unlink(self.linked)
        size = values.shape[1]
        local = self.normal.local_covariance(self.inverse)
        covariance = local[:, :size, :size] * slopes[:, :, None] * slopes[:, None, :]
        residuals = {
            int(place): row
            for rows in self.rows
            for place, row in zip(rows.places, rows.whitened(self.scatter.variances), strict=True)
        }
        return [
            Fit(
                model=self.model,
                values=values[at],
                covariance=covariance[at],
                chi2=np.asarray(np.sum(residuals[at] ** 2)),
                dof=round(self.dof / len(values)),
                residuals=residuals[at],
                on_bound=np.zeros(size, dtype=bool),
                converged=np.asarray(self.converged),
            )
            for at in range(len(values))
        ]


def fit_together(
    model: Model,
    conditions: Sequence[StiffnessData],
    start: ArrayLike,
    designs: Mapping[str, ArrayLike] | None = None,
    *,
    shared: Sequence[FloatArray] | None = None,
    scatter: Scatter | None = None,
) -> Together:
    """Fit a model to all conditions at once.

    Parameters
    ----------
    model : Model
    conditions : sequence of B StiffnessData
        Data of one condition each, without covariance between frequencies.
    start : (P,) or (B, P) float array
    designs : mapping of str to (B, K) float array, optional
        Matrix of the law of a parameter, by its symbol: a column of ones if all conditions share it. A parameter that
        is not named has a value of its own for each condition.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        Changes of Re K* and Im K* of each frequency in turn when one of p shared errors is one standard uncertainty.
    scatter : Scatter, optional
        Scatter of the conditions, added to the uncertainty of the data.

    Returns
    -------
    Together

    Raises
    ------
    ModelError
        If a name is not a parameter, or there are fewer data than coefficients.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = [[180e3, 120e3, 700.0], [180e3, 150e3, 900.0]]
    >>> data = [StiffnessData.of(omega, Zener().stiffness(one, omega), 100.0) for one in truth]
    >>> found = fit_together(Zener(), data, truth[0], {"K1": np.ones((2, 1))})
    >>> found.values.round(3).tolist()
    [[180000.0, 120000.0, 700.0], [180000.0, 150000.0, 900.0]]
    """
    symbols = model.known(designs or {})
    every = Conditions.of(model, conditions, shared, common=False)
    named = designs or {}
    laws = Laws(
        tuple(_law_of(one, named[one], every.count) if one in named else None for one in symbols),
        every.shared,
        every.count,
    )
    values = np.broadcast_to(model.checked(start), (every.count, len(symbols)))
    return search(every, laws, model.link(values), scatter or Scatter())


def search(
    conditions: Conditions,
    laws: Laws,
    linked: FloatArray,
    scatter: Scatter,
    errors: FloatArray | None = None,
    *,
    close: float = 0.0,
) -> Together:
    """The fit that a search from linked parameters (B, P) and shared errors (p,) ends at.

    The search is that of Levenberg and Marquardt. Weights are those at K* of the model of each step and do not vary
    within it. It also ends when a full step would reduce chi-square by less than `close`.

    Raises
    ------
    ModelError
        If there are fewer data than coefficients.
    """
    free = laws.coefficients + len(laws.own) * laws.count
    if conditions.known < free:
        raise ModelError(
            f"{laws.count} conditions give {conditions.known} numbers, too few for {free} coefficients of the "
            f"{conditions.model.name} model: take a simpler law or a smaller model"
        )
    laws = replace(laws, error_precision=conditions.precision(scatter.variances))
    place = _begin(laws, linked, errors if errors is not None else np.zeros(laws.shared))
    damping, converged, gains = _DAMPING, False, [np.inf] * _WINDOW
    now = _Point.of(conditions, laws, place, scatter)
    for _ in range(_STEPS):
        step, local = now.normal.step(damping)
        gain = now.normal.reduction(step, local)
        small = not gain > (close if damping <= _DAMPING else 0.0) + _SMALL_GAIN
        if small or damping > _MOST_DAMPING or sum(gains[-_WINDOW:]) < _FLAT + _WINDOW * close:
            converged = bool(np.isfinite(now.chi2))
            break
        tried = place[0] + step, place[1] + local[:, : linked.shape[1]]
        chi2 = now.chi2_at(conditions, laws, tried)
        if chi2 <= now.chi2 * (1 + _ROUND_OFF):
            place, damping, gains = tried, damping * _LOWER, [*gains, now.chi2 - chi2]
            now = _Point.of(conditions, laws, place, scatter)
        else:
            damping *= _RAISE
    dof = conditions.known - free
    return Together(
        conditions, laws, scatter, place[1], place[0], tuple(now.rows), now.normal, now.chi2, dof, converged
    )


def assembled(rows: Sequence[Rows], weights: Sequence[Weights], laws: Laws, unknowns: FloatArray) -> Normal:
    """The normal equations of conditions that are linearised about unknowns (U + p,)."""
    size = rows[0].columns.shape[2]
    gram, right = np.empty((laws.count, size, size)), np.empty((laws.count, size))
    for one, weight in zip(rows, weights, strict=True):
        weighted = np.swapaxes(weight.times(one.columns), 1, 2)
        gram[one.places] = weighted @ one.columns
        right[one.places] = (weighted @ one.off[..., None])[..., 0]
    return Normal(laws, gram, right, unknowns)


#: Coefficients and shared errors (U + p,), and linked parameters (B, P).
_Place = tuple[FloatArray, FloatArray]


def _begin(laws: Laws, linked: FloatArray, errors: FloatArray) -> _Place:
    """The place whose laws are closest to linked parameters (B, P)."""
    found, coefficients = linked.copy(), []
    for at, matrix in zip(laws.ruled, laws.matrices, strict=True):
        coefficients.append(np.linalg.lstsq(matrix, linked[:, at], rcond=None)[0])
        found[:, at] = matrix @ coefficients[-1]
    return np.concatenate([*coefficients, errors]), found


@dataclass(frozen=True, eq=False)
class _Point:
    """The linearised problem at a place of the search."""

    rows: list[Rows]
    weights: list[Weights]
    normal: Normal
    chi2: float

    @classmethod
    def of(cls, conditions: Conditions, laws: Laws, place: _Place, scatter: Scatter) -> _Point:
        errors = place[0][laws.coefficients :]
        rows = conditions.linearised(place[1], errors)
        weights = [Weights.of(one, scatter.variances) for one in rows]
        chi2 = sum(float(np.sum(one.chi2(each.off))) for one, each in zip(weights, rows, strict=True))
        return cls(rows, weights, assembled(rows, weights, laws, place[0]), chi2 + laws.prior_chi2(place[0]))

    def chi2_at(self, conditions: Conditions, laws: Laws, place: _Place) -> float:
        """Chi-square at another place with the weights of this one."""
        errors = place[0][laws.coefficients :]
        off = conditions.residuals(place[1], errors, self.rows)
        chi2 = sum(float(np.sum(one.chi2(each))) for one, each in zip(self.weights, off, strict=True))
        return chi2 + laws.prior_chi2(place[0])


def _law_of(symbol: str, given: ArrayLike, count: int) -> FloatArray:
    """The matrix of a law, one row per condition; ModelError if its shape is another."""
    law = np.asarray(given, dtype=float)
    if law.ndim != 2 or len(law) != count:
        raise ModelError(f"the law of {symbol} has the shape {law.shape}: {count} conditions need as many rows")
    return law


@dataclass(frozen=True)
class LeaveOneOut:
    """Comparison of each condition with the map of the other conditions; not-a-number if no condition can be omitted.

    Attributes
    ----------
    error : float [1]
        Leave-one-out error: root mean square difference between measured and predicted K*, relative.
    density : float
        Log predictive density, summed over the conditions: that of K* as measured under the map of the others. Its
        covariance is that of the map, of the scatter, of the data and of the shared errors, whose own density is added,
        and that of the scatter of conditions.
        It is -inf for a map of a file.
    inside : float [1]
        Fraction of all K' and K'' that are inside the predicted 95 % intervals.
    conditions : float [1]
        Fraction of the conditions whose K' and K'' at the middle frequency are both inside.
    """

    error: float = float("nan")
    inside: float = float("nan")
    conditions: float = float("nan")
    density: float = float("-inf")

    @classmethod
    def of(cls, found: Together) -> LeaveOneOut:
        """The leave-one-out errors of a fit; K* and its changes are of first order in parameters and shared errors."""
        change, covariance = without_each(found.normal, found.inverse)
        size = found.linked.shape[1]
        errors = found.errors + change[:, size:]
        for part in found.conditions.errors_of_model:  # the map does not correct K* for the error of the model
            errors[:, part] = 0.0
            columns = slice(size + part.start, size + part.stop)
            covariance[:, columns] = covariance[:, :, columns] = 0.0
        precision = found.conditions.precision(found.scatter.variances)
        variances = found.scatter.summed.variances
        change[:, size:] = errors - found.errors
        squares, scores, middle, density = [], [], [], 0.0
        for rows in found.rows:
            left = rows.off - (rows.columns @ change[rows.places][..., None])[..., 0]
            density += _density_of(rows, variances, left, covariance[rows.places])
            off, spread = _predicted(rows, variances, left, covariance[rows.places])
            squares.append(np.sum(off**2, axis=2).ravel())
            score = np.abs(off) / np.sqrt(spread)
            scores.append(score.ravel())
            middle.append(score[:, score.shape[1] // 2].max(axis=1))
        return cls(
            error=float(np.sqrt(np.mean(np.concatenate(squares)))),
            inside=float(np.mean(np.concatenate(scores) < NORMAL_95)),
            conditions=float(np.mean(np.concatenate(middle) < NORMAL_95)),
            density=density + found.scatter.log_prior - 0.5 * float(found.errors @ (precision * found.errors)),
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


def density_without_each(normal: Normal) -> float:
    """Log density of each condition under the fit of the others, summed, of linear equations.

    That of the shared errors is added: as linear equations have it, a large gain could stand for missing terms. That of
    the residuals themselves, `Weights.log_density`, is left out.
    """
    whole, step, local = normal.solved()
    spread = normal.local_covariance(whole)
    remainder = _remainder(normal, spread)
    gradient = normal.right - (normal.gram @ local[..., None])[..., 0]
    local = local - np.linalg.solve(remainder, spread @ gradient[..., None])[..., 0]
    moved = (normal.gram @ local[..., None])[..., 0]
    (_, precision), size = normal.laws.prior, normal.laws.coefficients
    chi2 = float(np.sum(local * (moved - 2 * normal.right)) + precision[size:] @ (normal.unknowns + step)[size:] ** 2)
    return _gain(normal.right - moved, normal.gram, np.linalg.solve(remainder, spread)) - 0.5 * chi2


def _gain(gradient: FloatArray, gram: FloatArray, covariance: FloatArray) -> float:
    """What C adds to the log density of residuals r with the covariance V + F C F^T, summed over conditions.

    It takes F^T V^-1 r (B, L), F^T V^-1 F (B, L, L) and C (B, L, L).
    """
    grown = np.eye(gram.shape[1]) + gram @ covariance
    gain = gradient * (covariance @ np.linalg.solve(grown, gradient[..., None]))[..., 0]
    return 0.5 * float(np.sum(gain) - np.sum(np.linalg.slogdet(grown)[1]))


def _density_of(rows: Rows, variances: FloatArray, left: FloatArray, covariance: FloatArray) -> float:
    """Log density of K* of a block, for residuals (G, M) and local covariances (G, L, L) without each."""
    weight = Weights.of(rows, variances)
    weighted = np.swapaxes(weight.times(rows.columns), 1, 2)
    gain = _gain((weighted @ left[..., None])[..., 0], weighted @ rows.columns, covariance)
    return gain + float(np.sum(weight.log_density(left, rows.scale)))


def _predicted(
    rows: Rows, variances: FloatArray, left: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals (G, N, 2) of K' and K'' without the condition, from those (G, M) along K*, and their variance."""
    groups, count = rows.own.shape[:2]
    columns = rows.columns[:, : 2 * count]
    off = left[:, : 2 * count].reshape(groups, count, 2)
    pairs = columns.reshape(groups, count, 2, -1)
    spread = pairs @ covariance[:, None] @ np.swapaxes(pairs, 2, 3) + rows.own
    spread = spread + np.diag(variances[2:4] + variances[:2])
    turn = multiplication(rows.scale / np.abs(rows.scale))  # along K*
    turned = (turn @ off[..., None])[..., 0]
    return turned, np.diagonal(turn @ spread @ np.swapaxes(turn, 2, 3), 0, 2, 3)
