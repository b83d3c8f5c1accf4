"""Fourpole: from tyre-rig recordings to stiffness, damping, mobility and transmissibility, with uncertainty.

The names below are all that a script needs; each is loaded when it is first used, so importing fourpole loads
no plotting, file or web library. Units are SI, angles radians, time factors e^{+jwt}.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourpole.campaign import Study, analyse, read_campaign
    from fourpole.core.demodulation.demodulate import demodulate
    from fourpole.core.identify import identify
    from fourpole.core.loadcurve import LoadCurve
    from fourpole.core.phasor import Phasors
    from fourpole.core.recording import Channel, Recording
    from fourpole.core.reduced import identify_mobility, predict
    from fourpole.core.rig import Rig
    from fourpole.core.routes import maxwell_arm
    from fourpole.core.twoport import (
        cascade,
        chain_mobility,
        chain_transmissibility,
        damper,
        deembed,
        inverse,
        mass,
        spring,
    )
    from fourpole.core.tyre import energy_loss, loss_factor, mobility, transmissibility, zener_stiffness
    from fourpole.errors import FourpoleError
    from fourpole.units import quantity
    from fourpole.virtual import simulate_campaign

_HOME = {
    "Channel": "core.recording",
    "FourpoleError": "errors",
    "LoadCurve": "core.loadcurve",
    "Phasors": "core.phasor",
    "Recording": "core.recording",
    "Rig": "core.rig",
    "Study": "campaign",
    "analyse": "campaign",
    "cascade": "core.twoport",
    "chain_mobility": "core.twoport",
    "chain_transmissibility": "core.twoport",
    "damper": "core.twoport",
    "deembed": "core.twoport",
    "demodulate": "core.demodulation.demodulate",
    "energy_loss": "core.tyre",
    "identify": "core.identify",
    "identify_mobility": "core.reduced",
    "inverse": "core.twoport",
    "loss_factor": "core.tyre",
    "mass": "core.twoport",
    "maxwell_arm": "core.routes",
    "mobility": "core.tyre",
    "predict": "core.reduced",
    "quantity": "units",
    "read_campaign": "campaign",
    "simulate_campaign": "virtual",
    "spring": "core.twoport",
    "transmissibility": "core.tyre",
    "zener_stiffness": "core.tyre",
}

__all__ = [
    "Channel",
    "FourpoleError",
    "LoadCurve",
    "Phasors",
    "Recording",
    "Rig",
    "Study",
    "analyse",
    "cascade",
    "chain_mobility",
    "chain_transmissibility",
    "damper",
    "deembed",
    "demodulate",
    "energy_loss",
    "identify",
    "identify_mobility",
    "inverse",
    "loss_factor",
    "mass",
    "maxwell_arm",
    "mobility",
    "predict",
    "quantity",
    "read_campaign",
    "simulate_campaign",
    "spring",
    "transmissibility",
    "zener_stiffness",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'fourpole' has no attribute {name!r}")
    return getattr(import_module(f"fourpole.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
