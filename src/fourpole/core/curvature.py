r"""Second-order uncertainty of K2 and C, which counts most where their first derivatives vanish.

With :math:`K^* - K_1 = a + jb`, :math:`K_2 = a + b^2/a` and :math:`\omega C = b + a^2/b`. Both have second derivatives
of rank one: they bend with the error :math:`w = db - (b/a)\,da` only, the change of the arm's loss factor times a.

Where value ± 1.96 u is not a 95 % interval, draws give one (Monte Carlo).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.confidence import LEVELS, NORMAL_95
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import arm_slopes, maxwell_arm, stiffness_by
from fourpole.core.sources import Source
from fourpole.core.unstated import NOTHING, Unstated, moved_by

#: Relative uncertainty of K2 or C above which propagation of uncertainty to second order is not valid.
NOT_LINEAR = 0.3
#: Mean of the fourth power of a standard normal deviation: the mean square of s z² about 0, over s².
_FOURTH_MOMENT = 3.0


@dataclass(frozen=True, eq=False)
class Curvature(ByValue):
    r"""Second-order terms of K2 and C of N tests: :math:`\Delta K_2 = w^2/a`, :math:`\Delta C = a^2 w^2/(\omega b^3)`.

    The mean of such a term is the shift s of K2 or C, its standard deviation :math:`\sqrt{2}\,s`. The stated value is
    not shifted, because the sign depends on what is held fixed, the truth or the measured value. The uncertainty is the
    root mean square deviation from the stated value, so that its second-order part is :math:`\sqrt{3}\,s`.

    Attributes
    ----------
    loss_factor : (N,) float array [1]
        b/a, the loss factor of the arm.
    bend : (N, 2) float array [m/N], [m/(N s/m)²]
        Second-order terms of K2 and C over w².

    Notes
    -----
    Deviation from the source: for normal inputs the note adds the variance 2 s² of the second-order term, and a product
    of first and third derivatives. Here 3 s² is added, and third derivatives are left out.

    References
    ----------
    JCGM 100:2008, 5.1.2, note.

    Examples
    --------
    >>> bent = Curvature.of(np.array([120e3 + 20e3j]), np.array([100e3]), np.array([100.0]))
    >>> np.sqrt(bent.covariance(np.array([2e3**2]))[0, 0, 0]).round(1)  # 2000 N/m in K1, dK2/dK1 = 0
    np.float64(346.4)
    """

    loss_factor: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, stiffness: ComplexArray, k1: FloatArray, omega: FloatArray) -> Self:
        """The curvature of K2 and C for K* and K1 (N,) [N/m] at an angular frequency (N,) [rad/s]."""
        arm = stiffness - k1
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            bend = np.stack([1.0 / arm.real, arm.real**2 / (omega * arm.imag**3)], axis=1)
            return cls(arm.imag / arm.real, bend)

    def by(self, by_arm: ComplexArray) -> FloatArray:
        """Derivatives (N, k) of w [N/m] from the complex derivatives (N, k) of K* - K1."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(by_arm.imag - self.loss_factor[:, None] * by_arm.real)

    def covariance(self, variance: FloatArray) -> FloatArray:
        """Second-order part (N, 2, 2) of the mean square deviation of K2 and C, from the variance (N,) of w [N²/m²]."""
        with np.errstate(invalid="ignore", over="ignore"):
            shift = self.bend * variance[:, None]
            return np.asarray(_FOURTH_MOMENT * shift[:, :, None] * shift[:, None, :])

    def distributed(self, sources: Mapping[Source, FloatArray]) -> dict[Source, FloatArray]:
        """The variances (N, 6) of the outputs by source with the second-order part of K2 and C.

        Each source has the fraction of the second-order part that it has of the variance of w.

        Parameters
        ----------
        sources : mapping of Source to (N, 7) float array
            First-order variances of the outputs, in the order of `core.identify.OUTPUTS`, and of w.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            total = np.sum([variance[:, 6] for variance in sources.values()], axis=0)
            each = _FOURTH_MOMENT * self.bend**2 * total[:, None]
            made = {}
            for source, variance in sources.items():
                made[source] = variance[:, :6].copy()
                made[source][:, 3:5] += each * variance[:, 6:]
            return made


def arm_covariance(stiffness: ArrayLike, k1: ArrayLike, omega: ArrayLike, covariance: FloatArray) -> FloatArray:
    """Covariance (N, 2, 2) of K2 [N/m] and C [N s/m] to second order, for an exact frequency.

    Parameters
    ----------
    stiffness, k1, omega : (N,) complex and float arrays [N/m], [N/m], [rad/s]
    covariance : (N, 2, 2) float array [N²/m²]
        Covariance of Re and Im of K* - K1.

    Examples
    --------
    >>> of_k1 = np.array([[[2e3**2, 0.0], [0.0, 0.0]]])
    >>> np.sqrt(arm_covariance([120e3 + 20e3j], [100e3], [100.0], of_k1)[0].diagonal()).round(1)
    array([346.4,  40.1])
    """
    stiffness, k1, omega = np.asarray(stiffness), np.asarray(k1, dtype=float), np.asarray(omega, dtype=float)
    each = np.tile([1.0, 1j], (stiffness.size, 1))
    bent = Curvature.of(stiffness, k1, omega)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        by = arm_slopes(stiffness, k1, maxwell_arm(stiffness, k1, omega), omega, each)
        bending = bent.by(each)
        variance = np.einsum("ni,nij,nj->n", bending, covariance, bending)
        return np.asarray(by @ covariance @ np.swapaxes(by, 1, 2) + bent.covariance(variance))


def largest_bend(stiffness: ComplexArray, k1: FloatArray, omega: FloatArray, covariance: FloatArray) -> FloatArray:
    r"""Distance of the 95 % quantiles of K2 and C from value ± 1.96 u, over u, to second order, (N, 2) [1].

    It is the upper bound :math:`1.96^2 s/u`, which is reached where the first-order part depends on w alone.

    Parameters
    ----------
    stiffness, k1, omega, covariance
        The same as for `arm_covariance`.
    """
    whole = arm_covariance(stiffness, k1, omega, covariance)
    bent = Curvature.of(stiffness, k1, omega)
    bending = bent.by(np.tile([1.0, 1j], (stiffness.size, 1)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shift = bent.bend * np.einsum("ni,nij,nj->n", bending, covariance, bending)[:, None]
        return np.asarray(NORMAL_95**2 * np.abs(shift) / np.sqrt(np.diagonal(whole, 0, 1, 2)))


@dataclass(frozen=True, eq=False)
class Interval(ByValue):
    """Quantiles of K2 or C at `LEVELS`; infinite if there is no upper limit.

    Attributes
    ----------
    quantiles : (3,) float array [N/m] or [N s/m]
    non_passive_share : float [1]
        Share of the draws whose K2 or C is not passive.
    """

    quantiles: FloatArray
    non_passive_share: float


def draw_around(stiffness: complex, covariance: FloatArray, draws: int, rng: np.random.Generator) -> ComplexArray:
    """Draws (draws,) of K* [N/m], normal in log K*, from the covariance (2, 2) of Re and Im of K*."""
    turn = np.array([[stiffness.real, stiffness.imag], [-stiffness.imag, stiffness.real]]) / abs(stiffness) ** 2
    parts = _normal(turn @ covariance @ turn.T, draws, rng)
    return np.asarray(stiffness * np.exp(parts.view(complex)[:, 0]))


def draw_route(
    phasors: Phasors,
    rig: Rig | None,
    route: str,
    channels: ChannelUncertainty,
    draws: int,
    rng: np.random.Generator,
    *,
    added_mass: float = 0.0,
    added_mass_std: float = 0.0,
    unstated: Unstated = NOTHING,
) -> ComplexArray:
    """Draws of K* of one test by a route, with all inputs drawn from normal distributions.

    Parameters
    ----------
    phasors : Phasors
        Phasors of one test.
    rig, route, channels : Rig or None, str, ChannelUncertainty
        The same as for `identify`.
    draws : int
        Number of draws.
    rng : numpy.random.Generator
    added_mass, added_mass_std : float [kg]
        Mass fixed to the moving mass, and its standard uncertainty.
    unstated : Unstated
        Standard uncertainties of the parts that nobody stated.

    Returns
    -------
    (draws,) complex array [N/m]
        K*.

    References
    ----------
    JCGM 101:2008, 6.4.7, 6.4.8, 7.3 and 7.4.
    """
    omega = float(phasors.omega)
    noise = _normal(np.nan_to_num(phasors.covariance), draws, rng)
    off = np.zeros((draws, 3), dtype=complex)
    for error in channels.errors(np.array([omega])):
        off[:, error.channel] += rng.standard_normal(draws) * error.std * error.turn[0]
    gains = np.exp(off)
    f1, v1, v2 = ((phasors.amplitudes + noise[:, ::2] + 1j * noise[:, 1::2]) * gains).T
    impedance: complex | ComplexArray = np.inf
    if rig is not None:
        spread = np.append(rig.uncertainties, added_mass_std) * rng.standard_normal((draws, rig.uncertainties.size + 1))
        f1 = f1 - 1j * omega * (rig.input_mass + spread[:, -2]) * v1
        if not rig.blocked:
            impedance = rig.impedance(omega, added_mass) + spread @ rig.impedance_gradient(omega, added_mass)
        if (std := unstated.std(rig, np.array([omega]))).any() or np.any(unstated.masses):
            masses = _normal(np.broadcast_to(unstated.masses, (2, 2)), draws, rng)
            moved = np.column_stack([std * rng.standard_normal((draws, std.size)), masses[:, 1]])
            far = v2 if np.isfinite(phasors.motion_out) else f1 / impedance
            impedance = impedance + np.einsum("ni,ni->n", moved, moved_by(np.full(draws, omega), far))
            f1 = f1 - 1j * omega * masses[:, 0] * v1
    with np.errstate(divide="ignore", invalid="ignore"):
        return stiffness_by(route, (f1, v1, v2), impedance, omega)


def _normal(covariance: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    """Draws (draws, k) of a normal distribution with mean 0 and a covariance (k, k)."""
    values, vectors = np.linalg.eigh(covariance)
    return (rng.standard_normal((draws, values.size)) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def arm_intervals(stiffness: ComplexArray, k1: FloatArray, omega: float) -> tuple[Interval, Interval]:
    """Quantiles of K2 and of C over draws of K* and K1.

    The quantiles are those of 1/K2 and 1/C, which are continuous at the pole. If a quantile of 1/K2 or 1/C is zero or
    negative, K2 or C has no upper limit.

    Parameters
    ----------
    stiffness, k1 : (draws,) complex and float arrays [N/m]
        Draws of K* and of K1.
    omega : float [rad/s]

    Notes
    -----
    Deviation from the source: the number of draws is fixed, without the adaptive procedure of JCGM 101, 7.9.

    References
    ----------
    JCGM 101:2008, 7.5 to 7.7; the interval is probabilistically symmetric.

    Examples
    --------
    >>> k2, c = arm_intervals(np.full(100, 194211.265309173 + 38773.596369347j), np.full(100, 180e3), 20 * np.pi)
    >>> k2.quantiles.round(1).tolist(), c.quantiles.round(3).tolist()
    ([120000.0, 120000.0, 120000.0], [700.0, 700.0, 700.0])
    """
    compliance = 1.0 / (stiffness - k1)
    return _interval(compliance.real), _interval(-omega * compliance.imag)


def _interval(inverse: FloatArray) -> Interval:
    """Quantiles of a quantity from draws of its inverse."""
    order = np.sort(inverse[np.isfinite(inverse)])
    low = np.interp((1 - np.array(LEVELS)) * (order.size - 1), np.arange(order.size), order)
    with np.errstate(divide="ignore"):
        return Interval(np.where(low > 0, 1.0 / low, np.inf), float(np.mean(~(inverse > 0))))
