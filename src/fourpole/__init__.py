"""Fourpole: from tyre-rig recordings to stiffness, damping, mobility and transmissibility, with uncertainty.

The names below are those that a script needs first; four-poles are in `fourpole.twoport`. Each name is loaded when it
is first used, so importing fourpole loads no plotting, file or web library. Units are SI, angles are in radians, and
the time factor is e^{+jwt}.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # as type checkers know it; to import typing would take longer than all the rest
if TYPE_CHECKING:
    from typing import Any

    from fourpole import models
    from fourpole import twoport as twoport
    from fourpole.campaign import read_campaign
    from fourpole.core.channelerrors import ChannelUncertainty
    from fourpole.core.demodulation.demodulate import demodulate
    from fourpole.core.identify import Identification, identify
    from fourpole.core.joint import identify_joint
    from fourpole.core.loadcurve import LoadCurve
    from fourpole.core.phasor import Phasors
    from fourpole.core.recording import Channel, Recording
    from fourpole.core.rig import Rig
    from fourpole.core.routes import maxwell_arm
    from fourpole.errors import FourpoleError
    from fourpole.findings.compared import compare
    from fourpole.fitting.curvefit import fit
    from fourpole.planning.plan import plan
    from fourpole.plot.notebook import draw
    from fourpole.study import Study, analyse
    from fourpole.study.recording import read_recording
    from fourpole.study.results import read_results
    from fourpole.units import quantity
    from fourpole.virtual import simulate_campaign

_HOME = {
    "Channel": "core.recording",
    "ChannelUncertainty": "core.channelerrors",
    "FourpoleError": "errors",
    "Identification": "core.identify",
    "LoadCurve": "core.loadcurve",
    "Phasors": "core.phasor",
    "Recording": "core.recording",
    "Rig": "core.rig",
    "Study": "study",
    "analyse": "study",
    "compare": "findings.compared",
    "demodulate": "core.demodulation.demodulate",
    "draw": "plot.notebook",
    "fit": "fitting.curvefit",
    "identify": "core.identify",
    "identify_joint": "core.joint",
    "maxwell_arm": "core.routes",
    "plan": "planning.plan",
    "quantity": "units",
    "read_campaign": "campaign",
    "read_recording": "study.recording",
    "read_results": "study.results",
    "simulate_campaign": "virtual",
}
_MODULES = ("models", "twoport")
#: Modules of names that earlier versions had in this package.
_MOVED = {
    **dict.fromkeys(("energy_loss", "loss_factor", "mobility", "transmissibility", "zener_stiffness"), "core.tyre"),
    **dict.fromkeys(("identify_mobility", "predict"), "core.reduced"),
    **dict.fromkeys(("cascade", "chain_mobility", "chain_transmissibility", "damper"), "twoport"),
    **dict.fromkeys(("deembed", "inverse", "mass", "spring"), "twoport"),
}

__all__ = [
    "Channel",
    "ChannelUncertainty",
    "FourpoleError",
    "Identification",
    "LoadCurve",
    "Phasors",
    "Recording",
    "Rig",
    "Study",
    "analyse",
    "compare",
    "demodulate",
    "draw",
    "fit",
    "identify",
    "identify_joint",
    "maxwell_arm",
    "models",
    "plan",
    "quantity",
    "read_campaign",
    "read_recording",
    "read_results",
    "simulate_campaign",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"fourpole.{name}")
    if name in _HOME:
        return getattr(import_module(f"fourpole.{_HOME[name]}"), name)
    moved = f"; use fourpole.{_MOVED[name]}.{name}" if name in _MOVED else ""
    raise AttributeError(f"module 'fourpole' has no attribute {name!r}{moved}")


def __dir__() -> list[str]:
    return sorted([*__all__, "twoport"])
