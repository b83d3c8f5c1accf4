"""Identification of a campaign's dynamic tests: phasors, rig and K1 become K*, K2, C and TR by a route."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign import defaults
from fourpole.campaign.folder import Campaign, Test
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.checks import worst_verdict
from fourpole.core.codes import Code
from fourpole.core.curvature import largest_bend
from fourpole.core.identification import Identification
from fourpole.core.identify import identify, variance_by_source
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.outputs import Outputs, identification, outputs
from fourpole.core.joint.outputs import variance_by_source as joint_variance_by_source
from fourpole.core.montecarlo import Interval, arm_intervals, draw_around, draw_route
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source
from fourpole.fitting.rows import Key, pair_columns, tyre_columns
from fourpole.study.outcome import BEGAN, Point, point_keys
from fourpole.study.rig_estimate import RigEstimate, RunOrder, mass_gain
from fourpole.study.rig_solution import relative_uncertainties, rig_estimate, with_recordings
from fourpole.study.sharing import at_mean_temperature, families, temperature_note, temperatures_apart
from fourpole.study.static import StaticStiffness, k1_apart

#: Relative uncertainty of K2 or C above which Monte Carlo finds their distribution.
_SKEW = 0.1
#: Monte Carlo finds the distribution of K2 and C if an end of a 95 % interval may be off value ± 1.96 u by this many u.
_BENT = 0.2
#: Relative uncertainty of K2 or C above which propagation of uncertainty to second order is not valid.
NOT_LINEAR = 0.3
#: A passive arm is possible if K' - K1 and K'' plus this many of their standard uncertainties are above zero.
_LOST = 3.0


@dataclass(frozen=True, eq=False)
class Setup(ByValue):
    """The inputs of the identification of N tests of one rig, besides their phasors.

    Attributes
    ----------
    rig_name : str
        Name of the rig; empty where the campaign has one rig without a name.
    rig : Rig or None
        The rig as stated.
    channels : ChannelUncertainty
        Standard uncertainties of the channels.
    k1, k1_std : (N,) float array [N/m]
        Static stiffness and its standard uncertainty.
    added, added_std : (N,) float array [kg]
        Added mass and its standard uncertainty.
    family : (N,) int array
        Number of the condition without frequency; negative for a rigid block in place of the tyre.
    nominal : (N,) float array [Hz]
        Frequency as stated; not-a-number where it is not stated, or where the recording gave several frequencies.
    specimen : tuple of N str
        Name of the specimen.
    time : (N,) float array
        Time of the test [s]; its place in tests.csv if not all times are known.
    static_time : (N,) float array
        Time of the static tests that gave K1; not-a-number if it is unknown.
    order : RunOrder
        Where the times are from.
    apart : (N,) float array [1]
        Standard uncertainty of log K* for the temperature of the test apart from the mean of its condition.
    lines, recording : (N,) float array [1], (N,) int array
        Number of lines of the recording that are used, and the number of the recording.
    """

    rig_name: str
    rig: Rig | None
    channels: ChannelUncertainty
    k1: FloatArray
    k1_std: FloatArray
    added: FloatArray
    added_std: FloatArray
    family: np.ndarray
    nominal: FloatArray
    specimen: tuple[str, ...]
    time: FloatArray
    static_time: FloatArray
    order: RunOrder
    apart: FloatArray
    lines: FloatArray
    recording: np.ndarray

    def part(self, rows: BoolArray) -> Setup:
        """The inputs for some of the tests."""
        names = {one.name for one in fields(self)} - {"rig_name", "rig", "channels", "specimen", "order"}
        specimen = tuple(name for name, kept in zip(self.specimen, rows, strict=True) if kept)
        taken = {name: getattr(self, name)[rows] for name in names}
        return replace(self, channels=self.channels.part(rows), specimen=specimen, **taken)


@dataclass(frozen=True, eq=False)
class Group(ByValue):
    """The tests of one rig that were identified together.

    Attributes
    ----------
    keys : tuple of (str, int)
        Test and point of each row.
    setup : Setup
    phasors : Phasors
    route : str
        The route that was used.
    result : Identification
    variance : dict of Source to (N, 6) float array
        Variance of each of `core.identify.OUTPUTS` by its source; K1 stands in its parts.
    intervals : dict of int to (Interval, Interval)
        Intervals of K2 and C by Monte Carlo, for the rows where value ± 1.96 u is not a 95 % interval.
    joint : Joint or None
        The joint solution; None for another route.
    estimate : RigEstimate or None
        The rig as found; None for another route.
    """

    keys: tuple[Key, ...]
    setup: Setup
    phasors: Phasors
    route: str
    result: Identification
    variance: dict[Source, FloatArray]
    intervals: dict[int, tuple[Interval, Interval]] = field(default_factory=dict)
    joint: Joint | None = None
    estimate: RigEstimate | None = None

    @cached_property
    def columns(self) -> dict[str, FloatArray]:
        """The identified values (N,) by column of dynamic.csv."""
        found = self.result
        return {
            **pair_columns(q.CORR_R_I, found.mobility.real, found.mobility.imag, found.mobility_covariance),
            **tyre_columns(found),
            q.TR_MEASURED.head: found.tr_measured,
            q.TR_PREDICTED.head: found.tr_predicted,
            q.TR.u_head: found.tr_std,
        }


@dataclass(frozen=True)
class Identified:
    """One point of a test, as row `at` of a group."""

    group: Group
    at: int

    @property
    def result(self) -> Identification:
        """The identification of the whole group."""
        return self.group.result


def no_rig(campaign: Campaign, route: str) -> str:
    """Message that a route lacks the rig, with what may be stated instead by the channels that are there."""
    stated = "state moving_mass and preload_stiffness"
    if campaign.stated.channels.motion_out is None:
        stated += ', or output = "blocked" if the far side of the specimen is fixed; without V2 there is no other route'
    elif campaign.stated.channels.force_in is not None:
        stated += ", or use --route relative"
    return f"campaign.toml: [rig] is missing, the {route} route needs it: {stated}"


def possible_route(campaign: Campaign, route: str) -> tuple[str, str]:
    """The route that the stated channels and rigs allow in place of the joint route, and a note with the reason."""
    stated = campaign.stated
    if route != "joint" or not campaign.of_kind("dynamic"):
        return route, ""
    if stated.channels.motion_out is None:
        return "mobility", "no V2 is stated, so the rig cannot be checked: K* by the mobility route"
    if not stated.all_rigs and stated.channels.force_in is not None:
        return "relative", "no rig is stated: K* by the relative route, from F1, V1 and V2, without a predicted TR"
    if stated.channels.force_in is None and stated.all_rigs:
        return "transmissibility", "no F1 is stated: K* by the transmissibility route, from V1, V2 and the rig"
    return route, ""


def identify_tests(
    campaign: Campaign,
    tests: Sequence[Test],
    points: Sequence[Point],
    stiffness: Sequence[StaticStiffness],
    route: str,
    draws: int,
    seed: int,
    apart: Collection[int] = (),
) -> tuple[dict[int, Identified], list[str]]:
    """Identify the usable tests of each rig together.

    Parameters
    ----------
    campaign : Campaign
    tests, points, stiffness : sequences
        Test, reduced recording and K1 of each row; `tests` holds a test once per point.
    route : str
        The route that is wanted.
    draws, seed : int
        Number of Monte Carlo trials for an interval of K2 and C, 0 for none, and their seed.
    apart : collection of int
        Indices of the tests that share K* with no other test, because their condition is not as stated.

    Returns
    -------
    found : dict of int to Identified
        Result of each test, by its index in `tests`.
    notes : list of str
        Departures from the requested route with their reasons, and notes on each rig as found.
    """
    found: dict[int, Identified] = {}
    notes: list[str] = []
    keys = point_keys(test.name for test in tests)
    several = {name for name, point in keys if point > 1}
    rigs: dict[str, list[int]] = {test.rig: [] for test in tests}
    for i, test in enumerate(tests):
        if _usable(test, points[i], route):
            rigs[test.rig].append(i)
    for rig_name, members in rigs.items():
        if not members:
            continue
        of_rig, used, k1 = [tests[i] for i in members], [points[i] for i in members], [stiffness[i] for i in members]
        setup = _with_responses(setup_of(campaign, rig_name, of_rig, k1), used)
        setup.nominal[[test.name in several for test in of_rig]] = np.nan
        alone = np.array([i in apart for i in members])
        setup.family[alone] = len(tests) + np.flatnonzero(alone)
        setup.apart[alone] = 0.0
        notes += temperature_note(setup.apart, campaign.stated.conditions)
        group, remarks = _group(setup, [keys[i] for i in members], used, k1, route)
        group.intervals.update(_intervals(group, draws, seed))
        notes += remarks
        found.update({i: Identified(group, at) for at, i in enumerate(members)})
    return found, notes


def _usable(test: Test, point: Point, route: str) -> bool:
    """Whether a test is identified together with the others; a rejected test would spoil the joint solution."""
    if point.phasors is None or (test.kind == "calibration" and route != "joint"):
        return False
    return worst_verdict(row.verdict for row in point.checks) != "rejected"


def _with_responses(setup: Setup, points: Sequence[Point]) -> Setup:
    """The setup with the uncertainty of calibrated responses at each test's frequency."""
    left = np.array([point.response_std for point in points])
    if not left.any():
        return setup
    return replace(setup, channels=replace(setup.channels, response=left[:, :, 0] + 1j * left[:, :, 1]))


