"""One figure as an entry of the catalogue."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fourpole.plot.data import FigureData
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fourpole.plot.style import Style


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

    def drawn(self, results: Study, style: Style) -> Figure | None:
        """The figure; None if the results hold nothing that it shows."""
        if self.draw is not None:
            return self.draw(results, style)
        from fourpole.plot.drawn import figure_of

        data = self.data(results) if self.data is not None else None
        return None if data is None else figure_of(data, style)
