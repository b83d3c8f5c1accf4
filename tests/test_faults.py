"""Calls of the system that fail, or at which the process is killed: results are the former ones or the new ones."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest
from tests.faults import Experiment, Fault, analysis_experiment, publishing_experiment
from tests.selection import turn

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(
        shutil.which("strace") is None and os.environ.get("CI", "").lower() not in ("1", "true", "yes"),
        reason="strace is not installed: make strace",
    ),
]

#: Faults of an analysis before the first file is in the store, and from there; each takes a second. They are others
#: after each change of the sources, and `make faults` tries all.
BEFORE, AFTER = 3, 10
#: Faults of the publishing, of more than 250, besides one of each kind at each call.
PUBLISHED = 30


def one_of_each(faults: list[Fault], choice: random.Random) -> list[Fault]:
    """One fault of each kind at each call of the system: most of all faults are of calls that only look at a file."""
    alike: dict[tuple[str, str], list[Fault]] = {}
    for fault in faults:
        alike.setdefault((fault.kind, fault.call.name), []).append(fault)
    return [choice.choice(several) for several in alike.values()]


def complaints(experiment: Experiment, faults: list[Fault]) -> list[str]:
    return [said for fault in faults if (said := experiment.complaint(fault))]


@pytest.mark.sampled(4)
def test_faults_while_results_are_published_leave_the_former_or_the_new_ones(tmp_path: Path) -> None:
    with publishing_experiment(tmp_path) as experiment:
        faults = experiment.faults
        assert len(faults) > 250
        assert {fault.kind for fault in faults} == {"SIGKILL", "EIO", "EACCES", "ENOSPC", "full"}
        choice = random.Random(turn())
        chosen = one_of_each(faults, choice) + choice.sample(faults, PUBLISHED)
        assert complaints(experiment, chosen) == []


@pytest.mark.sampled(4)
def test_faults_of_an_analysis_leave_the_former_or_the_new_results(tmp_path: Path) -> None:
    with analysis_experiment(tmp_path) as experiment:
        faults = experiment.faults
        begun = next(number for number, fault in enumerate(faults) if "/results/.store" in fault.call.line)
        assert begun > 2 * BEFORE
        choice = random.Random(turn())
        each = one_of_each(faults[begun:], choice)
        assert len(each) > AFTER
        chosen = choice.sample(faults[:begun], BEFORE) + choice.sample(each, AFTER)
        assert complaints(experiment, chosen) == []