def _group(
    setup: Setup, keys: Sequence[Key], points: Sequence[Point], stiffness: Sequence[StaticStiffness], route: str
) -> tuple[Group, list[str]]:
    """The tests of one rig identified by a route, or by the route that they allow instead; and notes."""
    phasors = Phasors.stack([phasors for point in points if (phasors := _phasors(point, route)) is not None])
    used, note = _route_of(setup, phasors, route)
    parts = [k1.parts for k1 in stiffness]
    try:
        group = _identified(tuple(keys), setup, phasors, used, parts)
    except np.linalg.LinAlgError as error:
        note = f"the joint route cannot be solved for these tests ({error}): K* by the mobility route"
        group = _identified(tuple(keys), setup, phasors, "mobility", parts)
    notes = [note] if note else []
    if group.estimate is not None:
        estimate = with_recordings(group.estimate, [point.checks for point in points])
        group = replace(group, estimate=estimate)
        notes += [*(estimate.note(code) for code in estimate.notes), *([estimate.rests] if estimate.rests else [])]
    where = f"[rigs.{setup.rig_name}]" if setup.rig_name else "[rig]"
    return group, [f"{where}: {note}" for note in notes]


def _phasors(point: Point, route: str) -> Phasors | None:
    """Amplitudes of a test; for the joint route a channel that hardly moves is not-a-number."""
    phasors = point.phasors
    still = {row.channel for row in point.checks if row.code is Code.EXCITATION and row.statistic > row.limit}
    idle = [symbol in still for symbol in SYMBOLS.values()]
    if phasors is None or route != "joint" or not any(idle):
        return phasors
    return replace(phasors, amplitudes=np.where(idle, np.nan, phasors.amplitudes))


