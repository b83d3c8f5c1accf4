"""Groups of tests with one K*, and the change of K* from the mean frequency of a group to that of a test."""

from __future__ import annotations

from copy import copy

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.routes import maxwell_arm

#: Largest ratio of successive frequencies in one condition, and of its highest to its lowest frequency: the tolerance
#: of `core.condition.SAME_FREQUENCY`, with room for the scatter of the speed.
_STEP, _WIDTH = 1.0105, 1.0161
#: Largest ratio of equal nominal frequencies, which allows for rounding in tests.csv.
_SAME = 1.0005
#: Logarithm of the ratio of two frequencies that differ by round-off alone.
_ROUND_OFF = 1e-12
#: If K* is closer to K1 than this share of |K*|, the arm is too soft to interpolate K2 and C.
_SOFT_ARM = 1e-3


def group_conditions(
    family: np.ndarray, frequency: FloatArray, nominal: FloatArray | None = None, recording: np.ndarray | None = None
) -> np.ndarray:
    """Number the conditions: tests of a family at the same nominal frequency, or within about 1 % of each other.

    Only nominal frequencies distinguish a sweep in finer steps from repeats. Two lines of one recording are never
    repeats: the one above begins another condition.

    Parameters
    ----------
    family : (N,) int array
        Number of the condition without its frequency; negative for tests without a tyre.
    frequency : (N,) float array [Hz]
        Frequency as found.
    nominal : (N,) float array, optional [Hz]
        Frequency as stated, or not-a-number. It is used in families for which it is stated for all tests.
    recording : (N,) int array, optional
        Number of the recording of which each test is a line; by default each test has its own.

    Returns
    -------
    (N,) int array
        Numbers from 0, in the order of family and frequency; -1 for tests without a tyre.

    Examples
    --------
    >>> group_conditions(np.array([0, 0, 0, 1, -1]), np.array([10.0, 12.0, 10.05, 10.0, 10.0])).tolist()
    [0, 1, 0, 2, -1]
    >>> group_conditions(np.zeros(3, int), np.array([100.0, 101.0, 100.5]), recording=np.array([0, 0, 1])).tolist()
    [0, 1, 0]
    """
    own = np.arange(family.size) if recording is None else recording
    nominal = np.full(family.size, np.nan) if nominal is None else nominal
    named = ~np.isin(family, np.unique(family[~np.isfinite(nominal)]))
    places = np.where(named, nominal, frequency)
    order = np.lexsort((frequency, places, family))
    labels = np.full(family.size, -1)
    current, first, last, label = -1, 0.0, 0.0, -1
    present: set[int] = set()
    for index in order:
        if family[index] < 0:
            continue
        f = float(places[index])
        step, width = (_SAME, _SAME) if named[index] else (_STEP, _WIDTH)
        if family[index] != current or f > step * last or f > width * first or int(own[index]) in present:
            label, first, current = label + 1, f, family[index]
            present.clear()
        last = f
        present.add(int(own[index]))
        labels[index] = label
    return labels


