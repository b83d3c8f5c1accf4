"""Any causal model in the place of the tyre, in time: against its K*, the chain, an ODE solver and the energy."""

import numpy as np
import polars as pl
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp

from fourpole.core.rig import Rig
from fourpole.errors import ModelError
from fourpole.models import maxwell
from fourpole.models.chain import in_time, transmissibility
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.interface import StateSpace
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.models.step import simulate
from fourpole.paper1982.models import Gehman, Structural
from fourpole.virtual import (
    Bench,
    Cam,
    Conditions,
    Laboratory,
    ModelTyre,
    Zener,
    run,
    simulate_campaign,
    simulate_phasors,
)

pytestmark = pytest.mark.thorough

MODELS = {
    "spring": (Spring(), (180e3,)),
    "kelvin": (KelvinVoigt(), (180e3, 300.0)),
    "zener": (maxwell.Zener(), (180e3, 120e3, 700.0)),
    "maxwell:5": (GeneralisedMaxwell(5), (150e3, 40e3, 60e3, 30e3, 20e3, 10e3, 0.3, 0.05, 0.02, 5e-3, 1e-3)),
    "fractional": (FractionalZener(), (150e3, 400e3, 2e-3, 0.4)),
    "fractional5": (FractionalZener5(), (150e3, 400e3, 2e-3, 0.4, 0.7)),
}
BENCH = Bench(preload_damping=15.0)
RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=15.0)
WORN = {"profile": ((2, 0.006, 0.7), (3, 0.002, 2.1)), "ripple": ((1, 1.5e-3, 0.3), (2, 1e-3, 1.0)), "wander": 1e-4}
ALL = {"tyre_mass": 0.8, "frame_stiffness": 4e6, "preload_loss_factor": 0.03, "input_mass": 0.5}
#: Of the arms that stand for a fractional model.
ACCURACY = 1e-6


def on_the_rig(name, frequency):
    model, values = MODELS[name]
    return in_time(model, values, (frequency / 5, 5 * frequency), ACCURACY)


def held(frequency, samples):
    """What a cubic between so many samples per second loses of a sine, at most."""
    return (2 * np.pi * frequency / samples) ** 4 / 384


def lines(motion, frequency):
    """Complex amplitudes of F1, V1, V2 at the cam's frequency."""
    turn = np.exp(2j * np.pi * frequency * motion.time)
    signals = np.stack([motion.force, motion.v1, motion.v2], axis=1)
    found, *_ = np.linalg.lstsq(np.stack([turn.real, -turn.imag], axis=1), signals, rcond=None)
    return found[0] + 1j * found[1]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("frequency", [10.0, 24.0])
@pytest.mark.sampled(2)
def test_its_phasors_are_its_stiffness_and_the_transmissibility_of_the_chain(name, frequency):
    """All that is lost is what the cubic between 10 000 points a second loses: V2 that share, K* by F1 over V1 - V2
    as much more as the difference is smaller than its parts. 1e-12 is for round-off of the phasors."""
    model, values = MODELS[name]
    space, omega = on_the_rig(name, frequency), 2 * np.pi * frequency
    f1, v1, v2 = lines(run(Cam(frequency), space, BENCH, duration=1.0, oversampling=10), frequency)
    found, moved = 1j * omega * f1 / (v1 - v2), v2 / v1
    lost = held(frequency, 10e3)
    limit = lost * (1 + abs(moved)) / abs(1 - moved) + 1e-12
    assert limit < 2e-9
    assert abs(found / space.stiffness(omega) - 1) < limit
    arms = 1.02 * ACCURACY if name.startswith("fractional") else 0.0  # 12 points an arm see all but 2 % of a peak
    assert abs(found / model.stiffness(values, [omega])[0] - 1) < limit + arms
    chain = transmissibility(model, values, RIG, [omega])[0]
    assert abs(moved / chain - 1) < lost + 1e-12 + 1.001 * arms * abs(1 - chain)  # dT/T = (1 - T) dK*/K*


