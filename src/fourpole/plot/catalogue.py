"""Figures by name, in the order of a report, and the files they are written to."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.errors import CampaignError
from fourpole.io.write import write_bytes
from fourpole.plot import budget, carpet, choice, models, motion, operating, properties, rig, schemes, stiffness
from fourpole.plot.style import Style, drawing
from fourpole.quantities import DERIVED
from fourpole.study.results import Results
from fourpole.study.study import make_folder

__all__ = ["FIGURES", "FORMATS", "FigureSpec", "draw", "render", "save_figures", "write_figure"]

#: What a figure can be written as.
FORMATS = ("svg", "png", "pdf")
_DPI = 150
_DIGITS = re.compile(rb"(\d\.\d\d)\d+")
_GROUP_NAME = re.compile(rb'<g id="[^"]*"')


@dataclass(frozen=True)
class FigureSpec:
    """One figure: its name, what it is called, what is seen in it, and how it is drawn.

    `draw` takes results and a style and returns None where the results hold nothing for it.
    """

    key: str
    title: str
    caption: str
    draw: Callable[[Results, Style], Figure | None]


def _specs() -> Iterable[FigureSpec]:
    yield FigureSpec(
        "fig01", "Figure 1: viscoelastic tyre model", "The spring K1 beside a spring K2 in series with a damper C.",
        schemes.tyre_model,
    )  # fmt: skip
    yield FigureSpec(
        "fig02",
        "Figure 2: model of the test arrangement",
        "The tyre under the moving mass m and the preload spring K3, which ends on a fixed foundation.",
        schemes.whole_model,
    )
    yield FigureSpec(
        "fig03",
        "Figure 3: static rig",
        "A screw loads the tyre; force and deflection are recorded together.",
        schemes.static_rig,
    )
    yield FigureSpec(
        "fig04",
        "Figure 4: dynamic rig",
        "A cam with 1 mm eccentricity shakes the contact; the tyre carries the moving mass under a leaf spring.",
        schemes.dynamic_rig,
    )
    yield FigureSpec(
        "fig05",
        "Figure 5: static load against deflection",
        "Lattice of mean load-deflection curves: each curve is one pressure, each cross-line one deflection.",
        carpet.load_deflection,
    )
    shown = ((6, q.C, "damping coefficient C"), (10, q.K2, "dynamic stiffness K2"))
    for first, quantity, words in shown:
        for at, (against, curves, make) in enumerate(
            (
                ("pressure", "constant frequency", properties.against_pressure),
                ("frequency", "constant pressure", properties.against_frequency),
            )
        ):
            for high, load in ((False, "low preload"), (True, "high preload")):
                number = first + 2 * at + high
                yield FigureSpec(
                    f"fig{number:02d}",
                    f"Figure {number}: {words} against {against}, {load}",
                    f"The {words} of each tyre against {against}, each curve at {curves}; "
                    f"{'the higher preloads' if high else 'the lowest preload'}, bars of one standard uncertainty.",
                    partial(make, quantity=quantity, high=high),
                )
    yield FigureSpec(
        "fig14",
        "Figure 14: transmissibility against frequency",
        "The ratio TR of the motions above and below the tyre at two pressures, with the frequencies at which "
        "the tyres' curves cross.",
        motion.transmissibility,
    )
    yield FigureSpec(
        "tr-measured-predicted",
        "Transmissibility measured and predicted",
        "TR from V2 and V1 against TR from K* and the rig as stated, and their difference against frequency.",
        motion.measured_against_predicted,
    )
    yield FigureSpec(
        "stiffness",
        "Dynamic stiffness against frequency",
        "Storage stiffness K', loss stiffness K'' and loss factor K''/K' of each tyre, with standard uncertainties.",
        stiffness.stiffness,
    )
    for one in DERIVED:
        yield FigureSpec(
            one.key.replace("_", "-"),
            f"{one.name[:1].upper()}{one.name[1:]} against frequency",
            f"The {one.meaning}, at the lowest preload, with standard uncertainties.",
            partial(properties.against_frequency, quantity=one, high=False),
        )
    yield FigureSpec(
        "nyquist",
        "Nyquist plot of the dynamic stiffness",
        "Loss stiffness K'' against storage stiffness K', each curve along frequency.",
        stiffness.nyquist,
    )
    yield FigureSpec(
        "routes",
        "Routes side by side",
        "K' by each route at one condition, and how far K' and K'' by each route lie from the K* in use.",
        stiffness.routes,
    )
    yield FigureSpec(
        "mobility",
        "Mobility measured and modelled",
        "Real part R and imaginary part I of V1/F1, points measured, lines from K1 and the interpolated K2 and C "
        "on the rig as stated.",
        stiffness.mobility,
    )
    yield FigureSpec(
        "rig-found",
        "The rig and the sensors, as stated and as found",
        "Each value that the tests share, from what is stated of it, in its stated uncertainty; whiskers are the "
        "standard uncertainty after the tests.",
        rig.found,
    )
    yield FigureSpec(
        "rig-residual",
        "What the rig leaves unexplained",
        "F1/V2 less the rig's impedance Zr, with the gains found taken out, test by test with standard uncertainties "
        "of the noise: no tyre can explain it, so it should be zero.",
        rig.residual,
    )
    yield FigureSpec(
        "mass-gain",
        "What the weighed mass gained",
        "Median standard uncertainties in the tests without an added mass, from these alone and from all tests.",
        rig.mass_gain,
    )
    yield FigureSpec(
        "budget",
        "What the uncertainty is made of",
        "Shares of the variance of K2, C and K* by source against frequency.",
        budget.budget,
    )
    yield FigureSpec(
        "model",
        "The chosen model through the data",
        "K' and K'' of each tyre with standard uncertainties, the model's line with its 95 % band, and below what the "
        "model leaves, in standard uncertainties; dashed lines are at ±2.",
        models.models,
    )
    yield FigureSpec(
        "model-choice",
        "Which model, and why",
        "Models that were tried on each tyre, the best first: BIC less the best, chi-square per degree of freedom, and "
        "how well frequencies left out are foretold.",
        choice.choice,
    )
    yield FigureSpec(
        "map",
        "The operating map against the tests",
        "What the map says over the tested conditions, with its 95 % band, and the tests with standard uncertainties; "
        "each colour is a frequency.",
        operating.operating,
    )


#: All figures by their keys, in the order of a report.
FIGURES: dict[str, FigureSpec] = {spec.key: spec for spec in _specs()}


def draw(results: Results, key: str, style: Style | None = None) -> Figure | None:
    """Draw one figure.

    Parameters
    ----------
    results : Results
        The tables of an analysed campaign.
    key : str
        One of `FIGURES`.
    style : Style, optional
        Theme and limits.

    Returns
    -------
    Figure or None
        A matplotlib figure that pyplot knows nothing of; None where the results hold nothing for it.

    Raises
    ------
    CampaignError
        If there is no such figure.
    """
    spec = _spec(key)
    style = style or Style()
    with drawing(style, key):
        return spec.draw(results, style)


def render(figure: Figure, key: str, form: str = "svg", style: Style | None = None) -> bytes:
    """The bytes of a figure; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
        What `draw` gave.
    key : str
        Its name, which goes into the file.
    form : {"svg", "png", "pdf"}
        In SVG, text stays text.
    style : Style, optional
        The one it was drawn with.

    Returns
    -------
    bytes
        The content of a file.

    Raises
    ------
    CampaignError
        If there is no such figure or format.
    """
    if form not in FORMATS:
        raise CampaignError(f"no format {form!r} of a figure: choose one of {', '.join(FORMATS)}")
    title = _spec(key).title
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Date": None, "Creator": "fourpole", "Title": title},
        "png": {"Software": None, "Title": title},
        "pdf": {"CreationDate": None, "Creator": "fourpole", "Producer": None, "Title": title},
    }
    content = io.BytesIO()
    with drawing(style or Style(), key), warnings.catch_warnings():
        # A name in a script that the font lacks: boxes in PNG, itself in SVG.
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        figure.savefig(content, format=form, dpi=_DPI, metadata=metadata[form])
    return _lean(content.getvalue()) if form == "svg" else content.getvalue()


def _lean(svg: bytes) -> bytes:
    """Without digits that no screen shows, and without names of groups, which would meet their like in one page."""
    lines = svg.split(b"\n")
    for at, line in enumerate(lines):
        if b"<text" not in line and b"title>" not in line:
            lines[at] = _GROUP_NAME.sub(b"<g", _DIGITS.sub(rb"\1", line))
    return b"\n".join(lines)


def write_figure(figure: Figure, key: str, path: str | Path, style: Style | None = None) -> Path:
    """Write a figure in one step; the name's ending says as what.

    Parameters
    ----------
    figure : Figure
        What `draw` gave.
    key : str
        Its name.
    path : path
        It ends in .svg, .png or .pdf.
    style : Style, optional
        The one it was drawn with.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CampaignError
        If the ending is none of these.
    FileError
        If the file cannot be written.
    """
    path = Path(path)
    write_bytes(path, render(figure, key, path.suffix.lower().removeprefix("."), style))
    return path


def save_figures(
    results: Results,
    folder: str | Path,
    *,
    keys: Sequence[str] | None = None,
    style: Style | None = None,
    formats: Sequence[str] = ("svg", "png"),
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Path]:
    """Draw figures and write each, as KEY.svg and KEY.png, in one step per file.

    A figure that the results hold nothing for is not written, and an older file of it goes.

    Parameters
    ----------
    results : Results
        The tables of an analysed campaign.
    folder : path
        Made if it does not exist.
    keys : sequence of str, optional
        Figures wanted; by default all of `FIGURES`.
    style : Style, optional
        Theme and limits.
    formats : sequence of {"svg", "png", "pdf"}
        What to write of each.
    progress : callable (done, total), optional
        Called after each figure.

    Returns
    -------
    dict of str to Path
        The file of each figure drawn, in the first of the formats.

    Raises
    ------
    CampaignError
        If a figure or format is unknown, or the folder cannot be made.
    FileError
        If a file cannot be written.
    """
    wanted = list(FIGURES if keys is None else dict.fromkeys(keys))
    for key in wanted:
        _spec(key)
    unknown = [form for form in formats if form not in FORMATS]
    if unknown or not formats:
        raise CampaignError(f"no format {(unknown or [''])[0]!r} of a figure: choose of {', '.join(FORMATS)}")
    folder = make_folder(folder)
    written: dict[str, Path] = {}
    for done, key in enumerate(wanted, start=1):
        figure = draw(results, key, style)
        for form in formats:
            path = folder / f"{key}.{form}"
            if figure is None:
                path.unlink(missing_ok=True)
            else:
                write_bytes(path, render(figure, key, form, style))
        if figure is not None:
            written[key] = folder / f"{key}.{formats[0]}"
        if progress is not None:
            progress(done, len(wanted))
    return written


def _spec(key: str) -> FigureSpec:
    if key not in FIGURES:
        near = get_close_matches(str(key), FIGURES, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"choose one of {', '.join(FIGURES)}"
        raise CampaignError(f"no figure {key!r}: {hint}")
    return FIGURES[key]
