"""Phasors, rig and K1 of a campaign's dynamic tests become K*, K2, C and TR: by a route, or by all that is there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.campaign.folder import Campaign, Test, condition_of
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.checks import Code, worst_verdict
from fourpole.core.identification import Identification
from fourpole.core.identify import identify, variance_by_source
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.outputs import Outputs, identification, outputs
from fourpole.core.joint.outputs import variance_by_source as joint_variance_by_source
from fourpole.core.montecarlo import Interval, arm_intervals, draw_around, draw_route
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source
from fourpole.fitting.rows import Key
from fourpole.study.outcome import Point, point_keys
from fourpole.study.rig_estimate import RigEstimate, mass_gain
from fourpole.study.rig_solution import relative_uncertainties, rig_estimate
from fourpole.study.static import StaticStiffness

__all__ = ["Group", "Identified", "Setup", "identify_tests", "possible_route", "setup_of"]

#: An added mass of unstated uncertainty is known to this.
ADDED_MASS_STD = 1e-4
#: Above this relative uncertainty of K2 or C their distribution is drawn, not taken as normal.
_SKEW = 0.1
#: A K' below K1, or a K'' below zero, by more of their uncertainty than this is no matter of luck.
_LOST = 3.0


@dataclass(frozen=True, eq=False)
class Setup(ByValue):
    """What identification needs of the tests of one rig, besides their phasors."""

    rig_name: str
    rig: Rig | None
    channels: ChannelUncertainty
    k1: FloatArray
    k1_std: FloatArray
    added: FloatArray
    added_std: FloatArray
    family: np.ndarray
    nominal: FloatArray

    def part(self, rows: BoolArray) -> Setup:
        """The same for some of the tests."""
        names = ("k1", "k1_std", "added", "added_std", "family", "nominal")
        return replace(self, channels=self.channels.part(rows), **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True)
class Identified:
    """One test: where it stands in its group."""

    group: Group
    at: int

    @property
    def result(self) -> Identification:
        """What the whole group came to."""
        return self.group.result


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
        The route that was possible.
    result : Identification
    variance : dict of Source to (N, 6) float array
        Of each of `core.identify.OUTPUTS`, by its source; K1 in its parts.
    intervals : dict of int to (Interval, Interval)
        Of K2 and C, for the tests where linear propagation fails.
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


def possible_route(campaign: Campaign, route: str) -> tuple[str, str]:
    """The route that the stated channels and rigs allow in place of the joint one, and a note that says why."""
    stated = campaign.stated
    if route != "joint" or not campaign.of_kind("dynamic"):
        return route, ""
    if stated.channels.motion_out is None:
        return "mobility", "no V2 is stated, so there is nothing to hold the rig against: K* by the mobility route"
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
) -> tuple[dict[int, Identified], list[str]]:
    """Identify the usable tests of each rig together.

    Returns
    -------
    found : dict of int to Identified
        By the place of the test in `tests`.
    notes : list of str
        What was done other than asked for, and why.
    """
    found: dict[int, Identified] = {}
    notes: list[str] = []
    keys = point_keys(test.name for test in tests)
    for rig_name in dict.fromkeys(test.rig for test in tests):
        members = [i for i, test in enumerate(tests) if test.rig == rig_name and _usable(test, points[i], route)]
        if not members:
            continue
        setup = setup_of(campaign, rig_name, [tests[i] for i in members], [stiffness[i] for i in members])
        phasors = Phasors.stack([phasors for i in members if (phasors := _phasors(points[i], route)) is not None])
        setup = _with_responses(setup, [points[i] for i in members])
        used, note = _route_of(setup, phasors, route)
        group_keys, parts = tuple(keys[i] for i in members), [stiffness[i].parts for i in members]
        try:
            group = _identified(group_keys, setup, phasors, used, parts)
        except np.linalg.LinAlgError as error:
            note = f"the joint route cannot be solved for these tests ({error}): K* by the mobility route"
            group = _identified(group_keys, setup, phasors, "mobility", parts)
        if note:
            notes.append(f"{_where(rig_name)}: {note}")
        group = _with_intervals(group, draws, seed)
        if group.estimate is not None:
            notes += [f"{_where(rig_name)}: {group.estimate.note(code)}" for code in group.estimate.notes]
        found.update({i: Identified(group, at) for at, i in enumerate(members)})
    return found, notes


def _with_responses(setup: Setup, points: Sequence[Point]) -> Setup:
    """The setup with what calibrated responses leave unknown at each test's frequency."""
    left = np.array([point.response_std for point in points])
    if not left.any():
        return setup
    return replace(setup, channels=replace(setup.channels, response=left[:, :, 0] + 1j * left[:, :, 1]))


