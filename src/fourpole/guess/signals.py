"""What the samples of a recording show: a steady sinusoid or a slow curve, at which frequency, how large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.io.signals import Signal
from fourpole.io.stream import Source, stream

_ENOUGH_ROWS = 1 << 18
_SPECTRUM = 1 << 16
_SLOW = 0.5  # Hz: no rig is excited below, no load is cycled faster
_FEWEST_TURNS = 6.0  # of a recording that knows no time
_STEADY = 0.4  # share of the variance that a sinusoid has
_SUSTAINED = 0.3  # least over largest amplitude of its quarters


@dataclass(frozen=True, eq=False)
class SignalShape(ByValue):
    """What a recording shows.

    Attributes
    ----------
    kind : str
        "static", "dynamic", or empty where it is neither: noise, a blow, silence.
    frequency : float [Hz]
        Of the strongest line; not-a-number where there is none or no time.
    rate : float or None [Hz]
    amplitudes : dict of str to complex
        At that frequency, of all channels, in recorded units.
    ranges : dict of str to (float, float)
        Least and largest value.
    samples : dict of str to array
        Some two thousand samples of each channel, for curves.
    pulses : dict of str to float
        Rising edges per cycle of the channels that are no motion or force.
    """

    kind: str
    frequency: float
    rate: float | None
    amplitudes: dict[str, complex] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    samples: dict[str, FloatArray] = field(default_factory=dict)
    pulses: dict[str, float] = field(default_factory=dict)

    def span(self, name: str) -> float:
        """Largest less least value of a channel, in recorded units; 0 where it has none."""
        low, high = self.ranges.get(name, (0.0, 0.0))
        return high - low


def samples_of(
    path: Path, names: Sequence[str], *, group: str, label: str, clock: str | None = None, unit: str = "s"
) -> dict[str, Signal]:
    """The first samples of the channels of a recording, with times where the file or the column `clock` states them."""
    source = Source(path, tuple(names), label, group, clock=clock, unit=unit, needs="nothing", rows=_ENOUGH_ROWS)
    return dict(zip(names, next(stream(source).chunks), strict=True))


def look(
    signals: Mapping[str, Signal],
    *,
    rate: float | None = None,
    aside: frozenset[str] = frozenset(),
) -> SignalShape:
    """What the samples of some channels show; those `aside` do not say what is excited."""
    lines = {name: _Line.of(signal, rate) for name, signal in signals.items() if np.isfinite(signal.samples).sum() > 1}
    ranges = {name: (float(one.samples.min()), float(one.samples.max())) for name, one in lines.items()}
    thin = {name: one.samples[:: max(1, one.samples.size // 2000)] for name, one in lines.items()}
    shape = SignalShape("", float("nan"), rate, ranges=ranges, samples=thin)
    excited = {name: one for name, one in lines.items() if name not in aside and one.moves}
    if not excited or min(one.samples.size for one in excited.values()) < 16:
        return shape
    return _with_excitation(shape, excited, {name: one for name, one in lines.items() if name in aside})


def _with_excitation(shape: SignalShape, excited: dict[str, _Line], aside: dict[str, _Line]) -> SignalShape:
    """The shape with kind, frequency and amplitudes of the excited channels, and the pulses of those `aside`."""
    best = max(excited.values(), key=lambda one: one.line[1])
    turns, _ = best.line
    frequency = turns * best.rate if best.rate else float("nan")
    per_sample = {name: frequency / one.rate if one.rate else turns for name, one in {**excited, **aside}.items()}
    return replace(
        shape,
        kind=_kind(best),
        frequency=frequency,
        rate=best.rate,
        amplitudes={name: one.amplitude(per_sample[name]) for name, one in excited.items()},
        pulses={name: _edges(one.samples) / (per_sample[name] * one.samples.size) for name, one in aside.items()},
    )


@dataclass(frozen=True)
class _Line:
    """A channel with its own rate, and the strongest line in it: turns per sample, and its share of the variance."""

    samples: FloatArray
    rate: float | None
    start: float
    line: tuple[float, float]

    @classmethod
    def of(cls, signal: Signal, rate: float | None) -> _Line:
        """By the times of the signal itself, else by those of the recording."""
        samples = _filled(signal.samples)
        own = signal.rate or (rate_of(signal.time) if signal.time is not None else None)
        start = float(signal.time[0]) if signal.time is not None else signal.start if signal.rate else 0.0
        return cls(samples, own or rate, start, _line(samples) if samples.size >= 16 else (0.0, 0.0))

    @property
    def moves(self) -> bool:
        """Whether it is more than a constant."""
        return bool(np.ptp(self.samples) > 1e-12 * np.max(np.abs(self.samples)))

    def amplitude(self, turns_per_sample: float) -> complex:
        """Complex amplitude at a frequency, from the zero of the file's time."""
        first = self.start * (self.rate or 0.0)
        return turn(self.samples, turns_per_sample) * np.exp(-2j * np.pi * turns_per_sample * first)


