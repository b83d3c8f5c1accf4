"""The figures by key, in the order of a report, and the files that they are written to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import replace
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

import polars as pl
from matplotlib.figure import Figure

from fourpole.errors import CampaignError
from fourpole.io.folders import make_folder
from fourpole.io.write import write_bytes
from fourpole.plot.cards import strided
from fourpole.plot.data import FigureData, FigureSpec
from fourpole.plot.layout import FORMATS, figure_bytes
from fourpole.plot.over import spec_over
from fourpole.plot.part import own_colours, part_of
from fourpole.plot.sheet import read_sheet
from fourpole.plot.style import Style, drawing
from fourpole.study.study import Study
from fourpole.words import package_toml

#: Number of tasks into which the figures are divided for workers; each task has its own copy of the tables.
_GROUPS = 6
#: Figures of model.json.
_OF_MODELS = {"model-choice", "spectrum", "amplitude"}


def _specs(room: str) -> dict[str, FigureSpec]:
    """The figures of the catalogue.toml of a room, with the functions that make them."""
    specs = {}
    for key, entry in package_toml(room, "catalogue.toml").items():
        make = import_module(f"{room}.{entry.pop('module')}").FIGURES[key]
        how = {"draw" if entry.pop("line_art", False) else "data": make}
        specs[key] = FigureSpec(key, **entry, **how)
    return specs


#: The paper's figures by their keys, in its order.
PAPER: dict[str, FigureSpec] = _specs("fourpole.paper1982")
#: All figures by their keys: those of the first page of a report, those by question, those of the paper.
FIGURES: dict[str, FigureSpec] = _specs("fourpole.plot") | PAPER


#: Figures that are drawn where they are named, not in a report, whose cards show the same.
ON_REQUEST = ("signals",)


def figures_of(results: Study, *, paper: bool = False) -> list[str]:
    """Keys of the figures that a report of these results shows, in its order.

    Parameters
    ----------
    results : Study
        The tables of an analysed campaign.
    paper : bool
        Whether the figures of the 1982 paper follow those by question.

    Returns
    -------
    list of str
        The first two are those of the first page. `save_figures` leaves out those for which the results hold nothing.
    """
    without = {*ON_REQUEST} | (set() if results.models is not None else _OF_MODELS)
    without |= set() if results.maps is not None else {"map"}
    return [key for key in FIGURES if key not in without and (paper or key not in PAPER)]


def draw(results: Study, key: str, style: Style | None = None) -> Figure | None:
    """Draw one figure.

    Parameters
    ----------
    results : Study
        The tables of an analysed campaign.
    key : str
        One of `FIGURES`, or what `fourpole.plot.over.key_over` makes of a quantity and an axis.
    style : Style, optional
        Theme and limits.

    Returns
    -------
    Figure or None
        A matplotlib figure that is not registered with pyplot; None if the results hold nothing that it shows. Of a
        test with many lines it shows some.

    Raises
    ------
    CampaignError
        If there is no such figure.
    """
    from fourpole.plot.drawn import figure_of  # slow to load

    spec = spec_of(key)
    style = style or Style()
    results = strided(results)
    part = part_of(results)
    if part is not None and part.selection.colours:
        names = read_sheet(results, texts_only=not spec.apart).names
        style = replace(style, own=own_colours(part, names))
    with drawing(style, key):
        if spec.draw is not None:
            return spec.draw(results, style)
        data = spec.data(results) if spec.data is not None else None
        return None if data is None else figure_of(data, style)


def figure_data(results: Study, key: str) -> FigureData | None:
    """A figure by question as data: series with values in the units of the axes, uncertainties and tests.

    Raises
    ------
    CampaignError
        If there is no such figure, or it is not made of data.

    Examples
    --------
    >>> none = pl.DataFrame()
    >>> figure_data(Study(none, none, none), "stiffness") is None
    True
    """
    spec = spec_of(key)
    if spec.data is None:
        with_data = ", ".join(one.key for one in FIGURES.values() if one.data is not None)
        raise CampaignError(f"the figure {key!r} is drawn, not made of data: choose one of {with_data}")
    return spec.data(results)


def render(figure: Figure, key: str, form: str = "svg", style: Style | None = None) -> bytes:
    """The content of a figure's file; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
        A figure that `draw` returned.
    key : str
        Key of the figure in `FIGURES`; its title is written into the file.
    form : {"svg", "png", "pdf"}
        Format of the file; in SVG, text stays text.
    style : Style, optional
        The style that the figure was drawn with.

    Returns
    -------
    bytes
        The content of a file.

    Raises
    ------
    CampaignError
        If there is no such figure or format.
    """
    return figure_bytes(figure, key, spec_of(key).title, form, style)


def write_figure(figure: Figure, key: str, path: str | Path, style: Style | None = None) -> Path:
    """Write a figure in one step; the ending of the file's name is the format.

    Parameters
    ----------
    figure : Figure
        A figure that `draw` returned.
    key : str
        Key of the figure in `FIGURES`.
    path : path
        The file; its name ends in .svg, .png or .pdf.
    style : Style, optional
        The style that the figure was drawn with.

    Returns
    -------
    Path
        The file that was written.

    Raises
    ------
    CampaignError
        If there is no such figure, or the name has another ending.
    FileError
        If the file cannot be written.
    """
    path = Path(path)
    write_bytes(path, render(figure, key, path.suffix.lower().removeprefix("."), style))
    return path


def save_figures(
    results: Study,
    folder: str | Path,
    *,
    keys: Sequence[str] | None = None,
    style: Style | None = None,
    formats: Sequence[str] = ("svg",),
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> dict[str, Path]:
    """Draw figures and write each as KEY.svg, or in other formats, each file in one step.

    If the results hold nothing that a figure shows, its files are removed from the folder.

    Parameters
    ----------
    results : Study
        The tables of an analysed campaign.
    folder : path
        Folder of the files; it is made if it does not exist.
    keys : sequence of str, optional
        Keys of the figures; by default those of `figures_of`.
    style : Style, optional
        Theme and limits.
    formats : sequence of {"svg", "png", "pdf"}
        Formats in which each figure is written.
    progress : callable (done, total), optional
        This function is called after each figure.
    executor : concurrent.futures.Executor, optional
        Workers in which the figures are drawn, in groups; by default they are drawn in this thread.

    Returns
    -------
    dict of str to Path
        The file of each figure that was drawn, in the first of the formats.

    Raises
    ------
    CampaignError
        If a figure or format is unknown, or the folder cannot be made.
    FileError
        If a file cannot be written.
    """
    wanted = list(dict.fromkeys(figures_of(results) if keys is None else keys))
    for key in wanted:
        spec_of(key)
    unknown = [form for form in formats if form not in FORMATS]
    if unknown or not formats:
        raise CampaignError(f"no format {(unknown or [''])[0]!r} of a figure: choose of {', '.join(FORMATS)}")
    folder = make_folder(folder)
    written: set[str] = set()
    for done, (key, drawings) in enumerate(_drawings(results, wanted, style, formats, executor), start=1):
        for form in formats:
            path = folder / f"{key}.{form}"
            if form in drawings:
                write_bytes(path, drawings[form])
                written.add(key)
            else:
                path.unlink(missing_ok=True)
        if progress is not None:
            progress(done, len(wanted))
    return {key: folder / f"{key}.{formats[0]}" for key in wanted if key in written}


def _drawings(
    results: Study, keys: Sequence[str], style: Style | None, formats: Sequence[str], executor: Executor | None
) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Each figure's key and files by format, in any order; no files where the results hold nothing that it shows."""
    if executor is None:
        yield from ((key, _drawing(results, key, style, formats)) for key in keys)
        return
    # The previews are the largest table, and figures show those of static tests only.
    previews = results.previews
    if previews.height:
        previews = previews.filter(pl.col("test").is_in(results.static["test"].to_list()))
    light = replace(results, tables={**results.tables, "previews": previews})
    tasks = [executor.submit(_group, light, keys[at::_GROUPS], style, formats) for at in range(_GROUPS)]
    try:
        for task in as_completed(tasks):
            yield from task.result()
    finally:
        for task in tasks:
            task.cancel()


def _group(
    results: Study, keys: Sequence[str], style: Style | None, formats: Sequence[str]
) -> list[tuple[str, dict[str, bytes]]]:
    """Some figures, as one task of a worker."""
    return [(key, _drawing(results, key, style, formats)) for key in keys]


def _drawing(results: Study, key: str, style: Style | None, formats: Sequence[str]) -> dict[str, bytes]:
    """The content of the files of one figure by format; empty if the results hold nothing that it shows."""
    figure = draw(results, key, style)
    return {} if figure is None else {form: render(figure, key, form, style) for form in formats}


def figure_files(keys: Sequence[str] | None = None, formats: Sequence[str] = ("svg", "png")) -> list[str]:
    """Names of the files that `save_figures` writes where all figures have data."""
    return [f"{key}.{form}" for key in (FIGURES if keys is None else keys) for form in formats]


def spec_of(key: str) -> FigureSpec:
    """The entry of a figure; CampaignError if there is none."""
    if (over := spec_over(str(key))) is not None:
        return over
    if key not in FIGURES:
        near = get_close_matches(str(key), FIGURES, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"choose one of {', '.join(FIGURES)}"
        raise CampaignError(f"no figure {key!r}: {hint}")
    return FIGURES[key]
