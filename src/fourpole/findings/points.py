"""Measured points: K*, K1, K2 and C of tests, with the errors that they share with others; errors of two results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.polar import polar
from fourpole.core.routes import arm_slopes
from fourpole.core.sources import Kind, Role, Source
from fourpole.fitting.likelihood import joined
from fourpole.fitting.rows import KEY, Key, keyed, keys_of
from fourpole.quantities import LOSS_ANGLE, MODULUS, RIG_VALUES, Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

#: The quantities of a point, in the order of `Points.values`.
QUANTITIES = (q.K1, MODULUS, LOSS_ANGLE, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
#: K* of two points may differ by this share of the smaller for one error to act in the same direction on both.
_ALIKE = 0.2
#: Distance in ln f within which other points of a condition give the slope, and below which frequencies count as one.
_REACH, _APART = 0.7, 0.02
#: Least variance of a difference as a share of the variances of both values: that of round-off.
_LEAST = 1e-9
_STATIC_ROLES = ("load", "deflection")
#: Keys of a channel that have no effect on its calibration.
_NO_CALIBRATION = ("range", "serial")
#: Column of tests.csv with the label of the mounting of V1's sensor.
MOUNTING = "mounting"
#: Errors of a channel a part of which is another in each mounting, by the end of their keys in study.json.
_PARTS_OF_MOUNTING = {Kind.GAIN: q.GAIN.head, Kind.PHASE: q.PHASE.head}
_OF_MOUNTING = [kind for kind in Kind if kind.role is Role.MOUNTING]
#: Correlation [1] of the error of a source of budget.csv in two campaigns: 1 for one error, 0 for independent errors.
Common = Callable[[str], float]


@dataclass(frozen=True, eq=False)
class Readings(ByValue):
    """N measured points, which are tests or means of tests.

    Attributes
    ----------
    keys : tuple of tuples of (str, int)
        Tests and their points behind each.
    frequency : (N,) float array [Hz]
    stiffness, k1, k2, c : (N,) arrays [N/m], [N/m], [N/m], [N s/m]
        Not-a-number where a value is blank.
    covariance : (N, 2, 2) float array [N²/m²]
        Covariance of Re K* and Im K*.
    std : (N, 3) float array [N/m], [N/m], [N s/m]
        Standard uncertainties of K1, K2 and C.
    group : (N,) int array
        Points with the same number have one condition.
    effects : mapping of str to (N,) complex array [N/m]
        Change of K* by one standard uncertainty of each source of budget.csv, up to a common sign.
    k1_gain : (N,) float array [N/m]
        Part of u(K1) from the gains of load and deflection.
    shared : (N, 2, p) float array [N/m]
        Change of Re K* and Im K* by one standard uncertainty of each error that the points of one campaign share.
    """

    keys: tuple[tuple[Key, ...], ...]
    frequency: FloatArray
    stiffness: ComplexArray
    k1: FloatArray
    k2: FloatArray
    c: FloatArray
    covariance: FloatArray
    std: FloatArray
    group: np.ndarray
    effects: Mapping[str, ComplexArray]
    k1_gain: FloatArray
    shared: FloatArray

    @classmethod
    def of(
        cls, table: pl.DataFrame, budget: pl.DataFrame, group: np.ndarray, covariance: pl.DataFrame | None = None
    ) -> Readings:
        """The points of rows of dynamic.csv, each a point; `covariance` is covariance.parquet of the same campaign."""
        keys = keys_of(table)
        re, im, k1, k2, c = (_numbers(table, quantity.head) for quantity in _COLUMNS)
        u_re, u_im, *std = (_numbers(table, quantity.u_head) for quantity in _COLUMNS)
        cross = np.nan_to_num(_numbers(table, q.CORR_K.head)) * u_re * u_im
        points = cls(
            keys=tuple((key,) for key in keys),
            frequency=_numbers(table, q.FREQUENCY.head),
            stiffness=re + 1j * im,
            k1=k1,
            k2=k2,
            c=c,
            covariance=np.stack([u_re**2, cross, cross, u_im**2], axis=1).reshape(-1, 2, 2),
            std=np.stack(std, axis=1),
            group=group,
            effects={},
            k1_gain=np.zeros(len(keys)),
            shared=np.zeros((len(keys), 2, 0)),
        )
        if covariance is not None and set(keys) <= set(keys_of(covariance)):
            points = replace(points, shared=joined(keys, covariance)[1])
        return points.with_budget(budget) if budget.height else points

    def with_budget(self, budget: pl.DataFrame) -> Readings:
        """The points with the effect of each source, from the standard uncertainties that budget.csv has."""
        places = pl.DataFrame([(*key, row) for row, (key,) in enumerate(self.keys)], schema=_PLACES, orient="row")
        placed = keyed(budget).join(places, on=list(KEY), how="inner", maintain_order="left")
        parts = placed.partition_by(q.SOURCE.head, q.QUANTITY.head, as_dict=True)

        def part(source: str, quantity: Quantity) -> FloatArray:
            values = np.zeros(self.frequency.size)
            rows = parts.get((source, quantity.column))
            if rows is not None:
                values[rows[_PLACE].to_numpy()] = _numbers(rows, q.U.head)
            return values

        names = dict.fromkeys(source for source, quantity in parts if quantity == q.STORAGE.column)
        parts_of_k = (q.STORAGE, q.LOSS, q.LOSS_FACTOR)
        effects = {name: self._signed(*(part(name, quantity) for quantity in parts_of_k)) for name in names}
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = part(Kind.K1_GAINS.text, q.C) / np.abs(self.slopes[:, -1, 2])
        return replace(self, effects=effects, k1_gain=np.minimum(np.nan_to_num(gain), np.nan_to_num(self.std[:, 0])))

    def _signed(self, u_re: FloatArray, u_im: FloatArray, u_loss: FloatArray) -> ComplexArray:
        """The change of K* from those of Re K*, Im K* and the loss factor, which tells their relative sign."""
        ratio = self.stiffness.imag / self.stiffness.real
        wanted = u_loss * np.abs(self.stiffness.real)
        same, opposite = np.abs(u_im - ratio * u_re), np.abs(u_im + ratio * u_re)
        sign = np.where(np.abs(same - wanted) <= np.abs(opposite - wanted), 1.0, -1.0)
        return np.asarray(u_re + 1j * sign * u_im)

    @cached_property
    def values(self) -> FloatArray:
        """Values (N, 8) of `QUANTITIES`."""
        stiffness = self.stiffness
        ratio = stiffness.imag / stiffness.real
        columns = (self.k1, *polar(stiffness)[0].T, stiffness.real, stiffness.imag, ratio, self.k2, self.c)
        return np.stack(columns, axis=1)

    @cached_property
    def stds(self) -> FloatArray:
        """Standard uncertainties (N, 8) of `QUANTITIES`; those of K1, K2 and C as the tables have them."""
        by_k = self.slopes[:, :, :2]
        variance = np.einsum("nqi,nij,nqj->nq", by_k, self.covariance, by_k)
        std = np.sqrt(np.maximum(variance, 0.0))
        std[:, [0, 6, 7]] = self.std
        return std

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivatives (N, 8, 3) of `QUANTITIES` by Re K*, Im K* and K1."""
        stiffness = self.stiffness
        re, im = stiffness.real, stiffness.imag
        slopes = np.zeros((re.size, len(QUANTITIES), 3))
        slopes[:, 0, 2] = 1.0
        slopes[:, 1:3, :2] = polar(stiffness)[1]
        slopes[:, 3, 0], slopes[:, 4, 1] = 1.0, 1.0
        slopes[:, 5, :2] = np.stack([-im / re, np.ones_like(re)], axis=1) / re[:, None]
        by = np.tile(np.array([1.0, 1j, -1.0]), (re.size, 1))
        slopes[:, 6:] = arm_slopes(stiffness, self.k1, (self.k2, self.c), 2.0 * np.pi * self.frequency, by)
        return slopes

    def part(self, rows: np.ndarray) -> Readings:
        """Some of the points."""
        arrays = {name: getattr(self, name)[rows] for name in (*_ARRAYS, "group")}
        effects = {name: effect[rows] for name, effect in self.effects.items()}
        return replace(self, keys=tuple(self.keys[row] for row in rows.tolist()), effects=effects, **arrays)

    def means(self, members: Sequence[Sequence[int]]) -> Readings:
        """The mean of each of some sets of points.

        The uncertainty of a mean is the mean one: repeats share K* of their condition in the joint route, and their
        common errors in every route.
        """

        def mean(values: np.ndarray) -> np.ndarray:
            with np.errstate(invalid="ignore"):
                return np.stack(
                    [np.nanmean(values[list(rows)], axis=0) if len(rows) > 1 else values[rows[0]] for rows in members]
                )

        effects = {name: mean(_aligned(effect, members)) for name, effect in self.effects.items()}
        return replace(
            self,
            keys=tuple(tuple(key for row in rows for key in self.keys[row]) for rows in members),
            group=self.group[[rows[0] for rows in members]],
            effects=effects,
            **{name: mean(getattr(self, name)) for name in _ARRAYS},
        )


