"""Faults that recordings show by themselves, as causes of a misfit."""

from dataclasses import replace

import numpy as np
import pytest
from tests.faulty import drifting

from fourpole.core.checks import Check, Code, Verdict, reported
from fourpole.study.analysis import analyse
from fourpole.study.rig_estimate import NoteCode, RigEstimate
from fourpole.study.rig_solution import with_recordings
from fourpole.virtual import RADIAL_PLY, simulate_campaign
from fourpole.virtual.plan import plan_tests

FITTED = RigEstimate("", chi2=900.0, dof=100.0)
MISFIT, LOST = replace(FITTED, fits=False), replace(FITTED, converged=False, reason="no step helps")


def shown(count):
    """Checks of ten recordings of which some show a specimen that is not linear, and one a wandering speed."""
    linear = Check(Code.LINEARITY, Verdict.OK, 0.0, 0.02)
    bent = reported(Code.LINEARITY, Verdict.WARNING, 0.1, 0.02)
    speed = reported(Code.SPEED, Verdict.WARNING, 0.1, shift=0.1)
    return [[bent if i < count else linear, *([] if i else [speed])] for i in range(10)]


@pytest.mark.parametrize(
    ("estimate", "count", "named"),
    [(FITTED, 10, False), (MISFIT, 4, False), (MISFIT, 5, True), (LOST, 1, False), (LOST, 2, True)],
)
def test_a_fault_of_many_recordings_is_the_first_cause(estimate, count, named):
    found = with_recordings(estimate, shown(count))
    said = [found.note(code) for code in found.notes]
    assert any(f"what {count} of 10 recordings show: the specimen is not linear" in note for note in said) == named
    assert found.tied == named


def test_a_solution_that_does_not_converge_says_what_the_recordings_show_and_what_to_do():
    note = with_recordings(LOST, shown(3)).note(NoteCode.NOT_CONVERGED)
    assert note.startswith("the joint route did not converge: no step helps; best explained by what 3 of 10 recordings")
    assert note.endswith("; use --route relative")
    assert LOST.note(NoteCode.NOT_CONVERGED) == (
        "the joint route did not converge: no step helps; use --route relative"
    )


@pytest.mark.thorough
@pytest.mark.parametrize("plan", [{"repeats": 3}, {"added_masses": (0.0, 10.0)}])
@pytest.mark.sampled(2)
def test_a_drift_is_noted_or_stands_in_a_tie_with_an_error_of_a_sensor(tmp_path, plan):
    """Each test without the mass is followed by that with it: V1 0.5 ms late looks as a drift of 1 % does."""
    tests = plan_tests([RADIAL_PLY], [170e3], [1000.0], np.linspace(10.0, 24.0, 8).tolist(), **plan)
    simulate_campaign(tmp_path / "one", seed=3, preloads=[1000.0], tests=drifting(tests, 0.05))
    study = analyse(tmp_path / "one")
    (rig,) = study.rigs
    alone = rig.fits and NoteCode.DRIFT in rig.notes
    tied = not rig.fits and any(cause.form in ("drift", "block") for cause in rig.causes)
    assert alone or tied
    assert study.dynamic["verdict"].unique().to_list() == ["ok" if rig.fits else "warning"]
