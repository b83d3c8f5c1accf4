"""Exact solution of z' = A z + B u in equal steps, for inputs u that are polynomials within a step."""

from __future__ import annotations

import numpy as np
import scipy

from fourpole.core.arrays import FloatArray


def held_force(a: FloatArray, column: FloatArray, step: float) -> FloatArray:
    """Change of the states in one step (n, 2) per unit of a force at both ends of the step, linear between them."""
    size = a.shape[0]
    chain = np.zeros((size + 2, size + 2))
    chain[:size, :size] = a * step
    chain[:size, size] = column[:, 0] * step
    chain[size, size + 1] = 1.0
    return np.asarray(scipy.linalg.expm(chain)[:size, size:] @ np.array([[1.0, 0.0], [-1.0, 1.0]]))


def respond(a: FloatArray, b: FloatArray, x1: FloatArray, v1: FloatArray, step: float, kept: slice) -> FloatArray:
    """States (n, kept) from rest at the first point; the input is a cubic between the points."""
    # A cubic is the output of a chain of integrators; one exponential of the system with this chain gives the step.
    size = a.shape[0]
    chain = np.zeros((size + 4, size + 4))
    chain[:size, :size] = a * step
    chain[:size, size] = b[:, 0] * step
    chain[:size, size + 1] = b[:, 1]  # the time of the chain runs from 0 to 1, so its slope is step * v1
    chain[[size, size + 1, size + 2], [size + 1, size + 2, size + 3]] = 1.0
    held = scipy.linalg.expm(chain)[:size]
    derivatives = np.array(  # derivatives of the cubic at the start of a step, from x and step * v at its ends
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-6.0, -4.0, 6.0, -2.0], [12.0, 6.0, -12.0, 6.0]]
    )
    push = held[:, size:] @ derivatives
    ends = np.stack([x1[:-1], step * v1[:-1], x1[1:], step * v1[1:]])
    return recur(a, push, ends, step, kept)


def recur(a: FloatArray, push: FloatArray, ends: FloatArray, step: float, kept: slice) -> FloatArray:
    """States (n, kept) from rest: in each step the modes decay, and `push` times the input at its `ends` is added."""
    values, vectors = np.linalg.eig(a)
    if np.linalg.cond(vectors / np.abs(vectors).max(axis=1, keepdims=True)) > 1e9:
        return march(scipy.linalg.expm(a * step), push @ ends)[:, kept]
    keep = values.imag >= 0.0  # one mode of each conjugate pair is sufficient
    modal_push = np.linalg.solve(vectors, push.astype(complex))[keep]
    # einsum, because the threads that matmul starts cost more time here than they save
    drives = np.einsum("ij,jk->ik", np.vstack([modal_push.real, modal_push.imag]), ends)
    half = modal_push.shape[0]
    modes, weights = [], []
    for value, vector, re, im in zip(values[keep], vectors.T[keep], drives[:half], drives[half:], strict=True):
        pole = np.exp(value * step)
        if value.imag == 0.0:
            modes.append(scipy.signal.lfilter([1.0], [1.0, -pole.real], re))
            weights.append(vector.real)
        else:
            mode = scipy.signal.lfilter([1.0], [1.0, -pole], re + 1j * im)
            modes += [mode.real, mode.imag]
            weights += [2.0 * vector.real, -2.0 * vector.imag]
    history = np.stack([np.concatenate([[0.0], mode])[kept] for mode in modes])
    return np.asarray(np.einsum("ij,ik->jk", np.stack(weights), history))


def march(transition: FloatArray, pushes: FloatArray) -> FloatArray:
    """States (n, steps + 1) by the recursion step by step, for the rare system whose modes coincide."""
    states = np.zeros((pushes.shape[0], pushes.shape[1] + 1))
    for index in range(pushes.shape[1]):
        states[:, index + 1] = transition @ states[:, index] + pushes[:, index]
    return states
