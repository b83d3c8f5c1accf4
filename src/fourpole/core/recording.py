"""A recording: channels in SI units, each with its time base and the properties of its chain; thinning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray, short_repr
from fourpole.core.chain import Link
from fourpole.core.digits import notebook_html, outline_svg
from fourpole.core.reference import Reference
from fourpole.errors import RecordingError
from fourpole.face import public

#: SI units of what channels measure; the signal of the drive has any unit.
UNITS = {"force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}
#: Number of differentiations that turn a motion into a velocity; 0 for a force and for the signal of the drive.
DERIVATIVES = {"force": 0, "displacement": 1, "velocity": 0, "acceleration": -1, "drive": 0}
#: Role of the signal that drives the excitation, in any unit.
DRIVE = "drive"


@dataclass(frozen=True)
class CrossTalk:
    """Cross-talk of another channel in a channel.

    Attributes
    ----------
    source : str
        Role of the other channel.
    quantity : str
        Quantity of the source that causes it: force, displacement, velocity or acceleration.
    coefficient : float
        This channel's SI unit per SI unit of that quantity.
    """

    source: str
    quantity: str
    coefficient: float


@dataclass(frozen=True, eq=False)
class Channel(ByValue):
    """Samples of one sensor in SI units, after gain, offset and inversion.

    Parameters
    ----------
    samples : (N,) float array [N], [m], [m/s] or [m/s²]
        Samples; not-a-number for a missing one.
    quantity : {"force", "displacement", "velocity", "acceleration", "drive"}
        Measured quantity; "drive" is the signal that drives the excitation, in any unit.
    delay : float [s]
        Delay of the samples: ``recorded(t) = true(t - delay)``.
    limits : (float, float), optional
        Values of the full scale, in the units of `samples`.
    rate : float [Hz], optional
        Samples per second; by default the recording's.
    start : float [s]
        Time of the first sample.
    chain : tuple of Link
        Links of the measurement chain besides the delay: filters, a calibrated response.
    crosstalk : tuple of CrossTalk
        Cross-talk of other channels, before the chain of this one.
    clipped : float [1], optional
        Share of the samples at full scale, if `samples` no longer show it.
    tilt : float [1], optional
        Largest departure of a sensor from the mean over this mean, if the channel is the mean of several on one part.

    Raises
    ------
    ValueError
        If the quantity is unknown.

    Examples
    --------
    >>> Channel(np.zeros(3), "velocity").quantity
    'velocity'
    """

    samples: FloatArray
    quantity: str
    delay: float = 0.0
    limits: tuple[float, float] | None = None
    rate: float | None = None
    start: float = 0.0
    chain: tuple[Link, ...] = ()
    crosstalk: tuple[CrossTalk, ...] = ()
    clipped: float | None = None
    tilt: float | None = None

    def __post_init__(self) -> None:
        if self.quantity not in DERIVATIVES:
            raise ValueError(f"no quantity {self.quantity!r}: choose one of {', '.join(DERIVATIVES)}")


@dataclass(frozen=True, repr=False)
class Recording:
    """Channels, each sampled uniformly.

    Parameters
    ----------
    sample_rate : float [Hz]
        Samples per second of the channels that do not state their own.
    channels : mapping of str to Channel
        ``motion_in`` and, if measured, ``force_in`` and ``motion_out``. Channels of the same rate and start have the
        same length.
    label : str
        Name of the recording in messages.
    reference : Reference, optional
        Phase of the excitation over time.

    Raises
    ------
    RecordingError
        If there is no ``motion_in``, or lengths differ.

    Examples
    --------
    >>> t = np.arange(1000) / 500.0
    >>> recording = Recording.from_arrays(t, force_in=np.sin(63 * t), motion_in=np.cos(63 * t))
    >>> recording.duration
    2.0
    """

    sample_rate: float
    channels: Mapping[str, Channel]
    label: str = "recording"
    reference: Reference | None = None
    #: What functions have made of the recording and may ask for again.
    made: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if "motion_in" not in self.channels:
            raise RecordingError(f"{self.label}: no channel 'motion_in': the motion at the contact must be there")
        for base in {self.base(name) for name in self.channels}:
            lengths = {name: channel.samples.size for name, channel in self.channels.items() if self.base(name) == base}
            if len(set(lengths.values())) > 1:
                raise RecordingError(f"{self.label}: channels differ in length: {lengths}")

    def base(self, name: str) -> tuple[float, float]:
        """Rate [Hz] and start [s] of a channel."""
        channel = self.channels[name]
        return (self.sample_rate if channel.rate is None else channel.rate), channel.start

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        *,
        force_in: ArrayLike,
        motion_in: ArrayLike,
        motion_out: ArrayLike | None = None,
        motion: str = "velocity",
        label: str = "recording",
    ) -> Recording:
        """Recording from arrays in SI units.

        Parameters
        ----------
        time : (N,) float array [s]
            Uniform time.
        force_in, motion_in, motion_out : (N,) float arrays
            F1 [N], and the motion at the contact and beyond the tyre. Both motions are positive in the same direction,
            from the contact towards the foundation; F1 is positive where it pushes the tyre in that direction.
        motion : {"displacement", "velocity", "acceleration"}
            Quantity of the motions [m], [m/s] or [m/s²].
        label : str
            Name of the recording in messages.

        Raises
        ------
        RecordingError
            If the time is not uniform.

        Examples
        --------
        >>> t = np.arange(100) / 100.0
        >>> Recording.from_arrays(t, force_in=t, motion_in=t).sample_rate
        100.0
        """
        stamps = np.asarray(time, dtype=float)
        if stamps.shape != np.shape(motion_in):
            raise RecordingError(
                f"{label}: time and motion_in differ in length: {stamps.size} and {np.size(motion_in)} samples"
            )
        step, remark = uniform_time(stamps)
        if remark:
            raise RecordingError(f"{label}: {remark}")
        channels = {
            "force_in": Channel(np.asarray(force_in, dtype=float), "force"),
            "motion_in": Channel(np.asarray(motion_in, dtype=float), motion),
        }
        if motion_out is not None:
            channels["motion_out"] = Channel(np.asarray(motion_out, dtype=float), motion)
        return cls(1.0 / step, channels, label)

    def without(self, name: str) -> Recording:
        """The recording without one channel."""
        kept = {key: channel for key, channel in self.channels.items() if key != name}
        return replace(self, channels=kept)

    @cached_property
    def span(self) -> tuple[float, float]:
        """Start and end of the time that all channels and the reference cover, half an interval beyond samples [s]."""
        spans = []
        for name, channel in self.channels.items():
            rate, start = self.base(name)
            spans.append((start - 0.5 / rate, start + (channel.samples.size - 0.5) / rate))
        if self.reference is not None:
            spans.append(self.reference.span)
        return max(first for first, _ in spans), min(last for _, last in spans)

    @property
    def duration(self) -> float:
        """Length of the time that all channels and the reference cover [s]."""
        first, last = self.span
        return last - first

    @property
    def force_peak(self) -> float:
        """Largest departure of F1 from its mean [N]; 0 where no force is recorded."""
        force = self.channels.get("force_in")
        return 0.0 if force is None else float(np.nanmax(np.abs(force.samples - np.nanmean(force.samples))))

    def _repr_html_(self) -> str:
        """Channels with their ranges and outlines, for a notebook."""
        rows, outlines = [], []
        for name, channel in self.channels.items():
            rate, start = self.base(name)
            samples = channel.samples
            known = samples[np.isfinite(samples)]
            ends = (f"{known.min():.4g}", f"{known.max():.4g}") if known.size else ("", "")
            times = (f"{start:.4g} to {start + samples.size / rate:.4g}", f"{rate:.6g}", str(samples.size))
            rows.append((name, channel.quantity, UNITS.get(channel.quantity, "1"), *ends, *times))
            outlines.append(f"<div>{notebook_html(name)}{outline_svg(samples)}</div>")
        heads = ("channel", "quantity", "unit", "least", "greatest", q.TIME.head, "rate [Hz]", "samples")
        return notebook_html(f"Recording {self.label}", (), heads, rows, after="".join(outlines))

    def plot(self) -> Any:
        """The channels over time, each in a panel; see `fourpole.draw`."""
        return public("draw")(self)

    def between(self, first: float, last: float) -> Recording:
        """The recording cut to the time between `first` and `last` [s]."""
        cut = {}
        for name, channel in self.channels.items():
            rate, start = self.base(name)
            low = max(0, int(np.ceil((first - start) * rate - 1e-6)))
            high = max(low, int(np.floor((last - start) * rate + 1e-6)) + 1)
            cut[name] = replace(channel, samples=channel.samples[low:high], start=start + low / rate)
        return replace(self, channels=cut)


#: Resolution of rounded stamps over the interval from which they may repeat [1], and fewest stamps that show it.
_COARSE, _FEWEST_ROUNDED = 1.1, 100


def uniform_time(time: FloatArray) -> tuple[float, str]:
    """Sampling interval of a time column, with a remark on its uniformity.

    Departures from a uniform grid that the rounding of the stamps explains are accepted. Departures of up to half an
    interval are treated as clock jitter, with a remark. Larger departures are an error.

    Parameters
    ----------
    time : (N,) float array [s]
        Time stamps, N >= 2.

    Returns
    -------
    step : float [s]
        Mean interval.
    remark : str
        Remark on clock jitter; empty for uniform stamps.

    Raises
    ------
    RecordingError
        If the stamps are missing, do not increase, or are not uniform.

    Examples
    --------
    >>> uniform_time(np.array([0.0, 0.1, 0.2]))
    (0.1, '')
    """
    if time.size < 2:
        raise RecordingError(f"{time.size} samples are too few for a time base")
    if not np.all(np.isfinite(time)):
        row = int(np.argmin(np.isfinite(time)))
        raise RecordingError(f"time is missing at sample {row + 1}; fill it in, or state sample_rate for the channels")
    index, since = np.arange(time.size) - 0.5 * (time.size - 1), time - time[0]
    step = float(index @ since / (index @ index))  # of the uniform grid nearest to the stamps
    off_grid = np.abs(since - since.mean() - step * index)
    if off_grid.max() <= 1e-6 * step:
        return step, ""
    increments = np.diff(time)
    shortest, longest = float(increments.min()), float(increments.max())
    stamps = _resolution(time, since, step) if shortest >= 0 < step else np.zeros(1)
    # where stamps of a uniform clock repeat because they are rounded
    coarse = (np.broadcast_to(stamps, time.shape)[1:] > _COARSE * step) & (time.size > _FEWEST_ROUNDED)
    if shortest < 0 or not np.all(coarse[increments == 0]) or not step > 0:
        row = int(np.argmax(increments <= 0))
        how = "runs backwards" if np.all(increments < 0) else f"does not increase at sample {row + 2}"
        raise RecordingError(
            f"time {how} (from {time[row]:.9g} s to {time[row + 1]:.9g} s); "
            "export the recording again in order of time, without repeated stamps"
        )
    worst = int(np.argmax(off_grid))
    # stamps within half a unit of a grid lie within (1 + 5/3)/2 units of the fitted one: its ends weigh the rest by 5/3
    rounding = stamps / 2 + 5 / 6 * stamps.max() + 1e-6 * step + 4 * np.finfo(float).eps * float(np.max(np.abs(time)))
    jumps = longest > 1.5 * shortest and longest > 1.5 * np.percentile(increments, 99.0) and stamps.max() <= step
    if np.all(off_grid <= rounding) and not jumps:
        return step, ""
    if off_grid[worst] <= 0.5 * step and not jumps:
        return step, (
            f"time stamps are up to {off_grid[worst] / step:.0%} of an interval off a uniform grid "
            f"(sample {worst + 1}); taken as clock jitter on uniform samples: "
            "if so, state sample_rate in campaign.toml, if not, resample"
        )
    jump = int(np.argmax(np.abs(increments - np.median(increments))))
    raise RecordingError(
        f"time is not uniform: the interval after sample {jump + 1} (at {time[jump]:.9g} s) is "
        f"{increments[jump]:.6g} s, the median {np.median(increments):.6g} s; samples were lost or the rate changed: "
        "resample, cut with window [s], or state sample_rate if the stamps are wrong"
    )


def _resolution(time: FloatArray, since: FloatArray, step: float) -> FloatArray:
    """Resolution of stamps that are rounded to a number of decimals, or of digits [s]; one for all, or that of each."""
    firsts = {*range(0, time.size, max(1, time.size // 4)), max(time.size - 500, 0)}
    some, own = (np.concatenate([stamps[first : first + 500] for first in firsts]) for stamps in (since, time))
    coarsest = int(np.floor(np.log10(step))) + 3
    fixed = next((unit for at in range(coarsest, -16, -1) if _are_multiples(some, unit := np.array(10.0**at))), 0.0)
    digits = next((digits for digits in range(2, 9) if _are_multiples(own, _last_digit(own, digits, step))), None)
    return np.atleast_1d(fixed if digits is None else np.maximum(fixed, _last_digit(time, digits, step)))


def _last_digit(time: FloatArray, digits: int, step: float) -> FloatArray:
    """One unit of the last of the digits behind the first one of stamps; those below a step have its decimals [s]."""
    return np.asarray(10.0 ** (np.floor(np.log10(np.maximum(np.abs(time), step))) - digits))


def _are_multiples(time: FloatArray, unit: FloatArray) -> bool:
    """Whether stamps are multiples of a unit."""
    quotient = time / unit
    return bool(np.all(np.abs(quotient - np.round(quotient)) < 1e-9 * np.maximum(1.0, np.abs(quotient))))


#: Attenuation of components that alias onto the band, and flatness of the band [dB].
_ATTENUATION = 160.0
#: Ends of the pass band and start of the stop band, as shares of the new rate.
_PASS, _STOP = 0.45, 0.55


class Decimator:
    r"""Every n-th sample of a channel after a linear-phase low-pass, from successive chunks.

    The filter is flat within 1e-8 up to 0.45 of the new rate, and attenuates components that alias onto that band by a
    factor of 1e-8. Its delay is exact, and `shift` includes it.

    Parameters
    ----------
    factor : int
        n >= 1; 1 keeps all samples.

    Examples
    --------
    >>> thin = Decimator(4)
    >>> for piece in np.split(np.cos(0.01 * np.arange(4000)), 4):
    ...     thin.feed(piece)
    >>> samples = thin.samples()
    >>> bool(np.allclose(samples, np.cos(0.01 * (thin.shift + 4 * np.arange(samples.size))), atol=1e-7))
    True
    """

    def __init__(self, factor: int) -> None:
        self.factor = factor
        self._taps = _taps(factor) if factor > 1 else np.ones(1)
        self._held = np.empty(0)
        self._skip = 0
        self._parts: list[FloatArray] = []

    @property
    def shift(self) -> float:
        """Position of the first output sample, in input samples."""
        return 0.5 * (self._taps.size - 1)

    def feed(self, piece: FloatArray) -> None:
        """Add samples; a missing one (not-a-number) makes all output samples missing that depend on it."""
        if self.factor == 1:
            self._parts.append(np.asarray(piece, dtype=float))
            return
        run = np.concatenate([self._held, piece])
        outputs = run.size - self._taps.size + 1
        if outputs <= 0:
            self._held = run
            return
        known = np.isfinite(run)
        smooth = scipy.signal.oaconvolve(np.where(known, run, 0.0), self._taps, mode="valid")
        if not known.all():
            gaps = np.concatenate([[0], np.cumsum(~known)])
            smooth[gaps[self._taps.size :] > gaps[: -self._taps.size]] = np.nan
        self._parts.append(smooth[self._skip :: self.factor].copy())  # a view would keep the whole array in memory
        self._skip = (self._skip - outputs) % self.factor
        self._held = run[outputs:].copy()

    def samples(self) -> FloatArray:
        """All output samples so far."""
        return self._parts[0] if len(self._parts) == 1 else np.concatenate([np.empty(0), *self._parts])


def _taps(factor: int) -> FloatArray:
    """Coefficients of the low-pass for a factor."""
    count, beta = scipy.signal.kaiserord(_ATTENUATION, 2 * (_STOP - _PASS) / factor)
    return np.asarray(scipy.signal.firwin(count | 1, (_PASS + _STOP) / factor, window=("kaiser", beta)))
