"""The shape of the signals of a recording: a steady sinusoid, a slow curve or many frequencies, and its amplitudes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.demodulation.spectrum import peak_place
from fourpole.core.demodulation.sums import hann
from fourpole.core.demodulation.tracks import Track
from fourpole.core.segments import TESTS, Segment, segments, without_dropouts
from fourpole.core.spectra import average, random, sweep
from fourpole.core.spectra.excited import RESOLVED
from fourpole.core.spectra.motion import fine_spectrum, motion_of, segment_of
from fourpole.errors import FourpoleError
from fourpole.io.look import filled, rate_of
from fourpole.io.signals import Signal
from fourpole.io.stream import StreamSource, stream

#: Number of samples that are read of each channel, and of each that is looked through for segments.
ENOUGH_ROWS, ALL_ROWS = 1 << 18, 1 << 21
#: Share of the motion of a random recording or a sweep that must be steady, so that it is cut [1].
_CUT = 0.5
#: Number of samples from which a spectrum is computed.
_SPECTRUM = 1 << 16
#: Frequency [Hz] below which a recording is static: dynamic tests are faster, static loading cycles are slower.
_SLOW = 0.5
#: Frequency [Hz] below which a slow curve has this share of its variance [1]; a sweep or a random motion has less.
_LOW, _MOSTLY = 2.0, 0.9
#: Number of cycles below which a recording without times is static.
_FEWEST_TURNS = 6.0
#: Smallest share of the variance [1] that the sinusoid of a dynamic test has.
_STEADY = 0.4
#: Smallest ratio of the least to the largest amplitude of the quarters of a dynamic test [1].
_SUSTAINED = 0.3
#: Segments of the spectrum that shows the band.
_FINE = 32
#: Least power in the band over the largest [1], and the least over the floor of the spectrum.
_POWER, _FLOOR = 1e-4, 10.0
#: Bins without power that a band may have.
_GAP = 3
#: Fewest cycles of the lowest frequency in a recording of many frequencies.
_CYCLES = 30.0
#: Least ratio of the ends of a band, and margin for the round-off of the sampling rate.
_WIDE, _MARGIN = 1.5, 1.01
#: Least share of the recording in which the power of a sweep lies [1]: an impact has far less.
_LASTING = 0.3


@dataclass(frozen=True, eq=False)
class SignalShape(ByValue):
    """Kind, frequency and amplitudes of a recording, found from its samples.

    Attributes
    ----------
    kind : str
        "static", "dynamic", "random", "sweep", or empty for another recording, such as an impact or a constant.
    frequency : float [Hz]
        Frequency of the strongest spectral line; not-a-number if no channel moves or no time is known.
    rate : float or None [Hz]
        Sample rate of the channel with the strongest line; None if it is not known.
    amplitudes : dict of str to complex
        Complex amplitude at `frequency` of each excited channel, in recorded units.
    ranges : dict of str to (float, float)
        Least and largest value of each channel, in recorded units.
    samples : dict of str to array
        About two thousand samples of each channel, in recorded units; static curves are made from them.
    means : dict of str to float
        Mean of each channel, in recorded units.
    band : (float, float) or None [Hz]
        Lowest and highest frequency of a random recording or a sweep.
    pulses : dict of str to float
        Rising edges per cycle of the excitation, for the channels that record no force or motion.
    """

    kind: str
    frequency: float
    rate: float | None
    amplitudes: dict[str, complex] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    samples: dict[str, FloatArray] = field(default_factory=dict)
    pulses: dict[str, float] = field(default_factory=dict)
    means: dict[str, float] = field(default_factory=dict)
    band: tuple[float, float] | None = None

    def span(self, name: str) -> float:
        """Largest minus least value of a channel, in recorded units; 0 for a channel without values."""
        low, high = self.ranges.get(name, (0.0, 0.0))
        return high - low


def samples_of(
    path: Path,
    names: Sequence[str],
    *,
    group: str,
    label: str,
    clock: str | None = None,
    unit: str = "s",
    rows: int = ENOUGH_ROWS,
) -> dict[str, Signal]:
    """The first samples of some channels, with the times that the file or its column `clock` states."""
    source = StreamSource(path, tuple(names), label, group, clock=clock, unit=unit, needs="nothing", rows=rows)
    return dict(zip(names, next(stream(source).chunks), strict=True))


def parts_of(signal: Signal, rate: float | None) -> list[Segment]:
    """The segments of a signal, in the times of its file [s]; none without a rate."""
    rate, first = rate_of(signal) or rate, _begin(signal)
    known = rate and np.isfinite(signal.samples).sum() > 1
    found = segments(without_dropouts(filled(signal.samples)), rate or 1.0) if known else []
    return [replace(one, start=first + one.start, end=first + one.end) for one in found]


def segments_of(signal: Signal, rate: float | None, *, banded: bool = False) -> list[Segment]:
    """The segments of a signal, if several are tests, and not all of them loops.

    A motion that is random or a sweep as a whole, `banded`, is cut only if most of it is steady.
    """
    found = parts_of(signal, rate)
    steady = [one for one in found if one.kind in ("sine", "loop")]
    lasts, rests = (sum(one.end - one.start for one in some)
                    for some in (steady, [one for one in found if one.kind in ("rest", "hold")]))  # fmt: skip
    if banded and lasts < _CUT * (signal.samples.size / (rate_of(signal) or rate or 1.0) - rests):
        return []
    # One sinusoid may be a part of a random motion; loops alone are a static test.
    tests = sum(one.kind in TESTS for one in found)
    several = len(steady) > 1 if any(one.kind == "sine" for one in steady) else tests > len(steady) > 0
    return found if several else []


def within(signal: Signal, window: tuple[float, float], rate: float | None) -> Signal:
    """The samples of a signal between two times [s]."""
    rate = rate_of(signal) or rate or 1.0
    low, high = (round((end - _begin(signal)) * rate) for end in window)
    time = None if signal.time is None else signal.time[low:high]
    return replace(signal, samples=signal.samples[low:high], start=signal.start + low / rate, time=time)


def _begin(signal: Signal) -> float:
    """Time of the first sample [s]."""
    return float(signal.time[0]) if signal.time is not None else signal.start


def signal_shape(
    signals: Mapping[str, Signal],
    *,
    rate: float | None = None,
    aside: frozenset[str] = frozenset(),
    motions: Mapping[str, int] | None = None,
    widest: bool = False,
) -> SignalShape:
    """The shape of a recording by its samples; channels `aside` do not decide on kind and frequency.

    `motions` are the channels that may show random excitation or a sweep, the likeliest first, each with the number of
    differentiations that make it a velocity. With `widest`, the band is the widest of theirs: a motion behind a
    specimen has a narrower one.
    """
    lines = {name: _Line.of(signal, rate) for name, signal in signals.items() if np.isfinite(signal.samples).sum() > 1}
    shape = SignalShape("", float("nan"), rate)
    for name, samples in ((name, line.samples) for name, line in lines.items()):
        shape.ranges[name] = float(samples.min()), float(samples.max())
        shape.samples[name] = samples[:: max(1, samples.size // 2000)]
        shape.means[name] = float(samples.mean())
    excited = {name: line for name, line in lines.items() if name not in aside and line.moves}
    if min((line.samples.size for line in excited.values()), default=0) < 16:
        return shape
    shape = _with_excitation(shape, excited, {name: line for name, line in lines.items() if name in aside})
    known = [(excited[name], derivative) for name, derivative in (motions or {}).items() if name in excited]
    shapes = [_with_band(shape, *motion) for motion in (known if widest else known[:1])]
    return max(shapes, key=lambda one: one.band[1] / one.band[0] if one.band else 0.0, default=shape)


def _with_band(shape: SignalShape, motion: _Line, derivative: int) -> SignalShape:
    """The shape as that of a random recording or a sweep, if it is one by a motion."""
    slow = shape.kind == "static" and not _is_slow(motion)
    if motion.rate is None or (shape.kind and not slow):
        return shape
    kind, band = excitation_of(motion.samples, motion.rate, derivative) or ("" if slow else shape.kind, None)
    return replace(shape, kind=kind, band=band)


def _is_slow(motion: _Line) -> bool:
    """Whether nearly all of the variance of a motion lies at low frequencies."""
    part = motion.samples - motion.samples.mean()
    power = np.abs(np.fft.rfft(part * hann(part.size))) ** 2
    frequency = np.fft.rfftfreq(part.size, 1.0 / (motion.rate or 1.0))
    return bool(power[frequency < _LOW].sum() >= _MOSTLY * power.sum())


def _with_excitation(shape: SignalShape, excited: dict[str, _Line], aside: dict[str, _Line]) -> SignalShape:
    """The shape with kind, frequency and amplitudes of the excited channels, and the pulses of those `aside`."""
    best = max(excited.values(), key=lambda channel: channel.line[1])
    turns, _ = best.line
    frequency = turns * best.rate if best.rate else float("nan")
    channels = {**excited, **aside}
    per_sample = {name: frequency / line.rate if line.rate else turns for name, line in channels.items()}
    return replace(
        shape,
        kind=_kind(best),
        frequency=frequency,
        rate=best.rate,
        amplitudes={name: line.amplitude(per_sample[name]) for name, line in excited.items()},
        pulses={name: _edges(line.samples) / (per_sample[name] * line.samples.size) for name, line in aside.items()},
    )


@dataclass(frozen=True, eq=False)
class _Line:
    """A channel: rate [Hz], first time [s], and strongest line with its cycles per sample and share of the variance."""

    samples: FloatArray
    rate: float | None
    start: float
    line: tuple[float, float]

    @classmethod
    def of(cls, signal: Signal, rate: float | None) -> _Line:
        """The line of a signal; `rate` [Hz] counts if the signal states neither a rate nor times."""
        samples = filled(signal.samples)
        start = float(signal.time[0]) if signal.time is not None else signal.start if signal.rate else 0.0
        return cls(samples, rate_of(signal) or rate, start, _line(samples) if samples.size >= 16 else (0.0, 0.0))

    @property
    def moves(self) -> bool:
        """Whether the channel is not constant."""
        return bool(np.ptp(self.samples) > 1e-12 * np.max(np.abs(self.samples)))

    def amplitude(self, turns_per_sample: float) -> complex:
        """Complex amplitude in recorded units; its phase is relative to time zero of the file."""
        first = self.start * (self.rate or 0.0)
        return turn(self.samples, turns_per_sample) * np.exp(-2j * np.pi * turns_per_sample * first)


def _kind(best: _Line) -> str:
    """Kind of the recording, "static", "dynamic" or empty, by the channel with the strongest line."""
    turns, share = best.line
    slow = turns * best.rate < _SLOW if best.rate else turns * best.samples.size < _FEWEST_TURNS
    if slow:
        return "static"
    return "dynamic" if share >= _STEADY and _lasts(best.samples, turns) else ""


def _edges(column: FloatArray) -> int:
    """Number of times a channel rises from the lowest to the highest third of its range."""
    low, high = column.min(), column.max()
    state = np.where(column > high - (high - low) / 3, 1, np.where(column < low + (high - low) / 3, -1, 0))
    settled = state[state != 0]
    return int(np.count_nonzero(np.diff(settled) > 0))


def _line(column: FloatArray) -> tuple[float, float]:
    """Frequency of the strongest line of a channel [cycles per sample], and its share of the variance [1]."""
    part = column[:_SPECTRUM] - column[:_SPECTRUM].mean()
    padded = 4 * part.size
    spectrum = np.abs(np.fft.rfft(part * hann(part.size), padded))
    spectrum[:3] = 0.0  # up to half a cycle in the recording is drift
    turns = peak_place(spectrum, int(np.argmax(spectrum))) / padded
    variance = float(np.mean(part**2))
    return turns, 0.5 * abs(turn(part, turns)) ** 2 / variance if variance > 0 else 0.0


def turn(column: FloatArray, turns_per_sample: float) -> complex:
    """Complex amplitude at a frequency, by least squares together with mean, drift and two harmonics."""
    part = column[:_SPECTRUM]
    at = np.arange(part.size)
    angle = 2 * np.pi * turns_per_sample * at
    most = max(1, min(3, int(0.45 / max(turns_per_sample, 1e-12))))
    rows = [np.ones(part.size), at / part.size]
    for harmonic in range(1, most + 1):
        rows += [np.cos(harmonic * angle), np.sin(harmonic * angle)]
    basis = np.stack(rows)
    fit = np.linalg.lstsq(basis @ basis.T, basis @ part, rcond=None)[0]
    return complex(fit[2], -fit[3])


def _lasts(column: FloatArray, turns_per_sample: float) -> bool:
    """Whether the amplitude of the line is similar in all quarters of the recording."""
    quarters = [part for part in np.array_split(column[:_SPECTRUM], 4) if part.size >= 8]
    sizes = [abs(turn(part, turns_per_sample)) for part in quarters]
    return bool(sizes) and min(sizes) > _SUSTAINED * max(sizes)


# ---- random excitation and sweeps


def excitation_of(samples: FloatArray, rate: float, derivative: int = 0) -> tuple[str, tuple[float, float]] | None:
    """Kind of a recording, "random" or "sweep", and its band [Hz]; None if it is neither.

    Parameters
    ----------
    samples : (N,) float array
        A motion or, without one, the force.
    rate : float [Hz]
    derivative : int
        Number of differentiations that turn the samples into a velocity.
    """
    signal = samples - samples.mean()
    track = Track(("motion_in",), signal[None], np.ones(signal.size, bool), np.arange(signal.size) / rate, rate)
    length = signal.size / rate
    try:
        band = _band(track, derivative)
        if band is None or length * band[0] < _CYCLES or band[1] < _WIDE * band[0]:
            return None
        motion = motion_of(track, segment_of(length, band[0]), band, fine_spectrum(track))
    except FourpoleError:
        return None
    if not motion.is_swept:
        band = _resolved(band, random.SHORTEST, length)
        return None if motion.has_sines or band is None else ("random", band)
    parts = np.array([np.mean(part**2) for part in np.array_split(signal, _FINE)])
    lasting = parts.sum() ** 2 / (parts.size * max(float(np.sum(parts**2)), 1e-300))
    band = _resolved(band, sweep.SHORTEST, length)
    return ("sweep", band) if lasting > _LASTING and band is not None else None


def _resolved(band: tuple[float, float], cycles: float, length: float) -> tuple[float, float] | None:
    """The part of a band [Hz] of whose lowest frequency a recording [s] has enough cycles; None if it is too narrow."""
    lowest = _MARGIN * cycles / length
    digits = 1 - int(np.floor(np.log10(lowest)))
    low = max(band[0], float(np.ceil(lowest * 10.0**digits) / 10.0**digits))
    return (low, band[1]) if band[1] > _WIDE * low else None


def _band(track: Track, derivative: int) -> tuple[float, float] | None:
    """The band [Hz] in which the velocity has power; None if it has none."""
    size = int(2 * track.time.size / (_FINE + 1))
    starts = average.starts_of(track.present, size)
    if size < 16 or starts.size < 2:
        return None
    frequency, inside = average.bins_of(size, track.rate, (0.0, track.rate))
    lines = average.lines_of(track.signals, starts, average.hann(size), inside)[0]
    power = np.mean(np.abs(lines) ** 2, axis=0) * frequency ** (2.0 * derivative)
    floor = float(np.quantile(power, 0.1))
    most = float(power.max())
    least = max(_POWER * most, _FLOOR * floor if floor * _FLOOR < 0.1 * most else 0.0)
    held = np.flatnonzero(power > least)
    if held.size == 0:
        return None
    parts = np.split(held, np.flatnonzero(np.diff(held) > _GAP) + 1)
    part = max(parts, key=lambda one: float(power[one].sum() / frequency[one[0]]) if one.size > 2 else 0.0)
    if part.size < 6:
        return None
    # the main lobe of the window widens the band by two bins on either side
    low, high = frequency[part[0] + 2], frequency[part[-1] - 2]
    return float(f"{low:.2g}"), min(float(f"{high:.2g}"), RESOLVED * track.rate)
