"""Comparison of two specimens: which has more of a quantity, by how much, and at which conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import ClassVar

import numpy as np

from fourpole.findings.evidence import Effect, between, mean_effect
from fourpole.findings.facts import Values, common, finding_on
from fourpole.findings.finding import Finding, Holds, Key
from fourpole.quantities import Quantity


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
    found = Comparison(names[upper], names[lower], differences(values[lower], values[upper]))
    holds = Holds.BELOW if found.holds is Holds.ABOVE and more else found.holds
    effect = mean_effect(list(differences(second, first).values()))
    both = dict(zip(names, values, strict=True))
    return finding_on(quantity, both, keys, holds, found, effect.value, effect.std)
