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
    changes = np.full((3, 2), np.nan)
    quarters = [fit.rows.quarters(fit.residual) for fit in fits]
    pairs = [[rows[0::2] + rows[1::2] for rows in products] for products in quarters]
    halves = np.concatenate([_amplitudes(fit, *products) for fit, products in zip(fits, pairs, strict=True)])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = halves[:, 1] / halves[:, 0]
    changes[list(places), 0], changes[list(places), 1] = np.abs(ratio) - 1.0, np.angle(ratio)
    motion = _amplitudes(fits[0], *quarters[0])[list(places).index(1)]
    turned = np.angle(motion[1::2] / motion[0::2])
    time = fits[0].track.time
    speed = float(np.diff(turned)[0] / (fits[0].omega * 0.25 * (time[-1] - time[0])))
    return changes, speed


def _amplitudes(fit: SineFit, normal: FloatArray, right: FloatArray) -> ComplexArray:
    """Amplitudes (channels, parts) of the fundamental; not-a-number for a part with too little of a cycle."""
    values = np.full((len(fit.track.names), len(normal)), complex(np.nan, np.nan))
    for i, matrix in enumerate(normal):
        trace = matrix[0, 0] + matrix[1, 1]
        apart = np.hypot(matrix[0, 0] - matrix[1, 1], 2 * matrix[0, 1])
        if trace > apart and (trace + apart) / (trace - apart) < _WORST:  # the condition number
            real, imaginary = np.linalg.solve(matrix, right[i]) + fit.coefficients[:2]
            values[:, i] = real + 1j * imaginary
    return values
