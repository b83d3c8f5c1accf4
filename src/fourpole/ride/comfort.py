"""Comfort after ISO 2631-1: the frequency weighting Wk of vertical vibration, and values of weighted acceleration.

Wk is for vertical acceleration at the seat of a seated person. It is the product of the transfer functions that the
standard states: band limits, transition and upward step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.recursion import LinearSystem, driven
from fourpole.errors import ModelError

#: Band limits of Wk [Hz].
_HIGH_PASS, _LOW_PASS = 0.4, 100.0
#: Frequencies of the upward step [Hz].
_STEP_FROM, _STEP_TO = 2.37, 3.35
#: Filters of Wk: natural frequency w [Hz], quality factor Q [1], and the factors of s², w s and w² in the numerator;
#: the denominator is s² + w s/Q + w².
_FILTERS = (
    (_HIGH_PASS, np.sqrt(0.5), (1.0, 0.0, 0.0)),
    (_LOW_PASS, np.sqrt(0.5), (0.0, 0.0, 1.0)),
    (12.5, 0.63, (0.0, 1.0, 1.0)),
    (_STEP_TO, 0.91, (1.0, _STEP_FROM / _STEP_TO / 0.91, (_STEP_FROM / _STEP_TO) ** 2)),
)
#: Time constant of the running r.m.s. value [s].
_RUNNING = 1.0


def weighting(frequency: ArrayLike) -> ComplexArray:
    r"""The weighting Wk (...,) [1] of vertical acceleration at frequencies (...,) [Hz].

    .. math:: H(s) = \frac{s^2}{s^2 + \sqrt2 \omega_1 s + \omega_1^2} \cdot
        \frac{\omega_2^2}{s^2 + \sqrt2 \omega_2 s + \omega_2^2} \cdot
        \frac{\omega_3 s + \omega_3^2}{s^2 + \omega_3 s/Q_4 + \omega_3^2} \cdot
        \frac{s^2 + \omega_5 s/Q_5 + \omega_5^2}{s^2 + \omega_6 s/Q_5 + \omega_6^2}

    with 0.4, 100, 12.5, 2.37 and 3.35 Hz, Q_4 = 0.63 and Q_5 = 0.91.

    References
    ----------
    ISO 2631-1:1997, annex A; ISO 8041-1:2017, table of the frequency weightings.

    Examples
    --------
    >>> np.abs(weighting([1.0, 10**0.8, 20.0])).round(3)
    array([0.482, 1.054, 0.636])
    """
    f = np.asarray(frequency, dtype=float)
    found = np.ones(f.shape, dtype=complex)
    for natural, quality, top in _FILTERS:
        s = 1j * f / natural
        found = found * np.polyval(top, s) / (s**2 + s / quality + 1.0)
    return np.asarray(found)[()]


def weighting_system() -> LinearSystem:
    """Wk as a linear system from acceleration to weighted acceleration, both in [m/s²]: one filter after the other."""
    n = 2 * len(_FILTERS)
    a, b = np.zeros((n, n)), np.zeros((n, 1))
    row, direct = np.zeros(n), 1.0  # the input of the next filter from the states before it, and from the acceleration
    for at, (natural, quality, (square, rate, level)) in enumerate(_FILTERS):
        first, second, w = 2 * at, 2 * at + 1, 2 * np.pi * natural
        a[first, second] = w
        a[second] = w * row
        a[second, [first, second]] -= w * np.array([1.0, 1.0 / quality])
        b[second] = w * direct
        row, direct = square * row, square * direct
        row[[first, second]] += [level - square, rate - square / quality]
    none = np.zeros((1, 1))
    return LinearSystem(a, b, np.zeros((n, 1)), row[None], none + direct, none)


def weighted(acceleration: ArrayLike, step: float) -> FloatArray:
    """Weighted acceleration (N,) [m/s²] of a vertical acceleration (N,) [m/s²] that is straight between its samples.

    Exact for such a signal. Straight lines lose (2 pi f step)²/12 of a sine of frequency f: 0.03 % at 10 Hz and 1 ms.

    Examples
    --------
    >>> time = 1e-3 * np.arange(20000)
    >>> found = weighted(np.sin(2 * np.pi * 5 * time), 1e-3)
    >>> float(np.std(found[10000:]) * np.sqrt(2)).__round__(3)
    1.039
    """
    check_step(step)
    (found,) = driven(weighting_system(), np.asarray(acceleration, dtype=float)[None], step)
    return found


#: Largest step: four samples per cycle at the upper band limit of Wk [s].
LONGEST_STEP = 1.0 / (4.0 * _LOW_PASS)


def check_step(step: float) -> None:
    """ModelError unless a time step [s] shows the band of Wk."""
    if not 0 < step <= LONGEST_STEP * (1 + 1e-9):
        raise ModelError(
            f"a step of {step:g} s is too long: the weighting goes up to {_LOW_PASS:g} Hz, state at most "
            f"{LONGEST_STEP:g} s"
        )


@dataclass(frozen=True)
class Comfort:
    """Values of one weighted acceleration.

    Attributes
    ----------
    rms : float [m/s²]
        Weighted acceleration a_w.
    peak : float [m/s²]
    vdv : float [m/s^1.75]
        Vibration dose value, the fourth root of the integral of the fourth power.
    mtvv : float [m/s²]
        Maximum transient vibration value: greatest running r.m.s. over 1 s, exponential average.
    """

    rms: float
    peak: float
    vdv: float
    mtvv: float

    @property
    def crest(self) -> float:
        """Crest factor [1]; above 9 the standard asks for the vibration dose value as well."""
        return self.peak / self.rms if self.rms > 0 else 0.0


def comfort_of(weighted_acceleration: ArrayLike, step: float) -> Comfort:
    """The values of a weighted acceleration (N,) [m/s²].

    Examples
    --------
    >>> found = comfort_of(np.sin(2 * np.pi * 5e-3 * np.arange(20000)), 1e-3)
    >>> round(found.rms, 4), round(found.crest, 4)
    (0.7071, 1.4142)
    """
    a = np.asarray(weighted_acceleration, dtype=float)
    decay = float(np.exp(-step / _RUNNING))
    running = scipy.signal.lfilter([1.0 - decay], [1.0, -decay], a**2)
    return Comfort(
        rms=float(np.sqrt(np.mean(a**2))),
        peak=float(np.max(np.abs(a), initial=0.0)),
        vdv=float((step * np.sum(a**4)) ** 0.25),
        mtvv=float(np.sqrt(np.max(running, initial=0.0))),
    )
