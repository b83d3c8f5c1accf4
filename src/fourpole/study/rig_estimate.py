"""The rig as found: the results of the joint route for one rig and its channels, as typed values.

`study.rig_solution` makes it of a joint solution, `study.rig_read` of a results folder; both give the same values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from fourpole import quantities as q
from fourpole.core.arrays import short_repr
from fourpole.core.joint.misfit import Candidate
from fourpole.core.sources import Kind, Role, Source
from fourpole.words import cause_words, explained

#: A found value whose uncertainty is above this share of the stated uncertainty rests in part on the statement.
_HALF = 0.5
#: Ratio of the noise in the joint solution to the noise in the recordings above which a note is made.
_WORTH_SAYING = 1.2
#: Relative drift of K* over the run, and its relative scatter, above which a note is made.
_DRIFTS, _SCATTERS = 1e-3, 1e-4
_MASS, _SPRING = Source(Kind.RIG_VALUE, "moving_mass"), Source(Kind.RIG_VALUE, "preload_stiffness")
#: The part of the rig that acts as a part of the value before it, so that no test distinguishes the two.
_HIDDEN_IN = {_MASS: Source(Kind.RIG_VALUE, "tyre_mass"), _SPRING: Source(Kind.RIG_VALUE, "frame_stiffness")}
_HIDDEN_WORDS = {
    _HIDDEN_IN[_MASS]: "; whatever else moves with V2, such as the tyre's own moving part, is in it",
    _HIDDEN_IN[_SPRING]: "; whatever gives way with the spring, such as the frame, is in it",
}
#: Columns of rig.csv by the name of the field.
CELLS = {
    "stated": q.STATED.head,
    "stated_std": q.STATED.u_head,
    "found": q.FOUND.head,
    "found_std": q.FOUND.u_head,
    "ratio": q.POSTERIOR.head,
    "pull": q.PULL.head,
    "detection_limit": q.DETECTION_LIMIT.head,
}
#: Fields that study.json has under their own names, before notes and candidates.
_RECORDED = (
    "tests", "conditions", "shared", "chi2", "dof", "fits", "rig_error", "inflation", "scatter", "unsteady",
    "converged", "reason", "steps", "tied", "rests", "order",
)  # fmt: skip


class RigFinding(StrEnum):
    """Result of the tests for a shared value, as in column `finding`; the column is empty if none of these applies."""

    FOUND = "found"
    NOT_DETERMINED = "not determined"
    CONTRADICTED = "contradicted"
    NOT_CALIBRATED = "not calibrated"
    UNSTATED = "unstated"
    UNKNOWN = ""


_REMARKS = {
    RigFinding.NOT_DETERMINED: "not determined by your data, taken from your statement",
    RigFinding.CONTRADICTED: "contradicts your statement: look for the cause before you use it",
    RigFinding.NOT_CALIBRATED: "the rig as stated does not fit: not calibrated",
    RigFinding.UNSTATED: "not stated by you, but the tests need it: look for its cause and state it",
    RigFinding.UNKNOWN: "",
}


class NoteCode(StrEnum):
    """Code of a note on the joint solution of a rig, as study.json holds it."""

    NOT_CONVERGED = "not converged"
    MISFIT = "misfit"
    NOISE = "noise"
    UNSTEADY = "unsteady drive"
    SCATTER = "scatter"
    DRIFT = "drift"
    STEP = "step"
    BLOCK = "block"
    AMPLITUDE = "amplitude"
    OUTLIERS = "outliers"
    UNSHARED_MASSES = "masses without a common condition"
    ONE_TEST = "one test"


class RunOrder(StrEnum):
    """Source of the times of the tests, or of their order in the run."""

    TIME = "the column time"
    RECORDINGS = "the start of the recordings"
    ROWS = "the order of tests.csv"


@dataclass(frozen=True)
class SharedValue:
    """One value that all tests of a rig share; numbers are in its unit, None where unknown.

    Attributes
    ----------
    source : Source
        The value: of the rig, of a channel, a ratio of two channels, or an added mass.
    unit : str
        SI.
    stated, stated_std, found, found_std : float or None
        Value and standard uncertainty before and after the tests.
    ratio : float or None [1]
        Standard uncertainty after the tests over that before.
    pull : float or None [1]
        Found less stated, in the standard uncertainty of that difference.
    detection_limit : float or None
        The smallest undeclared error that the tests would show; None where they show none.
    finding : RigFinding
    hides : Source or None
        A part that nobody stated and that the value may contain, because no test distinguishes the two.
    """

    source: Source
    unit: str
    stated: float | None
    stated_std: float | None
    found: float | None
    found_std: float | None
    ratio: float | None
    pull: float | None
    detection_limit: float | None
    finding: RigFinding
    hides: Source | None = None

    @property
    def remark(self) -> str:
        """Remark on the value in rig.csv."""
        if self.finding is not RigFinding.FOUND:
            return _REMARKS[self.finding]
        part, rest = (" in part", ", in part from your statement") if (self.ratio or 0.0) > _HALF else ("", "")
        return f"found{part} from your data{rest}{_HIDDEN_WORDS[self.hides] if self.hides else ''}"

    @property
    def row(self) -> dict[str, Any]:
        """The row of rig.csv, without the name of the rig."""
        return {
            q.VALUE.head: self.source.text,
            q.UNIT.head: self.unit,
            **{head: getattr(self, name) for name, head in CELLS.items()},
            q.FINDING.head: str(self.finding),
            q.REMARKS.head: self.remark,
        }


@dataclass(frozen=True)
class Outlier:
    """A test that does not agree with the others; its variance was enlarged by `factor`."""

    test: str
    factor: float
    point: int = 1


@dataclass(frozen=True)
class Unseen:
    """A component that moves a result before these tests would show it; see `fourpole.core.joint.unseen.Unseen`.

    `words` name it with its size, `key` of campaign.toml states it; `never`: it does not show at any possible size.
    """

    source: Source
    unit: str
    size: float
    result: str
    shift: float
    words: str
    key: str = ""
    never: bool = False

    @property
    def brief(self) -> str:
        """The component with its effect and its key, for a list."""
        if self.never:
            return f"{self.words} at this or any smaller size{f' ({self.key} states it)' if self.key else ''}"
        key = f"; {self.key} states it" if self.key else ""
        return f"{self.words} ({self.result} is then off by {self.shift:.0f} u{key})"

    @property
    def record(self) -> dict[str, Any]:
        """Its record in study.json."""
        numbers = {name: getattr(self, name) for name in ("unit", "size", "result", "shift", "words", "key", "never")}
        return {"component": self.source.text, **numbers}


@dataclass(frozen=True, repr=False)
class RigEstimate:
    """The rig and the channels as the joint route found them; what an analysis did not record has its default.

    Attributes
    ----------
    rig : str
        Name of the rig; empty where the campaign has one rig without a name.
    values : tuple of SharedValue
        In the order of rig.csv, ratios of channels last.
    fits : bool
        Whether rig and channels as stated fit the tests.
    converged : bool
        Whether the search for the most probable values converged.
    reason : str
        Why the search did not converge; empty if it did.
    steps : int
        Steps of the search.
    tests, conditions, shared : int
        Number of tests, of conditions, and of shared values that are not exactly known.
    chi2, dof : float or None [1]
        Chi-square of the rig as stated, and its degrees of freedom.
    rig_error : float [1]
        Error added to the rig's impedance in each test, relative to its largest part; 0 where the rig fits.
    inflation : float [1]
        Factor by which the standard uncertainty of all noise was enlarged.
    scatter : float [1]
        Relative scatter of K* between tests of one condition beyond the noise.
    unsteady : float [1]
        Relative error added to the frequency of each test, because the drive is unsteady.
    candidates : tuple of Candidate
        Causes that would lower a misfit, the best first.
    tied : int
        Number of the first candidates that explain the misfit equally well.
    rests : str
        What the uncertainty of K' comes from, and what the tests would not show; one sentence.
    unseen : tuple of Unseen
        The components that move a result by more than 2 u before they show, the largest shift first.
    order : RunOrder
        The order of the tests in the run, along which a specimen may drift.
    outliers : tuple of Outlier
        In the order of residuals.csv.
    massed : bool
        Whether a test has an added mass.
    unshared_masses : bool
        Whether tests have different masses, but no two of them the same condition.
    mass_gain : mapping of str to (float, float) [1]
        Median relative uncertainty of each quantity without and with the weighed mass.
    """

    rig: str
    values: tuple[SharedValue, ...] = ()
    fits: bool = True
    converged: bool = True
    reason: str = ""
    steps: int = 0
    tests: int = 0
    conditions: int = 0
    shared: int = 0
    chi2: float | None = None
    dof: float | None = None
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    candidates: tuple[Candidate, ...] = ()
    tied: int = 0
    rests: str = ""
    unseen: tuple[Unseen, ...] = ()
    order: RunOrder = RunOrder.ROWS
    outliers: tuple[Outlier, ...] = ()
    massed: bool = False
    unshared_masses: bool = False
    mass_gain: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def chi2_per_dof(self) -> float | None:
        """Chi-square per degree of freedom; None where there are no degrees of freedom."""
        return self.chi2 / self.dof if self.chi2 is not None and self.dof else None

    @property
    def contradicted(self) -> tuple[SharedValue, ...]:
        """The values whose statement the tests contradict."""
        return tuple(value for value in self.values if value.finding is RigFinding.CONTRADICTED)

    @property
    def causes(self) -> tuple[Candidate, ...]:
        """The candidates that explain the misfit best, and equally well."""
        return self.candidates[: self.tied]

    @property
    def wrong_channels(self) -> tuple[Candidate, ...]:
        """The best causes, if K* rests on the channels as stated and these causes are errors of them; else empty."""
        unresolved = self.rig_error > 0 and any(cause.source.of_channel for cause in self.causes)
        return self.causes if unresolved else ()

    @property
    def drifts(self) -> tuple[SharedValue, ...]:
        """The drifts of the specimens that are large enough for a note."""
        return self._of_specimens(Kind.DRIFT)

    def _of_specimens(self, kind: Kind) -> tuple[SharedValue, ...]:
        """The values of a kind that are large enough for a note."""
        return tuple(value for value in self.values if value.source.kind is kind and abs(value.found or 0.0) > _DRIFTS)

    @property
    def notes(self) -> tuple[NoteCode, ...]:
        """Codes of the notes for the user, the gravest first; the numbers of a note are fields of this class."""
        true = {
            NoteCode.NOT_CONVERGED: not self.converged,
            NoteCode.MISFIT: not self.fits,
            NoteCode.NOISE: self.fits and self.inflation > _WORTH_SAYING,
            NoteCode.UNSTEADY: self.unsteady > 0,
            NoteCode.SCATTER: self.scatter > _SCATTERS,
            NoteCode.DRIFT: bool(self.drifts),
            NoteCode.STEP: bool(self._of_specimens(Kind.STEP)),
            NoteCode.BLOCK: bool(self._of_specimens(Kind.BLOCK)),
            NoteCode.AMPLITUDE: bool(self._of_specimens(Kind.AMPLITUDE)),
            NoteCode.OUTLIERS: bool(self.outliers),
            NoteCode.UNSHARED_MASSES: self.unshared_masses,
            NoteCode.ONE_TEST: self.tests == 1,
        }
        return tuple(code for code, holds in true.items() if holds)

    def note(self, code: NoteCode) -> str:
        """The sentence of a note, with its numbers."""
        many = len(self.outliers) > 1
        return _NOTES[code].format(
            rig=self,
            misfit=self._misfit() if code is NoteCode.MISFIT else "",
            shown=f"; {self.explained}" if self.causes else "",
            strange=f"{len(self.outliers)} tests do" if many else "1 test does",
            counts="count" if many else "counts",
            drifts="; ".join(
                f"K* of {value.source.of} drifts by {100 * (value.found or 0.0):+.2g} % over the run"
                for value in self.drifts
            ),
            steps="; ".join(
                f"K* of {value.source.of} steps by {100 * (value.found or 0.0):+.2g} % during the run"
                for value in self._of_specimens(Kind.STEP)
            ),
            blocks="; ".join(
                f"K* of {value.source.of} is {100 * (value.found or 0.0):+.2g} % other in the tests with an added mass"
                for value in self._of_specimens(Kind.BLOCK)
            ),
            amplitude="; ".join(
                f"{100 * (2 ** (value.found or 0.0) - 1):+.2g} %" for value in self._of_specimens(Kind.AMPLITUDE)
            ),
            order=f"by {self.order}",
        )

    def _misfit(self) -> str:
        """Sentence on the values that contradict the tests, and on the best candidate for the cause."""
        against = [
            f"{_named(value.source)} is stated as {_short(value.stated, value.unit)}, "
            f"the tests give {_short(value.found, value.unit)}"
            for value in self.contradicted
            if self.candidates and value.source.role is not Role.RATIO
        ]
        chi2 = f"chi-square is {self.chi2 or 0.0:.3g} for {self.dof or 0.0:.0f} degrees of freedom"
        return f"({'; '.join(against) or chi2}); {self.explained}; {self._consequence()}"

    @property
    def explained(self) -> str:
        """What explains the misfit, in words; causes that explain it equally well stand together."""
        return explained(self.causes or self.candidates[:1])

    def _consequence(self) -> str:
        """The consequence of a misfit for the uncertainties."""
        if self.rig_error > 0:
            return "K* rests on the channels as stated and not on the rig, with their uncertainty"
        if not self.candidates:
            return "the uncertainties include no cause of it"
        return "the uncertainties include " + ("these causes" if len(self.causes) > 1 else "this cause")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of rig.csv."""
        return [{q.RIG.head: self.rig, **value.row} for value in self.values]

    @property
    def record(self) -> dict[str, Any]:
        """Record of the rig in study.json."""
        record = {name: getattr(self, name) for name in _RECORDED}
        record["notes"] = [self.note(code) for code in self.notes]
        record["note_codes"] = [str(code) for code in self.notes]
        record["unseen"] = [component.record for component in self.unseen]
        record["candidates"] = [_candidate_record(candidate) for candidate in self.candidates]
        if self.mass_gain:
            sides = zip(("without", "with"), zip(*self.mass_gain.values(), strict=True), strict=True)
            record["gain_of_masses"] = {side: dict(zip(self.mass_gain, stds, strict=True)) for side, stds in sides}
        return record