class JointConditions:
    """Conditions of tests that are sorted by condition; tests without a tyre come first.

    Parameters
    ----------
    label : (N,) int array
        Condition of each test, in rising order; -1 for none.
    family : (N,) int array
        Number of the condition of each test without its frequency.
    frequency, k1 : (N,) float arrays [Hz], [N/m]
        Frequency and static stiffness of each test; K1 is not-a-number if unknown.
    """

    def __init__(self, label: np.ndarray, family: np.ndarray, frequency: FloatArray, k1: FloatArray) -> None:
        self.label = label
        self.first = int(np.searchsorted(label, 0))
        self.count = int(label[-1]) + 1 if label.size > self.first else 0
        self.starts = np.searchsorted(label, np.arange(self.count))
        self.sizes = np.bincount(label[self.first :], minlength=self.count)
        self.mean_frequency = self.mean(frequency)
        self.k1 = self.mean(k1)
        self.family = family[self.starts] if self.count else np.zeros(0, dtype=int)
        self._omega = 2 * np.pi * frequency
        here = slice(self.first, None)
        self._apart = np.log(frequency[here] / self.mean_frequency[label[here]]) if self.count else np.zeros(0)
        self.is_apart = bool(np.any(np.abs(self._apart) > _ROUND_OFF))  # whether a test is off its mean frequency
        number, same = np.arange(self.count), self.family[1:] == self.family[:-1]
        self._below = np.where(np.append(False, same)[: self.count], number - 1, number)
        self._above = np.where(np.append(same, False)[: self.count], number + 1, number)
        span = np.log(self.mean_frequency[self._above] / self.mean_frequency[self._below])
        self._span = np.where(span > 0, span, 1.0)

    def without_k1(self) -> JointConditions:
        """The same conditions with K1 unknown, so that K* itself is interpolated over frequency."""
        other = copy(self)
        other.k1 = np.full(self.count, np.nan)
        return other

    def sum(self, values: np.ndarray) -> np.ndarray:
        """Sum over the tests of each condition, along the first axis."""
        if not self.count:
            return np.zeros((0, *values.shape[1:]), dtype=values.dtype)
        return np.add.reduceat(values, self.starts, axis=0)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Mean over the tests of each condition, along the first axis."""
        return self.sum(values) / self.sizes.reshape(-1, *[1] * (values.ndim - 1))

    def carried(self, stiffness: ComplexArray) -> ComplexArray:
        r"""K* of each test over K* of its condition, which is at the mean frequency.

        If K1 is known, 1/K2 and 1/C are interpolated over the neighbouring frequencies, because they stay finite where
        K2 or C do not. They are interpolated as powers of frequency, or linearly in its logarithm if they are not all
        positive. If K1 is unknown, K* is interpolated as a power of frequency.

        Parameters
        ----------
        stiffness : (count,) complex array [N/m]
            K* of each condition at its mean frequency.

        Returns
        -------
        (N,) complex array [1]
            1 for tests without a tyre.
        """
        ratio = np.ones(self.label.size, dtype=complex)
        if not self.count:
            return ratio
        here = slice(self.first, None)
        label, omega = self.label[here], self._omega[here]
        ratio[here] = np.exp(self._slopes(np.log(stiffness))[label] * self._apart)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            k2, c = maxwell_arm(stiffness, self.k1, 2 * np.pi * self.mean_frequency)
            compliance = self._moved(1 / k2) + self._moved(1 / c) / (1j * omega)
            by_arm = (self.k1[label] + 1 / compliance) / stiffness[label]
            fit = np.abs(stiffness - self.k1) > _SOFT_ARM * np.abs(stiffness)
        use = fit[label] & np.isfinite(by_arm) & (np.abs(by_arm - ratio[here]) < 0.1)
        ratio[here] = np.where(use, by_arm, ratio[here])
        return ratio

    def lead(self, slope: FloatArray, rows: slice, group: slice) -> FloatArray:
        """Derivative of log `carried` by the shared values, through K* of the neighbouring conditions.

        Parameters
        ----------
        slope : (count, 2, p) float array
            Fall of Re and Im of log K* of each condition per unit of the shared values.
        rows, group : slice
            Some tests with a tyre, which are all tests of some conditions.

        Returns
        -------
        (n, 2, p) float array
            0 for tests at the mean frequency of their condition.
        """
        apart = self._apart[rows.start - self.first : rows.stop - self.first]
        return -self._slopes(slope, group)[self.label[rows] - group.start] * apart[:, None, None]

    def off_curve(self, values: FloatArray) -> FloatArray:
        """Values (N,) less the curve through the medians of the neighbouring conditions; 0 for tests without a tyre."""
        off = np.zeros(values.size)
        if self.count:
            here, label = slice(self.first, None), self.label[self.first :]
            ranked = values[here][np.lexsort((values[here], label))]
            first = self.starts - self.first
            usual = 0.5 * (ranked[first + (self.sizes - 1) // 2] + ranked[first + self.sizes // 2])
            off[here] = values[here] - usual[label] - self._slopes(usual)[label] * self._apart
        return off

    def _moved(self, values: FloatArray) -> FloatArray:
        """Real values (c,) of the conditions, interpolated at the frequency of each test."""
        label = self.label[self.first :]
        power = values[label] * np.exp(self._slopes(np.log(values))[label] * self._apart)
        return np.where(np.isfinite(power), power, values[label] + self._slopes(values)[label] * self._apart)

    def _slopes(self, values: np.ndarray, group: slice = slice(None)) -> np.ndarray:
        """Slopes of the values of some conditions by log frequency, over their neighbours in the family; 0 without."""
        span = self._span[group].reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((values[self._above[group]] - values[self._below[group]]) / span)
