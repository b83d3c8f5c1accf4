"""The folder that a virtual campaign leaves: its contract, its truth, its manners."""

import hashlib
import itertools
import tomllib

import numpy as np
import polars as pl
import pytest

from fourpole.errors import FileError
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, RUBBER_MOUNT, simulate_campaign

pytestmark = pytest.mark.thorough

SMALL = {"pressures": [100e3, 170e3], "preloads": [1000.0], "frequencies": [10.0, 24.0]}
TESTS_COLUMNS = ["test", "file", "kind", "tyre", "pressure [bar]", "preload [N]", "frequency [Hz]"]


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    return simulate_campaign(tmp_path_factory.mktemp("full")).folder


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    return simulate_campaign(tmp_path_factory.mktemp("clean"), clean=True, **SMALL).folder


def test_a_campaign_is_the_one_it_always_was(tmp_path):
    """The samples are steps of a converter, so that round-off cannot change them."""
    plan = {"pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 14.0, 18.0, 24.0]}
    made = simulate_campaign(tmp_path, tyres=[RADIAL_PLY], **plan)
    digests = [hashlib.sha256((made.folder / "recordings" / f"{test}.csv").read_bytes()) for test in ("D1", "S1")]
    assert [digest.hexdigest()[:16] for digest in digests] == ["4fcc56b34c3e2e2d", "e6cff960e2188a2b"]


def test_faults_are_made_elsewhere(tmp_path):
    with pytest.raises(ValueError, match=r"faults= has left simulate_campaign.*docs/benchmark\.md"):
        simulate_campaign(tmp_path / "new", faults=["moving mass, +1 kg"])
    assert not (tmp_path / "new").exists()


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def table(folder, name):
    return pl.read_csv(folder / name, infer_schema_length=None)


def amplitudes(time, signals, frequency):
    """Complex amplitudes at a known frequency, with three harmonics, the mains and a slope fitted beside it."""
    t = time - time.mean()
    lines = [frequency, 2 * frequency, 3 * frequency, 50.0, 150.0]
    turns = [np.exp(2j * np.pi * f * t) for f in lines]
    columns = [part for turn in turns for part in (turn.real, -turn.imag)] + [np.ones_like(t), t]
    found, *_ = np.linalg.lstsq(np.stack(columns, axis=1), signals, rcond=None)
    return found[0] + 1j * found[1]


@pytest.mark.sampled(6)
def test_campaign_file_states_the_rig_the_channels_and_the_tyres(full):
    said = tomllib.loads((full / "campaign.toml").read_text())
    assert set(said) == {"title", "unstated", "rig", "channels", "tyres"}
    assert said["unstated"] == {"ordinary": "zero"}
    assert said["rig"] == {
        "moving_mass": {"value": 15.0, "unit": "kg", "std": 0.01},
        "preload_stiffness": {"value": 12.44, "unit": "kN/m", "std": 0.02},
        "preload_damping": {"value": 15.0, "unit": "N s/m", "std": 0.5},
    }
    roles = {"time": "t", "force_in": "F1", "motion_in": "V1", "motion_out": "V2", "load": "F", "deflection": "x"}
    assert {role: channel["column"] for role, channel in said["channels"].items()} == roles
    assert {name: tyre["construction"] for name, tyre in said["tyres"].items()} == {
        "cross-ply": CROSS_PLY.construction,
        "radial-ply": RADIAL_PLY.construction,
    }


def test_a_mount_is_a_specimen_without_pressure_and_leaves_the_files_of_the_tyres_as_they_are(tmp_path):
    plain, with_mount = (
        simulate_campaign(tmp_path / name, mounts=mounts, **SMALL).folder
        for name, mounts in (("plain", ()), ("mount", [RUBBER_MOUNT]))
    )
    said = tomllib.loads((with_mount / "campaign.toml").read_text())
    assert said["specimens"] == {"rubber-mount": {"construction": RUBBER_MOUNT.construction}}
    assert said["title"] == "Cross-ply, radial-ply and rubber-mount, virtual (seed 1982)"
    assert set(said["tyres"]) == {"cross-ply", "radial-ply"}
    recorded = {name: text for name, text in contents(plain).items() if name.startswith("recordings/")}
    assert recorded.items() <= contents(with_mount).items()
    rows = table(with_mount, "tests.csv").filter(pl.col("tyre") == "rubber-mount")
    assert rows["kind"].to_list() == ["static", "dynamic", "dynamic"]
    assert rows["pressure [bar]"].null_count() == 3


def test_list_of_tests_names_every_recording(full):
    tests = table(full, "tests.csv")
    assert tests.columns == TESTS_COLUMNS
    assert tests["kind"].value_counts().sort("kind").rows() == [("dynamic", 200), ("static", 10)]
    assert tests["test"].n_unique() == 210
    listed = set(tests["file"])
    assert listed == {path.relative_to(full).as_posix() for path in (full / "recordings").iterdir()}
    dynamic = tests.filter(pl.col("kind") == "dynamic")
    assert dynamic.null_count().sum_horizontal().item() == 0
    assert set(dynamic["pressure [bar]"]) == {1.0, 1.35, 1.7, 2.05, 2.4}
    static = tests.filter(pl.col("kind") == "static")
    assert static["preload [N]"].null_count() == static["frequency [Hz]"].null_count() == 10


def test_recordings_have_their_columns_and_the_campaign_is_small(full):
    static, dynamic = (pl.read_csv(full / "recordings" / name) for name in ("S1.csv", "D1.csv"))
    assert static.columns == ["t", "x", "F"]
    assert dynamic.columns == ["t", "F1", "V1", "V2"]
    np.testing.assert_array_equal(dynamic["t"], np.arange(4096) / 1000.0)
    assert sum(map(len, contents(full).values())) < 40e6


def test_truth_has_a_row_per_test_and_preload(full):
    truth = table(full, "truth.csv")
    assert truth["test"].n_unique() == 210
    assert truth.height == 10 * 2 + 200
    assert {"tyre", "pressure [Pa]", "preload [N]", "K1 [N/m]", "moving mass [kg]"} <= set(truth.columns)
    dynamic = truth.filter(pl.col("frequency [Hz]").is_not_null())
    assert dynamic.null_count().sum_horizontal().item() == 0
    stated = table(full, "tests.csv").filter(pl.col("kind") == "dynamic").join(dynamic, on="test")
    ratio = (stated["frequency [Hz]_right"] / stated["frequency [Hz]"]).to_numpy()
    assert 0.002 < abs(ratio - 1.0).max() <= 0.003


def test_true_rig_lies_within_what_is_stated(tmp_path):
    rigs = []
    for seed in range(5):
        truth = table(simulate_campaign(tmp_path / str(seed), seed=seed, **SMALL).folder, "truth.csv")
        rigs.append([truth[name][0] for name in truth.columns[-3:]])
    z = (np.array(rigs) - [15.0, 12440.0, 15.0]) / [0.01, 20.0, 0.5]
    assert (abs(z) <= 2.0).all()
    assert (z.std(axis=0) > 0.1).all()


def test_tyre_stays_on_the_cam(full):
    tests = table(full, "tests.csv").filter(pl.col("kind") == "dynamic")
    for file, preload in tests.select("file", "preload [N]").iter_rows():
        force = 1020.0 * pl.read_csv(full / file)["F1"].to_numpy()
        assert abs(force - force.mean()).max() < 0.85 * preload, file


def test_no_channel_reaches_its_full_scale(full):
    scales = {"F1": 1.0, "V1": 0.25, "V2": 0.5}
    for path in (full / "recordings").glob("D*.csv"):
        peaks = pl.read_csv(path).select(pl.col(name).abs().max() for name in scales).row(0)
        for peak, (name, scale) in zip(peaks, scales.items(), strict=True):
            assert 0.05 * scale < peak < 0.9 * scale, (path.name, name)


def test_declared_faults_undone_leave_the_truth_within_the_stated_uncertainty(full):
    truth = table(full, "truth.csv").filter(pl.col("frequency [Hz]").is_not_null())
    for row in truth.gather_every(7).iter_rows(named=True):  # all tyres, pressures, preloads and frequencies are in it
        recording = pl.read_csv(full / "recordings" / f"{row['test']}.csv").to_numpy()
        omega = 2.0 * np.pi * row["frequency [Hz]"]
        f1, v1, v2 = amplitudes(recording[:, 0], recording[:, 1:], row["frequency [Hz]"])
        f1, v1, v2 = 1020.0 * f1, v1 * np.exp(0.2e-3j * omega), -v2
        stiffness = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
        # two gains and phases, each off by 2 std at most; noise is a few 1e-5 of the amplitudes
        limit = 2 * 2 * np.hypot(2e-4, np.deg2rad(0.01)) + 2e-4
        assert abs(v2 / v1) == pytest.approx(row["TR [1]"], rel=limit)
        assert 1j * omega * f1 / (v1 - v2) == pytest.approx(
            stiffness, rel=limit * (1.0 + 2.0 * max(abs(v1), abs(v2)) / abs(v1 - v2))
        )


def test_clean_recordings_hold_the_truth_to_the_accuracy_of_the_rig(clean):
    truth = table(clean, "truth.csv").filter(pl.col("frequency [Hz]").is_not_null())
    said = tomllib.loads((clean / "campaign.toml").read_text())
    assert all(value["exact"] for value in said["rig"].values())
    assert all(channel["exact"] for role, channel in said["channels"].items() if role != "time")
    for row in truth.iter_rows(named=True):
        recording = pl.read_csv(clean / "recordings" / f"{row['test']}.csv").to_numpy()
        frequency = row["frequency [Hz]"]
        assert frequency in (10.0, 24.0)
        omega = 2.0 * np.pi * frequency
        f1, v1, v2 = amplitudes(recording[:, 0], recording[:, 1:], frequency)
        stiffness = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
        impedance = 1j * omega * 15.0 + 15.0 + 12440.0 / (1j * omega)
        assert f1 / v2 == pytest.approx(impedance, rel=1e-8)
        assert 1j * omega * f1 / (v1 - v2) == pytest.approx(stiffness, rel=1e-8)
        assert abs(v2 / v1) == pytest.approx(row["TR [1]"], rel=1e-8)
        arm = 1.0 / (stiffness - row["K1 [N/m]"])
        assert 1.0 / arm.real == pytest.approx(row["K2 [N/m]"], rel=1e-9)
        assert -1.0 / (omega * arm.imag) == pytest.approx(row["C [N s/m]"], rel=1e-9)


def test_clean_static_recordings_hold_k1(clean):
    truth = table(clean, "truth.csv").filter(pl.col("frequency [Hz]").is_null())
    for row in truth.iter_rows(named=True):
        recording = pl.read_csv(clean / "recordings" / f"{row['test']}.csv").to_numpy()[-1001:]
        x, mean = 1e-3 * recording[:501, 1], 0.5 * (recording[:501, 2] + recording[:499:-1, 2])
        linear, square = np.linalg.lstsq(np.stack([x, x * x], axis=1), mean, rcond=None)[0]
        assert np.sqrt(linear**2 + 4.0 * square * row["preload [N]"]) == pytest.approx(row["K1 [N/m]"], rel=1e-9)


@pytest.mark.parametrize("clean", [False, True])
def test_same_seed_gives_the_same_files(tmp_path, clean):
    first, again = (simulate_campaign(tmp_path / name, seed=5, clean=clean, **SMALL) for name in "ab")
    assert first.tests == again.tests == 12
    assert contents(first.folder) == contents(again.folder)


def test_other_seed_gives_other_noise(tmp_path):
    first, other = (simulate_campaign(tmp_path / str(seed), seed=seed, **SMALL).folder for seed in (5, 6))
    a, b = contents(first), contents(other)
    assert a.keys() == b.keys()
    assert all(a[name] != b[name] for name in a if name != "tests.csv")


def test_noise_of_a_test_does_not_depend_on_the_others(tmp_path):
    whole = simulate_campaign(tmp_path / "whole", **SMALL).folder
    part = simulate_campaign(tmp_path / "part", **{**SMALL, "frequencies": [10.0]}).folder
    assert (whole / "recordings/D1.csv").read_bytes() == (part / "recordings/D1.csv").read_bytes()


def test_progress_counts_to_the_end(tmp_path):
    calls = []
    simulate_campaign(tmp_path, progress=lambda *call: calls.append(call), **SMALL)
    assert calls == list(zip(range(1, 13), itertools.repeat(12), strict=False))


def test_added_mass_is_a_column_and_shifts_the_resonance(tmp_path):
    folder = simulate_campaign(tmp_path, clean=True, added_masses=[0.0, 10.0], **SMALL).folder
    tests = table(folder, "tests.csv").filter(pl.col("kind") == "dynamic")
    assert tests.columns == [*TESTS_COLUMNS, "added_mass [kg]"]
    truth = table(folder, "truth.csv").filter(pl.col("frequency [Hz]") == 24.0)
    light, heavy = (truth.filter(pl.col("added mass [kg]") == mass) for mass in (0.0, 10.0))
    assert (heavy["TR [1]"] < light["TR [1]"]).all()
    np.testing.assert_array_equal(heavy["Re K* [N/m]"], light["Re K* [N/m]"])
    recording = pl.read_csv(folder / "recordings" / f"{heavy['test'][0]}.csv").to_numpy()
    f1, _, v2 = amplitudes(recording[:, 0], recording[:, 1:], 24.0)
    omega = 2.0 * np.pi * 24.0
    assert f1 / v2 == pytest.approx(25j * omega + 15.0 + 12440.0 / (1j * omega), rel=1e-8)


TINY = {"tyres": [RADIAL_PLY], "pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 24.0]}
EVERYTHING = {
    "declared": {"tyre_mass": 0.8, "preload_loss_factor": 0.02, "input_mass": 0.5},
    "undeclared": {"frame_stiffness": 4e6, "gain F1": 0.03, "phase V2": 0.01},
    "rig_error": {"moving_mass": 0.02, "preload_stiffness": -0.02},
}


def impedance(row, omega, mass):
    """F/V2 of the rig that truth.csv tells, above a tyre, from spring and mass in their places."""
    leaf = row["preload stiffness [N/m]"] * (1.0 + 1j * row["preload loss factor [1]"])
    leaf += 1j * omega * row["preload damping [N s/m]"]
    return leaf / (1.0 + leaf * (1.0 / row["frame stiffness [N/m]"])) / (1j * omega) + 1j * omega * mass


def measured(folder, row):
    recording = pl.read_csv(folder / "recordings" / f"{row['test']}.csv").to_numpy()
    return amplitudes(recording[:, 0], recording[:, 1:], row["frequency [Hz]"])


def test_options_are_stated_or_hidden_as_asked(tmp_path):
    options = {**EVERYTHING, "sensors": (0.03, np.deg2rad(1.0)), "rig_std": {"moving_mass": 0.3}}
    folder = simulate_campaign(tmp_path, **TINY, **options).folder
    said = tomllib.loads((folder / "campaign.toml").read_text())
    assert said["rig"] == {
        "moving_mass": {"value": 15.0, "unit": "kg", "std": 0.3},
        "preload_stiffness": {"value": 12.44, "unit": "kN/m", "std": 0.02},
        "preload_damping": {"value": 15.0, "unit": "N s/m", "std": 0.5},
        "tyre_mass": {"value": 0.8, "unit": "kg", "std": 0.016},
        "preload_loss_factor": {"value": 0.02, "unit": "1", "std": 0.0004},
        "input_mass": {"value": 0.5, "unit": "kg", "std": 0.01},
    }
    for role in ("force_in", "motion_in", "motion_out"):
        assert (said["channels"][role]["std_gain"], said["channels"][role]["std_phase"]) == ("3 %", "1 deg")
    truth = table(folder, "truth.csv")
    row = truth.row(0, named=True)
    assert truth.select(truth.columns[12:]).n_unique() == 1
    assert row["moving mass [kg]"] == pytest.approx(15.3)
    assert row["preload stiffness [N/m]"] == pytest.approx(0.98 * 12440.0)
    assert 0.0 < abs(row["tyre mass [kg]"] - 0.8) <= 2 * 0.016
    assert (row["frame stiffness [N/m]"], row["leaf friction [N]"]) == (4e6, 0.0)
    assert (row["gain error F1 [1]"], row["phase error V2 [rad]"]) == (0.03, 0.01)
    assert 1e-3 < abs(row["gain error V1 [1]"]) <= 0.06


def test_clean_recordings_hold_every_part_of_the_rig_and_every_fault(tmp_path):
    folder = simulate_campaign(tmp_path, clean=True, calibration_masses=[8.0], **TINY, **EVERYTHING).folder
    truth = table(folder, "truth.csv").filter(pl.col("frequency [Hz]").is_not_null())
    assert truth["test"].to_list() == ["D1", "D2", "C1", "C2"]
    for row in truth.iter_rows(named=True):
        omega = 2.0 * np.pi * row["frequency [Hz]"]
        f1, v1, v2 = measured(folder, row) / [1.03, 1.0, np.exp(0.01j)]
        above = row["moving mass [kg]"] + row["added mass [kg]"]
        through = f1 - 1j * omega * row["input mass [kg]"] * v1
        assert abs(v2 / v1) == pytest.approx(row["TR [1]"], rel=1e-8)
        if row["tyre"] is None:
            assert v2 == pytest.approx(v1, rel=1e-8)
            assert through / v2 == pytest.approx(impedance(row, omega, above), rel=1e-8)
        else:
            above += row["tyre mass [kg]"]
            assert through / v2 == pytest.approx(impedance(row, omega, above), rel=1e-8)
            stiffness = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
            assert 1j * omega * through / (v1 - v2) == pytest.approx(stiffness, rel=1e-7)


def test_large_phase_errors_are_recorded(tmp_path):
    folder = simulate_campaign(tmp_path, clean=True, undeclared={"phase F1": -0.2, "phase V1": 0.2}, **TINY).folder
    row = table(folder, "truth.csv").row(1, named=True)
    f1, v1, v2 = measured(folder, row) / np.exp([-0.2j, 0.2j, 0.0])
    stiffness = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
    assert 2j * np.pi * row["frequency [Hz]"] * f1 / (v1 - v2) == pytest.approx(stiffness, rel=1e-7)


def test_friction_is_in_the_truth_of_the_transmissibility(tmp_path):
    folder = simulate_campaign(tmp_path, clean=True, undeclared={"leaf_friction": 5.0}, **TINY).folder
    for row in table(folder, "truth.csv").filter(pl.col("frequency [Hz]").is_not_null()).iter_rows(named=True):
        omega = 2.0 * np.pi * row["frequency [Hz]"]
        f1, v1, v2 = measured(folder, row)
        rubbing = f1 / v2 - impedance(row, omega, 15.0)
        assert rubbing == pytest.approx(4.0 * 5.0 / (np.pi * abs(v2)), rel=0.05)
        assert abs(v2 / v1) == pytest.approx(row["TR [1]"], rel=2e-3)


def test_calibrations_are_listed_without_a_tyre(tmp_path):
    folder = simulate_campaign(tmp_path, calibration_masses=[5.0, 10.0], **TINY).folder
    tests = table(folder, "tests.csv")
    assert tests.columns == [*TESTS_COLUMNS, "added_mass [kg]"]
    blocks = tests.filter(pl.col("kind") == "calibration")
    assert blocks["test"].to_list() == ["C1", "C2", "C3", "C4"]
    assert blocks["added_mass [kg]"].to_list() == [5.0, 5.0, 10.0, 10.0]
    assert blocks["frequency [Hz]"].to_list() == [10.0, 24.0] * 2
    assert blocks.select("tyre", "pressure [bar]", "preload [N]").null_count().row(0) == (4, 4, 4)
    assert all((folder / file).is_file() for file in tests["file"])
    simulate_campaign(folder, **TINY)
    assert not list((folder / "recordings").glob("C*"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"undeclared": {"tire_mass": 1.0}}, "undeclared has 'tire_mass'"),
        ({"declared": {"tyre_mass": 1.0}, "undeclared": {"tyre_mass": 1.0}}, "undeclared has 'tyre_mass'"),
        ({"declared": {"leaf_friction": 1.0}}, "declared has 'leaf_friction'"),
        ({"declared": {"tyre_mass": -1.0}}, "positive and finite"),
        ({"rig_error": {"tyre_mass": 0.1}}, "rig_error has 'tyre_mass'"),
        ({"rig_error": {"moving_mass": -2.0}}, "moving mass must be > 0"),
        ({"rig_std": {"mass": 0.1}}, "rig_std has 'mass'"),
        ({"sensors": (-1.0, 0.0)}, "zero or positive"),
        ({"added_mass_at": ("radial-ply", 1.7, 1000.0)}, "is no condition"),
        ({"calibration_masses": [0.0]}, "must be > 0 kg"),
    ],
)
def test_impossible_options_are_refused_and_nothing_is_written(tmp_path, options, said):
    with pytest.raises(ValueError, match=said):
        simulate_campaign(tmp_path / "new", **TINY, **options)
    assert not (tmp_path / "new").exists()


