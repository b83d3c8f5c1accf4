r"""What the three phasors of a test should be, and how they change with K* and the shared values.

With the drive d (the true V1), T = K*/(K* + jw Zr) and the channels' gains g:

.. math:: (F_1, V_1, V_2) = d\,\bigl(g_F (Z_r T + j\omega m_{in}),\; g_1,\; g_2 T\bigr)

A rigid block in place of the tyre has T = 1. The drive is free in every test, so that it is fitted out of
everything else before anything else is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelError
from fourpole.core.joint.shared import Shared
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Role

__all__ = [
    "Linear",
    "Observed",
    "cholesky_qr",
    "inverse_upper",
    "linearise",
    "part_shapes",
    "projected",
    "upper_factor",
    "whitened",
]

#: Relative uncertainty of any amplitude: what single precision, in a file or a sensor's electronics, holds at best.
FLOOR = 1e-7


@dataclass(frozen=True, eq=False)
class Observed(ByValue):
    """The tests' phasors, ready to be compared with a model; every array has one row per test.

    Attributes
    ----------
    omega, frequency_std : (N,) float arrays [rad/s], [Hz]
        Frequency and its uncertainty.
    amplitudes : (N, 3) complex array
        As measured, 0 where a channel is absent.
    whiten : (N, 6, 6) float array
        W with W S W^T = 1 for the covariance S of what is present; rows of absent channels are 0.
    mass_at : (N,) int array
        Which of the distinct masses is fixed to the moving mass; -1 for none.
    rigid : (N,) bool array
        True for a rigid block in place of the tyre.
    turns : (N, 3, e) complex array
        Change of the logarithm of each amplitude per unit of each of the channels' errors.
    """

    omega: FloatArray
    frequency_std: FloatArray
    amplitudes: ComplexArray
    whiten: FloatArray
    mass_at: np.ndarray
    rigid: BoolArray
    turns: ComplexArray

    @classmethod
    def of(
        cls, phasors: Phasors, mass_at: np.ndarray, rigid: BoolArray, errors: Sequence[ChannelError] = ()
    ) -> Observed:
        """From phasors of N tests, and the errors of their channels in the same order."""
        amplitudes = phasors.amplitudes
        present = np.isfinite(amplitudes) & (amplitudes != 0)
        amplitudes = np.where(present, amplitudes, 0.0)
        whiten = whitening(phasors.covariance, amplitudes, present)
        turns = np.zeros((len(amplitudes), 3, len(errors)), dtype=complex)
        for at, error in enumerate(errors):
            turns[:, error.channel, at] = error.turn
        return cls(phasors.omega, phasors.frequency_std, amplitudes, whiten, mass_at, rigid, turns)

    def gains(self, shared: Shared, z: FloatArray) -> ComplexArray:
        """Complex gains of F1, V1, V2 in each test, measured over true: exp(a + j phi), (N, 3)."""
        return np.asarray(np.exp(self.turns @ shared.channels_at(z, self.turns.shape[-1])))

    def part(self, rows: slice) -> Observed:
        """Some of the tests."""
        return Observed(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def whitening(covariance: FloatArray, amplitudes: ComplexArray, present: BoolArray) -> FloatArray:
    """W with W S W^T = 1, the inverse of S's Cholesky factor."""
    both = np.repeat(present, 2, axis=-1)
    at = np.arange(6)
    kept = np.where(both[:, :, None] & both[:, None, :], covariance, 0.0)
    kept[:, at, at] += np.where(both, (FLOOR * np.repeat(np.abs(amplitudes), 2, axis=-1)) ** 2, 1.0)
    # scaled to a unit diagonal first: forces and velocities are of very different size
    scale = 1.0 / np.sqrt(kept[:, at, at])
    factor = np.linalg.cholesky(kept * scale[:, :, None] * scale[:, None, :])
    inverse = np.linalg.inv(factor) * scale[:, None, :]
    return np.where(both[:, :, None], inverse, 0.0)


