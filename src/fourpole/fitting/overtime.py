"""Fits of relaxation and creep over time: a Prony series for each condition, as an ordinary model file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole.core import stats
from fourpole.core.condition import Sameness
from fourpole.errors import ModelError
from fourpole.fitting.likelihood import MOST_BYTES
from fourpole.fitting.modelfile import CandidateFile, ConditionFile, ModelEntry, ModelFile, model_parts
from fourpole.fitting.modelparts import NamedValue, Provenance, VerdictFile
from fourpole.fitting.rows import conditions_in, names_apart
from fourpole.io.published import read_listed
from fourpole.io.tables.kstar import TableOptions
from fourpole.io.tables.pair import TimeTable, read_over_time
from fourpole.models.choice import criteria
from fourpole.models.families import model_named
from fourpole.models.maxwell import Prony
from fourpole.models.overtime import TimeFit, density, fit_creep, fit_relaxation
from fourpole.models.shape import Shape

_RULE = Sameness()
_Condition = tuple[dict[str, float], tuple[float, float], TimeFit]
"""A state, its band [Hz] and its fit."""


def fit_over_time(
    path: Path,
    model: str = "auto",
    options: TableOptions | None = None,
    *,
    std: float | None = None,
    tyre: str | None = None,
    settings: Mapping[str, Any] | None = None,
) -> ModelFile | None:
    """The Prony series of a table of relaxation or creep; None for a table that is none.

    Parameters
    ----------
    path : Path
    model : str
        auto or prony, or prony:N for N relaxation times per decade of the grid.
    options : TableOptions, optional
        What the table does not say.
    std : float, optional [1]
        Relative standard uncertainty, in place of that in the table.
    tyre : str, optional
        Only this specimen.
    settings : mapping, optional
        Options as the file states them.

    Raises
    ------
    ModelError
        If there is no row to fit, or the model is another.
    FileError, TableError
        If the table cannot be read.
    """
    table = read_over_time(path, options)
    if table is None:
        return None
    family, _, _ = model.partition(":")
    if family not in ("auto", "prony"):
        raise ModelError(f"--model {model}: relaxation and creep over time are fitted by prony or prony:N only")
    made = model_named(model) if ":" in model else Prony(density(table.time[np.isfinite(table.time)]))
    assert isinstance(made, Prony)
    entries = _entries(table, path.name, made, std, tyre, None if options is None else options.shape)
    return ModelFile(
        kind="model",
        models=entries,
        provenance=Provenance.of(
            path.name,
            hashlib.sha256(read_listed(path, max_bytes=MOST_BYTES)).hexdigest(),
            settings,
            [f"understood {'; '.join(table.understood)}", *table.warnings],
        ),
    )


def _entries(
    table: TimeTable, name: str, model: Prony, std: float | None, tyre: str | None, shape: Shape | None
) -> list[ModelEntry]:
    """The entry of each specimen."""
    good = np.isfinite(table.time) & np.isfinite(table.values) & (table.time >= 0) & (table.values > 0)
    if not good.any():
        raise ModelError(f"{name}: no row has a time and a value above zero: nothing can be fitted")
    frame = pl.DataFrame({"": good}).hstack(table.further).filter(good)
    rows = conditions_in(frame, _RULE)
    (names,), labels = names_apart([rows], Sameness(())), _RULE.groups(rows)
    time, values = table.time[good], table.values[good]
    spread = std * values if std is not None else None if table.std is None else table.std[good]
    fit = fit_creep if table.creep else fit_relaxation
    found: dict[str, list[_Condition]] = {}
    for label in np.unique(labels):
        at = np.flatnonzero(labels == label)
        if tyre is not None and names[int(at[0])] != tyre:
            continue
        own = None if spread is None else spread[at]
        series = fit(time[at], values[at], own, per_decade=model.per_decade)
        state = {}
        for axis in _RULE.axes:
            if axis.column in frame.columns and np.isfinite(mean := float(frame[axis.column].to_numpy()[at].mean())):
                state[axis.column] = mean
        positive = time[at][time[at] > 0]
        band = (float(1 / (2 * np.pi * positive.max())), float(1 / (2 * np.pi * positive.min())))
        found.setdefault(names[int(at[0])], []).append((state, band, series))
    if not found:
        raise ModelError(f"{name}: no row of a specimen {tyre!r}: there are {', '.join(dict.fromkeys(names))}")
    what, known = "creep" if table.creep else "relaxation", spread is not None
    return [_entry(one, model, conditions, what, shape, known=known) for one, conditions in found.items()]


def _entry(
    tyre: str, model: Prony, conditions: Sequence[_Condition], what: str, shape: Shape | None, *, known: bool
) -> ModelEntry:
    """The entry of a specimen; conditions with fewer arms have arms without stiffness besides."""
    count = max(1, *(one.arms.springs.size for _, _, one in conditions)) if conditions else 1
    placed = Prony(model.per_decade, 10.0 ** -np.arange(count))
    fits = [one for _, _, one in conditions]
    chi2, dof = sum(one.chi2 for one in fits), sum(one.dof for one in fits)
    free = sum(1 + one.arms.springs.size for one in fits)
    said = f"{placed.name}: the non-negative spectrum of {what} over time, {free} parameters above zero"
    aicc, bic = criteria(chi2, free + dof, free)
    candidate = CandidateFile(
        model=placed.name, causal=True, free=free, chi2=chi2, dof=dof,
        aicc=aicc, bic=bic, cross_validation=None, on_bound=0, not_converged=0,
    )  # fmt: skip
    return ModelEntry(
        tyre=tyre,
        **model_parts(placed),
        discrepancy=max(one.error for one in fits),
        shape=shape,
        choice=f"{said}, chi-square {chi2:.3g} for {dof} degrees of freedom",
        candidates=[candidate],
        conditions=[_condition(*one, count, known=known) for one in conditions],
    )


def _condition(
    state: dict[str, float], band: tuple[float, float], found: TimeFit, count: int, *, known: bool
) -> ConditionFile:
    arms = found.arms
    own = arms.springs.size
    idle = (arms.times.min() if own else 1.0) * 10.0 ** -np.arange(1, count - own + 1)
    values = np.concatenate([[arms.rest], arms.springs, np.zeros(count - own), arms.times, idle])
    places = np.concatenate([np.arange(1 + own), 1 + count + np.arange(own)])
    covariance, ends = np.zeros((values.size, values.size)), np.stack([values, values], axis=1)
    covariance[np.ix_(places, places)], ends[places] = found.covariance, found.intervals
    chance = float(stats.chi2.sf(found.chi2, max(found.dof, 1)))
    verdict = VerdictFile(possible=not found.error, chance=chance, misfit=found.error, impossible=[])
    return ConditionFile(
        state=NamedValue.of(state),
        tests=[],
        band=band,
        values=values.tolist(),
        covariance=covariance.tolist(),
        intervals=[(float(low), float(high) if np.isfinite(high) else None) for low, high in ends],
        on_bound=[f"K_{at + 1}" for at in range(own, count)],
        chi2=found.chi2,
        dof=found.dof,
        converged=True,
        agreed=1.0,
        verdict=verdict if known else None,
    )
