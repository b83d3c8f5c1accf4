"""Checks of one recording: each function compares a statistic with its limit, which stands beside the function."""

from __future__ import annotations

from math import inf, nan

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Check, Code, Looks, Verdict, judged, reported
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.spectrum import LINE_GAP, off_multiples
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel
from fourpole.core.rig import Rig

#: Relative departure of F1 from Zr V2 above which the calibration of a channel must be wrong.
INCONSISTENT = 0.2


def check_frequency(found: float, stated: float | None) -> Check:
    """Compare the stated frequency with the one found: within 1 % ok, within 5 % a warning, else rejected."""
    off = 0.0 if not stated else abs(found - stated) / stated
    return judged(Code.FREQUENCY, off, 0.01, 0.05, found=found, stated=stated)


def check_lift_off(force_peak: float, preload: float | None, *, fixed: bool = False) -> Check:
    """Compare the peak of the dynamic force, harmonics included, with the preload; above it the tyre lifts off.

    A specimen that is fixed on both sides does not lift off.
    """
    share = 0.0 if preload is None or fixed else force_peak / preload if preload > 0 else np.inf
    return judged(Code.LIFT_OFF, share, 0.9, 1.0, peak=force_peak, preload=preload or 0.0)


def check_clipping(name: str, channel: Channel) -> Check:
    """Check the share of samples at the end of the converter's range, which is stated or found from flat tops."""
    return judged(Code.CLIPPING, clipped_share(channel), 0.0, 0.0, name)


def clipped_share(channel: Channel) -> float:
    """Share of samples [1] at the stated full scale, or in flat tops that no sine of this resolution has."""
    if channel.clipped is not None:
        return channel.clipped
    samples = channel.samples[np.isfinite(channel.samples)]
    if samples.size == 0:
        return 0.0
    if channel.limits is not None:
        low, high = channel.limits
        tolerance = 1e-4 * (high - low)
        at_limit = float(np.mean((samples <= low + tolerance) | (samples >= high - tolerance)))
        if at_limit > 0:
            return at_limit
    return sum(_flat_share(sign * samples) for sign in (1.0, -1.0))


def _flat_share(samples: FloatArray) -> float:
    """Share of samples [1] that equal the largest; 0 unless they are far more than at the top of a sine."""
    top = samples.max()
    at_top = samples == top
    count = int(at_top.sum())
    longest = int(np.max(np.diff(np.flatnonzero(np.concatenate([[True], ~at_top, [True]]))))) - 1
    if count < 6 or longest < 3:
        return 0.0
    below = samples[~at_top]
    if below.size == 0:
        return 0.0
    # A sine is within one step of the converter below its top for the fraction acos(1 - step/amplitude)/pi of a cycle.
    step = float(np.min(np.diff(np.unique(samples))))
    amplitude = 0.5 * float(np.ptp(samples))
    expected = np.arccos(max(1.0 - step / amplitude, -1.0)) / np.pi
    share = count / samples.size
    return share if share > 3.0 * expected + 2.0 / samples.size else 0.0


def check_distortion(found: Demodulation) -> Check:
    """Compare the harmonics of the displacement at the contact with its fundamental; a good cam gives a sine."""
    return judged(Code.DISTORTION, float(found.distortion[1]), 0.2)


