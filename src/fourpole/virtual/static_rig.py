"""The static rig: slow load cycles with rate-independent hysteresis; the first cycles condition the rubber."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.virtual.tyres import Tyre

#: Share of the tyre's conditioning effect in the first and in the second cycle; it is 0 in later cycles.
_CONDITIONING_LEFT = (1.0, 0.15)


@dataclass(frozen=True, eq=False)
class StaticCycles(ByValue):
    """Load cycles of a static test, without sensors.

    Parameters
    ----------
    time : (n,) float array [s]
        Time from the start of the first cycle.
    deflection, load : (n,) float arrays [m], [N]
        Deflection and load, positive in compression; both are 0 between cycles.
    """

    time: FloatArray
    deflection: FloatArray
    load: FloatArray


def load_cycles(
    tyre: Tyre,
    pressure: float,
    *,
    peak_load: float = 3500.0,
    cycles: int = 4,
    period: float = 20.0,
    sample_rate: float = 50.0,
) -> StaticCycles:
    r"""Load a tyre slowly from zero deflection to `peak_load` and back, `cycles` times.

    The deflection is :math:`x = x_p\,(1 - \cos 2\pi t/T)/2`. With :math:`u = x/x_p` the load of cycle n is

    .. math:: F = F_{mean}(x) \pm h\,F_p\,4u(1-u) + \mu_n\,F_{mean}(x)\,(1-u^2)

    with + for loading and - for unloading, so that the mean of the branches at equal deflection is the tyre's law. The
    last term is present only for loading, and only in the first two cycles: rubber is stiffer in its first deflections
    (Mullins effect). None of these terms depends on the rate.

    Parameters
    ----------
    tyre : VirtualTyre or ModelTyre
    pressure : float [Pa]
    peak_load : float [N]
        Mean load at the largest deflection; > 0.
    cycles : int
        Number of complete cycles; >= 1.
    period, sample_rate : float [s], [Hz]
        Duration of one cycle; samples per second; both > 0.

    Returns
    -------
    StaticCycles

    Raises
    ------
    ValueError
        If an argument is out of its range.

    Examples
    --------
    >>> from fourpole.virtual.tyres import RADIAL_PLY
    >>> slow = load_cycles(RADIAL_PLY, 170e3)
    >>> slow.time.size, float(slow.load.max().round(0)) >= 3500.0
    (4001, True)
    """
    if not (peak_load > 0.0 and period > 0.0 and sample_rate > 0.0 and cycles >= 1):
        raise ValueError("peak_load, period and sample_rate must be > 0 and cycles >= 1")
    time = np.arange(round(cycles * period * sample_rate) + 1) / sample_rate
    phase = time / period
    peak = float(tyre.deflection(peak_load, pressure))
    u = np.sin(np.pi * phase) ** 2
    cycle = np.floor(phase).astype(int)
    loading = phase - cycle < 0.5
    share = np.array((*_CONDITIONING_LEFT, 0.0))[np.minimum(cycle, len(_CONDITIONING_LEFT))]
    mean = tyre.load(peak * u, pressure)
    gap = tyre.hysteresis * peak_load * 4.0 * u * (1.0 - u)
    conditioning = tyre.conditioning * share * mean * (1.0 - u * u)
    load = mean + np.where(loading, gap + conditioning, -gap)
    return StaticCycles(time=time, deflection=peak * u, load=load)
