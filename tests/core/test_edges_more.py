"""Numbers that decide which samples, tests and branches are used: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from itertools import pairwise
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest
from tests.core.test_recordingchecks import one_test

from fourpole.core import branches, curves, meancurve, reference, specimenfit
from fourpole.core.condition import AXES, PRELOAD, PRESSURE, axis_of
from fourpole.core.demodulation.demodulate import Harmonics
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.meancurve import Local, Pairs
from fourpole.core.plan import advice, remedies
from fourpole.core.recordingchecks import check_consistency, check_mean_force, check_resonance, excess
from fourpole.core.reference import PulseTrain, Reference
from fourpole.core.rig import Rig
from fourpole.core.specimen import Body, Form, spread_of
from fourpole.core.spectra import averaged, excited, random, sweep
from fourpole.core.spectra.average import Ratios, with_shared_noise
from fourpole.core.spectra.motion import Motion, period_of
from fourpole.errors import FourpoleError

RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0)


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except FourpoleError:
            return False
        return True

    return decided


# --- curves of K* over frequency


def powers(count):
    """Powers of a condition of so many frequencies, in a campaign with a condition of nine."""
    frequency, family = np.r_[np.arange(1.0, count + 1), np.arange(1.0, 10)], np.repeat([0, 1], [count, 9])
    data = SimpleNamespace(frequency=frequency, family=family, specimen=family, prior=np.ones(1))
    return int(curves._Design(data, np.ones(family.size, bool))._powers[0])


def solved(dof):
    """Whether there is a solution with this excess of ten tests over the unknowns."""
    fit = MagicMock(levers=lambda rows: np.full(10, 1 - dof / 10), predicted=lambda rows: np.zeros(10))
    model = SimpleNamespace(fit=lambda *given: fit, noise=np.zeros(10), logs=np.full(10, 0.1 + 0.1j), rows=None)
    return curves._solved(model, np.ones(10, bool)) is not None


def judged(left):
    """Whether a test is judged, of whose departure this share is left in the fit of all."""
    fit = MagicMock(levers=lambda rows: np.array([1 - left]), predicted=lambda rows: np.zeros(1))
    solution = curves._Solution(fit, np.ones(2), 10.0)
    model = SimpleNamespace(logs=np.zeros(1), rows=None, noise=np.zeros(1))
    data = SimpleNamespace(frequency=np.ones(1), family=np.zeros(1, int))
    return bool(curves._judged(data, np.arange(1), None, model, solution, np.ones(1, bool)).judged[0])


def repeated(ratio, second):
    """Whether a test that departs by 0.3 is repeated by a second one, by their frequencies and its departure."""
    data = SimpleNamespace(frequency=np.array([1.0, ratio]), family=np.zeros(2, int))
    return bool(curves._repeated(data, np.array([0.3, second]) + 0j).all())


def good(times):
    """Whether a test is first taken as good, by its departure over the standard deviation of nine others."""
    logs = np.append(np.full(9, 0.11774), 0.1 * times) + 0j
    fit = MagicMock(predicted=lambda rows: np.zeros(10))
    model = SimpleNamespace(fit=lambda *given: fit, logs=logs, rows=None, noise=np.zeros(10))
    return bool(curves._first_good(model, 0)[-1])


def reached(apart, count=3):
    """Whether a test is held against another condition, by its distance from the frequencies of that."""
    frequency = np.append(np.full(count, 10.0), 10.0 * np.exp(apart))
    data = SimpleNamespace(frequency=frequency, family=np.append(np.zeros(count), 1), stiffness=np.ones(count + 1))
    made = SimpleNamespace(samples=data, strange=np.zeros(count + 1, bool), judged=np.ones(count + 1, bool))
    made._design, made._solution = MagicMock(), MagicMock(**{"fit.predicted": lambda row: np.zeros(1)})
    return curves.Curves.distance(made, count, 0) == 0.0


# --- branches and rests of a load-deflection curve


def record(rests=6, held=100, ramp=1, creep=0.0):
    """A record of rests at even levels, with ramps between; in each rest the value swings up and back by this way."""
    swing = np.minimum(np.arange(held), np.arange(held)[::-1]) * (2.0 * creep / held)
    parts = []
    for at in range(rests):
        parts += [at + swing, at + np.arange(1, ramp) / ramp]
    return np.concatenate(parts[:-1])


def stepped(values):
    return branches._rests_of(np.asarray(values, dtype=float)) is not None


def short_rests(share):
    """A staircase of 240 samples, of which all but this share lie in rests of four, too short to count."""
    steps, short = np.zeros(240), round(240 * (1 - share) / 5) * 5
    steps[np.r_[np.arange(0, short, 5), np.linspace(short, 220, 5).astype(int)]] = 1.0
    return np.cumsum(steps)


def held_rank(share):
    """Highest rank of a load with 18 levels, where the two levels of the deflection hold this share of its variance."""
    unit = np.linspace(-1, 1, 9) / np.std(np.linspace(-1, 1, 9))
    deflection = np.repeat([0.0, 1.0], 9) + np.sqrt(0.25 * share / (1 - share)) * np.tile(unit, 2)
    return int(branches.ranks(np.arange(18), deflection, np.arange(18.0)).max())


def turns(*deflection):
    """The branches of a deflection that goes from one of these values to the next."""
    path = [np.linspace(a, b, 40, endpoint=False) for a, b in pairwise(deflection)]
    return branches.split_branches(np.append(np.concatenate(path), deflection[-1]))


def contact(start=0.3, slope=0.0, plateau=0.0):
    """Whether a flat start is excluded: its share of the deflection, its slope and its load over those of the curve."""
    deflection = np.linspace(0.0, 1.0, 10001)
    flat = np.where(deflection > 0, plateau, 0.0) + slope * deflection
    load = np.where(deflection < start, flat, 0.02 + 0.98 * (deflection - start) / (1 - start))
    return not branches.in_contact(deflection, load).all()


# --- load-deflection curves and their tangents


def top(count):
    """Whether a load of 20 points is clipped, by the number of them that have the largest load."""
    place = np.arange(20.0)
    return LoadCurve(place, np.minimum(place, 20.0 - count)).flat_top > 0


def off(count=1, size=1e3):
    """Number of outliers among 100 points, of so many with a residual in standard deviations of the others."""
    residual = np.where(np.arange(100) < count, 1.4826 * size, (-1.0) ** np.arange(100))
    return int(meancurve.off_the_curve(SimpleNamespace(residual=residual), np.zeros(2)).sum())


def part(better=1.0, std=0.1):
    """Half widths of the parts that are tried for a tangent, and the part that is used, by its uncertainty."""
    tried = []

    def in_part(points, middle, reach, load):
        tried.append(round(reach, 9))
        return Local(None, 0.5, 1.0, better * std, middle, reach)

    whole = SimpleNamespace(span=(0.0, 1.0), tangent=lambda place: (1.0, std), stepped=False)
    with patch.object(meancurve, "in_part", in_part):
        best = meancurve.surest(Pairs(np.zeros(1), np.zeros(1), None), whole, 0.5, 1.0)
    return tried, round(best.reach, 9)


def widened(rests):
    """The factor of a variance for the degrees of freedom of so many rests, with one unknown."""
    fit = np.zeros(1), 1.0, 1.0, np.eye(1)
    return round(float(meancurve._covariances_of_rests(fit, rests, 9, 0.0, 0)[0][0, 0]) * (rests - 1), 9)


# --- checks of recordings, and references of the drive


def in_channel(share):
    """Whether a harmonic of F1 is the channel's own, by what V2 shows of it."""
    omega = 60.0
    needed = RIG.impedance(omega * np.arange(1, 4))
    amplitudes = np.array([[needed[0], 0, 1.0], [2.0, 0, 0], [1.0, 0, share / needed[2]]])
    return bool(excess(Harmonics(amplitudes, np.zeros((3, 3)), np.ones(3, bool)), omega, RIG, 0.0)[2])


