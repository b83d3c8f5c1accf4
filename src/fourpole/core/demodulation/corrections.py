"""What is undone at the amplitudes: the channels' own responses, and what they show of one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.chain import Calibrated, Delay, Link
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import DERIVATIVES, Channel, Recording
from fourpole.errors import RecordingError

__all__ = ["Correction", "corrections_of", "links_of", "response_std", "without_crosstalk"]


@dataclass(frozen=True)
class Correction:
    """One thing that was undone.

    Attributes
    ----------
    channel : str
        Role.
    name : str
        What it was: delay, high-pass, cross-talk of motion_in.
    gain, phase : float [1], [rad]
        Recorded over true at the test's frequency, by which was divided; of cross-talk, its share of the amplitude.
    gain_std, phase_std : float [1], [rad]
        What is not known of them.
    """

    channel: str
    name: str
    gain: float
    phase: float
    gain_std: float = 0.0
    phase_std: float = 0.0


def links_of(channel: Channel) -> tuple[Link, ...]:
    """All links of a channel's measurement chain, its delay first."""
    return (*((Delay(channel.delay),) if channel.delay else ()), *channel.chain)


def corrections_of(role: str, channel: Channel, omega: float) -> list[Correction]:
    """What a channel's chain does at a frequency; RecordingError where a calibration does not reach."""
    frequency = omega / (2 * np.pi)
    rows = []
    for link in links_of(channel):
        response = complex(link.at(frequency))
        std = link.std_at(frequency) if isinstance(link, Calibrated) else (0.0, 0.0)
        rows.append(Correction(role, link.name, abs(response), float(np.angle(response)), *std))
    return rows


def response_std(corrections: Sequence[Correction]) -> FloatArray:
    """What corrections leave unknown of F1, V1, V2, (3, 2): relative gain [1] and phase [rad]."""
    result = np.zeros((3, 2))
    for row in corrections:
        at = CHANNELS.index(row.channel)
        result[at] = np.hypot(result[at], (row.gain_std, row.phase_std))
    return result


def without_crosstalk(
    recording: Recording, names: Sequence[str], omega: float
) -> tuple[ComplexArray, list[Correction]]:
    r"""The matrix (channels, channels) that takes declared cross-talk out of the amplitudes, and its record.

    With :math:`X_i = A_i + \sum_j c_{ij} (j\omega)^{d_i - d_{ij}} A_j`, A the true forces and velocities, d the
    derivatives that make a velocity of what the channel records and of what its cross-talk counts as.
    """
    mixing = np.eye(len(names), dtype=complex)
    rows = []
    for i, name in enumerate(names):
        channel = recording.channels[name]
        for talk in channel.crosstalk:
            if talk.source not in names:
                symbol, source = SYMBOLS[name], SYMBOLS[talk.source]
                raise RecordingError(f"cross-talk of {source} in {symbol} cannot be taken out without {source}")
            power = DERIVATIVES[channel.quantity] - DERIVATIVES[talk.quantity]
            share = talk.coefficient * (1j * omega) ** power
            mixing[i, names.index(talk.source)] += share
            rows.append(Correction(name, f"cross-talk of {talk.source}", abs(share), float(np.angle(share))))
    return np.asarray(np.linalg.inv(mixing), dtype=complex), rows
