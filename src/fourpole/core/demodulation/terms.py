"""The terms of a fit of sines: their inner products with one another and with the samples of a track."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from fourpole.core import kernel
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.demodulation.sums import Sines, sums_without_samples
from fourpole.core.demodulation.tracks import Course, Track

#: Mean, slope, parabola, cubic.
DRIFT = 4
#: The polynomials of the drift, by the powers of s: orthogonal on a long record.
_POLYNOMIALS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1 / 3, 0.0, 1.0, 0.0], [0.0, -0.6, 0.0, 1.0]])
#: Plus and minus a line.
_BOTH = np.array([[1.0], [-1.0]])


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
        others = np.concatenate([multiples[: self.harmonics + 1], self.lines])
        return np.concatenate([multiples, (others + self.lines[:, None, None] * _BOTH).reshape(-1)])


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

    def fitted(self, **how: Any) -> tuple[float, FloatArray, list[Any], float] | None:
        """What `kernel.fit` gives; None if numpy must fit."""

    def model(self, coefficients: FloatArray) -> FloatArray:
        """The sum (C, N) of the rows times coefficients (P, C)."""

    def quarters(self, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Inner products of the fundamental's two rows in the quarters of a record, with themselves and a residual.

        They are (4, 2, 2) and (4, 2, C).
        """

    def beside(self, residual: FloatArray, harmonics: int, offset: float, reach: int) -> ComplexArray:
        """Sums (C, harmonics, 2 J + 1) of a residual times the turns beside harmonics; see `Sines.beside`."""


def rows_of(track: Track, terms: Terms) -> TermRows:
    """The rows of terms on a track: closed formulas, or a table where a reference gives the phase."""
    return _Uniform(track, terms) if track.course is None else _Table(track, terms, track.course)


