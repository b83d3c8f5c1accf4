"""fourpole ride: what is printed and written, and what is refused."""

import json

import numpy as np
import polars as pl
import pytest
from tests.fitting.test_ridetyres import table
from tests.fitting.test_shifting import table as isotherms
from tests.ride.integrator import integrate

from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.models import Zener
from fourpole.ride.response import frequencies_of, ride
from fourpole.ride.road import ClassRoad
from fourpole.ride.vehicle import QuarterCar

SPEED = 80 / 3.6


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ride")
    measured = read_measured(table(folder / "k.csv"), std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(folder / "model.json")
    model_file(measured, maps=map_tyres(measured, "zener")).write(folder / "map.json")
    narrow = measured.only(None, (8.0, 30.0))
    model_file(narrow, fit_tyres(narrow, "zener")).write(folder / "narrow.json")
    one = read_measured(table(folder / "one.csv", (2e5,)), std=0.05)
    for name in ("structural", "fractional", "spring", "kelvin"):
        model_file(one, fit_tyres(one, name)).write(folder / f"{name}.json")
    return folder


def told(text):
    return " ".join(text.split())


@pytest.mark.sampled(2)
def test_two_pressures_of_a_map_differ_by_a_number_with_its_uncertainty(run, files, tmp_path):
    points = ("--at", "pressure=1.7 bar", "--at", "pressure=2.3 bar")
    ran = run("ride", files / "map.json", *points, "--road", "c", "--out", tmp_path / "r")
    assert ran.exit_code == 0, ran.stderr
    assert "Ride: Golden car, 250 kg, road class C, 80 km/h" in ran.stdout
    assert "Difference from a, 1.7 bar, in %" in ran.stdout
    assert "constant damper instead of the model" in ran.stdout
    assert "a, 2.3 bar is less comfortable than a, 1.7 bar: a_w differs by 10." in ran.stdout
    assert ran.stderr == ""
    narrow = run("ride", files / "narrow.json", *points[:2])
    assert "(a) is from frequencies outside the tested ones, 8.447 to 24.55 Hz" in told(narrow.stderr)
    assert {path.name for path in (tmp_path / "r").iterdir()} == {"ride.csv", "ride.json", "ride.svg", "ride.png"}
    rows = pl.read_csv(tmp_path / "r" / "ride.csv").rows(named=True)
    road, car = ClassRoad.of("C"), QuarterCar(250.0, 37.5, 15825.0, 1500.0).body
    omega = 2 * np.pi * frequencies_of(road, SPEED)
    for row, p in zip(rows, (1.7e5, 2.3e5), strict=True):
        exact = ride(car, Zener().stiffness([180e3 * p / 2e5, 120e3 * p / 2e5, 700.0], omega), road, SPEED)
        off = row["weighted acceleration [m/s^2]"] - exact.values[0]
        assert abs(off) < 4 * row["u(weighted acceleration) [m/s^2]"]
    second = rows[1]
    assert second["difference in weighted acceleration [1]"] == pytest.approx(
        rows[1]["weighted acceleration [m/s^2]"] / rows[0]["weighted acceleration [m/s^2]"] - 1
    )
    alone = second["u(weighted acceleration) [m/s^2]"] / second["weighted acceleration [m/s^2]"]
    assert 0 < second["u(difference in weighted acceleration) [1]"] < 2 * alone
    document = json.loads((tmp_path / "r" / "ride.json").read_text())
    assert document["speed [m/s]"] == pytest.approx(SPEED)
    assert document["vehicle"]["source"].startswith("M. W. Sayers")


def test_files_are_compared_in_their_order(run, files):
    ran = run(
        "ride",
        files / "fractional.json",
        files / "model.json",
        "--json",
        "--speed",
        "50 km/h",
        "--vehicle",
        "large-car",
    )
    document = json.loads(ran.stdout)
    assert [one["label"] for one in document["rides"]] == [
        "a, 2 bar, fractional",
        "a, 1.7 bar",
        "a, 2 bar, zener",
        "a, 2.4 bar",
    ]
    assert document["rides"][0]["difference in weighted acceleration [1]"] == 0
    assert document["vehicle"]["sprung_mass"] == 454.5


def test_the_same_tyre_of_two_files_is_told_by_its_file(run, files, tmp_path):
    at = ("--at", "pressure=2 bar", "--json")
    places = [tmp_path / name / "model.json" for name in ("spring", "autumn")]
    for place in places:
        place.parent.mkdir()
        place.write_bytes((files / "model.json").read_bytes())
    document = json.loads(run("ride", *places, *at).stdout)
    assert [one["label"] for one in document["rides"]] == ["a, spring/model.json", "a, autumn/model.json"]
    document = json.loads(run("ride", places[0], places[0], *at).stdout)
    assert [one["label"] for one in document["rides"]] == ["a (1)", "a (2)"]
    assert document["rides"][1]["u(difference in weighted acceleration) [1]"] == 0


def test_errors_of_two_files_are_independent(run, files):
    """Discrepancies of models of one tyre in two files do not cancel."""
    at = ("--at", "pressure=2 bar", "--json")
    alone, apart = (
        json.loads(run("ride", *each, *at).stdout)["rides"][-1]
        for each in ((files / "kelvin.json",), (files / "spring.json", files / "kelvin.json"))
    )
    own = alone["u(weighted acceleration) [m/s^2]"] / alone["weighted acceleration [m/s^2]"]
    assert own > 0.05  # mostly discrepancy
    assert apart["u(difference in weighted acceleration) [1]"] > own


@pytest.mark.sampled(2)
def test_a_spring_that_loses_nothing_has_no_relative_power(run, files, tmp_path):
    ran = run("ride", files / "spring.json", files / "kelvin.json", "--at", "pressure=2 bar", "--out", tmp_path / "r")
    assert ran.exit_code == 0, ran.stderr
    assert "Warning" not in ran.stderr
    rides = json.loads((tmp_path / "r" / "ride.json").read_text(), parse_constant=pytest.fail)["rides"]
    assert [one["difference in power lost in the tyres [1]"] for one in rides] == [None, None]


@pytest.mark.sampled(8)
def test_a_road_in_time_has_crest_factor_and_dose(run, files, tmp_path):
    at = ("--at", "pressure=2 bar")
    ran = run("ride", files / "model.json", *at, "--duration", "10 s", "--seed", 3, "--json")
    (row,) = json.loads(ran.stdout)["rides"]
    assert 2 < row["crest factor [1]"] < 6
    assert row["vibration dose value [m/s^1.75]"] > row["weighted acceleration [m/s^2]"]
    ran = run("ride", files / "model.json", *at, "--road", "cleat 30 mm, 300 mm", "--lift-off", "--out", tmp_path / "c")
    assert ran.exit_code == 0, ran.stderr
    assert "a wheel is in the air" in told(ran.stderr)
    assert (tmp_path / "c" / "ride.png").is_file()
    for road in ("pothole 20 mm, 400 mm", "sweep 1 mm, 0.5:20 Hz, 5 s"):
        assert run("ride", files / "model.json", *at, "--road", road).exit_code == 0


@pytest.mark.sampled(6)
def test_a_measured_road_and_a_load_deflection_curve(run, files, tmp_path):
    x = np.arange(0.0, 60.0, 0.05)
    rows = zip(x.tolist(), (5 * np.sin(x)).tolist(), strict=True)
    road = tmp_path / "road.csv"
    road.write_text("distance [m],height [mm]\n" + "".join(f"{a:.3f},{b:.6f}\n" for a, b in rows))
    deflection = np.concatenate([np.linspace(0, 40, 200), np.linspace(40, 0, 200)])
    curve = tmp_path / "curve.csv"
    load = 120.0 * deflection + 1.5 * deflection**2
    curve.write_text(
        "deflection [mm],load [N]\n" + "".join(f"{a},{b}\n" for a, b in zip(deflection, load, strict=True))
    )
    at = ("--at", "pressure=2 bar", "--road", road)
    plain, curved = (
        json.loads(run("ride", files / "model.json", *at, "--json", *more).stdout)["rides"][0]
        for more in ((), ("--curve", curve))
    )
    assert plain["dynamic wheel load [N]"] > 0
    ratio = curved["dynamic wheel load [N]"] / plain["dynamic wheel load [N]"]
    assert 0.5 < ratio < 1.5
    assert abs(ratio - 1) > 1e-4
    ran = run("ride", files / "model.json", "--at", "pressure=2.4 bar", *at[2:], "--curve", curve)
    assert "the tangent of the curve at 2819 N is 177" in told(ran.stderr)
    assert "the model at rest has 216" in told(ran.stderr)
    bare = tmp_path / "bare.csv"
    bare.write_text(road.read_text().replace("distance [m],height [mm]", "a,b"))
    stated = ("--road", bare, "--column", "distance=a [m]", "--column", "height=b [mm]")
    same = json.loads(run("ride", files / "model.json", *at[:2], *stated, "--json").stdout)["rides"][0]
    assert same["dynamic wheel load [N]"] == plain["dynamic wheel load [N]"]
    gap = [line for line in road.read_text().splitlines(keepends=True) if not line.startswith("30.")]
    road.write_text("".join(gap))
    ran = run("ride", files / "model.json", *at)
    assert ran.exit_code == 2
    assert "road.csv: has a gap from 29.95 to 31 m" in told(ran.stderr)


@pytest.mark.parametrize(
    ("model", "more", "words"),
    [
        ("structural", (), "structural model of a, 2 bar is not causal: its force begins before its deflection"),
        ("structural", (), "fit a causal one, as with fourpole fit --model prony"),
        ("map", ("--at", "pressure=3 bar"), "3 bar is outside what was measured"),
        ("map", (), 'state the operating point, --at "pressure=..."'),
        ("model", ("--speed", "0 km/h"), "the speed 0 m/s is not positive"),
        ("model", ("--duration", "10 s", "--step", "10 ms"), "a step of 0.01 s is too long"),
        ("model", ("--duration", "10 s", "--seed", "-1"), "the seed -1 is negative"),
        ("model", ("--road", "Z"), "--road: 'Z' is neither a file nor a road: it is a class A to H"),
        ("model", ("--road", "cleat 10 mm"), "--road: 'cleat 10 mm' is no road"),
        ("model", ("--lift-off",), 'need a ride in time: state --duration, as "60 s"'),
        ("model", ("--at", "pressure"), "--at: 'pressure' is no operating point"),
        ("model", ("--at", "camber=two"), "an axis is pressure, preload, temperature with a unit"),
        ("model", ("--vehicle", "tank"), "no vehicle 'tank'"),
    ],
)
def test_what_is_refused_says_why(run, files, tmp_path, model, more, words):
    ran = run("ride", files / f"{model}.json", *more, "--out", tmp_path / "no")
    assert ran.exit_code == 2
    assert words in told(ran.stderr)
    assert "Traceback" not in ran.stderr
    assert not (tmp_path / "no").exists()


def test_a_fractional_model_rides_in_time_as_its_arms(run, files):
    """A Zener tyre was fitted: as the fractional model it rides as itself, within what the fit of 5 % leaves."""
    ran = run("ride", files / "fractional.json", files / "model.json", "--road", "cleat 10 mm, 50 mm",
              "--at", "pressure=2 bar", "--json")  # fmt: skip
    assert ran.exit_code == 0, ran.output
    found = json.loads(ran.stdout)
    notes = [one for one in found["notes"] if "ridden as Maxwell arms" in one]
    assert len(notes) == 1
    assert "the fractional model" in notes[0]
    assert "from 0.1 to 200 Hz" in notes[0]
    one, other = (ride["dynamic wheel load [N]"] for ride in found["rides"])
    assert one == pytest.approx(other, rel=0.05)


def test_a_vehicle_of_negative_mass_is_refused(run, files, tmp_path):
    path = tmp_path / "v.toml"
    path.write_text(
        'kind = "quarter car"\nsprung_mass = "-250 kg"\nunsprung_mass = "40 kg"\nsuspension_stiffness = "16 kN/m"\n'
        'suspension_damping = "1 kN s/m"\n'
    )
    ran = run("ride", files / "model.json", "--vehicle", path)
    assert ran.exit_code == 2
    assert "v.toml: sprung_mass: -250 kg is not possible" in told(ran.stderr)


@pytest.mark.sampled(4)
def test_the_model_of_a_master_curve_is_ridden_at_its_reference(run, tmp_path):
    isotherms(tmp_path / "isotherms.csv")
    assert run("shift", tmp_path / "isotherms.csv", "--reference", "20 degC", "--out", tmp_path / "m").exit_code == 0
    fitted = run("fit", tmp_path / "m" / "master.csv", "--model", "prony:1", "--out", tmp_path / "m.json")
    assert fitted.exit_code == 0
    ran = run("ride", tmp_path / "m.json")
    assert ran.exit_code == 0, ran.stderr
    assert "K* is that at 20.01 °C, the reference of its master curve" in told(ran.stderr)
    assert run("ride", tmp_path / "m.json", "--at", "temperature=30 degC").exit_code == 2


@pytest.mark.sampled(2)
def test_a_measured_road_is_that_of_an_independent_integrator(run, files, tmp_path):
    """A vehicle and a road of which Fourpole knows nothing: a_w within 0.1 %."""
    rng = np.random.default_rng(5)
    distance = 0.05 * np.arange(601)
    waves = np.geomspace(0.05, 5.0, 40)
    phases = rng.uniform(0.0, 2 * np.pi, waves.size)
    height = np.sum(2e-3 * np.sin(2 * np.pi * np.outer(distance, waves) + phases) / (1 + 10 * waves), axis=1)
    rows = "".join(f"{a:.2f},{1e3 * b:.12f}\n" for a, b in zip(distance.tolist(), height.tolist(), strict=True))
    (tmp_path / "road.csv").write_text(f"distance [m],height [mm]\n{rows}")
    (tmp_path / "car.toml").write_text(
        'kind = "quarter car"\nsprung_mass = "331 kg"\nunsprung_mass = "52 kg"\nsuspension_stiffness = "23.7 kN/m"\n'
        'suspension_damping = "1.31 kN s/m"\n'
    )
    more = ("--road", tmp_path / "road.csv", "--vehicle", tmp_path / "car.toml", "--speed", "17.3 m/s", "--json")
    (row,) = json.loads(run("ride", files / "model.json", "--at", "pressure=2 bar", *more).stdout)["rides"]
    k1, k2, c = json.loads((files / "model.json").read_text())["models"][0]["conditions"][1]["values"]
    step = 2.5e-4
    road = np.interp(17.3 * step * np.arange(round(30.0 / 17.3 / step)), distance, height)
    weighted, *_ = integrate((331.0, 52.0, 23700.0, 1310.0), k1, [(k2, c / k2)], road, step, 1)
    assert row["weighted acceleration [m/s^2]"] == pytest.approx(np.sqrt(np.mean(weighted**2)), rel=5e-4)
    assert row["vibration dose value [m/s^1.75]"] == pytest.approx((step * np.sum(weighted**4)) ** 0.25, rel=5e-4)


def test_the_units_of_the_campaign_are_shown(run, files, tmp_path):
    (tmp_path / "model.json").write_bytes((files / "model.json").read_bytes())
    (tmp_path / "study.json").write_text(
        json.dumps({"stated": {"report": {"units": {"force": "kgf", "stiffness": "N/mm"}}}})
    )
    ran = run("ride", tmp_path / "model.json", "--at", "pressure=2 bar")
    assert ran.exit_code == 0, ran.stderr
    assert "F [kgf]" in ran.stdout
    assert "K [N/mm]" in ran.stdout


def test_a_road_that_pulls_a_wheel_and_one_that_is_too_short_are_said(run, files, tmp_path):
    at = ("ride", files / "model.json", "--at", "pressure=2 bar")
    assert "a wheel would leave the road" in told(run(*at, "--road", "H").stderr)
    assert "a wheel would leave the road" not in told(run(*at, "--road", "C").stderr)
    assert "a wheel would leave the road" in told(run(*at, "--road", "cleat 60 mm, 300 mm").stderr)
    (tmp_path / "short.csv").write_text("distance [m],height [mm]\n" + "".join(f"{n},{n % 3}\n" for n in range(20)))
    ran = run(*at, "--road", tmp_path / "short.csv")
    assert "the ride lasts 0.86 s, less than one cycle at 0.4 Hz" in told(ran.stderr)
    (tmp_path / "tiny.csv").write_text("distance [m],height [mm]\n0,0\n1e-9,1\n2e-9,0\n")
    assert run(*at, "--road", tmp_path / "tiny.csv").exit_code == 2
