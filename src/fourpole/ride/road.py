"""Roads: the classes of ISO 8608, measured profiles, a cleat, a pothole and a sine sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError

#: Letters of the classes of ISO 8608, from smooth to rough.
CLASSES = "ABCDEFGH"
#: Reference spatial frequency of ISO 8608, and the range of its classes [1/m].
REFERENCE, RANGE = 0.1, (0.011, 2.83)
#: Displacement spectrum of class A at the reference [m³]; each further class has four times as much.
_OF_A = 16e-6
#: Highest speed [m/s], and largest rise of a road from its first point [m].
_FASTEST, _HIGHEST = 500.0, 1e4
#: Largest number of samples of a road.
MOST_SAMPLES = 5_000_000
#: A distance between two points above this multiple of the median one is a gap: of points that are mostly evenly
#: spaced, as most of them within a share of the median, and of others.
_GAP_EVEN, _GAP, _MOSTLY, _EVEN = 1.5, 3.0, 0.9, 0.02
#: Least number of samples per cycle of a sweep: straight lines lose 0.8 % of its amplitude then.
_PER_CYCLE = 20.0
#: Samples before and after a road that are fitted with it; a fit forgets its ends by a factor of 0.27 per sample.
_MARGIN = 30


@dataclass(frozen=True)
class ClassRoad:
    r"""A road whose height has a power spectrum of ISO 8608: :math:`G_d(n) = G_d(n_0) (n/n_0)^{-w}`.

    Attributes
    ----------
    level : float [m³]
        One-sided displacement spectrum at n_0 = 0.1 cycles/m, > 0.
    waviness : float [1]
        Exponent w; 2 in the classes of the standard.
    low, high : float [1/m]
        Spatial frequencies between which the road has any height.

    References
    ----------
    ISO 8608:2016: the geometric mean of class A is 16e-6 m³, of each further class four times as much.

    Examples
    --------
    >>> ClassRoad.of("C").level
    0.000256
    """

    level: float
    waviness: float = 2.0
    low: float = RANGE[0]
    high: float = RANGE[1]

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        if not (self.level > 0 and np.isfinite(self.level)):
            raise ModelError(f"a road of {self.level:g} m³ at 0.1 cycles/m is none: state a positive level")
        if not 0 < self.low < self.high < np.inf:
            raise ModelError(f"{self.low:g} to {self.high:g} cycles/m is no range of spatial frequencies: let it rise")

    @classmethod
    def of(cls, letter: str) -> ClassRoad:
        """The road of a class, A to H, at its geometric mean; ModelError for another letter."""
        at = CLASSES.find(letter.strip().upper())
        if at < 0 or len(letter.strip()) != 1:
            raise ModelError(f"no road class {letter!r}: choose one of {', '.join(CLASSES)}")
        return cls(_OF_A * 4.0**at)

    def spectrum(self, spatial: ArrayLike) -> FloatArray:
        """One-sided spectrum of the height (...,) [m³] at spatial frequencies (...,) [1/m]."""
        n = np.asarray(spatial, dtype=float)
        inside = (n >= self.low * (1 - 1e-12)) & (n <= self.high * (1 + 1e-12))
        return np.where(inside, self.level * (np.where(inside, n, 1.0) / REFERENCE) ** -self.waviness, 0.0)

    def band(self, speed: float) -> tuple[float, float]:
        """Lowest and highest frequency [Hz] at a speed [m/s]."""
        return self.low * speed, self.high * speed

    def spectrum_in_time(self, frequency: ArrayLike, speed: float) -> FloatArray:
        """One-sided spectrum of the height (...,) [m²/Hz] at frequencies (...,) [Hz] and a speed [m/s]."""
        return self.spectrum(np.asarray(frequency, dtype=float) / speed) / speed

    def realisation(self, duration: float, step: float, speed: float, seed: int) -> FloatArray:
        """Height (N,) [m] over time: a sum of sines of random phases, periodic in the duration.

        Each sine at a multiple of 1/duration has the mean square of the spectrum over this line, so that the
        periodogram over the duration is the spectrum. The phases are those of the seed.

        Parameters
        ----------
        duration, step : float [s]
            N = duration/step samples; the sines end below half the sampling rate.
        speed : float [m/s]
        seed : int

        Raises
        ------
        ModelError
            If the speed, the duration, the step or the seed is not possible.

        Examples
        --------
        >>> road = ClassRoad.of("C")
        >>> height = road.realisation(60.0, 1e-3, 20.0, seed=1)
        >>> line = 2 * np.abs(np.fft.rfft(height)[600] / height.size) ** 2 * 60.0  # at 10 Hz
        >>> np.allclose(line, road.spectrum_in_time(10.0, 20.0))
        True
        """
        check_speed(speed)
        if seed < 0:
            raise ModelError(f"the seed {seed} is negative: state zero or a positive whole number")
        count = samples(duration, step)
        frequency = np.fft.rfftfreq(count, step)
        amplitude = np.sqrt(2.0 * self.spectrum_in_time(frequency, speed) / (count * step))
        if count % 2 == 0:
            amplitude[-1] = 0.0
        phase = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, frequency.size)
        return np.asarray(np.fft.irfft(0.5 * count * amplitude * np.exp(1j * phase), count))


@dataclass(frozen=True, eq=False)
class Profile(ByValue):
    """A road by its heights over the distance, straight between its points and level before and after.

    Attributes
    ----------
    distance, height : (N,) float arrays [m]
        At least two points, rising in distance, without gaps.
    name : str
        The road in messages.

    Raises
    ------
    ModelError
        If the road has a gap, goes back, or has a value that is no number.

    Examples
    --------
    >>> Profile(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.01, 0.0])).at([0.5, 5.0]).tolist()
    [0.005, 0.000]
    """

    distance: FloatArray
    height: FloatArray
    name: str = "the road"

    def __post_init__(self) -> None:
        """Refuse gaps and impossible values."""
        x, z = self.distance, self.height
        if x.ndim != 1 or x.shape != z.shape or x.size < 2:
            raise ModelError(
                f"{self.name}: {x.size} distances and {z.size} heights are no profile: at least two of each"
            )
        bad = np.flatnonzero(~(np.isfinite(x) & np.isfinite(z)))
        if bad.size:
            at = int(bad[0])
            where = f"at {x[at]:.6g} m" if np.isfinite(x[at]) else f"in row {at + 1}"
            raise ModelError(
                f"{self.name}: {where} there is no number ({bad.size} such points): a ride needs a road without gaps; "
                "fill it from a second measurement, or cut the road there"
            )
        rise = np.abs(z - z[0])
        if rise.max() > _HIGHEST:
            at = int(np.argmax(rise))
            raise ModelError(
                f"{self.name}: the height {z[at]:.6g} m at {x[at]:.6g} m is none of a road: check its unit"
            )
        steps = np.diff(x)
        if not np.all(steps > 0):
            at = int(np.flatnonzero(steps <= 0)[0])
            raise ModelError(
                f"{self.name}: the distance does not rise after {x[at]:.6g} m, point {at + 1}: sort the rows, "
                "and leave one of those at the same distance"
            )
        usual = float(np.median(steps))
        even = float(np.mean(np.abs(steps - usual) <= _EVEN * usual)) > _MOSTLY
        if steps.max() > (_GAP_EVEN if even else _GAP) * usual * (1 + 1e-6):
            at = int(np.argmax(steps))
            raise ModelError(
                f"{self.name}: has a gap from {x[at]:.6g} to {x[at + 1]:.6g} m, its points are {usual:.3g} m apart: "
                "fill it from a second measurement, or cut the road there"
            )

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.distance[-1] - self.distance[0])

    def at(self, distance: ArrayLike) -> FloatArray:
        """Height (...,) [m] at distances (...,) [m] from the first point; level beyond the ends."""
        return np.interp(np.asarray(distance, dtype=float), self.distance - self.distance[0], self.height)

    @property
    def spacing(self) -> float:
        """Usual distance between two points [m]: the median."""
        return float(np.median(np.diff(self.distance)))

    def in_time(self, speed: float, step: float, after: float = 0.0, late: float = 0.0) -> FloatArray:
        """Height (N,) [m] over time: of the straight lines between samples that are nearest to the road.

        Nearest in the mean square, so that what is shorter than a step keeps its area, wherever the samples are.

        Parameters
        ----------
        speed : float [m/s]
        step : float [s]
        after : float [s]
            Time that goes on after the last point.
        late : float [s]
            Time at which the axle meets the first point.

        Raises
        ------
        ModelError
            If the speed, the step or the number of samples is not possible.

        Examples
        --------
        >>> short = Profile(np.array([0.0, 1.0, 1.001, 1.002, 2.0]), np.array([0.0, 0.0, 0.01, 0.0, 0.0]), "short")
        >>> round(float(np.sum(short.in_time(10.0, 1e-3)) * 1e-3 * 10.0), 9)  # area [m²]
        1.000e-05
        """
        check_speed(speed)
        count = samples(self.length / speed + after + step, step)
        first = self.height[0]
        return first + _nearest_lines(
            (self.distance - self.distance[0]) / speed + late, self.height - first, step, count
        )


def _nearest_lines(time: FloatArray, height: FloatArray, step: float, count: int) -> FloatArray:
    """Samples (count,) from time 0 on of the straight lines nearest in the mean square to those through (time, height).

    Normal equations of hat functions, one for each sample; a product of two straight lines is summed exactly.
    """
    grid = step * np.arange(-_MARGIN, count + _MARGIN)
    ends = np.union1d(grid, time[(time > grid[0]) & (time < grid[-1])])
    z, width = np.interp(ends, time, height), np.diff(ends)
    at = np.clip(np.searchsorted(grid, 0.5 * (ends[1:] + ends[:-1])) - 1, 0, grid.size - 2)
    start, end = (ends[:-1] - grid[at]) / step, (ends[1:] - grid[at]) / step
    whole = 0.5 * width * (z[1:] + z[:-1])
    upper = width * (start * (2 * z[:-1] + z[1:]) + end * (z[:-1] + 2 * z[1:])) / 6
    right = np.bincount(at, whole - upper, grid.size) + np.bincount(at + 1, upper, grid.size)
    bands = np.full((2, grid.size), step / 6)
    bands[1] = 4 * step / 6
    bands[1, [0, -1]] = 2 * step / 6
    return np.asarray(scipy.linalg.solveh_banded(bands, right)[_MARGIN:-_MARGIN])


def cleat(height: float, length: float, *, before: float = 1.0) -> Profile:
    """A bar across the road: a level top of a height and length [m], whose edges rise over a tenth of the length.

    Examples
    --------
    >>> cleat(0.01, 0.05).at([0.5, 1.025, 2.0]).tolist()
    [0.000, 0.010, 0.000]
    """
    if not (length > 0 and np.isfinite(height) and height != 0):
        raise ModelError(f"a cleat of {height:g} m height and {length:g} m length is none: state both, not zero")
    edge = 0.1 * length
    spacing = 0.5 * edge
    x = np.arange(0.0, 2 * before + length + 0.5 * spacing, spacing)
    return Profile(x, np.interp(x, before + np.array([0.0, edge, length - edge, length]), [0.0, height, height, 0.0]))


def pothole(depth: float, length: float, *, before: float = 1.0) -> Profile:
    """A hole of a depth and length [m]: a cleat that goes down."""
    if not depth > 0:
        raise ModelError(f"a pothole of {depth:g} m depth is none: state a positive depth")
    return cleat(-depth, length, before=before)


def sine_sweep(amplitude: float, low: float, high: float, duration: float, step: float) -> FloatArray:
    """Height (N,) [m] over time of a sine of an amplitude [m] whose frequency rises evenly in octaves from low to high.

    Examples
    --------
    >>> sine_sweep(1e-3, 1.0, 20.0, 10.0, 1e-3).shape
    (10000,)
    """
    if not (0 < amplitude <= _HIGHEST and 0 < low < high):
        raise ModelError(f"a sweep of {amplitude:g} m from {low:g} to {high:g} Hz is none: let the frequencies rise")
    if high * step * _PER_CYCLE > 1 + 1e-9:
        raise ModelError(
            f"a step of {step:g} s is too long for a sweep up to {high:g} Hz: state at most "
            f"{1 / high / _PER_CYCLE:.3g} s"
        )
    time = step * np.arange(samples(duration, step))
    rate = np.log(high / low) / duration
    return np.asarray(amplitude * np.sin(2 * np.pi * low * np.expm1(rate * time) / rate))


def check_speed(speed: float) -> None:
    """ModelError unless a speed [m/s] is positive and that of a vehicle."""
    if not speed > 0:
        raise ModelError(f"the speed {speed:g} m/s is not positive: a vehicle that stands has no ride")
    if not speed <= _FASTEST:
        raise ModelError(f"the speed {speed:g} m/s is above {_FASTEST:g} m/s, that of no vehicle: check its unit")


def samples(duration: float, step: float) -> int:
    """Number of samples of a duration at a step [s]; ModelError if it is not possible."""
    if not (step > 0 and duration > 0 and np.isfinite(duration)):
        raise ModelError(f"a duration of {duration:g} s at a step of {step:g} s is none: both are positive")
    count = round(duration / step)
    if not 2 <= count <= MOST_SAMPLES:
        raise ModelError(f"{duration:g} s at a step of {step:g} s are {count} samples: 2 to {MOST_SAMPLES} are taken")
    return count
