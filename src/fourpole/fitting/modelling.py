"""Fits and operating maps of a campaign: the choice of a model for each tyre, and its parameters or surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.confidence import CHANCE, COVERAGE_FACTOR
from fourpole.core.digits import notebook_html, with_std
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import columns_of
from fourpole.fitting.byamplitude import tested, told_apart
from fourpole.fitting.inertia import InertiaFile, mean_inertia
from fourpole.fitting.mapping import (
    best_map,
    known_values,
    map_axes,
    map_of_model,
    map_text,
    near_model,
    shared_effects,
)
from fourpole.fitting.measured import Measured, MeasuredSet
from fourpole.fitting.modelfile import CandidateFile, ConditionFile, ModelEntry, ModelFile, entry_of, model_parts
from fourpole.fitting.modelparts import NamedValue, Provenance, ToleranceFile, VerdictFile, finite_or_none
from fourpole.fitting.putback import put_back
from fourpole.fitting.ranges import REACH, ranges_of, rest_of
from fourpole.fitting.stated import RigFile
from fourpole.fitting.static import StaticFile, factor_sentence, slowest
from fourpole.fitting.temperature import TemperatureFile
from fourpole.models.causality import near_passive
from fourpole.models.choice import STOPPED, Choice, Trial, choose, fit_conditions, fixed_of
from fourpole.models.data import StiffnessData
from fourpole.models.discrepancy import by_residuals, misfit_of, model_discrepancy, with_error
from fourpole.models.families import BELT, by_amplitude, check_several, for_maps, has_inertia, model_named, sizes_of
from fourpole.models.fit import Fit
from fourpole.models.interface import Model
from fourpole.models.ladder import Rung, Verdict, verdict_of, without_inertia
from fourpole.models.operating import OperatingMap
from fourpole.models.profile import intervals
from fourpole.models.shape import Shape
from fourpole.models.together import fit_together
from fourpole.quantities import ShownUnits
from fourpole.units import nearest, shown

Progress = Callable[[int, int], None]
_Step = Callable[[], None]
#: The family of models with resonances.
_RESONANT = "resonant"


@dataclass(frozen=True, eq=False)
class TyreFit(ByValue):
    """The model of one tyre, fitted to each of its conditions.

    Attributes
    ----------
    tyre : str
    measured : tuple of Measured
    data : tuple of StiffnessData
        Data of the fits: the model discrepancy is added to their uncertainty.
    choice : Choice
        Comparison of the models.
    chosen : Trial
        The best model, fitted to `data`.
    intervals : tuple of (P, 2) float arrays
        95 % profile-likelihood intervals of each condition.
    verdicts : tuple of Verdict
        Whether a passive linear tyre can have K* as measured, one per condition; empty if the uncertainty is not known.
    discrepancy : float [1]
        Model discrepancy: the relative error of K* that makes chi-square equal its degrees of freedom.
    stopped : bool
        Whether the user stopped the fits of this tyre, or of those after it.
    """

    tyre: str
    measured: tuple[Measured, ...]
    data: tuple[StiffnessData, ...]
    choice: Choice
    chosen: Trial
    intervals: tuple[FloatArray, ...]
    verdicts: tuple[Verdict, ...]
    discrepancy: float
    stopped: bool = False

    @property
    def model(self) -> Model:
        """The chosen model."""
        return self.chosen.fit.model

    @property
    def given(self) -> list[StiffnessData]:
        """The measured data, without the model discrepancy and without a mass or belt that was taken off."""
        if not self.verdicts or has_inertia(self.model.name):
            return [one.data for one in self.measured]
        return [without_inertia(one.data, own) for one, own in zip(self.measured, self.verdicts, strict=True)]

    def _repr_html_(self) -> str:
        """The choice and the parameters, for a notebook."""
        units = ShownUnits()
        symbols = [(one.symbol, *units.unit(one.unit)) for one in self.model.parameters]
        rows = []
        for one, fit in zip(self.measured, self.chosen.fits, strict=True):
            pairs = (
                with_std(value / scale, COVERAGE_FACTOR * u / scale)
                for value, u, (_, _, scale) in zip(fit.values.tolist(), fit.std.tolist(), symbols, strict=True)
            )
            rows.append([one.in_words(units) or "all", *(f"{text} ± {u}" if u else text for text, u in pairs)])
        heads = ["condition", *(f"{symbol} [{unit}]" if unit else symbol for symbol, unit, _ in symbols)]
        title = f"{self.model.name} for {self.tyre}" if self.tyre else self.model.name
        return notebook_html(title, [self.choice.text, "± is U (k = 2)"], heads, rows)


@dataclass(frozen=True)
class TyreMap:
    """The operating map of one tyre.

    Attributes
    ----------
    tyre : str
    measured : tuple of Measured
    best : OperatingMap
    others : tuple of (str, OperatingMap or str)
        All models that were tried: their maps, or the reason why there is none.
    text : str
        The choice in words.
    """

    tyre: str
    measured: tuple[Measured, ...]
    best: OperatingMap
    others: tuple[tuple[str, OperatingMap | str], ...]
    text: str

    @property
    def maps(self) -> list[OperatingMap]:
        """The maps that were made."""
        return [one for _, one in self.others if isinstance(one, OperatingMap)]

    def _repr_html_(self) -> str:
        """The choice and the models that were tried, for a notebook."""
        rows = [
            (name, "none", "", "")
            if isinstance(one, str)
            else (name, one.link, f"{len(one.terms)}", f"{one.leave_one_out.error:.2%}")
            for name, one in self.others
        ]
        title = f"Map of {self.tyre}" if self.tyre else "Map"
        return notebook_html(title, [self.text], ("model", "link", "terms", "leave-one-out error"), rows)


class TyreFits(tuple[TyreFit, ...]):
    """Fits in the order of their tyres; the name of a tyre gives its fit."""

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        """The fit of a tyre by its name or number; ModelError for a name that no tyre has."""
        if not isinstance(key, str):
            return super().__getitem__(key)
        named = {fit.tyre: fit for fit in self}
        if key not in named:
            near = nearest(key, named)
            raise ModelError(f"no specimen {shown(key)}: {f'did you mean {near!r}?' if near else ', '.join(named)}")
        return named[key]


def fit_tyres(
    measured: MeasuredSet,
    model: str = "auto",
    *,
    given: Mapping[str, float] | None = None,
    share: Sequence[str] = (),
    progress: Progress | None = None,
) -> list[TyreFit]:
    """Fit one model to each condition of each tyre, or choose among several models.

    Parameters
    ----------
    measured : MeasuredSet
    model : str
        Name of a model, `maxwell` for as many arms as help, `auto` for a choice among all families, or `belt` for this
        choice for the springs about a belt.
    given : mapping of str to float, optional
        Values of known parameters, by symbol; they are not fitted.
    share : sequence of str
        Symbols of parameters that have one value in all conditions of a tyre.
    progress : callable, optional
        Called with the number of conditions that are done, and of all.

    Raises
    ------
    ModelError
        If a tyre cannot be fitted, or has several conditions for a model that is for one only.
    """
    if model not in ("auto", BELT) and not sizes_of(model):
        model_named(model)
    if model == BELT and not measured.known:
        raise ModelError("a belt is found by the uncertainty of K*, which the table does not state: state --std")
    done = count()

    def step() -> None:
        if progress is not None:
            progress(next(done), len(measured.conditions))

    step()
    found: list[TyreFit] = []
    for tyre in measured.tyres:
        try:
            found.append(_fit_tyre(tyre, measured, model, given or {}, share, step))
        except KeyboardInterrupt:  # the tyres that are fitted are kept
            if not found:
                raise
            rest = ", ".join(shown(one) for one in measured.tyres[len(found) :])
            text = f"{found[-1].choice.text}. Not fitted, {STOPPED}: {rest}"
            found[-1] = replace(found[-1], choice=replace(found[-1].choice, text=text), stopped=True)
            break
    return found


def _fit_tyre(
    tyre: str, every: MeasuredSet, model: str, given: Mapping[str, float], share: Sequence[str], step: _Step
) -> TyreFit:
    measured, told, belted = every.of(tyre), "", model == BELT
    model = "auto" if belted else model
    if len(measured) > 1:
        check_several(model)
    if by_amplitude(model):
        measured, told = told_apart(tyre, measured, model)
    stated = [one.data if told else near_passive(one.data) for one in measured]
    verdicts: tuple[Verdict, ...] = ()
    if every.known and not told:
        pairs = zip(stated, measured, strict=True)
        verdicts = tuple(verdict_of(data, one.of, belted=belted) for data, one in pairs)
        if not has_inertia(model):
            stated = [without_inertia(*pair) for pair in zip(stated, verdicts, strict=True)]
            measured = tuple(with_belt(*pair) for pair in zip(measured, verdicts, strict=True))
    most = max((one.resonances.size for one in verdicts if one.belt is None), default=0)
    model = f"{_RESONANT}:{most}" if model == "auto" and most else model
    held = [known_values(one, given) for one in measured]
    discrepancy = _discrepancy(stated, model, held, known=every.known)
    data = [with_error(one, discrepancy) for one in stated]
    choice = choose(data, None if model == "auto" else (model,), held)
    if not every.known and not told:
        choice, data, discrepancy = by_residuals(choice, stated, held, model)
    best, more, stopped = choice.best, 0.0, choice.stopped
    if best.chance < CHANCE:
        try:
            best, data, more = _widened(best, data, held)
        except KeyboardInterrupt:  # the fit is kept, without the discrepancy
            stopped = True
    whole = float(np.hypot(discrepancy, more))
    best = _sharing(best, measured, whole, share, held)
    fixed = list(fixed_of(best.fit.model, held))
    ends, why, stopped = intervals(best.fits, data, fixed, step, shared=bool(share), stopped=stopped)
    said = factor_sentence(best.fits, [one.loop for one in measured], data)
    lacking = [f"{name} was not compared: {reason.rstrip('.')}" for name, reason in choice.failed]
    choice = replace(choice, text=". ".join(filter(None, [choice.text, *said, *lacking, *why, told])))
    return TyreFit(tyre, measured, tuple(data), choice, best, ends, verdicts, whole, stopped)


def with_belt(measured: Measured, verdict: Verdict) -> Measured:
    """The condition with the belt that its verdict found, if any."""
    if verdict.belt is None:
        return measured
    belt = InertiaFile(form="belt", mass=verdict.belt.mass, share=verdict.belt.share)
    return replace(measured, inertia=belt)


def _widened(
    best: Trial, data: Sequence[StiffnessData], held: Sequence[Mapping[str, float]]
) -> tuple[Trial, list[StiffnessData], float]:
    """The candidate with the discrepancy [1] of its model, and the data to whose uncertainty this is added."""
    more = model_discrepancy(data, lambda rows: misfit_of(best.fit.model, rows, held))
    wider = [with_error(one, more) for one in data]
    return replace(best, fits=fit_conditions(best.fit.model, wider, held)), wider, more


def _discrepancy(
    stated: Sequence[StiffnessData], model: str, held: Sequence[Mapping[str, float]], *, known: bool
) -> float:
    """The discrepancy [1] to add before models are compared: that of the best passive tyre, or of the only model."""
    if known and has_inertia(model):
        return 0.0  # no relaxing tyre has K* of it
    if model == "auto" or sizes_of(model):
        return model_discrepancy(stated, always=not known)
    if known:
        return 0.0  # `_fit_tyre` computes it if the model does not fit
    placed = model_named(model).placed(stated)
    return model_discrepancy(stated, lambda rows: misfit_of(placed, rows, held), always=True)


def _sharing(
    best: Trial,
    measured: Sequence[Measured],
    discrepancy: float,
    share: Sequence[str],
    held: Sequence[Mapping[str, float]],
) -> Trial:
    """The candidate with one fit to all conditions, in which some parameters have one value for all."""
    if not share:
        return best
    model = best.fit.model
    if fixed_of(model, held):
        raise ModelError("parameters cannot be given together with shared ones: state --fix or --share")
    measured = near_model(measured, model, [one.values for one in best.fits])
    data = [with_error(one.own, discrepancy) for one in measured]
    designs = {name: np.ones((len(data), 1)) for name in share}
    start = np.stack([one.values for one in best.fits])
    found = fit_together(model, data, start, designs, shared=shared_effects(measured))
    return replace(best, fits=tuple(found.fits()))


def map_tyres(
    measured: MeasuredSet, model: str = "auto", over: Sequence[str] = (), *, progress: Progress | None = None
) -> list[TyreMap]:
    """Make the operating map of each tyre.

    Parameters
    ----------
    measured : MeasuredSet
    model : str
        Name of a model, or `auto` for the simplest causal one that predicts conditions left out hardly worse than the
        best, by the log predictive density.
    over : sequence of str
        Columns of further axes, besides pressure, preload and temperature.
    progress : callable, optional
        Called with the number of models that are done, and of all.

    Raises
    ------
    ModelError
        If a tyre has one condition only, the model is for one, or no surface can be fitted.
    """
    names = for_maps() if model == "auto" else (model,)
    for name in names:
        model_named(name)
        check_several(name)
    over = columns_of(over)
    total = len(names) * len(measured.tyres)
    found = []
    for at, tyre in enumerate(measured.tyres):

        def step(done: int, first: int = at * len(names)) -> None:
            if progress is not None:
                progress(first + done, total)

        found.append(_map_tyre(tyre, measured.of(tyre), names, over, step))
    return found


def _map_tyre(
    tyre: str, measured: tuple[Measured, ...], names: Sequence[str], over: Sequence[str], step: Callable[[int], None]
) -> TyreMap:
    said = ""
    if by_amplitude(names[0]):
        measured, said = told_apart(tyre, measured, names[0])
    axes = map_axes(tyre, measured, over)
    made: list[tuple[str, OperatingMap | str]] = []
    for at, name in enumerate(names):
        step(at)
        try:
            made.append((name, map_of_model(name, measured, axes, alone=len(names) == 1)))
        except ModelError as error:
            made.append((name, str(error)))
    good = [one for _, one in made if isinstance(one, OperatingMap)]
    if not good:
        raise ModelError(f"no map of the specimen {tyre!r} could be made: {made[0][1]}")
    best = best_map(good)
    text = ". ".join(filter(None, [map_text(best), said]))
    return TyreMap(tyre, measured, best, tuple(made), text)


def model_file(
    measured: MeasuredSet,
    fits: Sequence[TyreFit] = (),
    maps: Sequence[TyreMap] = (),
    *,
    settings: Mapping[str, Any] | None = None,
    rig: RigFile | None = None,
    shapes: Mapping[str, Shape] | None = None,
    laws: Mapping[str, TemperatureFile] | None = None,
) -> ModelFile:
    """The document of fits or of maps, with the share of the data that a query of it gives back; see `put_back`.

    `shapes` has the shapes of specimens by name, where they are stated; `laws` the laws of the temperature of master
    curves, by tyre.
    """
    shapes, laws = shapes or {}, laws or {}
    made = ModelFile(
        kind="map" if maps else "model",
        models=[_model_entry(one, shapes.get(one.tyre), laws.get(one.tyre)) for one in fits],
        maps=[
            entry_of(
                one.tyre,
                one.best,
                one.text,
                tested(one.measured, one.best.model),
                mean_inertia([each.inertia for each in one.measured]),
            )
            for one in maps
        ],
        rig=rig,
        axes=[
            ToleranceFile(column=axis.column, relative=axis.relative, absolute=axis.absolute)
            for axis in measured.rule.further
            if not axis.text
        ],
        provenance=Provenance.of(measured.source, measured.sha256, settings, measured.notes),
    )
    given = {one.tyre: [(each, each.data) for each in one.measured] for one in maps}
    given |= {one.tyre: list(zip(one.measured, one.given, strict=True)) for one in fits}
    models, maps_made = (
        [one.model_copy(update={"put_back": put_back(made, one.tyre, given[one.tyre])}) for one in entries]
        for entries in (made.models, made.maps)
    )
    return made.model_copy(update={"models": models, "maps": maps_made})


def _model_entry(found: TyreFit, shape: Shape | None, law: TemperatureFile | None) -> ModelEntry:
    if law is not None and len(found.measured) == 1:
        law, fit, ends = law.fitted(found.measured[0].tests, found.data[0], found.chosen.fit, found.intervals[0])
        found = replace(found, chosen=replace(found.chosen, fits=(fit,)), intervals=(ends,))
    verdicts = found.verdicts or (None,) * len(found.measured)
    rows = zip(found.measured, found.data, found.chosen.fits, found.intervals, verdicts, strict=True)
    ranged = found.model.relaxing and (len(found.choice.candidates) > 1 or found.model.linear)
    return ModelEntry(
        tyre=found.tyre,
        **model_parts(found.model),
        discrepancy=found.discrepancy,
        shape=shape,
        choice=found.choice.text,
        candidates=[_candidate_entry(one) for one in found.choice.candidates],
        conditions=[_condition_entry(*row, ranged=ranged) for row in rows],
        temperature=law,
    )


def _candidate_entry(one: Trial) -> CandidateFile:
    plain = ("free", "chi2", "dof", "aicc", "bic", "on_bound", "not_converged")
    return CandidateFile(
        model=one.name,
        causal=one.fit.model.causal,
        cross_validation=finite_or_none(one.cross_validation),
        **{name: getattr(one, name) for name in plain},
    )


def lacking_error(measured: Measured, verdict: Verdict) -> float:
    """The relative error of K* at each frequency that would make it possible for a relaxing tyre; 0 if it is."""
    return 0.0 if verdict.possible else model_discrepancy([measured.data], always=True)


def _condition_entry(
    measured: Measured, data: StiffnessData, found: Fit, ends: FloatArray, verdict: Verdict | None, *, ranged: bool
) -> ConditionFile:
    """The record of a condition; `ranged` where the data chose the order of the model."""
    band = (float(measured.frequency.min()), float(measured.frequency.max()))
    reach = (band[0] / REACH, band[1] * REACH) if ranged else (np.inf, np.inf)
    points = [point for name, point in measured.keys if name]
    judged = None
    if verdict is not None:
        judged = VerdictFile(
            possible=verdict.possible,
            holds=None if verdict.holds is Rung.RELAXING else verdict.holds.value,
            mass=verdict.mass or None,
            resonances=verdict.resonances.tolist(),
            chance=verdict.chance,
            misfit=lacking_error(measured, verdict),
            impossible=[] if verdict.possible else verdict.relaxing.impossible.tolist(),
        )
    return ConditionFile(
        state=NamedValue.of(measured.state),
        tests=[name for name in measured.tests if name],
        points=points if any(point > 1 for point in points) else [],
        band=band,
        amplitude=tested([measured], found.model),
        values=found.values.tolist(),
        covariance=found.covariance.tolist(),
        intervals=[(finite_or_none(low), finite_or_none(high)) for low, high in ends.tolist()],
        on_bound=[symbol for symbol, held in zip(found.model.symbols, found.on_bound.tolist(), strict=True) if held],
        chi2=float(found.chi2),
        dof=found.dof,
        converged=bool(found.converged),
        agreed=float(found.agreed),
        verdict=judged,
        static=StaticFile.of(measured.loop, found, data),
        ranges=ranges_of(data, min(slowest(measured.loop), reach[0]), reach[1]),
        rest=rest_of(data) if ranged else None,
        inertia=measured.inertia,
    )
