"""Faults of a laboratory: differences from its statement in the specimen, rig, sensors, tests or statement.

A fault changes how the tests of a campaign are run. Faults can be combined with each other and with any campaign:
``simulate_campaign(folder, faults=[scatter(0.001), FAULTS["V1 late, 0.5 ms"]])``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, exp, radians, sin
from typing import Any

import numpy as np

from fourpole.virtual.bench import Bench, Rocking
from fourpole.virtual.plan import Planned
from fourpole.virtual.runs import Run
from fourpole.virtual.tyres import VirtualTyre

_Change = Callable[[Run, np.random.Generator], Run]
_Apply = Callable[[Sequence[Run], np.random.Generator], list[Run]]

#: Relative change of stiffness and loss of a specimen per kelvin.
_PER_KELVIN = (-0.004, -0.006)
#: Lateral motion over V1 that a tilted sensor sees.
_LATERAL = 0.15
#: A plan with a second pressure or preload, for faults that confuse two of them.
_TWO_PRESSURES: Mapping[str, Any] = {"pressures": (135e3, 205e3), "repeats": 1}
_TWO_PRELOADS: Mapping[str, Any] = {"preloads": (1000.0, 2000.0), "repeats": 1}
#: Plans in which no data of the rig can show a fault.
_ONE, _EITHER = frozenset({"one mass"}), frozenset({"one mass", "weighed mass"})


@dataclass(frozen=True)
class Fault:
    """One difference between a laboratory and its statement.

    Parameters
    ----------
    name, size : str
        Name of the fault, and its size with the unit.
    part : str
        The part of the laboratory that has the fault: specimen, rig, sensors, tests, statement or static test.
    apply : callable (runs, rng)
        Returns the runs with the fault; `rng` draws what name and size do not determine.
    plan : mapping
        Arguments of `simulate_campaign` that the fault needs.
    unseen : set of str
        With "one mass" or "weighed mass" where no data of the rig can show the fault.

    Examples
    --------
    >>> FAULTS["moving mass, +1 kg"].part
    'rig'
    """

    name: str
    size: str
    part: str
    apply: _Apply
    plan: Mapping[str, Any] = field(default_factory=dict)
    unseen: frozenset[str] = frozenset()

    @property
    def title(self) -> str:
        """Name and size; its key in `FAULTS`."""
        return f"{self.name}, {self.size}" if self.size else self.name


def _each(change: _Change, kinds: Sequence[str] = ("dynamic",)) -> _Apply:
    """The fault that changes each test of some kinds."""
    return lambda runs, rng: [change(this, rng) if this.row.kind in kinds else this for this in runs]


def _one(change: _Change, fits: Callable[[Run], bool] = lambda _: True) -> _Apply:
    """The fault that changes one dynamic test without added mass, whose frequency is not the lowest or highest."""

    def apply(runs: Sequence[Run], rng: np.random.Generator) -> list[Run]:
        bad = _middle(runs, rng, fits)
        return [change(this, rng) if at == bad else this for at, this in enumerate(runs)]

    return apply


def _middle(runs: Sequence[Run], rng: np.random.Generator, fits: Callable[[Run], bool] = lambda _: True) -> int:
    """Number of a dynamic test in the middle of the frequencies, without added mass."""
    frequencies = [this.row.frequency for this in runs if this.row.kind == "dynamic"]
    inner = [
        at
        for at, this in enumerate(runs)
        if this.row.kind == "dynamic"
        and not this.row.added_mass
        and min(frequencies) < this.row.frequency < max(frequencies)
        and fits(this)
    ]
    if not inner:
        raise ValueError("the fault of one test needs a test between the lowest and the highest frequency")
    return int(rng.choice(inner))


# The specimen


def scatter(share: float) -> Fault:
    """K* differs by `share` [1] (standard deviation of real and imaginary part) between tests."""

    def change(this: Run, rng: np.random.Generator) -> Run:
        factor = this.specimen.repeat * (1.0 + share * complex(*rng.standard_normal(2)))
        return replace(this, specimen=replace(this.specimen, repeat=factor))

    return Fault("scatter of the specimen", f"{100 * share:g} %", "specimen", _each(change))


def drift(share: float) -> Fault:
    """K* and K1 change by `share` [1] from the first to the last test."""
    change = _tyre(lambda this: (1.0 + share * this.place, 1.0))
    return Fault("drift over the run", f"{100 * share:+g} %", "specimen", _each(change, ("static", "dynamic")))


def warming(kelvin: float) -> Fault:
    """The specimen becomes warmer over the run, first fast, then slowly, by `kelvin` in all."""
    change = _tyre(lambda this: _at_temperature(kelvin * (1.0 - exp(-3.0 * this.place)) / (1.0 - exp(-3.0))))
    return Fault("specimen warms up", f"{kelvin:+g} K", "specimen", _each(change))


def other_temperature(kelvin: float) -> Fault:
    """All dynamic tests are at another temperature than the static tests, which nobody wrote down."""
    change = _tyre(lambda _: _at_temperature(kelvin))
    return Fault("cold specimen", f"{kelvin:+g} K", "specimen", _each(change), unseen=_EITHER)


def softening(share: float) -> Fault:
    """K* falls with the amplitude: by half of `share` [1] at 1 mm."""
    change = _specimen(softening=share)
    return Fault("amplitude-dependent tyre", f"{100 * share:g} %", "specimen", _each(change))


def cubic(kappa: float) -> Fault:
    """The tyre has a further force of K1 `kappa` x^3; kappa in [1/m^2]."""
    return Fault("cubic tyre", f"{kappa * 1e-6:g}/mm²", "specimen", _each(_specimen(cubic=kappa)))


def _specimen(**values: Any) -> _Change:
    return lambda this, _: replace(this, specimen=replace(this.specimen, **values))


def _tyre(state: Callable[[Run], tuple[float, float]]) -> _Change:
    """The change to a tyre with other factors of stiffness and loss [1]."""

    def change(this: Run, _: np.random.Generator) -> Run:
        tyre = this.real.mounted
        if not isinstance(tyre, VirtualTyre):
            raise ValueError(
                f"{tyre.name} is a model; only the built-in kind of tyre can change with time or temperature"
            )
        return replace(this, real=replace(this.real, tyre=tyre.changed(*state(this))))

    return change


def _real(values: Callable[[Planned], Mapping[str, Any]], lies: bool = False) -> _Change:
    """The change to other true conditions; `lies` says that the row of the test claims the former ones."""
    return lambda this, _: replace(this, real=_with(this.real, values(this.real)), label_lies=lies or this.label_lies)


def _at_temperature(kelvin: float) -> tuple[float, float]:
    """Factors of stiffness and loss [1] of a tyre that is warmer by `kelvin`."""
    return 1.0 + _PER_KELVIN[0] * kelvin, 1.0 + _PER_KELVIN[1] * kelvin


# The rig


def rig(name: str, size: str, **values: Any) -> Fault:
    """Parts of the rig that differ from the statement by name of `Bench`; a callable takes the stated value."""

    def change(this: Run, _: np.random.Generator) -> Run:
        bench: Bench = this.bench
        new = {part: value(getattr(bench, part)) if callable(value) else value for part, value in values.items()}
        return replace(this, bench=replace(bench, **new))

    return Fault(name, size, "rig", _each(change, ("dynamic", "calibration")))


# The sensors


def channel(name: str, size: str, *channels: str, unseen: frozenset[str] = frozenset(), **flaw: Any) -> Fault:
    """The same `Flaw` of some channels in all dynamic tests."""
    return Fault(name, size, "sensors", _each(_flawed(channels, **flaw)), unseen=unseen)


def tilted(channel: str, degrees: float) -> Fault:
    """A sensor that measures in another direction: less of its own motion, and some of the lateral one."""
    angle = radians(degrees)
    flaw = {"scale": cos(angle), "crosstalk": (("V1", sin(angle) * _LATERAL / cos(angle)),)}
    unseen = _ONE if channel == "V1" else frozenset()
    return Fault(f"{channel} tilted", f"{degrees:g} deg", "sensors", _each(_flawed([channel], **flaw)), unseen=unseen)


def gain_drift(channel: str, share: float) -> Fault:
    """A gain that changes by `share` [1] from the first to the last test."""
    apply = _each(lambda this, _: this.flawed(channel, scale=1.0 + share * this.place))
    return Fault(f"gain of {channel} drifts", f"{100 * share:+g} %", "sensors", apply)


def jitter(channel: str, seconds: float) -> Fault:
    """A delay that differs from test to test; `seconds` is its standard deviation."""
    apply = _each(lambda this, rng: this.flawed(channel, delay=seconds * float(rng.standard_normal())))
    return Fault(f"trigger of {channel} jitters", f"{1e3 * seconds:g} ms", "sensors", apply)


def _flawed(channels: Sequence[str], **flaw: Any) -> _Change:
    def change(this: Run, _: np.random.Generator) -> Run:
        for each in channels:
            this = this.flawed(each, **flaw)
        return this

    return change


# Single tests, and their labels


def one_test(name: str, size: str, channel: str, **flaw: Any) -> Fault:
    """A `Flaw` of a channel in one test only."""
    return Fault(f"one test: {name}", size, "tests", _one(_flawed([channel], **flaw)))


def mass_left_on(kilograms: float) -> Fault:
    """One test has a mass on it that its row does not have."""
    apply = _one(_real(lambda this: {"added_mass": this.added_mass + kilograms}))
    return Fault("one test: mass left on", f"{kilograms:g} kg", "tests", apply)


def mislabelled(column: str, size: str, value: float, plan: Mapping[str, Any]) -> Fault:
    """The row of one test has another value of a column than the test had."""
    apply = _one(
        lambda this, _: replace(this, row=_with(this.row, {column: value}), label_lies=True),
        lambda this: bool(getattr(this.row, column) != value),
    )
    return Fault(f"one test: wrong {column} in its row", size, "tests", apply, plan=plan)


def swapped(column: str, plan: Mapping[str, Any], size: str = "") -> Fault:
    """The labels of two tests of the same frequency, which differ in a column, are exchanged."""

    def apply(runs: Sequence[Run], rng: np.random.Generator) -> list[Run]:
        return _exchanged(runs, *_pair(runs, rng, column))

    return Fault(f"two tests: labels of {column.replace('_', ' ')} swapped", size, "tests", apply, plan=plan)


def _exchanged(runs: Sequence[Run], one: int, other: int) -> list[Run]:
    """The runs with the labels of two of them exchanged."""
    changed = list(runs)
    for at, source in ((one, other), (other, one)):
        changed[at] = replace(runs[source], row=runs[at].row, label_lies=True)
    return changed


def duplicated(column: str, size: str, plan: Mapping[str, Any]) -> Fault:
    """The recording of one test is filed for a second one, which differs in a column."""

    def apply(runs: Sequence[Run], rng: np.random.Generator) -> list[Run]:
        one, other = _pair(runs, rng, column)
        changed = list(runs)
        lies = column != "name"
        changed[other] = replace(runs[one], row=runs[other].row, copy_of=runs[one].row.name, label_lies=lies)
        return changed

    return Fault("two tests: the same recording", size, "tests", apply, plan=plan)


def _pair(runs: Sequence[Run], rng: np.random.Generator, column: str) -> tuple[int, int]:
    """Numbers of two dynamic tests of one frequency that differ in a column, and in no other one but their name."""
    same = {"name": "", column: "" if column == "name" else 0.0}

    def partners(this: Run) -> list[int]:
        return [
            at
            for at, that in enumerate(runs)
            if getattr(that.row, column) != getattr(this.row, column) and _with(that.row, same) == _with(this.row, same)
        ]

    one = _middle(runs, rng, lambda this: bool(partners(this)))
    return one, partners(runs[one])[0]


def _with(test: Planned, values: Mapping[str, Any]) -> Planned:
    """The test with other values in some columns."""
    return replace(test, **values)


# The statement


def of_all(name: str, size: str, unseen: frozenset[str] = frozenset(), **factors: float) -> Fault:
    """A condition of all tests is the stated one times a factor."""
    change = _real(lambda this: {column: factor * getattr(this, column) for column, factor in factors.items()}, True)
    return Fault(name, size, "statement", _each(change, ("static", "dynamic")), unseen=unseen)


def wrong_unit(name: str, size: str, channel: str, factor: float) -> Fault:
    """A channel is recorded in another unit, or with another sign, than campaign.toml says."""
    return Fault(name, size, "statement", _each(_flawed([channel], scale=factor)))


def added_mass(share: float, unseen: frozenset[str] = frozenset()) -> Fault:
    """The added mass is the stated one times 1 + `share`."""
    apply = _each(_real(lambda this: {"added_mass": (1.0 + share) * this.added_mass}))
    return Fault("added mass", f"{100 * share:+g} %", "statement", apply, {"added_masses": (0.0, 10.0)}, unseen)


# The static test


def static(name: str, size: str, change: _Change, unseen: frozenset[str] = _EITHER, **plan: Any) -> Fault:
    """A change of all static tests."""
    return Fault(f"static test: {name}", size, "static test", _each(change, ("static",)), plan, unseen)


def static_swapped() -> Fault:
    """The labels of the first two static tests are exchanged."""

    def apply(runs: Sequence[Run], _: np.random.Generator) -> list[Run]:
        return _exchanged(runs, *[at for at, this in enumerate(runs) if this.row.kind == "static"][:2])

    return Fault("static test: labels of two swapped", "", "static test", apply, plan=_TWO_PRESSURES)


def _list() -> list[Fault]:
    """The faults of docs/faults.md, in its order."""
    return [
        # The specimen
        scatter(0.01),
        drift(0.01),
        drift(0.05),
        warming(15.0),
        other_temperature(-15.0),
        softening(0.2),
        cubic(1e4),
        # The rig
        rig("moving mass", "+1 kg", mass=lambda m: m + 1.0),
        rig("preload spring", "-25 %", preload_stiffness=lambda k: 0.75 * k),
        rig("preload damping", "+200 N s/m", preload_damping=lambda c: c + 200.0),
        rig("loss factor of the preload spring", "0.2", preload_loss_factor=0.2),
        rig("tyre mass", "2 kg", tyre_mass=2.0),
        rig("mass between force cell and tyre", "0.8 kg", input_mass=0.8),
        rig("compliant frame", "60 kN/m", frame_stiffness=60e3),
        rig("rocking mass", "35 Hz", rocking=Rocking(frequency=35.0)),
        rig("guide friction", "4 N", leaf_friction=4.0),
        rig("guide friction", "15 N", leaf_friction=15.0),
        # The sensors
        channel("gain of F1", "+1.5 %", "F1", scale=1.015, unseen=_ONE),
        channel("gain of F1", "+6 %", "F1", scale=1.06),
        channel("gain of V2", "+1.5 %", "V2", scale=1.015, unseen=_ONE),
        channel("gain of V2", "+6 %", "V2", scale=1.06),
        channel("gain of V1", "+6 %", "V1", scale=1.06, unseen=_ONE),
        *(channel(f"{name} late", "0.5 ms", name, delay=0.5e-3) for name in ("F1", "V2")),
        channel("V1 late", "0.5 ms", "V1", delay=0.5e-3, unseen=_ONE),
        tilted("V1", 15.0),
        tilted("V2", 15.0),
        channel("cross-talk from V2 into F1", "2 %", "F1", crosstalk=(("V2", 0.02 * 1500.0),)),
        channel("cross-talk from V1 into V2", "2 %", "V2", crosstalk=(("V1", 0.02),)),
        channel("hysteretic force cell", "3 %", "F1", hysteresis=0.03),
        channel("clock of V2", "300 ppm", "V2", clock=3e-4),
        channel("clock of V1", "300 ppm", "V1", clock=3e-4),
        channel("tone that aliases to 17.3 Hz in F1", "60 N", "F1", tone=60.0),
        channel("hum on V1 and V2", "20 mm/s", "V1", "V2", hum=0.02),
        channel("noise of F1", "30 N", "F1", noise=30.0),
        channel("drop-outs of V2", "4 %", "V2", dropouts=0.04),
        channel("drop-outs of F1", "4 %", "F1", dropouts=0.04),
        channel("spikes in F1", "5/s of 500 N", "F1", spikes=5.0, spike=500.0),
        channel("soft clipping of V2", "at 0.25 m/s", "V2", limit=0.25),
        channel("soft clipping of F1", "at 500 N", "F1", limit=500.0),
        gain_drift("F1", 0.04),
        jitter("V2", 0.3e-3),
        # Single tests, and their labels
        one_test("gain of V1", "+20 %", "V1", scale=1.2),
        one_test("loose V2", "+30 % at half time", "V2", loose=0.3),
        one_test("drop-outs of V2", "5 %", "V2", dropouts=0.05),
        mass_left_on(5.0),
        mislabelled("pressure", "2.05 for 1.35 bar", 205e3, _TWO_PRESSURES),
        mislabelled("preload", "2000 for 1000 N", 2000.0, _TWO_PRELOADS),
        swapped("pressure", _TWO_PRESSURES),
        swapped("preload", _TWO_PRELOADS),
        swapped("added_mass", {"added_masses": (0.0, 10.0)}),
        duplicated("name", "of a repeat", {"repeats": 2}),
        duplicated("preload", "of another preload", _TWO_PRELOADS),
        # The statement
        wrong_unit("F1 in kgf", "stated in N", "F1", 1.0 / 9.80665),
        wrong_unit("V2 with the other sign", "", "V2", -1.0),
        of_all("pressure of all tests", "-15 %", _EITHER, pressure=0.85),
        of_all("preload of all tests", "+20 %", _EITHER, preload=1.2),
        added_mass(-0.01, _EITHER),  # sensors known to 0.5 % do not show 1 %
        added_mass(-0.05),
        # The static test
        static("gain of the load", "+3 %", _flawed(["F"], scale=1.03)),
        static("zero of the load", "+150 N", _flawed(["F"], offset=150.0), frozenset()),
        static("frame in the deflection", "0.5 mm/kN", _flawed(["x"], crosstalk=(("F", 0.5e-6),))),
        static("creep", "15 % in 40 s", _specimen(creep=0.15)),
        static("colder", "-15 K", _tyre(lambda _: _at_temperature(-15.0))),
        static_swapped(),
    ]


#: The faults of docs/faults.md by name and size.
FAULTS: Mapping[str, Fault] = {fault.title: fault for fault in _list()}
