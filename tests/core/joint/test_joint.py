"""K* to start from: the closed-form route that suits what is stated."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.joint.joint import closed_form_start
from fourpole.virtual.phasor_rig import Laboratory

PERFECT = Laboratory(
    moving_mass=(15.0, 0.0), preload_stiffness=(12440.0, 0.0), preload_damping=(15.0, 0.0), std_added=0.0
)


def start_of(made):
    problem = made.problem()
    return closed_form_start(problem.observed, problem.conditions, problem.shared, made.channels), problem


@pytest.mark.parametrize("absent", [None, 0, 1, 2])
def test_where_all_is_exact_any_route_gives_the_truth(make, absent):
    made = make(PERFECT, masses=(0.0, 10.0), frequencies=3, families=2)
    if absent is not None and absent != 1:
        made = made.without(absent, slice(None))
    elif absent == 1:
        made = made.without(2, [0, 3]).without(0, [1, 6])
    start, problem = start_of(made)
    # round-off, where mass and spring, or force and motion, cancel to a tenth
    assert np.abs(start / made.campaign.stiffness[problem.conditions.starts] - 1).max() < 1e-12


def test_the_better_sensors_decide(make):
    """V2 off by 10 % and known as such: the mobility route, which does not need it."""
    lab = replace(PERFECT, std_gain=(0.0, 0.0, 0.1), undeclared={"gain V2": 0.1})
    made = make(lab, frequencies=3, families=2)
    start, problem = start_of(made)
    assert np.abs(start / made.campaign.stiffness[problem.conditions.starts] - 1).max() < 1e-10


def test_a_rig_hardly_known_does_not_decide(make):
    """The mass is off by 20 % and known as such: the relative route."""
    lab = replace(PERFECT, moving_mass=(15.0, 3.0), undeclared={"moving_mass": 18.0})
    made = make(lab, frequencies=3, families=2)
    start, problem = start_of(made)
    assert np.abs(start / made.campaign.stiffness[problem.conditions.starts] - 1).max() < 1e-10


def test_the_input_mass_is_taken_off(make):
    made = make(replace(PERFECT, input_mass=(2.0, 0.0)), frequencies=3, families=1)
    start, problem = start_of(made)
    assert np.abs(start / made.campaign.stiffness[problem.conditions.starts] - 1).max() < 1e-12


def test_there_is_a_start_where_no_route_is_possible(make):
    """V1 alone says nothing, but the search must begin somewhere."""
    made = make(PERFECT, frequencies=2, families=1).without(0, slice(None)).without(2, slice(None))
    start, _ = start_of(made)
    assert np.all(np.isfinite(start))


def test_blocks_alone_need_no_start(make):
    made = make(PERFECT, frequencies=2, families=1, blocks=(5.0,))
    start, _ = start_of(made.part(made.family < 0))
    assert start.shape == (0,)
