"""What the joint route learned of a rig and its channels, as rows, sentences and a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identification import Identification
from fourpole.core.joint import Joint, solve_joint
from fourpole.core.joint.misfit import Candidate, pulls
from fourpole.core.joint.outputs import Outputs, identification, outputs
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import RATIOS, Kind, Role, Source
from fourpole.study.notecode import NoteCode

__all__ = ["Learned", "learn"]

#: Above this ratio of posterior to prior uncertainty the tests have not determined a value.
NOT_DETERMINED = 0.9
#: Above this the statement still has a good part in the value.
_HALF = 0.5
#: Less information than this, against the statement's own, is none.
_NOTHING = 1e-8
#: Roles of values in the order of rig.csv, and what a part that nobody stated does not have.
_ORDER = (Role.RIG, Role.UNSTATED, Role.CHANNEL, Role.MASS)
_STATEMENT = ("stated", q.STATED.u_head, q.POSTERIOR.head, q.PULL.head, q.DETECTION_LIMIT.head)
#: What cannot be told from a value: it moves, or gives way, with it.
_MASS, _SPRING = Source(Kind.RIG_VALUE, "moving_mass"), Source(Kind.RIG_VALUE, "preload_stiffness")
_HIDDEN = {_MASS: Source(Kind.RIG_VALUE, "tyre_mass"), _SPRING: Source(Kind.RIG_VALUE, "frame_stiffness")}
_HIDDEN_WORDS = {
    _MASS: "; whatever else moves with V2, such as the tyre's own moving part, is in it",
    _SPRING: "; whatever gives way with the spring, such as the frame, is in it",
}
#: Further from its statement than this, in stated uncertainties, a value may hold what nobody stated.
_FAR = 2.0
#: Noise larger than the recordings say by more than this is worth a note.
_WORTH_SAYING = 1.2


@dataclass(frozen=True)
class Learned:
    """rig.csv, residuals.csv and the record of one rig.

    Attributes
    ----------
    values, residuals : list of dict
        Rows of rig.csv and residuals.csv, without the rig's name.
    record : dict
        For study.json.
    notes : tuple of str
        What the user must know of it.
    outliers : dict of str to float
        Tests that do not go with the others, with the factor by which their variance was enlarged.
    """

    values: list[dict[str, Any]]
    residuals: list[dict[str, Any]]
    record: dict[str, Any]
    notes: tuple[str, ...]
    outliers: dict[str, float]


def learn(
    joint: Joint,
    names: Sequence[str],
    phasors: Phasors,
    rig: Rig,
    channels: ChannelUncertainty,
    places: tuple[np.ndarray, FloatArray],
    found: Outputs,
    result: Identification,
) -> Learned:
    """Put a joint solution into rows and words.

    `places` are family and nominal frequency of each test, `found` and `result` what the solution says of them.
    """
    gained = _gain_of_masses(joint, phasors, rig, channels, places, found, result)
    notes = _notes(joint)
    misfit, solution = joint.misfit, joint.solution
    record: dict[str, Any] = {
        "tests": len(names),
        "conditions": joint.problem.conditions.count,
        "shared": len(joint.stated),
        "chi2": misfit.chi2,
        "dof": misfit.dof,
        "fits": misfit.fits,
        "rig_error": misfit.rig_error,
        "inflation": misfit.inflation,
        "scatter": misfit.scatter,
        "unsteady": misfit.unsteady,
        "converged": solution.converged,
        "reason": solution.reason,
        "steps": solution.steps,
        "notes": [text for _, text in notes],
        "note_codes": [str(code) for code, _ in notes],
        "candidates": [_candidate_record(candidate, misfit.chi2) for candidate in misfit.candidates[:6]],
    }
    if gained:
        record["gain_of_masses"] = gained
    factors = zip(names, joint.outlier, strict=True)
    return Learned(
        values=[*_values(joint), *_ratios(joint)],
        residuals=_residuals(joint, names, phasors),
        record=record,
        notes=tuple(text for _, text in notes),
        outliers={name: float(factor) for name, factor in factors if factor > 1},
    )


def _candidate_record(candidate: Candidate, chi2: float) -> dict[str, Any]:
    """A candidate for study.json, where its source stands as text."""
    part = candidate.source.of if candidate.of_rig else candidate.source.text
    known = {"part" if name == "source" else name: value for name, value in vars(candidate).items()}
    return known | {"part": part, "explains": min(candidate.explains, chi2)}


def _values(joint: Joint) -> list[dict[str, Any]]:
    """One row per shared value."""
    pull, found, std = pulls(joint.solution), joint.found, _honest_std(joint)
    stated = joint.stated.std
    rows = []
    for at, parameter in enumerate(joint.stated.parameters):
        row: dict[str, Any] = {
            "value": parameter.source.text,
            "unit": parameter.unit,
            "stated": parameter.stated,
            q.STATED.u_head: stated[at],
            "found": found[at],
            q.FOUND.u_head: std[at],
            q.POSTERIOR.head: std[at] / stated[at],
            q.PULL.head: _first_pull(joint, at, pull),
            q.DETECTION_LIMIT.head: _seen_from(joint, at),
        }
        if parameter.source.role is Role.UNSTATED:
            row |= dict.fromkeys(_STATEMENT, float("nan")) | {q.FOUND.u_head: joint.found_std[at]}
        group = _ORDER.index(parameter.source.role)
        rows.append((group, at, row | _finding(joint, at, std[at] / stated[at])))
    return [row for _, _, row in sorted(rows, key=lambda item: item[:2])]


def _first_pull(joint: Joint, at: int, pull: FloatArray) -> float:
    """Distance from the statement in its uncertainty, also for a statement that was contradicted."""
    if at in joint.misfit.conflicts:
        return float((joint.found[at] - joint.stated.parameters[at].stated) / joint.stated.std[at])
    return float(pull[at])


def _honest_std(joint: Joint) -> FloatArray:
    """Uncertainty of each value; where the rig does not fit, none is smaller than what is wrong, or was stated.

    A tyre's moving part is as good as a part of the moving mass, and a frame as a part of the spring: where nobody
    stated these, a mass or spring found further from its statement than chance easily takes it may hold them.
    """
    std = joint.found_std.copy()
    stated = joint.stated.parameters
    off = np.abs(joint.found - np.array([parameter.stated for parameter in stated]))
    sources = [parameter.source for parameter in stated]
    for at, source in enumerate(sources):
        hidden = _HIDDEN.get(source)
        far = off[at] > _FAR * joint.stated.std[at]
        if at in joint.misfit.conflicts or not joint.misfit.fits or (hidden and hidden not in sources and far):
            std[at] = max(float(np.hypot(std[at], off[at])), joint.stated.std[at] if not joint.misfit.fits else 0.0)
    return std


def _seen_from(joint: Joint, at: int) -> float:
    """The smallest undeclared error that would have shown at three standard uncertainties; not-a-number: none."""
    information = 1.0 / joint.solution.covariance[at, at] - 1.0
    if information < _NOTHING:
        return float("nan")
    return float(3.0 * np.sqrt(1.0 + 1.0 / information) * joint.problem.shared.std[at])


def _finding(joint: Joint, at: int, ratio: float) -> dict[str, str]:
    source = joint.stated.parameters[at].source if at >= 0 else None
    if source is not None and source.role is Role.UNSTATED:
        said = "not stated by you: the tests want it; look for its cause and state it"
        return {"finding": "unstated", "remarks": said}
    if at in joint.misfit.conflicts:
        said = "contradicts your statement: look for the cause before you use it"
        return {"finding": "contradicted", "remarks": said}
    if ratio > NOT_DETERMINED:
        return {"finding": "not determined", "remarks": "not determined by your data, taken from your statement"}
    if not joint.misfit.fits:
        return {"finding": "not calibrated", "remarks": "the rig as stated does not fit: not calibrated"}
    more = ""
    if source in _HIDDEN and _HIDDEN[source] not in [parameter.source for parameter in joint.stated.parameters]:
        more = _HIDDEN_WORDS[source]
    part = " in part" if ratio > _HALF else ""
    rest = ", in part from your statement" if part else ""
    return {"finding": "found", "remarks": f"found{part} from your data{rest}{more}"}


def _ratios(joint: Joint) -> list[dict[str, Any]]:
    """Ratios of the channels' gains, and differences of their phases: all that K* rests on."""
    at = {parameter.source: i for i, parameter in enumerate(joint.stated.parameters)}
    rows = []
    for over, under in RATIOS:
        for kind, unit, centre in ((Kind.GAIN, "1", 1.0), (Kind.PHASE, "rad", 0.0)):
            weights = np.zeros(len(joint.stated))
            for of, weight in ((over, 1.0), (under, -1.0)):
                if Source(kind, of) in at:
                    weights[at[Source(kind, of)]] = weight
            if weights.any():
                rows.append(_combined(joint, Source(kind, over, under), unit, centre, weights))
    return rows


