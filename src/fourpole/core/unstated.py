"""Parts of a rig that nobody stated: how large they may be, and what they add to its impedance Zr."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.rig import Rig

#: Usual deflection at which a guide slides [m], and the standard uncertainty of its logarithm.
PRESLIDING, PRESLIDING_STD = 3e-5, 1.0
#: Usual loss factor of a frame at its resonance [1].
FRAME_LOSS = 0.05


@dataclass(frozen=True, eq=False)
class Unstated(ByValue):
    """Standard uncertainties of what nobody stated, for routes that take each test by itself; 0 for none.

    Attributes
    ----------
    support : float [1]
        Of what frame and foundation of a rig that moves add to the force of its preload spring at each frequency, over
        this force.
    friction : float [N]
        Of the dry friction of its guide.
    frame_std : float [m/N]
        Of the compliance of a blocked rig whose frame counts as rigid.
    masses : (N, 2, 2) float array, or 0 [kg²]
        Of a rig that moves, covariance of the masses of each specimen that move with its contact and with its far side.
    """

    support: float = 0.0
    friction: float = 0.0
    frame_std: float = 0.0
    masses: FloatArray | float = 0.0

    def part(self, row: int) -> Unstated:
        """Those of one test."""
        masses = np.asarray(self.masses)
        return replace(self, masses=masses[row] if masses.ndim > 2 else masses)

    def std(self, rig: Rig | None, omega: FloatArray) -> FloatArray:
        """Standard uncertainties (N, 3) of support, twice, and friction, as `moved_by` has them; 0 if nothing moves."""
        if rig is None or rig.blocked:
            return np.zeros((omega.size, 3))
        held = self.support * rig.preload_stiffness / omega
        return np.stack(np.broadcast_arrays(held, held, self.friction), axis=1)


NOTHING: Final = Unstated()


def moved_by(omega: FloatArray, v2: ComplexArray) -> ComplexArray:
    """Change of Zr (N, 4) by Re and Im of what the support adds [N s/m], by dry friction of 1 N, and by 1 kg."""
    friction = sliding(omega, np.nan_to_num(np.abs(v2)), PRESLIDING)[0]
    return np.stack([np.ones_like(friction), np.full_like(friction, 1j), friction, 1j * omega], axis=1)


def unstated_parts(
    omega: FloatArray, rig: Rig, speed: FloatArray, rigid: BoolArray, sizes: Mapping[tuple[str, int], float]
) -> tuple[ComplexArray, dict[tuple[str, int], ComplexArray], ComplexArray]:
    r"""What the parts that nobody stated add to Zr, its derivative by each size, and that of all by the support.

    A frame is in series with spring and damper of the rig. Each of its modes is a compliance c with a resonance:

    .. math:: Z = \frac{Z_s}{1 + j\omega Z_s \sum c R},\quad R = \frac{1}{1 - u^2 + j\eta u},\quad u = f/f_r

    Parameters
    ----------
    omega : (N,) float array [rad/s]
    rig : Rig
    speed : (N,) float array [m/s]
        Amplitude of V2, on which dry friction depends; 0 if unknown, and then friction is 0.
    rigid : (N,) bool array
        True for a rigid block in place of the tyre, which has no mass of a tyre.
    sizes : mapping of (str, int) to float
        Sizes of the parts, of `core.sources.PARTS`, with their index. A frame without a resonance is massless.

    Returns
    -------
    sum : (N,) complex array [N s/m]
    by : dict of (str, int) to (N,) complex array
        Its derivative by each size.
    through_frame : (N,) complex array [1]
        Change of Zr by the impedance of spring and damper.
    """
    jw, support = 1j * omega, _support(omega, rig)
    held = PRESLIDING * np.exp(sizes["presliding", 0]) if ("presliding", 0) in sizes else 0.0
    dry, dry_by = sliding(omega, speed, held)
    linear = {"mass": np.where(rigid, 0.0, jw), "spring": 1 / jw, "loss": rig.preload_stiffness / omega + 0j,
              "friction": dry}  # fmt: skip
    by = {(part, 0): shape for part, shape in linear.items()}
    added = sum((size * by[key] for key, size in sizes.items() if key in by), 0 * jw)
    by["presliding", 0] = sizes.get(("friction", 0), 0.0) * dry_by
    modes = {index: _mode(omega, sizes, index) for part, index in sizes if part == "frame"}
    compliance = sum((size * shape[0] for size, shape in modes.values()), 0 * jw)
    through: ComplexArray = np.asarray(1 / (1 + jw * support * compliance), dtype=complex)
    for index, (size, (share, by_resonance, by_damping)) in modes.items():
        each = -jw * (support * through) ** 2
        by["frame", index] = each * share
        by["frame resonance", index], by["frame damping", index] = each * size * by_resonance, each * size * by_damping
    return added + support * (through - 1), by, through**2


def _mode(
    omega: FloatArray, sizes: Mapping[tuple[str, int], float], index: int
) -> tuple[float, tuple[ComplexArray, ComplexArray, ComplexArray]]:
    """A mode of a frame: its compliance [m/N], its shape R (N,), and derivatives of R by resonance and damping."""
    resonance = sizes.get(("frame resonance", index), np.inf)
    u, loss = omega / (2 * np.pi * resonance), 1j * FRAME_LOSS * np.exp(sizes.get(("frame damping", index), 0.0))
    share = 1 / (1 - u**2 + loss * u)
    return sizes["frame", index], (share, share**2 * (loss - 2 * u) * u / resonance, -(share**2) * loss * u)


def sliding(omega: FloatArray, speed: FloatArray, presliding: float) -> tuple[ComplexArray, ComplexArray]:
    r"""Impedance of dry friction of 1 N (N,) [s/m], and its derivative by the logarithm of the presliding.

    Friction holds as a spring does until it slides, at a deflection x. By the fundamental of its hysteresis at an
    amplitude X of the motion,

    .. math:: Z = \frac{1}{V}\Bigl(\frac4\pi (1 - s) - \frac{j}{\pi s}(\theta - \sin\theta\cos\theta)\Bigr),
        \quad s = \frac xX < 1,\quad \cos\theta = 1 - 2s,

    and the spring 1/x alone for s > 1. It is 0 where the speed V (N,) [m/s] is 0, which means unknown.

    References
    ----------
    I. D. Mayergoyz; G. Masing, "Eigenspannungen und Verfestigung beim Messing", 1926 (one element that slips).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(speed > 0, presliding * omega / speed, 0.0)
        angle = np.arccos(np.clip(1 - 2 * s, -1.0, 1.0))
        area = angle - np.sin(angle) * np.cos(angle)
        held = np.where(s > 0, area / (np.pi * s), 0.0)
        held_by = np.where(s > 0, 4 * np.sin(angle) / np.pi - held, 0.0)
        shape = 4 / np.pi * np.maximum(1 - s, 0.0) - 1j * held
        by = np.where(s < 1, -4 / np.pi * s, 0.0) - 1j * held_by
        return np.where(speed > 0, shape / speed, 0.0), np.where(speed > 0, by / speed, 0.0)


def _support(omega: FloatArray, rig: Rig) -> ComplexArray:
    """Impedance (N,) [N s/m] of spring, damper and frame: Zr without its masses."""
    return np.asarray(rig.impedance(omega)) - 1j * omega * (rig.moving_mass + rig.tyre_mass)
