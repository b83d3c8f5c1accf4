r"""Sums of uniform samples times sinusoids, without a table of the sinusoids.

Samples stand in M blocks of B. With the time :math:`t_b` of the middle of a block and the time :math:`\tau` from there,
:math:`e^{j\omega t} = e^{j\omega t_b} e^{j\omega\tau}`: one product of the samples with a small matrix gives the sums
of all blocks, at any frequency. The moments of a recording, which are the sums times powers of the time, then give the
sums at all frequencies near by. Sums without samples have a closed form.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from math import comb

import numpy as np

from fourpole.core import kernel
from fourpole.core.arrays import ComplexArray, FloatArray, IntArray

#: Powers of the time of a drift, and of the time within a block that moments have: a block is 1/100 of s at most.
_DRIFT, _WITHIN = 4, 3
#: Powers of the time of moments: the sums times 1, s and s² follow from these by a series of all but the last two.
_MOMENTS = 10
_SERIES = _MOMENTS - 2
_EXPONENTS = np.arange(_SERIES)[:, None]
_SHARES = 1.0 / np.cumprod(np.maximum(_EXPONENTS, 1.0), axis=0)
#: Largest turn at the ends of a record by which a frequency may depart from that of its moments [rad]: the series is
#: then off by 0.15^8/8! = 6e-12 of what the samples hold.
_NEAR = 0.15
#: Fewest blocks, if there are as many samples: 16 bins then turn by at most π 16/200 = 0.25 in half a block.
_BLOCKS = 200
#: Below this many turns of 1/2π over the record, the closed form loses digits, and the sum is made term by term.
_FEWEST_TURNS = 0.5


@lru_cache(maxsize=2)
def hann(count: int) -> FloatArray:
    """Hann window of a record of `count` samples."""
    window: FloatArray = 0.5 - 0.5 * np.cos(2 * np.pi / count * np.arange(count))
    window.flags.writeable = False
    return window


class Grid:
    """Uniform times in M blocks of B.

    Time is `u`, from the middle of the samples; `s` is `u` over half the record's length, from -1 to 1.

    Parameters
    ----------
    count : int
        Number of samples.
    rate : float [Hz]
        Samples per second.
    """

    def __init__(self, count: int, rate: float) -> None:
        size = max(1, min(int(np.sqrt(count)), count // _BLOCKS))
        blocks, self.count, self.rate = -(-count // size), count, rate
        self.half = 0.5 * max(count - 1, 1) / rate
        self.inside = (np.arange(size) - 0.5 * (size - 1)) / rate
        self.middle = (np.arange(blocks) * size + 0.5 * (size - count)) / rate

    def split(self, signals: FloatArray) -> FloatArray:
        """Samples (C, N) in blocks (C M, B), with zeros at the end of the last one."""
        whole, size = signals, self.middle.size * self.inside.size
        if size > self.count:
            whole = np.zeros((len(signals), size))
            whole[:, : self.count] = signals
        return np.ascontiguousarray(whole).reshape(-1, self.inside.size)

    def joined(self, blocks: FloatArray) -> FloatArray:
        """Samples (C, N) of blocks (C M, B)."""
        return blocks.reshape(-1, self.middle.size * self.inside.size)[:, : self.count]

    @cached_property
    def shifts(self) -> FloatArray:
        """Shares (10, M, 4) of the powers of the time from a block's middle in those of s: s^p = (s_b + sigma)^p."""
        powers, within = np.arange(_MOMENTS), np.arange(_DRIFT)
        ways = np.array([[comb(p, q) for q in within.tolist()] for p in powers.tolist()], dtype=float)
        places = (self.middle / self.half)[:, None] ** np.maximum(powers[:, None, None] - within, 0)
        return np.asarray(places * ways[:, None])

    @cached_property
    def powers(self) -> FloatArray:
        """Powers 0 to 3 (B, 4) of s from the middle of a block."""
        return np.asarray((self.inside / self.half)[:, None] ** np.arange(_DRIFT))


