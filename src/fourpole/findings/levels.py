"""Levels: the values of one quantity of one specimen over all conditions, without a comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np

from fourpole.findings.facts import Facts, Measured, Values, finding_on
from fourpole.findings.finding import Finding, Holds, Key
from fourpole.quantities import CYCLE_LOSS, NONLINEARITY, Quantity

Kind = TypeVar("Kind", bound="Level")
#: A curve whose departure from a straight line, relative to the load span, is below this is nearly linear.
_NEARLY = 0.01
#: A curve whose departure from a straight line is above this is markedly non-linear.
_MARKEDLY = 0.03


@dataclass(frozen=True)
class Level:
    """Values with their uncertainties by condition, in SI."""

    kind: ClassVar[str] = "level"
    values: Mapping[Key, Measured]

    @property
    def numbers(self) -> list[float]:
        """The values alone, in SI."""
        return [found.value for found in self.values.values()]


@dataclass(frozen=True)
class Departure(Level):
    """Departure of the load-deflection curves from a straight line, relative to the load span, by pressure."""

    kind: ClassVar[str] = "linearity"


@dataclass(frozen=True)
class CycleLoss(Level):
    """Energy lost in a static cycle of loading and unloading [J], by pressure."""

    kind: ClassVar[str] = "cycle loss"


def level_of(quantity: Quantity, tyre: str, values: Values) -> Finding:
    """The values of a quantity of one specimen; the effect is their mean, with the mean of their uncertainties."""
    mean, std = (float(np.mean([found.pair[i] for found in values.values()])) for i in (0, 1))
    return finding_on(quantity, {tyre: values}, values, Holds.MEASURED, Level(values), mean, std, unit=quantity.unit)


def linearity(facts: Facts) -> list[Finding]:
    """Departure of each specimen's load-deflection curves from a straight line; the effect is the largest."""
    found = []
    for tyre, detail in _static(facts, NONLINEARITY, Departure):
        shares, holds = detail.numbers, Holds.NON_LINEAR
        if max(shares) < _NEARLY:
            holds = Holds.NEARLY_LINEAR
        elif min(shares) > _MARKEDLY:
            holds = Holds.MARKEDLY_NON_LINEAR
        found.append(finding_on(NONLINEARITY, {tyre: detail.values}, detail.values, holds, detail, max(shares)))
    return found


def cycle_losses(facts: Facts) -> list[Finding]:
    """Energy that a static cycle of each specimen loses; the effect is the mean [J]."""
    return [
        finding_on(
            CYCLE_LOSS, {tyre: detail.values}, detail.values, Holds.MEASURED, detail, float(np.mean(detail.numbers)),
            unit=CYCLE_LOSS.unit,
        )
        for tyre, detail in _static(facts, CYCLE_LOSS, CycleLoss)
    ]  # fmt: skip


def _static(facts: Facts, quantity: Quantity, kind: type[Kind]) -> list[tuple[str, Kind]]:
    """The specimens that have a quantity, each with its values."""
    return [(tyre, kind(values)) for tyre in facts.tyres if (values := facts.values(quantity, tyre))]
