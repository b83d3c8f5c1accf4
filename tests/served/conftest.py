"""A small analysed campaign, made once, a server of a copy of it for all modules, and a browser."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from tests.kept import kept
from tests.report.browser import launched
from tests.served.server import Server, serving

from fourpole.app.analysis import run_analysis
from fourpole.app.options import RunOptions, Wanted
from fourpole.virtual import simulate_campaign


def _analysed(folder: Path) -> None:
    simulate_campaign(folder, pressures=[170e3, 240e3], preloads=[1000.0], frequencies=[10.0, 13.0, 16.0, 20.0])
    run_analysis(folder, None, "joint", 0, RunOptions(workers=1), Wanted(models=True), as_json=True)


@pytest.fixture(scope="session")
def analysed() -> Path:
    """A campaign with its results, its models and its report; tests copy it."""
    return kept("served", _analysed)


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
