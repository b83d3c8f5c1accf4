"""A figure as data: panels with series in the units of their axes, and the names that figures show."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.sources import Source
from fourpole.quantities import RIG_VALUES, Quantity
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fourpole.plot.style import Style

_T = TypeVar("_T")


def plain_text(text: str, longest: int = 24) -> str:
    """A text as figures show it: one line, without invisible characters, shortened in the middle if it is long.

    Examples
    --------
    >>> plain_text("a name that is much too long to be shown")
    'a name that is…be shown'
    """
    plain = "".join(sign if sign.isprintable() else " " for sign in unicodedata.normalize("NFC", text[:4000]))
    plain = " ".join(plain.split())
    if len(plain) > longest:
        tail = longest // 3
        plain = f"{plain[: longest - tail - 1].rstrip()}…{plain[-tail:].lstrip()}"
    return plain or "(no name)"


def short_names(names: Sequence[str], longest: int = 24) -> tuple[str, ...]:
    """Names as figures show them; equal names get a number.

    Examples
    --------
    >>> short_names(["a", "a ", "b"])
    ('a', 'a #2', 'b')
    """
    return tuple(distinct((plain_text(name, longest) for name in names), " #"))


def distinct(names: Iterable[str], mark: str, *, taken: Collection[str] = (), fold: bool = False) -> Iterator[str]:
    """The names made distinct: a name that occurred before or is in `taken` gets the mark and a number.

    With `fold`, names that differ only in upper and lower case count as equal.

    Examples
    --------
    >>> list(distinct(["a", "b", "a"], "_", taken=["b"]))
    ['a', 'b_2', 'a_2']
    """
    used = set(taken)
    for name in names:
        free, number = name, 1
        while (free.lower() if fold else free) in used:
            number += 1
            free = f"{name}{mark}{number}"
        used.add(free.lower() if fold else free)
        yield free


def kept(results: Study, key: object, make: Callable[[], _T]) -> _T:
    """What is made of some results once, by a key of its own."""
    if key not in results.derived:
        results.derived[key] = make()
    found: _T = results.derived[key]
    return found


def counted(number: int, noun: str) -> str:
    """A number with its noun in singular or plural.

    Examples
    --------
    >>> counted(1, "test"), counted(2, "test")
    ('1 test', '2 tests')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def lacking(number: int, what: str) -> list[str]:
    """The note that some tests have no value, if there are any.

    Examples
    --------
    >>> lacking(2, "TR"), lacking(0, "TR")
    (['2 tests have no TR'], [])
    """
    return [f"{counted(number, 'test')} {'has' if number == 1 else 'have'} no {what}"] if number else []


def value_label(source: Source) -> str:
    """A shared value, or a source of uncertainty, as figures name it.

    Examples
    --------
    >>> value_label(Source.read("moving_mass")), value_label(Source.read("loss angle block of radial"))
    ('moving mass m', 'δ block of radial')
    """
    value = RIG_VALUES.get(source.of)
    return value.name if value else plain_text(source.text.replace("_", " ").replace("loss angle", "δ"), 28)


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
    RANGE = "range"


class Place(StrEnum):
    """Where the label of a curve stands: beside or above its right end, or beside its left end."""

    RIGHT = "right"
    ABOVE = "above"
    LEFT = "left"


class Tone(StrEnum):
    """What a colour says where it is not that of a specimen."""

    NONE = ""
    INK = "ink"
    SURE = "sure"
    DOUBT = "doubt"
    ALARM = "alarm"


