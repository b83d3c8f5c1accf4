"""No command harms on folders that were made to harm: it says what is wrong, writes and runs nothing outside."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest
from scipy.io import savemat
from tests.hostile import Corpus, cases, corpus, state_of

pytestmark = [pytest.mark.thorough, pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs the files of Unix")]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Corpus]:
    with corpus(tmp_path_factory.mktemp("hostile")) as made:
        yield made


@pytest.mark.sampled(4)
def test_every_command_ends_with_a_message_and_changes_nothing_outside(folders: Corpus) -> None:
    before = state_of(folders.template)
    said = [folders.complaint(case) for case in cases(every=False)]
    assert [text for text in said if text] == []
    assert state_of(folders.template) == before  # which one command compares with


SHADOWS = (
    "typer/__init__.py", "struct.py", "pickle.py", "json.py", "multiprocessing/__init__.py", "fourpole/__init__.py",
    "sitecustomize.py", "usercustomize.py", "numpy.py", "polars.py", "matplotlib/__init__.py", "tests.py",
)  # fmt: skip


@pytest.mark.sampled(4)
def test_no_module_beside_campaign_and_recordings_is_run(folders: Corpus, tmp_path: Path) -> None:
    """Recordings that a library reads start a worker process; the figures of the report start others."""
    campaign, ran = Path(shutil.copytree(folders.template, tmp_path / "campaign")), tmp_path / "ran"
    ran.mkdir()
    recording = campaign / "recordings" / "D1.csv"
    savemat(recording.with_suffix(".mat"), pl.read_csv(recording).to_dict(as_series=False))
    table = campaign / "tests.csv"
    table.write_text(table.read_text().replace("D1.csv", "D1.mat"))
    for place in (campaign, campaign / "recordings", campaign / "results"):
        for name in SHADOWS:
            (place / name).parent.mkdir(exist_ok=True)
            (place / name).write_text(f"open({str(ran / 'it')!r}, 'a').write(__file__)\nraise SystemExit(9)\n")
    before = state_of(ran)
    command = [sys.executable, "-P", "-m", "fourpole", "analyse", ".", "--workers", "2"]  # as the command `fourpole` is
    done = subprocess.run(command, cwd=campaign, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 3), done.stderr
    assert state_of(ran) == before, (ran / "it").read_text()
