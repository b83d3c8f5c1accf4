"""Isotherms of simulated rubbers with a known law of the shift factors, by formulas of their own."""

import numpy as np

from fourpole.models.common_curve import Isotherm

C1, C2, REFERENCE = 8.86, 101.6, 20.0
TEMPERATURES = (-10.0, 0.0, 10.0, 20.0, 35.0, 50.0, 65.0)


def log_a(t, c1=C1, c2=C2, reference=REFERENCE):
    """Natural logarithm of the WLF shift factor."""
    t = np.asarray(t, dtype=float)
    return -np.log(10) * c1 * (t - reference) / (c2 + t - reference)


def fractional_zener(omega, low=1e5, high=3e7, time=1e-4, order=0.55):
    """K* of a fractional Zener solid."""
    power = (1j * np.asarray(omega) * time) ** order
    return low + (high - low) * power / (1 + power)


def isotherm(
    temperature, seed=None, noise=0.0, *, stated=False, b=1.0, shift=log_a, points=13, material=fractional_zener
):
    """K* over 0.1 to 50 Hz at a temperature, with relative noise of K' and K''."""
    omega = 2 * np.pi * np.geomspace(0.1, 50.0, points)
    k = material(omega * np.exp(shift(temperature))) / b
    rng = np.random.default_rng(seed)
    error = noise * (k.real * rng.standard_normal(points) + 1j * k.imag * rng.standard_normal(points))
    std = noise * np.stack([k.real, k.imag], axis=1)
    covariance = std[:, :, None] ** 2 * np.eye(2) if stated else None
    return Isotherm(float(temperature), omega, k + error, covariance)


def isotherms(seed=None, noise=0.0, temperatures=TEMPERATURES, **more):
    """One isotherm per temperature, with independent noise."""
    rng = np.random.default_rng(seed)
    return [isotherm(t, int(rng.integers(2**32)), noise, **more) for t in temperatures]
