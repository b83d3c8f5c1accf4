"""From a joint solution to the rig as found, and to the rows of residuals.csv."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.checks import Check, Code, Verdict
from fourpole.core.components import key_of
from fourpole.core.identify import Identification
from fourpole.core.joint import Joint
from fourpole.core.joint.misfit import Candidate, cause_of, pulls
from fourpole.core.joint.outputs import Outputs
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.unseen import Unseen as UnseenComponent
from fourpole.core.joint.unseen import unseen
from fourpole.core.phasor import Phasors
from fourpole.core.sources import RATIOS, Kind, Role, Source
from fourpole.fitting.rows import Key
from fourpole.study.rig_estimate import Outlier, RigEstimate, RigFinding, SharedValue, Unseen, hidden_in, number
from fourpole.words import cause_words

#: A value is not determined by the tests if its uncertainty after them is more than this share of the stated one.
NOT_DETERMINED = 0.9
#: Information below this share of the statement's own is round-off.
_ROUND_OFF = 1e-8
#: Number of standard uncertainties at which an undeclared error shows.
_SHOWS = 3.0
#: A value further from its statement than this many stated uncertainties may contain an unstated part.
_FAR = 2.0
#: Roles of shared values in the order of rig.csv.
_ORDER = (Role.RIG, Role.UNSTATED, Role.CHANNEL, Role.MASS, Role.SPECIMEN)
#: Fields that the estimate has of the misfit as they are.
_OF_MISFIT = ("fits", "chi2", "dof", "rig_error", "inflation", "scatter", "unsteady", "tied")
#: Candidates that are kept.
_CANDIDATES = 6
#: Faults of a recording that spoil its amplitudes. One is a cause of a misfit if the first share of the tests shows it,
#: and the cause of a lack of convergence if the second share does.
_SPOILS = (
    Code.LINEARITY, Code.FORCE_LINEARITY, Code.RIG_LINEARITY, Code.SPOILT, Code.HALVES, Code.CLIPPING, Code.TIME_BASE,
)  # fmt: skip
_MOST, _SOME = 0.5, 0.2
#: Least share of the variance of K' that is named, and the largest number of values and components that are named.
_LEAST_SHARE, _MOST_NAMED, _MOST_HIDDEN = 0.1, 3, 2


def rig_estimate(rig: str, keys: Sequence[Key], joint: Joint, values: Outputs) -> RigEstimate:
    """The rig as found, from a joint solution of the tests with these keys and its outputs."""
    misfit = joint.misfit
    massed = bool(np.any(joint.problem.observed.added(joint.problem.shared.masses) > 0))
    labels = zip(joint.problem.conditions.label.tolist(), joint.problem.observed.mass_at.tolist(), strict=True)
    pairs = {(label, mass) for label, mass in labels if label >= 0}  # conditions with the masses that they have
    hidden = unseen_components(joint, values)
    known: dict[str, Any] = {name: getattr(joint.solution, name) for name in ("converged", "reason", "steps")}
    known |= {name: getattr(misfit, name) for name in _OF_MISFIT}
    return RigEstimate(
        rig,
        tuple(_values(joint)),
        **known,
        tests=len(keys),
        conditions=joint.problem.conditions.count,
        shared=len(joint.stated),
        candidates=tuple(
            replace(candidate, explains=min(candidate.explains, misfit.chi2))
            for candidate in misfit.candidates[: max(_CANDIDATES, misfit.tied)]
        ),
        rests=_rests(joint, values, hidden),
        unseen=hidden,
        outliers=tuple(
            Outlier(test, factor, point)
            for (test, point), factor in zip(keys, joint.outlier.tolist(), strict=True)
            if factor > 1
        ),
        massed=massed,
        unshared_masses=len({mass for _, mass in pairs}) > 1 and len({label for label, _ in pairs}) == len(pairs),
    )


def _values(joint: Joint) -> list[SharedValue]:
    """The shared values in the order of rig.csv, then the ratios of gains and differences of phases of two channels."""
    parameters, misfit = joint.stated.parameters, joint.misfit
    pull, std = pulls(joint.solution), _enlarged_std(joint)
    stated = {parameter.source for parameter in parameters}
    values = []
    for index, (parameter, fitted) in enumerate(zip(parameters, joint.found.tolist(), strict=True)):
        raised = parameter.source in misfit.specimens
        role = parameter.source.role
        if role is Role.MOUNTING or (role is Role.SPECIMEN and not raised) or parameter.source.is_shape:
            continue  # many values of the table, of which the results hold no more than that
        prior, conflict = float(joint.stated.std[index]), index in misfit.conflicts
        unstated = raised or parameter.source in misfit.added
        value = SharedValue(
            Source.read(parameter.source.text),  # with the digits that rig.csv has
            parameter.unit,
            parameter.stated,
            prior,
            fitted,
            float(std[index]),
            ratio=float(std[index] / prior),
            pull=number((fitted - parameter.stated) / prior if conflict else float(pull[index])),
            detection_limit=number(_detection_limit(joint, index)),
            finding=RigFinding.UNSTATED if unstated else _finding(joint, std[index] / prior, conflict=conflict),
            hides=hidden_in(parameter.source, stated),
        )
        if unstated:
            value = replace(value, stated=None, stated_std=None, ratio=None, pull=None, detection_limit=None,
                            found_std=float(joint.found_std[index]))  # fmt: skip
        values.append(value)
    values.sort(key=lambda value: _ORDER.index(value.source.role))
    for over, under in RATIOS:
        for kind, unit, centre in ((Kind.GAIN, "1", 1.0), (Kind.PHASE, "rad", 0.0)):
            signs = {Source(kind, over): 1.0, Source(kind, under): -1.0}
            weights = np.array([signs.get(parameter.source, 0.0) for parameter in parameters])
            if weights.any():
                values.append(_combined(joint, Source(kind, over, under), unit, centre, weights))
    return values


def _enlarged_std(joint: Joint) -> FloatArray:
    """Standard uncertainty of each value, enlarged where the value may contain an error of the model.

    If the rig does not fit, no uncertainty is below the stated one, or below the distance from the statement. The
    moving part of a tyre acts as a part of the moving mass, and a frame as a part of the spring. If these parts are
    not stated, a mass or spring that is far from its statement may contain them.
    """
    std, prior = joint.found_std.copy(), joint.stated.std
    parameters, fits = joint.stated.parameters, joint.misfit.fits
    stated = {parameter.source for parameter in parameters}
    off = np.abs(joint.found - np.array([parameter.stated for parameter in parameters]))
    for index, parameter in enumerate(parameters):
        hides = hidden_in(parameter.source, stated) and off[index] > _FAR * prior[index]
        if index in joint.misfit.conflicts or not fits or hides:
            std[index] = max(float(np.hypot(std[index], off[index])), 0.0 if fits else prior[index])
    return std


def _detection_limit(joint: Joint, index: int) -> float:
    """The smallest undeclared error that the tests would show; not-a-number where they show none."""
    information = 1.0 / joint.solution.covariance[index, index] - 1.0
    if information < _ROUND_OFF:
        return float("nan")
    return float(_SHOWS * np.sqrt(1.0 + 1.0 / information) * joint.problem.shared.std[index])


def _finding(joint: Joint, ratio: float, *, conflict: bool) -> RigFinding:
    """The finding for a stated value; `ratio` is its uncertainty after the tests over that before [1]."""
    if conflict:
        return RigFinding.CONTRADICTED
    if ratio > NOT_DETERMINED:
        return RigFinding.NOT_DETERMINED
    return RigFinding.FOUND if joint.misfit.fits else RigFinding.NOT_CALIBRATED


def _combined(joint: Joint, source: Source, unit: str, centre: float, weights: FloatArray) -> SharedValue:
    """A weighted sum of shared values as one value; gains are summed as logarithms."""
    scaled = weights * joint.problem.shared.std
    std = float(np.sqrt(scaled @ joint.solution.covariance @ scaled))
    if not joint.misfit.fits:
        std = max(std, float(np.linalg.norm(weights * _enlarged_std(joint))))
    stated = float(np.linalg.norm(weights * joint.stated.std))
    ratio, off = std / stated, float(scaled @ joint.solution.z)
    pull = off / np.sqrt(max(stated**2 - std**2, 1e-12 * stated**2)) if ratio < 1 else None
    limit = _SHOWS * stated / np.sqrt(max(1 - ratio**2, _ROUND_OFF)) if ratio <= 1 - _ROUND_OFF else None
    return SharedValue(
        source,
        unit,
        centre,
        stated,
        float(np.exp(off)) if centre else off,
        std,
        ratio=ratio,
        pull=None if pull is None else float(pull),
        detection_limit=None if limit is None else float(limit),
        finding=_finding(joint, ratio, conflict=any(weights[i] for i in joint.misfit.conflicts)),
    )


def _rests(joint: Joint, values: Outputs, hidden: Sequence[Unseen]) -> str:
    """What the uncertainty of K' comes from, and the components that move a result most before they show."""
    shares = sorted(_shares(joint, values).items(), key=lambda share: -share[1])[:_MOST_NAMED]
    parts = [f"{_in_words(source)} ({100 * share:.0f} % of its u²)" for source, share in shares if share > _LEAST_SHARE]
    said = [f"K' rests on {', '.join(parts)}"] if parts else []
    if hidden:
        named = [component.brief for component in hidden[:_MOST_HIDDEN]]
        more = f", and {len(hidden) - _MOST_HIDDEN} more" if len(hidden) > _MOST_HIDDEN else ""
        said.append(f"these tests would not show {'; '.join(named)}{more}")
    return "; ".join(said)


