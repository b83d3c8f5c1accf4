"""The commands that make figures and the report from result tables."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

from fourpole.app.console import out, progress, warn
from fourpole.errors import CampaignError
from fourpole.findings import findings
from fourpole.io.staging import staged
from fourpole.plot import FIGURES, Style, draw, save_figures, write_figure
from fourpole.plot.catalogue import figure_files
from fourpole.report.page import ReportFigure, write_report
from fourpole.report.words.sentence import sentences
from fourpole.study.results import Results

#: Files that `make_report` writes where all figures have data, with PNG.
OF_REPORT = (*(f"figures/{name}" for name in figure_files()), "report.html")


def make_report(
    results: Results,
    folder: Path,
    style: Style | None = None,
    *,
    png: bool = False,
    executor: Executor | None = None,
) -> Path:
    """Draw all figures into `folder/figures`, each with `png` in that format, too, and write `folder/report.html`."""
    formats = ("svg", "png") if png else ("svg",)
    with progress("drawing") as advance:
        files = save_figures(
            results, folder / "figures", style=style, formats=formats, progress=advance, executor=executor
        )
    figures = {
        key: ReportFigure(key, FIGURES[key].title, FIGURES[key].caption, path.read_text(encoding="utf-8"))
        for key, path in files.items()
    }
    page = folder / "report.html"
    write_report(results, page, findings=sentences(findings(results)), figures=figures)
    return page


def run_report(results: Results, folder: Path, theme: str, *, png: bool = False) -> None:
    """Make figures and report from the tables of a results folder, and print the path of the report."""
    for fault in results.faults:
        warn(fault)
    with staged(folder, OF_REPORT) as new:
        page = make_report(results, new, Style(theme), png=png)
    out(f"report: {folder / page.name}")


def run_plot(results: Results, folder: Path, key: str, file: Path | None, style: Style) -> None:
    """Draw one figure into a file, by default in the folder of the other figures."""
    figure = draw(results, key, style)
    if figure is None:
        raise CampaignError(f"the results in {folder} hold no data for {key}: {FIGURES[key].title}")
    path = file if file is not None else folder / "figures" / f"{key}.svg"
    path.parent.mkdir(parents=True, exist_ok=True)
    out(f"figure: {write_figure(figure, key, path, style)}")
