"""What a recording holds beside its fundamental, over frequency: a look for hum, harmonics and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.recording import Channel, Recording

#: Largest number of samples of a channel that are looked at, from its middle.
_MOST = 1 << 18
#: Largest number of lines that are shown; of more, the largest of neighbours is.
_LINES = 1000


@dataclass(frozen=True, eq=False)
class ResidualSpectrum(ByValue):
    """The residual of one channel.

    Attributes
    ----------
    frequency : (n,) float array [Hz]
    amplitude : (n,) float array [the channel's SI unit]
        Amplitude of a sine that would show this line, 0 to peak.
    """

    frequency: FloatArray
    amplitude: FloatArray


def residual_spectrum(recording: Recording, frequency: float, role: str) -> ResidualSpectrum:
    """Spectrum of a channel less its mean and its fundamental.

    The fundamental is the least-squares fit of a sine at the frequency; the window is Hann's, so that a line has its
    amplitude at its peak within 15 %.

    Parameters
    ----------
    recording : Recording
    frequency : float [Hz]
        Frequency of the fundamental.
    role : str
        The channel: force_in, motion_in or motion_out.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> hum = 0.01 * np.cos(2 * np.pi * 50 * t)
    >>> recording = Recording.from_arrays(t, force_in=hum, motion_in=np.cos(62.8 * t) + hum)
    >>> found = residual_spectrum(recording, 62.8 / (2 * np.pi), "motion_in")
    >>> peak = int(np.argmax(found.amplitude))
    >>> round(float(found.frequency[peak])), round(float(found.amplitude[peak]), 4)
    (50, 0.01)
    """
    samples, rate = _middle(recording.channels[role]), recording.base(role)[0]
    t = np.arange(samples.size) / rate
    waves = np.stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t), np.ones_like(t)], axis=1)
    residual = samples - waves @ np.linalg.lstsq(waves, samples, rcond=None)[0]
    window = np.hanning(samples.size)
    amplitude = 2 * np.abs(np.fft.rfft(residual * window)) / window.sum()
    return _thinned(np.fft.rfftfreq(samples.size, 1 / rate), amplitude)


def _middle(channel: Channel) -> FloatArray:
    """The middle samples of a channel; missing ones have the mean."""
    begin = max(0, (channel.samples.size - _MOST) // 2)
    samples = channel.samples[begin : begin + _MOST]
    return np.where(np.isfinite(samples), samples, np.nanmean(samples))


def _thinned(frequency: FloatArray, amplitude: FloatArray) -> ResidualSpectrum:
    step = -(-frequency.size // _LINES)
    edges = np.arange(0, frequency.size, step)
    if step == 1:
        return ResidualSpectrum(frequency, amplitude)
    highest = [begin + int(np.argmax(amplitude[begin : begin + step])) for begin in edges]
    return ResidualSpectrum(frequency[highest], amplitude[highest])
