"""Which model: fits of several side by side, what each costs in parameters, and whether the data can tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit, fit
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.interface import Model
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring, Structural
from fourpole.models.starts import start_of

__all__ = ["Candidate", "Choice", "choose", "model_named"]

_MODELS: dict[str, type[Model]] = {
    "spring": Spring,
    "kelvin": KelvinVoigt,
    "structural": Structural,
    "zener": Zener,
    "fractional": FractionalZener,
    "fractional5": FractionalZener5,
}
_AUTO = ("spring", "kelvin", "zener", "maxwell:2", "maxwell:3", "maxwell:4", "maxwell:5", "fractional", "fractional5")
#: What a model is a special case of: it needs no more where it does as well.
_WITHIN = {
    "spring": {"kelvin", "structural", "zener", "maxwell", "fractional", "fractional5"},
    "kelvin": set[str](),
    "structural": set[str](),
    "zener": {"maxwell", "fractional", "fractional5"},
    "fractional": {"fractional5"},
    "fractional5": set[str](),
}
#: Difference of BIC below which two models are alike: odds of 20 to 1.
_ALIKE = 6.0
#: A model further off than this is not tried on frequencies left out.
_WORTH = 30.0
_FOLDS = 5
_FEWEST_LEFT = 2
#: Relative uncertainty with which a datum weighs nothing.
_NOTHING = 1e6


def model_named(name: str) -> Model:
    """A model by its name: spring, kelvin, structural, zener, fractional, fractional5, maxwell:N.

    Raises
    ------
    ModelError
        If there is none of that name.

    Examples
    --------
    >>> model_named("maxwell:3").name
    'maxwell:3'
    """
    kind, mark, count = name.partition(":")
    if kind == "maxwell" and mark and count.isdecimal():
        return GeneralisedMaxwell(int(count))
    if name not in _MODELS:
        raise ModelError(f"no model {name!r}: choose one of {', '.join(_MODELS)}, maxwell:N (as maxwell:3)")
    return _MODELS[name]()


@dataclass(frozen=True)
class Candidate:
    """One model on the data.

    Attributes
    ----------
    fit : Fit
    aicc, bic : float [1]
        Chi-square with what the free parameters cost (Akaike's, corrected for few data, and Bayes').
    reduced : float [1]
        Chi-square per degree of freedom.
    left_out : float [1]
        Root mean square of what a fit without them says of frequencies left out, in standard units; not-a-number
        where too few would be left, or the model is far from the best.
    """

    fit: Fit
    aicc: float
    bic: float
    reduced: float
    left_out: float = float("nan")

    @property
    def name(self) -> str:
        """Of its model."""
        return self.fit.model.name


@dataclass(frozen=True)
class Choice:
    """Models side by side, the best first.

    Attributes
    ----------
    candidates : tuple of Candidate
    alike : tuple of str
        Names of other models that the data cannot tell from the best.
    passed : tuple of (str, str)
        Models that were not tried, and why.
    text : str
        Which, and why.
    """

    candidates: tuple[Candidate, ...]
    alike: tuple[str, ...]
    passed: tuple[tuple[str, str], ...]
    text: str

    @property
    def best(self) -> Candidate:
        """The first."""
        return self.candidates[0]


def choose(data: StiffnessData, names: Sequence[str] = _AUTO) -> Choice:
    """Fit several models to one condition and say which, and why.

    Parameters
    ----------
    data : StiffnessData
        Of one condition.
    names : sequence of str
        Models; see `model_named`.

    Raises
    ------
    ModelError
        If no model could be fitted.

    References
    ----------
    K. P. Burnham, D. R. Anderson, "Model selection and multimodel inference", 2nd ed., 2002.

    Examples
    --------
    >>> omega = 2 * np.pi * np.geomspace(1.0, 100.0, 20)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> choose(StiffnessData.of(omega, truth, 100.0)).best.name
    'zener'
    """
    if data.stiffness.ndim != 1:
        raise ModelError("a choice is for one condition at a time: choose one")
    candidates, passed = [], []
    for name in names:
        model = model_named(name)
        try:
            candidates.append(_candidate(model, data))
        except ModelError as error:
            passed.append((name, str(error)))
    if not candidates:
        raise ModelError(passed[0][1] if passed else "no model was named")
    candidates.sort(key=lambda one: one.bic)
    near = [one.bic - candidates[0].bic < _WORTH for one in candidates]
    candidates = [
        replace(one, left_out=_left_out(one.fit.model, data, one.fit)) if worth else one
        for one, worth in zip(candidates, near, strict=True)
    ]
    best = candidates[0]
    alike = tuple(
        one.name for one in candidates[1:] if one.bic - best.bic < _ALIKE and not _contains(one.name, best.name)
    )
    return Choice(tuple(candidates), alike, tuple(passed), _said(best, candidates[1:], alike))


def _contains(larger: str, smaller: str) -> bool:
    """Whether one model is the other with more parameters."""
    large, small = larger.partition(":")[0], smaller.partition(":")[0]
    if large == small == "maxwell":
        return int(larger.partition(":")[2]) > int(smaller.partition(":")[2])
    return large in _WITHIN.get(small, set())


def _candidate(model: Model, data: StiffnessData) -> Candidate:
    found = fit(model, data, start_of(model, data))
    chi2, count = float(found.chi2), found.residuals.shape[-1]
    free = count - found.dof
    spare = max(count - free - 1, 1)
    return Candidate(
        fit=found,
        aicc=chi2 + 2 * free + 2 * free * (free + 1) / spare,
        bic=chi2 + free * float(np.log(count)),
        reduced=chi2 / max(found.dof, 1),
    )


def _left_out(model: Model, data: StiffnessData, whole: Fit) -> float:
    """What fits to four fifths of the frequencies, all five at once, say of the rest."""
    count = data.omega.size
    folds = min(_FOLDS, count)
    if 2 * (count - -(-count // folds)) < len(model.parameters) + _FEWEST_LEFT:
        return float("nan")
    left = np.arange(count) % folds == np.arange(folds)[:, None]
    found = fit(model, _without(data, left), whole.values)
    off = data.stiffness - model.stiffness(found.values, data.omega)
    squares: list[FloatArray] = []
    for fold, rows in enumerate(left):
        rest = data.part(np.flatnonzero(rows))
        squares.append(rest.whitened(rest.whitener(), off[fold, rows, None])[:, 0] ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _without(data: StiffnessData, left: BoolArray) -> StiffnessData:
    """The data once per row of `left` (folds, N), frequencies left out made to weigh nothing."""
    folds, count = left.shape
    covariance = np.broadcast_to(data.covariance, (folds, *data.covariance.shape)).copy()
    huge = (_NOTHING * np.abs(data.stiffness)) ** 2
    if data.full:
        both = np.repeat(left, 2, axis=1)
        covariance[both[:, :, None] | both[:, None, :]] = 0.0
        at = np.arange(2 * count)
        covariance[:, at, at] += np.where(both, np.repeat(huge, 2), 0.0)
    else:
        covariance[left] = 0.0
        covariance += np.where(left, huge, 0.0)[..., None, None] * np.eye(2)
    one = np.ones(folds)
    return StiffnessData(data.omega, data.stiffness * one[:, None], covariance, data.k1 * one, data.k1_std * one)


def _said(best: Candidate, others: Sequence[Candidate], alike: tuple[str, ...]) -> str:
    free = best.fit.residuals.shape[-1] - best.fit.dof
    said = (
        f"{best.name}: {free} parameters, chi-square {float(best.fit.chi2):.3g} for {best.fit.dof} degrees of freedom"
    )
    if float(best.fit.chance) < 1e-3:
        said += "; it does not fit: more is in the data than noise, and no model tried explains it"
    if alike:
        return f"{said}. The data cannot tell it from {', '.join(alike)}"
    rivals = [one for one in others if not _contains(one.name, best.name)]
    if rivals:
        said += f". The next, {rivals[0].name}, is worse by {rivals[0].bic - best.bic:.3g} in BIC"
    return said
