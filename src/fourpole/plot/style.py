"""Style of figures: themes, colours of tyres, markers of pressures and loads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import matplotlib as mpl
from matplotlib.colors import to_hex, to_rgb

from fourpole.errors import CampaignError
from fourpole.words import package_toml

#: A line style of matplotlib: a name, or an offset with lengths of dash and gap. Its own types differ by version.
Dashes: TypeAlias = Any
#: A marker of matplotlib: a letter, or a tuple of number of corners, kind and angle.
Marker: TypeAlias = Any


@dataclass(frozen=True)
class _Theme:
    """Colours and line width [pt] of one theme."""

    paper: str
    ink: str
    muted: str
    grid: str
    tyres: list[str]
    scale: list[float]
    line: float


#: What style.toml states: themes, and settings of matplotlib.
_STATED = package_toml("fourpole.plot", "style.toml")
THEMES: dict[str, _Theme] = {name: _Theme(**stated) for name, stated in _STATED["themes"].items()}

_SHADES = mpl.colormaps["viridis"]
#: Markers of pressures in rising order; the cross stands for rejected tests.
_PRESSURE_MARKERS: tuple[Marker, ...] = ("o", "s", "^", "D", "v", "P", "<", ">", "*", (4, 1, 0), (4, 1, 45))
_LOAD_DASHES: tuple[Dashes, ...] = (
    "solid",
    (0.0, (4.0, 1.6)),
    (0.0, (1.0, 1.3)),
    (0.0, (5.0, 1.4, 1.0, 1.4)),
    (0.0, (8.0, 2.0)),
    (0.0, (5.0, 1.4, 1.0, 1.4, 1.0, 1.4)),
)
Limits: TypeAlias = tuple[float, float] | None


@dataclass(frozen=True)
class Size:
    """Size of a figure: its width, its height, which by default follows from its panels, and the scale of its letters.

    Raises
    ------
    CampaignError
        If the size is not that of a page: 1 to 100 inches.
    """

    width: float = 7.0
    height: float | None = None
    font: float = 1.0

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("height", self.height)):
            if value is not None and not 1.0 <= value <= 100.0:
                raise CampaignError(f"the {name} of a figure is {value:.3g} in: give 1 to 100 in (25 mm to 2.5 m)")


#: Sizes by name: the text of a report, one column of a journal, a slide of 16:9.
SIZES = {"report": Size(), "journal": Size(3.5), "slide": Size(10.0, 5.625, 1.5)}


@dataclass(frozen=True)
class Style:
    """The theme and the axis limits of a figure, as the reader chooses them.

    Parameters
    ----------
    theme : {"light", "dark", "print"}
        Colours of paper, ink and tyres; a tyre has one colour in all figures.
    xlim, ylim : pair of float, optional
        Limits of the axes in the units of their labels; by default they follow from the values. Figures 1 to 4 have
        no axes and ignore them.
    size : Size
        Width, height and letters of the figure.
    dpi : int [1/in]
        Dots per inch of a PNG.
    own : mapping of int to str
        Colours of tyres in place of those of the palette, by number.

    Raises
    ------
    CampaignError
        If there is no such theme, or limits are not two different finite numbers.

    Examples
    --------
    >>> Style("print", xlim=(10, 24)).colour(0)
    '#004b80'
    """

    theme: str = "light"
    xlim: Limits = None
    ylim: Limits = None
    size: Size = SIZES["report"]
    dpi: int = 150
    own: Mapping[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 20 <= self.dpi <= 2400:
            raise CampaignError(f"dpi is {self.dpi}: give 20 to 2400 dots per inch")
        if self.theme not in THEMES:
            raise CampaignError(f"no theme {self.theme!r}: choose one of {', '.join(THEMES)}")
        for name, limits in (("xlim", self.xlim), ("ylim", self.ylim)):
            if limits is None:
                continue
            if len(limits) != 2 or not all(math.isfinite(end) for end in limits) or limits[0] == limits[1]:
                raise CampaignError(f"{name} is {limits!r}: give two different finite numbers, the lower end first")

    @property
    def look(self) -> _Theme:
        """Colours and widths of the theme."""
        return THEMES[self.theme]

    @property
    def width(self) -> float:
        """Width of the figure [in]."""
        return self.size.width

    def font(self, points: float) -> float:
        """Size of letters [pt] that have so many points in a report."""
        return points * self.size.font

    def colour(self, tyre: int) -> str:
        """Colour of a tyre by its number; beyond the palette, a darker or lighter shade of a palette colour."""
        if tyre in self.own:
            return self.own[tyre]
        palette = self.look.tyres
        turn, at = divmod(tyre, len(palette))
        if turn == 0:
            return palette[at]
        return mixed(palette[at], self.look.ink if turn % 2 else self.look.paper, 0.45)

    def frequency_colour(self, part: float) -> str:
        """Colour of a frequency on the sequential scale; `part` is 0 for the lowest and 1 for the highest."""
        low, high = self.look.scale
        return to_hex(_SHADES(low + (high - low) * part))

    @property
    def rc(self) -> dict[str, Any]:
        """Settings of matplotlib for drawing and writing a figure."""
        return {
            **_STATED["settings"],
            **{name: getattr(self.look, part) for name, part in _STATED["of_theme"].items()},
            **{name: self.font(points) for name, points in _STATED["letters"].items()},
        }


def load_dashes(rank: int) -> Dashes:
    """Line style of a load, by its rank among the loads of the campaign."""
    return _LOAD_DASHES[rank % len(_LOAD_DASHES)]


def pressure_marker(rank: int) -> Marker:
    """Marker of a pressure, by its rank among the pressures of the campaign."""
    return _PRESSURE_MARKERS[rank % len(_PRESSURE_MARKERS)]


def mixed(first: str, second: str, part: float) -> str:
    """Colour between two others; `part` is the share of the second."""
    red, green, blue = (a + (b - a) * part for a, b in zip(to_rgb(first), to_rgb(second), strict=True))
    return to_hex((red, green, blue))


@contextmanager
def drawing(style: Style, salt: str = "") -> Iterator[None]:
    """Inside the context matplotlib has the settings of the theme, not those of the user; afterwards the user's again.

    `salt` makes the ids in an SVG depend on the figure alone.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        settings: Any = {**style.rc, "svg.hashsalt": f"fourpole {salt}"}
        mpl.rcParams.update(settings)
        yield