@pytest.mark.parametrize("mass", [1.0, 1e-3])
def test_a_tyre_with_a_mass_inside_moves_as_its_equations_say(mass):
    """A mass between springs, with a mode at 62 Hz that the steps resolve, or at 1950 Hz that follows within a few."""
    k1, k2, k3, c = 120e3, 100e3, 50e3, 50.0
    space = StateSpace(
        np.array([[0.0, 1.0], [-(k2 + k3) / mass, -c / mass]]),
        np.array([[0.0, 0.0], [k2 / mass, 0.0]]),
        np.array([-k2, 0.0]),
        np.array([k1 + k2, 0.0]),
    )
    omega = 2 * np.pi * 24.0
    expected = k1 + k2 - k2**2 / (k2 + k3 + 1j * omega * c - mass * omega**2)
    f1, v1, v2 = lines(run(Cam(24.0), space, BENCH, duration=1.0, oversampling=10), 24.0)
    lost = held(24.0, 10e3) * (1 + abs(v2 / v1)) / abs(1 - v2 / v1)
    inertia = (omega * 1e-4) ** 2 / 12 * mass * omega**2 / abs(expected) if mass < 1.0 else 0.0
    assert abs(1j * omega * f1 / (v1 - v2) / expected - 1) < lost + inertia + 1e-12
    above = 12440.0 - 15.0 * omega**2 + 15j * omega
    assert abs(v2 / v1 / (expected / (expected + above)) - 1) < held(24.0, 10e3) + inertia


@pytest.mark.parametrize("name", ["kelvin", "maxwell:5"])
@pytest.mark.parametrize("parts", [{"frame_stiffness": 4e6}, ALL], ids=["frame", "all parts"])
def test_with_every_part_of_the_rig_it_moves_as_in_the_frequency_domain(name, parts):
    model, values = MODELS[name]
    found = lines(run(Cam(24.0), on_the_rig(name, 24.0), Bench(preload_damping=15.0, **parts), duration=1.0), 24.0)
    stated = {key: (value, 0.0) for key, value in parts.items()}
    laboratory = Laboratory((15.0, 0.0), (12440.0, 0.0), (15.0, 0.0), **stated)
    tests = Conditions(24.0, stiffness=model.stiffness(values, [2 * np.pi * 24.0]))
    expected = simulate_phasors(laboratory, tests, np.random.default_rng(0)).true_amplitudes[0]
    # F1 is what is left of the forces at both ends of the tyre, 4 times it
    np.testing.assert_allclose(found / found[1], expected / expected[1], rtol=4 * held(24.0, 5e3))


def test_friction_of_the_leaf_rubs_on_any_model():
    """As with the element of one frequency, and near its first harmonic."""
    model, values = MODELS["kelvin"]
    laboratory = Laboratory((15.0, 0.0), (12440.0, 0.0), (15.0, 0.0), undeclared={"leaf_friction": 20.0})
    tests = Conditions(10.0, stiffness=model.stiffness(values, [20 * np.pi]))
    expected = simulate_phasors(laboratory, tests, np.random.default_rng(0)).true_amplitudes[0]
    bench = Bench(preload_damping=15.0, leaf_friction=20.0)
    found = lines(run(Cam(10.0), on_the_rig("kelvin", 10.0), bench, duration=1.0), 10.0)
    without = transmissibility(model, values, RIG, [20 * np.pi])[0]
    effect = abs(expected[2] / expected[1] - without)
    assert effect > 0.01
    # the smoothed sign leaves out 0.5 % of it, the harmonics a part that grows with it
    assert abs(found[2] / found[1] - expected[2] / expected[1]) < (5e-3 + effect / abs(without)) * effect


def test_the_same_tyre_written_twice_moves_the_same():
    """The element by the force in its arm, the model by its damper's deflection: round-off and the cubic apart."""
    cam = Cam(17.0, **WORN)
    element = run(cam, Zener(180e3, 120e3, 700.0), BENCH, duration=0.5)
    model = run(cam, on_the_rig("zener", 17.0), BENCH, duration=0.5)
    for name in ("x2", "v2", "force"):
        one, other = getattr(element, name), getattr(model, name)
        # of a worn cam the third harmonic has 2e-3 of the motion: with the first, no more than 2 (wh)^4/384
        np.testing.assert_allclose(other, one, atol=4 * held(17.0, 5e3) * abs(one).max(), err_msg=name)


