"""K1 against K': a static test of another unit or specimen, a V1 of another unit or sign, and K1 exchanged."""

from __future__ import annotations

from math import atan, exp, log, pi

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Looks, Verdict, judged, reported
from fourpole.core.phasor import Phasors
from fourpole.core.routes import relative_route

#: Frequency of a slow static test [Hz]. Above it K' rises with frequency as fast as its loss factor allows.
_STATIC = 1e-3
#: Largest plausible K' over K1, in units of that rise, and smallest plausible K' over K1: errors of 50 and 20 % pass.
_ABOVE, _BELOW = 1.5, 0.8
#: Least relative difference of (K' - K1)/K'' that may come from exchanged K1, and the largest one after it: of
#: two specimens, and of two states of one specimen.
_SPECIMENS, _STATES = (0.5, 0.15), (0.3, 0.15)
#: Mistakes in V1 by the factor that corrects them.
_MISTAKES = {
    -1.0: Looks.V1_INVERTED,
    9.80665: Looks.V1_IN_G,
    1 / 9.80665: Looks.V1_TIMES_G,
    1000.0: Looks.V1_IN_M,
    1e-3: Looks.V1_IN_MM,
}


def check_scale(phasors: Phasors, stiffness: complex, k1: float, *, motion: bool = True) -> Check | None:
    """Compare K' of a test by itself with K1; None if either is unknown.

    Parameters
    ----------
    phasors : Phasors
        Amplitudes of the test.
    stiffness : complex [N/m]
        K* of the test by itself.
    k1 : float [N/m]
        Its static stiffness.
    motion : bool
        Whether a mistake in V1 is looked for.

    Returns
    -------
    Check or None
        A warning of V1's scale, of a K1 that is too large or of one that is too small; else ok.
    """
    if not (np.isfinite(stiffness) and np.isfinite(k1) and k1 > 0):
        return None
    frequency, ratio = float(phasors.frequency), stiffness.real / k1
    if is_plausible(stiffness, k1, frequency):
        return Check(Code.K1_RATIO, Verdict.OK, ratio, largest_ratio(stiffness, frequency))
    f1, v1, v2 = (complex(amplitude) for amplitude in phasors.amplitudes)
    if motion and np.isfinite(v2):
        factors = [
            factor
            for factor in _MISTAKES
            if is_plausible(complex(relative_route(f1, factor * v1, v2, float(phasors.omega))), k1, frequency)
        ]
        if len(factors) == 1:
            return reported(Code.V1_SCALE, Verdict.WARNING, ratio, looks=_MISTAKES[factors[0]])
    if 0 < ratio < _BELOW:
        return reported(Code.K1_LARGE, Verdict.WARNING, ratio, _BELOW, times=1 / ratio)
    loss = stiffness.imag / stiffness.real if stiffness.real else 0.0
    return judged(Code.K1_RATIO, ratio, largest_ratio(stiffness, frequency), loss=loss)


def largest_ratio(stiffness: complex, frequency: float) -> float:
    r"""Largest plausible K' over K1 [1] for K* [N/m] at a frequency [Hz].

    A power law that has the phase :math:`\delta` of K* rises by :math:`(f/f_s)^{2\delta/\pi}` from the static
    frequency :math:`f_s` on.

    Examples
    --------
    >>> round(largest_ratio(1e5 + 0j, 10.0), 2), round(largest_ratio(1e5 + 3e4j, 10.0), 2)
    (1.5, 8.28)
    """
    if stiffness.real <= 0:
        return _ABOVE
    phase = atan(max(stiffness.imag, 0.0) / stiffness.real)
    return _ABOVE * exp(2 * phase / pi * max(log(frequency / _STATIC), 0.0))


def is_plausible(stiffness: complex, k1: float, frequency: float) -> bool:
    """Whether a passive specimen of static stiffness K1 [N/m] may have this K* [N/m] at a frequency [Hz]."""
    return _BELOW <= stiffness.real / k1 <= largest_ratio(stiffness, frequency) and stiffness.imag > 0


def k1_exchanged(stiffness: ComplexArray, k1: FloatArray, *, same: bool = False) -> tuple[float, float, float] | None:
    r"""Compare two specimens of like kind, or two states of one, with their K1 and with each other's K1.

    A constant loss angle gives :math:`(K'-K_1)/K'' = (2/\pi)\ln(f/f_s)`, whatever its size, where f_s is the frequency
    of the static test. This ratio is therefore alike for specimens of equal conditions and equal static tests.

    Parameters
    ----------
    stiffness : (P, 2) complex array [N/m]
        K* of both specimens at P equal conditions and frequencies.
    k1 : (P, 2) float array [N/m]
        K1 of both.
    same : bool
        Whether both are one specimen, at two pressures.

    Returns
    -------
    (first, second, usual) or None [1]
        Medians of (K' - K1)/K'' of both, and their mean after the exchange; None if the exchange of K1 does not make
        unlike ratios alike.

    Examples
    --------
    >>> pair = np.array([[1.8e5 + 3e4j, 2.5e5 + 5e4j]])
    >>> k1_exchanged(pair, np.array([[1.3e5, 1.7e5]])) is None
    True
    >>> [round(one, 2) for one in k1_exchanged(pair, np.array([[1.7e5, 1.3e5]]))]
    [0.33, 2.4, 1.63]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = np.median((stiffness.real - k1) / stiffness.imag, axis=0).tolist()
        swapped = np.median((stiffness.real - k1[:, ::-1]) / stiffness.imag, axis=0)
    usual = float(swapped.mean())
    unlike, alike = _STATES if same else _SPECIMENS
    if usual > 0 and np.ptp(swapped) < alike * usual and abs(first - second) > unlike * usual:
        return first, second, usual
    return None
