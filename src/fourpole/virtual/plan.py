"""The tests of a virtual campaign, in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import isclose, nan
from typing import Literal

from fourpole.models.interface import StateSpace
from fourpole.virtual.bench import Element, Zener, equations
from fourpole.virtual.tyres import ModelTyre, Tyre

PRESSURES = (100e3, 135e3, 170e3, 205e3, 240e3)
PRELOADS = (1000.0, 2000.0)
FREQUENCIES = (10.0, 12.0, 14.0, 16.0, 17.0, 18.0, 19.0, 20.0, 22.0, 24.0)
#: Beginning of the names of the demonstration's tests.
SERIES = "Köln"

#: Tyre, pressure [Pa] and preload [N].
_Condition = tuple[Tyre, float, float]


@dataclass(frozen=True)
class Planned:
    """One row of tests.csv, in SI units; not-a-number for a value that it does not have. A calibration has no tyre."""

    __test__ = False  # pytest must not collect this class

    name: str
    kind: Literal["static", "dynamic", "calibration"]
    tyre: Tyre | None = None
    pressure: float = nan
    preload: float = nan
    frequency: float = nan
    added_mass: float = 0.0
    eccentricity: float = 1e-3

    @property
    def mounted(self) -> Tyre:
        """The tyre; ValueError for a calibration."""
        if self.tyre is None:
            raise ValueError(f"test {self.name} is a calibration: a rigid block stands in the place of the tyre")
        return self.tyre

    def springs(self, frequency: float) -> Zener | StateSpace:
        """The springs of a dynamic test at the true `frequency` of the cam [Hz]."""
        return self.mounted.element(frequency, self.pressure, self.preload)

    def element(self, frequency: float) -> Element:
        """The springs with the mass that the specimen has of its own."""
        springs, inertia = self.springs(frequency), self.mounted.inertia
        return springs if inertia is None else inertia.laden(equations(springs))


def plan_tests(
    tyres: Sequence[Tyre],
    pressures: Sequence[float],
    preloads: Sequence[float],
    frequencies: Sequence[float],
    *,
    added_masses: Sequence[float] = (0.0,),
    added_mass_at: tuple[str, float, float] | None = None,
    calibration_masses: Sequence[float] = (),
    repeats: int = 1,
    mounts: Sequence[ModelTyre] = (),
    eccentricity: float = 1e-3,
) -> list[Planned]:
    """Static tests S1 ..., dynamic tests D1 ... and calibrations C1 ...; see `simulate_campaign` for the arguments.

    Raises
    ------
    ValueError
        If `added_mass_at` is no condition of the campaign, a calibration has no mass, the eccentricity is not
        positive, or `repeats` is below 1.

    Examples
    --------
    >>> from fourpole.virtual.tyres import RADIAL_PLY
    >>> [test.name for test in plan_tests([RADIAL_PLY], [170e3], [1000.0], [10.0, 24.0], calibration_masses=[10.0])]
    ['S1', 'D1', 'D2', 'C1', 'C2']
    """
    if not all(mass > 0.0 for mass in calibration_masses):
        raise ValueError(f"calibration_masses = {tuple(calibration_masses)}: the mass of a block must be > 0 kg")
    if not eccentricity > 0.0:
        raise ValueError(f"eccentricity = {eccentricity}: must be > 0 m")
    if repeats < 1:
        raise ValueError(f"repeats = {repeats}: a campaign has each dynamic test at least once")
    static = [*product(tyres, pressures), *((mount, nan) for mount in mounts)]
    conditions = [*product(tyres, pressures, preloads), *((mount, nan, preloads[0]) for mount in mounts)]
    dynamic = [
        (*condition, frequency, mass)
        for condition, masses in _with_masses(conditions, added_masses, added_mass_at)
        for mass, frequency in product(masses, frequencies)
    ] * repeats
    blocks = product(calibration_masses, frequencies)
    return [
        *(Planned(f"S{number}", "static", *row) for number, row in enumerate(static, start=1)),
        *(
            Planned(f"D{number}", "dynamic", *row, eccentricity=eccentricity)
            for number, row in enumerate(dynamic, start=1)
        ),
        *(
            Planned(f"C{number}", "calibration", frequency=frequency, added_mass=mass, eccentricity=eccentricity)
            for number, (mass, frequency) in enumerate(blocks, start=1)
        ),
    ]


def with_inertia(tests: Sequence[Planned]) -> bool:
    """Whether a specimen has a mass of its own."""
    return any(test.tyre is not None and test.tyre.inertia is not None for test in tests)


def _with_masses(
    conditions: Sequence[_Condition], added_masses: Sequence[float], at: tuple[str, float, float] | None
) -> list[tuple[_Condition, Sequence[float]]]:
    """Each condition with its added masses: all of them at the condition `at` (None: at each), elsewhere 0 only."""
    if at is None:
        return [(condition, added_masses) for condition in conditions]
    if not any(_is_at(condition, at) for condition in conditions):
        raise ValueError(f"added_mass_at = {at} is no condition (tyre, pressure, preload) of this campaign")
    none = [mass for mass in added_masses if mass == 0.0]
    return [(condition, added_masses if _is_at(condition, at) else none) for condition in conditions]


def _is_at(condition: _Condition, wanted: tuple[str, float, float]) -> bool:
    """Whether a condition has this tyre name, pressure [Pa] and preload [N]."""
    tyre, *numbers = condition
    return tyre.name == wanted[0] and all(isclose(a, b) for a, b in zip(numbers, wanted[1:], strict=True))
