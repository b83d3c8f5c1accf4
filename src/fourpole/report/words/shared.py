"""The values that all tests of a rig share, row by row of rig.csv: as stated, as found, in the units people use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, pi
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.sources import Kind, Role, Source
from fourpole.report.digits import known, number, with_std
from fourpole.report.stated import RIG_VALUES

__all__ = ["DASH", "DECLARED", "FINDINGS", "GROUPS", "Value", "in_words", "shared_values"]

DASH = "–"
#: What a finding says where its row says nothing itself.
FINDINGS = {
    "found": "found by your data",
    "not determined": "not determined by your data, taken from your statement",
    "contradicted": "contradicted by your data: no uncertainty rests on your statement",
    "not calibrated": "not calibrated: the model of the rig does not fit",
    "unstated": "not stated by you: the tests want it; look for its cause and state it",
}
#: Groups of values with their headings.
GROUPS = {
    Role.RIG: "Rig",
    Role.CHANNEL: "Channels, measured over true",
    Role.RATIO: "What K* needs of the channels",
    Role.MASS: "Added masses",
}
#: Up to this many stated standard uncertainties an error is declared, or nearly so: none is unseen.
DECLARED = 6.0
#: An error above this is none that anybody would make; of the rig's values that is the value itself.
_MOST = {"%": 100.0, "°": 90.0}
_NOT_DETERMINED = FINDINGS["not determined"]


@dataclass(frozen=True)
class Value:
    """One shared value; its numbers are in the unit shown, a gain as its departure from 1.

    Attributes
    ----------
    source : Source
        The value itself.
    name, unit : str
        In words; as shown.
    stated, stated_std, found, found_std : float or None
    ratio : float or None [1]
        Posterior over prior uncertainty.
    pull : float or None [1]
        From stated to found, in the uncertainty of that distance.
    seen : float or None
        The smallest undeclared error that the data would show; None where none would be.
    finding, remarks : str
        As in rig.csv.
    """

    source: Source
    name: str
    unit: str
    stated: float | None
    stated_std: float | None
    found: float | None
    found_std: float | None
    ratio: float | None
    pull: float | None
    seen: float | None
    finding: str
    remarks: str

    @property
    def group(self) -> Role:
        """One of `GROUPS`; an unstated part, and what is not known here, stand with the rig's values."""
        return self.source.role if self.source.role in GROUPS else Role.RIG

    @property
    def signed(self) -> bool:
        """Whether it is a departure, which is shown with its sign."""
        return self.group in (Role.CHANNEL, Role.RATIO)

    def _pair(self, value: float | None, std: float | None) -> tuple[str, str]:
        text, about = with_std(value, std, 5)
        if self.signed and value is not None and value > 0 and text.strip("0."):
            text = f"+{text}"
        return text or DASH, about

    @property
    def stated_words(self) -> tuple[str, str]:
        """As stated, and its uncertainty."""
        return self._pair(self.stated, self.stated_std)

    @property
    def found_words(self) -> tuple[str, str]:
        """As found, and its uncertainty."""
        return self._pair(self.found, self.found_std)

    @property
    def ratio_words(self) -> str:
        """Posterior over prior uncertainty; 1 is 'nothing learned'."""
        return number(self.ratio, 3 if self.ratio is not None and 0.9 < self.ratio < 1 else 2) or DASH

    @property
    def pull_words(self) -> str:
        """How far it was drawn, in standard uncertainties."""
        if self.pull is None:
            return DASH
        text = f"{self.pull:+.2f}" if abs(self.pull) < 10 else f"{self.pull:+.0f}"
        return text.replace("-", "−") if text.strip("+-0.") else "0.00"

    @property
    def seen_words(self) -> str:
        """From which size an undeclared error shows."""
        if self.finding == "contradicted":
            return DASH
        if self.finding == "unstated":
            return DASH
        return "at no size" if self.hidden else f"{number(self.seen, 2)} {self.unit}".rstrip().replace(" °", "°")

    @property
    def mark(self) -> str:
        """The finding as a class of the page: letters and dashes."""
        return self.finding.replace(" ", "-") if self.finding in FINDINGS else "unknown"

    @property
    def sentence(self) -> str:
        """What is to be said of it; that it is not determined is always said in the same words."""
        usual = FINDINGS.get(self.finding, "")
        if self.finding == "not determined" and self.remarks and _NOT_DETERMINED not in self.remarks:
            return f"{_NOT_DETERMINED}; {self.remarks}"
        return self.remarks or usual

    @property
    def hidden(self) -> bool:
        """Whether an error of any size that can be stays unseen."""
        if self.finding == "unstated":
            return False
        if self.seen is None:
            return True
        most = _MOST.get(self.unit, abs(self.stated or 0.0) or inf)
        return self.seen > max(most, DECLARED * (self.stated_std or 0.0))


def shared_values(rows: pl.DataFrame, rig: str) -> tuple[Value, ...]:
    """The values of one rig, in the order of rig.csv."""
    if "rig" not in rows.columns:
        return ()
    return tuple(_value(row) for row in rows.rows(named=True) if str(row["rig"] or "") == rig)


def _value(row: Mapping[str, Any]) -> Value:
    source = Source.read(str(row.get("value") or ""), str(row.get("rig") or ""))
    name, unit, scale, zero = in_words(source, str(row.get("unit") or ""))

    def shown(column: str, origin: float = 0.0) -> float | None:
        found = known(row.get(column))
        return None if found is None else (found - origin) / scale

    return Value(
        source=source,
        name=name,
        unit=unit,
        stated=shown("stated", zero),
        stated_std=shown(q.STATED.u_head),
        found=shown("found", zero),
        found_std=shown(q.FOUND.u_head),
        ratio=known(row.get(q.POSTERIOR.head)),
        pull=known(row.get(q.PULL.head)),
        seen=shown(q.DETECTION_LIMIT.head),
        finding=str(row.get("finding") or ""),
        remarks=str(row.get("remarks") or ""),
    )


def in_words(source: Source, unit: str = "") -> tuple[str, str, float, float]:
    """Name, unit shown, SI value of that unit, and what is subtracted first.

    Examples
    --------
    >>> in_words(Source(Kind.RIG_VALUE, "preload_stiffness"), "N/m")
    ('preload spring K3', 'kN/m', 1000.0, 0.0)
    >>> in_words(Source(Kind.GAIN, "V1"), "1"), in_words(Source(Kind.GAIN, "F1", "V1"), "1")[0]
    (('gain of V1', '%', 0.01, 1.0), 'gain of F1 over V1')
    """
    of, under = source.of, source.under
    match source.kind:
        case Kind.RIG_VALUE:
            return *RIG_VALUES[of], 0.0
        case Kind.GAIN:
            return f"gain of {of} over {under}" if under else f"gain of {of}", "%", 0.01, 1.0
        case Kind.PHASE:
            return f"phase of {of} less {under}" if under else f"phase of {of}", "°", pi / 180, 0.0
        case Kind.DELAY:
            return f"delay of {of}", "ms", 1e-3, 0.0
        case Kind.RESPONSE_GAIN | Kind.RESPONSE_PHASE:
            what = "gain" if source.kind is Kind.RESPONSE_GAIN else "phase"
            return f"calibrated response of {of}, {what}, in its u", "", 1.0, 0.0
    return source.text.replace("_", " "), "" if unit == "1" else unit, 1.0, 0.0
