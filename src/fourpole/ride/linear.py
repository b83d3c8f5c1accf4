"""Linear systems stepped exactly: inputs are straight between samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.recursion import outputs_of


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
    >>> driven(lag, np.array([[0.0, 1.0, 2.0]]), 1.0).round(6).tolist()
    [[0.0, 0.367879, 1.135335]]
    """
    first, steady, moves = inputs[:, :1], np.zeros((len(system.c), 1)), inputs
    if np.any(first):
        steady = (system.d - system.c @ np.linalg.solve(system.a, system.b)) @ first
        moves = inputs - first
    transition, hold, slope = step_matrices(system.a, system.b, system.e, step)
    # The states less slope · u follow from earlier inputs alone.
    push = transition @ slope + hold - slope
    direct = system.d + system.c @ slope
    outputs = outputs_of(transition, push, system.c, direct, moves.T)
    if np.any(steady):
        outputs += steady
    if np.any(system.f):
        outputs += system.f @ np.gradient(inputs, step, axis=1)
    return outputs


def step_matrices(
    a: FloatArray, b: FloatArray, e: FloatArray, step: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One step: the change of the states by themselves, by the input at its start, and by the change of the input."""
    size, inputs = b.shape
    chain = np.zeros((size + 2 * inputs, size + 2 * inputs))
    chain[:size, :size] = a * step
    chain[:size, size : size + inputs] = b * step
    chain[:size, size + inputs :] = e
    chain[size : size + inputs, size + inputs :] = np.eye(inputs)
    whole = scipy.linalg.expm(chain)
    return whole[:size, :size], whole[:size, size : size + inputs], whole[:size, size + inputs :]
