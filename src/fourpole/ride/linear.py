"""Linear systems stepped exactly: inputs are straight between samples, each pole pair is one second-order section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray

#: Modes of a system are separated if the condition of its eigenvectors is below this: the loss is 1e-10 at most.
_SEPARABLE = 1e6
#: Below this modulus the functions of a step are summed as series of so many terms.
_SMALL, _TERMS = 0.5, 18


@dataclass(frozen=True, eq=False)
class LinearSystem(ByValue):
    r"""Outputs y of inputs u and their rates: :math:`\dot x = A x + B u + E \dot u`, :math:`y = C x + D u + F \dot u`.

    Attributes
    ----------
    a, b, e, c, d, f : float arrays
        A (n, n), B and E (n, m), C (p, n), D and F (p, m).
    """

    a: FloatArray
    b: FloatArray
    e: FloatArray
    c: FloatArray
    d: FloatArray
    f: FloatArray

    def response(self, frequency: ArrayLike) -> ComplexArray:
        """Transfer functions (N, p, m) at frequencies (N,) [Hz].

        Examples
        --------
        >>> one, none = np.ones((1, 1)), np.zeros((1, 1))
        >>> LinearSystem(-one, one, none, one, none, none).response([1 / (2 * np.pi)])[0, 0, 0].round(2)
        np.complex128(0.5-0.5j)
        """
        s = 2j * np.pi * np.asarray(frequency, dtype=float)[:, None, None]
        states = np.linalg.solve(s * np.eye(len(self.a)) - self.a, self.b + s * self.e)
        return np.asarray(self.c @ states + self.d + s * self.f)


def driven(system: LinearSystem, inputs: FloatArray, step: float) -> FloatArray:
    """Outputs (p, N) of inputs (m, N) that are straight between samples, from rest at the first sample.

    Exact at every sample, whatever the step. At a sample where a slope changes, the rate is the mean of both slopes.

    Examples
    --------
    >>> one, none = np.ones((1, 1)), np.zeros((1, 1))
    >>> lag = LinearSystem(-one, one, none, one, none, none)
    >>> driven(lag, np.array([[0.0, 1.0, 2.0]]), 1.0).round(6)
    array([[0.      , 0.367879, 1.135335]])
    """
    first = inputs[:, :1]
    moved = inputs - first
    steady = (system.d - system.c @ np.linalg.solve(system.a, system.b)) @ first
    modes = _modes(system)
    outputs = _by_sections(modes, system, moved, step) if modes is not None else _by_steps(system, moved, step)
    outputs += system.d @ moved + steady
    if np.any(system.f):
        outputs += system.f @ np.gradient(inputs, step, axis=1)
    return outputs


def _modes(system: LinearSystem) -> tuple[ComplexArray, ComplexArray] | None:
    """Poles (n,) and eigenvectors (n, n) of the states; None if the modes cannot be separated."""
    balanced, (scale, _) = scipy.linalg.matrix_balance(system.a, permute=False, separate=True)
    poles, vectors = np.linalg.eig(balanced)
    if not np.linalg.cond(vectors) < _SEPARABLE:
        return None
    return poles.astype(complex), scale[:, None] * vectors.astype(complex)


def _by_sections(
    modes: tuple[ComplexArray, ComplexArray], system: LinearSystem, moved: FloatArray, step: float
) -> FloatArray:
    """Outputs of the states by one section of order 1 or 2 for each pole or pair of poles."""
    poles, vectors = modes
    seen = system.c @ vectors
    drive, rate = (np.linalg.solve(vectors, one.astype(complex)) for one in (system.b, system.e))
    outputs = np.zeros((len(system.c), moved.shape[1]))
    for pole, c, b, e in zip(poles, seen.T, drive, rate, strict=True):
        if pole.imag < 0:
            continue  # the section of its conjugate has both
        turn, phi1, phi2 = _step_functions(pole * step)
        slope = step * phi2 * b + phi1 * e
        hold = step * phi1 * b - slope
        for place, u in enumerate(moved):
            for at, gain in enumerate(c.tolist()):
                if (top := _numerator(gain * slope[place], gain * hold[place], turn, pole.imag)).any():
                    outputs[at] += scipy.signal.lfilter(top, _denominator(turn, pole.imag), u)
    return outputs


def _numerator(now: complex, before: complex, turn: complex, imaginary: float) -> FloatArray:
    """Numerator of a section from the residues of this input and of the one before."""
    if imaginary == 0:
        return np.array([now.real, before.real])
    back = np.conj(turn)
    return 2.0 * np.array([now.real, (before - now * back).real, -(before * back).real])


def _denominator(turn: complex, imaginary: float) -> FloatArray:
    return np.array([1.0, -turn.real] if imaginary == 0 else [1.0, -2.0 * turn.real, abs(turn) ** 2])


def _step_functions(z: complex) -> tuple[complex, complex, complex]:
    """exp(z), (exp(z) - 1)/z and (exp(z) - 1 - z)/z²."""
    turn = complex(np.exp(z))
    if abs(z) > _SMALL:
        return turn, (turn - 1.0) / z, (turn - 1.0 - z) / z**2
    phi2 = 0.0 + 0.0j
    for k in range(_TERMS, 1, -1):
        phi2 = 1.0 + z * phi2 / (k + 1.0)
    phi2 *= 0.5
    return turn, 1.0 + z * phi2, phi2


def _by_steps(system: LinearSystem, moved: FloatArray, step: float) -> FloatArray:
    """The same where modes cannot be separated: step by step."""
    transition, hold, slope = step_matrices(system, step)
    drives = hold @ moved[:, :-1] + slope @ np.diff(moved, axis=1)
    states = np.zeros((len(system.a), moved.shape[1]))
    for index in range(drives.shape[1]):
        states[:, index + 1] = transition @ states[:, index] + drives[:, index]
    return np.asarray(system.c @ states)


def step_matrices(system: LinearSystem, step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One step: the change of the states by themselves, by the input at its start, and by the change of the input."""
    size, inputs = len(system.a), system.b.shape[1]
    chain = np.zeros((size + 2 * inputs, size + 2 * inputs))
    chain[:size, :size] = system.a * step
    chain[:size, size : size + inputs] = system.b * step
    chain[:size, size + inputs :] = system.e
    chain[size : size + inputs, size + inputs :] = np.eye(inputs)
    whole = scipy.linalg.expm(chain)
    return whole[:size, :size], whole[:size, size : size + inputs], whole[:size, size + inputs :]