def _phasors(point: Point, route: str) -> Phasors | None:
    """Amplitudes of a test; what hardly moves may warn, but must not be taken for a measurement by the joint route."""
    if point.phasors is None:
        return None
    phasors = point.phasors
    still = {row.channel for row in point.checks if row.code is Code.EXCITATION and row.statistic > row.limit}
    idle = [symbol in still for symbol in SYMBOLS.values()]
    if route != "joint" or not any(idle):
        return phasors
    return replace(phasors, amplitudes=np.where(idle, np.nan, phasors.amplitudes))


def _where(rig_name: str) -> str:
    return f"[rigs.{rig_name}]" if rig_name else "[rig]"


def _usable(test: Test, point: Point, route: str) -> bool:
    """Whether a test may take part; one that is rejected must not spoil what the others find together."""
    if point.phasors is None or (test.kind == "calibration" and route != "joint"):
        return False
    return worst_verdict(row.verdict for row in point.checks) != "rejected"


def _route_of(setup: Setup, phasors: Phasors, route: str) -> tuple[str, str]:
    """The joint route, or what the tests of this rig allow instead, with a note."""
    if route != "joint":
        return route, ""
    if setup.rig is None:
        return "relative", "the rig of these tests is not stated: K* by the relative route"
    if setup.rig.blocked:
        return "mobility", "the output is blocked, so there is no V2 to hold the rig against: K* by the mobility route"
    if not np.isfinite(phasors.motion_out).any():
        return "mobility", "no test has a usable V2 to hold the rig against: K* by the mobility route"
    return route, ""


def setup_of(campaign: Campaign, rig_name: str, tests: Sequence[Test], stiffness: Sequence[StaticStiffness]) -> Setup:
    """What identification needs of the tests of one rig."""
    stated = campaign.stated.all_rigs.get(rig_name)
    channels = [campaign.stated.channels.named(role) for role in CHANNELS]
    added = np.array([test.value("added_mass") or 0.0 for test in tests])
    added_std = [test.value("u(added_mass)") for test in tests]
    return Setup(
        rig_name=rig_name,
        rig=stated.rig() if stated is not None else None,
        channels=ChannelUncertainty(
            gain=np.array([channel.gain_std if channel is not None else 0.0 for channel in channels]),
            phase=np.array([channel.phase_std if channel is not None else 0.0 for channel in channels]),
            delay=np.array([channel.std_delay if channel is not None else 0.0 for channel in channels]),
        ),
        k1=np.array([k1.value for k1 in stiffness]),
        k1_std=np.array([k1.std for k1 in stiffness]),
        added=added,
        added_std=np.array([ADDED_MASS_STD * m if s is None else s for m, s in zip(added, added_std, strict=True)]),
        family=_families(campaign, tests),
        nominal=np.array([test.value("frequency") or np.nan for test in tests]),
    )


def _families(campaign: Campaign, tests: Sequence[Test]) -> np.ndarray:
    """Number of the condition of each test among all tests of the campaign; negative for a rigid block."""
    rule, every = campaign.stated.sameness, campaign.of_kind("dynamic")
    groups = rule.groups([condition_of(test, rule) for test in every]).tolist()
    number = {test.name: at for test, at in zip(every, groups, strict=True)}
    return np.array([-1 if test.kind == "calibration" else number[test.name] for test in tests])


def _identified(
    keys: tuple[Key, ...], setup: Setup, phasors: Phasors, route: str, parts: Sequence[Mapping[Source, float]]
) -> Group:
    if route == "joint":
        joint, found, result = _joint(setup, phasors)
        estimate = rig_estimate(setup.rig_name, keys, joint)
        estimate = replace(estimate, mass_gain=_mass_gain(joint, setup, phasors, found, result))
        variance = _k1_apart(joint_variance_by_source(joint, found, setup.k1_std), parts)
        return Group(keys, setup, phasors, route, result, variance, joint=joint, estimate=estimate)
    arguments: dict[str, Any] = {
        "k1_std": setup.k1_std,
        "route": route,
        "added_mass": setup.added,
        "added_mass_std": setup.added_std,
        "channels": setup.channels,
    }
    result = identify(phasors, setup.rig, setup.k1, **arguments)
    variance = variance_by_source(phasors, setup.rig, setup.k1, **arguments)
    return Group(keys, setup, phasors, route, result, _k1_apart(variance, parts))


def _joint(setup: Setup, phasors: Phasors) -> tuple[Joint, Outputs, Identification]:
    """The joint solution of some tests, and what it gives for each of them."""
    assert setup.rig is not None
    joint = solve_joint(
        phasors,
        setup.rig,
        setup.k1,
        family=setup.family,
        nominal_frequency=setup.nominal,
        added_mass=setup.added,
        added_mass_std=setup.added_std,
        channels=setup.channels,
    )
    found = outputs(joint, phasors, setup.k1)
    return joint, found, identification(joint, phasors, setup.k1, setup.k1_std, found)