def check_noise(found: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Compare the residual of the fit with the fundamental, for each channel."""
    ratios = zip(names, found.noise_ratio.tolist(), strict=True)
    return [judged(Code.RESIDUAL, ratio, 0.3, inf, name) for name, ratio in ratios if np.isfinite(ratio)]


def check_excitation(found: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Compare the standard uncertainty of each amplitude with the amplitude, to find channels that do not move."""
    rows = []
    for i, name in enumerate(names):
        amplitude = abs(complex(found.phasors.amplitudes[i]))
        if np.isfinite(amplitude):
            relative = float(found.phasors.std[2 * i : 2 * i + 2].max()) / amplitude if amplitude > 0 else np.inf
            rows.append(judged(Code.EXCITATION, relative, 0.05, 0.2, name, hertz=float(found.phasors.frequency)))
    return rows


def check_mains(found: Demodulation) -> Check:
    """Compare the frequency with the multiples of 50 and 60 Hz; on a multiple, hum adds to the excitation."""
    frequency = float(found.phasors.frequency)
    apart = min(float(off_multiples(frequency, base)) for base in (50.0, 60.0))
    bins = apart * found.cycles / frequency
    if bins < LINE_GAP:
        return reported(Code.MAINS, Verdict.WARNING, bins, LINE_GAP, hertz=frequency)
    return Check(Code.MAINS, Verdict.OK, bins, LINE_GAP)


def check_gaps(found: Demodulation) -> Check:
    """Check the share of samples that were missing and left out of the fit."""
    return judged(Code.MISSING, found.missing, 0.0, percent=100 * found.missing)


def check_spoilt(found: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Check the share of drop-outs and spikes, which were left out of the fit, for each channel."""
    shares = zip(names, found.spoilt.tolist(), strict=True)
    return [judged(Code.SPOILT, one, 0.0, inf, name, percent=100 * one) for name, one in shares if np.isfinite(one)]


#: Largest change of a channel against the others between the halves, of amplitude [1] and phase [rad]. The error of K*
#: of the whole recording is then up to half of it. K* of rubber that warms in a recording changes by 1 or 2 %.
_CHANGES = np.array([0.05, 0.03])
#: A change must exceed this many standard uncertainties, or the change of the speed times the sharpness of a resonance.
_CHANGE_NOISE, _SHARPNESS = 5.0, 30.0
#: The other channels agree if they change against each other by less than this share of the change.
_AGREE = 0.3


def check_halves(found: Demodulation, names: tuple[str, ...]) -> Check:
    """Compare the channels' changes between the halves: one channel that changes against the others drifts."""
    there = np.flatnonzero(np.isfinite(found.changes[:, 0])).tolist()
    std = 2.0 * found.phasors.std.reshape(3, 2).max(axis=1) / np.abs(found.phasors.amplitudes)
    limits = _CHANGES + _SHARPNESS * abs(found.speed_change)

    def apart(i: int, k: int) -> float:
        """Change of one channel against another, in its limits [1]."""
        least = np.maximum(limits, _CHANGE_NOISE * np.hypot(std[i], std[k]))
        return float(np.max(np.abs(found.changes[i] - found.changes[k]) / least))

    pairs = {(i, k): apart(i, k) for n, i in enumerate(there) for k in there[n + 1 :]}
    worst = max(pairs.values(), default=0.0)
    if not worst > 1.0:
        return Check(Code.HALVES, Verdict.OK, worst, 1.0)
    near = min(pairs, key=lambda pair: pairs[pair])
    odd = [i for i in there if i not in near]
    lone = len(there) == 3 and pairs[near] < _AGREE * worst
    which = odd[0] if lone else there[0]
    others = [i for i in there if i != which]
    gain, phase = (found.changes[which] - np.mean(found.changes[others], axis=0)).tolist()
    change: dict[str, float] = {"gain": gain}
    if abs(phase) / limits[1] > abs(gain) / limits[0]:
        change = {"phase": phase, "ppm": abs(2e6 * phase / (2 * np.pi * found.cycles))}
    specimen = not (lone and names[which] != "V1")
    beside = tuple(names[i] for i in others)
    return reported(
        Code.HALVES, Verdict.WARNING, worst, 1.0, names[which], others=beside, specimen=specimen, **change
    )  # fmt: skip


#: The force channel has the static load if its mean is at least this share of the preload.
_HAS_LOAD = 0.5
#: Largest departure of the mean of F1 from the preload, with the zero of a force cell.
_OFF_LOAD = 0.1


def check_mean_force(mean: float, preload: float | None) -> Check:
    """Compare the mean of F1 with the preload, if the channel has the static load."""
    share = abs(mean / preload) if preload else 0.0
    if not _HAS_LOAD <= share <= 1 / _HAS_LOAD:
        return Check(Code.MEAN_FORCE, Verdict.OK, 0.0, _OFF_LOAD)
    return judged(Code.MEAN_FORCE, abs(share - 1.0), _OFF_LOAD, mean=mean, preload=preload)


def check_resonance(frequency: float, rig: Rig, added_mass: float) -> Check:
    """Compare the rig's own stiffness K3 - m w² with its larger part; where it is small, K* is poorly determined."""
    omega = 2 * np.pi * frequency
    if rig.blocked:
        return Check(Code.RESONANCE, Verdict.OK, 0.0, 20.0)
    impedance = complex(rig.impedance(omega, added_mass))
    spring, inertia = rig.preload_stiffness, omega**2 * (rig.moving_mass + rig.tyre_mass + added_mass)
    left = abs(omega * impedance) / max(spring, inertia)
    closeness = 1.0 / left if left > 0 else np.inf
    return judged(Code.RESONANCE, closeness, 20.0, 100.0, hertz=frequency, spring=spring, inertia=inertia)


#: A ratio within this relative distance of a usual mistake is named as this mistake.
_ALIKE = 0.1
_G = 9.80665
#: Mistakes by the factor of F1 over what V2 and the rig need.
_MISTAKES = {
    -1.0: Looks.F1_V2_INVERTED,
    _G: Looks.V2_IN_G,
    1 / _G: Looks.F1_IN_KGF,
    1000.0: Looks.F1_IN_N,
    1e-3: Looks.F1_IN_KN,
}


def check_consistency(phasors: Phasors, rig: Rig, added_mass: float) -> Check:
    """Compare F1 with Zr V2, the force on the rig: by this one relation three channels check each other."""
    omega = 2 * np.pi * float(phasors.frequency)
    f1, v1, v2 = (complex(x) for x in phasors.amplitudes)
    impedance = complex(rig.impedance(omega, added_mass))
    needed = impedance * v2
    force = f1 - 1j * omega * rig.input_mass * v1
    if not (np.isfinite(force) and np.isfinite(needed)) or needed == 0:
        return Check(Code.CONSISTENCY, Verdict.OK, nan, INCONSISTENT)
    ratio = force / needed
    size, degrees = abs(ratio), np.degrees(np.angle(ratio))
    looks = [look for factor, look in _MISTAKES.items() if abs(ratio / factor - 1.0) < _ALIKE]
    if v1 != 0 and abs(force / (impedance * v1) - 1.0) < _ALIKE:
        looks.append(Looks.V1_V2_EXCHANGED)
    return judged(Code.CONSISTENCY, abs(ratio - 1.0), INCONSISTENT, ratio=size, degrees=degrees, looks=tuple(looks))
