"""Linear recursions over many samples, in blocks.

Within a block outputs are a product of matrices. From block to block the states are a recursion of the same kind, and
so on until few steps are left.
"""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray

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
