"""Numbers that decide a check of a campaign, a note or a finding: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import polars as pl
import pytest

from fourpole import quantities as q
from fourpole.campaign.channels import Conversion
from fourpole.campaign.row import Test as Row
from fourpole.campaign.schema import ConditionsFile
from fourpole.core.alone import Alone
from fourpole.core.checks import Check, Code, Verdict
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.phasor import Phasors
from fourpole.core.sources import Kind, Source
from fourpole.errors import RecordingError
from fourpole.io.signals import Signal
from fourpole.study import cache, check, compare, identify, load, reduce, rig_solution, watch, workers
from fourpole.study.agreement import excitations, mixed_amplitudes
from fourpole.study.compare import _joint_checks, copies, noises
from fourpole.study.identify import temperature_note
from fourpole.study.points import Points, StaticStiffness
from fourpole.study.repeated import _apart
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
    return bool(mixed_amplitudes(points_of(sizes, 1e-6), Alone(*alone([10.0, 12.0], deflection=sizes)), ()))


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


def no_arm(share):
    """Verdict on K2 and C of K' below K1, by the share of the trials that are not passive."""
    result = SimpleNamespace(stiffness=[1e5 + 1e4j], k1=[2e5], k2=[np.nan], c=[np.nan])
    interval = SimpleNamespace(non_passive_share=share, quantiles=np.zeros(3))
    group = SimpleNamespace(result=result, intervals={0: [interval] * 2})
    return compare._arm_check(group, 0, MagicMock(spec=StaticStiffness, lack=None)).verdict


def arm(relative):
    """Verdict on K2 and C, by their relative uncertainty."""
    result = SimpleNamespace(stiffness=[2e5 + 1e4j], k1=[1e5], k2=[1e5], c=[1e3])
    result.arm_covariance = [np.diag([(relative * 1e5) ** 2, 0.0])]
    group = SimpleNamespace(result=result, intervals={})
    return compare._arm_check(group, 0, MagicMock(spec=StaticStiffness, lack=None)).verdict


def drawn(relative=0.0, bend=0.0, off=None):
    """Whether K2 and C are drawn: by their uncertainty, their bend, and K' below K1 in its uncertainties."""
    lost = off is not None
    k2 = np.nan if lost else 1e5
    result = SimpleNamespace(
        arm_covariance=(relative * 1e5) ** 2 * np.eye(2)[None], k2=np.array([k2]), c=np.array([np.inf]),
        stiffness_covariance=1e6 * np.eye(2)[None], k1=np.array([1e5]), k1_std=np.zeros(1), frequency=np.ones(1),
        stiffness=np.array([1e5 - 1e3 * (off or 0.0) + 1e4j]),
    )  # fmt: skip
    with patch.object(identify, "largest_bend", lambda *given: np.array([[bend, 0.0]])):
        return bool(identify._skew(result)[0])


def turning(ratio):
    """Whether a reference is taken whose speed is this ratio of the frequency of V1."""
    reference = SimpleNamespace(omega=lambda *span: 2 * np.pi * 10.0 * ratio)
    with patch.multiple(load, Recording=MagicMock(return_value=MagicMock(span=(0, 1))), first_guess=lambda *_: 10.0):
        try:
            return load._checked(reference, MagicMock(), MagicMock()) is reference
        except RecordingError:
            return False


def rated(ratio):
    """Whether a remark says that the times of a file have another rate than the file states."""
    base = load.TimeBase(load.Timing(None, None, "a"))
    base.feed(Signal("x", "N", np.zeros(100), 0.0, 1000.0 * ratio, time=np.arange(100) / 1000.0))
    return bool(base.remark)


def thinned(count, near=1.0, rate=1e6):
    """The factor by which a recording of so many samples is thinned, by its frequency and rate."""
    conversion = Conversion("force", 1.0, 0.0, 0.0, None)
    line = load.ChannelBuilder("x", conversion, None, load.TimeBase(load.Timing(None, near, "a")), count=count)
    line.feed(Signal("x", "N", np.zeros(8), 0.0, rate))
    return line._thin.factor


def plain(off=0.0, force=0.0, cycles=100.0):
    """Whether the first part of a recording of 10 Hz passes without demodulation."""
    stated = {"frequency": 10.0, "preload": 1000.0}
    job = SimpleNamespace(test=SimpleNamespace(value=stated.get, fixed=False), rig=None)
    recording = SimpleNamespace(channels={}, force_peak=force * 1000.0, duration=cycles / (10.0 * (1 + off)))
    with patch.multiple(reduce, first_guess=lambda *given: 10.0 * (1 + off), tracks_of=lambda *given: []):
        return reduce._is_plain(job, recording)


def a_sine(left):
    """Whether a channel is a sine, by its residual over its amplitude."""
    fit = SimpleNamespace(residual=np.full((1, 8), left / 2**0.5), amplitudes=lambda: [np.ones(1)])
    with patch.object(reduce, "fit_sines", lambda *given: fit):
        return reduce._is_sine(MagicMock(), 10.0)