def _route_of(setup: Setup, phasors: Phasors, route: str) -> tuple[str, str]:
    """The route wanted, or the route that the tests of this rig allow instead, with a note."""
    if route != "joint":
        return route, ""
    if setup.rig is None:
        return "relative", "the rig of these tests is not stated: K* by the relative route"
    if setup.rig.blocked:
        return "mobility", "the output is blocked, so there is no V2: K* by the mobility route"
    if not np.isfinite(phasors.motion_out).any():
        return "mobility", "no test has a usable V2, so the rig cannot be checked: K* by the mobility route"
    return route, ""


def setup_of(campaign: Campaign, rig_name: str, tests: Sequence[Test], stiffness: Sequence[StaticStiffness]) -> Setup:
    """The inputs of the identification of some tests of one rig."""
    stated = campaign.stated.all_rigs.get(rig_name)
    added = np.array([test.value("added_mass") or 0.0 for test in tests])
    added_std = [test.value("u(added_mass)") for test in tests]
    order, time = _run(tests)
    _, at, lines = np.unique([test.name for test in tests], return_inverse=True, return_counts=True)
    family = families(campaign, tests)
    return Setup(
        rig_name=rig_name,
        rig=stated.rig() if stated is not None else None,
        channels=_channels(campaign),
        k1=np.array([k1.value for k1 in stiffness]),
        k1_std=np.array([k1.std for k1 in stiffness]),
        added=added,
        added_std=np.array([defaults.MASS_STD * m if s is None else s for m, s in zip(added, added_std, strict=True)]),
        family=family,
        nominal=np.array([test.value("frequency") or np.nan for test in tests]),
        specimen=tuple(test.tyre for test in tests),
        time=time,
        static_time=np.array([k1.time if order is RunOrder.TIME else np.nan for k1 in stiffness]),
        order=order,
        apart=temperatures_apart(tests, family, campaign.stated.conditions),
        lines=lines[at].astype(float),
        recording=at,
    )


