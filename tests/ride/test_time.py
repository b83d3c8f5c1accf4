"""Rides in time against an integrator that shares nothing with them, against scipy and against the spectrum."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests.ride.integrator import integrate, integrate_half
from tests.ride.test_vehicle import HALF

from fourpole.core.recursion import LinearSystem, driven
from fourpole.errors import ModelError
from fourpole.models import GeneralisedMaxwell, KelvinVoigt, Spring, Zener
from fourpole.ride.response import frequencies_of, ride
from fourpole.ride.road import ClassRoad, cleat, pothole
from fourpole.ride.time import axles, ride_in_time, whole_system, with_weighting
from fourpole.ride.vehicle import HalfCar, QuarterCar

CAR = (250.0, 37.5, 15825.0, 1500.0)
ZENER = (180e3, 120e3, 700.0)
TYRES = {
    "zener": (Zener(), ZENER, 180e3, [(120e3, 700.0 / 120e3)], 0.0),
    "kelvin": (KelvinVoigt(), (180e3, 300.0), 180e3, [], 300.0),
    "maxwell": (
        GeneralisedMaxwell(3), (150e3, 20e3, 40e3, 60e3, 0.5, 0.02, 1e-3), 150e3,
        [(20e3, 0.5), (40e3, 0.02), (60e3, 1e-3)], 0.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TYRES)
@pytest.mark.parametrize("kind", ["class", "cleat", "pothole"])
@pytest.mark.sampled(6)
def test_a_ride_is_that_of_an_independent_integrator(name, kind):
    model, values, k1, arms, damper = TYRES[name]
    step, speed = 1e-3, 15.0
    if kind == "class":
        road = ClassRoad.of("D").realisation(1.5, step, speed, seed=4)
    else:
        made = cleat(0.02, 0.4) if kind == "cleat" else pothole(0.03, 0.6)
        road = made.in_time(speed, step, after=0.8)
    found = ride_in_time(QuarterCar(*CAR).body, model.state_space(values), road[None], step)
    weighted, acceleration, force, deflection = integrate(CAR, k1, arms, road, step, 4, damper=damper)
    assert found.comfort.rms == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=1e-4)
    scale = np.max(np.abs(weighted))
    assert found.weighted == pytest.approx(weighted, abs=1e-4 * scale)
    assert found.acceleration == pytest.approx(acceleration, abs=1e-4 * np.max(np.abs(acceleration)))
    assert found.deflection[0] == pytest.approx(deflection, abs=1e-4 * np.max(np.abs(deflection)))
    if not damper:  # with a damper the force jumps where the slope of the road does
        load = force - sum(CAR[:2]) * 9.80665
        assert found.load[0] == pytest.approx(load, abs=1e-4 * np.max(np.abs(load)))


def test_a_ride_is_that_of_lsim():
    """A quarter car over 60 s at 1 kHz with the weighting, straight lines between samples."""
    road = ClassRoad.of("C").realisation(60.0, 1e-3, 80 / 3.6, seed=1)
    road = road - road[0]
    system = with_weighting(whole_system(QuarterCar(*CAR).body, Zener().state_space(ZENER)))
    found = driven(system, road[None], 1e-3)
    _, wanted, _ = signal.lsim((system.a, system.b, system.c, system.d), road, 1e-3 * np.arange(road.size))
    for one, other in zip(found, wanted.T, strict=True):
        assert np.max(np.abs(one - other)) < 1e-11 * np.max(np.abs(other))


@pytest.mark.parametrize("count", [4, 24, 25, 48, 49, 1500])
def test_two_equal_lags_follow_a_ramp(count):
    a = np.array([[-1.0, 1.0], [0.0, -1.0]])
    b, c, none = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    time = np.arange(float(count))
    found = driven(LinearSystem(a, b, np.zeros((2, 1)), c, none, none), time[None], 1.0)
    assert found[0] == pytest.approx(time - 2 + (time + 2) * np.exp(-time))


def test_a_slow_mode_keeps_its_digits():
    """A relaxation time of 1e6 s at a step of 1 ms: the functions of a step are sums, not differences."""
    slow = 1e-6
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    time = 1e-3 * np.arange(5)
    found = driven(LinearSystem(-slow * one, one, none, one, none, none), time[None], 1e-3)
    assert found[0] == pytest.approx(time**2 / 2 - slow * time**3 / 6, rel=1e-12)


@pytest.mark.parametrize("name", TYRES)
def test_a_long_ride_has_the_measures_of_the_spectrum(name):
    """A periodic road over a long time, the beginning left out: the sums over its lines are those over frequency."""
    model, values, *_ = TYRES[name]
    car, road, speed, step = QuarterCar(*CAR).body, ClassRoad.of("C"), 20.0, 2.5e-4
    once = road.realisation(65.536, step, speed, seed=9)
    found = ride_in_time(car, model.state_space(values), np.concatenate([once, once])[None], step)
    settled = type(found)(step, *(one[..., once.size :] for one in list(vars(found).values())[1:]))
    omega = 2 * np.pi * frequencies_of(road, speed)
    wanted = ride(car, model.stiffness(values, omega), road, speed)
    # straight lines between samples lose 0.07 % of the amplitude at 57 Hz, twice in the power; a sum over lines that
    # are 0.015 Hz apart is no integral
    assert settled.values == pytest.approx(wanted.values, rel=1.5e-3)


def test_the_rear_axle_meets_the_road_later():
    body = HalfCar(**HALF).body
    road = cleat(0.02, 0.4).in_time(14.0, 1e-3, after=1.0)
    heights = axles(road, body, 14.0, 1e-3)
    assert heights[1, 200:] == pytest.approx(heights[0, :-200])
    found = ride_in_time(body, Zener().state_space(ZENER), heights, 1e-3)
    assert found.load.shape == (2, road.size)
    first, second = np.argmax(found.load, axis=1)
    assert second - first == pytest.approx(200, abs=5)


def test_a_half_car_is_that_of_an_independent_integrator():
    body, step, speed = HalfCar(**HALF).body, 1e-3, 18.0
    heights = axles(ClassRoad.of("D").realisation(2.0, step, speed, seed=7), body, speed, step)
    found = ride_in_time(body, Zener().state_space(ZENER), heights, step)
    acceleration, *loads = integrate_half(HALF, ZENER[0], ZENER[1], ZENER[2] / ZENER[1], heights, step, 2)
    assert found.acceleration == pytest.approx(acceleration, abs=1e-4 * np.max(np.abs(acceleration)))
    for one, other in zip(found.load, loads, strict=True):
        assert one == pytest.approx(other, abs=1e-4 * np.max(np.abs(other)))


def test_a_half_car_has_the_measures_of_the_spectrum_with_its_lag():
    body, road, speed, step = HalfCar(**HALF).body, ClassRoad.of("C"), 20.0, 5e-4
    once = road.realisation(60.0, step, speed, seed=3)
    found = ride_in_time(body, Zener().state_space(ZENER), axles(np.tile(once, 3), body, speed, step), step)
    settled = type(found)(step, *(one[..., once.size :] for one in list(vars(found).values())[1:]))
    omega = 2 * np.pi * frequencies_of(road, speed)
    wanted = ride(body, Zener().stiffness(ZENER, omega), road, speed)
    assert settled.values == pytest.approx(wanted.values, rel=5e-3)  # straight lines lose 0.3 % of 57 Hz
    without = ride(replace(body, behind=np.zeros(2)), Zener().stiffness(ZENER, omega), road, speed)
    assert abs(without.values[0] / wanted.values[0] - 1) > 0.05  # the lag matters


def test_a_step_too_long_and_a_road_with_a_gap_are_refused():
    car, tyre = QuarterCar(*CAR).body, Spring().state_space([180e3])
    with pytest.raises(ModelError, match=r"step of 0\.01 s is too long: .* state at most 0\.0025 s"):
        ride_in_time(car, tyre, np.zeros((1, 100)), 0.01)
    with pytest.raises(ModelError, match="without gaps"):
        ride_in_time(car, tyre, np.array([[0.0, np.nan, 0.0]]), 1e-3)
    with pytest.raises(ModelError, match="not those of 1 wheels"):
        ride_in_time(car, tyre, np.zeros((2, 100)), 1e-3)


@pytest.mark.thorough
@pytest.mark.sampled(6)
def test_a_cleat_shorter_than_two_steps_has_its_comfort():
    """Against the integrator on samples that have every edge of the cleat."""
    speed = 22.2
    made, fine = cleat(0.02, 0.02), 0.001 / speed / 2
    edges = np.interp(np.arange(round((made.length + 0.4 * speed) / speed / fine)) * fine * speed,
                      made.distance, made.height)  # fmt: skip
    weighted, *_ = integrate(CAR, 180e3, [(120e3, 700.0 / 120e3)], edges, fine, 1)
    found = ride_in_time(
        QuarterCar(*CAR).body, Zener().state_space(ZENER), made.in_time(speed, 5e-4, after=0.4)[None], 5e-4
    )
    assert found.comfort.rms == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=1e-3)
    assert found.comfort.vdv == pytest.approx((fine * np.sum(weighted**4)) ** 0.25, rel=1e-3)


@pytest.mark.sampled(4)
def test_a_damper_feels_each_change_of_slope():
    """Load and energy of a damper on a road with a kink at each sample, by sums over 20 times as many samples."""
    step, fine, damper = 1e-3, 20, 300.0
    road = 1e-3 * np.cumsum(np.random.default_rng(3).normal(size=400)) * np.hanning(400)
    found = ride_in_time(QuarterCar(*CAR).body, KelvinVoigt().state_space((180e3, damper)), road[None], step)
    many = np.interp(np.arange((road.size - 1) * fine + 1) / fine, np.arange(road.size), road)
    x = integrate(CAR, 180e3, [], many, step / fine, 1, damper=damper)[3]
    rate = np.diff(x) * fine / step
    load = 180e3 * 0.5 * (x[1:] + x[:-1]) + damper * rate
    assert found.energy == pytest.approx(np.sum(load * np.diff(x)), rel=2e-3)
    assert found.values[2] == pytest.approx(np.sqrt(np.mean(load**2)), rel=5e-3)


def test_a_tyre_without_a_stiffness_at_rest_can_be_ridden():
    road = cleat(0.02, 0.5).in_time(15.0, 1e-3, after=0.5)
    found = ride_in_time(QuarterCar(*CAR).body, Zener().state_space((0.0, *ZENER[1:])), road[None], 1e-3)
    weighted, *_ = integrate(CAR, 0.0, [(120e3, 700.0 / 120e3)], road, 1e-3, 4)
    assert found.comfort.rms == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=1e-4)
