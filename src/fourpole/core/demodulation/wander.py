"""A drive whose speed wanders: the phase of V1 shows it, and the fit follows it if it changes the result."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray, real_matrix
from fourpole.core.demodulation.demodulate import Demodulation, demodulate
from fourpole.core.demodulation.envelope import ENVELOPE, envelope
from fourpole.core.demodulation.sinefit import fit_sines
from fourpole.core.demodulation.terms import DRIFT
from fourpole.core.demodulation.tracks import STEADY, Track, tracks_of
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import DERIVATIVES, Recording
from fourpole.core.reference import Reference
from fourpole.errors import RecordingError

_FEWEST_STRETCHES = 12
#: The speed is followed if a ratio of amplitudes then changes by more than this many standard uncertainties.
_SHIFT = 3.0
#: The speed is also followed if the standard uncertainty of a ratio then falls by this factor.
_STD_FALL = 2.0
#: The speed is followed only if the residual of V1 falls to this share of the residual at one frequency, or less.
_RESIDUAL_FALL = 0.9
#: Share of the energy to be removed that the amplitudes of stretches must show.
_SEEN = 0.25
#: Highest multiple of the excitation that is fitted.
_MULTIPLES = 10
#: The speed is followed only if no channel has a residual above this multiple of that at one frequency.
_RESIDUAL_RISE = 1.02
#: A drive wanders if its relative amplitude varies by less than this share of the variation of its phase [rad].
_AMPLITUDE_OVER_PHASE = 0.5


@dataclass(frozen=True)
class Wander:
    """Size and effect of a wandering speed.

    Attributes
    ----------
    speed : float [1]
        Largest departure of the speed from its mean, relative to the mean.
    shift : float [1]
        Relative error of V1/F1 or V2/V1, the larger one, if the speed is assumed to be steady.
    """

    speed: float
    shift: float


def follow_wander(recording: Recording, steady: Demodulation) -> tuple[Demodulation, Wander] | None:
    """The recording demodulated along the phase of V1, if its speed wanders enough to change the result.

    Parameters
    ----------
    recording : Recording
        A recording without a reference.
    steady : Demodulation
        The demodulation at one frequency.

    Returns
    -------
    (Demodulation, Wander) or None
        The demodulation along the phase of V1, and the wander; None if the speed is steady enough.

    Notes
    -----
    The phase of V1 in stretches of four cycles replaces a tacho. Its noise is small against that of the amplitudes,
    because it is smoothed and common to all channels.
    """
    followed = _along_v1(recording, steady, _RESIDUAL_FALL)
    if followed is None:
        return None
    better, peak = followed
    weight, shift = max(_change(steady.phasors, better.phasors, over, under) for over, under in ((1, 0), (2, 1)))
    return (better, Wander(peak, shift)) if weight > 1 else None


def refine_reference(recording: Recording, by_pulses: Demodulation) -> Demodulation:
    """The demodulation along the phase of V1 about the reference, if its residual is smaller; otherwise `by_pulses`.

    The pulses of a tacho jitter by up to a sampling interval, whereas V1 follows the drive itself.
    """
    better = _along_v1(recording, by_pulses, 1.0)
    return by_pulses if better is None else better[0]


def _along_v1(recording: Recording, steady: Demodulation, share: float) -> tuple[Demodulation, float] | None:
    """The demodulation along the phase of V1 and the largest departure of the speed [1]; None if none is better.

    The lines found beside a wandering drive are its sidebands; beside a steady drive they are interference. Both cases
    are compared: the phase of V1 as it is, and with the lines removed first. If the first is steady, so is the second.
    """
    if not _may_wander(recording, steady, share):
        return None
    tries = []
    for lines in dict.fromkeys((False, steady.lines.size > 0)):
        reference = _own_reference(recording, steady, lines=lines)
        if reference is None:
            continue
        if reference.departure(smooth=False) < STEADY:
            break
        if (departure := reference.departure()) < STEADY:
            continue
        with suppress(RecordingError):
            followed = demodulate(replace(recording, reference=reference))
            if _is_better(followed, steady, share):
                tries.append((followed, departure))
    return min(tries, key=lambda pair: float(pair[0].noise_ratio[CHANNELS.index("motion_in")]), default=None)


def _may_wander(recording: Recording, steady: Demodulation, share: float) -> bool:
    """Whether the amplitude of V1 varies enough for its residual to fall to a share when the variation is followed."""
    if recording.reference is not None:
        return True
    omega = float(steady.phasors.omega)
    over_time = recording.made.get(ENVELOPE) or envelope([_motion(recording)], omega)
    amplitude = over_time.amplitudes["motion_in"] * np.exp(1j * (over_time.omega - omega) * over_time.time)
    there = amplitude[np.isfinite(amplitude)]
    if there.size < _FEWEST_STRETCHES:
        return False
    residual = steady.noise_ratio[CHANNELS.index("motion_in")] * np.abs(np.mean(there))
    return bool(np.var(there) * _of_all_harmonics(recording, steady) > _SEEN * (1.0 - share**2) * residual**2)


def _of_all_harmonics(recording: Recording, steady: Demodulation) -> float:
    """Energy that a small wander moves out of all harmonics of V1, over that of the fundamental, at most [1].

    Harmonic n turns n times as far. A harmonic that a wander has spread out is a part of the residual.
    """
    place, power = CHANNELS.index("motion_in"), 2 - DERIVATIVES[recording.channels["motion_in"].quantity]
    kept = np.abs(steady.harmonics.amplitudes[place])
    displacement = kept / kept[0] / np.arange(1, kept.size + 1)
    rest = max(float(steady.distortion[place] ** 2 - np.sum(displacement[1:] ** 2)), 0.0)
    turned = float(np.sum((displacement * np.arange(1.0, kept.size + 1) ** power) ** 2))
    return turned + _MULTIPLES ** (2 * power) * rest + (_MULTIPLES * float(steady.noise_ratio[place])) ** 2


def _is_better(followed: Demodulation, steady: Demodulation, share: float) -> bool:
    """Whether the residual of V1 falls to the share and that of no channel grows."""
    left = followed.noise_ratio / np.maximum(steady.noise_ratio, 1e-15)
    return bool(left[CHANNELS.index("motion_in")] <= share and np.nanmax(left) <= _RESIDUAL_RISE)


def _motion(recording: Recording) -> Track:
    """V1 at the samples that all channels of its time base have."""
    first = tracks_of(recording, [name for name in CHANNELS if name in recording.channels])[0]
    place = first.names.index("motion_in")
    return replace(first, names=("motion_in",), signals=first.signals[place : place + 1])


def _own_reference(recording: Recording, steady: Demodulation, *, lines: bool) -> Reference | None:
    """The phase of V1 as a reference, about the recording's own reference if it has one.

    If `lines`, the interfering lines found are removed from V1 first. None if V1 shows no wandering drive.
    """
    omega, middle = float(steady.phasors.omega), 0.5 * sum(recording.span)
    motion = _motion(recording)
    if lines:
        fit = fit_sines(motion, omega, 1, 2 * np.pi * np.unique(steady.lines))
        foreign = fit.coefficients.copy()
        foreign[:2] = foreign[-DRIFT:] = 0.0
        motion = replace(motion, signals=motion.signals - fit.rows.model(foreign))
    curve = None if recording.reference is None else recording.reference.curve

    def turn(time: FloatArray) -> FloatArray:
        return np.zeros_like(time) if curve is None else curve(time + middle) - omega * time

    over_time = envelope([motion], omega, None if curve is None else turn)
    amplitude = over_time.amplitudes["motion_in"]
    there = np.isfinite(amplitude)
    if there.sum() < _FEWEST_STRETCHES:
        return None
    time = over_time.time[there]
    # The amplitude of a velocity is proportional to the speed, that of an acceleration to its square.
    power = 1 - DERIVATIVES[recording.channels["motion_in"].quantity]
    swell = 1.0 if curve is None else (curve(time + middle, 1) / omega) ** power
    if not _turned(amplitude[there] / swell):
        return None
    phase = omega * time + turn(time) + np.unwrap(np.angle(amplitude[there]))
    if np.any(np.diff(phase) <= 0):
        return None
    marks = np.linspace(phase[0], phase[-1], phase.size)
    return Reference(middle + np.interp(marks, phase, time), marks - marks[0])


def _turned(amplitude: ComplexArray) -> bool:
    """Whether the phase varies more than the relative amplitude: an interfering line varies both equally."""
    phase = np.unwrap(np.angle(amplitude))
    index = np.arange(phase.size) - 0.5 * (phase.size - 1)
    turning = phase - np.mean(phase) - index * (index @ phase / (index @ index))
    size = np.abs(amplitude)
    return bool(np.std(size / np.mean(size)) < _AMPLITUDE_OVER_PHASE * np.std(turning))


def _change(steady: Phasors, followed: Phasors, over: int, under: int) -> tuple[float, float]:
    """Weight and size [1] of the relative change of a ratio of two amplitudes, given by their indices.

    A change matters if its weight is above 1.
    """
    pair = [phasors.amplitudes[over] / phasors.amplitudes[under] for phasors in (steady, followed)]
    if not np.all(np.isfinite(pair)):
        return 0.0, 0.0
    stds = [_relative_std(phasors, over, under) for phasors in (steady, followed)]
    shift = float(abs(pair[0] / pair[1] - 1))
    least = max(stds[1], 1e-9)
    return max(shift / (_SHIFT * least), stds[0] / (_STD_FALL * least) if shift > least else 0.0), shift


def _relative_std(phasors: Phasors, over: int, under: int) -> float:
    """Relative standard uncertainty of a ratio's modulus from the noise [1]."""
    by = np.zeros((1, 3), dtype=complex)
    by[0, over], by[0, under] = 1.0 / phasors.amplitudes[over], -1.0 / phasors.amplitudes[under]
    turn = real_matrix(by)
    return float(np.sqrt(np.trace(turn @ phasors.covariance @ turn.T) / 2))