def test_a_damper_across_the_tyre_on_a_worn_cam_is_that_of_an_ode_solver():
    cam, (k, c) = Cam(17.0, **WORN), MODELS["kelvin"][1]
    motion = run(cam, on_the_rig("kelvin", 17.0), BENCH, duration=0.5, guard=0, oversampling=20)

    def slope(t, z):
        x1, v1 = (float(one[0]) for one in cam.motion(np.array([t])))
        x2, v2 = z
        return [v2, (k * (x1 - x2) + c * (v1 - v2) - 12440.0 * x2 - 15.0 * v2) / 15.0]

    start, at = [motion.x2[0], motion.v2[0]], motion.time[::200]
    solved = solve_ivp(slope, (0.0, 0.499), start, method="DOP853", t_eval=at, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(motion.x2[::200], solved.y[0], atol=1e-9 * abs(motion.x2).max())
    np.testing.assert_allclose(motion.v2[::200], solved.y[1], atol=1e-9 * abs(motion.v2).max())
    force = k * (motion.x1 - motion.x2) + c * (motion.v1 - motion.v2)
    np.testing.assert_allclose(motion.force, force, rtol=0, atol=1e-12 * abs(force).max())


@pytest.mark.parametrize("name", MODELS)
def test_power_put_in_is_what_the_model_and_the_leaf_lose(name):
    model, values = MODELS[name]
    motion = run(Cam(20.0), on_the_rig(name, 20.0), BENCH, duration=1.001, guard=0)  # 20 whole turns, closed
    put_in = np.mean((motion.force * motion.v1)[:-1])
    leaf = np.mean((15.0 * motion.v2**2)[:-1])
    _, v1, v2 = lines(motion, 20.0)
    across = abs(v1 - v2) / (40 * np.pi)
    tyre = 20.0 * float(model.energy_loss(values, [40 * np.pi], across)[0])
    assert put_in > 0.0
    assert tyre >= 0.0
    arms = abs(model.stiffness(values, [40 * np.pi])[0]) * ACCURACY * 20.0 * np.pi * across**2
    # the powers are small parts of what goes to and fro, |F1| |V1|
    assert put_in == pytest.approx(leaf + tyre, abs=4 * held(20.0, 5e3) * abs(motion.force * motion.v1).max() + arms)


@pytest.mark.parametrize("name", MODELS)
def test_what_the_tyre_gives_back_it_has_been_given(name):
    """From rest the energy put into it never falls below nothing; (2wh)^2/12 = 4e-5 is what a trapezium misses."""
    step = 1e-4
    x, v = Cam(17.0, **WORN).motion(np.arange(4000) * step)
    energy = cumulative_trapezoid(simulate(on_the_rig(name, 17.0), x - x[0], v, step) * v, dx=step)
    assert energy.max() > 0.0
    assert energy.min() > -1e-4 * energy.max()


def test_any_model_stands_on_the_rig_of_phasors():
    frequency = np.array([10.0, 17.0, 24.0])
    omega = 2 * np.pi * frequency
    table = Gehman([5.0, 10.0, 31.0], [90e3, 120e3, 150e3], [1e3, 700.0, 400.0])
    for model, values in (*MODELS.values(), (Structural(), (180e3, 0.1)), (table, (180e3,))):
        stiffness = model.stiffness(values, omega)
        tests = Conditions(frequency, stiffness=stiffness)
        run_ = simulate_phasors(Laboratory((15.0, 0.0), (12440.0, 0.0), (15.0, 0.0)), tests, np.random.default_rng(0))
        f1, v1, v2 = run_.true_amplitudes.T
        np.testing.assert_allclose(v2 / v1, transmissibility(model, values, RIG, omega), rtol=1e-12)
        np.testing.assert_allclose(1j * omega * f1 / (v1 - v2), stiffness, rtol=1e-12)
        np.testing.assert_allclose(run_.stiffness, stiffness, rtol=1e-14)
        assert np.isnan([run_.k2, run_.c]).all()


def test_the_element_by_its_stiffness_is_the_element():
    laboratory = Laboratory(noise=1e-3, undeclared={"leaf_friction": 5.0})
    plain = Conditions([10.0, 24.0], k1=150e3, k2=190e3, c=1400.0, added_mass=5.0, calibration=[False, True])
    by_parts = simulate_phasors(laboratory, plain, np.random.default_rng(1))
    whole = Conditions([10.0, 24.0], stiffness=by_parts.stiffness, added_mass=5.0, calibration=[False, True])
    by_whole = simulate_phasors(laboratory, whole, np.random.default_rng(1))
    np.testing.assert_allclose(by_whole.phasors.amplitudes, by_parts.phasors.amplitudes, rtol=1e-12)
    np.testing.assert_array_equal(np.isnan(by_whole.stiffness), [False, True])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    tyres = [ModelTyre(name.replace(":", "-"), *MODELS[name]) for name in ("kelvin", "maxwell:5", "fractional")]
    given = {"pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 24.0], "clean": True}
    return tyres, simulate_campaign(tmp_path_factory.mktemp("models"), tyres=tyres, **given).folder


def test_a_campaign_of_models_has_their_stiffness_in_its_recordings_and_its_truth(campaign):
    tyres, folder = campaign
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None).filter(pl.col("frequency [Hz]").is_not_null())
    models = {tyre.name: tyre for tyre in tyres}
    assert truth["tyre"].n_unique() == 3
    assert truth["K2 [N/m]"].null_count() == truth["C [N s/m]"].null_count() == truth.height == 6
    for row in truth.iter_rows(named=True):
        tyre, frequency = models[row["tyre"]], row["frequency [Hz]"]
        expected = tyre.model.stiffness(tyre.values, [2 * np.pi * frequency])[0]
        assert abs(complex(row["Re K* [N/m]"], row["Im K* [N/m]"]) / expected - 1) < 1.02 * ACCURACY
        assert row["K1 [N/m]"] == tyre.values[0]
        chain = abs(transmissibility(tyre.model, tyre.values, RIG, [2 * np.pi * frequency])[0])
        assert row["TR [1]"] == pytest.approx(chain, rel=1.02 * ACCURACY * abs(1 + chain))
        recorded = pl.read_csv(folder / "recordings" / f"{row['test']}.csv")
        turn = np.exp(2j * np.pi * frequency * recorded["t"].to_numpy())
        columns = np.stack([turn.real, -turn.imag], axis=1)
        found, *_ = np.linalg.lstsq(columns, recorded.select("F1", "V1", "V2").to_numpy(), rcond=None)
        f1, v1, v2 = found[0] + 1j * found[1]
        assert abs(2j * np.pi * frequency * f1 / (v1 - v2) / expected - 1) < 1.02 * ACCURACY + 1e-8


def test_a_campaign_of_models_has_their_stiffness_at_rest(campaign):
    tyres, folder = campaign
    for number, tyre in enumerate(tyres, start=1):
        static = pl.read_csv(folder / "recordings" / f"S{number}.csv")
        x, load = static["x"].to_numpy()[2000:] * 1e-3, static["F"].to_numpy()[2000:]  # conditioned by two cycles
        # loading and unloading are alike far from the mean at equal deflections: the slope is that of the straight law
        assert np.polyfit(x, load, 1)[0] == pytest.approx(tyre.values[0], rel=1e-9)


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda: ModelTyre("s", Structural(), (1e5, 0.1)).element(10.0, 1e5, 1e3), ModelError, "is not causal"),
        (lambda: ModelTyre("s", Spring(), (-1.0,)), ModelError, "K = -1 N/m"),
        (lambda: ModelTyre("s", GeneralisedMaxwell(1), (0.0, 1e5, 0.01)), ValueError, "carries no load"),
        (lambda: run(Cam(10.0), on_the_rig("spring", 10.0), Bench(), duration=0.1), ValueError, "no steady motion"),
        (
            lambda: run(Cam(10.0), GeneralisedMaxwell(1).state_space((1e5, 1e5, 1e4)), BENCH, duration=0.1),
            ValueError,
            "leave out long relaxation times",
        ),
        (
            lambda: run(
                Cam(10.0),
                StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([1e5, -300.0])),
                BENCH,
                duration=0.1,
            ),
            ValueError,
            "no steady motion",
        ),
        (lambda: Conditions(10.0, stiffness=np.nan).spread(), ValueError, "finite and not zero"),
        (lambda: Conditions(10.0, stiffness=0.0).spread(), ValueError, "finite and not zero"),
    ],
)
def test_what_cannot_stand_on_the_rig_is_refused(call, error, said):
    with pytest.raises(error, match=said):
        call()
