"""Linear systems stepped exactly: inputs are straight between samples.

A recursion over all samples is done in blocks. Within a block outputs are a product of matrices; from block to block
the states are a recursion of the same kind, and so on until few steps are left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray

#: Samples of a block, and number of steps that are taken one by one.
_BLOCK, _FEW = 24, 48


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
    steady = (system.d - system.c @ np.linalg.solve(system.a, system.b)) @ first
    transition, hold, slope = step_matrices(system, step)
    # The states less slope · u follow from earlier inputs alone.
    push = transition @ slope + hold - slope
    direct = system.d + system.c @ slope
    outputs = _in_blocks(transition, push, system.c, direct, (inputs - first).T)
    if np.any(steady):
        outputs += steady
    if np.any(system.f):
        outputs += system.f @ np.gradient(inputs, step, axis=1)
    return outputs


def _in_blocks(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, inputs: FloatArray) -> FloatArray:
    """Outputs (p, N) of x' = a x + b u, y = c x + d u from x = 0, with inputs (N, m)."""
    count, m = inputs.shape
    blocks = -(-count // _BLOCK)
    padded = np.zeros((blocks * _BLOCK, m))
    padded[:count] = inputs
    u = padded.reshape(blocks, _BLOCK * m)
    pushed, seen = [b], [c]
    for _ in range(_BLOCK - 1):
        pushed.append(a @ pushed[-1])
        seen.append(seen[-1] @ a)
    starts = _states(np.linalg.matrix_power(a, _BLOCK), u @ np.concatenate(pushed[::-1], axis=1).T)
    by_start = np.stack(seen).transpose(1, 2, 0)
    responses = np.stack([d, *(c @ one for one in pushed[:-1])])
    both = np.concatenate([by_start, _toeplitz(responses)], axis=1)
    return np.matmul(np.hstack([starts, u]), both).reshape(len(c), -1)[:, :count]


def _states(a: FloatArray, drives: FloatArray) -> FloatArray:
    """States (N, n) of x' = a x + drive from x = 0."""
    count, n = drives.shape
    if count > _FEW:
        return _in_blocks(a, np.eye(n), np.eye(n), np.zeros((n, n)), drives).T
    states, turned = np.zeros((count, n)), np.ascontiguousarray(a.T)
    for at in range(count - 1):
        states[at + 1] = states[at] @ turned + drives[at]
    return states


def _toeplitz(responses: FloatArray) -> FloatArray:
    """Matrices (p, L m, L) from inputs to each output of a block, of responses (L, p, m) after 0, 1 ... samples."""
    size, p, m = responses.shape
    whole = np.zeros((p, size, m, size))
    for early in range(size):
        whole[:, early, :, early:] = responses[: size - early].transpose(1, 2, 0)
    return whole.reshape(p, size * m, size)


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
