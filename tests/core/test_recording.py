"""Recordings, and what a column of time stamps says of the sampling."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fourpole.core.recording import Channel, Recording, uniform_time
from fourpole.errors import RecordingError


def test_from_arrays():
    t = np.arange(500) / 250.0 + 3.0
    recording = Recording.from_arrays(t, force_in=list(t), motion_in=2 * t, motion_out=3 * t, motion="acceleration")
    assert recording.sample_rate == pytest.approx(250.0, rel=1e-12)
    assert recording.channels["motion_in"].samples.size == 500
    assert recording.duration == pytest.approx(2.0, rel=1e-12)
    assert {name: channel.quantity for name, channel in recording.channels.items()} == {
        "force_in": "force",
        "motion_in": "acceleration",
        "motion_out": "acceleration",
    }
    less = recording.without("motion_out")
    assert list(less.channels) == ["force_in", "motion_in"]
    assert list(recording.channels) == ["force_in", "motion_in", "motion_out"]


def test_a_motion_at_the_contact_must_be_there():
    with pytest.raises(RecordingError, match="test 7: no channel 'motion_in'"):
        Recording(100.0, {"force_in": Channel(np.zeros(10), "force")}, "test 7")


def test_channels_are_equally_long():
    with pytest.raises(RecordingError, match=r"channels differ in length: {'motion_in': 10, 'force_in': 9}"):
        Recording(100.0, {"motion_in": Channel(np.zeros(10), "velocity"), "force_in": Channel(np.zeros(9), "force")})


def test_unknown_quantities():
    with pytest.raises(ValueError, match="no quantity 'speed': choose one of force, displacement, velocity"):
        Channel(np.zeros(3), "speed")


def test_jitter_is_no_uniform_time_for_arrays():
    t = np.arange(100) / 100.0
    t[50] += 0.003
    with pytest.raises(RecordingError, match="up to 30% of an interval off a uniform grid"):
        Recording.from_arrays(t, force_in=t, motion_in=t, label="sine 3")


@given(
    rate=st.floats(20.0, 20e3),
    samples=st.integers(10, 3000),
    start=st.sampled_from([0.0, 1.0, 59.5, -3.0]),
    finer=st.integers(1, 4),
)
@example(rate=19999.0, samples=201, start=0.0, finer=1)
def test_rounded_stamps_are_uniform(rate, samples, start, finer):
    """Stamps with one to four decimals more than the interval's first digit."""
    decimals = int(np.ceil(np.log10(rate))) + finer
    unit = 10.0**-decimals
    stamps = np.round(start + np.arange(samples) / rate, decimals)
    step, remark = uniform_time(stamps)
    assert remark == ""
    # |e| <= unit/2 on every stamp moves a fitted slope by (unit/2) sum|i| / sum i² = 1.5 unit/N at most
    assert abs(step - 1 / rate) <= 1.5 * unit / samples * (1 + 2 / samples) + 1e-13 * max(1.0, abs(start))


@given(st.integers(2, 50), st.floats(1e-5, 10.0), st.floats(-1e3, 1e3))
def test_exact_stamps(samples, interval, start):
    step, remark = uniform_time(start + interval * np.arange(samples))
    assert remark == ""
    assert step == pytest.approx(interval, abs=4e-16 * (abs(start) + samples * interval))


def test_jitter_is_said():
    rng = np.random.default_rng(0)
    stamps = (np.arange(1000) + rng.uniform(-0.2, 0.2, 1000)) / 500.0
    step, remark = uniform_time(stamps)
    assert step == pytest.approx(1 / 500.0, rel=0.2 * 1.5 / 1000)
    assert "off a uniform grid" in remark
    assert "state sample_rate" in remark


def test_one_late_stamp_is_named():
    stamps = np.arange(200) / 100.0
    stamps[120] += 0.0025
    step, remark = uniform_time(stamps)
    assert step == pytest.approx(0.01, rel=1e-4)
    assert "25% of an interval off a uniform grid (sample 121)" in remark


@pytest.mark.parametrize("lost", [3, 10, 400])
@pytest.mark.parametrize("rate", [500.0, 1000.0, 1024.0, 2000.0])
def test_a_jump_is_an_error(lost, rate):
    stamps = np.delete(np.arange(3000), slice(1001, 1001 + lost)) / rate
    with pytest.raises(
        RecordingError, match=r"time is not uniform: the interval after sample 1001 .* samples were lost"
    ):
        uniform_time(stamps)


