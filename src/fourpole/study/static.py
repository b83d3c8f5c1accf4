"""Static tests: load-deflection curves, and the K1 of each dynamic test from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign import defaults
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import Test, condition_of, problem_of
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Branch, Check, Code, NoK1, Side, Verdict, fault_of, reported, worst_verdict
from fourpole.core.condition import Sameness
from fourpole.core.loadcurve import ZERO_OFF, LoadCurve
from fourpole.core.sources import Kind, Source
from fourpole.errors import FourpoleError, LoadCurveError, Message
from fourpole.io.child import SECONDS
from fourpole.study.cache import Cache
from fourpole.study.curvefile import CurveOfFile, read_curve
from fourpole.study.points import StaticStiffness

_RULE = Sameness()
#: Checks of a static test that the remarks of the dynamic tests repeat.
_DOUBTS = (Code.CURVE, Code.LOAD_ZERO)


@dataclass(frozen=True)
class StaticRow:
    """One row of static.csv: a static test at one preload [N], with its columns by head and the parts of u(K1)."""

    test: Test
    preload: float
    columns: Mapping[str, Any] = field(default_factory=dict)
    checks: tuple[Check, ...] = ()
    parts: Mapping[Source, float] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of the checks."""
        return worst_verdict(check.verdict for check in self.checks)


@dataclass(frozen=True)
class StaticTest:
    """One static test: its curve, its rows, and the hash of its file; the curve is None where it cannot be read."""

    test: Test
    curve: LoadCurve | None
    rows: tuple[StaticRow, ...]
    sha256: str = ""


def evaluate_statics(campaign: Campaign, cache: Cache | None = None, seconds: float = SECONDS) -> list[StaticTest]:
    """Evaluate each static test at its own preload and at the preloads of the dynamic tests that use its K1.

    The cache keeps the curves; the processor time of a file that is read in a worker process has a limit [s].
    """
    statics, rule = campaign.of_kind("static"), campaign.stated.sameness
    loads = {test.name: {load} if (load := test.value("preload")) is not None else set() for test in statics}
    for test in campaign.of_kind("dynamic"):
        if (load := test.value("preload")) is not None:
            for name in _choice(test, statics, rule).names:
                loads[name].add(load)
    read = partial(read_curve, campaign, cache=cache, seconds=seconds)
    return [_evaluated(campaign, test, sorted(loads[test.name]), read) for test in statics]


@dataclass(frozen=True)
class _Choice:
    """The static tests whose K1 a dynamic test uses, the axes that only one side states, and a warning."""

    names: tuple[str, ...] = ()
    sides: tuple[tuple[str, Side], ...] = ()
    warning: Check | None = None


def _choice(test: Test, statics: Sequence[Test], rule: Sameness) -> _Choice:
    """All static tests of the same condition at any preload; where there is none, the nearest in temperature.

    A value that only one of two tests states counts as the same. Static tests with the fewest such values are used.
    """
    anywhere = rule.without("preload")
    mine = condition_of(test, anywhere)
    of_tyre = {static.name: condition_of(static, anywhere) for static in statics if static.tyre == test.tyre}
    lacking = {
        name: sum((a is None) != (b is None) for a, b in zip(condition.values, mine.values, strict=True))
        for name, condition in of_tyre.items()
        if anywhere.same(condition, mine, blank=True)
    }
    if not lacking:
        return _nearest(test, statics, rule)
    names = tuple(name for name, number in lacking.items() if number == min(lacking.values()))
    sides: list[tuple[str, Side]] = []
    mixed = []
    for place, axis in enumerate(anywhere.axes):
        stated = [value for name in names if (value := of_tyre[name].values[place]) is not None]
        # An axis of the campaign that no static test states does not apply to static tests.
        foreign = axis in rule.further and all(other.values[place] is None for other in of_tyre.values())
        if (mine.values[place] is None) == bool(stated) and not foreign:
            sides.append((axis.name, Side.STATIC if stated else Side.DYNAMIC))
        if len(set(axis.groups(stated).tolist())) > 1:
            mixed.append(axis.name)
    warning = reported(Code.K1_MIXED, Verdict.WARNING, axes=tuple(mixed)) if mixed else None
    return _Choice(names, tuple(sides), warning)


