"""The calibrated response of a sensor from a table: frequency, gain and phase with their standard uncertainties.

Several sensors on one rigid part have their mean, chunk by chunk, and how far each departs from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fourpole import units
from fourpole.core.arrays import FloatArray
from fourpole.core.chain import Calibrated
from fourpole.errors import TableError, UnitError
from fourpole.io.signals import Signal
from fourpole.units import shown

if TYPE_CHECKING:
    from fourpole.io.text import TextTable


#: Kind of quantity of each column.
_COLUMNS = {"frequency": "frequency", "gain": "ratio", "phase": "angle", "u(gain)": "ratio", "u(phase)": "angle"}
_MOST_BYTES = 4_000_000


def read_response(path: Path, label: str) -> Calibrated:
    """Read the response of a sensor, recorded over true, from a table of text.

    Parameters
    ----------
    path : Path
        A table with the columns frequency [Hz], gain [1] and phase [deg], and perhaps u(gain) [%] and u(phase) [deg].
        The gain is relative to the stated sensitivity or unit of the channel. The phase is positive where the
        recorded signal leads the true quantity.
    label : str
        Name of the file in messages.

    Raises
    ------
    FileError, TableError
        If the table cannot be read, or a column is missing or has no unit of its kind.
    """
    from fourpole.io.text import read_table  # with the layouts of text, which few campaigns have a table in

    table = read_table(path, max_bytes=_MOST_BYTES, label=label)
    columns = {name: _column(table, name, kind, label) for name, kind in _COLUMNS.items() if _place(table, name)}
    for name in ("frequency", "gain", "phase"):
        if name not in columns:
            raise TableError(
                f"{label}: column '{name}' is missing: a response has frequency [Hz], gain [1], phase [deg], "
                "and perhaps u(gain) [%], u(phase) [deg]"
            )
    for name in table.names:
        near = units.nearest(name.strip().casefold(), _COLUMNS, 0.6)
        if name.strip().casefold() not in _COLUMNS and (near or name.strip().casefold().startswith("u(")):
            raise TableError(f"{label}: column {units.shown(name)} is not known; did you mean '{near or 'u(gain)'}'?")
    for name in ("u(gain)", "u(phase)"):
        if name in columns and np.any(columns[name] < 0):
            raise TableError(f"{label}: column '{name}' has a negative uncertainty: state it zero or positive")
    nothing = np.zeros_like(columns["frequency"])
    return Calibrated(
        frequency=columns["frequency"],
        gain=columns["gain"],
        phase=np.unwrap(columns["phase"]),
        gain_std=columns.get("u(gain)", nothing),
        phase_std=columns.get("u(phase)", nothing),
        name=f"response {label}",
    )


def _place(table: TextTable, name: str) -> str:
    """Name of the column as written; empty where the table has no such column."""
    return next((head for head in table.names if head.strip().casefold() == name), "")


def _column(table: TextTable, name: str, kind: str, label: str) -> FloatArray:
    written = _place(table, name)
    unit = table.unit(written) or ("1" if kind == "ratio" else None)
    if unit is None:
        raise TableError(f"{label}: column '{name}' has no unit: write '{name} [{units.si_unit(kind)}]'")
    values = table.column(written)
    if np.isnan(values).any():
        row = table.lines[int(np.argmax(np.isnan(values)))]
        raise TableError(f"{label} row {row}: column '{name}' has no number: fill it in, or remove the row")
    try:
        return units.to_si(values, unit, kind)
    except UnitError as error:
        raise TableError(f"{label}: column '{name}': {error}") from None


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
