"""The sine fit of IEEE 1057 as a laboratory would write it, a peer of several benchmarks; by itself it does nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

__all__ = ["ieee_1057"]


def ieee_1057(
    time: NDArray[np.float64], samples: NDArray[np.float64], omega: float, harmonics: int = 1
) -> tuple[complex, float, NDArray[np.float64]]:
    """Amplitude, angular frequency and covariance: mean, harmonics and frequency by least squares, until it rests."""
    orders, found, change = np.arange(1, harmonics + 1), None, np.inf
    while abs(change) > 1e-9 * omega:
        angle = np.outer(time, omega * orders)
        cosine, sine = np.cos(angle), np.sin(angle)
        columns = [cosine, -sine, np.ones((time.size, 1))]
        if found is not None:
            real, imag = found[:harmonics] * orders, found[harmonics : 2 * harmonics] * orders
            columns.append(-time[:, None] * (sine @ real + cosine @ imag)[:, None])
        matrix = np.hstack(columns)
        found = lstsq(matrix, samples, lapack_driver="gelsy", check_finite=False)[0]
        if matrix.shape[1] > 2 * harmonics + 1:
            change = found[-1]
            omega += change
    rest = samples - matrix @ found
    covariance = rest @ rest / (time.size - matrix.shape[1]) * np.linalg.inv(matrix.T @ matrix)
    assert np.isfinite(covariance).all()
    return complex(found[0], found[harmonics]), omega, covariance
