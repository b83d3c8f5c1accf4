"""Each fault of a laboratory does what it says: in the recordings, in the statement and in the true values."""

import hashlib
import tomllib
from functools import cache

import numpy as np
import polars as pl
import pytest

from fourpole.virtual import FAULTS, RADIAL_PLY, Bench, Cam, Rocking, Zener, run, simulate_campaign
from fourpole.virtual.bench import far_end
from fourpole.virtual.faults import cubic, drift, duplicated, rig, scatter, softening, swapped, tilted, warming
from fourpole.virtual.static_rig import load_cycles

PLAN = {"tyres": [RADIAL_PLY], "pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 14.0, 18.0, 24.0]}
MASSES = {"added_masses": (0.0, 10.0)}


def table(folder, name):
    return pl.read_csv(folder / name, infer_schema_length=None)


def recording(folder, test):
    return pl.read_csv(folder / "recordings" / f"{test}.csv").to_numpy()


def digests(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (folder / "recordings").iterdir()}


def made(place, *faults, clean=True, **plan):
    return simulate_campaign(place, clean=clean, faults=faults, **(PLAN | plan)).folder


def amplitudes(folder, row):
    """Complex amplitudes of F1, V1 and V2 in a clean recording."""
    columns = recording(folder, row["test"])
    turn = np.exp(2j * np.pi * row["frequency [Hz]"] * columns[:, 0])
    lines = [part for order in range(1, 8) for part in ((turn**order).real, -(turn**order).imag)]
    found, *_ = np.linalg.lstsq(np.stack([*lines, np.ones(turn.size)], axis=1), columns[:, 1:], rcond=None)
    return found[0] + 1j * found[1]


def dynamic(folder):
    return table(folder, "truth.csv").filter(pl.col("frequency [Hz]").is_not_null()).to_dicts()


def stiffness(row):
    return row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    return made(tmp_path_factory.mktemp("honest"), repeats=2, **MASSES)


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return made(tmp_path_factory.mktemp("noisy"), clean=False)


def test_an_honest_campaign_is_the_one_it_always_was(noisy):
    """The samples are steps of a converter, so that round-off cannot change them."""
    assert digests(noisy)["D1.csv"][:16] == "4fcc56b34c3e2e2d"
    assert digests(noisy)["S1.csv"][:16] == "e6cff960e2188a2b"


def test_faults_leave_the_noise_as_it_is(noisy, tmp_path):
    """A fault draws nothing from the generator of a test: other tests, and other channels, have the same samples."""
    folder = made(tmp_path, FAULTS["drop-outs of V2, 4 %"], clean=False)
    before, after = (recording(place, "D2") for place in (noisy, folder))
    np.testing.assert_array_equal(before[:, :3], after[:, :3])
    kept = after[:, 3] != 0.0
    assert 0.04 <= 1.0 - kept.mean() < 0.06
    np.testing.assert_array_equal(before[kept, 3], after[kept, 3])
    assert digests(noisy)["S1.csv"] == digests(folder)["S1.csv"]
    assert (noisy / "campaign.toml").read_text() == (folder / "campaign.toml").read_text()


@pytest.fixture(scope="module")
def without_fault(tmp_path_factory):
    """The folder of a campaign without a fault, by its plan: most faults have the same."""
    return cache(lambda **plan: made(tmp_path_factory.mktemp("without"), **plan))


@pytest.mark.thorough
@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
@pytest.mark.sampled(6)
def test_every_fault_changes_recordings_or_statement(fault, without_fault, tmp_path):
    plan = {"clean": False, "frequencies": (10.0, 14.0, 24.0), **fault.plan}
    honest = without_fault(**plan)
    before = digests(honest) | {"": (honest / "tests.csv").read_text()}
    after = digests(made(tmp_path / "faulty", fault, **plan)) | {"": (tmp_path / "faulty" / "tests.csv").read_text()}
    assert before.keys() == after.keys()
    changed = {name for name in before if before[name] != after[name]}
    assert changed
    if fault.part == "static test":
        assert all(name.startswith("S") for name in changed)
    if "one test" in fault.name:
        assert len(changed) == 1
    if "two tests" in fault.name:
        assert len(changed) in (1, 2)
    said = [tomllib.loads((folder / "campaign.toml").read_text()) for folder in (honest, tmp_path / "faulty")]
    assert said[0] == said[1]


@pytest.mark.parametrize(
    "fault", [scatter(0.03), drift(0.05), warming(15.0), softening(0.2), cubic(1e4)], ids=lambda fault: fault.name
)
def test_truth_of_a_specimen_is_that_of_its_own_test(fault, tmp_path):
    folder = made(tmp_path, fault)
    # between the points, the cubic force of 10 % is linear: (omega h)^2/12 of it is missing, less in finer steps
    limit = 0.1 * (2 * np.pi * 24.0 * 2e-4) ** 2 / 12 if fault.name == "cubic tyre" else 1e-8
    for row in dynamic(folder):
        f1, v1, v2 = amplitudes(folder, row)
        omega = 2 * np.pi * row["frequency [Hz]"]
        assert 1j * omega * f1 / (v1 - v2) == pytest.approx(stiffness(row), rel=limit)
        assert abs(v2 / v1) == pytest.approx(row["TR [1]"], rel=limit)
        element = Zener(row["K1 [N/m]"], row["K2 [N/m]"], row["C [N s/m]"]).state_space()
        assert complex(element.stiffness(omega)) == pytest.approx(stiffness(row), rel=1e-9)


def factors(folder, honest):
    """K* over that of the honest campaign, and K1 over its K1, test by test in the order of the run."""
    pairs = list(zip(dynamic(folder), dynamic(honest), strict=True))
    return (
        np.array([stiffness(row) / stiffness(before) for row, before in pairs]),
        np.array([row["K1 [N/m]"] / before["K1 [N/m]"] for row, before in pairs]),
    )


def test_scatter_is_that_of_the_tests_and_not_of_k1(honest, tmp_path):
    factor, k1 = factors(made(tmp_path, scatter(0.01), repeats=2, **MASSES), honest)
    assert factor.size == 16
    for part in (factor.real - 1.0, factor.imag):
        assert part.std() == pytest.approx(0.01, rel=4 / np.sqrt(2 * factor.size))
    np.testing.assert_array_equal(k1, 1.0)


def test_drift_grows_along_the_run_and_takes_k1_along(honest, tmp_path):
    """The static test is the first of 17, so that the dynamic tests are at 1/16 ... 16/16 of the run."""
    factor, k1 = factors(made(tmp_path, drift(0.05), repeats=2, **MASSES), honest)
    np.testing.assert_allclose(factor, 1.0 + 0.05 * np.arange(1, 17) / 16, rtol=1e-12)
    np.testing.assert_allclose(k1, factor.real, rtol=1e-12)


def test_warm_rubber_is_softer_and_less_damped(honest, tmp_path):
    folder = made(tmp_path, warming(15.0), repeats=2, **MASSES)
    _, k1 = factors(folder, honest)
    assert k1[-1] == pytest.approx(1.0 - 0.004 * 15.0)
    assert (np.diff(k1) < 0).all()
    assert np.diff(k1)[0] < 2.0 * np.diff(k1)[-1]
    last, before = dynamic(folder)[-1], dynamic(honest)[-1]
    assert last["K2 [N/m]"] / before["K2 [N/m]"] == pytest.approx(0.94)
    assert last["C [N s/m]"] / before["C [N s/m]"] == pytest.approx(0.94 * 0.91)


def test_amplitude_dependent_tyre_is_softer_where_it_moves_more(honest, tmp_path):
    """With x the amplitude of the deflection, K* is 1 - 0.2 x/(x + 1 mm) of the linear one."""
    folder = made(tmp_path, softening(0.2), repeats=2, **MASSES)
    factor, _ = factors(folder, honest)
    deflection = []
    for row in dynamic(folder):
        _, v1, v2 = amplitudes(folder, row)
        deflection.append(abs(v1 - v2) / (2 * np.pi * row["frequency [Hz]"]))
    np.testing.assert_allclose(factor, 1.0 - 0.2 / (1.0 + 1e-3 / np.array(deflection)), rtol=1e-7)


def test_cubic_tyre_obeys_its_equations_of_motion():
    """Harmonic by harmonic: the force on the mass, and the force of the linear tyre and of its cube."""
    tyre, bench, kappa = Zener(110e3, 60e3, 800.0), Bench(preload_damping=15.0), 5e8
    rate = 9000.0
    motion = run(Cam(18.0), tyre, bench, duration=1.0, sample_rate=rate, oversampling=1, guard=0, cubic=kappa)
    cube = kappa * motion.deflection**3
    for order in (1, 3, 5):
        s = 2j * np.pi * 18.0 * order
        turn = np.exp(-s * motion.time)
        force, x1, x2, d, g = (
            2 * np.mean(each * turn) for each in (motion.force, motion.x1, motion.x2, motion.deflection, cube)
        )
        linear = complex(tyre.state_space().stiffness(s.imag))
        interpolated = (abs(s) / rate) ** 2 / 12 * abs(g)  # the force of the cube is linear between the points
        assert abs(g) > 1e3 * interpolated
        assert abs(force - linear * d - g) < 2 * interpolated + 1e-8 * abs(linear * x1)
        above = bench.mass * s * s + bench.preload_stiffness + bench.preload_damping * s
        assert abs(force - above * x2) < 2 * interpolated + 1e-8 * abs(linear * x1)


def test_rocking_mass_is_one_more_resonance():
    """Against the same two degrees of freedom as a matrix of impedances."""
    tyre, rocking = Zener(110e3, 60e3, 800.0), Rocking(inertia=0.25, frequency=35.0, tyre_arm=0.03, sensor_arm=0.06)
    bench = Bench(preload_damping=15.0, rocking=rocking)
    for frequency in (10.0, 24.0, 35.0):
        s = 2j * np.pi * frequency
        k = complex(tyre.state_space().stiffness(s.imag))
        hold = 0.25 * (2 * np.pi * 35.0) ** 2
        matrix = np.array(
            [
                [15.0 * s * s + 15.0 * s + 12440.0 + k, 0.03 * k],
                [0.03 * k, 0.25 * s * s + hold * (1.0 + 0.05 * s / (2 * np.pi * 35.0)) + 0.03**2 * k],
            ]
        )
        x2, angle = np.linalg.solve(matrix, np.array([k, 0.03 * k]))
        assert far_end(tyre, bench, frequency) == pytest.approx(x2 + 0.03 * angle, rel=1e-10)
        motion = run(Cam(frequency), tyre, bench, duration=0.5)
        turn = np.exp(s * motion.time)
        found, *_ = np.linalg.lstsq(
            np.stack([turn.real, -turn.imag], axis=1), np.stack([motion.x1, motion.x2, motion.deflection], axis=1)
        )
        x1, sensor, deflection = found[0] + 1j * found[1]
        assert sensor / x1 == pytest.approx(x2 + 0.06 * angle, rel=1e-8)
        assert deflection / x1 == pytest.approx(1.0 - x2 - 0.03 * angle, rel=1e-8)


def test_parts_of_the_rig_are_in_recordings_and_truth_and_not_in_the_statement(tmp_path):
    folder = made(tmp_path, rig("mass", "", mass=lambda m: m + 1.0), rig("frame", "", frame_stiffness=60e3))
    said = tomllib.loads((folder / "campaign.toml").read_text())["rig"]
    assert said["moving_mass"]["value"] == 15.0
    assert "frame_stiffness" not in said
    for row in dynamic(folder):
        f1, _, v2 = amplitudes(folder, row)
        s = 2j * np.pi * row["frequency [Hz]"]
        leaf = 12440.0 + 15.0 * s
        assert row["moving mass [kg]"] == 16.0
        assert row["frame stiffness [N/m]"] == 60e3
        assert s * f1 / v2 == pytest.approx(16.0 * s * s + leaf * 60e3 / (leaf + 60e3), rel=1e-7)


def test_channels_are_late_tilted_and_wrong_together(honest, tmp_path):
    """Faults of one channel go together; the clean sensors have no other error."""
    faults = [FAULTS["gain of V2, +6 %"], FAULTS["V2 late, 0.5 ms"], tilted("V2", 15.0)]
    folder = made(tmp_path, *faults, repeats=2, **MASSES)
    for row in dynamic(folder):
        late = np.exp(-2j * np.pi * row["frequency [Hz]"] * 0.5e-3)
        (f1, v1, v2), before = amplitudes(folder, row), amplitudes(honest, row)
        angle = np.deg2rad(15.0)
        assert (f1, v1) == pytest.approx((before[0], before[1]), rel=1e-9)
        wanted = 1.06 * late * (np.cos(angle) * before[2] + np.sin(angle) * 0.15 * before[1])
        assert v2 == pytest.approx(wanted, rel=1e-7)


def test_a_clock_turns_the_phase_from_half_to_half(tmp_path):
    """At 24 Hz, 300 ppm of 2.048 s turn the phase by 0.0927 rad; mean positions of the halves are that far apart."""
    folder = made(tmp_path, FAULTS["clock of V2, 300 ppm"])
    columns = recording(folder, "D4")
    turn = np.exp(2j * np.pi * 24.0 * columns[:, 0])
    phases = []
    for half in (slice(0, 2048), slice(2048, 4096)):
        basis = np.stack([turn.real, -turn.imag], axis=1)[half]
        found, *_ = np.linalg.lstsq(basis, columns[half, 2:], rcond=None)
        v1, v2 = found[0] + 1j * found[1]
        phases.append(np.angle(v2 / v1))
    assert phases[1] - phases[0] == pytest.approx(2 * np.pi * 24.0 * 3e-4 * 2.048, rel=0.02)


@pytest.mark.parametrize("column", ["preload", "added_mass"])
@pytest.mark.sampled(2)
def test_swapped_labels_exchange_two_recordings(column, tmp_path):
    plan = {"preloads": (1000.0, 2000.0), **MASSES}
    before = made(tmp_path / "before", **plan)
    after = made(tmp_path / "after", swapped(column, {}), **plan)
    assert (before / "tests.csv").read_text() == (after / "tests.csv").read_text()
    old, new = digests(before), digests(after)
    one, other = (name for name in old if old[name] != new[name])
    assert (old[one], old[other]) == (new[other], new[one])
    rows = {f"{row['test']}.csv": row for row in table(before, "tests.csv").to_dicts()}
    named = "added_mass [kg]" if column == "added_mass" else "preload [N]"
    assert rows[one]["frequency [Hz]"] == rows[other]["frequency [Hz]"]
    assert rows[one][named] != rows[other][named]
    np.testing.assert_array_equal(table(before, "truth.csv")["Re K* [N/m]"], table(after, "truth.csv")["Re K* [N/m]"])


def test_wrong_row_has_the_truth_of_what_it_says(tmp_path):
    plan = {"preloads": (1000.0, 2000.0)}
    fault = FAULTS["one test: wrong preload in its row, 2000 for 1000 N"]
    before, after = made(tmp_path / "before", **plan), made(tmp_path / "after", fault, **plan)
    assert digests(before) == digests(after)
    said = [table(folder, "tests.csv") for folder in (before, after)]
    (at,) = np.flatnonzero((said[0]["preload [N]"] != said[1]["preload [N]"]).fill_null(value=False).to_numpy())
    test, frequency = said[1]["test"][int(at)], said[1]["frequency [Hz]"][int(at)]
    (row,) = (row for row in dynamic(after) if row["test"] == test)
    assert row["K1 [N/m]"] == float(RADIAL_PLY.static_stiffness(170e3, 2000.0))
    assert row["K2 [N/m]"] == float(RADIAL_PLY.k2(frequency, 170e3, 2000.0))


@pytest.mark.parametrize(("column", "same"), [("name", True), ("preload", False)])
def test_duplicate_is_the_same_file_to_the_byte(column, same, tmp_path):
    plan = {"preloads": (1000.0, 2000.0), "repeats": 2}
    folder = made(tmp_path, scatter(0.01), duplicated(column, "", {}), clean=False, **plan)
    by_name = digests(folder)
    (pair,) = {tuple(n for n in by_name if by_name[n] == digest) for digest in by_name.values()} - {
        (name,) for name in by_name
    }
    rows = [row for row in dynamic(folder) if f"{row['test']}.csv" in pair]
    assert (rows[0]["Re K* [N/m]"] == rows[1]["Re K* [N/m]"]) == same
    assert (rows[0]["preload [N]"] == rows[1]["preload [N]"]) == same


def test_mass_on_the_rig_is_not_the_stated_one(tmp_path):
    folder = made(tmp_path, FAULTS["added mass, -5 %"], **MASSES)
    for row in dynamic(folder):
        f1, _, v2 = amplitudes(folder, row)
        s = 2j * np.pi * row["frequency [Hz]"]
        assert row["added mass [kg]"] in (0.0, 10.0)
        above = 15.0 + 0.95 * row["added mass [kg]"]
        assert s * f1 / v2 == pytest.approx(above * s * s + 15.0 * s + 12440.0, rel=1e-7)


def test_load_of_a_static_test_has_wrong_gain_and_zero(tmp_path):
    names = ["static test: gain of the load, +3 %", "static test: frame in the deflection, 0.5 mm/kN"]
    before, after = made(tmp_path / "before"), made(tmp_path / "after", *(FAULTS[name] for name in names))
    (_, x, load), (_, wrong_x, wrong) = recording(before, "S1").T, recording(after, "S1").T
    np.testing.assert_allclose(wrong, 1.03 * load, rtol=1e-12)
    np.testing.assert_allclose(wrong_x, x + 1e3 * 0.5e-6 * load, rtol=1e-12)


def test_creep_lowers_the_stiffness_of_slow_cycles():
    """With the deflection x_p (1 - cos wt)/2, a part s of a linear load passes a high-pass: 1 - s/(1 + j w tau)."""
    tyre = RADIAL_PLY.changed(1.0)
    tyre = type(tyre)(**{**vars(tyre), "b": 0.0, "hysteresis": 0.0, "conditioning": 0.0})
    slow = load_cycles(tyre, 170e3, creep=0.2, creep_time=5.0, cycles=12)
    last = slice(-1001, -1)  # the transient has decayed to e^-44
    turn = np.exp(-2j * np.pi * slow.time[last] / 20.0)
    ratio = np.mean(slow.load[last] * turn) / np.mean(slow.deflection[last] * turn)
    k1 = float(tyre.static_stiffness(170e3, 1000.0))
    assert ratio / k1 == pytest.approx(1.0 - 0.2 / (1.0 + 2j * np.pi * 5.0 / 20.0), rel=1e-5)


def test_a_fault_that_finds_no_test_is_refused(tmp_path):
    with pytest.raises(ValueError, match="between the lowest and the highest frequency"):
        made(tmp_path / "new", FAULTS["one test: gain of V1, +20 %"], frequencies=[10.0, 24.0])
    assert not (tmp_path / "new").exists()


def test_repeats_are_series_one_after_the_other(honest):
    tests = table(honest, "tests.csv").filter(pl.col("kind") == "dynamic")
    assert tests["test"].to_list() == [f"D{number}" for number in range(1, 17)]
    assert tests["frequency [Hz]"].to_list() == [10.0, 14.0, 18.0, 24.0] * 4
    assert tests["added_mass [kg]"].to_list() == ([0.0] * 4 + [10.0] * 4) * 2