def _nearest(test: Test, statics: Sequence[Test], rule: Sameness) -> _Choice:
    """The static tests that are nearest in temperature, all other values of the condition being the same."""
    otherwise, own = rule.without("preload", "temperature"), test.value("temperature")
    mine = condition_of(test, otherwise)
    near = [static for static in statics if otherwise.same(condition_of(static, otherwise), mine, blank=True)]
    if own is None or not near:
        return _Choice()
    # All have a temperature: a static test without one would already have matched.
    there = {static.name: static.values["temperature"] for static in near}
    nearest = min(there.values(), key=lambda value: (abs(value - own), value))
    axis = next(axis for axis in rule.axes if axis.name == "temperature")
    names = tuple(name for name, value in there.items() if axis.same(value, nearest))
    mean = float(np.mean([there[name] for name in names]))
    off, limit = abs(own - mean), axis.absolute
    warning = reported(Code.K1_TEMPERATURE, Verdict.WARNING, off, limit, tests=names, there=mean, own=own)
    return _Choice(names, warning=warning)


def _evaluated(
    campaign: Campaign, test: Test, preloads: list[float], read: Callable[[Test], CurveOfFile]
) -> StaticTest:
    sha256, code = "", Code.EXCLUDED if test.excluded else Code.LOAD_CURVE
    try:
        found = CurveOfFile(None, "", error=problem_of(test)) if test.faults else read(test)
        sha256 = found.sha256
        if found.curve is not None:
            loads: list[float] | list[None] = preloads or [None]
            rows = tuple(_at_preload(campaign, test, found.curve, load) for load in loads)
            return StaticTest(test, found.curve, rows, sha256)
        check = reported(code, Verdict.REJECTED, error=found.error)
    except FourpoleError as error:
        check = reported(code, Verdict.REJECTED, error=error.message)
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        check = fault_of(error, test.file)
    rows = tuple(StaticRow(test, load, checks=(check,)) for load in preloads or [np.nan])
    return StaticTest(test, None, rows, sha256)


def _at_preload(campaign: Campaign, test: Test, curve: LoadCurve, load: float | None) -> StaticRow:
    """The row of a static test at a preload [N]; without one it has no K1."""
    channels = campaign.stated.channels
    assert channels.load is not None
    assert channels.deflection is not None
    gains = channels.load.gain_std, channels.deflection.gain_std
    loss = curve.hysteresis_loss
    columns: dict[str, Any] = {
        q.CYCLE_LOSS.head: loss,
        q.CYCLE_LOSS.u_head: float(np.hypot(curve.loss_std, loss * np.hypot(*gains))),
        q.BRANCH_TIME.head: float(np.mean(curve.times)) if curve.times else np.nan,
        q.CYCLE.head: curve.cycles or None,
        q.NONLINEARITY.head: curve.nonlinearity,
    }
    if load is None:
        return StaticRow(test, np.nan, columns, (reported(Code.NO_PRELOAD, Verdict.OK, test=test.name),))
    try:
        tangent, secant = curve.tangent(load), curve.secant(load)
    except LoadCurveError as error:
        return StaticRow(test, load, columns, (reported(Code.BEYOND_CURVE, Verdict.REJECTED, error=error.message),))
    std = tangent.std_with_gains(*gains)
    columns |= {
        q.K1.head: tangent.stiffness,
        q.K1.u_head: std,
        q.K1_OF.head: curve.measured,
        q.K1_LOADING.head: tangent.loading,
        q.K1_UNLOADING.head: tangent.unloading,
        q.GAP.head: tangent.gap,
        q.SECANT.head: secant.stiffness,
    }
    parts = {
        Source(Kind.K1_FIT): tangent.fit,
        Source(Kind.K1_CYCLES): tangent.cycles,
        Source(Kind.K1_ZERO): tangent.zero,
        Source(Kind.K1_GAINS): float(np.sqrt(max(std**2 - tangent.std**2, 0.0))),
    }
    return StaticRow(test, load, columns, tuple(_checks_of_curve(curve, secant.reason)), parts)


def _checks_of_curve(curve: LoadCurve, no_secant: str) -> Iterator[Check]:
    """What is doubtful in a curve whose tangent is K1."""
    if curve.measured != "mean":
        yield branch_check(curve.measured)
    for doubt in curve.doubts:
        yield reported(Code.CURVE, Verdict.WARNING, error=doubt)
    if no_secant:
        yield reported(Code.SECANT, Verdict.OK, error=Message("no secant", "", no_secant))
    if curve.zero_off > ZERO_OFF:
        yield reported(Code.LOAD_ZERO, Verdict.WARNING, curve.zero_off, ZERO_OFF, without=curve.without_contact)


def branch_check(measured: str, tests: Sequence[str] = ()) -> Check:
    """The warning that K1, of these static tests, is not that of the mean of both branches."""
    return reported(Code.K1_BRANCH, Verdict.WARNING, branch=Branch[measured.upper()], tests=tuple(tests))


