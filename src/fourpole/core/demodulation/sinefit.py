r"""Least-squares fit of a periodic signal, its harmonics, interfering lines and drift to several channels at once.

All channels share one fundamental frequency. The channels of one fit also share their times and the frequency of each
interfering line. Gauss-Newton steps on the residual, from which the linear amplitudes are eliminated (variable
projection), find the frequencies; the noise of each channel gives its weight. The number of cycles need not be whole:
sines, mean and drift are fitted together, so there is no leakage. If a reference gives the phase, the sines follow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track

_DRIFT_ORDER = 3  # mean, slope, parabola, cubic
_ITERATIONS = 12


@dataclass(frozen=True, eq=False)
class SineFit(ByValue):
    """A fit at given frequencies; T is the record's length and time is counted from its middle.

    Attributes
    ----------
    track : Track
        The channels fitted, in units of each channel.
    omega, lines : float, (L,) float [rad/s]
        Fundamental, and interfering lines.
    harmonics : int
        Number of multiples of the fundamental, with the fundamental itself.
    unsteady : tuple of int
        Harmonics whose amplitude may vary over the record as a parabola, because a line lies too close to separate.
    basis : (P, N) float
        Cosines and minus sines of each frequency, then Legendre polynomials of time; 0 for missing samples.
    factor : Cholesky factor of the basis' Gram matrix.
    coefficients : (P, channels) float
        Amplitudes of the rows of `basis`, in units of each channel.
    residual : (channels, N) float
        Signals minus fit; 0 for missing samples.
    """

    track: Track
    omega: float
    lines: FloatArray
    harmonics: int
    unsteady: tuple[int, ...]
    basis: FloatArray
    factor: tuple[FloatArray, bool]
    coefficients: FloatArray
    residual: FloatArray

    @property
    def dof(self) -> int:
        """Number of samples minus number of fitted parameters."""
        return int(self.track.present.sum()) - self.basis.shape[0]

    @property
    def resolution(self) -> float:
        """Width of a bin, 1/T [Hz]."""
        time = self.track.time
        return float((time.size - 1) / (time[-1] - time[0]) / time.size)

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.resolution * self.track.time.size

    def amplitudes(self) -> ComplexArray:
        """Complex amplitudes X (channels, harmonics) of x(t) = Re(X e^{jwt}), with t from the middle of the record."""
        pairs = self.coefficients[: 2 * self.harmonics]
        return (pairs[0::2] + 1j * pairs[1::2]).T

    def amplitude_variance(self) -> float:
        """Variance of the real part of the fundamental's amplitude per unit of sample variance [1]."""
        unit = np.zeros((self.basis.shape[0], 2))
        unit[0, 0] = unit[1, 1] = 1.0
        return float(0.5 * np.trace(linalg.cho_solve(self.factor, unit)[:2]))

    def at(self, omega: float, lines: FloatArray, unsteady: tuple[int, ...] | None = None) -> SineFit:
        """The same signals fitted at other frequencies."""
        kept = self.unsteady if unsteady is None else unsteady
        return fit_sines(self.track, omega, self.harmonics, lines, kept)


def fit_sines(track: Track, omega: float, harmonics: int, lines: FloatArray, unsteady: tuple[int, ...] = ()) -> SineFit:
    """Fit the channels of a track at given frequencies [rad/s]."""
    basis = _basis(track, omega, harmonics, lines, unsteady)
    factor = linalg.cho_factor(basis @ basis.T, lower=True)
    coefficients = linalg.cho_solve(factor, basis @ track.signals.T)
    residual = track.signals - coefficients.T @ basis
    return SineFit(track, omega, lines, harmonics, unsteady, basis, factor, coefficients, residual)


def _basis(track: Track, omega: float, harmonics: int, lines: FloatArray, unsteady: tuple[int, ...]) -> FloatArray:
    """Rows (P, N) of sines and polynomials, in the order of `SineFit.basis`."""
    time, course = track.time, track.course
    steady = 2 * (harmonics + lines.size)
    followed = 0 if course is None else len(course.follow)
    rows = np.empty((steady + 4 * len(unsteady) + 2 * followed + _DRIFT_ORDER + 1, time.size))
    rotation = np.exp(1j * (omega * time if course is None else omega * time + course.turn))
    power = np.ones_like(rotation)
    for k in range(harmonics):
        power *= rotation
        rows[2 * k], rows[2 * k + 1] = power.real, -power.imag
    for k, line in enumerate(lines, start=harmonics):
        turning = np.exp(1j * line * time)
        rows[2 * k], rows[2 * k + 1] = turning.real, -turning.imag
    place = time / max(abs(time[0]), abs(time[-1]))
    for i, harmonic in enumerate(unsteady):
        pair = rows[2 * harmonic - 2 : 2 * harmonic]
        at = steady + 4 * i
        rows[at : at + 2], rows[at + 2 : at + 4] = pair * place, pair * (place**2 - 1.0 / 3.0)
    if course is not None:
        at = steady + 4 * len(unsteady)
        turned = course.follow * rotation
        rows[at : at + 2 * followed : 2], rows[at + 1 : at + 2 * followed : 2] = turned.real, -turned.imag
    rows[-4], rows[-3], rows[-2], rows[-1] = 1.0, place, place**2 - 1.0 / 3.0, place * (place**2 - 0.6)
    if not track.present.all():
        rows[:, ~track.present] = 0.0
    return rows


