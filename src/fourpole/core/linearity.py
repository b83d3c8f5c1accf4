r"""Linearity of a test: harmonics of the force that no linear specimen, or no linear rig, gives.

A linear specimen answers harmonic n of its deflection d with :math:`K^*(n\omega)\,d_n`, and a linear rig answers
harmonic n of V2 with :math:`Z_r(n\omega)\,V_{2,n}`. The force that remains is the specimen's own, or the rig's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, judged
from fourpole.core.demodulation.harmonics import Harmonics
from fourpole.core.recordingchecks import INCONSISTENT
from fourpole.core.rig import Rig

#: Harmonics of the specimen's own force over the fundamental. A dry friction or a cubic spring whose third harmonic is
#: 2 % makes up 6 % of the fundamental, and so K* depends on the amplitude by that much.
_SPECIMEN = 0.02
#: The same for the rig. Its friction then takes 3 % of the force, more than the usual uncertainty of a sensor.
_RIG = 0.01
#: Lowest natural frequency of a specimen by its own mass [Hz]; tyres have theirs from 50 Hz on.
_NATURAL = 40.0
#: Amplitudes below this many standard uncertainties of a part are noise: 4 of a million exceed it by chance.
_NOISE = 5.0
#: Harmonics of F1 are the channel's own if V2 needs less than this share of them.
_MOVED = 0.5


@dataclass(frozen=True)
class Excess:
    """Harmonics of the force that a linear test does not have, over the fundamental of F1.

    Attributes
    ----------
    specimen, rig : float [1]
        Root of the summed squares; not-a-number where the channels do not show it.
    unmoved : bool
        Whether the specimen's harmonics are not in V2, so that the channel of F1 makes them.
    """

    specimen: float
    rig: float
    unmoved: bool = False


def linearity_checks(harmonics: Harmonics, frequency: float, rig: Rig | None, added_mass: float) -> list[Check]:
    """Checks of the linearity of the specimen and of the rig; none where the channels do not show it.

    Parameters
    ----------
    harmonics : Harmonics
        Harmonics of the recording.
    frequency : float [Hz]
        Frequency of the fundamental.
    rig : Rig or None
        The rig as stated.
    added_mass : float [kg]
        Mass fixed to the moving mass in addition.

    Returns
    -------
    list of Check
        Linearity of the specimen or of the channel of F1, and linearity of the rig.
    """
    found = excess(harmonics, 2 * np.pi * frequency, rig, added_mass)
    rows = []
    if np.isfinite(found.specimen):
        code = Code.FORCE_LINEARITY if found.unmoved and found.specimen > _SPECIMEN else Code.LINEARITY
        rows.append(judged(code, found.specimen, _SPECIMEN))
    if np.isfinite(found.rig):
        rows.append(judged(Code.RIG_LINEARITY, found.rig, _RIG))
    return rows


def excess(harmonics: Harmonics, omega: float, rig: Rig | None, added_mass: float) -> Excess:
    r"""Harmonics of the force that the motion's harmonics do not explain.

    K* at a harmonic is taken as :math:`K^*(\omega)\,n^{2\delta/\pi}`, with :math:`\delta` the phase of K*. It is exact
    for a spring, a damper and a power law. A spring beside a damper, and a spring behind a damper, of the same phase
    give the largest departure from it. A mass of the specimen adds :math:`s/(1-s)`, :math:`s=(nf/f_0)^2`, where its
    lowest natural frequency :math:`f_0` is at least 40 Hz. Above it, harmonic n may depart by n - 1 times its size.
    If F1 and V2 contradict each other at the fundamental, both parts are not-a-number.

    Parameters
    ----------
    harmonics : Harmonics
    omega : float [rad/s]
        Angular frequency of the fundamental.
    rig : Rig or None
        The rig as stated.
    added_mass : float [kg]
        Mass fixed to the moving mass in addition.

    Examples
    --------
    >>> clean = np.array([[100.0, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, 0.0, 0.0]], dtype=complex)
    >>> bent = clean + [[0.0, 0.0, 25.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    >>> still = Rig(blocked=True)
    >>> for amplitudes in (clean, bent):
    ...     excess(Harmonics(amplitudes, np.zeros((3, 3)), np.ones(3, dtype=bool)), 63.0, still, 0.0).specimen
    0.0
    0.25
    """
    number = np.arange(1.0, harmonics.clear.size + 1)
    f1, v1, v2 = harmonics.amplitudes
    clear = harmonics.clear & (number > 1)
    if not (np.isfinite(f1[0]) and np.isfinite(v1[0])) or not clear.any() or f1[0] == 0:
        return Excess(np.nan, np.nan)
    jw = 1j * omega * number
    blocked = rig is not None and rig.blocked
    force = f1 - (0.0 if rig is None else rig.input_mass) * jw * v1
    needed = None if rig is None or blocked else np.asarray(rig.impedance(omega * number, added_mass))
    moved = _moved(force, v2, needed, blocked=blocked)
    if moved is None or _contradicts(force, v2, needed):
        return Excess(np.nan, np.nan)
    deflection = (v1 - moved) / jw
    stiffness = _extrapolated(force[0] / deflection[0], number)
    noise = harmonics.std
    far = 0.0 if blocked or np.isnan(v2[0]) else noise[2]
    spread = np.hypot(noise[0], np.abs(stiffness / jw) * np.hypot(noise[1], far))
    explained = stiffness * deflection
    allowed = _departure(np.angle(force[0] / deflection[0]), number, omega) * np.abs(explained)
    own = _above(force - explained, allowed + _NOISE * spread)
    specimen = _share(own[clear], force)
    if needed is None or np.isnan(v2[0]):
        return Excess(specimen, np.nan)
    left = _above(force - needed * v2, np.abs(force) + _NOISE * np.hypot(noise[0], np.abs(needed) * noise[2]))
    above = clear & (own > 0)
    in_v2 = np.linalg.norm((needed * v2)[above]) >= _MOVED * np.linalg.norm(force[above])
    return Excess(specimen, _share(left[clear], force), unmoved=not in_v2)


def _contradicts(force: ComplexArray, v2: ComplexArray, needed: ComplexArray | None) -> bool:
    """Whether F1 and V2 contradict each other at the fundamental, of which `check_consistency` warns."""
    if needed is None or np.isnan(v2[0]):
        return False
    return bool(abs(force[0] - needed[0] * v2[0]) > INCONSISTENT * abs(needed[0] * v2[0]))


def _moved(force: ComplexArray, v2: ComplexArray, needed: ComplexArray | None, *, blocked: bool) -> ComplexArray | None:
    """V2 of all harmonics: 0 where blocked, as measured, or as the rig's impedance gives it; None if unknown."""
    if blocked:
        return np.zeros_like(force)
    if np.isfinite(v2[0]):
        return v2
    return None if needed is None else force / needed


def _extrapolated(stiffness: complex, number: FloatArray) -> ComplexArray:
    """K* at the harmonics, by the power law that has the phase of K* [N/m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        lag = np.clip(np.angle(stiffness), 0.0, np.pi)
        return np.asarray(stiffness * number ** (2 * lag / np.pi))


def _departure(phase: float, number: FloatArray, omega: float) -> FloatArray:
    """Largest relative departure of a linear specimen's K* at the harmonics from its power law, (n,) [1]."""
    delta = float(np.clip(phase, 0.0, 0.5 * np.pi))
    turn, power = np.exp(-1j * delta), number ** (2 * delta / np.pi)
    beside = (np.cos(delta) + 1j * number * np.sin(delta)) * turn
    behind = 1j * number * turn / (np.sin(delta) + 1j * number * np.cos(delta))
    rubber = np.maximum(np.abs(beside / power - 1), np.abs(behind / power - 1))
    share = np.minimum((number * omega / (2 * np.pi * _NATURAL)) ** 2, 1.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(number - 1, rubber + share / (1 - share)))


def _above(amplitudes: ComplexArray, limit: FloatArray) -> FloatArray:
    """The part of each amplitude's modulus above a limit."""
    return np.maximum(np.abs(amplitudes) - limit, 0.0)


def _share(parts: FloatArray, force: ComplexArray) -> float:
    """Root of the summed squares of some parts [N] over the fundamental of the force [1]."""
    return float(np.linalg.norm(parts) / np.abs(force[0]))