def _kind(best: _Line) -> str:
    """Static, dynamic or empty, by the channel with the strongest line."""
    turns, share = best.line
    slow = turns * best.rate < _SLOW if best.rate else turns * best.samples.size < _FEWEST_TURNS
    if slow:
        return "static"
    return "dynamic" if share >= _STEADY and _lasts(best.samples, turns) else ""


def _edges(column: FloatArray) -> int:
    """How often a channel rises from its lowest to its highest third."""
    low, high = column.min(), column.max()
    state = np.where(column > high - (high - low) / 3, 1, np.where(column < low + (high - low) / 3, -1, 0))
    settled = state[state != 0]
    return int(np.count_nonzero(np.diff(settled) > 0))


def rate_of(time: FloatArray) -> float | None:
    """Samples per second by the median step of a time."""
    step = np.diff(time[np.isfinite(time)])
    middle = float(np.median(step)) if step.size else 0.0
    if not middle > 0:
        return None
    return float(step.size / step.sum()) if abs(step.mean() / middle - 1) < 0.01 else 1.0 / middle


def _filled(column: FloatArray) -> FloatArray:
    """Missing samples bridged."""
    there = np.isfinite(column)
    if there.all():
        return column
    at = np.arange(column.size)
    return np.interp(at, at[there], column[there])


def _line(column: FloatArray) -> tuple[float, float]:
    """The strongest line of a channel, in turns per sample, and its share of the variance."""
    part = _level(column[:_SPECTRUM])
    window = 0.5 - 0.5 * np.cos(2 * np.pi / part.size * np.arange(part.size))
    padded = 4 * part.size
    spectrum = np.abs(np.fft.rfft(part * window, padded))
    spectrum[:3] = 0.0  # half a turn and less is drift
    at = int(np.argmax(spectrum))
    shift = 0.0
    if 0 < at < spectrum.size - 1 and np.all(spectrum[at - 1 : at + 2] > 0):
        left, mid, right = np.log(spectrum[at - 1 : at + 2])
        bend = left - 2 * mid + right
        shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    turns = (at + shift) / padded
    variance = float(np.mean(part**2))
    return turns, 0.5 * abs(turn(part, turns)) ** 2 / variance if variance > 0 else 0.0


def _level(column: FloatArray) -> FloatArray:
    """A channel less its mean."""
    return np.asarray(column - column.mean())


def turn(column: FloatArray, turns_per_sample: float) -> complex:
    """Complex amplitude at a frequency, by least squares with a mean, a drift and two harmonics."""
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
    """Whether the line is as strong in each quarter of the recording."""
    quarters = [part for part in np.array_split(column[:_SPECTRUM], 4) if part.size >= 8]
    sizes = [abs(turn(part, turns_per_sample)) for part in quarters]
    return min(sizes) > _SUSTAINED * max(sizes)
