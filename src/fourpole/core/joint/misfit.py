"""Whether the rig as stated can be true: residuals test by test, their chi-square, and what would explain them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
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
from fourpole.core.joint.solve import Problem, Solution, with_columns, without_stiffness
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.rig import Rig
from fourpole.core.sources import PARTS, Kind, Source

__all__ = ["Candidate", "Residuals", "candidates", "pulls", "residuals"]

#: A chi-square less likely than this is a misfit.
UNLIKELY = 1e-3
#: A part of which no more than this share is left, when all that is free is fitted out of it, cannot be told.
_SEEN = 1e-20


@dataclass(frozen=True, eq=False)
class Residuals(ByValue):
    """What the fit leaves, test by test, in the order of the problem.

    Attributes
    ----------
    impedance : (N,) complex array [N s/m]
        F1/V2 - Zr, corrected for the gains found; not-a-number where F1 or V2 is absent.
    impedance_covariance : (N, 2, 2) float array
        Of its Re and Im, from the noise.
    rig, rig_dof : (N,) float arrays [1]
        Squared normalised residual that no K* could explain, and its degrees of freedom.
    tyre : (N,) float array [1]
        The rest: how far K* of this test is from that of its condition.
    tyre_part, tyre_weight : (N, 2) float array, (N, 2, 2) float array
        What it says of log K*: its derivative, and how it weighs a change.
    rig_part, rig_weight : (N, 2) float array, (N, 2, 2) float array
        What the rig's part says of Zr, in the same way.
    """

    impedance: ComplexArray
    impedance_covariance: FloatArray
    rig: FloatArray
    rig_dof: FloatArray
    tyre: FloatArray
    tyre_part: FloatArray
    tyre_weight: FloatArray
    rig_part: FloatArray
    rig_weight: FloatArray

    @property
    def whole(self) -> FloatArray:
        """Both parts."""
        return self.rig + self.tyre


def residuals(problem: Problem, solution: Solution) -> Residuals:
    """Residuals of a solution."""
    parts = [
        _of_chunk(problem.observed.part(rows), linear)
        for rows, _, linear in problem.linearised(solution.z, solution.stiffness)
    ]
    return Residuals(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _of_chunk(observed: Observed, linear: Linear) -> tuple[np.ndarray, ...]:
    by_k, tyre_weight = linear.by_stiffness, _gram(linear.by_stiffness)
    basis, _ = cholesky_qr(by_k)
    tyre = _across(basis, linear.residual)
    fit_out = projected(basis)
    rest = fit_out(linear.residual[..., None])[..., 0]
    by_zr = fit_out(linear.by_impedance)
    rig_weight, rig_part = _gram(by_zr), _across(by_zr, rest)
    inverse = inverse_upper(upper_factor(rig_weight))
    covariance = inverse @ np.swapaxes(inverse, 1, 2)
    off = (covariance @ rig_part[..., None])[..., 0]
    present = np.abs(observed.amplitudes) > 0
    dof = 2 * present.sum(axis=1) - np.where(observed.rigid, 2, 4)
    seen = present[:, 0] & present[:, 2]
    return (
        np.where(seen, off[:, 0] + 1j * off[:, 1], np.nan),
        np.where(seen[:, None, None], covariance, np.nan),
        np.sum(rest**2, axis=1),
        np.maximum(dof, 0),
        np.sum(tyre**2, axis=1),
        _across(by_k, linear.residual),
        tyre_weight,
        rig_part,
        rig_weight,
    )


def _gram(columns: FloatArray) -> FloatArray:
    return np.swapaxes(columns, 1, 2) @ columns


def _across(columns: FloatArray, vector: FloatArray) -> FloatArray:
    return np.einsum("nij,ni->nj", columns, vector)


def pulls(solution: Solution) -> FloatArray:
    """How far each shared value is drawn from what is stated, in the uncertainty of that distance.

    Not-a-number where the tests say nothing of it.
    """
    gained = 1.0 - np.diag(solution.covariance)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(gained > 1e-3, solution.z / np.sqrt(gained), np.nan)


def is_unlikely(chi2: float, dof: float) -> bool:
    """Whether chance gives such a chi-square less than once in a thousand."""
    return bool(dof > 0 and stats.chi2.sf(chi2, dof) < UNLIKELY)


@dataclass(frozen=True)
class Candidate:
    """One unstated part that would lower the misfit.

    Attributes
    ----------
    name : str
        tyre mass, frame, leaf friction, sensor ...
    value, std : float
        Its size by the data, and the standard uncertainty of that, in the unit.
    unit : str
    explains : float [1]
        By how much chi-square would fall.
    source : Source
        An unstated part of the rig, or an error of a channel.
    size : float
        Its size in the model's terms.
    text : str
        The part in words, with its size.
    """

    name: str
    value: float
    std: float
    unit: str
    explains: float
    source: Source
    size: float
    text: str

    @property
    def of_rig(self) -> bool:
        """Whether it is a part of the rig, not a sensor."""
        return self.source.kind is Kind.UNSTATED


def candidates(problem: Problem, solution: Solution) -> list[Candidate]:
    """Unstated parts, by how much of the misfit each alone would explain, best first."""
    p = len(problem.shared)
    _, _, slope = _with_extras(problem, solution, np.zeros((problem.conditions.count, 2, p + len(_EXTRAS))))
    triangle, size, _ = _with_extras(problem, solution, slope)
    block, target = triangle[p:-1, p:-1], triangle[p:-1, -1]
    weight, pull = np.sum(block**2, axis=0), block.T @ target
    found = []
    for at, (source, words) in enumerate(_EXTRAS.items()):
        if weight[at] > _SEEN * size[at] and (said := words(float(pull[at] / weight[at]))) is not None:
            relative = float(np.sqrt(weight[at]) / abs(pull[at]))
            name, value, unit, text = said
            explains = min(float(pull[at] ** 2 / weight[at]), solution.objective)
            std = abs(value) * relative
            found.append(Candidate(name, value, std, unit, explains, source, float(pull[at] / weight[at]), text))
    return sorted(found, key=lambda candidate: -candidate.explains)


def _with_extras(problem: Problem, solution: Solution, slope: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Triangle of shared values, extra parts and residual; size of the parts' columns; slope of log K* with all.

    `slope` is that of the neighbours, whose K* each test's is carried by.
    """
    shared = problem.shared
    p, rig = len(shared), shared.rig_at(solution.z)
    triangle = np.hstack([np.eye(p), np.zeros((p, len(_EXTRAS))), -solution.z[:, None]])
    size, slopes = np.zeros(len(_EXTRAS)), [np.zeros((0, 2, slope.shape[2]))]
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
    """Derivatives (N, 6, extras) by each part of `_EXTRAS`, the drive fitted out."""
    omega = observed.omega
    shapes = part_shapes(omega, rig, np.abs(linear.drive * linear.ratio), observed.rigid)
    changes = np.stack([shapes[part] for part in PARTS], axis=-1)
    columns = (
        linear.by_impedance[:, :, :1] * changes.real[:, None] + linear.by_impedance[:, :, 1:] * changes.imag[:, None]
    )
    sensor = np.zeros((omega.size, 3, 9), dtype=complex)
    for at in range(3):
        one = linear.predicted[:, at]
        sensor[:, at, at], sensor[:, at, 3 + at], sensor[:, at, 6 + at] = one, 1j * one, -1j * omega * one
    return np.concatenate([columns, projected(linear.frame)(whitened(observed.whiten, sensor))], axis=2)


