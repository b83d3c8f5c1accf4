"""Model discrepancy: the relative error of K*, per frequency, that makes chi-square equal its degrees of freedom.

It is added to the uncertainty of K* when no model fits within that uncertainty, or when the uncertainty is not known.
Without it, intervals of parameters would be too narrow and comparisons of models would not be valid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ComplexArray
from fourpole.core.confidence import CHANCE, LEVELS, NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.causality import best_passive
from fourpole.models.choice import Choice, Trial, choose, fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model

#: Degrees of freedom from which on residuals show an uncertainty that is not stated; times that a model is chosen then.
LEAST_DOF, _MOST_CHOICES = 3, 4
#: Probability of a larger chi-square at which the search for a better passive tyre ends.
_LIKELY = 0.5
#: The search ends when chi-square equals its degrees of freedom within this fraction.
_CLOSE = 0.01
_MOST_STEPS = 25
#: Second order of the shared errors, over the discrepancy, below which the recordings are not needed.
_SMALL = 0.3
#: Least and largest discrepancy of the search.
_LEAST, _MOST = 1e-7, 1.0


def with_error(data: StiffnessData, error: float) -> StiffnessData:
    """The data with a further error of Re K* and Im K*, relative to the modulus of K*, of each frequency by itself.

    Examples
    --------
    >>> data = with_error(StiffnessData.of([60.0], [3e5 + 4e5j], 0.0), 0.01)
    >>> data.covariance[0].round(3).tolist()
    [[25000000.0, 0.0], [0.0, 25000000.0]]
    """
    if not error:
        return data
    recorded = data.recorded
    if recorded is not None and np.all(data.shared_variance < _SMALL * error):
        recorded = None
    if recorded is not None:
        wider = [partial(_wider, one, error) for one in recorded.ravel()]
        recorded = np.array([*wider, None], dtype=object)[:-1].reshape(recorded.shape)
    return replace(data.with_noise((error * np.abs(data.stiffness)) ** 2), recorded=recorded)


def _wider(recorded: Callable[[ComplexArray], StiffnessData], error: float, stiffness: ComplexArray) -> StiffnessData:
    """The data as recorded near K* of a model, with an additional error."""
    return with_error(recorded(stiffness), error)


def model_discrepancy(
    conditions: Sequence[StiffnessData],
    misfit: Callable[[Sequence[StiffnessData]], tuple[float, int]] | None = None,
    *,
    always: bool = False,
) -> float:
    """The model discrepancy [1] of some conditions; 0 if the model fits within the uncertainty of the data.

    Parameters
    ----------
    conditions : sequence of StiffnessData
        Data of one condition each.
    misfit : callable, optional
        Chi-square and degrees of freedom of a model on such conditions; by default those of the best passive tyre.
    always : bool
        Search even if the model fits, because the uncertainty of the data is not known.

    Examples
    --------
    >>> omega = 2 * np.pi * np.arange(10.0, 25.0)
    >>> stiffness = 180e3 + 1j * omega * 700 * 120e3 / (120e3 + 1j * omega * 700)
    >>> model_discrepancy([StiffnessData.of(omega, stiffness, 100.0)])
    0.0
    >>> wrong = stiffness * (1 + 0.02 * (-1) ** np.arange(15))
    >>> 0.01 < model_discrepancy([StiffnessData.of(omega, wrong, 100.0)]) < 0.03
    True
    """
    misfit = misfit or least_misfit
    chi2, dof = misfit(conditions)
    if not always and stats.chi2.sf(chi2, max(dof, 1)) > CHANCE:
        return 0.0
    low, high, error = _LEAST, _MOST, 0.01
    for _ in range(_MOST_STEPS):
        chi2, dof = misfit([with_error(one, error) for one in conditions])
        ratio = chi2 / max(dof, 1)
        if abs(ratio - 1) < _CLOSE or high / low < 1 + _CLOSE:
            break
        low, high = (error, high) if ratio > 1 else (low, error)
        guess = error * np.sqrt(ratio)
        error = float(guess) if low < guess < high else float(np.sqrt(low * high))
    return error


def student_factor(dof: int) -> float:
    """Factor of an uncertainty that residuals with so many degrees of freedom show, with which ±1.96 u holds 95 % [1].

    References
    ----------
    G. A. F. Seber, C. J. Wild, "Nonlinear regression", 1989, 5.1 (scale and intervals by t).
    """
    return float(stats.t.ppf(LEVELS[-1], dof)) / NORMAL_95


def least_misfit(conditions: Sequence[StiffnessData]) -> tuple[float, int]:
    """Chi-square and degrees of freedom, summed over the conditions, of the best passive linear tyre of each."""
    found = [best_passive(one, _LIKELY)[1] for one in conditions]
    return sum(one.chi2 for one in found), sum(one.dof for one in found)


def by_residuals(
    choice: Choice, stated: Sequence[StiffnessData], held: Sequence[Mapping[str, float]], model: str
) -> tuple[Choice, list[StiffnessData], float]:
    """The choice, the data and their error [1], where nobody states the uncertainty of K*.

    The error is that of the chosen model by its own residuals, wider by Student's t for its degrees of freedom, so that
    value ± 1.96 u is a 95 % interval. The choice is made again until it stays.
    """
    names, again = None if model == "auto" else (model,), choice
    for _ in range(_MOST_CHOICES):
        choice, best = again, _with_enough(again)
        error = model_discrepancy(stated, partial(misfit_of, best.fit.model, given=held), always=True)
        again = choose([with_error(one, error) for one in stated], names, held)
        if again.best.name == best.name:
            break
    error *= student_factor(best.dof)
    data = [with_error(one, error) for one in stated]
    best = replace(best, fits=fit_conditions(best.fit.model, data, held))
    rest = tuple(one for one in again.candidates if one.name != best.name)
    return Choice.of((best, *rest), again.failed), data, error


def _with_enough(choice: Choice) -> Trial:
    """The best candidate whose residuals show the error of K*; ModelError if there is none."""
    for one in choice.candidates:
        if one.dof >= LEAST_DOF:
            return one
    raise ModelError(
        f"no uncertainty of K* is stated, and it cannot be found from these data: {choice.best.name} has "
        f"{choice.best.dof} numbers more than parameters, and {LEAST_DOF} are needed. State --std, as --std '1 %', or "
        "name a model with fewer parameters"
    )


def misfit_of(model: Model, data: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]) -> tuple[float, int]:
    """Chi-square and degrees of freedom of a model, summed over the conditions."""
    fits = fit_conditions(model, data, given)
    return sum(float(one.chi2) for one in fits), sum(one.dof for one in fits)
