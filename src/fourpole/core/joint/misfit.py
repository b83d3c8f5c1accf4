"""Agreement of the stated rig with the tests: residuals of each test, their chi-square, and possible causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ByRows, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE
from fourpole.core.joint.model import (
    Linear,
    Observed,
    cholesky_qr,
    inverse_upper,
    part_shapes,
    projected,
    upper_factor,
    whitened,
)
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.joint.solve import Problem, Solution, with_columns, without_stiffness
from fourpole.core.rig import Rig
from fourpole.core.sources import PARTS, Kind, Role, Source

#: An error below this share of a channel, or of the largest part of Zr, counts as noise: no rig is built so accurately.
NEGLIGIBLE = 1e-4
#: Roles of the values that have a statement.
STATED = (Role.RIG, Role.CHANNEL, Role.MASS)
#: A stated value of which the tests know less than this share of its variance has no pull. Information below the second
#: share is round-off.
_INFORMED, _ROUND_OFF = 1e-3, 1e-8
#: Largest error of a channel that can be a cause: gain [1], phase [rad], delay [s].
_LARGEST = {
    Kind.GAIN: 0.25,
    Kind.PHASE: 0.25,
    Kind.DELAY: 3e-3,
    Kind.GAIN_DRIFT: 0.25,
    Kind.CROSSTALK: 0.25,
    Kind.AMPLITUDE: 1.0,
}
#: Largest error of a mass or a spring, and largest unstated part, that can be a cause: over the stated value.
_LARGEST_SHARE = 0.5
#: A stated value is a cause only if the tests know it to this share of its largest error.
_KNOWN = 0.2
_BULK = ("moving_mass", "preload_stiffness", "frame_stiffness")
#: A candidate is not identifiable when less than this fraction of its squared column norm remains after projecting out
#: the free parameters.
_IDENTIFIABLE = 1e-20


@dataclass(frozen=True, eq=False)
class Residuals(ByRows):
    """Residuals of each test.

    Attributes
    ----------
    impedance : (N,) complex array [N s/m]
        F1/V2 - Zr, corrected for the gains found; not-a-number if F1 or V2 is absent.
    impedance_covariance : (N, 2, 2) float array
        Covariance of its Re and Im from the noise.
    rig, rig_dof : (N,) float arrays [1]
        Squared normalised residual that no K* can explain, and its degrees of freedom.
    tyre : (N,) float array [1]
        Squared normalised residual that another K* for this test alone would explain.
    rig_part, rig_weight : (N, 2) float array, (N, 2, 2) float array
        Half the fall of the squared residual that no K* can explain per change of Re and Im of Zr, and half its second
        derivative.
    """

    impedance: ComplexArray
    impedance_covariance: FloatArray
    rig: FloatArray
    rig_dof: FloatArray
    tyre: FloatArray
    rig_part: FloatArray
    rig_weight: FloatArray

    @property
    def whole(self) -> FloatArray:
        """Squared normalised residual of rig and tyre together (N,) [1]."""
        return self.rig + self.tyre


def residuals(problem: Problem, solution: Solution) -> Residuals:
    """Residuals of a solution, in the order of the problem."""
    parts = [
        _residuals(problem.observed.part(rows), linear)
        for rows, _, linear in problem.linearised(solution.z, solution.stiffness)
    ]
    return Residuals(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _residuals(observed: Observed, linear: Linear) -> tuple[np.ndarray, ...]:
    """The fields of `Residuals` for some tests."""
    by_k = linear.by_stiffness
    basis, _ = cholesky_qr(by_k)
    tyre = np.einsum("nij,ni->nj", basis, linear.residual)
    rest = projected(basis, linear.residual[..., None])[..., 0]
    by_zr = projected(basis, linear.by_impedance)
    rig_weight, rig_part = np.swapaxes(by_zr, 1, 2) @ by_zr, np.einsum("nij,ni->nj", by_zr, rest)
    inverse = inverse_upper(upper_factor(rig_weight))
    covariance = inverse @ np.swapaxes(inverse, 1, 2)
    off = (covariance @ rig_part[..., None])[..., 0]
    present = np.abs(observed.amplitudes) > 0
    dof = 2 * present.sum(axis=1) - np.where(observed.rigid, 2, 4)
    both = present[:, 0] & present[:, 2]
    return (
        np.where(both, off[:, 0] + 1j * off[:, 1], np.nan),
        np.where(both[:, None, None], covariance, np.nan),
        np.sum(rest**2, axis=1),
        np.maximum(dof, 0),
        np.sum(tyre**2, axis=1),
        rig_part,
        rig_weight,
    )


def pulls(solution: Solution) -> FloatArray:
    """Departure of each shared value from its statement, in standard uncertainties of that departure (p,) [1].

    Not-a-number for a value that the tests do not improve.
    """
    gained = 1.0 - np.diag(solution.covariance)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(gained > _INFORMED, solution.z / np.sqrt(gained), np.nan)


def is_unlikely(chi2: float, dof: float) -> bool:
    """Whether the probability of a larger chi-square by noise alone is below `CHANCE`."""
    return bool(dof > 0 and stats.chi2.sf(chi2, dof) < CHANCE)


def largest_part(problem: Problem, z: FloatArray, stiffness: ComplexArray) -> FloatArray:
    """Modulus of the larger part of Zr, mass or spring (N,) [N s/m]; unlike Zr it does not vanish at resonance.

    It is that at shared values z and K* of each condition.
    """
    rig, omega = problem.shared.rig_at(z), problem.observed.omega
    return larger_part(problem.columns("impedance", z, stiffness), omega, rig)


def larger_part(impedance: ComplexArray, omega: FloatArray, rig: Rig) -> FloatArray:
    """Modulus of the larger part, mass or spring, of Zr = `impedance` (N,) [N s/m]."""
    spring = rig.preload_stiffness / omega
    return np.maximum(np.abs(impedance + 1j * spring), spring)


@dataclass(frozen=True)
class Candidate:
    """One cause that would lower the misfit: an error of a stated value, or a part or error that nobody stated.

    Attributes
    ----------
    name : str
        Name of the cause, as in tyre mass, frame, leaf friction or sensor F1.
    value, std : float
        Its estimated size and standard uncertainty, in the unit.
    unit : str
        SI unit of `value`.
    explains : float [1]
        Fall of chi-square with this cause.
    source : Source
        The stated value, the unstated part of the rig, or the error of a channel.
    size : float
        Its estimated size in the unit of `core.sources.PARTS`, of the error of the channel, or of the stated value.
    form : str
        Its form in words, a key of `causes` in `fourpole/words/words.toml`.
    values : mapping of str to object
        What these words name: names of channels, numbers in their units.
    released : bool
        Whether it is a stated value without its statement; if not, nobody stated it.
    """

    name: str
    value: float
    std: float
    unit: str
    explains: float
    source: Source
    size: float
    form: str
    values: Mapping[str, Any] = field(default_factory=dict, hash=False)
    released: bool = False

    @property
    def of_rig(self) -> bool:
        """Whether the candidate is an unstated part of the rig."""
        return self.source.kind is Kind.UNSTATED


def candidates(problem: Problem, solution: Solution) -> list[Candidate]:
    """Causes that could explain a misfit, each by itself; the largest fall of chi-square comes first.

    Causes of impossible size are left out. A stated value is tried without its statement, and comes before what nobody
    stated if both explain the same.
    """
    causes = [*_released(problem, solution), *_unstated(problem, solution)]
    return sorted(causes, key=lambda cause: (-float(f"{cause.explains:.4g}"), not cause.released))


def _released(problem: Problem, solution: Solution) -> Iterator[Candidate]:
    """The stated values without their statement."""
    informed = 1.0 - np.diag(solution.covariance)
    for index, parameter in enumerate(problem.shared.parameters):
        if parameter.source.role not in STATED or informed[index] < _ROUND_OFF:
            continue
        z = float(solution.z[index])
        size, std = parameter.std * z / informed[index], parameter.std * np.sqrt(1 / informed[index] - 1)
        if _possible(parameter, size, std) and (cause := _described(parameter, size)):
            explains = min(z**2 / float(informed[index]), solution.objective)
            yield replace(cause, std=float(std), explains=explains, released=True)


def _unstated(problem: Problem, solution: Solution) -> Iterator[Candidate]:
    """The parts of a rig and the errors of the channels that are not among the shared values."""
    p, rig, extras = len(problem.shared), problem.shared.rig, _extras(problem)
    shared = {parameter.source for parameter in problem.shared.parameters}
    _, _, slope = _with_extras(problem, solution, np.zeros((problem.conditions.count, 2, p + len(extras))))
    triangle, size, _ = _with_extras(problem, solution, slope)
    block, target = triangle[p:-1, p:-1], triangle[p:-1, -1]
    weight, pull = np.sum(block**2, axis=0), block.T @ target
    for index, source in enumerate(extras):
        if not weight[index] > _IDENTIFIABLE * size[index] or source in shared:
            continue
        estimate = float(pull[index] / weight[index])
        error = index - len(PARTS) - 1
        if error >= 0 and abs(estimate) * np.abs(problem.observed.turns[..., error]).max() < NEGLIGIBLE:
            continue
        part = SharedParameter(source, "", 0, 1.0 if source.kind is Kind.GAIN else 0.0, 0.0)
        if _possible(part, estimate, whole=_whole(source, rig)) and (cause := _described(part, estimate)):
            std = abs(cause.value) * float(np.sqrt(weight[index]) / abs(pull[index]))
            yield replace(cause, std=std, explains=min(float(pull[index] ** 2 / weight[index]), solution.objective))


def _with_extras(problem: Problem, solution: Solution, slope: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Triangle of shared values, extra parts and residual; squared norms of the parts' columns; slope of log K*.

    `slope` (c, 2, p + extras) is the fall of log K* of each condition per unit of the shared values and parts.
    """
    shared = problem.shared
    p, rig = len(shared), shared.rig_at(solution.z)
    count = len(_extras(problem))
    triangle = np.hstack([np.eye(p), np.zeros((p, count)), -solution.z[:, None]])
    size, slopes = np.zeros(count), [np.zeros((0, 2, slope.shape[2]))]
    lead = problem.conditions.lead(slope)
    for rows, group, linear in problem.linearised(solution.z, solution.stiffness):
        extra = _extra_columns(problem.observed.part(rows), linear, rig)
        size += np.sum(extra**2, axis=(0, 1))
        moved = np.concatenate([linear.by_shared, extra], axis=2) + linear.by_stiffness @ lead[rows]
        columns = np.concatenate([moved, linear.residual[:, :, None]], axis=2)
        if group.stop > group.start:
            starts = problem.conditions.starts[group] - rows.start
            root, share, columns = without_stiffness(linear.by_stiffness, columns, starts)
            slopes.append((root @ share)[:, :, :-1])
        triangle = with_columns(triangle, columns)
    return triangle, size, np.concatenate(slopes)


