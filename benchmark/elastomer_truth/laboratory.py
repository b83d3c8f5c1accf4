"""What a laboratory is: specimens, rig, sensors, logger and tests, as they are and as the statement says."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from elastomer_truth.mechanics import Array, ComplexArray, Link, Network

#: Relative change of stiffness and of loss of a specimen per kelvin.
PER_KELVIN = (-0.004, -0.006)
REFERENCE_TEMPERATURE = 23.0
#: Deflection at which the friction of a guide is reached [m].
PRESLIDING = 1e-4
#: Number of equal springs in series of each kind of specimen that is a chain.
CHAINS = {"belt": 2, "two masses": 3, "mount": 6}


@dataclass
class Value:
    """A value as it is, as stated, and the standard uncertainty of the statement; not stated if that is None."""

    true: float
    stated: float | None = None
    u: float = 0.0


@dataclass
class Specimen:
    """A specimen.

    Attributes
    ----------
    name, kind : str
        Kinds: massless, belt, two masses, mount, hydromount, Payne.
    stiffness, bend : float [N/m], [N/m^2]
        Static law F = stiffness x + bend x^2.
    arms : list of (float [1], float [s])
        Maxwell arms over the static tangent, and their relaxation times.
    mass : Value [kg]
        Mass between the ends.
    share : float
        Of a belt: stiffness at the contact over that at the rim.
    track : (float [1], float [Hz], float [1])
        Of a hydromount: chamber over tangent, frequency of the fluid on the chamber, damping ratio.
    slip : list of (float [1], float [m])
        Of Payne: stiffness over tangent, largest deflection.
    scatter, drift, heating : Value [1], [1], [K]
        Scatter of log K* between tests; change of log |K*| over the run; rise of temperature over the run.
    """

    name: str
    kind: str
    stiffness: float
    bend: float
    arms: list[tuple[float, float]]
    mass: Value
    share: float = 2.0
    track: tuple[float, float, float] | None = None
    slip: list[tuple[float, float]] = field(default_factory=list)
    scatter: Value = field(default_factory=lambda: Value(0.0))
    drift: Value = field(default_factory=lambda: Value(0.0))
    heating: float = 0.0

    def tangent(self, preload: float) -> float:
        """Static tangent stiffness at a load [N/m]."""
        return math.sqrt(self.stiffness**2 + 4 * self.bend * preload)

    def links(self, preload: float, stiffer: float, lossier: float, far: str) -> tuple[dict[str, float], list[Link]]:
        """Masses by node and links from the contact to the node behind it; factors of stiffness and loss."""
        k = self.tangent(preload) * stiffer
        arms = tuple((g * k * lossier, time) for g, time in self.arms)
        if self.kind not in CHAINS:
            slip = tuple((g * k * lossier, largest) for g, largest in self.slip)
            track = None
            if self.track is not None:
                over, hertz, ratio = self.track
                omega = 2 * math.pi * hertz
                track = (over * k, over * k / omega**2, 2 * ratio * over * k / omega)
            return {}, [Link("contact", far, k, arms=arms, track=track, slip=slip)]
        count = CHAINS[self.kind]
        nodes = ["contact", *(f"specimen {at}" for at in range(1, count)), far]
        weights = [1 + self.share, (1 + self.share) / self.share] if self.kind == "belt" else [count] * count
        weights = [weights[0], weights[1]] if self.kind == "belt" else weights
        links = [
            Link(a, b, n * k, arms=tuple((n * g, time) for g, time in arms))
            for a, b, n in zip(nodes[:-1], nodes[1:], weights, strict=True)
        ]
        masses = dict.fromkeys(nodes[1:-1], self.mass.true / (count - 1))
        if self.kind == "mount":
            # Masses with the inertia of one that is spread evenly, between the ends and at each, to first order in w^2.
            masses = {node: mass * count / (count + 1) for node, mass in masses.items()}
            masses |= {"contact": self.mass.true / (2 * count + 2), far: self.mass.true / (2 * count + 2)}
        return masses, links


@dataclass
class Sensor:
    """One channel; all of `true` is unknown to those who read the statement.

    Attributes
    ----------
    column, role, quantity, unit : str
        Role: F1, V1, V2, load or deflection. Quantity: force, displacement, velocity or acceleration.
    scale : float
        Units of the recording per SI unit.
    gain, phase, delay, low_cut, slope : Value
        Recorded over true [1], [rad], [s], corner of a first-order high-pass [Hz], rise of the gain at 100 Hz [1].
    mounting : Value
        Standard deviation of the part of the gain that is another in each mounting [1].
    low_pass : float, optional [Hz]
        Corner of a Butterworth filter of second order, as stated.
    noise, full_scale : float [SI]
    """

    column: str
    role: str
    quantity: str
    unit: str
    scale: float
    gain: Value
    phase: Value
    delay: Value
    low_cut: Value
    slope: Value
    mounting: Value
    linearity: Value = field(default_factory=lambda: Value(0.0))
    low_pass: float | None = None
    noise: float = 0.0
    full_scale: float = 1.0
    #: Faults of the channel: cross-talk by role, soft limit, hum, tone, drop-outs, drift, sign, unit ...
    flaws: dict[str, object] = field(default_factory=dict)

    def response(self, frequency: Array, skew: float = 0.0) -> ComplexArray:
        """Recorded over true motion or force (N,), derivatives of the motion included; 0 at 0 Hz for a motion."""
        f = np.asarray(frequency, dtype=float)
        s = 2j * np.pi * f
        power = {"force": 0, "displacement": 0, "velocity": 1, "acceleration": 2}[self.quantity]
        value = self.gain.true * s**power * (1 + self.slope.true * (f / 100.0) ** 2)
        value = value * np.exp(1j * self.phase.true * (f > 0) - s * (self.delay.true + skew))
        if self.low_cut.true > 0:
            value = value * (1j * f / (1j * f + self.low_cut.true))
        if self.low_pass is not None:
            r = 1j * f / self.low_pass
            value = value / (1 + math.sqrt(2) * r + r * r)
        return value


@dataclass
class Test:
    """One test: what its row says, and in `true` where it differed; `factors` are those of stiffness and loss."""

    name: str
    kind: str
    specimen: str
    preload: float
    frequency: float = 0.0
    band: tuple[float, float] | None = None
    added_mass: float = 0.0
    amplitude: float = 0.0
    duration: float = 4.0
    start: float = 0.0
    place: float = 0.0
    true: dict[str, float] = field(default_factory=dict)
    factors: tuple[float, float] = (1.0, 1.0)
    flaws: dict[str, dict[str, object]] = field(default_factory=dict)
    file_of: str = ""
    phase: float = 0.0

    @property
    def preload_true(self) -> float:
        return self.true.get("preload", self.preload)


@dataclass
class Laboratory:
    """A campaign: all that makes its recordings, and its statement."""

    name: str
    seed: int
    tier: str
    rig: str
    values: dict[str, Value]
    sensors: dict[str, Sensor]
    specimens: dict[str, Specimen]
    tests: list[Test]
    added_mass: Value
    rate: int
    simultaneous: bool
    skew: dict[str, float]
    skew_limit: float | None
    bits: int | None
    noise: float = 1.0
    faults: list[Fault] = field(default_factory=list)

    @property
    def blocked(self) -> bool:
        return self.rig.startswith("blocked")

    def true(self, name: str) -> float:
        """A value of the rig as it is; 0 for a part that is not there."""
        return self.values[name].true if name in self.values else 0.0

    def network(self, test: Test) -> Network:
        """The mechanics of a dynamic test."""
        specimen, far = self.specimens[test.specimen], "wheel"
        rigid = self.blocked and not self.true("frame stiffness")
        if rigid:
            far = "ground"
        masses, links = specimen.links(test.preload_true, *test.factors, far)
        masses["contact"] = masses.get("contact", 0.0) + self.true("input mass")
        links = list(links)
        if rigid:
            masses.pop("ground", None)
            return Network(masses, tuple(links), self.true("base motion"), "ground")
        own = self.true("moving mass")
        if test.added_mass:
            own += test.added_mass * self.added_mass.true / (self.added_mass.stated or 1.0)
        masses["wheel"] = masses.get("wheel", 0.0) + own + test.true.get("mass left on", 0.0)
        below = "ground"
        if self.blocked:
            masses["wheel"] = masses["wheel"] - own + self.true("frame mass")
            links.append(Link("wheel", "ground", self.true("frame stiffness"), self.true("frame damping")))
            return Network(masses, tuple(links), self.true("base motion"), "wheel")
        if self.true("frame stiffness"):
            below = "frame"
            masses["frame"] = self.true("frame mass")
            links.append(Link("frame", "ground", self.true("frame stiffness"), self.true("frame damping")))
        friction = self.true("guide friction")
        slip = ((friction / PRESLIDING, PRESLIDING),) if friction else ()
        links.append(Link("wheel", below, self.true("preload spring"), self.true("preload damping"), slip=slip))
        if self.true("cable stiffness"):
            links.append(Link("wheel", "ground", self.true("cable stiffness"), self.true("cable damping")))
        return Network(masses, tuple(links), self.true("base motion"), "wheel")

    def response(self, test: Test, role: str, frequency: Array) -> ComplexArray:
        """Recorded over true of a channel in a test, its flaws that are linear included."""
        sensor = self.sensors[role]
        value = sensor.response(frequency, self.skew.get(role, 0.0))
        flaws = {**sensor.flaws, **test.flaws.get(role, {})}
        factor = float(flaws.get("factor", 1.0)) * (1 + float(flaws.get("drift", 0.0)) * test.place)
        return value * factor * np.exp(-2j * np.pi * np.asarray(frequency) * float(flaws.get("jitter", 0.0)))


@dataclass
class Fault:
    """A fault that the files do not mention."""

    name: str
    cause: str
    part: str
    size: float
    linear: bool = True