_grid_of = lru_cache(maxsize=16)(Grid)


class Blocks:
    """Samples (C, N) of channels in the blocks of their times, and what sums of them were made."""

    def __init__(self, signals: FloatArray, rate: float) -> None:
        self.grid = _grid_of(signals.shape[1], rate)
        self.samples = self.grid.split(signals)
        self._base, self._moments = np.array([-np.inf]), np.zeros((len(signals), 3, _SERIES, 1), dtype=complex)

    @cached_property
    def drift(self) -> FloatArray:
        """Sums (C, 4) of the samples times 1, s, s² and s³."""
        parts = (self.samples @ self.grid.powers).reshape(-1, self.grid.middle.size * _DRIFT)
        return np.asarray(parts @ self.grid.shifts[:_DRIFT].reshape(_DRIFT, -1).T)

    def sums(self, omega: float, harmonics: int, others: FloatArray) -> ComplexArray:
        """Sums (C, 3, F) of the samples times 1, s or s² and e^{-jωu}, at multiples of omega and at others [rad/s]."""
        place, turn = self.reach(omega, harmonics, others)
        series = (-1j * turn) ** _EXPONENTS * _SHARES
        return np.add.reduce(self._moments.take(place, axis=3) * series, axis=2)

    def reach(self, omega: float, harmonics: int, others: FloatArray) -> tuple[IntArray, FloatArray]:
        """Place of the nearest moments of each frequency (F,), and its turn from there [rad].

        The samples are gone through only for frequencies that are far from all before.
        """
        frequency = np.concatenate([omega * np.arange(1, harmonics + 1), others])
        for _ in range(2):
            turns = (frequency[:, None] - self._base) * self.grid.half
            place = np.abs(turns).argmin(axis=1)
            turn = turns[np.arange(place.size), place]
            far = np.abs(turn) > _NEAR
            if not far.any():
                break
            new = Sines(self.grid, omega, harmonics if far[:harmonics].any() else 0, others[far[harmonics:]])
            moments = new.moments(self.samples)[:, _EXPONENTS.T + np.arange(3)[:, None]]
            self._base = np.concatenate([self._base, new.omega])
            self._moments = np.concatenate([self._moments, moments], axis=3)
            self.__dict__.pop("handed", None)
        return place, turn

    @cached_property
    def handed(self) -> kernel.Track:
        """The track as the library in C takes it."""
        grid, order = self.grid, 2 * _DRIFT - 2
        still = _term_by_term((0.0,), grid.count, grid.rate, order)
        shape, scale = (*self._moments.shape[:1], grid.count, self._base.size), (grid.rate, grid.half, 2 * grid.half)
        return kernel.Track(
            *shape, *scale, self._base, self.drift, *_derivatives(order, grid.count), still, self._moments
        )


def geometric(ratio: ComplexArray, table: ComplexArray, start: ComplexArray | None = None) -> None:
    """Fill a table (n, F) with start · ratio^k in column k, from k = 0; by default with ratio^(k + 1)."""
    table[:] = ratio[:, None]
    if start is not None:
        table[:, 0] = start
    np.multiply.accumulate(table, axis=1, out=table)


