"""Checks of all lines of a recording together: noise that channels share, and F1 against V2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Verdict, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.spectra.excited import Excited

#: Pairs of channels in the order of the closure phase.
_NAMES = (("F1", "V1"), ("V1", "V2"), ("V2", "F1"))
#: Fewest lines that are looked at together, and the uncertainty of a ratio above which a line is left out [1].
_FEWEST, _KNOWN = 8, 0.1
#: Standard uncertainty of Zr, over its largest part, that a chain of masses and springs has of any rig [1].
_DISCREPANCY = 0.01
#: Error of a cross spectrum by shared noise that is worth a warning [1].
_SMALL = 3e-3
#: Share of the chi-square that a delay must explain to be named.
_EXPLAINS = 0.8
#: Number of stated causes: values of the rig, gain, phase and delay.
_STATED = len(PARAMETERS) + 3


def check_shared_noise(found: Excited) -> list[Check]:
    """Check the correlation of the noises of two channels over all lines; a chi-square of two degrees of freedom.

    An error of the cross spectra below 0.3 % is no warning. Leakage is of this size, and is in the uncertainty.
    """
    if found.driven or not np.isfinite(found.closure).all():
        return []
    limit = float(stats.chi2.isf(SEARCH_CHANCE / len(_NAMES), 2))
    at = int(np.argmax(found.shared[:, 2]))
    size, std, statistic, error = found.shared[at].tolist()
    if not (statistic > limit and error > _SMALL):
        return [Check(Code.SHARED, Verdict.OK, statistic, limit)]
    return [
        reported(
            Code.SHARED, Verdict.WARNING, statistic, limit, pair=_NAMES[at], size=size, std=std, percent=100 * error
        )
    ]


@dataclass(frozen=True)
class Sensors:
    """Standard uncertainties of the channels F1 and V2.

    Attributes
    ----------
    gain : (float, float) [1]
        Relative uncertainties of the gains.
    phase : (float, float) [rad]
        Uncertainties of phase errors that are the same at all frequencies.
    delay : (float, float) [s]
        Uncertainties of the delays of the samples.
    """

    gain: tuple[float, float]
    phase: tuple[float, float]
    delay: tuple[float, float]


def check_pooled(found: Excited, rig: Rig, added_mass: float, sensors: Sensors) -> list[Check]:
    r"""Compare F1 with Zr V2 over all lines of a recording.

    The chi-square is that of :math:`\ln(F_1/(Z_r V_2))` with the noise of each line, the uncertainties of the rig and
    of both channels as stated, and 1 % of the largest part of Zr for what a chain of masses and springs does not have.
    A delay of one channel is named if it explains the departure.
    """
    omega = found.phasors.omega
    f1, v1, v2 = found.phasors.amplitudes.T
    impedance = np.asarray(rig.impedance(omega, added_mass))
    force = f1 - 1j * omega * rig.input_mass * v1
    used = np.isfinite(v2) & (found.relative.max(axis=1) < _KNOWN) & ~np.broadcast_to(found.foreign, v2.shape)
    if rig.blocked or used.sum() < _FEWEST:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.log(force / (impedance * v2))
        largest = np.maximum(omega * (rig.moving_mass + added_mass), rig.preload_stiffness / omega) / np.abs(impedance)
        slopes = rig.impedance_gradient(omega, added_mass)[:, :-1] / impedance[:, None] * rig.uncertainties
    noise = np.sqrt(_noise(found) + (_DISCREPANCY * largest)[:, None] ** 2)
    gain, phase, delay = (float(np.hypot(*one)) for one in (sensors.gain, sensors.phase, sensors.delay))
    columns = [*slopes.T, np.full(omega.shape, gain), np.full(omega.shape, 1j * phase), 1j * delay * omega]
    statistic, _ = _left(off[used], noise[used], columns, used)
    late, tau = _left(off[used], noise[used], [*columns, 1j * omega], used)
    count = 2 * int(used.sum())
    limit = float(stats.chi2.isf(SEARCH_CHANCE, count)) / count
    if not statistic / count > limit:
        return [Check(Code.POOLED, Verdict.OK, statistic / count, limit)]
    size = float(np.sqrt(np.mean(np.abs(off[used]) ** 2)))
    delay = tau if statistic - late > _EXPLAINS * statistic else np.nan
    return [reported(Code.POOLED, Verdict.WARNING, statistic / count, limit, percent=100 * size, delay=delay)]


def _noise(found: Excited) -> FloatArray:
    """Variances (L, 2) of Re and Im of ln(F1/V2) from the noise."""
    f1, _, v2 = found.phasors.amplitudes.T
    turn = np.zeros((f1.size, 2, 6))
    for place, slope in ((0, 1.0 / f1), (4, -1.0 / v2)):
        turn[:, 0, place], turn[:, 0, place + 1] = slope.real, -slope.imag
        turn[:, 1, place], turn[:, 1, place + 1] = slope.imag, slope.real
    return np.asarray(np.einsum("lii->li", turn @ found.phasors.covariance @ turn.transpose(0, 2, 1)))


def _left(
    off: ComplexArray, noise: FloatArray, columns: Sequence[ComplexArray], used: np.ndarray
) -> tuple[float, float]:
    """Chi-square of the departures beyond their known causes, each of unit variance, and the last of these; a column
    beyond the stated ones is free.
    """
    rows = np.concatenate([off.real / noise[:, 0], off.imag / noise[:, 1]])
    design = np.stack([np.concatenate([one[used].real / noise[:, 0], one[used].imag / noise[:, 1]]) for one in columns])
    prior = np.eye(design.shape[0])
    if len(columns) > _STATED:
        prior[-1, -1] = 0.0
    whole = np.concatenate([design.T, prior])
    scale = np.maximum(np.sqrt(np.sum(whole**2, axis=0)), 1e-300)
    wanted = np.concatenate([rows, np.zeros(prior.shape[0])])
    found = np.linalg.lstsq(whole / scale, wanted, rcond=None)[0] / scale
    return float(np.sum((wanted - whole @ found) ** 2)), float(found[-1])
