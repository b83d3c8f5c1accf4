"""Numbers that decide whether a rig fits, and what is named as the cause: a case just inside each, one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.core.components import component
from fourpole.core.joint import asking, belts, joint, misfit, reconcile, scatter, specimens
from fourpole.core.joint import unseen as unseen_module
from fourpole.core.joint.asking import Group, tie
from fourpole.core.joint.belts import is_possible
from fourpole.core.joint.conditions import group_conditions
from fourpole.core.joint.misfit import gross_errors, pulls
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.joint.specimens import Misfit
from fourpole.core.joint.unseen import _listed
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source

RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0)


def shared(kind=Kind.GAIN, std=1.0):
    return Shared(RIG, (SharedParameter(Source(kind, "F1"), "1", 0, 0.0, std),), np.zeros(0))


def judged(left=0.5, level=0.0, inflation=1.0, conflicts=(0,)):
    """The misfit where causes leave this share of it, and the other tests an error of Zr of this size."""
    before = Misfit(chi2=1e5 + 10.0, dof=10.0, conflicts=conflicts, inflation=inflation)
    solved = dict.fromkeys(("residuals", "largest_part", "_with_noise", "without_rig"), MagicMock())
    found = {"_whole": lambda state: (1e5 * left + 10.0, 10.0), "_level": lambda *given: level}
    with patch.multiple(reconcile, **solved, **found):
        return reconcile._judged(MagicMock(), before, [[]])


def contradicted(size):
    """Whether a raised gain that was found at this many of its stated uncertainties contradicts the statement."""
    problem = SimpleNamespace(shared=shared(std=10.0))
    state = SimpleNamespace(problem=problem, solution=SimpleNamespace(z=np.array([size / 10.0])))
    return reconcile._raised(state, shared())["conflicts"] == (0,)


def massless(scatter):
    """Whether massless specimens are enough for tests that fit, with K* that scatters from test to test."""
    problem = SimpleNamespace(conditions=SimpleNamespace(count=1))
    with patch.object(joint, "explains_more", lambda *given: False):
        return joint._is_enough((problem, None, np.ones(3), Misfit(scatter=scatter)), {})


def possible(mass):
    """Whether a mass of a specimen is possible, in its standard uncertainties."""
    values = SimpleNamespace(std=np.ones(1), parameters=shared(Kind.BELT_MASS).parameters, found=lambda z: [mass])
    solution = SimpleNamespace(covariance=np.eye(1), z=np.zeros(1))
    return is_possible(SimpleNamespace(shared=values), solution)


def unseen(shift):
    """Number of unseen components, by the shift of TR in its uncertainties."""
    return len(_listed(list(shared().parameters), np.ones(1), np.array([[0.0], [0.0], [shift]]), np.zeros(1, bool)))


def shown_from(derivative):
    """Size from which a component shows, by what of its derivative is left beside all other values."""
    made, values, one = MagicMock(condition=np.zeros(1, int), order=np.zeros(1, int)), MagicMock(), shared().parameters
    values.value, values.by_own, values.by_shared = np.ones((1, 6)), np.zeros((1, 6, 2)), np.zeros((1, 6, 0))
    values.covariance_of = lambda *given: np.eye(6)[None]
    part = SimpleNamespace(impedance_by_shared=np.zeros((1, 1)))
    wide = SimpleNamespace(linearised=lambda *given: [(0, 0, part)])
    parts = {"groups_of": lambda *given: [SimpleNamespace(parameters=one, largest=1e9, is_mode=False)]}
    parts |= {"widened": lambda *given: (wide, np.array([[derivative]]), np.zeros((1, 2, 1)))}
    parts |= {"_by_impedance": lambda *given: np.zeros((1, 1)), "_listed": lambda extra, units, *given: float(units[0])}
    parts |= {"_padded": lambda *given: None}
    with patch.multiple(unseen_module, **parts):
        return unseen_module.unseen(made, values)


def gross(ratio, near=0.9):
    """Form of the gross error of tests whose F1 over Zr V2 are these; |Zr| is this share of its larger part."""
    ratio = np.atleast_1d(ratio)
    omega = np.full(ratio.size, np.sqrt((1 - near) * 12440.0 / 15.0))
    amplitudes = np.stack([ratio * RIG.impedance(omega), np.full(ratio.size, 3.0), np.ones(ratio.size)], axis=1)
    observed = SimpleNamespace(amplitudes=amplitudes, omega=omega, added=lambda masses: 0.0)
    return next((cause.form for cause in gross_errors(observed, shared())), "")


def raised(*gains):
    """Number of groups that are raised, by their gains of evidence."""
    return len(tie([SimpleNamespace(gain=gain) for gain in gains]))


def cost(kind):
    """Evidence that a group of this kind needs besides."""
    return Group("a", (SharedParameter(Source(kind, "F1"), "1", 0, 0.0, 1.0),), 1.0).cost


def as_large(size):
    """Whether a group is possible, by its size over its bound."""
    parts = {"is_negligible": lambda *given: False}
    problem = SimpleNamespace(shared=SimpleNamespace(parameters=shared().parameters, std=np.ones(1)))
    with patch.multiple(asking, **parts):
        return asking._possible(Group("a", shared().parameters, 1.0), problem, np.array([size]))


def largest(of):
    """The largest error of a stated mass of the rig [kg], that of 15 kg, or one of 0.3 kg before the specimen."""
    stated = {"moving_mass": 15.0, "input_mass": 0.3}[of]
    mass = SharedParameter(Source(Kind.RIG_VALUE, of), "kg", 0, stated, 0.1)
    with patch.object(asking, "wholes", return_value={"mass": 15.0, "input": 15.0}):
        return next(asking._stated(None, SimpleNamespace(rig=RIG, parameters=(mass,))))[2]


def contradicts(gives_way, index=1):
    """Whether a frame contradicts the rig, by what it gives way over the preload spring; `support` is 0.3 %."""
    problem = SimpleNamespace(shared=SimpleNamespace(rig=RIG), support=3e-3)
    frame = SharedParameter(Source(Kind.UNSTATED, "frame"), "m/N", index, 0.0, 1.0)
    return not reconcile._is_ordinary(problem, frame, gives_way / RIG.preload_stiffness)


def found_scatter(scatter):
    """The scatter that is tried, over 0.1 %."""
    with patch.multiple(asking, deviations=lambda *given: None, scatter_of=lambda *given: scatter):
        return round(asking._scatter(None, MagicMock(), np.ones(1)), 9)


def followed(left, tests=1):
    """Whether a trial is solved to its end, by what it leaves of an objective of 1000."""
    after = SimpleNamespace(converged=False, objective=left, stiffness=None, z=None, slope=None)
    before = SimpleNamespace(objective=1000.0, stiffness=None, slope=None)
    problem = SimpleNamespace(observed=SimpleNamespace(omega=np.ones(tests)))
    with patch.object(asking, "solve_either", return_value=(problem, after)) as solve:
        asking.followed(problem, before, None)
    return solve.call_count == 2


def outliers(*whole, usual=1.0, pairs=False, tests=40, mass=None):
    """Number of outliers, by the squared residuals of the first tests; that there are too many of them is -1."""
    left = np.append(whole, np.full(tests - len(whole), usual))
    label = np.arange(tests) // 2 if pairs else np.zeros(tests, int)
    label = np.append(np.arange(len(whole)), np.full(tests - len(whole), len(whole))) if not pairs else label
    observed = SimpleNamespace(rigid=np.zeros(tests, bool), mass_at=np.arange(tests) < (mass or 0))
    conditions = SimpleNamespace(label=label, sizes=np.bincount(label))
    state = SimpleNamespace(outlier=np.ones(tests), problem=SimpleNamespace(conditions=conditions, observed=observed))
    flags, many = specimens._outliers(state, SimpleNamespace(whole=left))
    return -1 if many else int(flags.sum())


def bent(share):
    """Whether the worst test is taken out, by what the squared residuals of the others then are of those before."""
    state = SimpleNamespace(outlier=np.ones(3), solution=None, start=None, first=None, problem=None)
    parts = {"replace": lambda one, **changed: SimpleNamespace(**vars(state)), "_weaken": lambda *given: None}
    parts["residuals"] = lambda *given: SimpleNamespace(whole=np.full(3, share))
    with patch.multiple(specimens, **parts):
        return specimens._without_worst(state, SimpleNamespace(whole=np.array([9.0, 1.0, 1.0])))


def unsteady(share):
    """Whether an unsteady drive is tried as the cause of a misfit, by the share of it that this explains."""
    rest, along = np.array([[np.sqrt(1000.0 * share + 1), 0.0]]), np.array([[1.0, 0.0]])
    sides = iter([rest[..., None], along[..., None]])
    left = SimpleNamespace(rig=np.array([1002.0]), rig_dof=np.array([2.0]))
    parts = {"cholesky_qr": lambda *given: (None, None), "projected": lambda *given: next(sides)}
    with patch.multiple(reconcile, **parts), patch.object(reconcile, "_level", return_value=0.0) as level:
        reconcile._unsteady_drive(MagicMock(), left)
    return level.called


def each(residual):
    """Factor of the variance of a test with this squared residual, where the noise is as the recordings give it."""
    left = SimpleNamespace(rig=np.array([residual]), rig_dof=np.array([2.0]))
    return round(float(reconcile._each(left, 1.0)[0]), 6)


def grouped(*frequency, nominal=None):
    """Number of conditions of some frequencies [Hz]."""
    stated = None if nominal is None else np.array(nominal)
    return len(set(group_conditions(np.zeros(len(frequency), int), np.array(frequency), stated).tolist()))


def first_size(_):
    """Size with which an effect of the amplitude begins."""
    problem = SimpleNamespace(observed=SimpleNamespace(deflection=np.ones(1)))
    return round(next(asking._absent(problem, None))[1].std, 6)


def by_median(count):
    """Whether the scatter of K* is that by the median, of so many repeats."""
    conditions = SimpleNamespace(label=np.zeros(count, int), first=0, sizes=np.array([count]))
    noise = scatter.Deviations(np.zeros((count, 2)), np.tile(np.eye(2), (count, 1, 1)))
    parts = {
        "root_of": lambda function: 1.0,
        "scatter_of": lambda *given: 0.0,
        "squares": lambda *given: np.ones(count),
    }
    with patch.multiple(scatter, **parts):
        return scatter.robust_scatter(SimpleNamespace(conditions=conditions), noise) == 1.0


def scattered(share, chi2=6.0):
    """Whether a scatter with this share of the variance by the noise is one, by chi-square of 6 degrees of freedom."""
    noise = scatter.Deviations(np.zeros((3, 2)), np.tile(4.0 * np.eye(2), (3, 1, 1)))
    return scatter._that_matters(2.0 * np.sqrt(share), noise, lambda: chi2, 6.0) > 0


def named(shift=9.0, rise=99.0, second=0.0):
    """Number of the values that neighbouring frequencies contradict, by shift of K*, rise and a second pull."""
    move = np.array([5.0, 5.0 * second])
    lines = MagicMock(root=np.eye(2))
    lines.evidence.side_effect = lambda at, size: rise * float(at @ at > 0)
    lines.step.side_effect = lambda at, size: move - at
    lines.shift.return_value = shift
    rows = [SharedParameter(Source(Kind.GAIN, of), "1", at, 1.0, 0.01) for at, of in enumerate(("V1", "V2"))]
    problem = SimpleNamespace(shared=Shared(RIG, tuple(rows), np.zeros(0)))
    solution = SimpleNamespace(covariance=np.eye(2), z=np.zeros(2))
    with patch.object(misfit._Lines, "of", return_value=lines):
        return len(misfit.contradicted_by_neighbours(problem, solution))


def forms(gain, fits):
    """Forms that explain the tests, the most probable first, by the gain of a belt over massless ones."""
    solution = SimpleNamespace(converged=True, objective=0.0, stiffness=None, z=None)
    massless, belt = (("massless", solution, None, Misfit(fits=fits)), ("belt", solution, None, Misfit()))
    parts = {"explained": [(gain, Misfit(), solution)], "reconcile": belt, "solve_either": (None, solution)}
    parts |= {"robust_scatter": 0.0, "deviations": None, "is_possible": True}
    given = {name: MagicMock(return_value=value) for name, value in parts.items()}
    with patch.multiple(joint, _weight=lambda made, plain: gain if made[0] == "belt" else 0.0, **given):
        return " ".join(made[0] for made in joint._with_masses(None, None, {}, massless, stated=False))


def restored(whole):
    """Whether a weakened test has its weight again, by its squared residual with that weight."""
    state = SimpleNamespace(outlier=np.array([1.0, 100.0, 1.0, 1.0]), problem=None, solution=None)
    left = SimpleNamespace(whole=np.array([1.0, whole / 100, 1.0, 1.0]))
    with patch.multiple(specimens, residuals=lambda *given: left, _weaken=MagicMock()):
        specimens.restore_tests(state)
        return specimens._weaken.called


def searched(left):
    """Number of first masses that are tried of belts and rods, by what they leave for each test."""
    solution = SimpleNamespace(converged=True, objective=9 * left, evidence=0.0)
    parts = {"with_belts": lambda *given, **how: None, "_first": lambda *given: None, "weight_of": lambda *given: 0.0}
    problem = SimpleNamespace(observed=SimpleNamespace(omega=np.ones(9)), shared=SimpleNamespace(rig=RIG))
    with patch.multiple(belts, _searched=MagicMock(return_value=(None, solution)), **parts):
        belts.explained(problem, {}, None)
        return belts._searched.call_count


#: Largest error that is possible, by its kind.
BOUNDS = {
    Kind.GAIN: 0.15, Kind.PHASE: 0.25, Kind.DELAY: 5e-3, Kind.LOW_CUT: 2.0, Kind.SLOPE: 0.01, Kind.MOUNTING_GAIN: 0.15,
    Kind.MOUNTING_PHASE: 0.25, Kind.REMOUNTING_GAIN: 0.15, Kind.REMOUNTING_PHASE: 0.25, Kind.BLOCK: 0.3,
    Kind.ANGLE_BLOCK: 0.3, Kind.DRIFT: 0.3, Kind.ANGLE_DRIFT: 0.3, Kind.STEP: 0.3, Kind.ANGLE_STEP: 0.3,
    Kind.RIG_VALUE: 0.3, Kind.AMPLITUDE: 1.0, Kind.GAIN_DRIFT: 0.15, Kind.GAIN_STEP: 0.15, Kind.CROSSTALK: 0.15,
    Kind.FIXTURE: 0.3, Kind.UNSTATED: 0.3, Kind.SCATTER: 0.03, Kind.BELT_MASS: 0.5, Kind.BELT_SHARE: 3.0,
    Kind.BELT_ANGLE: 0.5, Kind.BELT_EXPONENT: 3.0, Kind.K1_LINEARITY: 0.1,
}  # fmt: skip
#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "contradiction of a statement, 3 u": (contradicted, {2.97: False, 3.03: True, -3.03: True}),
    "causes that leave 1 % of a misfit": (lambda x: judged(x).conflicts, {0.0099: (0,), 0.0101: ()}),
    "model discrepancy of a rig, 0.01 %": (lambda x: judged(level=x).rig_error, {0.99e-4: 0.0, 1.01e-4: 1.01e-4}),
    "noise at most twice that of the recordings": (
        lambda x: judged(0.0, inflation=x, conflicts=()).fits, {1.98: True, 2.02: False},
    ),
    "scatter of massless specimens, 1 %": (massless, {0.0099: True, 0.0101: False}),
    "mass of a specimen below zero, 3 u": (possible, {-2.97: True, -3.03: False}),
    "unseen component that matters, 2 u": (unseen, {1.98: 0, 2.02: 1}),
    "value without a pull, 0.1 % of its variance": (
        lambda x: bool(np.isfinite(pulls(SimpleNamespace(covariance=np.array([[1 - x]]), z=np.ones(1)))[0])),
        {0.99e-3: False, 1.01e-3: True},
    ),
    "gross error of size, 0.25": (lambda x: gross(np.exp(x)), {0.247: "", 0.253: "f1_off"}),
    "gross error of angle, 0.5 rad": (lambda x: gross(np.exp(1j * x)), {0.495: "", 0.505: "f1_off"}),
    "unit that is recognised, 0.15": (
        lambda x: gross(9.80665 * np.exp(x)), {0.148: "f1_n_as_kgf", 0.152: "f1_off"},
    ),
    "sign that is recognised, 0.15 rad": (lambda x: gross(-np.exp(1j * x)), {0.148: "inverted", 0.152: "f1_off"}),
    "tests that agree, 70 %": (
        lambda count: gross([2.0] * count + [1.0] * (20 - count)), {14: "", 15: "f1_off"},
    ),
    "tests close to the resonance, 20 %": (lambda x: gross(2.0, x), {0.198: "", 0.202: "f1_off"}),
    "group that is raised, 5 in evidence": (raised, {4.95: 0, 5.05: 1}),
    "groups that are raised together, 10 in evidence": (lambda x: raised(30.0, 30.0 - x), {9.9: 2, 10.1: 1}),
    "groups that are raised together, almost the best, 2": (lambda x: raised(6.0, 6.0 - x), {1.98: 2, 2.02: 1}),
    "rare errors, 3 and 5 more in evidence": (
        cost, {Kind.GAIN: 0.0, Kind.CROSSTALK: 3.0, Kind.GAIN_DRIFT: 3.0, Kind.GAIN_STEP: 5.0, Kind.STEP: 5.0},
    ),
    "size of a group, twice its bound": (as_large, {1.98: True, 2.02: False, -1.98: True, -2.02: False}),
    "error of a stated value, half of it, or a part that nobody stated": (
        largest, {"moving_mass": 7.5, "input_mass": 4.5},
    ),
    "mode of a frame, 3 times what a support may give way": (contradicts, {0.0089: False, 0.0091: True}),
    "frame without a mode": (lambda x: contradicts(x, 0), {0.001: True}),
    "mode of a frame, 3 more in evidence": (
        lambda index: Group(
            "a", (SharedParameter(Source(Kind.UNSTATED, "frame"), "m/N", index, 0.0, 1.0),), 1.0
        ).cost,
        {0: 0.0, 1: 3.0},
    ),
    "modes of a frame, a tenth apart and up to twice beyond the tests": (
        lambda count: asking._resonances(
            SimpleNamespace(observed=SimpleNamespace(omega=2 * np.pi * np.linspace(5.0, 40.0, count)))
        ).round(6)[[0, -1]].tolist() if count > 1 else 0,
        {1: 0, 20: [2.5, 80.0]},
    ),
    "scatter that is tried, 3 %": (found_scatter, {0.0297: 29.7, 0.0303: 30.0}),
    "trial that is followed, a tenth of the objective": (followed, {99.0: True, 101.0: False}),
    "trial that is followed, 40 for each test": (lambda x: followed(x, 5), {198.0: True, 202.0: False}),
    "outlier, 50 times the usual residual": (outliers, {49.5: 0, 50.5: 1}),
    "outlier, 50 times the median over 1.386": (lambda x: outliers(x, usual=2.772), {99.0: 0, 101.0: 1}),
    "outliers of a pair, half of the larger one": (
        lambda x: outliers(1000.0, x * 1000.0, pairs=True), {0.495: 1, 0.505: 2},
    ),
    "outliers, a tenth of the tests": (lambda n: outliers(*[99.0] * n), {4: 4, 5: -1}),
    "outliers, 35 % of the tests with a mass": (
        lambda n: outliers(*[99.0] * n, tests=100, mass=20), {7: 7, 8: -1},
    ),
    "test that bends the others, a tenth of their residuals": (bent, {0.099: True, 0.101: False}),
    "unsteady drive, 70 % of the misfit": (unsteady, {0.693: False, 0.707: True}),
    "noise of a test, 4 degrees of freedom of the others": (each, {2.0: 1.0, 98.0: 17.0}),
    "unseen component, shown from 4 u on": (shown_from, {1.0: 4.0, 2.0: 2.0}),
    "largest errors that are possible": (lambda kind: component(kind).bound, BOUNDS),
    "belt that nobody states, 0.7, 0.05 and 0.6": (
        lambda kind: component(kind).std, {Kind.BELT_SHARE: 0.7, Kind.BELT_ANGLE: 0.05, Kind.BELT_EXPONENT: 0.6},
    ),
    "size with which a group begins, a thirtieth": (first_size, {"amplitude": 0.033333}),
    "parts of a run, 8": (lambda n: len(set(joint.parts_of_run(np.zeros(n), np.arange(n)).tolist())), {7: 7, 16: 8}),
    "repeats of a median, 6": (by_median, {5: False, 6: True}),
    "K* of neighbours moves by 3 u": (named, {2.97: 0, 3.03: 1}),
    "and the evidence rises by 5": (lambda rise: named(rise=rise), {4.95: 0, 5.05: 1}),
    "as another value that moves by 80 %": (lambda second: named(second=second), {0.79: 1, 0.81: 2}),
    "scatter that matters, 2 % of the variance": (scattered, {0.0196: False, 0.0204: True}),
    "and scatter that is no chance of 0.1 %": (lambda chi2: scattered(0.001, chi2), {22.4: False, 22.5: True}),
    "belt that leaves nothing, 8 for each test": (searched, {7.92: 2, 8.08: 6}),
    "belt beside massless ones that fit, 5 from 5": (
        lambda gain: forms(gain, fits=True),
        {-0.1: "massless", 0.1: "massless belt", 4.9: "massless belt", 5.1: "belt massless", 10.1: "belt"},
    ),
    "belt beside massless ones that do not fit, 5 from 0": (
        lambda gain: forms(gain, fits=False),
        {-5.1: "massless", -0.1: "massless belt", 0.1: "belt massless", 5.1: "belt"},
    ),
    "test that is no longer strange, 50": (restored, {49.0: True, 51.0: False}),
    "frequencies of one condition, 1.05 %": (lambda x: grouped(10.0, 10 * x), {1.0104: 1, 1.0106: 2}),
    "frequencies of one condition, 1.61 % in all": (
        lambda x: grouped(10.0, 10.08, 10 * x), {1.016: 1, 1.0163: 2},
    ),
    "stated frequencies of one condition, 0.05 %": (
        lambda x: grouped(10.0, 10.0, nominal=(10.0, 10 * x)), {1.00049: 1, 1.00051: 2},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases


@pytest.mark.parametrize("root", [1e-9, 3e-4, 0.2, 0.999])
def test_the_root_of_a_falling_function_is_found_to_round_off(root):
    found = [
        scatter.root_of(lambda x: 1.0 / (1e-8 + x**2) - 1.0 / (1e-8 + root**2)),
        scatter.root_of(lambda x: root - x),
        scatter.root_of(lambda x: root**3 - x**3),
    ]
    np.testing.assert_allclose(found, root, rtol=1e-6 if root < 1e-8 else 1e-10)


def test_a_function_without_a_root_in_the_range_gives_its_end():
    assert scatter.root_of(lambda x: np.nan) == 0.0
    assert scatter.root_of(lambda x: -x) == 0.0
    assert scatter.root_of(lambda x: 2.0 - x) == 1.0
