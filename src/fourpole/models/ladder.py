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

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.models.causality import Possible, check_possible, grid_of, terms_of
from fourpole.models.data import MASTER_DECADES, StiffnessData, real_columns, with_shared
from fourpole.models.nonnegative import least_squares, profile_ends, rise_of, whitened_conditions

#: A rung is better than the one below if its BIC is lower by this; a resonance, than every single error by more.
_BETTER, _FAR_BETTER = 6.0, 10.0
#: Most resonances, and the fewest frequencies at which n of them can be told: the first number plus n times the second.
_MOST, _FEWEST, _EACH = 3, 4, 6
#: A resonance lies within these shares of the ends of the band.
_BELOW, _ABOVE = 0.7, 1.4
#: First frequencies and damping ratios of a resonance that are tried.
_HERTZ, _RATIOS = 24, (0.01, 0.03, 0.1, 0.4)
#: The same of a belt: number of frequencies, and the ratios m11/m12.
_BELT_HERTZ, _SHARES = 16, (0.05, 0.2, 1.0, 5.0)
#: Least and largest damping ratio of a resonance.
_LEAST_RATIO, _LARGEST_RATIO = 1e-3, 2.0
_STEPS = 150
#: Where a resonance leaves a chi-square of this many degrees of freedom, another one does not help.
_HOPELESS = 100.0
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
    holds : Holds
    relaxing : Possible
        The test of the lowest rung.
    chi2, dof, chance : float, int, float [1]
        Chi-square of the rung that holds, or of the highest, and the probability of a larger one.
    mass, mass_std : float [kg]
        Mass at the driven end, and its standard uncertainty, which is 0 where there are resonances.
    resonances, ratios : (n,) float arrays [Hz], [1]
        Frequency and damping ratio of each resonance.
    lies : tuple of Lie
        Errors of the laboratory that explain K* too, the best first; empty where a relaxing specimen can have it.
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


