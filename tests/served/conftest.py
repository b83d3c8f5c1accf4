"""A small analysed campaign, made once, and servers of copies of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.kept import kept
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


@pytest.fixture(scope="module")
def server(analysed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with one campaign."""
    root = tmp_path_factory.mktemp("root")
    shutil.copytree(analysed, root / "radial and cross")
    with serving(root) as running:
        yield running
