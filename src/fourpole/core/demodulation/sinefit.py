r"""Least-squares fit of a periodic signal, its harmonics, interfering lines and drift to several channels at once.

All channels share one fundamental frequency. The channels of one fit also share their times and the frequency of each
interfering line. Gauss-Newton steps on the residual, from which the linear amplitudes are eliminated (variable
projection), find the frequencies; the step of the fundamental includes its curvature. The noise of each channel gives
its weight. The number of cycles need not be whole: sines, mean and drift are fitted together, so there is no leakage.
If a reference gives the phase, the sines follow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.demodulation.terms import TermRows, Terms, rows_of
from fourpole.core.demodulation.tracks import Track

_ITERATIONS = 12
#: A frequency is identifiable if at least this share of the slope by it is independent of those before it.
_ALIKE = 1e-3
#: Round-off of an energy, relative.
_ROUND_OFF = 1e-14
#: A step is taken to first order if its second order is at most this share of an amplitude's standard uncertainty.
_SECOND = 3e-4
#: Share of a standard uncertainty that the last step may leave.
_LEFT = 1e-3
#: A step leaves at most this multiple of the residual over the slope to the next step, times the leakage of its sine.
_LEFT_OVER = 3.0
#: Largest share of curvature in a step of the fundamental.
_MOST_BENT = 0.3
#: Longest step of a frequency, in bins of 1/T.
_LONGEST = 0.3


@dataclass(frozen=True, eq=False)
class SineFit(Terms):
    """A fit of terms at given frequencies; T is the record's length and time is counted from its middle.

    Attributes
    ----------
    track : Track
        The channels fitted, in units of each channel.
    inner : (P + 2 S + 2, P + 2 S + 2) float
        Inner products of the P rows of the terms, of the rows of the S sines times time, and of the fundamental times
        its square.
    factor : (P, P) float
        Cholesky factor of the inner products of the rows.
    coefficients : (P, channels) float
        Amplitudes of the rows, in units of each channel.
    right : (P + 2 S + 2, channels) float
        Inner products of the rows with the residual; 0 but for round-off for the first P.
    variance : (channels,) float
        Mean square of the residual over its degrees of freedom, not below its round-off.
    shift : (1 + L,) float [rad/s]
        Small step of the fundamental and the lines that was taken to first order.
    """

    track: Track
    inner: FloatArray
    factor: FloatArray
    coefficients: FloatArray
    right: FloatArray
    variance: FloatArray
    shift: FloatArray

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
    def rows(self) -> TermRows:
        """The terms as rows over the samples."""
        return rows_of(self.track, Terms(self.omega, self.harmonics, self.lines, self.unsteady))

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
        return float(0.5 * np.trace(self.solve(np.eye(self.size, 2))[:2]))

    def solve(self, right: FloatArray) -> FloatArray:
        """The inner products of the rows, inverted, times a matrix (P, n)."""
        return np.asarray(lapack.dpotrs(self.factor, right, lower=1)[0])

    def at(self, omega: float, lines: FloatArray, unsteady: tuple[int, ...] | None = None) -> SineFit:
        """The same signals fitted at other frequencies."""
        kept = self.unsteady if unsteady is None else unsteady
        return fit_sines(self.track, omega, self.harmonics, lines, kept)

    def moved(self, omega: float, lines: FloatArray) -> SineFit:
        """The fit after steps of the fundamental and of the lines (L,) [rad/s] that are small enough for first order.

        All harmonics turn, also those that do not inform the frequency.
        """
        size, steps = self.size, np.concatenate([omega * np.arange(1, self.harmonics + 1), lines])
        turned = np.zeros_like(self.coefficients)
        turned[: 2 * steps.size] = _quarter_on(self.right[size:-2], steps)
        along = -_quarter_on(self.coefficients[: 2 * steps.size], steps)
        beside = self.inner[:, size:-2] @ along
        change = self.solve(turned - beside[:size])
        right = self.right - beside - self.inner[:, :size] @ change
        bent = self.right[-2:]
        right[size : size + 2] += omega * np.stack([bent[1], -bent[0]])
        return replace(
            self,
            omega=self.omega + omega,
            lines=self.lines + lines,
            coefficients=self.coefficients + change,
            right=right,
            shift=self.shift + np.r_[omega, lines],
        )


def _quarter_on(pairs: FloatArray, steps: FloatArray) -> FloatArray:
    """Values (2 S, channels) of cosines and minus sines: those of their derivatives by the phase, times steps (S,)."""
    turned = np.empty_like(pairs)
    turned[0::2], turned[1::2] = steps[:, None] * pairs[1::2], -steps[:, None] * pairs[0::2]
    return turned


def fit_sines(track: Track, omega: float, harmonics: int, lines: FloatArray, unsteady: tuple[int, ...] = ()) -> SineFit:
    """Fit the channels of a track at given frequencies [rad/s].

    References
    ----------
    IEEE Std 1057-2017, sine fit of three parameters, with harmonics, lines and drift added.
    """
    rows = rows_of(track, Terms(omega, harmonics, lines, unsteady))
    inner, right = rows.products(), rows.with_signals()
    size = rows.size
    factor, wrong = lapack.dpotrf(inner[:size, :size], lower=1)
    if wrong:
        raise np.linalg.LinAlgError("the terms of a fit are not independent")
    coefficients = lapack.dpotrs(factor, right[:size], lower=1)[0]
    left = track.energy - np.einsum("ij,ij->j", coefficients, right[:size])
    # The energy left is a difference: its round-off is that of the whole energy.
    variance = np.maximum(left, _ROUND_OFF * track.energy + 1e-300) / max(track.known - size, 1)
    right = right - inner[:, :size] @ coefficients
    start = np.zeros(1 + lines.size)
    return SineFit(omega, harmonics, lines, unsteady, track, inner, factor, coefficients, right, variance, start)


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
    The search ends if all steps are below 1e-3 of the standard uncertainty of their frequency, or with a step that can
    be taken to first order, without new sums over the samples: what it neglects is below 1e-3 of the uncertainty, too.

    References
    ----------
    IEEE Std 1057-2017, sine fit of four parameters, here of several channels at one frequency. P. Händel, "Properties
    of the IEEE-STD-1057 four-parameter sine wave fit algorithm", IEEE Trans. Instrum. Meas. 49 (2000), 1189.
    """
    fits = list(fits)
    bin_width = 2 * np.pi / max(fit.track.time[-1] - fit.track.time[0] for fit in fits)
    ends = np.cumsum([1, *(fit.lines.size for fit in fits)])
    before: FloatArray = np.zeros(ends[-1])
    for _ in range(_ITERATIONS):
        step, std, neglected, spread = _newton_step(fits, informing, weights, free=free)
        if np.all(np.abs(step) < np.maximum(1e-12 * bin_width, _LEFT * std)):
            break
        step = np.clip(step, -_LONGEST * bin_width, _LONGEST * bin_width)
        steps = [np.r_[step[0], own] for own in np.split(step, ends)[1:-1]]
        # A line's step leaves the share that the step before it left, or the residual over the slope. The latter alone
        # is no estimate if the noise about the line is far above its mean.
        size, last = np.abs(step[1:]), np.abs(before[1:] * std[1:])
        of_lines = np.max(size * np.minimum(size / np.maximum(last, 1e-300), spread), initial=0.0)
        of_fundamental = abs(step[0] + fits[0].shift[0]) * (neglected + spread * bin_width / fits[0].omega)
        settled = of_lines < _LEFT and of_fundamental < _LEFT
        if settled and all(_is_small(fit, own, spread) for fit, own in zip(fits, steps, strict=True)):
            fits = [fit.moved(own[0], own[1:]) for fit, own in zip(fits, steps, strict=True)]
            break
        before = step
        fits = [fit.at(fit.omega + own[0], fit.lines + own[1:]) for fit, own in zip(fits, steps, strict=True)]
    return fits, float(std[0])