_PLACE = "place"
_PLACES: dict[str, Any] = {q.TEST.head: pl.String, q.POINT.head: pl.Int64, _PLACE: pl.Int64}
_COLUMNS = (q.STORAGE, q.LOSS, q.K1, q.K2, q.C)
#: The attributes of points that are arrays of numbers.
_ARRAYS = ("frequency", "stiffness", "k1", "k2", "c", "covariance", "std", "k1_gain", "shared")


def _numbers(table: pl.DataFrame, head: str) -> FloatArray:
    """A column as an array; not-a-number where it is blank."""
    return table[head].cast(pl.Float64).fill_null(float("nan")).to_numpy()


def _aligned(effect: ComplexArray, members: Sequence[Sequence[int]]) -> ComplexArray:
    """The effects of one source, of which those of one set of points have the sign of the first."""
    turned = effect.copy()
    for rows in members:
        first = effect[rows[0]]
        for row in rows[1:]:
            turned[row] *= 1.0 if (np.conj(first) * effect[row]).real >= 0.0 else -1.0
    return turned


@dataclass(frozen=True, eq=False)
class Differences(ByValue):
    """M pairs of points: the second less the first, by quantity.

    Attributes
    ----------
    first, second : (M, 8) float arrays
        Values of `QUANTITIES`; those of the second are brought to the frequency of the first.
    u : (M, 8) float array
        Standard uncertainty of the difference.
    unlike : (M,) bool array
        Pairs whose K* differs so much that no error of two campaigns is taken to act in the same direction.
    """

    first: FloatArray
    second: FloatArray
    u: FloatArray
    unlike: np.ndarray