def gaps(gap):
    reference._check_steady(np.append(np.arange(20.0), 19 + gap), 1)


def pulses(low):
    """Number of pulses of a signal that falls to this level between two of them."""
    train = PulseTrain()
    train.feed(np.array([0.0, 1.0, low, 1.0, 0.0]), 10.0, 0.0)
    return train.times().size


# --- random excitation, sweeps, plans and conditions


def bands(width):
    """Number of bins of the first line, by their width [Hz], from 100 Hz on."""
    edges = averaged._edges(100.0 + width * np.arange(40), width, 2)
    return int(edges[1] - edges[0])


def periods(count):
    """Number of periods in a segment of a record of so many."""
    return averaged._periods(SimpleNamespace(time=np.zeros(round(1000 * count)), rate=1000.0), 1.0, 100.0)


def repeats(share):
    """Whether a motion has a period, of whose power this share repeats."""
    random = np.random.default_rng(1)
    wave = np.tile(random.standard_normal(1000), 20)
    motion = np.sqrt(share) * wave + np.sqrt(1 - share) * random.standard_normal(20000)
    track = SimpleNamespace(names=("motion_in",), signals=motion[None], rate=1000.0)
    return period_of(track, (2.0, 400.0)) is not None


def long_enough(length, band=(10.0, 90.0)):
    """Whether a random recording of a length [s] is taken."""
    track, recording = SimpleNamespace(time=np.zeros(round(1000 * length)), rate=1000.0), SimpleNamespace(label="a")
    made = MagicMock(return_value=SimpleNamespace(driven=True))
    parts = dict.fromkeys(("fine_spectrum", "_check_random", "motion_of"), MagicMock())
    parts |= {"prepared": lambda *given: (track, band), "period_of": lambda *given: None, "segment_amplitudes": made}
    with patch.multiple(random, **parts):
        random.random_amplitudes(recording, band)


