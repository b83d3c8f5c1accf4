"""The common curve of shifted isotherms: K' and K'' each by a non-negative relaxation spectrum on fixed times.

K' and K'' have spectra of their own. A spectrum common to both would tie them by the Kramers-Kronig relations, and then
an error of the loss angle, as many instruments have, would move K' too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.models.data import DECADE, relaxation
from fourpole.models.nonnegative import least_squares

#: Decades of times beyond each end of the reduced frequencies.
_BEYOND = 2.0
#: Least relative error of K' and K'', so that no weight is infinite.
_LEAST = 1e-6
#: Least error of K' or K'' as a share of the modulus of K*, for each unit of the relative error.
_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Isotherm(ByValue):
    """K* over frequency at one temperature.

    Attributes
    ----------
    temperature : float [degC]
    omega : (N,) float array [rad/s]
        Angular frequencies, rising.
    stiffness : (N,) complex array [N/m]
        K*; or a modulus E* or G* [Pa], of all isotherms alike.
    covariance : (N, 2, 2) float array or None
        Covariance of Re and Im of K*; None where the uncertainty is not stated.
    """

    temperature: float
    omega: FloatArray
    stiffness: ComplexArray
    covariance: FloatArray | None = None

    @property
    def frequency(self) -> FloatArray:
        """Frequencies (N,) [Hz]."""
        return self.omega / (2 * np.pi)


def terms(omega: FloatArray, times: FloatArray) -> ComplexArray:
    """Response (N, k) of unit springs with relaxation times; an infinite time is a spring in parallel."""
    finite = np.where(np.isfinite(times), times, 1.0)
    return np.where(np.isfinite(times), relaxation(omega, finite), 1.0)


def slopes(omega: FloatArray, times: FloatArray) -> ComplexArray:
    """Derivative (N, k) of `terms` by ln(omega)."""
    part = terms(omega, times)
    return np.where(np.isfinite(times), part * (1 - part), 0.0)


def by_spectra(part: ComplexArray, springs: FloatArray) -> ComplexArray:
    """Terms (N, k) with the springs (2, k) of K' and of K''."""
    return np.asarray(part.real @ springs[0] + 1j * (part.imag @ springs[1]))


def _times(isotherms: Sequence[Isotherm], log_a: FloatArray, density: int) -> FloatArray:
    """Relaxation times [s], on fixed places of the logarithmic axis; the first is infinite."""
    ends = [np.log10(one.omega[[0, -1]]) + shift / DECADE for one, shift in zip(isotherms, log_a, strict=True)]
    low = int(np.floor((-np.max(ends) - _BEYOND) * density))
    high = int(np.ceil((-np.min(ends) + _BEYOND) * density))
    return np.append(np.inf, 10.0 ** (np.arange(low, high + 1) / density))


@dataclass(frozen=True, eq=False)
class SpectraFit(ByValue):
    """The best spectra at given shifts: the model, the weighted residuals and the weighted rows of all arms."""

    times: FloatArray
    springs: FloatArray
    model: list[ComplexArray]
    residual: FloatArray
    rows: list[FloatArray]

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def used(self) -> int:
        """Number of arms in use."""
        return int(np.count_nonzero(self.springs))

    @property
    def active(self) -> list[FloatArray]:
        """The rows of the arms in use."""
        return [rows[:, springs > 0] for rows, springs in zip(self.rows, self.springs, strict=True)]

    def loose(self, density: int) -> list[FloatArray]:
        """The rows of all arms, each times the stiffness that a spectrum as smooth as this one may have there."""
        return [rows * _envelope(springs, density) for rows, springs in zip(self.rows, self.springs, strict=True)]


def fit_spectra(
    isotherms: Sequence[Isotherm], shifts: FloatArray, errors: Sequence[FloatArray], density: int
) -> SpectraFit:
    """Non-negative least squares for the spectra of K' and of K'' at given shifts ln a_T and ln b_T (2, n)."""
    times = _times(isotherms, shifts[0], density)
    sizes = [one.omega.size for one in isotherms]
    a, b = (np.repeat(one, sizes) for one in shifts)
    every = terms(np.concatenate([one.omega for one in isotherms]) * np.exp(a), times) * np.exp(-b)[:, None]
    std = np.concatenate(errors)
    measured = np.concatenate([one.stiffness for one in isotherms])
    springs, residual, used = [], [], []
    for at, (rows, target) in enumerate(((every.real, measured.real), (every.imag, measured.imag))):
        weighted, right = rows / std[:, at, None], target / std[:, at]
        springs.append(least_squares(weighted, right)[0])
        residual.append(right - weighted @ springs[-1])
        used.append(weighted)
    both, whole = np.array(springs), np.concatenate(residual)
    model = np.split(by_spectra(every, both), np.cumsum(sizes)[:-1])
    return SpectraFit(times, both, model, whole, used)


