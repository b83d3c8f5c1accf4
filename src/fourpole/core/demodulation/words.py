r"""What the words of a logger leave of an amplitude: samples stand on steps q, and a sine of few steps is no sine.

The error of a sample has the variance :math:`q^2/12`. Without noise it is the same in each cycle, and spreads evenly
over about :math:`2\pi A/q` harmonics of an amplitude A. Noise :math:`\sigma` turns it into noise, so that

.. math:: u^2(A) = \frac{q^3}{24\pi A}\,e^{-4\pi^2\sigma^2/q^2}.

References
----------
B. Widrow and I. Kollár, "Quantization Noise", 2008, chapters 4 and 19. IEEE Std 1057, annex B.
"""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray

#: Samples whose steps are looked at, the least share of them that repeat another one, and the distance from a step,
#: over it, up to which a value stands on it.
_LOOKED, _REPEATED, _OFF = 512, 0.1, 0.1


def step_of(samples: FloatArray) -> float:
    """Step on which the values of samples (N,) stand, in their unit; 0 where they stand on none.

    Examples
    --------
    >>> step_of(np.round(100 * np.sin(np.arange(300.0))) / 4)
    0.25
    >>> step_of(np.sin(np.arange(300.0)))
    0.0
    """
    looked = samples[:_LOOKED]
    values = np.unique(looked[np.isfinite(looked)])
    if not 1 < values.size <= (1 - _REPEATED) * looked.size:
        return 0.0
    step = float(np.diff(values).min())
    places = (values - values[0]) / step
    return step if np.abs(places - np.round(places)).max() < _OFF else 0.0


def word_variance(samples: FloatArray, amplitude: float, noise: float) -> float:
    """Squared uncertainty of an amplitude by the steps of samples (N,) with a noise, all in their unit."""
    step = step_of(samples)
    if not step or not amplitude > 0:
        return 0.0
    before = max(noise**2 - step**2 / 12, 0.0)  # what the steps themselves make of it is no noise
    return float(step**3 / (24 * np.pi * max(amplitude, step)) * np.exp(-4 * np.pi**2 * before / step**2))
