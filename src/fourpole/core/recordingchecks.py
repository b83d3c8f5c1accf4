"""Checks of one recording: each function compares a statistic with its limit, which stands beside the function."""

from __future__ import annotations

from cmath import isfinite, phase, rect
from itertools import combinations
from math import cos, degrees, hypot, inf, nan, sin
from typing import Any

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Looks, Verdict, judged, reported
from fourpole.core.demodulation.demodulate import Demodulation, Harmonics
from fourpole.core.demodulation.spectrum import LINE_GAP, off_multiples
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel
from fourpole.core.rig import Rig

#: Relative departure of F1 from Zr V2 above which the calibration of a channel must be wrong.
INCONSISTENT = 0.2


def check_frequency(frequency: float, stated: float | None) -> Check:
    """Compare the stated frequency with the one found: within 1 % ok, within 5 % a warning, else rejected."""
    off = 0.0 if not stated else abs(frequency - stated) / stated
    return judged(Code.FREQUENCY, off, 0.01, 0.05, found=frequency, stated=stated)


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
    samples = channel.samples
    if not (known := np.isfinite(samples)).all():
        samples = samples[known]
    if samples.size == 0:
        return 0.0
    if channel.limits is not None:
        low, high = channel.limits
        tolerance = 1e-4 * (high - low)
        at_limit = float(np.mean((samples <= low + tolerance) | (samples >= high - tolerance)))
        if at_limit > 0:
            return at_limit
    return _flat_share(samples, samples.max()) + _flat_share(samples, samples.min())


def _flat_share(samples: FloatArray, top: float) -> float:
    """Share of samples [1] that equal the largest or smallest; 0 unless they are far more than at the top of a sine."""
    at_top = samples == top
    count = np.count_nonzero(at_top)
    if count < 6 or np.max(np.diff(np.flatnonzero(np.concatenate([[True], ~at_top, [True]])))) < 4:
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


def check_distortion(demodulation: Demodulation) -> Check:
    """Compare the harmonics of the displacement at the contact with its fundamental; a good cam gives a sine."""
    return judged(Code.DISTORTION, float(demodulation.distortion[1]), 0.2)


