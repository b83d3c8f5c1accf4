r"""Noise with memory: white noise beside a part that fades exponentially along the record.

Each residual is :math:`w_i + c_i` with white w and :math:`c_i = \rho\,c_{i-1} + \eta_i`; the share of c in the variance
is :math:`\lambda`. Whitening turns such residuals into independent ones of equal variance.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray

#: Lengths over which the correlated part fades [rows], and its shares of the variance.
_LENGTHS = (1.5, 5.0, 15.0, 50.0, 300.0)
_SHARES = (0.05, 0.3, 0.8, 1.0)


@lru_cache(maxsize=1)
def memories() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Decay per row, share of the correlated part and number of parameters of each memory; the first is white."""
    decay = [0.0, *(float(np.exp(-1.0 / length)) for length in _LENGTHS for _ in _SHARES)]
    share = [0.0, *_SHARES * len(_LENGTHS)]
    count = [0.0, *(1.0 if part == 1.0 else 2.0 for part in share[1:])]
    return np.array(decay), np.array(share), np.array(count)


def whitened(rows: FloatArray, starts: BoolArray, *, plain: bool = False) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows whitened for each memory, the sum of the logarithms of their variances, and the parameters of each memory.

    Parameters
    ----------
    rows : (M, K) float array
        Columns of a linear model along the record.
    starts : (M,) bool array
        Whether a row is the first of a stretch; stretches are independent of each other.
    plain : bool
        Whether only white noise is considered.

    Returns
    -------
    rows : (G, M, K) float array
    log_variance : (G,) float array
    count : (G,) float array
    """
    decay, share, count = (column[:1] if plain else column for column in memories())
    if plain:
        return rows[None], np.zeros(1), count
    out = np.empty((decay.size, *rows.shape))
    logs = np.zeros(decay.size)
    ahead = share
    guess = np.zeros((decay.size, rows.shape[1]))
    for i, row in enumerate(rows):
        if starts[i]:
            ahead, guess = share, np.zeros_like(guess)
        variance = ahead + 1.0 - share
        left = row - guess
        out[:, i] = left / np.sqrt(variance)[:, None]
        logs += np.log(variance)
        gain = ahead / variance
        guess = decay[:, None] * (guess + gain[:, None] * left)
        ahead = decay**2 * ahead * (1.0 - gain) + share * (1.0 - decay**2)
    return out, logs, count
