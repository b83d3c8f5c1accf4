"""Gross errors of a statement: a unit, a sign, exchanged columns; each is named, and nothing smaller is."""

import numpy as np
import pytest

from fourpole.core.joint.misfit import gross_errors
from fourpole.virtual.phasor_rig import Laboratory
from fourpole.words import cause_words

pytestmark = pytest.mark.thorough

USUAL = Laboratory(moving_mass=(15.0, 0.3), preload_stiffness=(12440.0, 250.0), std_gain=(0.01,) * 3, noise=2e-4)
#: Change of F1, V1, V2, and words that the first named cause has.
GROSS = {
    "kgf": ((1 / 9.80665, 1, 1), "F1 9.81 times too small"),
    "g": ((1, 1, 9.80665), "F1 9.81 times too small"),
    "N as kgf": ((9.80665, 1, 1), "F1 9.81 times too large"),
    "kN": ((1e-3, 1, 1), "F1 1000 times too small"),
    "mm": ((1, 1e3, 1e3), "F1 1000 times too small"),
    "sign of F1": ((-1, 1, 1), "F1 with its sign inverted"),
    "sign of V2": ((1, 1, -1), "F1 with its sign inverted"),
    "kN and sign": ((-1e-3, 1, 1), "F1 with its sign inverted, 1000 times too small"),
    "twice": ((2.0, 1, 1), "F1 "),
}


def changed(made, factors):
    return made.recorded(made.phasors.amplitudes * np.array(factors))


@pytest.mark.parametrize(
    ("name", "masses"), [*((name, (0.0,)) for name in GROSS), ("g", (0.0, 10.0)), ("kN and sign", (0.0, 10.0))]
)
@pytest.mark.sampled(6)
def test_a_wrong_unit_or_sign_is_named(make, name, masses):
    factors, words = GROSS[name]
    made = changed(make(USUAL, masses=masses, frequencies=6, families=2, within=2.0), factors)
    misfit = made.identify().misfit
    assert not misfit.fits
    assert cause_words(misfit.candidates[0]).startswith(words)
    assert {one.source.of for one in misfit.candidates[: misfit.tied]} == {"F1", "V2"}


def test_exchanged_velocities_are_named(make):
    made = make(USUAL, frequencies=6, families=2, within=2.0)
    misfit = made.recorded(made.phasors.amplitudes[:, [0, 2, 1]]).identify().misfit
    assert not misfit.fits
    assert "V1 and V2 exchanged" in cause_words(misfit.candidates[0])


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.sampled(4)
def test_an_honest_campaign_has_no_gross_error(make, seed):
    made = make(USUAL, masses=((0.0,), (0.0, 10.0))[seed % 2], frequencies=4, families=2, seed=seed)
    problem = made.problem()
    assert gross_errors(problem.observed, problem.shared) == []


@pytest.mark.parametrize("factors", [(1.15, 1, 1), (1, 1, 0.87), (np.exp(0.3j), 1, 1)])
def test_an_error_of_a_sixth_is_no_gross_one(make, factors):
    made = changed(make(USUAL, frequencies=6, families=2, within=2.0), factors)
    problem = made.problem()
    assert gross_errors(problem.observed, problem.shared) == []


def test_absent_channels_break_nothing(make):
    made = make(USUAL, frequencies=4, families=2, blocks=(8.0,), within=2.0).without(0, [3]).without(2, [5])
    problem = made.problem()
    assert gross_errors(problem.observed, problem.shared) == []
    nothing = made.without(2, slice(None)).problem()
    assert gross_errors(nothing.observed, nothing.shared) == []
