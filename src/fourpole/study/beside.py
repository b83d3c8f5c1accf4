"""The mean of several sensors on one rigid part, chunk by chunk, and how far each departs from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import TableError
from fourpole.io.signals import Signal
from fourpole.units import shown


class MeanOfSensors:
    """The mean of sensors on one part: its translation, where they stand evenly round its centre of gravity."""

    def __init__(self, sensors: int) -> None:
        self.sensors = sensors
        self._count, self._of_mean = 0, np.zeros(2)  # the sums of the mean m and of m²
        self._sums = np.zeros((sensors, 2))  # of each sensor the sums of its departure d from m, and of d m

    def feed(self, signals: Sequence[Signal]) -> Signal:
        """The mean of the next chunk of all sensors; TableError if these differ in their unit or their times."""
        first = signals[0]
        for other in signals[1:]:
            times = (other.samples.size, other.start, other.rate) != (first.samples.size, first.start, first.rate)
            if other.unit != first.unit or times:
                raise TableError(
                    f"{shown(other.name)} has another unit, or other times, than {shown(first.name)} beside it: leave "
                    "it out, or convert it"
                )
        samples = np.stack([signal.samples for signal in signals])
        mean = samples.mean(axis=0)
        self._add(samples[:, np.isfinite(mean)], mean[np.isfinite(mean)])
        return replace(first, samples=mean)

    def _add(self, samples: FloatArray, mean: FloatArray) -> None:
        apart = samples - mean
        self._count += mean.size
        self._of_mean += mean.sum(), mean @ mean
        self._sums += np.stack([apart.sum(axis=1), apart @ mean], axis=1)

    @property
    def tilt(self) -> float:
        """Largest departure of a sensor from the mean that moves with it, over the mean [1]."""
        total, square = self._of_mean
        variance = square - total**2 / max(self._count, 1)
        if not variance > 0:
            return 0.0
        shares = (self._sums[:, 1] - self._sums[:, 0] * total / self._count) / variance
        return float(np.abs(shares).max())
