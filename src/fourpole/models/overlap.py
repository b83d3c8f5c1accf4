"""Overlaps of neighbouring isotherms: how long they are, and whether both isotherms follow one curve there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.models.superposition import FEWEST_POINTS, Superposition, common_range, inside

#: Overlap [decades] below which a shift factor rests on few points.
SHORT = 0.3
#: Verdicts on an overlap: the isotherms follow one curve; their loss factors differ; only their levels differ; the
#: overlap is too short for a verdict.
ONE_CURVE, LOSS, LEVEL, TOO_SHORT = "one curve", "loss factor", "level", "short"
#: Relative difference of K', K'' or the loss factor below which isotherms count as one curve, whatever chance says:
#: an error of the temperature of a few tenths of a kelvin has this effect.
_MATERIAL = 0.03
#: Highest order of the curve through both isotherms of an overlap, in ln(frequency).
_ORDER = 3


@dataclass(frozen=True)
class Overlap:
    """The overlap of two neighbouring isotherms.

    Attributes
    ----------
    temperatures : (float, float) [degC]
    decades : float
        Length of the common range of reduced frequency.
    points : int
        Least number of points of one isotherm in it.
    chi2, dof : float, int
        Squared differences in level and slope of K' and of K'' between the isotherms, in standard uncertainties, and
        their number less the shifts fitted.
    chance : float [1]
        Probability of a larger chi-square by noise alone.
    level, loss : float [1]
        Relative difference of K', and of the loss factor, warm less cold, in the middle of the overlap.
    verdict : str
        `ONE_CURVE`, `LOSS`, `LEVEL` or `TOO_SHORT`.
    """

    temperatures: tuple[float, float]
    decades: float
    points: int
    chi2: float
    dof: int
    chance: float
    level: float
    loss: float
    verdict: str


def overlaps(found: Superposition) -> tuple[Overlap, ...]:
    """The overlaps of all neighbours, rising in temperature.

    The loss factor does not change with a vertical shift, so a difference in it shows that no shifts whatever make the
    isotherms one curve: the material is not thermorheologically simple there, or the loss angle is wrong.
    """
    count = len(found.isotherms) - 1
    limit = SEARCH_CHANCE / max(count, 1)
    return tuple(_overlap(found, at, limit) for at in range(count))


def _overlap(found: Superposition, at: int, limit: float) -> Overlap:
    pair = found.isotherms[at], found.isotherms[at + 1]
    ends = common_range(*pair, found.log_a[at], found.log_a[at + 1])
    kept = [inside(one, found.log_a[at + i], ends) for i, one in enumerate(pair)]
    points = int(min(rows.sum() for rows in kept))
    decades = float(np.log10(ends[1] / ends[0])) if ends[1] > ends[0] else 0.0
    temperatures = pair[0].temperature, pair[1].temperature
    if points < FEWEST_POINTS:
        return Overlap(temperatures, decades, points, 0.0, 0, float("nan"), float("nan"), float("nan"), TOO_SHORT)
    x, side, k, errors = _joined(found, at, kept)
    middle = x - np.log(np.sqrt(ends[0] * ends[1]))
    storage = _apart(middle, side, np.log(k.real), errors[:, 0] / k.real)
    lost = _apart(middle, side, np.log(np.abs(k.imag)), errors[:, 1] / np.abs(k.imag))
    both = np.hypot(errors[:, 0] / k.real, errors[:, 1] / np.abs(k.imag))
    ratio = _apart(middle, side, np.log(np.abs(k.imag) / k.real), both)
    chi2, dof = storage.chi2 + lost.chi2, max(2 * storage.dof - (2 if found.vertical else 1), 1)
    chance = float(stats.chi2.sf(chi2, dof))
    verdict = ONE_CURVE
    if decades < SHORT:
        verdict = TOO_SHORT
    elif chance < limit and max(storage.largest, lost.largest, ratio.largest) > _MATERIAL:
        odd = stats.chi2.sf(ratio.chi2, ratio.dof) < limit and ratio.largest > _MATERIAL
        verdict = LOSS if odd else LEVEL
    return Overlap(temperatures, decades, points, chi2, dof, chance, storage.middle, ratio.middle, verdict)


def _joined(
    found: Superposition, at: int, kept: list[np.ndarray]
) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
    """Points of both isotherms in their overlap: ln(reduced frequency), side (0 cold, 1 warm), K* and its errors."""
    parts = []
    for i, rows in enumerate(kept):
        omega, stiffness = found.reduced(at + i)
        errors = found.errors[at + i][rows] * np.exp(found.log_b[at + i])
        parts.append((np.log(omega[rows]), np.full(int(rows.sum()), float(i)), stiffness[rows], errors))
    x, side, k, errors = (np.concatenate(part) for part in zip(*parts, strict=True))
    return x, side, k, errors


@dataclass(frozen=True)
class _Apart:
    """Relative difference of two curves in the middle of their overlap, the largest one, chi-square and its dof."""

    middle: float
    largest: float
    chi2: float
    dof: int


def _apart(x: FloatArray, side: FloatArray, y: FloatArray, std: FloatArray) -> _Apart:
    """The difference of two curves in their overlap, in level and slope.

    One polynomial goes through both curves, and one of them has a level and a slope of its own besides.
    """
    order = int(min(_ORDER, max(1, x.size - 4)))
    common = np.vander(x, order + 1, increasing=True)
    slope = min(side.sum(), side.size - side.sum()) > FEWEST_POINTS
    own = np.stack([side, side * x], axis=1)[:, : 2 if slope else 1]
    basis = np.linalg.qr(common / std[:, None])[0]
    target, rows = y / std, own / std[:, None]
    target, rows = target - basis @ (basis.T @ target), rows - basis @ (basis.T @ rows)
    value = np.linalg.lstsq(rows, target, rcond=None)[0]
    largest = float(np.max(np.abs((own @ value)[side == 1])))
    return _Apart(float(np.expm1(value[0])), largest, float(np.sum((rows @ value) ** 2)), own.shape[1])
