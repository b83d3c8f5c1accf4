r"""A model as a linear system of first-order states, for programs that take matrices or branches.

With the belt of its tyre it has both ends. The belt is a mass m between two springs of one law, :math:`k_{contact} =
(1 + r) K^*` and :math:`k_{rim} = (1 + r) K^* / r`. With the mean motion of both ends :math:`y = (r x_1 + x_2)/(1 + r)`
and the force Q that accelerates the belt,

.. math:: F_1 = K^* (x_1 - x_2) + \frac{r}{1 + r} Q,\quad F_2 = K^* (x_1 - x_2) - \frac{1}{1 + r} Q,\quad
          Q = m \ddot x_b = \frac{(1 + r)^2}{r} K^* (y - x_b),

which is `fourpole.core.specimen.Specimen` with an exponent of 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.models.fractional import rational
from fourpole.models.interface import Arms, Model, StateSpace

#: Largest relative error of K* of an approximation: the first of these that 60 arms reach.
ACCURACIES = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
#: Largest relative error of K* that the change to separate states may add.
_MOST_LOST = 1e-6
#: Branches that relax in less than this over the highest angular frequency are merged into two.
_FAST = 1e-5
#: Frequencies at which that error is evaluated.
_POINTS = 200


@dataclass(frozen=True, eq=False)
class Realised(ByValue):
    r"""A model as a spring and a damper parallel to branches, each with a state of its own.

    .. math::

        K^* = K_\mathrm{rest} + j\omega C + \sum_i k_i \frac{j\omega\tau_i}{1 + j\omega\tau_i}
        + \frac12 \sum_m \left(\kappa_m \frac{j\omega}{j\omega + \lambda_m}
        + \bar\kappa_m \frac{j\omega}{j\omega + \bar\lambda_m}\right)

    A branch has the state z with :math:`\tau \dot z = x - z` and the force :math:`k (x - z)`. A pair of branches has a
    complex state with :math:`\dot z = \lambda (x - z)` and the force :math:`\mathrm{Re}\,\kappa (x - z)`. Every state
    is a length [m], and at rest it equals the deflection x.

    Attributes
    ----------
    rest : float [N/m]
        Stiffness at zero frequency.
    damper : float [N s/m]
    springs, times : (n,) float arrays [N/m], [s]
        Stiffness and relaxation time of each branch, the times > 0 and falling.
    pair_springs, pair_rates : (m,) complex arrays [N/m], [1/s]
        κ and λ of each pair: Re λ > 0 is its decay, Im λ > 0 its frequency [rad/s]. Only models with inertia have
        pairs, and branches whose stiffness is negative.
    error : float [1]
        Largest relative error of K* within the band; 0 if the branches are those of the model.
    """

    rest: float
    damper: float
    springs: FloatArray
    times: FloatArray
    pair_springs: ComplexArray
    pair_rates: ComplexArray
    error: float = 0.0

    @property
    def instantaneous(self) -> float:
        """Stiffness of a sudden deflection [N/m], beside the damper."""
        return float(self.rest + self.springs.sum() + self.pair_springs.real.sum())

    @property
    def space(self) -> StateSpace:
        """The matrices: one state per branch, then two per pair, its real and imaginary part.

        Examples
        --------
        >>> from fourpole.models import Zener
        >>> space = realised(Zener(), [180e3, 120e3, 600.0], (5.0, 50.0)).space
        >>> [one.round(6).tolist() for one in (space.a, space.b, space.c, space.d)]
        [[[-200.0]], [[200.0, 0.0]], [-120000.0], [300000.0, 0.0]]
        """
        count, pairs = self.springs.size, self.pair_springs.size
        a = np.zeros((count + 2 * pairs, count + 2 * pairs))
        at, real = np.arange(count), count + 2 * np.arange(pairs)
        a[at, at] = -1.0 / self.times
        a[real, real] = a[real + 1, real + 1] = -self.pair_rates.real
        a[real, real + 1], a[real + 1, real] = self.pair_rates.imag, -self.pair_rates.imag
        drive = np.concatenate([1.0 / self.times, np.ravel([self.pair_rates.real, self.pair_rates.imag], "F")])
        output = np.concatenate([-self.springs, np.ravel([-self.pair_springs.real, self.pair_springs.imag], "F")])
        inputs, direct = np.stack([drive, np.zeros_like(drive)], axis=1), np.array([self.instantaneous, self.damper])
        return StateSpace(a, inputs, output, direct)

    def stiffness(self, omega: ArrayLike) -> ComplexArray:
        """K* (...,) [N/m] at angular frequencies (...,) [rad/s]."""
        s = 1j * np.asarray(omega, dtype=float)[..., None]
        found = self.rest + s[..., 0] * self.damper + np.sum(self.springs * s * self.times / (1 + s * self.times), -1)
        k, rate = self.pair_springs, self.pair_rates
        found = found + 0.5 * np.sum(k * s / (s + rate) + k.conj() * s / (s + rate.conj()), axis=-1)
        return np.asarray(found, dtype=complex)[()]


def realised(model: Model, values: ArrayLike, band: tuple[float, float]) -> Realised:
    """The linear system that a causal model is, or that approximates it within a band.

    Parameters
    ----------
    model : Model
    values : (P,) float array
        Parameters of the model.
    band : (float, float) [Hz]
        Band in which the error is stated, and of the approximation of a model with a power of the frequency.

    Returns
    -------
    Realised

    Raises
    ------
    ModelError
        If the model is not causal, has a mode without loss, or no system of 60 branches is within 0.1 % of K*.

    Examples
    --------
    >>> from fourpole.models import FractionalZener, Zener
    >>> realised(Zener(), [180e3, 120e3, 600.0], (5.0, 50.0)).times
    array([0.005])
    >>> found = realised(FractionalZener(), [150e3, 400e3, 2e-3, 0.4], (5.0, 50.0))
    >>> found.springs.size, found.error < 1e-7
    (14, True)
    """
    checked = model.checked(values)
    if not model.causal:
        raise ModelError(
            f"the {model.name} model is not causal: its force would precede its deflection; "
            "take one that is, as with fourpole fit --model prony or fourpole map --model maxwell:2"
        )
    try:
        return _of_arms(model.prony(checked))
    except ModelError:  # no Prony series
        pass
    try:
        space = model.state_space(checked)
    except ModelError:  # a power of the frequency
        return _approximated(model, checked, band)
    return separate(space, model.name, band)


def _of_arms(arms: Arms, error: float = 0.0) -> Realised:
    """A Prony series; arms without a stiffness or a relaxation time are left out."""
    kept = (arms.springs > 0) & (arms.times > 0)
    order = np.argsort(-arms.times[kept], kind="stable")
    none = np.zeros(0, dtype=complex)
    return Realised(arms.rest, 0.0, arms.springs[kept][order], arms.times[kept][order], none, none, error)


def _approximated(model: Model, values: FloatArray, band: tuple[float, float]) -> Realised:
    """The Prony series that approximates a model, by the smallest of `ACCURACIES` that is possible."""
    for accuracy in ACCURACIES:
        try:
            maxwell, arms, error = rational(model, values, band, accuracy)
        except ModelError:
            if accuracy == ACCURACIES[-1]:
                raise
        else:
            return _of_arms(maxwell.prony(arms), error)
    raise AssertionError


def separate(space: StateSpace, name: str, band: tuple[float, float]) -> Realised:
    """A state space with separate states, by its eigenvalues."""
    poles, vectors = (np.asarray(one, dtype=complex) for one in np.linalg.eig(space.a))
    if np.any(poles.real >= -1e-12 * np.abs(poles)):
        raise ModelError(f"the {name} model has a mode without loss, which rings forever: state a loss above zero")
    output, drive = space.c @ vectors, np.linalg.solve(vectors, space.b.astype(complex))
    at_rest = output * drive[:, 0] / poles
    springs = output * drive[:, 1] + at_rest
    real, pairs = np.flatnonzero(poles.imag == 0), np.flatnonzero(poles.imag < 0)
    real, pairs = (one[np.argsort(np.abs(poles[one]), kind="stable")] for one in (real, pairs))
    found = Realised(
        rest=float(space.d[0] - at_rest.sum().real),
        damper=float(space.d[1]),
        springs=springs[real].real,
        times=-1.0 / poles[real].real,
        pair_springs=2.0 * springs[pairs],
        pair_rates=-poles[pairs],
    )
    if not len(space.a):
        return found
    omega = 2 * np.pi * np.geomspace(*band, _POINTS)
    found = _merged(found, _FAST / omega[-1])
    error = float(np.max(np.abs(found.space.stiffness(omega) / space.stiffness(omega) - 1)))
    if not error <= _MOST_LOST:
        raise ModelError(f"the states of the {name} model cannot be separated: K* would be wrong by {error:.2g}")
    return replace(found, error=error)


def _merged(found: Realised, least: float) -> Realised:
    """The damper and all branches with a relaxation time below `least` [s] as two branches.

    Modes that are far faster than the band come as branches whose huge stiffnesses cancel, which takes digits. Below
    their frequencies they are a damper and a mass, and so are the two branches: first and second moment are the same.
    """
    fast = found.times < least
    if not fast.any():
        return found
    springs, times = found.springs[fast], found.times[fast]
    moments = [found.damper + np.sum(springs * times), np.sum(springs * times**2)]
    two = least * np.array([1.0, 0.5])
    return replace(
        found,
        damper=0.0,
        springs=np.append(found.springs[~fast], np.linalg.solve([two, two**2], moments)),
        times=np.append(found.times[~fast], two),
    )


#: A specimen without inertia.
MASSLESS = Specimen()


def weight(belt: Specimen) -> float:
    """The factor r/(1 + r) [1] of the motion of the contact in the mean motion of both ends."""
    share = abs(belt.share)
    return share / (1 + share)


def gain(belt: Specimen) -> float:
    """Stiffness on which the belt moves, contact and rim held, over K* [1]: (1 + r)²/r."""
    share = abs(belt.share)
    return (1 + share) ** 2 / share


@dataclass(frozen=True, eq=False)
class EndsSpace(ByValue):
    r"""Forces on both ends by their motions: :math:`\dot z = A z + B u`, :math:`F = C z + D u`.

    The inputs u are displacement and velocity of the contact and of the wheel, the outputs the force F1 into the
    contact and the force F2 on the wheel, all positive from the contact towards the wheel.

    Attributes
    ----------
    a, b, c, d : (n, n), (n, 4), (2, n), (2, 4) float arrays
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray

    def dynamic_stiffness(self, omega: FloatArray) -> ComplexArray:
        """Forces (N, 2, 2) [N/m] on both ends, F1 and -F2, over their motions at (N,) [rad/s], contact first.

        Examples
        --------
        >>> from fourpole.models import Zener
        >>> tyre, omega = Specimen(Form.BELT, 7.0, 0.2), np.array([150.0])
        >>> ends = both_ends(realised(Zener(), [180e3, 120e3, 700.0], (5.0, 50.0)).space, tyre)
        >>> exact = tyre.dynamic_stiffness(Zener().stiffness([180e3, 120e3, 700.0], omega), omega)
        >>> bool(np.abs(ends.dynamic_stiffness(omega) / exact - 1).max() < 1e-12)
        True
        """
        s = 1j * omega[:, None, None]
        drive = np.kron(np.eye(2), np.ones((2, 1))) * np.where(np.arange(4)[:, None] % 2, s, 1.0)
        states = np.linalg.solve(s * np.eye(len(self.a)) - self.a, self.b @ drive)
        return np.asarray(np.array([[1.0], [-1.0]]) * (self.c @ states + self.d @ drive))


