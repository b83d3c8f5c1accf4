"""`Source`: the source of an uncertainty or a misfit, with its text on disk, which only this module makes and reads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fourpole.core.phasor import SYMBOLS
from fourpole.core.rig import PARAMETERS

#: Parts of a rig that its statement may lack, with the SI unit of their size.
PARTS = {
    "mass": "kg", "spring": "N/m", "frame": "m/N", "frame resonance": "Hz", "frame damping": "1", "loss": "1",
    "friction": "N", "presliding": "1", "input": "kg",
}  # fmt: skip
#: Parts that say how another one acts, and have no size of their own.
SHAPES = ("frame resonance", "frame damping", "presliding")
#: Pairs of channels (over, under); K* depends on the ratio of their gains and the difference of their phases.
RATIOS = (("F1", "V1"), ("V2", "V1"))


#: One channel in another.
_CROSSED = tuple(
    f"{source} in {channel}" for source in SYMBOLS.values() for channel in SYMBOLS.values() if source != channel
)


class Role(Enum):
    """The object to which an error belongs."""

    TEST = "one test"
    RIG = "the rig as stated"
    UNSTATED = "a part of the rig that nobody stated"
    CHANNEL = "a channel, in all tests"
    MOUNTING = "a channel, as it was mounted"
    RATIO = "one channel against another"
    MASS = "a weighed mass"
    SPECIMEN = "a specimen, in all its tests"
    STATIC = "K1"
    OTHER = "unknown"


class Kind(Enum):
    """Each kind of source: the start of its text on disk, the possible ends of that text, and its role."""

    NOISE = ("sensor noise", (), Role.TEST)
    FREQUENCY = ("frequency", (), Role.TEST)
    SCATTER = ("scatter", (), Role.TEST)
    STRANGE = ("strange tests", (), Role.TEST)
    UNSTEADY = ("unsteady drive", (), Role.TEST)
    RIG_MISFIT = ("rig misfit", (), Role.TEST)
    GAIN = ("gain ", (*SYMBOLS.values(),), Role.CHANNEL)
    PHASE = ("phase ", (*SYMBOLS.values(),), Role.CHANNEL)
    DELAY = ("delay ", (*SYMBOLS.values(),), Role.CHANNEL)
    LOW_CUT = ("low-cut ", (*SYMBOLS.values(),), Role.CHANNEL)
    SLOPE = ("slope ", (*SYMBOLS.values(),), Role.CHANNEL)
    MOUNTING_GAIN = ("mounting gain ", (*SYMBOLS.values(),), Role.MOUNTING)
    MOUNTING_PHASE = ("mounting phase ", (*SYMBOLS.values(),), Role.MOUNTING)
    REMOUNTING_GAIN = ("gain with one mass ", (*SYMBOLS.values(),), Role.MOUNTING)
    REMOUNTING_PHASE = ("phase with one mass ", (*SYMBOLS.values(),), Role.MOUNTING)
    RESPONSE_GAIN = ("response gain ", (*SYMBOLS.values(),), Role.CHANNEL)
    RESPONSE_PHASE = ("response phase ", (*SYMBOLS.values(),), Role.CHANNEL)
    CROSSTALK = ("cross-talk ", (*_CROSSED,), Role.CHANNEL)
    FIXTURE = ("fixture ", ("V1",), Role.CHANNEL)
    GAIN_DRIFT = ("gain drift ", (*SYMBOLS.values(),), Role.CHANNEL)
    GAIN_STEP = ("gain step ", (*SYMBOLS.values(),), Role.CHANNEL)
    RIG_VALUE = ("", (*PARAMETERS,), Role.RIG)
    UNSTATED = ("unstated ", (*PARTS,), Role.UNSTATED)
    ADDED_MASS = ("added mass", (), Role.MASS)
    DRIFT = ("drift of ", (), Role.SPECIMEN)
    AMPLITUDE = ("amplitude", (), Role.SPECIMEN)
    ANGLE_DRIFT = ("loss angle drift of ", (), Role.SPECIMEN)
    STEP = ("step of ", (), Role.SPECIMEN)
    ANGLE_STEP = ("loss angle step of ", (), Role.SPECIMEN)
    BLOCK = ("block of ", (), Role.SPECIMEN)
    ANGLE_BLOCK = ("loss angle block of ", (), Role.SPECIMEN)
    BELT_MASS = ("belt mass of ", (), Role.SPECIMEN)
    BELT_SHARE = ("share of springs of ", (), Role.SPECIMEN)
    BELT_ANGLE = ("angle of springs of ", (), Role.SPECIMEN)
    BELT_EXPONENT = ("exponent of springs of ", (), Role.SPECIMEN)
    BELT_SPREAD = ("spread of the mass of ", (), Role.SPECIMEN)
    K1 = ("K1", (), Role.STATIC)
    K1_FIT = ("K1 fit", (), Role.STATIC)
    #: In tables of earlier versions only: the gap of the branches is a property of the specimen, not an error of K1.
    K1_GAP = ("K1 branch gap", (), Role.STATIC)
    K1_CYCLES = ("K1 cycles", (), Role.STATIC)
    K1_ZERO = ("K1 zero", (), Role.STATIC)
    K1_GAINS = ("K1 gains", (), Role.STATIC)
    K1_REPEATS = ("K1 repeats", (), Role.STATIC)
    K1_STATED = ("K1 stated", (), Role.STATIC)
    K1_LINEARITY = ("K1 linearity", (), Role.STATIC)
    K1_DRIFT = ("K1 drift", (), Role.STATIC)
    K1_TEMPERATURE = ("K1 temperature", (), Role.STATIC)
    OTHER = ("", (), Role.OTHER)

    def __init__(self, text: str, of: tuple[str, ...], role: Role) -> None:
        self.text = text
        self.of = of
        self.role = role


#: Sign between the two channels in the text of a ratio or difference.
_BETWEEN = {Kind.GAIN: "/", Kind.PHASE: "-"}
_MASS = re.compile(r"added mass (\S+) kg")
#: Kinds whose text ends with the name of a specimen.
_OF_SPECIMEN = (
    Kind.DRIFT, Kind.ANGLE_DRIFT, Kind.STEP, Kind.ANGLE_STEP, Kind.BLOCK, Kind.ANGLE_BLOCK,
    Kind.BELT_MASS, Kind.BELT_SHARE, Kind.BELT_ANGLE, Kind.BELT_EXPONENT, Kind.BELT_SPREAD,
)  # fmt: skip


@dataclass(frozen=True)
class Source:
    """One source of error.

    Attributes
    ----------
    kind : Kind
    of : str
        The channel (F1, V1, V2), the rig's value (of `core.rig.PARAMETERS`), the unstated part (of `PARTS`) or the
        specimen. For a source of kind OTHER it is the whole text.
    under : str
        The second channel of a ratio or a difference; empty for a single channel.
    mass : float, optional [kg]
        The added mass; None for all masses.
    rig : str
        Name of the rig; empty for a rig without a name.

    Examples
    --------
    >>> Source(Kind.GAIN, "F1").text, Source(Kind.GAIN, "F1", "V1").text, Source(Kind.ADDED_MASS, mass=10.0).text
    ('gain F1', 'gain F1/V1', 'added mass 10 kg')
    >>> Source.read("phase F1-V1") == Source(Kind.PHASE, "F1", "V1")
    True
    """

    kind: Kind
    of: str = ""
    under: str = ""
    mass: float | None = None
    rig: str = ""

    @property
    def role(self) -> Role:
        """The object to which the error belongs."""
        return Role.RATIO if self.under else self.kind.role

    @property
    def is_shape(self) -> bool:
        """Whether it says how an unstated part acts, and not how large it is."""
        return self.kind is Kind.UNSTATED and self.of in SHAPES

    @property
    def of_channel(self) -> bool:
        """Whether it is the error of a channel, in all tests or in those of one mounting."""
        return not self.under and self.kind.role in (Role.CHANNEL, Role.MOUNTING)

    @property
    def text(self) -> str:
        """Its text in budget.csv and rig.csv, without the rig."""
        if self.mass is not None:
            return f"{self.kind.text} {self.mass:g} kg"
        return f"{self.kind.text}{self.of}{_BETWEEN[self.kind] if self.under else ''}{self.under}"

    @classmethod
    def read(cls, text: str, rig: str = "") -> Source:
        """The source with this text on disk; its kind is OTHER if the text is unknown."""
        kind, of, under = _KNOWN.get(text, (Kind.OTHER, text, ""))
        if kind is Kind.OTHER and (weighed := _MASS.fullmatch(text)):
            try:
                weighed_mass = cls(Kind.ADDED_MASS, mass=float(weighed[1]), rig=rig)
            except ValueError:
                return cls(kind, of, rig=rig)
            return weighed_mass if weighed_mass.text == text else cls(kind, of, rig=rig)
        for of_specimen in _OF_SPECIMEN:
            if kind is Kind.OTHER and text.startswith(of_specimen.text):
                return cls(of_specimen, text.removeprefix(of_specimen.text), rig=rig)
        return cls(kind, of, under, rig=rig)


def _known() -> dict[str, tuple[Kind, str, str]]:
    """Kind, `of` and `under` by the text, for all sources except single added masses."""
    single = [(kind, of, "") for kind in Kind if kind is not Kind.OTHER for of in kind.of or ("",)]
    paired = [(kind, over, under) for kind in _BETWEEN for over, under in RATIOS]
    return {Source(*parts).text: parts for parts in (*single, *paired)}


_KNOWN: Final = _known()
