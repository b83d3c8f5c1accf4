"""Checks of the lines of a recording with many: each by itself, noise that channels share, and F1 against V2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.spectra.excited import Excited

#: Uncertainty of a ratio above which a line is doubtful, and above which the ratio has no mean.
_DOUBTFUL, _LOST = 0.1, 0.3
#: Misfit of the closure phase that is worth a warning.
_MUCH = 4.0
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


def check_line(lines: Excited, index: int) -> Check:
    """Check the uncertainties of F1/V1 and V2/V1 of a line."""
    worst = float(np.nanmax(lines.relative[index]))
    hertz = float(lines.phasors.frequency[index])
    if np.broadcast_to(lines.foreign, lines.averages.shape)[index]:
        return reported(Code.BESIDE, Verdict.REJECTED, hertz=hertz)
    return judged(Code.LINE, worst, _DOUBTFUL, _LOST, hertz=hertz, percent=100 * worst)


def check_closure(lines: Excited) -> Iterator[Check]:
    """Check the closure phase of all lines: its squares over their variances have the mean 1 if noises are independent.

    The limit has the chance of a false alarm that all searches have, and is at least four: uncertainties are enlarged
    by what is below it.
    """
    if np.isfinite(lines.misfit) and not lines.driven:
        count = int(np.isfinite(lines.closure[:, 0]).sum())
        limit = float(stats.chi2.isf(SEARCH_CHANCE, count)) / count
        yield judged(Code.CLOSURE, lines.misfit, max(limit, _MUCH), times=np.sqrt(lines.misfit), length=lines.length)


def check_shared_noise(lines: Excited) -> list[Check]:
    """Check the correlation of the noises of two channels over all lines; a chi-square of two degrees of freedom.

    An error of the cross spectra below 0.3 % is no warning. Leakage is of this size, and is in the uncertainty.
    """
    if lines.driven or not np.isfinite(lines.closure).all():
        return []
    limit = float(stats.chi2.isf(SEARCH_CHANCE / len(_NAMES), 2))
    worst = int(np.argmax(lines.shared[:, 2]))
    size, std, statistic, error = lines.shared[worst].tolist()
    if not (statistic > limit and error > _SMALL):
        return [Check(Code.SHARED, Verdict.OK, statistic, limit)]
    return [
        reported(
            Code.SHARED, Verdict.WARNING, statistic, limit, pair=_NAMES[worst], size=size, std=std, percent=100 * error
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


def check_pooled(lines: Excited, rig: Rig, added_mass: float, sensors: Sensors) -> list[Check]:
    r"""Compare F1 with Zr V2 over all lines of a recording.

    The chi-square is that of :math:`\ln(F_1/(Z_r V_2))` with the noise of each line, the uncertainties of the rig and
    of both channels as stated, and 1 % of the largest part of Zr for what a chain of masses and springs does not have.
    A delay of one channel is named if it explains the departure.
    """
    omega = lines.phasors.omega
    f1, v1, v2 = lines.phasors.amplitudes.T
    impedance = np.asarray(rig.impedance(omega, added_mass))
    force = f1 - 1j * omega * rig.input_mass * v1
    used = np.isfinite(v2) & (lines.relative.max(axis=1) < _KNOWN) & ~np.broadcast_to(lines.foreign, v2.shape)
    if rig.blocked or used.sum() < _FEWEST:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.log(force / (impedance * v2))
        largest = np.maximum(omega * (rig.moving_mass + added_mass), rig.preload_stiffness / omega) / np.abs(impedance)
        slopes = rig.impedance_gradient(omega, added_mass)[:, :-1] / impedance[:, None] * rig.uncertainties
    noise = np.sqrt(_noise(lines) + (_DISCREPANCY * largest)[:, None] ** 2)
    gain, phase, delay = (float(np.hypot(*pair)) for pair in (sensors.gain, sensors.phase, sensors.delay))
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


def _noise(lines: Excited) -> FloatArray:
    """Variances (L, 2) of Re and Im of ln(F1/V2) from the noise."""
    f1, _, v2 = lines.phasors.amplitudes.T
    turn = np.zeros((f1.size, 2, 6))
    for place, slope in ((0, 1.0 / f1), (4, -1.0 / v2)):
        turn[:, 0, place], turn[:, 0, place + 1] = slope.real, -slope.imag
        turn[:, 1, place], turn[:, 1, place + 1] = slope.imag, slope.real
    return np.asarray(np.einsum("lii->li", turn @ lines.phasors.covariance @ turn.transpose(0, 2, 1)))


def _left(
    off: ComplexArray, noise: FloatArray, columns: Sequence[ComplexArray], used: np.ndarray
) -> tuple[float, float]:
    """Chi-square of the departures beyond their known causes, each of unit variance, and the last of these; a column
    beyond the stated ones is free.
    """
    rows = np.concatenate([off.real / noise[:, 0], off.imag / noise[:, 1]])
    design = np.stack(
        [np.concatenate([cause[used].real / noise[:, 0], cause[used].imag / noise[:, 1]]) for cause in columns]
    )
    prior = np.eye(design.shape[0])
    if len(columns) > _STATED:
        prior[-1, -1] = 0.0
    whole = np.concatenate([design.T, prior])
    scale = np.maximum(np.sqrt(np.sum(whole**2, axis=0)), 1e-300)
    wanted = np.concatenate([rows, np.zeros(prior.shape[0])])
    sizes = np.linalg.lstsq(whole / scale, wanted, rcond=None)[0] / scale
    return float(np.sum((wanted - whole @ sizes) ** 2)), float(sizes[-1])
