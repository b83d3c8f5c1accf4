"""One set of parameters over several inflation pressures: which conditions share one, the fit in words, its record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import AXES
from fourpole.errors import ModelError
from fourpole.fitting.measured import Measured
from fourpole.fitting.modelparts import Strict
from fourpole.models.choice import Trial, fixed_of
from fourpole.models.discrepancy import with_error
from fourpole.models.over_pressure import PressureFit, fit_over_pressures

_PRESSURE = q.PRESSURE.head
#: Smaller p-values are not told apart.
_LEAST_CHANCE = 1e-12
#: Pressures that differ by less than this fraction are one.
_SAME = 0.02


@dataclass(frozen=True)
class OverPressures:
    """A fit over pressures, with the places of its conditions among those of the tyre."""

    places: tuple[int, ...]
    fit: PressureFit


class PressureFile(Strict):
    """A set of parameters that several conditions share, which differ in their pressure."""

    conditions: list[int] = Field(min_length=2, max_length=100_000, description="Places of the conditions, from 0 on.")
    shared: list[str] = Field(max_length=100, description="Symbols of the parameters that were fitted.")
    chi2: float = Field(description="Of the shared set, without scatter.")
    dof: int
    separate_chi2: float = Field(description="With values of their own for each pressure.")
    separate_dof: int
    chance: float = Field(description="Probability of so large a difference of the two chi-squares by noise alone [1].")
    agrees: bool = Field(description="Whether the effect of the pressure agrees with the data.")
    trend: float = Field(description="Relative change of measured K* beyond the model's with pressure [1/Pa].")
    trend_std: float = Field(ge=0, description="Standard uncertainty of the trend [1/Pa].")
    scatter: list[float] = Field(
        max_length=100,
        description="Relative scatter of each shared parameter from pressure to pressure; in the covariance [1].",
    )
    alone: list[float] = Field(
        max_length=100_000, description="Relative error of K* at each pressure from parameters of its own [1]."
    )
    predicted: list[float] = Field(
        max_length=100_000, description="Relative error of K* at each pressure from the other pressures [1]."
    )

    @classmethod
    def of(cls, found: OverPressures) -> PressureFile:
        """The record of a fit."""
        fit = found.fit
        plain = ("chi2", "dof", "separate_chi2", "separate_dof", "chance", "agrees")
        return cls(
            conditions=list(found.places),
            shared=list(fit.shared),
            **{name: getattr(fit, name) for name in plain},
            trend=fit.trend / 1e5,
            trend_std=fit.trend_std / 1e5,
            scatter=fit.scatter.tolist(),
            alone=fit.own_error.tolist(),
            predicted=fit.left_out.tolist(),
        )


def check_pressures(where: str, records: Sequence[PressureFile], states: Sequence[Mapping[str, float]]) -> None:
    """ModelError unless the records name conditions that are there, each once, and that have a pressure."""
    named = [at for one in records for at in one.conditions]
    if any(not 0 <= at < len(states) or _PRESSURE not in states[at] for at in named) or len({*named}) != len(named):
        raise ModelError(f"{where}: a fit over pressures names conditions that are not there, or one twice")
    for one in records:
        if {len(one.alone), len(one.predicted)} != {len(one.conditions)} or len(one.scatter) != len(one.shared):
            raise ModelError(f"{where}: a fit over pressures has not as many errors as conditions and parameters")


def share_over_pressures(
    best: Trial,
    measured: Sequence[Measured],
    discrepancy: float,
    held: Sequence[Mapping[str, float]],
    share: Sequence[str],
    common: Sequence[FloatArray],
) -> tuple[Trial, tuple[OverPressures, ...]]:
    """The candidate with one set of parameters for all pressures, where its model has the pressure as a parameter."""
    model = best.fit.model
    if not model.pressure:
        return best, ()
    if share:
        raise ModelError(f"the {model.name} model has one set of parameters for all pressures: leave out --share")
    fits, found = list(best.fits), []
    for places in _groups(measured):
        known = [held[at] for at in places]
        pressures = [measured[at].state[_PRESSURE] for at in places]
        if any(one[model.pressure] != own for one, own in zip(known, pressures, strict=True)):
            continue  # the user has fixed the pressure
        made = fit_over_pressures(
            model,
            [with_error(measured[at].own, discrepancy) for at in places],
            pressures,
            np.stack([fits[at].values for at in places]),
            list(fixed_of(model, known)),
            [common[at] for at in places],
        )
        found.append(OverPressures(places, made))
        for at, one in zip(places, made.fits, strict=True):
            fits[at] = one
    return replace(best, fits=tuple(fits)), tuple(found)


def _groups(measured: Sequence[Measured]) -> list[tuple[int, ...]]:
    """Places of conditions that differ in their pressure only, at two pressures at least."""
    groups: dict[tuple[tuple[str, float], ...], list[int]] = {}
    for at, one in enumerate(measured):
        if _PRESSURE in one.state:
            rest = tuple(sorted((column, value) for column, value in one.state.items() if column != _PRESSURE))
            groups.setdefault(_near(rest, groups), []).append(at)
    pressures = {key: [measured[at].state[_PRESSURE] for at in places] for key, places in groups.items()}
    return [tuple(places) for key, places in groups.items() if min(pressures[key]) < (1 - _SAME) * max(pressures[key])]


def _near(
    rest: tuple[tuple[str, float], ...], known: Mapping[tuple[tuple[str, float], ...], object]
) -> tuple[tuple[str, float], ...]:
    """The known state that equals this one within the tolerance of a pressure; else this one."""
    for other in known:
        same = [column for column, _ in other] == [column for column, _ in rest]
        if same and all(_alike(column, a, b) for (column, a), (_, b) in zip(rest, other, strict=True)):
            return other
    return rest


def _alike(column: str, one: float, other: float) -> bool:
    """Whether two values on an axis are of one condition."""
    axis = next((axis for axis in AXES if axis.column == column), None)
    return abs(one - other) <= _SAME * max(abs(one), abs(other)) if axis is None else axis.same(one, other)


def pressure_sentence(found: OverPressures, measured: Sequence[Measured], discrepancy: float) -> str:
    """What a fit over pressures says of the effect of the pressure, as sentences without the last full stop."""
    fit = found.fit
    one = measured[found.places[0]]
    rest = replace(one, state={column: value for column, value in one.state.items() if column != _PRESSURE}).label
    low, high = fit.pressures.min() / 1e5, fit.pressures.max() / 1e5
    at = f"At {rest}, " if rest else ""
    model = fit.fits[0].model.name
    first = (
        f"{at}{_listed(fit.shared)} {'have' if len(fit.shared) > 1 else 'has'} one value for {len(fit.pressures)} "
        f"pressures from {low:.4g} to {high:.4g} bar: chi-square {fit.chi2:.3g} for {fit.dof} degrees of freedom, "
        f"{fit.separate_chi2:.3g} for {fit.separate_dof} with own values for each pressure"
    )
    parts = [first]
    size, std = 100 * abs(fit.trend), 100 * fit.trend_std
    side = "more" if fit.trend > 0 else "less"
    if fit.agrees:
        parts.append(
            f"The effect of the pressure agrees with that of the {model} ({_chance(fit.chance)}): measured |K*| "
            f"rises by {size:.2g} ± {std:.2g} % per bar {side} than the {model}'s"
        )
    else:
        parts.append(
            f"The effect of the pressure is NOT that of the {model} ({_chance(fit.chance)}): measured |K*| rises "
            f"by {size:.3g} ± {std:.2g} % per bar {side} than the {model}'s. Intervals and queries include the scatter "
            f"from pressure to pressure: {_scatter(fit)}"
        )
    predicted, alone = (100 * float(np.sqrt(np.mean(np.square(one)))) for one in (fit.left_out, fit.own_error))
    parts.append(
        f"From the other pressures, K* at each one is predicted with an error of {predicted:.2g} % ({alone:.2g} % with "
        "own values)"
    )
    if discrepancy:
        parts.append(
            f"Over frequency the {model} itself is off by {100 * discrepancy:.2g} %: it does not describe this tyre"
            if not fit.agrees
            else f"Over frequency the {model} itself is off by {100 * discrepancy:.2g} %, so this shows little"
        )
    return ". ".join(parts)


def _chance(value: float) -> str:
    return f"p-value {value:.2g}" if value > _LEAST_CHANCE else f"p-value below {_LEAST_CHANCE:g}"


def _scatter(fit: PressureFit) -> str:
    """The scatter of the shared parameters in words."""
    pairs = zip(fit.shared, (100 * fit.scatter).tolist(), strict=True)
    return _listed([f"{size:.2g} % of {name}" for name, size in pairs if size]) or "none that stands out"


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def between(
    records: Sequence[PressureFile], states: Sequence[Mapping[str, float]], state: Mapping[str, float]
) -> PressureFile | None:
    """The only set of parameters whose range of pressures holds that of a stated point; None if there is none.

    `states` are those of the conditions for which all but the pressure is as stated; others are empty.
    """
    pressure = state.get(_PRESSURE)
    if pressure is None:
        return None
    good = []
    for one in records:
        own = [states[at][_PRESSURE] for at in one.conditions if states[at]]
        if len(own) == len(one.conditions) and min(own) <= pressure <= max(own):
            good.append(one)
    return good[0] if len(good) == 1 else None
