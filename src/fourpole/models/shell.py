r"""A thin elastic cylinder of finite width, inflated, on radial springs: frequencies, shapes, static deflection.

Sanders' shell (exact for rigid motions, and a ring where the width moves as one) with Flügge's terms of the tension
that inflation gives: N_theta = p R, N_y a stated share of it; the pressure stays p and normal to the deformed wall.
The harmonics n around and m across,

.. math:: w = W \cos n\theta\, X_m(y), \quad v = V \sin n\theta\, X_m(y), \quad
          \partial u/\partial y = U k_m \cos n\theta\, X_m(y)

(u axial, v around, w outward; k_m = m pi/B), do not couple between either of two pairs of edges:

* "guided": X = cos(k y), m = 0, 1, 2 ...: edges that slide radially and around, and neither turn nor move axially;
  m = 0 is the ring in plane strain, of bending stiffness D B and membrane stiffness S B;
* "supported": X = sin(k y), m = 1, 2 ...: shear diaphragms, w = v = N_y = M_y = 0.

Per area the stiffness of (U, V, W) is S A/R² + D C/R⁴ + p P/R + k E_ww, and the mass mu everywhere.

References
----------
J. T. Tielking, "Plane vibration characteristics of a pneumatic tire model", SAE 650492, 1965 (the tyre so seen);
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

__all__ = ["Cylinder", "enough_terms", "flexibility", "mode_shape", "natural_frequencies", "ring_frequencies"]

_MOST_TERMS = 1024


@dataclass(frozen=True, eq=False)
class Cylinder(ByValue):
    """The cylinder; every number may be an array (...,).

    Attributes
    ----------
    radius, width : float arrays [m]
        R and B.
    membrane, bending : float arrays [N/m], [N m]
        S and D in plane strain: E h/(1 - nu²) and E h³/12/(1 - nu²) of a homogeneous wall; S > 0.
    pressure : float array [Pa]
        p, over the outside's.
    foundation : float array [N/m³]
        k, radial.
    mass : float array [kg/m²]
        mu.
    poisson : float [1]
        nu, in [0, 0.5].
    axial : float [1]
        N_y over p R; 0.5 is a cylinder whose closed ends float.
    edges : "guided" or "supported"

    Raises
    ------
    ModelError
        If one is outside its bounds.
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
        """Bounds."""
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
        """One attribute as (..., 1), to broadcast against harmonics."""
        return np.asarray(getattr(self, name), dtype=float)[..., None]


def harmonics(edges: str, around: int, across: int) -> tuple[FloatArray, FloatArray]:
    """The n and m (pairs,) that a load amid the width drives: n < around, and the first m, each second one."""
    if around < 1 or across < 1:
        raise ModelError(f"a sum of harmonics needs one or more each way, not {around} and {across}")
    first = 0 if edges == "guided" else 1
    n, m = np.meshgrid(np.arange(around), first + 2 * np.arange(across), indexing="ij")
    return n.ravel().astype(float), m.ravel().astype(float)


def wave(cylinder: Cylinder, m: FloatArray) -> FloatArray:
    """Lambda = m pi R/B, (..., pairs)."""
    return np.asarray(np.pi * m * cylinder.column("radius") / cylinder.column("width"))