def _in_words(source: Source) -> str:
    """A stated value by its name in a sentence, with the article."""
    if source.role is Role.MASS:
        return f"the added mass of {source.mass:g} kg"
    if source.of_channel:
        return f"the {source.kind.text.strip()} of {source.of}"
    return f"the {source.of.replace('_', ' ')}" if source.role is Role.RIG else source.text


def _shares(joint: Joint, values: Outputs) -> dict[Source, float]:
    """Share of each shared value in the variance of K', as the median of all tests."""
    tyres = np.isfinite(values.value[:, 0])
    whole = values.covariance_of(slice(0, 1), np.zeros(tyres.size))[:, 0, 0]
    shares: dict[Source, float] = {}
    if tyres.any() and np.all(whole[tyres] > 0):
        moved = (values.by_shared[tyres, 0] @ values.covariance) ** 2 / whole[tyres, None]
        for index, parameter in enumerate(joint.problem.shared.parameters):
            shares[parameter.source] = shares.get(parameter.source, 0.0) + float(np.median(moved[:, index]))
    return shares


def unseen_components(joint: Joint, values: Outputs) -> tuple[Unseen, ...]:
    """What the tests cannot see, with the words and the key of each."""
    return tuple(
        Unseen(
            **{name: getattr(row, name) for name in ("source", "unit", "size", "result", "shift", "never")},
            words=cause_words(cause_of([_as_parameter(joint, row)], np.array([row.size]), np.zeros(1))),
            key=key_of(row.source),
        )
        for row in unseen(joint, values)
    )