def _extra_columns(observed: Observed, linear: Linear, rig: Rig) -> FloatArray:
    """Derivatives (N, 6, extras) by each part and error of `_extras`, with the drive projected out."""
    omega = observed.omega
    shapes = part_shapes(omega, rig, np.abs(linear.drive * linear.ratio), observed.rigid)
    changes = np.stack([shapes[part] for part in shapes], axis=-1)
    columns = (
        linear.by_impedance[:, :, :1] * changes.real[:, None] + linear.by_impedance[:, :, 1:] * changes.imag[:, None]
    )
    input_mass = np.zeros((omega.size, 3, 1), dtype=complex)
    input_mass[:, 0, 0] = 1j * omega * linear.drive
    sensor = np.concatenate([input_mass, observed.turns * linear.predicted[:, :, None]], axis=2)
    errors = projected(linear.frame, whitened(observed.whiten, sensor))
    errors = errors if linear.weigh is None else linear.weigh @ errors
    amplitude = linear.by_stiffness[:, :, :1] * observed.deflection[:, None, None]
    return np.concatenate([amplitude, columns, errors], axis=2)


def _extras(problem: Problem) -> tuple[Source, ...]:
    """The parts and errors that are tried as explanations, in the order of `_extra_columns`."""
    return (Source(Kind.AMPLITUDE), *(Source(Kind.UNSTATED, part) for part in PARTS), *problem.errors)


