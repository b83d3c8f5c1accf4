"""The first and the second half of a recording against each other: gains and clocks that drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit

#: A part with a larger condition number than this has too little of a cycle.
_WORST = 10.0


def changes_of(fits: Sequence[SineFit], places: Sequence[int]) -> tuple[FloatArray, float]:
    """Change of each channel from the first half to the second, and that of the speed.

    Parameters
    ----------
    fits : sequence of SineFit
        Final fits of all tracks, V1 in the first.
    places : sequence of int
        Place of each channel among F1, V1, V2, in the order of the fits.

    Returns
    -------
    (3, 2) float array [1], [rad]
        Relative change of the amplitude, and change of the phase; not-a-number for an absent channel.
    float [1]
        Relative change of the speed of V1.
    """
    changes, parts = np.full((3, 2), np.nan), []
    for fit in fits:
        normal, right = fit.rows.quarters(fit.residual)
        halves = [np.concatenate([rows, rows[0::2] + rows[1::2]]) for rows in (normal, right)]
        parts.append(_amplitudes(fit, *halves))
    amplitudes = np.concatenate(parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = amplitudes[:, 5] / amplitudes[:, 4]
        motion = amplitudes[list(places).index(1)]
        turned = np.angle(motion[1:4:2] / motion[0:4:2]).tolist()
    changes[list(places), 0], changes[list(places), 1] = np.abs(ratio) - 1.0, np.angle(ratio)
    time = fits[0].track.time
    return changes, (turned[1] - turned[0]) / (fits[0].omega * 0.25 * float(time[-1] - time[0]))


def _amplitudes(fit: SineFit, normal: FloatArray, right: FloatArray) -> ComplexArray:
    """Amplitudes (channels, parts) of the fundamental; not-a-number for a part with too little of a cycle.

    From inner products of its two rows, with themselves (parts, 2, 2) and with the residual (parts, 2, channels).
    """
    first, both, second = normal[:, 0, 0], normal[:, 0, 1], normal[:, 1, 1]
    trace, apart = first + second, np.hypot(first - second, 2 * both)
    short = (trace + apart) >= _WORST * (trace - apart)  # the condition number
    determinant = np.where(short, np.nan, first * second - both**2)
    inverse = np.stack([second, -both, -both, first], axis=1) / determinant[:, None]
    found = inverse.reshape(-1, 2, 2) @ right + fit.coefficients[:2]
    return np.asarray((found[:, 0] + 1j * found[:, 1]).T)