def verdict_of(data: StiffnessData) -> Verdict:
    """The smallest kind of passive linear specimen that can have K* of one condition.

    Parameters
    ----------
    data : StiffnessData
        Data of one condition, with K1 if it is known.

    Returns
    -------
    Verdict

    Raises
    ------
    ModelError
        If the data are of several conditions.

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
    lowest = _Best(relaxing.chi2, _free(data, relaxing), _count(data), 0.0, np.zeros((0, 2)))
    if lowest.chance > SEARCH_CHANCE or data.omega.max() > 10.0**MASTER_DECADES * data.omega.min():
        rung = Rung.RELAXING if relaxing.possible else Rung.NONE  # inertia does not shift with temperature
        return _verdict(rung, relaxing, lowest, ())
    ladder = _Ladder(data.at(relaxing.best))
    massed = ladder.with_pairs(np.zeros((0, 2)))
    lies = tuple(sorted(ladder.lies(), key=lambda lie: lie.bic))
    best = massed if massed.bic < lowest.bic - _BETTER else lowest
    if best is massed and massed.chance > SEARCH_CHANCE:
        return replace(_verdict(Rung.MASS, relaxing, massed, lies), mass_std=ladder.mass_std(massed))
    least = min((lie.bic for lie in lies), default=np.inf) - _FAR_BETTER
    found = massed
    for count in range(1, _MOST + 1):
        if data.count < _FEWEST + _EACH * count:
            break
        found = ladder.with_another(found)
        for tried in (found, *([ladder.with_belt()] if count == 1 else [])):
            if tried.bic < best.bic - _BETTER:
                best = tried
        if best.places.size and best.chance > SEARCH_CHANCE and best.bic < least:
            return _verdict(Rung.RESONANT, relaxing, best, lies)
        if best.chi2 > _HOPELESS * best.dof:
            break
    return _verdict(Rung.RELAXING if relaxing.possible else Rung.NONE, relaxing, lowest, lies)


def _verdict(holds: Rung, relaxing: Possible, rung: _Best, lies: tuple[Lie, ...]) -> Verdict:
    hertz, ratios = rung.places[:, 0] / (2 * np.pi), rung.places[:, 1]
    return Verdict(
        holds, relaxing, rung.chi2, rung.dof, rung.chance, rung.mass, 0.0, hertz, ratios, lies
    )  # fmt: skip


def without_mass(data: StiffnessData, verdict: Verdict) -> StiffnessData:
    """The data without the mass at the driven end that the verdict found, if any, with its uncertainty.

    The uncertainty of the mass is one error of all frequencies, like those that they share.
    """
    if verdict.holds is not Rung.MASS:
        return data
    square = data.omega**2
    column = real_columns((square * verdict.mass_std)[:, None] + 0j)
    whole = with_shared(data.covariance, column, data.stiffness.shape)
    return replace(data, stiffness=data.stiffness + square * verdict.mass, covariance=whole, recorded=None)


def _count(data: StiffnessData) -> int:
    return 2 * data.count + int(data.has_k1)


def _free(data: StiffnessData, relaxing: Possible) -> int:
    return _count(data) - relaxing.dof


class _Ladder:
    """The rungs above the lowest, on a grid of relaxation times, and single errors beside them."""

    def __init__(self, data: StiffnessData) -> None:
        self.data, self.times = data, grid_of(data)
        (self.condition,) = whitened_conditions(data)
        self.count = _count(data)
        self.terms = terms_of(data.omega, self.times, known=data.has_k1 and not data.ramp)
        self.static = np.zeros(self.terms.shape[1] - 1)  # share of each term but the first in K1
        self.static[-self.times.size - 1 : -1] = data.static_share(self.times)
        self.rows, self.target = self.condition.rows(self.terms, self.static), self.condition.target
        self.mass = -np.asarray(data.omega**2 / data.omega.max() ** 2, dtype=complex)[:, None]

    def _with(self, more: ComplexArray) -> FloatArray:
        """Rows of the relaxing terms and of `more` (N, k), which have no share in K1."""
        rows = self.data.whitened(self.condition.whiten, more)
        return np.concatenate([self.rows, np.vstack([rows, np.zeros((1, more.shape[1]))])], axis=1)

    def with_pairs(self, places: FloatArray) -> _Best:
        """The best specimen with a mass, and with resonances at `places` (n, 2): frequency [rad/s], damping ratio."""
        pairs = [pair_of(self.data.omega, *place) for place in places]
        weights, chi2 = least_squares(self._with(np.concatenate([self.mass, *pairs], axis=1)), self.target)
        scale = float(self.data.omega.max()) ** -2
        free = int(np.count_nonzero(weights)) + 2 * len(places)
        return _Best(chi2, free, self.count, float(weights[self.terms.shape[1]]) * scale, places)

    def mass_std(self, found: _Best) -> float:
        """Standard uncertainty of a mass without resonances [kg]: half the interval in which chi-square rises by 1."""
        top = float(self.data.omega.max()) ** 2
        column = self._with(self.mass)[:, -1]

        def height(value: float) -> float:
            return rise_of(self.rows, self.target - column * value, found.chi2)

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

    def with_belt(self) -> _Best:
        """The best relaxing springs about a mass, by the force and the motion of one end; see `core.specimen`.

        With m11 and m12 its K* follows from each measured value, so that the test is that of a massless specimen.
        """
        omega = self.data.omega
        hertz = np.geomspace(_BELOW * omega.min(), _ABOVE * omega.max(), _BELT_HERTZ)
        starts = [(np.log(natural), np.log(share)) for natural in hertz for share in _SHARES]
        first = min(starts, key=lambda start: self._belted(*start)[0])
        moved = scipy.optimize.minimize(
            lambda x: self._belted(*x)[0], first, method="Nelder-Mead", options={"maxfev": _STEPS, "fatol": 1e-2}
        )
        chi2, free = self._belted(*moved.x)
        natural = float(np.exp(moved.x[0]))
        return _Best(chi2, free + 2, self.count, 0.0, np.array([(natural, 0.0)]))

    def _belted(self, log_natural: float, log_share: float) -> tuple[float, int]:
        """Chi-square with a belt whose mode, with both ends held, is at exp(log_natural) [rad/s], and free values."""
        measured, square = self.data.stiffness, self.data.omega**2
        through = float(np.abs(measured[0])) / np.exp(2 * log_natural)  # m12 [kg]
        u, v = square * through, square * through * np.exp(log_share)
        middle, inner = (u + v + measured) / 2, measured * u
        root = np.sqrt(middle**2 - inner)
        pair = np.stack([middle + root, middle - root])
        stiffness = pair[np.argmin(np.abs(pair - measured[0]), axis=0), np.arange(measured.size)]
        slope = (2 * stiffness - 2 * middle) / (stiffness - u)  # of what is measured by K*
        condition = replace(self.condition, data=replace(self.condition.data, stiffness=slope * stiffness))
        rows = condition.rows(slope[:, None] * self.terms, self.static)
        if not (np.all(np.isfinite(rows)) and np.all(np.isfinite(condition.target))):
            return np.inf, 0
        weights, chi2 = least_squares(rows, condition.target)
        return chi2, int(np.count_nonzero(weights))

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
    r"""K* (N, k) of the extreme terms of a resonance at `natural` [rad/s], each over its largest modulus.

    .. math::

        \frac{s^2}{d}, \quad \frac{s\,(s + 2\zeta\omega_0)}{d}, \quad
        \frac{s\,(s^2 + (q - 1)^2 \omega_0 s/(2\zeta) + q^2 \omega_0^2)}{d}, \qquad
        d = s^2 + 2\zeta\omega_0 s + \omega_0^2

    The last is the biquadratic that is just positive real, for each q > 0; at q = 1 it is a damper.
    """
    s, q = 1j * omega[:, None], np.exp(ratio * _QS)
    d = s**2 + 2 * ratio * natural * s + natural**2
    biquads = s * (s**2 + (q - 1) ** 2 * natural / (2 * ratio) * s + (q * natural) ** 2) / d
    pair = np.concatenate([s**2 / d, s * (s + 2 * ratio * natural) / d, biquads], axis=1)
    return np.asarray(pair / np.abs(pair).max(axis=0))
