"""The values that all tests of a rig share, in the units and digits that people use."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

from fourpole.core.sources import Kind, Role, Source
from fourpole.quantities import RIG_VALUES, ShownUnits
from fourpole.report.digits import number, with_std
from fourpole.study.rig_estimate import RigEstimate, RigFinding, SharedValue

DASH = "–"
#: Groups of values with their headings.
GROUPS = {
    Role.RIG: "Rig",
    Role.CHANNEL: "Channels, measured over true",
    Role.RATIO: "What K* needs of the channels",
    Role.MASS: "Added masses",
    Role.SPECIMEN: "Specimens",
}
#: Name, unit shown, SI value of that unit, and zero of each unstated part of a rig.
_UNSTATED = {
    "mass": ("moving mass that is not stated", "kg", 1.0, 0.0),
    "spring": ("spring that is not stated", "kN/m", 1e3, 0.0),
    "frame": ("compliance of the frame, not stated", "mm/kN", 1e-6, 0.0),
    "loss": ("loss factor of the spring, not stated", "", 1.0, 0.0),
    "friction": ("dry friction that is not stated", "N", 1.0, 0.0),
    "input": ("input mass that is not stated", "kg", 1.0, 0.0),
}
#: SI unit of those parts that can be shown in another unit.
_UNSTATED_SI = {"mass": "kg", "spring": "N/m", "friction": "N", "input": "kg"}
#: An error of up to this many stated standard uncertainties counts as declared.
DECLARED = 6.0
#: Largest error that is plausible, by the unit shown; for a value of the rig it is the value itself.
_MOST = {"%": 100.0, "°": 90.0}


@dataclass(frozen=True)
class ShownValue:
    """One shared value in its shown unit; a gain is shown as its departure from 1.

    Attributes
    ----------
    value : SharedValue
        The value in SI.
    name, unit : str
        Name in words; the shown unit.
    scale, zero : float
        SI value of one shown unit, and the SI value that is shown as zero.
    """

    value: SharedValue
    name: str
    unit: str
    scale: float
    zero: float

    @classmethod
    def of(cls, value: SharedValue, units: ShownUnits | None = None) -> ShownValue:
        """The value with its name and unit."""
        return cls(value, *in_words(value.source, value.unit, units))

    @property
    def source(self) -> Source:
        """The source of error that this value is."""
        return self.value.source

    @property
    def finding(self) -> RigFinding:
        """The outcome of the joint route for this value."""
        return self.value.finding

    @property
    def group(self) -> Role:
        """One of `GROUPS`; an unstated part, or a value of an unknown kind, belongs to the rig's values."""
        return self.source.role if self.source.role in GROUPS else Role.RIG

    def _shown(self, value: float | None, zero: float = 0.0) -> float | None:
        return None if value is None else (value - zero) / self.scale

    @property
    def stated(self) -> float | None:
        """Value as stated."""
        return self._shown(self.value.stated, self.zero)

    @property
    def stated_std(self) -> float | None:
        """Standard uncertainty as stated."""
        return self._shown(self.value.stated_std)

    @property
    def detection_limit(self) -> float | None:
        """Detection limit: the smallest undeclared error that the tests would show; None if they show none."""
        return self._shown(self.value.detection_limit)

    def _pair(self, value: float | None, std: float | None) -> tuple[str, str]:
        text, about = with_std(value, std, 5)
        departure = self.group in (Role.CHANNEL, Role.RATIO, Role.SPECIMEN)
        if departure and value is not None and value > 0 and text.strip("0."):
            text = f"+{text}"
        return text or DASH, about

    @property
    def stated_words(self) -> tuple[str, str]:
        """Value as stated, and its standard uncertainty."""
        return self._pair(self.stated, self.stated_std)

    @property
    def found_words(self) -> tuple[str, str]:
        """Value as found, and its standard uncertainty."""
        return self._pair(self._shown(self.value.found, self.zero), self._shown(self.value.found_std))

    def stated_with_u(self, coverage: float) -> str:
        """Value as stated with its uncertainty, expanded by a coverage factor."""
        return _joined(*self._pair(self.stated, _times(self.stated_std, coverage)))

    def found_with_u(self, coverage: float) -> str:
        """Value as found with its uncertainty, expanded by a coverage factor."""
        std = _times(self._shown(self.value.found_std), coverage)
        return _joined(*self._pair(self._shown(self.value.found, self.zero), std))

    @property
    def ratio_words(self) -> str:
        """Ratio of the standard uncertainties after and before the tests [1], as text."""
        ratio = self.value.ratio
        return number(ratio, 3 if ratio is not None and 0.9 < ratio < 1 else 2) or DASH

    @property
    def pull_words(self) -> str:
        """Found less stated value over the standard uncertainty of their difference [1], as text."""
        pull = self.value.pull
        if pull is None:
            return DASH
        text = f"{pull:+.2f}" if abs(pull) < 10 else f"{pull:+.0f}"
        return text.replace("-", "−") if text.strip("+-0.") else "0.00"

    @property
    def detection_words(self) -> str:
        """The detection limit with its unit, "at no size", or a dash."""
        if self.finding in (RigFinding.CONTRADICTED, RigFinding.UNSTATED):
            return DASH
        return (
            "at no size"
            if self.hidden
            else f"{number(self.detection_limit, 2)} {self.unit}".rstrip().replace(" °", "°")
        )

    @property
    def mark(self) -> str:
        """The finding as a class of the page: letters and dashes."""
        return self.finding.replace(" ", "-") or "unknown"

    @property
    def hidden(self) -> bool:
        """Whether the tests would show no plausible error of the value."""
        if self.finding is RigFinding.UNSTATED:
            return False
        if self.detection_limit is None:
            return True
        most = _MOST.get(self.unit, abs(self.stated or 0.0) or inf)
        return self.detection_limit > max(most, DECLARED * (self.stated_std or 0.0))


