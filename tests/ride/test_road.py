"""Roads: each class at its level, spectra that are what they say, gaps refused."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.ride.road import CLASSES, ClassRoad, Profile, cleat, pothole, sine_sweep


@pytest.mark.parametrize("letter", CLASSES)
def test_each_class_has_four_times_the_spectrum_of_the_one_before(letter):
    road = ClassRoad.of(letter)
    assert road.spectrum(0.1) == pytest.approx(16e-6 * 4 ** CLASSES.index(letter))
    assert road.spectrum([0.05, 0.2]) == pytest.approx(road.level * np.array([4.0, 0.25]))
    assert road.spectrum([0.0109, 2.84]) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("letter", ["A", "D", "H"])
def test_realisations_have_the_spectrum_of_their_class(letter):
    """By Welch's method, which knows nothing of the sum of sines, over many seeds; no window is needed, nor a taper."""
    from scipy.signal import welch

    road, speed, step = ClassRoad.of(letter), 20.0, 0.004
    found = []
    for seed in range(40):
        height = road.realisation(64.0, step, speed, seed)
        frequency, power = welch(height, 1 / step, nperseg=4096, window="hann", detrend="linear")
        found.append(power)
    inside = (frequency > 0.9) & (frequency < 40.0)
    ratio = np.mean(found, axis=0)[inside] / road.spectrum_in_time(frequency[inside], speed)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.02)
    assert np.all(np.abs(ratio - 1.0) < 0.5)


def test_the_periodogram_of_a_realisation_is_the_spectrum():
    road = ClassRoad.of("C")
    height = road.realisation(60.0, 1e-3, 20.0, seed=5)
    power = 2.0 * np.abs(np.fft.rfft(height) / height.size) ** 2 * 60.0
    frequency = np.fft.rfftfreq(height.size, 1e-3)
    assert power[:-1] == pytest.approx(road.spectrum_in_time(frequency, 20.0)[:-1], rel=1e-9, abs=1e-20)
    low, high = 0.011 * 20.0, 2.83 * 20.0
    assert np.mean(height**2) == pytest.approx(road.level * 0.01 * 20.0 * (1 / low - 1 / high), rel=0.05)


def test_a_seed_gives_the_same_road_and_another_one_another():
    road = ClassRoad.of("B")
    first, again, other = (road.realisation(10.0, 1e-3, 10.0, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


@pytest.mark.parametrize("letter", ["I", "", "AB", "1"])
def test_a_class_that_is_none_is_refused(letter):
    with pytest.raises(ModelError, match="choose one of A, B, C"):
        ClassRoad.of(letter)


@pytest.mark.parametrize("speed", [0.0, -5.0, float("nan")])
def test_a_vehicle_that_stands_is_refused(speed):
    with pytest.raises(ModelError, match=r"speed .* is not positive"):
        ClassRoad.of("C").realisation(10.0, 1e-3, speed, 1)
    with pytest.raises(ModelError, match=r"speed .* is not positive"):
        cleat(0.01, 0.1).in_time(speed, 1e-3)


def test_a_profile_is_straight_between_its_points_and_level_beyond():
    road = Profile(np.array([10.0, 11.0, 12.0]), np.array([0.0, 0.02, 0.01]))
    assert road.at([-1.0, 0.0, 0.25, 1.5, 9.0]) == pytest.approx([0.0, 0.0, 0.005, 0.015, 0.01])
    over = road.in_time(2.0, 0.25)
    assert over == pytest.approx([0.0, 0.01, 0.02, 0.015, 0.01])


def test_gaps_and_values_that_are_none_are_refused_with_their_place():
    x = np.arange(20.0)
    z = np.zeros(20)
    with pytest.raises(ModelError, match=r"r\.csv: has a gap from 4 to 8 m, its points are 1 m apart"):
        Profile(np.delete(x, [5, 6, 7]), z[:17], "r.csv")
    z[7] = np.nan
    with pytest.raises(ModelError, match=r"at 7 m there is no number \(1 such points\)"):
        Profile(x, z)
    with pytest.raises(ModelError, match="does not rise after 3 m"):
        Profile(np.array([0.0, 1.0, 2.0, 3.0, 3.0]), np.zeros(5))
    with pytest.raises(ModelError, match="at least two"):
        Profile(np.zeros(1), np.zeros(1))


def test_an_uneven_profile_without_a_gap_is_taken():
    Profile(np.array([0.0, 1.0, 2.5, 4.0, 6.0]), np.zeros(5))


def test_one_missing_row_of_an_even_profile_is_a_gap():
    with pytest.raises(ModelError, match="has a gap from 4 to 6 m"):
        Profile(np.delete(np.arange(40.0), 5), np.zeros(39))


def test_a_cleat_stands_and_a_pothole_lies():
    up, down = cleat(0.01, 0.1), pothole(0.01, 0.1)
    assert up.height.max() == pytest.approx(0.01)
    assert down.height == pytest.approx(-up.height)
    for wrong in (lambda: cleat(0.0, 0.1), lambda: cleat(0.01, 0.0), lambda: pothole(-0.01, 0.1)):
        with pytest.raises(ModelError, match="is none"):
            wrong()


def test_a_sweep_has_its_frequencies_where_they_should_be():
    step = 1e-4
    height = sine_sweep(0.002, 1.0, 16.0, 8.0, step)
    upward = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0)) * step
    middle = 0.5 * (upward[1:] + upward[:-1])
    assert 1.0 / np.diff(upward) == pytest.approx(2.0 ** (middle / 2.0), rel=0.02)
    with pytest.raises(ModelError, match="sweep"):
        sine_sweep(0.002, 16.0, 1.0, 8.0, step)


@pytest.mark.parametrize("speed", [3.0, 22.3, 36.0])
@pytest.mark.parametrize("late", [0.0, 0.0123])
def test_what_is_shorter_than_a_step_keeps_its_area_and_its_place(speed, late):
    """Samples of the road itself would have a third of this cleat, or twice as much, by chance."""
    road, step = cleat(0.02, 0.02), 5e-4
    over = road.in_time(speed, step, after=0.1, late=late)
    time = step * np.arange(over.size)
    assert np.sum(over) * step * speed == pytest.approx(0.02 * 0.018)
    assert np.sum(time * over) / np.sum(over) == pytest.approx(1.01 / speed + late, rel=1e-9)


def test_a_step_too_long_for_a_sweep_is_refused():
    with pytest.raises(ModelError, match=r"too long for a sweep up to 20 Hz: state at most 0\.0025 s"):
        sine_sweep(0.002, 1.0, 20.0, 8.0, 2.6e-3)


def test_what_is_no_road_is_refused():
    with pytest.raises(ModelError, match=r"the height 1e\+06 m at 1 m is none of a road: check its unit"):
        Profile(np.arange(3.0), np.array([0.0, 1e6, 0.0]))
    with pytest.raises(ModelError, match="leave one of those at the same distance"):
        Profile(np.array([0.0, 1.0, 1.0, 2.0]), np.zeros(4))
    with pytest.raises(ModelError, match="above 500 m/s, that of no vehicle"):
        ClassRoad.of("C").realisation(1.0, 1e-3, 1e6, seed=1)
    with pytest.raises(ModelError, match="seed -1 is negative"):
        ClassRoad.of("C").realisation(1.0, 1e-3, 20.0, seed=-1)


def test_a_level_road_stays_level():
    assert np.ptp(Profile(np.arange(9.0), np.full(9, 0.3)).in_time(7.0, 3e-3)) == 0.0
