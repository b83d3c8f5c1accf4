"""The true conditions of each test of a campaign, besides its row in tests.csv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.models.interface import StateSpace
from fourpole.virtual.bench import Bench, Element, Zener, equations, far_end
from fourpole.virtual.plan import Planned
from fourpole.virtual.sensors import Flaw
from fourpole.virtual.truth import Truth

#: Iterations for the amplitude of an amplitude-dependent tyre, each of which gains more than one digit.
_ITERATIONS = 30


@dataclass(frozen=True)
class Specimen:
    r"""Properties of a specimen besides the law of its tyre: repeatability, dependence on amplitude and on time.

    Parameters
    ----------
    repeat : complex [1]
        Factor of K* in this test; its imaginary part is a change of the loss, taken at the frequency of the test.
    softening, amplitude : float [1], [m]
        s and a of a K* that falls with the amplitude x of the deflection: :math:`K^* (1 - s\,x/(x + a))`.
    cubic : float [1/m^2]
        kappa of the force :math:`K_1 \kappa x^3`.
    creep, creep_time : float [1], [s]
        Fraction of the load that relaxes, and its relaxation time; slow load cycles then have a lower stiffness.
    """

    repeat: complex = 1.0
    softening: float = 0.0
    amplitude: float = 1e-3
    cubic: float = 0.0
    creep: float = 0.0
    creep_time: float = 40.0


@dataclass(frozen=True)
class Run:
    """One test: its row in tests.csv, and its true conditions.

    Parameters
    ----------
    row : Planned
        The test as tests.csv states it.
    real : Planned
        The conditions under which the recording was made; its name has no effect.
    bench : Bench
        The true rig, without the added mass.
    place : float [1]
        Place in the campaign: 0 for the first test, 1 for the last.
    specimen : Specimen
    flaws : mapping of channel to Flaw
        Channels with faults.
    label_lies : bool
        Whether `row` names other conditions than those of the recording; the truth is then that of `row`.
    copy_of : str
        Name of another test whose recording is also filed for this one.
    """

    row: Planned
    real: Planned
    bench: Bench
    place: float = 0.0
    specimen: Specimen = Specimen()
    flaws: Mapping[str, Flaw] = field(default_factory=dict)
    label_lies: bool = False
    copy_of: str = ""

    @property
    def loaded_bench(self) -> Bench:
        """The rig with the added mass of the test."""
        return replace(self.bench, mass=self.bench.mass + self.real.added_mass)

    def flawed(self, channel: str, **values: Any) -> Run:
        """The same run, with further faults of a channel; factors and delays add to those that it has."""
        had = self.flaws.get(channel, Flaw())
        if "scale" in values:
            values["scale"] *= had.scale
        if "delay" in values:
            values["delay"] += had.delay
        if "crosstalk" in values:
            values["crosstalk"] = (*had.crosstalk, *values["crosstalk"])
        return replace(self, flaws={**self.flaws, channel: replace(had, **values)})

    def as_labelled(self) -> Run:
        """The run whose true values the row claims to have."""
        return replace(self, real=self.row) if self.label_lies else self


def runs_of(tests: Sequence[Planned], truth: Truth) -> list[Run]:
    """The tests of an honest campaign, in their order."""
    last = max(1, len(tests) - 1)
    return [Run(test, test, truth.bench, place=at / last) for at, test in enumerate(tests)]


def tyre_of(this: Run, frequency: float) -> Zener | StateSpace:
    """The springs of a dynamic test at the true `frequency` of the cam [Hz], at the amplitude of the test."""
    real = this.real
    mounted = real.mounted.element(frequency, real.pressure, real.preload)
    tyre = _repeated(mounted, this.specimen.repeat, frequency)
    if not this.specimen.softening:
        return tyre
    bench = this.loaded_bench.damped_at(frequency)
    part = 1.0
    for _ in range(_ITERATIONS):
        deflection = real.eccentricity * abs(1.0 - far_end(laden(this, _times(tyre, part)), bench, frequency))
        part = 1.0 - this.specimen.softening * deflection / (deflection + this.specimen.amplitude)
    return _times(tyre, part)


def laden(this: Run, springs: Zener | StateSpace) -> Element:
    """The springs of a dynamic test with the mass that the specimen has of its own."""
    inertia = this.real.mounted.inertia
    return springs if inertia is None else inertia.laden(equations(springs))


def cubic_of(this: Run) -> float:
    """The factor of the cubic force of the tyre in a dynamic test [N/m^3]."""
    if not this.specimen.cubic:
        return 0.0
    return this.specimen.cubic * float(this.real.mounted.static_stiffness(this.real.pressure, this.real.preload))


def _times(tyre: Zener | StateSpace, factor: float) -> Zener | StateSpace:
    """The element with `factor` times its K*."""
    if isinstance(tyre, Zener):
        return Zener(factor * tyre.k1, factor * tyre.k2, factor * tyre.c)
    return StateSpace(tyre.a, tyre.b, factor * tyre.c, factor * tyre.d)


def _repeated(tyre: Zener | StateSpace, factor: complex, frequency: float) -> Zener | StateSpace:
    """The element with `factor` times its K* at a `frequency` [Hz].

    Both springs keep their ratio; a damper is added or removed for the rest.
    """
    if factor == 1.0:
        return tyre
    model = equations(tyre)
    omega = 2.0 * np.pi * frequency
    wanted = factor * complex(model.stiffness(omega))
    rest = wanted - factor.real * complex(model.stiffness(omega))
    direct = factor.real * model.d + np.array([rest.real, rest.imag / omega])
    return StateSpace(model.a, model.b, factor.real * model.c, direct)
