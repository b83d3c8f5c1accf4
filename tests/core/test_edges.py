"""Numbers that decide what a user sees: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from math import atan, pi
from types import SimpleNamespace

import numpy as np
import pytest
from tests.core.test_curves import campaign
from tests.core.test_recordingchecks import one_test

from fourpole.core.alone import is_plausible, k1_exchanged
from fourpole.core.condition import AMPLITUDE, FREQUENCY
from fourpole.core.curves import curves_of
from fourpole.core.demodulation.demodulate import Harmonics
from fourpole.core.joint.misfit import is_unlikely
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.recordingchecks import check_consistency, check_halves, excess, force_bend, judged_excess
from fourpole.core.rig import Rig
from fourpole.core.spectra.checks import check_closure, check_line, check_shared_noise


def line(relative):
    """Verdict on a line, by the relative uncertainty of V2/V1."""
    phasors = SimpleNamespace(frequency=np.array([10.0]))
    lines = SimpleNamespace(
        relative=np.array([[0.0, relative]]), phasors=phasors, foreign=False, averages=np.ones(1), nonlinear=0.0
    )
    return check_line(lines, 0).verdict


def closure(misfit, count=1000):
    """Verdict on the closure phase of some lines, by its mean square over its variance."""
    lines = SimpleNamespace(misfit=misfit, driven=False, closure=np.zeros((count, 2)), length=1.0, nonlinear=0.0)
    return next(check_closure(lines)).verdict


def shared_noise(error=1.0, statistic=100.0):
    """Verdict on noise in common of V1 and V2, by the error of their cross spectrum and by its chi-square."""
    shared = np.array([np.zeros(4), [0.1, 0.01, statistic, error], np.zeros(4)])
    (check,) = check_shared_noise(SimpleNamespace(driven=False, closure=np.zeros((9, 2)), shared=shared, nonlinear=0.0))
    return check.verdict


def exchanged(unlike, alike, *, same):
    """Whether K1 looks exchanged: (K' - K1)/K'' of both differ by `unlike`, after the exchange by `alike` about 1."""
    k1 = np.array([[0.0, 0.5 * (unlike + alike)]])
    return k1_exchanged(k1[:, ::-1] + [1 - 0.5 * alike, 1 + 0.5 * alike] + 1j, k1, same=same) is not None


def doubts(**sizes):
    """Doubts about a load-deflection curve over 1000 N."""
    usual = {"cycles": 2, "missing": 0.0, "outliers": 0, "flat_top": 0.0, "_shifts": [0.0]}
    curve = SimpleNamespace(measured_loads=(0.0, 1000.0), **usual | sizes)
    return [str(doubt).split()[1] for doubt in LoadCurve.doubts.fget(curve)]


def strange(off):
    """Number of tests off the curve of their condition, by the departure of one of them; the others have none."""
    data = campaign(scatter=1e-6)
    data.stiffness[30] *= np.exp(off)
    return int(curves_of(data).strange.sum())


def halves(changes, std=0.0, speed=0.0):
    """The channel that changed between the halves of a recording, by the changes of gain and phase of all."""
    changes = np.stack([np.real(changes), np.imag(changes)], axis=1)
    phasors = SimpleNamespace(std=np.full(6, std), amplitudes=np.ones(3))
    made = SimpleNamespace(changes=changes, phasors=phasors, speed_change=speed, cycles=100.0)
    return check_halves(made, ("F1", "V1", "V2")).channel


def mistake(ratio):
    """Number of mistakes of which F1 over Zr V2 reminds."""
    check = check_consistency(one_test(ratio), Rig(moving_mass=15.0, preload_stiffness=12440.0), 0.0)
    return len(check.values["looks"])


def bends(*third, std=0.0, hertz=9.428):
    """Whether the third harmonics of F1 and V1, over those of an elastic spring, show a specimen that is not linear."""
    jw = 2j * np.pi * hertz
    amplitudes = np.zeros((3, 3), dtype=complex)
    amplitudes[:, 0], amplitudes[:2, 2] = (1.0, jw, 0.0), np.array(third) * (1.0, 3 * jw)
    noise = np.zeros((3, 3))
    noise[0, 2] = std
    return excess(Harmonics(amplitudes, noise, np.ones(3, dtype=bool)), abs(jw), Rig(blocked=True), 0.0)[0] > 1e-9


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "line, doubtful from 10 %": (line, {0.099: "ok", 0.101: "warning"}),
    "line, lost from 30 %": (line, {0.299: "warning", 0.301: "rejected"}),
    "closure phase, four times its variance": (closure, {3.96: "ok", 4.04: "warning"}),
    "closure phase of one line, 1 % by chance": (lambda x: closure(x, 1), {6.60: "ok", 6.67: "warning"}),
    "shared noise, 0.3 % of a cross spectrum": (shared_noise, {2.97e-3: "ok", 3.03e-3: "warning"}),
    "shared noise, 1 % by chance in three pairs": (lambda x: shared_noise(1.0, x), {11.3: "ok", 11.5: "warning"}),
    "misfit, 0.1 % by chance": (lambda chi2: is_unlikely(chi2, 2.0), {13.7: False, 13.9: True}),
    "K' over K1, 0.8 to 1.5": (
        lambda ratio: is_plausible(complex(ratio, 1e-9), 1.0, 10.0),
        {0.792: False, 0.808: True, 1.485: True, 1.515: False},
    ),
    "K' over K1, its rise from 1 mHz on": (
        lambda share: is_plausible(1 + 0.2j, 1 / (share * 1.5 * (14.0 / 1e-3) ** (2 * atan(0.2) / pi)), 14.0),
        {0.99: True, 1.01: False},
    ),
    "K1 exchanged, two specimens unlike by half": (
        lambda x: exchanged(x, 0.1, same=False), {0.495: False, 0.505: True},
    ),
    "K1 exchanged, alike within 15 % after it": (
        lambda x: exchanged(1.0, x, same=False), {0.149: True, 0.151: False},
    ),
    "K1 exchanged, two states unlike by 0.3": (lambda x: exchanged(x, 0.1, same=True), {0.297: False, 0.303: True}),
    "K1 exchanged, two states alike after it": (lambda x: exchanged(1.0, x, same=True), {0.149: True, 0.151: False}),
    "load that creeps, 1 % of its span": (lambda n: doubts(_shifts=[n]), {9.9: [], -9.9: [], 10.1: ["load"]}),
    "clipped load, over 3 % of the deflection": (lambda x: doubts(flat_top=x), {0.0297: [], 0.0303: ["load"]}),
    "test off its curve by 1 %": (strange, {0.0095: 0, 0.0105: 1}),
    "amplitude that is the same, 5 %": (lambda x: AMPLITUDE.same(1.0, x), {0.951: True, 0.949: False}),
    "frequency that is shown as one, 2 %": (lambda x: FREQUENCY.same(10.0, x), {9.81: True, 9.79: False}),
    "gain that changes, 5 %": (lambda x: halves([x, 0.0, 0.0]), {0.0495: "", 0.0505: "F1"}),
    "phase that changes, 0.03 rad": (lambda x: halves([1j * x, 0.0, 0.0]), {0.0297: "", 0.0303: "F1"}),
    "change beyond the noise, 5 u": (
        lambda x: halves([x * 2 * 2**0.5 * 0.01, 0.0, 0.0], 0.01), {4.95: "", 5.05: "F1"},
    ),
    "change beside a resonance, 30 times that of the speed": (
        lambda x: halves([0.05 + x * 1e-3, 0.0, 0.0], speed=1e-3), {29.5: "", 30.5: "F1"},
    ),
    "channels that agree, 30 % of the change": (lambda x: halves([0.0, 0.1 * x, 0.1]), {0.297: "V2", 0.303: "F1"}),
    "mistake that is recognised, 10 %": (lambda x: mistake(-1 - x), {0.099: 1, 0.101: 0}),
    "harmonics of the specimen, 2 %": (
        lambda x: judged_excess((x, np.nan, False))[0].verdict, {0.0198: "ok", 0.0202: "warning"},
    ),
    "harmonics of the rig, 1 %": (
        lambda x: judged_excess((np.nan, x, False))[0].verdict, {0.0099: "ok", 0.0101: "warning"},
    ),
    "harmonics beyond the noise, 5 u": (lambda x: bends(0.1, 0.0, std=0.1 / x), {4.95: False, 5.05: True}),
    "natural frequency of a specimen, 40 Hz": (lambda x: bends(1.0 + x, 1.0), {0.99: False, 1.01: True}),
    "harmonic of a cubic departure, a third of it": (lambda x: round(force_bend((x, 0.0, True)), 6), {0.01: 0.03}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
