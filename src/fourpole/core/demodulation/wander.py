"""A drive whose speed wanders: seen in the phase of V1 itself, and followed where it does harm."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.demodulate import Demodulation, demodulate
from fourpole.core.demodulation.envelope import envelope
from fourpole.core.demodulation.sinefit import fit_sines
from fourpole.core.demodulation.tracks import STEADY, tracks_of
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import DERIVATIVES, Recording
from fourpole.core.reference import Reference
from fourpole.errors import RecordingError

__all__ = ["Wander", "follow_wander", "refine_reference"]

_FEWEST_STRETCHES = 12
_DRIFT = 4  # the last rows of a fit: mean and drift
#: What is worth following: a ratio of amplitudes moved by so many of its uncertainties, or these made smaller so much,
#: and less left of every channel than at one frequency: nothing that was found there may have been given up.
_MOVED, _WORSE = 3.0, 2.0
_LESS, _NO_MORE = 0.9, 1.02
#: A drive's amplitude swells by less than this share of what its phase turns.
_SWELLS = 0.5


@dataclass(frozen=True)
class Wander:
    """What a wandering speed does.

    Attributes
    ----------
    speed : float [1]
        Largest departure of the speed from its mean.
    shift : float [1]
        By how much V1/F1 or V2/V1 is wrong if the speed is taken as steady.
    """

    speed: float
    shift: float


def follow_wander(recording: Recording, found: Demodulation) -> tuple[Demodulation, Wander] | None:
    """The recording demodulated along the phase of V1, where its speed wanders so that it matters; else None.

    Parameters
    ----------
    recording : Recording
        Without a reference.
    found : Demodulation
        At one frequency.

    Notes
    -----
    The phase of V1 in stretches of four cycles takes the place of a tacho; what it holds of V1's noise is small against
    that of the amplitudes, for it is smoothed and common to all channels.
    """
    followed = _along_v1(recording, found, _LESS)
    if followed is None:
        return None
    better, peak = followed
    worst = max(
        (_change(found.phasors, better.phasors, over, under) for over, under in ((1, 0), (2, 1))),
        key=lambda change: change.harm,
    )
    return (better, Wander(peak, worst.shift)) if worst.harm > 1 else None


def refine_reference(recording: Recording, found: Demodulation) -> Demodulation:
    """The recording demodulated along the phase of V1 about its reference, where that leaves less; else as found.

    A tacho's pulses jitter, for the time of a sample is known to a sample only; V1 has turned with the drive itself.
    """
    better = _along_v1(recording, found, 1.0)
    return found if better is None else better[0]


def _along_v1(recording: Recording, found: Demodulation, share: float) -> tuple[Demodulation, float] | None:
    """The recording along the phase of V1, where that leaves less, and the largest departure of the speed.

    What a wandering drive has found as lines are sidebands, and what stands beside a steady one is not: so V1's phase
    is tried with the lines found, and without them.
    """
    tries = []
    for lines in dict.fromkeys((False, found.lines.size > 0)):
        reference = _own_reference(recording, found, lines=lines)
        if reference is None or (departure := _departure(reference)) < STEADY:
            continue
        with suppress(RecordingError):
            followed = demodulate(replace(recording, reference=reference))
            if _less(followed, found, share):
                tries.append((followed, departure))
    return min(tries, key=lambda one: float(one[0].noise_ratio[CHANNELS.index("motion_in")]), default=None)


def _departure(reference: Reference) -> float:
    """Largest departure of the speed from its mean [1]."""
    low, high = reference.span
    speed = reference.curve(np.linspace(low, high, 200), 1)
    return float(np.max(np.abs(speed / reference.omega(low, high) - 1.0)))


def _less(followed: Demodulation, found: Demodulation, share: float) -> bool:
    """Whether less of V1 is left, by a share, and no more of any channel."""
    left = followed.noise_ratio / np.maximum(found.noise_ratio, 1e-15)
    return bool(left[CHANNELS.index("motion_in")] <= share and np.nanmax(left) <= _NO_MORE)


def _own_reference(recording: Recording, found: Demodulation, *, lines: bool) -> Reference | None:
    """The phase of V1 as a reference, about the recording's own if it has one; `lines`: taken away first."""
    omega, middle = float(found.phasors.omega), 0.5 * sum(recording.span)
    first = tracks_of(recording, [name for name in CHANNELS if name in recording.channels])[0]
    if lines:
        fit = fit_sines(first.signals, first.present, first.time, omega, 1, 2 * np.pi * np.unique(found.lines))
        foreign = fit.coefficients[2:-_DRIFT].T @ fit.basis[2:-_DRIFT]
        first = replace(first, signals=first.signals - foreign)
    curve = None if recording.reference is None else recording.reference.curve

    def turn(time: FloatArray) -> FloatArray:
        return np.zeros_like(time) if curve is None else curve(time + middle) - omega * time

    seen = envelope([first], omega, turn)
    amplitude = seen.amplitudes["motion_in"]
    there = np.isfinite(amplitude)
    if there.sum() < _FEWEST_STRETCHES:
        return None
    time = seen.time[there]
    power = 1 - DERIVATIVES[recording.channels["motion_in"].quantity]  # a velocity swells with the speed itself
    swell = 1.0 if curve is None else (curve(time + middle, 1) / omega) ** power
    if not _turned(amplitude[there] / swell):
        return None
    phase = omega * time + turn(time) + np.unwrap(np.angle(amplitude[there]))
    if np.any(np.diff(phase) <= 0):
        return None
    marks = np.linspace(phase[0], phase[-1], phase.size)
    return Reference(middle + np.interp(marks, phase, time), marks - marks[0])


def _turned(amplitude: ComplexArray) -> bool:
    """Whether an amplitude turns more than it swells: with a line close by it does both alike."""
    phase = np.unwrap(np.angle(amplitude))
    index = np.arange(float(phase.size))
    turning = phase - np.polynomial.Polynomial.fit(index, phase, 1)(index)
    size = np.abs(amplitude)
    return bool(np.std(size / np.mean(size)) < _SWELLS * np.std(turning))


@dataclass(frozen=True)
class _Change:
    shift: float
    harm: float


def _change(steady: Phasors, followed: Phasors, over: int, under: int) -> _Change:
    """How a ratio of two amplitudes changes by following, and how much harm that is, 1 where it starts to matter."""
    pair = [phasors.amplitudes[over] / phasors.amplitudes[under] for phasors in (steady, followed)]
    if not np.all(np.isfinite(pair)):
        return _Change(0.0, 0.0)
    stds = [_relative_std(phasors, over, under) for phasors in (steady, followed)]
    shift = float(abs(pair[0] / pair[1] - 1))
    least = max(stds[1], 1e-9)
    return _Change(shift, max(shift / (_MOVED * least), stds[0] / (_WORSE * least) if shift > least else 0.0))


def _relative_std(phasors: Phasors, over: int, under: int) -> float:
    """Standard uncertainty of a ratio's modulus from the noise, relative [1]."""
    row = np.zeros((2, 6))
    for index, sign in ((over, 1.0), (under, -1.0)):
        turned = sign / phasors.amplitudes[index]
        row[:, 2 * index] = turned.real, turned.imag
        row[:, 2 * index + 1] = -turned.imag, turned.real
    return float(np.sqrt(np.trace(row @ phasors.covariance @ row.T) / 2))
