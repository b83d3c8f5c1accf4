"""A rig and its sensors as the joint route found them, in words, and the errors that the tests do not show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fourpole.core.sources import Kind, Role
from fourpole.findings.facts import natural
from fourpole.quantities import ShownUnits
from fourpole.report.digits import known
from fourpole.report.words.phrases import counted, joined, number, percent
from fourpole.report.words.shared_values import DECLARED, ShownValue
from fourpole.report.words.sources import source_in_words
from fourpole.study.rig_estimate import NoteCode, Outlier, RigEstimate, RigFinding
from fourpole.study.study import Study
from fourpole.words import cause_words

#: An undeclared error is reported as hard to detect if its detection limit is above this, by the unit shown.
#: For a value of the rig the limit for per cent counts, relative to the value.
_LATE = {"%": 5.0, "°": 3.0}
#: Candidates that are listed, and all that explain the misfit equally well.
_MOST_CANDIDATES = 4
#: Two gains whose errors have the same effect on F1/V2.
_BLIND = {(Kind.GAIN, "F1"), (Kind.GAIN, "V2")}
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
        unseen=tuple(_unseen(found, values)),
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
        f"{text}. With rig and sensors as stated chi-square is {number(found.chi2)} at {found.dof:.0f} degrees of "
        f"freedom, {number(found.chi2_per_dof, 2)} per degree, where chance gives about 1."
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
    per = f": chi-square is {number(ratio, 2)} per degree of freedom, not 1" if ratio is not None and ratio > 1 else ""
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
        yield f"all noise was multiplied by {number(inflation, 2)}"


def _candidates(found: RigEstimate) -> Iterable[str]:
    """Candidates that would explain the misfit, the best first, and those not distinguishable from it."""
    for at, candidate in enumerate(found.candidates[: max(_MOST_CANDIDATES, found.tied)]):
        value, std = known(candidate.value), known(candidate.std)
        text = cause_words(candidate) + (f" (known to {percent(std / abs(value))})" if value and std else "")
        explains = known(candidate.explains)
        if explains is not None:
            text += f": chi-square would fall by {number(explains)}"
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
        parts.append(f"{what} to {percent(after)} instead of {percent(before)}")
    if not parts:
        return ""
    return f"With the weighed mass the tests without it give {joined(parts)} (median standard uncertainties)."


def _unseen(found: RigEstimate, values: Sequence[ShownValue]) -> Iterable[str]:
    """Undeclared errors that the tests do not show, and what would show them, as sentences."""
    # If the rig does not fit, the misfit already shows an error of the rig, so only errors of channels can be hidden.
    groups = {Role.RIG, Role.CHANNEL} if found.fits else {Role.CHANNEL}
    every = [value for value in values if value.group in groups and _is_hidden(value)]
    # Of these values only an error that all channels have in common is hidden.
    common = [value for value in every if found.massed and _ratios_seen(value, values)]
    hidden = [value for value in every if value not in common]
    yield from _common_error(common)
    if hidden:
        yield _hidden_errors(hidden, massed=found.massed)
    yield from [] if found.massed else _equal_effects(values)
    yield from _trusted_masses(values)
    if Role.CHANNEL not in {value.group for value in hidden}:
        groups = groups | {Role.RATIO}
    yield from _late_errors([value for value in values if value.group in groups and value not in common])


def _late_errors(values: Sequence[ShownValue]) -> Iterable[str]:
    """The values with a large detection limit, as a sentence."""
    late = [value for value in values if is_late(value)]
    if late:
        sizes = joined(f"{value.detection_words} for {_possessive(value)}" for value in late)
        yield f"Errors beyond what is stated would show only from a size of {sizes}; smaller ones stay unseen."


def _hidden_errors(hidden: Sequence[ShownValue], *, massed: bool) -> str:
    """The values of which the tests show no plausible error, and the cheapest way to detect one, as a sentence."""
    errors, statement, them = "An error", "its statement", "it"
    if len(hidden) > 1:
        errors, statement, them = "Errors", "their statements", "them"
    remedy = "a calibration" if all(value.group is Role.CHANNEL for value in hidden) else "a measurement of its own"
    return (
        f"{errors} of {_possessives(hidden)} beyond {statement} would not show in these data; "
        f"{remedy if massed else 'a repeat with a weighed mass'} would show {them}."
    )


def _trusted_masses(values: Sequence[ShownValue]) -> Iterable[str]:
    """The dependence of all results on the weight of an added mass, with the detection limit of its error."""
    for value in values:
        if value.group is Role.MASS and value.finding is RigFinding.NOT_DETERMINED:
            below = "" if value.detection_limit is None or value.hidden else f" below {value.detection_words}"
            yield (
                f"The scale of the sensors, and so of K*, rests on the weight of the {value.name}: an undeclared error "
                f"of it{below} would not show, and moves K* by its share and K2 and C by several times that. Weigh it "
                "twice; a second, different mass would show it."
            )


def _common_error(common: Sequence[ShownValue]) -> Iterable[str]:
    """Sentence on an error that all channels have in common."""
    if common:
        yield (
            f"An error of {_possessives(common)} that all channels have in common would not show in these data. It has "
            "no effect on the results: K* needs only the ratios of the channels, whose errors would show."
        )


def _equal_effects(values: Sequence[ShownValue]) -> Iterable[str]:
    """Sentence on errors that have the same effect on the results of all tests with one mass."""
    if {(value.source.kind, value.source.of) for value in values if not value.source.under} >= _BLIND:
        yield (
            "These data compare F1/V2 with the rig: an error of F1's gain has the same effect as one of V2's, or as an "
            "error of the moving mass and the preload spring together."
        )


def _is_hidden(value: ShownValue) -> bool:
    """Whether the tests show no plausible error of a value; the statement of a contradicted value shows one."""
    return value.hidden and value.finding is not RigFinding.CONTRADICTED


def _ratios_seen(value: ShownValue, values: Sequence[ShownValue]) -> bool:
    """Whether an error of every channel ratio of the same kind as a channel's value would be detected."""
    if value.group is not Role.CHANNEL:
        return False
    ratios = [other for other in values if other.group is Role.RATIO and other.source.kind is value.source.kind]
    return bool(ratios) and not any(other.hidden or is_late(other) for other in ratios)


def is_late(value: ShownValue) -> bool:
    """Whether the detection limit is large and exceeds six stated standard uncertainties."""
    if value.detection_limit is None or value.hidden or value.group is Role.MASS:
        return False
    if value.detection_limit < DECLARED * (value.stated_std or 0.0):
        return False
    if value.unit in _LATE:
        return value.detection_limit > _LATE[value.unit]
    return bool(value.stated) and value.detection_limit > 0.01 * _LATE["%"] * abs(value.stated or 0.0)


def _possessive(value: ShownValue) -> str:
    """The name of a value inside a sentence: "V1's gain", "the moving mass m"."""
    return source_in_words(value.source) if value.group is Role.CHANNEL else f"the {value.name}"


def _possessives(values: Sequence[ShownValue]) -> str:
    return joined(_possessive(value) for value in values)
