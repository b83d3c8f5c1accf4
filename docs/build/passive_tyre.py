"""What the route of the 1982 paper makes of a passive tyre if one thing is not as the route assumes.

The tyre is a generalised Maxwell model on the virtual rig. Its phasors have no noise: each departure of C from the true
one has one cause, the fault that was put in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from fourpole import Rig, maxwell_arm
from fourpole.core.routes import mobility_route
from fourpole.models.maxwell import GeneralisedMaxwell
from fourpole.models.ramp import Ramp
from fourpole.virtual import CROSS_PLY, RADIAL_PLY
from fourpole.virtual.phasor_rig import Conditions, Laboratory, simulate_phasors

#: The frequencies of the paper [Hz], half as far apart as in a campaign.
FREQUENCY = np.arange(10.0, 24.25, 0.5)
#: The tyre: stiffness at rest [N/m], stiffness of each arm [N/m], relaxation times [s], one per decade.
AT_REST, ARM = 110e3, 15e3
TIMES = 3.0 * 10.0 ** np.arange(2, -6, -1)
#: The rig of the paper: the moving mass [kg] is that of the project's other examples, the spring [N/m] is the paper's.
MASS, SPRING = 15.0, 12440.0
#: Pressures [Pa] and preloads [N] over which the paper compares.
PRESSURES, PRELOADS = (100e3, 170e3, 240e3), (1000.0, 2000.0)
#: The arms of the cross-ply tyre over those of the radial-ply tyre, as the laws of the virtual tyres have it.
STIFFER = 1.6


@dataclass(frozen=True)
class Fault:
    """One thing that is not as the paper's route assumes.

    Attributes
    ----------
    name, unit : str
        What is off, and the unit of its size.
    size : float
        The size of the example, in the unit.
    hidden : callable
        True values of the rig and errors of the sensors that nobody stated, by the size.
    stated : callable
        Values of the rig that the laboratory states, by the size.
    factor : callable
        Stated K1 over K* at rest, by the size.
    """

    name: str
    unit: str
    size: float
    hidden: Callable[[float], dict[str, float]] = field(default=lambda size: {})  # noqa: ARG005
    stated: Callable[[float], dict[str, float]] = field(default=lambda size: {})  # noqa: ARG005
    factor: Callable[[float], float] = field(default=lambda size: 1.0)  # noqa: ARG005


def _at_rate(branch: float) -> float:
    """K1 of the third loop over K* at rest, if a branch takes so many seconds."""
    return 1.0 + ARM * float(Ramp(branch, 3, 0.5).share(TIMES).sum()) / AT_REST


#: The faults of the page, in its order.
FAULTS = (
    Fault("V1/F1 too low", "%", 5.0, hidden=lambda s: {"gain V1": -s / 100}),
    Fault("V1/F1 too high", "%", 5.0, hidden=lambda s: {"gain V1": s / 100}),
    Fault("m stated too low", "%", 2.0, stated=lambda s: {"moving_mass": MASS * (1 - s / 100)}),
    Fault("m stated too high", "%", 2.0, stated=lambda s: {"moving_mass": MASS * (1 + s / 100)}),
    Fault("K3 stated too high", "%", 10.0, stated=lambda s: {"preload_stiffness": SPRING * (1 + s / 100)}),
    Fault("K3 stated too low", "%", 10.0, stated=lambda s: {"preload_stiffness": SPRING * (1 - s / 100)}),
    Fault("unweighed mass between cell and contact", "kg", 1.0, hidden=lambda s: {"input_mass": s}),
    Fault("tyre's part moves with m, not counted", "kg", 1.0, hidden=lambda s: {"tyre_mass": s}),
    Fault(
        "tyre's part counted as m, moves with the contact",
        "kg",
        1.0,
        hidden=lambda s: {"moving_mass": MASS - s, "input_mass": s},
    ),
    Fault("V1 ahead in phase", "°", 1.0, hidden=lambda s: {"phase V1": np.radians(s)}),
    Fault("V1 behind in phase", "°", 1.0, hidden=lambda s: {"phase V1": -np.radians(s)}),
    Fault("K1 of a loop, each branch", "s", 20.0, factor=_at_rate),
    Fault("K1 too high", "%", 5.0, factor=lambda s: 1 + s / 100),
    Fault("K1 too low", "%", 5.0, factor=lambda s: 1 - s / 100),
)


def tyre(frequency: np.ndarray, at_rest: float = AT_REST, arm: float = ARM) -> np.ndarray:
    """K* of the tyre [N/m] at frequencies [Hz]."""
    values = [at_rest, *[arm] * TIMES.size, *TIMES]
    return GeneralisedMaxwell(TIMES.size).stiffness(values, 2 * np.pi * frequency)


def by_paper(
    frequency: np.ndarray, stiffness: np.ndarray, at_rest: Any, fault: Fault | None = None, size: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """K2 [N/m] and C [N s/m] by the paper's route, from the phasors of the virtual rig with a fault of a size."""
    size = fault.size if fault is not None and size is None else size or 0.0
    fault = fault or Fault("", "", 0.0)
    laboratory = Laboratory(
        moving_mass=(MASS, 0.0),
        preload_stiffness=(SPRING, 0.0),
        preload_damping=(0.0, 0.0),
        undeclared=fault.hidden(size),
    )
    conditions = Conditions(frequency=frequency, stiffness=stiffness)
    phasors = simulate_phasors(laboratory, conditions, np.random.default_rng(0)).phasors
    rig = Rig(**{"moving_mass": MASS, "preload_stiffness": SPRING, **fault.stated(size)})
    k1 = np.broadcast_to(at_rest * fault.factor(size), frequency.shape)
    found = mobility_route(phasors.mobility, rig.mobility(phasors.omega), phasors.omega)
    return maxwell_arm(found, k1, phasors.omega)


