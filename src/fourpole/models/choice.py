"""Choice of a model: several fits compared by misfit and number of parameters, and whether the data decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import CHANCE, StiffnessData, stacked
from fourpole.models.families import automatic, contains, model_named, sizes_of
from fourpole.models.fit import Fit, best_fit, fit
from fourpole.models.interface import Model
from fourpole.models.starts import starts_of

__all__ = ["AUTO", "Candidate", "Choice", "choose", "fit_conditions", "fixed_of"]

#: Models that are tried if none is named.
AUTO = automatic()
#: Difference of BIC below which two models are alike: odds of 20 to 1.
_ALIKE = 6.0
#: Difference of BIC to the best model, per condition, above which the cross-validation error is not computed.
_WORTH = 30.0
_FOLDS = 5
_FEWEST_LEFT = 2
#: Starts of each fit: a guard against local minima.
_STARTS = 4
#: Sizes of a family that are tried beyond the best one so far.
_PATIENCE = 2
#: Relative standard uncertainty that gives a datum no weight in a fit.
_NOTHING = 1e6


@dataclass(frozen=True)
class Candidate:
    """One model on the data of all conditions, each with parameters of its own.

    Attributes
    ----------
    fits : tuple of Fit
        One per condition.
    aicc, bic : float [1]
        Chi-square with what the free parameters cost (Akaike's, corrected for few data, and Bayes'), summed.
    left_out : float [1]
        Cross-validation error: root mean square of the residuals at frequencies that the fit did not use, in standard
        uncertainties. Not-a-number if too few frequencies would remain, or if the model is far worse than the best.
    """

    fits: tuple[Fit, ...]
    aicc: float
    bic: float
    left_out: float = float("nan")

    @property
    def name(self) -> str:
        """Name of its model."""
        return self.fits[0].model.name

    @property
    def fit(self) -> Fit:
        """Fit of the first condition."""
        return self.fits[0]

    @property
    def free(self) -> int:
        """Free parameters of all conditions."""
        return sum(one.residuals.shape[-1] - one.dof for one in self.fits)

    @property
    def chi2(self) -> float:
        """Chi-square, summed over all conditions."""
        return float(sum(float(one.chi2) for one in self.fits))

    @property
    def dof(self) -> int:
        """Degrees of freedom, summed over all conditions."""
        return sum(one.dof for one in self.fits)

    @property
    def reduced(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi2 / max(self.dof, 1)

    @property
    def chance(self) -> float:
        """Probability of a chi-square as large, if the model were true."""
        return float(stats.chi2.sf(self.chi2, max(self.dof, 1)))

    @property
    def on_bound(self) -> int:
        """Parameters on a bound."""
        return sum(int(one.on_bound.sum()) for one in self.fits)

    @property
    def lost(self) -> int:
        """Number of conditions whose fit did not converge."""
        return sum(not bool(one.converged) for one in self.fits)


@dataclass(frozen=True)
class Choice:
    """Models side by side, the best first.

    Attributes
    ----------
    candidates : tuple of Candidate
    alike : tuple of str
        Names of other models whose BIC is so close to that of the best that the data do not decide.
    unneeded : tuple of str
        Names of models that contain the best as a special case: they fit no better with more parameters.
    passed : tuple of (str, str)
        Models that were not tried, each with the reason.
    text : str
        The chosen model and the reason, in sentences.
    """

    candidates: tuple[Candidate, ...]
    alike: tuple[str, ...]
    unneeded: tuple[str, ...]
    passed: tuple[tuple[str, str], ...]
    text: str

    @property
    def best(self) -> Candidate:
        """The best candidate, which stands first."""
        return self.candidates[0]

    def named(self, name: str) -> Candidate:
        """The one of a name."""
        return next(one for one in self.candidates if one.name == name)


def choose(
    data: StiffnessData | Sequence[StiffnessData],
    names: Sequence[str] = AUTO,
    given: Sequence[Mapping[str, float]] | None = None,
) -> Choice:
    """Fit several models to one or more conditions and say which, and why.

    Parameters
    ----------
    data : StiffnessData or sequence of them
        Of one condition each.
    names : sequence of str
        Models; see `families.model_named`. A family's bare name, as maxwell, is as large a size as helps.
    given : sequence of mapping of str to float, optional
        Of each condition, parameters that are known and not fitted, by symbol; a model takes those that it has.

    Raises
    ------
    ModelError
        If no model could be fitted.

    References
    ----------
    K. P. Burnham, D. R. Anderson, "Model selection and multimodel inference", 2nd ed., 2002.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.geomspace(1.0, 100.0, 20)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> choose(StiffnessData.of(omega, truth, 100.0)).best.name
    'zener'
    """
    conditions = [data] if isinstance(data, StiffnessData) else list(data)
    if not conditions or any(one.stiffness.ndim != 1 for one in conditions):
        raise ModelError("a choice is for one or more conditions, given one by one")
    known = given if given is not None else [{}] * len(conditions)
    candidates, passed = _tried(names, conditions, known)
    candidates.sort(key=lambda one: one.bic)
    worth = candidates[0].bic + _WORTH * len(conditions)
    candidates = [
        replace(one, left_out=_left_out(one, conditions, known)) if one.bic < worth else one for one in candidates
    ]
    best = candidates[0]
    near = [one.name for one in candidates[1:] if one.bic - best.bic < _ALIKE]
    alike = tuple(name for name in near if not contains(name, best.name))
    unneeded = tuple(name for name in near if contains(name, best.name))
    return Choice(tuple(candidates), alike, unneeded, passed, _said(candidates, alike, unneeded))


def _tried(
    names: Sequence[str], conditions: Sequence[StiffnessData], known: Sequence[Mapping[str, float]]
) -> tuple[list[Candidate], tuple[tuple[str, str], ...]]:
    """The models that could be fitted, and the others with the reason; ModelError where none could."""
    candidates: list[Candidate] = []
    passed = []
    for name in names:
        try:
            sizes = sizes_of(name)
            candidates += (
                _growing(name, sizes, conditions, known)
                if sizes
                else [_candidate(model_named(name), conditions, known)]
            )
        except ModelError as error:
            passed.append((name, str(error)))
    if not candidates:
        raise ModelError(passed[0][1] if passed else "no model was named")
    return candidates, tuple(passed)


def fit_conditions(
    model: Model, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]] | None = None
) -> tuple[Fit, ...]:
    """One model to each of several conditions, from several starts; those of a kind at once.

    `given` has the parameters of each condition that are known; those usually fixed stay at their defaults.
    """
    fits: dict[int, Fit] = {}
    for places, together in stacked(conditions):
        fixed = fixed_of(model, [given[place] for place in places] if given is not None else [{}] * len(places))
        found = best_fit(model, together, starts_of(model, together, _STARTS), fixed=fixed)
        fits.update({place: found.part(at) for at, place in enumerate(places)})
    return tuple(fits[at] for at in range(len(conditions)))


def fixed_of(model: Model, given: Sequence[Mapping[str, float]]) -> dict[str, FloatArray]:
    """Values of the parameters that are held, for each of some conditions."""
    fixed: dict[str, FloatArray] = {}
    for parameter in model.parameters:
        symbol = parameter.symbol
        if symbol in model.usually_fixed or any(symbol in one for one in given):
            fixed[symbol] = np.array([one.get(symbol, parameter.default) for one in given])
    return fixed


def _growing(
    family: str, sizes: Sequence[int], conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]
) -> list[Candidate]:
    """Models of a family from its smallest size on, until larger ones do not help."""
    found: list[Candidate] = []
    for size in sizes:
        try:
            found.append(_candidate(model_named(f"{family}:{size}"), conditions, given))
        except ModelError:
            if not found:
                raise
            break
        if int(np.argmin([one.bic for one in found])) < len(found) - _PATIENCE:
            break
    return found


def _candidate(model: Model, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]) -> Candidate:
    fits = fit_conditions(model, conditions, given)
    aicc = bic = 0.0
    for one, data in zip(fits, conditions, strict=True):
        # A model that flows leaves K1 as a parameter of its own: so all models are compared on the same data.
        count = one.residuals.shape[-1] + int(data.has_k1 and not model.rests)
        free = count - one.dof
        aicc += float(one.chi2) + 2 * free + 2 * free * (free + 1) / max(count - free - 1, 1)
        bic += float(one.chi2) + free * float(np.log(count))
    return Candidate(fits, aicc, bic)


def _left_out(candidate: Candidate, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]) -> float:
    """Cross-validation error [1]: rms residual, in standard uncertainties, at each fifth of the frequencies in turn."""
    squares: list[FloatArray] = []
    for places, together in stacked(conditions):
        count, size = together.count, len(places)
        folds = min(_FOLDS, count)
        if 2 * (count - -(-count // folds)) < len(candidate.fit.model.parameters) + _FEWEST_LEFT:
            return float("nan")
        left = np.arange(count) % folds == np.arange(folds)[:, None]
        values = np.stack([candidate.fits[place].values for place in places])
        model, start = candidate.fit.model, np.broadcast_to(values, (folds, *values.shape))
        fixed = list(fixed_of(model, [given[place] for place in places]))
        found = fit(model, _without(together, left), start, fixed=fixed)
        off = together.stiffness - candidate.fit.model.stiffness(found.values, together.omega)
        for fold, rows in enumerate(left):
            rest = together.part(np.flatnonzero(rows))
            squares.append(rest.whitened(rest.whitener(), off[fold][:, rows, None])[..., 0].reshape(size, -1) ** 2)
    return float(np.sqrt(np.mean(np.concatenate([one.ravel() for one in squares]))))


def _without(data: StiffnessData, left: BoolArray) -> StiffnessData:
    """Conditions (B, N) once per row of `left` (folds, N), with no weight on the frequencies left out."""
    folds, count = left.shape
    covariance = np.broadcast_to(data.covariance, (folds, *data.covariance.shape)).copy()
    huge = np.broadcast_to((_NOTHING * np.abs(data.stiffness)) ** 2, (folds, *data.stiffness.shape))
    if data.full:
        both = np.repeat(left, 2, axis=1)[:, None, :]
        covariance = np.where(both[..., :, None] | both[..., None, :], 0.0, covariance)
        at = np.arange(2 * count)
        covariance[..., at, at] += np.where(both, np.repeat(huge, 2, axis=-1), 0.0)
    else:
        aside = left[:, None, :, None, None]
        covariance = np.where(aside, huge[..., None, None] * np.eye(2), covariance)
    lead = (folds, *data.stiffness.shape[:-1])
    omega, k1, k1_std = (np.broadcast_to(one, (*lead, *one.shape[1:])) for one in (data.omega, data.k1, data.k1_std))
    return StiffnessData(omega, np.broadcast_to(data.stiffness, (*lead, count)), covariance, k1, k1_std)


def _said(candidates: Sequence[Candidate], alike: Sequence[str], unneeded: Sequence[str]) -> str:
    best = candidates[0]
    free = (
        f"{best.free} parameters" if len(best.fits) == 1 else f"{best.free} parameters in {len(best.fits)} conditions"
    )
    said = f"{best.name}: {free}, chi-square {best.chi2:.3g} for {best.dof} degrees of freedom"
    if best.on_bound:
        said += f"; {best.on_bound} of them on a bound, or unseen by the data"
    if not best.dof:
        return f"{said}: as many parameters as data, so that nothing is left to tell models apart"
    if best.chance < CHANCE:
        said += "; it does not fit: more is in the data than noise, and no model tried explains it"
    if alike:
        said = f"{said}. The data cannot tell it from {', '.join(alike)}"
    else:
        rivals = [one for one in candidates[1:] if not contains(one.name, best.name)]
        if rivals:
            said += f". The next, {rivals[0].name}, is worse by {rivals[0].bic - best.bic:.3g} in BIC"
    if unneeded:
        said += ". Nor can they tell it" if alike else ". The data ask for no more, though they cannot tell it"
        said += f" from {', '.join(unneeded)}, of which it is a special case"
    if not best.fit.model.causal:
        causal = next((one for one in candidates if one.fit.model.causal), None)
        said += ". It is not causal and cannot be stepped in time"
        said += f": for a simulation take {causal.name}" if causal is not None else ""
    return said
