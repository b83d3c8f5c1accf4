"""Segments of one recording: what a test machine does one after the other, with rests and ramps between."""

import numpy as np
import pytest

from fourpole.core.segments import segments as all_segments
from fourpole.core.segments import without_dropouts

RATE = 2000.0


def rest(seconds):
    return lambda x: np.full(int(seconds * RATE), x)


def ramp(seconds, to):
    return lambda x: np.linspace(x, to, int(seconds * RATE))


def sine(frequency, amplitude, seconds):
    """A sinusoid that begins softly, as machines begin it."""
    t = np.arange(int(seconds * RATE)) / RATE
    motion = amplitude * np.minimum(1.0, t * frequency / 1.5) * np.sin(2 * np.pi * frequency * t)
    return lambda x: x + motion


def loops(height, seconds, count):
    t = np.arange(int(seconds * count * RATE)) / RATE
    return lambda x: x + height * (1 - np.abs((2 * t / seconds) % 2 - 1))


def sweep(first, last, seconds):
    t, rise = np.arange(int(seconds * RATE)) / RATE, np.log(last / first) / seconds
    return lambda x: x + np.sin(2 * np.pi * first * np.expm1(rise * t) / rise)


def random(low, high, seconds):
    rng, size = np.random.default_rng(4), int(seconds * RATE)
    frequency = np.fft.rfftfreq(size, 1 / RATE)
    lines = (frequency > low) * (frequency < high) * np.exp(2j * np.pi * rng.random(frequency.size))
    return lambda x: x + np.fft.irfft(lines, size) * np.sqrt(size)


def motion(*parts, noise=0.0, step=0.0):
    made = [np.zeros(1)]
    for part in parts:
        made.append(part(made[-1][-1]))
    one = np.concatenate(made) + noise * np.random.default_rng(1).standard_normal(sum(map(len, made)))
    return np.round(one / step) * step if step else one


def segments(motion, rate):
    """The steady ones, which are tests."""
    return [one for one in all_segments(motion, rate) if one.kind in ("sine", "loop")]


FREQUENCIES = (0.5, 1, 2, 5, 10, 20, 50, 100)
PROCEDURE = [part for f in FREQUENCIES for part in (rest(1.0), sine(f, f**-0.5, max(10 / f, 2.0)))]


@pytest.mark.parametrize("noise", [0.0, 1e-4, 3e-3])
@pytest.mark.parametrize("step", [0.0, 5e-3])
@pytest.mark.sampled(2)
def test_eight_sines_with_rests_are_eight_segments_without_their_beginning(noise, step):
    found = segments(motion(*PROCEDURE, noise=noise, step=step), RATE)
    assert [one.kind for one in found] == ["sine"] * 8
    begun, at = 0.0, []
    for f in FREQUENCIES:
        at.append((begun + 1.0, begun + 1.0 + max(10 / f, 2.0)))
        begun = at[-1][1]
    for one, f, (start, end) in zip(found, FREQUENCIES, at, strict=True):
        assert one.frequency == pytest.approx(f, rel=2e-3)
        assert one.amplitude == pytest.approx(f**-0.5, rel=0.05)
        assert start + 0.8 / f < one.start < start + 3.0 / f
        assert end - 1.5 / f < one.end <= end + 0.1 / f


@pytest.mark.sampled(2)
def test_preloads_with_ramps_between_are_told_by_the_mean_and_a_loop_before_is_one():
    parts = [rest(1.0), loops(5.0, 20.0, 3), rest(2.0)]
    for mean in (1.0, 2.0, 3.0):
        parts += [ramp(2.0, mean), rest(3.0)]
        parts += [part for f in (1, 3, 10, 30, 60) for part in (sine(f, 0.1, max(8 / f, 1.0)), rest(0.3))]
    found = segments(motion(*parts, noise=1e-3), RATE)
    assert [one.kind for one in found] == ["loop", *["sine"] * 15]
    assert (found[0].frequency, found[0].amplitude) == pytest.approx((0.05, 2.5), rel=0.01)
    assert [round(one.mean, 1) for one in found[1:]] == [mean for mean in (1.0, 2.0, 3.0) for _ in range(5)]
    assert [round(one.frequency) for one in found[1:]] == [1, 3, 10, 30, 60] * 3


