"""Four-poles of mechanical elements and of their chains: the functions of `fourpole.core.twoport`.

Examples
--------
A tyre under its moving mass and preload spring, at 10 Hz:

>>> from fourpole.twoport import cascade, chain_mobility, mass, spring
>>> omega = 2 * 3.141592653589793 * 10.0
>>> chain = cascade(spring(194211.27 + 38773.60j, omega), mass(15.0, omega), spring(12440.0, omega))
>>> abs(chain_mobility(chain)).round(7)
np.float64(0.001034)
"""

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

__all__ = ["cascade", "chain_mobility", "chain_transmissibility", "damper", "deembed", "inverse", "mass", "spring"]
