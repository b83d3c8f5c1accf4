"""The values that all tests of a rig share, in the units and digits that people use."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from fourpole.core.sources import Role, Source
from fourpole.quantities import ShownUnits
from fourpole.report.digits import number, with_std
from fourpole.report.words.sources import in_words
from fourpole.study.rig_estimate import RigFinding, SharedValue

DASH = "–"
#: Groups of values with their headings.
GROUPS = {
    Role.RIG: "Rig",
    Role.CHANNEL: "Channels, measured over true",
    Role.RATIO: "What K* needs of the channels",
    Role.MASS: "Added masses",
    Role.SPECIMEN: "Specimens",
}
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

    def words(self, which: Literal["stated", "found"], coverage: float = 1.0) -> tuple[str, str]:
        """Value as stated or as found, and its standard uncertainty times a coverage factor."""
        known, known_std = getattr(self.value, which), getattr(self.value, f"{which}_std")
        value, std = self._shown(known, self.zero), self._shown(known_std)
        text, about = with_std(value, None if std is None else coverage * std, 5)
        departure = self.group in (Role.CHANNEL, Role.RATIO, Role.SPECIMEN)
        if departure and value is not None and value > 0 and text.strip("0."):
            text = f"+{text}"
        return text or DASH, about

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
    def detection_number(self) -> str:
        """The detection limit without its unit, "at no size", or a dash."""
        if self.finding in (RigFinding.CONTRADICTED, RigFinding.UNSTATED):
            return DASH
        return "at no size" if self.hidden else number(self.detection_limit, 2)

    @property
    def detection_words(self) -> str:
        """The detection limit with its unit, "at no size", or a dash."""
        unit = "" if self.hidden or self.detection_number == DASH else self.unit
        return f"{self.detection_number} {unit}".rstrip().replace(" °", "°")

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
