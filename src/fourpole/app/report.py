"""The command that makes figures and the report from result tables."""

from __future__ import annotations

from pathlib import Path

from fourpole.app.console import out, progress, warn
from fourpole.campaign.folder import LIMITS
from fourpole.findings import by_size, findings
from fourpole.io.door import read_bytes, sha256_of
from fourpole.io.folders import resolved
from fourpole.io.published import publishing
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.plot import FIGURES, Style, figures_of, save_figures
from fourpole.plot.catalogue import figure_files
from fourpole.report.page import ReportFigure, write_report
from fourpole.report.pdf import browser, print_page
from fourpole.report.words.sentence import sentences
from fourpole.study.record import section
from fourpole.study.study import Study

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


def run_report(results: Study, folder: Path, theme: str, *, png: bool, paper: bool, pdf: bool) -> None:
    """Make figures and report from the tables of a results folder, and print the path of the report."""
    if pdf:
        browser()  # before the work, so that a missing one is said at once
    for fault in (*results.faults, *_changed(results, folder)):
        warn(fault)
    renew_report(results, folder, Style(theme), png=png, paper=paper, pdf=pdf)
    out(f"report: {folder / PAGE}")
    if pdf:
        out(f"pdf: {folder / 'report.pdf'}")


def renew_report(
    results: Study,
    folder: Path,
    style: Style | None = None,
    *,
    png: bool = False,
    paper: bool = False,
    pdf: bool = False,
) -> None:
    """Make figures and report anew from the results of a folder, and put them among these; see `make_report`."""
    with publishing(folder, OF_REPORT, basis=results.dynamic_sha256) as new:
        page = make_report(results, new, style, png=png, paper=paper)
        if pdf:
            print_page(page, new / "report.pdf")


def _changed(results: Study, folder: Path) -> list[str]:
    """Statements of the campaign around a results folder that are not those that were analysed, with the remedy."""
    hashes, campaign = section(results.record, "sha256"), resolved(folder).parent
    changed = []
    for name in ("campaign.toml", "tests.csv", LIMITS):
        path = campaign / name
        if hashes and path.is_file() and sha256_of(path, max_bytes=MAX_FILE_BYTES) != hashes.get(name):
            changed.append(name)
    if not changed:
        return []
    return [f"{' and '.join(changed)} changed since the analysis: run fourpole analyse {folder.parent} to use that"]
