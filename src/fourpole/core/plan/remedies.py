"""Remedies for an uncertainty that is too large: each with its change of a plan and its cost."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.components import SpecimenUncertainty
from fourpole.core.identify import Identification
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.plan.expect import PlannedTests, expect, possible_routes
from fourpole.core.rig import Rig

#: Added masses that are compared by default [kg].
MASSES = (2.0, 5.0, 10.0, 20.0)
_MORE_CYCLES = (4.0, 16.0)
_REPEATS = 3
#: Standard uncertainties of gain [1] and phase [rad] after a calibration, in the order of `Effort.sensor`.
_SENSORS = tuple((gain, np.radians(phase)) for gain, phase in ((0.005, 0.25), (0.002, 0.1), (0.001, 0.05)))
#: Relative standard uncertainties of the rig's values after a measurement [1], in the order of `Effort.rig`.
_RIG = (0.005, 0.001)
#: Relative standard uncertainties of K1 with a better static rig [1], in the order of `Effort.k1`.
_K1 = (0.01, 0.005, 0.002, 0.001)


@dataclass(frozen=True)
class Effort:
    """Costs in minutes of one person at the rig; the defaults are rough estimates.

    Attributes
    ----------
    settle : float [min]
        Time to set the frequency of a test and reach a steady state; the recorded cycles are extra.
    mount, mount_per_kg : float [min], [min/kg]
        Time to fix a mass, reset the preload and undo both, in each condition of the tyre.
    sensor : 3 floats [min]
        Time to calibrate one channel to 0.5 %, 0.2 %, 0.1 % and 0.25, 0.1, 0.05 degrees.
    rig : 2 floats [min]
        Time to weigh the moving mass and measure the preload spring to 0.5 %, 0.1 %.
    k1 : 4 floats [min]
        Time to improve the static rig to 1 %, 0.5 %, 0.2 %, 0.1 % in K1.
    static : float [min]
        Time for one static test with its conditioning.
    """

    settle: float = 0.5
    mount: float = 10.0
    mount_per_kg: float = 0.2
    sensor: tuple[float, ...] = (30.0, 60.0, 120.0)
    rig: tuple[float, ...] = (60.0, 180.0)
    k1: tuple[float, ...] = (30.0, 60.0, 120.0, 240.0)
    static: float = 15.0


@dataclass(frozen=True)
class Plan:
    """Planned tests of a rig, with everything that determines the expected uncertainty.

    Attributes
    ----------
    tests : PlannedTests
    rig : Rig
        The rig as stated, with its uncertainties.
    channels : ChannelUncertainty
        Uncertainties of the channels F1, V1, V2.
    specimens : SpecimenUncertainty
        Uncertainties of the specimens over blocks and time.
    cycles : float [1]
        Recorded cycles of each test, to which `tests.noise` refers.
    statics : int
        Number of static tests, one for each tyre and pressure.
    mass_std : float [1]
        Relative standard uncertainty of a mass that is weighed.
    """

    tests: PlannedTests
    rig: Rig
    channels: ChannelUncertainty = field(default_factory=ChannelUncertainty)
    specimens: SpecimenUncertainty = field(default_factory=SpecimenUncertainty)
    cycles: float = 40.0
    statics: int = 1
    mass_std: float = 1e-4

    @property
    def routes(self) -> tuple[str, ...]:
        """Routes that are possible with the rig and the channels."""
        return possible_routes(self.rig, self.tests.present)

    @property
    def best_route(self) -> str:
        """The route with the smallest uncertainty: the joint route if it is possible."""
        return self.routes[-1]

    def expect(self, route: str) -> Identification:
        """The expected result by a route; see `fourpole.core.plan.expect`."""
        return expect(self.tests, self.rig, route, channels=self.channels, specimens=self.specimens)

    def minutes(self, tests: PlannedTests, effort: Effort) -> float:
        """Time to run some tests [min]."""
        return float(np.sum(effort.settle + self.cycles / tests.frequency / 60.0))

    def with_mass(self, mass: float, which: np.ndarray | None = None) -> Plan:
        """The plan with repeats of some tests with an added mass; by default of all tests without one."""
        rows = self.tests.bare if which is None else which
        return replace(self, tests=self.tests.with_mass(mass, self.mass_std * mass, rows))


@dataclass(frozen=True)
class Remedy:
    """One possible change of a plan.

    Attributes
    ----------
    kind : {"cycles", "repeats", "sensors", "rig", "K1", "mass", "frequencies"}
    text : str
        Description.
    minutes : float [min]
        Cost.
    change : callable (Plan) -> Plan
        Function that makes the change; tests that it adds come after the others.
    k1 : float [1]
        Relative standard uncertainty of K1 afterwards, for a remedy of kind K1.
    """

    kind: str
    text: str
    minutes: float
    change: Callable[[Plan], Plan]
    k1: float = np.inf


def remedies(plan: Plan, effort: Effort, masses: Sequence[float] = MASSES) -> dict[str, list[Remedy]]:
    """Remedies for the dynamic tests in groups, of which a combination takes at most one remedy each.

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> plan = Plan(PlannedTests([10.0, 12.0], 180e3, 120e3, 700.0), rig)
    >>> [remedy.text for remedy in remedies(plan, Effort(), masses=[10.0])["more tests"]]
    ['10 kg added at 10 Hz', '10 kg added at 12 Hz', '10 kg added at all 2 frequencies', 'tests halfway between the \
frequencies as well']
    """
    more = [*_masses(plan, effort, masses), *_halfway(plan, effort)]
    return {
        "noise": list(_longer(plan, effort)),
        "sensors": list(_sensors(plan, effort)),
        "rig": list(_better_rig(plan, effort)),
        "more tests": more,
    }


def _longer(plan: Plan, effort: Effort) -> Iterator[Remedy]:
    """More cycles in each test, or repeats of all tests."""
    if not np.any(plan.tests.noise > 0):
        return
    turning = plan.cycles * float(np.sum(1.0 / plan.tests.frequency)) / 60.0
    for factor in _MORE_CYCLES:
        text = f"{factor * plan.cycles:g} cycles in place of {plan.cycles:g}"
        yield Remedy("cycles", text, (factor - 1) * turning, partial(_quieter, factor, factor * plan.cycles))
    whole = plan.minutes(plan.tests, effort)
    yield Remedy(
        "repeats", f"each test {_REPEATS} times", (_REPEATS - 1) * whole, partial(_quieter, _REPEATS, plan.cycles)
    )


def _quieter(factor: float, cycles: float, plan: Plan) -> Plan:
    """The plan with white noise reduced by the root of a factor, from more cycles or more tests of a condition."""
    return replace(plan, tests=replace(plan.tests, noise=plan.tests.noise / np.sqrt(factor)), cycles=cycles)


def _sensors(plan: Plan, effort: Effort) -> Iterator[Remedy]:
    """Calibrations of single channels, and of all channels that are worse than the calibration."""
    present, known = plan.tests.present, plan.channels
    recorded = [channel for channel in range(3) if present[channel] and not (plan.rig.blocked and channel == 2)]
    for (gain, phase), minutes in zip(_SENSORS, effort.sensor, strict=True):
        worse = [channel for channel in recorded if known.gain[channel] > gain or known.phase[channel] > phase]
        for which in [*([channel] for channel in worse), *([worse] if len(worse) > 1 else [])]:
            names = " and ".join(SYMBOLS[CHANNELS[channel]] for channel in which) if len(which) < 3 else "F1, V1 and V2"
            text = f"{names} calibrated to {100 * gain:g} % and {np.degrees(phase):g}°"
            yield Remedy("sensors", text, minutes * len(which), partial(_calibrated, which, gain, phase))


def _calibrated(which: list[int], gain: float, phase: float, plan: Plan) -> Plan:
    """The plan with at most these uncertainties of gain and phase of some channels, at all its frequencies."""
    low, high = float(plan.tests.frequency.min()), float(plan.tests.frequency.max())
    most = {"gain": gain, "phase": phase, "delay": phase / (2 * np.pi * high), "low_cut": phase * low,
            "slope": gain / high**2}  # fmt: skip
    known = {name: getattr(plan.channels, name).copy() for name in most}
    for name, std in known.items():
        std[which] = np.minimum(std[which], most[name])
    return replace(plan, channels=replace(plan.channels, **known))


def _better_rig(plan: Plan, effort: Effort) -> Iterator[Remedy]:
    """Measurements of the rig's values."""
    if plan.rig.blocked:
        return
    for level, minutes in zip(_RIG, effort.rig, strict=True):
        if any(std > level * abs(getattr(plan.rig, name)) for name, std in plan.rig.std.items()):
            yield Remedy("rig", f"the rig's values measured to {100 * level:g} %", minutes, partial(_measured, level))


