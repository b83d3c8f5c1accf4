"""First values of K* for the joint solution: in closed form, by the route with the smallest stated uncertainty."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import ComplexArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint.conditions import JointConditions
from fourpole.core.joint.model import Observed
from fourpole.core.joint.shared import Shared
from fourpole.core.routes import stiffness_by

#: Least relative uncertainty of a channel or of the rig in the comparison of routes.
_LEAST = 1e-4


def closed_form_start(
    observed: Observed, conditions: JointConditions, shared: Shared, channels: ChannelUncertainty
) -> ComplexArray:
    """K* of each condition [N/m], from the stated rig and the amplitudes as measured."""
    rig, omega = shared.rig, observed.omega
    added = observed.added(shared.masses)
    impedance = np.asarray(rig.impedance(omega, added))
    f1, v1, v2 = np.where(observed.amplitudes == 0, np.nan, observed.amplitudes).T
    f1 = f1 - 1j * omega * rig.input_mass * v1
    u_f, u_1, u_2 = np.hypot(np.hypot(channels.gain, channels.phase), _LEAST)
    spread = np.abs(rig.impedance_gradient(omega, added)[:, :-1]) * rig.uncertainties
    with np.errstate(divide="ignore", invalid="ignore"):
        u_z = np.sqrt(np.sum(spread**2, axis=1)) / np.abs(impedance) + _LEAST
        routes = ("relative", "mobility", "transmissibility")
        found = np.stack([stiffness_by(route, (f1, v1, v2), impedance, omega) for route in routes])
        apart, tyre = np.abs(v1 - v2), np.abs(v1 / f1 - 1 / impedance)
        off = np.stack(
            [
                np.sqrt(u_f**2 + (np.abs(v1) * u_1 / apart) ** 2 + (np.abs(v2) * u_2 / apart) ** 2),
                np.sqrt(np.abs(v1 / f1) ** 2 * (u_f**2 + u_1**2) + np.abs(u_z / impedance) ** 2) / tyre,
                np.sqrt(u_z**2 + (u_1**2 + u_2**2) * np.abs(v1 / (v1 - v2)) ** 2),
            ]
        )
    off = np.where(np.isfinite(off) & np.isfinite(found) & (found != 0), off, np.inf)
    best = np.argmin(off, axis=0)
    at = np.arange(omega.size)
    weight = 1 / np.minimum(off[best, at], 1e6) ** 2
    value = np.where(np.isfinite(found[best, at]), found[best, at], 1e5)
    return conditions.sum(value * weight) / conditions.sum(weight)
