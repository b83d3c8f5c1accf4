"""Values of one quantity over all conditions: those of one specimen, and those of two compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import ClassVar

import numpy as np

from fourpole.findings.evidence import Effect, between, mean_effect
from fourpole.findings.facts import Estimate, Facts, Values, common, finding_on
from fourpole.findings.finding import Finding, Holds, Key
from fourpole.quantities import CYCLE_LOSS, NONLINEARITY, Quantity

#: A curve whose departure from a straight line, relative to the load span, is below this is nearly linear.
_NEARLY = 0.01
#: A curve whose departure from a straight line is above this is markedly non-linear.
_MARKEDLY = 0.03


@dataclass(frozen=True)
class Level:
    """Values with their uncertainties by condition, in SI."""

    kind: ClassVar[str] = "level"
    values: Mapping[Key, Estimate]

    @property
    def numbers(self) -> list[float]:
        """The values alone, in SI."""
        return [measured.value for measured in self.values.values()]


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
    mean, std = (float(np.mean(part)) for part in zip(*(measured.pair for measured in values.values()), strict=True))
    return finding_on(quantity, {tyre: values}, values, Holds.MEASURED, Level(values), mean, std, unit=quantity.unit)


def linearity(facts: Facts) -> list[Finding]:
    """Departure of each specimen's load-deflection curves from a straight line; the effect is the largest."""
    findings = []
    for tyre, values in facts.by_tyre(NONLINEARITY).items():
        detail, holds = Departure(values), Holds.NON_LINEAR
        if max(detail.numbers) < _NEARLY:
            holds = Holds.NEARLY_LINEAR
        elif min(detail.numbers) > _MARKEDLY:
            holds = Holds.MARKEDLY_NON_LINEAR
        findings.append(finding_on(NONLINEARITY, {tyre: values}, values, holds, detail, max(detail.numbers)))
    return findings


def cycle_losses(facts: Facts) -> list[Finding]:
    """Energy that a static cycle of each specimen loses; the effect is the mean [J]."""
    findings = []
    for tyre, values in facts.by_tyre(CYCLE_LOSS).items():
        loss, unit = CycleLoss(values), CYCLE_LOSS.unit
        mean = float(np.mean(loss.numbers))
        findings.append(finding_on(CYCLE_LOSS, {tyre: values}, values, Holds.MEASURED, loss, mean, unit=unit))
    return findings


@dataclass(frozen=True)
class Comparison:
    """A quantity of one specimen against that of another.

    Attributes
    ----------
    upper, lower : str
        The specimen with the larger and with the smaller values, by the mean of their logarithms.
    effects : mapping
        Difference of upper less lower, relative to the lower, by condition.
    """

    kind: ClassVar[str] = "comparison"
    upper: str
    lower: str
    effects: Mapping[Key, Effect]

    @property
    def mean(self) -> Effect:
        """Mean difference over the conditions."""
        return mean_effect(list(self.effects.values()))

    @property
    def holds(self) -> Holds:
        """ABOVE: the upper exceeds the lower; MIXED: the order depends on the condition; or NO_DIFFERENCE."""
        searched, claimed = len(self.effects), self.mean.claimed()
        if not claimed and not any(effect.claimed(searched) for effect in self.effects.values()):
            return Holds.NO_DIFFERENCE
        opposed = any(effect.sign == -1 for effect in self.effects.values())
        return Holds.MIXED if opposed or not claimed else Holds.ABOVE


def differences(first: Values, second: Values) -> dict[Key, Effect]:
    """Second less first, relative to the first, at each condition in common."""
    return {key: between(first[key].pair, second[key].pair) for key in common(first, second)}


def compare(quantity: Quantity, names: tuple[str, str], values: tuple[Values, Values]) -> Finding | None:
    """The comparison of two specimens; None where they have no condition in common.

    The effect is first less second, relative to the second; the effects of the detail are relative to the lower.
    """
    first, second = values
    keys = common(first, second)
    if not keys:
        return None
    more = float(np.mean([log(second[key].value / first[key].value) for key in keys])) > 0.0
    upper, lower = (1, 0) if more else (0, 1)
    comparison = Comparison(names[upper], names[lower], differences(values[lower], values[upper]))
    holds = Holds.BELOW if comparison.holds is Holds.ABOVE and more else comparison.holds
    effect = mean_effect(list(differences(second, first).values()))
    both = dict(zip(names, values, strict=True))
    return finding_on(quantity, both, keys, holds, comparison, effect.value, effect.std)
