"""Numbers that decide a check of a campaign, a note or a finding: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.campaign.row import Test as Row
from fourpole.campaign.schema import ConditionsFile
from fourpole.core.alone import Alone
from fourpole.core.checks import Check, Code, Verdict
from fourpole.core.phasor import Phasors
from fourpole.core.sources import Kind, Source
from fourpole.study import rig_solution
from fourpole.study.compare import _amplitudes, _joint_checks, copies, excitations, noises
from fourpole.study.identify import temperature_note
from fourpole.study.points import Points
from fourpole.study.rig_estimate import RigEstimate, RigFinding, SharedValue
from fourpole.study.static import _at_preload


def points_of(amplitude, std, bands=None):
    """Tests of one condition: amplitudes of all channels, and their standard uncertainty (N,) or (N, 6)."""
    amplitude, count = np.asarray(amplitude, dtype=float), len(amplitude)
    std = np.broadcast_to(np.reshape(std, (-1, 1)) if np.ndim(std) < 2 else std, (count, 6))
    phasors = Phasors.from_polar(np.full(count, 10.0), amplitude, amplitude, 0.0, amplitude)
    phasors = replace(phasors, covariance=std[:, :, None] ** 2 * np.eye(6))
    kinds = [(band, "dynamic" if band is None else "random") for band in bands or [None] * count]
    tests = tuple(Row(f"D{at}", at, kind=kind, tyre="mount", band=band) for at, (band, kind) in enumerate(kinds))
    every = (None,) * count
    return Points(tests, phasors, ((),) * count, every, every, None, every, condition=np.zeros(count, dtype=int))


def noisy(times=20.0, share=0.02, count=6):
    """Number of warnings, where V2 of the last test has so many times the usual noise, and this over its amplitude."""
    std = np.full((count, 6), 1e-3)
    std[-1, 4:] *= times
    points = points_of(np.full(count, times * 1e-3 / share), std)
    return sum(check.verdict is Verdict.WARNING for _, check in noises(points, np.ones(count, dtype=bool)))


def alike(apart):
    """Number of tests that look copied, by the difference of two recordings in uncertainties of their noise."""
    return len(list(copies(points_of([1.0, 1.0 + apart * 1e-6], 1e-6), np.ones(2, dtype=bool))))


def alone(frequency, factor=1.0, deflection=1e-3):
    each = np.ones(len(frequency))
    return factor * 2e5 * (1 + 0.2j) * each, 1e-6 * each, deflection * each, np.asarray(frequency), each + 0j


def compared(first, second, bands=(None, (5.0, 90.0))):
    """Verdicts on the excitations of a condition, of the tests of two kinds."""
    columns = [np.concatenate(pair) for pair in zip(first, second, strict=True)]
    kinds = [band for band, part in zip(bands, (first, second), strict=True) for _ in part[1]]
    found = excitations(points_of(columns[2], 1e-6, kinds), Alone(*columns), ())
    return [str(check.verdict) for _, check in found]


def mixed(ratio):
    """Whether a condition mixes deflection amplitudes, by their ratio."""
    sizes = np.array([1e-3, ratio * 1e-3])
    ((_, check),) = _amplitudes(points_of(sizes, 1e-6), Alone(*alone([10.0, 12.0], deflection=sizes)), ())
    return bool(check.values)


def of_joint(scatter=0.0, times=0.0):
    """Codes of the warnings on a single test of a rig that fits, by the scatter of K* and what the noise leaves."""
    left = SimpleNamespace(rig=np.array([2 * times**2]), rig_dof=np.array([2.0]))
    joint = SimpleNamespace(residuals=left, outlier=np.ones(1), two_roots=[False], converged=True)
    checks = _joint_checks(SimpleNamespace(joint=joint, estimate=RigEstimate("", scatter=scatter)), 0)
    return [check.code for check in checks if check.verdict is Verdict.WARNING]


def drift(found):
    """Notes on a rig with a specimen that drifts."""
    value = SharedValue(Source(Kind.DRIFT, "a"), "1", None, None, found, None, None, None, None, RigFinding.UNSTATED)
    return list(map(str, RigEstimate("", (value,)).notes))


def spoilt(count, *, converged):
    """Number of causes of a misfit that the recordings show, where this many of ten are clipped."""
    checks = [[Check(Code.CLIPPING, Verdict.REJECTED)]] * count + [[]] * (10 - count)
    return rig_solution.with_recordings(RigEstimate("", fits=False, converged=converged), checks).tied


def rests(share):
    """What K' rests on, where a value has this share of its variance."""
    with patch.object(rig_solution, "_shares", lambda *given: {Source(Kind.RIG_VALUE, "moving_mass"): share}):
        return rig_solution._rests(None, None, ())