@dataclass(frozen=True, eq=False)
class Linear(ByValue):
    """Whitened residual and derivatives of some tests, the drive fitted out of all.

    Attributes
    ----------
    residual : (N, 6) float array
        Measured less model.
    by_stiffness : (N, 6, 2) float array
        Derivatives of the model by Re and Im of log K*; 0 for rigid blocks.
    by_impedance : (N, 6, 2) float array
        The same by Re and Im of Zr [N s/m].
    by_shared : (N, 6, p) float array
        By the shared values, in their stated uncertainties.
    drive : (N,) complex array [m/s]
        V1.
    impedance, ratio : (N,) complex arrays [N s/m], [1]
        Zr and T = V2/V1.
    impedance_by_shared : (N, p) complex array
        dZr/dz.
    predicted : (N, 3) complex array
        F1, V1, V2 as the channels would record them.
    frame : (N, 6, 2) float array
        Orthonormal columns of what the drive can do.
    """

    residual: FloatArray
    by_stiffness: FloatArray
    by_impedance: FloatArray
    by_shared: FloatArray
    drive: ComplexArray
    impedance: ComplexArray
    ratio: ComplexArray
    impedance_by_shared: ComplexArray
    predicted: ComplexArray
    frame: FloatArray


def linearise(observed: Observed, shared: Shared, z: FloatArray, stiffness: ComplexArray) -> Linear:
    """The model and its derivatives at shared values z and K* of each test [N/m]."""
    jw = 1j * observed.omega
    rig, gains = shared.rig_at(z), observed.gains(shared, z)
    added = np.where(observed.mass_at >= 0, np.append(shared.masses_at(z), 0.0)[observed.mass_at], 0.0)
    added = added - np.where(observed.rigid, rig.tyre_mass, 0.0)
    impedance = np.asarray(rig.impedance(observed.omega, added))
    extra = shared.extra_at(z)
    if extra:
        shapes = part_shapes(observed.omega, rig, np.abs(observed.amplitudes[:, 2]), observed.rigid)
        impedance = impedance + sum(value * shapes[part] for part, value in extra.items())
    ratio = np.where(observed.rigid, 1.0, stiffness / (stiffness + jw * impedance))
    by_log_k = ratio * (1 - ratio)
    by_zr = np.where(observed.rigid, 0.0, -jw * stiffness / (stiffness + jw * impedance) ** 2)

    unit = np.stack([impedance * ratio + jw * rig.input_mass, np.ones_like(ratio), ratio], axis=-1) * gains
    frame, triangle = _orthonormal(_both(observed.whiten, unit))
    measured = whitened(observed.whiten, observed.amplitudes[..., None])[..., 0]
    share = np.einsum("nij,ni->nj", frame, measured)
    drive_parts = (inverse_upper(triangle) @ share[..., None])[..., 0]
    drive = drive_parts[:, 0] + 1j * drive_parts[:, 1]

    zero = np.zeros_like(ratio)
    scaled, predicted = gains * drive[:, None], unit * drive[:, None]
    log_k = np.stack([impedance * by_log_k, zero, by_log_k], axis=-1) * scaled
    zr = np.stack([np.where(observed.rigid, 1.0, ratio**2), zero, by_zr], axis=-1) * scaled
    zr_by_shared = _impedance_by_shared(observed, shared, rig, rig.impedance_gradient(observed.omega, added))
    by_shared = _by_shared(observed, shared, zr_by_shared, zr, predicted, jw * scaled[:, 0])
    fit_out = projected(frame)
    return Linear(
        residual=fit_out(measured[..., None])[..., 0],
        by_stiffness=fit_out(_both(observed.whiten, log_k)),
        by_impedance=fit_out(_both(observed.whiten, zr)),
        by_shared=fit_out(whitened(observed.whiten, by_shared)),
        drive=drive,
        impedance=impedance,
        ratio=ratio,
        impedance_by_shared=zr_by_shared,
        predicted=predicted,
        frame=frame,
    )


def part_shapes(omega: FloatArray, rig: Rig, speed: FloatArray, rigid: BoolArray) -> dict[str, ComplexArray]:
    """Derivative of Zr by each of `core.sources.PARTS`, (N,) each.

    Parameters
    ----------
    omega : (N,) float array [rad/s]
    rig : Rig
    speed : (N,) float array [m/s]
        Amplitude of V2, on which dry friction depends; 0 where unknown, where it is left out.
    rigid : (N,) bool array
        Rigid blocks in place of the tyre, which have no tyre's mass.
    """
    support = np.asarray(rig.impedance(omega)) - 1j * omega * (rig.moving_mass + rig.tyre_mass)
    dry = np.divide(4 / np.pi, speed, out=np.zeros(omega.size), where=speed > 0)
    return {
        "mass": np.where(rigid, 0.0, 1j * omega),
        "spring": 1 / (1j * omega),
        "frame": -1j * omega * support**2,
        "loss": rig.preload_stiffness / omega + 0j,
        "friction": dry + 0j,
    }


