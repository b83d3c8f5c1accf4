"""Uncertainty of the channels: errors of gain, phase, delay and response, each the same in all tests."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.sources import Kind, Source


@dataclass(frozen=True, eq=False)
class ChannelError(ByValue):
    """One error of a channel, the same in all tests.

    Attributes
    ----------
    source : Source
        The gain, phase or delay, or the gain or phase of a calibrated response.
    unit : str
        SI unit; an error of a calibrated response is in multiples of its stated uncertainty.
    channel : int
        0, 1, 2 for F1, V1, V2.
    std : float
        Standard uncertainty in the unit.
    turn : (N,) complex array
        Change of the logarithm of each test's recorded amplitude per unit of the error.
    """

    source: Source
    unit: str
    channel: int
    std: float
    turn: ComplexArray


@dataclass(frozen=True, eq=False)
class ChannelUncertainty(ByValue):
    """Standard uncertainties of the channels F1, V1, V2; the default of each is 0, an exact channel.

    Attributes
    ----------
    gain, phase : (3,) float arrays [1], [rad]
        Relative standard uncertainty of the gain, and that of the phase. Each has one error at all frequencies.
    delay : (3,) float array [s]
        Standard uncertainty of the delay; its error times omega is an error of the phase.
    response : (N, 3) complex array, optional [1] + j [rad]
        Standard uncertainties of gain and phase of a calibrated response at each test's frequency. One error of each
        applies to all tests, in proportion to these values.

    References
    ----------
    JCGM 100:2008, 5.2.2 (errors that several inputs have in common correlate them).

    Examples
    --------
    Gains known to 1 % and phases to 0.5 degrees:

    >>> unsure = ChannelUncertainty(np.full(3, 0.01), np.radians(np.full(3, 0.5)))
    >>> [error.source.text for error in unsure.errors(np.array([63.0]))][:2]
    ['gain F1', 'phase F1']
    """

    gain: FloatArray = field(default_factory=lambda: np.zeros(3))
    phase: FloatArray = field(default_factory=lambda: np.zeros(3))
    delay: FloatArray = field(default_factory=lambda: np.zeros(3))
    response: ComplexArray | None = None

    def part(self, rows: Any) -> ChannelUncertainty:
        """The uncertainties for some of the tests, by anything that indexes an array."""
        return self if self.response is None else replace(self, response=self.response[rows])

    def errors(self, omega: FloatArray, *, possible: bool = False) -> list[ChannelError]:
        """All errors with an uncertainty, for tests at angular frequencies (N,) [rad/s]; or all that are possible."""
        ones = np.ones(omega.size, dtype=complex)
        listed = []
        for channel, role in enumerate(CHANNELS):
            symbol = SYMBOLS[role]
            listed.append(ChannelError(Source(Kind.GAIN, symbol), "1", channel, float(self.gain[channel]), ones))
            listed.append(
                ChannelError(Source(Kind.PHASE, symbol), "rad", channel, float(self.phase[channel]), 1j * ones)
            )
            listed.append(
                ChannelError(Source(Kind.DELAY, symbol), "s", channel, float(self.delay[channel]), -1j * omega)
            )
            if self.response is not None:
                gain, phase = self.response[:, channel].real, self.response[:, channel].imag
                sources = Source(Kind.RESPONSE_GAIN, symbol), Source(Kind.RESPONSE_PHASE, symbol)
                listed.append(ChannelError(sources[0], "1", channel, float(gain.any()), gain + 0j))
                listed.append(ChannelError(sources[1], "1", channel, float(phase.any()), 1j * phase))
        return [error for error in listed if possible or error.std > 0]

    def covariance(self, amplitudes: ComplexArray, omega: FloatArray) -> FloatArray:
        """Covariance (N, 6, 6) of measured amplitudes (N, 3) from these uncertainties."""
        result = np.zeros((omega.size, 6, 6))
        for error in self.errors(omega):
            result += error_covariance(error, amplitudes)
        return result


def error_covariance(error: ChannelError, amplitudes: ComplexArray) -> FloatArray:
    """Covariance (N, 6, 6) of measured amplitudes (N, 3) from one error."""
    result = np.zeros((len(amplitudes), 6, 6))
    along = parts(amplitudes[:, error.channel] * error.turn * error.std)
    block = slice(2 * error.channel, 2 * error.channel + 2)
    result[:, block, block] = along[:, :, None] * along[:, None, :]
    return result


def parts(values: ComplexArray, axis: int = -1) -> FloatArray:
    """Real and imaginary part of complex values, along a new axis."""
    return np.stack([values.real, values.imag], axis=axis)
