"""Numbers that decide what is cut, left out or followed of a recording: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.core.demodulation import demodulate, halves, spectrum, spoilt, steady, tracks, wander
from fourpole.core.demodulation.spectrum import Line
from fourpole.core.demodulation.sums import hann
from fourpole.core.recording import Recording
from fourpole.errors import RecordingError

YES = np.ones(1, dtype=bool)


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except RecordingError:
            return False
        return True

    return decided


def cycles(count):
    recording, track = (
        SimpleNamespace(duration=count / 10.0, label="a"),
        SimpleNamespace(rate=1e3, names=("motion_in",)),
    )
    demodulate._check_length(recording, [track], 10.0, given=True)


def first_line(apart):
    """The first guess [Hz] near 10 Hz, by the distance of the weaker one of two lines."""
    recording = SimpleNamespace(channels={"motion_in": SimpleNamespace(quantity="velocity")})
    lines = [Line(20.0, 20.0, 1.0), Line(10 * (1 + apart), 10 * (1 + apart), 0.5)]
    with patch.object(demodulate, "strongest_lines", lambda *given, **how: lines):
        return demodulate._strongest(recording, SimpleNamespace(rate=1e3, spectrum=None, time=np.zeros(9)), 10.0)


def harmonic(number, size=0.01):
    """Distortion of V1, with a harmonic of its displacement of 1 %, and the number of harmonics that are kept."""
    at = 2 * np.pi * 10.0 * np.arange(2000) / 1000.0
    wave = np.cos(at) + size * number * np.cos(number * at)
    made = demodulate.demodulate(Recording.from_arrays(at / (20 * np.pi), force_in=np.cos(at), motion_in=wave))
    return round(float(made.distortion[1]), 6), made.harmonics.clear.size


def terms(*lines, fitted=()):
    """Number of lines that are fitted of those shown [Hz], beside others and an excitation of 7 Hz; 1/T is 1 Hz."""
    fit = SimpleNamespace(
        unsteady=(), omega=14 * np.pi, resolution=1.0, harmonics=1, lines=2 * np.pi * np.array(fitted)
    )
    fit.track = SimpleNamespace(exact_rate=1e4)
    return demodulate._new_terms(fit, np.array(lines))[0].size


def weak(share):
    """Number of the lines of two sines, the second with this share of the first."""
    at = 2 * np.pi * np.arange(2000) / 200.0
    bins = np.fft.rfft((np.cos(10 * at) + share * np.cos(30 * at)) * hann(at.size))
    return len(spectrum.strongest_lines(bins, 200.0 / at.size, order=0))


def shown(power):
    """Number of lines in a spectrum of this power over its noise in one bin."""
    bins = np.full((1, 640), np.log(2.0))
    bins[0, 100] = power
    with patch.object(spectrum, "_power", lambda spectrum: bins):
        return spectrum.find_lines(np.zeros((1, 1278)), 1.0, np.zeros(1)).size


def white(frequency):
    """Whether the noise beside a frequency [Hz] is taken as white, for bins of 1 Hz."""
    fit = SimpleNamespace(
        resolution=1.0, track=SimpleNamespace(exact_rate=1e4), lines=np.zeros(0), omega=2 * np.pi * frequency
    )
    with patch.multiple(spectrum, _bins=lambda *given: np.ones((1, 1, 99)), _white=lambda *given: None):
        return spectrum.noise_beside([fit])[0] is None


def spiked(spike, amplitude=1.0, noise=0.6745):
    """Number of spikes, by one residual over the usual one."""
    rest = noise * (-1.0) ** np.arange(200)
    rest[50] = spike
    track = SimpleNamespace(recorded=np.ones(200, bool), signals=np.sin(np.arange(200.0))[None], spoilt=None)
    track.exact_rate, track.time = 100.0, np.arange(200) / 100.0
    fit = SimpleNamespace(track=track, residual=rest[None], omega=20.0, coefficients=np.array([[amplitude], [0.0]]))
    return int(spoilt._flags(fit).sum())


def stuck(off=1.0, count=10):
    """Whether a run of so many equal samples is a drop-out, by its departure from the fit over the amplitude."""
    row = np.cumsum(np.full(60, 1e-9))
    row[20 : 20 + count] = row[20]
    return bool(spoilt._stuck(row, np.full(60, off), 1.0).any())


def left_out(share):
    """Whether some samples are left out, by their share."""
    flags, old = np.arange(1000)[None] < 1000 * share, [MagicMock()]
    parts = {"_flags": lambda *given: flags, "_left_out": lambda fit, flag: None, "_confirmed": lambda *given: flags}
    with patch.multiple(spoilt, refine=lambda fits, **how: (fits, 0.0), **parts):
        return spoilt.without_spoilt(old, [YES], free=True) != old


def confirmed(share):
    """Whether spikes are confirmed, by the residual without them over that with them."""
    fits = [SimpleNamespace(residual=np.full((1, 4), size), dof=4) for size in (share, 1.0)]
    with patch.object(spoilt, "_returns", lambda *given: False):
        return bool(spoilt._confirmed(*fits, np.ones((1, 4), bool)).any())


def returning(count, apart=0.0):
    """Whether spikes in so many of 20 cycles return at one phase, every other one this share of a cycle later."""
    track = SimpleNamespace(time=np.arange(2000) / 100.0, course=None)
    flags = np.zeros(2000, bool)
    flags[100 * np.arange(count) + 1 + np.round(100 * apart * (np.arange(count) % 2)).astype(int)] = True
    return spoilt._returns(SimpleNamespace(track=track, omega=2 * np.pi), flags)


def running(*levels, speed=0.0, parts=(20, 10)):
    """The end of the stretches in which the drive runs, of parts with these levels; the last one has another speed."""
    size, off = np.repeat(levels, parts), np.repeat([*[0.0] * (len(parts) - 1), speed], parts)
    found = steady._running(SimpleNamespace(amplitudes={"motion_in": size}), off)
    return found and found[1]


def steadiness(off, scatter=0.0):
    """Whether the first of 16 stretches is steady, and whether it differs much, by its departure."""
    level = 1.0 + scatter * (-1.0) ** np.arange(16)
    level[0] = 1.0 + off
    flags = steady._steady(SimpleNamespace(amplitudes={"motion_in": level}), np.zeros(16), slice(0, 16))
    return [bool(flag[0]) for flag in flags]


def between_rests(level=0.0, moving=7.0):
    """Start of the motion of 1 Hz after a rest of 3 s with this share of its range; None if nothing is cut."""
    time = np.arange(round(100 * (3 + moving))) / 100.0
    motion = np.where(time < 3, level, 1.0) * np.sin(2 * np.pi * time)
    track = SimpleNamespace(signals=motion[None], names=("motion_in",), present=np.ones(time.size, bool), rate=100.0)
    found = steady._between_rests(track, 1.0, (0.0, 3 + moving))
    return found and round(found[0], 6)


def long_enough(count):
    """Whether a steady part of so many cycles is cut out of a recording."""
    parts = {"tracks_of": lambda *given: [None], "envelope": lambda *given: None, "_running": lambda *given: (2, 9)}
    stretches = SimpleNamespace(amplitudes={"motion_in": np.ones(40)}, time=np.arange(40.0), omega=1.0, hop=1.0)
    parts |= {"_bridged": lambda *given: stretches, "_trimmed": lambda *given: (2, 2 + count)}
    with patch.multiple(steady, **parts):
        return steady.steady_part(SimpleNamespace(channels={}, span=(0.0, 40.0), made={}), 1.0) is not None


def samples(count, missing=0, largest=1.0):
    motion = largest * np.sin(np.arange(float(count)))
    motion[:missing] = np.nan
    tracks._signals(SimpleNamespace(channels={"motion_in": SimpleNamespace(samples=motion)}, label="a"), ["motion_in"])


def followed(departure):
    """Number of functions of the speed that are fitted, by its departure from the mean."""
    wave = np.sin(2 * np.pi * 10 * np.arange(4000) / 1000.0)
    recording = Recording.from_arrays(np.arange(4000) / 1000.0, force_in=wave, motion_in=wave)
    track = tracks.tracks_of(recording, ["motion_in"])

    def curve(time, order=0):
        phase = 0.5 * np.pi * order
        rate = 62.8 * departure * 3.0 ** (order - 1) * np.sin(3.0 * time + phase)
        return rate + (62.8 * time, 62.8, 0.0)[order]

    reference = SimpleNamespace(curve=curve, omega=lambda *span: 62.8)
    return len(tracks.following(track, reference, (0.0, 4.0))[0][0].course.follow)


def independent(share):
    """Number of functions that are kept of two, by the share of the second that is independent."""
    first, second = np.sin(np.arange(8) * np.pi / 4), np.cos(np.arange(8) * np.pi / 4)
    return len(tracks._different(np.stack([first, np.sqrt(1 - share**2) * first + share * second]) + 0j))


def wanders(swing):
    """Whether the drive wanders, by the variation of the amplitude over that of the phase."""
    wave = 0.01 * np.sin(2 * np.pi * np.arange(400) / 10)
    return wander._turned((1 + swing * wave) * np.exp(1j * wave))


def varies(energy=1.0, count=40):
    """Whether V1 may wander, by the variance of its amplitude over a quarter of what the residual must lose."""
    amplitude = 1.0 + np.sqrt(0.25 * energy * 0.75) * 0.1 * (-1.0) ** np.arange(count) + 0j
    made = SimpleNamespace(amplitudes={"motion_in": amplitude}, omega=1.0, time=0.0)
    recording = SimpleNamespace(reference=None, made={})
    state = SimpleNamespace(noise_ratio=np.full(3, 0.1), phasors=SimpleNamespace(omega=1.0))
    parts = {"envelope": lambda *given: made, "_motion": lambda *given: None, "_of_all_harmonics": lambda *given: 1.0}
    with patch.multiple(wander, **parts):
        return wander._may_wander(recording, state, 0.5)


def better(left=0.5, other=1.0, change=2.0):
    """Whether a wander is followed, by the residuals of V1 and of another channel over those at one frequency."""
    ratio = SimpleNamespace(noise_ratio=np.array([other, left, 1.0]), phasors=None)
    reference = SimpleNamespace(departure=lambda **how: 1.0)
    parts = {"_may_wander": True, "_own_reference": reference, "demodulate": ratio}
    parts |= {"_change": (change, 0.1), "replace": None}
    with patch.multiple(wander, **{name: lambda *given, value=value, **how: value for name, value in parts.items()}):
        whole = SimpleNamespace(noise_ratio=np.ones(3), lines=np.zeros(0), phasors=None)
        return wander.follow_wander(MagicMock(), whole) is not None


def changed(shift, before=1.0):
    """Whether a ratio of amplitudes changes enough, in its uncertainties, and by the uncertainty before over that."""
    pair = [SimpleNamespace(amplitudes=np.array([1.0, size, 1.0])) for size in (1 + shift * 1e-6, 1.0)]
    stds = iter([before * 1e-6, 1e-6])
    with patch.object(wander, "_relative_std", lambda *given: next(stds)):
        return wander._change(*pair, 1, 0)[0] > 1


def half(condition):
    """Whether a part of a recording has enough of a cycle, by its condition number."""
    fit = SimpleNamespace(track=SimpleNamespace(names=("a",)), coefficients=np.zeros((2, 1)))
    return bool(np.isfinite(halves._amplitudes(fit, np.diag([condition, 1.0])[None], np.ones((1, 2, 1)))[0, 0]))


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "shortest recording, 3 cycles": (taken(cycles), {2.97: False, 3.03: True}),
    "line near a stated frequency, 5 %": (
        lambda x: round(first_line(x), 6), {0.0495: 10.495, 0.0505: 20.0, -0.0495: 9.505, -0.0505: 20.0},
    ),
    "harmonics that are fitted, 10, and kept, 5": (harmonic, {10: (0.01, 5), 11: (0.0, 5)}),
    "lines that are fitted, 12": (lambda count: terms(*np.arange(1, count + 1) * 100.0), {11: 11, 12: 12, 13: 12}),
    "lines apart, 2.5 bins": (lambda x: terms(100 + x, fitted=[100.0]), {2.47: 0, 2.53: 1}),
    "harmonic beside hum, 3.5 bins": (
        lambda x: bool(demodulate._informing(25.0 + x / 2, 2, 1.0, None)[1]), {3.46: False, 3.54: True},
    ),
    "sideband of a drive, 35 % from a harmonic": (
        lambda x: len(demodulate._foreign(np.array([7.0 * (1 + x)]), SimpleNamespace(omega=14 * np.pi, resolution=0.0),
                                          None)),
        {0.347: 0, 0.353: 1},
    ),
    "excitation, 30 % of the strongest line": (weak, {0.297: 1, 0.303: 2}),
    "line, 30 times the noise": (shown, {29.7: 0, 30.3: 1}),
    "bins beside a frequency, 16 within 40 %": (
        lambda x: int(spectrum._ALL_OFFSETS[spectrum._used(np.full(1, x), 1.0, 1e4, np.zeros(0))[0]].max()),
        {10.0: 4, 39.0: 15, 100.0: 16},
    ),
    "noise that is not white, 4 bins": (white, {7.4: True, 7.6: False}),
    "spike, 6 times the usual residual": (spiked, {5.94: 0, 6.06: 1}),
    "spike, 0.1 % of the amplitude": (lambda x: spiked(x, noise=1e-9), {0.99e-3: 0, 1.01e-3: 1}),
    "drop-out, 15 % of the amplitude": (stuck, {0.1485: False, 0.1515: True}),
    "drop-out, 4 samples": (lambda count: stuck(count=count), {3: False, 4: True}),
    "samples that are left out, 20 %": (left_out, {0.198: True, 0.202: False}),
    "residual without spikes, 70 %": (confirmed, {0.693: True, 0.707: False}),
    "spikes that return, half of the cycles": (returning, {9: False, 10: True}),
    "spikes at one phase, an eighth of a cycle": (lambda x: returning(12, x), {0.1: True, 0.2: False}),
    "drive that runs, level within 20 %": (lambda x: running(1.0, x), {0.802: 30, 0.798: 20, 1.198: 30, 1.202: 20}),
    "drive that runs, speed within 3 %": (lambda x: running(1.0, 1.0, speed=x), {0.0297: 30, 0.0303: 20}),
    "drive that runs, 70 % of its stretches at once": (
        lambda n: running(1.0, 0.1, 1.0, parts=(n, 3, 20 - n)), {15: 15, 14: 14, 13: None},
    ),
    "drive that runs, 8 stretches": (lambda n: running(1.0, 0.1, parts=(n, 3)), {7: None, 8: 8}),
    "steady stretch, 0.2 %": (lambda x: steadiness(x)[0], {1.98e-3: True, 2.02e-3: False}),
    "rough stretch, 0.5 %": (lambda x: steadiness(x)[1], {4.95e-3: False, 5.05e-3: True}),
    "steady stretch, 5 standard deviations": (
        lambda x: steadiness(0.01 * x, 0.01), {4.95: [True, False], 5.05: [False, False], 10.1: [False, True]},
    ),
    "transient of a start, 30 % of the stretches": (
        lambda n: steady._cut(np.arange(20) >= n), {5: 6, 6: 0},
    ),
    "rest of the drive, 20 % of the range": (between_rests, {0.198: 4.0, 0.202: None}),
    "motion between rests, 4 cycles": (lambda x: between_rests(moving=x), {4.5: None, 5.0: 4.0}),
    "steady part, 6 cycles": (long_enough, {5: False, 6: True}),
    "samples of a recording, 16": (taken(samples), {15: False, 16: True}),
    "missing samples, 20 %": (taken(lambda n: samples(1000, n)), {198: True, 202: False}),
    "largest sample, 1e30": (taken(lambda x: samples(100, 0, x)), {0.99e30: True, 1.02e30: False}),
    "speed that is followed, 0.01 %, and with its cube, 0.3 %": (
        followed, {0.99e-4: 0, 1.01e-4: 2, 2.97e-3: 2, 3.03e-3: 3},
    ),
    "function of the speed, 30 % independent": (independent, {0.297: 1, 0.303: 2}),
    "drive that wanders, amplitude below half the phase": (wanders, {0.495: True, 0.505: False}),
    "amplitude of V1 that shows a wander, a quarter": (varies, {0.99: False, 1.01: True}),
    "stretches that show a wander, 12": (lambda count: varies(4.0, count), {11: False, 12: True}),
    "wander that is followed, residual of V1 below 90 %": (better, {0.891: True, 0.909: False}),
    "wander that is followed, other residuals within 2 %": (
        lambda x: better(other=x), {1.019: True, 1.021: False},
    ),
    "wander that matters, 3 u": (changed, {2.97: False, 3.03: True}),
    "wander that matters, half of the uncertainty": (lambda x: changed(1.5, x), {1.98: False, 2.02: True}),
    "part of a recording, condition number of 10": (half, {9.9: True, 10.1: False}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
