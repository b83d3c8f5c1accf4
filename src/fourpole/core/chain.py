"""Measurement chains: the frequency responses of sensors, amplifiers and filters.

Each link has `at(frequency)`, the recorded over the true amplitude for the time factor e^{+jwt}. The response of a
channel is the product of its links.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import RecordingError


class Link(Protocol):
    """One link of a measurement chain."""

    @property
    def name(self) -> str:
        """Name of the link in tables."""

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true amplitude [1] at frequencies (...,) [Hz], > 0."""


@dataclass(frozen=True)
class Delay:
    r"""A delay of a channel: :math:`H = e^{-j\omega\tau}`.

    Parameters
    ----------
    seconds : float [s]
        ``recorded(t) = true(t - seconds)``.

    Examples
    --------
    >>> np.angle(Delay(1e-3).at(10.0), deg=True).round(6)
    np.float64(-3.6)
    """

    seconds: float
    name: str = "delay"

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true amplitude [1]."""
        return np.asarray(np.exp(-2j * np.pi * np.asarray(frequency) * self.seconds))


@dataclass(frozen=True)
class HighPass:
    r"""A Butterworth high-pass, as in an IEPE sensor; of first order :math:`H = js/(1 + js)`, s = f/corner.

    Parameters
    ----------
    corner : float [Hz]
        Frequency at which the amplitude has fallen by 3 dB; > 0.
    order : int
        Order of the filter; >= 1.

    References
    ----------
    S. Butterworth, "On the theory of filter amplifiers", 1930.

    Examples
    --------
    >>> abs(HighPass(0.5).at(10.0)).round(4), np.angle(HighPass(0.5).at(10.0), deg=True).round(2)
    (np.float64(0.9988), np.float64(2.86))
    """

    corner: float
    order: int = 1
    name: str = "high-pass"

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true amplitude [1]."""
        return _butterworth(self.corner / (1j * np.asarray(frequency, dtype=float)), self.order)


@dataclass(frozen=True)
class LowPass:
    r"""A Butterworth low-pass, as an amplifier's filter: of first order :math:`H = 1/(1 + js)`, s = f/corner.

    Parameters
    ----------
    corner : float [Hz]
        Frequency at which the amplitude has fallen by 3 dB; > 0.
    order : int
        Order of the filter; >= 1.

    Examples
    --------
    >>> abs(LowPass(100.0, 2).at(100.0)).round(4), np.angle(LowPass(100.0, 2).at(100.0), deg=True).round(6)
    (np.float64(0.7071), np.float64(-90.0))
    """

    corner: float
    order: int = 1
    name: str = "low-pass"

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true amplitude [1]."""
        return _butterworth(1j * np.asarray(frequency, dtype=float) / self.corner, self.order)


def _butterworth(s: ComplexArray, order: int) -> ComplexArray:
    """1/B(s) of a Butterworth polynomial, whose roots lie on the left half of the unit circle."""
    angles = np.pi * (2 * np.arange(1, order + 1) + order - 1) / (2 * order)
    return np.asarray(1.0 / np.prod(s[..., None] - np.exp(1j * angles), axis=-1))


@dataclass(frozen=True)
class Geophone:
    r"""A sensor of velocity above its natural frequency: :math:`H = -r^2 / (1 - r^2 + 2j\zeta r)`, r = f/f0.

    Its sign is that of a velocity well above f0.

    Parameters
    ----------
    natural_frequency : float [Hz]
        f0; > 0.
    damping : float [1]
        Damping ratio zeta; > 0.

    References
    ----------
    Base excitation of a mass on a spring; the terms are those of ISO 2041.

    Examples
    --------
    >>> Geophone(4.5, 0.7).at(4500.0).round(2)
    np.complex128(1+0j)
    """

    natural_frequency: float
    damping: float
    name: str = "geophone"

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true amplitude [1]."""
        r = np.asarray(frequency, dtype=float) / self.natural_frequency
        return np.asarray(-(r**2) / (1 - r**2 + 2j * self.damping * r))


@dataclass(frozen=True, eq=False)
class Calibrated(ByValue):
    """A calibrated response, with linear interpolation of gain and phase between its frequencies.

    Parameters
    ----------
    frequency : (n,) float array [Hz]
        Frequencies of the calibration, rising; n >= 1.
    gain, phase : (n,) float arrays [1], [rad]
        Modulus and phase of recorded over true amplitude; the phase has no jumps.
    gain_std, phase_std : (n,) float arrays [1], [rad]
        Standard uncertainties of gain (relative) and phase; one error of each applies to all frequencies, in proportion
        to these values.
    name : str
        Name of the link in tables and messages.

    Raises
    ------
    RecordingError
        If the frequencies do not rise, or a gain is not positive.

    Examples
    --------
    >>> response = Calibrated(np.array([5.0, 50.0]), np.array([0.99, 1.0]), np.array([0.02, 0.0]))
    >>> abs(response.at(27.5)).round(6), response.std_at(27.5)
    (np.float64(0.995), (0.0, 0.0))
    """

    frequency: FloatArray
    gain: FloatArray
    phase: FloatArray
    gain_std: FloatArray = field(default_factory=lambda: np.zeros(1))
    phase_std: FloatArray = field(default_factory=lambda: np.zeros(1))
    name: str = "response"

    def __post_init__(self) -> None:
        if self.frequency.size == 0 or np.any(np.diff(self.frequency) <= 0) or self.frequency[0] <= 0:
            raise RecordingError(f"{self.name}: its frequencies must be positive and rise from row to row")
        if not np.all(self.gain > 0):
            raise RecordingError(f"{self.name}: its gains must be positive; a reversed sensor has invert = true")

    def at(self, frequency: ArrayLike) -> ComplexArray:
        """Recorded over true [1]; frequencies beyond the ends, as of harmonics, have the values at the ends."""
        hertz = np.asarray(frequency, dtype=float)
        gain, phase = (np.interp(hertz, self.frequency, part) for part in (self.gain, self.phase))
        return np.asarray(gain * np.exp(1j * phase), dtype=complex)

    def std_at(self, frequency: float) -> tuple[float, float]:
        """Standard uncertainty of the gain, relative [1], and of the phase [rad].

        Raises
        ------
        RecordingError
            If the frequency lies outside the range of the calibration.
        """
        low, high = float(self.frequency[0]), float(self.frequency[-1])
        if not low * (1 - 1e-9) <= frequency <= high * (1 + 1e-9):
            raise RecordingError(
                f"{self.name} is known from {low:g} to {high:g} Hz, the test is at {frequency:.5g} Hz: "
                "calibrate the sensor there, or leave the test out"
            )
        stds = (np.broadcast_to(std, self.frequency.shape) for std in (self.gain_std, self.phase_std))
        gain, phase = (float(np.interp(frequency, self.frequency, std)) for std in stds)
        return gain, phase
