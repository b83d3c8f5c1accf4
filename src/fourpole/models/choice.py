"""Choice of a model: several models fitted to the same data and compared by information criteria."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.confidence import CHANCE
from fourpole.errors import ModelError
from fourpole.models.data import MASTER_DECADES, StiffnessData, stacked
from fourpole.models.families import automatic, contains, model_named, sizes_of
from fourpole.models.fit import Fit, best_fit, fit
from fourpole.models.interface import Model
from fourpole.models.problem import starts_of
from fourpole.models.ramp import takes_k1

#: Reason why a model that was not compared was left out: the user stopped the fits.
STOPPED = "stopped by Ctrl-C"
#: The model of a master curve: no law with few parameters holds over so many decades.
_OF_MASTER_CURVES = ("prony",)
#: Two models are equally good if their BIC differ by less than this: odds of 20 to 1.
_ALIKE = 6.0
#: The cross-validation error is computed if the BIC exceeds the least by less than this for each condition.
_WORTH = 30.0
#: Number of parts into which cross-validation divides the frequencies; least degrees of freedom of its fits.
_FOLDS = 5
_LEAST_DOF = 2
#: Number of starts of each fit.
_STARTS = 4
#: Number of larger sizes of a family that are tried beyond the best size so far.
_PATIENCE = 2
#: Relative uncertainty that gives a datum no weight.
_NO_WEIGHT = 1e6


@dataclass(frozen=True)
class Trial:
    """One model fitted to all conditions, with parameters of its own for each.

    Attributes
    ----------
    fits : tuple of Fit
        One fit per condition.
    aicc, bic : float [1]
        Akaike's information criterion, corrected for few data, and the Bayesian one, summed over the conditions.
    cross_validation : float [1]
        Cross-validation error: root mean square residual of frequencies that the fit did not use, in standard
        uncertainties. Not-a-number if too few frequencies would remain, or the model is far from the best.
    """

    fits: tuple[Fit, ...]
    aicc: float
    bic: float
    cross_validation: float = float("nan")

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.fits[0].model.name

    @property
    def fit(self) -> Fit:
        """Fit of the first condition."""
        return self.fits[0]

    @property
    def free(self) -> int:
        """Number of free parameters of all conditions."""
        return sum(one.residuals.shape[-1] - one.dof for one in self.fits)

    @property
    def chi2(self) -> float:
        """Chi-square of all conditions."""
        return float(sum(float(one.chi2) for one in self.fits))

    @property
    def dof(self) -> int:
        """Degrees of freedom of all conditions."""
        return sum(one.dof for one in self.fits)

    @property
    def reduced(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi2 / max(self.dof, 1)

    @property
    def chance(self) -> float:
        """Probability of a larger chi-square if the model is true."""
        return float(stats.chi2.sf(self.chi2, max(self.dof, 1)))

    @property
    def on_bound(self) -> int:
        """Number of parameters on a bound."""
        return sum(int(one.on_bound.sum()) for one in self.fits)

    @property
    def not_converged(self) -> int:
        """Number of conditions whose fit did not converge."""
        return sum(not bool(one.converged) for one in self.fits)


@dataclass(frozen=True)
class Choice:
    """The result of a comparison of models.

    Attributes
    ----------
    candidates : tuple of Trial
        Rising in BIC: the best model is the first.
    alike : tuple of str
        Names of models as good as the best, of which the best is not a special case.
    unneeded : tuple of str
        Names of models as good as the best, of which the best is a special case: their further parameters do not help.
    failed : tuple of (str, str)
        Names of models that could not be fitted, with the reason.
    text : str
        The best model, and the reason for the choice.
    """

    candidates: tuple[Trial, ...]
    alike: tuple[str, ...]
    unneeded: tuple[str, ...]
    failed: tuple[tuple[str, str], ...]
    text: str

    @classmethod
    def of(cls, candidates: Sequence[Trial], failed: tuple[tuple[str, str], ...]) -> Choice:
        """The choice of the first of some candidates."""
        alike, unneeded = _as_good(candidates)
        return cls(tuple(candidates), alike, unneeded, failed, _text(candidates, alike, unneeded))

    @property
    def stopped(self) -> bool:
        """Whether the user stopped the comparison before all models were tried."""
        return any(reason == STOPPED for _, reason in self.failed)

    @property
    def best(self) -> Trial:
        """The candidate with the least BIC."""
        return self.candidates[0]

    def named(self, name: str) -> Trial:
        """The candidate of a model, by its name."""
        return next(one for one in self.candidates if one.name == name)


def choose(
    data: StiffnessData | Sequence[StiffnessData],
    names: Sequence[str] | None = None,
    given: Sequence[Mapping[str, float]] | None = None,
) -> Choice:
    """Fit several models to one or more conditions and choose the one with the least BIC.

    Parameters
    ----------
    data : StiffnessData or sequence of StiffnessData
        Data of one condition each.
    names : sequence of str, optional
        Names of models; see `families.model_named`. The default is those of `families.automatic` for the band of the
        data, and over a master curve a Prony series alone, whose spectrum is the
        data's. For the bare name of a family, such as maxwell, larger sizes are tried as long as they help.
    given : sequence of mapping of str to float, optional
        For each condition, values of known parameters by symbol. A model uses those of its own parameters.

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
        raise ModelError("a choice of models needs one or more conditions, each as data of its own")
    known = given if given is not None else [{}] * len(conditions)
    if names is None:
        omega = np.concatenate([one.omega for one in conditions])
        decades = float(np.log10(omega.max()) - np.log10(omega.min()))
        names = automatic(decades) if decades < MASTER_DECADES else _OF_MASTER_CURVES
    candidates, failed = _fitted(names, conditions, known)
    candidates.sort(key=lambda one: one.bic)
    if not any(reason == STOPPED for _, reason in failed):
        try:
            _cross_validate(candidates, conditions, known)
        except KeyboardInterrupt:
            failed = (*failed, ("cross-validation", STOPPED))
    return Choice.of(candidates, failed)


