"""A figure as data: panels with series in the units of their axes, with uncertainties and the tests behind each point.

A figure is made of results without matplotlib; `fourpole.plot.drawn` draws it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.quantities import Quantity

#: Largest number of curves in a panel that have a label each; more curves have a colour scale.
MOST_LABELLED = 6


def shade(at: int, count: int) -> float:
    """Shade of a specimen's colour for one of its curves, 0 (palest) to 1; the last curve has the colour itself."""
    return 1.0 if count < 2 else 0.35 + 0.65 * at / (count - 1)


class Role(StrEnum):
    """What a series shows."""

    POINTS = "points"
    REJECTED = "rejected"
    MODEL = "model"
    LINE = "line"


@dataclass(frozen=True)
class AxisData:
    """An axis: the name of its quantity, its unit, and whether it is logarithmic.

    Examples
    --------
    >>> AxisData("frequency", "Hz").label
    'frequency [Hz]'
    """

    name: str
    unit: str
    log: bool = False

    @classmethod
    def of(cls, quantity: Quantity, *, log: bool = False) -> AxisData:
        """The axis of a quantity in its shown unit."""
        return cls(quantity.name, quantity.shown, log)

    @property
    def label(self) -> str:
        """Name with unit."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True, eq=False)
class Series(ByValue):
    """Points or a curve of one condition, in the units of the axes.

    Attributes
    ----------
    role : Role
    x, y : (N,) float arrays
    spread : (N,) float array or None
        Of points the standard uncertainty of y; of a model the half-width of its 95 % band.
    label : str
        Text at the end of the curve; empty for a curve without one.
    tyre : int
        Number of the specimen, which sets the colour; -1 for none.
    shade : float
        Shade of the specimen's colour, 0 (palest) to 1.
    marker, dash : int
        Ranks of the pressure and of the preload, which set marker and line style.
    level : float
        Value on the colour scale of the figure; not-a-number where the specimen sets the colour.
    tests, cards : tuples of str
        Name of the test of each point, and the id of its card in the report; empty for curves.
    """

    role: Role
    x: FloatArray
    y: FloatArray
    spread: FloatArray | None = None
    label: str = ""
    tyre: int = -1
    shade: float = 1.0
    marker: int = 0
    dash: int = 0
    level: float = np.nan
    tests: tuple[str, ...] = ()
    cards: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Field(ByValue):
    """Values (M, N) of a quantity over the abscissa (N,) and the ordinate (M,), with its name and unit."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    name: str
    unit: str


@dataclass(frozen=True, eq=False)
class Panel(ByValue):
    """One pair of axes with its series and, of a map, its field.

    `tyre` is the number of the specimen that heads the panel, or -1. With `names`, the ordinate is a list of names from
    the top down, at 0, 1, 2 and so on.
    """

    x: AxisData
    y: AxisData
    series: tuple[Series, ...]
    title: str = ""
    right: str = ""
    tyre: int = -1
    field: Field | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scale:
    """A colour scale: name and unit of the quantity, and the ends of the scale."""

    name: str
    unit: str
    low: float
    high: float

    def part(self, value: float) -> float:
        """Place of a value on the scale, 0 to 1."""
        return (value - self.low) / (self.high - self.low) if self.high > self.low else 0.5


@dataclass(frozen=True, eq=False)
class FigureData(ByValue):
    """A whole figure.

    Attributes
    ----------
    panels : tuple of Panel
        Row by row.
    columns : int
        Number of panels in a row.
    names : tuple of str
        Specimens by number, as shown.
    scale : Scale or None
        Colour scale of the series that have a level.
    keyed : tuple of int
        Numbers of the specimens that the key names.
    dashes : tuple of (int, str)
        Line styles that the key explains: rank and text.
    notes : tuple of str
        What the figure does not show, and how it was made.
    panel_height, height : float [in]
        Height of a panel, and of the whole figure; without the latter it follows from the panels.
    shared : bool
        Whether the panels of a row share the ordinate.
    left : float [in]
        Room for the numbers or names on the left of a panel.
    """

    panels: tuple[Panel, ...]
    columns: int
    names: tuple[str, ...] = ()
    scale: Scale | None = None
    keyed: tuple[int, ...] = ()
    dashes: tuple[tuple[int, str], ...] = ()
    notes: tuple[str, ...] = ()
    panel_height: float = 2.2
    height: float | None = None
    shared: bool = True
    left: float = 0.66

    @property
    def has_band(self) -> bool:
        """Whether a curve has a band."""
        return any(one.role is Role.MODEL and one.spread is not None for panel in self.panels for one in panel.series)

    @property
    def rejected(self) -> bool:
        """Whether a rejected test is shown."""
        return any(one.role is Role.REJECTED for panel in self.panels for one in panel.series)
