"""References of the drive: pulses and angles become the phase they came from."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.reference import PulseTrain, Reference
from fourpole.errors import RecordingError

RATE = 2000.0
TIME = np.arange(20_000) / RATE
MEAN, SLOW, DEPTH = 2 * np.pi * 11.0, 2 * np.pi / 7.3, 0.01


def angle(time):
    return MEAN * (time + DEPTH / SLOW * np.sin(SLOW * time))


def speed(time):
    return MEAN * (1 + DEPTH * np.cos(SLOW * time))


@pytest.mark.parametrize("pulses", [1, 4, 60])
def test_pulses_give_phase_and_speed(pulses):
    fine = np.arange(10 * 200_000) / 200_000.0
    edges = np.interp(np.arange(2 * np.pi / pulses, angle(fine[-1]), 2 * np.pi / pulses), angle(fine), fine)
    reference = Reference.from_pulses(edges, pulses=pulses)
    at = np.linspace(1.0, 9.0, 50)
    curve = reference.curve
    off = curve(at) - angle(at)
    assert np.ptp(off) < 2e-3  # where a revolution begins does not matter
    assert curve(at, 1) == pytest.approx(speed(at), rel=2e-4)
    assert reference.omega(1.0, 9.0) == pytest.approx((angle(9.0) - angle(1.0)) / 8.0, rel=1e-5)


@pytest.mark.parametrize("cycles", [1.0, 3.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_an_encoder_gives_the_phase(sense, cycles):
    reference = Reference.from_angle(TIME, sense * angle(TIME) % (2 * np.pi), cycles=cycles)
    at = np.linspace(1.0, 9.0, 50)
    assert np.ptp(reference.curve(at) - cycles * angle(at)) < 2e-3 * cycles


def test_what_the_speed_does_within_a_revolution_is_left_alone():
    """A wobble of 0.05 rad once per revolution, and teeth unevenly cut: the phase at the end of each is even."""
    wobbling = 20 * np.pi * TIME + 0.05 * np.sin(20 * np.pi * TIME)
    reference = Reference.from_angle(TIME, wobbling)
    at = np.linspace(1.0, 9.0, 77)
    off = reference.curve(at) - 20 * np.pi * at
    assert np.ptp(off) < 1e-3


def test_jitter_of_the_pulses_is_smoothed():
    """0.2 ms of jitter, 14 mrad of phase, once per revolution: less than half is left of it."""
    rng = np.random.default_rng(0)
    edges = np.arange(1, 110) / 11.0 + 2e-4 * rng.standard_normal(109)
    at = np.linspace(1.0, 9.0, 500)
    off = Reference.from_pulses(edges).curve(at) - MEAN * at
    assert np.std(off) < 0.5 * MEAN * 2e-4


@settings(max_examples=30)
@given(cuts=st.lists(st.integers(1, 19_999), max_size=6, unique=True))
def test_pieces_have_the_pulses_of_the_whole(cuts):
    tacho = np.sin(3 * angle(TIME))
    whole, parted = PulseTrain(), PulseTrain()
    whole.feed(tacho, RATE, 0.0)
    # the first piece shows the pulses' height: it must hold one
    edges = [0, *sorted(max(cut, 400) for cut in cuts), TIME.size]
    for first, last in pairwise(edges):
        if last > first:
            parted.feed(tacho[first:last], RATE, first / RATE)
    assert parted.times() == pytest.approx(whole.times(), abs=1e-2 / (3 * MEAN))  # its samples miss the top by 5e-3
    assert parted.times().size == whole.times().size == int(3 * angle(TIME[-1]) / (2 * np.pi))


def test_missing_samples_are_no_pulses():
    tacho = np.where(angle(TIME) % (2 * np.pi) < 1.0, 5.0, 0.0)
    tacho[100:110] = np.nan
    train = PulseTrain()
    train.feed(tacho, RATE, 0.0)
    assert train.times().size == pytest.approx(angle(TIME[-1]) / (2 * np.pi), abs=1.0)


def test_too_few_turns_are_told():
    with pytest.raises(RecordingError, match="3 revolutions at 1 per revolution, 4 are needed"):
        Reference.from_pulses(np.arange(3.0))
    with pytest.raises(RecordingError, match=r"the reference turns 2\.\d+ times"):
        Reference.from_angle(TIME[:500], angle(TIME[:500]))
    with pytest.raises(RecordingError, match="the reference turns 0 times"):
        Reference.from_angle(TIME, np.full(TIME.size, np.nan))
