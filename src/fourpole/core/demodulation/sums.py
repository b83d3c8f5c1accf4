r"""Sums of uniform samples times sinusoids, without a table of the sinusoids.

Samples stand in M blocks of B. With the time :math:`t_b` of the middle of a block and the time :math:`\tau` from there,
:math:`e^{j\omega t} = e^{j\omega t_b} e^{j\omega\tau}`: one product of the samples with a small matrix gives the sums
of all blocks, at any frequency. Sums without samples have a closed form. Both are exact but for round-off.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from math import comb

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray

#: Powers of the time, and the numbers of ways of which the power of a sum is made.
_ORDERS = np.arange(4)
_BINOMIALS = np.array([[comb(p, q) for q in range(4)] for p in range(4)], dtype=float)
#: Below this many turns of 1/2π over the record, the closed form loses digits, and the sum is made term by term.
_FEWEST_TURNS = 0.5


class Blocks:
    """Samples of channels in blocks.

    Time is `u`, from the middle of the samples; `s` is `u` over half the record's length, from -1 to 1.

    Parameters
    ----------
    signals : (C, N) float array
        Samples; 0 for missing ones.
    rate : float [Hz]
        Samples per second.
    fewest : int
        Number of blocks at least, if there are as many samples; by default the root of the number of samples.
    """

    def __init__(self, signals: FloatArray, rate: float, fewest: int = 1) -> None:
        self.channels, self.count = signals.shape
        size = max(1, min(int(np.sqrt(self.count)), self.count // fewest))
        blocks = -(-self.count // size)
        if blocks * size == self.count:
            whole = np.ascontiguousarray(signals)
        else:
            whole = np.zeros((self.channels, blocks * size))
            whole[:, : self.count] = signals
        self.samples = whole.reshape(self.channels * blocks, size)
        self.half = 0.5 * max(self.count - 1, 1) / rate
        self.inside = (np.arange(size) - 0.5 * (size - 1)) / rate
        self.middle = (np.arange(blocks) * size + 0.5 * (size - self.count)) / rate

    @cached_property
    def shifts(self) -> FloatArray:
        """Shares (4, M, 4) of the powers of the time from a block's middle in those of s: s^p = (s_b + sigma)^p."""
        places = (self.middle / self.half)[:, None] ** np.maximum(_ORDERS[:, None, None] - _ORDERS, 0)
        return np.asarray(places * _BINOMIALS[:, None])

    @cached_property
    def powers(self) -> FloatArray:
        """Powers 0 to 3 (B, 4) of s from the middle of a block."""
        return np.asarray((self.inside / self.half)[:, None] ** _ORDERS)

    @cached_property
    def moments(self) -> FloatArray:
        """Sums (C, 4) of the samples times 1, s, s² and s³."""
        parts = (self.samples @ self.powers).reshape(self.channels, -1)
        return np.asarray(parts @ self.shifts.reshape(_ORDERS.size, -1).T)


def geometric(ratio: ComplexArray, table: ComplexArray, start: ComplexArray | None = None) -> None:
    """Fill a table (n, F) with start · ratio^k in column k, from k = 0; by default with ratio^(k + 1)."""
    if table.shape[1]:
        table[:, 0] = ratio if start is None else start
    for k in range(1, table.shape[1]):
        np.multiply(table[:, k - 1], ratio, out=table[:, k])


