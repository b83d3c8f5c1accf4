"""A small analysed campaign, made once, a server of a copy of it for all modules, and a browser."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from tests.kept import kept
from tests.report.browser import launched
from tests.selection import EVERY, share, turn
from tests.served.server import Server, serving

from fourpole.app.analysis import run_analysis
from fourpole.app.options import RunOptions, Wanted
from fourpole.plot import figures_of
from fourpole.report.page import FRONT
from fourpole.study.study import Study
from fourpole.virtual import simulate_campaign

#: Figures of the front and of the page of models.
DRAWN = (*FRONT, "storage-loss", "model-choice", "spectrum", "amplitude")


def _drawn(results: Study, **more: bool) -> list[str]:
    """Those, and of the others a fourth by turns: all of them take longer than the analysis."""
    return [key for number, key in enumerate(figures_of(results, **more)) if key in DRAWN or share(number, 4)]


def _analysed(folder: Path) -> None:
    simulate_campaign(folder, pressures=[170e3, 240e3], preloads=[1000.0], frequencies=[10.0, 13.0, 16.0, 20.0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fourpole.app.report.figures_of", _drawn)
        run_analysis(folder, None, "joint", 0, RunOptions(workers=1), Wanted(models=True), as_json=True)


@pytest.fixture(scope="session")
def analysed() -> Path:
    """A campaign with its results, its models and its report; tests copy it."""
    return kept("served", _analysed, DRAWN, EVERY, turn())


@pytest.fixture(scope="session")
def server(analysed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with one campaign, which each test leaves as it was."""
    root = tmp_path_factory.mktemp("root")
    shutil.copytree(analysed, root / "radial and cross")
    with serving(root) as running:
        yield running


@pytest.fixture(scope="session")
def empty_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server of a folder in which nothing is; each test empties it again."""
    with serving(tmp_path_factory.mktemp("empty")) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with launched() as running:
        yield running
