"""The rig above the tyre as equations of motion: moving mass, leaf spring, frame; specimens with a mass.

A specimen with a mass of its own is springs in a row, and a mass between each two of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, isfinite, isinf

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.models.interface import StateSpace


@dataclass(frozen=True, eq=False)
class Laden(ByValue):
    """Springs in a row from the contact to the wheel, and the masses between them.

    Attributes
    ----------
    springs : (n + 1,) tuple of StateSpace
        Together they have the specimen's K*.
    masses : (n,) tuple of float [kg]
    """

    springs: tuple[StateSpace, ...]
    masses: tuple[float, ...]


@dataclass(frozen=True)
class Belt:
    r"""A belt between the tread and the sidewall of a tyre.

    With r the share, the springs beside it are :math:`k_{contact} = (1 + r) K^*` and :math:`k_{rim} = k_{contact}/r`.
    If the rim's spring is constant, it has that stiffness at rest, and the spring at the contact has the flexibility
    that is left of 1/K*.

    Parameters
    ----------
    mass : float [kg]
        > 0.
    share : float [1]
        r = k_contact/k_rim, > 0; at rest if the rim's spring is constant.
    constant_rim : bool
        Whether the spring at the rim is constant; by default both springs are of one law.

    Examples
    --------
    >>> from fourpole.virtual.bench import Zener
    >>> contact, rim = Belt(7.0, share=0.2, constant_rim=True).laden(Zener(240e3, 90e3, 900.0).state_space()).springs
    >>> rim.stiffness(100.0).round(0), (1 / (1 / contact.stiffness(100.0) + 1 / rim.stiffness(100.0))).round(0)
    (np.complex128(1440000+0j), np.complex128(285000+45000j))
    """

    mass: float
    share: float = 0.2
    constant_rim: bool = False

    def __post_init__(self) -> None:
        if not min(self.mass, self.share) > 0.0:
            raise ValueError("mass and share of a belt must be > 0")

    def laden(self, whole: StateSpace) -> Laden:
        """The springs and the mass of a specimen whose K* is that of `whole`."""
        if not self.constant_rim:
            return Laden((_times(whole, 1 + self.share), _times(whole, (1 + self.share) / self.share)), (self.mass,))
        rim = (1 + self.share) / self.share * float(whole.stiffness(0.0).real)
        spring = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([rim, 0.0]))
        return Laden((_without(whole, rim), spring), (self.mass,))

    def described(self, whole: StateSpace, omega: float) -> tuple[float, float]:
        r"""Share, as a modulus [1], and :math:`\sqrt{\mathrm{Re}\,k_{rim}/m_b}/2\pi` [Hz], at omega [rad/s]."""
        contact, rim = (complex(spring.stiffness(omega)) for spring in self.laden(whole).springs)
        return abs(contact / rim), float(np.sqrt(rim.real / self.mass) / (2.0 * np.pi))


@dataclass(frozen=True)
class Rod:
    """A specimen of one material, such as a mount, whose mass is spread evenly along it.

    Parameters
    ----------
    mass : float [kg]
        > 0.
    points : int
        Number of point masses in its place, where Gauss's quadrature has its points. The forces on both ends are then
        exact up to the second power of frequency. 16 points err by 0.02 % of K* where omega^2 mass is K*.
    """

    mass: float
    points: int = 16

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and self.points >= 1):
            raise ValueError("the mass of a rod must be > 0, and it has at least one point")

    def laden(self, whole: StateSpace) -> Laden:
        """The springs and the masses of a specimen whose K* is that of `whole`."""
        places, weights = np.polynomial.legendre.leggauss(self.points)
        lengths = np.diff([-1.0, *places, 1.0]) / 2.0
        return Laden(
            tuple(_times(whole, 1.0 / length) for length in lengths), tuple((self.mass / 2 * weights).tolist())
        )

    def described(self, whole: StateSpace, omega: float) -> tuple[None, float]:
        """No share, and the first frequency [Hz] with the wheel held and the contact free, of K* at omega [rad/s]."""
        return None, float(np.sqrt(whole.stiffness(omega).real / self.mass) / 4.0)


def _times(spring: StateSpace, factor: float) -> StateSpace:
    """The spring with `factor` times its K*."""
    return replace(spring, c=factor * spring.c, d=factor * spring.d)


def _without(whole: StateSpace, rim: float) -> StateSpace:
    """What is in series with a constant spring [N/m] in a specimen of the K* of `whole`.

    With its deflection in place of its rate, the specimen has :math:`F = C w + e x`, where e is its stiffness at once,
    and x is the deflection that is wanted plus F over the rim's stiffness.
    """
    at_once: FloatArray = whole.c @ whole.b[:, 1] + whole.d[0]
    if whole.d[1] or not at_once < rim:
        raise ValueError(f"the spring at the rim, {rim:.6g} N/m, must be stiffer than the specimen is at any frequency")
    gain = 1.0 / (1.0 - at_once / rim)
    drive = gain * (whole.a @ whole.b[:, 1] + whole.b[:, 0])
    return StateSpace(
        whole.a + np.outer(drive, whole.c) / rim,
        np.stack([drive, np.zeros_like(drive)], axis=1),
        gain * whole.c,
        np.array([gain * at_once, 0.0]),
    )


#: A frame that follows its spring at a rate above this is treated as quasi-static [rad/s].
_AT_ONCE = 1e9


@dataclass(frozen=True)
class Zener:
    """A massless tyre at one frequency: K1 parallel to a spring K2 and a damper C in series; all > 0.

    Parameters
    ----------
    k1, k2, c : float [N/m], [N/m], [N s/m]
        Spring K1, spring K2 and damper C.
    """

    k1: float
    k2: float
    c: float

    def state_space(self) -> StateSpace:
        r"""The element in state space: its state q [N] is the force in the arm of K2 and C.

        .. math:: \dot q = K_2 v - (K_2/C)\,q, \qquad F = K_1 x + q

        The deflection of the spring K2 is that of the arm minus that of the damper.

        Raises
        ------
        ValueError
            If a constant is not positive.
        """
        if not min(self.k1, self.k2, self.c) > 0.0:
            raise ValueError("K1, K2 and C must be > 0")
        return StateSpace(
            np.array([[-self.k2 / self.c]]), np.array([[0.0, self.k2]]), np.ones(1), np.array([self.k1, 0.0])
        )


@dataclass(frozen=True)
class Bench:
    r"""The rig above the tyre: a moving mass, with a leaf spring and a damper to a fixed foundation.

    Parameters
    ----------
    mass, preload_stiffness, preload_damping : float [kg], [N/m], [N s/m]
        m > 0, K3 >= 0, c3 >= 0.
    tyre_mass : float [kg]
        Moving part of the tyre, lumped with the moving mass; >= 0.
    frame_stiffness : float [N/m]
        Stiffness of the frame in series with leaf spring and damper; > 0, by default rigid.
    preload_loss_factor : float [1]
        eta of the leaf spring; >= 0. In the time domain it becomes the damper K3 eta/omega, which has the same loss at
        the mean frequency of the cam, and n times the loss at n times that frequency.
    leaf_friction : float [N]
        Coulomb friction F_f between the moving mass and the foundation; >= 0.
    input_mass : float [kg]
        Mass between force cell and contact, whose inertia is part of F1; >= 0.

    Examples
    --------
    >>> Bench(preload_loss_factor=0.02).damped_at(10.0).preload_damping
    3.9598
    """

    mass: float = 15.0
    preload_stiffness: float = 12440.0
    preload_damping: float = 0.0
    tyre_mass: float = 0.0
    frame_stiffness: float = inf
    preload_loss_factor: float = 0.0
    leaf_friction: float = 0.0
    input_mass: float = 0.0

    def damped_at(self, frequency: float) -> Bench:
        """The bench with its loss factor replaced by a damper of the same loss at `frequency` [Hz]."""
        if not self.preload_loss_factor:
            return self
        structural = self.preload_stiffness * self.preload_loss_factor / (2.0 * np.pi * frequency)
        return replace(self, preload_damping=self.preload_damping + structural, preload_loss_factor=0.0)

    def check(self) -> None:
        """Raise a ValueError if a value is out of its range."""
        least = (self.preload_stiffness, self.preload_damping, self.tyre_mass, self.preload_loss_factor)
        if not (self.mass > 0.0 and min(*least, self.leaf_friction, self.input_mass) >= 0.0):
            raise ValueError("the moving mass must be > 0 and all other values of the rig >= 0")
        if not self.frame_stiffness > 0.0:
            raise ValueError("frame_stiffness must be > 0; infinite where the frame is rigid")


#: What may stand in the place of the tyre.
Element = Zener | StateSpace | Laden


def state_matrices(tyre: Element, bench: Bench) -> tuple[FloatArray, FloatArray]:
    r"""Matrices A, B of the equations of motion y' = A y + B u with y = (x2, v2, z) and u = (x1, v1).

    The states z of the tyre and its force F follow from its deflection and deflection rate:

    .. math::

        \dot z &= A_t z + B_t \begin{bmatrix} x_1 - x_2 \\ v_1 - v_2 \end{bmatrix}, \qquad
        F = C_t z + D_t \begin{bmatrix} x_1 - x_2 \\ v_1 - v_2 \end{bmatrix} \\
        m\,\dot v_2 &= F - K_3 x_2 - c_3 v_2

    For a compliant frame, its motion x3 is the last state, and the force on the mass is that of the frame:

    .. math::

        m\,\dot v_2 &= F - K_f x_3 \\
        c_3\,\dot x_3 &= c_3 v_2 + K_3 (x_2 - x_3) - K_f x_3

    A mass between the springs of a specimen has its own equation of motion. Its states stand after x2 and v2: those of
    the spring before it, its displacement and its velocity, from the contact on.

    These equations have no friction. `Bench.damped_at` must have replaced a loss factor by a damper.

    Raises
    ------
    ValueError
        If the bench has a loss factor, or a constant of the element is not positive.

    Examples
    --------
    >>> a, b = state_matrices(Zener(120e3, 90e3, 800.0), Bench())
    >>> a.shape, b.shape, bool((np.linalg.eigvals(a).real < 0).all())
    ((3, 3), (3, 2), True)
    """
    if bench.preload_loss_factor:
        raise ValueError("a loss factor has no equation of motion: replace it by a damper with Bench.damped_at")
    if isinstance(tyre, Laden):
        return _laden(tyre, bench)
    tyre = equations(tyre)
    m = bench.mass + bench.tyre_mass
    k3, c3, frame = leaf(bench)
    size = 2 + tyre.a.shape[0]
    a = np.zeros((size, size))
    a[0, 1] = 1.0
    a[1, :2] = -(tyre.d + np.array([k3, c3])) / m
    a[1, 2:] = tyre.c / m
    a[2:, :2] = -tyre.b
    a[2:, 2:] = tyre.a
    b = np.vstack([np.zeros(2), tyre.d / m, tyre.b])
    if isfinite(frame):
        a = np.pad(a, (0, 1))
        a[1, :2] = -tyre.d / m
        a[1, -1] = -frame / m
        a[-1, [0, 1, -1]] = k3 / c3, 1.0, -(k3 + frame) / c3
        b = np.pad(b, ((0, 1), (0, 0)))
    return a + 0.0, b  # the sum changes negative zeros into positive ones


def _laden(tyre: Laden, bench: Bench) -> tuple[FloatArray, FloatArray]:
    """The equations of motion of a rig with springs and masses in a row, from the wheel to the contact."""
    last = tyre.springs[-1]
    a, b = state_matrices(last, bench)
    force = np.zeros(a.shape[0])  # of the last spring, per state
    force[:2], force[2 : 2 + last.a.shape[0]] = -last.d, last.c
    direct = last.d
    for spring, mass in zip(reversed(tyre.springs[:-1]), reversed(tyre.masses), strict=True):
        z, x, v = slice(2, 2 + spring.a.shape[0]), 2 + spring.a.shape[0], 3 + spring.a.shape[0]
        size = a.shape[0] + v - 1
        behind, node = np.r_[:2, v + 1 : size], slice(x, v + 1)
        wide, drive = np.zeros((size, size)), np.zeros((size, 2))
        wide[np.ix_(behind, behind)], wide[behind, node] = a, b
        wide[x, v] = 1.0
        wide[v, behind] = -force / mass
        wide[v, node] -= (direct + spring.d) / mass
        wide[v, z], drive[v] = spring.c / mass, spring.d / mass
        wide[z, z], wide[z, node], drive[z] = spring.a, -spring.b, spring.b
        a, b, force, direct = wide, drive, np.zeros(size), spring.d
        force[z], force[node] = spring.c, -spring.d
    return a, b


def equations(tyre: Zener | StateSpace) -> StateSpace:
    """The tyre in state space."""
    return tyre if isinstance(tyre, StateSpace) else tyre.state_space()


def leaf(bench: Bench) -> tuple[float, float, float]:
    """K3 [N/m], c3 [N s/m] and the stiffness of the frame in series with them [N/m].

    If the damper is so weak that the frame follows within a step, leaf and frame are combined into one spring and
    damper on a rigid frame. The relative error of the stiffness is then (omega c3)^2 / (K3 (K3 + frame)), for example
    1e-11 at 24 Hz for a frame 500 times stiffer than K3.
    """
    k3, c3, frame = bench.preload_stiffness, bench.preload_damping, bench.frame_stiffness
    if isinf(frame) or k3 + frame <= _AT_ONCE * c3:
        return k3, c3, frame
    share = frame / (k3 + frame)
    return k3 * share, c3 * share * share, inf


def far_end(tyre: Element, bench: Bench, frequency: float) -> complex:
    """x2/x1 [1] at one `frequency` [Hz], from the equations of motion; x2 is the motion of the tyre's far end.

    Examples
    --------
    >>> round(abs(far_end(Zener(k1=120e3, k2=90e3, c=800.0), Bench(), 10.0)), 3)
    1.435
    """
    a, b = state_matrices(tyre, bench)
    s = 2j * np.pi * frequency
    states = np.linalg.solve(s * np.eye(a.shape[0]) - a, b @ np.array([1.0, s]))
    return complex(states[0])
