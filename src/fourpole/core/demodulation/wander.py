"""A drive whose speed wanders: seen in the phase of V1 itself, and followed where it does harm."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.demodulation.demodulate import Demodulation, demodulate
from fourpole.core.demodulation.envelope import envelope
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import Recording
from fourpole.core.reference import Reference
from fourpole.errors import RecordingError

__all__ = ["Wander", "follow_wander"]

#: A speed steadier than this, relative, does no harm.
_STEADY = 1e-4
_FEWEST_STRETCHES = 12
#: What is worth following: a ratio of amplitudes moved by so many of its uncertainties, or these made smaller so much.
_MOVED, _WORSE = 3.0, 2.0


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
    names = [name for name in CHANNELS if name in recording.channels]
    reference = _own_reference(recording, names, float(found.phasors.omega))
    if reference is None:
        return None
    low, high = reference.span
    steps = np.linspace(low, high, 200)
    speed = reference.curve(steps, 1)
    peak = float(np.max(np.abs(speed / reference.omega(low, high) - 1.0)))
    if peak < _STEADY:
        return None
    try:
        followed = demodulate(replace(recording, reference=reference))
    except RecordingError:
        return None
    worst = max(
        (_change(found.phasors, followed.phasors, over, under) for over, under in ((1, 0), (2, 1))),
        key=lambda change: change.harm,
    )
    return (followed, Wander(peak, worst.shift)) if worst.harm > 1 else None


def _own_reference(recording: Recording, names: list[str], omega: float) -> Reference | None:
    """The phase of V1 as a reference."""
    tracks = tracks_of(recording, names)
    found = envelope(tracks, omega)
    amplitude = found.amplitudes["motion_in"]
    there = np.isfinite(amplitude)
    if there.sum() < _FEWEST_STRETCHES:
        return None
    middle = 0.5 * sum(recording.span)
    time = found.time[there]
    phase = omega * time + np.unwrap(np.angle(amplitude[there]))
    if np.any(np.diff(phase) <= 0):
        return None
    marks = np.linspace(phase[0], phase[-1], phase.size)
    return Reference(middle + np.interp(marks, phase, time), marks - marks[0])


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
