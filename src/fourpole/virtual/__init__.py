"""The static and the dynamic rig of the 1982 paper in software, to test an analysis against known true values.

This package shares no formula with `fourpole.core`. The tyre is a set of differential equations, its own or those of a
causal model, which is integrated in time or solved at one frequency.
"""

from fourpole.virtual.bench import Belt, Bench, Laden, Rod, Zener, state_matrices
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import Motion, run, run_block
from fourpole.virtual.phasor_rig import Conditions, DrawnLaboratory, Laboratory, PhasorCampaign, draw, simulate_phasors
from fourpole.virtual.recordings import StaticCycles, load_cycles
from fourpole.virtual.sensors import Sensor, sample
from fourpole.virtual.simulate import SimulatedCampaign, simulate_campaign
from fourpole.virtual.tyres import BELTED, CAR_TYRE, CROSS_PLY, RADIAL_PLY, RUBBER_MOUNT, ModelTyre, VirtualTyre

__all__ = [
    "BELTED",
    "CAR_TYRE",
    "CROSS_PLY",
    "RADIAL_PLY",
    "RUBBER_MOUNT",
    "Belt",
    "Bench",
    "Cam",
    "Conditions",
    "DrawnLaboratory",
    "Laboratory",
    "Laden",
    "ModelTyre",
    "Motion",
    "PhasorCampaign",
    "Rod",
    "Sensor",
    "SimulatedCampaign",
    "StaticCycles",
    "VirtualTyre",
    "Zener",
    "draw",
    "load_cycles",
    "run",
    "run_block",
    "sample",
    "simulate_campaign",
    "simulate_phasors",
    "state_matrices",
]
