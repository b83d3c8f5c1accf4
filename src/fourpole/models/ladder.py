r"""The verdict on K* of one condition: the smallest kind of passive linear specimen that can have it.

The rungs, from below, with :math:`s = j\omega` and :math:`d = s^2 + 2\zeta\omega_0 s + \omega_0^2`:

.. math::

    K^* = K_\infty + \sum_i K_i \frac{s\tau_i}{1 + s\tau_i} + s C \;\bigl[ + s^2 m \bigr]
    \;\Bigl[ + \sum_n \frac{a_n s^2 \omega_0 + b_n s\,(s + 2\zeta\omega_0)\,\omega_0}{d_n} \Bigr],
    \qquad K_\infty, K_i, C, m, a_n, b_n \ge 0

Each term over s is positive real, so that the fit at given poles is one convex problem. A sum of such terms is passive.
A passive specimen need not be such a sum, so that the last verdict is "none of these", and not "not passive".
The ladder climbs only where the rung below is unlikely and the next is better by far. Errors of the laboratory by one
number are tried beside it: a delay, cross-talk or a compliance may look like inertia.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.specimen import TYRE
from fourpole.errors import ModelError
from fourpole.models.causality import Possible, check_possible, grid_of, relaxing_terms
from fourpole.models.data import MASTER_DECADES, StiffnessData
from fourpole.models.inertial import Belt, Of, carried, inertia_of, springs_of, turned
from fourpole.models.nonnegative import least_squares, profile_ends, rise_of, whitened_conditions

#: A rung is better than the one below if its BIC is lower by this; a resonance, than every single error by more, be it
#: of the laboratory or of K* at one frequency.
_BETTER, _FAR_BETTER = 6.0, 10.0
#: Most resonances, and the fewest frequencies at which n of them can be told: the first number plus n times the second.
_MOST, _FEWEST, _EACH = 3, 4, 6
#: A resonance lies within these shares of the ends of the band.
_BELOW, _ABOVE = 0.7, 1.4
#: First frequencies and damping ratios of a resonance that are tried.
_HERTZ, _RATIOS = 24, (0.01, 0.03, 0.1, 0.4)
#: The same of a belt: number of frequencies, and the ratios m11/m12.
_BELT_HERTZ, _SHARES = 16, (0.05, 0.2, 1.0, 5.0)
#: Number of frequencies, those nearest to a resonance, of which each may be the wrong one in its place.
_SUSPECTS = 12
#: Least and largest damping ratio of a resonance.
_LEAST_RATIO, _LARGEST_RATIO = 1e-3, 2.0
_STEPS = 150
#: Step in the logarithms of a belt; Gauss-Newton turns about its springs; number of starts that are followed.
_STEP, _TURNS, _POLISHED = 1e-4, 3, 3
#: Number of draws from which the scatter of a belt is taken, and their seed.
_DRAWS, _SEED = 12, 0
#: First steps in the logarithms of a belt whose place is nearly known.
_NEAR = 0.005
#: Halvings of the interval in which the smallest error is looked for.
_HALVINGS = 7
#: Logarithms of q of the extreme biquadratics of a resonance, over its damping ratio.
_QS = np.concatenate([-np.geomspace(0.25, 16, 10)[::-1], np.geomspace(0.25, 16, 10)])


class Rung(StrEnum):
    """The kind of specimen."""

    RELAXING = "relaxing"
    MASS = "mass"
    RESONANT = "resonant"
    NONE = "none"


@dataclass(frozen=True)
class Lie:
    """An error of the laboratory with which a massless, relaxing specimen can have K*.

    Attributes
    ----------
    name : str
        delay, cross-talk, or compliance.
    size : float
        The smallest that is enough, in `unit`: larger ones may explain K* as well.
    unit : str
    bic : float
    """

    name: str
    size: float
    unit: str
    bic: float


@dataclass(frozen=True, eq=False)
class Verdict(ByValue):
    """The rung that holds, with what it has.

    Attributes
    ----------
    holds : Rung
    relaxing : Possible
        The test of the lowest rung.
    chi2, dof, chance : float, int, float [1]
        Chi-square of the rung that holds, or of the highest, and the probability of a larger one.
    mass, mass_std : float [kg]
        Mass at the driven end, and its standard uncertainty.
    resonances, ratios : (n,) float arrays [Hz], [1]
        Frequency and damping ratio of each resonance.
    lies : tuple of Lie
        Errors of the laboratory that explain K* too, the best first; empty where a relaxing specimen can have it.
    belt : Belt or None
        The belt whose resonance it is, where this is simpler than a sum of resonances.
    of : Of
    """

    holds: Rung
    relaxing: Possible
    chi2: float
    dof: int
    chance: float
    mass: float
    mass_std: float
    resonances: FloatArray
    ratios: FloatArray
    lies: tuple[Lie, ...]
    belt: Belt | None = None
    of: Of = Of.DRIVING_POINT

    @property
    def possible(self) -> bool:
        """Whether a passive linear specimen can have K*."""
        return self.holds is not Rung.NONE


@dataclass(frozen=True, eq=False)
class _Best(ByValue):
    """The best specimen of one kind: chi-square, number of its values, mass, and its resonances."""

    chi2: float
    free: int
    count: int
    mass: float
    places: FloatArray
    belt: tuple[float, ...] = ()

    @property
    def bic(self) -> float:
        return self.chi2 + self.free * float(np.log(self.count))

    @property
    def dof(self) -> int:
        return max(self.count - self.free, 1)

    @property
    def chance(self) -> float:
        """Probability of a larger chi-square."""
        return float(stats.chi2.sf(self.chi2, self.dof))


def verdict_of(data: StiffnessData, of: Of = Of.DRIVING_POINT, *, belted: bool = False) -> Verdict:
    """The smallest kind of passive linear specimen that can have K* of one condition.

    Parameters
    ----------
    data : StiffnessData
        Data of one condition, with K1 if it is known.
    of : Of
        What K* is of: springs have no inertia; a blocked transfer has that of a mass between two springs.
    belted : bool
        Whether the specimen is known to have a belt, so that no smaller kind is asked.

    Returns
    -------
    Verdict

    Raises
    ------
    ModelError
        If the data are of several conditions, or a belt is asked for that they cannot show.

    References
    ----------
    O. Brune, "Synthesis of a finite two-terminal network whose driving-point impedance is a prescribed function of
    frequency", J. Math. Phys. 10, 1931 (positive-real functions); G. Schwarz, "Estimating the dimension of a model",
    Annals of Statistics 6, 1978 (BIC).

    Examples
    --------
    A plate of 1 kg beneath the specimen that nobody stated:

    >>> omega = 2 * np.pi * np.linspace(8.0, 24.0, 12)
    >>> k = 2e5 * (1j * omega / 60) ** 0.06 - omega**2 * 1.0
    >>> found = verdict_of(StiffnessData.of(omega, k, 300.0))
    >>> found.holds.value, round(found.mass, 1)
    ('mass', 1.0)
    """
    relaxing = check_possible(data, SEARCH_CHANCE)
    lowest = _Best(relaxing.chi2, data.numbers - relaxing.dof, data.numbers, 0.0, np.zeros((0, 2)))
    if belted:
        return _with_belt(data, relaxing, of)
    if lowest.chance > SEARCH_CHANCE or data.omega.max() > 10.0**MASTER_DECADES * data.omega.min():
        rung = Rung.RELAXING if relaxing.possible else Rung.NONE  # inertia does not shift with temperature
        return _verdict(rung, relaxing, lowest, ())
    ladder = Ladder(data.at(relaxing.best))
    lies = tuple(sorted(ladder.lies(), key=lambda lie: lie.bic))
    least = min((lie.bic for lie in lies), default=np.inf) - _FAR_BETTER
    best = lowest
    for rung, tried in ladder.climbed(of):
        best = tried if tried.bic < best.bic - _BETTER else best
        good = best is not lowest and best.chance > SEARCH_CHANCE
        if good and rung is Rung.MASS and best is tried:
            break
        resonant = good and rung is Rung.RESONANT and bool(best.places.size or best.belt)
        if resonant and best.bic < least and best.bic < ladder.with_one_wrong(best) - _FAR_BETTER:
            break
    else:
        return _verdict(Rung.RELAXING if relaxing.possible else Rung.NONE, relaxing, lowest, lies, of=of)
    found = _verdict(rung, relaxing, best, lies, of=of)
    return replace(found, mass_std=ladder.mass_std(best) if best.mass else 0.0, belt=ladder.belt_of(best))


def _with_belt(data: StiffnessData, relaxing: Possible, of: Of) -> Verdict:
    """The verdict on a specimen that is known to have a belt."""
    if of is Of.SPRINGS:
        raise ModelError("K* of springs is without the belt: fit another model, or say --of 'driving point'")
    if data.count < _FEWEST + _EACH:
        raise ModelError(f"a belt needs {_FEWEST + _EACH} frequencies or more, not {data.count}: measure at more")
    ladder = Ladder(data.at(relaxing.best))
    best = ladder.with_belt(transfer=of is Of.BLOCKED_TRANSFER)
    holds = Rung.RESONANT if best.chance > SEARCH_CHANCE else Rung.NONE
    return replace(_verdict(holds, relaxing, best, (), of=of), belt=ladder.belt_of(best))


def _verdict(holds: Rung, relaxing: Possible, rung: _Best, lies: tuple[Lie, ...], of: Of = Of.DRIVING_POINT) -> Verdict:
    places = np.array([(np.exp(rung.belt[0]), 0.0)]) if rung.belt else rung.places
    hertz, ratios = places[:, 0] / (2 * np.pi), places[:, 1]
    return Verdict(
        holds, relaxing, rung.chi2, rung.dof, rung.chance, rung.mass, 0.0, hertz, ratios, lies, of=of
    )  # fmt: skip


def without_inertia(data: StiffnessData, verdict: Verdict) -> StiffnessData:
    """The data without the mass at the driven end, or the belt, that the verdict found, with its uncertainty.

    What is left is K* of the springs, or of a specimen with resonances and no mass. The uncertainty of the mass, or of
    the frequency and the share of the belt, is an error of all frequencies, like those that they share.
    """
    found, omega = verdict.belt, data.omega
    if found is not None:
        logs = np.log([found.natural, found.share])[: len(found.covariance)]
        here, slope = carried(found.springs, *inertia_of(data.stiffness[0], omega, logs.tolist()))
        steps = (logs + step for step in _STEP * np.eye(logs.size))
        moved = [
            (here - carried(found.springs, *inertia_of(data.stiffness[0], omega, one.tolist()))[0]) / slope / _STEP
            for one in steps
        ]
        columns = np.stack(moved, axis=1) @ np.linalg.cholesky(found.covariance)
        return turned(data, found.springs + (data.stiffness - here) / slope, 1 / slope, columns)
    if not verdict.mass:
        return data
    square = omega**2
    return turned(data, data.stiffness + square * verdict.mass, None, (square * verdict.mass_std)[:, None] + 0j)


class Ladder:
    """The rungs above the lowest, on a grid of relaxation times, and single errors beside them."""

    def __init__(self, data: StiffnessData) -> None:
        self.data, (self.condition,) = data, whitened_conditions(data)
        self.terms, self.static = relaxing_terms(data, grid_of(data))
        self.rows, self.target = self.condition.rows(self.terms, self.static), self.condition.target
        self.count = data.numbers
        self.mass = -np.asarray(data.omega**2 / data.omega.max() ** 2, dtype=complex)[:, None]

    def _with(self, more: ComplexArray) -> FloatArray:
        """Rows of the relaxing terms and of `more` (N, k), which have no share in K1."""
        return np.concatenate([self.rows, self.condition.rows(more, np.zeros(more.shape[1]))], axis=1)

    def with_pairs(self, places: FloatArray, wrong: int | None = None) -> _Best:
        """The best specimen with a mass, and with resonances at `places` (n, 2): frequency [rad/s], damping ratio.

        K* of the frequency number `wrong` may be any.
        """
        more = [self.mass, *self._pairs(places)]
        if wrong is not None:
            more.append(np.where(np.arange(self.data.count)[:, None] == wrong, [1, -1, 1j, -1j], 0))
        weights, chi2 = least_squares(self._with(np.concatenate(more, axis=1)), self.target)
        scale = float(self.data.omega.max()) ** -2
        values = int(np.count_nonzero(weights)) + 2 * len(places)
        return _Best(chi2, values, self.count, float(weights[self.terms.shape[1]]) * scale, places)

    def with_one_wrong(self, best: _Best) -> float:
        """Least BIC of a specimen with a resonance less, where K* of one frequency is wrong; infinite if not likely."""
        hertz = np.log([np.exp(best.belt[0])] if best.belt else best.places[:, 0])
        near = np.argsort(np.min(np.abs(np.log(self.data.omega)[:, None] - hertz), axis=1), kind="stable")[:_SUSPECTS]
        fewer = [np.delete(best.places, at, axis=0) for at in range(len(best.places))] or [best.places]
        tried = [self.with_pairs(places, wrong) for places in fewer for wrong in near.tolist()]
        return min((one.bic for one in tried if one.chance > SEARCH_CHANCE), default=np.inf)

    def climbed(self, of: Of) -> Iterator[tuple[Rung, _Best]]:
        """The rungs above the lowest, from below, as far as the frequencies are enough for them."""
        if of is Of.BLOCKED_TRANSFER:
            yield Rung.RESONANT, self.with_belt(transfer=True)
        if of is not Of.DRIVING_POINT:
            return
        found = self.with_pairs(np.zeros((0, 2)))
        yield Rung.MASS, found
        for count in range(1, _MOST + 1):
            if self.data.count < _FEWEST + _EACH * count:
                return
            if count == 1:
                yield Rung.RESONANT, self.with_belt()
            found = self.with_another(found)
            yield Rung.RESONANT, found

    def _pairs(self, places: FloatArray) -> list[ComplexArray]:
        """Terms of the resonances at `places`."""
        return [pair_of(self.data.omega, *place) for place in places]

    def numerators(self, places: FloatArray) -> FloatArray:
        """The best numerators (n, 3) of the resonances at `places`: factors of s, s² and s³ over d."""
        weights, _ = least_squares(self._with(np.concatenate(self._pairs(places), axis=1)), self.target)
        split = np.split(weights[self.terms.shape[1] :], len(places))
        return np.array([each @ numerators_of(*place) for place, each in zip(places, split, strict=True)])

    def mass_std(self, found: _Best) -> float:
        """Standard uncertainty of a mass [kg] at given resonances: half the interval where chi-square rises by 1."""
        top = float(self.data.omega.max()) ** 2
        column = self._with(self.mass)[:, -1]
        pairs = self._pairs(found.places)
        rows = self._with(np.concatenate(pairs, axis=1)) if pairs else self.rows

        def height(value: float) -> float:
            return rise_of(rows, self.target - column * value, found.chi2)

        low, high = profile_ends(height, found.mass * top, 0.1 * found.mass * top, 1.0)
        return (high - low) / 2 / top

    def with_another(self, before: _Best) -> _Best:
        """The best specimen with one more resonance, all of them moved to where they suit K* best."""
        low, high = _BELOW * self.data.omega.min(), _ABOVE * self.data.omega.max()
        tried = (
            np.vstack([before.places, (omega, ratio)])
            for omega in np.geomspace(low, high, _HERTZ) for ratio in _RATIOS
        )  # fmt: skip
        first = min((self.with_pairs(places) for places in tried), key=lambda rung: rung.chi2).places
        limits = np.log([(low, high), (_LEAST_RATIO, _LARGEST_RATIO)]).T

        def chi2(logs: FloatArray) -> float:
            return self.with_pairs(np.exp(np.clip(logs.reshape(-1, 2), *limits))).chi2

        moved = scipy.optimize.minimize(
            chi2, np.log(first).ravel(), method="Nelder-Mead", options={"maxfev": _STEPS, "xatol": 1e-4, "fatol": 1e-2}
        )
        return self.with_pairs(np.exp(np.clip(moved.x.reshape(-1, 2), *limits)))

    def with_belt(self, *, transfer: bool = False) -> _Best:
        """The best relaxing springs about a mass, by the force and the motion of one end, or of both; see `carried`."""
        omega = self.data.omega
        hertz = np.log(np.geomspace(_BELOW * omega.min(), _ABOVE * omega.max(), _BELT_HERTZ))
        starts = [(one,) for one in hertz] if transfer else [(one, np.log(share)) for one in hertz for share in _SHARES]
        firsts = sorted(starts, key=lambda start: self._belted(start)[0])[:_POLISHED]
        return min((self._moved_belt(first) for first in firsts), key=lambda one: one.chi2)

    def _moved_belt(self, first: Sequence[float], *, near: bool = False) -> _Best:
        """The belt about a first one, by its logarithms, with the least chi-square; `near` where it is almost there."""
        options: dict[str, Any] = {"maxfev": _STEPS, "fatol": 1e-2, "xatol": 1e-5}
        if near:
            corners = np.vstack([np.zeros(len(first)), _NEAR * np.eye(len(first))])
            options |= {"fatol": 0.1, "xatol": 1e-4, "initial_simplex": np.array(first) + corners}
        moved = scipy.optimize.minimize(lambda x: self._belted(x)[0], first, method="Nelder-Mead", options=options)
        belt = tuple(float(one) for one in moved.x)
        chi2, free, _ = self._belted(belt)
        return _Best(chi2, free + len(belt), self.count, 0.0, np.zeros((0, 2)), belt)

    def _belted(self, belt: Sequence[float]) -> tuple[float, int, ComplexArray]:
        """Chi-square with a belt, by log frequency [rad/s] and log share; number of values of its springs, their K*."""
        measured = self.data.stiffness
        inertia, share = inertia_of(measured[0], self.data.omega, belt)
        springs, chi2, free = springs_of(measured, inertia, share), np.inf, 0
        for _ in range(_TURNS):
            shown, slope = carried(springs, inertia, share)
            condition = replace(
                self.condition, data=replace(self.condition.data, stiffness=measured - shown + slope * springs)
            )
            rows = condition.rows(slope[:, None] * self.terms, self.static)
            if not (np.all(np.isfinite(rows)) and np.all(np.isfinite(condition.target))):
                return np.inf, 0, springs
            weights, chi2 = least_squares(rows, condition.target)
            springs, free = self.terms @ weights, int(np.count_nonzero(weights))
        return chi2, free, springs

    def belt_of(self, found: _Best) -> Belt | None:
        """The belt of a rung, with the scatter of belts found in K* drawn about it.

        The springs are any relaxing ones: where terms are at zero the curvature of chi-square is no measure of it.
        """
        if not found.belt:
            return None
        best, (_, _, springs) = np.array(found.belt), self._belted(found.belt)
        shown, _ = carried(springs, *inertia_of(self.data.stiffness[0], self.data.omega, found.belt))
        rng, turn = np.random.default_rng(_SEED), np.linalg.inv(self.condition.whiten)
        off = []
        for _ in range(_DRAWS):
            noise = rng.standard_normal(2 * self.data.count)
            each = turn @ noise if self.data.full else (turn @ noise.reshape(-1, 2, 1)).ravel()
            drawn = Ladder(replace(self.data, stiffness=shown + each[0::2] + 1j * each[1::2]))
            there = drawn._moved_belt(found.belt, near=True).belt
            scale = np.log(np.abs(drawn.data.stiffness[0] / self.data.stiffness[0])) / 2
            off.append(np.array(there) - best - np.array([scale, 0.0])[: best.size])
        covariance = np.transpose(off) @ np.array(off) / _DRAWS
        natural, share = float(np.exp(best[0])), float(np.exp(best[1])) if best.size > 1 else TYRE
        mass = float(np.abs(self.data.stiffness[0])) / natural**2 * (share + 2 + 1 / share)
        by = np.array([-2.0, (share - 1 / share) / (share + 2 + 1 / share)])[: best.size]
        std = mass * float(np.sqrt(by @ covariance @ by))
        return Belt(natural, share, mass, std, covariance, springs)

    def lies(self) -> Iterator[Lie]:
        """Single errors with which a massless, relaxing specimen can have K*."""
        omega, stiffness = self.data.omega, self.data.stiffness
        size = float(np.median(np.abs(stiffness)))
        top = float(omega.max())
        shapes: dict[str, tuple[str, float, Callable[[float], ComplexArray]]] = {
            "delay": ("s", 0.3 / top, lambda x: stiffness * np.exp(-1j * omega * x)),
            "compliance": ("m/N", 0.5 / size, lambda x: stiffness / (1 - stiffness * x)),
            "cross-talk": ("m/(N s)", 0.3 * top / size, lambda x: stiffness / (1 - stiffness * x / (1j * omega))),
        }
        for name, (unit, most, true) in shapes.items():
            found = scipy.optimize.minimize_scalar(
                lambda x, true=true: self._without(true(x))[0], bounds=(-most, most), method="bounded"
            )
            chi2, free = self._without(true(found.x))
            rung = _Best(chi2, free + 1, self.count, 0.0, np.zeros((0, 2)))
            if rung.chance > SEARCH_CHANCE:
                yield Lie(name, self._smallest(true, float(found.x), chi2 + 1.0), unit, rung.bic)

    def _smallest(self, true: Callable[[float], ComplexArray], enough: float, chi2: float) -> float:
        """The smallest error, towards one that is enough, with which chi-square is this low."""
        low = 0.0
        for _ in range(_HALVINGS):
            middle = (low + enough) / 2
            low, enough = (low, middle) if self._without(true(middle))[0] <= chi2 else (middle, enough)
        return enough

    def _without(self, stiffness: ComplexArray) -> tuple[float, int]:
        """Chi-square of the best relaxing specimen of another K*, and the number of its values."""
        target = replace(self.condition, data=replace(self.data, stiffness=stiffness)).target
        weights, chi2 = least_squares(self.rows, target)
        return chi2, int(np.count_nonzero(weights))


def pair_of(omega: FloatArray, natural: float, ratio: float) -> ComplexArray:
    r"""K* (N, k) of the extreme terms of a resonance at `natural` [rad/s].

    .. math::

        \frac{s^2}{d}, \quad \frac{s\,(s + 2\zeta\omega_0)}{d}, \quad
        \frac{s\,(s^2 + (q - 1)^2 \omega_0 s/(2\zeta) + q^2 \omega_0^2)}{d}, \qquad
        d = s^2 + 2\zeta\omega_0 s + \omega_0^2

    The last is the biquadratic that is just positive real, for each q > 0; at q = 1 it is a damper.
    """
    s = 1j * omega[:, None]
    powers = np.concatenate([s, s**2, s**3], axis=1)
    return np.asarray(powers @ numerators_of(natural, ratio).T / (s**2 + 2 * ratio * natural * s + natural**2))


def numerators_of(natural: float, ratio: float) -> FloatArray:
    """Factors (k, 3) of s, s² and s³ in the numerators over d of the terms of `pair_of`."""
    q = np.exp(ratio * _QS)
    biquads = np.stack([(q * natural) ** 2, (q - 1) ** 2 * natural / (2 * ratio), np.ones_like(q)], axis=1)
    return np.concatenate([[[0.0, 1.0, 0.0], [2 * ratio * natural, 1.0, 0.0]], biquads])
