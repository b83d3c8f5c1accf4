"""Results with models and maps: fitted to closed formulas, as `fourpole fit` and `fourpole map` leave them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
from tests.plot.conftest import results_of

from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.modelparts import VerdictFile
from fourpole.models.families import model_named
from fourpole.study.study import Study

#: An elastomer over seven decades: stiffness at rest and at once, relaxation time, order.
ELASTOMER = (2e5, 5e7, 1e-5, 0.5)
_PRESSURES, _FREQUENCIES = (100e3, 170e3, 240e3), (10.0, 14.0, 17.0, 19.0, 24.0)


@cache
def study_with_models() -> Study:
    """Two tyres at three pressures, two preloads and five frequencies, with a Zener model and a map of each."""
    return with_models(results_of(pressures=_PRESSURES, frequencies=_FREQUENCIES), "zener")


def with_models(results: Study, model: str, *, maps: bool = True) -> Study:
    measured = measured_of(results.dynamic)
    found = replace(results, models=model_file(measured, fit_tyres(measured, model)))
    return replace(found, maps=model_file(measured, maps=map_tyres(measured, model))) if maps else found


def elastomer_table(temperatures: Sequence[float] = (), *, count: int = 40, noise: float = 0.01) -> pl.DataFrame:
    """K* of an elastomer from 0.01 Hz to 100 kHz; by temperature its relaxation moves along."""
    rng = np.random.default_rng(3)
    frequency = np.geomspace(1e-2, 1e5, count)
    parts = []
    for degrees in temperatures or (None,):
        values = list(ELASTOMER)
        if degrees is not None:
            values[2] *= 10 ** (-(degrees - 20) / 20)
        k = model_named("fractional").stiffness(values, 2 * np.pi * frequency)
        std = noise * np.abs(k)
        k = k + std * (rng.normal(size=count) + 1j * rng.normal(size=count))
        columns = {"frequency [Hz]": frequency, "Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}
        columns |= {"u(Re K*) [N/m]": std, "u(Im K*) [N/m]": std}
        if degrees is not None:
            columns["temperature [degC]"] = np.full(count, degrees)
        parts.append(pl.DataFrame(columns))
    return pl.concat(parts)


@cache
def elastomer(temperatures: tuple[float, ...] = (), model: str = "fractional") -> Study:
    """A table by itself, as the command fits it where there is no campaign."""
    nothing = Study(pl.DataFrame(), elastomer_table(temperatures), pl.DataFrame())
    return with_models(nothing, model, maps=bool(temperatures))


def edited(results: Study, **changes: object) -> Study:
    """The same with something else in the entry of each tyre's model."""
    assert results.models is not None
    entries = [one.model_copy(update=changes) for one in results.models.models]
    return replace(results, models=results.models.model_copy(update={"models": entries}))


def against(results: Study, model: str) -> Study:
    """The same where another model, which is no better, was tried too."""
    assert results.models is not None
    measured = measured_of(results.dynamic)
    others = model_file(measured, fit_tyres(measured, model)).models
    pairs = zip(results.models.models, others, strict=True)
    entries = [one.model_copy(update={"candidates": [*one.candidates, *other.candidates]}) for one, other in pairs]
    return replace(results, models=results.models.model_copy(update={"models": entries}))


def judged(results: Study, verdicts: Sequence[tuple[bool, float, list[float]]]) -> Study:
    """Verdicts of the first conditions of the first tyre, which alone is kept."""
    assert results.models is not None
    entry = results.models.models[0]
    conditions = [
        one.model_copy(update={"verdict": VerdictFile(possible=good, chance=0.5, misfit=off, impossible=where)})
        for one, (good, off, where) in zip(entry.conditions, verdicts, strict=False)
    ]
    kept = entry.model_copy(update={"conditions": conditions})
    return replace(results, models=results.models.model_copy(update={"models": [kept]}))


def named(file: ModelFile, names: Mapping[str, str]) -> ModelFile:
    """The same with tyres of other names."""
    update = {
        field: [one.model_copy(update={"tyre": names[one.tyre]}) for one in getattr(file, field)]
        for field in ("models", "maps")
    }
    return file.model_copy(update=update)


def of_each(file: ModelFile, names: Sequence[str]) -> ModelFile:
    """The entries of the only tyre once more for each of the tyres of these names, which are alike."""
    update = {
        field: [one.model_copy(update={"tyre": name}) for name in names for one in getattr(file, field)]
        for field in ("models", "maps")
    }
    return file.model_copy(update=update)
