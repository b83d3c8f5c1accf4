"""Figures for a script or a notebook: of results by the name of a figure or of a quantity, and of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fourpole import quantities as q
from fourpole.core.recording import Recording
from fourpole.errors import CampaignError
from fourpole.plot.catalogue import FIGURES
from fourpole.plot.catalogue import draw as figure_of
from fourpole.plot.layout import figure_bytes, new_figure
from fourpole.plot.style import Style, drawing
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Figure that shows a quantity, by the symbols that people write.
OF_QUANTITY = {
    **dict.fromkeys(("K*", "|K*|", "loss angle", "delta"), "stiffness"),
    **dict.fromkeys(("K'", "K''", "Re K*", "Im K*"), "storage-loss"),
    **dict.fromkeys(("K2", "C"), "arm"),
    "TR": "tr",
}
_UNITS = {"force": "N", "displacement": "mm", "velocity": "mm/s", "acceleration": "m/s²"}
_SCALES = {"displacement": 1e-3, "velocity": 1e-3}
#: Points of a line; of more samples the least and the greatest along the line are drawn.
_POINTS = 4000


@dataclass(frozen=True, eq=False, repr=False)
class Drawn:
    """A figure that a notebook shows by itself.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        The figure, not registered with pyplot; its axes can be changed.
    key, title : str
        Name and title of the figure.
    """

    figure: Figure
    key: str
    title: str

    def __repr__(self) -> str:
        return f"<figure {self.key}: {self.title}>"

    def _repr_svg_(self) -> str:
        return figure_bytes(self.figure, self.key, self.title, "svg").decode()

    def save(self, path: str | Path) -> Path:
        """Write the figure to a file; its ending, .svg, .png or .pdf, is the format."""
        from fourpole.io.write import write_bytes

        path = Path(path) if Path(path).suffix else Path(path).with_suffix(".svg")
        write_bytes(path, figure_bytes(self.figure, self.key, self.title, path.suffix.lstrip(".").lower()))
        return path


def draw(what: Study | Recording, figure: str = "stiffness", *, style: Style | None = None) -> Drawn:
    """A figure of results, or of a recording.

    Parameters
    ----------
    what : Study or Recording
    figure : str
        Of results: a quantity, as "K2", "C", "K'", "TR", "loss angle", or one of `fourpole.plot.FIGURES`.
    style : Style, optional
        Theme, size and limits.

    Returns
    -------
    Drawn
        A notebook shows it; `save` writes it, `figure` is matplotlib's.

    Raises
    ------
    CampaignError
        If there is no such figure, or the results hold nothing that it shows.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(1000) / 500.0
    >>> draw(Recording.from_arrays(t, force_in=np.sin(63 * t), motion_in=np.cos(63 * t)))
    <figure recording: recording>
    """
    if isinstance(what, Recording):
        return _recording(what, style or Style())
    key = OF_QUANTITY.get(figure, figure)
    if key not in FIGURES:
        quantities, figures = ", ".join(OF_QUANTITY), ", ".join(FIGURES)
        raise CampaignError(f"no figure {figure!r}: name a quantity, {quantities}, or one of {figures}")
    found = figure_of(what, key, style)
    if found is None:
        raise CampaignError(f"the results hold no data for {figure}: {FIGURES[key].title}")
    return Drawn(found, key, FIGURES[key].title)


def _recording(recording: Recording, style: Style) -> Drawn:
    """Each channel over time in a panel."""
    import numpy as np

    with drawing(style, "recording"):
        figure = new_figure(style.size.width, 1.0 + 1.2 * len(recording.channels))
        panels = figure.subplots(len(recording.channels), 1, sharex=True, squeeze=False)[:, 0]
        for at, (ax, (name, one)) in enumerate(zip(panels, recording.channels.items(), strict=True)):
            rate, start = recording.base(name)
            values = one.samples / _SCALES.get(one.quantity, 1.0)
            step = max(1, values.size // _POINTS)
            edges = np.arange(0, values.size, step)
            ends = np.stack([np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)], axis=1).ravel()
            ax.plot(np.repeat(start + edges / rate, 2), ends, color=style.colour(at), linewidth=0.7)
            ax.set_ylabel(f"{name}\n[{_UNITS[one.quantity]}]")
        panels[-1].set_xlabel(q.TIME.label)
        figure.set_layout_engine("constrained")
    return Drawn(figure, "recording", recording.label)
