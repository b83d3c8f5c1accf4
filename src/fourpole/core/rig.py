r"""The rig beyond the tyre, as a chain of four-poles with the uncertainty of each value.

From the force cell to the foundation::

    F1, V1 ── input mass ── TYRE ── tyre mass ── moving mass (+ added mass) ── preload spring ── frame ── fixed
                                 └ V2 is measured here

The preload spring has a damper and a loss factor. Parts that are not stated are absent: no input or tyre mass, a rigid
frame. With ``blocked=True`` the far side of the specimen does not move.

A fixture between the sensor of V1 and the specimen is a spring in series with K*, which gives way with it. With its
stiffness :math:`k_f` and the force F on the specimen, the motion of the specimen's contact is

.. math:: V_1' = V_1 - j\omega F/k_f.

No test of a specimen tells such a spring from the specimen itself; a rigid block in its place does.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray, real_matrix
from fourpole.core.phasor import Phasors
from fourpole.core.twoport import cascade, mass, spring
from fourpole.errors import RigError
from fourpole.face import public
from fourpole.quantities import RIG_VALUES

#: The rig's values in the order of every gradient, with their SI units.
PARAMETERS = {key: value.unit for key, value in RIG_VALUES.items()}


#: Kind of quantity of each value that is written as a text.
_KINDS = {"kg": "mass", "N/m": "stiffness", "N s/m": "damping", "1": "ratio"}


def _number(name: str, value: float | str) -> float:
    """A value of a rig in SI, from a number or from a text with its unit."""
    if not isinstance(value, str) or name not in PARAMETERS:
        return value  # type: ignore[return-value]
    return float(public("quantity")(value, _KINDS[PARAMETERS[name]]))


@dataclass(frozen=True)
class Rig:
    r"""The parts between the tyre and the foundation, and between the force cell and the tyre.

    Values and uncertainties are numbers in SI, or texts with their unit, as in ``Rig(moving_mass="15 kg")``.

    With the paper's parts, the impedance at the tyre is :math:`Z_r = j\omega m + c_3 + K_3/(j\omega)`. `impedance` has
    the formula with all parts.

    Parameters
    ----------
    moving_mass : float [kg]
        Mass m that moves with V2; > 0 (0 is allowed only where `blocked`).
    preload_stiffness, preload_damping : float [N/m], [N s/m]
        Preload spring K3 and the damper c3 beside it; >= 0.
    preload_loss_factor : float [1]
        Structural loss of the preload spring: K3 (1 + j eta); >= 0.
    tyre_mass : float [kg]
        Moving part of the tyre, lumped at the wheel side; >= 0.
    frame_stiffness : float [N/m]
        Stiffness of the frame behind the preload spring; > 0, default rigid.
    input_mass : float [kg]
        Mass between force cell and contact; >= 0.
    blocked : bool
        True for a rig whose output side does not move (elastomer benches): V2 = 0, its mobility is 0.
    at_ground : bool
        True where F1 of a blocked rig is the force on the ground, and not on the driven end.
    std : mapping of str to float
        Standard uncertainty of each value by its name, in its unit; 0 for values without an entry.

    Raises
    ------
    RigError
        If a value is out of its range or not finite, or `std` names no value of a rig.
    UnitError
        If a text is no quantity of the kind.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (6), (7).

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> rig.impedance(2 * np.pi * 10).round(3)
    np.complex128(744.489j)
    """

    moving_mass: float = 0.0
    preload_stiffness: float = 0.0
    preload_damping: float = 0.0
    preload_loss_factor: float = 0.0
    tyre_mass: float = 0.0
    frame_stiffness: float = float("inf")
    input_mass: float = 0.0
    blocked: bool = False
    at_ground: bool = False
    std: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            object.__setattr__(self, name, _number(name, getattr(self, name)))
        object.__setattr__(self, "std", {name: _number(name, value) for name, value in self.std.items()})
        for name in PARAMETERS:
            self._check(name, getattr(self, name))
        for name, value in self.std.items():
            if name not in PARAMETERS:
                raise RigError(f"the rig has no value {name!r}: it has {', '.join(PARAMETERS)}")
            if not (np.isfinite(value) and value >= 0):
                raise RigError(f"the uncertainty of {name} is {value:g}: it must be zero or positive")

    def _check(self, name: str, value: float) -> None:
        """Raise an error if a value is not possible: only a frame may be rigid, and only a blocked rig has no mass."""
        rigid = name == "frame_stiffness" and value == float("inf")
        must_exceed = name == "frame_stiffness" or (name == "moving_mass" and not self.blocked)
        if not (rigid or (np.isfinite(value) and (value > 0 if must_exceed else value >= 0))):
            wanted = "positive" if must_exceed else "zero or positive"
            raise RigError(f"{name} is {value:g} {PARAMETERS[name]}: it must be a finite, {wanted} number")

    @property
    def critical_damping(self) -> float:
        """Damping with which mass and spring would not swing, 2 sqrt(K3 m) [N s/m]."""
        return float(2 * np.sqrt(self.preload_stiffness * self.moving_mass))

    @property
    def uncertainties(self) -> FloatArray:
        """Standard uncertainties in the order of `PARAMETERS`."""
        return np.array([self.std.get(name, 0.0) for name in PARAMETERS])

    @property
    def resonance(self) -> float:
        """Resonance frequency of the rig alone, K3 = m w^2 [Hz], at which no test shows the tyre; nan if blocked."""
        if self.blocked:
            return float("nan")
        return float(np.sqrt(self.preload_stiffness / (self.moving_mass + self.tyre_mass)) / (2 * np.pi))

    @property
    def _held(self) -> bool:
        """Whether a spring or damper joins the mass to the foundation."""
        return self.preload_stiffness > 0 or self.preload_damping > 0

    def chain(self, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
        """Four-pole from the far side of the tyre to the foundation.

        Parameters
        ----------
        omega : (...,) float array [rad/s]
            Angular frequency.
        added_mass : (...,) float array [kg]
            Mass fixed to the moving mass in addition.

        Returns
        -------
        (..., 2, 2) complex array
            Entries in 1, N s/m, m/(N s), 1.
        """
        omega = np.asarray(omega, dtype=float)
        parts = [mass(self.moving_mass + self.tyre_mass + np.asarray(added_mass), omega)]
        if self._held:
            parts.append(spring(self._leaf(omega), omega))
            if np.isfinite(self.frame_stiffness):
                parts.append(spring(self.frame_stiffness, omega))
        return cascade(*parts)

    def mobility(self, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
        """Mobility V2/F2 of the rig at the tyre, 1/Zr [m/(N s)]; infinite at its own resonance."""
        omega = np.asarray(omega, dtype=float)
        if self.blocked:
            return 1j * omega / self.frame_stiffness + np.zeros(np.shape(added_mass))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(1.0 / np.asarray(self.impedance(omega, added_mass)))[()]

    def impedance(self, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
        r"""Impedance F2/V2 of the rig at the tyre [N s/m]; that of its frame where blocked, infinite if this is rigid.

        .. math::

            Z_r = j\omega (m + m_t + D) + \Bigl(\frac{j\omega}{K_3 (1 + j\eta) + j\omega c_3}
            + \frac{j\omega}{K_f}\Bigr)^{-1}
        """
        omega = np.asarray(omega, dtype=float)
        if self.blocked:
            frame = np.inf if np.isinf(self.frame_stiffness) else self.frame_stiffness / (1j * omega)
            return np.full(np.broadcast_shapes(omega.shape, np.shape(added_mass)), frame, dtype=complex)
        total = self.moving_mass + self.tyre_mass + np.asarray(added_mass)
        return np.asarray(1j * omega * total + self._support(omega))[()]

    def _leaf(self, omega: FloatArray) -> ComplexArray:
        """Dynamic stiffness of the preload spring with its damper [N/m]."""
        return self.preload_stiffness * (1 + 1j * self.preload_loss_factor) + 1j * omega * self.preload_damping

    def _support(self, omega: FloatArray) -> ComplexArray:
        """Impedance of preload spring and frame in series [N s/m]; 0 where nothing holds the mass."""
        if not self._held:
            return np.zeros(omega.shape, dtype=complex)
        leaf = self._leaf(omega)
        return leaf / (1j * omega * (1 + leaf / self.frame_stiffness))

    def impedance_gradient(self, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
        """Derivatives of Zr by the rig's values and, last, by the added mass.

        Parameters
        ----------
        omega : (...,) float array [rad/s]
            Angular frequency.
        added_mass : (...,) float array [kg]
            Mass fixed to the moving mass in addition.

        Returns
        -------
        (..., 8) complex array
            In the order of `PARAMETERS`, then the added mass; zero for absent parts, and for all but the frame of a
            blocked rig.
        """
        omega, added_mass = np.broadcast_arrays(np.asarray(omega, dtype=float), added_mass)
        gradient = np.zeros((*omega.shape, len(PARAMETERS) + 1), dtype=complex)
        jw = 1j * omega
        if self.blocked:
            if np.isfinite(self.frame_stiffness):
                gradient[..., list(PARAMETERS).index("frame_stiffness")] = 1 / jw
            return gradient
        by = dict.fromkeys(("moving_mass", "tyre_mass", "added_mass"), jw)
        by_leaf = (1 + self._leaf(omega) / self.frame_stiffness) ** -2.0 / jw
        by["preload_stiffness"] = by_leaf * (1 + 1j * self.preload_loss_factor)
        by["preload_damping"] = by_leaf * jw
        by["preload_loss_factor"] = by_leaf * 1j * self.preload_stiffness
        by["frame_stiffness"] = self._support(omega) ** 2 * jw / self.frame_stiffness**2
        names = [*PARAMETERS, "added_mass"]
        for name, derivative in by.items():
            gradient[..., names.index(name)] = derivative
        return gradient

    def impedance_slope(self, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
        """Derivative of Zr by the angular frequency [N s^2/m]; 0 where blocked by a rigid frame."""
        omega, added_mass = np.broadcast_arrays(np.asarray(omega, dtype=float), added_mass)
        if self.blocked:
            frame = self.frame_stiffness if np.isfinite(self.frame_stiffness) else 0.0
            return np.asarray(1j * frame / omega**2)
        slope = 1j * (self.moving_mass + self.tyre_mass + added_mass) - self._support(omega) / omega
        if self._held:
            slope = slope + self.preload_damping / omega * (1 + self._leaf(omega) / self.frame_stiffness) ** -2.0
        return np.asarray(slope)[()]

    def shifted(self, **values: float) -> Rig:
        """The rig with other values, which are not checked: an estimate near zero may be negative."""
        rig = copy(self)
        for name, value in values.items():
            object.__setattr__(rig, name, value)
        return rig


def without_fixture(phasors: Phasors, compliance: FloatArray, input_mass: FloatArray) -> Phasors:
    """Phasors with V1 at the specimen.

    Parameters
    ----------
    phasors : Phasors
        N tests, with V1 at its sensor.
    compliance : (N,) float array [m/N]
        1/k_f of the fixture; 0 where there is none.
    input_mass : (N,) float array [kg]
        Mass between the force cell and the fixture.

    Examples
    --------
    A specimen of 100 kN/m on a fixture of 900 kN/m looks 10 % softer:

    >>> one = Phasors.from_polar([10.0], 90.0, 2e-3 * np.pi * 10, np.pi / -2)
    >>> true = without_fixture(one, np.array([1 / 900e3]), np.zeros(1))
    >>> abs(true.omega * true.amplitudes[:, 0] / true.amplitudes[:, 1]).round(3).tolist()
    [100000.0]
    """
    jw = 1j * phasors.omega
    turn = np.tile(np.eye(3, dtype=complex), (len(jw), 1, 1))
    turn[:, 1, 0] = -jw * compliance
    turn[:, 1, 1] += jw**2 * input_mass * compliance
    # The inertia of the input mass, which moves with the sensor, stays the same as it is taken off F1 later.
    turn[:, 0] += (jw * input_mass)[:, None] * (turn[:, 1] - np.array([0.0, 1.0, 0.0]))
    known = np.where(np.isfinite(phasors.amplitudes), phasors.amplitudes, 0.0)
    amplitudes = np.where(np.isfinite(phasors.amplitudes), np.einsum("nij,nj->ni", turn, known), phasors.amplitudes)
    real = real_matrix(turn)
    covariance = real @ np.nan_to_num(phasors.covariance) @ np.swapaxes(real, 1, 2)
    return replace(phasors, amplitudes=amplitudes, covariance=covariance)


def given_way(phasors: Phasors, input_mass: float, rigid: BoolArray) -> tuple[ComplexArray, float]:
    """Change (N,) of log V1 by a fixture as compliant as the specimens are, and this compliance [m/N].

    It is 0 for tests without F1 or V1; the compliance is the median of those of all tests without a `rigid` block (N,).
    """
    f1, v1, v2 = phasors.amplitudes.T
    jw = 1j * phasors.omega
    with np.errstate(divide="ignore", invalid="ignore"):
        force = f1 - jw * input_mass * v1
        across = np.where(rigid, np.nan, np.abs((v1 - np.nan_to_num(v2)) / (phasors.omega * force)))
        size = float(np.nanmedian(across)) if np.isfinite(across).any() else 0.0
        change = jw * force / v1 * size
    return np.where(np.isfinite(change), change, 0.0), size
