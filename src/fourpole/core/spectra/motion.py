"""What kind of excitation the motion at the contact shows: random, periodic, a sweep, or separate sines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.spectra.average import bins_of, hann, lines_of, starts_of

#: Number of segments that a first estimate takes, and fewest cycles of the lowest frequency in a segment.
MANY, CYCLES = 128, 4.0
#: Share of foreign bins above which the motion has gaps, and share of their power above which it is one sine, or a few.
_FOREIGN, _SINGLE = 0.05, 0.25
#: Number of segments that hold the power at a bin, below which the excitation is a sweep.
_SWEPT = 8.0
#: Segments that are looked at.
_MOST = 256
#: Distance in bins from which on a power belongs to another bin, and half the width of the main lobe of a Hann window.
_AWAY, _LOBE = 0.6, 2.0
#: Width of the window in bins: that of a rectangle of the same power.
_NOISE_WIDTH = 1.5
#: Share of the power of a bin that is in its main lobe, below which it leaks from far off.
_NEAR = 0.5
#: Share of the independent averages of Gaussian noise below which the spectrum consists of lines. The scatter of noise
#: in a narrow bin stays above it.
_FULL = 0.5
#: Samples in which a period is looked for: more need much memory.
_LONGEST = 1 << 22
#: Distance in samples, over many periods, up to which a period is a whole number of samples.
_WHOLE = 0.1
#: Powers that are weighted at a time: they stay in the cache of the processor.
_AT_A_TIME = 1 << 15
#: Correlation of the motion with itself a period later, and the least share of it that many periods later.
_ALIKE, _LASTING = 0.7, 0.9


@dataclass(frozen=True)
class Motion:
    """The kind of excitation.

    Attributes
    ----------
    foreign : float [1]
        Share of the bins whose power is that of another frequency, as between separate sines.
    single : float [1]
        Share of the power of V1 that these bins have; a third of it or more if the motion is one sine.
    held : float [1]
        Number of segments that hold the power at a bin, in the median: all of them if the excitation is steady, a few
        in a sweep.
    """

    foreign: float
    single: float
    held: float

    @property
    def is_swept(self) -> bool:
        """Whether each frequency is excited in a few segments only, as by a sweep."""
        return self.held < _SWEPT

    @property
    def has_gaps(self) -> bool:
        """Whether many bins lie between separate sines."""
        return self.foreign > _FOREIGN

    @property
    def has_sines(self) -> bool:
        """Whether the motion is one sine, or separate sines."""
        return self.has_gaps or self.single > _SINGLE


@dataclass(frozen=True, eq=False)
class Fine(ByValue):
    """Spectrum of the whole record of V1, which resolves what a segment does not.

    Attributes
    ----------
    power : (B,) float array
        Power at the bins.
    width : float [Hz]
        Distance of the bins; the first is at zero.
    """

    power: FloatArray
    width: float

    def seen(self, first: float, last: float, step: float) -> tuple[float, float, float]:
        r"""What a line, the mean of the bins of Hann windows from `first` to `last` [Hz], sees of the motion.

        Returns its power, the frequency of its power [Hz], and the share of the averages that noise would have:
        :math:`2\,(\sum w)^2/\sum w^2` over that of its window, with w the power at each bin of the whole record times
        that of the window; noise has a mean square of twice its square.
        """
        low = max(1, int((first - _LOBE * step) / self.width))
        power = self.power[low : int((last + _LOBE * step) / self.width) + 2]
        frequency = self.width * np.arange(low, low + power.size)
        window = np.zeros(frequency.size)
        for middle in np.arange(first, last + 0.5 * step, step):
            window += _lobe((frequency - middle) / step)
        held = power * window
        total, squares = float(held.sum()), float(np.sum(held**2))
        if not (total > 0 and squares > 0):
            return 0.0, 0.5 * (first + last), 1.0
        share = 2.0 * total**2 / squares * float(np.sum(window**2)) / float(window.sum()) ** 2
        return total, float(np.sum(held * frequency)) / total, 1.0 if share > _FULL else share

    def seen_by_bins(self, frequency: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
        """Power, and frequency of the power [Hz], that each bin of a Hann window sees, its bins a step [Hz] apart."""
        count = int(2.0 * _LOBE * step / self.width) + 3
        parts = []
        for some in np.array_split(frequency, max(1, frequency.size * count // _AT_A_TIME)):
            first = np.maximum(1, ((some - _LOBE * step) / self.width).astype(int))
            places = first[:, None] + np.arange(count)
            fine = self.width * places
            power = self.power.take(places, mode="clip") * (places < self.power.size)
            held = power * _lobe((fine - some[:, None]) / step)
            total = held.sum(axis=1)
            middle = (held * fine).sum(axis=1) / np.where(total > 0, total, 1.0)
            parts.append((total, np.where(total > 0, middle, some)))
        power, middle = map(np.concatenate, zip(*parts, strict=True))
        return power, middle


def segment_of(length: float, lowest: float, count: int = MANY) -> float:
    """Length [s] of `count` segments of a record [s], at least four cycles of the lowest frequency [Hz]."""
    return max(2.0 * length / (count + 1.0), CYCLES / lowest)


def _lobe(apart: FloatArray) -> FloatArray:
    """Power of a Hann window in its main lobe, some bins off its middle."""
    x = np.where(np.abs(np.abs(apart) - 1.0) < 1e-6, 1.0 + 2e-6, apart)
    return np.where(np.abs(apart) < _LOBE, (np.sinc(x) / (1.0 - x**2)) ** 2, 0.0)


def fine_spectrum(track: Track) -> Fine:
    """The spectrum of the whole record of V1, in the scale of a mean over segments; missing samples are zero."""
    motion = track.signals[track.names.index("motion_in")]
    window = hann(motion.size)
    lines = scipy.fft.rfft(motion * window)
    return Fine((lines.real**2 + lines.imag**2) / float(np.sum(window**2)), track.rate / motion.size)


def motion_of(track: Track, segment: float, band: tuple[float, float], fine: Fine) -> Motion:
    r"""The kind of excitation, from the first segments of V1 and the spectrum of the whole record.

    The number of segments that hold the power P is :math:`2\,(\sum P)^2/\sum P^2`, at most all: the power of Gaussian
    noise has a mean square of twice its square.

    Parameters
    ----------
    track : Track
        Channels with the same sampling times.
    segment : float [s]
        Length of a segment.
    band : (float, float) [Hz]
        Lowest and highest frequency.
    fine : Fine
        The spectrum of the whole record.
    """
    size = round(segment * track.rate)
    starts = starts_of(track.present, size)
    starts = starts[:: max(1, starts.size // _MOST)]
    frequency, inside = bins_of(size, track.rate, band)
    motion = track.signals[[track.names.index("motion_in")]]
    lines = lines_of(motion, starts, hann(size), inside)[0]
    power = lines.real**2 + lines.imag**2
    total = power.sum(axis=0)
    held = 2.0 * total**2 / np.maximum((power**2).sum(axis=0), 1e-300)
    step = track.rate / size
    seen, middle = fine.seen_by_bins(frequency, step)
    near = seen * fine.width / (_NOISE_WIDTH * step)
    leaks = near < _NEAR * total / (starts.size * float(np.sum(hann(size) ** 2)))
    foreign = leaks | (np.abs(middle - frequency) > _AWAY * step)
    single = float(total[foreign].sum() / max(total.sum(), 1e-300))
    return Motion(float(foreign.mean()), single, float(min(np.median(held), starts.size)))


def period_of(track: Track, band: tuple[float, float]) -> float | None:
    r"""Period of V1 in a band [s]; None if V1 does not repeat, or has fewer than two periods.

    .. math:: r(\tau) = \frac{\int v(t)\,v(t+\tau)\,dt}{(1 - \tau/T)\int v^2\,dt}

    is the same at all multiples of a period. That of noise falls, in a narrow band slowly.
    """
    motion = track.signals[track.names.index("motion_in")][:_LONGEST]
    size = scipy.fft.next_fast_len(2 * motion.size, real=True)
    lines = scipy.fft.rfft(motion, size)
    frequency = np.arange(lines.size) * track.rate / size
    lines[(frequency < band[0]) | (frequency > band[1])] = 0.0
    alike = scipy.fft.irfft(lines.real**2 + lines.imag**2, size)[: motion.size // 2 + 1]
    alike /= max(float(alike[0]), 1e-300) * (1.0 - np.arange(alike.size) / motion.size)
    least = int(np.ceil(track.rate / band[0]))
    if alike.size < least + 2 or not (largest := float(alike[least:-1].max())) > _ALIKE:
        return None
    first = least + int(np.argmax(alike[least:-1] > _LASTING * largest))
    while first < alike.size - 2 and alike[first + 1] > alike[first]:
        first += 1
    lag, count = float(first), 1
    while 2.0 * lag < alike.size - 2:
        lag, count = _peak(alike, 2.0 * lag), 2 * count
    if not alike[round(lag)] > _LASTING * alike[first]:
        return None
    lag = _repeats_after(motion, round(lag))
    whole = round(lag / count)
    return (whole if abs(lag - whole * count) < _WHOLE else lag / count) / track.rate


def _repeats_after(motion: FloatArray, lag: int) -> float:
    r"""The lag at which a motion repeats, near a lag in samples: where v(t + lag) - v(t) has nothing of dv/dt.

    The peak of a correlation is off as far as the motion at both ends of the record is not that of its middle.
    """
    change, slope = motion[lag:] - motion[: motion.size - lag], np.gradient(motion)[: motion.size - lag]
    return lag - float(change @ slope) / max(float(slope @ slope), 1e-300)


def _peak(values: FloatArray, near: float) -> float:
    """Place of the largest value near a place, by a parabola."""
    low = max(1, round(near) - 2)
    top = min(low + int(np.argmax(values[low : round(near) + 3])), values.size - 2)
    below, here, above = values[top - 1 : top + 2].tolist()
    bend = below - 2.0 * here + above
    return top + (0.5 * (below - above) / bend if bend < 0 else 0.0)
