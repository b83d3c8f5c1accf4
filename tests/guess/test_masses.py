"""V1, V2 and signs without a force, by what a mass behind a specimen does."""

from types import SimpleNamespace

import numpy as np
import pytest

from fourpole.guess import masses
from fourpole.guess.masses import _apart, _departure, by_mass, rig_doubt
from fourpole.words.heads import Column, Role

NEAR = Role("motion_in", "acc_base", "m/s^2", "acceleration")
FAR = Role("motion_out", "acc_mass", "m/s^2", "acceleration")


def ratio(place, loss=0.1):
    """V2 over V1 at a frequency over that of the resonance."""
    return (1 + 1j * loss) / (1 + 1j * loss - place**2)


def found(places, *, exchanged=False, turned=False, below=False, names=("acc_base", "acc_mass"), loss=0.1):
    """The columns of V1 and V2, the signs, and the doubts, of recordings at some frequencies over the resonance."""
    shapes = []
    for place in places:
        pair = [1.0, ratio(place, loss) * (-1 if turned else 1)]
        shapes.append(SimpleNamespace(frequency=20.0 * place, amplitudes=dict(zip(names, pair, strict=True))))
    order = names[::-1] if exchanged else names
    roles = {
        role: Role(role, column, "m/s^2", "acceleration")
        for role, column in zip(("motion_in", "motion_out"), order, strict=True)
    }
    roles = by_mass(roles, shapes[::-1], below=below)
    near, far = roles["motion_in"], roles["motion_out"]
    assert (near.role, far.role) == ("motion_in", "motion_out")
    return (near.column, far.column), near.invert != far.invert, far.doubts


BANDS = {
    "below": [0.2, 0.5, 0.7], "across": [0.3, 0.9, 2.0, 5.0], "above": [2.0, 5.0, 10.0], "at it": [0.95, 1.0, 1.05],
}  # fmt: skip


@pytest.mark.parametrize("band", BANDS.values(), ids=BANDS)
def test_what_is_right_stays(band):
    assert found(band) == (("acc_base", "acc_mass"), False, ())


@pytest.mark.parametrize("band", ["across", "above"])
def test_columns_that_are_exchanged_are_found_and_said(band):
    columns, turned, (doubt,) = found(BANDS[band], exchanged=True)
    assert (columns, turned) == (("acc_base", "acc_mass"), False)
    assert "exchanged" in doubt


@pytest.mark.parametrize("band", ["across", "above"])
def test_a_sensor_that_is_turned_is_found_and_said(band):
    columns, turned, (doubt,) = found(BANDS[band], turned=True)
    assert (columns, turned) == (("acc_base", "acc_mass"), True)
    assert "its sign is turned" in doubt


@pytest.mark.parametrize("place", [0.8, 1.0, 1.2, 3.0])
def test_one_recording_shows_exchanged_columns_too(place):
    assert found([place], exchanged=True)[:2] == (("acc_base", "acc_mass"), False)
    assert found([place])[1:] == (False, ())


def test_a_channel_that_stands_still_is_passed_over():
    still = SimpleNamespace(frequency=20.0, amplitudes={"acc_base": 0j, "acc_mass": 1.0 + 0j})
    roles = {"motion_in": NEAR, "motion_out": FAR}
    assert by_mass(roles, [still]) == roles


def test_a_low_loss_whose_sign_the_phases_of_the_sensors_hide_turns_nothing():
    assert found([3.0, 5.0, 10.0], loss=-0.01) == (("acc_base", "acc_mass"), False, ())


def test_below_the_resonance_too():
    assert found(BANDS["below"], exchanged=True)[:2] == (("acc_base", "acc_mass"), False)
    assert found(BANDS["below"], turned=True)[:2] == (("acc_base", "acc_mass"), True)
    assert found(BANDS["across"], exchanged=True, turned=True)[:2] == (("acc_base", "acc_mass"), True)


def test_springs_of_the_mass_change_nothing():
    """Below the resonance of mass and springs K* without them is negative."""
    places = np.array([0.1, 0.2, 0.35, 0.6, 1.5, 3.0, 6.0])
    shapes = [
        SimpleNamespace(
            frequency=place, amplitudes={"acc_base": 1.0, "acc_mass": (1 + 0.1j) / (1.06 + 0.1j - place**2)}
        )
        for place in places.tolist()
    ]
    roles = {"motion_in": NEAR, "motion_out": FAR}
    assert by_mass(roles, shapes, below=False) == roles


