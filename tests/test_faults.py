"""Calls of the system that fail, or at which the process is killed: results are the former ones or the new ones."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest
from tests.faults import Experiment, Fault, analysis_experiment, publishing_experiment

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(
        shutil.which("strace") is None and os.environ.get("CI", "").lower() not in ("1", "true", "yes"),
        reason="strace is not installed: make strace",
    ),
]

#: Faults of an analysis before the first file is in the store, and from there.
BEFORE, AFTER = 10, 30
#: Faults of the publishing, of more than 250: `python -m tests.faults` tries all.
PUBLISHED = 150


def complaints(experiment: Experiment, faults: list[Fault]) -> list[str]:
    return [said for fault in faults if (said := experiment.complaint(fault))]


def test_faults_while_results_are_published_leave_the_former_or_the_new_ones(tmp_path: Path) -> None:
    with publishing_experiment(tmp_path) as experiment:
        faults = experiment.faults
        assert len(faults) > 250
        assert {fault.kind for fault in faults} == {"SIGKILL", "EIO", "EACCES", "ENOSPC", "full"}
        chosen = random.Random(1982).sample(faults, PUBLISHED)
        assert {fault.kind for fault in chosen} == {fault.kind for fault in faults}
        assert complaints(experiment, chosen) == []


def test_faults_of_an_analysis_leave_the_former_or_the_new_results(tmp_path: Path) -> None:
    with analysis_experiment(tmp_path) as experiment:
        faults = experiment.faults
        begun = next(number for number, fault in enumerate(faults) if "/results/.store" in fault.call.line)
        assert begun > 2 * BEFORE
        choice = random.Random(1982)
        chosen = choice.sample(faults[:begun], BEFORE) + choice.sample(faults[begun:], AFTER)
        assert complaints(experiment, chosen) == []
