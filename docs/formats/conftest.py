"""What the examples of these pages begin with: a folder, the command in it, and two signals."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr
from pathlib import Path

import numpy as np
import pytest

from fourpole.app.cli import app


@pytest.fixture(autouse=True)
def signals(request: pytest.FixtureRequest, tmp_path: Path, doctest_namespace: dict[str, object]) -> Iterator[None]:
    """Names of README.md, "The examples"; no other page knows them."""
    if request.path.name == "channels.md":
        yield
        return

    def fourpole(*words: str) -> None:
        """The command, in the folder, with its messages."""
        with redirect_stderr(sys.stdout), chdir(tmp_path):
            app(words, standalone_mode=False)

    time = np.arange(2000) / 1000
    turning = 2 * np.pi * 12 * time
    names = {"fourpole": fourpole, "folder": tmp_path, "np": np, "time": time}
    doctest_namespace.update(names, F1=50 * np.sin(turning), V1=0.07 * np.cos(turning))
    yield
    doctest_namespace.clear()