#: Sentence of each note; `rig` is the estimate.
_NOTES = {
    NoteCode.NOT_CONVERGED: "the joint route did not converge: {rig.reason}{shown}; use --route relative",
    NoteCode.MISFIT: (
        "rig and channels as stated do not fit their tests {misfit}; no row counts as ok, and no value is called "
        "calibrated"
    ),
    NoteCode.NOISE: (
        "all noise was multiplied by {rig.inflation:.2g}: the tests differ by more than the noise of their "
        "recordings, and no single error of a sensor or part of the rig explains it; look for an unsteady drive"
    ),
    NoteCode.UNSTEADY: (
        "the drive is unsteady: the tests scatter as if each frequency had a relative error of {rig.unsteady:.1g}, "
        "and the uncertainties include that"
    ),
    NoteCode.SCATTER: (
        "K* repeats to {rig.scatter:.2%} from test to test, besides the noise; each row has K* of its own test: look "
        "at temperature, conditioning and amplitude if this scatter is too large"
    ),
    NoteCode.DRIFT: "{drifts}, {order}; each row has K* of its own place in the run",
    NoteCode.STEP: "{steps}, {order}; each row has K* of its own place in the run",
    NoteCode.BLOCK: "{blocks}; each row has K* of its own test",
    NoteCode.AMPLITUDE: "K* changes by {amplitude} as the amplitude of the deflection doubles",
    NoteCode.OUTLIERS: "{strange} not go with the others and hardly {counts}",
    NoteCode.UNSHARED_MASSES: (
        "no condition was tested with two masses, so the added mass does not calibrate the sensors: tyre, pressure "
        "(2 %), preload (1 %), temperature (5 K) and frequency (1 %) must be the same without and with it"
    ),
    NoteCode.ONE_TEST: "one test only: rig and channels are taken as you stated them",
}


