"""Agreement of the stated rig with the tests: residuals of each test, their chi-square, and possible causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ByRows, ComplexArray, FloatArray
from fourpole.core.components import component
from fourpole.core.confidence import CHANCE
from fourpole.core.joint.model import Linear, Observed, cholesky_qr, inverse_upper, projected, upper_factor
from fourpole.core.joint.shared import BLOCKS, DRIFTS, Shared, SharedParameter
from fourpole.core.joint.solve import Problem, Solution
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Role, Source

#: An error below this share of a channel, or of the largest part of Zr, counts as noise: no rig is built so accurately.
NEGLIGIBLE = 1e-4
#: A stated value of which the tests know less than this share of its variance has no pull.
_INFORMED = 1e-3


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


def cause_of(parameters: Sequence[SharedParameter], sizes: FloatArray, std: FloatArray) -> Candidate:
    """A group of components as a cause: their sizes as found (k,) and standard uncertainties (k,), each in its unit."""
    first = parameters[0]
    size, source = float(sizes[0]), first.source
    if source.kind is not Kind.UNSTATED and (
        len(parameters) > 1 or source.kind in (*DRIFTS, *BLOCKS) or source.role is Role.MOUNTING
    ):
        return _described_group(parameters, sizes, std)
    if source.kind is Kind.UNSTATED:
        cause = _described_part(source, size)
        if len(parameters) > 1:
            cause = replace(
                cause, form="mode", values={**cause.values, "hertz": parameters[1].stated + float(sizes[1])}
            )
        return replace(cause, std=abs(cause.value / size) * float(std[0]) if size else 0.0)
    if source.role in (Role.RIG, Role.MASS):
        shown = first.unit if first.unit != "1" else ""
        stated = {"value": first.stated + size, "stated": first.stated, "unit": shown}
        name = "added mass" if source.role is Role.MASS else source.of.replace("_", " ")
        return Candidate(name, size, float(std[0]), first.unit, 0.0, source, size, "stated", stated)
    crossed, _, into = source.of.partition(" in ")
    percent = {"of": source.of, "percent": 100 * size}
    response = ("1", "response", {"of": source.text, "times": abs(size)})
    delay = {"of": source.of, "milliseconds": abs(size) * 1e3}
    unit, form, values = {
        Kind.AMPLITUDE: ("1", "amplitude", {"percent": 100 * (2**size - 1)}),
        Kind.PHASE: ("rad", "phase", {"of": source.of, "degrees": np.degrees(size)}),
        Kind.DELAY: ("s", "late" if size > 0 else "early", delay),
        Kind.LOW_CUT: ("Hz", "low_cut", {"of": source.of, "hertz": abs(size)}),
        Kind.CROSSTALK: ("1", "crosstalk", {"of": crossed, "into": into, "percent": 100 * size}),
        Kind.RESPONSE_GAIN: response,
        Kind.RESPONSE_PHASE: response,
    }.get(source.kind, ("1", source.kind.name.lower(), {**percent, "times": size}))
    of_specimen = source.kind in (Kind.SCATTER, Kind.AMPLITUDE)
    name = "specimen" if of_specimen else f"sensor {into or source.of}" if source.of_channel else source.text
    return Candidate(name, size, float(std[0]), unit, 0.0, source, size, form, values)


def _described_group(parameters: Sequence[SharedParameter], sizes: FloatArray, std: FloatArray) -> Candidate:
    """Several components as one cause, by the root mean square of moduli and of angles."""
    source = parameters[0].source
    angle = np.array([parameter.unit == "rad" for parameter in parameters])
    percent, degrees = (float(np.sqrt(np.mean(sizes[part] ** 2))) if part.any() else 0.0 for part in (~angle, angle))
    u = float(np.sqrt(np.mean(std[~angle] ** 2))) if (~angle).any() else 0.0
    mounted = source.role is Role.MOUNTING
    values = {"of": source.of, "percent": 100 * percent, "degrees": np.degrees(degrees)}
    name, form = f"sensor {source.of}" if mounted else "specimen", component(source.kind).group
    return Candidate(name, percent, u, "1", 0.0, source, percent, form, values)


#: Name and unit of each part of `PARTS` as a cause.
_PART_NAMES = {
    "mass": ("tyre mass", "kg"),
    "spring": ("preload spring", "N/m"),
    "frame": ("frame", "N/m"),
    "loss": ("leaf friction", "1"),
    "friction": ("leaf friction", "N"),
    "input": ("input mass", "kg"),
}


def _described_part(source: Source, size: float) -> Candidate:
    """A part of the rig of this size; only a moving mass may be smaller than stated."""
    if size <= 0 and source.of == "mass":
        return Candidate("moving mass", size, 0.0, "kg", 0.0, source, size, "smaller_mass", {"size": -size})
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
#: Gross errors that no inertia of a specimen looks like.
UNITS_AND_SIGNS = (*_FACTORS.values(), "v2_unit", "inverted", "exchanged")


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


# ---- a stated value that K* of neighbouring frequencies contradicts

#: Standard deviations of log K* about the line through its neighbours that are compared: the smallest, the largest and
#: their number; a specimen is never smoother than the smallest.
_SMOOTHEST, _ROUGHEST, _GRADES = 0.01, 3.0, 20
#: Steps of the shared values for each of them, the longest in standard uncertainties, and most conditions that count.
_MOVES, _LONGEST, _MOST_LINES = 4, 3.0, 2000
#: A stated value is contradicted if K* moves by more than so many u, and the evidence rises by more than this.
_BEYOND, _RISES = 3.0, 5.0
#: Values that move by at least this share of the largest explain as much.
_AS_MUCH = 0.8


def contradicted_by_neighbours(problem: Problem, solution: Solution) -> tuple[Candidate, ...]:
    r"""The stated values with which K* of neighbouring frequencies would be on one line, the largest first.

    K* of each condition is free, so that a wrong gain may be explained by any K*. But K* of a specimen is smooth over
    frequency: log K* of a condition lies about the line through its neighbours in log frequency, with the standard
    deviation that suits the tests best. The shared values are moved from those found, with their covariance, to where
    both together are most probable. 1/K* is linear in the gains of the motions, so that with the slope B

    .. math:: \log K(\delta z) = \log\hat K - \log(1 + B\,\delta z)

    Returns
    -------
    tuple of Candidate
        Empty if K* would move by no more than its uncertainty.
    """
    lines = _Lines.of(problem, solution)
    if lines is None:
        return ()
    sizes = np.geomspace(_ROUGHEST, _SMOOTHEST, _GRADES).tolist()
    move = found = np.zeros(len(problem.shared))
    before = max(lines.evidence(move, size) for size in sizes)
    best = before + _RISES
    for size in sizes:
        for _ in range(_MOVES):
            step = lines.step(move, size)
            move = move + step * min(1.0, _LONGEST / max(float(np.linalg.norm(step)), _LONGEST))
        if (now := lines.evidence(move, size)) > best:
            best, found = now, move
    if lines.shift(found) < _BEYOND:
        return ()
    std, moved = np.sqrt(np.diag(solution.covariance)), lines.root @ found
    pull = np.abs(moved) / std
    pull[[row.source.role is Role.SPECIMEN for row in problem.shared.parameters]] = 0.0
    causes = []
    for place in [place for place in np.argsort(-pull).tolist() if pull[place] > _AS_MUCH * pull.max()]:
        unit = problem.shared.std[[place]]
        cause = cause_of([problem.shared.parameters[place]], (solution.z + moved)[[place]] * unit, std[[place]] * unit)
        causes.append(replace(cause, explains=2 * (best - before), released=True))
    return tuple(causes)


@dataclass(frozen=True, eq=False)
class _Lines:
    """log K* of n conditions with a neighbour on each side, about the lines through these.

    Attributes
    ----------
    log_k, weight : (n, 3) complex and float arrays
        log K* of the condition below, of itself and above, and the weights with which they sum to its departure.
    by : (n, 3, p) complex array
        Rise of log K* by p independent moves of the shared values, each of one standard uncertainty.
    variance : (n,) float array
        Variance of the departure by the noise.
    u : (n,) float array
        Standard uncertainty of log K*.
    root : (p, p) float array
        The moves in stated standard uncertainties.
    """

    log_k: ComplexArray
    weight: FloatArray
    by: ComplexArray
    variance: FloatArray
    u: FloatArray
    root: FloatArray

    @classmethod
    def of(cls, problem: Problem, solution: Solution) -> _Lines | None:
        """The lines of a solution; None if there are no more than two."""
        conditions, family = problem.conditions, problem.conditions.family
        middle = 1 + np.flatnonzero(family[2:] == family[:-2])[:: 1 + family.size // _MOST_LINES]
        if middle.size <= 2 or not len(problem.shared):
            return None
        place = middle[:, None] + np.array([-1, 0, 1])
        at = np.log(conditions.mean_frequency[place])
        below = (at[:, 2] - at[:, 1]) / (at[:, 2] - at[:, 0])
        weight = np.stack([-below, np.ones(middle.size), below - 1.0], axis=1)
        values, vectors = np.linalg.eigh(solution.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        by = -np.array([1.0, 1.0j]) @ (solution.slope[place] @ root)
        own = np.trace(solution.own + solution.doubt, axis1=1, axis2=2)[place] / 2
        u = np.sqrt(own[:, 1] + np.sum(np.abs(by[:, 1]) ** 2, axis=1) / 2 + NEGLIGIBLE**2)
        return cls(np.log(solution.stiffness)[place], weight, by, np.sum(weight**2 * own, axis=1), u, root)

    def _rest(self, move: FloatArray) -> ComplexArray:
        """1/K* of the conditions over that found (n, 3) after a move (p,)."""
        return np.asarray(1.0 - self.by @ move)

    def _off(self, move: FloatArray) -> ComplexArray:
        """Departures (n,) from the lines after a move."""
        off = np.sum(self.weight * (self.log_k - np.log(self._rest(move))), axis=1)
        return np.asarray(off.real + 1j * np.angle(np.exp(1j * off.imag)))

    def evidence(self, move: FloatArray, size: float) -> float:
        """Logarithm of the probability of the departures and of a move, if the departures have this size."""
        variance = self.variance + size**2
        squares = np.abs(self._off(move)) ** 2 / variance
        return float(-0.5 * np.sum(squares) - np.sum(np.log(variance)) - 0.5 * move @ move)

    def step(self, move: FloatArray, size: float) -> FloatArray:
        """Gauss-Newton step (p,) of a move to the largest evidence."""
        root = np.sqrt(self.variance + size**2)
        by = np.sum((self.weight / self._rest(move))[:, :, None] * self.by, axis=1) / root[:, None]
        off = self._off(move) / root
        normal = np.eye(move.size) + (by.conj().T @ by).real
        return np.asarray(np.linalg.solve(normal, -move - (by.conj().T @ off).real))

    def shift(self, move: FloatArray) -> float:
        """Median change of K* by a move, in its standard uncertainty."""
        return float(np.median(np.abs(np.log(self._rest(move)[:, 1])) / self.u))