def belt_force(springs: StateSpace, belt: Specimen) -> StateSpace:
    """The force Q on the belt by the mean motion of both ends and its rate; the last states are x_b and its rate."""
    n, k = len(springs.a), gain(belt)
    (dx, dv), mass = k * springs.d, belt.mass
    c = np.concatenate([k * springs.c, [-dx, -dv]])
    last = np.concatenate([np.zeros(n + 1), [1.0]])
    a = np.vstack([np.hstack([springs.a, -springs.b]), last, c / mass])
    b = np.vstack([springs.b, np.zeros(2), np.array([dx, dv]) / mass])
    return StateSpace(a, b, c, np.array([dx, dv]))


def both_ends(springs: StateSpace, belt: Specimen = MASSLESS) -> EndsSpace:
    """The system of both ends, of K* and of a belt; its first states are those of K*."""
    apart = np.kron([1.0, -1.0], np.eye(2))
    found = EndsSpace(springs.a, springs.b @ apart, np.tile(springs.c, (2, 1)), np.tile(springs.d @ apart, (2, 1)))
    if belt.form is Form.MASSLESS:
        return found
    moving, w = belt_force(springs, belt), weight(belt)
    mean, onto = np.kron([w, 1 - w], np.eye(2)), np.array([[w], [w - 1]])
    return EndsSpace(
        a=scipy.linalg.block_diag(found.a, moving.a),
        b=np.vstack([found.b, moving.b @ mean]),
        c=np.hstack([found.c, onto * moving.c]),
        d=found.d + onto * (moving.d @ mean),
    )


def belt_modes(springs: Realised, belt: Specimen, band: tuple[float, float]) -> Realised:
    """The force Q over the mean motion of both ends as branches and pairs; ModelError if the belt has no loss."""
    found = separate(belt_force(springs.space, belt), "belted", band)
    return replace(found, rest=0.0, error=max(found.error, springs.error))
