r"""The fixture between the sensor of V1 and the specimen: a spring in series with K*, which gives way with it.

With its stiffness :math:`k_f` and the force F on the specimen, the motion of the specimen's contact is

.. math:: V_1' = V_1 - j\omega F/k_f.

No test of a specimen tells such a spring from the specimen itself; a rigid block in its place does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.phasor import Phasors


def without_fixture(phasors: Phasors, compliance: FloatArray, input_mass: FloatArray) -> Phasors:
    """Phasors with V1 at the specimen.

    Parameters
    ----------
    phasors : Phasors
        N tests, with V1 at its sensor.
    compliance : (N,) float array [m/N]
        1/k_f of the fixture; 0 where there is none.
    input_mass : (N,) float array [kg]
        Mass between the force cell and the fixture.

    Examples
    --------
    A specimen of 100 kN/m on a fixture of 900 kN/m looks 10 % softer:

    >>> one = Phasors.from_polar([10.0], 90.0, 2e-3 * np.pi * 10, np.pi / -2)
    >>> true = without_fixture(one, np.array([1 / 900e3]), np.zeros(1))
    >>> abs(true.omega * true.amplitudes[:, 0] / true.amplitudes[:, 1]).round(3).tolist()
    [100000.0]
    """
    jw = 1j * phasors.omega
    turn = np.tile(np.eye(3, dtype=complex), (len(jw), 1, 1))
    turn[:, 1, 0] = -jw * compliance
    turn[:, 1, 1] += jw**2 * input_mass * compliance
    # The inertia of the input mass, which moves with the sensor, stays the same as it is taken off F1 later.
    turn[:, 0] += (jw * input_mass)[:, None] * (turn[:, 1] - np.array([0.0, 1.0, 0.0]))
    known = np.where(np.isfinite(phasors.amplitudes), phasors.amplitudes, 0.0)
    amplitudes = np.where(np.isfinite(phasors.amplitudes), np.einsum("nij,nj->ni", turn, known), phasors.amplitudes)
    real = np.empty((len(jw), 6, 6))
    real[:, 0::2, 0::2] = real[:, 1::2, 1::2] = turn.real
    real[:, 1::2, 0::2], real[:, 0::2, 1::2] = turn.imag, -turn.imag
    covariance = real @ np.nan_to_num(phasors.covariance) @ np.swapaxes(real, 1, 2)
    return replace(phasors, amplitudes=amplitudes, covariance=covariance)


def given_way(phasors: Phasors, input_mass: float, rigid: BoolArray) -> tuple[ComplexArray, float]:
    """Change (N,) of log V1 by a fixture as compliant as the specimens are, and this compliance [m/N].

    It is 0 for tests without F1 or V1; the compliance is the median of those of all tests without a `rigid` block (N,).
    """
    f1, v1, v2 = phasors.amplitudes.T
    jw = 1j * phasors.omega
    with np.errstate(divide="ignore", invalid="ignore"):
        force = f1 - jw * input_mass * v1
        across = np.where(rigid, np.nan, np.abs((v1 - np.nan_to_num(v2)) / (phasors.omega * force)))
        size = float(np.nanmedian(across)) if np.isfinite(across).any() else 0.0
        change = jw * force / v1 * size
    return np.where(np.isfinite(change), change, 0.0), size