def _envelope(springs: FloatArray, density: int) -> FloatArray:
    """The largest stiffness (k,) within a decade of each relaxation time; the spring in parallel has its own."""
    finite = np.pad(springs[1:], density)
    near = np.lib.stride_tricks.sliding_window_view(finite, 2 * density + 1).max(axis=1)
    return np.append(max(float(springs[0]), float(near[-1])), near)


def shift_rows(
    isotherms: Sequence[Isotherm],
    shifts: FloatArray,
    fit: SpectraFit,
    errors: Sequence[FloatArray],
    free: np.ndarray,
    vertical: bool,
    *,
    loose: int = 0,
) -> FloatArray:
    """Weighted derivatives (2N, p) of the model by the free shifts, with the spectra projected out.

    By least squares only few arms are in use, and the others are zero. With `loose` arms per decade, each
    arm may also have a stiffness like that of its neighbours; their uncertainty belongs to that of the shifts.
    """
    ends = np.cumsum([0, *(one.omega.size for one in isotherms)])
    change = np.zeros((int(ends[-1]), free.size * (2 if vertical else 1)), dtype=complex)
    for place, at in enumerate(free.tolist()):
        rows = slice(int(ends[at]), int(ends[at + 1]))
        rising = slopes(isotherms[at].omega * np.exp(shifts[0, at]), fit.times) * np.exp(-shifts[1, at])
        change[rows, place] = by_spectra(rising, fit.springs)
        if vertical:
            change[rows, free.size + place] = -fit.model[at]
    std = np.concatenate(errors)
    blocks = []
    arms = fit.loose(loose) if loose else fit.active
    for columns, size, arm in zip((change.real, change.imag), std.T, arms, strict=True):
        weighted = columns / size[:, None]
        if loose:
            width = arm.shape[1]
            arm = np.concatenate([arm, np.eye(width)])  # noqa: PLW2901
            weighted = np.concatenate([weighted, np.zeros((width, weighted.shape[1]))])
        basis = np.linalg.qr(arm)[0]
        blocks.append(weighted - basis @ (basis.T @ weighted))
    return np.concatenate(blocks)


def stated_errors(one: Isotherm) -> FloatArray:
    """Standard uncertainties (N, 2) of Re and Im K* as stated [N/m]."""
    covariance = np.zeros((one.omega.size, 2, 2)) if one.covariance is None else one.covariance
    std = np.sqrt(np.diagonal(covariance, 0, 1, 2))
    return np.asarray(np.maximum(std, _LEAST * np.abs(one.stiffness)[:, None]))


def relative_errors(model: ComplexArray, size: tuple[float, float], *, of_modulus: bool = False) -> FloatArray:
    """Standard uncertainties (N, 2) of Re and Im, as shares of K' and K'', or both of the modulus of K*."""
    whole = np.abs(model)[:, None]
    if of_modulus:
        return np.asarray(whole * np.array(size))
    both = np.abs(parts(model, axis=1))
    return np.asarray(np.maximum(both, _SHARE * whole) * np.array(size))


def errors_of_misfit(isotherms: Sequence[Isotherm], fit: SpectraFit, dof: int) -> list[FloatArray]:
    """Errors (N, 2) of each isotherm by the misfit: shares of K' and K'', or of the modulus, whichever is likelier."""
    off = np.concatenate([one.stiffness for one in isotherms]) - np.concatenate(fit.model)
    both = np.abs(parts(off, axis=1))
    lost = np.sqrt(both.size / dof)
    found = []
    for of_modulus in (False, True):
        unit = relative_errors(np.concatenate(fit.model), (1.0, 1.0), of_modulus=of_modulus)
        size = np.maximum(lost * np.sqrt(np.mean((both / unit) ** 2, axis=0)), _LEAST)
        found.append(unit * size)
    best = min(found, key=lambda one: float(np.sum(np.log(one))))
    return np.split(best, np.cumsum([one.omega.size for one in isotherms])[:-1])
