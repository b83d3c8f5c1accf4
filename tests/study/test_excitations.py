"""K* of one condition by a sine, by noise and by sweeps: equal for a linear specimen, and the difference in words."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests import random_rig

from fourpole.campaign.folder import Test as Row
from fourpole.core.codes import Code
from fourpole.core.condition import Sameness
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.study.excitations import excitations
from fourpole.study.own import Own

CAMPAIGN = SimpleNamespace(stated=SimpleNamespace(sameness=Sameness()))


def made(rng, *, softer=1.0, noise=0.005, second="random"):
    """Eight sines of 1 mm, and 200 lines of noise of 0.1 mm by which K* is larger by a factor."""
    tests, own = [], []
    for kind, frequencies, size, factor, share in (
        ("dynamic", np.geomspace(6, 60, 8), 1e-3, 1.0, 0.1 * noise),
        (second, np.linspace(5, 200, 200), 1e-4, softer, noise),
    ):
        for at, frequency in enumerate(frequencies.tolist()):
            true = factor * complex(random_rig.stiffness(2 * np.pi * frequency))
            off = share * complex(*rng.normal(size=2))
            name = f"S{at}" if kind == "dynamic" else "R"
            tests.append(Row(name, 2, kind=kind, tyre="mount", band=None if kind == "dynamic" else (5.0, 200.0)))
            own.append(Own(true * np.exp(off), share, size, frequency, 1.0 + 0j))
    return tests, own


@pytest.mark.parametrize("second", ["random", "sweep"])
def test_a_linear_specimen_has_one_k_star_by_all_excitations(second):
    """A false alarm has the chance of all searches; ten times its mean number has less than 1e-4."""
    rng, told, runs = np.random.default_rng(40), 0, 300
    for _ in range(runs):
        ((name, check),) = excitations(CAMPAIGN, *made(rng, second=second))
        assert (name, check.verdict) == ("mount", "ok")
        told += bool(check.remark)
    assert told <= max(3.0, 10.0 * SEARCH_CHANCE * runs)


@pytest.mark.parametrize(("softer", "decibel", "verdict"), [(1.05, "0.42", "ok"), (1.3, "2.3", "warning")])
def test_a_difference_is_said_in_decibel(softer, decibel, verdict):
    ((_, check),) = excitations(CAMPAIGN, *made(np.random.default_rng(41), softer=softer))
    assert check.code is Code.EXCITATIONS
    assert check.verdict == verdict
    assert f"by random excitation of 0.1 mm is {decibel} dB above that by sines (mean of 5 frequencies" in check.remark


def test_levels_of_noise_are_excitations_of_their_own():
    rng = np.random.default_rng(42)
    tests, own = made(rng)
    louder = [Own(1.1 * one.stiffness, one.noise, 3.0 * one.deflection, one.frequency, one.lever) for one in own]
    kept = [i for i, test in enumerate(tests) if test.band]
    every = [*tests, *(tests[i] for i in kept)], [*own, *(louder[i] for i in kept)]
    found = [check for _, check in excitations(CAMPAIGN, *every)]
    assert len(found) == 3
    assert sum("random excitation of 0.3 mm is 0.8" in check.remark for check in found) == 2


def test_excitations_without_common_frequencies_are_not_compared():
    tests, own = made(np.random.default_rng(43))
    apart = [one if test.band else Own(one.stiffness, one.noise, one.deflection, 0.01 * one.frequency, one.lever)
             for test, one in zip(tests, own, strict=True)]  # fmt: skip
    assert excitations(CAMPAIGN, tests, apart) == []
