"""How figures look: themes, colours of tyres, markers of pressures and loads, and text that stays text."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib as mpl
from matplotlib.colors import to_hex, to_rgb

from fourpole.errors import CampaignError

__all__ = ["THEMES", "Dashes", "Marker", "Style", "drawing", "plain_text", "short_names"]

#: A line style, a name or an offset with lengths of dash and gap; matplotlib's own types differ by version.
Dashes: TypeAlias = Any
#: A marker as matplotlib takes it: a letter, or corners, kind and angle.
Marker: TypeAlias = Any


@dataclass(frozen=True)
class _Theme:
    paper: str
    ink: str
    muted: str
    grid: str
    tyres: tuple[str, ...]
    #: The part of the sequential scale that stands out from the paper.
    scale: tuple[float, float]
    line: float


_OKABE_ITO = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#000000")
#: The order puts dark beside light, so that the first tyres differ in grey too.
THEMES: dict[str, _Theme] = {
    "light": _Theme("#ffffff", "#1f2328", "#6a7178", "#e3e6e9", _OKABE_ITO, (0.0, 0.86), 1.3),
    "dark": _Theme(
        "#16191d",
        "#e8eaed",
        "#9aa1a9",
        "#33383f",
        ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#F0E442", "#ffffff"),
        (0.28, 1.0),
        1.3,
    ),
    "print": _Theme(
        "#ffffff",
        "#000000",
        "#555555",
        "#dddddd",
        ("#004b80", "#E69F00", "#00694c", "#CC79A7", "#9c3f00", "#56B4E9", "#000000"),
        (0.0, 0.8),
        1.6,
    ),
}

#: Pressures, in rising order; the cross is kept for rejected tests.
_PRESSURE_MARKERS: tuple[Marker, ...] = ("o", "s", "^", "D", "v", "P", "<", ">", "*", (4, 1, 0), (4, 1, 45))
#: Loads have markers of their own, so that a figure never means a pressure where it shows a load.
_LOAD_MARKERS = ("d", "p", "h", "H")
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
class Style:
    """What a reader may choose of a figure.

    Parameters
    ----------
    theme : {"light", "dark", "print"}
        Paper and ink; each theme keeps one colour per tyre in all figures.
    xlim, ylim : pair of float, optional
        Limits of the axes in the units they show; by default the measured values set them. Schemes ignore them.

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

    def __post_init__(self) -> None:
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

    def colour(self, tyre: int) -> str:
        """Colour of a tyre by the order of its first appearance; beyond the palette its darker and lighter kin."""
        palette = self.look.tyres
        turn, at = divmod(tyre, len(palette))
        if turn == 0:
            return palette[at]
        return mixed(palette[at], self.look.ink if turn % 2 else self.look.paper, 0.45)

    def face(self, tyre: int, rank: int, count: int) -> str:
        """Fill of a marker: the tyre's colour, paler for the lower of several pressures."""
        part = 1.0 if count < 2 else 0.12 + 0.88 * rank / (count - 1)
        return mixed(self.look.paper, self.colour(tyre), part)

    def neutral_face(self, rank: int, count: int) -> str:
        """The same fill for a key that stands for every tyre."""
        part = 1.0 if count < 2 else 0.12 + 0.88 * rank / (count - 1)
        return mixed(self.look.paper, self.look.muted, part)

    def frequency_colour(self, part: float) -> str:
        """Colour on the sequential scale; `part` runs from 0, the lowest frequency, to 1."""
        low, high = self.look.scale
        return to_hex(mpl.colormaps["viridis"](low + (high - low) * part))

    @property
    def rc(self) -> dict[str, Any]:
        """Settings while a figure is drawn and written."""
        look = self.look
        return {
            "font.family": ["sans-serif"],
            "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica", "sans-serif"],
            "font.size": 8.0,
            "text.parse_math": False,
            "text.color": look.ink,
            "axes.formatter.use_mathtext": False,
            "axes.formatter.useoffset": False,
            "axes.facecolor": look.paper,
            "axes.edgecolor": look.muted,
            "axes.labelcolor": look.ink,
            "axes.labelsize": 8.0,
            "axes.titlesize": 8.5,
            "axes.linewidth": 0.7,
            "axes.grid": True,
            "axes.axisbelow": True,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "grid.color": look.grid,
            "grid.linewidth": 0.6,
            "xtick.color": look.muted,
            "ytick.color": look.muted,
            "xtick.labelcolor": look.ink,
            "ytick.labelcolor": look.ink,
            "xtick.labelsize": 7.5,
            "ytick.labelsize": 7.5,
            "xtick.major.width": 0.7,
            "ytick.major.width": 0.7,
            "xtick.major.size": 2.5,
            "ytick.major.size": 2.5,
            "lines.linewidth": look.line,
            "lines.markersize": 4.0,
            "lines.markeredgewidth": 0.9,
            "legend.fontsize": 7.5,
            "legend.frameon": False,
            "figure.facecolor": look.paper,
            "savefig.facecolor": look.paper,
            "savefig.edgecolor": "none",
            "svg.fonttype": "none",
            "pdf.fonttype": 42,
        }


def load_dashes(rank: int) -> Dashes:
    """Line style of a load, by its rank among the loads of the campaign."""
    return _LOAD_DASHES[rank % len(_LOAD_DASHES)]


def load_marker(rank: int) -> str:
    """Marker of a load, where the pressure is the abscissa."""
    return _LOAD_MARKERS[rank % len(_LOAD_MARKERS)]


def pressure_marker(rank: int) -> Marker:
    """Marker of a pressure, by its rank among the pressures of the campaign."""
    return _PRESSURE_MARKERS[rank % len(_PRESSURE_MARKERS)]


def mixed(first: str, second: str, part: float) -> str:
    """Colour between two others; `part` is the share of the second."""
    red, green, blue = (a + (b - a) * part for a, b in zip(to_rgb(first), to_rgb(second), strict=True))
    return to_hex((red, green, blue))


@contextmanager
def drawing(style: Style, salt: str = "") -> Iterator[None]:
    """Settings of the theme, whatever the user's matplotlib is set to, and only while a figure is made."""
    with mpl.rc_context():
        mpl.rcdefaults()
        settings: Any = {**style.rc, "svg.hashsalt": f"fourpole {salt}"}
        mpl.rcParams.update(settings)
        yield


def plain_text(text: str, longest: int = 24) -> str:
    """Text of a file as a figure shows it: one line, nothing invisible, the middle left out where it is long.

    Examples
    --------
    >>> plain_text("a name that is much too long to be shown")
    'a name that is…be shown'
    """
    seen = "".join(sign if sign.isprintable() else " " for sign in unicodedata.normalize("NFC", text[:4000]))
    seen = " ".join(seen.split())
    if len(seen) > longest:
        tail = longest // 3
        seen = f"{seen[: longest - tail - 1].rstrip()}…{seen[-tail:].lstrip()}"
    return seen or "(no name)"


def short_names(names: Sequence[str], longest: int = 24) -> tuple[str, ...]:
    """Names as figures show them, each different from the others.

    Examples
    --------
    >>> short_names(["a", "a ", "b"])
    ('a', 'a #2', 'b')
    """
    taken: list[str] = []
    for name in names:
        label = shown = plain_text(name, longest)
        number = 1
        while label in taken:
            number += 1
            label = f"{shown} #{number}"
        taken.append(label)
    return tuple(taken)
