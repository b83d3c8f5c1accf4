r"""A specimen with inertia: a two-port of springs and of a mass between them, or of a mass that is spread along it.

Between force and motion of its two ends a specimen is

.. math:: \begin{bmatrix} F_1 \\ -F_2 \end{bmatrix} = D \begin{bmatrix} x_1 \\ x_2 \end{bmatrix},\qquad
          D = S \begin{bmatrix} 1 & -1 \\ -1 & 1 \end{bmatrix}
              - \omega^2 \begin{bmatrix} m_1 & 0 \\ 0 & m_2 \end{bmatrix},

a spring S between two masses that stand on the ground. All three are complex, and depend on frequency. With K* of its
springs alone, a mass :math:`m_b` and the share :math:`r = k_{contact}/k_{rim}` of the two springs beside it,

.. math:: S = \frac{K^*}{1 - a},\quad m_1 = \frac{m_b\,r/(1 + r)}{1 - a},\quad m_2 = \frac{m_b/(1 + r)}{1 - a},\quad
          a = \frac{\omega^2 m_b\,r}{(1 + r)^2 K^*}.

The share depends on frequency as far as the two springs are not of one law:

.. math:: \frac1r = \Bigl(1 + \frac1{r_0}\Bigr) \Bigl(\frac{K^*}{K_0}\Bigr)^{-p/(1 + r_0)} - 1,

which is :math:`r_0 (K^*/K_0)^p` near :math:`K_0`. For p = 0 they are of one law, for :math:`p = 1 + r_0` the spring at
the rim is constant. In a rod the mass is spread along the specimen: n equal masses between n + 1 equal springs have

.. math:: S = (n + 1)\,K^*\,\frac{\sin\varphi}{\sin(n + 1)\varphi},\quad
          \omega^2 m_1 = \omega^2 m_2
          = (n + 1)\,K^* \Bigl(\cos\varphi - 1 + \sin\varphi\,\tan\frac{(n + 1)\varphi}{2}\Bigr),\quad
          \sin^2\frac\varphi2 = \frac{\omega^2 m_b}{4\,n\,(n + 1)\,K^*},

for every real n. The spread 1 - 1/n is 0 for one mass in the middle, and 1 for a mass that is spread evenly.

References
----------
H. B. Pacejka, "Tire and Vehicle Dynamics", 3rd ed., 2012, chapter 9 (rigid ring). SAE J2710 (modal tests of tyres).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByRows, ByValue, ComplexArray, FloatArray
from fourpole.core.components import component
from fourpole.core.sources import Kind

#: Modulus of the square of the angle of a rod below which it is linear in it; what this leaves out is its square.
_SMALL = 1e-8
#: Least mass of each part of a rod, over that of all.
_FINEST = 1e-4
#: Largest logarithm of a share, and least logarithm of the stiffness at the rim over K*: of a search that went astray.
_LARGE, _SOFTER = 12.0, 0.05
#: Logarithm of a share, of a search that went astray, below which it is nothing.
_FARTHEST = 500.0
_PARTS = ("spring", "contact", "wheel")


#: Standard uncertainty of the mass that moves between the ends, over the weight; of a block it is that mass, too.
_HALF = 0.5
#: Stiffness of the spring at the contact over that at the rim: of a tyre, and of a block of rubber.
TYRE, BLOCK = 0.2, 1.0
#: Least relative uncertainty of a stated spring at the rim: that of rubber between the mode and the tests.
_LEAST = 0.03
#: Uncertainty of the log odds of a stated spread over those of which nothing is known; no mass is nearer to an end, and
#: one that is stated there may be as near as it likes, so that its log odds have the whole uncertainty.
_ABOUT, _EVEN = 0.25, 0.01
#: Newton steps from the dynamic stiffness at an end to K* of the springs.
_STEPS = 20


class Form(Enum):
    """Where a specimen has its mass."""

    MASSLESS = "massless"
    BELT = "belt"
    ROD = "rod"


@dataclass(frozen=True, eq=False)
class Ends(ByValue):
    """The spring between the ends of N specimens, and the mass at each, as a test at one frequency sees them.

    Attributes
    ----------
    spring : (N,) complex array [N/m]
    contact, wheel : (N,) complex arrays [kg]
        The masses at the contact and at the wheel.
    by : (N, 4, 3) complex array
        Derivatives by log K*, mass, log share and exponent, of log `spring`, `contact` and `wheel`. A rod has the
        logarithm of the odds of its spread in place of the exponent.
    """

    spring: ComplexArray
    contact: ComplexArray
    wheel: ComplexArray
    by: ComplexArray


def massless(stiffness: ComplexArray) -> Ends:
    """The ends of specimens without inertia, of K* (N,) [N/m]."""
    zero, by = np.zeros(stiffness.size, dtype=complex), np.zeros((stiffness.size, 4, 3), dtype=complex)
    by[:, 0, 0] = 1.0
    return Ends(stiffness, zero, zero, by)


def ends_of(
    stiffness: ComplexArray,
    omega: FloatArray,
    mass: FloatArray,
    log_share: ComplexArray,
    exponent: FloatArray,
    reference: ComplexArray,
    rod: BoolArray,
) -> Ends:
    """The ends of N specimens, and their derivatives.

    Parameters
    ----------
    stiffness : (N,) complex array [N/m]
        K* of the springs.
    omega, mass, exponent : (N,) float arrays [rad/s], [kg], [1]
        Of a rod the last is the logarithm of the odds of its spread.
    log_share : (N,) complex array [1]
        Logarithm of the share where K* is `reference` (N,) [N/m].
    rod : (N,) bool array
        True for a mass that is spread along the specimen, which has no share.
    """
    belt = _belt(stiffness, omega, mass, log_share, exponent, reference)
    if not rod.any():
        return belt
    along = _rod(stiffness, omega, mass, exponent)
    spring, contact, wheel = (np.where(rod, getattr(along, name), getattr(belt, name)) for name in _PARTS)
    return Ends(spring, contact, wheel, np.where(rod[:, None, None], along.by, belt.by))


def _belt(
    stiffness: ComplexArray,
    omega: FloatArray,
    mass: FloatArray,
    log_share: ComplexArray,
    exponent: FloatArray,
    reference: ComplexArray,
) -> Ends:
    share, law = _share(np.log(stiffness / reference), log_share, exponent)
    contact, wheel = share / (1 + share), 1 / (1 + share)
    between = contact * wheel
    a = omega**2 * mass * between / stiffness
    h = 1 / (1 - a)
    at_contact, at_wheel = mass * contact * h, mass * wheel * h
    by = np.zeros((stiffness.size, 4, 3), dtype=complex)
    changes = np.stack([-a, omega**2 * between / stiffness, a * (wheel - contact)], axis=1)  # of a
    by[:, :3, 0] = h[:, None] * changes
    by[:, :3, 1], by[:, :3, 2] = at_contact[:, None] * by[:, :3, 0], at_wheel[:, None] * by[:, :3, 0]
    by[:, 0, 0] += 1.0
    by[:, 1, 1] += contact * h
    by[:, 1, 2] += wheel * h
    by[:, 2, 1] += mass * between * h
    by[:, 2, 2] -= mass * between * h
    by[:, 0] += law[0][:, None] * by[:, 2]
    by[:, 3] = law[2][:, None] * by[:, 2]
    by[:, 2] *= law[1][:, None]
    return Ends(stiffness * h, at_contact, at_wheel, by)


def _share(
    bend: ComplexArray, log_share: ComplexArray, exponent: FloatArray
) -> tuple[ComplexArray, tuple[ComplexArray, ComplexArray, ComplexArray]]:
    """The share (N,) where log K* is by `bend` above that of the reference; derivatives of its logarithm.

    These are by `bend`, by the logarithm of the share at the reference, and by the exponent.
    """
    first = np.exp(np.clip(log_share.real, -_LARGE, _LARGE) + 1j * log_share.imag)
    whole = 1 + first
    rise = exponent * bend / whole
    most = np.log(np.abs(whole / first)) - _SOFTER
    rise = np.clip(rise.real, -_FARTHEST, most) + 1j * rise.imag
    share = 1 / (whole / first * np.exp(-rise) - 1)
    slope = (1 + share) / whole
    return share, (exponent * slope, slope * (1 - rise * first), bend * slope)


def log_odds(spread: float) -> float:
    """Logarithm of the odds of the spread of a rod, s/(1 - s), in which it has no end."""
    each = float(np.clip(1 - spread, _FINEST, 1 - _FINEST))
    return float(np.log(1 / each - 1))


def spread_of(odds: ArrayLike) -> FloatArray:
    """The spread of a rod by the logarithm of its odds."""
    return np.asarray(1 / (1 + np.exp(-np.clip(odds, -_LARGE, _LARGE))))


def _rod(stiffness: ComplexArray, omega: FloatArray, mass: FloatArray, odds: FloatArray) -> Ends:
    unit, each = omega**2 / stiffness, np.maximum(1 - spread_of(odds), _FINEST)  # one mass over all
    x = np.where(np.abs(mass * unit) < _SMALL, _SMALL, mass * unit)
    rest = mass * unit - x
    sine = 0.5 * each * np.sqrt(x / (1 + each))
    angle = 2 * np.arcsin(sine)
    angle = angle.real + 1j * np.clip(angle.imag, -_LARGE * each, _LARGE * each)
    count = (1 + each) / each
    whole, by_sine = count * angle, 2 / np.sqrt(1 - sine**2)
    by_x, by_each = by_sine * sine / (2 * x), by_sine * sine * (1 / each - 0.5 / (1 + each))
    whole_by_each = count * by_each - angle / each**2
    cot, whole_cot, half = 1 / np.tan(angle), 1 / np.tan(whole), np.tan(whole / 2)
    log_spring = np.log(count) + np.log(np.sin(angle)) - np.log(np.sin(whole))
    log_by_x = by_x * (cot - count * whole_cot)
    log_by_each = 1 / (1 + each) - 1 / each + by_each * cot - whole_by_each * whole_cot
    # The mass at an end over that of the rod.
    turned = count * np.sin(angle) * half
    end = turned / x - 0.5 * each
    end_by_x = (turned * (by_x * cot + 0.5 * count * by_x * (half + 1 / half)) - turned / x) / x
    end_by_each = (
        turned * (-1 / (each * (1 + each)) + by_each * cot + 0.5 * whole_by_each * (half + 1 / half)) / x - 0.5
    )
    end, log_spring = end + rest * end_by_x, log_spring + rest * log_by_x
    by = np.zeros((stiffness.size, 4, 3), dtype=complex)
    square = mass * unit
    by[:, 0, 0], by[:, 1, 0], by[:, 3, 0] = 1 - square * log_by_x, unit * log_by_x, log_by_each
    by[:, 0, 1] = by[:, 0, 2] = -mass * square * end_by_x
    by[:, 1, 1] = by[:, 1, 2] = end + square * end_by_x
    by[:, 3, 1] = by[:, 3, 2] = mass * end_by_each
    by[:, 3] *= (-each * (1 - each))[:, None]
    at_end = np.asarray(mass * end, dtype=complex)
    return Ends(stiffness * np.exp(log_spring), at_end, at_end, by)


@dataclass(frozen=True)
class Specimen:
    r"""The inertia of a specimen at one condition; K* of its springs is apart.

    Parameters
    ----------
    form : Form
    mass : float [kg]
        The mass between its springs, or that of a rod.
    share : complex [1]
        Stiffness of the spring at the contact over that at the rim where K* is `reference`.
    exponent : float [1]
        Power of K* by which the share changes near the reference.
    spread : float [1]
        Of a rod: 0 for one mass in the middle, 1 - 1/n for n equal masses, 1 for a mass that is spread evenly.
    reference : complex [N/m]
        K* at which the share is `share`.

    Examples
    --------
    A car's tyre with a belt of 7 kg: 24 Hz is far below its first mode, and yet its ends differ from its spring by 2 to
    41 %.

    >>> tyre = Specimen(Form.BELT, 7.0, 0.2)
    >>> stiffness, omega = np.array([2.9e5]), 2 * np.pi * np.array([24.0])
    >>> d = tyre.dynamic_stiffness(stiffness, omega)
    >>> (d[0] / stiffness).real.round(3)
    array([[ 0.983, -1.083],
           [-1.083,  0.587]])
    >>> tyre.frequencies(stiffness).round(1)
    array([[79.3, 86.9]])
    """

    form: Form = Form.MASSLESS
    mass: float = 0.0
    share: complex = 0.2
    exponent: float = 0.0
    reference: complex = 1.0
    spread: float = 1.0

    def ends(self, stiffness: ComplexArray, omega: FloatArray) -> Ends:
        """The spring and the masses of both ends, for K* (N,) [N/m] at angular frequencies (N,) [rad/s]."""
        if self.form is Form.MASSLESS:
            return massless(stiffness)
        ones = np.ones(stiffness.size)
        rod = self.form is Form.ROD
        log_share, last = np.log(complex(self.share)) * ones, (log_odds(self.spread) if rod else self.exponent) * ones
        alike = np.full(stiffness.size, rod)
        return ends_of(stiffness, omega, self.mass * ones, log_share, last, self.reference * ones, alike)

    def share_at(self, stiffness: ComplexArray) -> ComplexArray:
        """Share of the springs (N,) [1] where K* is `stiffness` (N,) [N/m]."""
        bend = np.log(np.asarray(stiffness, dtype=complex) / self.reference)
        return _share(bend, np.log(complex(self.share)) * np.ones(bend.shape), self.exponent * np.ones(bend.shape))[0]

    def dynamic_stiffness(self, stiffness: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """D (N, 2, 2) [N/m]: the forces on both ends over their motions, contact first.

        Parameters
        ----------
        stiffness : (N,) complex array [N/m]
            K* of the springs.
        omega : (N,) float array [rad/s]
        """
        stiffness, omega = np.atleast_1d(np.asarray(stiffness, complex)), np.atleast_1d(np.asarray(omega, float))
        ends = self.ends(stiffness, omega)
        d = np.empty((stiffness.size, 2, 2), dtype=complex)
        d[:, 0, 0], d[:, 1, 1] = ends.spring - omega**2 * ends.contact, ends.spring - omega**2 * ends.wheel
        d[:, 0, 1] = d[:, 1, 0] = -ends.spring
        return d

    def frequencies(self, stiffness: ArrayLike) -> FloatArray:
        r"""First frequency of the mass (N, 2) [Hz] with the rim held, for K* (N,) [N/m]: contact free, and held too.

        Of a belt they are :math:`\sqrt{\mathrm{Re}\,k_{rim}/m_b}/2\pi` and that of both springs together; the first is
        FREQ_LONG of MF-Swift. Of a rod they are the first of its own.
        """
        stiffness = np.atleast_1d(np.asarray(stiffness, complex))
        if self.form is Form.ROD:
            each = max(1 - self.spread, _FINEST)
            root = np.sqrt(stiffness.real / self.mass * (1 + each)) / (np.pi * each)
            turns = [np.sin(0.5 * np.pi * each / (more + each)) for more in (2, 1)]
            return np.stack([root * turn for turn in turns], axis=1)
        share = self.share_at(stiffness)
        rim = stiffness * (1 + share) / share
        with np.errstate(divide="ignore", invalid="ignore"):
            pair = np.stack([rim.real, (rim * (1 + share)).real], axis=1)
            return np.asarray(np.sqrt(pair / self.mass) / (2 * np.pi))


@dataclass(frozen=True)
class Body:
    """What is stated of the inertia of a specimen.

    Attributes
    ----------
    mass, mass_std : float [kg]
        Its mass between the ends, and the standard uncertainty; 0 and 0 where nothing is stated.
    share : float [1]
        Usual share of its springs.
    frequency, frequency_std : float [Hz]
        First frequency of the mass with the rim held and the contact free, and its standard uncertainty; 0 and 0 where
        it is not stated.
    spread : float, optional [1]
        How far the mass is spread from end to end, as of `Specimen`; None where it is not stated.
    """

    mass: float = 0.0
    mass_std: float = 0.0
    share: float = TYRE
    frequency: float = 0.0
    frequency_std: float = 0.0
    spread: float | None = None

    @classmethod
    def weighed(cls, weight: float, share: float = TYRE, spread: float | None = None) -> Body:
        """A specimen of which the whole weight [kg] is stated: some part of it moves between the ends."""
        block = share == BLOCK or spread is not None
        return cls(_HALF * weight if block else 0.0, _HALF * weight, share, spread=spread)

    @property
    def is_block(self) -> bool:
        """Whether it may be a rod: its spread is stated, or neither a mode nor that one of its springs is softer."""
        return self.spread is not None or (self.share == BLOCK and not self.frequency)

    @property
    def odds(self) -> tuple[float, float]:
        """Logarithm of the odds of its spread, and its standard uncertainty."""
        std = component(Kind.BELT_SPREAD).std
        if self.spread is None:
            return 0.0, std
        inside = _EVEN < self.spread < 1 - _EVEN
        return log_odds(float(np.clip(self.spread, _EVEN, 1 - _EVEN))), (_ABOUT if inside else 1.0) * std

    def springs(self, stiffness: float) -> tuple[float, float]:
        """Logarithm of the share where K' is `stiffness` [N/m], and its standard uncertainty."""
        rim = self.mass * (2 * np.pi * self.frequency) ** 2
        if not self.frequency or not 0 < stiffness < rim:
            return float(np.log(self.share)), component(Kind.BELT_SHARE).std
        share = stiffness / (rim - stiffness)
        relative = np.hypot(self.mass_std / self.mass, 2 * self.frequency_std / self.frequency)
        return float(np.log(share)), float((1 + share) * max(relative, _LEAST))