def test_two_lost_samples_are_an_error():
    """One interval off the grid on either side of the gap, which no jitter explains."""
    for rate in (1024.0, 2000.0):
        with pytest.raises(RecordingError, match="samples were lost"):
            uniform_time(np.delete(np.arange(3000), [1500, 1501]) / rate)


@pytest.mark.parametrize("rate", [200.0, 1024.0, 2000.0])
def test_a_single_lost_sample_does_not_pass_in_silence(rate):
    stamps = np.delete(np.arange(3000), 1500) / rate
    try:
        _, remark = uniform_time(stamps)
    except RecordingError:
        return
    assert "off a uniform grid" in remark


@pytest.mark.parametrize("rounded", ["%.5g", "%.6g", "%.3f", "%.4f"])
@pytest.mark.parametrize("rate", [512.0, 1651.6, 2000.0, 4096.0])
@pytest.mark.sampled(4)
def test_stamps_of_a_few_digits_are_those_of_a_uniform_clock(rate, rounded):
    stamps = np.array([float(rounded % time) for time in np.arange(int(130 * rate)) / rate])
    step, remark = uniform_time(stamps)
    assert (1.0 / step, remark) == (pytest.approx(rate, rel=1e-6), "")
    few = np.delete(stamps, slice(700, 800))
    with pytest.raises(RecordingError, match="samples were lost"):
        uniform_time(few)


@pytest.mark.parametrize(
    ("count", "rate", "passes"), [(100, 1300.0, False), (101, 1300.0, True), (3000, 1050.0, False)]
)
def test_stamps_may_repeat_only_where_their_rounding_shows(count, rate, passes):
    """More than 100 stamps, of a resolution beyond 1.1 intervals; a repeated stamp is a repeated row otherwise."""
    stamps = np.round(np.arange(count) / rate, 3)
    if passes:
        assert 1.0 / uniform_time(stamps)[0] == pytest.approx(rate, rel=1e-2)
    else:
        with pytest.raises(RecordingError, match="does not increase"):
            uniform_time(stamps)


def test_a_change_of_rate_is_an_error():
    stamps = np.cumsum(np.repeat([1e-3, 1.2e-3], 500))
    with pytest.raises(RecordingError, match="samples were lost or the rate changed"):
        uniform_time(stamps)


@pytest.mark.parametrize(
    ("stamps", "says"),
    [
        ([0.0], "1 samples are too few for a time base"),
        ([0.0, 0.1, np.nan, 0.3], "time is missing at sample 3"),
        ([np.inf, 0.1, 0.2], "time is missing at sample 1"),
        ([0.3, 0.2, 0.1], "time runs backwards \\(from 0.3 s to 0.2 s\\)"),
        ([0.0, 0.1, 0.1, 0.2], "does not increase at sample 3 \\(from 0.1 s to 0.1 s\\)"),
        ([0.0, 0.1, 0.2, 0.15], "does not increase at sample 4"),
    ],
)
def test_stamps_that_make_no_time_base(stamps, says):
    with pytest.raises(RecordingError, match=says):
        uniform_time(np.array(stamps))


@pytest.mark.parametrize(("rate", "lost"), [(500.0, 1), (1000.0, 1), (1000.0, 2)])
def test_lost_samples_between_stamps_in_whole_milliseconds_do_not_pass_in_silence(rate, lost):
    stamps = np.delete(np.arange(3000), slice(1500, 1500 + lost)) / rate
    try:
        _, remark = uniform_time(stamps)
    except RecordingError:
        return
    assert remark


def test_jitter_is_said_whatever_the_zero_of_time():
    """Seconds since 1970, as loggers write them: doubles still hold a quarter of a microsecond there."""
    rng = np.random.default_rng(0)
    stamps = (np.arange(1000) + rng.uniform(-0.18, 0.18, 1000)) / 200.0
    assert uniform_time(stamps)[1]
    assert uniform_time(1.7e9 + stamps)[1]


def test_time_is_as_long_as_the_channels():
    t = np.arange(100) / 100.0
    with pytest.raises(RecordingError, match="length"):
        Recording.from_arrays(t, force_in=np.zeros(200), motion_in=np.zeros(200))
