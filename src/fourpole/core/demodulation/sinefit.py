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
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.terms import Rows, Terms, rows_of
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
class SineFit(ByValue):
    """A fit at given frequencies; T is the record's length and time is counted from its middle.

    Attributes
    ----------
    track : Track
        The channels fitted, in units of each channel.
    terms : Terms
        What is fitted: the frequencies.
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
    terms: Terms
    inner: FloatArray
    factor: FloatArray
    coefficients: FloatArray
    right: FloatArray
    variance: FloatArray
    shift: FloatArray

    @property
    def omega(self) -> float:
        """Fundamental [rad/s]."""
        return self.terms.omega

    @property
    def lines(self) -> FloatArray:
        """Interfering lines (L,) [rad/s]."""
        return self.terms.lines

    @property
    def harmonics(self) -> int:
        """Number of multiples of the fundamental, with the fundamental itself."""
        return self.terms.harmonics

    @property
    def unsteady(self) -> tuple[int, ...]:
        """Harmonics whose amplitude may vary over the record, because a line lies too close to separate."""
        return self.terms.unsteady

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
        return self.rate / self.track.time.size

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.track.exact_rate

    @cached_property
    def rows(self) -> Rows:
        """The terms as rows over the samples."""
        return rows_of(self.track, self.terms)

    @cached_property
    def apart(self) -> FloatArray:
        """Inner products (2 S, 2 S) of the sines times time, without their parts along the rows."""
        own = slice(self.size, -2)
        shared = self.inner[: self.size, own]
        return np.asarray(self.inner[own, own] - shared.T @ self.solve(shared))

    @property
    def bend(self) -> FloatArray:
        """Inner product (channels,) of the residual with the second derivative of the model by the fundamental."""
        return -np.asarray(np.einsum("ic,ic->c", self.coefficients[:2], self.right[-2:]))

    @property
    def bend_std(self) -> FloatArray:
        """The same (channels,) by all other harmonics: standard deviation if the residual is white."""
        pairs = self.coefficients[2 : 2 * self.harmonics] * np.repeat(np.arange(2, self.harmonics + 1) ** 2, 2)[:, None]
        squares = np.einsum("ic,ic->c", pairs, pairs) * self.variance * self.track.known
        return np.asarray(np.sqrt(squares / 10) * (0.5 * self.track.time.size / self.rate) ** 2)

    @cached_property
    def residual(self) -> FloatArray:
        """Signals minus fit (channels, N); 0 for missing samples."""
        model = self.rows.model(self.coefficients)
        return np.subtract(self.track.signals, model, out=model)

    @cached_property
    def carrier(self) -> ComplexArray:
        """The fundamental as a rotation (N,)."""
        return self.rows.carrier()

    def amplitudes(self) -> ComplexArray:
        """Complex amplitudes X (channels, harmonics) of x(t) = Re(X e^{jwt}), with t from the middle of the record."""
        pairs = self.coefficients[: 2 * self.harmonics]
        turn = np.exp(-1j * self.omega * self.rows.lead * np.arange(1, self.harmonics + 1))
        return np.asarray((pairs[0::2] + 1j * pairs[1::2]).T * turn)

    def amplitude_variance(self) -> float:
        """Variance of the real part of the fundamental's amplitude per unit of sample variance [1]."""
        unit = np.zeros((self.size, 2))
        unit[0, 0] = unit[1, 1] = 1.0
        return float(0.5 * np.trace(self.solve(unit)[:2]))

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
        terms = replace(self.terms, omega=self.omega + omega, lines=self.lines + lines)
        shift = self.shift + np.r_[omega, lines]
        return replace(self, terms=terms, coefficients=self.coefficients + change, right=right, shift=shift)


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
    terms = Terms(omega, harmonics, lines, unsteady)
    rows = rows_of(track, terms)
    inner, right = rows.products(), rows.with_signals()
    size = rows.size
    factor, wrong = lapack.dpotrf(inner[:size, :size], lower=1)
    if wrong:
        raise np.linalg.LinAlgError("the terms of a fit are not independent")
    coefficients = lapack.dpotrs(factor, right[:size], lower=1)[0]
    left = track.energy - np.einsum("ij,ij->j", coefficients, right[:size])
    # The energy left is a difference: its round-off is that of the whole energy.
    variance = np.maximum(left, _ROUND_OFF * track.energy + 1e-300) / max(track.known - size, 1)
    return SineFit(
        track,
        terms,
        inner,
        factor,
        coefficients,
        right - inner[:, :size] @ coefficients,
        variance,
        np.zeros(1 + lines.size),
    )


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
    before: FloatArray = np.zeros(1 + sum(fit.lines.size for fit in fits))
    for _ in range(_ITERATIONS):
        used = [1.0 / fit.variance for fit in fits] if weights is None else weights
        slopes = [_slopes(fit, may, free=free) for fit, may in zip(fits, informing, strict=True)]
        step = _newton_step(fits, slopes, used, free=free)
        if np.all(np.abs(step.size) < np.maximum(1e-12 * bin_width, _LEFT * step.std)):
            break
        whole = np.clip(step.size, -_LONGEST * bin_width, _LONGEST * bin_width)
        steps = _for_each(fits, whole)
        settled = _left_of_lines(whole, before, step.std, _LEFT_OVER * _spread(fits, used)) < _LEFT
        if settled and _is_last(fits, steps, used, step.neglected, bin_width):
            fits = [fit.moved(one[0], one[1:]) for fit, one in zip(fits, steps, strict=True)]
            break
        before = whole
        fits = [fit.at(fit.omega + one[0], fit.lines + one[1:]) for fit, one in zip(fits, steps, strict=True)]
    return fits, float(step.std[0])