class Sines:
    """Sinusoids e^{-jωu} on blocks, as their turn inside a block (B, F) and that of the middles of blocks (M, F).

    Parameters
    ----------
    blocks : Blocks
    omega : float [rad/s]
        Fundamental, whose multiples come first.
    harmonics : int
        Number of these multiples.
    others : (L,) float array [rad/s]
        Other frequencies.
    """

    def __init__(self, blocks: Blocks, omega: float, harmonics: int, others: FloatArray) -> None:
        tables = []
        for time in (blocks.inside, blocks.middle):
            table = np.empty((time.size, harmonics + others.size), dtype=complex)
            table[:, harmonics:] = np.exp(-1j * time[:, None] * others)
            geometric(np.exp(-1j * omega * time), table[:, :harmonics])
            tables.append(table)
        self._blocks, (self._inside, self._middle) = blocks, tables

    def sums(self, order: int) -> ComplexArray:
        """Sums (C, order + 1, F) of the samples times s^p e^{-jωu}, for p from 0 and each frequency."""
        parts = self._parts(order)
        flat = parts.reshape(parts.shape[0], -1, parts.shape[3]).view(float)
        shifts = self._blocks.shifts[: order + 1, :, : order + 1].reshape(order + 1, -1)
        return np.asarray((shifts @ flat).view(complex))

    def _parts(self, order: int) -> ComplexArray:
        """Sums (C, M, order + 1, F) over each block of the samples times powers of s from its middle, and e^{-jωu}."""
        blocks = self._blocks
        parts = (blocks.samples @ self._within(order)).view(complex)
        made = parts.reshape(blocks.channels, blocks.middle.size, order + 1, -1)
        made *= self._middle[:, None]
        return np.asarray(made)

    def beside(self, offset: float, reach: int) -> ComplexArray:
        """Sums (C, F, 2 J + 1) of the samples times e^{-j(ω + nd)u} for n from -J to J and a small offset d [rad/s].

        Within a block the turn n·d·u is expanded to its cube: with n·d·u at most 0.25, a sum is off by at most 2e-4 of
        what the samples hold beside it.
        """
        blocks, steps = self._blocks, np.arange(-reach, reach + 1)
        turning = np.empty((blocks.middle.size, steps.size), dtype=complex)
        geometric(np.exp(-1j * offset * blocks.middle), turning, np.exp(1j * reach * offset * blocks.middle))
        parts = self._parts(3)
        rows = parts.transpose(2, 0, 3, 1).reshape(-1, blocks.middle.size) @ turning
        along = rows.reshape(4, blocks.channels, parts.shape[3], steps.size)
        turn = -1j * blocks.half * offset * steps
        return np.asarray(along[0] + turn * (along[1] + turn / 2 * (along[2] + turn / 3 * along[3])))

    def wave(self, amplitudes: ComplexArray, drift: FloatArray) -> FloatArray:
        """The signals (C, N) Re sum s^p X e^{jωu} of amplitudes X (C, order + 1, F), and of drift (C, 4) s^p."""
        blocks, (channels, orders, count) = self._blocks, amplitudes.shape
        # Each block has amplitudes and a polynomial about its own middle.
        shifts = blocks.shifts[:orders, :, :orders]
        each = np.tensordot(amplitudes, shifts, (1, 0)).transpose(0, 2, 3, 1) * self._middle.conj()[:, None]
        parts = np.empty((channels, blocks.middle.size, 2 * orders * count + drift.shape[1]))
        parts[:, :, : 2 * orders * count] = each.reshape(channels, blocks.middle.size, -1).view(float)
        parts[:, :, 2 * orders * count :] = np.tensordot(drift, blocks.shifts, 1)
        table = np.concatenate([self._within(orders - 1), blocks.powers], axis=1)
        made = parts.reshape(-1, parts.shape[2]) @ table.T
        return made.reshape(channels, -1)[:, : blocks.count]

    def _within(self, order: int) -> FloatArray:
        """Cosines and minus sines (B, 2 (order + 1) F) in a block, times the powers of s from the block's middle."""
        if order == 0:
            return self._inside.view(float)
        return (
            (self._inside[:, None] * self._blocks.powers[:, : order + 1, None])
            .reshape(len(self._inside), -1)
            .view(float)
        )

    def carrier(self) -> ComplexArray:
        """The first of the sinusoids as a rotation e^{jωu} (N,)."""
        turning = self._middle[:, :1].conj() * self._inside[:, 0].conj()
        return np.asarray(turning.reshape(-1)[: self._blocks.count])


def sums_without_samples(omega: FloatArray, count: int, rate: float, order: int) -> ComplexArray:
    r"""Sums (order + 1, F) of s^p e^{jωu} over uniform samples, for p from 0 to `order`, at omega (F,) [rad/s].

    With :math:`x = \omega/2f_s` the sum for p = 0 is :math:`g = \sin Nx/\sin x`, and that for p follows from
    the p-th derivative of g, by differentiating :math:`g \sin x = \sin Nx`.

    Parameters
    ----------
    omega : (F,) float array [rad/s]
        Frequencies; the sum at 0 is that of the powers alone.
    count : int
        Number of samples N >= 2.
    rate : float [Hz]
        Samples per second.
    order : int
        Highest power of s.

    Examples
    --------
    >>> s = np.linspace(-1.0, 1.0, 50)
    >>> wave = np.exp(1j * 2.0 * 2.45 * s)
    >>> bool(np.allclose(sums_without_samples(np.array([2.0]), 50, 10.0, 1)[:, 0], [wave.sum(), (s * wave).sum()]))
    True
    """
    x = omega / (2 * rate)
    slow = np.abs(np.sin(x)) * count < _FEWEST_TURNS
    base = np.where(slow, 1.0, x)
    sine, step = np.sin(base), 1.0 / (count - 1.0)
    cotangent = np.cos(base) / sine * step
    # The derivatives of sin Nx over N^p sin x. Those of sin x over sin x are 1, cot x, -1, -cot x, in turn.
    whole = np.sin(count * base) / sine, np.cos(count * base) / sine
    made = np.empty((order + 1, omega.size))
    for p in range(order + 1):
        even, odd = _of_lower(p, step)
        np.multiply(whole[p % 2], (count * step) ** p * (-1) ** (p // 2), out=made[p])
        if p > 0:
            made[p] -= cotangent * (odd @ made[:p])
        if p > 1:
            made[p] -= even @ made[:p]
    result = ((-1j) ** np.arange(order + 1))[:, None] * made
    if slow.any():
        result[:, slow] = _term_by_term(omega[slow], count, rate, order)
    return result


@lru_cache(maxsize=64)
def _of_lower(order: int, step: float) -> tuple[FloatArray, FloatArray]:
    """Shares (order,) of the lower derivatives in that of an order: those with 1, and those with cot x by a step."""
    shares = np.array([comb(order, i) * step ** (order - i) * (-1) ** ((order - i) // 2) for i in range(order)])
    odd = (order - np.arange(order)) % 2 == 1
    return np.where(odd, 0.0, shares), np.where(odd, shares / step, 0.0)


def _term_by_term(omega: FloatArray, count: int, rate: float, order: int) -> ComplexArray:
    """The sums (order + 1, F) of `sums_without_samples` as they are defined."""
    index = np.arange(count) - 0.5 * (count - 1)
    place = index / (0.5 * (count - 1))
    made = np.empty((order + 1, omega.size), dtype=complex)
    for k, frequency in enumerate(omega.tolist()):
        turning = np.exp(1j * frequency / rate * index)
        made[:, k] = [place**p @ turning for p in range(order + 1)]
    return made
