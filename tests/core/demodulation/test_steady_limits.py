"""Where a steady part begins and ends, and when a wandering drive is followed: either side of each limit."""

from types import SimpleNamespace

import numpy as np
import pytest

from fourpole.core.demodulation import steady, wander
from fourpole.core.demodulation.envelope import Envelope
from fourpole.core.demodulation.steady import steady_part
from fourpole.core.phasor import CHANNELS, Phasors

BELOW, ABOVE = 0.99, 1.01
FREQUENCY, HOP, COUNT = 10.0, 0.2, 101


@pytest.fixture
def part(monkeypatch):
    """The steady part, in stretches, of a recording with this envelope."""

    def found(size, *, phase=0.0, ratio=1.0, count=COUNT, hop=HOP):
        motion = np.broadcast_to(size, count) * np.exp(1j * np.broadcast_to(phase, count))
        time = (np.arange(count) - (count - 1) / 2) * hop
        amplitudes = {"force_in": 100.0 * motion * ratio, "motion_in": motion, "motion_out": motion / 2}
        made = Envelope(time, amplitudes, 2 * np.pi * FREQUENCY, hop)
        monkeypatch.setattr(steady, "tracks_of", lambda *given: [])
        monkeypatch.setattr(steady, "envelope", lambda *given: made)
        half = (count - 1) / 2 * hop
        recording = SimpleNamespace(channels=dict.fromkeys(CHANNELS), span=(-half, half), made={})
        span = steady_part(recording, FREQUENCY)
        return None if span is None else tuple(round((at + half) / hop) for at in span)

    return found


def start(count, value):
    """One, but for the first stretches."""
    return np.where(np.arange(COUNT) < count, value, 1.0)


def test_a_drive_that_runs_from_end_to_end_is_left_whole(part):
    assert part(1.0) is None


# What comes first is a third of the recording here: too long to ring out, so only a drive that is not up is cut.


@pytest.mark.parametrize(("level", "cut"), [(0.79, True), (0.81, False), (1.19, False), (1.21, True)])
def test_the_drive_is_up_within_a_fifth_of_its_level(part, level, cut):
    found = part(start(35, level))
    assert found is None if not cut else 35 <= found[0] <= 38


@pytest.mark.parametrize(("off", "cut"), [(BELOW * 0.03, False), (ABOVE * 0.03, True)])
def test_the_drive_is_up_within_three_hundredths_of_its_speed(part, off, cut):
    turned = -np.cumsum(np.where(np.arange(COUNT) < 35, off, 0.0)) * 2 * np.pi * FREQUENCY * HOP
    found = part(1.0, phase=turned)
    assert found is None if not cut else 34 <= found[0] <= 38


@pytest.mark.parametrize(("longest", "other", "found"), [(69, 31, False), (71, 29, True)])
def test_the_longest_run_is_seven_tenths_of_all_that_runs(part, longest, other, found):
    size = np.concatenate([np.ones(longest), np.full(3, 0.1), np.ones(other)])
    assert (part(size, count=size.size) is not None) == found


@pytest.mark.parametrize(("stretches", "found"), [(7, False), (8, True)])
def test_a_drive_that_runs_for_fewer_than_eight_stretches_is_none(part, stretches, found):
    size = np.concatenate([np.full(3, 0.4), np.ones(stretches)])
    assert (part(size, count=size.size) is not None) == found


@pytest.mark.parametrize(("cycles", "found"), [(5.9, False), (6.1, True)])
def test_six_cycles_must_be_left(part, cycles, found):
    """Of 101 stretches ten are the start, and one more is cut in each of two rounds."""
    hop = cycles / (FREQUENCY * 89)
    assert (part(start(10, 0.1), hop=hop) is not None) == found


