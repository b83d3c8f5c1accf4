r"""Least-squares fit of a periodic signal, its harmonics, interfering lines and drift to several channels at once.

All channels share one fundamental frequency. The channels of one fit also share their times and the frequency of each
interfering line. Gauss-Newton steps on the residual, from which the linear amplitudes are eliminated (variable
projection), find the frequencies; the step of the fundamental includes its curvature. The noise of each channel gives
its weight. The number of cycles need not be whole: sines, mean and drift are fitted together, so there is no leakage.
If a reference gives the phase, the sines follow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.demodulation.terms import TermRows, Terms, rows_of
from fourpole.core.demodulation.tracks import Track

_ITERATIONS = 12
#: A frequency is identifiable if at least this share of the slope by it is independent of the others.
_ALIKE = 1e-3
#: Round-off of an energy, relative.
_ROUND_OFF = 1e-14
#: Share of a standard uncertainty that the last step may leave.
_LEFT = 1e-3
#: A step leaves at most this multiple of the residual over the slope to the next step, times the leakage of its sine.
_LEFT_OVER = 3.0
#: Largest share of curvature in a step of the fundamental.
_MOST_BENT = 0.3
#: Longest step of a frequency, in bins of 1/T.
_LONGEST = 0.3
#: A pair of a cosine and a minus sine a quarter on: the derivative of a sine by its phase.
_QUARTER = np.array([[-1.0], [1.0]])


@dataclass(frozen=True, eq=False)
class SineFit(Terms):
    """A fit of terms at given frequencies; T is the record's length and time is counted from its middle.

    Attributes
    ----------
    track : Track
        The channels fitted, in units of each channel.
    rows : TermRows
        The terms as rows over the samples.
    inner : (P + 2 S + 2, P + 2 S + 2) float
        Inner products of the P rows of the terms, of the rows of the S sines times time, and of the fundamental times
        its square.
    inverse : (P, P) float
        Inverse of the inner products of the rows.
    coefficients : (P, channels) float
        Amplitudes of the rows, in units of each channel.
    right : (2 S + 2, channels) float
        Inner products of the rows after the first P with the residual.
    variance : (channels,) float
        Mean square of the residual over its degrees of freedom, not below its round-off.
    """

    track: Track
    rows: TermRows
    inner: FloatArray
    inverse: FloatArray
    coefficients: FloatArray
    right: FloatArray
    variance: FloatArray

    @property
    def size(self) -> int:
        """Number P of rows."""
        return self.coefficients.shape[0]

    @property
    def dof(self) -> int:
        """Number of samples minus number of fitted parameters."""
        return self.track.known - self.size

    @property
    def resolution(self) -> float:
        """Width of a bin, 1/T [Hz]."""
        return self.track.exact_rate / self.track.time.size

    @cached_property
    def residual(self) -> FloatArray:
        """Signals minus fit (channels, N); 0 for missing samples."""
        model = self.rows.model(self.coefficients)
        return np.subtract(self.track.signals, model, out=model)

    def amplitudes(self) -> ComplexArray:
        """Complex amplitudes X (channels, harmonics) of x(t) = Re(X e^{jwt}), with t from the middle of the record."""
        pairs = self.coefficients[: 2 * self.harmonics]
        turn = np.exp(-1j * self.omega * self.rows.lead * np.arange(1, self.harmonics + 1))
        return np.asarray((pairs[0::2] + 1j * pairs[1::2]).T * turn)

    def amplitude_variance(self) -> float:
        """Variance of the real part of the fundamental's amplitude per unit of sample variance [1]."""
        return 0.5 * float(self.inverse[0, 0] + self.inverse[1, 1])

    def at(self, omega: float, lines: FloatArray, unsteady: tuple[int, ...] | None = None) -> SineFit:
        """The same signals fitted at other frequencies."""
        kept = self.unsteady if unsteady is None else unsteady
        return fit_sines(self.track, omega, self.harmonics, lines, kept)