def _mass_gain(
    joint: Joint, setup: Setup, phasors: Phasors, found: Outputs, result: Identification
) -> dict[str, tuple[float, float]]:
    """Median relative uncertainties of the tests without an added mass, from these tests alone and from all tests."""
    bare = (setup.added == 0) & (joint.condition >= 0)
    if bare.all() or not bare.any():
        return {}
    fewer, fewer_phasors = setup.part(bare), phasors.part(bare)
    alone, alone_found, alone_result = _joint(fewer, fewer_phasors)
    exact = identification(alone, fewer_phasors, fewer.k1, 0.0, alone_found)
    without = relative_uncertainties(alone_result, exact, np.ones(fewer.k1.size, dtype=bool))
    exact = identification(joint, phasors, setup.k1, 0.0, found)
    return mass_gain(without, relative_uncertainties(result, exact, bare))


def _k1_apart(variance: dict[Source, FloatArray], parts: Sequence[Mapping[Source, float]]) -> dict[Source, FloatArray]:
    """The variance that K1 makes, in the parts that K1's own uncertainty has."""
    whole = variance.pop(Source(Kind.K1))
    sources = dict.fromkeys(source for part in parts for source in part)
    squares = {source: np.array([part.get(source, 0.0) ** 2 for part in parts]) for source in sources}
    total = np.sum(list(squares.values()), axis=0) if squares else np.zeros(len(parts))
    for source, square in squares.items():
        share = np.divide(square, total, out=np.zeros_like(square), where=total > 0)
        variance[source] = whole * share[:, None]
    return variance


def _with_intervals(group: Group, draws: int, seed: int) -> Group:
    """The group with K2 and C drawn where their uncertainty is too large for them to be normal.

    Each test has draws of its own, whatever the others are and in whatever order.
    """
    for at in np.flatnonzero(_skew(group.result)) if draws else ():
        test, point = group.keys[at]
        rng = np.random.default_rng([seed, *test.encode(), *((point,) if point > 1 else ())])
        stiffness = _drawn(group, int(at), draws, rng)
        k1 = group.result.k1[at] + np.nan_to_num(group.result.k1_std[at]) * rng.standard_normal(draws)
        group.intervals[int(at)] = arm_intervals(stiffness, k1, float(2 * np.pi * group.result.frequency[at]))
    return group


def _skew(result: Identification) -> np.ndarray:
    """Tests whose K2 or C is known so badly, or not at all, that its distribution is not normal."""
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = np.diagonal(result.arm_covariance, 0, 1, 2)
        relative = np.sqrt(variance) / np.stack([result.k2, result.c], axis=1)
        off = np.stack([result.stiffness.real - result.k1, result.stiffness.imag], axis=1)
        spread = np.sqrt(np.diagonal(result.stiffness_covariance, 0, 1, 2))
        spread[:, 0] = np.hypot(spread[:, 0], np.nan_to_num(result.k1_std))
        lost = np.isnan(result.k2) & np.all(off > -_LOST * spread, axis=1)
        return np.isfinite(result.k1) & np.isfinite(result.stiffness) & (np.any(relative > _SKEW, axis=1) | lost)


def _drawn(group: Group, at: int, draws: int, rng: np.random.Generator) -> ComplexArray:
    if group.result.joint is not None:
        return draw_around(complex(group.result.stiffness[at]), group.result.stiffness_covariance[at], draws, rng)
    one = group.phasors.part(at)
    setup = group.setup
    return draw_route(
        one,
        setup.rig,
        group.route,
        setup.channels.part([at]),
        draws,
        rng,
        added_mass=float(setup.added[at]),
        added_mass_std=float(setup.added_std[at]),
    )


def budget_columns(group: Group) -> dict[str, list[np.ndarray]]:
    """budget.csv as numbers: per source the tests, outputs, uncertainties and shares that are not zero."""
    columns: dict[str, list[np.ndarray]] = {name: [] for name in ("source", "test", "quantity", "u", "share")}
    known = _known(group.result)
    total = np.sum(list(group.variance.values()), axis=0)
    for at, variance in enumerate(group.variance.values()):
        rows, outputs_ = np.nonzero(known & (variance > 0) & (total > 0))
        columns["source"].append(np.full(rows.size, at))
        columns["test"].append(rows)
        columns["quantity"].append(outputs_)
        columns["u"].append(np.sqrt(variance[rows, outputs_]))
        columns["share"].append(variance[rows, outputs_] / total[rows, outputs_])
    return columns


def _known(result: Identification) -> np.ndarray:
    """Which outputs of which tests exist."""
    stiffness, arm = np.isfinite(result.stiffness), np.isfinite(result.k2)
    return np.stack([stiffness, stiffness, stiffness, arm, arm, np.isfinite(result.tr_std)], axis=1)
