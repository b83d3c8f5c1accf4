"""K* of one condition by a sine, by noise and by sweeps: equal for a linear specimen, and the difference in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import random_rig

from fourpole.campaign.row import Test as Row
from fourpole.core.alone import Alone
from fourpole.core.checks import Code
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.study.agreement import excitations
from fourpole.study.points import Points
from fourpole.words import remark_of


def made(rng, *, softer=1.0, noise=0.005, second="random"):
    """Eight sines of 1 mm, and 200 lines of noise of 0.1 mm by which K* is larger by a factor."""
    tests, rows = [], []
    for kind, frequencies, size, factor, share in (
        ("dynamic", np.geomspace(6, 60, 8), 1e-3, 1.0, 0.1 * noise),
        (second, np.linspace(5, 200, 200), 1e-4, softer, noise),
    ):
        for at, frequency in enumerate(frequencies.tolist()):
            true = factor * complex(random_rig.stiffness(2 * np.pi * frequency))
            off = share * complex(*rng.normal(size=2))
            name = f"S{at}" if kind == "dynamic" else "R"
            tests.append(Row(name, 2, kind=kind, tyre="mount", band=None if kind == "dynamic" else (5.0, 200.0)))
            rows.append((true * np.exp(off), share, size, frequency, 1.0 + 0j))
    return points_of(tests), Alone(*(np.array(column) for column in zip(*rows, strict=True)))


def points_of(tests):
    """All of one condition."""
    every = (None,) * len(tests)
    return Points(tuple(tests), None, every, every, every, None, every, condition=np.zeros(len(tests), dtype=int))


@pytest.mark.parametrize("second", ["random", "sweep"])
@pytest.mark.sampled(2)
def test_a_linear_specimen_has_one_k_star_by_all_excitations(second):
    """A false alarm has the chance of all searches; ten times its mean number has less than 1e-4."""
    rng, told, runs = np.random.default_rng(40), 0, 300
    for _ in range(runs):
        ((name, check),) = excitations(*made(rng, second=second), ())
        assert (name, check.verdict) == ("mount", "ok")
        told += bool(remark_of(check))
    assert told <= max(3.0, 10.0 * SEARCH_CHANCE * runs)


@pytest.mark.parametrize(("softer", "decibel", "verdict"), [(1.05, "0.42", "ok"), (1.3, "2.3", "warning")])
def test_a_difference_is_said_in_decibel(softer, decibel, verdict):
    ((_, check),) = excitations(*made(np.random.default_rng(41), softer=softer), ())
    assert check.code is Code.EXCITATIONS
    assert check.verdict == verdict
    assert f"by random excitation of 0.1 mm is {decibel} dB above that by sines (mean of 5 frequencies" in remark_of(
        check
    )


def test_levels_of_noise_are_excitations_of_their_own():
    rng = np.random.default_rng(42)
    points, alone = made(rng)
    lines = [row for row, test in enumerate(points.tests) if test.band]
    every = [*range(len(points.tests)), *lines]
    louder = np.where(np.arange(len(every)) < len(points.tests), 1.0, 1.1)
    alone = alone.part(every)
    alone = replace(
        alone, stiffness=louder * alone.stiffness, deflection=np.where(louder > 1, 3.0, 1.0) * alone.deflection
    )
    found = [check for _, check in excitations(points_of([points.tests[row] for row in every]), alone, ())]
    assert len(found) == 3
    assert sum("random excitation of 0.3 mm is 0.8" in remark_of(check) for check in found) == 2


def test_excitations_without_common_frequencies_are_not_compared():
    points, alone = made(np.random.default_rng(43))
    factor = [1.0 if test.band else 0.01 for test in points.tests]
    assert list(excitations(points, replace(alone, frequency=factor * alone.frequency), ())) == []