def differences(
    points: Readings, others: Readings, pairs: tuple[np.ndarray, np.ndarray], common: Common | None
) -> Differences:
    r"""The second points less the first, with the uncertainty of each difference.

    .. math:: u^2 = u_1^2 + u_2^2 - 2\,g_1^T X g_2 + u_{step}^2

    with g the derivatives of the quantity by Re K*, Im K* and K1, and X the covariance of these between both points.

    Parameters
    ----------
    points, others : Readings
    pairs : two (M,) int arrays
        Places of both points of each pair.
    common : function, optional
        Correlation of the error of a source in two campaigns, which is taken to act in the same direction on both if
        their K* differs by less than 20 %. None for points of one campaign, whose covariance `shared` has.
    """
    first, second = points.part(pairs[0]), others.part(pairs[1])
    unlike = np.zeros(len(pairs[0]), dtype=bool)
    cross = np.zeros((unlike.size, 3, 3))
    if common is None:
        cross[:, :2, :2] = first.shared @ np.swapaxes(second.shared, 1, 2)
    else:
        apart = np.abs(second.stiffness - first.stiffness) / np.minimum(abs(first.stiffness), abs(second.stiffness))
        unlike = apart > _ALIKE
        cross[:, :2, :2] = np.where(unlike[:, None, None], 0.0, _cross(first, second, common))
    of_k1 = 1.0 if common is None else common(Kind.K1_GAINS.text)
    cross[:, 2, 2] = of_k1 * first.k1_gain * second.k1_gain
    g1, g2 = first.slopes, second.slopes
    with np.errstate(invalid="ignore"):
        covariance = np.einsum("nqi,nij,nqj->nq", np.nan_to_num(g1), cross, np.nan_to_num(g2))
        alone = first.stds**2 + second.stds**2
        variance = np.maximum(alone - 2.0 * covariance, _LEAST * alone)
    moved, u_step = _steps(first, others, pairs[1])
    return Differences(first.values, second.values - moved, np.sqrt(variance + u_step**2), unlike)


def _cross(first: Readings, second: Readings, common: Common) -> FloatArray:
    """Covariance (M, 2, 2) of K* of both points from the common errors, each in the same direction on both."""
    covariance = np.zeros((first.frequency.size, 2, 2))
    for name in sorted(first.effects.keys() & second.effects.keys()):
        if (correlation := common(name)) > 0.0:
            a, b = first.effects[name], second.effects[name]
            sign = np.where((np.conj(a) * b).real >= 0.0, 1.0, -1.0)
            pair = (np.stack([effect.real, effect.imag], axis=1) for effect in (a, sign * b))
            covariance += correlation * np.einsum("ni,nj->nij", *pair)
    return covariance


