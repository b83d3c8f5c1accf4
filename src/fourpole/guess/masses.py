r"""V1 and V2 of recordings without a force, where a mass behind the specimen shows it: which is which, and their signs.

The mass gives :math:`K^*/m = -\omega^2 T/(1 - T)` with :math:`T = V_2/V_1`: of an elastomer it has a small positive
angle and changes little with frequency. If columns are exchanged, or a sensor is turned round, it is negative, loses no
energy, or rises with :math:`\omega^2`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.guess.roles import phasors_of
from fourpole.guess.signals import SignalShape
from fourpole.units import shown
from fourpole.words.heads import LOWER, UPPER, Column, Role, words_of

#: Share of the tests that must show a passive specimen so that nothing is changed [1].
_MOST = 0.9
#: Departure of ln(K*/m) from a constant that no elastomer has: a factor of e, or an angle of 1 rad.
_STRANGE = 1.0
#: Usual loss angle [rad], and the departure after a change over that before it from which on it is made [1].
_LOSS, _CLEARLY = 0.1, 0.5
#: Departure of a sensor from another one up to which both are on one part [1]; the mass may tilt.
_FOLLOWS = 0.3
_ONLY = "only so K* is positive and much the same at all frequencies"
#: What is changed, as a doubt, by whether the columns are exchanged and one sensor is turned.
_CHANGES = {
    (False, False): "",
    (True, False): f"V1 and V2 are exchanged against what the names say: {_ONLY}",
    (False, True): f"its sign is turned: {_ONLY}",
    (True, True): f"V1 and V2 are exchanged against what the names say, and the sign of one is turned: {_ONLY}",
}
_MASS = (
    "rig: no force is recorded, so K* follows from the mass behind the specimen, which is stated nowhere",
    'fourpole init FOLDER --force --mass-above "12.5 kg" (or --mass-below), or moving_mass in [rig] of campaign.toml',
)
_SPRINGS = (
    (
        "rig: no force is recorded, so K* follows from the moving mass. The stiffness K3 of its auxiliary springs is "
        "stated nowhere: they count as softer than the specimen, so that u(K*)/K* is 0.6 K*/(m w²)"
    ),
    "state preload_stiffness in [rig] of campaign.toml if K* is wanted near the resonance of mass and specimen",
)
_UNLIKE = "the motions are not those of a mass behind a specimen: check columns and signs of both"


def shows_force(roles: Mapping[str, Role]) -> bool:
    """Whether a mass behind the specimen takes the place of a force: V1 and V2 are recorded, and F1 is not."""
    return "force_in" not in roles and {"motion_in", "motion_out"} <= roles.keys()


def rig_doubt(roles: Mapping[str, Role], rig: Mapping[str, float]) -> tuple[str, str] | None:
    """What the lack of a value of the rig costs, and the remedy; None if both are known."""
    if {"moving_mass", "preload_stiffness"} <= rig.keys():
        return None
    if shows_force(roles) and "moving_mass" in rig:
        return _SPRINGS
    if shows_force(roles):
        return _MASS
    with_both, without = "K*, K2, C and TR can be given", "no K*"
    if {"force_in", "motion_in", "motion_out"} <= roles.keys():
        with_both = "TR is predicted, and the joint route finds the errors of both values and of the sensors"
        without = "K* by the relative route, with the errors of the sensors as stated"
    lacking = "preload stiffness K3 is" if "moving_mass" in rig else "moving mass m and preload stiffness K3 are"
    found = f"rig: its {lacking} stated nowhere. With both (2 % is enough) "
    return f"{found}{with_both}. Without: {without}", "state both in [rig] of campaign.toml"


def by_mass(
    roles: dict[str, Role], shapes: Sequence[SignalShape], columns: Sequence[Column] = (), *, below: bool = False
) -> dict[str, Role]:
    """The roles of V1 and V2 by what a mass behind the specimen does; as they are where a force was recorded.

    With the mass `below`, words as lower and upper in the names mean the opposite of what they mean on a tyre rig. One
    of several `columns` whose motion is that of V1 or V2 is a further sensor beside it.
    """
    if not shows_force(roles):
        return roles
    near, far = roles["motion_in"], roles["motion_out"]
    if below and (_is(near, LOWER) or _is(far, UPPER)):
        near, far = far, near
    frequency, ratio = _ratios(near, far, shapes)
    doubt, stiffness = "", _stiffness(frequency, ratio)
    passive = float(np.mean((stiffness.real > 0) & (stiffness.imag > 0))) if ratio.size else 1.0
    if passive < _MOST or (ratio.size and _departure(stiffness) > _STRANGE):
        departures = {change: _departure(_stiffness(frequency, ratio, *change)) for change in _CHANGES}
        exchanged, turned = change = min(departures, key=lambda one: departures[one])
        if departures[change] > _STRANGE:
            doubt = _UNLIKE
        elif departures[change] < _CLEARLY * departures[False, False]:
            doubt, near, far = _CHANGES[change], *((far, near) if exchanged else (near, far))
            far = replace(far, invert=far.invert != turned)
    near, far = (_with_beside(one, other, shapes, columns) for one, other in ((near, far), (far, near)))
    far = replace(far, role="motion_out")
    return {**roles, "motion_in": replace(near, role="motion_in"), "motion_out": far.doubted(doubt) if doubt else far}


def _with_beside(role: Role, other: Role, shapes: Sequence[SignalShape], columns: Sequence[Column]) -> Role:
    """A role with the further sensors on its part: columns of its kind and unit that move as it does, and not as V1
    or V2 on the other side.
    """
    alike = []
    for column in columns:
        of_kind = (column.quantity, column.unit) == (role.quantity, role.unit)
        if of_kind and column.name not in (role.column, other.column):
            own, far = (_apart(column.name, one.column, shapes) for one in (role, other))
            alike += [column.name] if own < _FOLLOWS and own < far else []
    if not alike:
        return role
    listed = " and ".join(shown(name, 30) for name in (role.column, *alike))
    return replace(role, beside=tuple(alike)).doubted(f"the mean of {listed}, which move as sensors on one part do")


def _apart(one: str, other: str, shapes: Sequence[SignalShape]) -> float:
    """Median departure of the amplitudes of two columns from each other, over those of the second [1]."""
    pairs = [(shape.amplitudes.get(one, 0j), shape.amplitudes.get(other, 0j)) for shape in shapes]
    shares = [abs(a / b - 1) for a, b in pairs if b]
    return float(np.median(shares)) if shares else np.inf


def _ratios(near: Role, far: Role, shapes: Sequence[SignalShape]) -> tuple[FloatArray, ComplexArray]:
    """Frequencies [Hz] and V2 over V1 of the tests that have both."""
    frequency, v1, v2 = np.array([one.frequency for one in shapes]), phasors_of(near, shapes), phasors_of(far, shapes)
    known = np.isfinite(frequency) & np.isfinite(v1 * v2) & (v1 != 0) & (v2 != 0) & (v1 != v2)
    return frequency[known], v2[known] / v1[known]


def _stiffness(
    frequency: FloatArray, ratio: ComplexArray, exchanged: bool = False, turned: bool = False
) -> ComplexArray:
    """K* over the mass, in one unit, by V2 over V1 or what this is after a change."""
    ratio = (-1 if turned else 1) * (1 / ratio if exchanged else ratio)
    return -(frequency**2) * ratio / (1 - ratio)


def _departure(stiffness: ComplexArray) -> float:
    """Median departure of ln K* from a constant with a usual loss angle [1]."""
    logs = np.log(stiffness)
    return float(np.median(np.abs(logs - np.median(logs.real) - 1j * _LOSS)))


def _is(role: Role, words: frozenset[str]) -> bool:
    return bool(words & set(words_of(role.column)))