def _times(std: float | None, coverage: float) -> float | None:
    return None if std is None else coverage * std


def _joined(value: str, about: str) -> str:
    return f"{value} ± {about}" if about else value


def shown_values(found: RigEstimate, units: ShownUnits | None = None) -> tuple[ShownValue, ...]:
    """The shared values of one rig in the units that are wanted, in the order of rig.csv."""
    return tuple(ShownValue.of(value, units) for value in found.values)


#: Name, unit shown and its SI value of errors that are 0 where there is none.
_SIMPLE = {
    Kind.CROSSTALK: ("cross-talk of {}", "%", 0.01),
    Kind.GAIN_DRIFT: ("drift of {}'s gain over the run", "%", 0.01),
    Kind.DRIFT: ("drift of K* of {} over the run", "%", 0.01),
    Kind.ANGLE_DRIFT: ("drift of the loss angle of {} over the run", "°", pi / 180),
    Kind.AMPLITUDE: ("change of K* with the amplitude of the deflection", "", 1.0),
    Kind.DELAY: ("delay of {}", "ms", 1e-3),
}


def in_words(source: Source, unit: str = "", units: ShownUnits | None = None) -> tuple[str, str, float, float]:
    """Name, unit shown, SI value of that unit, and the SI value shown as zero, in the units that are wanted.

    Examples
    --------
    >>> in_words(Source(Kind.RIG_VALUE, "preload_stiffness"), "N/m")
    ('preload spring K3', 'kN/m', 1000.0, 0.0)
    >>> in_words(Source(Kind.GAIN, "V1"), "1"), in_words(Source(Kind.GAIN, "F1", "V1"), "1")[0]
    (('gain of V1', '%', 0.01, 1.0), 'gain of F1 over V1')
    """
    of, under = source.of, source.under
    if source.kind in _SIMPLE:
        name, shown, scale = _SIMPLE[source.kind]
        return name.format(of or "the specimen"), shown, scale, 0.0
    match source.kind:
        case Kind.UNSTATED:
            wanted = units.wanted.get(_UNSTATED_SI.get(of, "")) if units else None
            return (_UNSTATED[of][0], *wanted, 0.0) if wanted else _UNSTATED[of]
        case Kind.RIG_VALUE:
            value = (units or ShownUnits()).of(RIG_VALUES[of])
            return value.name, value.suffix, value.scale, 0.0
        case Kind.GAIN:
            return f"gain of {of} over {under}" if under else f"gain of {of}", "%", 0.01, 1.0
        case Kind.PHASE:
            return f"phase of {of} less {under}" if under else f"phase of {of}", "°", pi / 180, 0.0
        case Kind.RESPONSE_GAIN | Kind.RESPONSE_PHASE:
            what = "gain" if source.kind is Kind.RESPONSE_GAIN else "phase"
            return f"calibrated response of {of}, {what}, in its u", "", 1.0, 0.0
    return source.text.replace("_", " "), "" if unit == "1" else unit, 1.0, 0.0