def _steps(first: Readings, others: Readings, rows: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Change (M, 8) of each quantity of the second from the frequency of the first to its own, and its uncertainty."""
    moved, u = np.zeros((rows.size, len(QUANTITIES))), np.zeros((rows.size, len(QUANTITIES)))
    members = {number: np.flatnonzero(others.group == number) for number in np.unique(others.group[rows]).tolist()}
    for pair, row in enumerate(rows.tolist()):
        step = float(np.log(others.frequency[row] / first.frequency[pair]))
        near = members[int(others.group[row])]
        x = np.log(others.frequency[near] / first.frequency[pair])
        near, x = near[np.abs(x) <= _REACH], x[np.abs(x) <= _REACH]
        values = others.values[near]
        for column in range(1, len(QUANTITIES)):  # K1 has no frequency
            known = np.isfinite(values[:, column])
            moved[pair, column], u[pair, column] = _step(x[known], values[known, column], step)
            if not np.isfinite(moved[pair, column]):  # K* of a passive specimen changes by less than the frequency does
                moved[pair, column], u[pair, column] = 0.0, abs(others.values[row, column] * step)
    return moved, u


def _step(x: FloatArray, values: FloatArray, end: float) -> tuple[float, float]:
    """Change of a value from x = 0 to `end`, by a parabola or a line, and its uncertainty; nan without a slope.

    The uncertainty is the difference of the two, or half of the change where three points are lacking.
    """
    distinct = 1 + int(np.sum(np.diff(np.sort(x)) > _APART)) if x.size else 0
    if distinct < 2:
        return np.nan, np.nan
    line = float(np.polynomial.polynomial.polyfit(x, values, 1)[1]) * end
    if distinct < 3:
        return line, abs(line) / 2
    slope, bend = np.polynomial.polynomial.polyfit(x, values, 2)[1:].tolist()
    return slope * end + bend * end**2, abs(slope * end + bend * end**2 - line)


# ---- the errors that two results have in common


def none(_: str) -> float:
    """No error is common."""
    return 0.0


def of_one_campaign(results: Study, specimens: tuple[str, str]) -> tuple[str, ...]:
    """What two specimens of one campaign share, as sentences."""
    if not results.covariance.height:
        return ("The results have no covariance.parquet: errors that both specimens share are taken as independent.",)
    rigs = [set(results.dynamic.filter(pl.col(q.TYRE.head) == name)[q.RIG.head]) for name in specimens]
    if not rigs[0] & rigs[1]:
        return (f"{' and '.join(specimens)} were tested on different rigs: all errors of K* are taken as independent.",)
    text = (
        f"{' and '.join(specimens)} were tested in one campaign: the errors of its sensors, rig and weighed masses are "
        "common to both, with the covariance that the campaign found; in K1 the gains of load and deflection are."
    )
    return (text,)


def of_two_campaigns(first: Study, second: Study) -> tuple[Common, tuple[str, ...]]:
    r"""The correlation of each error in two campaigns, and what is common with the reasons, as sentences.

    A channel is one sensor if both state one `serial`, and all other keys but `range` alike. Its errors are then
    common, and those of a value of the rig if rigs of the same names state it alike. The part m of one mounting in the
    standard uncertainty u of a gain is another error in another mounting; the correlation of the gain is then

    .. math:: r = (u^2 - m^2)/(u_1 u_2)

    where u_i is u, or the root of u² - m² if the mountings of campaign i are errors of their own.
    """
    records = first.record, second.record
    halls = [str(section(record, "stated").get("laboratory") or "") for record in records]
    if all(halls) and halls[0] != halls[1]:
        return none, (f"The laboratories differ ({halls[0]}, {halls[1]}): all errors are taken as independent.",)
    unlike = {role: _unlike(records, role) for role in (*CHANNELS, *_STATIC_ROLES)}
    rigs = [section(record, "stated", "rigs") for record in records]
    every = [section(rig) for of_record in rigs for rig in of_record.values()]
    values = {
        name: rigs[0].keys() == rigs[1].keys()
        and all(name in rig for rig in every)
        and len({(section(rig, name).get("value"), section(rig, name).get("std")) for rig in every}) == 1
        for name in RIG_VALUES
    }
    sensors = {SYMBOLS[role]: role for role in CHANNELS if unlike[role] == ""}
    mounted = _mountings(first) == _mountings(second) != {""}
    budgets = [set(results.budget[q.SOURCE.head]) for results in (first, second) if results.budget.height]
    lasting = {
        (symbol, kind): _lasting(section(records[0], "stated", "channels", role), budgets, symbol, kind)
        for symbol, role in sensors.items()
        for kind in _PARTS_OF_MOUNTING
        if not (mounted and role == "motion_in")
    }

    def correlation(text: str) -> float:
        source = Source.read(text)
        names = {name for name in (*source.of.split(" in "), source.under) if name}
        if source.kind is Kind.K1_GAINS:
            return float(all(unlike[role] == "" for role in _STATIC_ROLES))
        if source.role is Role.RIG:
            return float(values.get(source.of, False))
        if source.role in (Role.CHANNEL, Role.RATIO):
            one = source.kind is not Kind.GAIN_DRIFT and names <= sensors.keys()
            return min(lasting.get((name, source.kind), 1.0) for name in names) if one else 0.0
        of_v1 = source.kind in (Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE) and names <= sensors.keys()
        return float((mounted and of_v1) or source.role is Role.MASS)

    anew = list(dict.fromkeys(symbol for (symbol, _), share in lasting.items() if share < 1.0))
    return correlation, _reasons(unlike, values, anew, weighed=all(map(_weighs, (first, second))))


def _lasting(stated: Mapping[str, Any], budgets: Sequence[set[str]], symbol: str, kind: Kind) -> float:
    """Correlation of the gain or phase of one sensor in two campaigns with other mountings; see `of_two_campaigns`."""
    part, whole = (stated.get(f"{of}{_PARTS_OF_MOUNTING[kind]}") or 0.0 for of in ("mounting ", "std_"))
    apart = sum(any(Source(each, symbol).text in budget for each in _OF_MOUNTING) for budget in budgets)
    return float((1.0 - min(part / whole, 1.0) ** 2) ** (1.0 - 0.5 * apart)) if whole else 1.0


def _mountings(results: Study) -> set[str]:
    """Labels of the mountings of V1 that tests.csv states for the specimens' tests; "" for a test without one."""
    table = results.dynamic
    if MOUNTING not in table.columns:
        return {""}
    return set(table.filter(pl.col(q.TYRE.head).fill_null("") != "")[MOUNTING].fill_null(""))


def _weighs(results: Study) -> bool:
    """Whether a test has an added mass."""
    table = results.dynamic
    return q.ADDED_MASS.head in table.columns and bool((table[q.ADDED_MASS.head].fill_null(0.0) > 0.0).any())


def _unlike(records: Sequence[Mapping[str, Any]], role: str) -> str | None:
    """Why a channel is not one sensor: "serial" or "statement"; "" if it is, None if a record has no errors of it."""
    channels = [section(record, "stated", "channels", role) for record in records]
    if not all(channels) or any(channel.get("exact") for channel in channels):
        return None
    serials = [channel.get("serial") for channel in channels]
    first, second = ({key: c[key] for key in c if key not in _NO_CALIBRATION} for c in channels)
    if first != second or (all(serials) and serials[0] != serials[1]):
        return "statement"
    return "" if all(serials) else "serial"


def _reasons(
    unlike: Mapping[str, str | None], values: Mapping[str, bool], anew: Sequence[str], *, weighed: bool
) -> tuple[str, ...]:
    """What is common and what is not, as sentences."""
    words = {**SYMBOLS, "load": "load", "deflection": "deflection"}
    alike, unnamed, other = (
        ", ".join(words[role] for role, why in unlike.items() if why == reason)
        for reason in ("", "serial", "statement")
    )
    rig = ", ".join(RIG_VALUES[name].name for name, same in values.items() if same)
    parts = [f"the sensors of {alike} (serial numbers)", f"{rig} of the rig", "weighed masses of the same size"]
    common = "; ".join(part for part, there in zip(parts, (alike, rig, weighed), strict=True) if there)
    said = {
        f"Taken as common are the errors of {common}. They cancel as far as they act alike. If one of them was "
        "calibrated again between the campaigns, use --independent.": common,
        f"The part of a mounting in gain and phase of {', '.join(anew)} is taken as independent. If it is common, "
        'state one mounting in tests.csv, or mounted = "rig" (V1), or remounted_with_mass = false (F1, V2).': anew,
        f"The errors of {unnamed} are taken as independent, as no serial number is stated. If both campaigns used the "
        "same sensors, state their serial in [channels] of both.": unnamed,
        f"The statements of {other} differ: their errors are taken as independent.": other,
        "The campaigns state nothing alike: all errors are taken as independent.": not (common or unnamed or other),
    }
    return tuple(text for text, there in said.items() if there)