def test_earlier_virtual_campaign_is_replaced_and_other_files_stay(tmp_path):
    simulate_campaign(tmp_path, seed=1, **SMALL)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "recordings" / "photo.jpg").write_text("mine")
    simulate_campaign(tmp_path, seed=2, **{**SMALL, "frequencies": [10.0]})
    left = contents(tmp_path)
    assert left.pop("notes.txt") == left.pop("recordings/photo.jpg") == b"mine"
    fresh = simulate_campaign(tmp_path / "fresh", seed=2, **{**SMALL, "frequencies": [10.0]})
    assert left == contents(fresh.folder)


def test_interrupted_run_is_no_campaign_but_can_be_repeated(tmp_path):
    class StopError(Exception):
        pass

    def stop(done, total):
        if done == 3:
            raise StopError

    with pytest.raises(StopError):
        simulate_campaign(tmp_path, progress=stop, **SMALL)
    assert not (tmp_path / "tests.csv").exists()
    assert simulate_campaign(tmp_path, **SMALL).tests == 12
    assert (tmp_path / "tests.csv").exists()


@pytest.mark.parametrize(("name", "text"), [("thesis.docx", "years"), ("truth.csv", "somebody,else\n1,2\n")])
def test_foreign_folder_is_refused_and_untouched(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match="not empty and holds no truth"):
        simulate_campaign(tmp_path, **SMALL)
    assert contents(tmp_path) == {name: text.encode()}


def test_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "campaign").write_text("a file")
    with pytest.raises(FileError, match="is a file"):
        simulate_campaign(tmp_path / "campaign", **SMALL)
    with pytest.raises(FileError, match="cannot be written"):
        simulate_campaign(tmp_path / "campaign" / "below", **SMALL)
