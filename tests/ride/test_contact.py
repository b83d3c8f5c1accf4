"""Rides with lift-off and with a load-deflection curve, against an integrator that shares nothing with them."""

import numpy as np
import pytest
from tests.ride.integrator import integrate

from fourpole.errors import ModelError
from fourpole.models import KelvinVoigt, Zener
from fourpole.ride.contact import LoadDeflection, ride_with_contact
from fourpole.ride.road import cleat, pothole
from fourpole.ride.time import axles, ride_in_time
from fourpole.ride.vehicle import HalfCar, QuarterCar

CAR = (250.0, 37.5, 15825.0, 1500.0)
BODY = QuarterCar(*CAR).body
ZENER, ARMS = (180e3, 120e3, 700.0), [(120e3, 700.0 / 120e3)]
#: A progressive tyre: 180 kN/m at the load of this car.
DEFLECTION = np.linspace(0.0, 0.08, 161)
LOAD = 120e3 * DEFLECTION + 1.9e6 * DEFLECTION**2
STEP = 2.5e-4


@pytest.mark.parametrize("model", [Zener(), KelvinVoigt()], ids=lambda one: one.name)
def test_a_small_ride_is_the_linear_one(model):
    tyre = model.state_space(ZENER if model.name == "zener" else (180e3, 300.0))
    road = cleat(0.005, 0.5).in_time(10.0, STEP, after=1.0)[None]
    found, wanted = ride_with_contact(BODY, tyre, road, STEP), ride_in_time(BODY, tyre, road, STEP)
    assert not found.in_air.any()
    assert found.ride.comfort.rms == pytest.approx(wanted.comfort.rms, rel=2e-4)
    assert found.ride.values[:-1] == pytest.approx(wanted.values[:-1], rel=2e-3)
    # the rate of a damper jumps at the edges of the cleat, where power depends on the kind of difference
    assert found.ride.values[-1] == pytest.approx(wanted.values[-1], rel=0.03 if model.name == "kelvin" else 2e-3)


def test_two_wheels_are_those_of_the_linear_ride():
    body = HalfCar(575.0, 769.0, 1.38, 1.36, 60.0, 60.0, 16800.0, 16800.0, 1200.0, 1200.0).body
    tyre = Zener().state_space(ZENER)
    road = axles(cleat(0.005, 0.5).in_time(10.0, STEP, after=1.0), body, 10.0, STEP)
    found, wanted = ride_with_contact(body, tyre, road, STEP), ride_in_time(body, tyre, road, STEP)
    assert found.ride.values == pytest.approx(wanted.values, rel=5e-4)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.sampled(2)
def test_a_wheel_that_leaves_the_road_is_that_of_an_independent_integrator(curved):
    """A cleat of 40 mm at 15 m/s throws the wheel into the air; the tyre relaxes there."""
    road = cleat(0.04, 0.5).in_time(15.0, STEP, after=0.7)
    curve = LoadDeflection(DEFLECTION, LOAD) if curved else None
    static = None
    if curved:
        rest = curve.deflection_at(BODY.loads[0])

        def static(x):
            inside = np.clip(x + rest, DEFLECTION[0], DEFLECTION[-1])
            ends = (LOAD[1] - LOAD[0], LOAD[-1] - LOAD[-2])
            slope = ends[0] if x + rest < inside else ends[1]
            return np.interp(inside, DEFLECTION, LOAD) + slope / (DEFLECTION[1] - DEFLECTION[0]) * (x + rest - inside)

    found = ride_with_contact(BODY, Zener().state_space(ZENER), road[None], STEP, curve)
    weighted, _, force, _ = integrate(CAR, 180e3, ARMS, road, STEP, 1, lift=True, static=static)
    airborne = float(np.mean(force <= 0))
    assert airborne > 0.02
    assert found.in_air[0] == pytest.approx(airborne, abs=0.002)
    assert found.ride.load.min() == pytest.approx(-BODY.loads[0])
    assert found.ride.comfort.rms == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=1e-3)
    assert found.ride.load[0] == pytest.approx(force - BODY.loads[0], abs=0.005 * force.max())


def test_a_smaller_step_changes_little():
    rides = []
    for step in (STEP, STEP / 4):
        road = cleat(0.04, 0.5).in_time(15.0, step, after=0.7)
        rides.append(ride_with_contact(BODY, Zener().state_space(ZENER), road[None], step).ride.comfort.rms)
    assert rides[0] == pytest.approx(rides[1], rel=1e-3)


def test_a_wheel_beyond_its_curve_is_counted_and_a_load_beyond_it_refused():
    short = LoadDeflection(DEFLECTION[:60], LOAD[:60])
    road = cleat(0.04, 0.5).in_time(15.0, STEP, after=0.2)[None]
    assert ride_with_contact(BODY, Zener().state_space(ZENER), road, STEP, short).beyond[0] > 0
    with pytest.raises(ModelError, match=r"static load of the wheel, 2819 N, is not on the load-deflection curve"):
        ride_with_contact(BODY, Zener().state_space(ZENER), road, STEP, LoadDeflection(DEFLECTION[:20], LOAD[:20]))
    with pytest.raises(ModelError, match="does not rise everywhere"):
        LoadDeflection(DEFLECTION[:3], np.array([0.0, 5.0, 4.0]))
    with pytest.raises(ModelError, match="at least two points"):
        LoadDeflection(DEFLECTION[:1], LOAD[:1])


@pytest.mark.thorough
@pytest.mark.sampled(6)
def test_a_pothole_at_the_step_of_the_command_is_that_of_an_independent_integrator():
    """Edges of 2 ms throw the wheel into the air; at a step of 0.25 ms a_w would be 0.16 % less."""
    made, step = pothole(0.05, 0.4), 1.25e-4
    edges = made.in_time(20.0, step / 4, after=0.3)
    found = ride_with_contact(BODY, Zener().state_space(ZENER), made.in_time(20.0, step, after=0.3)[None], step)
    weighted, *_ = integrate(CAR, 180e3, ARMS, edges, step / 4, 1, lift=True)
    assert found.in_air[0] > 0.02
    assert found.ride.comfort.rms == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=1e-3)
