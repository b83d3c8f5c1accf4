"""The terms of a fit of sines: their inner products with one another and with the samples of a track."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.demodulation.sums import Sines, sums_without_samples
from fourpole.core.demodulation.tracks import Course, Track

#: Mean, slope, parabola, cubic.
DRIFT = 4
#: The polynomials of the drift, by the powers of s: orthogonal on a long record.
_POLYNOMIALS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1 / 3, 0.0, 1.0, 0.0], [0.0, -0.6, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Terms(ByValue):
    """What is fitted; each sine is a row of cosines and a row of minus sines.

    Attributes
    ----------
    omega, lines : float, (L,) float [rad/s]
        Fundamental, and interfering lines.
    harmonics : int
        Number of multiples of the fundamental, with the fundamental itself.
    unsteady : tuple of int
        Harmonics whose amplitude may vary over the record as a parabola.
    """

    omega: float
    harmonics: int
    lines: FloatArray
    unsteady: tuple[int, ...]

    @property
    def sines(self) -> FloatArray:
        """Frequencies (S,) of the harmonics and of the lines [rad/s]."""
        return np.concatenate([self.omega * np.arange(1, self.harmonics + 1), self.lines])

    def differences(self) -> FloatArray:
        """The sums and differences of any two frequencies, and of these with zero, but no one twice [rad/s]."""
        multiples = self.omega * np.arange(2 * self.harmonics + 1)
        if not self.lines.size:
            return multiples
        others = np.append(multiples[: self.harmonics + 1], self.lines)
        return np.concatenate([multiples, *(part for line in self.lines for part in (others + line, others - line))])


class TermRows(Protocol):
    """The rows of some terms on a track: sines, parabolas of unsteady harmonics, what follows a speed, then the drift.

    Inner products have these P rows first, then the 2 S rows of the sines times the time u from the middle [s], along
    which a change of frequency acts. The last two are those of the fundamental times u²: its model bends along them.

    Attributes
    ----------
    size : int
        Number P of rows.
    lead : float [s]
        Time of the zero of phase of the rows after that of the track.
    """

    size: int
    lead: float

    def products(self) -> FloatArray:
        """Inner products (P + 2 S + 2, P + 2 S + 2) of the rows."""

    def with_signals(self) -> FloatArray:
        """Inner products (P + 2 S + 2, C) of the rows with the channels."""

    def model(self, coefficients: FloatArray) -> FloatArray:
        """The sum (C, N) of the rows times coefficients (P, C)."""

    def carrier(self) -> ComplexArray:
        """The fundamental as a rotation (N,)."""


def rows_of(track: Track, terms: Terms) -> TermRows:
    """The rows of terms on a track: closed formulas, or a table where a reference gives the phase."""
    return _Uniform(track, terms) if track.course is None else _Table(track, terms, track.course)


class _Layout:
    """Places of the rows among atoms s^p e^{jwu}, each a pair of real rows.

    Attributes
    ----------
    sines : int
        Number S of sines.
    size : int
        Number P of rows.
    seconds : (P + 2 S + 2,) int
        Power of each row's time in seconds; 0 where its time is s.
    frequency, power : (Q,) int
        Frequency of each atom, among the sines and zero; power of s.
    rows : (P + 2 S + 2, 2 Q) float
        The rows as linear combinations of cosines and minus sines of the atoms.
    powers, above, below : (Q, Q) int
        For each pair of atoms the power of their product; the places of the sum and of the difference of their
        frequencies in `Terms.differences`.
    mirrored : (Q, Q) bool
        Whether the difference is the negative of the one there.
    """

    def __init__(self, harmonics: int, lines: int, unsteady: tuple[int, ...]) -> None:
        sines = self.sines = harmonics + lines
        atoms = [(i, 0) for i in range(sines)] + [(h - 1, p) for h in unsteady for p in (1, 2)]
        drift = len(atoms)
        atoms += [(sines, p) for p in range(DRIFT)]
        moving = len(atoms)
        atoms += [(i, 1) for i in range(sines)] + [(0, 2)]
        rows = np.eye(2 * len(atoms))
        for k, h in enumerate(unsteady):
            parabola = 2 * (sines + 2 * k + 1)
            rows[parabola : parabola + 2, 2 * h - 2 : 2 * h] -= np.eye(2) / 3
        rows[2 * drift : 2 * moving : 2, 2 * drift : 2 * moving : 2] = _POLYNOMIALS
        kept = np.r_[: 2 * drift, 2 * drift : 2 * moving : 2, 2 * moving : 2 * len(atoms)]
        self.rows, self.size = rows[kept], len(kept) - 2 * sines - 2
        self.seconds = np.repeat([0, 1, 2], [self.size, 2 * sines, 2])
        self.frequency, self.power = np.array(atoms).T
        self.powers = self.power[:, None] + self.power
        pairs = self.frequency[:, None], self.frequency
        self.above, self.below, self.mirrored = (places[pairs] for places in _places(harmonics, lines))


_layout = lru_cache(maxsize=64)(_Layout)


def _places(harmonics: int, lines: int) -> tuple[IntArray, IntArray, BoolArray]:
    """Places in `Terms.differences` of the sum and of the difference of two frequencies, and whether it is mirrored.

    The frequencies are the harmonics, the lines, and zero.
    """
    count = harmonics + lines + 1
    above, below = np.zeros((2, count, count), dtype=int)
    mirrored = np.zeros((count, count), dtype=bool)
    multiple = np.r_[1 : harmonics + 1, np.zeros(lines, dtype=int), 0]
    still = np.r_[:harmonics, count - 1]  # harmonics and zero
    pairs = np.ix_(still, still)
    above[pairs] = multiple[still][:, None] + multiple[still]
    below[pairs] = np.abs(multiple[still][:, None] - multiple[still])
    mirrored[pairs] = multiple[still][:, None] < multiple[still]
    # With a line there are: zero, the harmonics and the lines, plus the line; the same minus the line.
    others = np.r_[1 : harmonics + 1, harmonics + 1 + np.arange(lines), 0]
    for k in range(lines):
        line, first = harmonics + k, 2 * harmonics + 1 + 2 * k * count
        above[:, line] = above[line] = first + others
        below[:, line] = below[line] = first + count + others
        mirrored[:, line], mirrored[line] = False, True
    return above, below, mirrored


class _Uniform:
    """Rows at uniform times: no table of them is made; missing samples are taken off the closed sums."""

    def __init__(self, track: Track, terms: Terms) -> None:
        self._track, self._terms, self._blocks = track, terms, track.blocks
        self._layout = _layout(terms.harmonics, terms.lines.size, terms.unsteady)
        self._waves = Sines(track.blocks, terms.omega, terms.harmonics, terms.lines)
        self.size, self.lead = self._layout.size, 0.5 * float(track.time[0] + track.time[-1])

    def products(self) -> FloatArray:
        layout, track, omega = self._layout, self._track, self._terms.differences()
        moving = omega != 0.0
        sums = np.zeros((2 * DRIFT - 1, omega.size), dtype=complex)  # only powers of the drift alone reach the sixth
        sums[:-1, moving] = sums_without_samples(omega[moving], track.time.size, track.exact_rate, 2 * DRIFT - 3)
        sums[:, ~moving] = _sums_of_powers(track.time.size)[:, None]
        above, below = sums[layout.powers, layout.above], sums[layout.powers, layout.below]
        below = np.where(layout.mirrored, below.conj(), below)
        made = np.empty((above.shape[0], 2, above.shape[0], 2))
        made[:, 0, :, 0], made[:, 1, :, 1] = below.real + above.real, below.real - above.real
        made[:, 0, :, 1], made[:, 1, :, 0] = below.imag - above.imag, -below.imag - above.imag
        flat = 0.5 * made.reshape(layout.rows.shape[1], -1)
        whole = layout.rows @ flat @ layout.rows.T
        if track.known < track.time.size:
            gone = self._rows_at(~track.present)
            whole -= gone @ gone.T
        units = self._blocks.half**layout.seconds
        return whole * units[:, None] * units

    def with_signals(self) -> FloatArray:
        layout = self._layout
        sums = np.zeros((self._blocks.channels, DRIFT, layout.sines + 1), dtype=complex)
        sums[:, :3, :-1] = self._waves.sums(2)
        sums[:, :, -1] = self._blocks.moments
        flat = np.ascontiguousarray(sums[:, layout.power, layout.frequency]).view(float)
        return (layout.rows @ flat.T) * (self._blocks.half**layout.seconds)[:, None]

    def model(self, coefficients: FloatArray) -> FloatArray:
        layout = self._layout
        flat = np.ascontiguousarray(coefficients.T @ layout.rows[: self.size]).view(complex)
        order = 2 if self._terms.unsteady else 0
        each = np.zeros((flat.shape[0], DRIFT, layout.sines + 1), dtype=complex)
        fitted = layout.frequency.size - layout.sines - 1
        each[:, layout.power[:fitted], layout.frequency[:fitted]] = flat[:, :fitted]
        made = self._waves.wave(each[:, : order + 1, :-1], each[:, :, -1].real)
        return made if self._track.known == self._track.time.size else made * self._track.present

    def carrier(self) -> ComplexArray:
        return self._waves.carrier()

    def _rows_at(self, flags: BoolArray) -> FloatArray:
        """All rows, with s instead of seconds, at the samples that are flagged."""
        place = np.flatnonzero(flags) / (0.5 * (flags.size - 1)) - 1.0
        omega = np.append(self._terms.sines, 0.0)[self._layout.frequency]
        atoms = place ** self._layout.power[:, None] * np.exp(-1j * omega[:, None] * self._blocks.half * place)
        return self._layout.rows @ np.stack([atoms.real, atoms.imag], axis=1).reshape(2 * omega.size, -1)


@lru_cache(maxsize=64)
def _sums_of_powers(count: int) -> FloatArray:
    """Sums (7,) of s^p, for p from 0 to 6."""
    place = np.linspace(-1.0, 1.0, count)
    return np.array([np.sum(place**p) if p % 2 == 0 else 0.0 for p in range(2 * DRIFT - 1)])


class _Table:
    """Rows as a table (P, N): for a track whose phase a reference gives."""

    def __init__(self, track: Track, terms: Terms, course: Course) -> None:
        self._track, self._terms, self._course, self.lead = track, terms, course, 0.0
        self.size = 2 * (terms.sines.size + len(course.follow)) + 4 * len(terms.unsteady) + DRIFT

    @cached_property
    def _rows(self) -> FloatArray:
        """Rows (P, N) of sines, parabolas of unsteady harmonics, what follows the speed, and drift."""
        track, terms = self._track, self._terms
        sines, unsteady = 2 * terms.sines.size, terms.unsteady
        rows = np.empty((self.size, track.time.size))
        rotation, power = self.carrier(), np.ones(track.time.size, dtype=complex)
        for k in range(terms.harmonics):
            power = power * rotation
            rows[2 * k], rows[2 * k + 1] = power.real, -power.imag
        for k, line in enumerate(terms.lines, start=terms.harmonics):
            turning = np.exp(1j * line * track.time)
            rows[2 * k], rows[2 * k + 1] = turning.real, -turning.imag
        place = track.time / max(abs(track.time[0]), abs(track.time[-1]))
        for i, harmonic in enumerate(unsteady):
            pair = rows[2 * harmonic - 2 : 2 * harmonic]
            start = sines + 4 * i
            rows[start : start + 2], rows[start + 2 : start + 4] = pair * place, pair * (place**2 - 1.0 / 3.0)
        turned = self._course.follow * rotation
        rows[sines + 4 * len(unsteady) : -DRIFT : 2] = turned.real
        rows[sines + 4 * len(unsteady) + 1 : -DRIFT : 2] = -turned.imag
        rows[-DRIFT:] = _POLYNOMIALS @ place ** np.arange(DRIFT)[:, None]
        rows[:, ~track.present] = 0.0
        return rows

    @cached_property
    def _whole(self) -> FloatArray:
        """The rows, then the sines times time and the fundamental times its square."""
        sines, time = 2 * self._terms.sines.size, self._track.time
        return np.concatenate([self._rows, self._rows[:sines] * time, self._rows[:2] * time**2])

    def products(self) -> FloatArray:
        return self._whole @ self._whole.T

    def with_signals(self) -> FloatArray:
        return self._whole @ self._track.signals.T

    def model(self, coefficients: FloatArray) -> FloatArray:
        return coefficients.T @ self._rows

    def carrier(self) -> ComplexArray:
        return np.asarray(np.exp(1j * (self._terms.omega * self._track.time + self._course.turn)))
