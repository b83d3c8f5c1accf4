"""What the file of a recording states, and the conditions that were found of it."""

from __future__ import annotations

from dataclasses import dataclass, field

from fourpole.core.condition import AXES, FREQUENCY, Axis, axis_of
from fourpole.guess.names import Token

#: The tolerances of the rule of one condition, and that of a frequency, by the name of the condition.
_AXES = {axis.name: axis for axis in (*AXES, FREQUENCY)}
#: Kinds of tests in which a specimen moves, and those on the moving rig.
DYNAMIC_KINDS = ("dynamic", "random", "sweep")
MOVING_KINDS = (*DYNAMIC_KINDS, "calibration")


def axis_named(condition: str) -> Axis:
    """The tolerances within which two values of a condition are the same, by its name."""
    return _AXES.get(condition) or axis_of(condition)


@dataclass(frozen=True)
class Entry:
    """Kind, frequency and tokens of one recording; tokens of nearer folders come before those of farther ones.

    Attributes
    ----------
    kind : str
        "static", "dynamic", "random", "sweep" or "calibration".
    frequency : float [Hz]
        Frequency of the recording; not-a-number where it shows none.
    name, header, folder : tuple of Token
        Tokens of its name, of its header, and of the notes of its folder.
    signals : tuple of Token
        Conditions that its signals suggest; they count where nothing states one.
    """

    kind: str
    frequency: float
    name: tuple[Token, ...]
    header: tuple[Token, ...] = ()
    folder: tuple[Token, ...] = ()
    signals: tuple[Token, ...] = ()

    @property
    def parts(self) -> tuple[tuple[str, tuple[Token, ...]], ...]:
        """The tokens by place: name, header, folder. A token of an earlier place has priority."""
        return ("name", self.name), ("header", self.header), ("folder", self.folder)

    def stated(self, what: str) -> str:
        """Text of the first token of a kind; empty if there is none."""
        tokens = (*self.name, *self.header, *self.folder)
        return next((token.text.strip() for token in tokens if token.what == what), "")


@dataclass
class RecordingConditions:
    """Conditions of one recording in SI, the band of its excitation [Hz], its tyre, its doubts as (subject, text)."""

    values: dict[str, float] = field(default_factory=dict)
    tyre: str = ""
    construction: str = ""
    repeat: str = ""
    band: tuple[float, float] | None = None
    doubts: list[tuple[str, str]] = field(default_factory=list)

    def doubt(self, about: str, text: str) -> None:
        """Add a doubt on a subject."""
        self.doubts.append((about, text))

    def assume_tyre(self, name: str, text: str) -> None:
        """Set the name of the tyre, and add the doubt on it."""
        self.tyre = name
        self.doubt("tyre", text)
