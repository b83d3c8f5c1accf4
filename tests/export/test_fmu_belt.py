"""FMUs with the belt of a tyre in FMPy: both forces by the two-port of the specimen, steps, and saved states."""

from __future__ import annotations

import numpy as np
import pytest
from tests.export.fmus import BELT, INPUTS, MODELS, instance, made, points, states_in, unpacked

from fourpole.core.recursion import LinearSystem, driven
from fourpole.core.specimen import Specimen
from fourpole.export.fmi.variables import variables_of
from fourpole.models.realised import both_ends

fmpy = pytest.importorskip("fmpy", reason="FMPy needs a later numpy than the lowest version allowed")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

POINTS = points(belt=BELT)
NAMES = [one.name for one in variables_of(POINTS)]
FORCES = [NAMES.index("contact_force"), NAMES.index("force")]
COUNT = states_in(POINTS)
STATES = [NAMES.index(f"{kind}[{at + 1}]") for kind in ("states", "belt_states") for at in range(COUNT // 2)]
RATES = [NAMES.index(f"der({NAMES[at]})") for at in STATES]
both = pytest.mark.parametrize("version", [2, 3])
each = pytest.mark.parametrize("point", range(1, len(POINTS) + 1))


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The FMU of all models with a belt, and of one without, unpacked, of each version."""
    place = tmp_path_factory.mktemp("belt")
    return {version: unpacked(made(place, version, belt=BELT), place / str(version)) for version in (2, 3)}


def own(point):
    """The system of both ends of an operating point; the first one has no belt."""
    return both_ends(POINTS[point - 1].system.space, BELT if point > 1 else Specimen())


@both
@pytest.mark.sampled(4)
def test_the_description_has_both_forces_and_no_problems(folders, version):
    assert validate_fmu(str(folders[version].parent / f"tyre{version}.fmu")) == []
    description = fmpy.read_model_description(str(folders[version]), validate=True)
    assert [one.name for one in description.modelVariables] == NAMES
    assert description.numberOfContinuousStates == COUNT
    assert [one.variable.name for one in description.outputs] == ["force", "contact_force"]


@each
@pytest.mark.sampled(2)
def test_both_forces_are_those_of_the_two_port(folders, point):
    """By the derivatives of forces and states, which are the matrices of the FMU; at rest it weighs as its belt."""
    with instance(folders[2], 2, stepped=False) as one:
        one.start(point)
        one.exchange()
        columns = [one.changes([*FORCES, *RATES], [known], [1.0]) for known in (*INPUTS, *STATES)]
        moved = np.array(one.states(COUNT))
        assert np.all(moved == 0)
        one.set_states(1e-3 * np.arange(COUNT))
        assert one.get(*STATES) == pytest.approx(1e-3 * np.arange(COUNT))
        assert one.derivatives(COUNT) == pytest.approx(np.array(columns)[4:, 2:].T @ (1e-3 * np.arange(COUNT)))
    whole = np.array(columns).T
    d, c, b, a = whole[:2, :4], whole[:2, 4:], whole[2:, :4], whole[2:, 4:]
    used = np.any(a, axis=1)
    a, b, c = a[np.ix_(used, used)], b[used], c[:, used]
    frequency = np.geomspace(0.5, 200.0, 40)
    if point == list(MODELS).index("fractional") + 2:
        frequency = np.geomspace(1.0, 100.0, 40)
    exact = own(point).dynamic_stiffness(2 * np.pi * frequency)
    for f, wanted in zip(frequency, exact, strict=True):
        s = 2j * np.pi * f
        drive = np.array([[1, 0], [s, 0], [0, 1], [0, s]])
        found = c @ np.linalg.solve(s * np.eye(len(a)) - a, b @ drive) + d @ drive
        assert np.diag([1, -1]) @ found == pytest.approx(wanted, rel=1e-6)


@both
@each
def test_steps_are_exact_for_straight_lines_of_both_ends(folders, version, point):
    step, rng = 2e-3, np.random.default_rng(3)
    ends, heights = own(point), rng.normal(0.0, 1e-3, (2, 200))
    inputs, rates = heights - heights[:, :1], np.diff(heights, axis=1) / step
    none = np.zeros((2, 2))
    system = LinearSystem(ends.a, ends.b[:, ::2], ends.b[:, 1::2], ends.c, ends.d[:, ::2], none)
    steady = ends.d[0, 0] + (ends.c[0] @ np.linalg.solve(-ends.a, ends.b[:, 0]) if len(ends.a) else 0.0)
    wanted = driven(system, inputs, step) if len(ends.a) else system.d @ inputs
    wanted = wanted[:, 1:] + steady * (heights[0, 0] - heights[1, 0])
    found, saved = [], None
    with instance(folders[version], version) as one:
        one.start(point, [heights[0, 0], rates[0, 0], heights[1, 0], rates[1, 0]])
        for at in range(rates.shape[1]):
            one.step(at * step, step)
            last = min(at + 1, rates.shape[1] - 1)
            one.put(INPUTS, [heights[0, at + 1], rates[0, last], heights[1, at + 1], rates[1, last]])
            slope = np.array([rates[0, last], rates[1, last]])
            found.append(one.get(*FORCES) - ends.d[:, 1::2] @ slope)
            if at == 50:
                saved = one.it.getFMUState() if version == 3 else one.it.getFMUstate()
        (one.it.setFMUState if version == 3 else one.it.setFMUstate)(saved)
        assert one.get(*FORCES) - ends.d[:, 1::2] @ rates[:, 51] == pytest.approx(found[50], rel=1e-9)
    assert np.max(np.abs(np.array(found).T - wanted)) < 1e-9 * np.max(np.abs(wanted))


def test_with_derivatives_of_the_inputs_the_forces_are_exact_before_the_inputs_of_their_time(folders):
    step = 1e-3
    time = step * np.arange(200)
    ends = np.array(
        [1e-3 * np.sin(90 * time), 0.09 * np.cos(90 * time), 4e-4 * np.sin(300 * time), 0.12 * np.cos(300 * time)]
    )
    early, late = [], []
    with instance(folders[2], 2) as one:
        one.start(2, ends[:, 0])
        for at in range(1, time.size):
            one.slopes(INPUTS, np.diff(ends)[:, at - 1] / step)
            one.step(time[at - 1], step)
            early.append(one.get(*FORCES))
            one.put(INPUTS, ends[:, at])
            late.append(one.get(*FORCES))
    assert np.max(np.abs(np.array(early) - late)) < 1e-9 * np.max(np.abs(late))


def test_a_variable_that_is_not_there_is_refused(folders):
    with instance(folders[2], 2) as one:
        one.start(1)
        for call in (
            lambda: one.get(len(NAMES)), lambda: one.put([FORCES[0]], [1.0]),
            lambda: one.changes([len(NAMES)], [1], [1.0]), lambda: one.changes([FORCES[0]], [len(NAMES)], [1.0]),
        ):  # fmt: skip
            with pytest.raises(FMICallException):
                call()
    with instance(folders[2], 2) as one, pytest.raises(FMICallException):
        one.start(len(POINTS) + 1)
