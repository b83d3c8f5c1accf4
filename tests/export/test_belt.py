"""A belt in the exports of a model and in rides: both ends by the two-port of the specimen, and each mass once."""

from __future__ import annotations

import json

import numpy as np
import polars as pl
import pytest
from tests.export.modelica import read_modelica
from tests.export.test_tir import read as read_tir
from tests.export.vehicle import LOAD, PRESSURE, parameters, table

from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError, UnitError
from fourpole.export import export_results
from fourpole.fitting.inertia import InertiaFile, belt_stated, mean_inertia
from fourpole.fitting.measured import measured_of, read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.placed import placed_models
from fourpole.fitting.ridetyres import tyres_for_ride
from fourpole.models import Zener
from fourpole.ride.compare import compare_in_time, compare_on_class
from fourpole.ride.contact import LoadDeflection
from fourpole.ride.response import Condensed, transfers
from fourpole.ride.road import ClassRoad
from fourpole.ride.time import whole_system
from fourpole.ride.vehicle import GRAVITY, HalfCar, QuarterCar

BELT = Specimen(Form.BELT, 7.0, 0.2)
VALUES = parameters(2e5, 3.5e3)
FREQUENCY = np.geomspace(0.1, 300.0, 60)
OMEGA = 2 * np.pi * FREQUENCY
EXACT = BELT.dynamic_stiffness(Zener().stiffness(VALUES, OMEGA), OMEGA)
CARS = [
    QuarterCar(250.0, 37.5, 15825.0, 1500.0),
    HalfCar(500.0, 700.0, 1.2, 1.4, 40.0, 41.0, 18e3, 19e3, 1500.0, 1600.0, 0.1),
]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A fit of the tyre at one condition."""
    measured = measured_of(table((2e5,), (3.5e3,)), std=1e-6)
    path = tmp_path_factory.mktemp("belt") / "model.json"
    model_file(measured, fit_tyres(measured, "zener")).write(path)
    return path


def ends(found, omega=OMEGA):
    """Forces (N, 2, 2) F1 and -F2 over the motions of both ends, from matrices A, B, C, D of a file."""
    a, b, c, d = found
    one = []
    for w in omega:
        drive = np.array([[1, 0], [1j * w, 0], [0, 1], [0, 1j * w]])
        states = np.linalg.solve(1j * w * np.eye(len(a)) - a, b @ drive)
        one.append(np.diag([1, -1]) @ (c @ states + d @ drive))
    return np.array(one)


@pytest.mark.parametrize("kind", ["statespace", "modelica"])
def test_both_ends_are_the_two_port_and_their_rigid_body_is_the_belt(kind, model, tmp_path):
    exported = export_results(model, kind, tmp_path / "a.x", belt=BELT)
    if kind == "statespace":
        document = json.loads(exported.path.read_text("utf-8"))
        (one,) = document["systems"]
        assert len(document["inputs"]) == 4
        assert (one["belt_mass_kg"], one["belt_share"]) == (7.0, 0.2)
        found = [np.array(one[name]) for name in "ABCD"]
    else:
        (block,) = read_modelica(exported.path.read_text("utf-8"))[1].values()
        assert (block.inputs, block.outputs) == (["x1", "v1", "x2", "v2"], ["F1", "F2"])
        found = block.matrices()
    assert np.abs(ends(found) / EXACT - 1).max() < 1e-6
    slow = np.array([2 * np.pi * 0.01])
    assert -ends(found, slow)[0].sum().real / slow[0] ** 2 == pytest.approx(BELT.mass, rel=1e-5)
    assert np.all(np.linalg.eigvals(found[0]).real < 0)
    assert "the belt of 7 kg is in the file: take it off the unsprung mass of the vehicle" in exported.notes


@pytest.mark.parametrize("car", CARS)
def test_a_ride_has_the_belt_out_of_the_unsprung_mass(car):
    """The two-port of the specimen under the vehicle without the belt, by matrices; masses and weight as stated."""
    body = car.body
    lags, k = body.behind / 20.0, Zener().stiffness(VALUES, OMEGA)
    found, _ = transfers(Condensed.of(body.without(BELT.mass), OMEGA), k, lags, BELT)
    steps = whole_system(body, Zener().state_space(VALUES), BELT).response(FREQUENCY)
    mass = body.mass.copy()
    n, w = len(mass), body.wheels
    mass[range(n - w, n), range(n - w, n)] -= BELT.mass
    onto = np.eye(n)[:, n - w :]
    for at, omega in enumerate(OMEGA):
        d = EXACT[at]
        road = np.exp(-1j * omega * lags)
        whole = body.stiffness + 1j * omega * body.damping - omega**2 * mass + d[1, 1] * onto @ onto.T
        motion = np.linalg.solve(whole, -d[1, 0] * onto @ road)
        load = d[0, 0] * road + d[0, 1] * motion[n - w :]
        assert found.acceleration[at] == pytest.approx(-(omega**2) * body.seat @ motion, rel=1e-6)
        assert found.load[at] == pytest.approx(load, rel=1e-6)
        assert (steps[at] @ road)[: 1 + w] == pytest.approx([found.acceleration[at], *found.load[at]], rel=1e-6)
        force = -d[1, 0] * road - d[1, 1] * motion[n - w :]
        power = omega * np.imag(np.vdot(road, load) - np.vdot(motion[n - w :], force))
        assert omega * k[at].imag * np.sum(np.abs(found.deflection[at]) ** 2) == pytest.approx(power, rel=1e-6)
    carried = sum(getattr(car, name) for name in vars(car) if name.endswith("sprung_mass"))
    assert body.without(BELT.mass).loads.sum() == pytest.approx(carried * GRAVITY)
    omega = np.array([1e-3])  # a slow road carries the whole vehicle: its loads are those of the stated masses
    slow, _ = transfers(Condensed.of(body.without(BELT.mass), omega), k[:1].real + 0j, 0 * lags, BELT)
    assert -slow.load.sum().real / omega[0] ** 2 == pytest.approx(carried, rel=1e-4)


@pytest.mark.sampled(6)
def test_rides_in_time_and_on_a_spectrum_have_the_same_belt(model):
    road, (one,) = ClassRoad.of("C"), tyres_for_ride(model, belt=BELT)
    body, heights = CARS[0].body, road.realisation(60.0, 5e-4, 20.0, 1)
    spectrum = compare_on_class(body, [one.tyre], road, 20.0, [10.0])
    time = compare_in_time(body, [one.tyre], heights[None], 5e-4, [10.0])
    assert time.values[0, :5] == pytest.approx(spectrum.values[0], rel=0.1)
    assert time.std[0, :5] == pytest.approx(spectrum.std[0], rel=0.2)
    (plain,) = tyres_for_ride(model)
    without = compare_on_class(body, [plain.tyre], road, 20.0, [10.0])
    assert np.all(np.abs(without.values / spectrum.values - 1)[0, :3] > 1e-3)
    high = compare_in_time(body, [one.tyre], 1e-2 * heights[None, :8000], 2.5e-4, [10.0], lift=True)
    low = compare_in_time(body, [one.tyre], 1e-2 * heights[None, :8000], 2.5e-4, [10.0])
    assert high.values == pytest.approx(low.values, rel=2e-3)  # that is too low a road for a lift-off
    rough = compare_in_time(body, [one.tyre], 4.0 * heights[None, :4000], 5e-4, [10.0], lift=True)
    assert 0 < rough.contact[0].in_air[0] < 0.5
    curve = LoadDeflection(np.array([0.0, 0.05]), np.array([0.0, 9e3]))
    with pytest.raises(ModelError, match=r'curve is of the whole tyre.*--belt-mass "0 kg"'):
        compare_in_time(body, [one.tyre], heights[None], 5e-4, [10.0], curve=curve)
    with pytest.raises(ModelError, match=r"the belt of 40 kg is a part of the unsprung mass of 37.5 kg, and leaves no"):
        body.without(40.0)


def test_a_tir_file_has_the_mode_of_the_belt(model, tmp_path):
    blocks, comments = read_tir(export_results(model, "tir", tmp_path / "a.tir", frequency=20.0, belt=BELT).path)
    assert blocks["INERTIA"] == {"BELT_MASS": 7.0}
    mode = blocks["STRUCTURAL"]
    k = Zener().stiffness(VALUES, 2 * np.pi * mode["FREQ_LONG"])
    assert mode["FREQ_LONG"] == pytest.approx(np.sqrt(1.2 / 0.2 * k.real / 7.0) / (2 * np.pi), rel=1e-6)
    assert mode["DAMP_LONG"] == pytest.approx(k.imag / k.real / 2, rel=1e-6)
    assert "FREQ_LONG is outside the tested frequencies" in comments
    blocks, _ = read_tir(export_results(model, "tir", tmp_path / "a.tir", frequency=20.0).path)
    assert not {"INERTIA", "STRUCTURAL"} & set(blocks)


def test_a_model_file_has_the_inertia_of_specimens_csv(tmp_path):
    """A row per specimen and condition; a blank value of an axis is that of every condition."""
    rows_of = table((1.7e5, 2e5), (2e3, 3.5e3))
    rows_of.write_csv(tmp_path / "dynamic.csv")
    rows = [("tyre", p, None, form, mass, share) for p, form, mass, share in
            ((1.7e5, "belt", 7.0, 0.16), (2e5, "belt", 7.0, 0.25), (2.4e5, "massless", None, None))]  # fmt: skip
    schema = ["tyre", PRESSURE, LOAD, "form", "belt mass [kg]", "share of springs [1]"]
    pl.DataFrame(rows, schema=schema, orient="row").write_csv(tmp_path / "specimens.csv")
    measured = read_measured(tmp_path, std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    model_file(measured, maps=map_tyres(measured, "zener")).write(tmp_path / "map.json")
    fits, mapped = read_model_file(tmp_path / "model.json"), read_model_file(tmp_path / "map.json")
    placed = placed_models(fits, "model.json")
    assert [(one.state[PRESSURE], one.belt) for one in placed[::2]] == [
        (1.7e5, Specimen(Form.BELT, 7.0, 0.16)), (2e5, Specimen(Form.BELT, 7.0, 0.25)),
    ]  # fmt: skip
    (one,) = placed_models(mapped, "map.json", [{PRESSURE: 1.8e5, LOAD: 2.5e3}])
    assert (one.belt.mass, one.belt.share) == (7.0, pytest.approx(0.2))
    assert placed_models(mapped, "map.json", [{PRESSURE: 1.8e5, LOAD: 2.5e3}], belt=Specimen())[0].belt == Specimen()
    names = pl.Series("test", [f"D{at}" for at in range(rows_of.height)])
    rows_of.with_columns(names, pl.lit("driving point").alias("K* of")).write_csv(tmp_path / "dynamic.csv")
    assert {one.inertia for one in read_measured(tmp_path, std=1e-3).conditions} == {None}


def test_a_rod_is_named_and_left_out(tmp_path):
    measured = measured_of(table((2e5,), (3.5e3,)), std=1e-3)
    made = model_file(measured, fit_tyres(measured, "zener"))
    rod = InertiaFile(form="rod", mass=0.4, share=None)
    (entry,) = made.models
    conditions = [one.model_copy(update={"inertia": rod}) for one in entry.conditions]
    made = made.model_copy(update={"models": [entry.model_copy(update={"conditions": conditions})]})
    made.write(tmp_path / "model.json")
    exported = export_results(tmp_path / "model.json", "statespace")
    assert any(
        "its own mass of 0.4 kg is not in the model: add half of it at each end" in one for one in exported.notes
    )
    assert json.loads(exported.path.read_text("utf-8"))["outputs"] == ["force F [N]"]


def test_a_belt_that_is_stated():
    assert belt_stated(None, None) is None
    assert belt_stated(0.0, 0.3) == Specimen()
    assert belt_stated(7.0, 0.3) == Specimen(Form.BELT, 7.0, 0.3)
    for mass, share in ((None, 0.3), (7.0, 0.0), (7.0, float("nan"))):
        with pytest.raises(UnitError, match="--belt-share"):
            belt_stated(mass, share)
    assert mean_inertia([None]) is None
