"""Where a fit begins: closed forms and small grids, so that nobody need guess."""

from __future__ import annotations

import numpy as np
from scipy import optimize

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.interface import Model
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring, Structural

__all__ = ["start_of"]

_ORDERS = np.linspace(0.1, 1.0, 10)
_TIMES_PER_DECADE = 3
_DECADES_BEYOND = 3.0
_SMALL = 1e-6


def start_of(model: Model, data: StiffnessData) -> FloatArray:
    """Parameters (..., P) close to those that fit K* of conditions (...,).

    Raises
    ------
    ModelError
        If no start is known for the model.

    Examples
    --------
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> start_of(Zener(), StiffnessData.of(omega, truth, 100.0)).round(3)
    array([180000., 120000.,    700.])
    """
    lead, k = data.stiffness.shape[:-1], data.stiffness.reshape(-1, data.omega.size)
    if isinstance(model, Spring):
        found = np.mean(k.real, axis=1)[:, None]
    elif isinstance(model, KelvinVoigt):
        found = np.stack([np.mean(k.real, axis=1), np.mean(k.imag * data.omega, 1) / np.mean(data.omega**2)], axis=1)
    elif isinstance(model, Structural):
        found = np.stack([np.mean(k.real, axis=1), np.mean(k.imag, 1) / np.mean(k.real, 1)], axis=1)
    elif isinstance(model, Zener):
        found = _zener(k, data.omega)
    elif isinstance(model, FractionalZener | FractionalZener5):
        found = np.array([_fractional(row, data.omega) for row in k])
        if isinstance(model, FractionalZener5):
            found = np.concatenate([found, np.full((len(found), 1), 0.9)], axis=1)
    elif isinstance(model, GeneralisedMaxwell):
        found = np.array([_maxwell(row, data.omega, model.arms) for row in k])
    else:
        raise ModelError(f"no start is known for the {model.name} model: state one")
    low = np.array([parameter.low for parameter in model.parameters])
    high = np.array([parameter.high for parameter in model.parameters])
    usual = np.abs(model.defaults)
    inside = np.clip(np.where(np.isfinite(found), found, usual), low, high)
    logs = np.array([parameter.log for parameter in model.parameters])
    inside = np.where(logs, np.maximum(inside, _SMALL * usual), inside)
    return np.asarray(inside.reshape(*lead, -1))


def _zener(k: ComplexArray, omega: FloatArray) -> FloatArray:
    """K* (1 + jw tau) = K1 + jw tau (K1 + K2) is linear in K1, tau (K1 + K2) and tau: least squares of each row."""
    scale = np.mean(np.abs(k), axis=1)[:, None]
    w, y = omega / np.mean(omega), k / scale
    one = np.ones_like(y)
    terms = np.stack([one, 1j * w * one, -1j * w * y], axis=-1) / (1 + w[:, None])
    rows = np.concatenate([terms.real, terms.imag], axis=1)
    right = np.concatenate([y.real / (1 + w), y.imag / (1 + w)], axis=1)
    turned = np.swapaxes(rows, 1, 2)
    ridge = 1e-12 * np.eye(3)
    first, second, tau = np.linalg.solve(turned @ rows + ridge, (turned @ right[..., None]))[..., 0].T
    tau = np.maximum(tau, _SMALL)
    k1 = np.maximum(first, 0.01) * scale[:, 0]
    k2 = np.maximum(second / tau * scale[:, 0] - k1, 0.01 * scale[:, 0])
    return np.stack([k1, k2, tau / np.mean(omega) * k2], axis=1)


def _fractional(k: ComplexArray, omega: FloatArray) -> FloatArray:
    """The best K0, K_inf >= 0 on a grid of times and orders."""
    decades = np.log10(omega.max() / omega.min()) + 2 * _DECADES_BEYOND
    times = 1.0 / np.geomspace(
        omega.min() / 10**_DECADES_BEYOND, omega.max() * 10**_DECADES_BEYOND, int(decades * _TIMES_PER_DECADE) + 1
    )
    weight = 1.0 / np.abs(k)
    power = (1j * omega * times[:, None, None]) ** _ORDERS[:, None]
    share = power / (1 + power)
    terms = np.stack([1 - share, share], axis=-1) * weight[:, None]
    rows = np.concatenate([terms.real, terms.imag], axis=2)
    right = np.concatenate([(k * weight).real, (k * weight).imag])
    turned = np.swapaxes(rows, 2, 3)
    found = np.linalg.solve(turned @ rows + 1e-12 * np.eye(2), (turned @ right)[..., None])[..., 0]
    found = np.maximum(found, _SMALL * np.mean(np.abs(k)))
    misfit = np.sum(((rows @ found[..., None])[..., 0] - right) ** 2, axis=-1)
    at, order = np.unravel_index(np.argmin(misfit), misfit.shape)
    low, high = found[at, order]
    return np.array([low, max(high, low * (1 + 1e-3)), times[at], _ORDERS[order]])


def _maxwell(k: ComplexArray, omega: FloatArray, arms: int) -> FloatArray:
    """Non-negative least squares on relaxation times that are spread over the band, one per arm."""
    times = 1.0 / np.geomspace(omega.min() * 0.6, omega.max() * 1.6, arms) if arms > 1 else _peak(k, omega)
    relaxed = 1.0 - 1.0 / (1.0 + 1j * omega[:, None] * times)
    terms = np.concatenate([np.ones((omega.size, 1)), relaxed], axis=1) / np.abs(k)[:, None]
    wanted = k / np.abs(k)
    found, _ = optimize.nnls(np.concatenate([terms.real, terms.imag]), np.concatenate([wanted.real, wanted.imag]))
    floor = 1e-3 * np.mean(np.abs(k)) / arms
    return np.concatenate([np.maximum(found, floor), times])


def _peak(k: ComplexArray, omega: FloatArray) -> FloatArray:
    return np.array([1.0 / omega[int(np.argmax(k.imag / k.real))]])