def marks(off, wave=0.0):
    """Whether a stretch that is off is good, and whether it is rough; the middle half swells by a wave."""
    motion = np.ones(COUNT, dtype=complex)
    middle = slice(COUNT // 4 + 1, COUNT - COUNT // 4)
    motion[middle] += wave * (-1.0) ** np.arange(motion[middle].size)
    motion[5] += off
    made = Envelope(np.arange(COUNT) * HOP, {"motion_in": motion}, 2 * np.pi * FREQUENCY, HOP)
    good, rough = steady._steady(made, np.zeros(COUNT), slice(0, COUNT))
    return bool(good[5]), bool(rough[5])


@pytest.mark.parametrize(("off", "good"), [(BELOW * 2e-3, True), (ABOVE * 2e-3, False)])
def test_a_stretch_is_steady_within_two_thousandths(off, good):
    assert marks(off)[0] == good


@pytest.mark.parametrize(("off", "rough"), [(BELOW * 5e-3, False), (ABOVE * 5e-3, True)])
def test_a_stretch_is_rough_beyond_five_thousandths(off, rough):
    assert marks(off)[1] == rough


@pytest.mark.parametrize(
    ("deviations", "expected"), [(4.9, (True, False)), (5.1, (False, False)), (10.2, (False, True))]
)
def test_a_stretch_is_as_steady_as_the_middle_within_five_deviations_and_rough_beyond_ten(deviations, expected):
    assert marks(deviations * 3e-3, wave=3e-3) == expected


@pytest.mark.parametrize(("first", "cut"), [(29, 30), (30, 0)])
def test_a_start_rings_out_within_three_tenths(first, cut):
    assert steady._cut(np.arange(100) >= first) == cut


# A drive whose speed wanders.


def phasors(shift=0.0, std=1e-4):
    """Three amplitudes of 1, V2 shifted; `std` is that of a ratio's modulus."""
    return Phasors(10.0, np.array([1.0, 1.0, 1.0 + shift], dtype=complex), 0.5 * std**2 * np.eye(6), 0.0, np.inf)


@pytest.fixture
def follows(monkeypatch):
    """Whether a wandering drive is followed, by what is left, moved and known with and without following."""

    def following(*, left=(0.5, 0.5, 0.5), departure=1e-2, shift=1.0, before=1e-4, after=1e-4):
        better = SimpleNamespace(noise_ratio=0.01 * np.array(left), phasors=phasors(std=after))
        found = SimpleNamespace(lines=np.zeros(0), noise_ratio=np.full(3, 0.01), phasors=phasors(shift, before))
        monkeypatch.setattr(wander, "_may_wander", lambda *given: True)
        monkeypatch.setattr(
            wander, "_own_reference", lambda *given, **how: SimpleNamespace(departure=lambda **how: departure)
        )
        monkeypatch.setattr(wander, "replace", lambda recording, **changes: recording)
        monkeypatch.setattr(wander, "demodulate", lambda recording: better)
        return wander.follow_wander(None, found) is not None

    return following


@pytest.mark.parametrize(("departure", "followed"), [(BELOW * 1e-4, False), (ABOVE * 1e-4, True)])
def test_a_speed_that_wanders_by_a_ten_thousandth_is_followed(follows, departure, followed):
    assert follows(departure=departure) == followed


@pytest.mark.parametrize(("left", "followed"), [(0.89, True), (0.91, False)])
def test_a_tenth_less_of_v1_must_be_left(follows, left, followed):
    assert follows(left=(0.5, left, 0.5)) == followed


@pytest.mark.parametrize("channel", [0, 2])
@pytest.mark.parametrize(("left", "followed"), [(1.019, True), (1.021, False)])
def test_no_more_of_any_channel_may_be_left(follows, left, followed, channel):
    assert follows(left=np.where(np.arange(3) == channel, left, 0.5)) == followed


@pytest.mark.parametrize(("deviations", "followed"), [(2.97, False), (3.03, True)])
def test_a_ratio_moved_by_three_of_its_uncertainties_is_worth_following(follows, deviations, followed):
    assert follows(shift=deviations * 1e-4) == followed


@pytest.mark.parametrize(("factor", "followed"), [(1.98, False), (2.02, True)])
def test_half_the_uncertainty_is_worth_following(follows, factor, followed):
    assert follows(shift=1.5e-4, before=factor * 1e-4) == followed


@pytest.mark.parametrize(("deviations", "followed"), [(BELOW, False), (ABOVE, True)])
def test_less_uncertainty_is_worth_nothing_where_the_ratio_stays(follows, deviations, followed):
    assert follows(shift=deviations * 1e-4, before=3e-4) == followed


@pytest.mark.parametrize(("share", "turned"), [(0.495, True), (0.505, False)])
def test_a_drive_swells_by_less_than_half_of_what_it_turns(share, turned):
    """Even about the middle, so that the straight line that is taken away is none."""
    wave = np.cos(2 * np.pi * (np.arange(60) - 29.5) / 20)
    assert wander._turned((1 + 0.1 * share * wave) * np.exp(0.1j * wave)) == turned


@pytest.mark.parametrize(("stretches", "followed"), [(11, False), (12, True)])
def test_a_phase_is_followed_in_twelve_stretches_at_least(monkeypatch, stretches, followed):
    time = np.arange(20) * HOP
    amplitude = np.where(np.arange(20) < stretches, 1.0 + 0j, np.nan)
    made = Envelope(time, {"motion_in": amplitude}, 2 * np.pi * FREQUENCY, HOP)
    monkeypatch.setattr(wander, "_motion", lambda recording: None)
    monkeypatch.setattr(wander, "envelope", lambda *given: made)
    monkeypatch.setattr(wander, "_turned", lambda amplitude: True)
    channels = {"motion_in": SimpleNamespace(quantity="velocity")}
    recording = SimpleNamespace(channels=channels, span=(0.0, 4.0), reference=None)
    found = SimpleNamespace(phasors=SimpleNamespace(omega=2 * np.pi * FREQUENCY))
    assert (wander._own_reference(recording, found, lines=False) is not None) == followed
