"""Identification of a campaign's points: phasors, rig and K1 become K*, K2, C and TR by a route."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.campaign import defaults
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import Test, begun_at
from fourpole.campaign.schema import ConditionsFile
from fourpole.core.alone import largest_imbalance, shown_friction, shown_masses
from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.core.blocking import blocking_checks, steep_checks, with_unstated_springs
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.checks import Check, Code
from fourpole.core.components import component
from fourpole.core.condition import temperature_std
from fourpole.core.curvature import Interval, arm_intervals, draw_around, draw_route, largest_bend
from fourpole.core.demodulation.corrections import Correction, response_std
from fourpole.core.identify import Answers, Identification, identify, variance_by_source
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.outputs import Outputs, identification, outputs
from fourpole.core.joint.outputs import variance_by_source as joint_variance_by_source
from fourpole.core.phasor import CHANNELS, SYMBOLS, Phasors
from fourpole.core.recordingchecks import check_consistency
from fourpole.core.rig import Rig, given_way, without_fixture
from fourpole.core.sources import Kind, Source
from fourpole.core.specimen import Body
from fourpole.core.unstated import Unstated
from fourpole.errors import CampaignError
from fourpole.fitting.rows import Key
from fourpole.study.points import Points, StaticStiffness
from fourpole.study.rig_estimate import RigEstimate, RunOrder, mass_gain
from fourpole.study.rig_solution import relative_uncertainties, rig_estimate, with_recordings
from fourpole.study.static import k1_apart

#: Relative uncertainty of K2 or C above which Monte Carlo finds their distribution.
_SKEW = 0.1
#: Monte Carlo finds the distribution of K2 and C if an end of a 95 % interval may be off value ± 1.96 u by this many u.
_BENT = 0.2
#: A passive arm is possible if K' - K1 and K'' plus this many of their standard uncertainties are above zero.
_LOST = 3.0
#: Uncertainty of K* from the temperature of a test above which a note tells it [1].
_NOTED = 1e-4


@dataclass(frozen=True, eq=False)
class RigGroup(ByValue):
    """The tests of one rig that were identified together.

    Attributes
    ----------
    rig_name : str
        Name of the rig; empty where the campaign has one rig without a name.
    rows : (N,) int array
        Their rows among all points.
    keys : tuple of (str, int)
        Test and point of each row.
    phasors : Phasors
        Amplitudes as they were used.
    route : str
        The route that was used.
    result : Identification
    variance : dict of Source to (N, 6) float array
        Variance of each of `core.identify.OUTPUTS` by its source; K1 stands in its parts.
    joint : Joint or None
        The joint solution; None for another route.
    estimate : RigEstimate or None
        The rig as found; None for another route.
    intervals : dict of int to (Interval, Interval)
        Intervals of K2 and C by Monte Carlo, for the rows where value ± 1.96 u is not a 95 % interval.
    k_of : (N,) array of str
        What K* is of: springs, driving point or blocked transfer.
    heavy : frozenset of int
        Places of the rows whose specimen has a stated mass that this route does not take out.
    checks : tuple of tuple of Check
        Checks of each row by its route, which take the place of earlier ones of the same code; none of the joint route.
    unstated : Unstated
        Uncertainties of the parts that nobody stated, where each test was taken by itself.
    """

    rig_name: str
    rows: np.ndarray
    keys: tuple[Key, ...]
    phasors: Phasors
    route: str
    result: Identification
    variance: dict[Source, FloatArray]
    joint: Joint | None = None
    estimate: RigEstimate | None = None
    intervals: dict[int, tuple[Interval, Interval]] = field(default_factory=dict)
    k_of: np.ndarray = field(default_factory=lambda: np.array(["springs"]))
    heavy: frozenset[int] = frozenset()
    checks: tuple[tuple[Check, ...], ...] = ()
    unstated: Unstated = field(default_factory=Unstated)


def no_rig(campaign: Campaign, route: str) -> str:
    """Message that a route lacks the rig, with what may be stated instead by the channels that are there."""
    stated = "state moving_mass and preload_stiffness"
    if route == "transmissibility":
        stated = 'no force is recorded: state the mass behind the specimen, as moving_mass = "12.5 kg"'
    elif campaign.stated.channels.motion_out is None:
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
    if stated.channels.force_in is None:
        return "transmissibility", "no F1 is stated: K* by the transmissibility route, from V1, V2 and the rig"
    return route, ""


def check_rig(campaign: Campaign, route: str) -> None:
    """CampaignError if the dynamic tests of a campaign need a rig for a route that is not stated, or another one."""
    rigs = campaign.stated.all_rigs
    if not rigs and route != "relative" and any(test.kind in ("dynamic", "calibration") for test in campaign.tests):
        raise CampaignError(no_rig(campaign, route))
    if route == "transmissibility" and any(rig.output == "blocked" for rig in rigs.values()):
        raise CampaignError(
            "campaign.toml: [rig] output is blocked, so there is no transmissibility: use --route mobility"
        )


def identify_points(
    campaign: Campaign, points: Points, route: str, draws: int, seed: int
) -> tuple[list[RigGroup], list[str]]:
    """Identify the usable tests of each rig together.

    Parameters
    ----------
    campaign : Campaign
    points : Points
        The points with K1 and all checks that come before.
    route : str
        The route that is wanted.
    draws, seed : int
        Number of Monte Carlo trials for an interval of K2 and C, 0 for none, and their seed.

    Returns
    -------
    groups : list of RigGroup
        The tests of each rig.
    notes : list of str
        Departures from the requested route with their reasons, and notes on each rig as found.
    """
    groups, notes = [], []
    points = without_fixtures(campaign, points)
    # A rejected test would spoil the joint solution of the others.
    usable = points.sound if route == "joint" else points.sound & (points.condition >= 0)
    rigs = np.array([test.rig for test in points.tests])
    for rig_name in dict.fromkeys(rigs[usable].tolist()):
        rows = np.flatnonzero(usable & (rigs == rig_name))
        setup, order = setup_of(campaign, rig_name, points, rows)
        notes += temperature_note(setup["apart"], campaign.stated.conditions)
        group, remarks = _identified(rig_name, points, rows, setup, order, route)
        group.intervals.update(_intervals(group, setup, draws, seed))
        where = f"[rigs.{rig_name}]" if rig_name else "[rig]"
        notes += [f"{where}: {remark}" for remark in remarks]
        groups.append(group)
    return groups, notes


def setup_of(campaign: Campaign, rig_name: str, points: Points, rows: np.ndarray) -> tuple[dict[str, Any], RunOrder]:
    """What is known of some rows of one rig besides their phasors, and where their times are from.

    These are the arguments of `fourpole.core.joint.solve_joint`. A strange row is alone in its condition. The tests ran
    as tests.csv states it, as their recordings state it, or in the order of tests.csv.
    """
    tests, strange, stated = [points.tests[index] for index in rows], points.strange[rows], campaign.stated
    _, own, lines = np.unique([test.name for test in tests], return_inverse=True, return_counts=True)
    files = [test.name if test.window is None else f"{test.file} " for test in tests]  # parts of one are no repeats
    count = Counter(test.name for test in points.tests)
    nominal = [np.nan if count[test.name] > 1 else test.value("frequency") or np.nan for test in tests]
    temperature, time = np.array([test.values.get("temperature", np.nan) for test in tests]), np.array(begun_at(tests))
    order = RunOrder.TIME
    if not np.all(np.isfinite(time)):
        time, order = points.began[rows], RunOrder.RECORDINGS
    if not np.all(np.isfinite(time)):
        time, order = np.arange(len(tests), dtype=float), RunOrder.ROWS
    apart = temperature_std(temperature, points.condition[rows], stated.conditions.per_kelvin)
    added, added_std = added_masses(tests)
    phasors, of_rig = points.phasors.part(rows), stated.all_rigs.get(rig_name)
    family = np.where(strange, len(points.tests) + np.arange(rows.size), points.condition[rows])
    rig = None if of_rig is None else of_rig.rig()
    if rig is not None and of_rig is not None and of_rig.unstated_springs:
        rig = with_unstated_springs(rig, phasors, added, family)
    channels = channel_uncertainty(
        campaign, [points.corrections[index] for index in rows], float(phasors.frequency.max())
    )
    fixture, size = given_way(phasors, 0.0 if rig is None else rig.input_mass, points.condition[rows] < 0)
    fixture_std = 0.0 if of_rig is None or not size else of_rig.fixture_compliance[1] / size
    setup = {
        "rig": rig,
        "k1": np.array([points.stiffness[index].value for index in rows]),
        "family": family,
        "nominal_frequency": np.array(nominal),
        "added_mass": added,
        "added_mass_std": added_std,
        "channels": replace(channels, fixture=fixture, fixture_std=fixture_std),
        "mounting": np.array([test.mounting for test in tests], dtype=object),
        "specimen": np.array([test.tyre for test in tests], dtype=object),
        "specimens": stated.specimen_uncertainty,
        "bodies": stated.bodies,
        **stated.unstated.rig_std(
            rigid=rig is None or bool(np.isinf(rig.frame_stiffness)), guided=stated.channels.force_in is not None
        ),
        "complete": stated.unstated.ordinary == "zero",
        "time": time,
        "apart": np.where(strange, 0.0, apart),
        "lines": lines[own].astype(float),
        "recording": np.unique(files, return_inverse=True)[1].ravel(),
    }
    return setup, order


def without_fixtures(campaign: Campaign, points: Points) -> Points:
    """The points with V1 at the specimen, where a rig states a fixture that gives way before it."""
    rigs = campaign.stated.all_rigs
    compliance = {name: rig.fixture_compliance[0] for name, rig in rigs.items()}
    if not any(compliance.values()):
        return points
    own = np.array([compliance.get(test.rig, 0.0) for test in points.tests])
    mass = np.array([rigs[test.rig].rig().input_mass if test.rig in rigs else 0.0 for test in points.tests])
    return replace(points, phasors=without_fixture(points.phasors, own, mass))


def added_masses(tests: Sequence[Test]) -> tuple[FloatArray, FloatArray]:
    """Added mass of each test and its standard uncertainty [kg]."""
    added = np.array([test.added_mass for test in tests])
    std = np.array([test.values.get("u(added_mass)", np.nan) for test in tests])
    return added, np.where(np.isnan(std), defaults.MASS_STD * added, std)


def channel_uncertainty(
    campaign: Campaign, corrections: Sequence[Sequence[Correction]], top: float
) -> ChannelUncertainty:
    """Standard uncertainties of the channels, zero for one that is not stated, and of calibrated responses.

    `top` is the highest frequency of the tests [Hz], at which the slope of a gain is stated.
    """
    channels = {role: campaign.stated.channels.named(role) for role in CHANNELS}
    uncertainty = campaign.stated.ordinary.uncertainty(channels, top)
    response = np.array([response_std(rows) for rows in corrections])
    return replace(uncertainty, response=response[:, :, 0] + 1j * response[:, :, 1]) if response.any() else uncertainty


def _identified(
    rig_name: str, points: Points, rows: np.ndarray, setup: dict[str, Any], order: RunOrder, route: str
) -> tuple[RigGroup, list[str]]:
    """The tests of one rig identified by a route, or by the route that they allow instead; and notes."""
    keys, checks = points.keys, [points.checks[index] for index in rows]
    phasors, used, note = _usable(setup["rig"], points.phasors.part(rows), checks, route)
    stiffness = [points.stiffness[index] for index in rows]
    of_rig = (rig_name, rows, tuple(keys[index] for index in rows), phasors)
    try:
        joint = used == "joint"
        group = _joint(of_rig, setup, stiffness, order) if joint else _by_route(used, of_rig, setup, stiffness, checks)
    except np.linalg.LinAlgError as error:
        note = f"the joint route cannot be solved for these tests ({error}): K* by the mobility route"
        group = _by_route("mobility", of_rig, setup, stiffness, checks)
    notes = [note] if note else []
    if group.estimate is None:
        return group, notes
    estimate = with_recordings(group.estimate, checks)
    notes += [*(estimate.note(code) for code in estimate.notes), *([estimate.rests] if estimate.rests else [])]
    return replace(group, estimate=estimate), notes


def _usable(
    rig: Rig | None, phasors: Phasors, checks: Sequence[Sequence[Check]], route: str
) -> tuple[Phasors, str, str]:
    """The phasors that are used, the route wanted or that the tests of this rig allow instead, and a note on it.

    Channels that hardly move are no part of the joint solution.
    """
    if route != "joint":
        return phasors, route, ""
    idle = [[check.channel for check in of_test if check.code is Code.EXCITATION and check.statistic > check.limit]
            for of_test in checks]  # fmt: skip
    still = np.array([[symbol in channels for symbol in SYMBOLS.values()] for channels in idle])
    phasors = replace(phasors, amplitudes=np.where(still, np.nan, phasors.amplitudes))
    if rig is None:
        return phasors, "relative", "the rig of these tests is not stated: K* by the relative route"
    if rig.blocked:
        return phasors, "mobility", "the output is blocked, so there is no V2: K* by the mobility route"
    if not np.isfinite(phasors.motion_out).any():
        why = "no test has a usable V2, so the rig cannot be checked: K* by the mobility route"
        return phasors, "mobility", why
    return phasors, route, ""


_OfRig = tuple[str, np.ndarray, tuple[Key, ...], Phasors]


def _by_route(
    route: str,
    of_rig: _OfRig,
    setup: dict[str, Any],
    stiffness: Sequence[StaticStiffness],
    earlier: Sequence[Sequence[Check]],
) -> RigGroup:
    """The tests of one rig, each by itself by a route; they have checks of `earlier` stages."""
    phasors, rig, k1 = of_rig[-1], setup["rig"], setup["k1"]
    arguments = {name: setup[name] for name in ("added_mass", "added_mass_std", "channels", "mounting")}
    unstated = Unstated(*(setup[name] for name in ("support", "friction", "frame_std")))
    bodies = [setup["bodies"].get(name, Body()) for name in setup["specimen"]]
    known, blocked = np.array([body.mass_std > 0 for body in bodies]), rig is not None and rig.blocked
    if blocked and known.any():
        arguments["bodies"] = bodies
    at_far_end = route == "transmissibility" or (blocked and rig.at_ground)
    inside = (known | setup["complete"]) & blocked  # its inertia is taken out, or it has none
    k_of = np.where(inside, "springs", "blocked transfer" if at_far_end else "driving point")
    arguments |= {"k1_std": np.array([of_test.std for of_test in stiffness]), "route": route, "unstated": unstated}
    checks: list[list[Check]] = [[] for _ in k1]
    if rig is not None and not rig.blocked:
        friction = shown_friction(Answers(phasors, rig, **arguments), unstated.friction)
        arguments["unstated"] = unstated = replace(unstated, friction=friction)
        masses, limits = _of_balance(phasors, setup, bodies, arguments, earlier)
        arguments["unstated"] = unstated = replace(unstated, masses=masses)
        for row, (added, limit) in enumerate(zip(setup["added_mass"].tolist(), limits.tolist(), strict=True)):
            checks[row].append(check_consistency(phasors.part(row), rig, added, limit))
    result = identify(phasors, rig, k1, **arguments)
    # K* of a test stays at its own temperature; the covariance is that of its condition, at the mean temperature.
    moved = (setup["apart"] * np.abs(result.stiffness))[:, None, None] ** 2 * np.eye(2)
    result = replace(result, condition_covariance=result.condition_covariance + moved)
    variance = variance_by_source(phasors, rig, k1, **arguments)
    variance = k1_apart(variance, [of_test.parts for of_test in stiffness])
    heavy = frozenset() if blocked else frozenset(np.flatnonzero(known).tolist())
    if rig is not None and route == "transmissibility":
        found = (phasors, rig, result, variance, setup["added_mass"], setup["family"])
        for row, check in enumerate(blocking_checks(*found)):
            checks[row].append(check)
    if rig is not None and (route == "transmissibility" or rig.blocked):
        for row, check in steep_checks(phasors, result, setup["family"], blocked=rig.blocked).items():
            checks[row].append(check)
    further: dict[str, Any] = {"k_of": k_of, "heavy": heavy, "unstated": unstated}
    return RigGroup(*of_rig, route, result, variance, checks=tuple(map(tuple, checks)), **further)


def _of_balance(
    phasors: Phasors,
    setup: dict[str, Any],
    bodies: Sequence[Body],
    arguments: dict[str, Any],
    earlier: Sequence[Sequence[Check]],
) -> tuple[FloatArray, FloatArray]:
    """Masses of the specimens that F1 against V2 allows, and the departure of F1 that is explained with them."""
    rig = setup["rig"]
    answers = Answers(phasors, rig, **arguments)
    gross = np.array([any(check.values.get("looks") for check in of_test) for of_test in earlier], dtype=bool)
    shown = shown_masses(answers, setup["specimen"], component(Kind.BELT_MASS).bound * rig.moving_mass, gross)
    stated = np.array([body.mass for body in bodies])
    masses = shown + 0.25 * stated[:, None, None] ** 2  # half of a stated mass moves with either end
    if setup["complete"]:
        masses[[body.mass_std == 0 for body in bodies]] = 0.0
    return masses, largest_imbalance(answers, masses)


def _joint(of_rig: _OfRig, setup: dict[str, Any], stiffness: Sequence[StaticStiffness], order: RunOrder) -> RigGroup:
    """The tests of one rig by the joint route."""
    rig_name, _, keys, phasors = of_rig
    setup = {name: value for name, value in setup.items() if name not in ("frame_std", "complete")}  # of a bench
    joint = solve_joint(phasors, **setup)
    k1_std, parts = _with_specimen(setup, joint, stiffness, order)
    values = outputs(joint, phasors, setup["k1"])
    result = identification(joint, phasors, setup["k1"], k1_std, values)
    gain = _mass_gain(joint, setup, k1_std, phasors, values, result)
    estimate = replace(rig_estimate(rig_name, keys, joint, values), order=order, mass_gain=gain)
    variance = k1_apart(joint_variance_by_source(joint, values, k1_std), parts)
    return RigGroup(*of_rig, "joint", result, variance, joint, estimate)


def _with_specimen(
    setup: Mapping[str, Any], joint: Joint, stiffness: Sequence[StaticStiffness], order: RunOrder
) -> tuple[FloatArray, list[Mapping[Source, float]]]:
    """Uncertainty of K1 and its parts, with drift and scatter of the specimens between a test and its static test.

    Without times the static test was made at any time of the run. It is one without an added mass. K1 need not drift as
    K* does, so it is not corrected. It is taken to scatter as K* of the repeats does.
    """
    time, k1, length = setup["time"], np.nan_to_num(setup["k1"]), float(np.ptp(setup["time"]))
    sizes = np.hypot(joint.found, joint.found_std)
    found = {parameter.key: float(size) for parameter, size in zip(joint.stated.parameters, sizes, strict=True)}
    drift = {source.of: size for (source, _), size in found.items() if source.kind is Kind.DRIFT and length}
    block = {index: size for (source, index), size in found.items() if source.kind is Kind.BLOCK}
    of_test = joint.problem.observed.block(joint.problem.shared)[np.argsort(joint.order)].tolist()
    static_time = np.array([each.time if order is RunOrder.TIME else np.nan for each in stiffness])
    place = joint.problem.observed.place[np.argsort(joint.order)]
    apart = np.where(np.isfinite(static_time), (time - static_time) / (length or 1.0), np.sqrt(place**2 + 1 / 12))
    drifted = np.array([drift.get(name, 0.0) for name in setup["specimen"]]) * np.abs(apart)
    drifted = np.hypot(drifted, [block.get(index, 0.0) for index in of_test])
    moved = {Source(Kind.K1_DRIFT): drifted * k1, Source(Kind.SCATTER): joint.misfit.scatter * k1}
    moved = {source: std for source, std in moved.items() if std.any()}
    own, parts = np.array([each.std for each in stiffness]), [each.parts for each in stiffness]
    wider = [{**part, **{source: float(std[row]) for source, std in moved.items()}} if part else part
             for row, part in enumerate(parts)]  # fmt: skip
    return np.sqrt(sum((std**2 for std in moved.values()), own**2)), wider


def _mass_gain(
    joint: Joint,
    setup: Mapping[str, Any],
    k1_std: FloatArray,
    phasors: Phasors,
    values: Outputs,
    result: Identification,
) -> dict[str, tuple[float, float]]:
    """Median relative uncertainties of the tests without an added mass, from these tests alone and from all tests.

    Both are about the values that all tests give.
    """
    bare = (setup["added_mass"] == 0) & (joint.condition >= 0)
    if bare.all() or not bare.any():
        return {}
    alone, few, k1 = joint.part(bare), phasors.part(bare), setup["k1"][bare]
    of_alone = outputs(alone, few, k1)
    without = relative_uncertainties(
        identification(alone, few, k1, k1_std[bare], of_alone),
        identification(alone, few, k1, 0.0, of_alone),
        np.ones(k1.size, dtype=bool),
    )
    exact = identification(joint, phasors, setup["k1"], 0.0, values)
    return mass_gain(without, relative_uncertainties(result, exact, bare))


def _intervals(
    group: RigGroup, setup: Mapping[str, Any], draws: int, seed: int
) -> dict[int, tuple[Interval, Interval]]:
    """Intervals of K2 and C by Monte Carlo, for the rows where value ± 1.96 u is not a 95 % interval.

    The random numbers of a row depend on its test and point only, not on other tests or their order.
    """
    intervals, result = {}, group.result
    for row in np.flatnonzero(_skew(result)).tolist() if draws else ():
        test, point = group.keys[row]
        rng = np.random.default_rng([seed, *test.encode(), *((point,) if point > 1 else ())])
        if group.joint is not None or (group.route == "mobility" and group.k_of[row] == "springs"):
            stiffness = draw_around(complex(result.stiffness[row]), result.stiffness_covariance[row], draws, rng)
        else:
            added = {name: float(setup[name][row]) for name in ("added_mass", "added_mass_std")}
            channels, phasors = setup["channels"].part([row]), group.phasors.part(row)
            unstated = group.unstated.part(row)
            stiffness = draw_route(phasors, setup["rig"], group.route, channels, draws, rng, unstated=unstated, **added)
        k1 = result.k1[row] + np.nan_to_num(result.k1_std[row]) * rng.standard_normal(draws)
        intervals[row] = arm_intervals(stiffness, k1, float(2 * np.pi * result.frequency[row]))
    return intervals


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


def temperature_note(apart: FloatArray, conditions: ConditionsFile) -> list[str]:
    """The note that tests of one condition had different temperatures, if this adds to the uncertainty of K*."""
    most, per_kelvin = float(apart.max(initial=0.0)), conditions.per_kelvin
    if most < _NOTED:
        return []
    stated = "stated" if conditions.temperature_sensitivity is not None else "assumed"
    text = (
        f"[conditions] tests of one condition were up to {most / per_kelvin:.2g} K from its mean temperature. Their K* "
        f"counts as uncertain by {100 * per_kelvin:.3g} %/K ({stated}: temperature_sensitivity), here by up to "
        f"{100 * most:.2g} %, between these tests"
    )
    return [text]
