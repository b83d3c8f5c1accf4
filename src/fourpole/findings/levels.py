"""Levels: the values of one quantity of one specimen over all conditions, and what they say by themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fourpole.findings.facts import Facts, Measured, tests_of
from fourpole.findings.finding import Finding, Holds, Key, Topic, conditions
from fourpole.quantities import CYCLE_LOSS, NONLINEARITY, Quantity

__all__ = ["CycleLoss", "Departure", "Level", "cycle_losses", "level_of", "linearity"]

#: Departure from a straight line, relative to the load span, below which a curve counts as nearly linear.
_NEARLY = 0.01
#: Departure above which a curve counts as markedly non-linear.
_MARKEDLY = 0.03


@dataclass(frozen=True)
class Level:
    """Values with their uncertainties, by condition, in SI."""

    kind: ClassVar[str] = "level"
    values: Mapping[Key, Measured]

    @property
    def lowest(self) -> Key:
        """Condition of the lowest value."""
        return min(self.values, key=lambda key: (self.values[key].value, key))

    @property
    def highest(self) -> Key:
        """Condition of the highest value."""
        return max(self.values, key=lambda key: (self.values[key].value, key))


@dataclass(frozen=True)
class Departure:
    """Departure of the load-deflection curves from a straight line, relative to the load span, one per pressure."""

    kind: ClassVar[str] = "linearity"
    shares: tuple[float, ...]


@dataclass(frozen=True)
class CycleLoss:
    """Energy lost in a static cycle of loading and unloading [J], one value per pressure."""

    kind: ClassVar[str] = "cycle loss"
    losses: tuple[float, ...]


def level_of(quantity: Quantity, tyre: str, values: Mapping[Key, Measured]) -> Finding:
    """The values of a quantity of one specimen; the effect is their mean, with the mean of their uncertainties."""
    mean, std = (float(np.mean([found.pair[i] for found in values.values()])) for i in (0, 1))
    at, tests = conditions(quantity.over, values), tests_of(values.values())
    return Finding(
        Topic(quantity.topic), quantity, (tyre,), Holds.MEASURED, Level(values), at, mean, std, quantity.unit, tests
    )


def linearity(facts: Facts) -> list[Finding]:
    """How far the load-deflection curves of each specimen depart from a straight line; the effect is the largest."""
    found = []
    for tyre in facts.tyres:
        values = facts.values(NONLINEARITY, tyre)
        shares = tuple(measured.value for measured in values.values())
        if shares:
            holds = Holds.NON_LINEAR
            if max(shares) < _NEARLY:
                holds = Holds.NEARLY_LINEAR
            elif min(shares) > _MARKEDLY:
                holds = Holds.MARKEDLY_NON_LINEAR
            found.append(_static(NONLINEARITY, tyre, values, holds, Departure(shares), max(shares)))
    return found


def cycle_losses(facts: Facts) -> list[Finding]:
    """What a static cycle of each specimen loses; the effect is the mean."""
    found = []
    for tyre in facts.tyres:
        values = facts.values(CYCLE_LOSS, tyre)
        losses = tuple(measured.value for measured in values.values())
        if losses:
            mean = float(np.mean(losses))
            found.append(_static(CYCLE_LOSS, tyre, values, Holds.MEASURED, CycleLoss(losses), mean))
    return found


def _static(
    quantity: Quantity,
    tyre: str,
    values: Mapping[Key, Measured],
    holds: Holds,
    detail: Departure | CycleLoss,
    effect: float,
) -> Finding:
    at, tests = conditions(quantity.over, values), tests_of(values.values())
    return Finding(Topic(quantity.topic), quantity, (tyre,), holds, detail, at, effect, None, quantity.unit, tests)