@dataclass(frozen=True)
class AxisData:
    """An axis: the name of its quantity, its unit, and its kind.

    A `log` axis is logarithmic: an abscissa always, an ordinate if its values span more than a decade. It is linear up
    to `linear`. A `signed` axis is about zero, and holds the uncertainties. One from `zero` begins there or below.

    Examples
    --------
    >>> AxisData("frequency", "Hz").label
    'frequency [Hz]'
    """

    name: str
    unit: str
    log: bool = False
    linear: float = 0.0
    signed: bool = False
    zero: bool = False

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
        Of points the standard uncertainty of y; of a model the half-width of its 95 % band; of ranges their half.
    across : (N,) float array or None
        The same along the abscissa, of points and ranges.
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
    tone : Tone
        Colour of a series without a specimen.
    hollow : bool
        Whether the markers are open.
    texts : tuple of str
        Text on the right of each point; empty for none.
    place : Place
        Where the label of a curve stands.
    tests, cards : tuples of str
        Name of the test of each point, and the id of its card in the report; empty for curves.
    """

    role: Role
    x: FloatArray
    y: FloatArray
    spread: FloatArray | None = None
    across: FloatArray | None = None
    label: str = ""
    tyre: int = -1
    shade: float = 1.0
    marker: int = 0
    dash: int = 0
    level: float = np.nan
    tone: Tone = Tone.NONE
    hollow: bool = False
    texts: tuple[str, ...] = ()
    place: Place = Place.RIGHT
    tests: tuple[str, ...] = ()
    cards: tuple[str, ...] = ()


def look(role: Role = Role.POINTS, **how: Any) -> Series:
    """A series without points: what others are made of, or an entry of the key."""
    return Series(role, np.zeros(0), np.zeros(0), **how)


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
    the top down, at 0, 1, 2 and so on; `heads` are the numbers of those that head a group, and `beside` has a text for
    each name on the right of the panel. `corner` stands in the lower left corner.
    """

    x: AxisData
    y: AxisData
    series: tuple[Series, ...]
    title: str = ""
    right: str = ""
    tyre: int = -1
    field: Field | None = None
    names: tuple[str, ...] = ()
    heads: tuple[int, ...] = ()
    beside: tuple[str, ...] = ()
    corner: str = ""


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
    key : tuple of (Series, str)
        Further entries of the key: a series without points for its look, and the text.
    lost : str
        What a rejected test is called.
    notes : tuple of str
        What the figure does not show, and how it was made.
    panel_height, height : float [in]
        Height of a panel, and of the whole figure; without the latter it follows from the panels.
    shared : bool
        Whether the panels of a row share the ordinate.
    aligned : bool
        Whether panels of the same abscissa have the same limits.
    left, right : float [in]
        Room for the numbers or names on the left of a panel, and on its right.
    block : int
        Number of rows of panels that belong together; where a height has no room for all, the last ones are left out.
    """

    panels: tuple[Panel, ...]
    columns: int
    names: tuple[str, ...] = ()
    scale: Scale | None = None
    keyed: tuple[int, ...] = ()
    dashes: tuple[tuple[int, str], ...] = ()
    key: tuple[tuple[Series, str], ...] = ()
    lost: str = "rejected test"
    notes: tuple[str, ...] = ()
    panel_height: float = 2.2
    height: float | None = None
    shared: bool = True
    aligned: bool = False
    left: float = 0.66
    right: float = 0.16
    block: int = 1

    @property
    def rows(self) -> list[tuple[Panel, ...]]:
        """The panels of each row."""
        return [self.panels[first : first + self.columns] for first in range(0, len(self.panels), self.columns)]

    @property
    def series(self) -> list[Series]:
        """The series of all panels."""
        return [series for panel in self.panels for series in panel.series]


@dataclass(frozen=True)
class FigureSpec:
    """One figure: its key, its name, its caption, and the function that makes its data or draws it.

    `data` makes the figure of results as data; `draw` draws line art of a rig, which has no axes. Either returns None
    if the results hold nothing that the figure shows. `apart`: whether specimens at several temperatures have a colour
    each. `number`: that of a figure of the paper; 0 for another one.
    """

    key: str
    name: str
    caption: str
    draw: Callable[[Study, Style], Figure | None] | None = None
    data: Callable[[Study], FigureData | None] | None = None
    apart: bool = False
    number: int = 0

    @property
    def title(self) -> str:
        """The name, after the number of a figure of the paper."""
        return f"Figure {self.number}: {self.name}" if self.number else self.name
