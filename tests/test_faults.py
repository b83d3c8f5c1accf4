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


def complaints(experiment: Experiment, faults: list[Fault]) -> list[str]:
    return [said for fault in faults if (said := experiment.complaint(fault))]


def test_every_fault_while_results_are_published_leaves_the_former_or_the_new_ones(tmp_path: Path) -> None:
    with publishing_experiment(tmp_path) as experiment:
        faults = experiment.faults
        assert len(faults) > 250
        assert {fault.kind for fault in faults} == {"SIGKILL", "EIO", "EACCES", "ENOSPC", "full"}
        assert complaints(experiment, faults) == []


def test_faults_of_an_analysis_leave_the_former_or_the_new_results(tmp_path: Path) -> None:
    with analysis_experiment(tmp_path) as experiment:
        faults = experiment.faults
        begun = next(number for number, fault in enumerate(faults) if "/results/.store" in fault.call.line)
        assert begun > 2 * BEFORE
        choice = random.Random(1982)
        chosen = choice.sample(faults[:begun], BEFORE) + choice.sample(faults[begun:], AFTER)
        assert complaints(experiment, chosen) == []
