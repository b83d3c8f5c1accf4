"""Look-up tables of models and maps: K* with its uncertainty on a grid of operating points and frequencies.

The grid is so fine that linear interpolation of Re K* and Im K* between its points is right within a stated error,
which is a column of the table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.condition import AMPLITUDE
from fourpole.export.source import MODEL_FILE, accuracy_columns
from fourpole.fitting.accuracy import Accuracy, accuracy_of
from fourpole.fitting.byamplitude import answer_at, depends_on_amplitude, levels_of_map
from fourpole.fitting.modelfile import ModelFile
from fourpole.fitting.placed import conditions_of, placed_at, specimens
from fourpole.fitting.query import maps_of
from fourpole.fitting.rows import tyre_columns
from fourpole.io.write import write_table
from fourpole.models.operating import Answer, OperatingMap
from fourpole.quantities import ShownUnits

#: Error of linear interpolation, relative to |K*|, that the grid goes for, and its largest number of rows per map.
_ACCURACY, _MOST_ROWS = 1e-3, 50_000
#: Number of points of each side to begin with; they are doubled.
_FIRST = 3
#: Column of the error of interpolation.
ERROR = "interpolation error [1]"


def write(source: ModelFile, path: Path, specimen: str | None = None) -> tuple[str, ...]:
    """Write a row per operating point and frequency; returns notes on the error of interpolation and on blank rows."""
    sheets = [one for name in specimens(source, MODEL_FILE, specimen) for one in _sheets(source, name)]
    table = pl.concat([one.rows() for one in sheets], how="diagonal_relaxed")
    write_table(path, table)
    return (*_notes(table), *dict.fromkeys(remark for one in sheets for remark in one.remarks))


def _notes(table: pl.DataFrame) -> list[str]:
    worst = 100 * float(np.max(table[ERROR].to_numpy()))
    notes = [f"linear interpolation of Re K* and Im K* differs from the model by up to {worst:.2g} % of |K*|"]
    blank = int(table[q.STORAGE.head].is_nan().sum())
    if blank:
        notes.append(f"{blank} of {table.height} rows are blank: they are outside the tested conditions")
    return notes


@dataclass(frozen=True, eq=False)
class _Sheet:
    """What a part of the table is of: a map, or a fit at one condition as a map of one point.

    `levels` are the tested amplitudes of the deflection [m] if K* depends on them; `remarks` hold for the whole sheet.
    """

    specimen: str
    map: OperatingMap
    levels: list[float]
    accuracy: Accuracy
    remarks: tuple[str, ...] = ()

    @property
    def sides(self) -> list[tuple[float, float, bool]]:
        """Ends of each side, and whether its points are evenly spaced on a logarithmic scale."""
        points, logs = self.map.axes.points, self.map.axes.logarithmic
        ends = zip(self.map.axes.names, points.min(axis=0).tolist(), points.max(axis=0).tolist(), strict=True)
        sides = [(low, high, name in logs) for name, low, high in ends] if self.map.axes.names else []
        if self.levels:
            sides.append((self.levels[0], self.levels[-1], True))
        return [*sides, (*self.map.band, True)]

    def grid(self) -> list[FloatArray]:
        """The grid: each side is refined until interpolation along it is accurate enough."""
        counts = [_FIRST if high > low else 1 for low, high, _ in self.sides]
        while True:
            grid = [_side(one, count) for one, count in zip(self.sides, counts, strict=True)]
            errors = [self.error(grid, (at,)) for at in range(len(grid))]
            finer = [
                2 * count - 1 if error > _ACCURACY / len(grid) else count
                for count, error in zip(counts, errors, strict=True)
            ]
            if finer == counts or np.prod(finer) > _MOST_ROWS:
                return grid
            counts = finer

    def error(self, grid: list[FloatArray], along: tuple[int, ...] | None = None) -> float:
        """Largest error of interpolation relative to |K*| [1], at the middles of cells or along some sides only."""
        along = tuple(at for at in (range(len(grid)) if along is None else along) if grid[at].size > 1)
        middles = [0.5 * (one[1:] + one[:-1]) if at in along else one for at, one in enumerate(grid)]
        exact, corners = self.stiffness(middles), self.stiffness(grid)
        for at in along:
            sides = np.moveaxis(corners, at, 0)
            corners = np.moveaxis(0.5 * (sides[1:] + sides[:-1]), 0, at)
        known = np.isfinite(corners) & np.isfinite(exact)
        return float(np.max(np.abs(corners[known] / exact[known] - 1), initial=0.0))

    def stiffness(self, grid: list[FloatArray]) -> ComplexArray:
        """K* [N/m] on a grid; not-a-number outside the tested conditions."""
        axes, omega, model = grid[: len(self.map.axes.names)], 2 * np.pi * grid[-1], self.map.model
        points, shape = _mesh(axes), tuple(one.size for one in axes)
        values, inside = self.map.parameters(points), self.inside(points)
        models = [model.at_amplitude(one) for one in grid[len(axes)]] if self.levels else [model]
        found = [np.where(inside[:, None], one.stiffness(values, omega), np.nan + 0j) for one in models]
        whole = np.stack(found, axis=1).reshape(*shape, len(models), omega.size)
        return whole if self.levels else whole[..., 0, :]

    def inside(self, points: FloatArray) -> np.ndarray:
        """Whether points (Q, d) are inside the tested conditions."""
        return np.array([self.map.axes.outside(one)[0] == 0 for one in points])

    def rows(self) -> pl.DataFrame:
        """A row per point of the grid, the frequency running fastest; K* is blank outside the tested conditions."""
        grid = self.grid()
        error = self.error(grid)
        axes, frequency = grid[: len(self.map.axes.names)], grid[-1]
        tables = []
        for point, amplitude in product(_mesh(axes), grid[len(axes)].tolist() if self.levels else [None]):
            state = {**self.map.axes.constant, **dict(zip(self.map.axes.names, point.tolist(), strict=True))}
            state |= {} if amplitude is None else {AMPLITUDE.column: amplitude}
            columns = tyre_columns(self._answer(point, frequency, amplitude))
            if not self.inside(point[None])[0]:
                columns = {head: np.full(frequency.size, np.nan) for head in columns}
            table = pl.DataFrame({q.FREQUENCY.head: frequency, **columns, ERROR: np.full(frequency.size, error)})
            fixed = [pl.lit(value).alias(column) for column, value in {q.TYRE.head: self.specimen, **state}.items()]
            tables.append(table.select(*fixed, pl.all()))
        said = (pl.lit(value).alias(head) for head, value in accuracy_columns(self.accuracy).items())
        return pl.concat(tables).with_columns(said)

    def _answer(self, point: FloatArray, frequency: FloatArray, amplitude: float | None) -> Answer:
        points = np.repeat(point[None], frequency.size, axis=0)
        if amplitude is None:
            return self.map.ask(points, frequency)
        return answer_at(self.map, points, frequency, amplitude, self.levels)


def _sheets(file: ModelFile, specimen: str) -> Iterator[_Sheet]:
    """A sheet for the map of a specimen, or for each condition of its fits."""
    mapped = next((one for one in file.maps if one.tyre == specimen and one.axes), None)
    for state in [{}] if mapped else conditions_of(file, specimen, MODEL_FILE):
        found = maps_of(file, specimen, state, ShownUnits())
        levels = levels_of_map(file, specimen, found) if depends_on_amplitude(file, specimen) else []
        if mapped is not None:
            yield _Sheet(specimen, found, levels, accuracy_of(mapped))
        else:
            placed = placed_at(file, MODEL_FILE, specimen, state)
            yield _Sheet(specimen, found, levels, placed.accuracy, placed.remarks)


def _side(ends: tuple[float, float, bool], count: int) -> FloatArray:
    """Points of a side, evenly spaced from end to end."""
    low, high, logarithmic = ends
    return np.geomspace(low, high, count) if logarithmic else np.linspace(low, high, count)


def _mesh(axes: list[FloatArray]) -> FloatArray:
    """All points (Q, d) of some axes, the last one running fastest."""
    if not axes:
        return np.zeros((1, 0))
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
