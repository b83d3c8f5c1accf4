"""A specimen whose K* steps during the run: what is asked for, where, and K* with its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from tests.core.joint.worlds import DESIGNS, draw_world

from fourpole.core.joint import solve_joint
from fourpole.core.joint.joint import parts_of_run
from fourpole.core.joint.outputs import identification
from fourpole.core.sources import Kind


def test_the_parts_of_a_run_have_equally_many_tests_of_each_specimen():
    specimen, time = np.repeat([0, 1], [16, 3]), np.append(np.arange(16.0)[::-1], [5.0, 5.0, 9.0])
    part = parts_of_run(specimen, time)
    assert part[:16].tolist() == np.repeat(np.arange(8), 2)[::-1].tolist()
    assert part[16:].tolist() == [0, 0, 5]  # tests of one time are not parted


@pytest.mark.sampled(8)
def test_a_step_is_asked_for_and_k_is_right_on_both_sides():
    design = replace(DESIGNS["tyre-five"], repeats=2)
    world = draw_world(np.random.default_rng([8, 2]), design, "step of K*", 30.0)
    joint = solve_joint(world.phasors, world.rig, world.k1, **world.keywords())
    assert any(source.kind is Kind.STEP for source in joint.misfit.specimens)
    assert joint.misfit.fits
    found = identification(joint, world.phasors, world.k1, 0.0)
    error = (found.stiffness - world.stiffness).real / np.sqrt(found.stiffness_covariance[:, 0, 0])
    assert np.nanmax(np.abs(error[joint.outlier == 1])) < 4