def _measured(level: float, plan: Plan) -> Plan:
    """The plan with at most this relative uncertainty of the rig's values."""
    whole = {"preload_damping": plan.rig.critical_damping}
    std = {name: min(std, level * (abs(getattr(plan.rig, name)) or whole.get(name, 0.0)))
           for name, std in plan.rig.std.items()}  # fmt: skip
    return replace(plan, rig=replace(plan.rig, std=std))


def _masses(plan: Plan, effort: Effort, masses: Sequence[float]) -> Iterator[Remedy]:
    """A weighed mass at one, three or all frequencies of one condition of the tyre, or in every condition."""
    tests = plan.tests
    free = tests.bare
    if "joint" not in plan.routes or not free.size:
        return
    families, counts = np.unique(tests.family[free], return_counts=True)
    fullest = free[tests.family[free] == families[np.argmax(counts)]]
    first = _distinct(fullest, tests.frequency)
    rows = _distinct(free, tests.frequency, tests.family)
    each = _of_each_mounting(tests, free)
    where = " of one condition" if families.size > 1 else ""
    middle = len(first) // 2
    for mass in masses:
        chosen: dict[tuple[int, ...], str] = {
            (row,): f"at {tests.frequency[row]:.4g} Hz{where}" for row in (first[0], first[middle], first[-1])
        }
        if len(first) > 3:
            chosen[first[0], first[middle], first[-1]] = f"at 3 of {len(first)} frequencies{where}"
        if len(first) > 1:
            chosen[tuple(first)] = f"at all {len(first)} frequencies{where}"
        if len(each) > len(first):
            chosen[tuple(each)] = "at all frequencies of one condition of each mounting of V1"
        if families.size > 1:
            chosen[tuple(rows)] = f"at all frequencies of all {families.size} conditions"
        for which, words in chosen.items():
            mounted = np.unique(tests.family[list(which)]).size
            minutes = mounted * (effort.mount + effort.mount_per_kg * mass)
            minutes += plan.minutes(tests.part(list(which)), effort)
            heavier = partial(Plan.with_mass, mass=mass, which=np.array(which))
            yield Remedy("mass", f"{mass:g} kg added {words}", minutes, heavier)