def _run(tests: Sequence[Test]) -> tuple[RunOrder, FloatArray]:
    """When the tests ran: as tests.csv states it, as their recordings state it, or in the order of tests.csv."""
    time = np.array([test.values.get("time", np.nan) for test in tests])
    if np.all(np.isfinite(time)):
        return RunOrder.TIME, time
    recorded = np.array([test.values.get(BEGAN, np.nan) for test in tests])
    if np.all(np.isfinite(recorded)):
        return RunOrder.RECORDINGS, recorded
    return RunOrder.ROWS, np.arange(len(tests), dtype=float)


def _channels(campaign: Campaign) -> ChannelUncertainty:
    """Standard uncertainties of the channels as stated; zero for a channel that is not stated."""
    channels = [campaign.stated.channels.named(role) for role in CHANNELS]
    stated = [(0.0, 0.0, 0.0) if one is None else (one.gain_std, one.phase_std, one.std_delay) for one in channels]
    return ChannelUncertainty(*np.array(stated).T)


def _identified(
    keys: tuple[Key, ...], setup: Setup, phasors: Phasors, route: str, parts: Sequence[Mapping[Source, float]]
) -> Group:
    """The tests of one rig by a route; `parts` are those of the uncertainty of each K1."""
    if route == "joint":
        joint = _solved(setup, phasors)
        setup, parts = _with_drift(setup, joint, parts)
        found, result = _results(setup, phasors, joint)
        estimate = rig_estimate(setup.rig_name, keys, joint, found)
        estimate = replace(estimate, order=setup.order, mass_gain=_mass_gain(joint, setup, phasors, found, result))
        variance = k1_apart(joint_variance_by_source(joint, found, setup.k1_std), parts)
        return Group(keys, setup, phasors, route, result, variance, joint=joint, estimate=estimate)
    arguments: dict[str, Any] = {
        "k1_std": setup.k1_std,
        "route": route,
        "added_mass": setup.added,
        "added_mass_std": setup.added_std,
        "channels": setup.channels,
    }
    result = identify(phasors, setup.rig, setup.k1, **arguments)
    result = at_mean_temperature(result, setup.apart)
    variance = variance_by_source(phasors, setup.rig, setup.k1, **arguments)
    return Group(keys, setup, phasors, route, result, k1_apart(variance, parts))


def _solved(setup: Setup, phasors: Phasors) -> Joint:
    """The joint solution of some tests."""
    assert setup.rig is not None
    return solve_joint(
        phasors,
        setup.rig,
        setup.k1,
        family=setup.family,
        nominal_frequency=setup.nominal,
        added_mass=setup.added,
        added_mass_std=setup.added_std,
        channels=setup.channels,
        specimen=setup.specimen,
        time=setup.time,
        apart=setup.apart,
        lines=setup.lines,
        recording=setup.recording,
    )


def _results(setup: Setup, phasors: Phasors, joint: Joint) -> tuple[Outputs, Identification]:
    """Outputs of a joint solution for each of its tests, and the identification from them."""
    found = outputs(joint, phasors, setup.k1)
    return found, identification(joint, phasors, setup.k1, setup.k1_std, found)


def _with_drift(
    setup: Setup, joint: Joint, parts: Sequence[Mapping[Source, float]]
) -> tuple[Setup, Sequence[Mapping[Source, float]]]:
    """Add the drift of the specimens between a test and its static test to the uncertainty of K1.

    Without times the static test was made at any time of the run. K1 need not drift as K* does, so it is not corrected.
    """
    drift = {
        one.source.of: float(np.hypot(joint.found[at], joint.found_std[at]))
        for at, one in enumerate(joint.stated.parameters)
        if one.source.kind is Kind.DRIFT
    }
    length = float(np.ptp(setup.time))
    if not drift or not length:
        return setup, parts
    place = joint.problem.observed.place[np.argsort(joint.order)]
    apart = np.where(
        np.isfinite(setup.static_time), (setup.time - setup.static_time) / length, np.sqrt(place**2 + 1 / 12)
    )
    moved = np.array([drift.get(name, 0.0) for name in setup.specimen]) * np.abs(apart) * np.nan_to_num(setup.k1)
    source = Source(Kind.K1_DRIFT)
    wider = [{**part, source: float(one)} if part else part for part, one in zip(parts, moved, strict=True)]
    return replace(setup, k1_std=np.hypot(setup.k1_std, moved)), wider