def finer(leakage, after=0.0):
    """Number of lengths of segments that are tried, by what leaks with the first one, and with the others."""
    sizes, lengths = iter([leakage, after, after, after]), iter([1.0, 2.0, 4.0, 8.0])
    track = SimpleNamespace(time=np.zeros(100_000), rate=1000.0)
    parts = dict.fromkeys(("fine_spectrum", "_check_random"), MagicMock())
    parts |= {"prepared": lambda *given: (track, (10.0, 90.0)), "period_of": lambda *given: None}
    parts |= {"motion_of": MagicMock(return_value=SimpleNamespace(has_gaps=False))}
    made = MagicMock(side_effect=lambda *given: SimpleNamespace(driven=False, leak=next(sizes), length=next(lengths)))
    with patch.multiple(random, _leakage=lambda one: one.leak, segment_amplitudes=made, **parts):
        random.random_amplitudes(SimpleNamespace(label="a"), (10.0, 90.0))
    return made.call_count


def settling(misfit):
    """Whether the whole record is tried for a motion that repeats, by the misfit of its closure phase."""
    found = SimpleNamespace(misfit=misfit, driven=False)
    parts = {"periodic_amplitudes": lambda *given: found, "fits_whole": lambda *given: True}
    with patch.multiple(sweep, whole_amplitudes=MagicMock(return_value=found), **parts):
        sweep.repeated_amplitudes(None, None, (1.0, 9.0), 1.0)
        return sweep.whole_amplitudes.called


def resolved(length):
    """Whether the spectra of a record of a length [s] resolve a band from 10 Hz."""
    track = SimpleNamespace(time=np.zeros(round(1000 * length)), rate=1000.0, present=np.ones(1, bool))
    return sweep.fits_whole(track, (10.0, 90.0))


def in_common(coherence, averages=10.0):
    """Whether a channel has something in common with others, by its coherence times the averages."""
    count = excited._COHERENT
    excited._check_common(["motion_in"], np.full((3, len(count)), coherence / averages), np.full(3, averages))


def better(values="channels", std=0.0):
    """Number of remedies by better channels, a better rig or better static tests, by the uncertainty that they have."""
    tests = SimpleNamespace(present=(True, False, False), rigid=False, k1=1.0, k1_std=std)
    gain, phase = np.full(3, std * (values == "gain")), np.full(3, np.radians(std) * (values == "phase"))
    rig = SimpleNamespace(blocked=False, moving_mass=15.0, std={"moving_mass": 15.0 * std})
    plan = SimpleNamespace(tests=tests, rig=rig, channels=SimpleNamespace(gain=gain, phase=phase), statics=1)
    makers = {"rig": remedies._better_rig, "K1": remedies.k1_remedies}
    return len(list(makers.get(values, remedies._sensors)(plan, remedies.Effort())))


def longer(cycles):
    """The texts of remedies against noise."""
    tests = SimpleNamespace(noise=np.ones(1), frequency=np.ones(1))
    plan = SimpleNamespace(tests=tests, cycles=cycles, minutes=lambda tests, effort: 1.0)
    return [one.text.split()[0 if "cycles" in one.text else 2] for one in remedies._longer(plan, remedies.Effort())]