def _whole(source: Source, rig: Rig) -> float:
    """The stated value with which the size of an unstated part is compared, in its unit; infinite if there is none."""
    whole = {"mass": rig.moving_mass, "spring": rig.preload_stiffness, "frame": 1 / rig.preload_stiffness,
             "loss": 1.0, "input": rig.moving_mass}  # fmt: skip
    return whole.get(source.of, np.inf) if source.kind is Kind.UNSTATED else np.inf


def _possible(parameter: SharedParameter, size: float, std: float = 0.0, whole: float = np.inf) -> bool:
    """Whether an error of this size and standard uncertainty can be a cause.

    `whole` is the value with which an unstated part is compared.
    """
    kind, role = parameter.source.kind, parameter.source.role
    if kind in _LARGEST or role is Role.MASS or parameter.source.of in _BULK:
        largest = _LARGEST.get(kind, _LARGEST_SHARE * parameter.stated)
        return abs(size) <= largest and std <= _KNOWN * largest
    if role is Role.UNSTATED:
        return abs(size) <= _LARGEST_SHARE * whole
    return role is Role.CHANNEL or parameter.stated + size >= 0


def _described(parameter: SharedParameter, size: float) -> Candidate | None:
    """A cause of this size, with its name and words; None for a part whose size has an impossible sign."""
    source, kind, of = parameter.source, parameter.source.kind, parameter.source.of
    if kind is Kind.UNSTATED:
        return _described_part(source, size)
    name, unit, form = f"sensor {of}", "1", kind.name.lower()
    values: dict[str, Any] = {"of": of, "percent": 100 * size}
    if kind is Kind.AMPLITUDE:
        name, values = "specimen", {"percent": 100 * (2**size - 1)}
    elif kind is Kind.PHASE:
        unit, values = "rad", {"of": of, "degrees": np.degrees(size)}
    elif kind is Kind.DELAY:
        unit, form, values = "s", "late" if size > 0 else "early", {"of": of, "milliseconds": abs(size) * 1e3}
    elif kind is Kind.CROSSTALK:
        crossed, _, channel = of.partition(" in ")
        name, values = f"sensor {channel}", {"of": crossed, "into": channel, "percent": 100 * size}
    elif source.role is Role.CHANNEL and kind not in (Kind.GAIN, Kind.GAIN_DRIFT):
        form, values = "response", {"of": source.text, "times": abs(size)}
    elif source.role is not Role.CHANNEL:
        name, unit = "added mass" if source.role is Role.MASS else of.replace("_", " "), parameter.unit
        shown = unit if unit != "1" else ""
        form, values = "stated", {"value": parameter.stated + size, "stated": parameter.stated, "unit": shown}
    return Candidate(name, size, 0.0, unit, 0.0, source, size, form, values)