def _combined(joint: Joint, source: Source, unit: str, centre: float, weights: FloatArray) -> dict[str, Any]:
    scaled = weights * joint.problem.shared.std
    std = float(np.sqrt(scaled @ joint.solution.covariance @ scaled))
    if not joint.misfit.fits:
        std = max(std, float(np.linalg.norm(weights * _honest_std(joint))))
    stated = float(np.linalg.norm(weights * joint.stated.std))
    ratio = std / stated
    off = float(scaled @ joint.solution.z)
    touched = [i for i in joint.misfit.conflicts if weights[i]]
    blind = float("nan")
    row = {
        "value": source.text,
        "unit": unit,
        "stated": centre,
        q.STATED.u_head: stated,
        "found": float(np.exp(off)) if centre else off,
        q.FOUND.u_head: std,
        q.POSTERIOR.head: ratio,
        q.PULL.head: off / np.sqrt(max(stated**2 - std**2, 1e-12 * stated**2)) if ratio < 1 else blind,
        q.DETECTION_LIMIT.head: blind if ratio > 1 - _NOTHING else 3.0 * stated / np.sqrt(max(1 - ratio**2, _NOTHING)),
    }
    return row | _finding(joint, touched[0] if touched else -1, ratio)


def _residuals(joint: Joint, names: Sequence[str], phasors: Phasors) -> list[dict[str, Any]]:
    left, problem = joint.residuals, joint.problem
    back = np.argsort(joint.order)
    impedance = problem.columns("impedance", joint.solution.z, joint.solution.stiffness)[back]
    mass_at = problem.observed.mass_at[back]
    added = np.append(problem.shared.masses, 0.0)[mass_at]
    std = np.sqrt(np.diagonal(left.impedance_covariance, 0, 1, 2))
    return [
        {
            "test": name,
            q.ADDED_MASS.head: float(added[i]),
            q.FREQUENCY.head: float(phasors.frequency[i]),
            q.RESIDUAL_RE.head: float(left.impedance[i].real),
            q.RESIDUAL_IM.head: float(left.impedance[i].imag),
            q.RESIDUAL_RE.u_head: float(std[i, 0]),
            q.RESIDUAL_IM.u_head: float(std[i, 1]),
            q.ZR.parts[0]: float(impedance[i].real),
            q.ZR.parts[1]: float(impedance[i].imag),
            q.CHI2.head: float(left.rig[i]),
            q.DOF.head: float(left.rig_dof[i]),
            q.OUTLIER.head: float(joint.outlier[i]),
        }
        for i, name in enumerate(names)
    ]


