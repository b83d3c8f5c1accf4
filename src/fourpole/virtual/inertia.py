"""Virtual specimens with a mass of their own: springs in a row, and a mass between each two of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
