"""Static tests: load-deflection curves, from the cache or their files, and the K1 of each dynamic test from them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign import defaults
from fourpole.campaign.channels import CLASSES as CHANNEL_CLASSES
from fourpole.campaign.channels import ChannelsFile
from fourpole.campaign.folder import Campaign
from fourpole.campaign.place import at_hand, identity_or_none, is_guarded
from fourpole.campaign.row import Test, condition_of, problem_of
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Branch, Check, Code, NoK1, Side, Verdict, fault_of, reported
from fourpole.core.condition import Sameness
from fourpole.core.loadcurve import ZERO_OFF, LoadCurve
from fourpole.core.sources import Kind, Source
from fourpole.errors import FileError, FourpoleError, LoadCurveError, Message
from fourpole.io.child import SECONDS, Died, Late, answer_of
from fourpole.io.door import sha256_of
from fourpole.io.packed import pack, unpack
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.study.cache import Cache
from fourpole.study.load import load_curve
from fourpole.study.points import StaticStiffness

_RULE = Sameness()
#: A curve of more bytes is not kept.
_MOST_KEPT = 16_000_000
#: The parts of [channels] that a curve depends on.
_OF_CURVE = ("time", "sample_rate", "load", "deflection")
#: The classes of what a worker process is told of a static test, and of which its answer is made.
OF_WORK = (Test, *CHANNEL_CLASSES)
CURVE_CLASSES = (LoadCurve, Message)
#: Checks of a static test that the remarks of the dynamic tests repeat.
_DOUBTS = (Code.CURVE, Code.LOAD_ZERO)


@dataclass(frozen=True)
class StaticRow:
    """One row of static.csv: a static test at one preload [N].

    Attributes
    ----------
    test : Test
    preload : float [N]
        Not-a-number for a test without a preload.
    columns : mapping of str to value
        Its columns by head.
    checks : tuple of Check
    parts : mapping of Source to float [N/m]
        The parts of u(K1).
    curve : LoadCurve or None
        The curve of the test; None where it cannot be read.
    sha256 : str
        Hash of its file; empty where it was not read.
    """

    test: Test
    preload: float
    columns: Mapping[str, Any] = field(default_factory=dict)
    checks: tuple[Check, ...] = ()
    parts: Mapping[Source, float] = field(default_factory=dict)
    curve: LoadCurve | None = None
    sha256: str = ""


def evaluate_statics(campaign: Campaign, cache: Cache | None = None, seconds: float = SECONDS) -> list[StaticRow]:
    """Evaluate each static test at its own preload and at the preloads of the dynamic tests that use its K1.

    The cache keeps the curves; the processor time of a file that is read in a worker process has a limit [s].
    """
    statics, rule = campaign.of_kind("static"), campaign.stated.sameness
    loads = {test.name: {load} if (load := test.value("preload")) is not None else set() for test in statics}
    for test in campaign.of_kind("dynamic"):
        if (load := test.value("preload")) is not None:
            for name in _choice(test, statics, rule)[0]:
                loads[name].add(load)
    return [static for test in statics for static in _rows_of(campaign, test, sorted(loads[test.name]), cache, seconds)]


def _rows_of(
    campaign: Campaign, test: Test, preloads: list[float], cache: Cache | None, seconds: float
) -> list[StaticRow]:
    """The rows of one static test."""
    sha256, code = "", Code.EXCLUDED if test.excluded else Code.LOAD_CURVE
    try:
        curve, sha256 = (problem_of(test), "") if test.faults else read_curve(campaign, test, cache, seconds)
        if isinstance(curve, LoadCurve):
            loads: list[float] | list[None] = preloads or [None]
            return [_at_preload(campaign, test, curve, sha256, load) for load in loads]
        check = reported(code, Verdict.REJECTED, error=curve)
    except FourpoleError as error:
        check = reported(code, Verdict.REJECTED, error=error.message)
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        check = fault_of(error, test.file)
    return [StaticRow(test, load, checks=(check,), sha256=sha256) for load in preloads or [np.nan]]


def read_curve(
    campaign: Campaign, test: Test, cache: Cache | None = None, seconds: float = SECONDS
) -> tuple[LoadCurve | Message, str]:
    """The curve of a static test, or why its file holds none, and the hash of its file.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    test : Test
        A static test of it.
    cache : Cache, optional
        The cache, in which it may stand, and in which it is kept.
    seconds : float [s]
        Limit of the processor time of a file that is read in a worker process.

    Raises
    ------
    FourpoleError
        If there is no such file, or its worker process dies twice.
    """
    folder, channels = campaign.folder.absolute(), campaign.stated.channels
    settings = ["static", test.file, test.window, channels.without_uncertainties(*_OF_CURVE)]
    identity = identity_or_none(folder, test.file)
    if cache is not None and (noted := cache.hash_noted(test.file, identity)):
        kept = cache.bytes_of(cache.name(settings, noted))
        with suppress(ValueError, KeyError, TypeError, IndexError):
            if kept is not None:
                return _unpacked(kept)
    if is_guarded(folder, test.file):
        size = identity.size if identity is not None else 0
        try:
            curve, sha256 = _unpacked(answer_of(curve_of, folder, test, channels, size=size, seconds=seconds))
        except Died as death:
            remedy = f"allow more with --time-limit, or {death.remedy}" if isinstance(death, Late) else death.remedy
            raise FileError(f"{test.file} {death}; {remedy}") from None
    else:
        curve, sha256, _ = curve_of(folder, test, channels)
    if cache is not None:
        cache.note(test.file, identity, sha256)
        content = pack((curve, sha256, curve.missing)) if isinstance(curve, LoadCurve) else b""
        if content and len(content) < _MOST_KEPT:
            cache.keep(cache.name(settings, sha256), content)
    return curve, sha256


def curve_of(folder: Path, test: Test, channels: ChannelsFile) -> tuple[LoadCurve | Message, str, float]:
    """The curve of a file or why it holds none, its hash, and the share of its points that are missing [1].

    FileError if the file cannot be read.
    """
    with at_hand(folder, test.file) as path:
        sha256 = sha256_of(path, max_bytes=MAX_FILE_BYTES, label=test.file)
        try:
            curve = load_curve(path, test, channels)
        except FileError:  # says nothing of the content
            raise
        except FourpoleError as error:
            return error.message, sha256, 0.0
        return curve, sha256, curve.missing


def _unpacked(content: bytes) -> tuple[LoadCurve | Message, str]:
    """The curve of packed bytes, with the share of its points that were missing, and the hash of its file."""
    curve, sha256, missing = unpack(content, CURVE_CLASSES)
    if isinstance(curve, LoadCurve):
        object.__setattr__(curve, "missing", missing)  # the points that it counts are not kept
    return curve, sha256


def _choice(test: Test, statics: Sequence[Test], rule: Sameness) -> tuple[tuple[str, ...], Check | None]:
    """The static tests whose K1 a dynamic test uses: of its condition at any preload; else the nearest in temperature.

    A value that only one of two tests states counts as the same. Static tests with the fewest such values are used. The
    check is a warning of another temperature.
    """
    anywhere = rule.without("preload")
    mine = condition_of(test, anywhere)
    of_tyre = {static.name: condition_of(static, anywhere) for static in statics if static.tyre == test.tyre}
    lacking = {
        name: sum((a is None) != (b is None) for a, b in zip(condition.values, mine.values, strict=True))
        for name, condition in of_tyre.items()
        if anywhere.same(condition, mine, blank=True)
    }
    if lacking:
        return tuple(name for name, number in lacking.items() if number == min(lacking.values())), None
    otherwise, own = rule.without("preload", "temperature"), test.value("temperature")
    mine = condition_of(test, otherwise)
    near = [static for static in statics if otherwise.same(condition_of(static, otherwise), mine, blank=True)]
    return _nearest(near, own, rule) if own is not None and near else ((), None)


def _nearest(statics: Sequence[Test], own: float, rule: Sameness) -> tuple[tuple[str, ...], Check]:
    """Those of some static tests that are nearest in temperature [degC], and a warning.

    All have a temperature: a static test without one would already have matched.
    """
    there = {static.name: static.values["temperature"] for static in statics}
    nearest = min(there.values(), key=lambda value: (abs(value - own), value))
    axis = next(axis for axis in rule.axes if axis.name == "temperature")
    names = tuple(name for name, value in there.items() if axis.same(value, nearest))
    mean = float(np.mean([there[name] for name in names]))
    off, limit = abs(own - mean), axis.absolute
    return names, reported(Code.K1_TEMPERATURE, Verdict.WARNING, off, limit, tests=names, there=mean, own=own)


def _at_preload(campaign: Campaign, test: Test, curve: LoadCurve, sha256: str, load: float | None) -> StaticRow:
    """The row of a static test at a preload [N]; without one it has no K1."""
    channels = campaign.stated.channels
    assert channels.load is not None
    assert channels.deflection is not None
    gains = channels.load.gain_std, channels.deflection.gain_std
    linearity = [campaign.stated.ordinary.linearity(channel) for channel in (channels.load, channels.deflection)]
    loss = curve.hysteresis_loss
    columns: dict[str, Any] = {
        q.CYCLE_LOSS.head: loss,
        q.CYCLE_LOSS.u_head: float(np.hypot(curve.loss_std, loss * np.hypot(*gains))),
        q.BRANCH_TIME.head: float(np.mean(curve.times)) if curve.times else np.nan,
        q.CYCLE.head: curve.cycles or None,
        q.NONLINEARITY.head: curve.nonlinearity,
    }
    parts: dict[Source, float] = {}
    if load is None:
        checks = [reported(Code.NO_PRELOAD, Verdict.OK, test=test.name)]
        return StaticRow(test, np.nan, columns, tuple(checks), parts, curve, sha256)
    try:
        tangent, secant = curve.tangent(load), curve.secant(load)
    except LoadCurveError as error:
        checks = [reported(Code.BEYOND_CURVE, Verdict.REJECTED, error=error.message)]
    else:
        with_gains, bent = tangent.std_with_gains(*gains), tangent.std_by_linearity(*linearity)
        columns |= {
            q.K1.head: tangent.stiffness,
            q.K1.u_head: float(np.hypot(with_gains, bent)),
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
            Source(Kind.K1_GAINS): float(np.sqrt(max(with_gains**2 - tangent.std**2, 0.0))),
            **({Source(Kind.K1_LINEARITY): bent} if bent else {}),
        }
        checks = [branch_check(curve.measured)] if curve.measured != "mean" else []
        checks += [reported(Code.CURVE, Verdict.WARNING, error=doubt) for doubt in curve.doubts]
        if secant.reason:
            checks.append(reported(Code.SECANT, Verdict.OK, error=Message("no secant", "", secant.reason)))
        if curve.zero_off > ZERO_OFF:
            off = curve.zero_off
            checks.append(reported(Code.LOAD_ZERO, Verdict.WARNING, off, ZERO_OFF, without=curve.without_contact))
    return StaticRow(test, load, columns, tuple(checks), parts, curve, sha256)


def branch_check(measured: str, tests: Sequence[str] = ()) -> Check:
    """The warning that K1, of these static tests, is not that of the mean of both branches."""
    return reported(Code.K1_BRANCH, Verdict.WARNING, branch=Branch[measured.upper()], tests=tuple(tests))


def stiffness_for(
    test: Test, statics: Sequence[StaticRow], rule: Sameness = _RULE, per_kelvin: float = 0.0
) -> StaticStiffness:
    """K1 of a dynamic test: as tests.csv states it, else from the static tests of its condition at its own preload.

    A rigid block has none. `per_kelvin` is the relative change of K1 per kelvin [1/K], for static tests at another
    temperature.
    """
    stated, std = test.value("K1"), test.value("u(K1)")
    if test.kind == "calibration":
        return StaticStiffness()
    if stated is not None:
        std = defaults.K1_STD * stated if std is None else std
        return StaticStiffness(stated, std, parts={Source(Kind.K1_STATED): std})
    tests = list({static.test.name: static.test for static in statics}.values())
    names, warning = _choice(test, tests, rule)
    at_load = [static for static in statics if static.test.name in names and static.preload == test.value("preload")]
    good = [static for static in at_load if Verdict.REJECTED not in [check.verdict for check in static.checks]]
    if not good:
        return StaticStiffness(lack=_lack(test, tests, names, at_load, rule))
    return _mean(good, test, per_kelvin, _checks_of_choice(test, tests, good, names, warning, rule))


def _mean(good: Sequence[StaticRow], test: Test, per_kelvin: float, checks: Iterable[Check]) -> StaticStiffness:
    """Mean K1 of repeats; their scatter, and the temperature of the dynamic test, are parts of its uncertainty."""
    values = np.array([static.columns[q.K1.head] for static in good])
    mean, spread = float(values.mean()), values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    parts = {source: float(np.mean([static.parts[source] for static in good])) for source in good[0].parts}
    std = float(np.hypot(np.mean([static.columns[q.K1.u_head] for static in good]), spread))
    if spread > 0:
        parts[Source(Kind.K1_REPEATS)] = float(spread)
    own, there = test.value("temperature"), np.array([static.test.values.get("temperature", np.nan) for static in good])
    moved = 0.0 if own is None else per_kelvin * abs(own - float(np.mean(there))) * mean
    if moved and np.isfinite(moved):
        parts[Source(Kind.K1_TEMPERATURE)] = float(moved)
        std = float(np.hypot(std, moved))
    time = float(np.mean([static.test.values.get("time", np.nan) for static in good]))
    return StaticStiffness(mean, std, checks=tuple(checks), parts=parts, time=time)


def _checks_of_choice(
    test: Test,
    tests: Sequence[Test],
    good: Sequence[StaticRow],
    names: tuple[str, ...],
    warning: Check | None,
    rule: Sameness,
) -> Iterator[Check]:
    """What is doubtful in the static tests that give K1, and in their choice among all of the specimen."""
    sides, mixed = ((), ()) if warning is not None else _unlike_axes(test, tests, names, rule)
    if warning is not None:
        yield warning
    elif mixed:
        yield reported(Code.K1_MIXED, Verdict.WARNING, axes=mixed)
    single = [static for static in good if static.columns[q.K1_OF.head] != "mean"]
    if single:
        yield branch_check(single[0].columns[q.K1_OF.head], [static.test.name for static in single])
    of_tests = {static.test.name: tuple(check for check in static.checks if check.code in _DOUBTS) for static in good}
    doubts = tuple((name, checks) for name, checks in of_tests.items() if checks)
    if sides or doubts:
        yield reported(Code.K1, Verdict.OK, tests=names, sides=sides, doubts=doubts)


def _unlike_axes(
    test: Test, tests: Sequence[Test], names: tuple[str, ...], rule: Sameness
) -> tuple[tuple[tuple[str, Side], ...], tuple[str, ...]]:
    """The axes that only the static tests with these names or only the dynamic test states; those on which they differ.

    An axis of the campaign that no static test of the specimen states does not apply to static tests.
    """
    sides: list[tuple[str, Side]] = []
    mixed = []
    anywhere = rule.without("preload")
    mine = condition_of(test, anywhere).values
    of_tyre = {static.name: condition_of(static, anywhere).values for static in tests if static.tyre == test.tyre}
    for place, axis in enumerate(anywhere.axes):
        stated = [value for name in names if (value := of_tyre[name][place]) is not None]
        foreign = axis in rule.further and all(values[place] is None for values in of_tyre.values())
        if (mine[place] is None) == bool(stated) and not foreign:
            sides.append((axis.name, Side.STATIC if stated else Side.DYNAMIC))
        if len(set(axis.groups(stated).tolist())) > 1:
            mixed.append(axis.name)
    return tuple(sides), tuple(mixed)


def _lack(
    test: Test, tests: Sequence[Test], names: tuple[str, ...], at_load: Sequence[StaticRow], rule: Sameness
) -> Check:
    """The warning that a dynamic test has no K1: no static test has its condition, or all of them are rejected."""
    preload = test.value("preload")
    if not names:
        pressures = {p for static in tests if static.tyre == test.tyre and (p := static.value("pressure")) is not None}
        axes = tuple(axis.name for axis in rule.further)
        named = {"tyre": test.tyre, "pressures": tuple(sorted(pressures)), "axes": axes}
        return reported(Code.NO_K1, Verdict.WARNING, because=NoK1.NO_TEST, **named)
    if preload is None:
        return reported(Code.NO_K1, Verdict.WARNING, because=NoK1.NO_PRELOAD)
    checks = tuple(check for row in at_load for check in row.checks if check.verdict is Verdict.REJECTED)
    values = {"preload": preload, "test": at_load[0].test.name, "checks": checks}
    return reported(Code.NO_K1, Verdict.WARNING, because=NoK1.REJECTED, **values)


def k1_apart(variance: dict[Source, FloatArray], parts: Sequence[Mapping[Source, float]]) -> dict[Source, FloatArray]:
    """The variances with that of K1 divided into the parts of K1's own uncertainty."""
    whole = variance.pop(Source(Kind.K1))
    sources = dict.fromkeys(source for part in parts for source in part)
    squares = {source: np.array([part.get(source, 0.0) ** 2 for part in parts]) for source in sources}
    total = np.sum(list(squares.values()), axis=0) if squares else np.zeros(len(parts))
    for source, square in squares.items():
        share = np.divide(square, total, out=np.zeros_like(square), where=total > 0)
        variance[source] = variance.get(source, 0.0) + whole * share[:, None]
    return variance
