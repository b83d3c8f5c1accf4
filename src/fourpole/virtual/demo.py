"""The campaign of `fourpole demo`: a car's tyre, and behind it the two of the 1982 paper, named as laboratories do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isnan, radians
from typing import Any

from fourpole.virtual.plan import PRELOADS, PRESSURES, SERIES, Planned, plan_tests
from fourpole.virtual.tyres import BELTED, CAR_TYRE

#: Pressures of the car's tyre [Pa] and its only preload [N].
_PRESSURES, _PRELOAD = (180e3, 210e3, 240e3), 2000.0
#: Frequencies [Hz]; the pressures of the paper's tyres are every other one of the paper.
_FREQUENCIES = (10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0)
#: Mass that is added at one condition [kg], and amplitude of the contact below the car's tyre, which resonates [m].
_ADDED, _ECCENTRICITY = 10.0, 0.2e-3
_REPORT = {
    "laboratory": "Prüfstand 2 (virtual), Köln",
    "operator": "J. Müller (virtual)",
    "tested": "2026-11-02 to 2026-11-05",
    "method": "steady sines of a cam, 10 to 24 Hz; static loops",
}


def demo_settings() -> dict[str, Any]:
    """Arguments of `simulate_campaign` for the demonstration.

    Returns
    -------
    dict
        The tests, sensors of 0.5 % and 0.2°, the rig's uncertainties, and what the report says of the laboratory.

    Examples
    --------
    >>> tests = demo_settings()["tests"]
    >>> len(tests), tests[0].name, tests[-1].name
    (137, 'Köln_car-tyre_1.8bar_static', 'Köln_radial-ply_2.4bar_2000N_24Hz')
    """
    car = plan_tests(
        [CAR_TYRE],
        _PRESSURES,
        [_PRELOAD],
        _FREQUENCIES,
        added_masses=(0.0, _ADDED),
        added_mass_at=(CAR_TYRE.name, _PRESSURES[1], _PRELOAD),
        eccentricity=_ECCENTRICITY,
    )
    paper = plan_tests(BELTED, PRESSURES[::2], PRELOADS, _FREQUENCIES)
    return {
        "tests": list(_named([*car, *paper])),
        "sensors": (5e-3, radians(0.2)),
        "rig_std": {"moving_mass": 0.15, "preload_stiffness": 120.0, "preload_damping": 5.0},
        "report": _REPORT,
    }


def _named(tests: list[Planned]) -> Iterator[Planned]:
    """The tests, named by their conditions."""
    for test in tests:
        of_sine = "static" if isnan(test.frequency) else f"{test.preload:.4g}N_{test.frequency:.4g}Hz"
        mass = f"_{test.added_mass:.4g}kg" if test.added_mass else ""
        yield replace(test, name=f"{SERIES}_{test.mounted.name}_{test.pressure / 1e5:.4g}bar_{of_sine}{mass}")