def refine(
    fits: Sequence[SineFit],
    *,
    informing: Sequence[BoolArray],
    free: bool = True,
    weights: Sequence[FloatArray] | None = None,
) -> tuple[list[SineFit], float]:
    """Fits at the fundamental (if `free`) and the lines that minimise the weighted residual.

    Parameters
    ----------
    fits : sequence of SineFit
        One for each track, at the first guess of the frequencies.
    informing : sequence of (harmonics,) bool arrays
        For each fit, the harmonics that may inform the frequency. A harmonic at a multiple of the mains must not.
    free : bool
        Whether the fundamental is estimated.
    weights : sequence of (channels,) float arrays, optional
        Inverse variances of the samples of each fit; by default those of its residual.

    Returns
    -------
    list of SineFit, float [rad/s]
        The fits, and the standard uncertainty of the fundamental.
    """
    fits = list(fits)
    resolution = 2 * np.pi / max(fit.track.time[-1] - fit.track.time[0] for fit in fits)
    for _ in range(_ITERATIONS):
        used = [_weights(fit) for fit in fits] if weights is None else weights
        step, std = _newton_step(fits, informing, used, free=free)
        if np.all(np.abs(step) < np.maximum(1e-12 * resolution, 1e-3 * std)):
            break
        step = np.clip(step, -0.3 * resolution, 0.3 * resolution)
        moved = np.split(step[1:], np.cumsum([fit.lines.size for fit in fits])[:-1])
        fits = [fit.at(fit.omega + step[0], fit.lines + lines) for fit, lines in zip(fits, moved, strict=True)]
    return fits, float(std[0])


def _weights(fit: SineFit) -> FloatArray:
    """Inverse variances of the samples; round-off bounds the variance of a noiseless channel from below."""
    variance = np.sum(fit.residual**2, axis=1) / max(fit.dof, 1)
    floor = np.max(np.abs(fit.track.signals), axis=1) ** 2 * 1e-30 + 1e-300
    return 1.0 / np.maximum(variance, floor)


def _newton_step(
    fits: Sequence[SineFit], informing: Sequence[BoolArray], weights: Sequence[FloatArray], *, free: bool
) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton step of the fundamental and the lines of each fit, with its standard uncertainty [rad/s]."""
    count = 1 + sum(fit.lines.size for fit in fits)
    normal, right = np.zeros((count, count)), np.zeros(count)
    at = 1
    for fit, spoken, weighed in zip(fits, informing, weights, strict=True):
        own = np.r_[0, at : at + fit.lines.size]
        at += fit.lines.size
        every = _slopes(fit, spoken, free=free)
        along = np.swapaxes(every @ fit.basis.T, -1, -2)
        for weight, slopes, shared, residual in zip(weighed, every, along, fit.residual, strict=True):
            # The slopes are projected onto the complement of the basis; the residual already lies in it.
            normal[np.ix_(own, own)] += weight * (slopes @ slopes.T - shared.T @ linalg.cho_solve(fit.factor, shared))
            right[own] += weight * slopes @ residual
    if not free:
        normal[0, 0] = 1.0
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale)
    covariance = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) * np.outer(scale, scale)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return covariance @ right, std if free else std * (np.arange(count) > 0)


def _slopes(fit: SineFit, informing: BoolArray, *, free: bool) -> FloatArray:
    """Derivatives (channels, 1 + lines, N) of the model by the fundamental and by each line."""
    sines = fit.harmonics + fit.lines.size
    multiple = np.eye(1 + fit.lines.size, sines, k=fit.harmonics - 1)
    multiple[0, : fit.harmonics] = free * informing * np.arange(1.0, fit.harmonics + 1)
    pairs = fit.coefficients[: 2 * sines].T.reshape(-1, 1, sines, 2)
    turned = (multiple[:, :, None] * pairs[..., ::-1] * [-1.0, 1.0]).reshape(len(pairs), -1, 2 * sines)
    return turned @ fit.basis[: 2 * sines] * fit.track.time