def _quarters(track: Track) -> IntArray:
    """First sample of each quarter of a record, and the number of samples."""
    return np.linspace(0, track.time.size, 5).astype(int)


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
    atoms : (Q,) int
        Place of each atom among all powers of all frequencies.
    kept : (P + 2 S + 2,) int
        The cosines and minus sines of atoms, in turn, of which the rows are made: all but the sines of zero.
    rows : (P + 2 S + 2, P + 2 S + 2) float
        The rows as linear combinations of these.
    below, above : (P + 2 S + 2, P + 2 S + 2) int
        For each pair of these the places of the sums over the difference and over the sum of their frequencies, of the
        power of their product: power times the number of `Terms.differences`, plus the place of the frequency there.
    of_below, of_above : (P + 2 S + 2, P + 2 S + 2) float
        Their shares in the inner product. Even powers have sums of cosines, odd ones sums of sines.
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
        kept = self.kept = np.r_[: 2 * drift, 2 * drift : 2 * moving : 2, 2 * moving : 2 * len(atoms)]
        self.rows, self.size = rows[np.ix_(kept, kept)], kept.size - 2 * sines - 2
        self.seconds = np.repeat([0, 1, 2], [self.size, 2 * sines, 2])
        self.frequency, self.power = np.array(atoms).T
        self.atoms = self.power * (sines + 1) + self.frequency
        pairs = self.frequency[kept // 2][:, None], self.frequency[kept // 2]
        above, below, mirrored = (places[pairs] for places in _places(harmonics, lines))
        powers, sine = self.power[kept // 2], kept % 2
        powers = powers[:, None] + powers
        self.below, self.above = (places + powers * (1 + max(above.max(), below.max())) for places in (below, above))
        # 2 cos a cos b = cos(a - b) + cos(a + b), and so on, with minus sines: those of both kinds have odd powers.
        alike = powers % 2 == 0
        first, second = sine[:, None] > sine, sine[:, None] < sine
        self.of_below = 0.5 * np.where(alike, sine[:, None] == sine, (second * 1.0 - first) * np.where(mirrored, -1, 1))
        self.of_above = 0.5 * np.where(alike, (sine[:, None] == sine) * (1.0 - 2.0 * sine), -1.0 * (first | second))

    @cached_property
    def handed(self) -> kernel.Layout:
        """The layout as the library in C takes it."""
        places = self.seconds, self.frequency, self.power, self.kept, self.below, self.above
        return kernel.Layout(len(self.rows), self.size, self.sines, *places, self.rows, self.of_below, self.of_above)


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
        layout = self._layout = _layout(terms.harmonics, terms.lines.size, terms.unsteady)
        self.size, self.lead = layout.size, 0.5 * float(track.time[0] + track.time[-1])

    @cached_property
    def _rows(self) -> FloatArray:
        """The rows as combinations of atoms, with times in seconds."""
        return np.asarray(self._layout.rows * (self._blocks.grid.half**self._layout.seconds)[:, None])

    @cached_property
    def waves(self) -> Sines:
        """The sines on the blocks of the samples."""
        return Sines(self._blocks.grid, self._terms.omega, self._terms.harmonics, self._terms.lines)

    def products(self) -> FloatArray:
        layout, track = self._layout, self._track
        sums = sums_without_samples(self._terms.differences(), track.time.size, track.exact_rate, 2 * DRIFT - 2)
        flat = layout.of_below * sums.take(layout.below) + layout.of_above * sums.take(layout.above)
        whole = self._rows @ flat @ self._rows.T
        if track.known < track.time.size:
            gone = self._rows_at(~track.present)
            whole -= gone @ gone.T
        return np.asarray(whole)

    def with_signals(self) -> FloatArray:
        layout, terms = self._layout, self._terms
        sums = np.empty((len(self._track.signals), DRIFT, layout.sines + 1), dtype=complex)
        sums[:, :-1, :-1] = self._blocks.sums(terms.omega, terms.harmonics, terms.lines)
        sums[:, :, -1] = self._blocks.drift
        flat = sums.reshape(len(sums), -1).take(layout.atoms, axis=1).view(float)
        return self._rows @ flat[:, layout.kept].T

    def fitted(self, **how: Any) -> tuple[float, FloatArray, list[Any], float] | None:
        track = self._track
        whole = track.known == track.time.size
        return kernel.fit(self._layout.handed, self._blocks, self._terms, track.energy, **how) if whole else None

    def model(self, coefficients: FloatArray) -> FloatArray:
        layout, terms = self._layout, self._terms
        flat = np.zeros((coefficients.shape[1], 2 * layout.frequency.size))
        flat[:, layout.kept[: self.size]] = coefficients.T @ layout.rows[: self.size, : self.size]
        each = np.zeros((len(flat), DRIFT, layout.sines + 1), dtype=complex)
        fitted = layout.frequency.size - layout.sines - 1
        each.reshape(len(each), -1)[:, layout.atoms[:fitted]] = flat.view(complex)[:, :fitted]
        made = self.waves.wave(each[:, : 3 if terms.unsteady else 1, :-1], each[:, :, -1].real)
        return made if self._track.known == self._track.time.size else made * self._track.present

    def quarters(self, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        track, edges, turn = self._track, _quarters(self._track), self._terms.omega / self._track.exact_rate
        counts, middles = np.diff(edges).astype(float), edges[1:] + edges[:-1] - track.time.size
        double = np.exp(1j * turn * middles) * (np.sin(turn * counts) / np.sin(turn))  # sums of the square of the turn
        if track.known < track.time.size:
            gone = np.flatnonzero(~track.present)
            quarter = np.searchsorted(edges, gone, "right") - 1
            counts -= np.bincount(quarter, minlength=4)
            np.subtract.at(double, quarter, np.exp(1j * turn * (2 * gone + 1 - track.time.size)))
        normal = [[counts + double.real, -double.imag], [-double.imag, counts - double.real]]
        sums = self.waves.between(self._blocks.grid.split(residual), edges)
        return 0.5 * np.transpose(normal, (2, 0, 1)), np.stack([sums.real, sums.imag]).transpose(2, 0, 1)

    def beside(self, residual: FloatArray, harmonics: int, offset: float, reach: int) -> ComplexArray:
        omega = self._terms.omega * np.arange(1, harmonics + 1)[:, None] + offset * np.arange(-reach, reach + 1)
        sums = self.waves.beside(self._blocks.grid.split(residual), harmonics, offset, reach)
        return np.asarray(sums * np.exp(-1j * self.lead * omega))

    def _rows_at(self, flags: BoolArray) -> FloatArray:
        """All rows at the samples that are flagged."""
        place = np.flatnonzero(flags) / (0.5 * (flags.size - 1)) - 1.0
        omega = np.append(self._terms.sines, 0.0)[self._layout.frequency]
        atoms = place ** self._layout.power[:, None] * np.exp(-1j * omega[:, None] * self._blocks.grid.half * place)
        return self._rows @ np.stack([atoms.real, atoms.imag], axis=1).reshape(2 * omega.size, -1)[self._layout.kept]


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
        rotation = np.exp(1j * (terms.omega * track.time + self._course.turn))
        power = np.ones(track.time.size, dtype=complex)
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

    def fitted(self, **how: Any) -> None:
        """None: the library in C has no tables."""

    def model(self, coefficients: FloatArray) -> FloatArray:
        return coefficients.T @ self._rows

    def quarters(self, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        parts = [(self._rows[:2, low:high], residual[:, low:high]) for low, high in pairwise(_quarters(self._track))]
        return np.stack([rows @ rows.T for rows, _ in parts]), np.stack([rows @ left.T for rows, left in parts])

    def beside(self, residual: FloatArray, harmonics: int, offset: float, reach: int) -> ComplexArray:
        time, steps = self._track.time, np.arange(-reach, reach + 1)
        steady = self._terms.omega * np.arange(1, harmonics + 1)[:, None] * time + self._course.turn
        sums = np.fft.fft(residual[:, None] * np.exp(-1j * steady), axis=-1)[..., steps]
        return np.asarray(sums * np.exp(-1j * offset * steps * time[0]))
