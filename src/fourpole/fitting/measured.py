"""Measured K*, condition by condition, with the covariance across frequencies: the data of fits.

The source is a results folder, a dynamic.csv alone, or any table with a frequency, Re K* and Im K*, such as
`fourpole identify` writes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, short_repr
from fourpole.core.condition import AXES, TEMPERATURE_SENSITIVITY, Axis, Sameness, temperature_std
from fourpole.core.joint.around import Likelihood
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import COLUMN, columns_of, levels_of, mixed, with_amplitude, without_amplitude
from fourpole.fitting.inertia import InertiaFile, bodies_of, inertia_of
from fourpole.fitting.likelihood import COVARIANCE, MOST_BYTES, covariance_of, joined, read_likelihoods
from fourpole.fitting.rows import (
    FREQUENCY,
    IM,
    KEY,
    RE,
    STD,
    Key,
    as_frame,
    by_labels,
    conditions_in,
    covariances,
    in_si,
    keys_of,
    known_numbers,
    lacking_std,
    names_apart,
    rule_in,
    usable,
)
from fourpole.io.folders import results_in
from fourpole.io.published import Published, published_beside, read_listed
from fourpole.io.tables.kstar import TableOptions, read_k_star
from fourpole.models.data import StiffnessData, complex_columns, real_columns
from fourpole.models.inertial import Of
from fourpole.models.problem import Recorded, bends
from fourpole.models.ramp import Loop
from fourpole.quantities import ShownUnits
from fourpole.units import shown

_TEMPERATURE = q.TEMPERATURE.head
#: The note on a table without uncertainties of K*.
NO_STD = "the table states no uncertainty of K*: what the best passive specimen leaves is taken for it"
_MOVED = (
    f"rows of one condition differ in temperature: K* counts as uncertain by {100 * TEMPERATURE_SENSITIVITY:g} % per "
    "kelvin from their mean"
)
#: Relative distance beyond an end of a band within which a frequency is inside, as drives are stated by round numbers.
_NOMINAL = 1e-2
_RULE = Sameness()
#: Tables of a results folder, and the table of a master curve; covariance.parquet may lie beside each.
_RESULTS, MASTER = ("dynamic.csv", "dynamic.parquet"), "master.csv"
#: Least variance of a test's K* as a share of that of its condition; from the second share on it is that of all tests.
_LEAST_OWN, _COMMON = 1e-4, 0.9


@dataclass(frozen=True, eq=False)
class Measured(ByValue):
    """K* over frequency of one condition: a tyre at one pressure, preload and temperature.

    Attributes
    ----------
    tyre : str
    state : dict of str to float
        Stated values of the axes, by column: {"pressure [Pa]": 1.7e5}.
    keys : tuple of (str, int)
        Test and point of each frequency, rising in frequency.
    own : StiffnessData
        K* with the covariance that is independent between frequencies.
    shared : (2N, p) float array [N/m]
        Changes of Re K* and Im K* of each frequency in turn when one of p errors that all conditions share is one
        standard uncertainty.
    recorded : Recorded, optional
        K* near that of a model, as the recordings have it. The data have it where the shared errors are not linear
        within the noise.
    loop : Loop, optional
        The static test, if K1 is the tangent of its ramp.
    inertia : InertiaFile, optional
        The mass of the specimen between its ends, of which K* of its springs is free.
    of : Of
        What K* is of.
    """

    tyre: str
    state: dict[str, float]
    keys: tuple[Key, ...]
    own: StiffnessData
    shared: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    recorded: Recorded | None = field(default=None, compare=False)
    loop: Loop | None = None
    inertia: InertiaFile | None = None
    of: Of = Of.DRIVING_POINT

    @property
    def tests(self) -> tuple[str, ...]:
        """Name of the test of each frequency."""
        return tuple(test for test, _ in self.keys)

    @property
    def data(self) -> StiffnessData:
        """K* with its whole covariance, shared errors included."""
        if not self.shared.size:
            return self.own
        data = self.own.with_errors(self.shared)
        if self.recorded is None or not bends(self.own, self.shared):
            return data
        return replace(data, recorded=np.array(self.recorded, dtype=object))

    @property
    def frequency(self) -> FloatArray:
        """Frequencies (N,) [Hz]."""
        return np.asarray(self.own.omega / (2 * np.pi))

    @property
    def label(self) -> str:
        """The condition in words: 1.7 bar, 1000 N."""
        return self.in_words(ShownUnits())

    def in_words(self, units: ShownUnits) -> str:
        """The condition in words, in the units that are wanted."""
        return ", ".join(units.setting(column, value) for column, value in self.state.items())


@dataclass(frozen=True, repr=False)
class MeasuredSet:
    """All conditions of a table.

    Attributes
    ----------
    conditions : tuple of Measured
        Conditions, tyre by tyre, rising on their axes.
    notes : tuple of str
        Assumptions, and rows that are not used.
    known : bool
        Whether the uncertainty of K* is stated.
    source, sha256 : str
        Name and hash of the table.
    rule : Sameness
        The rule by which rows have the same condition.
    """

    conditions: tuple[Measured, ...]
    notes: tuple[str, ...]
    known: bool
    source: str = ""
    sha256: str = ""
    rule: Sameness = _RULE

    __repr__ = short_repr

    @property
    def tyres(self) -> tuple[str, ...]:
        """Names of the tyres, in the order of the conditions."""
        return tuple(dict.fromkeys(one.tyre for one in self.conditions))

    def of(self, tyre: str) -> tuple[Measured, ...]:
        """The conditions of one tyre."""
        return tuple(one for one in self.conditions if one.tyre == tyre)

    def only(self, tyre: str | None = None, band: tuple[float, float] | None = None) -> MeasuredSet:
        """The conditions of one tyre, or the frequencies within a band [Hz]; ModelError if there are none."""
        kept = self.conditions
        if tyre is not None:
            kept = self.of(tyre)
            if not kept:
                there = ", ".join(map(shown, self.tyres)) or "none"
                raise ModelError(f"{self.source}: no test of a specimen {shown(tyre)}: there are {there}")
        if band is not None:
            kept = tuple(part for one in kept if (part := _within(one, band)) is not None)
            if not kept:
                raise ModelError(f"{self.source}: no test between {band[0]:g} and {band[1]:g} Hz")
        return replace(self, conditions=kept)


def _within(one: Measured, band: tuple[float, float]) -> Measured | None:
    """A condition with its frequencies within a band [Hz], the nominal ends of which count as inside, or None."""
    rows = np.flatnonzero((one.frequency >= band[0] * (1 - _NOMINAL)) & (one.frequency <= band[1] * (1 + _NOMINAL)))
    if not rows.size:
        return None
    keys = tuple(one.keys[at] for at in rows.tolist())
    shared = real_columns(complex_columns(one.shared)[rows]) if one.shared.size else one.shared
    recorded = None if one.recorded is None else one.recorded.part(rows)
    return replace(one, keys=keys, own=one.own.part(rows), shared=shared, recorded=recorded)


def read_measured(
    path: str | Path,
    *,
    over: Sequence[str] = (),
    std: float | None = None,
    k1: tuple[float, float] | None = None,
    axes: Sequence[Axis] = AXES,
    options: TableOptions | None = None,
    by_amplitude: bool = False,
    of: Of | None = None,
) -> MeasuredSet:
    """Read K* of all conditions from results.

    Parameters
    ----------
    path : path
        A results folder, the folder of a campaign with results, or a table of K* of any format; see `read_k_star`.
    over : sequence of str
        Columns of further axes, with their unit.
    std : float, optional [1]
        Relative standard uncertainty of K*, in place of that in the table.
    k1 : (float, float), optional [N/m]
        Static stiffness and its standard uncertainty, in place of those in the table.
    axes : sequence of Axis
        The axes that every table has, with their tolerances.
    options : TableOptions, optional
        What the table does not say: its columns and units, and the shape of a specimen whose modulus it holds.
    by_amplitude : bool
        Whether tests of one condition with different amplitudes of the deflection have different K*.
    of : Of, optional
        What K* is of, in place of what the table says.

    Returns
    -------
    MeasuredSet

    Raises
    ------
    ModelError
        If no test has a K*, or a column is missing.
    FileError, TableError
        If the table cannot be read.
    """
    path = results_in(path)
    table = path / "dynamic.csv" if path.is_dir() else path
    results = published_beside(table)
    content = read_listed(table, max_bytes=MOST_BYTES, results=results)
    own = table.name in (*_RESULTS, MASTER) and not (options and options.columns)
    if own:
        frame, spoken = as_frame(table.name, content), list[str]()
    else:
        understood = read_k_star(table, options)
        frame, spoken = understood.frame(), [f"understood {'; '.join(understood.understood)}", *understood.warnings]
        frame, told = by_labels(frame, understood.labels, Sameness(tuple(axes)).over(columns_of(over)))
        spoken += told
    covariance = None
    if table.name in (*_RESULTS, MASTER) and results.has(COVARIANCE) and std is None:
        covariance = covariance_of(results.read(COVARIANCE, max_bytes=MOST_BYTES))
    record = results.record if table.name in _RESULTS else {}
    rule = Sameness((*axes, *rule_in(record).further))
    likelihoods = {} if covariance is None else read_likelihoods(results)
    given: dict[str, Any] = {"over": over, "std": std, "k1": k1, "by_amplitude": by_amplitude}
    found = measured_of(frame, covariance, likelihoods, name=table.name, rule=rule, **given)
    if table.name in _RESULTS:
        found = _with_inertia(found, frame, results)
    if of is not None:
        found = replace(found, conditions=tuple(replace(one, of=of) for one in found.conditions))
    spoken += [] if own else _repeats([one.own.omega for one in found.conditions], table.name)
    return replace(found, sha256=hashlib.sha256(content).hexdigest(), notes=(*spoken, *found.notes))


def _with_inertia(found: MeasuredSet, frame: pl.DataFrame, results: Published) -> MeasuredSet:
    """The conditions with the inertia of their specimens, where K* is that of the springs alone."""
    bodies, kinds = bodies_of(results), dict[str, str]()
    if q.K_OF.head in frame.columns:
        kinds = dict(zip(frame[q.TEST.head], frame[q.K_OF.head].fill_null(Of.SPRINGS.value), strict=True))

    def known(one: Measured) -> Measured:
        of = {kinds.get(test, Of.SPRINGS.value) for test in one.tests}
        if of == {Of.BLOCKED_TRANSFER.value}:
            return replace(one, of=Of.BLOCKED_TRANSFER)
        body = next((body for body in bodies if body.is_at(one.tyre, one.state)), None)
        return (
            one if body is None or of != {Of.SPRINGS.value} else replace(one, of=Of.SPRINGS, inertia=inertia_of(body))
        )

    return replace(found, conditions=tuple(map(known, found.conditions)))


def _repeats(omega: Sequence[FloatArray], name: str) -> list[str]:
    """A note on frequencies that a condition has more than once."""
    count = sum(one.size - np.unique(one).size for one in omega)
    if not count:
        return []
    return [f"{count} rows of {name} repeat a frequency of their condition: each counts as a measurement of its own"]


def table_of(measured: MeasuredSet) -> pl.DataFrame:
    """The conditions as a table like dynamic.csv, with the uncertainties and K1 of the fits."""
    rows = []
    several = any(point > 1 for one in measured.conditions for _, point in one.keys)
    for one in measured.conditions:
        own = one.data
        std = np.sqrt(np.diagonal(own.covariance) if own.full else np.diagonal(own.covariance, 0, 1, 2).ravel())
        cross = [one.own.covariance[at, 0, 1] for at in range(own.count)]
        for at in range(own.count):
            u_re, u_im = float(std[2 * at]), float(std[2 * at + 1])
            key = dict(zip(KEY if several else KEY[:1], one.keys[at], strict=False))
            row = {**key, "tyre": one.tyre, **one.state, FREQUENCY: float(one.frequency[at])}
            row |= {} if own.amplitude is None else {COLUMN: float(own.amplitude[at])}
            row |= {RE: float(own.stiffness[at].real), IM: float(own.stiffness[at].imag)}
            if measured.known:
                row |= {STD[0]: u_re, STD[1]: u_im, STD[2]: float(cross[at] / (u_re * u_im)) if u_re * u_im else 0.0}
            static = [float(part) if np.isfinite(part) else None for part in (own.k1, own.k1_std)]
            rows.append(row | dict(zip(q.K1.heads, static, strict=True)))
    return pl.DataFrame(rows, infer_schema_length=None)


def measured_of(
    frame: pl.DataFrame,
    covariance: pl.DataFrame | None = None,
    likelihoods: Mapping[str, Likelihood] | None = None,
    *,
    over: Sequence[str] = (),
    std: float | None = None,
    k1: tuple[float, float] | None = None,
    name: str = "dynamic",
    rule: Sameness = _RULE,
    by_amplitude: bool = False,
) -> MeasuredSet:
    """K* of all conditions, by a rule, from a table in memory; see `read_measured`."""
    over, frame = columns_of(over), with_amplitude(in_si(frame, name))
    rule = rule.over(over)
    rule = Sameness(without_amplitude(rule.axes)) if by_amplitude else rule
    numbers = known_numbers(frame, name, rule, [*over, *([COLUMN] if by_amplitude else [])])
    good, notes = usable(numbers, name, stated=std is None and covariance is None, by_amplitude=by_amplitude)
    if not good.any():
        raise ModelError(f"{name}: no row has a frequency and K*: nothing can be fitted")
    # A test without K* can still join two conditions, as it does where the tests are identified.
    label = rule.groups(conditions_in(frame, rule))[good]
    numbers = {column: each[good] for column, each in numbers.items()}
    rows = _Rows.of(frame.filter(good), rule, numbers, covariance, std).at_temperatures(label)
    apart = by_amplitude or COLUMN in over
    rows = rows.by_level(label) if apart else rows
    notes += rows.notes(covariance is not None)
    notes += [] if by_amplitude else mixed(label, rows.numbers[FREQUENCY], rows.numbers.get(COLUMN), rule)
    axes = [axis.column for axis in rule.axes if axis.column in numbers]
    conditions = [_measured(rows, np.flatnonzero(label == one), axes, k1, by_amplitude) for one in np.unique(label)]
    if not apart:  # the recordings hold K* of a joint condition, not of an amplitude
        conditions = [_as_recorded(one, rows, likelihoods or {}) for one in conditions]
    return MeasuredSet(tuple(conditions), tuple(notes), rows.source != _Source.NONE, name, rule=rule)


class _Source(Enum):
    """Where the uncertainty of K* is from."""

    GIVEN, COVARIANCE, TABLE, NONE = range(4)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The usable rows of a table."""

    tyres: list[str]
    keys: Sequence[Key]
    numbers: dict[str, FloatArray]
    covariance: FloatArray
    shared: FloatArray
    condition: np.ndarray
    source: _Source
    moved: bool = False
    places: Sequence[tuple[str, int]] = ()

    @classmethod
    def of(
        cls,
        frame: pl.DataFrame,
        rule: Sameness,
        numbers: dict[str, FloatArray],
        covariance: pl.DataFrame | None,
        std: float | None,
    ) -> _Rows:
        worded = Sameness(tuple(axis for axis in rule.axes if axis.text))
        (tyres,), keys = names_apart([conditions_in(frame, worded)], worded), keys_of(frame)
        count = len(tyres)
        stiffness = numbers[RE] + 1j * numbers[IM]
        own: FloatArray = np.zeros((count, 2, 2))
        shared: FloatArray = np.zeros((count, 2, 0))
        condition = np.arange(count)
        source, places = _Source.NONE, list[tuple[str, int]]()
        if std is not None:
            own += (std * np.abs(stiffness))[:, None, None] ** 2 * np.eye(2)
            source = _Source.GIVEN
        elif covariance is not None and set(keys) <= set(keys_of(covariance)):
            own, shared, condition, places = joined(keys, covariance)
            source = _Source.COVARIANCE
        elif not lacking_std(numbers):
            own, source = covariances(numbers), _Source.TABLE
        return cls(tyres, keys, numbers, own, shared, condition, source, places=places)

    @property
    def stiffness(self) -> ComplexArray:
        return np.asarray(self.numbers[RE] + 1j * self.numbers[IM])

    def at_temperatures(self, label: np.ndarray) -> _Rows:
        """The rows with the uncertainty of K* at the mean temperature of their condition.

        covariance.parquet already has it.
        """
        if _TEMPERATURE not in self.numbers or self.source in (_Source.COVARIANCE, _Source.NONE):
            return self
        moved = temperature_std(self.numbers[_TEMPERATURE], label, TEMPERATURE_SENSITIVITY) * np.abs(self.stiffness)
        return replace(
            self, covariance=self.covariance + moved[:, None, None] ** 2 * np.eye(2), moved=bool(moved.any())
        )

    def by_level(self, label: np.ndarray) -> _Rows:
        """The rows with K* of each level of the amplitude apart, and the covariance of the tests themselves.

        Tests that share one K* in the joint route scatter about it with their amplitude. Without scatter each of them
        has K* of all tests, whose information then is divided among the levels.
        """
        level = np.zeros(len(self.tyres), dtype=int)
        for one in np.unique(label):
            level[label == one] = levels_of(self.numbers[COLUMN][label == one])
        condition = np.unique(np.stack([self.condition, level], axis=1), axis=0, return_inverse=True)[1].ravel()
        if self.source != _Source.COVARIANCE or not all(column in self.numbers for column in STD[:2]):
            return replace(self, condition=condition)
        own = covariances(self.numbers) - self.shared @ np.swapaxes(self.shared, 1, 2)
        values, vectors = np.linalg.eigh(own)
        least = _LEAST_OWN * np.trace(self.covariance, axis1=1, axis2=2)[:, None]
        own = (vectors * np.maximum(values, least)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        levels = np.array([np.unique(condition[self.condition == one]).size for one in self.condition])
        common = np.trace(own, axis1=1, axis2=2) > _COMMON * np.trace(self.covariance, axis1=1, axis2=2)
        own = np.where((levels > 1)[:, None, None], own * np.where(common, levels, 1)[:, None, None], self.covariance)
        return replace(self, condition=condition, covariance=own)

    def notes(self, had_covariance: bool) -> list[str]:
        said = []
        if self.source == _Source.NONE:
            given = any(column in self.numbers for column in STD[:2])
            said = [*([lacking_std(self.numbers)] if given else []), NO_STD]
        elif self.source == _Source.TABLE:
            why = "covariance.parquet is of other tests" if had_covariance else "only the table was given"
            said = [f"{why}: errors that tests share are taken as independent"]
        return [*said, _MOVED] if self.moved else said


def _measured(
    rows: _Rows, places: np.ndarray, axes: Sequence[str], k1: tuple[float, float] | None, by_amplitude: bool
) -> Measured:
    """One condition from its rows; rows with the same number of `condition` share one K* and are one frequency."""
    frequency, condition = rows.numbers[FREQUENCY], rows.condition[places]
    groups = [places[condition == one] for one in dict.fromkeys(condition.tolist())]
    mean = sorted(groups, key=lambda members: float(np.mean(frequency[members])))
    shared = np.stack([rows.shared[members].mean(axis=0) for members in mean])
    static = _static(rows, places) if k1 is None else k1
    own = StiffnessData.of(
        2 * np.pi * np.array([frequency[members].mean() for members in mean]),
        np.array([rows.stiffness[members].mean() for members in mean]),
        covariance=np.stack([rows.covariance[members].mean(axis=0) for members in mean]),
        k1=static[0],
        k1_std=static[1],
    )
    if by_amplitude:
        logs = np.log(rows.numbers[COLUMN])
        own = replace(own, amplitude=np.array([np.exp(np.mean(logs[members])) for members in mean]))
    state = {column: float(np.mean(rows.numbers[column][places])) for column in axes}
    return Measured(
        tyre=rows.tyres[int(places[0])],
        state={column: value for column, value in state.items() if np.isfinite(value)},
        keys=tuple(rows.keys[members[0]] for members in mean),
        own=own,
        shared=shared.reshape(2 * len(mean), -1) if shared.shape[2] else np.zeros((0, 0)),
    )


def _as_recorded(one: Measured, rows: _Rows, likelihoods: Mapping[str, Likelihood]) -> Measured:
    """The condition with K* as recorded, where all its tests are of one rig."""
    if not rows.places or not likelihoods:
        return one
    place = dict(zip(rows.keys, rows.places, strict=True))
    rigs = {place[key][0] for key in one.keys}
    likelihood = likelihoods.get(rigs.pop()) if len(rigs) == 1 else None
    if likelihood is None:
        return one
    return replace(one, recorded=Recorded.of(likelihood, [place[key][1] for key in one.keys], one.own))


def _static(rows: _Rows, places: np.ndarray) -> tuple[float, float]:
    """K1 of a condition and its standard uncertainty [N/m]; not-a-number if they are not stated."""
    if not all(column in rows.numbers for column in q.K1.heads):
        return float("nan"), float("nan")
    value, std = (rows.numbers[column][places] for column in q.K1.heads)
    good = np.isfinite(value) & np.isfinite(std) & (std > 0)
    if not good.any():
        return float("nan"), float("nan")
    return float(value[good].mean()), float(std[good].mean())
