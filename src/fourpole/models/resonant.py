r"""A relaxing specimen with resonances: a fluid in an inertia track, a belt between springs, a mass on an absorber.

Each resonance is the general biquadratic positive-real function of one natural frequency, times s:

.. math::

    K^* = K_\infty + \sum_i K_i \frac{s\tau_i}{1 + s\tau_i}
        + \sum_n s\,\frac{C_a s^2 + p\,s + C_b\,\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2},\qquad
    p = \frac{\omega_n}{2\zeta}\left(\sqrt{C_a} - \sqrt{C_b}\right)^2 + E,\qquad s = j\omega

The term is passive for all :math:`C_a, C_b, E \ge 0` and for no other p: the least p is where the real part of K*/s
touches zero at one frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import best_fit
from fourpole.models.interface import Model, Parameter, StateSpace, columns, positive
from fourpole.models.ladder import Ladder
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.nonnegative import whitened_conditions
from fourpole.models.problem import starts_of

#: Most resonances; most arms beside them; parameters of a resonance.
_MOST, _MOST_ARMS, _EACH = 3, 4, 5
#: Start of a factor that is zero, over the largest of its resonance.
_IDLE = 1e-4


class Resonant(Model):
    r"""A spring, arms of spring and damper in series, and n resonances.

    The parameters are K_inf, K_1 ... K_a, tau_1 ... tau_a, and of each resonance its natural frequency f, its damping
    ratio zeta, the damping C_a far above and C_b far below it, and E. The number of arms follows from the data.

    Parameters
    ----------
    count : int
        Number n of resonances, from 1 to 3.
    arms : int
        Number a of arms, >= 1.

    References
    ----------
    O. Brune, "Synthesis of a finite two-terminal network whose driving-point impedance is a prescribed function of
    frequency", J. Math. Phys. 10, 1931.

    Examples
    --------
    A spring of 150 kN/m to a mass of 60 kg, which a damper of 600 N s/m holds, beside a spring of 200 kN/m:

    >>> s = 1j * np.array([20.0, 50.0, 90.0])
    >>> driven = 2e5 + 1 / (1 / 150e3 + 1 / (60 * s**2 + 600 * s))
    >>> model = Resonant(1).stiffness([2e5, 0.0, 1.0, 25 / np.pi, 0.1, 0.0, 600.0, 0.0], s.imag)
    >>> bool(np.allclose(model, driven))
    True
    """

    relaxing = False
    has_inertia = True
    candidate = False
    sizes = range(1, _MOST + 1)
    special_cases = ("spring",)

    def __init__(self, count: int, arms: int = 1) -> None:
        if not 1 <= count <= _MOST:
            raise ModelError(f"a resonant model has 1 to {_MOST} resonances, not {count}")
        self.name, self.count, self.rest = f"resonant:{count}", count, GeneralisedMaxwell(arms)
        self.parameters = (*self.rest.parameters, *(one for n in range(1, count + 1) for one in _resonance(n)))

    def placed(self, conditions: Sequence[StiffnessData]) -> Resonant:
        """The model with as many arms as the rest of any condition needs, by BIC."""
        return Resonant(self.count, max(_arms_of(one, self.count) for one in conditions))

    def with_parameters(self, count: int) -> Resonant:
        """The model with this number of parameters."""
        arms, odd = divmod(count - 1 - _EACH * self.count, 2)
        if odd or arms < 1:
            raise ModelError(f"a model with {self.count} resonances has no {count} parameters")
        return Resonant(self.count, arms)

    def _split(self, values: ArrayLike) -> tuple[FloatArray, list[FloatArray]]:
        """The parameters (..., A) of spring and arms, and those (..., 5) of each resonance."""
        checked, first = self.checked(values), len(self.rest.parameters)
        each = [checked[..., first + _EACH * n : first + _EACH * (n + 1)] for n in range(self.count)]
        return checked[..., :first], each

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        relaxing, each = self._split(values)
        s = 1j * positive(omega)
        found = self.rest.stiffness(relaxing, omega)
        for one in each:
            top, bottom = _quotient(one, s)
            found = found + s * top / bottom
        return np.asarray(found)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by the parameters, in their order."""
        relaxing, each = self._split(values)
        s = 1j * positive(omega)
        return np.concatenate([self.rest.derivative(relaxing, omega), *(_slopes(one, s) for one in each)], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """Frequencies where a search finds them, the best weights at these, and arms of the rest."""
        return np.stack([self._start(one.data, count) for one in whitened_conditions(data)], axis=1)

    def _start(self, data: StiffnessData, count: int) -> FloatArray:
        """Starts (count or fewer, P) of one condition."""
        places, numerators, rest = _parts(data, self.count)
        relaxing = self.rest.starts(rest.flat(), count)[:, 0]
        each = [_start_of(place, factors) for place, factors in zip(places, numerators, strict=True)]
        return np.concatenate([relaxing, np.tile(np.concatenate(each), (len(relaxing), 1))], axis=1)

    def ordering(self, values: FloatArray) -> np.ndarray:
        """Places that sort the arms by falling time, the resonances by rising frequency."""
        first = len(self.rest.parameters)
        arms = self.rest.ordering(values[..., :first])
        order = np.argsort(values[..., first::_EACH], axis=-1, kind="stable")
        each = first + _EACH * order[..., None] + np.arange(_EACH)
        return np.concatenate([arms, each.reshape(*order.shape[:-1], -1)], axis=-1)

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space with a state per arm, and two per resonance: x through 1/d, and its rate over the frequency."""
        relaxing, each = self._split(values)
        spaces = [self.rest.state_space(relaxing), *(_space(one) for one in each)]
        return StateSpace(
            scipy.linalg.block_diag(*(one.a for one in spaces)),
            np.concatenate([one.b for one in spaces]),
            np.concatenate([one.c for one in spaces]),
            np.sum([one.d for one in spaces], axis=0),
        )


def _resonance(n: int) -> tuple[Parameter, ...]:
    """The parameters of one resonance."""
    ends = (0.0, np.inf)
    return (
        Parameter(f"f_{n}", "Hz", *ends, 30.0 * n, f"natural frequency of resonance {n}", log=True),
        Parameter(f"zeta_{n}", "1", 0.0, 10.0, 0.1, f"damping ratio of resonance {n}", log=True),
        Parameter(f"Ca_{n}", "N s/m", *ends, 100.0, f"damping far above resonance {n}", log=True),
        Parameter(f"Cb_{n}", "N s/m", *ends, 100.0, f"damping far below resonance {n}", log=True),
        Parameter(f"E_{n}", "N/m", *ends, 1e5, f"strength of resonance {n} beyond these", log=True),
    )


def _turned(one: FloatArray) -> list[FloatArray]:
    """Angular frequency, damping ratio, C_a, C_b and E (..., 1) of one resonance (..., 5)."""
    hertz, *others = columns(one)
    return [2 * np.pi * hertz, *others]


def _middle(one: FloatArray) -> FloatArray:
    """The factor p (..., 1) [N/m] of s in the numerator."""
    natural, ratio, above, below, strength = _turned(one)
    return np.asarray(natural * (np.sqrt(above) - np.sqrt(below)) ** 2 / (2 * ratio) + strength)


def _quotient(one: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Numerator and denominator (..., N) of one resonance without the factor s."""
    natural, ratio, above, below, _ = _turned(one)
    return above * s**2 + _middle(one) * s + below * natural**2, s**2 + 2 * ratio * natural * s + natural**2


def _slopes(one: FloatArray, s: ComplexArray) -> ComplexArray:
    """Derivatives (..., N, 5) of one resonance by its parameters."""
    natural, ratio, above, below, _ = _turned(one)
    top, bottom = _quotient(one, s)
    apart = (np.sqrt(above) - np.sqrt(below)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        up, down = (np.where(part > 0, np.sqrt(other / part), 0.0) for part, other in ((above, below), (below, above)))
    by_top = [
        (apart / (2 * ratio) * s + 2 * below * natural) * 2 * np.pi,
        -natural * apart / (2 * ratio**2) * s,
        s**2 + natural * (1 - up) / (2 * ratio) * s,
        natural**2 + natural * (1 - down) / (2 * ratio) * s,
        s,
    ]
    by_bottom = [(2 * ratio * s + 2 * natural) * 2 * np.pi, 2 * natural * s, *(np.zeros_like(bottom) for _ in range(3))]
    pairs = zip(by_top, by_bottom, strict=True)
    return np.stack([s * (upper * bottom - top * lower) / bottom**2 for upper, lower in pairs], axis=-1)


def _space(one: FloatArray) -> StateSpace:
    """The state space of one resonance."""
    natural, ratio, above, below, _ = (float(part[..., 0]) for part in _turned(one))
    rates = np.array([[0.0, natural], [-natural, -2 * ratio * natural]])
    # s (C_a s² + p s + C_b w²)/d = s C_a + A + (B s - A w²)/d, with the states w² x/d and w s x/d.
    direct = float(_middle(one)[..., 0]) - 2 * ratio * natural * above
    rest = (below - above) * natural**2 - 2 * ratio * natural * direct
    return StateSpace(
        rates, np.array([[0.0, 0.0], [natural, 0.0]]), np.array([-direct, rest / natural]), np.array([direct, above])
    )


def _parts(data: StiffnessData, count: int) -> tuple[FloatArray, FloatArray, StiffnessData]:
    """So many resonances (count, 2) [rad/s], [1] as suit a condition best, their numerators, and what they leave."""
    ladder = Ladder(replace(data, relative=None, reference=None, recorded=None))
    found = ladder.with_pairs(np.zeros((0, 2)))
    for _ in range(count):
        found = ladder.with_another(found)
    s = 1j * data.omega
    numerators, left = ladder.numerators(found.places), ladder.data.stiffness
    for (natural, ratio), (first, second, third) in zip(found.places, numerators, strict=True):
        left = left - s * (first + second * s + third * s**2) / (s**2 + 2 * ratio * natural * s + natural**2)
    return found.places, numerators, replace(ladder.data, stiffness=left)


def _arms_of(data: StiffnessData, count: int) -> int:
    """Number of arms beside the resonances with the least BIC."""
    *_, rest = _parts(data, count)
    least, best = np.inf, 1
    for arms in range(1, _MOST_ARMS + 1):
        model, room = GeneralisedMaxwell(arms), 2 * data.count - 1 - _EACH * count
        if 2 * arms > room:
            break
        found = best_fit(model, rest, starts_of(model, rest, 1))
        bic = float(found.chi2) + 2 * arms * float(np.log(2 * data.count))
        if bic > least:
            break
        least, best = bic, arms
    return best


def _start_of(place: FloatArray, factors: FloatArray) -> FloatArray:
    """The parameters (5,) of a resonance by the factors of s, s² and s³ in its numerator; none of them zero."""
    natural, ratio = place
    below, above = factors[0] / natural**2, factors[2]
    strength = factors[1] - natural * (np.sqrt(above) - np.sqrt(below)) ** 2 / (2 * ratio)
    largest = max(factors[1] / natural, above, below)
    dampers = np.maximum([above, below, strength / natural], _IDLE * largest)
    return np.array([natural / (2 * np.pi), ratio, dampers[0], dampers[1], dampers[2] * natural])
