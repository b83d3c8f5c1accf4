r"""A model and the belt of its tyre as a linear system of both ends, for programs that take matrices or equations.

The belt is a mass m between two springs of one law, :math:`k_{contact} = (1 + r) K^*` and :math:`k_{rim} = (1 + r) K^*
/ r`. With the mean motion of both ends :math:`y = (r x_1 + x_2)/(1 + r)` and the force Q that accelerates the belt,

.. math:: F_1 = K^* (x_1 - x_2) + \frac{r}{1 + r} Q,\quad F_2 = K^* (x_1 - x_2) - \frac{1}{1 + r} Q,\quad
          Q = m \ddot x_b = \frac{(1 + r)^2}{r} K^* (y - x_b),

which is `fourpole.core.specimen.Specimen` with an exponent of 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.specimen import Form, Specimen
from fourpole.models.interface import StateSpace
from fourpole.models.realised import Realised, separate

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
        >>> from fourpole.models.realised import realised
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