def _named(source: Source) -> str:
    """The name of a value in a sentence that states its size."""
    return source.kind.text if source.role is Role.MASS else source.text.replace("_", " ")


def _short(value: float | None, unit: str) -> str:
    shown, scale = q.ShownUnits().unit(unit)
    return "unknown" if value is None else f"{value / scale:.5g} {shown}".rstrip()


def _candidate_record(candidate: Candidate) -> dict[str, Any]:
    """A candidate for study.json, with its source as text."""
    part = candidate.source.of if candidate.of_rig else candidate.source.text
    return {
        "name": candidate.name,
        "value": number(candidate.value),
        "std": number(candidate.std),
        "unit": candidate.unit,
        "explains": number(candidate.explains),
        "part": part,
        "size": number(candidate.size),
        "text": cause_words(candidate),
        "released": candidate.released,
    }


def hidden_in(source: Source, stated: set[Source]) -> Source | None:
    """The part that a value may contain, where it is not among those stated."""
    part = _HIDDEN_IN.get(source)
    return None if part in stated else part


def mass_gain(without: Mapping[str, Any], both: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Median relative uncertainties without and with the weighed mass, of the quantities that have both."""
    pairs = {str(name): (number(value), number(both.get(name))) for name, value in without.items()}
    return {name: (a, b) for name, (a, b) in pairs.items() if a is not None and b is not None and a > 0 and b > 0}


def number(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
