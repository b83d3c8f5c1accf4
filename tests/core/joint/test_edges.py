"""Numbers that decide whether a rig fits, and what is named as the cause: a case just inside each, one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.core.joint import joint, reconcile
from fourpole.core.joint.belts import is_possible
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


def gross(ratio, near=0.9):
    """Form of the gross error of tests whose F1 over Zr V2 are these; |Zr| is this share of its larger part."""
    ratio = np.atleast_1d(ratio)
    omega = np.full(ratio.size, np.sqrt((1 - near) * 12440.0 / 15.0))
    amplitudes = np.stack([ratio * RIG.impedance(omega), np.full(ratio.size, 3.0), np.ones(ratio.size)], axis=1)
    observed = SimpleNamespace(amplitudes=amplitudes, omega=omega, added=lambda masses: 0.0)
    return next((cause.form for cause in gross_errors(observed, shared())), "")


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
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