def example(fault: Fault | None = None, size: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """K2 [N/m] and C [N s/m] of the page's tyre over `FREQUENCY`, by the paper's route."""
    return by_paper(FREQUENCY, tyre(FREQUENCY), AT_REST, fault, size)


def slope(values: np.ndarray, frequency: np.ndarray = FREQUENCY) -> float:
    """Slope of the straight line through values over the frequency [per Hz]."""
    return float(np.polyfit(frequency, values, 1)[0])


def top(values: np.ndarray, frequency: np.ndarray = FREQUENCY) -> float:
    """Frequency [Hz] of the largest value."""
    return float(frequency[int(np.argmax(values))])


#: What C may do, with the number that turns positive when it does, from C over `FREQUENCY`.
TURNS: dict[str, Callable[[np.ndarray], float]] = {
    "C rises at 10 Hz": lambda c: float(c[1] - c[0]),
    "its line rises": slope,
    "C rises up to 24 Hz": lambda c: float(np.diff(c).min()),
    "no C > 0 at 10 Hz": lambda c: float(-c[0]),
}


def least_size(fault: Fault, turn: Callable[[np.ndarray], float], most: float) -> float | None:
    """The least size of a fault at which a number turns positive, to three digits; None if it does not up to `most`."""
    sizes = np.geomspace(most / 1e3, most, 31)
    high = next((size for size in sizes if turn(example(fault, size)[1]) > 0), None)
    if high is None:
        return None
    low = 0.0 if high == sizes[0] else high / (sizes[1] / sizes[0])
    while high - low > 5e-4 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if turn(example(fault, middle)[1]) > 0 else (middle, high)
    return float(high)


@cache
def random_tyres(count: int) -> tuple[np.ndarray, np.ndarray]:
    """K* (count, F) and K* at rest (count,) of passive tyres whose loss factor at 17 Hz is 0.03 to 0.3.

    A tyre has one to eight arms with relaxation times from 0.1 ms to 1000 s; a stiffness at rest of 80 to 250 kN/m.
    """
    rng = np.random.default_rng(1982)
    found, rest = np.empty((count, FREQUENCY.size), dtype=complex), np.empty(count)
    at = 0
    while at < count:
        arms = int(rng.integers(1, 9))
        springs = 80e3 * rng.random(arms)
        times = 10.0 ** rng.uniform(-4.0, 3.0, arms)
        rest[at] = 10.0 ** rng.uniform(np.log10(80e3), np.log10(250e3))
        found[at] = GeneralisedMaxwell(arms).stiffness([rest[at], *springs, *times], 2 * np.pi * FREQUENCY)
        middle = found[at, FREQUENCY.size // 2]
        at += 0.03 <= middle.imag / middle.real <= 0.3
    return found, rest


def of_random_tyres(fault: Fault, count: int) -> tuple[np.ndarray, np.ndarray]:
    """K2 and C (count, F) of random tyres by the paper's route with a fault."""
    stiffness, rest = random_tyres(count)
    frequency = np.tile(FREQUENCY, count)
    k2, c = by_paper(frequency, stiffness.ravel(), np.repeat(rest, FREQUENCY.size), fault)
    return k2.reshape(count, -1), c.reshape(count, -1)


def over_conditions(
    name: str, fault: Fault | None, frequency: float
) -> tuple[dict[tuple[float, float], float], dict[tuple[float, float], float]]:
    """K2 and C at each pressure and preload at a frequency [Hz], for a tyre whose arms are the same at all of them.

    K1 is that of the virtual tyre of this name, so that K* at rest changes and nothing else does.
    """
    law, arm = (CROSS_PLY, STIFFER * ARM) if name == CROSS_PLY.name else (RADIAL_PLY, ARM)
    cases = [(pressure, preload) for preload in PRELOADS for pressure in PRESSURES]
    rest = np.array([float(law.static_stiffness(*case)) for case in cases])
    at = np.full(rest.size, frequency)
    stiffness = tyre(at[:1], 0.0, arm) + rest
    k2, c = by_paper(at, stiffness, rest, fault)
    return dict(zip(cases, k2.tolist(), strict=True)), dict(zip(cases, c.tolist(), strict=True))