def test_a_motion_that_is_none_of_a_mass_is_doubted():
    shapes = [SimpleNamespace(frequency=f, amplitudes={"acc_base": 1.0, "acc_mass": 0.5 / f}) for f in (1.0, 9.0, 99.0)]
    roles = by_mass({"motion_in": NEAR, "motion_out": FAR}, shapes, below=False)
    assert "not those of a mass" in roles["motion_out"].doubts[0]


def test_below_the_specimen_the_lower_sensor_is_on_the_mass():
    names = "Beschl. oben", "Beschl. unten"
    assert found(BANDS["across"], exchanged=True, below=True, names=names) == (names, False, ())
    columns, _, (doubt,) = found(BANDS["across"], exchanged=True, below=False, names=names)
    assert columns == names
    assert "exchanged" in doubt


def test_with_a_force_the_roles_stay():
    roles = {"force_in": NEAR, "motion_in": FAR, "motion_out": NEAR}
    assert by_mass(roles, [], below=True) is roles


@pytest.mark.parametrize(
    ("rig", "said"),
    [
        ({}, "the mass behind the specimen, which is stated nowhere"),
        ({"moving_mass": 12.5}, "count as softer than the specimen"),
        ({"moving_mass": 12.5, "preload_stiffness": 9e3}, None),
    ],
)
def test_what_a_value_of_the_rig_gains_is_said(rig, said):
    doubt = rig_doubt({"motion_in": NEAR, "motion_out": FAR}, rig)
    assert doubt is None if said is None else said in doubt[0]


@pytest.mark.parametrize(("factor", "doubted"), [(0.98, False), (1.02, True)])
def test_a_stiffness_that_changes_by_a_factor_of_e_is_none_of_an_elastomer(factor, doubted):
    logs = 0.1j + factor * np.array([-1.0, -1j, -1j, 0.0, 1.0])
    assert (_departure(np.exp(logs)) > 1.0) is doubted


def sensors(*, third, tilt=0.0, unit="m/s^2"):
    """The roles with a third column: a further sensor on the mass, on the input, or across."""
    names = ("acc_base", "acc_mass", third)
    shapes = []
    for place in BANDS["across"]:
        of = {"on mass": ratio(place) * (1 + tilt), "on input": 1.0 + tilt, "across": 0.05j}[third]
        shapes.append(
            SimpleNamespace(frequency=place, amplitudes=dict(zip(names, (1.0, ratio(place), of), strict=True)))
        )
    columns = [Column(name, "m/s^2", "acceleration") for name in names[:2]] + [Column(third, unit, "acceleration")]
    return by_mass({"motion_in": NEAR, "motion_out": FAR}, shapes, columns)


def test_a_third_sensor_is_part_of_a_mean_where_it_moves_as_v1_or_v2_does():
    assert sensors(third="on mass", tilt=0.2)["motion_out"].beside == ("on mass",)
    assert sensors(third="on input")["motion_in"].beside == ("on input",)
    assert "which move as sensors on one part do" in sensors(third="on input")["motion_in"].doubts[0]
    assert all(not role.beside for role in sensors(third="across").values())
    assert all(not role.beside for role in sensors(third="on mass", unit="g").values())


@pytest.mark.parametrize(("tilt", "beside"), [(0.29, ("on mass",)), (0.31, ())])
def test_a_mass_may_tilt_by_thirty_percent(tilt, beside):
    assert sensors(third="on mass", tilt=tilt)["motion_out"].beside == beside


def test_columns_without_amplitudes_are_apart():
    assert _apart("a", "b", []) == np.inf


@pytest.mark.parametrize(("after", "changed"), [(0.49, True), (0.51, False)])
def test_half_of_the_departure_is_a_clear_change(monkeypatch, after, changed):
    departures = iter([1.0, after, 2.0, 2.0])
    monkeypatch.setattr(masses, "_departure", lambda stiffness: next(departures))
    leads = SimpleNamespace(frequency=20.0, amplitudes={"acc_base": 1.0, "acc_mass": 0.5j})
    roles = by_mass({"motion_in": NEAR, "motion_out": FAR}, [leads])
    assert (roles["motion_in"].column == "acc_mass") is changed
