"""Simulation of a model in time: the exact force for a deflection that is a cubic between its samples."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray
from fourpole.core.recursion import states_of
from fourpole.errors import ModelError
from fourpole.models.interface import StateSpace

#: Derivatives 0 to 3 of the cubic at the start of a step, times powers of the step, from x and step·v at both ends.
_HERMITE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-6.0, -4.0, 6.0, -2.0], [12.0, 6.0, -12.0, 6.0]])


def simulate(model: StateSpace, deflection: ArrayLike, rate: ArrayLike, step: float) -> FloatArray:
    """Force over time for a sampled deflection; the model is at rest at the first value before.

    Parameters
    ----------
    model : StateSpace
    deflection, rate : (N,) float arrays [m], [m/s]
        Samples of x and of its derivative. Between two samples x is the cubic with these values at both ends.
    step : float [s]
        Time between samples, > 0.

    Returns
    -------
    (N,) float array [N]
        Force, exact for cubics at every step. For a sine of n samples per cycle the relative error is (2 pi/n)^4/384.
        It is larger for a model with inertia, which amplifies the curvature errors of the cubics, but falls with the
        same power of the step.

    Raises
    ------
    ModelError
        If the arrays differ in length or the step is not positive.

    Examples
    --------
    >>> spring = StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([180e3, 0.0]))
    >>> simulate(spring, [0.0, 1e-3], [0.0, 0.0], 1e-3).tolist()
    [0.0, 180.0]
    """
    x, v = np.asarray(deflection, dtype=float), np.asarray(rate, dtype=float)
    if x.shape != v.shape or x.ndim != 1 or x.size == 0 or not step > 0:
        raise ModelError("deflection and rate must have the same length, and the step must be positive [s]")
    direct = model.d[0] * x + model.d[1] * v
    size = len(model.a)
    if not size:
        return np.asarray(direct)
    transition, push = cubic_step(model.a, model.b, step)
    at_rest = np.linalg.solve(-model.a, model.b[:, 0] * x[0])
    drives = push @ np.stack([x[:-1], step * v[:-1], x[1:], step * v[1:]])
    states = states_of(transition, np.vstack([at_rest, drives.T, np.zeros((1, size))]))[1:]
    return np.asarray(direct + states @ model.c)


def cubic_step(a: FloatArray, b: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Matrices of one step: (n, n) for the states, and (n, 4) for x and step·v at both ends of the cubic.

    A cubic is the output of a chain of integrators, so that one exponential of the system with this chain is exact.
    """
    size = len(a)
    chain = np.zeros((size + 4, size + 4))
    chain[:size, :size] = a * step
    chain[:size, size] = b[:, 0] * step
    chain[:size, size + 1] = b[:, 1]  # the integrators run over time/step, so that the slope is step·v
    chain[[size, size + 1, size + 2], [size + 1, size + 2, size + 3]] = 1.0
    whole = scipy.linalg.expm(chain)
    return whole[:size, :size], whole[:size, size:] @ _HERMITE
