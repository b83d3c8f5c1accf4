"""Samples that are no measurement: drop-outs, in which a channel stands still, and spikes. The fit leaves them out.

Such samples are few, hold most of the residual's energy, and do not return at the same phase of each cycle. Kinks of a
friction force return.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray, IntArray
from fourpole.core.demodulation.sinefit import SineFit, fit_sines, refine
from fourpole.core.demodulation.spectrum import median
from fourpole.core.demodulation.terms import rows_of

#: Residual over its usual size at which a sample is a spike: 1 of 500 million samples of normal noise exceeds it.
_SPIKE = 6.0
#: Smallest spike or drop-out over the amplitude; smaller ones cannot change the result.
_LEAST = 1e-3
#: A drop-out is a run of at least so many equal samples, which departs from the fit by this share of the amplitude.
_RUN, _APART = 4, 0.15
#: Largest share of samples that are left out. If more are spoilt, no fit tells which.
_MOST = 0.2
#: The residual must fall to this share when the samples are left out, which then held half its energy.
_FALL = 0.7
#: Samples that return at one phase in more than this share of the cycles belong to the signal.
_PERIODIC = 0.5
#: Number of parts of a cycle within which samples are at one phase; number of cycles in which the noise is judged.
_PHASES, _CYCLES = 8, 4
_PASSES = 8
#: Median of the modulus over the standard deviation of normal noise.
_MEDIAN = 0.6745


def without_spoilt(fits: Sequence[SineFit], informing: Sequence[BoolArray], *, free: bool) -> list[SineFit]:
    """The fits without drop-outs and spikes; `Track.spoilt` tells the samples that were left out.

    Parameters
    ----------
    fits : sequence of SineFit
        Fits of all tracks, without interfering lines.
    informing : sequence of (harmonics,) bool arrays
        Harmonics that may inform the frequency, as for `refine`.
    free : bool
        Whether the frequency is estimated.
    """
    old = list(fits)
    flags = [_flags(fit) for fit in old]
    if not any(flag.any() for flag in flags):
        return old
    new = old
    for _ in range(_PASSES):
        if any(np.mean(flag.any(axis=0)) > _MOST for flag in flags):
            return old
        new = [_left_out(fit, flag) for fit, flag in zip(old, flags, strict=True)]
        new, _ = refine(new, informing=informing, free=free)
        last, flags = flags, [_flags(fit, whole.track.signals) for fit, whole in zip(new, old, strict=True)]
        if all(np.array_equal(a, b) for a, b in zip(last, flags, strict=True)):
            break
    kept = [_confirmed(fit, was, flag) for fit, was, flag in zip(new, old, flags, strict=True)]
    if not any(flag.any() for flag in kept):
        return old
    new = [_left_out(fit, flag) for fit, flag in zip(old, kept, strict=True)]
    return refine(new, informing=informing, free=free)[0]


def _left_out(fit: SineFit, flags: BoolArray) -> SineFit:
    """The fit without the samples that are flagged (channels, N) in any channel."""
    if not flags.any():
        return fit
    track, gone = fit.track, flags.any(axis=0)
    signals = np.where(gone, 0.0, track.signals)
    less = replace(track, signals=signals, present=track.present & ~gone, spoilt=flags)
    return fit_sines(less, fit.omega, fit.harmonics, fit.lines, fit.unsteady)


def _flags(fit: SineFit, signals: FloatArray | None = None) -> BoolArray:
    """Flags (channels, N) of drop-outs and spikes; `signals` has the samples that the fit left out."""
    track = fit.track
    present = track.recorded
    signals = track.signals if signals is None else signals
    left = signals - _everywhere(fit) if track.spoilt is not None else fit.residual
    rest, sizes = np.abs(left), np.hypot(*fit.coefficients[:2]).tolist()
    count = int(min(max(_CYCLES * track.exact_rate * 2 * np.pi / fit.omega, 64), track.time.size))
    edges = np.linspace(0, track.time.size, max(track.time.size // count, 1) + 1).astype(int)
    spiky = np.ones(len(rest), dtype=bool) if not present.all() else _may_spike(rest, edges)
    flags = np.zeros(signals.shape, dtype=bool)
    for i, (largest, amplitude) in enumerate(zip(rest.max(axis=1).tolist(), sizes, strict=True)):
        if spiky[i] and largest > _LEAST * amplitude:
            flags[i] = rest[i] > np.maximum(_SPIKE * _usual(rest[i], present, edges), _LEAST * amplitude)
        if largest > _APART * amplitude:
            flags[i] |= _stuck(signals[i], rest[i], amplitude)
    return flags & present


def _may_spike(rest: FloatArray, edges: IntArray) -> BoolArray:
    """Flags of the rows of moduli (channels, N) that may exceed the limit of a spike; False is certain.

    The median of a block is large enough for the largest of all, unless half of the block's samples are smaller.
    """
    below = rest < rest.max(axis=1, keepdims=True) * (_MEDIAN / _SPIKE)
    fewer = np.add.reduceat(below, edges[:-1], axis=1, dtype=int) < np.diff(edges) // 2
    return np.asarray(~fewer.all(axis=1))


def _everywhere(fit: SineFit) -> FloatArray:
    """The fit (channels, N) at all samples, also at those that it left out."""
    whole = replace(fit.track, present=np.ones_like(fit.track.present))
    return rows_of(whole, fit).model(fit.coefficients)


def _usual(rest: FloatArray, present: BoolArray, edges: IntArray) -> FloatArray:
    """Standard deviation of a residual of modulus `rest` (N,), from the median of each block between edges."""
    usual = np.empty(rest.size)
    everywhere = median(rest[present])
    for low, high in pairwise(edges.tolist()):
        known = rest[low:high] if present[low:high].all() else rest[low:high][present[low:high]]
        usual[low:high] = median(known) if 2 * known.size > high - low else everywhere
    return usual / _MEDIAN


def _stuck(row: FloatArray, rest: FloatArray, amplitude: float) -> BoolArray:
    """Flags (N,) of runs of equal samples that depart from the fit by more than a coarse converter explains."""
    steps = np.diff(row)
    flags = np.zeros(row.size, dtype=bool)
    runs = [(low, high) for low, high in runs_of(steps == 0.0) if high - low >= _RUN - 1]
    if not runs:
        return flags
    moving = np.abs(steps[steps != 0.0])
    limit = _APART * amplitude + 3.0 * (float(np.min(moving)) if moving.size else np.inf)
    for low, high in runs:
        if rest[low : high + 1].max() > limit:
            flags[low : high + 1] = True
    return flags


def runs_of(flags: BoolArray) -> list[tuple[int, int]]:
    """First index, and index after the last, of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def _confirmed(fit: SineFit, old: SineFit, flags: BoolArray) -> BoolArray:
    """The flags of the channels whose residual falls without these samples, and that do not return each cycle."""
    keep = np.zeros_like(flags)
    rms, usual = (np.sqrt(np.sum(part.residual**2, axis=1) / max(part.dof, 1)) for part in (fit, old))
    for i, row in enumerate(flags):
        if row.any() and rms[i] < _FALL * usual[i] and not _returns(fit, row):
            keep[i] = row
    return keep


def _returns(fit: SineFit, flags: BoolArray) -> bool:
    """Whether flagged runs lie at the same phase in many cycles."""
    track = fit.track
    turn = fit.omega * track.time + (0.0 if track.course is None else track.course.turn)
    cycles = turn / (2 * np.pi)
    middles = np.array([cycles[(low + high - 1) // 2] for low, high in runs_of(flags)])
    total = cycles[-1] - cycles[0]
    for shift in (0.0, 0.5):
        place = middles * _PHASES + shift
        phases = np.stack([np.floor(place) % _PHASES, np.floor(place / _PHASES)])
        _, counts = np.unique(np.unique(phases, axis=1)[0], return_counts=True)
        if counts.max() > max(_PERIODIC * total, 1.0):
            return True
    return False
