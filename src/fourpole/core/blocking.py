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

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Difficulty, Steep, judged
from fourpole.core.components import component
from fourpole.core.curvature import NOT_LINEAR
from fourpole.core.identify import Identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import transmissibility_route
from fourpole.core.sources import Kind, Role, Source

#: Relative u(K*) above which U (k = 2) is more than 1 dB, the accuracy of ISO 10846-3, and above which U exceeds K*.
_DECIBEL, _NOTHING = (10 ** (1 / 20) - 1) / 2, 0.5
#: Fewest tests that show springs, the least noise of K' among tests [1], and the springs in their u that are told.
_FEWEST, _LEAST, _CLEAR = 4, 5e-3, 4.0
#: Largest step of the logarithm of frequency between tests that are compared, and of that of their deflections.
_OCTAVE = float(np.log(2.0)) + 1e-3
#: Standard uncertainties by noise of each value up to which two values are alike: lines may be thousands.
_NOISE = 4.0
#: Change of K' over itself that a larger change of the deflection may make, as in filled rubber [1].
_PAYNE = 0.5
#: Where V1 - V2 is smaller than this share of V1, the errors of the sensors are multiplied.
_ALIKE = 0.5
_SPRINGS = (Source(Kind.RIG_VALUE, "preload_stiffness"), Source(Kind.RIG_VALUE, "preload_damping"))


def with_unstated_springs(rig: Rig, phasors: Phasors, added: FloatArray, family: np.ndarray) -> Rig:
    r"""The rig with the uncertainty of auxiliary springs of which nothing is stated [N/m], [N s/m].

    .. math:: u(K_3) = |K^*|/\sqrt 3, \qquad u(c_3) = 0.02 \cdot 2\sqrt{u(K_3)\,m}

    \|K*\| is the median of the tests above the resonance of the mass on the specimen. u(K3) is larger where K' over
    frequency shows stiffer springs. The damper is that of any rig. `added` is the added mass of each test [kg], and
    tests of one number of `family` have one K*.

    Examples
    --------
    >>> ratio = np.array([[np.nan, 1.0, -0.1]], dtype=complex)
    >>> test = Phasors(np.array([50.0]), ratio, np.zeros((1, 6, 6)), np.zeros(1), np.zeros(1))
    >>> with_unstated_springs(Rig(moving_mass=10.0), test, np.zeros(1), np.zeros(1)).std["preload_stiffness"].round(1)
    np.float64(51802.0)
    """
    stiffness, inertia = _without_springs(rig, phasors, added)
    size = np.abs(stiffness)
    above = size < inertia
    known = size[above] if above.any() else size[np.isfinite(size)]
    spring = float(np.median(known)) / np.sqrt(3.0) if known.size else 0.0
    spring = max(spring, shown_springs(rig, phasors, added, family))
    damper = component(Kind.RIG_VALUE).std * 2.0 * np.sqrt(spring * rig.moving_mass)
    return replace(rig, std={**rig.std, "preload_stiffness": spring, "preload_damping": float(damper)})


