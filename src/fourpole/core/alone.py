"""K* and deflection of each test by itself, before tests are identified together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByRows, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelError, parts
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import stiffness_by


@dataclass(frozen=True, eq=False)
class Alone(ByRows):
    """K* and deflection of N tests, each without the others; not-a-number where they are not known.

    Attributes
    ----------
    stiffness : (N,) complex array [N/m]
        K*: from F1, V1 and V2, or from two of them and the rig where one is not known.
    noise : (N,) float array [1]
        Standard uncertainty of ln K* from the noise.
    deflection : (N,) float array [m]
        Amplitude of the specimen's deflection.
    frequency : (N,) float array [Hz]
        Frequency of the test.
    lever : (N,) complex array [1]
        1/(1 - V2/V1), by which an error of the ratio of the gains of V1 and V2 acts on ln K*; 0 without V2.
    """

    stiffness: ComplexArray
    noise: FloatArray
    deflection: FloatArray
    frequency: FloatArray
    lever: ComplexArray

    @classmethod
    def of(cls, phasors: Phasors, rigs: Sequence[Rig | None], added: FloatArray) -> Alone:
        """K* of N tests on their rigs, with their added masses [kg]."""
        which = np.array([id(rig) for rig in rigs])
        rows = [np.flatnonzero(which == one) for one in dict.fromkeys(which.tolist())]
        found = [_alone(phasors.part(of_rig), rigs[of_rig[0]], added[of_rig]) for of_rig in rows]
        order = np.argsort(np.concatenate([np.zeros(0, int), *rows]))
        kinds = (complex, float, float, float, complex)
        columns = zip(*found, strict=True) if found else [[]] * len(kinds)
        return cls(
            *(
                np.concatenate([np.zeros(0, kind), *of_rigs])[order]
                for of_rigs, kind in zip(columns, kinds, strict=True)
            )
        )


def _alone(phasors: Phasors, rig: Rig | None, added: FloatArray) -> tuple[np.ndarray, ...]:
    """The columns of the tests on one rig."""
    omega = phasors.omega
    f1, v1, v2 = phasors.amplitudes.T
    blocked = rig is not None and rig.blocked
    lost = ~np.isfinite(v2) | blocked
    with np.errstate(all="ignore"):
        force = f1 - (0.0 if rig is None else 1j * omega * rig.input_mass * v1)
        impedance = np.inf if rig is None or blocked else rig.impedance(omega, added)
        no_force = ~lost & ~np.isfinite(f1) & (rig is not None)
        ways = [stiffness_by(one, (force, v1, v2), impedance, omega) for one in ("mobility", "transmissibility")]
        stiffness = np.select([lost, no_force], ways, stiffness_by("relative", (force, v1, v2), impedance, omega))
        lever, none = np.where(lost, 0.0, v1 / (v1 - v2)), np.zeros_like(v1)
        by_force, by_motion = (1 / f1, -1 / v1, none), (1 / f1, -1 / (v1 - v2), 1 / (v1 - v2))
        slopes = np.select([lost, no_force], [by_force, (none, -lever / v1, lever / v2)], by_motion).T
        moved = deflection_amplitude(force, v1, v2, omega, stiffness=stiffness, blocked=blocked)
        # The larger standard uncertainty of both parts of ln K*, by its slopes.
        turn = np.stack([parts(slopes.conj()), parts(1j * slopes.conj())], axis=1).reshape(-1, 2, 6)
        covariance = np.where(np.isfinite(phasors.covariance), phasors.covariance, 0.0)
        noise = np.sqrt(np.einsum("nki,nij,nkj->nk", turn, covariance, turn).max(axis=1))
    return stiffness, noise, moved, phasors.frequency, lever


def deflection_std(
    amplitudes: ComplexArray, covariance: FloatArray, errors: Sequence[ChannelError], *, blocked: bool = False
) -> FloatArray:
    r"""Relative standard uncertainty (N,) of the amplitude of the deflection [1], by noise and errors of the channels.

    Parameters
    ----------
    amplitudes, covariance : (N, 3) complex [N], [m/s], (N, 6, 6) float
        F1, V1, V2 and the covariance of their noise. Where V2 is not-a-number, the deflection is F1/K*, and the part
        of F1 is returned.
    errors : sequence of ChannelError
        The errors of the channels.
    blocked : bool
        Whether the far side does not move.

    Examples
    --------
    >>> from fourpole.core.channelerrors import ChannelUncertainty
    >>> errors = ChannelUncertainty(gain=np.array([0.0, 0.01, 0.01])).errors(np.array([63.0]))
    >>> deflection_std(np.array([[100.0, 0.3, 0.1 + 0j]]), np.zeros((1, 6, 6)), errors).round(4)
    array([0.0158])
    """
    f1, v1, v2 = amplitudes.T
    alone = np.isnan(v2) & (not blocked)
    moved = v1 if blocked else v1 - v2
    with np.errstate(divide="ignore", invalid="ignore"):
        part, force = moved / np.abs(moved) ** 2, f1 / np.abs(f1) ** 2
    far = np.where(alone | blocked, 0.0, -part)
    slopes = np.stack([np.where(alone, force, 0.0), np.where(alone, 0.0, part), far], axis=1)
    real = parts(slopes).reshape(-1, 6)
    variance = np.einsum("ni,nij,nj->n", real, np.where(np.isfinite(covariance), covariance, 0.0), real)
    for error in errors:
        along = amplitudes[:, error.channel] * error.turn * error.std
        variance = variance + np.nan_to_num((np.conj(slopes[:, error.channel]) * along).real) ** 2
    return np.sqrt(variance)


def deflection_amplitude(
    force: ArrayLike,
    contact: ArrayLike,
    far: ArrayLike,
    omega: ArrayLike,
    *,
    stiffness: ArrayLike = np.nan,
    blocked: bool = False,
) -> FloatArray:
    r"""Amplitude of the deflection, 0-to-peak.

    .. math:: x = |V_1 - V_2|/\omega , \quad\text{or, where V2 is not known,}\quad x = |F/K^*|

    Parameters
    ----------
    force, contact, far : (...,) complex arrays [N], [m/s]
        Force on the specimen, and the velocities of both sides; V2 is not-a-number where it is not known.
    omega : (...,) float array [rad/s]
        > 0.
    stiffness : (...,) complex array, optional [N/m]
        K*.
    blocked : bool
        Whether the far side does not move.

    Returns
    -------
    (...,) float array [m]
        Not-a-number where neither V2 nor K* is known.

    Examples
    --------
    >>> deflection_amplitude(100.0, 0.3, 0.1, 200.0), deflection_amplitude(100.0, 0.3, np.nan, 200.0, stiffness=2e5)
    (array(0.001), array(0.0005))
    """
    w, v1 = np.asarray(omega, dtype=float), np.asarray(contact, dtype=complex)
    if blocked:
        return np.asarray(np.abs(v1) / w)
    moved = np.abs(v1 - np.asarray(far, dtype=complex)) / w
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(np.isfinite(moved), moved, np.abs(np.asarray(force) / np.asarray(stiffness))))
