r"""All four poles of a specimen at each frequency, from rigid blocks and two loads, without a model of specimen or rig.

Between the forces on both ends of a specimen and their motions :math:`x = V/(j\omega)` is

.. math:: \begin{bmatrix} F_1 \\ -F_2 \end{bmatrix} =
          \begin{bmatrix} k_{11} & k_{12} \\ k_{21} & k_{22} \end{bmatrix} \begin{bmatrix} x_1 \\ x_2 \end{bmatrix}.

A rigid block of mass M in place of the specimen moves as a whole, so that its recorded channels are

.. math:: \frac{F_1}{V_2} = \frac{\rho}{j\omega}\,(R - \omega^2 m_i - \omega^2 M), \qquad \frac{V_1}{V_2} = \tau.

Two blocks give the ratios of the channels, :math:`\rho` and :math:`\tau`, and the dynamic stiffness R of the rig beyond
the specimen; :math:`m_i` is the stated input mass. With the specimen's chain from its contact to its wheel,

.. math:: \begin{bmatrix} F_1 \\ x_1 \end{bmatrix} =
          \begin{bmatrix} a_{11} & a_{12} \\ a_{21} & a_{22} \end{bmatrix}
          \begin{bmatrix} F_2 \\ x_2 \end{bmatrix},\qquad
          \begin{bmatrix} k_{11} & k_{12} \\ k_{21} & k_{22} \end{bmatrix} = \frac{1}{a_{21}}
          \begin{bmatrix} a_{11} & a_{12} a_{21} - a_{11} a_{22} \\ -1 & a_{22} \end{bmatrix},

an added mass A on the rig makes :math:`F_2 = (R - \omega^2 A)\,x_2 = L\,x_2`, and then

.. math:: T = \frac{x_2}{x_1} = \frac{1}{a_{21} L + a_{22}}, \qquad
          \frac{F_1}{V_1} = \frac{\rho}{\tau}\,\frac{(a_{11} L + a_{12})\,T - \omega^2 m_i}{j\omega},\qquad
          \frac{V_2}{V_1} = \frac{T}{\tau},

so two added masses give all four. The seven unknowns of each frequency are found together by weighted least squares of
all ratios; further blocks, loads and repeats are weighed by their uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByRows, ByValue, ComplexArray, FloatArray, parts, real_matrix
from fourpole.core.channelerrors import ChannelError
from fourpole.core.phasor import Phasors
from fourpole.errors import RigError

#: Symbols of the four poles, in the order of every covariance.
POLES = ("k11", "k12", "k21", "k22")
#: Relative round-off of a ratio: the least standard uncertainty that weights have.
_ROUND_OFF = 1e-9
#: Rounds of the search, and of the change of the unknowns between neighbouring frequencies.
_ROUNDS, _PASSES = 20, 3
#: Step of a derivative, over the size of the unknown: the error of the derivative is below 1e-9 of it.
_STEP = 1e-5
#: Change of an unknown, over its size, at which the search has ended.
_SETTLED = 1e-10


@dataclass(frozen=True, eq=False)
class Setups(ByRows):
    """What stood on the rig in each of N tests of one specimen at one condition, and of the rigid blocks.

    Attributes
    ----------
    rigid : (N,) bool array
        True for a rigid block in place of the specimen.
    mass : (N,) float array [kg]
        Mass of the block, or mass that was fixed to the moving mass.
    mass_std : (N,) float array [kg]
        Its standard uncertainty. Tests with equal masses have one error.
    group : (N,) int array
        Number of the frequency of each test, from 0.
    """

    rigid: BoolArray
    mass: FloatArray
    mass_std: FloatArray
    group: np.ndarray

    def lacking(self) -> str:
        """What a group of tests lacks for four poles, and what to add; empty if it lacks nothing."""
        blocks, loads = (np.unique(self.mass[which]).size for which in (self.rigid, ~self.rigid))
        lacks = []
        if blocks < 2:
            lacks.append(
                f"{blocks} of 2 rigid blocks: add tests of kind = calibration with a rigid block in place of the "
                "specimen, of two different weighed masses in the column added_mass [kg]"
            )
        if loads < 2:
            lacks.append(
                f"{loads} of 2 loads: add tests of the specimen with another weighed mass fixed to the moving mass, in "
                "the column added_mass [kg]"
            )
        return "; ".join(lacks)


@dataclass(frozen=True, eq=False)
class AllPoles(ByValue):
    """The four poles of a specimen at F frequencies.

    Attributes
    ----------
    frequency : (F,) float array [Hz]
        Mean frequency of the tests.
    stiffness : (F, 2, 2) complex array [N/m]
        k11, k12, k21 and k22: forces on the ends over motions of the ends, contact first.
    noise : (F, 8, 8) float array [N²/m²]
        Covariance of Re and Im of k11, k12, k21, k22 by the noise of the phasors, which no two frequencies share.
    shared : (F, 8, p) float array [N/m]
        Their change per standard uncertainty of each of p errors that all frequencies share: the weighed masses, the
        input mass, the mountings of the sensors, the specimen's change between loads, the mass at its wheel.
    rig : (F,) complex array [N/m]
        Dynamic stiffness of the rig beyond the specimen without an added mass.
    ratios : (F, 2) complex array [1]
        Recorded over true ratio of F1 to V2 and of V1 to V2: the calibration of the channels against each other.
    misfit : (F,) float array [1]
        Chi-square of the ratios that are more than the unknowns.
    dof : (F,) int array [1]
        Its degrees of freedom.
    """

    frequency: FloatArray
    stiffness: ComplexArray
    noise: FloatArray
    shared: FloatArray
    rig: ComplexArray
    ratios: ComplexArray
    misfit: FloatArray
    dof: np.ndarray

    @property
    def omega(self) -> FloatArray:
        """Angular frequency (F,) [rad/s]."""
        return 2 * np.pi * self.frequency

    @property
    def covariance(self) -> FloatArray:
        """Covariance (F, 8, 8) of Re and Im of k11, k12, k21, k22 [N²/m²], of noise and shared errors."""
        return self.noise + self.shared @ np.swapaxes(self.shared, 1, 2)

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties (F, 4, 2) of Re and Im of k11, k12, k21 and k22 [N/m]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).reshape(-1, 4, 2)

    @property
    def agreement(self) -> float:
        """Chance that no frequency has a misfit as large as the largest, if tests differ by their uncertainty alone."""
        return float(min(1.0, self.misfit.size * np.min(stats.chi2.sf(self.misfit, self.dof))))

    @property
    def determinant(self) -> ComplexArray:
        """Determinant (F,) of the four-pole [1], k12/k21; 1 for a reciprocal specimen."""
        return np.asarray(self.stiffness[:, 0, 1] / self.stiffness[:, 1, 0])

    @property
    def determinant_std(self) -> FloatArray:
        """Standard uncertainties (F, 2) of Re and Im of `determinant` [1]."""
        by = np.zeros((self.frequency.size, 1, 4), dtype=complex)
        by[:, 0, 1] = 1 / self.stiffness[:, 1, 0]
        by[:, 0, 2] = -self.determinant / self.stiffness[:, 1, 0]
        turn = real_matrix(by)
        return np.sqrt(np.diagonal(turn @ self.covariance @ np.swapaxes(turn, 1, 2), axis1=1, axis2=2))


def reciprocal(measured: AllPoles) -> tuple[AllPoles, float]:
    """The four poles with k12 = k21, and the chance that such poles would differ as much as the measured ones.

    The shared errors are found with the poles: a sensor that was mounted anew, for one, makes k12 and k21 differ.

    Examples
    --------
    Two estimates of one spring, k21 ten times as certain as k12:

    >>> noise = np.diag(np.repeat([10.0, 100.0, 10.0, 10.0], 2) ** 2)[None]
    >>> poles, none = np.array([[[1e5, -1e5 - 99], [-1e5, 1e5]]]) + 0j, np.zeros(1)
    >>> equal, chance = reciprocal(AllPoles(none, poles, noise, np.zeros((1, 8, 0)), none, none, none, none))
    >>> equal.stiffness[0, 0, 1].real.round(1), equal.std[0, 1, 0].round(2), round(chance, 2)
    (np.float64(-100001.0), np.float64(9.95), 0.62)
    """
    turn, noise, shared = real_matrix(np.array([[0, 1.0, -1.0, 0]])), measured.noise, measured.shared
    values = parts(measured.stiffness.reshape(-1, 4)).reshape(-1, 8)
    between = turn @ noise @ turn.T
    whiten = np.linalg.inv(np.linalg.cholesky(between))
    count = shared.shape[2]
    # The last rows are the standard normal distribution of the shared errors.
    lines = np.concatenate([(whiten @ turn @ shared).reshape(2 * len(values), count), np.eye(count)])
    seen = np.append(np.einsum("fij,fj->fi", whiten @ turn, values), np.zeros(count))
    errors = np.linalg.lstsq(lines, seen, rcond=None)[0]
    left = seen - lines @ errors
    keep = np.eye(8) - noise @ turn.T @ np.linalg.solve(between, np.broadcast_to(turn, (len(values), 2, 8)))
    poles = np.einsum("fij,fj->fi", keep, values - shared @ errors)
    root = np.linalg.inv(np.linalg.qr(lines, mode="r")) if count else np.zeros((0, 0))
    equal = replace(
        measured,
        stiffness=(poles[:, ::2] + 1j * poles[:, 1::2]).reshape(-1, 2, 2),
        noise=keep @ noise @ np.swapaxes(keep, 1, 2),
        shared=keep @ shared @ root,
    )
    return equal, float(stats.chi2.sf(left @ left, 2 * len(values)))


def all_poles(
    phasors: Phasors,
    setups: Setups,
    *,
    input_mass: tuple[float, float] = (0.0, 0.0),
    wheel_mass: tuple[float, float] = (0.0, 0.0),
    change: complex = 0j,
    errors: tuple[ChannelError, ...] = (),
) -> AllPoles:
    r"""The four poles of a specimen from rigid blocks and two or more added masses.

    Parameters
    ----------
    phasors : Phasors
        N tests with F1, V1 and V2, of one specimen at one condition and of the blocks, on one rig. No channel needs a
        calibration, but each must be the same in all tests.
    setups : Setups
    input_mass : (float, float) [kg]
        Mass between force cell and contact, in tests with a block too, and its standard uncertainty. An error of it is
        an error of the same size of the masses at both ends, of opposite sign.
    wheel_mass : (float, float) [kg]
        Mass that is mounted together with the specimen at its wheel side, as `Rig.tyre_mass`, and its standard
        uncertainty. It is taken off k22: :math:`k_{22} + \omega^2 m`.
    change : complex [1] + j [rad]
        Standard uncertainty of modulus and angle of the specimen's stiffness with each further added mass, against the
        tests with the smallest one.
    errors : tuple of ChannelError
        Errors of the channels that are not the same in all tests, as of a sensor that is mounted anew.

    Returns
    -------
    AllPoles
        One row per frequency, rising.

    Raises
    ------
    RigError
        If a frequency has fewer than two blocks or two loads.

    Notes
    -----
    The frequencies of the tests in a group may differ by 1 %. The channels' ratios, R and the specimen's chain change
    linearly between them, with the slope through the neighbouring groups. None of these has a pole where the rig or the
    specimen resonates, as mobilities and k11, k12, k22 have. With one frequency alone, nothing is known of the slopes.

    References
    ----------
    ISO 10846-1 (k1,1, k1,2, k2,1, k2,2 of resilient elements). JCGM 102:2011, 6.2.

    Examples
    --------
    A spring of 200 kN/m with a loss factor of 0.1, at 20 Hz, on a mass of 15 kg that floats; F1's gain is 5 % high:

    >>> w = 2 * np.pi * 20.0
    >>> k, rows = 2e5 * (1 + 0.1j), []
    >>> for mass in (5.0, 12.0):  # two blocks
    ...     rows.append([1.05 * 1j * w * (15.0 + mass), 1.0, 1.0])
    >>> for mass in (0.0, 10.0):  # two loads
    ...     t = k / (k - w**2 * (15.0 + mass))
    ...     rows.append([1.05 * k * (1 - t) / (1j * w), 1.0, t])
    >>> zero = np.zeros(4)
    >>> phasors = Phasors(zero + 20.0, np.array(rows), np.zeros((4, 6, 6)), zero, zero + np.inf)
    >>> setups = Setups(np.arange(4) < 2, np.array([5.0, 12.0, 0.0, 10.0]), zero, zero.astype(int))
    >>> all_poles(phasors, setups).stiffness[0].round(3).tolist()
    [[(200000+20000j), (-200000-20000j)], [(-200000-20000j), (200000+20000j)]]
    """
    groups = [np.flatnonzero(setups.group == number) for number in np.unique(setups.group)]
    groups.sort(key=lambda rows: float(np.mean(phasors.frequency[rows])))
    for rows in groups:
        if lack := setups.part(rows).lacking():
            raise RigError(f"{np.mean(phasors.frequency[rows]):.4g} Hz has {lack}")
    shared = _Shared(setups, input_mass[1], change, errors)
    tests = [_Tests(phasors.part(rows), setups.part(rows), rows, input_mass[0], shared) for rows in groups]
    mean = np.array([test.mean for test in tests])
    unknowns = np.array([test.first() for test in tests])
    slopes, apart = np.zeros_like(unknowns), len(tests) > 1 and any(np.ptp(test.omega) > 0 for test in tests)
    for _ in range(_PASSES if apart else 1):
        if apart:
            slopes = np.asarray(np.gradient(unknowns, mean, axis=0, edge_order=2 if len(tests) > 2 else 1))
        fits = [test.fitted(*start) for test, *start in zip(tests, unknowns, slopes, strict=True)]
        unknowns = np.array([fit.unknowns for fit in fits])
    square, chains = mean**2, unknowns[:, 3:]
    poles = np.array([_poles(chain) for chain in chains])
    poles[:, 3] += square * wheel_mass[0]
    turn = real_matrix(np.array([_slope(_poles, chain) for chain in chains]))
    at_wheel = np.zeros((mean.size, 8, 1))
    at_wheel[:, 6, 0] = square * wheel_mass[1]
    return AllPoles(
        frequency=mean / (2 * np.pi),
        stiffness=poles.reshape(-1, 2, 2),
        noise=turn @ np.array([fit.noise for fit in fits])[:, 6:, 6:] @ np.swapaxes(turn, 1, 2),
        shared=np.concatenate([turn @ np.array([fit.shared for fit in fits])[:, 6:], at_wheel], axis=2),
        rig=unknowns[:, 2],
        ratios=unknowns[:, :2],
        misfit=np.array([fit.misfit for fit in fits]),
        dof=np.array([4 * rows.size - 14 for rows in groups]),
    )


def _poles(chain: ComplexArray) -> ComplexArray:
    """k11, k12, k21, k22 of a11, a12, a21, a22."""
    a11, a12, a21, a22 = chain
    return np.array([a11 / a21, a12 - a11 * a22 / a21, -1 / a21, a22 / a21])


def _slope(function: Callable[[ComplexArray], ComplexArray], at: ComplexArray) -> ComplexArray:
    """Derivatives of an analytic function by its arguments (k,), along a new last axis, by central differences."""
    steps = np.diag(_STEP * np.abs(at))
    return np.stack([(function(at + step) - function(at - step)) / (2 * step.sum()) for step in steps], axis=-1)


class _Shared:
    """The errors that all tests share: the masses by their value, and the loads with which a specimen may change."""

    def __init__(self, setups: Setups, input_std: float, change: complex, errors: tuple[ChannelError, ...]) -> None:
        self.masses, self.errors = np.unique(setups.mass[setups.mass > 0]), errors
        self.loads = np.unique(setups.mass[~setups.rigid])[1:]
        of_masses = [float(np.max(setups.mass_std[setups.mass == mass])) for mass in self.masses]
        of_errors = [error.std for error in errors]
        self.stds = np.array([*of_masses, input_std, *of_errors, *[change.real, change.imag] * self.loads.size])


class _Fit(NamedTuple):
    """The unknowns of a frequency, their covariance by noise, their change by each shared error, and chi-square."""

    unknowns: ComplexArray
    noise: FloatArray
    shared: FloatArray
    misfit: float


class _Tests:
    """The tests of one frequency: two complex ratios of each, and what they must be.

    The seven unknowns are rho, tau, R, a11, a12, a21, a22: smooth over frequency also where rig or specimen resonate.
    """

    def __init__(self, phasors: Phasors, setups: Setups, rows: np.ndarray, input_mass: float, shared: _Shared) -> None:
        self.omega, self.omega_std = phasors.omega, 2 * np.pi * phasors.frequency_std
        self.mean = float(np.mean(self.omega))
        self.setups, self.input_mass, self.shared = setups, input_mass, shared
        f, v1, v2 = phasors.amplitudes.T
        rigid = setups.rigid
        below = np.where(rigid, v2, v1)
        self.ratios = np.stack([f / below, np.where(rigid, v1, v2) / below], axis=1)
        zero, one = np.zeros(f.size), np.ones(f.size)
        # Derivatives of the logarithms of both ratios by those of the three channels.
        sign = np.where(rigid, 1.0, -1.0)
        by_log = np.array([[one, np.minimum(sign, 0.0), -np.maximum(sign, 0.0)], [zero, sign, -sign]])
        by_log = np.moveaxis(by_log, 2, 0) * self.ratios[:, :, None]
        turn = real_matrix(by_log / phasors.amplitudes[:, None, :])
        self.covariance = turn @ phasors.covariance @ np.swapaxes(turn, 1, 2)
        least = _ROUND_OFF * np.repeat(np.abs(self.ratios), 2, axis=1)
        self.covariance += least[:, None] ** 2 * np.eye(4)
        by_error = [by_log[:, :, error.channel] * error.turn[rows, None] for error in shared.errors]
        self.by_error = np.array(by_error).reshape(-1, 2 * f.size).T

    def first(self) -> ComplexArray:
        """First values of the unknowns (7,), by linear least squares at the mean frequency."""
        w, rigid, mass = self.mean, self.setups.rigid, self.setups.mass
        ones = np.ones(mass.size)
        lines = np.stack([ones, -(w**2) * mass], axis=1)[rigid].astype(complex)
        whole, rho = np.linalg.lstsq(lines, 1j * w * self.ratios[rigid, 0], rcond=None)[0]
        tau, r = np.mean(self.ratios[rigid, 1]), whole / rho + w**2 * self.input_mass
        t = tau * self.ratios[~rigid, 1]
        lines = np.stack([ones[~rigid], t], axis=1)
        force = 1j * w * tau / rho * self.ratios[~rigid, 0] + w**2 * self.input_mass
        k11, k12 = np.linalg.lstsq(lines, force, rcond=None)[0]
        k21, k22 = np.linalg.lstsq(lines, -(r - w**2 * mass[~rigid]) * t, rcond=None)[0]
        return np.array([rho, tau, r, -k11 / k21, k12 - k11 * k22 / k21, -1 / k21, -k22 / k21])

    def model(self, unknowns: ComplexArray, slopes: ComplexArray, omega: FloatArray) -> ComplexArray:
        """Both ratios (N, 2) at each test's frequency."""
        rho, tau, r, a11, a12, a21, a22 = unknowns[:, None] + slopes[:, None] * (omega - self.mean)
        load, at_input = r - omega**2 * self.setups.mass, omega**2 * self.input_mass
        t = 1 / (a21 * load + a22)
        of_block, of_specimen = [load - at_input, tau], [((a11 * load + a12) * t - at_input) / tau, t / tau]
        ratios = np.where(self.setups.rigid, of_block, of_specimen)
        ratios[0] *= rho / (1j * omega)
        return np.asarray(ratios.T)

    def by_shared(self, unknowns: ComplexArray, by: ComplexArray) -> FloatArray:
        """Change (4N, p) of the ratios, recorded less expected, per standard uncertainty of each shared error."""
        square, mass, rho, tau = self.omega[:, None] ** 2, self.setups.mass[:, None], unknowns[0], unknowns[1]
        of_input = 1j * self.omega * rho * np.where(self.setups.rigid, 1.0, 1 / tau)
        by_input = np.stack([of_input, 0 * of_input], axis=1).reshape(-1, 1)
        # A stiffer specimen has a smaller a21 and a larger a12.
        stiffer = unknowns[4] * by[:, :, 4] - unknowns[5] * by[:, :, 5]
        own = np.repeat((mass == self.shared.loads) & ~self.setups.rigid[:, None], 2, axis=0)
        by_change = (stiffer.reshape(-1, 1) * own)[:, :, None] * np.array([1, 1j])
        by_mass = (square * by[:, :, 2]).reshape(-1, 1) * np.repeat(mass == self.shared.masses, 2, axis=0)
        columns = [by_mass, -by_input, self.by_error, by_change.reshape(by_mass.shape[0], -1)]
        stds = self.shared.stds
        return np.swapaxes(parts(np.concatenate(columns, axis=1)), 1, 2).reshape(-1, stds.size) * stds

    def fitted(self, unknowns: ComplexArray, slopes: ComplexArray) -> _Fit:
        """The unknowns by Gauss-Newton, from first values."""
        ahead, behind = (self.model(unknowns, slopes, self.omega + sign * self.omega_std) for sign in (1, -1))
        jitter = parts(ahead - behind).reshape(-1, 4) / 2
        noise = scipy.linalg.block_diag(*(self.covariance + jitter[:, :, None] * jitter[:, None, :]))
        shared = self.by_shared(unknowns, _slope(lambda at: self.model(at, slopes, self.omega), unknowns))
        scale = np.sqrt(np.diagonal(noise))
        root = np.linalg.cholesky((noise + shared @ shared.T) / np.outer(scale, scale))
        size = np.abs(unknowns)
        for _ in range(_ROUNDS):
            by = _slope(lambda at: self.model(at, slopes, self.omega), unknowns)
            left = np.linalg.solve(root, parts(self.ratios - self.model(unknowns, slopes, self.omega)).ravel() / scale)
            design = np.linalg.solve(root, real_matrix(by * size).reshape(left.size, 14) / scale[:, None])
            inverse = np.linalg.pinv(design)
            step = inverse @ left
            unknowns = unknowns + size * (step[::2] + 1j * step[1::2])
            if np.max(np.abs(step)) < _SETTLED:
                break
        left = left - design @ step
        gain = np.repeat(size, 2)[:, None] * inverse @ np.linalg.inv(root) / scale
        return _Fit(unknowns, gain @ noise @ gain.T, gain @ shared, float(left @ left))
