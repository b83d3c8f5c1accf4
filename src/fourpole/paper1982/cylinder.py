r"""An inflated thin elastic cylinder of finite width on radial springs: frequencies, mode shapes, static deflection.

The theory is Sanders' shell, which is exact for rigid motions and includes the ring, with Flügge's terms of the tension
by inflation: N_theta = p R, and N_y is a stated fraction of it. The pressure is constant and normal to the deformed
wall.
The harmonics n around and m across,

.. math:: w = W \cos n\theta\, X_m(y), \quad v = V \sin n\theta\, X_m(y), \quad
          \partial u/\partial y = U k_m \cos n\theta\, X_m(y)

with u axial, v around, w outward and k_m = m pi/B, are independent of each other for two kinds of edges:

* "guided": X = cos(k y), m = 0, 1, 2 ...: edges that slide radially and around, but neither rotate nor move axially.
  The harmonic m = 0 is the ring in plane strain, with bending stiffness D B and membrane stiffness S B.
* "supported": X = sin(k y), m = 1, 2 ...: shear diaphragms, w = v = N_y = M_y = 0.

The stiffness of (U, V, W) per area is S A/R² + D C/R⁴ + p P/R + k E_ww; the mass per area is mu.

References
----------
J. T. Tielking, "Plane vibration characteristics of a pneumatic tire model", SAE 650492, 1965 (the model of a tyre);
J. L. Sanders, "An improved first-approximation theory for thin shells", NASA TR R-24, 1959 (strains);
W. Flügge, "Stresses in shells", 2nd ed., 1973, on the buckling of cylinders (terms of the initial tension);
A. W. Leissa, "Vibration of shells", NASA SP-288, 1973, ch. 2 (frequencies).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError


@dataclass(frozen=True, eq=False)
class Cylinder(ByValue):
    """A cylinder on springs; the first seven attributes broadcast with each other to (...,).

    Attributes
    ----------
    radius, width : float arrays [m]
        Radius R and width B.
    membrane, bending : float arrays [N/m], [N m]
        Membrane stiffness S > 0 and bending stiffness D in plane strain: E h/(1 - nu²) and E h³/12/(1 - nu²) of a
        homogeneous wall.
    pressure : float array [Pa]
        Gauge pressure p.
    foundation : float array [N/m³]
        Radial stiffness k per area.
    mass : float array [kg/m²]
        Mass mu per area.
    poisson : float [1]
        Poisson's ratio nu, in [0, 0.5].
    axial : float [1]
        N_y/(p R); 0.5 is a cylinder whose closed ends are free to move axially.
    edges : "guided" or "supported"

    Raises
    ------
    ModelError
        If a value is outside its bounds.
    """

    radius: ArrayLike
    width: ArrayLike
    membrane: ArrayLike
    bending: ArrayLike
    pressure: ArrayLike
    foundation: ArrayLike
    mass: ArrayLike
    poisson: float = 0.3
    axial: float = 0.5
    edges: Literal["guided", "supported"] = "guided"

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name in ("radius", "width", "membrane", "mass"):
            if not np.all(np.asarray(getattr(self, name)) > 0):
                raise ModelError(f"the {name} of a cylinder must be positive")
        for name in ("bending", "pressure", "foundation", "axial"):
            if not np.all(np.asarray(getattr(self, name)) >= 0):
                raise ModelError(f"the {name} of a cylinder must not be negative")
        if not 0 <= self.poisson <= 0.5:
            raise ModelError(f"Poisson's ratio lies in 0 to 0.5, not at {self.poisson:g}")
        if self.edges not in ("guided", "supported"):
            raise ModelError(f"the edges of a cylinder are 'guided' or 'supported', not {self.edges!r}")

    def column(self, name: str) -> FloatArray:
        """One attribute as an array (..., 1) that broadcasts with harmonics."""
        return np.asarray(getattr(self, name), dtype=float)[..., None]


def harmonics(edges: str, around: int, across: int) -> tuple[FloatArray, FloatArray]:
    """Harmonics n and m (pairs,) that a load in the middle of the width excites: n < around, `across` values of m."""
    if around < 1 or across < 1:
        raise ModelError(f"state at least one harmonic around and across, not {around} and {across}")
    first = 0 if edges == "guided" else 1
    n, m = np.meshgrid(np.arange(around), first + 2 * np.arange(across), indexing="ij")
    return n.ravel().astype(float), m.ravel().astype(float)


def wave(cylinder: Cylinder, m: FloatArray) -> FloatArray:
    """The wave number lambda = m pi R/B (..., pairs) [1]."""
    return np.asarray(np.pi * m * cylinder.column("radius") / cylinder.column("width"))


def shares(cylinder: Cylinder, n: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Matrices A, C and P of the stiffness, functions of n and lambda: (6, ..., pairs) for uu, uv, uw, vv, vw, ww."""
    nu, g = cylinder.poisson, (1 - cylinder.poisson) / 2
    n, across = np.broadcast_arrays(n, across)
    n2, a2, na = n * n, across * across, n * across
    stretch = [a2 + g * n2, (nu + g) * na, nu * across, n2 + g * a2, n, np.ones_like(n)]
    bend = [g / 4 * n2, -0.75 * g * na, -g * n * na, n2 + 2.25 * g * a2, n * (n2 + (nu + 3 * g) * a2), (n2 + a2) ** 2]
    pull = n2 + cylinder.axial * a2
    tension = [pull, 0 * pull, -across, pull, n, pull]
    return np.stack(stretch), np.stack(bend), np.stack(tension)


