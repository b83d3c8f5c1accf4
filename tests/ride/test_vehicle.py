"""Vehicles: their matrices against hand-written equations, and impossible values."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.ride.vehicle import GRAVITY, HalfCar, QuarterCar

QUARTER = {"sprung_mass": 250.0, "unsprung_mass": 37.5, "suspension_stiffness": 15825.0, "suspension_damping": 1500.0}
HALF = {
    "sprung_mass": 575.0, "pitch_inertia": 769.0, "front_distance": 1.3, "rear_distance": 1.5,
    "front_unsprung_mass": 40.0, "rear_unsprung_mass": 45.0,
    "front_suspension_stiffness": 16800.0, "rear_suspension_stiffness": 18600.0,
    "front_suspension_damping": 1200.0, "rear_suspension_damping": 1300.0, "seat_ahead": 0.2,
}  # fmt: skip


def test_a_quarter_car_has_the_forces_of_its_equations():
    body = QuarterCar(**QUARTER).body
    q, v = np.array([0.01, 0.03]), np.array([0.2, -0.1])
    force = 15825.0 * (q[1] - q[0]) + 1500.0 * (v[1] - v[0])  # upwards on the body
    assert body.stiffness @ q + body.damping @ v == pytest.approx([-force, force])
    assert body.travel @ q == pytest.approx([0.02])


def test_a_half_car_has_the_forces_of_its_equations():
    body = HalfCar(**HALF).body
    rng = np.random.default_rng(3)
    (heave, pitch, front, rear), v = rng.normal(size=4), rng.normal(size=4)
    at_front = 16800.0 * (front - heave - 1.3 * pitch) + 1200.0 * (v[2] - v[0] - 1.3 * v[1])
    at_rear = 18600.0 * (rear - heave + 1.5 * pitch) + 1300.0 * (v[3] - v[0] + 1.5 * v[1])
    wanted = [-at_front - at_rear, -1.3 * at_front + 1.5 * at_rear, at_front, at_rear]
    assert body.stiffness @ [heave, pitch, front, rear] + body.damping @ v == pytest.approx(wanted)
    assert body.loads.sum() == pytest.approx((575.0 + 85.0) * GRAVITY)
    assert body.loads[0] == pytest.approx((575.0 * 1.5 / 2.8 + 40.0) * GRAVITY)
    assert body.behind == pytest.approx([0.0, 2.8])
    assert body.seat @ [heave, pitch, 0, 0] == pytest.approx(heave + 0.2 * pitch)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("sprung_mass", -250.0, "sprung_mass: -250 kg is not possible: state a value that is positive"),
        ("unsprung_mass", 0.0, "unsprung_mass: 0 kg"),
        ("suspension_stiffness", float("nan"), "suspension_stiffness: nan N/m"),
        ("suspension_damping", -1.0, "suspension_damping: -1 N s/m .* a value that is zero or positive"),
    ],
)  # fmt: skip
def test_an_impossible_value_is_refused_by_its_name(name, value, words):
    with pytest.raises(ModelError, match=words):
        QuarterCar(**{**QUARTER, name: value})


def test_a_seat_may_be_behind_and_damping_zero():
    assert HalfCar(**{**HALF, "seat_ahead": -0.5}).body.seat[1] == -0.5
    assert not QuarterCar(**{**QUARTER, "suspension_damping": 0.0}).body.damping.any()
