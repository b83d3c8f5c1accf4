r"""A blocking mass in place of a force cell: K* from two motions, and where that fails (ISO 10846-3, indirect method).

A mass m behind the specimen hangs on auxiliary springs :math:`K_3 + j\omega c_3`. Its motion shows the force:

.. math:: K^* = (m\omega^2 - K_3 - j\omega c_3)\,\frac{-T}{1 - T}, \qquad T = V_2/V_1

Springs that nobody states change K* by :math:`K_3/(m\omega^2)`, which falls with the square of the frequency. Soft
springs are softer than the specimen, :math:`0 \le K_3 \le |K^*|`. This alone makes K* uncertain by
:math:`|K^*|/(\sqrt 3\,m\omega^2)`. U (k = 2) is 1 dB where :math:`|T|` is about 0.1, the lower limit of the standard.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Check, Code, Difficulty, judged
from fourpole.core.components import component
from fourpole.core.curvature import NOT_LINEAR
from fourpole.core.identify import Identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import transmissibility_route
from fourpole.core.sources import Kind, Role, Source

#: Relative u(K*) above which U (k = 2) is more than 1 dB, the accuracy of ISO 10846-3, and above which U exceeds K*.
_DECIBEL, _NOTHING = (10 ** (1 / 20) - 1) / 2, 0.5
#: Where V1 - V2 is smaller than this share of V1, the errors of the sensors are multiplied.
_ALIKE = 0.5
_SPRINGS = (Source(Kind.RIG_VALUE, "preload_stiffness"), Source(Kind.RIG_VALUE, "preload_damping"))


def with_unstated_springs(rig: Rig, phasors: Phasors, added: FloatArray) -> Rig:
    r"""The rig with the uncertainty of auxiliary springs of which nothing is stated [N/m], [N s/m].

    .. math:: u(K_3) = |K^*|/\sqrt 3, \qquad u(c_3) = 0.02 \cdot 2\sqrt{u(K_3)\,m}

    |K*| is the median of the tests above the resonance of the mass on the specimen. The damper is that of any rig.
    `added` is the added mass of each test [kg].

    Examples
    --------
    >>> ratio = np.array([[np.nan, 1.0, -0.1]], dtype=complex)
    >>> test = Phasors(np.array([50.0]), ratio, np.zeros((1, 6, 6)), np.zeros(1), np.zeros(1))
    >>> with_unstated_springs(Rig(moving_mass=10.0), test, np.zeros(1)).std["preload_stiffness"].round(1)
    np.float64(51802.0)
    """
    v1, v2 = phasors.amplitudes[:, 1:].T
    omega, inertia = phasors.omega, phasors.omega**2 * (rig.moving_mass + rig.tyre_mass + added)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(transmissibility_route(v2 / v1, rig.impedance(omega, added), omega))
    above = size < inertia
    known = size[above] if above.any() else size[np.isfinite(size)]
    spring = float(np.median(known)) / np.sqrt(3.0) if known.size else 0.0
    damper = component(Kind.RIG_VALUE).std * 2.0 * np.sqrt(spring * rig.moving_mass)
    return replace(rig, std={**rig.std, "preload_stiffness": spring, "preload_damping": float(damper)})


def blocking_checks(
    phasors: Phasors, rig: Rig, result: Identification, variance: Mapping[Source, FloatArray]
) -> tuple[Check, ...]:
    """Check for each of N tests whether two motions and a mass determine K*, with what prevents it.

    Parameters
    ----------
    phasors : Phasors
        Amplitudes of the tests.
    rig : Rig
        The rig; K3 is 0 where it is not stated.
    result : Identification
        K* with its covariance.
    variance : mapping of Source to (N, 6) float array
        Variance of each of `fourpole.core.identify.OUTPUTS` by its source.

    Returns
    -------
    tuple of N Check
        Rejected where U (k = 2) is more than |K*|, a warning where springs or motions that are alike make it more than
        1 dB, or another source more than 60 %, else ok.
    """
    sources, parts = list(variance), np.stack([part[:, :2].sum(axis=1) for part in variance.values()])
    v1, v2 = phasors.amplitudes[:, 1:].T
    ratio, size = v2 / v1, np.abs(result.stiffness)
    relative = np.sqrt(np.trace(result.stiffness_covariance, axis1=1, axis2=2)) / size
    checks = []
    for place, share in enumerate(relative.tolist()):
        main = sources[int(np.argmax(np.nan_to_num(parts[:, place])))]
        if main in _SPRINGS:
            difficulty = Difficulty.SPRINGS if rig.preload_stiffness else Difficulty.UNSTATED_SPRINGS
        else:
            alike = main.kind.role is not Role.RIG and abs(1 - ratio[place]) < _ALIKE
            difficulty = Difficulty.ALIKE if alike else Difficulty.SOURCE
        enough = float(phasors.frequency[place]) * float(np.sqrt(share / _DECIBEL))
        said = {"difficulty": difficulty, "source": main.text, "ratio": abs(complex(ratio[place]))}
        warn = NOT_LINEAR if difficulty is Difficulty.SOURCE else _DECIBEL
        checks.append(judged(Code.BLOCKING, share, warn, _NOTHING, percent=200 * share, enough=enough, **said))
    return tuple(checks)
