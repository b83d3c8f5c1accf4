"""Uncertainty of the channels: errors of gain, phase, delay and response, each the same in all tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.core.components import component
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.sources import Kind, Source

#: Kinds of error of gain and of phase in one mounting, and with one added mass.
_MOUNTED = ((Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE), (Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE))
#: The channels whose sensors are usually mounted anew so.
_USUALLY = dict(zip(_MOUNTED, ((1,), (0, 2)), strict=True))


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
    low_cut : (3,) float array [Hz]
        Standard uncertainty of the corner of a first-order low-cut; its error over the frequency is an error of phase.
    slope : (3,) float array [1/Hz²]
        Standard uncertainty of a rise of the gain with frequency squared.
    mounting : (3,) complex array [1] + j [rad]
        Part of gain and phase that is another in each mounting of the sensor; `gain` and `phase` contain it.
    remounting : (3,) complex array [1] + j [rad]
        The same for each added mass.
    crosstalk : (3,) float array [1]
        Standard uncertainty of the share of each other channel in this one, over their sizes; for the joint route only.
    response : (N, 3) complex array, optional [1] + j [rad]
        Standard uncertainties of gain and phase of a calibrated response at each test's frequency. One error of each
        applies to all tests, in proportion to these values.
    fixture : (N,) complex array, optional [1]
        Change of log V1 by a fixture as compliant as the specimen is, from `core.fixture.given_way`.
    fixture_std : float [1]
        Standard uncertainty of the compliance of the fixture, in that unit.

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
    low_cut: FloatArray = field(default_factory=lambda: np.zeros(3))
    slope: FloatArray = field(default_factory=lambda: np.zeros(3))
    mounting: ComplexArray = field(default_factory=lambda: np.zeros(3, dtype=complex))
    remounting: ComplexArray = field(default_factory=lambda: np.zeros(3, dtype=complex))
    crosstalk: FloatArray = field(default_factory=lambda: np.zeros(3))
    response: ComplexArray | None = None
    fixture: ComplexArray | None = None
    fixture_std: float = 0.0

    def part(self, rows: Any) -> ChannelUncertainty:
        """The uncertainties for some of the tests, by anything that indexes an array."""
        of_tests = {"response": self.response, "fixture": self.fixture}
        return replace(self, **{name: of_each[rows] for name, of_each in of_tests.items() if of_each is not None})

    def errors(
        self, omega: FloatArray, groups: Sequence[np.ndarray] = (), *, possible: bool = False
    ) -> list[ChannelError]:
        """All errors with an uncertainty, or all that are possible, of tests at angular frequencies (N,) [rad/s].

        `groups` has the number of the mounting and of the added mass of each test, (N,) each; without it, gain and
        phase are the same in all tests.
        """
        listed = []
        for channel, role in enumerate(CHANNELS):
            symbol = SYMBOLS[role]
            apart = [
                (kinds, std[channel], number)
                for kinds, std, number in zip(_MOUNTED, (self.mounting, self.remounting), groups, strict=False)
                if (std[channel] or (possible and channel in _USUALLY[kinds])) and np.unique(number).size > 1
            ]
            for kind, std in self._common(channel, [std for _, std, _ in apart]).items():
                row = component(kind)
                # The unit of a slope is that at the highest frequency.
                scale = (float(omega.max()) / (2 * np.pi)) ** 2 if kind is Kind.SLOPE and omega.size else 1.0
                turn = row.shape.turn(omega) / scale
                listed.append(ChannelError(Source(kind, symbol), row.unit, channel, std * scale, turn))
            if self.response is not None:
                own = self.response[:, channel]
                for kind, turn in ((Kind.RESPONSE_GAIN, own.real + 0j), (Kind.RESPONSE_PHASE, 1j * own.imag)):
                    listed.append(ChannelError(Source(kind, symbol), "1", channel, float(turn.any()), turn))
            for kinds, std, number in apart:
                for each in np.unique(number):
                    own = (number == each) + 0j
                    for kind, part, turn in zip(kinds, (std.real, std.imag), (own, 1j * own), strict=True):
                        error = ChannelError(Source(kind, symbol), component(kind).unit, channel, float(part), turn)
                        listed.append(error)
        if self.fixture is not None:
            source, unit = Source(Kind.FIXTURE, SYMBOLS[CHANNELS[1]]), component(Kind.FIXTURE).unit
            listed.append(ChannelError(source, unit, 1, self.fixture_std, self.fixture))
        return [error for error in listed if possible or error.std > 0]

    def _common(self, channel: int, apart: Sequence[complex]) -> dict[Kind, float]:
        """Standard uncertainty of each error that all tests share, without the parts that are apart."""
        gain, phase = (
            float(np.sqrt(max(whole[channel] ** 2 - sum(part(std) ** 2 for std in apart), 0.0)))
            for whole, part in ((self.gain, np.real), (self.phase, np.imag))
        )
        rest = {Kind.DELAY: self.delay, Kind.LOW_CUT: self.low_cut, Kind.SLOPE: self.slope}
        return {Kind.GAIN: gain, Kind.PHASE: phase, **{kind: float(of_all[channel]) for kind, of_all in rest.items()}}


def error_covariance(error: ChannelError, amplitudes: ComplexArray) -> FloatArray:
    """Covariance (N, 6, 6) of measured amplitudes (N, 3) from one error."""
    result = np.zeros((len(amplitudes), 6, 6))
    along = parts(amplitudes[:, error.channel] * error.turn * error.std)
    block = slice(2 * error.channel, 2 * error.channel + 2)
    result[:, block, block] = along[:, :, None] * along[:, None, :]
    return result
