"""K* and deflection of each test by itself, its K' against K1, and its F1 against what V2 and the rig need.

K1 may be that of another unit or specimen, V1 of another unit or sign, and K1 of two specimens exchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, exp, log, pi

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByRows, ComplexArray, FloatArray, parts, real_matrix
from fourpole.core.channelerrors import ChannelError
from fourpole.core.checks import Check, Code, Looks, Verdict, judged, reported
from fourpole.core.confidence import CHANCE
from fourpole.core.identify import FRICTION_AT, MASSES, Answers, propagate
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import relative_route, stiffness_by


@dataclass(frozen=True, eq=False)
class Alone(ByRows):
    """K* and deflection of N tests, each without the others; not-a-number where they are not known.

    Attributes
    ----------
    stiffness : (N,) complex array [N/m]
        K*: from F1, V1 and V2, or from two of them and the rig where one is not known.
    noise : (N,) float array [1]
        Standard uncertainty of ln K* from the noise.
    deflection : (N,) float array [m]
        Amplitude of the specimen's deflection.
    frequency : (N,) float array [Hz]
        Frequency of the test.
    lever : (N,) complex array [1]
        1/(1 - V2/V1), by which an error of the ratio of the gains of V1 and V2 acts on ln K*; 0 without V2.
    """

    stiffness: ComplexArray
    noise: FloatArray
    deflection: FloatArray
    frequency: FloatArray
    lever: ComplexArray

    @classmethod
    def of(cls, phasors: Phasors, rigs: Sequence[Rig | None], added: FloatArray) -> Alone:
        """K* of N tests on their rigs, with their added masses [kg]."""
        which = np.array([id(rig) for rig in rigs])
        columns = [np.zeros(which.size, kind) for kind in (complex, float, float, float, complex)]
        for one in dict.fromkeys(which.tolist()):
            rows = np.flatnonzero(which == one)
            found = _alone(phasors.part(rows), rigs[rows[0]], added[rows])
            for column, of_rig in zip(columns, found, strict=True):
                column[rows] = of_rig
        return cls(*columns)


def _alone(phasors: Phasors, rig: Rig | None, added: FloatArray) -> tuple[np.ndarray, ...]:
    """The columns of the tests on one rig."""
    omega = phasors.omega
    f1, v1, v2 = phasors.amplitudes.T
    blocked = rig is not None and rig.blocked
    lost = ~np.isfinite(v2) | blocked
    with np.errstate(all="ignore"):
        force = f1 - (0.0 if rig is None else 1j * omega * rig.input_mass * v1)
        impedance = np.inf if rig is None or blocked else rig.impedance(omega, added)
        no_force = ~lost & ~np.isfinite(f1) & (rig is not None)
        ways = [stiffness_by(one, (force, v1, v2), impedance, omega) for one in ("mobility", "transmissibility")]
        stiffness = np.select([lost, no_force], ways, stiffness_by("relative", (force, v1, v2), impedance, omega))
        lever, none = np.where(lost, 0.0, v1 / (v1 - v2)), np.zeros_like(v1)
        by_force, by_motion = (1 / f1, -1 / v1, none), (1 / f1, -1 / (v1 - v2), 1 / (v1 - v2))
        slopes = np.select([lost, no_force], [by_force, (none, -lever / v1, lever / v2)], by_motion).T
        moved = deflection_amplitude(force, v1, v2, omega, stiffness=stiffness, blocked=blocked)
        # The larger standard uncertainty of both parts of ln K*, by its slopes.
        turn = real_matrix(slopes[:, None])
        covariance = np.where(np.isfinite(phasors.covariance), phasors.covariance, 0.0)
        noise = np.sqrt(np.einsum("nki,nij,nkj->nk", turn, covariance, turn).max(axis=1))
    return stiffness, noise, moved, phasors.frequency, lever


def deflection_std(
    amplitudes: ComplexArray, covariance: FloatArray, errors: Sequence[ChannelError], *, blocked: bool = False
) -> FloatArray:
    r"""Relative standard uncertainty (N,) of the amplitude of the deflection [1], by noise and errors of the channels.

    Parameters
    ----------
    amplitudes, covariance : (N, 3) complex [N], [m/s], (N, 6, 6) float
        F1, V1, V2 and the covariance of their noise. Where V2 is not-a-number, the deflection is F1/K*, and the part
        of F1 is returned.
    errors : sequence of ChannelError
        The errors of the channels.
    blocked : bool
        Whether the far side does not move.

    Examples
    --------
    >>> from fourpole.core.channelerrors import ChannelUncertainty
    >>> errors = ChannelUncertainty(gain=np.array([0.0, 0.01, 0.01])).errors(np.array([63.0]))
    >>> deflection_std(np.array([[100.0, 0.3, 0.1 + 0j]]), np.zeros((1, 6, 6)), errors).round(4)
    array([0.0158])
    """
    f1, v1, v2 = amplitudes.T
    alone = np.isnan(v2) & (not blocked)
    moved = v1 if blocked else v1 - v2
    with np.errstate(divide="ignore", invalid="ignore"):
        part, force = moved / np.abs(moved) ** 2, f1 / np.abs(f1) ** 2
    far = np.where(alone | blocked, 0.0, -part)
    slopes = np.stack([np.where(alone, force, 0.0), np.where(alone, 0.0, part), far], axis=1)
    real = parts(slopes).reshape(-1, 6)
    variance = np.einsum("ni,nij,nj->n", real, np.where(np.isfinite(covariance), covariance, 0.0), real)
    for error in errors:
        along = amplitudes[:, error.channel] * error.turn * error.std
        variance = variance + np.nan_to_num((np.conj(slopes[:, error.channel]) * along).real) ** 2
    return np.sqrt(variance)


def deflection_amplitude(
    force: ArrayLike,
    contact: ArrayLike,
    far: ArrayLike,
    omega: ArrayLike,
    *,
    stiffness: ArrayLike = np.nan,
    blocked: bool = False,
) -> FloatArray:
    r"""Amplitude of the deflection, 0-to-peak.

    .. math:: x = |V_1 - V_2|/\omega , \quad\text{or, where V2 is not known,}\quad x = |F/K^*|

    Parameters
    ----------
    force, contact, far : (...,) complex arrays [N], [m/s]
        Force on the specimen, and the velocities of both sides; V2 is not-a-number where it is not known.
    omega : (...,) float array [rad/s]
        > 0.
    stiffness : (...,) complex array, optional [N/m]
        K*.
    blocked : bool
        Whether the far side does not move.

    Returns
    -------
    (...,) float array [m]
        Not-a-number where neither V2 nor K* is known.

    Examples
    --------
    >>> deflection_amplitude(100.0, 0.3, 0.1, 200.0), deflection_amplitude(100.0, 0.3, np.nan, 200.0, stiffness=2e5)
    (array(0.001), array(0.0005))
    """
    w, v1 = np.asarray(omega, dtype=float), np.asarray(contact, dtype=complex)
    if blocked:
        return np.asarray(np.abs(v1) / w)
    moved = np.abs(v1 - np.asarray(far, dtype=complex)) / w
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(np.isfinite(moved), moved, np.abs(np.asarray(force) / np.asarray(stiffness))))


#: Frequency of a slow static test [Hz]. Above it K' rises with frequency as fast as its loss factor allows.
_STATIC = 1e-3
#: Largest plausible K' over K1, in units of that rise, and smallest plausible K' over K1: errors of 50 and 20 % pass.
_ABOVE, _BELOW = 1.5, 0.8
#: Least relative difference of (K' - K1)/K'' that may come from exchanged K1, and the largest one after it: of
#: two specimens, and of two states of one specimen.
_SPECIMENS, _STATES = (0.5, 0.15), (0.3, 0.15)
#: Mistakes in V1 by the factor that corrects them.
_MISTAKES = {
    -1.0: Looks.V1_INVERTED,
    9.80665: Looks.V1_IN_G,
    1 / 9.80665: Looks.V1_TIMES_G,
    1000.0: Looks.V1_IN_M,
    1e-3: Looks.V1_IN_MM,
}


def check_scale(phasors: Phasors, stiffness: complex, k1: float, *, motion: bool = True) -> Check | None:
    """Compare K' of a test by itself with K1; None if either is unknown.

    Parameters
    ----------
    phasors : Phasors
        Amplitudes of the test.
    stiffness : complex [N/m]
        K* of the test by itself.
    k1 : float [N/m]
        Its static stiffness.
    motion : bool
        Whether a mistake in V1 is looked for.

    Returns
    -------
    Check or None
        A warning of V1's scale, of a K1 that is too large or of one that is too small; else ok.
    """
    if not (np.isfinite(stiffness) and np.isfinite(k1) and k1 > 0):
        return None
    frequency, ratio = float(phasors.frequency), stiffness.real / k1
    if is_plausible(stiffness, k1, frequency):
        return Check(Code.K1_RATIO, Verdict.OK, ratio, largest_ratio(stiffness, frequency))
    f1, v1, v2 = (complex(amplitude) for amplitude in phasors.amplitudes)
    if motion and np.isfinite(v2):
        factors = [
            factor
            for factor in _MISTAKES
            if is_plausible(complex(relative_route(f1, factor * v1, v2, float(phasors.omega))), k1, frequency)
        ]
        if len(factors) == 1:
            return reported(Code.V1_SCALE, Verdict.WARNING, ratio, looks=_MISTAKES[factors[0]])
    if 0 < ratio < _BELOW:
        return reported(Code.K1_LARGE, Verdict.WARNING, ratio, _BELOW, times=1 / ratio)
    loss = stiffness.imag / stiffness.real if stiffness.real else 0.0
    return judged(Code.K1_RATIO, ratio, largest_ratio(stiffness, frequency), loss=loss)


def largest_ratio(stiffness: complex, frequency: float) -> float:
    r"""Largest plausible K' over K1 [1] for K* [N/m] at a frequency [Hz].

    A power law that has the phase :math:`\delta` of K* rises by :math:`(f/f_s)^{2\delta/\pi}` from the static
    frequency :math:`f_s` on.

    Examples
    --------
    >>> round(largest_ratio(1e5 + 0j, 10.0), 2), round(largest_ratio(1e5 + 3e4j, 10.0), 2)
    (1.5, 8.28)
    """
    if stiffness.real <= 0:
        return _ABOVE
    phase = atan(max(stiffness.imag, 0.0) / stiffness.real)
    return _ABOVE * exp(2 * phase / pi * max(log(frequency / _STATIC), 0.0))


def is_plausible(stiffness: complex, k1: float, frequency: float) -> bool:
    """Whether a passive specimen of static stiffness K1 [N/m] may have this K* [N/m] at a frequency [Hz]."""
    return _BELOW <= stiffness.real / k1 <= largest_ratio(stiffness, frequency) and stiffness.imag > 0


def k1_exchanged(stiffness: ComplexArray, k1: FloatArray, *, same: bool = False) -> tuple[float, float, float] | None:
    r"""Compare two specimens of like kind, or two states of one, with their K1 and with each other's K1.

    A constant loss angle gives :math:`(K'-K_1)/K'' = (2/\pi)\ln(f/f_s)`, whatever its size, where f_s is the frequency
    of the static test. This ratio is therefore alike for specimens of equal conditions and equal static tests.

    Parameters
    ----------
    stiffness : (P, 2) complex array [N/m]
        K* of both specimens at P equal conditions and frequencies.
    k1 : (P, 2) float array [N/m]
        K1 of both.
    same : bool
        Whether both are one specimen, at two pressures.

    Returns
    -------
    (first, second, usual) or None [1]
        Medians of (K' - K1)/K'' of both, and their mean after the exchange; None if the exchange of K1 does not make
        unlike ratios alike.

    Examples
    --------
    >>> pair = np.array([[1.8e5 + 3e4j, 2.5e5 + 5e4j]])
    >>> k1_exchanged(pair, np.array([[1.3e5, 1.7e5]])) is None
    True
    >>> [round(one, 2) for one in k1_exchanged(pair, np.array([[1.7e5, 1.3e5]]))]
    [0.33, 2.4, 1.63]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = np.median((stiffness.real - k1) / stiffness.imag, axis=0).tolist()
        swapped = np.median((stiffness.real - k1[:, ::-1]) / stiffness.imag, axis=0)
    usual = float(swapped.mean())
    unlike, alike = _STATES if same else _SPECIMENS
    if usual > 0 and np.ptp(swapped) < alike * usual and abs(first - second) > unlike * usual:
        return first, second, usual
    return None


#: Departure of F1 from what V2 and the rig need that is no contradiction, whatever is exact [1].
_LEAST = 1e-4
#: Standard deviations to each side, and number, of the places along the short axis of a distribution of two masses.
_FARTHEST, _STEPS = 6.0, 241


def shown_masses(answers: Answers, specimen: Sequence[str], bound: float, gross: BoolArray) -> FloatArray:
    r"""Second moments (N, 2, 2) of the masses of each test's specimen that F1 against V2 shows and leaves open [kg²].

    The masses m move with the contact and with the far side of a specimen, and all of its tests share them. With their
    derivatives A of the whitened departures w,

    .. math:: m = I^{-1} \sum A^T w, \quad C = I^{-1} (B B^T + I) I^{-1}, \quad I = \sum A^T A + 1/b^2,
        \quad B = \sum A^T.

    The result is that of the normal distribution about m with the covariance C, of masses that are not negative.
    Errors of the channels count as common to all tests, by B, and as independent. `bound` b [kg] is what a mass may be
    before the tests. The result is 0 where no test has F1 and V2. In `gross` tests (N,) a sign or a unit of a channel
    is wrong, and no mass looks like these.
    """
    off, covariance, by_masses = _imbalance(answers)
    known, names = np.isfinite(off).all(axis=1) & ~gross, np.asarray(specimen, dtype=str)
    turn = _whitening(covariance)
    drawn, slopes = np.einsum("nij,nj->ni", turn, np.where(known[:, None], off, 0.0)), turn @ by_masses
    moments = np.zeros((names.size, 2, 2))
    for name in np.unique(names[known]):
        own = np.flatnonzero(np.equal(names, name) & known)
        found = np.linalg.inv(np.einsum("nij,nik->jk", slopes[own], slopes[own]) + bound**-2 * np.eye(2))
        mass, common = found @ np.einsum("nij,ni->j", slopes[own], drawn[own]), found @ slopes[own].sum(axis=0).T
        moments[np.equal(names, name)] = _moments(mass, common @ common.T + found)
    return moments


def _moments(mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Second moments (2, 2) of two masses that are not negative, of a normal distribution about `mean` (2,).

    Along the long axis of the distribution they have a closed form, and along the short one they are summed. Those of
    the whole distribution where nearly all of it is negative.
    """
    variance, axes = np.linalg.eigh(covariance)
    short, long = (axes * np.sqrt(np.maximum(variance, 0.0))).T
    steps = np.linspace(-_FARTHEST, _FARTHEST, _STEPS)
    at = mean[:, None] + short[:, None] * steps
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = -at / long[:, None]
        low = np.max(np.where(long[:, None] > 0, ends, -np.inf), axis=0)
        high = np.maximum(np.min(np.where(long[:, None] < 0, ends, np.inf), axis=0), low)
        sides = np.stack([low, high])
        density = np.exp(-0.5 * (sides**2 + steps**2)) / np.sqrt(2 * np.pi)
        held = np.nan_to_num(sides * density)
    inside = np.exp(-0.5 * steps**2) * np.diff(scipy.special.ndtr(sides), axis=0)[0]
    if inside.sum() < CHANCE:
        return np.outer(mean, mean) + covariance
    across = np.outer(at @ (density[0] - density[1]), long)
    square = (at * inside) @ at.T + across + across.T + (inside + held[0] - held[1]).sum() * np.outer(long, long)
    return np.asarray(square / inside.sum())


def shown_friction(answers: Answers, bound: float) -> float:
    """Dry friction [N] that F1 against V2 shows and leaves open, in the test that shows it best, at most `bound`.

    All tests of a rig have the same guide.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio, by = answers.balance()
        of_friction, others = by[:, :, FRICTION_AT], answers.covariance.copy()
        others[:, FRICTION_AT, FRICTION_AT] = 0.0
        spread = propagate(by, others) + _LEAST**2 * np.eye(2)
        square = np.sum(of_friction**2, axis=1)
        found = np.sum(of_friction * parts(ratio - 1.0), axis=1) / square
        moment = found**2 + np.einsum("ni,nij,nj->n", of_friction, spread, of_friction) / square**2
    return float(np.sqrt(min(bound**2, np.min(moment, where=np.isfinite(moment), initial=np.inf))))


def largest_imbalance(answers: Answers, masses: FloatArray) -> FloatArray:
    r"""Largest departure (N,) [1] of F1 from the force that V2 and the rig need which the uncertainties explain.

    It is that in the direction of the departure r, by the covariance S of its parts. Where a channel lacks it is
    not-a-number.

    .. math:: |r| \sqrt{-2 \ln p/(r^T S^{-1} r)}

    `masses` (N, 2, 2) [kg²] are the second moments of those that the specimens may have.
    """
    off, covariance, by_masses = _imbalance(answers)
    off[(off == 0).all(axis=1)] = 1.0
    turn = _whitening(covariance + by_masses @ masses @ np.swapaxes(by_masses, 1, 2))
    size = np.linalg.norm(np.einsum("nij,nj->ni", turn, off), axis=1)
    return np.linalg.norm(off, axis=1) * np.sqrt(-2 * log(CHANCE)) / size


def _imbalance(answers: Answers) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Re and Im (N, 2) of the departure of F1, their covariance (N, 2, 2), and derivatives (N, 2, 2) by the masses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio, by = answers.balance()
        covariance = propagate(by, answers.covariance)
    known = np.isfinite(ratio) & np.isfinite(covariance).all(axis=(1, 2))
    covariance = np.where(known[:, None, None], covariance, 0.0)
    off = np.where(known[:, None], parts(ratio - 1.0), np.nan)
    return off, covariance, np.where(known[:, None, None], by[:, :, MASSES], 0.0)


def _whitening(covariance: FloatArray) -> FloatArray:
    """Inverse square roots (N, 2, 2) of covariances (N, 2, 2) of two parts, with the least variance of each."""
    squares, vectors = np.linalg.eigh(covariance)
    scaled = vectors / np.sqrt(np.maximum(squares, 0.0) + _LEAST**2)[:, None]
    return np.asarray(scaled @ np.swapaxes(vectors, 1, 2))
