"""The table of components: every error that a test of a rig may have, with its size where nobody states it.

A laboratory leaves ordinary parts unstated: the delay of a card, the low-cut of an amplifier, a sensor that is mounted
anew. Each is an unknown of the likelihood with the standard uncertainty of this table. A component of size 0 counts as
absent until the tests ask for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import pi

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.sources import Kind, Source


class Shape(Enum):
    """Change of the logarithm of what a component acts on, per unit of the component."""

    MODULUS = "1"
    ANGLE = "j"
    DELAY = "-j w"
    LOW_CUT = "j/f"
    SLOPE = "f^2"
    PART = "a part of the rig"
    NOISE = "a random number of each test"

    def turn(self, omega: FloatArray) -> ComplexArray:
        """The change (N,) at angular frequencies (N,) [rad/s]; of a part of the rig, and of noise, it is 0."""
        frequency = omega / (2 * np.pi)
        ones = np.ones(omega.size, dtype=complex)
        turns = {
            Shape.MODULUS: ones,
            Shape.ANGLE: 1j * ones,
            Shape.DELAY: -1j * omega,
            Shape.LOW_CUT: 1j / frequency,
            Shape.SLOPE: frequency**2 + 0j,
        }
        return turns.get(self, 0 * ones)


class Scope(Enum):
    """The tests that have an error in common."""

    SHARED = "all tests"
    MOUNTING = "the tests of one mounting of the sensor"
    ASSEMBLY = "the tests with one added mass"
    SPECIMEN = "the tests of one specimen"
    BLOCK = "the tests of one specimen with one added mass"
    TEST = "one test"


@dataclass(frozen=True)
class Component:
    """One kind of error.

    Attributes
    ----------
    kind : Kind
        Kind of its source.
    group : str
        The components that stand and fall together.
    shape : Shape
    scope : Scope
    std : float
        Standard uncertainty where the campaign states nothing, in the unit; 0 for a component that tests must ask for.
    bound : float
        Largest size that is possible, in the unit.
    unit : str
        SI unit.
    key : str
        Key of campaign.toml that states it; empty if there is none.
    words : str
        What it is, in words.
    """

    kind: Kind
    group: str
    shape: Shape
    scope: Scope
    std: float
    bound: float
    unit: str
    key: str
    words: str


_DEGREE = pi / 180.0

#: All components. A slope is in 1/Hz² in the likelihood; here it is that at the highest frequency of the tests.
COMPONENTS = (
    Component(Kind.GAIN, "gain", Shape.MODULUS, Scope.SHARED, 0.01, 0.15, "1", "std_gain",
              "the gain of a channel"),
    Component(Kind.PHASE, "phase", Shape.ANGLE, Scope.SHARED, 0.5 * _DEGREE, 0.25, "rad", "std_phase",
              "the phase of a channel, the same at all frequencies"),
    Component(Kind.DELAY, "delay", Shape.DELAY, Scope.SHARED, 20e-6, 5e-3, "s", "std_delay",
              "the delay of a channel against the others"),
    Component(Kind.LOW_CUT, "low-cut", Shape.LOW_CUT, Scope.SHARED, 0.05, 2.0, "Hz", "low_cut",
              "the low-cut of a channel: its first-order corner"),
    Component(Kind.SLOPE, "slope", Shape.SLOPE, Scope.SHARED, 1e-3, 1e-2, "1", "std_slope",
              "the rise of a gain with frequency, at the highest frequency"),
    Component(Kind.MOUNTING_GAIN, "mounting", Shape.MODULUS, Scope.MOUNTING, 2.5e-3, 0.15, "1", "std_mounting",
              "the gain of V1 in one mounting"),
    Component(Kind.MOUNTING_PHASE, "mounting", Shape.ANGLE, Scope.MOUNTING, 0.15 * _DEGREE, 0.25, "rad",
              "std_mounting", "the phase of V1 in one mounting"),
    Component(Kind.REMOUNTING_GAIN, "remounting", Shape.MODULUS, Scope.ASSEMBLY, 2e-4, 0.15, "1", "std_remounting",
              "the gain of F1 or V2 with one added mass"),
    Component(Kind.REMOUNTING_PHASE, "remounting", Shape.ANGLE, Scope.ASSEMBLY, 0.01 * _DEGREE, 0.25, "rad",
              "std_remounting", "the phase of F1 or V2 with one added mass"),
    Component(Kind.BLOCK, "block", Shape.MODULUS, Scope.BLOCK, 3e-3, 0.3, "1", "std_block",
              "|K*| of a specimen in the tests with an added mass"),
    Component(Kind.ANGLE_BLOCK, "block", Shape.ANGLE, Scope.BLOCK, 1e-3, 0.3, "rad", "std_block",
              "the loss angle of a specimen in the tests with an added mass"),
    Component(Kind.DRIFT, "drift", Shape.MODULUS, Scope.SPECIMEN, 2e-3, 0.3, "1", "std_drift",
              "the drift of |K*| over the run"),
    Component(Kind.ANGLE_DRIFT, "drift", Shape.ANGLE, Scope.SPECIMEN, 7e-4, 0.3, "rad", "std_drift",
              "the drift of the loss angle over the run"),
    Component(Kind.STEP, "step", Shape.MODULUS, Scope.SPECIMEN, 0.0, 0.3, "1", "",
              "a step of |K*| during the run"),
    Component(Kind.ANGLE_STEP, "step", Shape.ANGLE, Scope.SPECIMEN, 0.0, 0.3, "rad", "",
              "a step of the loss angle during the run"),
    Component(Kind.RIG_VALUE, "preload damping", Shape.PART, Scope.SHARED, 0.02, 0.3, "1", "preload_damping",
              "the damper of the preload spring, over the critical one"),
    Component(Kind.AMPLITUDE, "amplitude", Shape.MODULUS, Scope.SHARED, 0.0, 1.0, "1", "",
              "the change of log |K*| per logarithm of the deflection"),
    Component(Kind.GAIN_DRIFT, "gain drift", Shape.MODULUS, Scope.SHARED, 0.0, 0.15, "1", "",
              "the drift of a channel's gain over the run"),
    Component(Kind.GAIN_STEP, "gain step", Shape.MODULUS, Scope.SHARED, 0.0, 0.15, "1", "",
              "a step of a channel's gain during the run"),
    Component(Kind.CROSSTALK, "cross-talk", Shape.MODULUS, Scope.SHARED, 0.0, 0.15, "1", "std_crosstalk",
              "a channel in another, over their sizes"),
    Component(Kind.FIXTURE, "fixture", Shape.PART, Scope.SHARED, 0.0, 0.3, "1", "fixture_stiffness",
              "the compliance between V1 and the specimen, over that of the specimen"),
    Component(Kind.UNSTATED, "part of the rig", Shape.PART, Scope.SHARED, 0.0, 0.3, "1", "",
              "a part of the rig that nobody stated, over the part that it belongs to"),
    Component(Kind.SCATTER, "scatter", Shape.NOISE, Scope.TEST, 0.0, 0.03, "1", "",
              "the scatter of log K* from test to test"),
    Component(Kind.BELT_MASS, "belt", Shape.PART, Scope.SPECIMEN, 0.0, 0.5, "kg", "specimen_mass",
              "the mass that a specimen has between its ends, over the moving mass"),
    Component(Kind.BELT_SHARE, "belt", Shape.PART, Scope.SPECIMEN, 0.7, 3.0, "1", "belt_frequency",
              "the logarithm of the share of the springs on both sides of this mass"),
    Component(Kind.BELT_ANGLE, "belt", Shape.PART, Scope.SPECIMEN, 0.05, 0.5, "rad", "",
              "the difference of their loss angles"),
    Component(Kind.BELT_EXPONENT, "belt", Shape.PART, Scope.SPECIMEN, 0.6, 3.0, "1", "",
              "the power of K* by which their share changes"),
    Component(Kind.BELT_SPREAD, "belt", Shape.PART, Scope.SPECIMEN, pi / 3**0.5, 9.0, "1", "",  # as of any spread alike
              "the logarithm of the odds of the spread of its mass, 0 in its middle, 1 evenly"),
    Component(Kind.K1_LINEARITY, "linearity", Shape.MODULUS, Scope.SHARED, 1e-3, 0.1, "1", "linearity",
              "the departure of load or deflection from a straight line, over the range"),
)  # fmt: skip


#: Size with which an asked component begins, over its bound.
BEGINS = 1 / 30


def component(kind: Kind) -> Component:
    """The component of a kind of source.

    Examples
    --------
    >>> component(Kind.DELAY).std, component(Kind.DELAY).key
    (2.000e-05, 'std_delay')
    """
    return next(row for row in COMPONENTS if row.kind is kind)


def key_of(source: Source) -> str:
    """The key of campaign.toml that states a source; empty if none does."""
    if source.kind is Kind.RIG_VALUE:
        return source.of
    return next((row.key for row in COMPONENTS if row.kind is source.kind), "")


@dataclass(frozen=True)
class SpecimenUncertainty:
    """Standard uncertainties of log K* of a specimen, of its modulus [1] + j its angle [rad]; 0 for none.

    Attributes
    ----------
    block : complex
        Of the tests with an added mass against those without.
    drift : complex
        Of the change over the whole run.
    """

    block: complex = 0j
    drift: complex = 0j