_Said = tuple[str, float, str, str] | None


def _mass(change: float) -> _Said:
    if change > 0:
        text = f"a moving mass {change:.3g} kg larger than stated, as an undeclared tyre mass would make it"
        return "tyre mass", change, "kg", text
    return "moving mass", change, "kg", f"a moving mass {-change:.3g} kg smaller than stated"


def _frame(compliance: float) -> _Said:
    if compliance <= 0:
        return None
    text = f"a frame of {1 / compliance:.3g} N/m behind the preload spring, or a spring softer by as much"
    return "frame", 1 / compliance, "N/m", text


def _spring(change: float) -> _Said:
    if change <= 0:
        return None
    return "preload spring", change, "N/m", f"a preload spring {change:.3g} N/m stiffer than stated"


def _loss(factor: float) -> _Said:
    return (
        ("leaf friction", factor, "1", f"a loss factor of {factor:.3g} in the preload spring") if factor > 0 else None
    )


def _friction(force: float) -> _Said:
    return ("leaf friction", force, "N", f"dry friction of {force:.3g} N in the preload spring") if force > 0 else None


def _gain(symbol: str) -> Callable[[float], _Said]:
    return lambda gain: (f"sensor {symbol}", gain, "1", f"a gain of {symbol} off by {100 * gain:+.2g} %")


def _phase(symbol: str) -> Callable[[float], _Said]:
    return lambda phase: (
        f"sensor {symbol}",
        phase,
        "rad",
        f"a phase of {symbol} off by {np.degrees(phase):+.2g} degrees at all frequencies",
    )


def _delay(symbol: str) -> Callable[[float], _Said]:
    return lambda delay: (
        f"sensor {symbol}",
        delay,
        "s",
        f"{symbol} {abs(delay) * 1e3:.3g} ms {'late' if delay > 0 else 'early'}",
    )


_SYMBOLS = tuple(SYMBOLS[role] for role in CHANNELS)
_WORDS = {"mass": _mass, "spring": _spring, "frame": _frame, "loss": _loss, "friction": _friction}
#: Each extra part with its words, in the order of `_extra_columns`.
_EXTRAS: dict[Source, Callable[[float], _Said]] = {
    **{Source(Kind.UNSTATED, part): _WORDS[part] for part in PARTS},
    **{Source(Kind.GAIN, symbol): _gain(symbol) for symbol in _SYMBOLS},
    **{Source(Kind.PHASE, symbol): _phase(symbol) for symbol in _SYMBOLS},
    **{Source(Kind.DELAY, symbol): _delay(symbol) for symbol in _SYMBOLS},
}