def _notes(joint: Joint) -> list[tuple[NoteCode, str]]:
    """What the user must know, each with its code and its sentence, the gravest first."""
    misfit, notes = joint.misfit, []
    if not joint.solution.converged:
        text = f"the joint route did not converge: {joint.solution.reason}; use --route relative"
        notes.append((NoteCode.NOT_CONVERGED, text))
    if not misfit.fits:
        notes.append((NoteCode.MISFIT, _misfit_note(joint)))
    elif misfit.inflation > _WORTH_SAYING:
        text = (
            f"noise counts as {misfit.inflation:.2g} times what each recording by itself says: the tests differ by "
            "more, and nothing unstated explains it (an unsteady drive would)"
        )
        notes.append((NoteCode.NOISE, text))
    if misfit.unsteady > 0:
        text = (
            f"the drive is unsteady: the tests scatter as if each frequency were off by {misfit.unsteady:.1g} of it, "
            "and the uncertainties hold that"
        )
        notes.append((NoteCode.UNSTEADY, text))
    if misfit.scatter > 0:
        text = (
            f"K* of repeated tests of one condition scatters by {misfit.scatter:.2g} of its value beyond the noise: "
            "look at temperature, conditioning and amplitude; the uncertainties hold this scatter"
        )
        notes.append((NoteCode.SCATTER, text))
    strange = int(np.sum(joint.outlier > 1))
    if strange:
        many = "tests do" if strange > 1 else "test does"
        text = f"{strange} {many} not go with the others and hardly {'count' if strange > 1 else 'counts'}"
        notes.append((NoteCode.OUTLIERS, text))
    notes += [(NoteCode.UNSHARED_MASSES, text) for text in _unshared_masses(joint)]
    if joint.problem.conditions.label.size == 1:
        notes.append((NoteCode.ONE_TEST, "one test only: rig and channels are taken as you stated them"))
    return notes


