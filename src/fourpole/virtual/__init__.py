"""Both rigs of the 1982 paper in software, in the time domain, to test an analysis against a known truth.

Nothing here shares a formula with the core: the tyre is a set of differential equations, marched in time.
"""

from fourpole.virtual.dynamic_rig import Bench, Cam, Motion, Zener, run, state_matrices
from fourpole.virtual.sensors import Sensor, sample
from fourpole.virtual.simulate import SimulatedCampaign, simulate_campaign
from fourpole.virtual.static_rig import StaticCycles, load_cycles
from fourpole.virtual.tyres import CROSS_PLY, RADIAL_PLY, VirtualTyre

__all__ = [
    "CROSS_PLY",
    "RADIAL_PLY",
    "Bench",
    "Cam",
    "Motion",
    "Sensor",
    "SimulatedCampaign",
    "StaticCycles",
    "VirtualTyre",
    "Zener",
    "load_cycles",
    "run",
    "sample",
    "simulate_campaign",
    "state_matrices",
]