def _as_parameter(joint: Joint, row: UnseenComponent) -> SharedParameter:
    stated = next((known.stated for known in joint.stated.parameters if known.source == row.source), 0.0)
    return SharedParameter(row.source, row.unit, 0, stated, row.size)


def with_recordings(estimate: RigEstimate, checks: Sequence[Sequence[Check]]) -> RigEstimate:
    """The estimate with the faults that most recordings show by themselves as the first causes of a misfit."""
    if (estimate.fits and estimate.converged) or not checks:
        return estimate
    least = (_MOST if estimate.converged else _SOME) * len(checks)
    faults = [
        {(check.code, check.channel) for check in of_test if check.code in _SPOILS and check.verdict is not Verdict.OK}
        for of_test in checks
    ]
    shown = Counter(fault for of_test in faults for fault in of_test)
    causes = tuple(
        replace(_shown_by_recordings(*fault, count, len(checks)), explains=estimate.chi2 or 0.0)
        for fault, count in shown.most_common()
        if count >= least
    )
    return replace(estimate, candidates=(*causes, *estimate.candidates), tied=len(causes) + estimate.tied)


def _shown_by_recordings(code: Code, channel: str, count: int, of: int) -> Candidate:
    """A fault that `count` of `of` recordings show, as a cause without a size."""
    shown = {"count": count, "of": of, "channel": channel, "code": code}
    source = Source(Kind.OTHER, code.text)
    return Candidate("recordings", np.nan, np.nan, "1", 0.0, source, 0.0, "recordings", shown)


def residual_columns(joint: Joint, phasors: Phasors) -> dict[str, FloatArray]:
    """The columns of residuals.csv in the order of the tests, without test and rig."""
    left, problem = joint.residuals, joint.problem
    place = np.argsort(joint.order)
    impedance = problem.columns("impedance", joint.solution.z, joint.solution.stiffness)[place]
    std = np.sqrt(np.diagonal(left.impedance_covariance, 0, 1, 2))
    return {
        q.ADDED_MASS.head: problem.observed.added(problem.shared.masses)[place],
        q.FREQUENCY.head: phasors.frequency,
        q.RESIDUAL_RE.head: left.impedance.real,
        q.RESIDUAL_IM.head: left.impedance.imag,
        q.RESIDUAL_RE.u_head: std[:, 0],
        q.RESIDUAL_IM.u_head: std[:, 1],
        q.ZR.parts[0]: impedance.real,
        q.ZR.parts[1]: impedance.imag,
        q.CHI2.head: left.rig,
        q.DOF.head: left.rig_dof,
        q.OUTLIER.head: joint.outlier,
    }


def relative_uncertainties(result: Identification, exact: Identification, rows: BoolArray) -> dict[str, float]:
    """Median relative uncertainties [1] of K' (over the modulus of K*), of K2 and of C.

    K2 and C stand with the uncertainty of K1, and without it as `exact` has them.
    """
    with np.errstate(invalid="ignore"):
        relative = {"K'": np.sqrt(result.stiffness_covariance[rows, 0, 0]) / np.abs(result.stiffness[rows])}
        for identified, words in ((result, "{}"), (exact, "{}, K1 known")):
            k2_std, c_std = np.sqrt(np.diagonal(identified.arm_covariance[rows], 0, 1, 2)).T
            relative[words.format("K2")] = k2_std / identified.k2[rows]
            relative[words.format("C")] = c_std / identified.c[rows]
    known = {name: value[np.isfinite(value)] for name, value in relative.items()}
    return {name: float(np.median(value)) for name, value in known.items() if value.size}