def a_rod(gain):
    """Whether a specimen is taken as a rod, by the chi-square that this explains beyond a massless one."""
    left = {Form.MASSLESS: gain, Form.ROD: 0.0, Form.BELT: 0.0}

    def fit(measured, form, share):
        return SimpleNamespace(chi2=left[form], specimen=SimpleNamespace(form=form, mass=0))

    with patch.object(specimenfit, "_fit", fit):
        return specimenfit.fit_specimen(None).specimen.form is Form.ROD


def cheapest(ratio):
    """The cost of the nearest outcome, where a cheaper one has an uncertainty that is larger by this factor."""
    outcomes = [SimpleNamespace(worst=1.0, minutes=9.0), SimpleNamespace(worst=ratio, minutes=1.0)]
    return advice._nearest(outcomes).minutes


#: Two ratios that are known exactly.
EXACT = Ratios(np.ones((1, 2), dtype=complex), np.zeros((1, 4, 4)))
#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "slope, bend and its slope, 3, 5 and 8 frequencies": (powers, {2: 1, 3: 2, 4: 2, 5: 3, 7: 3, 8: 4}),
    "tests beyond the unknowns of a curve, 3": (solved, {2.97: False, 3.03: True}),
    "test that is judged, 0.1 % of its departure": (judged, {0.99e-3: False, 1.01e-3: True}),
    "test that is first good, 4 standard deviations": (good, {3.96: True, 4.04: False}),
    "reach of a curve, 3 %": (reached, {0.0297: True, 0.0303: False, -0.0297: True, -0.0303: False}),
    "frequencies of another curve, 3": (lambda count: reached(0.0, count), {2: False, 3: True}),
    "stepped record, 60 samples": (lambda n: stepped(np.repeat(np.arange(6), 10)[:n]), {59: False, 60: True}),
    "stepped record, half of its way": (lambda x: stepped(record(creep=x)), {0.44: True, 0.47: False}),
    "stepped record, 30 % of its samples": (lambda n: stepped(record(ramp=n)), {50: True, 52: False}),
    "step, four times the median": (lambda x: stepped(record(6, 40, 20, 1 / x)), {3.9: False, 4.1: True}),
    "step, 0.5 % of the span": (lambda n: stepped(record(ramp=n)), {39: True, 41: False}),
    "rests, half of the samples": (lambda x: stepped(short_rests(x)), {0.47: False, 0.53: True}),
    "rests, four levels": (
        lambda n: branches.rests(np.repeat(np.arange(n), 30).astype(float)) is not None, {3: False, 4: True},
    ),
    "way within the rests, 20 %": (
        lambda x: branches._flat(np.array([0, 0, 1, 1]), np.array([0.0, x, 1 + x, 1 + x])),
        {0.198: True, 0.202: False},
    ),
    "levels, 5 % of the span": (
        lambda x: int(branches._levels(np.array([0.0, x]), 1.0).max()), {0.0495: 0, 0.0505: 1},
    ),
    "rests that agree, 1 % of the variance": (held_rank, {0.0099: 1, 0.0101: 17}),
    "turn, 30 % of the range": (lambda x: len(turns(0, 1, 1 - x, 1).ends), {0.29: 1, 0.31: 3}),
    "complete branch, 90 % of the median": (
        lambda x: len(turns(0, 1, 0, 1, 0, x, 0).cycles), {0.89: 2, 0.91: 3},
    ),
    "deflections of a curve, a twentieth of the span": (
        lambda count: branches.levels(np.linspace(0, 1, count)), {19: 19, 20: 20, 30: 20},
    ),
    "rest at an end, 2 % of the span": (
        lambda x: branches._rest(np.array([0.0, 1.0, 1 - x]), 1, 1), {0.0198: 2, 0.0202: 1},
    ),
    "free travel, 5 % of the deflection": (contact, {0.049: False, 0.051: True}),
    "free travel, below 1 % of the load": (lambda x: contact(plateau=x), {0.0099: True, 0.0102: False}),
    "free travel, 2 % of the slope": (lambda x: contact(slope=x), {0.0198: True, 0.0202: False}),
    "points of a curve, 5": (taken(lambda n: LoadCurve(np.arange(float(n)), np.arange(float(n)))), {4: False, 5: True}),
    "load at which a curve starts, 0.5 % of its span": (
        lambda x: LoadCurve(np.linspace(0, 1, 31), np.linspace(0, 1, 31) + x).secant(0.5).reason == "",
        {4.95e-3: True, 5.05e-3: False},
    ),
    "points of the largest load, more than 4": (top, {4: False, 5: True}),
    "outlier, 10 standard deviations": (lambda x: off(size=x), {9.9: 0, 10.1: 1}),
    "outliers, 2 % of the points": (off, {2: 2, 3: 0}),
    "parts of a curve, 60 % and 36 %": (lambda x: part(x)[0], {1.0: [0.3, 0.18]}),
    "part that is used, 60 % of the uncertainty": (lambda x: part(x)[1], {0.594: 0.3, 0.606: 0.0}),
    "curve that is sure, 1e-5": (lambda x: len(part(std=x)[0]), {0.99e-5: 0, 1.01e-5: 2}),
    "points of a part, 15": (lambda n: meancurve._enough(np.linspace(0, 1, n), None), {14: False, 15: True}),
    "deflections of a part, 10": (
        lambda n: meancurve._enough(np.repeat(np.linspace(0, 1, n), 3), None), {9: False, 10: True},
    ),
    "load beyond the curve, 2 % of the span": (
        taken(lambda x: meancurve.deflection_at(SimpleNamespace(span=(0.0, 1.0), value=lambda place: place), x)),
        {-0.0198: True, -0.0202: False, 1.0198: True, 1.0202: False},
    ),
    "degrees of freedom of Student's t, 3": (widened, {2: 3.0, 4: 3.0, 5: 2.0}),
    "F1 and V2 that agree, 20 %": (
        lambda x: check_consistency(one_test(x), RIG, 0.0).verdict,
        {1.198: "ok", 1.202: "warning", 0.802: "ok", 0.798: "warning"},
    ),
    "mean of F1 that is the load, half to twice the preload": (
        lambda x: check_mean_force(x, 1000.0).verdict,
        {495.0: "ok", 505.0: "warning", 1980.0: "warning", 2020.0: "ok"},
    ),
    "mean of F1 that is the preload, 10 %": (
        lambda x: check_mean_force(x, 1000.0).verdict, {1099.0: "ok", 1101.0: "warning", 899.0: "warning"},
    ),
    "rig close to its resonance, 20 and 100 times": (
        lambda x: check_resonance(np.sqrt((1 - 1 / x) * 12440.0 / 15.0) / (2 * np.pi), RIG, 0.0).verdict,
        {19.8: "ok", 20.2: "warning", 99.0: "warning", 101.0: "rejected"},
    ),
    "harmonic of F1 that the rig does not need, half": (in_channel, {0.495: True, 0.505: False}),
    "revolutions of a reference, 4": (
        taken(lambda n: Reference.from_pulses(np.arange(float(n)), pulses=1)), {3: False, 4: True},
    ),
    "revolutions of an encoder, 5": (
        taken(lambda n: Reference.from_angle(np.arange(2000.0), np.arange(2000.0) * 2 * np.pi * n / 1999.0)),
        {4.95: False, 5.05: True},
    ),
    "pulses that are even, 0.5 to 1.5 of the usual gap": (
        taken(gaps), {0.495: False, 0.505: True, 1.495: True, 1.505: False},
    ),
    "pulse, 20 % beyond the middle": (pulses, {0.29: 2, 0.31: 1}),
    "sweep, 8 segments": (lambda x: Motion(0.0, 0.0, x).is_swept, {7.92: True, 8.08: False}),
    "sines, 5 % of the bins": (lambda x: Motion(x, 0.0, 99.0).has_sines, {0.0495: False, 0.0505: True}),
    "sines, a quarter of the power": (lambda x: Motion(0.0, x, 99.0).has_sines, {0.2475: False, 0.2525: True}),
    "bands of bins, 1 % of the frequency and more than 3 bins": (bands, {0.201: 4, 0.249: 4, 0.251: 2}),
    "periods of a record, 9 segments": (periods, {19.9: 2, 20.1: 4}),
    "motion that repeats, 70 % of its power": (repeats, {0.66: False, 0.74: True}),
    "random recording, 66 cycles": (taken(lambda x: long_enough(x / 10.0)), {65.0: False, 67.0: True}),
    "segments that are longer, what leaks 1.5": (finer, {1.48: 1, 1.52: 2}),
    "segments that are longer, 80 % of what leaks": (lambda x: finer(9.0, 9.0 * x), {0.79: 3, 0.81: 2}),
    "first periods that are not alike, 4 times the variance": (settling, {3.96: False, 4.04: True}),
    "sweep, 21 bins in a quarter of the frequency": (resolved, {8.3: False, 8.5: True}),
    "channel with nothing in common, coherence of 2 averages": (taken(in_common), {1.98: False, 2.02: True}),
    "averages that show nothing in common, 3": (taken(lambda n: in_common(0.1, n)), {2.97: True, 3.03: False}),
    "channels that are calibrated to 0.5, 0.2 and 0.1 %": (
        lambda x: better("gain", x), {0.99e-3: 0, 1.01e-3: 1, 1.98e-3: 1, 2.02e-3: 2, 4.95e-3: 2, 5.05e-3: 3},
    ),
    "channels that are calibrated to 0.25, 0.1 and 0.05°": (
        lambda x: better("phase", x), {0.0495: 0, 0.0505: 1, 0.099: 1, 0.101: 2, 0.247: 2, 0.253: 3},
    ),
    "rig that is measured to 0.5 and 0.1 %": (
        lambda x: better("rig", x), {0.99e-3: 0, 1.01e-3: 1, 4.95e-3: 1, 5.05e-3: 2},
    ),
    "K1 that is known to 1, 0.5, 0.2 and 0.1 %": (
        lambda x: better("K1", x),
        {0.99e-3: 0, 1.01e-3: 1, 1.98e-3: 1, 2.02e-3: 2, 4.95e-3: 2, 5.05e-3: 3, 9.9e-3: 3, 1.01e-2: 4},
    ),
    "cycles, 4 and 16 times as many, or 3 tests": (longer, {40.0: ["160", "640", "3"]}),
    "specimen that is a rod, 0.1 % by chance": (a_rod, {13.7: False, 13.9: True}),
    "moving part of a specimen, half of its weight": (lambda x: Body.weighed(x).mass_std, {10.0: 5.0}),
    "moving part of a block, half of its weight": (lambda x: Body.weighed(x, 1.0).mass, {10.0: 5.0}),
    "spread of a mass, known to a quarter of nothing": (
        lambda x: round(Body(1.0, 0.1, spread=x).odds[1] / Body(1.0, 0.1, 1.0).odds[1], 9),
        {0.5: 0.25, 0.98: 0.25, 0.995: 1.0, 0.0: 1.0},
    ),
    "spread of a mass, no nearer to an end than 1 %": (
        lambda x: round(float(spread_of(Body(1.0, 0.1, spread=x).odds[0])), 9), {0.98: 0.98, 0.995: 0.99, 0.004: 0.01},
    ),
    "ratio outside of H1 and H2, 2 u": (
        lambda x: round(float(with_shared_noise(EXACT, *np.full((2, 1, 2), [[[0.3]], [[x]]])).covariance[0, 0, 2]), 9),
        {1.9: 0.0, 2.1: 0.09},
    ),
    "tests of one frequency, 1 %": (lambda x: repeated(x, 0.3), {1.009: True, 1.011: False}),
    "tests that repeat each other, 20 % of their departure": (lambda x: repeated(1.0, x), {0.255: True, 0.245: False}),
    "share of the springs of a tyre, 0.2": (
        lambda x: round(float(np.exp(Body.weighed(x).springs(1e5)[0])), 9), {1.0: 0.2},
    ),
    "share of the springs, known to 3 %": (
        lambda x: round(Body(1.0, x, frequency=np.sqrt(2e5) / (2 * np.pi)).springs(1e5)[1] / 2, 6),
        {0.02: 0.03, 0.04: 0.04},
    ),
    "uncertainties that are equal, 2 %": (cheapest, {1.019: 1.0, 1.021: 9.0}),
    "pressure that is the same, 2 %": (lambda x: PRESSURE.same(1.0, x), {0.981: True, 0.979: False}),
    "preload that is the same, 1 %": (lambda x: PRELOAD.same(1.0, x), {0.991: True, 0.989: False}),
    "temperature that is the same, 5 K": (lambda x: AXES[2].same(20.0, x), {24.9: True, 25.1: False}),
    "further condition that is the same, 1 %": (
        lambda x: axis_of("hardness [ShA]").same(1.0, x), {0.991: True, 0.989: False},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