def shares(cylinder: Cylinder, n: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, C and P (6, ..., pairs), as uu, uv, uw, vv, vw, ww, of n and lambda."""
    nu, g = cylinder.poisson, (1 - cylinder.poisson) / 2
    n, across = np.broadcast_arrays(n, across)
    n2, a2, na = n * n, across * across, n * across
    stretch = [a2 + g * n2, (nu + g) * na, nu * across, n2 + g * a2, n, np.ones_like(n)]
    bend = [
        g / 4 * n2,
        -0.75 * g * na,
        -g * n * na,
        n2 + 2.25 * g * a2,
        n * (n2 + (nu + 3 * g) * a2),
        (n2 + a2) ** 2,
    ]
    pull = n2 + cylinder.axial * a2
    tension = [pull, 0 * pull, -across, pull, n, pull]
    return np.stack(stretch), np.stack(bend), np.stack(tension)


def slopes(cylinder: Cylinder, n: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Their derivatives by lambda."""
    nu, g = cylinder.poisson, (1 - cylinder.poisson) / 2
    n, across = np.broadcast_arrays(n, across)
    one, nothing = np.ones_like(n), np.zeros_like(n)
    stretch = [2 * across, (nu + g) * n, nu * one, 2 * g * across, nothing, nothing]
    bend = [
        nothing,
        -0.75 * g * n,
        -g * n * n,
        4.5 * g * across,
        2 * (nu + 3 * g) * n * across,
        4 * across * (n * n + across**2),
    ]
    pull = 2 * cylinder.axial * across
    return np.stack(stretch), np.stack(bend), np.stack([pull, nothing, -one, pull, nothing, pull])


def elasticity(cylinder: Cylinder, n: FloatArray, m: FloatArray) -> FloatArray:
    """Stiffness per area (6, ..., pairs) [N/m³] of (U, V, W); what a harmonic lacks stands on a spring by itself."""
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
    """(U, V, W) (3, ..., pairs) to a unit radial load per area, from the stiffness (6, ..., pairs)."""
    uu, uv, uw, vv, vw, ww = stiffness
    plane = uu * vv - uv * uv
    u, v = (uv * vw - vv * uw) / plane, (uv * uw - uu * vw) / plane
    w = 1.0 / (ww + uw * u + vw * v)
    return np.stack([u * w, v * w, w])


def load(
    cylinder: Cylinder, n: FloatArray, m: FloatArray, length: ArrayLike, share: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A patch amid the width in each harmonic, around and across, and over the harmonic's area [1/m²]."""
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
        Harmonics around and across; they broadcast with each other.

    Returns
    -------
    (..., 3) float array [Hz]
        Rising, of the cylinder's shape, then of n and m; NaN, last, where the harmonic has no such motion.

    Raises
    ------
    ModelError
        If the edges have no such m, or the cylinder would buckle.

    Examples
    --------
    A steel tube of h/R = 0.01, 20 radii long, between diaphragms: 0.016101 in units of its wall's speed over R.

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
        raise ModelError("the cylinder buckles: its membrane is softer than its tension; raise S, or lower p")
    lacks = np.stack([wide == 0, flat == 0, np.zeros(flat.shape, bool)], axis=-1)
    absent = np.einsum("...ij,...i->...j", shape**2, lacks.astype(float)) > 0.5
    found = np.sort(np.where(absent, np.nan, np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)), axis=-1)
    return np.asarray(found.reshape(*found.shape[:-2], *around.shape, 3))


def modes(stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (..., pairs, 3), rising, and vectors (..., pairs, 3, 3), in columns, of (6, ..., pairs)."""
    square = np.moveaxis(stiffness[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])], (0, 1), (-2, -1))
    squares, shape = np.linalg.eigh(square)
    return np.asarray(squares), np.asarray(shape)


def mode_shape(
    cylinder: Cylinder, n: int, m: int, theta: ArrayLike, y: ArrayLike, branch: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The motion of one natural frequency, its largest part 1.

    Parameters
    ----------
    cylinder : Cylinder
        One, not arrays.
    n, m : int
        Harmonics around and across.
    theta, y : (...,) float arrays [rad], [m]
        Where; y from 0 to B; they broadcast with each other.
    branch : int
        0, 1 or 2, in the order of `natural_frequencies`.

    Returns
    -------
    u, v, w : (...,) float arrays [1]
        Axial, around, outward.

    Raises
    ------
    ModelError
        If the harmonic has no such motion.

    Examples
    --------
    An oval ring: v is -w/n, a quarter turned.

    >>> ring = Cylinder(0.3, 0.2, 1e8, 5.0, 0.0, 0.0, 12.0)
    >>> u, v, w = mode_shape(ring, 2, 0, [0.0, np.pi / 4], 0.1)
    >>> w.round(3), v.round(3)
    (array([1., 0.]), array([-0. , -0.5]))
    """
    frequencies = natural_frequencies(cylinder, n, m)
    if frequencies.shape != (3,) or not 0 <= branch < np.sum(np.isfinite(frequencies)):
        raise ModelError(f"harmonic n = {n}, m = {m} of one cylinder has no motion {branch}")
    squares, shape = modes(elasticity(cylinder, np.array([float(n)]), np.array([float(m)])))
    wanted = (2 * np.pi * frequencies[branch]) ** 2 * float(np.asarray(cylinder.mass))
    there = np.array([m != 0, n != 0, True])
    real = [at for at in range(3) if np.sum(shape[0, there, at] ** 2) > 0.5]
    part = shape[0, :, min(real, key=lambda at: abs(squares[0, at] - wanted))]
    part = part / part[int(np.argmax(np.abs(part)))]
    number = m * np.pi / float(np.asarray(cylinder.width))
    cos, sin = np.cos(number * np.asarray(y, dtype=float)), np.sin(number * np.asarray(y, dtype=float))
    along, axial = (cos, sin) if cylinder.edges == "guided" else (sin, -cos)
    turn, quarter = np.cos(n * np.asarray(theta, dtype=float)), np.sin(n * np.asarray(theta, dtype=float))
    return part[0] * turn * axial, part[1] * quarter * along, part[2] * turn * along


def ring_frequencies(
    n: ArrayLike,
    *,
    radius: ArrayLike,
    bending: ArrayLike,
    mass: ArrayLike,
    tension: ArrayLike = 0.0,
    foundation: ArrayLike = 0.0,
) -> FloatArray:
    r"""Natural frequencies in its plane of a ring that bends but does not stretch.

    .. math:: \omega_n^2 = \frac{n^2}{m (n^2 + 1)}
              \left(\frac{EI (n^2 - 1)^2}{R^4} + \frac{N (n^2 - 1)}{R^2} + k\right)

    from v' = -w: potential and kinetic energy of w = cos(n theta), v = -sin(n theta)/n. The tension is that of a
    pressure that stays constant and normal to the ring, so that a translation, n = 1, is free of it.

    Parameters
    ----------
    n : (...,) int array
        Waves around, >= 1.
    radius, bending, mass : float arrays [m], [N m²], [kg/m]
        R, EI, and mass per length; > 0.
    tension, foundation : float arrays [N], [N/m²]
        N, and k, radial and per length; >= 0.

    Returns
    -------
    (...,) float array [Hz]

    Raises
    ------
    ModelError
        If n is below 1 or another is outside its bounds.

    References
    ----------
    Lord Rayleigh, "The theory of sound", vol. 1, 2nd ed., 1894, section 233; S. C. Huang, W. Soedel, "Effects of
    Coriolis acceleration on the free and forced in-plane vibrations of rotating rings on elastic foundation", J. Sound
    Vib. 115, 1987 (with springs and tension).

    Examples
    --------
    >>> ring_frequencies([1, 2, 3], radius=0.3, bending=5.0, mass=3.0).round(3)
    array([ 0.   ,  6.126, 17.327])
    """
    waves = np.asarray(n, dtype=float)
    if not np.all(waves >= 1) or not all(np.all(np.asarray(one) > 0) for one in (radius, bending, mass)):
        raise ModelError("a ring needs one wave around or more, and a positive radius, bending stiffness and mass")
    if not all(np.all(np.asarray(one) >= 0) for one in (tension, foundation)):
        raise ModelError("a ring's tension and foundation must not be negative")
    r, square = np.asarray(radius, dtype=float), waves**2
    stiffness = (
        np.asarray(bending) * (square - 1) ** 2 / r**4
        + np.asarray(tension) * (square - 1) / r**2
        + np.asarray(foundation)
    )
    return np.asarray(np.sqrt(stiffness * square / ((square + 1) * np.asarray(mass))) / (2 * np.pi))


def flexibility(
    cylinder: Cylinder, length: ArrayLike, share: ArrayLike, *, around: int = 40, across: int = 10
) -> FloatArray:
    r"""Mean deflection under a uniform load amid the width, over that load: the sum of its harmonics.

    .. math:: H = \sum_{n,m} \frac{X_m(B/2)^2\, \mathrm{sinc}^2(n l/2R)\, \mathrm{sinc}^2(m \pi \beta/2)}{a_{nm}}
              \left[K_{nm}^{-1}\right]_{ww},
              \quad a_{nm} = \pi R B \cdot (2 \text{ if } n = 0) \cdot (1/2 \text{ if } m > 0)

    Parameters
    ----------
    cylinder : Cylinder
    length : float array [m]
        l of the patch, around; 0 is a point.
    share : float array [1]
        beta, its width over B; 0 is a point, 1 the whole width: between guided edges a ring.
    around, across : int
        How many harmonics; across only those that a load amid the width drives. Under a point the rest goes as the
        inverse square of either (bending; as the inverse logarithmically with D = 0), under a patch faster.

    Returns
    -------
    (...,) float array [m/N]

    Examples
    --------
    A ring of large radius is a beam on springs, K = sqrt(8) k^(3/4) EI^(1/4), with k and EI those of its whole width.

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


def enough_terms(
    cylinder: Cylinder, length: ArrayLike, share: ArrayLike, accuracy: float = 1e-3
) -> tuple[int, int, float]:
    """How many harmonics a static deflection of stated accuracy takes.

    Both numbers are doubled until the change is small: under a point each doubling brings a quarter of the last where
    the wall bends, so that all that follow bring a third of the last at most; a patch brings less.

    Parameters
    ----------
    cylinder, length, share
        As in `flexibility`; of arrays the worst counts.
    accuracy : float [1]
        Relative, > 0.

    Returns
    -------
    around, across : int
    error : float [1]
        The estimated rest, relative.

    Raises
    ------
    ModelError
        If 1024 harmonics around are not enough: a point load on a wall that hardly bends.

    Examples
    --------
    >>> tyre = Cylinder(0.3, 0.2, 1e7, 20.0, 2e5, 6e6, 12.0)
    >>> around, across, error = enough_terms(tyre, 0.1, 0.6, 1e-3)
    >>> around, across, error < 1e-3
    (32, 8, True)
    """
    if not accuracy > 0:
        raise ModelError(f"the accuracy must be positive, not {accuracy:g}")
    around, across = 8, 2
    before = flexibility(cylinder, length, share, around=around, across=across)
    error = np.inf
    while around < _MOST_TERMS:
        around, across = 2 * around, 2 * across
        now = flexibility(cylinder, length, share, around=around, across=across)
        error = float(np.max(np.abs(now - before) / now)) / 3
        if error <= accuracy:
            return around, across, error
        before = now
    raise ModelError(
        f"{around} harmonics around and {across} across leave {error:.2g} of the deflection, {accuracy:g} was asked: "
        "give the load a patch, or the wall more bending stiffness"
    )
