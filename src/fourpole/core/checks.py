"""Checks: each compares a statistic of a test with a limit and gives a verdict; codes, numbers and names, no sentence.

`fourpole.words` makes their sentences. `recordingchecks` has the functions for one recording, called in
`fourpole.study.reduce`. `fourpole.study.compare` makes the checks between tests, with `scales` and `curves`, and
those of an identified point; `fourpole.study.agreement` those of a condition.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from functools import cached_property
from math import inf, nan
from typing import Any

from fourpole.errors import Message, out_of_memory


class Verdict(StrEnum):
    """The verdict on a test, from best to worst."""

    OK = "ok"
    WARNING = "warning"
    REJECTED = "rejected"

    def __repr__(self) -> str:
        return repr(self.value)

    @property
    def rank(self) -> int:
        """0 for the best verdict."""
        return VERDICTS.index(self)

    @classmethod
    def read(cls, text: str) -> Verdict:
        """The verdict of this name; a rejection for another text."""
        return cls(text) if text in VERDICTS else cls.REJECTED


#: The verdicts, from best to worst.
VERDICTS = tuple(Verdict)


class Asked(StrEnum):
    """A quantity that is asked of a test, and has a verdict of its own."""

    K1 = "K1"
    STIFFNESS = "K*"
    ARM = "K2 C"
    TR = "TR"


class Code(Enum):
    """The code of each check, which is its name on disk."""

    FREQUENCY = "stated frequency"
    MISSING = "missing samples"
    SPOILT = "drop-outs"
    HALVES = "steady channel"
    MEAN_FORCE = "mean force"
    MAINS = "mains"
    DISTORTION = "distortion"
    LINEARITY = "linearity of the specimen"
    FORCE_LINEARITY = "linearity of F1"
    RIG_LINEARITY = "linearity of the rig"
    EXCITATION = "excitation"
    LINE = "line"
    BESIDE = "beside a line"
    CLOSURE = "closure phase"
    SHARED = "shared noise"
    RESIDUAL = "residual"
    LIFT_OFF = "lift-off"
    RESONANCE = "rig resonance"
    CONSISTENCY = "F1 against V2"
    BLOCKING = "blocking mass"
    STEEP = "K' over frequency"
    CLIPPING = "clipping"
    TILT = "tilt"
    LEFT_OUT = "use"
    TIME_BASE = "time base"
    STEADY = "steady part"
    SPEED = "speed"
    STATEMENT = "tests.csv"
    EXCLUDED = "excluded"
    RECORDING = "recording"
    CONSTANT = "constant channel"
    TOO_SHORT = "length"
    MEMORY = "memory"
    READER = "reader"
    SLOW = "time"
    FAULT = "fault"
    LOAD_CURVE = "load curve"
    CURVE = "curve"
    BEYOND_CURVE = "preload"
    NO_PRELOAD = "no preload"
    SECANT = "secant"
    LOAD_ZERO = "zero of the load"
    K1 = "K1"
    K1_TEMPERATURE = "K1 temperature"
    K1_MIXED = "K1 conditions"
    K1_BRANCH = "K1 of one branch"
    NO_K1 = "no K1"
    PASSIVE = "passivity"
    OTHERS_GIVE = "passivity of other tests"
    PASSIVE_ARM = "passive arm"
    UNCERTAINTY = "uncertainty"
    CERTAINTY = "uncertainty of K*"
    AGREEMENT = "agreement"
    RIG = "rig"
    SCATTER = "scatter"
    TWO_ROOTS = "second K*"
    INERTIA = "inertia of the specimen"
    V1_SCALE = "V1 against K1"
    K1_RATIO = "K1 against K'"
    K1_LARGE = "K1 above K'"
    K1_EXCHANGED = "K1 exchanged"
    AMPLITUDES = "amplitudes"
    EXCITATIONS = "excitations"
    COPY = "copy"
    NOISE = "noise"
    OFF_CURVE = "K* curve"
    OTHER_CURVE = "K* curve of another condition"
    EXCHANGED = "labels"
    CONVERGENCE = "convergence"
    CALIBRATION = "calibration"
    CALIBRATION_UNUSED = "calibration unused"

    @cached_property
    def text(self) -> str:
        """Its name on disk."""
        return self.value

    @property
    def limit_is_least(self) -> bool:
        """Whether the limit is the least good statistic; it is the largest one of every other code."""
        return self in (Code.MAINS, Code.PASSIVE_ARM)

    @cached_property
    def quantity(self) -> Asked:
        """What the check bears on; K2, C and TR follow from K*, so what bears on K* bears on them, too."""
        return Asked.ARM if self in _OF_ARM else Asked.STIFFNESS

    @classmethod
    def read(cls, text: str) -> Code | None:
        """The code with this name on disk; None if no code has it."""
        with suppress(ValueError):
            return cls(text)
        return None


#: Checks of K1, which K2 and C need, and of the damped arm that they are.
_OF_ARM = {
    Code.NO_K1, Code.K1, Code.K1_TEMPERATURE, Code.K1_MIXED, Code.K1_BRANCH, Code.K1_EXCHANGED, Code.K1_LARGE,
    Code.PASSIVE_ARM, Code.UNCERTAINTY,
}  # fmt: skip


class Looks(Enum):
    """What a wrong sign, unit or column of a channel looks like."""

    F1_V2_INVERTED = auto()
    V2_IN_G = auto()
    F1_IN_KGF = auto()
    F1_IN_N = auto()
    F1_IN_KN = auto()
    V1_V2_EXCHANGED = auto()
    V1_INVERTED = auto()
    V1_IN_G = auto()
    V1_TIMES_G = auto()
    V1_IN_M = auto()
    V1_IN_MM = auto()


#: What is doubtful in a load-deflection curve, by its code; {0} is its size, {1} the size in percent. The texts are
#: here because `LoadCurve.remarks` has them for users of the core.
CURVE_DOUBTS = {
    "one cycle": "one complete cycle only: the rubber was not conditioned, and no repeat shows how steady it is",
    "missing points": "{1:.2g} % of the points are missing and were left out",
    "outliers": "{0} points lie far off the curve and were left out: look for spikes in the load",
    "creep": "the load at equal deflection changes by {0:.3g} N from the second to the last cycle: the specimen "
    "creeps, or the load cell drifts and K1 is that of another load",
    "clipped": "the load stands at its largest value over {0:.0%} of the deflection: the load cell was clipped; repeat "
    "the test with a larger range",
}


class Branch(Enum):
    """What K1 is the tangent of where it is not that of the mean of both branches."""

    LOADING = auto()
    UNLOADING = auto()
    POINTS = auto()


class Side(Enum):
    """The side that states a value of a condition which the other one leaves blank: the static test, or the dynamic."""

    STATIC = auto()
    DYNAMIC = auto()


class NoK1(Enum):
    """Why a dynamic test has no K1: no static test, no preload, or a static test that was rejected."""

    NO_TEST = auto()
    NO_PRELOAD = auto()
    REJECTED = auto()


class Difficulty(Enum):
    """What makes K* by a blocking mass uncertain: auxiliary springs, motions that are alike, or another source."""

    UNSTATED_SPRINGS = auto()
    SHOWN_SPRINGS = auto()
    SPRINGS = auto()
    ALIKE = auto()
    SOURCE = auto()


class Steep(Enum):
    """How K' contradicts K* at lower frequencies: it falls, or rises by more than the loss allows."""

    FALLS = auto()
    RISES = auto()


