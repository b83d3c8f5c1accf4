"""K* of a test by itself, before the tests are identified together, and its condition in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Test
from fourpole.core.arrays import ComplexArray
from fourpole.core.deflection import deflection_amplitude
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import stiffness_by


@dataclass(frozen=True)
class Own:
    """K* and deflection of a test by itself, without the other tests.

    Attributes
    ----------
    stiffness : complex [N/m]
        K*: from F1, V1 and V2, or from F1, V1 and the rig where V2 is not known.
    noise : float [1]
        Standard uncertainty of ln K* from the noise.
    deflection : float [m]
        Amplitude of the specimen's deflection.
    frequency : float [Hz]
        Frequency of the test.
    lever : complex [1]
        1/(1 - V2/V1), by which an error of the ratio of the gains of V1 and V2 acts on ln K*; 0 without V2.
    """

    stiffness: complex
    noise: float
    deflection: float
    frequency: float
    lever: complex


def own_of(phasors: Phasors | None, rig: Rig | None, added: float) -> Own:
    """K* and deflection of a test by itself; `added` is its added mass [kg]."""
    assert phasors is not None
    omega = float(phasors.omega)
    f1, v1, v2 = phasors.amplitudes
    force = f1 - (0.0 if rig is None else 1j * omega * rig.input_mass * v1)
    blocked = rig is not None and rig.blocked
    with np.errstate(all="ignore"):
        if blocked or not np.isfinite(v2):
            impedance = np.inf if rig is None or blocked else complex(rig.impedance(omega, added))
            stiffness = complex(
                stiffness_by("mobility", [np.asarray(one) for one in (force, v1, v2)], impedance, omega)
            )
            lever = 0j
            slopes = np.array([1 / f1, -1 / v1, 0.0])
        else:
            stiffness = complex(stiffness_by("relative", [np.asarray(one) for one in (force, v1, v2)], 0.0, omega))
            lever = complex(np.divide(v1, v1 - v2))
            slopes = np.array([1 / f1, -1 / (v1 - v2), 1 / (v1 - v2)])
        moved = deflection_amplitude(force, v1, v2, omega, stiffness=stiffness, blocked=blocked)
        noise = _noise(phasors, slopes)
    return Own(stiffness, noise, float(moved), float(phasors.frequency), lever)


def _noise(phasors: Phasors, slopes: ComplexArray) -> float:
    """The larger standard uncertainty of both parts of a complex function of the amplitudes, by its slopes (3,)."""
    turn = np.zeros((2, 6))
    turn[0, 0::2], turn[0, 1::2], turn[1, 0::2], turn[1, 1::2] = slopes.real, -slopes.imag, slopes.imag, slopes.real
    covariance = np.where(np.isfinite(phasors.covariance), phasors.covariance, 0.0)
    return float(np.sqrt(np.max(np.diag(turn @ covariance @ turn.T))))


def named(test: Test, beside: Test | None = None, further: Sequence[str] = ()) -> str:
    """The condition of a test in words, as far as it differs from that of another test."""
    parts = [] if beside is not None and test.tyre == beside.tyre else [test.tyre]
    for one in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE):
        value = test.value(one.key)
        if value is not None and (beside is None or value != beside.value(one.key)):
            parts.append(f"{value / one.scale:.4g} {one.shown}")
    values = [(name, test.extra.get(name) or test.value(name)) for name in further]
    parts += [f"{name} {value}" for name, value in values if value is not None]
    return ", ".join(parts) or test.name