def stiffness_for(
    test: Test, statics: Sequence[StaticRow], rule: Sameness = _RULE, per_kelvin: float = 0.0
) -> StaticStiffness:
    """K1 of a dynamic test: as tests.csv states it, else from the static tests of its condition at its own preload.

    `per_kelvin` is the relative change of K1 per kelvin [1/K], for static tests at another temperature.
    """
    stated = test.value("K1")
    if stated is not None:
        std = test.value("u(K1)")
        std = defaults.K1_STD * stated if std is None else std
        return StaticStiffness(stated, std, parts={Source(Kind.K1_STATED): std})
    choice = _choice(test, list({row.test.name: row.test for row in statics}.values()), rule)
    if not choice.names:
        return StaticStiffness(lack=_no_static_test(test, statics, rule))
    preload = test.value("preload")
    if preload is None:
        return StaticStiffness(lack=reported(Code.NO_K1, Verdict.WARNING, because=NoK1.NO_PRELOAD))
    at_load = [row for row in statics if row.test.name in choice.names and row.preload == preload]
    good = [row for row in at_load if row.verdict is not Verdict.REJECTED]
    if not good:
        checks = tuple(check for row in at_load for check in row.checks if check.verdict is Verdict.REJECTED)
        values = {"because": NoK1.REJECTED, "preload": preload, "test": at_load[0].test.name, "checks": checks}
        return StaticStiffness(lack=reported(Code.NO_K1, Verdict.WARNING, **values))
    return _at_temperature(_mean(good, choice), test, good, per_kelvin)


def _mean(good: Sequence[StaticRow], choice: _Choice) -> StaticStiffness:
    """Mean K1 of repeats; their scatter is a part of its uncertainty."""
    values = np.array([row.columns[q.K1.head] for row in good])
    spread = values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    parts = {source: float(np.mean([row.parts[source] for row in good])) for source in good[0].parts}
    if spread > 0:
        parts[Source(Kind.K1_REPEATS)] = float(spread)
    std = float(np.hypot(np.mean([row.columns[q.K1.u_head] for row in good]), spread))
    time = float(np.mean([row.test.values.get("time", np.nan) for row in good]))
    checks = tuple(_checks_of_choice(good, choice))
    return StaticStiffness(float(values.mean()), std, checks=checks, parts=parts, time=time)


def _checks_of_choice(good: Sequence[StaticRow], choice: _Choice) -> Iterator[Check]:
    """What is doubtful in the static tests that give K1, and in their choice."""
    if choice.warning is not None:
        yield choice.warning
    single = [row for row in good if row.columns[q.K1_OF.head] != "mean"]
    if single:
        yield branch_check(single[0].columns[q.K1_OF.head], [row.test.name for row in single])
    of_tests = {row.test.name: tuple(check for check in row.checks if check.code in _DOUBTS) for row in good}
    doubts = tuple((name, checks) for name, checks in of_tests.items() if checks)
    if choice.sides or doubts:
        yield reported(Code.K1, Verdict.OK, tests=choice.names, sides=choice.sides, doubts=doubts)


def _at_temperature(mean: StaticStiffness, test: Test, good: Sequence[StaticRow], per_kelvin: float) -> StaticStiffness:
    """K1 with the uncertainty from the difference of its temperature from that of the dynamic test."""
    own, there = test.value("temperature"), [row.test.value("temperature") for row in good]
    if own is None or None in there:
        return mean
    moved = per_kelvin * abs(own - float(np.mean(np.array(there, dtype=float)))) * mean.value
    parts = {**mean.parts, Source(Kind.K1_TEMPERATURE): float(moved)}
    return replace(mean, std=float(np.hypot(mean.std, moved)), parts=parts) if moved else mean


def _no_static_test(test: Test, statics: Sequence[StaticRow], rule: Sameness) -> Check:
    """The warning that no static test has the condition of a dynamic test, with the pressures there are."""
    pressures = {p for row in statics if row.test.tyre == test.tyre and (p := row.test.value("pressure")) is not None}
    axes = tuple(axis.name for axis in rule.further)
    values = {"tyre": test.tyre, "pressures": tuple(sorted(pressures)), "axes": axes}
    return reported(Code.NO_K1, Verdict.WARNING, because=NoK1.NO_TEST, **values)


def k1_apart(variance: dict[Source, FloatArray], parts: Sequence[Mapping[Source, float]]) -> dict[Source, FloatArray]:
    """The variances with that of K1 divided into the parts of K1's own uncertainty."""
    whole = variance.pop(Source(Kind.K1))
    sources = dict.fromkeys(source for part in parts for source in part)
    squares = {source: np.array([part.get(source, 0.0) ** 2 for part in parts]) for source in sources}
    total = np.sum(list(squares.values()), axis=0) if squares else np.zeros(len(parts))
    for source, square in squares.items():
        share = np.divide(square, total, out=np.zeros_like(square), where=total > 0)
        variance[source] = whole * share[:, None]
    return variance