class _Step(NamedTuple):
    """A step of the frequencies: of the fundamental, then of the lines of each fit.

    Attributes
    ----------
    size, std : (1 + all lines,) float [rad/s]
        The step, and the standard uncertainty of each frequency; 0 for a fundamental that is not free.
    neglected : float [s/rad]
        What a step of the fundamental leaves, because it neglects curvature, over the standard uncertainty and over
        the step.
    """

    size: FloatArray
    std: FloatArray
    neglected: float


def _for_each(fits: Sequence[SineFit], step: FloatArray) -> list[FloatArray]:
    """The step (1 + L,) of each fit: of the fundamental and of its own lines [rad/s]."""
    lines = np.split(step[1:], np.cumsum([fit.lines.size for fit in fits])[:-1])
    return [np.r_[step[0], own] for own in lines]


def _is_last(
    fits: Sequence[SineFit],
    steps: Sequence[FloatArray],
    weights: Sequence[FloatArray],
    neglected: float,
    bin_width: float,
) -> bool:
    """Whether no other step is needed after these, taken to first order; `neglected` is that of `_Step`."""
    spread = _LEFT_OVER * _spread(fits, weights)
    whole = abs(steps[0][0] + fits[0].shift[0])
    left = whole * (neglected + spread * bin_width / fits[0].omega)
    return left < _LEFT and all(_is_small(fit, step, spread) for fit, step in zip(fits, steps, strict=True))


def _spread(fits: Sequence[SineFit], weights: Sequence[FloatArray]) -> float:
    """Root of the weighted energy of the residual times the mean square of time [s].

    Its product with the standard uncertainty of a frequency is the residual over the slope of the model: the share of a
    step that Gauss-Newton may leave to the next, because it neglects the curvature of the model.
    """
    each = [
        float(fit.variance @ weight) * fit.track.known * (fit.track.time[-1] - fit.track.time[0]) ** 2 / 12
        for fit, weight in zip(fits, weights, strict=True)
    ]
    return float(np.sqrt(sum(each)))


def _left_of_lines(step: FloatArray, before: FloatArray, std: FloatArray, spread: float) -> float:
    """What a step (1 + L,) leaves of a line's step, at most, over its standard uncertainty.

    It leaves the share that the step before it left, or the residual over the slope. The latter alone is no estimate if
    the noise about the line is far above its mean.
    """
    size, last = np.abs(step[1:]), np.abs(before[1:] * std[1:])
    return float(np.max(size * np.minimum(size / np.maximum(last, 1e-300), spread), initial=0.0))


def _is_small(fit: SineFit, step: FloatArray, spread: float) -> bool:
    """Whether what a step (1 + L,) of the frequencies [rad/s] neglects is far below the uncertainty of the harmonics.

    An error of an interfering line reaches a harmonic by its leakage, 1 / (π bins between them). If the residual is
    white, the step times `spread` over the root of the samples is what it leaves of the line, over its uncertainty.
    """
    half, numbers = 0.5 * fit.track.time.size / fit.rate, np.arange(1, fit.harmonics + 1)
    pairs = fit.coefficients[: 2 * fit.terms.sines.size]
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
    fits: Sequence[SineFit], slopes: Sequence[FloatArray], weights: Sequence[FloatArray], *, free: bool
) -> _Step:
    """Step of the fundamental and the lines of each fit, with the curvature by the fundamental.

    The curvature by the other harmonics is left out; `neglected` has what the step leaves by that.
    """
    count = 1 + sum(fit.lines.size for fit in fits)
    normal, right, bend, others = np.zeros((count, count)), np.zeros(count), 0.0, 0.0
    at = 1
    for fit, each, weight in zip(fits, slopes, weights, strict=True):
        own = [0, *range(at, at + fit.lines.size)]
        at += fit.lines.size
        # The slopes are projected onto the complement of the rows; the residual already lies in it.
        along, left = each.swapaxes(0, 1).reshape(len(own), -1), weight * fit.right[fit.size : -2]
        projected = (weight[:, None, None] * (each @ fit.apart)).swapaxes(0, 1).reshape(len(own), -1)
        normal[np.ix_(own, own)] += along @ projected.T
        right[own] += along @ left.T.reshape(-1)
        bend += float(weight @ fit.bend)
        others += float(weight @ fit.bend_std)
    if not free:
        normal[0, 0] = 1.0
    covariance = _inverse(normal)
    std, size = np.sqrt(np.maximum(np.diag(covariance), 0.0)), covariance @ right
    if not free:
        return _Step(size, std * (np.arange(count) > 0), 0.0)
    variance = covariance[0, 0]
    bent = float(np.clip(bend * variance, -_MOST_BENT, _MOST_BENT))
    # With the curvature, the step of the fundamental is 1 / (1 - bent) times as long, and the lines follow it.
    size += covariance[:, 0] / variance * (size[0] * bent / (1.0 - bent))
    return _Step(size, std, (bent**2 + _LEFT_OVER * others * float(variance)) / std[0])


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
