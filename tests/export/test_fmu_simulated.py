"""FMUs in FMPy: the force of our own time stepping, K* by sines, restarts, and errors in place of crashes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.export.fmus import (
    BAND,
    DRAW,
    FORCE,
    INPUTS,
    MODELS,
    POINT,
    PRELOAD,
    SHELL,
    STATE,
    STATES,
    WITH_INERTIA,
    instance,
    made,
    points,
    unpacked,
)

from fourpole.core.recursion import LinearSystem, driven
from fourpole.export.fmi.variables import variables_of
from fourpole.models.families import model_named
from fourpole.models.realised import realised
from fourpole.models.step import simulate
from fourpole.paper1982.shell import RADIAL_PLY

fmpy = pytest.importorskip("fmpy", reason="FMPy needs a later numpy than the lowest version allowed")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

POINTS = range(1, len(MODELS) + 1)
both = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """The FMU of all models as operating points, of each version."""
    place = tmp_path_factory.mktemp("fmu")
    return {version: made(place, version) for version in (2, 3)}


@pytest.fixture(scope="module")
def folders(archives):
    """The same, unpacked."""
    return {version: unpacked(path, path.parent / str(version)) for version, path in archives.items()}


def motion(step, count):
    """Deflection and rate (count,) of two sines."""
    time = step * np.arange(count)
    x = 2e-3 + 1e-3 * np.sin(90 * time) + 3e-4 * np.sin(400 * time + 1)
    return x, 0.09 * np.cos(90 * time) + 0.12 * np.cos(400 * time + 1)


def follow(one, x, v, step, shared=0.3):
    """Forces over the steps of an instance; contact and wheel share the motion."""
    found = [one.force]
    for at in range(1, x.size):
        one.step((at - 1) * step, step)
        both_ends = [(1 + shared) * x[at], (1 + shared) * v[at], shared * x[at], shared * v[at]]
        one.put(INPUTS, both_ends)
        found.append(one.force)
    return np.array(found)


def first(x, v, shared=0.3):
    return [(1 + shared) * x[0], (1 + shared) * v[0], shared * x[0], shared * v[0]]


@both
@pytest.mark.sampled(2)
def test_the_description_has_no_problems(archives, version):
    assert validate_fmu(str(archives[version])) == []


@both
def test_the_description_lists_the_variables_by_their_places(folders, version):
    description = fmpy.read_model_description(str(folders[version]), validate=True)
    wanted = variables_of(points())
    assert [(one.name, one.valueReference) for one in description.modelVariables] == [
        (one.name, at) for at, one in enumerate(wanted)
    ]
    assert [one.unit or "" for one in description.modelVariables] == [one.unit for one in wanted]
    assert description.numberOfContinuousStates == STATES
    assert [one.derivative.name for one in description.modelVariables if one.derivative] == [
        f"states[{at + 1}]" for at in range(STATES)
    ]
    assert description.modelExchange.modelIdentifier == description.coSimulation.modelIdentifier == "tyre"


@both
@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("step", [1e-4, 1e-3, 1.3e-2])
@pytest.mark.sampled(2)
def test_the_force_is_that_of_our_own_time_stepping(folders, version, point, step):
    x, v = motion(step, 300)
    wanted = simulate(points()[point - 1].system.space, x, v, step)
    with instance(folders[version], version) as one:
        one.start(point, first(x, v))
        found = follow(one, x, v, step)
    assert np.max(np.abs(found - wanted)) < 1e-11 * np.max(np.abs(wanted))


@both
@pytest.mark.parametrize("point", POINTS)
def test_straight_lines_with_kinks_are_followed_exactly_also_in_parts_of_a_step(folders, version, point):
    step, heights = 2e-3, np.random.default_rng(3).normal(0.0, 1e-3, 200)
    space = points()[point - 1].system.space
    system = LinearSystem(
        space.a, space.b[:, :1], np.zeros((len(space.a), 1)), space.c[None], space.d[None, :1], np.zeros((1, 1))
    )
    wanted = driven(system, heights[None], step)[0] if len(space.a) else space.d[0] * heights
    slopes = np.diff(heights) / step
    force = []
    with instance(folders[version], version) as one:
        one.start(point, [heights[0], slopes[0], 0.0, 0.0])
        time = 0.0
        for at, slope in enumerate(slopes):
            for part in (0.25, 0.75):  # 1 ms of the second interval is a step by itself
                one.step(time, part * step)
                time += part * step
                end = heights[at] + slope * (step if part == 0.75 else part * step)
                force.append(one.force)  # before the inputs are known
                last = part == 0.75 and at + 1 < slopes.size
                one.put(INPUTS, [end, slopes[at + 1] if last else slope, 0.0, 0.0])
    damping = space.d[1] * slopes
    assert np.max(np.abs(np.array(force[1::2]) - damping - wanted[1:])) < 1e-10 * np.max(np.abs(wanted))


@both
def test_without_states_of_the_end_the_force_is_that_of_the_motion_as_it_goes_on(folders, version):
    """The force before the inputs of its time is that of a parabola: its error is of the third order of the step."""
    apart = []
    for count in (200, 400):
        step = 2 * np.pi / 90 / count
        x, v = 1e-3 * np.sin(90 * step * np.arange(count)), 0.09 * np.cos(90 * step * np.arange(count))
        with instance(folders[version], version) as one:
            one.start(1, first(x, v))
            pairs = []
            for at in range(1, count):
                one.step((at - 1) * step, step)
                early = one.force
                one.put(INPUTS, [1.3 * x[at], 1.3 * v[at], 0.3 * x[at], 0.3 * v[at]])
                pairs.append(early - one.force)
        apart.append(np.max(np.abs(pairs[2:])))
    assert apart[0] / apart[1] == pytest.approx(8.0, rel=0.05)
    assert apart[0] < 300e3 * 1e-3 * (2 * np.pi / 200) ** 3 / 2


@pytest.mark.parametrize("point", POINTS)
def test_with_derivatives_of_the_inputs_the_force_is_exact_before_the_inputs_of_its_time(folders, point):
    step, count = 1e-3, 400
    x, v = motion(step, count)
    wanted = simulate(points()[point - 1].system.space, x, v, step)
    with instance(folders[2], 2) as one:
        one.start(point, first(x, v))
        found = [one.force]
        for at in range(1, count):
            slopes = [np.diff(each)[at - 1] / step for each in (x, v)]
            one.slopes(INPUTS, [1.3 * slopes[0], 1.3 * slopes[1], 0.3 * slopes[0], 0.3 * slopes[1]])
            one.step((at - 1) * step, step)
            found.append(one.force)
            one.put(INPUTS, [1.3 * x[at], 1.3 * v[at], 0.3 * x[at], 0.3 * v[at]])
    assert np.max(np.abs(np.array(found) - wanted)) < 1e-11 * np.max(np.abs(wanted))


@both
@pytest.mark.parametrize("point", [1, 2])
@pytest.mark.sampled(2)
def test_the_recorded_force_of_a_sine_has_the_dynamic_stiffness_of_the_model(folders, version, point):
    """FMPy records the force of a step before it sets the inputs of that time."""
    model, frequency, cycle, cycles = model_named(list(MODELS)[point - 1]), 20.0, 4000, 4
    omega, step = 2 * np.pi * frequency, 1 / (frequency * cycle)
    time = step * np.arange(cycles * cycle + 2)
    table = np.rec.fromarrays(
        [time, 1e-3 * np.sin(omega * time), 1e-3 * omega * np.cos(omega * time), 0 * time, 0 * time],
        names=["time", "contact.displacement", "contact.velocity", "wheel.displacement", "wheel.velocity"],
    )
    found = fmpy.simulate_fmu(
        str(folders[version]), start_values={"point": point}, input=table, output=["force"],
        stop_time=cycles / frequency, output_interval=step, fmi_type="CoSimulation",
    )  # fmt: skip
    last = slice(-cycle - 1, -1)
    force, at = np.asarray(found["force"])[last], np.asarray(found["time"])[last]
    k = 2j / cycle * np.sum(force * np.exp(-1j * omega * at)) / 1e-3
    assert abs(k / model.stiffness(MODELS[model.name], [omega])[0] - 1) < 1e-6


@both
@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("frequency", [1.7, 30.0])
@pytest.mark.sampled(4)
def test_the_dynamic_stiffness_by_sines_is_that_of_the_model(folders, version, point, frequency):
    name = list(MODELS)[point - 1]
    model, cycle = model_named(name), 100
    omega, step = 2 * np.pi * frequency, 1.0 / (cycle * frequency)
    slowest = max(points()[point - 1].system.times, default=0.0)
    settled = math.ceil(20 * slowest * frequency + 1) * cycle
    time = step * np.arange(settled + cycle)
    x, v = 1e-3 * np.sin(omega * time), 1e-3 * omega * np.cos(omega * time)
    with instance(folders[version], version) as one:
        one.start(point, first(x, v))
        force = follow(one, x, v, step)[-cycle:]
    found = 2j / cycle * np.sum(force * np.exp(-1j * omega * time[-cycle:])) / 1e-3
    assert abs(found / model.stiffness(MODELS[name], [omega])[0] - 1) < 1e-6


@both
@pytest.mark.sampled(2)
def test_model_exchange_by_an_independent_integrator(folders, version):
    point, space = 3, points()[2].system.space
    times = np.linspace(0.0, 0.2, 41)
    x = lambda t: 1e-3 * np.sin(90 * t) + 2e-3  # noqa: E731
    v = lambda t: 0.09 * np.cos(90 * t)  # noqa: E731
    fine = 0.2 / 4000 * np.arange(4001)
    wanted = simulate(space, x(fine), v(fine), fine[1])[::100]
    with instance(folders[version], version, stepped=False) as one:
        one.start(point, [x(0.0), v(0.0), 0.0, 0.0])
        one.exchange()

        def derivatives(time, states):
            one.it.setTime(time)
            one.put(INPUTS, [x(time), v(time), 0.0, 0.0])
            one.set_states(states)
            return one.derivatives()

        assert one.states() == pytest.approx([2e-3] * 3 + [0.0] * (STATES - 3))
        found = solve_ivp(derivatives, (0.0, 0.2), one.states(), "Radau", times, rtol=1e-10, atol=1e-14)
        force = []
        for time, states in zip(times, found.y.T, strict=True):
            derivatives(time, states)
            force.append(one.force)
        one.it.terminate()
    assert np.max(np.abs(np.array(force) - wanted)) < 1e-7 * np.max(np.abs(wanted))


@both
@pytest.mark.parametrize("stepped", [True, False])
def test_directional_derivatives_are_those_of_the_matrices(folders, version, stepped):
    point, space = 3, points()[2].system.space
    size = len(space.a)
    knowns = [*INPUTS, *range(STATE, STATE + size)]
    unknowns = [FORCE, *range(STATE + STATES, STATE + STATES + size)]
    sides = np.array([[1, 0, -1, 0], [0, 1, 0, -1]])
    wanted = np.block([[space.d @ sides, space.c], [space.b @ sides, space.a]])
    with instance(folders[version], version, stepped=stepped) as one:
        one.start(point)
        found = np.stack([one.changes(unknowns, knowns, row) for row in np.eye(len(knowns))], axis=1)
    assert np.allclose(found, wanted, rtol=1e-12, atol=0.0)


@both
def test_a_state_that_was_saved_goes_on_as_before_also_in_another_instance(folders, version):
    x, v = motion(1e-3, 60)
    with instance(folders[version], version) as one, instance(folders[version], version, name="two") as two:
        one.start(4, first(x, v))
        follow(one, x[:31], v[:31], 1e-3)

        def go_on(instance_):
            found = []
            for at in range(31, 60):
                instance_.step((at - 1) * 1e-3, 1e-3)
                instance_.put(INPUTS, [1.3 * x[at], 1.3 * v[at], 0.3 * x[at], 0.3 * v[at]])
                found.append(instance_.force)
            return found

        state = one.it.getFMUState()
        content = one.it.serializeFMUState(state)
        wanted = go_on(one)
        one.it.setFMUState(state)
        assert one.get(0) == pytest.approx(0.03)
        assert go_on(one) == wanted
        other = two.state_of(content)
        two.it.setFMUState(other)
        assert go_on(two) == wanted
        one.it.freeFMUState(state)
        two.it.freeFMUState(other)
    assert len(set(wanted)) == 29


@both
def test_a_state_of_the_other_kind_of_simulation_is_refused(folders, version):
    with instance(folders[version], version) as one, instance(folders[version], version, stepped=False) as two:
        one.start(1)
        two.start(1)
        state = one.it.getFMUState()
        other = two.state_of(one.it.serializeFMUState(state))
        with pytest.raises(FMICallException):
            two.it.setFMUState(other)
        assert two.said[-1].endswith("the state is of the other kind of simulation")
        one.it.freeFMUState(state)
        two.it.freeFMUState(other)


@both
def test_reset_is_a_fresh_start(folders, version):
    x, v = motion(1e-3, 40)
    with instance(folders[version], version) as one:
        one.start(4, first(x, v))
        wanted = follow(one, x, v, 1e-3)
        one.it.reset()
        one.start(4, first(x, v))
        assert follow(one, x, v, 1e-3).tolist() == wanted.tolist()


@both
def test_parameters_and_preload_can_be_set_before_the_start(folders, version):
    names = [one.name for one in variables_of(points())]
    place = names.index("points[1].stiffness_at_rest")
    with instance(folders[version], version) as one:
        one.setup()
        one.put([place, PRELOAD], [250e3, 3e3])
        one.put(INPUTS, [3e-3, 0.0, 1e-3, 0.0])
        assert one.get(place, PRELOAD).tolist() == [250e3, 3e3]
        one.it.exitInitializationMode()
        assert one.force == pytest.approx(3e3 + 250e3 * 2e-3)


NAN = float("nan")
#: Calls that are wrong, with words of the message.
WRONG = {
    "input that is no number": (lambda one: one.put([1], [NAN]), "contact.displacement cannot have a value that is"),
    "infinite velocity": (lambda one: one.put([2], [math.inf]), "contact.velocity cannot have a value that is"),
    "step of zero": (lambda one: one.step(0.0, 0.0), "its duration a positive one"),
    "negative step": (lambda one: one.step(0.0, -1e-3), "its duration a positive one"),
    "step that is no number": (lambda one: one.step(0.0, NAN), "its duration a positive one"),
    "infinite step": (lambda one: one.step(0.0, math.inf), "must be a finite number"),
    "step from another time": (lambda one: one.step(0.5, 1e-3), "does not begin where the last one ended"),
    "step beyond the end": (lambda one: one.step(0.0, 2.0), "beyond the end of the experiment"),
    "point after the start": (lambda one: one.choose(2), "point is a parameter: it can be set before"),
    "preload after the start": (lambda one: one.put([PRELOAD], [1.0]), "preload is a parameter: it can be set before"),
    "force": (lambda one: one.put([FORCE], [1.0]), "force is computed and cannot be set"),
    "time": (lambda one: one.put([0], [1.0]), "time is computed and cannot be set"),
    "unknown variable": (lambda one: one.get(100_000), "value reference 100000 is no variable of this model"),
    "real of an integer": (lambda one: one.get(POINT), "point is an integer"),
    "integer of a real": (lambda one: one._choose([FORCE], [1]), "force is no"),
    "initialization again": (lambda one: one.it.exitInitializationMode(), "is not allowed now"),
    "bytes of another state": (lambda one: one.state_of(b"\0" * 40), "not the bytes of a state of this model"),
    "derivative by a parameter": (lambda one: one.changes([FORCE], [PRELOAD], [1.0]), "preload is none of"),
    "derivative of an input": (lambda one: one.changes([1], [1], [1.0]), "contact.displacement is none of"),
}  # fmt: skip


@both
@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_call_ends_in_an_error_with_a_message_and_changes_nothing(folders, version, case):
    call, words = WRONG[case]
    with instance(folders[version], version) as one:
        one.start(1, [1e-3, 0.0, 0.0, 0.0], stop=1.0)
        before = one.force
        with pytest.raises(FMICallException):
            call(one)
        assert len(one.said) == 1
        assert words in one.said[0]
        assert one.force == before
        one.step(0.0, 1e-3)
        assert one.force == before


STARTING = {
    "point 0": (lambda one: one.choose(0), "number of an operating point that this model does not have"),
    "draw that is not there": (lambda one: one._choose([DRAW], [1]), "number of a draw that this model does not have"),
    "point beyond": (lambda one: one.choose(len(MODELS) + 1), "number of an operating point that this model"),
    "time of zero": (lambda one: one.put([place("points[1].branches[1].relaxation_time")], [0.0]), "so small a value"),
    "negative damping": (lambda one: one.put([place("points[2].damping")], [-1.0]), "points[2].damping cannot have so"),
    "stiffness that is no number": (lambda one: one.put([place("points[1].stiffness_at_rest")], [NAN]), "not a finite"),
    "step": (lambda one: one.step(0.0, 1e-3), "is not allowed now"),
    "state": (lambda one: one.put([STATE], [1.0]), "states[1] is computed"),
}  # fmt: skip


def place(name):
    return [one.name for one in variables_of(points())].index(name)


@both
@pytest.mark.parametrize("case", STARTING)
def test_a_wrong_start_ends_in_an_error_with_a_message(folders, version, case):
    call, words = STARTING[case]
    with instance(folders[version], version) as one:
        one.setup()
        with pytest.raises(FMICallException):
            call(one)
        assert words in one.said[-1]
        one.it.exitInitializationMode()
        assert one.force == 0.0


@both
@pytest.mark.parametrize("more", [{"token": "{0}"}, {"name": ""}])
def test_another_token_and_no_name_make_no_instance(folders, version, more):
    with pytest.raises(Exception, match="instantiate"):
        instance(folders[version], version, **more).__enter__()


@both
def test_a_force_that_is_too_large_ends_the_step_with_an_error(folders, version):
    with instance(folders[version], version) as one:
        one.start(1)
        one.put(INPUTS, [1e308, 0.0, -1e308, 0.0])
        with pytest.raises(FMICallException):
            one.step(0.0, 1e-3)
        assert "the inputs are too large" in one.said[-1]
        one.put(INPUTS, [1e-3, 0.0, 0.0, 0.0])
        one.step(0.0, 1e-3)
        assert math.isfinite(one.force)


@both
@pytest.mark.sampled(2)
def test_a_model_with_inertia_steps_by_its_pairs(version, tmp_path):
    path = made(tmp_path, version, WITH_INERTIA)
    assert validate_fmu(str(path)) == []
    x, v = motion(1e-3, 300)
    system = realised(SHELL, RADIAL_PLY, BAND)
    assert system.pair_springs.size
    wanted = simulate(system.space, x, v, 1e-3)
    with instance(unpacked(path, tmp_path / "in"), version) as one:
        one.start(1, first(x, v))
        force = follow(one, x, v, 1e-3)
    assert np.max(np.abs(force - wanted)) < 1e-9 * np.max(np.abs(wanted))