def _is_small(fit: SineFit, step: FloatArray, spread: float) -> bool:
    """Whether what a step (1 + L,) of the frequencies [rad/s] neglects is far below the uncertainty of the harmonics.

    An error of an interfering line reaches a harmonic by its leakage, 1 / (π bins between them). If the residual is
    white, the step times `spread` over the root of the samples is what it leaves of the line, over its uncertainty.
    """
    half, numbers = 0.5 * fit.track.time.size / fit.track.exact_rate, np.arange(1, fit.harmonics + 1)
    pairs = fit.coefficients[: 2 * fit.sines.size]
    harmonics, lines = np.split(np.hypot(pairs[0::2], pairs[1::2]), [fit.harmonics])
    turn, turns = np.split(step + fit.shift, [1])
    # First order leaves half the square of a turn: in the mean 1/6 of that at the ends; leakage is 1 over the cycles.
    second = ((half * turn * numbers) ** 2 * (1 / 6 + np.pi / (half * fit.omega))) @ harmonics
    if turns.size:
        gap = np.abs(fit.lines[:, None] - fit.omega * numbers).min(axis=1)
        leakage = 1.0 / np.clip(half * gap, 1.0, 10.0)
        second = second + (0.5 * (half * turns) ** 2 * leakage) @ lines
        if np.any(np.abs(turns) * (spread / np.sqrt(fit.track.known)) * leakage > _LEFT):
            return False
    return bool(np.all(second < _SECOND * np.sqrt(2.0 * fit.variance / fit.track.known)))


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
        own, sines = [0, *range(start, start + fit.lines.size)], slice(fit.size, -2)
        start += fit.lines.size
        # The slopes are projected onto the complement of the rows; the residual already lies in it.
        shared = fit.inner[: fit.size, sines]
        apart = fit.inner[sines, sines] - shared.T @ fit.solve(shared)
        slopes = _slopes(fit, informing[i], free=free)
        along, left = slopes.swapaxes(0, 1).reshape(len(own), -1), weight * fit.right[sines]
        projected = (weight[:, None, None] * (slopes @ apart)).swapaxes(0, 1).reshape(len(own), -1)
        normal[np.ix_(own, own)] += along @ projected.T
        right[own] += along @ left.T.reshape(-1)
        # The residual along the second derivative of the model, and how far that of the other harmonics scatters if
        # the residual is white.
        bend += float(weight @ -np.einsum("ic,ic->c", fit.coefficients[:2], fit.right[-2:]))
        numbers = np.repeat(np.arange(2, fit.harmonics + 1) ** 2, 2)[:, None]
        pairs = fit.coefficients[2 : 2 * fit.harmonics] * numbers
        squares = np.einsum("ic,ic->c", pairs, pairs) * fit.variance * fit.track.known
        others += float(weight @ (np.sqrt(squares / 10) * (0.5 * fit.track.time.size / fit.track.exact_rate) ** 2))
        energy += float(fit.variance @ weight) * fit.track.known * (fit.track.time[-1] - fit.track.time[0]) ** 2 / 12
    if not free:
        normal[0, 0] = 1.0
    covariance = _inverse(normal)
    std, size = np.sqrt(np.maximum(np.diag(covariance), 0.0)), covariance @ right
    spread = _LEFT_OVER * float(np.sqrt(energy))
    if not free:
        return size, std * (np.arange(count) > 0), 0.0, spread
    variance = covariance[0, 0]
    bent = float(np.clip(bend * variance, -_MOST_BENT, _MOST_BENT))
    # With the curvature, the step of the fundamental is 1 / (1 - bent) times as long, and the lines follow it.
    size += covariance[:, 0] / variance * (size[0] * bent / (1.0 - bent))
    return size, std, (bent**2 + _LEFT_OVER * others * float(variance)) / std[0], spread


def _inverse(normal: FloatArray) -> FloatArray:
    """Inverse of a positive matrix; directions that it does not know stay out."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale)
    factor, wrong = lapack.dpotrf(scaled, lower=1)
    if wrong or np.min(np.diag(factor)) < _ALIKE:
        inverse = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
    else:
        inverse = lapack.dpotrs(factor, np.eye(len(scaled)), lower=1)[0]
    return np.asarray(inverse * np.outer(scale, scale))


def _slopes(fit: SineFit, informing: BoolArray, *, free: bool) -> FloatArray:
    """Derivatives (channels, 1 + lines, 2 S) by the fundamental and by each line, along the sines times time."""
    sines = fit.harmonics + fit.lines.size
    multiple = np.eye(1 + fit.lines.size, sines, k=fit.harmonics - 1)
    multiple[0, : fit.harmonics] = free * informing * np.arange(1.0, fit.harmonics + 1)
    pairs = fit.coefficients[: 2 * sines].T.reshape(-1, 1, sines, 2)
    return np.asarray((multiple[:, :, None] * pairs[..., ::-1] * [-1.0, 1.0]).reshape(len(pairs), -1, 2 * sines))