def _impedance_by_shared(observed: Observed, shared: Shared, rig: Rig, gradient: ComplexArray) -> ComplexArray:
    """dZr/dz of each test, (N, p)."""
    shapes = part_shapes(observed.omega, rig, np.abs(observed.amplitudes[:, 2]), observed.rigid)
    change = np.zeros((observed.omega.size, len(shared)), dtype=complex)
    for at, parameter in enumerate(shared.parameters):
        role, of = parameter.source.role, parameter.source.of
        if role is Role.RIG:
            change[:, at] = gradient[:, parameter.index]
            if of == "tyre_mass":
                change[observed.rigid, at] = 0.0
        elif role is Role.UNSTATED:
            change[:, at] = shapes[of]
        elif role is Role.MASS:
            change[:, at] = np.where(observed.mass_at == parameter.index, gradient[:, -1], 0.0)
    return np.asarray(change * shared.std)


def _by_shared(
    observed: Observed,
    shared: Shared,
    zr_by_shared: ComplexArray,
    by_zr: ComplexArray,
    predicted: ComplexArray,
    by_input_mass: ComplexArray,
) -> ComplexArray:
    """Derivatives of the three amplitudes by z, (N, 3, p)."""
    change = by_zr[:, :, None] * zr_by_shared[:, None, :]
    for at, parameter in enumerate(shared.parameters):
        if parameter.source.role is Role.CHANNEL:
            change[:, :, at] = observed.turns[:, :, parameter.index] * parameter.std * predicted
        elif parameter.source.of == "input_mass":
            change[:, 0, at] = parameter.std * by_input_mass
    return change


def _interleaved(values: ComplexArray) -> FloatArray:
    """(N, 3, ...) complex as (N, 6, ...): Re and Im of each in turn."""
    pairs = np.stack([values.real, values.imag], axis=2)
    return pairs.reshape(values.shape[0], 6, *values.shape[2:])


def whitened(whiten: FloatArray, values: ComplexArray) -> FloatArray:
    """(N, 3, k) complex changes of the amplitudes as (N, 6, k), in units of the noise."""
    return np.matmul(whiten, _interleaved(values))


def _both(whiten: FloatArray, values: ComplexArray) -> FloatArray:
    """Whitened derivatives (N, 6, 2) by Re and Im of a quantity, from the complex derivatives (N, 3)."""
    return whitened(whiten, np.stack([values, 1j * values], axis=-1))


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Q and R of (N, 6, 2) columns; their Cholesky factor, applied twice, is as good as reflections and much faster."""
    first, r1 = cholesky_qr(columns)
    second, r2 = cholesky_qr(first)
    return second, r2 @ r1


def cholesky_qr(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Q and R of (N, 6, 2) columns, by their Cholesky factor once."""
    upper = upper_factor(np.swapaxes(columns, 1, 2) @ columns)
    return columns @ inverse_upper(upper), upper


def upper_factor(gram: FloatArray) -> FloatArray:
    """R with R^T R = G for (..., 2, 2) G; columns that do nothing get R = 1."""
    a, b, d = gram[..., 0, 0], gram[..., 0, 1], gram[..., 1, 1]
    idle = (a <= 0) | (d <= 0)
    a, d = np.where(idle, 1.0, a), np.where(idle, 1.0, d)
    r00 = np.sqrt(a)
    r01 = np.where(idle, 0.0, b / r00)
    r11 = np.sqrt(np.maximum(d - r01**2, 1e-14 * d))
    return np.stack([np.stack([r00, r01], -1), np.stack([np.zeros_like(r00), r11], -1)], -2)


def inverse_upper(upper: FloatArray) -> FloatArray:
    """Inverse of (..., 2, 2) upper triangles."""
    a, b, d = upper[..., 0, 0], upper[..., 0, 1], upper[..., 1, 1]
    return np.stack([np.stack([1 / a, -b / (a * d)], -1), np.stack([np.zeros_like(a), 1 / d], -1)], -2)


def projected(frame: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """What takes the directions of `frame` out of columns (N, 6, k); twice, so that nothing of them is left."""

    def fit_out(columns: FloatArray) -> FloatArray:
        for _ in range(2):
            columns = columns - frame @ (np.swapaxes(frame, 1, 2) @ columns)
        return columns

    return fit_out
