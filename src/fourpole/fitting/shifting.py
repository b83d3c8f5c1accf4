"""Tables of isotherms become a master curve, its shift factors and their law, as tables and files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray, parts
from fourpole.core.condition import AXES, Condition, Sameness
from fourpole.errors import FileError, ModelError
from fourpole.fitting.document import MOST_BYTES
from fourpole.fitting.likelihood import COVARIANCE_COLUMNS
from fourpole.fitting.measured import MASTER, Measured, MeasuredSet, measured_of, read_measured
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.modelparts import NamedValue, PutBackFile
from fourpole.fitting.temperature import ShiftsFile, TemperatureFile, VerticalFile
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes
from fourpole.io.seal import alterations, sealed
from fourpole.io.tables.kstar import TableOptions
from fourpole.models.common_curve import Isotherm
from fourpole.models.data import complex_columns
from fourpole.models.shift_law import CONSTANTS, LawChoice, Overlap, fit_laws, overlaps
from fourpole.models.superposition import Superposition, superpose

#: Largest difference of two temperatures of one isotherm [K].
APART = 1.0
#: Files beside the table of a master curve.
LAW, COVARIANCE = "temperature.json", "covariance.parquet"
_TEMPERATURE = q.TEMPERATURE.head


@dataclass(frozen=True, eq=False)
class TyreShift(ByValue):
    """The master curve of one specimen.

    Attributes
    ----------
    tyre : str
    state : dict of str to float
        Values on the axes besides temperature.
    measured : tuple of Measured
        The isotherms of `found`, rising in temperature.
    found : Superposition
    rest : tuple of Isotherm
        Isotherms that no overlap links to the reference.
    overlaps : tuple of Overlap
    choice : LawChoice
    vertical : (float, float) or None
        Relative change of b_T per kelvin, and its standard uncertainty [1/K]; None without vertical shifts.
    """

    tyre: str
    state: dict[str, float]
    measured: tuple[Measured, ...]
    found: Superposition
    rest: tuple[Isotherm, ...]
    overlaps: tuple[Overlap, ...]
    choice: LawChoice
    vertical: tuple[float, float] | None


def read_isotherms(
    paths: Sequence[str | Path], *, apart: float = APART, std: float | None = None, options: TableOptions | None = None
) -> MeasuredSet:
    """Read the isotherms of one or several tables, as one set of conditions.

    Parameters
    ----------
    paths : sequence of path
        Tables or results folders with a column of temperature.
    apart : float [K]
        Largest difference of two temperatures of one isotherm.
    std : float, optional [1]
        Relative standard uncertainty of K*, in place of that in the tables.
    options : TableOptions, optional
        What the tables do not say. Without a factor or shape a modulus takes the place of K*.

    Raises
    ------
    ModelError
        If a table has no temperature or no K*.
    FileError, TableError
        If a table cannot be read.
    """
    if not apart > 0:
        raise ModelError("the temperatures of one isotherm must be allowed to differ: state --apart above zero")
    axes = tuple(replace(axis, absolute=apart) if axis.column == _TEMPERATURE else axis for axis in AXES)
    options = replace(TableOptions() if options is None else options, moduli=True)
    sets = [read_measured(path, std=std, axes=axes, options=options) for path in paths]
    for path, one in zip(paths, sets, strict=True):
        if any(_TEMPERATURE not in each.state for each in one.conditions):
            lacking = "".join(f"; {note}" for note in one.notes if "states no unit" in note)
            raise ModelError(
                f"{Path(path).name}: has no {_TEMPERATURE} in some or all rows: add a column {_TEMPERATURE} with the "
                f"temperature of each row{lacking}"
            )
    return MeasuredSet(
        conditions=tuple(chain.from_iterable(one.conditions for one in sets)),
        notes=tuple(dict.fromkeys(chain.from_iterable(one.notes for one in sets))),
        known=all(one.known for one in sets),
        source=", ".join(one.source for one in sets),
        sha256=sets[0].sha256 if len(sets) == 1 else "",
        rule=sets[0].rule,
    )


def shift_tyres(
    measured: MeasuredSet,
    reference: float | None = None,
    *,
    vertical: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[TyreShift]:
    """The master curve of each specimen, at each state besides temperature; ModelError if one cannot be made."""
    rule = measured.rule.without("temperature")
    numeric = [axis for axis in rule.axes if not axis.text]
    plain = Sameness(tuple(numeric))
    states = [Condition(one.tyre, tuple(one.state.get(axis.column) for axis in numeric)) for one in measured.conditions]
    labels = plain.groups(states)
    every = [int(label) for label in np.unique(labels)]
    made = []
    for done, label in enumerate(every):
        if progress is not None:
            progress(done, len(every))
        members = [one for one, own in zip(measured.conditions, labels, strict=True) if own == label]
        made.append(_shift(members, reference, known=measured.known, vertical=vertical))
    return made


def _shift(members: Sequence[Measured], reference: float | None, *, known: bool, vertical: bool) -> TyreShift:
    ordered = sorted(members, key=lambda one: one.state[_TEMPERATURE])
    isotherms = [_isotherm(one, known=known) for one in ordered]
    found, rest = superpose(isotherms, reference, vertical=vertical)
    kept = {one.temperature for one in found.isotherms}
    choice = fit_laws(found.temperatures, found.log_a, found.covariance, found.reference)
    state = {name: value for name, value in ordered[0].state.items() if name != _TEMPERATURE}
    return TyreShift(
        tyre=ordered[0].tyre,
        state=state,
        measured=tuple(one for one in ordered if one.state[_TEMPERATURE] in kept),
        found=found,
        rest=rest,
        overlaps=overlaps(found),
        choice=choice,
        vertical=_vertical(found) if vertical else None,
    )


def _isotherm(one: Measured, *, known: bool) -> Isotherm:
    """The isotherm of a condition; rows of one frequency are their mean."""
    omega, at = _frequencies(one)
    covariance = _means(one.own.covariance, at) / np.bincount(at)[:, None, None] if known else None
    return Isotherm(one.state[_TEMPERATURE], omega, _means(one.own.stiffness, at), covariance)


def _frequencies(one: Measured) -> tuple[FloatArray, np.ndarray]:
    """The distinct angular frequencies of a condition, and the number of each row's."""
    _, first, at = np.unique(np.round(np.log(one.own.omega), 10), return_index=True, return_inverse=True)
    return one.own.omega[first], at


