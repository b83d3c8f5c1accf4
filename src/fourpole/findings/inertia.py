"""Specimens with a mass of their own, as findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fourpole import quantities as q
from fourpole.core.specimen import Form
from fourpole.findings.facts import Estimate
from fourpole.findings.finding import UNSTATED, Finding, FindingConditions, Holds, Setup, Topic
from fourpole.quantities import Quantity
from fourpole.study.inertia import FoundBody, bodies_in
from fourpole.study.study import Study


@dataclass(frozen=True)
class Inertia:
    """The mass of a specimen: its rows of specimens.csv, one for each condition without the frequency."""

    kind: ClassVar[str] = "inertia"
    bodies: tuple[FoundBody, ...]

    @property
    def form(self) -> Form:
        """A belt or a rod."""
        return self.bodies[0].form

    def ends(self, quantity: Quantity) -> tuple[Estimate, Estimate]:
        """The lowest and the highest value over the conditions; of equal ones the first, twice."""
        found = [Estimate(*body.pair(quantity)) for body in self.bodies]
        low, high = (pick(found, key=lambda one: one.value) for pick in (min, max))
        return low, high


def inertias(results: Study) -> list[Finding]:
    """The mass of each specimen that has one, on each rig; the effect is the mass [kg]."""
    groups: dict[tuple[str, str], list[FoundBody]] = {}
    for body in bodies_in(results):
        groups.setdefault((body.tyre, str(body.row[q.RIG.head] or "")), []).append(body)
    return [_finding(tyre, rig, bodies) for (tyre, rig), bodies in groups.items()]


def _finding(tyre: str, rig: str, bodies: list[FoundBody]) -> Finding:
    axes = q.PRESSURE.head, q.PRELOAD.head
    keys = tuple(tuple(body.place.get(column, UNSTATED) for column in axes) for body in bodies)
    where, detail = FindingConditions(("pressure", "load"), keys, Setup(rig)), Inertia(tuple(bodies))
    mass, std = bodies[0].pair(q.BELT_MASS)
    return Finding(Topic.INERTIA, q.BELT_MASS, (tyre,), Holds.MEASURED, detail, where, mass, std, unit=q.BELT_MASS.unit)