def first_part(near):
    """The lengths [s] of a recording that are looked at first, and demodulated, by its frequency."""
    recording, lengths, seen = SimpleNamespace(channels={"x": MagicMock(samples=np.arange(2.0))}), [], []
    parts = {"loaded": lambda job, path, length: (lengths.append(length), (recording, ()))[1]}
    parts |= {"demodulated_part": lambda job, path, length: seen.append(length), "_is_plain": lambda *given: False}
    parts |= {"unclipped": lambda recording, needed: (recording, ()), "_shown_frequency": lambda *given: 1.0}
    parts |= {"points_of": lambda *given: SimpleNamespace(checks=[()])}
    job = MagicMock()
    job.test.value, job.test.band = lambda name: near, None
    with patch.multiple(reduce, at_hand=MagicMock(), **parts):
        reduce.check_part(job)
    return (*lengths, *seen)


def shows(frequency):
    """The length [s] of the first part that shows a frequency, of a long recording."""
    lengths = [2.0]
    recording = SimpleNamespace(duration=1e9)
    parts = {"loaded": lambda job, path, length: (lengths.append(length), (recording, ()))[1]}
    with patch.multiple(reduce, first_guess=lambda recording: frequency, **parts):
        reduce._shown_frequency(MagicMock(), MagicMock(), recording)
    return lengths[-1]


def shared_value(off=0.0, **fields):
    """A joint solution with the moving mass alone, which was found off its statement by so many uncertainties."""
    mass = SharedParameter(Source(Kind.RIG_VALUE, "moving_mass"), "kg", 0, 15.0, 1.0)
    stated = SimpleNamespace(std=np.ones(1), parameters=(mass,))
    return SimpleNamespace(
        stated=stated, found=np.array([15.0 + off]), found_std=np.array([0.1]), problem=SimpleNamespace(shared=stated),
        misfit=SimpleNamespace(fits=True, conflicts=()), **fields,
    )  # fmt: skip


def found_remark(ratio):
    """Whether a value that was found rests in part on its statement, by its uncertainty over the stated one."""
    nothing = (None,) * 2
    value = SharedValue(Source(Kind.GAIN, "F1"), "1", 1.0, 0.01, 1.0, 0.01, ratio, *nothing, RigFinding.FOUND)
    return "in part" in value.remark


def many(hidden=(), *shares):
    """What K' rests on, of some shares of its variance and some hidden components."""
    sources = {Source(Kind.ADDED_MASS, str(at)): share for at, share in enumerate(shares)}
    hidden = [SimpleNamespace(brief="none") for _ in range(hidden)]
    with patch.multiple(rig_solution, _shares=lambda *given: sources, _in_words=lambda source: "x"):
        return rig_solution._rests(None, None, hidden)


def waited(time, what):
    """Whether a file that is unchanged for this time [s] is taken as whole, or as not readable."""
    one = SimpleNamespace(_files={"a": watch._File((1, 1), 0.0)}, _clock=lambda: time)
    return watch.Watch._is_ready(one, "a", (1, 1), time) if what == "whole" else watch.Watch._has_waited(one, "a")


def pool(seconds):
    """Number of worker processes for some work [s], of two that are allowed."""
    with patch.multiple(workers, processors=lambda: 8, _MOST=2, Workers=lambda count: SimpleNamespace(count=count)):
        return getattr(workers.pool_of(None, 100, seconds), "count", 1)


def former(count):
    """Number of former tests with which a test is compared, of so many at its condition."""
    tests = [Row(f"D{at}", at, kind="dynamic", tyre="mount") for at in range(count + 1)]
    table = pl.DataFrame({q.TEST.head: [test.name for test in tests[1:]], q.VERDICT.head: ["ok"] * count})
    return len(watch._alike(SimpleNamespace(tests=tests), tests[0], SimpleNamespace(dynamic=table)))


def hashed(size):
    """Whether two files of one size [byte] are searched for copies."""
    tests = [Row(name, at, kind="dynamic", tyre="mount", file=name) for at, name in enumerate(("a", "b"))]
    paths = {test.name: MagicMock(**{"stat.return_value.st_size": size}) for test in tests}
    with patch.multiple(check, sha256_of=lambda *given, **how: "same", group_of=lambda path, file: ""):
        said = MagicMock(paths=paths, campaign=SimpleNamespace(tests=tests))
        check._Inspection.duplicates(said)
    return said._say.called


def kept(age=1, size=1):
    """Whether a reduced recording of a size [byte] is kept that this many runs have not used."""
    name = f"{0:040x}"
    entries = MagicMock(sizes={name: size}, size=size)
    made = SimpleNamespace(_folder=MagicMock(), _entries=entries, _used={name: 0}, _run=age)
    with patch.object(cache.os, "scandir", lambda folder: []):
        cache.Cache._prune(made)
    return name in made._used


