"""K* of a Zener tyre over pressure, preload and frequency, whose springs rise with both."""

from __future__ import annotations

import numpy as np
import polars as pl

from fourpole.models import Zener

FREQUENCY = np.geomspace(1.0, 60.0, 10)
PRESSURE, LOAD = "pressure [Pa]", "preload [N]"
PRESSURES, LOADS = (1.7e5, 2.0e5, 2.4e5), (2e3, 3.5e3, 5e3)


def parameters(pressure, load):
    """K1, K2 and C of the tyre."""
    springs = (pressure / 2e5) ** 0.8 * (load / 3.5e3) ** 0.15
    return np.array([180e3 * springs, 60e3 * springs, 700.0])


def stiffness(frequency, pressure, load):
    """K* of the tyre (N,) [N/m]."""
    return Zener().stiffness(parameters(pressure, load), 2 * np.pi * np.asarray(frequency))


def table(pressures=PRESSURES, loads=LOADS, tyre="tyre"):
    """K* without noise at all conditions, as a table."""
    return pl.DataFrame(
        {"tyre": tyre, PRESSURE: p, LOAD: load, "frequency [Hz]": f, "Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}
        for p in pressures
        for load in loads
        for f, k in zip(FREQUENCY, stiffness(FREQUENCY, p, load), strict=True)
    )
