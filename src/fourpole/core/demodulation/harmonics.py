"""The harmonics of F1, V1 and V2 with their noise: what a linear specimen and a linear rig must explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit
from fourpole.core.demodulation.spectrum import LINE_GAP, Noise, off_multiples

#: Number of harmonics that are kept, with the fundamental; higher ones are weak, and a specimen has modes there.
KEPT = 5


@dataclass(frozen=True, eq=False)
class Harmonics(ByValue):
    """Harmonics of one recording, the fundamental first.

    Attributes
    ----------
    amplitudes : (3, H) complex array [N], [m/s], [m/s]
        Amplitudes of F1, V1, V2; not-a-number for an absent channel.
    std : (3, H) float array [N], [m/s], [m/s]
        Standard uncertainty of the real and of the imaginary part, from the noise beside each harmonic.
    clear : (H,) bool array
        False where hum of the mains is too close to the harmonic.
    """

    amplitudes: ComplexArray
    std: FloatArray
    clear: BoolArray


def harmonics_of(
    fits: Sequence[SineFit],
    noise: Sequence[Noise],
    places: Sequence[int],
    recorded: Sequence[ComplexArray],
    true: Sequence[ComplexArray],
) -> Harmonics:
    """The harmonics of the channels of some fits.

    Parameters
    ----------
    fits : sequence of SineFit
        Final fits of all tracks.
    noise : sequence of Noise
        Noise beside each harmonic that is kept.
    places : sequence of int
        Place of each channel among F1, V1, V2, in the order of the fits.
    recorded, true : sequences of (harmonics,) complex arrays
        Amplitudes of each channel in recorded units, and as force or velocity before the measurement chain.

    Returns
    -------
    Harmonics
        As many as there are noises.
    """
    count = len(noise)
    amplitudes = np.full((3, count), complex(np.nan, np.nan))
    std = np.full((3, count), np.nan)
    frequency = fits[0].omega / (2 * np.pi)
    stds = np.sqrt(0.5 * np.abs([np.diag(one.covariance) for one in noise]))
    for i, (place, raw, whole) in enumerate(zip(places, recorded, true, strict=True)):
        amplitudes[place] = whole[:count]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.abs(whole[:count] / raw[:count])
        std[place] = stds[:, i] * np.where(np.isfinite(scale), scale, 0.0)
    return Harmonics(amplitudes, std, _clear(fits, frequency, count))


def _clear(fits: Sequence[SineFit], frequency: float, count: int) -> BoolArray:
    """Flags (count,) of the harmonics that are no multiple of the mains; other lines stand in the fit themselves."""
    multiples = frequency * np.arange(1, count + 1)
    gap = (LINE_GAP + 1.0) * max(fit.resolution for fit in fits)
    hum = [off_multiples(multiples, base) < gap for base in (50.0, 60.0)]
    return np.asarray(~np.any(hum, axis=0))