def _as_good(candidates: Sequence[Trial]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of models as good as the best, of which it is not a special case, and of which it is one."""
    best, *others = candidates
    near = [one.name for one in others if one.bic - best.bic < _ALIKE]
    larger = tuple(name for name in near if contains(name, best.name))
    return tuple(name for name in near if name not in larger), larger


def _fitted(
    names: Sequence[str], conditions: Sequence[StiffnessData], known: Sequence[Mapping[str, float]]
) -> tuple[list[Trial], tuple[tuple[str, str], ...]]:
    """The models that could be fitted, and the others with the reason; ModelError if there is no fit."""
    candidates: list[Trial] = []
    failed = []
    for name in names:
        try:
            if sizes := sizes_of(name):
                candidates += _growing(name, sizes, conditions, known)
            else:
                candidates.append(_candidate(model_named(name), conditions, known))
        except ModelError as error:
            failed.append((name, str(error)))
        except (np.linalg.LinAlgError, FloatingPointError) as error:
            failed.append((name, f"its fit failed ({error})"))
        except KeyboardInterrupt:  # what is found is kept
            if not candidates:
                raise
            failed += [(one, STOPPED) for one in names[names.index(name) :]]
            break
    if not candidates:
        raise ModelError(failed[0][1] if failed else "no model was named")
    return candidates, tuple(failed)


def fit_conditions(
    model: Model, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]] | None = None
) -> tuple[Fit, ...]:
    """The fits of one model to several conditions, one fit per condition, each from several starts.

    `given` has the known parameters of each condition. Parameters that are usually fixed otherwise keep their defaults.
    """
    fits: dict[int, Fit] = {}
    model = model.placed(conditions)
    for places, together in stacked(conditions, apart=model.linear):
        fixed = fixed_of(model, [given[place] for place in places] if given is not None else [{}] * len(places))
        easy = together if together.reference is not None else together.eased()
        found = best_fit(model, easy, starts_of(model, together, _STARTS), fixed=fixed)
        found = _at_own_errors(model, together, found, list(fixed))
        fits.update({place: found.part(at) for at, place in enumerate(places)})
    return tuple(fits[at] for at in range(len(conditions)))


def _at_own_errors(model: Model, data: StiffnessData, found: Fit, fixed: Sequence[str]) -> Fit:
    """The fit with the errors that frequencies share at K* of the fit itself."""
    _, settled = data.settled(
        found,
        lambda one: model.on(data).stiffness(one.values, data.omega),
        lambda there, one: fit(model, there, one.values, fixed=fixed),
    )
    return replace(settled, agreed=found.agreed)


def fixed_of(model: Model, given: Sequence[Mapping[str, float]]) -> dict[str, FloatArray]:
    """Values of the parameters that are not fitted, by symbol, one for each condition."""
    fixed: dict[str, FloatArray] = {}
    for parameter in model.parameters:
        symbol = parameter.symbol
        if symbol in model.usually_fixed or any(symbol in one for one in given):
            fixed[symbol] = np.array([one.get(symbol, parameter.default) for one in given])
    return fixed


def _growing(
    family: str, sizes: Sequence[int], conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]
) -> list[Trial]:
    """The fits of a family, rising in size, until larger sizes do not reduce the BIC."""
    found: list[Trial] = []
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


def _candidate(model: Model, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]) -> Trial:
    """One model fitted to all conditions, with its information criteria."""
    fits = fit_conditions(model, conditions, given)
    aicc = bic = 0.0
    for one, data in zip(fits, conditions, strict=True):
        # For a model that flows, K1 is a datum and a parameter of its own: all models are compared on the same data.
        count = one.residuals.shape[-1] + int(data.has_k1 and not takes_k1(model, data))
        free = count - one.dof
        both = criteria(float(one.chi2), count, free)
        aicc, bic = aicc + both[0], bic + both[1]
    return Trial(fits, aicc, bic)


def criteria(chi2: float, count: int, free: int) -> tuple[float, float]:
    """AICc and BIC of a fit of so many free parameters to so many data."""
    aicc = chi2 + 2 * free + 2 * free * (free + 1) / max(count - free - 1, 1)
    return aicc, chi2 + free * float(np.log(count))


def _cross_validate(
    candidates: list[Trial], conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]
) -> None:
    """Give the candidates near the best one their cross-validation error."""
    limit = candidates[0].bic + _WORTH * len(conditions)
    for at, one in enumerate(candidates):
        if one.bic < limit:
            candidates[at] = replace(one, cross_validation=_cross_validation_error(one, conditions, given))


def _cross_validation_error(
    candidate: Trial, conditions: Sequence[StiffnessData], given: Sequence[Mapping[str, float]]
) -> float:
    """Root mean square residual of frequencies, in standard uncertainties, from fits to the other four fifths."""
    model = candidate.fit.model
    squares: list[FloatArray] = []
    for places, together in stacked(conditions):
        count, size = together.count, len(places)
        folds = min(_FOLDS, count)
        if 2 * (count - -(-count // folds)) < len(model.parameters) + _LEAST_DOF:
            return float("nan")
        unused = np.arange(count) % folds == np.arange(folds)[:, None]
        values = np.stack([candidate.fits[place].values for place in places])
        start = np.broadcast_to(values, (folds, *values.shape))
        here = together.at(model.on(together).stiffness(values, together.omega))
        fixed = list(fixed_of(model, [given[place] for place in places]))
        found = fit(model, _without(here, unused), start, fixed=fixed)
        off = here.stiffness - model.on(here).stiffness(found.values, here.omega)
        for fold, rows in enumerate(unused):
            rest = here.part(np.flatnonzero(rows))
            squares.append(rest.whitened(rest.whitener(), off[fold][:, rows, None])[..., 0].reshape(size, -1) ** 2)
    return float(np.sqrt(np.mean(np.concatenate([one.ravel() for one in squares]))))


def _without(data: StiffnessData, unused: BoolArray) -> StiffnessData:
    """The conditions (B, N) once per row of `unused` (folds, N), with unused frequencies without weight."""
    lead = (len(unused), *data.stiffness.shape[:-1])
    if data.full:
        both = np.repeat(unused, 2, axis=1)[:, None]
        alone = both[..., :, None] | both[..., None, :]
    else:
        alone = unused[:, None, :, None, None]
    names = ("omega", "stiffness", "k1", "k1_std", "amplitude")
    held = {name: one for name in names if (one := getattr(data, name)) is not None}
    wide: dict[str, Any] = {name: np.broadcast_to(one, (*lead, *one.shape[1:])) for name, one in held.items()}
    found = StiffnessData(**wide, covariance=np.where(alone, 0.0, data.covariance), **data.ramp)
    return found.with_noise(np.where(unused[:, None], (_NO_WEIGHT * np.abs(data.stiffness)) ** 2, 0.0))


def _text(candidates: Sequence[Trial], alike: Sequence[str], unneeded: Sequence[str]) -> str:
    """The best model and the reason for the choice, in sentences; the last one without its full stop."""
    best = candidates[0]
    many = f" in {len(best.fits)} conditions" if len(best.fits) > 1 else ""
    chi2 = f"{best.chi2:.3g}" if best.chi2 < 1000 else f"{best.chi2:.0f}"
    free = f"{best.free} parameter{'s' if best.free != 1 else ''}"
    first = f"{best.name}: {free}{many}, chi-square {chi2} for {best.dof} degrees of freedom"
    if best.dof and best.chance < CHANCE:
        first += ", too large for the uncertainty of the data"
    if best.on_bound:
        which = "terms zero" if best.fit.model.linear else "parameters on a bound or without effect on K*"
        first += f"; {best.on_bound} of the {which}"
    if not best.dof:
        return f"{first}: as many parameters as data, so that models cannot be compared"
    return ". ".join([first, *_comparison(candidates, alike, unneeded)])


def _comparison(candidates: Sequence[Trial], alike: Sequence[str], unneeded: Sequence[str]) -> Iterator[str]:
    """Sentences on the models that are as good as the best, or on the next one, and on a simulation in time."""
    best, *others = candidates
    rivals = [one for one in others if not contains(one.name, best.name)]
    if alike:
        yield f"The data cannot distinguish it from {', '.join(alike)}"
    elif rivals:
        yield f"The BIC of the next, {rivals[0].name}, is larger by {rivals[0].bic - best.bic:.3g}"
    if unneeded:
        yield f"The data do not require the parameters that {', '.join(unneeded)} would add to it"
    causal = next((one for one in candidates if one.fit.model.causal), None)
    if causal is not best:
        instead = f": for a simulation take {causal.name}" if causal is not None else ""
        yield f"It is not causal and cannot be simulated in time{instead}"
