"""Vehicles as TOML: values in SI, and what is wrong named with its key."""

import pytest

from fourpole.campaign.vehicle import read_vehicle, vehicle_named, vehicle_names
from fourpole.errors import CampaignError, FileError
from fourpole.ride.vehicle import HalfCar, QuarterCar

QUARTER = """
kind = "quarter car"
sprung_mass = "0.25 t"
unsprung_mass = "37.5 kg"
suspension_stiffness = "15.8 N/mm"
suspension_damping = "1.5 kN s/m"
"""
HALF = """
name = "Mine"
kind = "half car"
sprung_mass = "575 kg"
pitch_inertia = "769 kg m²"
front_distance = "1.38 m"
rear_distance = "136 cm"
front_unsprung_mass = "60 kg"
rear_unsprung_mass = "60 kg"
front_suspension_stiffness = "16.8 kN/m"
rear_suspension_stiffness = "16.8 kN/m"
front_suspension_damping = "1.2 kN s/m"
rear_suspension_damping = "1.2 kN s/m"
"""


def test_values_are_in_si():
    assert read_vehicle(QUARTER, "my.toml").vehicle == QuarterCar(250.0, 37.5, 15800.0, 1500.0)
    assert read_vehicle(QUARTER, "my.toml").name == "my"
    half = read_vehicle(HALF)
    assert (half.name, half.vehicle.pitch_inertia, half.vehicle.rear_distance) == ("Mine", 769.0, 1.36)
    assert isinstance(half.vehicle, HalfCar)
    assert half.vehicle.seat_ahead == 0.0
    assert read_vehicle(HALF + 'seat_ahead = "-30 cm"').vehicle.seat_ahead == -0.3


@pytest.mark.parametrize("name", vehicle_names())
def test_each_vehicle_of_the_package_names_its_source(name):
    found = vehicle_named(name)
    assert len(found.source) > 40
    assert 1000 < found.vehicle.body.loads[0] < 60_000


def test_there_are_two_vehicles_and_the_first_is_the_golden_car():
    """Ratios of Sayers 1995: 63.3 1/s², 6.0 1/s and 0.15."""
    assert vehicle_names() == ("golden-car", "large-car")
    golden = vehicle_named("golden-car").vehicle
    ms = golden.sprung_mass
    assert (golden.suspension_stiffness / ms, golden.suspension_damping / ms) == pytest.approx((63.3, 6.0))
    assert golden.unsprung_mass / ms == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"0.25 t"', '"-250 kg"', "v.toml: sprung_mass: -250 kg is not possible: state a value that is positive"),
        ('"0.25 t"', "250", "sprung_mass: .*has no unit; write it as in '15 kg'"),
        ('"0.25 t"', '"250 m"', "sprung_mass: 'm' is a length; a mass is needed"),
        ("sprung_mass", "spring_mass", "unknown key 'spring_mass'; did you mean 'sprung_mass'"),
        ('suspension_damping = "1.5 kN s/m"', "", "suspension_damping is missing: state it with its unit"),
        ('"quarter car"', '"car"', 'kind: \'car\' is none: write kind = "quarter car" or "half car"'),
        ('"quarter car"', "quarter", "v.toml: not valid TOML"),
        ('"37.5 kg"', "[1, 2]", "unsprung_mass: "),
    ],
)
def test_what_is_wrong_is_named(old, new, words):
    with pytest.raises(CampaignError, match=words):
        read_vehicle(QUARTER.replace(old, new, 1), "v.toml")


def test_a_file_that_is_not_there_and_a_name_that_is_none(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        vehicle_named(tmp_path / "no.toml")
    with pytest.raises(CampaignError, match="no vehicle 'golden'; did you mean 'golden-car'"):
        vehicle_named("golden")
    (tmp_path / "my.toml").write_text(QUARTER)
    assert vehicle_named(tmp_path / "my.toml").vehicle.sprung_mass == 250.0