def _means(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Means (n, ...) of the rows (N, ...) of each frequency, by their numbers."""
    found = np.zeros((at.max() + 1, *values.shape[1:]), dtype=values.dtype)
    np.add.at(found, at, values)
    return np.asarray(found / np.bincount(at).reshape(-1, *[1] * (values.ndim - 1)))


def _vertical(found: Superposition) -> tuple[float, float]:
    """Slope of ln b_T over temperature [1/K] by weighted least squares, and its standard uncertainty."""
    others = np.arange(found.temperatures.size) != found.reference
    x = (found.temperatures - found.temperatures[found.reference])[others]
    y = found.log_b[others]
    weight = np.linalg.pinv(found.vertical_covariance[np.ix_(others, others)] + 1e-16 * np.eye(x.size))
    slope = float(x @ weight @ y / (x @ weight @ x))
    rest = y - slope * x
    scale = max(1.0, float(rest @ weight @ rest) / max(x.size - 1, 1))
    return slope, float(np.sqrt(scale / (x @ weight @ x)))


def law_file(one: TyreShift) -> TemperatureFile:
    """The shift factors of a master curve and their law, as a model file has them."""
    law = one.choice.best
    names = CONSTANTS[law.name]
    ends = one.found.temperatures
    return TemperatureFile(
        law="WLF" if law.name == "WLF" else "Arrhenius",
        reference=law.reference,
        constants=[NamedValue(name=n, unit=u, value=float(v)) for (n, u), v in zip(names, law.values, strict=True)],
        covariance=law.covariance.tolist(),
        range=(float(ends.min()), float(ends.max())),
        vertical=None if one.vertical is None else VerticalFile(slope=one.vertical[0], std=one.vertical[1]),
        decided=one.choice.decided,
        shifts=_shifts_file(one),
    )


def _name(one: TyreShift, temperature: float) -> str:
    """Name of an isotherm in the table of the master curve."""
    return f"{one.tyre} at {temperature:.5g} degC".strip()


def _shifts_file(one: TyreShift) -> ShiftsFile:
    found, decade = one.found, np.log(10.0)
    return ShiftsFile(
        temperatures=found.temperatures.tolist(),
        tests=[_name(one, t) for t in found.temperatures.tolist()],
        log10_a=(found.log_a / decade).tolist(),
        covariance_a=(found.covariance / decade**2).tolist(),
        log10_b=(found.log_b / decade).tolist() if found.vertical else [],
        covariance_b=(found.vertical_covariance / decade**2).tolist() if found.vertical else [],
    )


def shift_table(every: Sequence[TyreShift]) -> pl.DataFrame:
    """The shift factors of all isotherms, with their standard uncertainties."""
    rows: list[dict[str, Any]] = []
    for one in every:
        found, law = one.found, one.choice.best
        stds = found.std / np.log(10), law.log_a_std(found.temperatures) / np.log(10)
        for at, t in enumerate(found.temperatures.tolist()):
            row = {"tyre": one.tyre, **one.state, _TEMPERATURE: t}
            row |= {"log10 aT [1]": float(found.log_a[at] / np.log(10)), "u(log10 aT) [1]": float(stds[0][at])}
            row |= {"log10 aT by the law [1]": float(law.log_a(t)[0] / np.log(10))}
            row |= {"u(log10 aT by the law) [1]": float(stds[1][at])}
            if found.vertical:
                b = float(np.exp(found.log_b[at]))
                row |= {"bT [1]": b, "u(bT) [1]": b * float(found.vertical_std[at])}
            rows.append(row)
        lost = [{"tyre": one.tyre, **one.state, _TEMPERATURE: each.temperature} for each in one.rest]
        rows += lost
    return pl.DataFrame(rows, infer_schema_length=None)


def overlap_table(every: Sequence[TyreShift]) -> pl.DataFrame:
    """The overlaps of neighbouring isotherms, with their verdicts."""
    rows: list[dict[str, Any]] = []
    for one in every:
        for each in one.overlaps:
            row: dict[str, Any] = {"tyre": one.tyre, **one.state}
            row |= dict(zip(("colder [degC]", "warmer [degC]"), each.temperatures, strict=True))
            row |= {"overlap [decades]": each.decades, "points": each.points, "chi2": each.chi2, "dof": each.dof}
            row |= {"p-value [1]": each.chance, "difference of K' [1]": each.level}
            rows.append(row | {"difference of loss factor [1]": each.loss, "verdict": each.verdict})
    return pl.DataFrame(rows, infer_schema_length=None)


def master_tables(every: Sequence[TyreShift]) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The master curve as a table that `fit` reads, and its covariance.

    Reduced K* over reduced frequency, at the reference temperature. The uncertainty of the shift factors is not part of
    it: the fit adds it to that of the parameters.
    """
    rows: list[dict[str, Any]] = []
    covariance: list[dict[str, Any]] = []
    for number, one in enumerate(every):
        for at, t in enumerate(one.found.temperatures.tolist()):
            own, shared = _errors(one.found, at, one.measured[at])
            omega, stiffness = one.found.reduced(at)
            name = _name(one, t)
            for point in range(omega.size):
                key = {q.TEST.head: name, q.POINT.head: point + 1}
                std = np.sqrt(np.diag(own[point] + shared[point] @ shared[point].T))
                row = {**key, "tyre": one.tyre, **one.state, _TEMPERATURE: one.choice.best.reference}
                row |= {q.FREQUENCY.head: float(omega[point] / (2 * np.pi))}
                row |= {q.STORAGE.head: float(stiffness[point].real), q.LOSS.head: float(stiffness[point].imag)}
                row |= {q.STORAGE.u_head: float(std[0]), q.LOSS.u_head: float(std[1])}
                row |= {"measured temperature [degC]": t}
                rows.append(row | {"measured frequency [Hz]": float(one.found.isotherms[at].frequency[point])})
                values = (name, f"{number}", len(covariance), own[point].ravel().tolist(), *shared[point].tolist())
                covariance.append({**dict(zip(COVARIANCE_COLUMNS, values, strict=True)), q.POINT.head: point + 1})
    return pl.DataFrame(rows, infer_schema_length=None), pl.DataFrame(covariance, infer_schema_length=None)


def _errors(found: Superposition, at: int, measured: Measured) -> tuple[FloatArray, FloatArray]:
    """Own covariance (N, 2, 2) of reduced K* of an isotherm, and its change (N, 2, p) by errors of the recordings."""
    _, stiffness = found.reduced(at)
    own = (found.errors[at] * np.exp(found.log_b[at]))[:, :, None] ** 2 * np.eye(2)
    if not measured.shared.size:
        return own, np.zeros((stiffness.size, 2, 0))
    relative = complex_columns(measured.shared) / measured.own.stiffness[:, None]
    _, same = _frequencies(measured)
    whole = stiffness[:, None] * _means(relative, same)
    return own, parts(whole, axis=1)


def law_document(every: Sequence[TyreShift], sha256: str) -> dict[str, Any]:
    """The laws of a master curve as a JSON document, with the hash of the table that they belong to."""
    laws = [{"tyre": one.tyre, "temperature": law_file(one).model_dump(mode="json")} for one in every]
    return sealed({"format": "fourpole-temperature", "version": 1, "master sha256": sha256, "laws": laws})


def laws_beside(table: Path, sha256: str) -> tuple[dict[str, TemperatureFile], str]:
    """Laws by specimen for a master curve, from the file beside it, and a note if they are of another table."""
    beside = table.parent / LAW
    if table.name != MASTER or not beside.is_file():
        return {}, ""
    try:
        document = json_of(read_bytes(beside, max_bytes=MOST_BYTES, within=beside.parent), LAW)
        changed, same = alterations(document), document["master sha256"] == sha256
        laws = {one["tyre"]: TemperatureFile.model_validate(one["temperature"]) for one in document["laws"]}
        single = len(laws) == len(document["laws"])
    except (FileError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}, f"{LAW} beside the table cannot be read: the model has no law of the temperature; run fourpole shift"
    if changed:
        return {}, f"{LAW}: {changed[0]}: the model has no law of the temperature; run fourpole shift again"
    if not same:
        return {}, f"{LAW} is of another {MASTER}: the model has no law of the temperature; run fourpole shift again"
    if not single:
        return (
            {},
            "a specimen has several master curves: its model has no law of the temperature; fit one state at a time",
        )
    return laws, ""


def shifted_back(one: TyreShift) -> PutBackFile | None:
    """How many data of a master curve a query gives back, through its shift factors and a Prony series of the curve.

    None if no Prony series could be fitted. See `putback.put_back`.
    """
    frame, covariance = master_tables([one])
    laws = {one.tyre: law_file(one)}
    try:
        measured = measured_of(frame, covariance, name=MASTER)
        (entry,) = model_file(measured, fit_tyres(measured, "prony"), laws=laws).models
    except ModelError:
        return None
    return entry.put_back
