"""The uncertainty of K* where nobody states it: by the residuals of the chosen model, with Student's t."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from fourpole.errors import ModelError
from fourpole.models.choice import Choice, Trial, choose, fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.discrepancy import LEAST_DOF, model_discrepancy, student_factor, with_error
from fourpole.models.interface import Model

#: Times that the model is chosen.
_MOST_CHOICES = 4


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
    return replace(again, candidates=(best, *rest)), data, error


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
