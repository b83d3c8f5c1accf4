"""The first and the second half of a recording against each other: gains and clocks that drift."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit


def parts_of(fit: SineFit, parts: int) -> ComplexArray:
    """Amplitudes (channels, parts) of the fundamental in equal parts of the recording."""
    track = fit.track
    pair = fit.basis[:2]
    signals = fit.residual + fit.coefficients[:2].T @ pair
    edges = np.linspace(0, track.time.size, parts + 1).astype(int)
    found = np.full((signals.shape[0], parts), complex(np.nan, np.nan))
    for i, (low, high) in enumerate(pairwise(edges)):
        basis = pair[:, low:high]
        normal = basis @ basis.T
        if np.linalg.cond(normal) < 10.0:
            real, imaginary = np.linalg.solve(normal, basis @ signals[:, low:high].T)
            found[:, i] = real + 1j * imaginary
    return found


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
    halves = np.concatenate([parts_of(fit, 2) for fit in fits])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = halves[:, 1] / halves[:, 0]
    changes[list(places), 0], changes[list(places), 1] = np.abs(ratio) - 1.0, np.angle(ratio)
    quarters = parts_of(fits[0], 4)[list(places).index(1)]
    turned = np.angle(quarters[1::2] / quarters[0::2])
    time = fits[0].track.time
    speed = float(np.diff(turned)[0] / (fits[0].omega * 0.25 * (time[-1] - time[0])))
    return changes, speed
