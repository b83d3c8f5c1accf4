r"""Models of a tyre's dynamic stiffness K*: values, derivatives and, for causal models, their motion in time.

Each family is a class of this package, imported when it is first used: ``from fourpole.models import Zener``.

==================== ==================================================================================
`Spring`             linear spring, :math:`K^* = K`
`KelvinVoigt`        spring parallel to a viscous damper, :math:`K^* = K + j\omega C`
`Zener`              the paper's K1 parallel to an arm of constant K2 and C
`GeneralisedMaxwell` spring parallel to n arms of spring and damper in series
`Prony`              the same with fixed relaxation times, so many per decade of the band
`FractionalZener`    two springs and one power of the frequency
`FractionalZener5`   the same with a second power, for a skew loss peak
`Resonant`           spring and arms with resonances, for specimens with inertia
`Kraus`              filled rubber, whose K* depends on the amplitude of the deflection; not causal
`Structural`         spring with structural damping, :math:`K^* = K (1 + j\eta)`; not causal; for one condition
`GehmanLaw`          K1 parallel to an arm whose K2 and C are smooth functions of the frequency; likewise
`Shell`              inflated cylindrical shell on radial springs, with inertia; for one condition
==================== ==================================================================================

The registry `fourpole.models.families` has the name of each family in commands and files.
"""

from __future__ import annotations

from typing import Any

from fourpole.face import load
from fourpole.models.families import FAMILIES, NAMED

_HOME = {
    place.rpartition(".")[2]: place for place in (*(f"{__name__}.{one}" for one in FAMILIES.values()), *NAMED.values())
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; its models are {', '.join(_HOME)}")
    return load(_HOME[name])


def __dir__() -> list[str]:
    return sorted(_HOME)
