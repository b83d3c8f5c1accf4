"""Corrections of the amplitudes: the responses of the channels, and the cross-talk between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.chain import Calibrated, Delay, Link
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import DERIVATIVES, Channel, Recording
from fourpole.errors import RecordingError


@dataclass(frozen=True)
class Correction:
    """One correction of an amplitude.

    Attributes
    ----------
    channel : str
        Role of the channel.
    name : str
        Its cause, as in 'delay', 'high-pass' or 'cross-talk of motion_in'.
    gain, phase : float [1], [rad]
        Modulus and phase of recorded over true amplitude at the test's frequency. For cross-talk, those of the
        amplitude recorded per amplitude of the source, in SI units.
    gain_std, phase_std : float [1], [rad]
        Their standard uncertainties.
    """

    channel: str
    name: str
    gain: float
    phase: float
    gain_std: float = 0.0
    phase_std: float = 0.0


def links_of(channel: Channel) -> tuple[Link, ...]:
    """The links of a channel's measurement chain, its delay first."""
    return (*((Delay(channel.delay),) if channel.delay else ()), *channel.chain)


def corrections_of(recording: Recording, names: Sequence[str], omega: float) -> list[Correction]:
    """Corrections for the chains of some channels at omega [rad/s]; RecordingError outside a calibration's range."""
    frequency = omega / (2 * np.pi)
    rows = []
    for name in names:
        for link in links_of(recording.channels[name]):
            response = complex(link.at(frequency))
            std = link.std_at(frequency) if isinstance(link, Calibrated) else (0.0, 0.0)
            rows.append(Correction(name, link.name, abs(response), float(np.angle(response)), *std))
    return rows


def response_std(corrections: Sequence[Correction]) -> FloatArray:
    """Standard uncertainties (3, 2) of the gains [1] and phases [rad] of F1, V1, V2 after the corrections."""
    result = np.zeros((3, 2))
    for row in corrections:
        place = CHANNELS.index(row.channel)
        result[place] = np.hypot(result[place], (row.gain_std, row.phase_std))
    return result


def without_crosstalk(
    recording: Recording, names: Sequence[str], omega: float
) -> tuple[ComplexArray, list[Correction]]:
    r"""The matrix (channels, channels) that removes declared cross-talk from the amplitudes, and its corrections.

    It inverts :math:`X_i = A_i + \sum_j c_{ij} (j\omega)^{d_i - d_{ij}} A_j`, where A are the true forces and
    velocities. The exponents d count the derivatives that turn the recorded quantity of channel i, and the quantity
    that its cross-talk refers to, into a velocity.
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
    return np.asarray(np.linalg.inv(mixing) if rows else mixing), rows