def test_steps_without_a_rest_between_are_cut_where_they_change():
    found = segments(motion(*(sine(f, 1.0, 3.0) for f in (5.0, 5.6, 8.0)), noise=1e-3), RATE)
    assert [round(one.frequency, 1) for one in found] == [5.0, 5.6, 8.0]
    parts = [sine(10.0, amplitude, 2.0) for amplitude in (1.0, 0.5, 0.2)]
    assert [round(one.amplitude, 1) for one in segments(motion(*parts, noise=1e-3), RATE)] == [1.0, 0.5, 0.2]


@pytest.mark.parametrize(
    "part", [sweep(1.0, 60.0, 60.0), sweep(5.0, 20.0, 120.0), random(5.0, 50.0, 20.0), rest(20.0), ramp(20.0, 5.0)]
)
@pytest.mark.sampled(2)
def test_other_motions_have_none(part):
    assert segments(motion(part, noise=1e-3), RATE) == []


def test_a_cycle_or_two_and_a_few_samples_are_none():
    assert segments(motion(rest(1.0), sine(10.0, 1.0, 0.4), rest(1.0)), RATE) == []
    assert segments(np.zeros(3), RATE) == []
    assert segments(np.zeros(0), RATE) == []


def test_what_lies_between_is_named():
    parts = [rest(2.0), loops(5.0, 20.0, 3), ramp(2.0, 1.0), rest(4.0), sine(2.0, 0.1, 5.0), rest(2.0), ramp(1.0, 0.0)]
    parts += [rest(2.0), sweep(2.0, 50.0, 20.0), rest(2.0), random(2.0, 60.0, 20.0), rest(2.0)]
    kinds = [one.kind for one in all_segments(motion(*parts, noise=1e-3), RATE)]
    assert kinds[:5] == ["loop", "ramp", "hold", "sine", "hold"]
    assert kinds[5:] == ["ramp", "rest", "sweep", "hold", "random", "hold"]


def test_slow_sines_are_sines_and_slow_triangles_are_loops():
    found = segments(motion(rest(1.0), sine(0.1, 1.0, 80.0), rest(1.0), loops(5.0, 10.0, 6)), RATE)
    assert [one.kind for one in found] == ["sine", "loop"]


@pytest.mark.parametrize("lost", [1, 20])
def test_drop_outs_to_zero_are_no_turns(lost):
    whole = 2.0 + motion(*(part for f in (0.5, 5.0, 20.0) for part in (rest(1.0), sine(f, 0.1, 8 / f))), noise=1e-4)
    hurt = whole.copy()
    for place in (4000, 33000, 38100):
        hurt[place : place + lost] = 0.0
    for one, other in zip(segments(whole, RATE), segments(without_dropouts(hurt), RATE), strict=True):
        assert (one.kind, one.frequency) == (other.kind, pytest.approx(other.frequency, rel=1e-3))


@pytest.mark.parametrize("cycles", [6, 7, 12])
def test_a_few_cycles_leave_three_that_are_used(cycles):
    (one,) = segments(motion(rest(1.0), sine(5.0, 1.0, cycles / 5), rest(1.0), noise=1e-3), RATE)
    assert (one.end - one.start) * one.frequency >= 2.9


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.sampled(3)
def test_noisy_random_motion_is_not_cut_into_sines(noise, seed):
    made = motion(random(5.0, 100.0, 60.0))
    made = made + noise * made.std() * np.random.default_rng(seed).normal(size=made.size)
    steady = segments(made, RATE)
    assert sum(one.end - one.start for one in steady) < 6.0