def _without_springs(rig: Rig, phasors: Phasors, added: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """K* of each test as on a mass without springs, and m w² [N/m]."""
    v1, v2 = phasors.amplitudes[:, 1:].T
    inertia = phasors.omega**2 * (rig.moving_mass + rig.tyre_mass + added)
    with np.errstate(divide="ignore", invalid="ignore"):
        return transmissibility_route(v2 / v1, inertia / (-1j * phasors.omega), phasors.omega), inertia


def shown_springs(rig: Rig, phasors: Phasors, added: FloatArray, family: np.ndarray) -> float:
    """Stiffness of auxiliary springs that K' over frequency shows clearly [N/m]; 0 where it shows none."""
    stiffness, inertia = _without_springs(rig, phasors, added)
    v1, v2 = phasors.amplitudes[:, 1:].T
    variance = np.einsum("nii->ni", phasors.covariance)[:, 2:].reshape(-1, 2, 2).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = np.sqrt(variance[:, 0] / np.abs(v1) ** 2 + variance[:, 1] / np.abs(v2) ** 2) / np.abs(1 - v2 / v1)
    spring, std = least_springs(stiffness.real, inertia, family, noise)
    return spring if spring > _CLEAR * std else 0.0


def least_springs(
    storage: FloatArray, inertia: FloatArray, family: np.ndarray, noise: FloatArray
) -> tuple[float, float]:
    r"""Stiffness of auxiliary springs that K' without them shows by its frequencies, and its uncertainty [N/m].

    K' of a relaxing specimen without inertia does not fall with the frequency. Springs make it too large by
    :math:`1/(1 - K_3/(m\omega^2))`, which falls. Least squares of :math:`1 = K'_0/K' + K_3/(m\omega^2)`, where K'_0 is
    one for each family, give the springs that keep K' constant: the least ones, as K' may rise.

    Parameters
    ----------
    storage : (N,) float array [N/m]
        K' without springs; positive values above the resonance of mass and specimen are used.
    inertia : (N,) float array [N/m]
        :math:`m\omega^2`.
    family : (N,) int array
        Tests of one number have one K*.
    noise : (N,) float array [1]
        Relative standard uncertainty of each K* by noise.

    Returns
    -------
    (K3, u)
        Value and standard uncertainty [N/m]. Not-a-number where no family has four tests above the resonance.

    Examples
    --------
    >>> inertia = 10 * (2 * np.pi * np.geomspace(40.0, 200.0, 9)) ** 2
    >>> spring, std = least_springs(1e5 / (1 - 5e3 / inertia), inertia, np.zeros(9), np.zeros(9))
    >>> round(spring), round(std, -2)
    (5000, 3400.0)
    """
    above = (storage > 0) & (storage < inertia)
    size = {of: int(np.sum(above & (family == of))) for of in np.unique(family[above]).tolist()}
    used = np.flatnonzero(above & np.isin(family, [of for of, count in size.items() if count >= _FEWEST]))
    if not used.size:
        return np.nan, np.nan
    own = np.where(family[used][:, None] == np.unique(family[used]), 1.0 / storage[used][:, None], 0.0)
    weight = 1.0 / np.maximum(noise[used], _LEAST)[:, None]
    design = np.column_stack([own, 1.0 / inertia[used]]) * weight
    normal = np.linalg.pinv(design.T @ design)
    solution = normal @ (design.T @ weight[:, 0])
    left = weight[:, 0] - design @ solution
    misfit = max(1.0, float(left @ left) / max(left.size - solution.size, 1))
    return float(solution[-1]), float(np.sqrt(normal[-1, -1] * misfit))


def blocking_checks(
    phasors: Phasors,
    rig: Rig,
    result: Identification,
    variance: Mapping[Source, FloatArray],
    added: FloatArray,
    family: np.ndarray,
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
    added : (N,) float array [kg]
        Added mass.
    family : (N,) int array
        Tests of one number have one K*.

    Returns
    -------
    tuple of N Check
        Rejected where U (k = 2) exceeds K*, a warning where springs or motions that are alike make it more than
        1 dB, or another source more than 60 %, else ok.
    """
    sources, parts = list(variance), np.stack([part[:, :2].sum(axis=1) for part in variance.values()])
    v1, v2 = phasors.amplitudes[:, 1:].T
    ratio, size = v2 / v1, np.abs(result.stiffness)
    relative = np.sqrt(np.trace(result.stiffness_covariance, axis1=1, axis2=2)) / size
    spring = 0.0 if rig.preload_stiffness else shown_springs(rig, phasors, added, family)
    checks = []
    for place, share in enumerate(relative.tolist()):
        main = sources[int(np.argmax(np.nan_to_num(parts[:, place])))]
        if main in _SPRINGS:
            unstated = Difficulty.SHOWN_SPRINGS if spring else Difficulty.UNSTATED_SPRINGS
            difficulty = Difficulty.SPRINGS if rig.preload_stiffness else unstated
        else:
            alike = main.kind.role is not Role.RIG and abs(1 - ratio[place]) < _ALIKE
            difficulty = Difficulty.ALIKE if alike else Difficulty.SOURCE
        enough = float(phasors.frequency[place]) * float(np.sqrt(share / _DECIBEL))
        said = {"difficulty": difficulty, "source": main.text, "ratio": abs(complex(ratio[place])), "spring": spring}
        warn = NOT_LINEAR if difficulty is Difficulty.SOURCE else _DECIBEL
        checks.append(judged(Code.BLOCKING, share, warn, _NOTHING, percent=200 * share, enough=enough, **said))
    return tuple(checks)


def steep_checks(
    phasors: Phasors, result: Identification, family: np.ndarray, *, blocked: bool = False
) -> dict[int, Check]:
    r"""A warning for each test whose K' contradicts K* at lower frequencies, as where the mass bends.

    Where the far side is `blocked`, only K' that falls is one, as a mass before the force cell makes it; the check has
    this mass [kg].

    K' of a relaxing specimen without inertia changes from one frequency to a higher one by

    .. math:: 0 \le K'(\omega_2) - K'(\omega_1) \le \int_{\omega_1}^{\omega_2} K''\,d\ln\omega

    The integral is that of the tests between them, with K'' + U; it is known where they are at most an octave from each
    other. The noise of both values counts four times, and what their shared errors leave in the difference twice. Where
    deflections differ by more than a factor of two, half of K' is allowed for the amplitude.

    Returns
    -------
    dict of int to Check
        By the place of the test.
    """
    std = np.sqrt(np.maximum(np.diagonal(result.stiffness_covariance, 0, 1, 2), 0.0))
    own = np.maximum(result.condition_covariance[:, 0, 0], 0.0) + (_LEAST * result.stiffness.real) ** 2
    noise = _NOISE * np.sqrt(own)
    storage, loss = result.stiffness.real, np.maximum(result.stiffness.imag, 0.0) + 2.0 * std[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        shared = result.stiffness_shared[:, 0] / storage[:, None]
        moved = np.log(np.abs(phasors.amplitudes[:, 1] - np.nan_to_num(phasors.amplitudes[:, 2])) / phasors.omega)
    certain = np.isfinite(storage) & np.isfinite(moved) & (std[:, 0] < _NOTHING * np.abs(result.stiffness))
    checks = {}
    for of in np.unique(family[certain]):
        here = np.flatnonzero(certain & (family == of))
        here = here[np.argsort(phasors.frequency[here], kind="stable")]
        logs = np.log(phasors.omega[here])
        steps = np.diff(logs, prepend=logs[:1])
        rise = np.cumsum(steps * (loss[here] + loss[np.roll(here, 1)]) / 2.0)
        start = np.maximum.accumulate(np.where(steps > _OCTAVE, np.arange(here.size), 0))
        for place in range(1, here.size):
            row, lower = here[place], np.arange(place)
            lower = lower[logs[lower] < logs[place] - 1e-6]
            below = here[lower]
            alike = np.abs(moved[below] - moved[row]) < _OCTAVE
            within = noise[row] + noise[below] + np.where(alike, 0.0, _PAYNE * storage[row])
            within = within + 2.0 * storage[row] * np.linalg.norm(shared[row] - shared[below], axis=1)
            least = storage[below] - within
            most = np.where(lower < start[place], np.inf, storage[below] + within + rise[place] - rise[lower])
            low = float(np.max(least, initial=-np.inf)) - storage[row]
            high = storage[row] - float(np.min(most, initial=np.inf))
            off = max(low, high) / abs(result.stiffness[row])
            if off > 0 and not (blocked and high >= low):
                hertz, steep = float(phasors.frequency[below[-1]]), Steep.FALLS if low > high else Steep.RISES
                said: dict[str, object] = {"percent": 100 * off, "steep": steep, "hertz": hertz}
                if blocked:
                    first = below[int(np.argmax(least))]
                    fallen = storage[first] - storage[row]
                    mass = float(fallen / (phasors.omega[row] ** 2 - phasors.omega[first] ** 2))
                    said |= {"form": "blocked", "mass": mass}
                checks[int(row)] = judged(Code.STEEP, off, 0.0, np.inf, **said)
    return checks