#: Name and unit of each part of `PARTS` as a cause.
_PART_NAMES = {
    "mass": ("tyre mass", "kg"),
    "spring": ("preload spring", "N/m"),
    "frame": ("frame", "N/m"),
    "loss": ("leaf friction", "1"),
    "friction": ("leaf friction", "N"),
    "input": ("input mass", "kg"),
}


def _described_part(source: Source, size: float) -> Candidate | None:
    """A part of the rig of this size; only a moving mass may be smaller than stated."""
    if size <= 0:
        smaller = Candidate("moving mass", size, 0.0, "kg", 0.0, source, size, "smaller_mass", {"size": -size})
        return smaller if source.of == "mass" else None
    name, unit = _PART_NAMES[source.of]
    value = 1 / size if source.of == "frame" else size  # the size of a frame is a compliance
    return Candidate(name, value, 0.0, unit, 0.0, source, size, source.of, {"size": value})


# ---- gross errors of a statement, which no small change of a value explains: a unit, a sign, exchanged columns

#: A ratio of F1 to what V2 and the rig need is gross beyond these: its logarithm [1], its angle [rad].
_GROSS, _TURNED = 0.25, 0.5
#: A factor or an exchange is recognised if the ratio is this close to it, in logarithm and angle.
_NEAR = 0.15
#: Tests in which Zr is below this share of its largest part are close to the rig's resonance, and are not used.
_RESONANT = 0.2
#: Share of the tests that must agree.
_MOST = 0.7
#: Factors by which F1 must be multiplied after a mistake of a unit, with the form of the cause in words.
_FACTORS = {9.80665: "f1_kgf_as_n", 1 / 9.80665: "f1_n_as_kgf", 1e3: "f1_kn_as_n", 1e-3: "f1_n_as_kn"}


