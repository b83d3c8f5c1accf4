"""The commands that make figures and the report from result tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from fourpole.answer import Answer, Table
from fourpole.app.console import option, progress, rising, warn
from fourpole.app.standing import STATEMENT
from fourpole.errors import CampaignError
from fourpole.findings import by_size, findings
from fourpole.io.door import read_bytes, sha256_of
from fourpole.io.folders import resolved
from fourpole.io.published import publishing
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.plot import FIGURES, PAPER, SIZES, Size, Style, draw, figures_of, save_figures, write_figure
from fourpole.plot.catalogue import ON_REQUEST, figure_files, spec_of
from fourpole.plot.notebook import OF_QUANTITY
from fourpole.plot.over import key_over
from fourpole.plot.part import Selection, select
from fourpole.report.html import browser, print_page
from fourpole.report.page import ReportFigure, write_report
from fourpole.report.words.sentence import sentences
from fourpole.study.record import section
from fourpole.study.study import Study
from fourpole.units import quantity, shown

if TYPE_CHECKING:
    from fourpole.app.options import PlotOptions

#: Files that `make_report` writes where all figures have data, with PNG.
PAGE = "report.html"
OF_REPORT = (*(f"figures/{name}" for name in figure_files()), PAGE, "report.pdf")


def make_report(
    results: Study, folder: Path, style: Style | None = None, *, png: bool = False, paper: bool = False
) -> Path:
    """Draw the figures into `folder/figures`, each with `png` in that format, too, and write `folder/report.html`.

    With `paper`, the figures of the 1982 paper are among them.
    """
    formats = ("svg", "png") if png else ("svg",)
    with progress("drawing") as advance:
        files = save_figures(
            results, folder / "figures", keys=figures_of(results, paper=paper), style=style, formats=formats,
            progress=advance,
        )  # fmt: skip
    drawings = {key: read_bytes(path, max_bytes=MAX_FILE_BYTES).decode() for key, path in files.items()}
    figures = {
        key: ReportFigure(key, FIGURES[key].title, FIGURES[key].caption, drawing, FIGURES[key].number)
        for key, drawing in drawings.items()
    }
    page = folder / PAGE
    write_report(results, page, findings=sentences(by_size(findings(results)), results.shown), figures=figures)
    return page


def run_report(results: Study, folder: Path, theme: str, *, png: bool, paper: bool, pdf: bool) -> Answer:
    """Make figures and report from the tables of a results folder."""
    if pdf:
        browser()  # before the work, so that a missing one is said at once
    warn(*results.faults, *_changed(results, folder))
    figures = renew_report(results, folder, Style(theme), png=png, paper=paper, pdf=pdf)
    files = [("report", folder / PAGE), *([("pdf", folder / "report.pdf")] if pdf else [])]
    document = {
        **{what: str(path) for what, path in files},
        "figures": [str(folder / "figures" / name) for name in figures],
        "verdicts": results.counts,
    }
    return Answer((), lambda: document, files)


def renew_report(
    results: Study,
    folder: Path,
    style: Style | None = None,
    *,
    png: bool = False,
    paper: bool = False,
    pdf: bool = False,
) -> list[str]:
    """Make figures and report anew from the results of a folder, and put them among these; names of the figures.

    See `make_report`.
    """
    with publishing(folder, OF_REPORT, basis=results.dynamic_sha256) as new:
        page = make_report(results, new, style, png=png, paper=paper)
        if pdf:
            print_page(page, new / "report.pdf")
        return sorted(path.name for path in new.glob("figures/*"))


def _changed(results: Study, folder: Path) -> list[str]:
    """Statements of the campaign around a results folder that are not those that were analysed, with the remedy."""
    hashes, campaign = section(results.record, "sha256"), resolved(folder).parent
    changed = []
    for name in STATEMENT:
        path = campaign / name
        if hashes and path.is_file() and sha256_of(path, max_bytes=MAX_FILE_BYTES) != hashes.get(name):
            changed.append(name)
    if not changed:
        return []
    return [f"{' and '.join(changed)} changed since the analysis: run fourpole analyse {folder.parent} to use that"]


_INCH = 0.0254
#: Dots per inch of a PNG, for screens and for printing.
_SCREEN, _PRINT = 150, 300
_SIZE = re.compile(r"\s*([0-9.,]+)\s*+([a-z]*?)\s*+[x×]\s*([0-9.,]+)\s*([a-z]+)\s*", re.IGNORECASE)


def run_plot(results: Study, folder: Path, figure: str | None, file: Path | None, options: PlotOptions) -> Answer:
    """Draw one figure, or those of the paper, or list the figures there are."""
    key, selection, style = figure, _selection(options), _style(options)
    if selection != Selection():
        results = select(results, selection)
    if options.over is not None:
        if key is None:
            raise CampaignError("--over: name the quantity, as in fourpole plot RESULTS K2 --over pressure")
        key = key_over(key, options.over)
    if key is not None:
        return Answer(files=[("figure", draw_one(results, folder, OF_QUANTITY.get(key, key), file, style))])
    if not options.paper:
        rows = [(one, FIGURES[one].title) for one in (*figures_of(results), *ON_REQUEST)]
        hint = "\ndraw one with fourpole plot RESULTS FIGURE; --paper has the figures of the 1982 paper"
        return Answer([Table(("figure", "shows"), rows), hint], lambda: {"figures": dict(rows)})
    if file is not None:
        raise CampaignError("--out is for one figure: the figures of the paper go into RESULTS/figures")
    with publishing(folder, basis=results.dynamic_sha256) as new:
        made = save_figures(results, new / "figures", keys=list(PAPER), style=style)
    drawn = [str(folder / "figures" / path.name) for path in made.values()]
    return Answer([f"figures: {len(made)} in {folder / 'figures'}"], lambda: {"figures": drawn})


def draw_one(results: Study, folder: Path, key: str, file: Path | None, style: Style) -> Path:
    """Draw one figure into a file, or among the results of a folder; returns its path."""
    drawing = draw(results, key, style)
    if drawing is None:
        raise CampaignError(f"the results in {folder} hold no data for {key}: {spec_of(key).title}")
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        return write_figure(drawing, key, file, style)
    with publishing(folder, basis=results.dynamic_sha256) as new:
        (new / "figures").mkdir()
        return folder / "figures" / write_figure(drawing, key, new / "figures" / f"{key}.svg", style).name


def _selection(options: PlotOptions) -> Selection:
    return Selection(
        specimens=tuple(options.specimen or ()),
        tests=tuple(options.test or ()),
        pressures=_quantities(options.pressure, "pressure", "--pressure"),
        preloads=_quantities(options.preload, "force", "--preload"),
        temperatures=_quantities(options.temperature, "temperature", "--temperature"),
        labels=_pairs(options.label, "--label", 'radial="Tyre A"'),
        colours={name: _colour(text) for name, text in _pairs(options.colour, "--colour", "radial=#0072b2").items()},
    )


def _quantities(texts: Sequence[str] | None, kind: str, name: str) -> tuple[float, ...]:
    return tuple(option(text, kind, name) for text in texts or ())


def _pairs(texts: Sequence[str] | None, name: str, example: str) -> dict[str, str]:
    """What is stated of each specimen."""
    pairs = {}
    for text in texts or ():
        specimen, sign, value = text.partition("=")
        if not (specimen and sign and value):
            raise CampaignError(f"{name}: {shown(text)} is no SPECIMEN=VALUE, as {example}")
        pairs[specimen.strip()] = value.strip()
    return pairs


def _colour(text: str) -> str:
    """A colour as #rrggbb."""
    from matplotlib.colors import CSS4_COLORS

    if re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        return text.lower()
    if text.lower() in CSS4_COLORS:
        return str(CSS4_COLORS[text.lower()]).lower()
    near = get_close_matches(text.lower(), CSS4_COLORS, n=1)
    hint = f"did you mean {near[0]}?" if near else "write it as #0072b2, or by a name such as navy"
    raise CampaignError(f"--colour: {shown(text)} is no colour: {hint}")


def _style(options: PlotOptions) -> Style:
    limits = [
        None if text is None else rising(text, name, "10:24")
        for name, text in (("--xlim", options.xlim), ("--ylim", options.ylim))
    ]
    dpi = options.dpi or (_PRINT if options.size == "journal" else _SCREEN)
    return Style(options.theme, xlim=limits[0], ylim=limits[1], size=_size(options.size), dpi=dpi)


def _size(text: str) -> Size:
    """A size by name, or as width x height."""
    if text.lower() in SIZES:
        return SIZES[text.lower()]
    found = _SIZE.fullmatch(text)
    if found is None:
        near = get_close_matches(text.lower(), SIZES, n=1)
        hint = f"did you mean {near[0]}?" if near else f"choose {', '.join(SIZES)}, or state it as '89x60 mm'"
        raise CampaignError(f"--size: {shown(text)} is no size: {hint}")
    wide, first, high, last = found.groups()
    width, height = (
        quantity(f"{number} {unit}", "displacement") for number, unit in ((wide, first or last), (high, last))
    )
    return Size(width / _INCH, height / _INCH)
