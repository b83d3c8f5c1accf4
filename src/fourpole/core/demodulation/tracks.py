"""Tracks: the channels of a recording with one common zero of time, grouped by equal sampling times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.sums import Blocks, hann
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import Recording
from fourpole.core.reference import Reference
from fourpole.errors import ConstantError, RecordingError

_FEWEST_SAMPLES = 16
_MOST_MISSING = 0.2
#: Largest sample in SI units: above any measurement, and its square does not overflow.
_LARGEST = 1e30
#: A speed that departs from its mean by less than this share does not change the amplitudes.
STEADY = 1e-4
#: A speed that departs from its mean by more than this share needs the third power of the response.
_CURVED = 3e-3
#: A further function of the speed is fitted if at least this share of its norm is independent of those before it.
_ALIKE = 0.3


@dataclass(frozen=True, eq=False)
class Course(ByValue):
    """Phase of the excitation as a reference gives it.

    Attributes
    ----------
    turn : (N,) float [rad]
        Phase of the fundamental minus omega·t.
    follow : (M, N) complex [1]
        Functions of time that the amplitude of the fundamental may follow; each is 0 at the mean speed.
    """

    turn: FloatArray
    follow: ComplexArray


@dataclass(frozen=True, eq=False)
class Track(ByValue):
    """Channels with the same sampling times.

    Attributes
    ----------
    names : tuple of str
        Roles.
    signals : (channels, N) float array
        Samples minus their means, in SI units; 0 for missing samples.
    present : (N,) bool array
        True for samples that all of these channels have.
    time : (N,) float array [s]
        Time from the middle of the recording.
    rate : float [Hz]
        Samples per second.
    course : Course or None
        Phase of the excitation as a reference gives it; None without a reference.
    spoilt : (channels, N) bool array or None
        Drop-outs and spikes, which are not present in any channel; None if there are none.
    """

    names: tuple[str, ...]
    signals: FloatArray
    present: BoolArray
    time: FloatArray
    rate: float
    course: Course | None = None
    spoilt: BoolArray | None = None

    @cached_property
    def known(self) -> int:
        """Number of samples that all channels have."""
        return int(np.count_nonzero(self.present))

    @property
    def recorded(self) -> BoolArray:
        """Flags (N,) of the samples that the recording has, drop-outs and spikes included."""
        return self.present if self.spoilt is None else self.present | self.spoilt.any(axis=0)

    @cached_property
    def blocks(self) -> Blocks:
        """The samples in blocks, for sums with sinusoids."""
        return Blocks(self.signals, self.exact_rate)

    @property
    def exact_rate(self) -> float:
        """Samples per second, from the first and the last time: it keeps the phase at both ends [Hz]."""
        return float((self.time.size - 1) / (self.time[-1] - self.time[0]))

    @cached_property
    def energy(self) -> FloatArray:
        """Sum (channels,) of the squares of the samples."""
        return np.einsum("ij,ij->i", self.signals, self.signals)

    @cached_property
    def spectrum(self) -> ComplexArray:
        """Spectrum (N // 2 + 1,) of V1 minus its mean and slope, under a Hann window."""
        motion = self.signals[self.names.index("motion_in")]
        index = np.arange(motion.size) - 0.5 * (motion.size - 1)
        index *= (index @ motion) / (motion.size * (motion.size**2 - 1.0) / 12.0)
        return np.fft.rfft((motion - np.add(index, motion.mean(), out=index)) * hann(motion.size))


def tracks_of(recording: Recording, names: Sequence[str]) -> list[Track]:
    """Tracks of the channels `names` over their common time, V1 first; RecordingError for a channel without signal."""
    made: dict[tuple[str, ...], list[Track]] = recording.made
    asked = ("tracks", *names)
    if asked in made:
        return made[asked]
    alike = recording.reference is None and len({recording.base(name) for name in recording.channels}) == 1
    common = recording if alike else recording.between(*recording.span)
    middle, tracks = 0.5 * sum(recording.span), []
    for rate, start in dict.fromkeys(common.base(name) for name in ("motion_in", *names)):
        own = tuple(name for name in names if common.base(name) == (rate, start))
        if own:
            signals, present = _signals(common, own)
            size = signals.shape[1]
            time = (np.arange(size) - 0.5 * (size - 1)) / rate + (start + 0.5 * (size - 1) / rate - middle)
            tracks.append(Track(own, signals, present, time, rate))
    made[asked] = tracks
    return tracks


def following(tracks: Sequence[Track], reference: Reference, span: tuple[float, float]) -> tuple[list[Track], float]:
    r"""The tracks with the phase that a reference gives, and the mean speed [rad/s].

    The analysis needs the response at the mean speed w0. With s the departure of the speed from w0, relative to w0, the
    response :math:`\sum_n a_n (\omega/\omega_0 - 1)^n` to a drive of this phase is

    .. math:: a_0 + a_1 s + a_2 (s^2 - j\dot s/\omega_0) + a_3 (s^3 - 3j s\dot s/\omega_0) + \dots

    The fit includes these terms, so that neither the curvature of the response nor its lag changes a_0.
    """
    curve = reference.curve
    omega, middle = reference.omega(*span), 0.5 * (span[0] + span[1])
    zero = float(curve(np.array([middle]))[0])
    worst = float(np.max(np.abs(curve(np.linspace(*span, 400), 1) / omega - 1.0)))
    followed = []
    for track in tracks:
        time = track.time + middle
        turn = curve(time) - zero - omega * track.time
        follow: ComplexArray = np.empty((0, time.size), dtype=complex)
        if worst > STEADY:
            off, lag = (curve(time, 1) / omega - 1.0) / worst, curve(time, 2) / omega**2 / worst
            powers = [off + 0j, off**2 - 1j * lag / worst, off**3 - 3j * off * lag / worst]
            follow = _different(np.stack(powers[: 3 if worst > _CURVED else 2]))
        followed.append(replace(track, course=Course(turn, follow)))
    return followed, omega


def _different(rows: ComplexArray) -> ComplexArray:
    """The rows that are not a linear combination of a constant and the rows before them."""
    kept: list[ComplexArray] = [np.ones(rows.shape[1], dtype=complex)]
    for row in rows:
        basis, _ = np.linalg.qr(np.stack(kept).T)
        if np.linalg.norm(row - basis @ (basis.conj().T @ row)) > _ALIKE * np.linalg.norm(row):
            kept.append(row)
    return np.stack(kept[1:]) if len(kept) > 1 else rows[:0]


def _signals(recording: Recording, names: Sequence[str]) -> tuple[FloatArray, BoolArray]:
    """Samples (C, N) minus their means, 0 for missing samples; flags (N,) of the samples that all channels have."""
    raw = np.array([recording.channels[name].samples for name in names], dtype=float)
    if raw.shape[1] < _FEWEST_SAMPLES:
        raise RecordingError(
            f"{recording.label} has {raw.shape[1]} samples, at least {_FEWEST_SAMPLES} are needed: "
            "record three cycles or more"
        )
    present, signals = np.ones(raw.shape[1], dtype=bool), raw
    if not np.isfinite(raw.sum(axis=1)).all():
        present = _present(raw, names)
        signals = np.where(present, raw, 0.0)
    size = _largest(signals)
    for name, largest in zip(names, size.tolist(), strict=True):
        if largest > _LARGEST:
            raise RecordingError(
                f"{named(name)} reaches {largest:.3g} in SI units, which is no measurement: "
                "check its column, unit and gain"
            )
    count = np.count_nonzero(present)
    signals = signals - signals.sum(axis=1, keepdims=True) / count
    if count < present.size:
        signals *= present
    for name, left, largest in zip(names, _largest(signals).tolist(), size.tolist(), strict=True):
        if left <= 1e-12 * largest or largest == 0:
            raise ConstantError(
                f"{named(name)} is constant ({largest:.6g} in SI units): "
                "the sensor was off, unplugged, or another column is meant"
            )
    moving = [(name, motion) for name, motion in zip(names, signals, strict=True) if name in CHANNELS[1:]]
    for (name, motion), (other, same) in combinations(moving, 2):
        if np.array_equal(motion, same):
            raise RecordingError(
                f"{named(name)} and {named(other)} have the same samples: "
                "name the column of each, or export the recording again"
            )
    return signals, present


def _largest(rows: FloatArray) -> FloatArray:
    """Largest modulus of each row."""
    return np.maximum(rows.max(axis=1), -rows.min(axis=1)) + 0.0  # no minus zero


def _present(raw: FloatArray, names: Sequence[str]) -> BoolArray:
    """Flags (N,) of the samples that all channels (C, N) have; RecordingError if too many are missing."""
    there = np.isfinite(raw)
    present = np.asarray(there.all(axis=0))
    if np.mean(present) < 1.0 - _MOST_MISSING:
        worst = int(np.argmin(there.mean(axis=1)))
        raise RecordingError(
            f"{named(names[worst])}: {1.0 - there[worst].mean():.0%} of the samples are missing "
            f"({1.0 - present.mean():.0%} in any channel), at most {_MOST_MISSING:.0%} can be bridged; "
            "record the test again"
        )
    return present


def named(role: str) -> str:
    """Symbol and role of a channel, as in 'F1 (force_in)'."""
    return f"{SYMBOLS[role]} ({role})" if role in SYMBOLS else role
