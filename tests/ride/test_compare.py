"""Rides compared: in time as on a spectrum, with the uncertainty that drawn models have."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models import FractionalZener, GeneralisedMaxwell, KelvinVoigt, Spring, Zener
from fourpole.ride.compare import Tyre, compare_in_time, compare_on_class
from fourpole.ride.contact import ride_with_contact
from fourpole.ride.response import frequencies_of, ride
from fourpole.ride.road import ClassRoad, cleat
from fourpole.ride.time import axles, ride_in_time
from fourpole.ride.vehicle import QuarterCar

BODY = QuarterCar(250.0, 37.5, 15825.0, 1500.0).body
ZENER = np.array([180e3, 120e3, 700.0])
ROOT = np.array([[0.02, 0.0, 0.0], [0.01, 0.05, 0.0], [0.0, 0.02, 0.06]]) * ZENER[:, None]
OTHER = ZENER * np.array([1.1, 1.0, 0.9])
SPEED = 15.0


def tyres(source=("fit", "fit")):
    return [Tyre(Zener(), values, {name: ROOT}, name=name) for values, name in zip((ZENER, OTHER), source, strict=True)]


def test_errors_in_common_cancel_and_others_do_not():
    road = ClassRoad.of("C")
    common, apart = (compare_on_class(BODY, tyres(one), road, SPEED, (10.0, 10.0)) for one in (("a", "a"), ("a", "b")))
    assert common.values == pytest.approx(apart.values)
    assert common.difference[0] == pytest.approx(np.zeros(5))
    assert common.difference_std[0] == pytest.approx(np.zeros(5))
    assert common.difference_std[1, 0] < 0.5 * apart.difference_std[1, 0]
    assert apart.difference_std[1, 0] == pytest.approx(np.hypot(*(apart.std / apart.values)[:, 0]), rel=0.1)
    assert common.damper[0] == pytest.approx([194211.3, 617.1], rel=1e-5)
    assert 1e-3 < abs(common.with_damper[0, 0]) < 0.5


@pytest.mark.statistical
@pytest.mark.parametrize(("lift", "draws"), [(False, 300), (True, 150)])
@pytest.mark.sampled(2)
def test_the_uncertainty_in_time_is_the_spread_of_drawn_models(lift, draws):
    step = 1e-3
    heights = axles(cleat(0.03, 0.4).in_time(SPEED, step, after=0.5), BODY, SPEED, step)
    found = compare_in_time(BODY, tyres()[:1], heights, step, (10.0,), lift=lift)
    assert bool(found.contact) is lift
    rng = np.random.default_rng(6)
    values = []
    for _ in range(draws):
        space = Zener().state_space(ZENER + ROOT @ rng.normal(size=3))
        one = ride_with_contact(BODY, space, heights, step).ride if lift else ride_in_time(BODY, space, heights, step)
        values.append([*one.values, one.comfort.vdv])
    spread = np.std(values, axis=0, ddof=1)
    known = 3 / np.sqrt(2 * draws)  # three times the relative uncertainty of a spread
    assert found.std[0][[0, 1, 2, 3, 4, 6]] == pytest.approx(spread, rel=known)


@pytest.mark.sampled(4)
def test_time_and_spectrum_agree():
    road, step = ClassRoad.of("C"), 5e-4
    once = road.realisation(40.0, step, SPEED, seed=2)
    heights = np.concatenate([once, once, once, once])[None]
    found = compare_in_time(BODY, tyres(), heights, step, (10.0, 10.0))
    wanted = compare_on_class(BODY, tyres(), road, SPEED, (10.0, 10.0))
    assert found.names[:5] == wanted.names
    assert found.values[:, :5] == pytest.approx(wanted.values, rel=0.02)  # the first 40 s begin at rest
    assert found.difference[1, :5] == pytest.approx(wanted.difference[1], abs=2e-3)
    assert found.std[:, :5] == pytest.approx(wanted.std, rel=0.05)
    assert found.with_damper[:, 0] == pytest.approx(wanted.with_damper[:, 0], abs=2e-3)


def test_a_discrepancy_in_time_is_a_stiffer_tyre():
    heights = cleat(0.01, 0.4).in_time(SPEED, 1e-3, after=0.5)[None]
    tyre = Tyre(Zener(), ZENER, discrepancy=(0.02, 0.02))
    found = compare_in_time(BODY, [tyre], heights, 1e-3, (10.0,))
    stiffer = ride_in_time(BODY, Zener().state_space(ZENER * 1.02), heights, 1e-3).values
    assert found.std[0, 0] == pytest.approx(abs(stiffer - found.values[0, :5])[0], rel=0.05)


def test_a_parameter_on_its_bound_has_a_slope_on_one_side():
    values = np.array([180e3, 0.0, 50e3, 0.1, 0.01])
    tyre = Tyre(GeneralisedMaxwell(2), values, {"fit": np.diag([1e3, 2e3, 1e3, 0.01, 1e-3])})
    heights = cleat(0.01, 0.4).in_time(SPEED, 1e-3, after=0.5)[None]
    assert np.all(np.isfinite(compare_in_time(BODY, [tyre], heights, 1e-3, (10.0,)).std))


def test_a_level_road_is_refused():
    with pytest.raises(ModelError, match="the road is level"):
        compare_in_time(BODY, tyres(), np.full((1, 100), 0.3), 1e-3, (10.0, 10.0))


@pytest.mark.sampled(4)
def test_a_fractional_model_in_time_is_as_on_the_spectrum():
    """Values and uncertainties: the arms are the model, and so are the derivatives by its parameters."""
    values = np.array([150e3, 400e3, 1e-3, 0.4])
    errors = {"fit": np.diag([2e3, 8e3, 5e-5, 0.01])}
    tyres = [Tyre(FractionalZener(), values, errors, name="B"), Tyre(Zener(), ZENER, name="Z")]
    road, step = ClassRoad.of("C"), 5e-4
    once = road.realisation(40.0, step, SPEED, seed=2)
    found = compare_in_time(BODY, tyres, np.concatenate([once] * 4)[None], step, (10.0, 10.0))
    wanted = compare_on_class(BODY, tyres, road, SPEED, (10.0, 10.0))
    assert found.values[:, :5] == pytest.approx(wanted.values, rel=0.02)  # the first 40 s begin at rest
    assert found.std[0, :5] == pytest.approx(wanted.std[0], rel=0.05)
    assert 0 < found.approximated[0] < 1e-6
    assert found.approximated[1] == 0


def test_a_model_that_no_arms_can_be_is_refused_with_the_remedy():
    tyre = Tyre(FractionalZener(), np.array([1e3, 1e12, 1e-9, 1.0]), name="B")
    with pytest.raises(ModelError, match=r"^B: 60 arms have an error .*--model prony$"):
        compare_in_time(BODY, [tyre], np.arange(100.0)[None], 1e-3, (10.0,))


def test_a_narrow_resonance_gets_more_frequencies_and_one_without_damping_is_refused():
    """Without a damper in the suspension, against 100 times as many frequencies."""
    body, road = QuarterCar(250.0, 37.5, 15825.0, 0.0).body, ClassRoad.of("C")
    narrow = Tyre(KelvinVoigt(), np.array([180e3, 500.0]))
    found = compare_on_class(body, [narrow], road, SPEED, (10.0,))
    omega = 2 * np.pi * frequencies_of(road, SPEED, 200_001)
    wanted = ride(body, narrow.stiffness(omega), road, SPEED).values
    assert found.values[0] == pytest.approx(wanted, rel=1e-4)
    few = ride(body, narrow.stiffness(2 * np.pi * frequencies_of(road, SPEED)), road, SPEED)
    assert few.unresolved > 0.1
    assert abs(few.values[0] / wanted[0] - 1) > 0.01
    with pytest.raises(ModelError, match=r"resonates at 1\.2. Hz almost without damping.*suspension damping"):
        compare_on_class(body, [Tyre(Spring(), np.array([180e3]))], road, SPEED, (10.0,))


def test_a_tyre_of_no_stiffness_is_refused():
    with pytest.raises(ModelError, match="zero at all frequencies"):
        compare_on_class(BODY, [Tyre(Spring(), np.array([0.0]))], ClassRoad.of("C"), SPEED, (10.0,))