@dataclass(frozen=True, eq=False)
class Inertia(ByRows):
    """What is known of the inertia of the specimens of N tests.

    Attributes
    ----------
    mass, mass_std : (N,) float arrays [kg]
    shape, shape_std : (N,) float arrays [1]
        Logarithm of the share of the springs, of a block that of the odds of the spread of its mass, and its standard
        uncertainty.
    block : (N,) bool array
    """

    mass: FloatArray
    mass_std: FloatArray
    shape: FloatArray
    shape_std: FloatArray
    block: BoolArray

    @classmethod
    def of(cls, bodies: Sequence[Body], stiffness: FloatArray) -> Inertia:
        """That of N specimens as stated, whose K' is about `stiffness` (N,) [N/m]."""
        each = zip(bodies, stiffness, strict=True)
        shapes = [body.odds if body.is_block else body.springs(one) for body, one in each]
        shape, std = np.array(shapes).reshape(-1, 2).T
        mass, mass_std = np.array([(body.mass, body.mass_std) for body in bodies]).reshape(-1, 2).T
        block = np.array([body.is_block for body in bodies], dtype=bool)
        return cls(mass, mass_std, shape, np.where(mass_std > 0, std, 0.0), block)

    def springs(
        self, measured: ComplexArray, omega: FloatArray, *, at_ground: bool
    ) -> tuple[ComplexArray, ComplexArray]:
        r"""K* (N,) of the springs of specimens whose far end is held [N/m], and derivatives (N, 3).

        Parameters
        ----------
        measured : (N,) complex array [N/m]
            Force over the motion of the driven end: :math:`D_{11}` where the force is that on this end, and
            :math:`-D_{12}` where it is that on the ground.
        omega : (N,) float array [rad/s]
        at_ground : bool
            Whether the force is that on the ground.

        Returns
        -------
        stiffness : (N,) complex array [N/m]
        by : (N, 3) complex array
            Derivatives by `measured`, by the mass and by the shape.
        """
        share, spread = np.where(self.block, 0.0, self.shape) + 0j, np.where(self.block, self.shape, 0.0)
        # The search begins at the larger root of a belt, which is that below its first mode.
        r, inertia = np.exp(share), omega**2 * self.mass
        a = (1 + r) ** 2 / r
        linear = measured if at_ground else measured + inertia / (1 + 1 / r)
        root = np.sqrt(linear**2 - 4 * measured * inertia / a)
        stiffness = 0.5 * (linear + np.where(root.real < 0, -root, root))
        for step in range(_STEPS + 1):
            ends = ends_of(stiffness, omega, self.mass, share, spread, stiffness, self.block)
            by = np.concatenate(
                [ends.by[:, :2], np.where(self.block[:, None], ends.by[:, 3], ends.by[:, 2])[:, None]], 1
            )
            slopes = ends.spring[:, None] * by[:, :, 0]
            value = ends.spring
            if not at_ground:
                value, slopes = value - omega**2 * ends.contact, slopes - (omega**2)[:, None] * by[:, :, 1]
            slopes[:, 0] /= stiffness
            if step < _STEPS:
                stiffness = stiffness - (value - measured) / slopes[:, 0]
        return stiffness, np.stack([1 / slopes[:, 0], *(-slopes[:, 1:] / slopes[:, :1]).T], axis=1)