def _mass_gain(
    joint: Joint, setup: Setup, phasors: Phasors, found: Outputs, result: Identification
) -> dict[str, tuple[float, float]]:
    """Median relative uncertainties of the tests without an added mass, from these tests alone and from all tests."""
    bare = (setup.added == 0) & (joint.condition >= 0)
    if bare.all() or not bare.any():
        return {}
    fewer, fewer_phasors = setup.part(bare), phasors.part(bare)
    alone = _solved(fewer, fewer_phasors)
    alone_found, alone_result = _results(fewer, fewer_phasors, alone)
    exact = identification(alone, fewer_phasors, fewer.k1, 0.0, alone_found)
    without = relative_uncertainties(alone_result, exact, np.ones(fewer.k1.size, dtype=bool))
    exact = identification(joint, phasors, setup.k1, 0.0, found)
    return mass_gain(without, relative_uncertainties(result, exact, bare))


def _intervals(group: Group, draws: int, seed: int) -> dict[int, tuple[Interval, Interval]]:
    """Intervals of K2 and C by Monte Carlo, for the rows where value ± 1.96 u is not a 95 % interval.

    The random numbers of a row depend on its test and point only, not on other tests or their order.
    """
    found = {}
    for at in np.flatnonzero(_skew(group.result)).tolist() if draws else ():
        test, point = group.keys[at]
        rng = np.random.default_rng([seed, *test.encode(), *((point,) if point > 1 else ())])
        stiffness = _drawn(group, at, draws, rng)
        k1 = group.result.k1[at] + np.nan_to_num(group.result.k1_std[at]) * rng.standard_normal(draws)
        found[at] = arm_intervals(stiffness, k1, float(2 * np.pi * group.result.frequency[at]))
    return found


def _skew(result: Identification) -> BoolArray:
    """Whether K2 or C of each test is too uncertain, too bent, or undefined by chance, for a normal distribution."""
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = np.diagonal(result.arm_covariance, 0, 1, 2)
        relative = np.sqrt(variance) / np.stack([result.k2, result.c], axis=1)
        difference = result.stiffness_covariance.copy()
        difference[:, 0, 0] += np.nan_to_num(result.k1_std) ** 2
        bend = largest_bend(result.stiffness, result.k1, 2 * np.pi * result.frequency, difference)
        bent = np.isfinite(result.k2) & np.any(bend > _BENT, axis=1)
        off = np.stack([result.stiffness.real - result.k1, result.stiffness.imag], axis=1)
        spread = np.sqrt(np.diagonal(result.stiffness_covariance, 0, 1, 2))
        spread[:, 0] = np.hypot(spread[:, 0], np.nan_to_num(result.k1_std))
        lost = np.isnan(result.k2) & np.all(off > -_LOST * spread, axis=1)
        known = np.isfinite(result.k1) & np.isfinite(result.stiffness)
        return np.asarray(known & (np.any(relative > _SKEW, axis=1) | bent | lost))


def _drawn(group: Group, at: int, draws: int, rng: np.random.Generator) -> ComplexArray:
    """Random values of K* of one row from its distribution, (draws,) [N/m]."""
    if group.joint is not None:
        return draw_around(complex(group.result.stiffness[at]), group.result.stiffness_covariance[at], draws, rng)
    setup = group.setup
    return draw_route(
        group.phasors.part(at),
        setup.rig,
        group.route,
        setup.channels.part([at]),
        draws,
        rng,
        added_mass=float(setup.added[at]),
        added_mass_std=float(setup.added_std[at]),
    )


def budget_columns(group: Group) -> dict[str, np.ndarray]:
    """budget.csv as numbers: source, test and quantity by their places, uncertainty and share that are not zero."""
    result = group.result
    stiffness, arm = np.isfinite(result.stiffness), np.isfinite(result.k2)
    known = np.stack([stiffness, stiffness, stiffness, arm, arm, np.isfinite(result.tr_std)], axis=1)
    variance = np.stack(list(group.variance.values()))
    total = variance.sum(axis=0)
    source, test, quantity = np.nonzero(known & (variance > 0) & (total > 0))
    found = variance[source, test, quantity]
    share = found / total[test, quantity]
    return {"source": source, "test": test, "quantity": quantity, "u": np.sqrt(found), "share": share}