class Sines:
    """Sinusoids e^{-jωu} on a grid, as their turn inside a block (B, F) and that of the middles of blocks (M, F).

    Parameters
    ----------
    grid : Grid
    omega : float [rad/s]
        Fundamental, whose multiples come first.
    harmonics : int
        Number of these multiples.
    others : (L,) float array [rad/s]
        Other frequencies.
    """

    def __init__(self, grid: Grid, omega: float, harmonics: int, others: FloatArray) -> None:
        tables = []
        for time in (grid.inside, grid.middle):
            table = np.empty((time.size, harmonics + others.size), dtype=complex)
            if others.size:
                table[:, harmonics:] = np.exp(-1j * time[:, None] * others)
            geometric(np.exp(-1j * omega * time), table[:, :harmonics])
            tables.append(table)
        self._grid, (self._inside, self._middle) = grid, tables
        self.omega = np.concatenate([omega * np.arange(1, harmonics + 1), others])

    def moments(self, samples: FloatArray, orders: int = _MOMENTS) -> ComplexArray:
        """Sums (C, orders, F) of samples (C M, B) times powers of s from 0 and e^{-jωu}.

        From s³ on, the cube of the time within a block is left out.
        """
        within = min(orders, _WITHIN)
        parts = self._parts(samples, within, self.omega.size)
        flat = parts.reshape(len(parts), -1, parts.shape[3]).view(float)
        shifts = self._grid.shifts[:orders, :, :within].reshape(orders, -1)
        return np.asarray((shifts @ flat).view(complex))

    def between(self, samples: FloatArray, edges: IntArray) -> ComplexArray:
        """Sums (C, n - 1) of samples (C M, B) times the first of the sinusoids, between places (n,) from 0 to N."""
        size, blocks = self._grid.inside.size, self._grid.middle.size
        block = np.minimum(edges // size, blocks - 1)
        before = np.cumsum(self._parts(samples, 1, 1)[:, :, 0, 0], axis=1)[:, block - 1] * (block > 0)
        within = np.arange(size) < (edges - block * size)[:, None]
        rest = (samples.reshape(-1, blocks, size)[:, block] * within) @ self._inside[:, 0]
        return np.diff(before + rest * self._middle[block, 0])

    def _parts(self, samples: FloatArray, orders: int, count: int) -> ComplexArray:
        """Sums (C, M, orders, F) over the blocks of samples (C M, B) times powers of s from a middle, and e^{-jωu}.

        `count` is F, the number of the first frequencies.
        """
        made = (samples @ self._within(orders, count)).view(complex).reshape(-1, self._grid.middle.size, orders, count)
        made *= self._middle[:, None, :count]
        return np.asarray(made)

    def beside(self, samples: FloatArray, count: int, offset: float, reach: int) -> ComplexArray:
        """Sums (C, F, 2 J + 1) of samples (C M, B) times e^{-j(ω + nd)u}, n from -J to J, for a small offset d [rad/s].

        `count` is F, the number of the first frequencies.
        Within a block the turn n·d·u is expanded to its cube: with n·d·u at most 0.25, a sum is off by at most 2e-4 of
        what the samples hold beside it.
        """
        grid, steps = self._grid, np.arange(-reach, reach + 1)
        turning = np.empty((grid.middle.size, steps.size), dtype=complex)
        geometric(np.exp(-1j * offset * grid.middle), turning, np.exp(1j * reach * offset * grid.middle))
        parts = self._parts(samples, 4, count)
        rows = parts.transpose(2, 0, 3, 1).reshape(-1, grid.middle.size) @ turning
        along = rows.reshape(4, len(parts), count, steps.size)
        turn = -1j * grid.half * offset * steps
        return np.asarray(along[0] + turn * (along[1] + turn / 2 * (along[2] + turn / 3 * along[3])))

    def wave(self, amplitudes: ComplexArray, drift: FloatArray) -> FloatArray:
        """The signals (C, N) Re sum s^p X e^{jωu} of amplitudes X (C, orders, F), and of drift (C, 4) s^p."""
        grid, (channels, orders, count) = self._grid, amplitudes.shape
        # Each block has amplitudes and a polynomial about its own middle.
        shifts = grid.shifts[:orders, :, :orders].reshape(orders, -1).T
        each = (shifts @ amplitudes).reshape(channels, -1, orders, count) * self._middle.conj()[:, None]
        parts = np.empty((channels, grid.middle.size, 2 * orders * count + drift.shape[1]))
        parts[:, :, : 2 * orders * count] = each.reshape(channels, grid.middle.size, -1).view(float)
        along = drift @ grid.shifts[:_DRIFT].reshape(_DRIFT, -1)
        parts[:, :, 2 * orders * count :] = along.reshape(channels, -1, _DRIFT)
        table = np.concatenate([self._within(orders, count), grid.powers], axis=1)
        return grid.joined(parts.reshape(-1, parts.shape[2]) @ table.T)

    def _within(self, orders: int, count: int) -> FloatArray:
        """Cosines and minus sines (B, 2 orders F) in a block, times the powers of s from the block's middle."""
        powers = self._grid.powers[:, :orders, None]
        return (self._inside[:, None, :count] * powers).reshape(len(powers), -1).view(float)


def sums_without_samples(omega: FloatArray, count: int, rate: float, order: int) -> FloatArray:
    r"""Sums (order + 1, F) over uniform samples of s^p cos ωu for even p, and of s^p sin ωu for odd p up to `order`.

    The others are zero. With :math:`x = \omega/2f_s` the sum for p = 0 is :math:`g = \sin Nx/\sin x`, and that for p is
    its p-th derivative by x, but for the sign, over :math:`(N - 1)^p`.

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
    >>> even, odd = np.cos(2.0 * 2.45 * s), np.sin(2.0 * 2.45 * s)
    >>> bool(np.allclose(sums_without_samples(np.array([2.0]), 50, 10.0, 1)[:, 0], [even.sum(), (s * odd).sum()]))
    True
    """
    x = omega / (2 * rate)
    sine = np.sin(x)
    slow = np.abs(sine) * count < _FEWEST_TURNS
    if slow.any():
        sine[slow] = 1.0
    powers = np.empty((order + 1, omega.size))
    powers[0], powers[1:] = 1.0 / sine, np.cos(x) / sine / (count - 1.0)
    np.multiply.accumulate(powers, out=powers)
    by_sine, by_cosine = _derivatives(order, count)
    made = np.sin(count * x) * (by_sine @ powers) + np.cos(count * x) * (by_cosine @ powers)
    if slow.any():
        made[:, slow] = _term_by_term(tuple(omega[slow].tolist()), count, rate, order)
    return np.asarray(made)


@lru_cache(maxsize=64)
def _derivatives(order: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Polynomials (order + 1, order + 1) in cot x/(N - 1) of the sums: those times sin Nx/sin x and times cos Nx/sin x.

    The derivatives of 1/sin x are polynomials in t = cot x, times 1/sin x: P' is -t P - (1 + t²) dP/dt.
    """
    step = 1.0 / (count - 1.0)
    inverse = np.zeros((order + 1, order + 2))
    inverse[0, 0] = 1.0
    degrees = np.arange(order + 2)
    for i in range(order):
        slope = inverse[i] * degrees
        inverse[i + 1, 1:] = -inverse[i, :-1] - slope[:-1]
        inverse[i + 1, :-1] -= slope[1:]
    inverse = inverse[:, :-1] * step ** np.maximum(degrees[:-1, None] - degrees[:-1], 0)
    made = np.zeros((2, order + 1, order + 1))
    for p in range(order + 1):
        for i in range(p + 1):
            turns = p - i  # derivatives of sin Nx
            share = comb(p, i) * (count * step) ** turns * (-1) ** (turns // 2) * (-1) ** ((p + 1) // 2)
            made[turns % 2, p] += share * inverse[i]
    return made[0], made[1]


@lru_cache(maxsize=64)
def _term_by_term(omega: tuple[float, ...], count: int, rate: float, order: int) -> FloatArray:
    """The sums (order + 1, F) of `sums_without_samples` as they are defined."""
    index = np.arange(count) - 0.5 * (count - 1)
    place = index / (0.5 * (count - 1))
    made = np.empty((order + 1, len(omega)))
    for k, frequency in enumerate(omega):
        turning = np.cos(frequency / rate * index), np.sin(frequency / rate * index)
        made[:, k] = [place**p @ turning[p % 2] for p in range(order + 1)]
    return made
