"""Sensors: the measurement chain from a motion or force to the numbers in a file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import FloatArray


@dataclass(frozen=True)
class Sensor:
    r"""A channel with its errors; by default it has none.

    .. math:: r(t) = \pm (1 + \epsilon)\,s\,y(t - \tau) + r_0 + drift + hum + noise

    The result is clipped at the full scale and rounded to the steps of the converter. `scale` s converts SI units to
    the recorded unit; all other amplitudes are in the recorded unit.

    Parameters
    ----------
    scale : float [recorded/SI]
        Recorded value per SI value: 1e-3 for a force recorded in kN.
    gain_error : float [1]
        epsilon.
    delay : float [s]
        tau: the delay of the samples, which may be negative.
    invert : bool
        Whether the sign is inverted.
    offset : float
        r_0.
    drift, drift_period, drift_phase : float, float [s], float [rad]
        Amplitude, period and phase of a slow sine.
    hum, hum_phase : float, float [rad]
        Amplitude and phase of mains hum at 50 Hz; a third of the amplitude is added at 150 Hz.
    noise, pink : float
        Root mean square of white noise and of 1/f noise.
    full_scale, bits : float, int
        The converter has 2**bits steps from -full_scale to +full_scale; with bits = 0 there is no converter.

    Examples
    --------
    >>> fine = np.sin(2 * np.pi * 10.0 * np.arange(-8, 1008) / 1000.0)
    >>> times = np.arange(100) / 100.0
    >>> late = Sensor(delay=1e-3).record(fine, start=-0.008, step=0.001, times=times)
    >>> float(late[1].round(6)) == float(np.sin(2 * np.pi * 10.0 * 0.009).round(6))
    True
    """

    scale: float = 1.0
    gain_error: float = 0.0
    delay: float = 0.0
    invert: bool = False
    offset: float = 0.0
    drift: float = 0.0
    drift_period: float = 10.0
    drift_phase: float = 0.0
    hum: float = 0.0
    hum_phase: float = 0.0
    noise: float = 0.0
    pink: float = 0.0
    full_scale: float = np.inf
    bits: int = 0

    def record(
        self,
        signal: FloatArray,
        *,
        start: float,
        step: float,
        times: FloatArray,
        rng: np.random.Generator | None = None,
    ) -> FloatArray:
        """The record of a `signal` that begins at `start` and has a sample every `step`.

        Parameters
        ----------
        signal : (n,) float array [SI]
            Samples of the motion or force.
        start, step : float [s]
            Time of the first sample, and sampling interval.
        times : (k,) float array [s]
            Uniform times of the record.
        rng : numpy.random.Generator
            Source of the noise; a sensor with noise needs it.

        Returns
        -------
        (k,) float array [as recorded]

        Raises
        ------
        ValueError
            If `times` with the delay lie outside the signal, or if a sensor with noise has no `rng`.
        """
        factor = self.scale * (1.0 + self.gain_error) * (-1.0 if self.invert else 1.0)
        recorded = factor * sample(signal, start=start, step=step, times=times - self.delay)
        if self.offset:
            recorded += self.offset
        if self.drift:
            recorded += self.drift * np.sin(2.0 * np.pi / self.drift_period * times + self.drift_phase)
        if self.hum:
            mains = 2.0 * np.pi * 50.0 * times + self.hum_phase
            recorded += self.hum * (np.sin(mains) + np.sin(3.0 * mains) / 3.0)
        if self.noise or self.pink:
            if rng is None:
                raise ValueError("a sensor with noise needs a random generator")
            recorded += self.noise * rng.standard_normal(times.size)
            if self.pink:
                recorded += self.pink * _pink(times.size, rng)
        if self.bits:
            lsb = 2.0 * self.full_scale / 2**self.bits
            levels = np.clip(np.rint(recorded / lsb), -(2 ** (self.bits - 1)), 2 ** (self.bits - 1) - 1)
            recorded = levels * lsb
        return recorded


def sample(signal: FloatArray, *, start: float, step: float, times: FloatArray) -> FloatArray:
    """Values of a smooth, finely sampled `signal` at other `times` [s], by six-point Lagrange interpolation.

    The error is at most (omega step)^6/200 of the amplitude: 4e-12 at 24 Hz in steps of 0.2 ms.

    Examples
    --------
    >>> fine = np.sin(np.arange(0.0, 2.0, 0.01))
    >>> abs(float(sample(fine, start=0.0, step=0.01, times=np.array([0.5037]))[0] - np.sin(0.5037))) < 1e-12
    True
    """
    position = (times - start) / step
    nearest = np.rint(position)
    if np.abs(position - nearest).max() < 1e-6:  # the times lie on the grid, apart from round-off
        index = nearest.astype(int)
        if index.min() < 0 or index.max() >= signal.size:
            raise ValueError(_beyond(signal, start, step, times))
        chosen: FloatArray = signal[index]
        return chosen
    index = np.floor(position).astype(int)
    if index.min() < 2 or index.max() + 3 >= signal.size:
        raise ValueError(_beyond(signal, start, step, times))
    s = position - index
    nodes = (-2, -1, 0, 1, 2, 3)
    value: FloatArray = np.zeros_like(s)
    for node in nodes:
        weight = np.ones_like(s)
        for other in nodes:
            if other != node:
                weight *= (s - other) / (node - other)
        value += weight * signal[index + node]
    return value


def _beyond(signal: FloatArray, start: float, step: float, times: FloatArray) -> str:
    """The message for times outside a signal."""
    end = start + (signal.size - 1) * step
    return (
        f"samples from {times.min():.6g} to {times.max():.6g} s are needed, the signal reaches from {start:.6g} "
        f"to {end:.6g} s, and interpolation needs three points more on each side; make the signal longer"
    )


def _pink(count: int, rng: np.random.Generator) -> FloatArray:
    """Noise (count,) of unit root mean square, whose power is proportional to 1/f."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum[0] = 0.0
    spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
    noise = np.fft.irfft(spectrum, count)
    return np.asarray(noise / np.sqrt(np.mean(noise * noise)))
