"""A rig and its sensors as the joint route found them, in words; the values that all tests of a rig share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import known, number, with_std
from fourpole.core.sources import Role, Source
from fourpole.findings.facts import natural
from fourpole.quantities import ShownUnits
from fourpole.report.digits import counted, joined, percent, plain_number
from fourpole.report.words.limits import in_words, remedy_of
from fourpole.study.rig_estimate import NoteCode, Outlier, RigEstimate, RigFinding, SharedValue
from fourpole.study.study import Study
from fourpole.words import cause_words

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

    def words(self, which: Literal["stated", "found"]) -> tuple[str, str]:
        """Value as stated or as found, and its U."""
        known, known_std = getattr(self.value, which), getattr(self.value, f"{which}_std")
        value, std = self._shown(known, self.zero), self._shown(known_std)
        text, about = with_std(value, None if std is None else COVERAGE_FACTOR * std, 5)
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


#: Candidates that are listed, and all that explain the misfit equally well.
_MOST_CANDIDATES = 4
#: Components that the tests do not show which are listed.
_MOST_UNSEEN = 8
#: Notes whose content is given by other sentences of this module.
_SAID = (NoteCode.MISFIT, NoteCode.OUTLIERS, NoteCode.NOT_CONVERGED, NoteCode.SCATTER)


@dataclass(frozen=True)
class RigInWords:
    """One rig as found, with its sentences.

    Attributes
    ----------
    estimate : RigEstimate
        The rig as found, in numbers.
    values : tuple of ShownValue
        In the order of rig.csv.
    fit : str
        Tests, conditions and chi-square.
    summary : str
        The number of values that were found, and of those that were not.
    misfit : tuple of str
        The misfit and its consequence for the results; empty where the rig fits.
    candidates : tuple of str
        Parts that would explain the misfit, the best first.
    remarks : tuple of str
        Scatter, convergence and notes.
    unseen : tuple of str
        Errors that the tests do not show.
    outliers : tuple of Outlier
        The largest factor first.
    gain : str
        Reduction of the uncertainties by the weighed mass.
    """

    estimate: RigEstimate
    values: tuple[ShownValue, ...]
    fit: str
    summary: str
    misfit: tuple[str, ...]
    candidates: tuple[str, ...]
    remarks: tuple[str, ...]
    unseen: tuple[str, ...]
    outliers: tuple[Outlier, ...]
    gain: str


def rigs_in_words(results: Study) -> list[RigInWords]:
    """Each rig as found, in the order of rig.csv; none where another route was used."""
    return [_in_words(found, results.shown) for found in results.rigs]


def _in_words(found: RigEstimate, units: ShownUnits) -> RigInWords:
    values = tuple(ShownValue.of(value, units) for value in found.values)
    return RigInWords(
        found,
        values,
        fit=_fit(found),
        summary=_summary(values, fits=found.fits),
        misfit=() if found.fits else tuple(_misfit(found, values)),
        candidates=() if found.fits else tuple(_candidates(found)),
        remarks=tuple(_remarks(found)),
        unseen=tuple(_unseen(found)),
        outliers=tuple(sorted(found.outliers, key=lambda outlier: (-outlier.factor, natural(outlier.test)))),
        gain=_gain(found),
    )


def _fit(found: RigEstimate) -> str:
    text = (
        f"{counted(found.tests, 'test')} at {counted(found.conditions, 'condition')} share "
        f"{counted(found.shared, 'unknown value')}"
    )
    if found.chi2 is None or found.chi2_per_dof is None:
        return f"{text}; they leave no degree of freedom to check the rig and the sensors against each other."
    return (
        f"{text}. With rig and sensors as stated chi-square is {plain_number(found.chi2)} at {found.dof:.0f} degrees "
        f"of freedom, {plain_number(found.chi2_per_dof, 2)} per degree, where chance gives about 1."
    )


def _summary(values: Sequence[ShownValue], *, fits: bool) -> str:
    own = [value for value in values if value.group is not Role.RATIO]
    if not own:
        return "All values were stated as exact: there was nothing to find."
    count = Counter(value.finding for value in own)
    of = f"Of {counted(len(own), 'shared value')}"
    if not fits:
        return f"{of} none is called calibrated, because the rig as stated does not fit."
    text = f"{of} {_was(count[RigFinding.FOUND])} found by your data"
    if count[RigFinding.NOT_DETERMINED]:
        text += f"; {_was(count[RigFinding.NOT_DETERMINED])} not determined by your data, taken from your statement"
    return f"{text}."


def _was(count: int) -> str:
    return f"{count or 'none'} {'was' if count <= 1 else 'were'}"


def _misfit(found: RigEstimate, values: Sequence[ShownValue]) -> Iterable[str]:
    ratio = found.chi2_per_dof
    per = (
        f": chi-square is {plain_number(ratio, 2)} per degree of freedom, not 1"
        if ratio is not None and ratio > 1
        else ""
    )
    yield f"The rig and the sensors as stated do not fit these tests{per}."
    if found.candidates:
        yield from _contradictions(values)
    else:
        yield _sentence(found.explained)
    done = list(_enlarged(found))
    if done:
        yield f"The uncertainties of all results were enlarged to cover the misfit: {joined(done)}."
    yield "No row counts as ok, and no value of this rig is called calibrated."


def _contradictions(values: Sequence[ShownValue]) -> Iterable[str]:
    """What the tests contradict, and what they show that nobody stated, as sentences."""
    against = [value.name for value in values if value.finding is RigFinding.CONTRADICTED]
    if against:
        which = "this statement hardly counts" if len(against) == 1 else "these statements hardly count"
        yield (
            f"The data contradict what you state of the {joined(against)}: {which} now, and its departure is in the "
            "uncertainties of all results."
        )
    # A specimen may drift in a rig that fits.
    added = [
        value.name for value in values if value.finding is RigFinding.UNSTATED and value.group is not Role.SPECIMEN
    ]
    if added:
        yield f"The tests show what you did not state: {joined(added)}. The uncertainties of all results include it."


def _enlarged(found: RigEstimate) -> Iterable[str]:
    error, inflation = found.rig_error, found.inflation
    if error > 0:
        yield (
            f"each test includes an error of the rig's impedance of {percent(error)} of its largest part, so that K* "
            "rests on the channels"
        )
    if inflation > 1:
        yield f"all noise was multiplied by {plain_number(inflation, 2)}"


def _candidates(found: RigEstimate) -> Iterable[str]:
    """Candidates that would explain the misfit, the best first, and those not distinguishable from it."""
    for at, candidate in enumerate(found.candidates[: max(_MOST_CANDIDATES, found.tied)]):
        value, std = known(candidate.value), known(candidate.std)
        text = cause_words(candidate) + (f" (U {percent(COVERAGE_FACTOR * std / abs(value))})" if value and std else "")
        explains = known(candidate.explains)
        if explains is not None:
            text += f": chi-square would fall by {plain_number(explains)}"
            if 0 < at < found.tied:
                text += ", nearly as much, so that the data do not distinguish it from the first"
        yield text


def _remarks(found: RigEstimate) -> Iterable[str]:
    if not found.converged:
        reason = found.reason or "no reason is given"
        yield f"The joint route did not converge ({reason}): do not rely on it, use the relative route."
        if found.causes:
            yield _sentence(found.explained)
    if NoteCode.SCATTER in found.notes:
        yield (
            f"K* repeats to {percent(found.scatter)} from test to test, besides the noise; each row has K* of its own "
            "test. Look at temperature, conditioning and amplitude if this scatter is too large."
        )
    for code in found.notes:
        if code not in _SAID:
            yield _sentence(found.note(code))
    if found.rests:
        yield _sentence(found.rests)


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _gain(found: RigEstimate) -> str:
    """The median uncertainties of K2 and C with and without the weighed mass, as a sentence."""
    parts = []
    for name, (before, after) in found.mass_gain.items():
        what = name.replace(", K1 known", " (if K1 were exact)")
        parts.append(f"{what} to {percent(COVERAGE_FACTOR * after)} instead of {percent(COVERAGE_FACTOR * before)}")
    if not parts:
        return ""
    return f"With the weighed mass the tests without it give {joined(parts)} (median U)."


def _unseen(found: RigEstimate) -> Iterable[str]:
    """The components that move a result before the tests would show them, the largest first, as sentences."""
    for component in found.unseen[:_MOST_UNSEEN]:
        if component.never:
            effect = f"at this or any smaller size, but {component.result} would contain it"
            remedy = remedy_of(component.source)
            key = f", or state {component.key}" if component.key and component.key not in remedy else ""
            key = f". Remedy: {remedy}{key}"
        else:
            effect = f"by which {component.result} would be off by {component.shift:.0f} u"
            key = f"; {component.key} in campaign.toml states it" if component.key else ""
        yield f"These data would not show {component.words}, {effect}{key}."
    if len(found.unseen) > _MOST_UNSEEN:
        yield f"{counted(len(found.unseen) - _MOST_UNSEEN, 'further component')} would move a result by more than 2 u."