def priors():
    """Standard uncertainties of drift over the run and of the power of the amplitude, of the curves of a campaign."""
    points, rows = points_of([1.0, 1.0], 1e-6), np.arange(2)
    with patch.object(compare, "curves_of", lambda samples: samples.prior):
        return compare._curves(MagicMock(**{"stated.channels.named": lambda role: None}), points,
                               Alone(*alone([10.0, 12.0])), rows)  # fmt: skip


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
    "no passive arm, in 97.5 % of the trials": (no_arm, {0.97: Verdict.WARNING, 0.98: Verdict.REJECTED}),
    "K2 and C that are uncertain, 30 %": (arm, {0.297: "ok", 0.303: "warning"}),
    "drift and power of a curve, 0.2 and 0.03": (lambda at: priors()[at], {2: 0.2, 3: 0.03}),
    "K2 and C that are drawn, uncertain by 10 %": (drawn, {0.099: False, 0.101: True}),
    "K2 and C that are drawn, 0.2 u off": (lambda x: drawn(bend=x), {0.198: False, 0.202: True}),
    "K2 and C that are drawn, 3 u from a passive arm": (lambda x: drawn(off=x), {2.97: True, 3.03: False}),
    "reference that turns as V1, 3 %": (turning, {0.971: True, 0.969: False, 1.029: True, 1.031: False}),
    "rate of a file and of its times, 0.1 %": (rated, {1.0009: False, 1.0011: True, 0.9989: True}),
    "samples that are thinned, above 524 288": (thinned, {524_288: 1, 524_289: 2}),
    "samples of a cycle after thinning, 4": (lambda near: thinned(1 << 30, near, 100.0), {12.4: 2, 12.6: 1}),
    "first part that passes, frequency within 3 %": (lambda x: plain(off=x), {0.0297: True, 0.0303: False}),
    "first part that passes, force below 80 % of the preload": (lambda x: plain(force=x), {0.79: True, 0.81: False}),
    "first part that passes, 4 cycles": (lambda x: plain(cycles=x), {3.96: False, 4.04: True}),
    "first part that passes, residual below 15 %": (a_sine, {0.149: True, 0.151: False}),
    "first part, 2 s or 20 cycles": (first_part, {None: (2.0, 20.0), 1.0: (10.0, 20.0), 40.0: (0.5, 2.0)}),
    "first part that shows a frequency, 4 cycles": (shows, {2.02: 2.0, 1.98: 4.0, 0.51: 8.0}),
    "result that is repeated, 0.1 % of its uncertainty": (
        lambda x: _apart(1e3, 1e3 + x, 1.0, 1e3)[1] <= 1, {0.99e-3: True, 1.01e-3: False},
    ),
    "result that is repeated, 1e-6 of itself": (
        lambda x: _apart(1.0, 1.0 + x, 0.0, 1.0)[1] <= 1, {0.99e-6: True, 1.01e-6: False},
    ),
    "result that is repeated, 1e-9 of the largest": (
        lambda x: _apart(0.0, x, 0.0, 1.0)[1] <= 1, {0.99e-9: True, 1.01e-9: False},
    ),
    "value that rests in part on its statement, half of its u": (found_remark, {0.495: False, 0.505: True}),
    "noise that is noted, 1.2 times that of the recordings": (
        lambda x: list(map(str, RigEstimate("", inflation=x).notes)), {1.19: [], 1.21: ["noise"]},
    ),
    "value that is not determined, 90 % of its u": (
        lambda x: rig_solution._finding(shared_value(), x, conflict=False),
        {0.89: RigFinding.FOUND, 0.91: RigFinding.NOT_DETERMINED},
    ),
    "error that shows, 3 u": (
        lambda x: round(rig_solution._detection_limit(
            shared_value(solution=SimpleNamespace(covariance=np.array([[x]]))), 0), 9),
        {0.5: round(3 * 2**0.5, 9)},
    ),
    "mass that may contain an unstated one, 2 u": (
        lambda x: rig_solution._enlarged_std(shared_value(off=x))[0] > 1, {1.98: False, 2.02: True},
    ),
    "values that are named, three": (lambda count: many(0, *[0.2] * count).count("%"), {2: 2, 3: 3, 4: 3}),
    "components that are named, two": (lambda count: many(count).count("none"), {1: 1, 2: 2, 3: 2}),
    "file that is whole, 2 s": (lambda x: waited(x, "whole"), {1.98: False, 2.02: True}),
    "file that cannot be read, 3.5 s": (lambda x: waited(x, "unreadable"), {3.46: False, 3.54: True}),
    "former tests that are compared, four": (former, {3: 3, 4: 4, 5: 4}),
    "copies that are searched, up to 500 MB": (hashed, {4.99e8: True, 5.01e8: False}),
    "reduced recording that is kept, ten runs": (kept, {9: True, 10: False}),
    "reduced recordings that are kept, 2 GB": (lambda size: kept(size=size), {1.99e9: True, 2.01e9: False}),
    "worker processes, from 3 s on": (pool, {2.97: 1, 3.03: 2}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
