"""Linear recursions over many samples, in blocks.

Within a block outputs are a product of matrices. From block to block the states are a recursion of the same kind, and
so on until few steps are left.
"""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray

#: Samples of a block, and number of steps that are taken one by one.
_BLOCK, _FEW = 12, 48


def outputs_of(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, inputs: FloatArray) -> FloatArray:
    """Outputs (p, N) of x' = a x + b u, y = c x + d u from x = 0, with inputs (N, m).

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> outputs_of(0.5 * one, one, one, 0 * one, np.ones((5, 1)))
    array([[0.   , 1.   , 1.5  , 1.75 , 1.875]])
    """
    count, m = inputs.shape
    blocks = -(-count // _BLOCK)
    # A row has the states at the start of a block, and the inputs of the block: filled in place, as memory takes time.
    rows = np.empty((blocks, len(a) + _BLOCK * m))
    u, whole = rows[:, len(a) :], count // _BLOCK
    u[:whole] = inputs[: whole * _BLOCK].reshape(whole, _BLOCK * m)
    u[whole:] = 0.0
    u[whole:, : (count - whole * _BLOCK) * m] = inputs[whole * _BLOCK :].reshape(1, -1)
    pushed, seen = [b], [c]
    for _ in range(_BLOCK - 1):
        pushed.append(a @ pushed[-1])
        seen.append(seen[-1] @ a)
    rows[:, : len(a)] = states_of(np.linalg.matrix_power(a, _BLOCK), u @ np.concatenate(pushed[::-1], axis=1).T)
    by_start = np.stack(seen).transpose(1, 2, 0)
    responses = np.stack([d, *(c @ one for one in pushed[:-1])])
    both = np.concatenate([by_start, _toeplitz(responses)], axis=1)
    return np.matmul(rows, both).reshape(len(c), -1)[:, :count]


def states_of(a: FloatArray, drives: FloatArray) -> FloatArray:
    """States (N, n) of x' = a x + drive from x = 0, with drives (N, n)."""
    count, n = drives.shape
    if count > _FEW:
        return outputs_of(a, np.eye(n), np.eye(n), np.zeros((n, n)), drives).T
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