def slopes(cylinder: Cylinder, n: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of A, C and P by lambda; see `shares`."""
    nu, g = cylinder.poisson, (1 - cylinder.poisson) / 2
    n, across = np.broadcast_arrays(n, across)
    one, nothing = np.ones_like(n), np.zeros_like(n)
    stretch = [2 * across, (nu + g) * n, nu * one, 2 * g * across, nothing, nothing]
    twist, whole = 2 * (nu + 3 * g) * n * across, 4 * across * (n * n + across**2)
    bend = [nothing, -0.75 * g * n, -g * n * n, 4.5 * g * across, twist, whole]
    pull = 2 * cylinder.axial * across
    return np.stack(stretch), np.stack(bend), np.stack([pull, nothing, -one, pull, nothing, pull])


def elasticity(cylinder: Cylinder, n: FloatArray, m: FloatArray) -> FloatArray:
    """Stiffness per area (6, ..., pairs) [N/m³] of (U, V, W).

    A harmonic with n = 0 has no V and one with m = 0 has no U: there a spring keeps the matrix regular.
    """
    across = wave(cylinder, m)
    stretch, bend, tension = shares(cylinder, n, across)
    radius, membrane = cylinder.column("radius"), cylinder.column("membrane")
    whole = membrane / radius**2 * stretch
    whole += cylinder.column("bending") / radius**4 * bend
    whole += cylinder.column("pressure") / radius * tension
    whole[5] += cylinder.column("foundation")
    whole[0] += np.where(across == 0, membrane / radius**2, 0.0)
    whole[3] += np.where(n == 0, membrane / radius**2, 0.0)
    return np.asarray(whole)


def radial_answer(stiffness: FloatArray) -> FloatArray:
    """(U, V, W) (3, ..., pairs) [m³/N] under a unit radial load per area, from the stiffness (6, ..., pairs)."""
    uu, uv, uw, vv, vw, ww = stiffness
    plane = uu * vv - uv * uv
    u, v = (uv * vw - vv * uw) / plane, (uv * uw - uu * vw) / plane
    w = 1.0 / (ww + uw * u + vw * v)
    return np.stack([u * w, v * w, w])


def load(
    cylinder: Cylinder, n: FloatArray, m: FloatArray, length: ArrayLike, share: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fourier coefficients of a patch in the middle of the width, around and across, and 1/area of each harmonic."""
    half = n * np.asarray(length, dtype=float)[..., None] / (2 * cylinder.column("radius"))
    around = np.sinc(half / np.pi)
    across = np.sinc(m * np.asarray(share, dtype=float)[..., None] / 2)
    parts = np.where(n == 0, 2.0, 1.0) * np.where(m == 0, 1.0, 0.5) * np.pi
    return around, across, 1.0 / (parts * cylinder.column("radius") * cylinder.column("width"))


def natural_frequencies(cylinder: Cylinder, n: ArrayLike, m: ArrayLike) -> FloatArray:
    r"""Natural frequencies of the free cylinder on its springs.

    .. math:: \det\left(\frac{S}{R^2} A + \frac{D}{R^4} C + \frac{p}{R} P + k E_{ww} - \mu\omega^2 I\right) = 0

    Parameters
    ----------
    cylinder : Cylinder
    n, m : (...,) int arrays
        Harmonics around and across; the two arrays broadcast with each other.

    Returns
    -------
    (..., 3) float array [Hz]
        Frequencies, rising along the last axis, for each cylinder, then each n and m. Not-a-number, last, where the
        harmonic has fewer than three motions.

    Raises
    ------
    ModelError
        If the edges have no such m, or the cylinder buckles.

    Examples
    --------
    A steel tube of h/R = 0.01, 20 radii long, between diaphragms: 0.016101 in units of the speed of sound in its wall
    over R.

    >>> tube = Cylinder(1.0, 20.0, 1.0, 1e-4 / 12, 0.0, 0.0, 1.0, edges="supported")
    >>> (2 * np.pi * natural_frequencies(tube, 1, 1)).round(4)
    array([0.0161, 0.6098, 1.4182])
    """
    around, across = np.broadcast_arrays(np.asarray(n, dtype=float), np.asarray(m, dtype=float))
    if np.any(around < 0) or np.any(across < (cylinder.edges == "supported")):
        raise ModelError(f"harmonics around begin at 0, across at {int(cylinder.edges == 'supported')}")
    flat, wide = around.ravel(), across.ravel()
    squares, shape = modes(elasticity(cylinder, flat, wide))
    squares = squares / cylinder.column("mass")[..., None]
    if np.any(squares < -1e-9 * squares[..., -1:]):
        raise ModelError("the cylinder buckles: raise the membrane stiffness S, or lower the pressure p")
    lacks = np.stack([wide == 0, flat == 0, np.zeros(flat.shape, bool)], axis=-1)
    absent = np.einsum("...ij,...i->...j", shape**2, lacks.astype(float)) > 0.5
    found = np.sort(np.where(absent, np.nan, np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)), axis=-1)
    return np.asarray(found.reshape(*found.shape[:-2], *around.shape, 3))