def check_noise(demodulation: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Compare the residual of the fit with the fundamental, for each channel."""
    ratios = zip(names, demodulation.noise_ratio.tolist(), strict=True)
    return [judged(Code.RESIDUAL, ratio, 0.3, inf, name) for name, ratio in ratios if np.isfinite(ratio)]


def check_excitation(demodulation: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Compare the standard uncertainty of each amplitude with the amplitude, to find channels that do not move."""
    phasors = demodulation.phasors
    sizes, stds = np.abs(phasors.amplitudes).tolist(), phasors.std.reshape(3, 2).max(axis=1).tolist()
    return [
        judged(Code.EXCITATION, std / size if size > 0 else inf, 0.05, 0.2, name, hertz=float(phasors.frequency))
        for name, size, std in zip(names, sizes, stds, strict=True)
        if isfinite(size)
    ]


def check_mains(demodulation: Demodulation) -> Check:
    """Compare the frequency with the multiples of 50 and 60 Hz; on a multiple, hum adds to the excitation."""
    frequency = float(demodulation.phasors.frequency)
    apart = min(float(off_multiples(frequency, base)) for base in (50.0, 60.0))
    bins = apart * demodulation.cycles / frequency
    if bins < LINE_GAP:
        return reported(Code.MAINS, Verdict.WARNING, bins, LINE_GAP, hertz=frequency)
    return Check(Code.MAINS, Verdict.OK, bins, LINE_GAP)


def check_gaps(demodulation: Demodulation) -> Check:
    """Check the share of samples that were missing and left out of the fit."""
    return judged(Code.MISSING, demodulation.missing, 0.0, percent=100 * demodulation.missing)


def check_spoilt(demodulation: Demodulation, names: tuple[str, ...]) -> list[Check]:
    """Check the share of drop-outs and spikes, which were left out of the fit, for each channel."""
    shares = zip(names, demodulation.spoilt.tolist(), strict=True)
    known = [(name, share) for name, share in shares if np.isfinite(share)]
    return [judged(Code.SPOILT, share, 0.0, inf, name, percent=100 * share) for name, share in known]


#: Largest change of a channel against the others between the halves, of amplitude [1] and phase [rad]. The error of K*
#: of the whole recording is then up to half of it. K* of rubber that warms in a recording changes by 1 or 2 %.
_CHANGES = (0.05, 0.03)
#: A change must exceed this many standard uncertainties, or the change of the speed times the sharpness of a resonance.
_CHANGE_NOISE, _SHARPNESS = 5.0, 30.0
#: The other channels agree if they change against each other by less than this share of the change.
_AGREE = 0.3


def check_halves(demodulation: Demodulation, names: tuple[str, ...]) -> Check:
    """Compare the channels' changes between the halves: one channel that changes against the others drifts."""
    phasors, changes = demodulation.phasors, demodulation.changes.tolist()
    there = [i for i, (gain, _) in enumerate(changes) if isfinite(gain)]
    std = (2.0 * phasors.std.reshape(3, 2).max(axis=1) / np.abs(phasors.amplitudes)).tolist()
    limits = [change + _SHARPNESS * abs(demodulation.speed_change) for change in _CHANGES]
    pairs = {}  # change of one channel against another, in its limits [1]
    for i, k in combinations(there, 2):
        noise = _CHANGE_NOISE * hypot(std[i], std[k])
        parts = zip(changes[i], changes[k], limits, strict=True)
        pairs[i, k] = max(abs(one - other) / max(noise, limit) for one, other, limit in parts)
    worst = max(pairs.values(), default=0.0)
    if not worst > 1.0:
        return Check(Code.HALVES, Verdict.OK, worst, 1.0)
    near = min(pairs, key=lambda pair: pairs[pair])
    odd = [i for i in there if i not in near]
    lone = len(there) == 3 and pairs[near] < _AGREE * worst
    which = odd[0] if lone else there[0]
    others = [i for i in there if i != which]
    gain, turn = (np.array(changes[which]) - np.mean([changes[i] for i in others], axis=0)).tolist()
    change: dict[str, Any] = {"gain": gain}
    if abs(turn) / limits[1] > abs(gain) / limits[0]:
        change = {"phase": turn, "ppm": abs(2e6 * turn / (2 * np.pi * demodulation.cycles))}
    change |= {"others": tuple(names[i] for i in others), "specimen": not (lone and names[which] != "V1")}
    return reported(Code.HALVES, Verdict.WARNING, worst, 1.0, names[which], **change)


#: Departure of a sensor from the mean of those on one part, over the mean. If they stand unevenly by a tenth of their
#: distance, a tenth is an error of 1 % of the motion, the usual error of a gain. From 1 on one is dead or turned round.
_TILTED, _TURNED = 0.1, 1.0


def check_tilt(channel: str, tilt: float) -> Check:
    """Check how far the sensors of a channel that is their mean depart from it."""
    return judged(Code.TILT, tilt, _TILTED, _TURNED, channel)


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


def check_consistency(phasors: Phasors, rig: Rig, added_mass: float, limit: float = INCONSISTENT) -> Check:
    """Compare F1 with Zr V2, the force on the rig: by this one relation three channels check each other.

    `limit` [1] is what the uncertainties explain of the departure, from `core.alone.largest_imbalance`.
    """
    omega = 2 * np.pi * float(phasors.frequency)
    f1, v1, v2 = (complex(x) for x in phasors.amplitudes)
    impedance = complex(rig.impedance(omega, added_mass))
    needed = impedance * v2
    force = f1 - 1j * omega * rig.input_mass * v1
    if not (isfinite(force) and isfinite(needed)) or needed == 0:
        return Check(Code.CONSISTENCY, Verdict.OK, nan, INCONSISTENT)
    ratio = force / needed
    size, angle = abs(ratio), degrees(phase(ratio))
    looks = [look for factor, look in _MISTAKES.items() if abs(ratio / factor - 1.0) < _ALIKE]
    if v1 != 0 and abs(force / (impedance * v1) - 1.0) < _ALIKE:
        looks.append(Looks.V1_V2_EXCHANGED)
    return judged(
        Code.CONSISTENCY, abs(ratio - 1.0), min(limit, INCONSISTENT), ratio=size, degrees=angle, looks=tuple(looks)
    )


#: Harmonics of the specimen's own force over the fundamental. A dry friction or a cubic spring whose third harmonic is
#: 2 % makes up 6 % of the fundamental, and so K* depends on the amplitude by that much.
_SPECIMEN = 0.02
#: The same for the rig. Its friction then takes 3 % of the force, more than the usual uncertainty of a sensor.
_RIG = 0.01
#: Lowest natural frequency of a specimen by its own mass [Hz]; tyres have theirs from 50 Hz on.
_NATURAL = 40.0
#: Amplitudes below this many standard uncertainties of a part are noise: 4 of a million exceed it by chance.
_NOISE = 5.0
#: Harmonics of F1 are the channel's own if V2 needs less than this share of them.
_MOVED = 0.5


#: A cubic departure from a straight line changes the fundamental by three times its third harmonic.
_BENT = 3.0


def force_bend(found: tuple[float, float, bool]) -> float:
    """Relative error of F1's fundamental by what `excess` found; 0 where no harmonics are those of its own channel."""
    own, _, unmoved = found
    return _BENT * own if unmoved and np.isfinite(own) else 0.0


def judged_excess(found: tuple[float, float, bool], of_force: float = 0.0) -> list[Check]:
    r"""Checks of the linearity of the specimen, or of the channel of F1, and of the rig, by what `excess` found.

    A linear specimen answers harmonic n of its deflection d with :math:`K^*(n\omega)\,d_n`, and a linear rig answers
    harmonic n of V2 with :math:`Z_r(n\omega)\,V_{2,n}`. The force that remains is the specimen's own, or the rig's.

    `of_force` is the linearity of F1 as stated [1], over its range, which is twice the amplitude.
    """
    specimen, of_rig, unmoved = found
    rows = []
    if np.isfinite(specimen):
        code = Code.FORCE_LINEARITY if unmoved and specimen > _SPECIMEN else Code.LINEARITY
        limit = max(_SPECIMEN, 2 * of_force) if unmoved else _SPECIMEN
        rows.append(judged(code, specimen, limit))
    if np.isfinite(of_rig):
        rows.append(judged(Code.RIG_LINEARITY, of_rig, _RIG))
    return rows


def excess(harmonics: Harmonics, omega: float, rig: Rig | None, added_mass: float) -> tuple[float, float, bool]:
    r"""Harmonics of the force that the motion's harmonics do not explain.

    K* at a harmonic is taken as :math:`K^*(\omega)\,n^{2\delta/\pi}`, with :math:`\delta` the phase of K*. It is exact
    for a spring, a damper and a power law. A spring beside a damper, and a spring behind a damper, of the same phase
    give the largest departure from it. A mass of the specimen adds :math:`s/(1-s)`, :math:`s=(nf/f_0)^2`, where its
    lowest natural frequency :math:`f_0` is at least 40 Hz. Above it, harmonic n may depart by n - 1 times its size.
    If F1 and V2 contradict each other at the fundamental, both parts are not-a-number.

    Parameters
    ----------
    harmonics : Harmonics
    omega : float [rad/s]
        Angular frequency of the fundamental.
    rig : Rig or None
        The rig as stated.
    added_mass : float [kg]
        Mass fixed to the moving mass in addition.

    Returns
    -------
    specimen, rig : float [1]
        Root of the summed squares over the fundamental of F1; not-a-number where the channels do not show it.
    unmoved : bool
        Whether the specimen's harmonics are not in V2, so that the channel of F1 makes them.

    Examples
    --------
    >>> clean = np.array([[100.0, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, 0.0, 0.0]], dtype=complex)
    >>> bent = clean + [[0.0, 0.0, 25.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    >>> still = Rig(blocked=True)
    >>> for amplitudes in (clean, bent):
    ...     excess(Harmonics(amplitudes, np.zeros((3, 3)), np.ones(3, dtype=bool)), 63.0, still, 0.0)[0]
    0.0
    0.25
    """
    number = np.arange(1.0, harmonics.clear.size + 1)
    f1, v1, v2 = harmonics.amplitudes
    clear = harmonics.clear & (number > 1)
    if not (np.isfinite(f1[0]) and np.isfinite(v1[0])) or not clear.any() or f1[0] == 0:
        return np.nan, np.nan, False
    jw = 1j * omega * number
    blocked = rig is not None and rig.blocked
    force = f1 - (0.0 if rig is None else rig.input_mass) * jw * v1
    needed = None if rig is None or blocked else np.asarray(rig.impedance(omega * number, added_mass))
    moved = _moved(force, v2, needed, blocked=blocked)
    if moved is None:
        return np.nan, np.nan, False
    deflection = (v1 - moved) / jw
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = complex(force[0] / deflection[0])
        turn = phase(ratio)
        stiffness = ratio * number ** (2 * max(turn, 0.0) / np.pi)
    noise = harmonics.std
    far = 0.0 if blocked or np.isnan(v2[0]) else noise[2]
    spread = np.hypot(noise[0], np.abs(stiffness / jw) * np.hypot(noise[1], far))
    explained = stiffness * deflection
    allowed = _departure(turn, number, omega) * np.abs(explained)
    own = np.maximum(np.abs(force - explained) - (allowed + _NOISE * spread), 0.0)
    specimen = float(np.linalg.norm(own[clear]) / np.abs(force[0]))
    if needed is None or np.isnan(v2[0]):
        return specimen, np.nan, False
    through = needed * v2  # the force that the rig needs
    limit = np.abs(force) + _NOISE * np.hypot(noise[0], np.abs(needed) * noise[2])
    left = np.maximum(np.abs(force - through) - limit, 0.0)
    above = clear & (own > 0)
    in_v2 = np.linalg.norm(through[above]) >= _MOVED * np.linalg.norm(force[above])
    return specimen, float(np.linalg.norm(left[clear]) / np.abs(force[0])), not in_v2


def _moved(force: ComplexArray, v2: ComplexArray, needed: ComplexArray | None, *, blocked: bool) -> ComplexArray | None:
    """V2 of all harmonics: 0 where blocked, as measured, or as the rig's impedance gives it.

    None if it is unknown, or if F1 and V2 contradict each other at the fundamental, of which `check_consistency` warns.
    """
    if blocked:
        return np.zeros_like(force)
    if not np.isfinite(v2[0]):
        return None if needed is None else force / needed
    if needed is not None and abs(force[0] - needed[0] * v2[0]) > INCONSISTENT * abs(needed[0] * v2[0]):
        return None
    return v2


def _departure(turn: float, number: FloatArray, omega: float) -> FloatArray:
    """Largest relative departure of a linear specimen's K* at the harmonics from its power law, (n,) [1]."""
    delta = min(max(turn, 0.0), 0.5 * np.pi)
    elastic, viscous, back = cos(delta), 1j * sin(delta), rect(1.0, -delta) / number ** (2 * delta / np.pi)
    beside = (elastic + number * viscous) * back
    behind = number * back / (elastic * number - viscous)
    rubber = np.maximum(np.abs(beside - 1), np.abs(behind - 1))
    share = np.minimum((number * omega / (2 * np.pi * _NATURAL)) ** 2, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(number - 1, rubber + share / (1 - share)))