class Excitation(Enum):
    """The excitation of some tests of a condition."""

    SINES = auto()
    RANDOM = auto()
    SWEEP = auto()


@dataclass(frozen=True)
class Check:
    """One check of one test.

    Attributes
    ----------
    code : Code
        The kind of check.
    verdict : Verdict
        The verdict on the test, or on the channel.
    statistic, limit : float
        The value found and its limit, in the same unit; not-a-number for a check without a number.
    channel : str
        F1, V1 or V2 for a check of one channel; else empty.
    values : mapping of str to object
        What the sentence names beside them: numbers in the units of `fourpole.words.units`, names of tests,
        channels and files, enums, what an error says, other checks, or tuples of them.
    """

    code: Code
    verdict: Verdict
    statistic: float = nan
    limit: float = nan
    channel: str = ""
    values: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def heading(self) -> str:
        """Name of the check, followed by its channel if it has one."""
        return f"{self.code.text} of {self.channel}" if self.channel else self.code.text


#: The classes that checks of recordings are made of.
CHECK_CLASSES = (Check, Code, Verdict, Message, Looks)


def worst_verdict(verdicts: Iterable[str]) -> Verdict:
    """The worst of several verdicts, of which an unknown one counts as a rejection; OK if there is no verdict.

    Examples
    --------
    >>> worst_verdict(["ok", "rejected", "warning"])
    'rejected'
    """
    kinds = set(verdicts)
    if not kinds.issubset(VERDICTS):
        return Verdict.REJECTED
    return next((verdict for verdict in reversed(VERDICTS) if verdict in kinds), Verdict.OK)


def reported(
    code: Code, verdict: Verdict, statistic: float = nan, limit: float = nan, channel: str = "", /, **values: object
) -> Check:
    """A check with further values.

    Examples
    --------
    >>> reported(Code.MEMORY, Verdict.REJECTED, file="D1.csv").values
    {'file': 'D1.csv'}
    """
    return Check(code, verdict, statistic, limit, channel, values)


def judged(
    code: Code, statistic: float, warn: float, reject: float = inf, channel: str = "", /, **values: object
) -> Check:
    """A check of a statistic: rejected above `reject`, else a warning above `warn`, else ok and without values."""
    if statistic > reject:
        return Check(code, Verdict.REJECTED, statistic, reject, channel, values)
    if statistic > warn:
        return Check(code, Verdict.WARNING, statistic, warn, channel, values)
    return Check(code, Verdict.OK, statistic, warn, channel)


def fault_of(error: Exception, file: str) -> Check:
    """The rejection of a test because of an error that is none of Fourpole's own: a fault, or too little memory."""
    if out_of_memory(error):
        return reported(Code.MEMORY, Verdict.REJECTED, file=file)
    name = type(error).__name__
    return reported(Code.FAULT, Verdict.REJECTED, error=Message(name, "", f"{name}: {error}"))
