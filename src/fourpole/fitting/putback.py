"""The data that a model was made from, put back: what a query answers at their own points, against the data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import AMPLITUDE
from fourpole.core.confidence import NORMAL_95
from fourpole.errors import ModelError
from fourpole.fitting.measured import Measured
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.modelparts import PutBackFile
from fourpole.fitting.query import Query, ask
from fourpole.models.data import StiffnessData

#: A condition, and its K* as the model has it: without a mass that the fit took off.
Datum = tuple[Measured, StiffnessData]
_HEADS = (q.STORAGE, q.LOSS, q.K1)


@dataclass(frozen=True, eq=False)
class _Part:
    """Some frequencies of a condition with one operating point.

    Attributes
    ----------
    rows : (n,) int array
    frequency : (n,) float array [Hz]
        As they were measured; those of a master curve are reduced ones.
    state : dict of str to float
    scale : float [1]
        K* of the data over K* of the query: the vertical shift factor of a master curve.
    """

    rows: np.ndarray
    frequency: FloatArray
    state: dict[str, float]
    scale: float = 1.0


def put_back(file: ModelFile, tyre: str, conditions: Iterable[Datum]) -> PutBackFile | None:
    """How many of the data of a tyre lie in the 95 % interval that a query gives for them; None without data.

    Each K' and K'' is predicted by `query.ask` at its own operating point: specimen, pressure, preload, further axes,
    frequency, of a master curve the temperature of its isotherm, and the amplitude if K* depends on it. So is K1 of a
    static test at rest. Frequencies outside the band that all conditions of a map have are predicted as with
    `--beyond`. A datum for which the query is refused counts as outside.

    The interval is that of prediction: 1.96 times the root of u² of the query and u² of the datum to either side. That
    of the query includes the model discrepancy, or the scatter about a map; that of the datum what the tests share. The
    model has seen the datum, so the interval is rather too wide than too narrow.
    """
    inside = values = 0
    worst: dict[str, float] = {}
    for measured, data in conditions:
        std = np.sqrt(np.diagonal(data.covariance) if data.full else np.diagonal(data.covariance, 0, 1, 2).ravel())
        for part in _parts(file, tyre, measured, data):
            found = data.stiffness[part.rows]
            rest = float(data.k1) if measured.loop is None and part.rows[0] == 0 else np.nan
            datum = np.stack([found.real, found.imag, np.full(found.size, np.nan)], axis=1)
            own = np.stack([*std.reshape(-1, 2)[part.rows].T, np.full(found.size, float(data.k1_std))], axis=1)
            datum[0, 2] = rest
            far = _distances(file, tyre, part, datum, own)
            known = ~np.isnan(far)
            values, inside = values + int(known.sum()), inside + int((far <= NORMAL_95).sum())
            for row, size in zip(part.rows.tolist(), np.nanmax(far, axis=1, initial=0.0).tolist(), strict=True):
                if size > NORMAL_95 and (name := measured.tests[row]):
                    worst[name] = max(size, worst.get(name, 0.0))
    if not values:
        return None
    return PutBackFile(inside=inside, values=values, outside=sorted(worst, key=lambda name: -worst[name]))


def _parts(file: ModelFile, tyre: str, one: Measured, data: StiffnessData) -> Iterator[_Part]:
    """The frequencies of a condition by their operating points."""
    entry = file.model_entry(tyre)
    law = None if entry is None else entry.temperature
    every = np.arange(data.count)
    if law is not None and law.shifts is not None and set(one.tests) <= set(law.shifts.tests):
        for name, temperature in zip(law.shifts.tests, law.shifts.temperatures, strict=True):
            rows, shift = np.flatnonzero(np.array(one.tests) == name), law.at(temperature)
            if rows.size:
                state = {**one.state, q.TEMPERATURE.head: temperature}
                yield _Part(rows, one.frequency[rows] / shift.factor, state, float(np.exp(shift.log_b)))
    elif data.amplitude is not None:
        for row in every:
            state = {**one.state, AMPLITUDE.column: float(data.amplitude[row])}
            yield _Part(every[row : row + 1], one.frequency[row : row + 1], state)
    else:
        yield _Part(every, one.frequency, one.state)


def _distances(file: ModelFile, tyre: str, part: _Part, datum: FloatArray, own: FloatArray) -> FloatArray:
    """Distances (n, 3) of K', K'' and K1 from their predictions, in standard uncertainties; not-a-number if unknown."""
    try:
        rows = ask(file, Query(part.frequency.tolist(), part.state, tyre, beyond=True))
    except ModelError:
        return np.where(np.isnan(datum), np.nan, np.inf)
    made, std = (part.scale * _numbers(rows, [getattr(one, of) for one in _HEADS]) for of in ("head", "u_head"))
    off, spread = np.abs(made - datum), np.hypot(np.nan_to_num(std), np.nan_to_num(own))
    return np.divide(off, spread, out=np.where(off > 0, np.inf, off), where=spread > 0)


def _numbers(rows: Sequence[dict[str, Any]], heads: Sequence[str]) -> FloatArray:
    return np.array([[row[head] for head in heads] for row in rows], dtype=float)