def modes(stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (..., pairs, 3), rising, and vectors (..., pairs, 3, 3), in columns, of (6, ..., pairs)."""
    square = np.moveaxis(stiffness[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])], (0, 1), (-2, -1))
    squares, shape = np.linalg.eigh(square)
    return np.asarray(squares), np.asarray(shape)


def flexibility(
    cylinder: Cylinder, length: ArrayLike, share: ArrayLike, *, around: int = 40, across: int = 10
) -> FloatArray:
    r"""Mean deflection under a uniform load in the middle of the width, per unit of the load, as a sum of harmonics.

    .. math:: H = \sum_{n,m} \frac{X_m(B/2)^2\, \mathrm{sinc}^2(n l/2R)\, \mathrm{sinc}^2(m \pi \beta/2)}{a_{nm}}
              \left[K_{nm}^{-1}\right]_{ww},
              \quad a_{nm} = \pi R B \cdot (2 \text{ if } n = 0) \cdot (1/2 \text{ if } m > 0)

    Parameters
    ----------
    cylinder : Cylinder
    length : float array [m]
        Length l of the patch around; 0 is a point.
    share : float array [1]
        Width of the patch over B, beta; 0 is a point, 1 the whole width. With guided edges 1 is a ring.
    around, across : int
        Number of harmonics; across only those that a load in the middle of the width excites. The truncation error
        under a point load falls with the inverse square of both numbers if the wall has bending stiffness, and only
        logarithmically if D = 0. It falls faster under a patch.

    Returns
    -------
    (...,) float array [m/N]

    Examples
    --------
    A ring of large radius is a beam on springs, K = sqrt(8) k^(3/4) EI^(1/4), with k and EI of the whole width.

    >>> ring = Cylinder(20.0, 0.2, 1e3, 25.0, 0.0, 5e6, 12.0)
    >>> (1 / flexibility(ring, 0.0, 1.0, around=20000, across=1)).round(-1)
    np.float64(133750.0)
    >>> round(8**0.5 * 1e6**0.75 * 5.0**0.25, -1)
    133750.0
    """
    n, m = harmonics(cylinder.edges, around, across)
    along, over, per_area = load(cylinder, n, m, length, share)
    answer = radial_answer(elasticity(cylinder, n, m))[2]
    return np.asarray(np.sum((along * over) ** 2 * per_area * answer, axis=-1))