def _of_each_mounting(tests: PlannedTests, free: np.ndarray) -> list[int]:
    """The tests at all frequencies of the first condition of each mounting of V1's sensor."""
    rows: list[int] = []
    for mounting in np.unique(tests.mounting[free]):
        own = free[tests.mounting[free] == mounting]
        rows += _distinct(own[tests.family[own] == tests.family[own[0]]], tests.frequency)
    return rows


def _distinct(rows: np.ndarray, *keys: np.ndarray) -> list[int]:
    """The first row of each set of rows with equal keys, in the order of the keys; the first key counts most."""
    _, first = np.unique(np.stack([key[rows] for key in keys]), axis=1, return_index=True)
    return [int(row) for row in rows[first]]


def _halfway(plan: Plan, effort: Effort) -> Iterator[Remedy]:
    """Further tests at frequencies halfway between those planned."""
    tests = plan.tests
    free = tests.bare
    new: list[PlannedTests] = []
    for family in np.unique(tests.family[free]) if "joint" in plan.routes else []:
        rows = _distinct(free[tests.family[free] == family], tests.frequency)
        f = tests.frequency[rows]
        if f.size > 1:
            between = (f[1:] + f[:-1]) / 2
            guess: dict[str, Any] = {
                name: np.interp(between, f, getattr(tests, name)[rows]) for name in ("k1", "k2", "c", "noise")
            }
            new.append(replace(tests.part(rows[:-1]), frequency=between, **guess))
    if new:
        added = new[0].followed_by(*new[1:])
        text = "tests halfway between the frequencies as well"
        yield Remedy("frequencies", text, plan.minutes(added, effort), partial(_further, added))


def _further(added: PlannedTests, plan: Plan) -> Plan:
    """The plan with added tests."""
    return replace(plan, tests=plan.tests.followed_by(added))


def k1_remedies(plan: Plan, effort: Effort) -> list[Remedy]:
    """Remedies of better static tests; their effect on K2 and C does not depend on the dynamic tests."""
    relative: FloatArray = np.where(plan.tests.rigid, 0.0, plan.tests.k1_std / plan.tests.k1)
    listed = []
    for level, minutes in zip(_K1, effort.k1, strict=True):
        if np.any(relative > level):
            cost = minutes + effort.static * plan.statics
            listed.append(Remedy("K1", f"K1 known to {100 * level:g} %", cost, lambda plan: plan, k1=level))
    return listed