def fit_sines(track: Track, omega: float, harmonics: int, lines: FloatArray, unsteady: tuple[int, ...] = ()) -> SineFit:
    """Fit the channels of a track at given frequencies [rad/s].

    References
    ----------
    IEEE Std 1057-2017, sine fit of three parameters, with harmonics, lines and drift added.
    """
    rows = rows_of(track, Terms(omega, harmonics, lines, unsteady))
    if (made := rows.fitted()) is not None:
        return SineFit(omega, harmonics, lines, unsteady, track, rows, *made[2])
    inner, right = rows.products(), rows.with_signals()
    size = rows.size
    inverse = np.linalg.inv(inner[:size, :size])
    if not inverse.diagonal().min() > 0:
        raise np.linalg.LinAlgError("the terms of a fit are not independent")
    coefficients = inverse @ right[:size]
    left = track.energy - (coefficients * right[:size]).sum(axis=0)
    # The energy left is a difference: its round-off is that of the whole energy.
    variance = np.maximum(left, _ROUND_OFF * track.energy + 1e-300) / max(track.known - size, 1)
    right = right[size:] - inner[size:, :size] @ coefficients
    return SineFit(omega, harmonics, lines, unsteady, track, rows, inner, inverse, coefficients, right, variance)


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

    Notes
    -----
    The search ends if all steps are below 1e-3 of the standard uncertainty of their frequency, or with a step that
    leaves less than that to the next one.

    References
    ----------
    IEEE Std 1057-2017, sine fit of four parameters, here of several channels at one frequency. P. Händel, "Properties
    of the IEEE-STD-1057 four-parameter sine wave fit algorithm", IEEE Trans. Instrum. Meas. 49 (2000), 1189.
    """
    fits = list(fits)
    if len(fits) == 1 and (done := _refined(fits[0], informing[0], free, weights)) is not None:
        return done
    bin_width = 2 * np.pi / max(fit.track.time[-1] - fit.track.time[0] for fit in fits)
    before: FloatArray = np.zeros(1 + sum(fit.lines.size for fit in fits))
    for _ in range(_ITERATIONS):
        step, std, neglected, spread = _newton_step(fits, informing, weights, free=free)
        # An error of a line's frequency reaches a harmonic by leakage only: less of it counts.
        leakage = np.concatenate([[1.0], *map(_leakage, fits)])
        if (np.abs(step) * leakage < np.maximum(1e-12 * bin_width, _LEFT * std)).all():
            break
        step = np.minimum(np.maximum(step, -_LONGEST * bin_width), _LONGEST * bin_width)
        # A line's step leaves the share that the step before it left, or the residual over the slope. The latter alone
        # is no estimate if the noise about the line is far above its mean.
        size, last = np.abs(step), np.abs(before * std)
        rest = size * np.minimum(size / np.maximum(last, 1e-300), spread)
        rest[0] = size[0] * (neglected + spread * bin_width / fits[0].omega)
        before, start = step, 1
        for i, fit in enumerate(fits):
            end = start + fit.lines.size
            fits[i] = fit.at(fit.omega + float(step[0]), fit.lines + step[start:end])
            start = end
        if (rest * leakage).max() < _LEFT:
            break
    return fits, float(std[0])


def _refined(
    fit: SineFit, informing: BoolArray, free: bool, weights: Sequence[FloatArray] | None
) -> tuple[list[SineFit], float] | None:
    """The fit of one track, refined by the library in C; None if numpy must do it."""
    weight = None if weights is None else weights[0]
    made = fit.rows.fitted(rounds=_ITERATIONS, free=free, informing=informing, weight=weight)
    if made is None:
        return None
    omega, lines, found, std = made
    rows = rows_of(fit.track, Terms(omega, fit.harmonics, lines, fit.unsteady))
    return [SineFit(omega, fit.harmonics, lines, fit.unsteady, fit.track, rows, *found)], std


def _leakage(fit: SineFit) -> FloatArray:
    """Error of a harmonic by that of the frequency of each line (L,), both over their uncertainties, at most [1].

    If the residual is white, it is the root of 3 over the phase between the two at the ends of the record, here with
    the margin `_LEFT_OVER`.
    """
    gap = np.abs(fit.lines[:, None] - fit.omega * np.arange(1, fit.harmonics + 1)).min(axis=1)
    return np.minimum(_LEFT_OVER * np.sqrt(12.0) / ((fit.track.time[-1] - fit.track.time[0]) * gap), 1.0)


def _newton_step(
    fits: Sequence[SineFit], informing: Sequence[BoolArray], weights: Sequence[FloatArray] | None, *, free: bool
) -> tuple[FloatArray, FloatArray, float, float]:
    """Step of the frequencies, with the curvature by the fundamental, from the arguments of `refine`.

    The curvature by the other harmonics is left out.

    Returns
    -------
    size, std : (1 + all lines,) float arrays [rad/s]
        The step of the fundamental, then of the lines of each fit, and the standard uncertainty of each frequency; 0
        for a fundamental that is not free.
    neglected : float [s/rad]
        What a step of the fundamental leaves, because it neglects curvature, over the standard uncertainty and over
        the step.
    spread : float [s]
        Root of the weighted energy of the residual times the mean square of time, with the margin `_LEFT_OVER`. Its
        product with the standard uncertainty of a frequency is the residual over the slope of the model: the share of a
        step that Gauss-Newton may leave to the next, because it neglects the curvature of the model.
    """
    count = 1 + sum(fit.lines.size for fit in fits)
    normal, right, start = np.zeros((count, count)), np.zeros(count), 1
    bend = others = energy = 0.0
    for i, fit in enumerate(fits):
        weight = 1.0 / fit.variance if weights is None else weights[i]
        slopes = _slopes(fit, informing[i], free=free)
        # The slopes are projected onto the complement of the rows; the residual already lies in it.
        shared = fit.inner[: fit.size, fit.size : -2]
        apart = fit.inner[fit.size : -2, fit.size : -2] - shared.T @ (fit.inverse @ shared)
        along, weighted = (apart @ slopes).reshape(len(slopes), -1), (slopes * weight).reshape(len(slopes), -1)
        own = np.array([0, *range(start, start + fit.lines.size)])
        start += fit.lines.size
        normal[own[:, None], own] += weighted @ along.T
        right[own] += weighted @ fit.right[:-2].reshape(-1)
        # The residual along the second derivative of the model, and how far that of the other harmonics scatters if
        # the residual is white.
        bend -= float((fit.coefficients[:2] * fit.right[-2:]).sum(axis=0) @ weight)
        pairs = fit.coefficients[2 : 2 * fit.harmonics] * np.arange(2.0, fit.harmonics + 1).repeat(2)[:, None] ** 2
        squares = (pairs * pairs).sum(axis=0) * fit.variance * (fit.track.known / 10)
        length = float(fit.track.time[-1] - fit.track.time[0])
        others += float(weight @ np.sqrt(squares)) * (0.5 * length) ** 2
        energy += float(fit.variance @ weight) * fit.track.known * length**2 / 12
    if not free:
        normal[0, 0] = 1.0
    covariance = _inverse(normal)
    std, size = np.sqrt(np.maximum(covariance.diagonal(), 0.0)), covariance @ right
    spread = _LEFT_OVER * float(np.sqrt(energy))
    if not free:
        std[0] = 0.0
        return size, std, 0.0, spread
    variance = float(covariance[0, 0])
    bent = min(max(bend * variance, -_MOST_BENT), _MOST_BENT)
    # With the curvature, the step of the fundamental is 1 / (1 - bent) times as long, and the lines follow it.
    size += covariance[:, 0] / variance * (size[0] * bent / (1.0 - bent))
    return size, std, (bent**2 + _LEFT_OVER * others * variance) / float(std[0]), spread


def _inverse(normal: FloatArray) -> FloatArray:
    """Inverse of a positive matrix; directions that it does not know stay out."""
    scale = 1.0 / np.sqrt(np.maximum(normal.diagonal(), 1e-300))
    if scale.size == 1 and normal[0, 0] > 0:
        return (scale * scale)[:, None]
    outer = scale[:, None] * scale
    scaled = normal * outer
    with suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(scaled)
        lost = inverse.diagonal()
        if lost.min() > 0 and lost.max() < _ALIKE**-2:
            return np.asarray(inverse * outer)
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) * outer)


def _slopes(fit: SineFit, informing: BoolArray, *, free: bool) -> FloatArray:
    """Derivatives (1 + lines, 2 S, channels) by the fundamental and by each line, along the sines times time."""
    own = 2 * fit.harmonics
    pairs = fit.coefficients[: own + 2 * fit.lines.size].reshape(-1, 2, fit.coefficients.shape[1])
    turned = (pairs[:, ::-1] * _QUARTER).reshape(-1, pairs.shape[2])
    slopes = np.zeros((1 + fit.lines.size, *turned.shape))
    if free:
        slopes[0, :own] = turned[:own] * (informing * np.arange(1.0, fit.harmonics + 1)).repeat(2)[:, None]
    for k in range(fit.lines.size):
        place = slice(own + 2 * k, own + 2 * k + 2)
        slopes[1 + k, place] = turned[place]
    return slopes
