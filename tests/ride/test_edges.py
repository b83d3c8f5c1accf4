"""Numbers that decide whether a road, a step or a ride is taken: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.ride import compare
from fourpole.ride.comfort import check_step, comfort_of
from fourpole.ride.road import ClassRoad, Profile, check_speed, samples, sine_sweep


def taken(function):
    """A function that gives whether another one takes a case, with None for no error."""

    def decided(case):
        try:
            function(case)
        except ModelError:
            return False
        return True

    return decided


def road(gap=1.0, uneven=0.0, height=0.0, share=0.0):
    """A road of 100 points, 1 m apart but for a gap; a share of the others is off by up to `uneven`."""
    steps = np.ones(99)
    steps[: round(share * 99)] += uneven
    steps[-1] = gap
    return Profile(np.append(0.0, np.cumsum(steps)), np.append(np.zeros(99), height))


def resolved(share):
    """How many times finer the frequencies are until they are enough, by what they leave unresolved."""
    counts = []

    def ridden(*given):
        counts.append(given[-1])
        return "found", SimpleNamespace(unresolved=share, frequency=np.ones(1), spectrum=np.ones(1))

    with patch.object(compare, "_on_class", ridden):
        taken(lambda _: compare.compare_on_class(None, [], None, 20.0, []))(None)
    return [round(count / counts[0]) for count in counts]


def shared(source):
    """Standard uncertainty of the relative difference of two rides, with an error of 10 % in both."""
    first, second = np.array([1.0]), np.array([1.1])
    effects = {"gain": np.array([[0.1]])}, {source: np.array([[0.11]])}
    return round(float(compare.relative_difference((first, effects[0]), (second, effects[1]))[1][0]), 9)


def band(_):
    """The band [Hz] over which a tyre is taken as branches."""
    tyre = SimpleNamespace(name="a", model=SimpleNamespace(state_space=no_states))
    with patch.object(compare, "realised", return_value=SimpleNamespace(space=None, error=0.0)) as made:
        compare._space(tyre, None)
    return made.call_args.args[2]


def no_states(values):
    raise ModelError("a power of the frequency")


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "ride that is resolved, 1 %, or 8 and 32 times finer": (resolved, {0.0099: [1], 0.0101: [1, 8, 32]}),
    "error that is shared, in proportion": (shared, {"gain": 0.0, "other": round(0.11 * 2**0.5, 9)}),
    "step of the weighting, 2.5 ms": (taken(check_step), {2.49e-3: True, 2.51e-3: False}),
    "step of a sweep, 20 samples a cycle": (
        taken(lambda step: sine_sweep(1e-3, 1.0, 20.0, 10.0, step)), {2.49e-3: True, 2.51e-3: False},
    ),
    "speed of a vehicle, 500 m/s": (taken(check_speed), {499.0: True, 501.0: False}),
    "samples of a road, 5 millions": (taken(lambda count: samples(count * 1e-3, 1e-3)), {5e6: True, 5.01e6: False}),
    "height of a road, 10 km": (taken(lambda x: road(height=x)), {9.9e3: True, 1.01e4: False}),
    "gap of even points, 1.5 times their distance": (taken(road), {1.49: True, 1.51: False}),
    "gap of uneven points, 3 times their distance": (
        taken(lambda x: road(x, uneven=0.1, share=0.4)), {2.97: True, 3.03: False},
    ),
    "points that are even, within 2 %": (
        taken(lambda x: road(2.0, uneven=x, share=0.4)), {0.0198: False, 0.0202: True},
    ),
    "points that are even, 90 % of them": (
        taken(lambda x: road(2.0, uneven=0.1, share=x)), {7 / 99: False, 9 / 99: True},
    ),
    "tyre as branches, 0.1 to 200 Hz": (band, {"fractional": (0.1, 200.0)}),
    "road of a class, 0.011 to 2.83 1/m": (
        lambda n: bool(ClassRoad.of("A").spectrum(n) > 0), {0.0109: False, 0.0111: True, 2.82: True, 2.84: False},
    ),
    "road of class A, 16e-6 m³ at 0.1 1/m": (
        lambda n: round(float(ClassRoad.of("A").spectrum(n)) * 1e6, 6), {0.1: 16.0, 0.2: 4.0},
    ),
    "running mean of a vibration, 1 s": (
        lambda time: round(float(comfort_of(np.ones(round(1000 * time)), 1e-3).mtvv), 3), {1.0: 0.795, 0.5: 0.627},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