def _misfit_note(joint: Joint) -> str:
    misfit = joint.misfit
    best = f"; best explained by {misfit.candidates[0].text}" if misfit.candidates else ""
    aside = [joint.stated.parameters[at] for at in misfit.conflicts]
    against = [
        f"{parameter.source.text} is stated as {_short(parameter.stated, parameter.unit)}, "
        f"the tests want {_short(float(joint.found[at]), parameter.unit)}"
        for at, parameter in zip(misfit.conflicts, aside, strict=True)
    ]
    what = "; ".join(against) or f"chi-square is {misfit.chi2:.3g} for {misfit.dof:.0f} degrees of freedom"
    return (
        f"rig and channels as stated do not fit their tests ({what}){best}; "
        "uncertainties are enlarged and no value is called calibrated"
    )


def _unshared_masses(joint: Joint) -> list[str]:
    """Whether the tests with different masses are of other tyres, loads or temperatures, so that they tell nothing."""
    mass_at, label = joint.problem.observed.mass_at, joint.problem.conditions.label
    pairs = {(int(c), int(m)) for c, m in zip(label, mass_at, strict=True) if c >= 0}
    if len({m for _, m in pairs}) < 2 or len({c for c, _ in pairs}) < len(pairs):
        return []
    text = (
        "no condition was tested with two masses, so the added mass tells nothing of the sensors: tyre, "
        "pressure (2 %), preload (1 %), temperature (5 K) and frequency (1 %) must be the same without and with it"
    )
    return [text]


def _short(value: float, unit: str) -> str:
    return f"{value:.5g}" + (f" {unit}" if unit != "1" else "")


def _gain_of_masses(
    joint: Joint,
    phasors: Phasors,
    rig: Rig,
    channels: ChannelUncertainty,
    places: tuple[np.ndarray, FloatArray],
    found: Outputs,
    result: Identification,
) -> dict[str, dict[str, float]]:
    """Median relative uncertainties of K2 and C in the tests without an added mass, from these alone and from all."""
    mass_at = joint.problem.observed.mass_at[np.argsort(joint.order)]
    bare = (mass_at < 0) & (joint.condition >= 0)
    if bare.all() or not bare.any():
        return {}
    fewer = phasors.part(bare)
    k1, k1_std = result.k1[bare], result.k1_std[bare]
    family, nominal = (place[bare] for place in places)
    alone = solve_joint(fewer, rig, k1, family=family, nominal_frequency=nominal, channels=channels.part(bare))
    every = np.ones(k1.size, dtype=bool)
    fewer_found = outputs(alone, fewer, k1)
    stated, exact = (identification(alone, fewer, k1, std, fewer_found) for std in (k1_std, 0.0))
    without = _medians(stated, exact, every)
    both = _medians(result, identification(joint, phasors, result.k1, 0.0, found), bare)
    return {"without": without, "with": both} if without else {}


def _medians(result: Identification, known_k1: Identification, rows: BoolArray) -> dict[str, float]:
    """Median relative uncertainties of K' (of the modulus), K2 and C, these also as if K1 were exact."""
    with np.errstate(invalid="ignore"):
        relative = {"K'": np.sqrt(result.stiffness_covariance[rows, 0, 0]) / np.abs(result.stiffness[rows])}
        for found, words in ((result, "{}"), (known_k1, "{}, K1 known")):
            arm = np.sqrt(np.diagonal(found.arm_covariance[rows], 0, 1, 2))
            relative |= {words.format("K2"): arm[:, 0] / found.k2[rows], words.format("C"): arm[:, 1] / found.c[rows]}
    known = {name: value[np.isfinite(value)] for name, value in relative.items()}
    return {name: float(np.median(value)) for name, value in known.items() if value.size}