def zero_off(share):
    """Codes of the checks of a static test, by the load before contact over its span."""
    curve = MagicMock(measured="mean", doubts=(), zero_off=share, loss_std=0.0, hysteresis_loss=0.0, times=())
    curve.tangent.return_value = MagicMock(std=1.0, std_with_gains=lambda *_: 1.0, std_by_linearity=lambda *_: 0.0)
    curve.secant.return_value.reason = ""
    campaign = MagicMock()
    campaign.stated.channels.load.gain_std = campaign.stated.channels.deflection.gain_std = 0.01
    return [check.code for check in _at_preload(campaign, Row("S1", 1), curve, "", 1000.0).checks]


THREE, LEVELS = np.array([10.0, 20.0, 40.0]), ((5.0, 90.0), (5.0, 90.0))
#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "noise, ten times the usual": (noisy, {9.9: 0, 10.1: 1}),
    "noise that matters, 0.3 % of the amplitude": (lambda x: noisy(share=x), {2.97e-3: 0, 3.03e-3: 1}),
    "tests of which one can be noisier, 5": (lambda count: noisy(count=count), {4: 0, 5: 1}),
    "copy, 0.1 % of the noise": (alike, {0.99e-3: 2, 1.01e-3: 0}),
    "amplitudes mixed, a factor of 2": (mixed, {1.98: False, 2.02: True}),
    "one level of noise, a factor of 1.25": (
        lambda x: compared(alone(THREE), alone(THREE, 1.0, x * 1e-3), LEVELS), {1.24: [], 1.26: ["ok"]},
    ),
    "lines near a frequency, 6 %": (
        lambda x: compared(alone(THREE), alone(np.outer(np.exp([-x, x]), THREE).ravel())), {0.0594: ["ok"], 0.0606: []},
    ),
    "common frequencies, three": (lambda n: compared(alone(THREE[:n]), alone(THREE[:n])), {2: [], 3: ["ok"]}),
    "linear specimen, 1.5 dB": (
        lambda x: compared(alone(THREE), alone(THREE, 10 ** (x / 20))), {1.49: ["ok"], 1.51: ["warning"]},
    ),
    "scatter of K*, 2 %": (of_joint, {0.0198: [], 0.0202: [Code.SCATTER]}),
    "test that does not agree, 1 % by chance": (lambda x: of_joint(times=x), {2.12: [], 2.17: [Code.AGREEMENT]}),
    "uncertainty from the temperature, 0.01 %": (
        lambda x: len(temperature_note(np.array([x]), ConditionsFile())), {0.99e-4: 0, 1.01e-4: 1},
    ),
    "temperature sensitivity that is assumed, 1 %/K": (
        lambda x: "up to 1 K from" in temperature_note(np.array([x]), ConditionsFile())[0], {0.0094: False, 0.01: True},
    ),
    "drift that is noted, 0.1 %": (drift, {0.99e-3: [], 1.01e-3: ["drift"]}),
    "scatter that is noted, 0.01 %": (
        lambda x: list(map(str, RigEstimate("", scatter=x).notes)), {0.99e-4: [], 1.01e-4: ["scatter"]},
    ),
    "recordings at fault, half of all": (lambda count: spoilt(count, converged=True), {4: 0, 5: 1}),
    "recordings at fault, a fifth without an end": (lambda count: spoilt(count, converged=False), {1: 0, 2: 1}),
    "share of u² that is named, a tenth": (lambda x: bool(rests(x)), {0.099: False, 0.101: True}),
    "zero of the load, 1 % of its span": (zero_off, {0.0099: [], 0.0101: [Code.LOAD_ZERO]}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
