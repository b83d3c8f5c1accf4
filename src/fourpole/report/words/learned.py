"""What the joint route learned of a rig and its sensors, in words, and what it could not learn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import polars as pl

from fourpole import quantities as q
from fourpole.core.sources import Kind, Role
from fourpole.findings.facts import natural
from fourpole.report.digits import known, number
from fourpole.report.words.phrases import counted, joined, percent
from fourpole.report.words.shared import DECLARED, Value, shared_values
from fourpole.report.words.sources import source_in_words
from fourpole.study.notecode import NoteCode
from fourpole.study.results import Results
from fourpole.study.rigestimate import Candidate, Outlier, RigEstimate, rig_estimates

__all__ = ["Learned", "learned"]

#: An undeclared error that would show only above this is told, per cent or degrees; a rig's value likewise in per cent.
_LATE = {"%": 5.0, "°": 3.0}
#: A candidate that explains this much of what the best explains cannot be told from it.
_AS_WELL = 0.9
_MOST_CANDIDATES = 4
#: Two gains whose errors F1/V2 alone cannot tell apart.
_BLIND = {(Kind.GAIN, "F1"), (Kind.GAIN, "V2")}
_MASS = "a repeat with a weighed mass"
#: Notes that the sentences here say already.
_SAID = (NoteCode.MISFIT, NoteCode.OUTLIERS, NoteCode.NOT_CONVERGED, NoteCode.SCATTER)


@dataclass(frozen=True)
class Learned:
    """One rig and its sensors after the joint route.

    Attributes
    ----------
    rig : str
        Empty where the campaign has one rig without a name.
    fits : bool
        Whether rig and channels as stated go with the tests.
    fit : str
        Tests, conditions and chi-square.
    summary : str
        How many values were found, and how many not.
    values : tuple of Value
        As in rig.csv.
    misfit, candidates, remarks, unseen : tuples of str
        What does not fit and what was done about it; what would explain it, the best first; scatter, search, notes;
        errors that the data cannot show.
    outliers : tuple of Outlier
    gain : str
        What the weighed mass gained.
    """

    rig: str
    fits: bool
    fit: str
    summary: str
    values: tuple[Value, ...]
    misfit: tuple[str, ...]
    candidates: tuple[str, ...]
    remarks: tuple[str, ...]
    unseen: tuple[str, ...]
    outliers: tuple[Outlier, ...]
    gain: str


def learned(results: Results) -> list[Learned]:
    """What was learned of each rig; nothing where another route was used.

    Parameters
    ----------
    results : Results

    Returns
    -------
    list of Learned
        In the order of rig.csv.
    """
    return [_of_rig(results, estimate) for estimate in rig_estimates(results)]


def _of_rig(results: Results, found: RigEstimate) -> Learned:
    values, fits = shared_values(results.rig, found.rig), found.fits
    return Learned(
        rig=found.rig,
        fits=fits,
        fit=_fit(found),
        summary=_summary(values, fits=fits),
        values=values,
        misfit=() if fits else tuple(_misfit(found, values)),
        candidates=() if fits else tuple(_candidates(found)),
        remarks=tuple(_remarks(found)),
        unseen=tuple(_unseen(values, fits=fits, massed=_massed(results.residuals, found.rig, values))),
        outliers=tuple(sorted(found.outliers, key=lambda outlier: (-outlier.factor, natural(outlier.test)))),
        gain=_gain(found),
    )


def _rounded(value: float, digits: int = 3) -> str:
    return number(float(f"{value:.{digits}g}"), digits)


def _fit(found: RigEstimate) -> str:
    text = (
        f"{counted(found.tests, 'test')} at {counted(found.conditions, 'condition')} share "
        f"{counted(found.shared, 'unknown value')}"
    )
    if found.chi2 is None or found.chi2_per_dof is None:
        return f"{text}; they leave nothing over by which rig and sensors could be held against each other."
    return (
        f"{text}. With rig and sensors as stated chi-square is {_rounded(found.chi2)} at {found.dof:.0f} degrees of "
        f"freedom, {_rounded(found.chi2_per_dof, 2)} per degree, where chance gives about 1."
    )


def _summary(values: Sequence[Value], *, fits: bool) -> str:
    own = [value for value in values if value.group is not Role.RATIO]
    if not own:
        return "All values were stated as exact: there was nothing to find."
    count = {finding: sum(value.finding == finding for value in own) for finding in ("found", "not determined")}
    of = f"Of {counted(len(own), 'shared value')}"
    if not fits:
        return f"{of} none is called calibrated, because the rig as stated does not fit."
    text = f"{of} {_was(count['found'])} found by your data"
    if count["not determined"]:
        text += f"; {_was(count['not determined'])} not determined by your data, taken from your statement"
    return f"{text}."


def _was(count: int) -> str:
    return f"{count or 'none'} {'was' if count <= 1 else 'were'}"


def _misfit(found: RigEstimate, values: Sequence[Value]) -> Iterable[str]:
    ratio = found.chi2_per_dof
    per = f": chi-square is {_rounded(ratio, 2)} per degree of freedom, not 1" if ratio is not None else ""
    yield f"The rig and the sensors as stated do not go with these tests{per}."
    against = [value.name for value in values if value.finding == "contradicted"]
    if against:
        yield (
            f"The data contradict what you state of the {joined(against)}: "
            f"no uncertainty rests on {'this statement' if len(against) == 1 else 'these statements'}, "
            "which leaves all results less certain."
        )
    done = list(_enlarged(found))
    if done:
        yield f"The uncertainties of all results were enlarged to hold the misfit: {joined(done)}."
    yield "No value of this rig is called calibrated."


def _enlarged(found: RigEstimate) -> Iterable[str]:
    error, inflation = found.rig_error, found.inflation
    if error > 0:
        yield f"an error of {percent(error)} of its largest part was granted to the rig's impedance in each test"
    if inflation > 1:
        yield f"all noise was taken {number(inflation, 2)} times larger"


def _candidates(found: RigEstimate) -> Iterable[str]:
    """What would explain the misfit, the best first, and what cannot be told from it."""
    best = found.candidates[0].explains if found.candidates else None
    for at, candidate in enumerate(found.candidates[:_MOST_CANDIDATES]):
        text = f"{candidate.text}{_give_or_take(candidate)}"
        if candidate.explains is not None:
            text += f": chi-square would fall by {_rounded(candidate.explains)}"
            if at and best and candidate.explains >= _AS_WELL * best:
                text += ", so nearly as much that the data hardly tell the two apart"
        yield text


def _give_or_take(candidate: Candidate) -> str:
    value, std = candidate.value, candidate.std
    return f" (known to {percent(std / abs(value))})" if value and std else ""


def _remarks(found: RigEstimate) -> Iterable[str]:
    if not found.converged:
        reason = found.reason or "no reason is given"
        yield f"The joint route did not converge ({reason}): do not rely on it, use the relative route."
    if found.scatter > 0:
        yield (
            f"Tests at the same condition differ in K* by {percent(found.scatter)} more than their noise explains; "
            "this scatter is in the uncertainties. Look at temperature, conditioning and amplitude."
        )
    for note in found.notes:
        if note.code not in _SAID:
            yield f"{note.text[:1].upper()}{note.text[1:].rstrip('.')}."


def _gain(found: RigEstimate) -> str:
    """By how much the weighed mass made K2 and C better known."""
    parts = []
    for name, (before, after) in (found.mass_gain or {}).items():
        what = name.replace(", K1 known", " (if K1 were exact)")
        parts.append(f"{what} to {percent(after)} instead of {percent(before)}")
    if not parts:
        return ""
    return f"With the weighed mass the tests without it give {joined(parts)} (median standard uncertainties)."


def _massed(residuals: pl.DataFrame, rig: str, values: Sequence[Value]) -> bool:
    """Whether tests with an added mass are among those of a rig."""
    if any(value.group is Role.MASS for value in values):
        return True
    if q.ADDED_MASS.head not in residuals.columns:
        return False
    here = residuals.filter(pl.col("rig").fill_null("") == rig)[q.ADDED_MASS.head].to_list()
    return any((known(mass) or 0.0) > 0 for mass in here)


def _unseen(values: Sequence[Value], *, fits: bool, massed: bool) -> Iterable[str]:
    """Which undeclared errors these data cannot show, and what would show them."""
    groups = (
        (Role.RIG, Role.CHANNEL) if fits else (Role.CHANNEL,)
    )  # where the rig does not fit, an error of it did show
    hidden = [value for value in values if value.hidden and value.group in groups and value.finding != "contradicted"]
    common = [value for value in hidden if massed and value.group is Role.CHANNEL and _ratios_seen(value, values)]
    if common:
        yield (
            f"An error of {_possessives(common)} that all channels have in common would not show in these data, and "
            "does no harm: K* needs only the ratios of the channels, whose errors would show."
        )
    hidden = [value for value in hidden if value not in common]
    if hidden:
        many = len(hidden) > 1
        yield (
            f"{'Errors' if many else 'An error'} of {_possessives(hidden)} beyond "
            f"{'their statements' if many else 'its statement'} would not show in these data; "
            f"{_what_would(hidden, massed=massed)} would show {'them' if many else 'it'}."
        )
    if not massed and _BLIND.issubset(
        (value.source.kind, value.source.of) for value in values if not value.source.under
    ):
        yield (
            "These data hold F1/V2 against the rig: they cannot tell an error of F1's gain from one of V2's, nor from "
            "the moving mass and the preload spring off together."
        )
    yield from _trusted_masses(values)
    told = any(value.group is Role.CHANNEL for value in hidden)
    late = [
        value
        for value in values
        if _late(value) and (value.group in groups or (value.group is Role.RATIO and not told)) and value not in common
    ]
    if late:
        sizes = joined(f"{value.seen_words} for {_possessive(value)}" for value in late)
        yield f"Errors beyond what is stated would show only from a size of {sizes}; smaller ones stay unseen."


def _trusted_masses(values: Sequence[Value]) -> Iterable[str]:
    """That the scale of all results is the weight of a mass, and from which size an error of it would show."""
    for value in values:
        if value.group is Role.MASS and value.finding == "not determined":
            below = "" if value.seen is None or value.hidden else f" below {value.seen_words}"
            yield (
                f"The scale of the sensors, and so of K*, rests on the weight of the {value.name}: an undeclared error "
                f"of it{below} would not show, and moves K* by its share and K2 and C by several times that. Weigh it "
                "twice; a second, different mass would show it."
            )


def _ratios_seen(value: Value, values: Sequence[Value]) -> bool:
    """Whether all ratios of this kind of value would show an error."""
    ratios = [other for other in values if other.group is Role.RATIO and other.source.kind is value.source.kind]
    return bool(ratios) and not any(other.hidden or _late(other) for other in ratios)


def _late(value: Value) -> bool:
    """Whether only a large undeclared error would show, much larger than the statement allows for."""
    if value.seen is None or value.hidden or value.group is Role.MASS:
        return False
    if value.seen < DECLARED * (value.stated_std or 0.0):
        return False
    if value.unit in _LATE:
        return value.seen > _LATE[value.unit]
    return bool(value.stated) and value.seen > 0.01 * _LATE["%"] * abs(value.stated or 0.0)


def _possessive(value: Value) -> str:
    """V1's gain, the moving mass m."""
    return source_in_words(value.source) if value.group is Role.CHANNEL else f"the {value.name}"


def _possessives(values: Sequence[Value]) -> str:
    return joined(_possessive(value) for value in values)


def _what_would(hidden: Sequence[Value], *, massed: bool) -> str:
    """The cheapest thing that would show errors of these values."""
    if not massed:
        return _MASS
    return "a calibration" if all(value.group is Role.CHANNEL for value in hidden) else "a measurement of its own"
