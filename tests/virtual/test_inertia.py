"""Specimens with a mass of their own: both rigs against the nodes of their springs and masses at one frequency."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.faulty import scattering

from fourpole.core.joint import solve_joint
from fourpole.core.joint.belts import found_specimens
from fourpole.core.rig import Rig
from fourpole.models.springs import KelvinVoigt
from fourpole.study import analyse
from fourpole.virtual import (
    BELTED,
    CAR_TYRE,
    RADIAL_PLY,
    RUBBER_MOUNT,
    Belt,
    Bench,
    Cam,
    Conditions,
    Laboratory,
    ModelTyre,
    Rod,
    run,
    simulate_campaign,
    simulate_phasors,
)
from fourpole.virtual.plan import plan_tests

pytestmark = pytest.mark.thorough

INERTIA = {"belt": Belt(7.0), "constant rim": Belt(7.0, constant_rim=True), "rod": Rod(0.4, points=5)}
BENCHES = {
    "plain": Bench(preload_damping=15.0),
    "all parts": Bench(
        preload_damping=15.0, tyre_mass=0.8, frame_stiffness=4e6, preload_loss_factor=0.03, input_mass=0.5
    ),
}
#: What a cubic between 10 000 points per second loses of a sine of 24 Hz, and its acceleration at a mass in a step.
HELD, FOLLOWING = (2 * np.pi * 24.0 * 1e-4) ** 4 / 384, (2 * np.pi * 24.0 * 1e-4) ** 2 / 12
PLAN = {"tyres": [CAR_TYRE], "pressures": [170e3], "preloads": [1000.0], "eccentricity": 0.25e-3}


def eliminated(springs, masses, bench, frequency):
    """F1/x1 of springs and masses in a row on a rig, and the motion of their far end, by the forces on each node."""
    omega = 2 * np.pi * frequency
    above = bench.preload_stiffness * (1 + 1j * bench.preload_loss_factor) + 1j * omega * bench.preload_damping
    above = 1 / (1 / above + 1 / bench.frame_stiffness)
    above -= omega**2 * (bench.mass + bench.tyre_mass)
    forces = np.diag([*(-(omega**2) * np.array([bench.input_mass, *masses])), above])
    for at, spring in enumerate(springs):
        forces[at : at + 2, at : at + 2] += spring * np.array([[1, -1], [-1, 1]])
    behind = np.linalg.solve(forces[1:, 1:], -forces[1:, 0])
    return forces[0, 0] + forces[0, 1:] @ behind, behind[-1]


def lines(signals, time, frequency):
    """Complex amplitudes of columns at one frequency."""
    turn = np.exp(2j * np.pi * frequency * time)
    found, *_ = np.linalg.lstsq(np.stack([turn.real, -turn.imag], axis=1), signals, rcond=None)
    return found[0] + 1j * found[1]


@pytest.mark.parametrize("inertia", INERTIA.values(), ids=INERTIA)
@pytest.mark.parametrize("bench", BENCHES.values(), ids=BENCHES)
def test_its_motion_is_that_of_its_springs_and_masses(inertia, bench):
    whole, omega = CAR_TYRE.element(24.0, 170e3, 1000.0), 48 * np.pi
    laden = inertia.laden(whole)
    springs = [complex(spring.stiffness(omega)) for spring in laden.springs]
    assert 1 / sum(1 / spring for spring in springs) == pytest.approx(complex(whole.stiffness(omega)), rel=1e-12)
    assert sum(laden.masses) == pytest.approx(inertia.mass, rel=1e-12)
    motion = run(Cam(24.0), laden, bench, duration=1.0, oversampling=10)
    far = motion.x1 - motion.deflection
    f1, x1, x2 = lines(np.stack([motion.force, motion.x1, far], axis=1), motion.time, 24.0)
    force, ratio = eliminated(springs, laden.masses, bench, 24.0)
    assert abs(x2 / x1 / ratio - 1) < HELD + 1e-12
    following = FOLLOWING * omega**2 * laden.masses[0] if isinstance(inertia, Rod) else 0.0
    assert abs(f1 / x1 - force) < HELD * abs(springs[0]) * (1 + abs(ratio)) + following


def test_a_rod_nears_a_bar_of_evenly_spread_mass():
    omega, stiffness = 2 * np.pi * 100.0, 300e3
    theta = np.sqrt(omega**2 * 0.4 / stiffness)
    bench = Bench(mass=1e9)  # holds the far end
    errors = []
    for points in (8, 16):
        laden = Rod(0.4, points).laden(ModelTyre("m", KelvinVoigt(), (stiffness, 0.0)).element(1.0, np.nan, 1.0))
        springs = [float(spring.d[0]) for spring in laden.springs]
        errors.append(abs(eliminated(springs, laden.masses, bench, 100.0)[0].real / stiffness - theta / np.tan(theta)))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.parametrize("share", [0.2, 0.25 + 0.02j])
def test_a_belt_on_the_rig_of_phasors(share):
    tests = Conditions([10.0, 24.0], k1=250e3, k2=60e3, c=600.0, belt_mass=[0.0, 7.0], belt_share=share)
    made = simulate_phasors(Laboratory((15.0, 0.0), (12440.0, 0.0), (15.0, 0.0)), tests, np.random.default_rng(0))
    f1, v1, v2 = made.true_amplitudes.T
    for at, (frequency, mass) in enumerate(((10.0, 0.0), (24.0, 7.0))):
        omega = 2 * np.pi * frequency
        whole = 250e3 + 1 / (1 / 60e3 + 1 / (600j * omega))
        assert made.stiffness[at] == pytest.approx(whole, rel=1e-12)
        springs = [(1 + share) * whole, (1 + share) * whole / share]
        force, ratio = eliminated(springs, [mass], BENCHES["plain"], frequency)
        assert v2[at] / v1[at] == pytest.approx(ratio, rel=1e-12)
        assert 1j * omega * f1[at] / v1[at] == pytest.approx(force, rel=1e-12)


def test_the_likelihood_finds_the_belt_on_the_rig_of_phasors():
    frequency, added = np.tile(np.linspace(10.0, 24.0, 10), 2), np.repeat([0.0, 10.0], 10)
    spring = CAR_TYRE.model.stiffness(CAR_TYRE.values, 2 * np.pi * frequency)
    laboratory = Laboratory((15.0, 0.1), (12440.0, 60.0), (15.0, 2.0), noise=1e-4, std_gain=(5e-3,) * 3)
    tests = Conditions(frequency, stiffness=spring, added_mass=added, belt_mass=7.0)
    made = simulate_phasors(laboratory, tests, np.random.default_rng(1))
    stated = {name: getattr(laboratory, name) for name in ("moving_mass", "preload_stiffness", "preload_damping")}
    rig = Rig(**{name: pair[0] for name, pair in stated.items()}, std={name: pair[1] for name, pair in stated.items()})
    joint = solve_joint(made.phasors, rig, added_mass=added, added_mass_std=1e-4 * added)
    (found,) = found_specimens(joint.problem, joint.solution)
    assert abs(found.specimen.mass - 7.0) < 3 * found.mass_std < 1.0


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    plan = {**PLAN, "frequencies": np.linspace(10.0, 24.0, 8), "added_masses": [0.0, 10.0]}
    rig = {"moving_mass": 0.1, "preload_stiffness": 60.0}
    folder = simulate_campaign(tmp_path_factory.mktemp("car"), **plan, sensors=(5e-3, 2e-3), rig_std=rig).folder
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None).drop_nulls("frequency [Hz]")
    return truth, analyse(folder).dynamic.join(truth, on="test", suffix=" true")


@pytest.mark.sampled(6)
def test_a_campaign_of_a_cars_tyre_is_found(car):
    for head, std in (("Re K* [N/m]", "u(Re K*) [N/m]"), ("Im K* [N/m]", "u(Im K*) [N/m]")):
        found, true, u = (car[1][name].to_numpy() for name in (head, f"{head} true", std))
        assert np.all(np.abs(found - true) < 4.0 * u)
    assert car[1]["u(Re K*) [N/m]"].max() < 0.005 * 290e3


@pytest.mark.sampled(8)
def test_a_belt_is_found_though_k_star_scatters_from_repeat_to_repeat(tmp_path):
    """With one mass; the scatter of 0.1 % is ten times what the noise makes of K*."""
    tests = plan_tests(BELTED[1:], [170e3], [1000.0], np.arange(10.0, 25.0, 2.0).tolist(), repeats=3)
    made = simulate_campaign(
        tmp_path, seed=1002, preloads=[1000.0], tests=scattering(tests, 1e-3),
        sensors=(5e-3, np.radians(0.5)), rig_std={"moving_mass": 0.3, "preload_stiffness": 250.0},
    )  # fmt: skip
    study = analyse(made.folder)
    assert study.counts == {"ok": 25, "warning": 0, "rejected": 0}
    assert study.specimens["belt mass [kg]"][0] == pytest.approx(3.0, abs=3 * study.specimens["u(belt mass) [kg]"][0])


def test_its_truth_has_its_belt(car):
    truth = car[0]
    assert truth.columns[-3:] == ["belt mass [kg]", "belt share [1]", "belt frequency, rim held, contact free [Hz]"]
    assert truth["belt mass [kg]"].to_list() == [7.0] * 16
    np.testing.assert_allclose(truth["belt share [1]"], 0.2, rtol=1e-12)
    frequency = np.sqrt(6 * truth["Re K* [N/m]"].to_numpy() / 7.0) / (2 * np.pi)
    np.testing.assert_allclose(truth["belt frequency, rim held, contact free [Hz]"], frequency, rtol=1e-9)
    assert abs(frequency - 80.0).max() < 1.5


@pytest.mark.parametrize("undeclared", [{}, {"leaf_friction": 0.5}], ids=["plain", "friction"])
@pytest.mark.parametrize("inertia", INERTIA.values(), ids=INERTIA)
@pytest.mark.sampled(4)
def test_transmissibility_and_recordings_are_of_its_ends(tmp_path, inertia, undeclared):
    plan = {**PLAN, "tyres": [replace(CAR_TYRE, inertia=inertia), RADIAL_PLY], "frequencies": [20.0], "clean": True}
    folder = simulate_campaign(tmp_path, **plan, undeclared=undeclared).folder
    laden, plain = pl.read_csv(folder / "truth.csv").drop_nulls("frequency [Hz]").iter_rows(named=True)
    assert plain["belt mass [kg]"] is None
    assert (laden["belt share [1]"] is None) == isinstance(inertia, Rod)
    recorded = pl.read_csv(folder / "recordings" / "D1.csv")
    signals, time = recorded.select("F1", "V1", "V2").to_numpy(), recorded["t"].to_numpy()
    _, v1, v2 = lines(signals, time, 20.0)
    assert laden["TR [1]"] == pytest.approx(abs(v2 / v1), rel=3e-4 if undeclared else 1e-8)
    if not undeclared:
        parts = inertia.laden(CAR_TYRE.element(20.0, 170e3, 1000.0))
        springs = [complex(spring.stiffness(40 * np.pi)) for spring in parts.springs]
        assert laden["TR [1]"] == pytest.approx(abs(eliminated(springs, parts.masses, BENCHES["plain"], 20.0)[1]))


def test_it_changes_no_static_test_and_no_other_specimen(tmp_path):
    plan = {**PLAN, "frequencies": [20.0]}
    mass, none = (
        simulate_campaign(tmp_path / name, **{**plan, "tyres": [RADIAL_PLY, tyre]}).folder
        for name, tyre in (("mass", CAR_TYRE), ("none", replace(CAR_TYRE, inertia=None)))
    )
    assert (mass / "campaign.toml").read_bytes() == (none / "campaign.toml").read_bytes()
    same = {
        path.name: path.read_bytes() == (none / "recordings" / path.name).read_bytes()
        for path in (mass / "recordings").iterdir()
    }
    assert same == {"S1.csv": True, "S2.csv": True, "D1.csv": True, "D2.csv": False}
    assert "belt" not in (none / "truth.csv").read_text()


def test_a_rod_has_its_first_frequency(tmp_path):
    mount = replace(RUBBER_MOUNT, inertia=Rod(0.4))
    folder = simulate_campaign(tmp_path, **{**PLAN, "tyres": [], "mounts": [mount], "frequencies": [20.0]}).folder
    (row,) = pl.read_csv(folder / "truth.csv", infer_schema_length=None).drop_nulls("frequency [Hz]").to_dicts()
    assert row["belt frequency, rim held, contact free [Hz]"] == pytest.approx(
        np.sqrt(row["Re K* [N/m]"] / 0.4) / 4, rel=1e-12
    )


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Belt(0.0), "must be > 0"),
        (lambda: Belt(7.0, share=-0.2), "must be > 0"),
        (lambda: Rod(0.4, points=0), "at least one point"),
        (lambda: Belt(7.0, 2.0, constant_rim=True).laden(RUBBER_MOUNT.element(10.0, 0.0, 1.0)), "must be stiffer"),
        (lambda: Conditions(10.0, belt_mass=-1.0).spread(), "must be > 0"),
        (lambda: Conditions(10.0, belt_share=0.0).spread(), "must be > 0"),
    ],
)
def test_what_no_specimen_has_is_refused(call, said):
    with pytest.raises(ValueError, match=said):
        call()