def gross_errors(observed: Observed, shared: Shared) -> list[Candidate]:
    """The gross errors of F1 and V2 that most tests show; empty for none.

    Parameters
    ----------
    observed : Observed
        The tests, sorted or not.
    shared : Shared
        The rig and the masses as stated.
    """
    force, contact, wheel = observed.amplitudes.T
    impedance = np.asarray(shared.rig.impedance(observed.omega, observed.added(shared.masses)))
    input_force = 1j * observed.omega * shared.rig.input_mass * contact
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (force - input_force) / (impedance * wheel)
        exchanged = force / (impedance * contact)
    off_resonance = np.abs(impedance) > _RESONANT * larger_part(impedance, observed.omega, shared.rig)
    used = np.isfinite(ratio) & (ratio != 0) & (force != 0) & off_resonance
    if not used.any():
        return []
    other = exchanged[used]
    swapped = bool(np.all(np.isfinite(other))) and _is_one(*_middle(other)) and _agree(other)
    size, angle = _middle(ratio[used])
    if swapped and not (_is_one(size, angle) and _agree(ratio[used])):
        return [_gross("V1", 1.0, "exchanged")]
    small = abs(np.log(size)) < _GROSS and abs(angle) < _TURNED
    return _gross_causes(size, angle) if _agree(ratio[used]) and not small else []


def _gross_causes(size: float, angle: float) -> list[Candidate]:
    """The errors of F1 or V2 that give a ratio of this size and angle [rad]."""
    turned = abs(abs(angle) - np.pi) < _NEAR
    for factor, form in _FACTORS.items():
        if abs(np.log(size * factor)) < _NEAR and (turned or abs(angle) < _NEAR):
            return [_gross("F1", size, form, turned=turned), _gross("V2", size, "v2_unit", turned=turned)]
    if turned and abs(np.log(size)) < _NEAR:
        return [_gross(channel, size, "inverted", of=channel) for channel in ("F1", "V2")]
    degrees = np.degrees(angle)
    return [_gross("F1", size, "f1_off", times=size, degrees=degrees), _gross("V2", size, "v2_off", times=1 / size)]


def _gross(channel: str, size: float, form: str, **values: object) -> Candidate:
    """A gross error of a channel, whose factor is `size`; it counts as the cause of all of chi-square."""
    source = Source(Kind.GAIN, channel)
    return Candidate(f"sensor {channel}", size - 1, 0.0, "1", np.inf, source, size - 1, form, values)


def _middle(ratio: ComplexArray) -> tuple[float, float]:
    """Median size of ratios, and the angle of their mean direction [rad]."""
    turned = np.mean(ratio / np.abs(ratio))
    return float(np.median(np.abs(ratio))), float(np.angle(turned))


def _agree(ratio: ComplexArray) -> bool:
    """Whether most ratios are close to their middle."""
    size, angle = _middle(ratio)
    off: FloatArray = np.abs(np.log(ratio / (size * np.exp(1j * angle))))
    return bool(np.mean(off < 2 * _NEAR) > _MOST)


def _is_one(size: float, angle: float) -> bool:
    return abs(np.log(size)) < _NEAR and abs(angle) < _NEAR
