"""One finding as data: quantity, specimens and conditions, effect with uncertainty, and outcome; findings.csv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import polars as pl

from fourpole.quantities import Quantity

#: The value of a pressure, load or frequency that the campaign does not state.
UNSTATED = -1.0
Key = tuple[float, ...]
#: Heads of findings.csv, each with its meaning.
FINDING_COLUMNS = {
    "kind": "level, comparison, trend with an axis, resonance, claim with its number, or another kind of finding",
    "quantity": "name of the quantity; blank where the finding is about tests",
    "specimens": "names of the specimens",
    "condition": "lowest to highest pressure, load and frequency, the rig, and the added mass",
    "effect": "size of the effect",
    "u(effect)": "its standard uncertainty; of a mean over conditions, that of one condition; blank where it has none",
    "unit": "unit of the effect, 1 for a relative one",
    "holds": "the outcome",
    "tests": "names of the tests that the finding uses",
}
_UNITS = {"pressure": "Pa", "load": "N", "frequency": "Hz"}


class Topic(StrEnum):
    """The headings of findings, in the order of the report."""

    TRUST = "trust"
    INERTIA = "inertia"
    STATIC = "static stiffness"
    NONLINEARITY = "nonlinearity"
    DYNAMIC = "dynamic stiffness"
    DAMPING = "damping"
    LOSS = "loss"
    RESONANCE = "resonance"
    TRANSMISSIBILITY = "transmissibility"
    CLAIMS = "claims"


class Holds(StrEnum):
    """The outcome of a finding, in the words of findings.csv."""

    ALL_USED = "all used"
    SOME_USED = "some used"
    NONE_USED = "none used"
    NO_TESTS = "no tests"
    REJECTED = "rejected"
    WARNING = "warning"
    MEASURED = "measured"
    NEARLY_LINEAR = "nearly linear"
    NON_LINEAR = "non-linear"
    MARKEDLY_NON_LINEAR = "markedly non-linear"
    ABOVE = "first above second"
    BELOW = "first below second"
    NO_DIFFERENCE = "no difference"
    MIXED = "depends on the condition"
    RISES = "rises"
    FALLS = "falls"
    NO_CHANGE = "no change"
    MAXIMUM = "maximum"
    MINIMUM = "minimum"
    INSIDE = "inside the tested frequencies"
    AT_LOWEST = "at the lowest tested frequency"
    AT_HIGHEST = "at the highest tested frequency"
    NO_CROSSING = "no crossing"
    ONE_CROSSING = "one crossing"
    SEVERAL_CROSSINGS = "several crossings"
    WITHIN = "within the uncertainty"
    BEYOND = "beyond the uncertainty"
    TRUE = "holds"
    TRUE_UNSURE = "holds, not beyond the uncertainty"
    FALSE = "does not hold"
    NOT_EXAMINED = "cannot be examined"


@dataclass(frozen=True, order=True)
class Setup:
    """The rig and the added mass [kg]: a transmissibility curve depends on both besides the specimen."""

    rig: str = ""
    added_mass: float = 0.0


@dataclass(frozen=True)
class FindingConditions:
    """Nominal conditions: each key has the values of `axes`, which are pressure [Pa], load [N] and frequency [Hz]."""

    axes: tuple[str, ...] = ()
    keys: tuple[Key, ...] = ()
    setup: Setup = Setup()

    def values(self, axis: str) -> list[float]:
        """Distinct stated values of one axis in SI, rising."""
        place = self.axes.index(axis)
        return sorted({key[place] for key in self.keys if key[place] != UNSTATED})

    def __str__(self) -> str:
        """Lowest to highest setting of each axis in SI, and the set-up."""
        parts = []
        for axis in self.axes:
            if values := self.values(axis):
                span = f"{values[0]:.6g}" if len(values) == 1 else f"{values[0]:.6g} to {values[-1]:.6g}"
                parts.append(f"{axis} {span} {_UNITS[axis]}")
        if self.setup.rig:
            parts.append(f"rig {self.setup.rig}")
        if self.setup.added_mass:
            parts.append(f"added mass {self.setup.added_mass:.6g} kg")
        return "; ".join(parts)


class Detail(Protocol):
    """The numbers that only one kind of finding has; frozen and free of arrays, so that findings compare."""

    @property
    def kind(self) -> str:
        """Name of the kind in findings.csv: comparison, trend with pressure, claim 3."""


@dataclass(frozen=True)
class Finding:
    """One result that a campaign shows.

    Attributes
    ----------
    topic : Topic
    quantity : Quantity or None
        The quantity that the finding is about; None if it is about tests.
    specimens : tuple of str
        Names as in the campaign.
    holds : Holds
        The outcome.
    detail : Detail
        The numbers of this kind of finding; `detail.kind` names the kind.
    conditions : FindingConditions
        The conditions at which the quantity was measured.
    effect, std : float or None
        Size of the effect and its standard uncertainty, in `unit`. A mean over conditions has that of one condition.
    unit : str
        SI unit; "1" for a relative effect.
    tests : tuple of str
        Names of the tests that the finding uses, sorted.
    """

    topic: Topic
    quantity: Quantity | None
    specimens: tuple[str, ...]
    holds: Holds
    detail: Detail
    conditions: FindingConditions = field(default_factory=FindingConditions)
    effect: float | None = None
    std: float | None = None
    unit: str = ""
    tests: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Name of its kind: comparison, trend with pressure, claim 3."""
        return self.detail.kind


def findings_table(findings: Sequence[Finding]) -> pl.DataFrame:
    """Findings as the rows of findings.csv.

    Parameters
    ----------
    findings : sequence of Finding

    Returns
    -------
    polars.DataFrame
        `effect` and `u(effect)` are in `unit`, not-a-number is blank; several specimens, settings or tests are
        separated by "; ".
    """
    rows = [
        (
            finding.kind,
            finding.quantity.column if finding.quantity else "",
            "; ".join(finding.specimens),
            str(finding.conditions),
            finding.effect,
            finding.std,
            finding.unit,
            str(finding.holds),
            "; ".join(finding.tests),
        )
        for finding in findings
    ]
    numbers = ("effect", "u(effect)")
    schema = {name: pl.Float64 if name in numbers else pl.String for name in FINDING_COLUMNS}
    return pl.DataFrame(rows, schema=schema, orient="row")
