"""The first and the second half of a recording against each other: gains and clocks that drift."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit

#: A part with a larger condition number than this has too little of a cycle.
_WORST = 10.0


def _condition(normal: FloatArray) -> float:
    """Condition number of a positive symmetric matrix (2, 2) [1]."""
    trace, apart = normal[0, 0] + normal[1, 1], np.hypot(normal[0, 0] - normal[1, 1], 2 * normal[0, 1])
    return float((trace + apart) / (trace - apart)) if trace > apart else float("inf")


class _Sums(NamedTuple):
    """Inner products of the fundamental's two rows in equal parts of a recording: (parts, 2, 2), (parts, 2, C)."""

    normal: FloatArray
    right: FloatArray

    def joined(self) -> _Sums:
        """The sums of each two parts."""
        return _Sums(self.normal[0::2] + self.normal[1::2], self.right[0::2] + self.right[1::2])

    def amplitudes(self, fit: SineFit) -> ComplexArray:
        """Amplitudes (channels, parts) of the fundamental; not-a-number for a part with too little of a cycle."""
        found = np.full((len(fit.track.names), len(self.normal)), complex(np.nan, np.nan))
        for i, (normal, right) in enumerate(zip(self.normal, self.right, strict=True)):
            if _condition(normal) < _WORST:
                real, imaginary = np.linalg.solve(normal, right) + fit.coefficients[:2]
                found[:, i] = real + 1j * imaginary
        return found


def _quarters(fit: SineFit) -> _Sums:
    """Inner products in the quarters of a recording, with the residual."""
    pair = np.stack([fit.carrier.real, -fit.carrier.imag])
    if fit.dof + fit.size < pair.shape[1]:
        pair *= fit.track.present
    edges = np.linspace(0, pair.shape[1], 5).astype(int).tolist()
    rows = [(pair[:, low:high], fit.residual[:, low:high]) for low, high in pairwise(edges)]
    return _Sums(np.stack([one @ one.T for one, _ in rows]), np.stack([one @ left.T for one, left in rows]))


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
    sums = [_quarters(fit) for fit in fits]
    halves = np.concatenate([one.joined().amplitudes(fit) for one, fit in zip(sums, fits, strict=True)])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = halves[:, 1] / halves[:, 0]
    changes[list(places), 0], changes[list(places), 1] = np.abs(ratio) - 1.0, np.angle(ratio)
    quarters = sums[0].amplitudes(fits[0])[list(places).index(1)]
    turned = np.angle(quarters[1::2] / quarters[0::2])
    time = fits[0].track.time
    speed = float(np.diff(turned)[0] / (fits[0].omega * 0.25 * (time[-1] - time[0])))
    return changes, speed
