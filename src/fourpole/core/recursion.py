"""Linear recursions over many samples, in blocks; linear systems stepped exactly, with inputs straight between samples.

Within a block outputs are a product of matrices. From block to block the states are a recursion of the same kind, and
so on until few steps are left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray

#: Samples of a block, number of steps that are taken one by one, and blocks that are multiplied at a time.
_BLOCK, _FEW, _ROWS = 16, 48, 512


def outputs_of(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, inputs: FloatArray) -> FloatArray:
    """Outputs (p, N) of x' = a x + b u, y = c x + d u from x = 0, with inputs (N, m).

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> outputs_of(0.5 * one, one, one, 0 * one, np.ones((5, 1))).tolist()
    [[0.0, 1.0, 1.5, 1.75, 1.875]]
    """
    count, m = inputs.shape
    whole = count // _BLOCK
    pushed, seen = [b], [c]
    for _ in range(_BLOCK - 1):
        pushed.append(a @ pushed[-1])
        seen.append(seen[-1] @ a)
    u = inputs[: whole * _BLOCK].reshape(whole, _BLOCK * m)
    drives = np.zeros((-(-count // _BLOCK), len(a)))
    np.matmul(u, np.concatenate(pushed[::-1], axis=1).T, out=drives[:whole])
    states = states_of(np.linalg.matrix_power(a, _BLOCK), drives)
    responses = np.stack([d, *(c @ push for push in pushed[:-1])])
    both = np.concatenate([np.stack(seen).transpose(1, 2, 0), _toeplitz(responses)], axis=1)
    # A row has the states at the start of a block, and its inputs. Few rows at a time: fresh memory takes longer.
    outputs, rows = np.empty((len(c), len(drives), _BLOCK)), np.empty((_ROWS, len(a) + _BLOCK * m))
    for first in range(0, whole, _ROWS):
        some = slice(first, min(first + _ROWS, whole))
        here = rows[: some.stop - first]
        here[:, : len(a)], here[:, len(a) :] = states[some], u[some]
        np.matmul(here, both, out=outputs[:, some])
    if len(drives) > whole:
        last = np.zeros(both.shape[1])
        last[: len(a)] = states[whole]
        last[len(a) : len(a) + (count - whole * _BLOCK) * m] = inputs[whole * _BLOCK :].ravel()
        outputs[:, whole] = last @ both
    return outputs.reshape(len(c), -1)[:, :count]


def states_of(a: FloatArray, drives: FloatArray) -> FloatArray:
    """States (N, n) of x' = a x + drive from x = 0, with drives (N, n)."""
    count, n = drives.shape
    if count > _FEW:
        return outputs_of(a, np.eye(n), np.eye(n), np.zeros((n, n)), drives).T
    states, turned = np.zeros((count, n)), np.ascontiguousarray(a.T)
    for i in range(count - 1):
        states[i + 1] = states[i] @ turned + drives[i]
    return states


def _toeplitz(responses: FloatArray) -> FloatArray:
    """Matrices (p, L m, L) from inputs to each output of a block, of responses (L, p, m) after 0, 1 ... samples."""
    size, p, m = responses.shape
    whole = np.zeros((p, size, m, size))
    for early in range(size):
        whole[:, early, :, early:] = responses[: size - early].transpose(1, 2, 0)
    return whole.reshape(p, size * m, size)


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
