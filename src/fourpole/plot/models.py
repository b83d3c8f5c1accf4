"""What the figures of models share: headings, names and logarithmic ordinates."""

from __future__ import annotations

from matplotlib.axes import Axes

from fourpole.plot.panels import numbered, tyre_heading
from fourpole.plot.sheet import Sheet
from fourpole.plot.style import Style


def steep(ax: Axes, limits: tuple[float, float], style: Style) -> None:
    """Make the ordinate logarithmic."""
    ax.set_yscale("log")
    ax.set_ylim(style.ylim if style.ylim and min(style.ylim) > 0 else limits)
    numbered(ax, "y", most=5)


def heading(ax: Axes, sheet: Sheet, model: str, tyre: int, right: str, style: Style, columns: int) -> None:
    """Write the name of the tyre above a panel, or the name of the model if the tyre has none."""
    name = sheet.labels[tyre] if sheet.names[tyre] else model
    tyre_heading(ax, name, style.colour(tyre), right, style=style, columns=columns)


def share(part: float) -> str:
    """A relative error as text in per cent."""
    return f"{100 * part:.2g} %"


def model_of(sheet: Sheet, tyre: int) -> str:
    """The name of a tyre before that of its model in a key; empty if the tyre has no name."""
    return f"{sheet.labels[tyre]}: " if sheet.names[tyre] else ""
