"""Which of two specimens has more of a quantity, by how much and where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from typing import ClassVar

import numpy as np

from fourpole.findings.evidence import Effect, between, mean_effect
from fourpole.findings.facts import Measured, common, tests_of
from fourpole.findings.finding import Finding, Holds, Key, Topic, conditions
from fourpole.quantities import Quantity

__all__ = ["Comparison", "compare", "differences"]

Values = Mapping[Key, Measured]


@dataclass(frozen=True)
class Comparison:
    """A quantity of one specimen against that of another.

    Attributes
    ----------
    upper, lower : str
        The specimen with the larger and with the smaller values, by the mean of their logarithms.
    effects : mapping
        How far the upper is above the lower, relative to the lower, by condition.
    """

    kind: ClassVar[str] = "comparison"
    upper: str
    lower: str
    effects: Mapping[Key, Effect]

    @property
    def mean(self) -> Effect:
        """Mean over the conditions."""
        return mean_effect(list(self.effects.values()))

    @property
    def mixed(self) -> bool:
        """Whether the order depends on the condition, or stands at single conditions only."""
        return any(effect.sign == -1 for effect in self.effects.values()) or not self.mean.claimed()

    @property
    def seen(self) -> bool:
        """Whether any difference is beyond its uncertainty."""
        looks = len(self.effects)
        return self.mean.claimed() or any(effect.claimed(looks) for effect in self.effects.values())


def differences(first: Values, second: Values) -> dict[Key, Effect]:
    """How far the second is above the first, at each condition in common."""
    return {key: between(first[key].pair, second[key].pair) for key in common(first, second)}


def compare(quantity: Quantity, names: tuple[str, str], values: tuple[Values, Values]) -> Finding | None:
    """The comparison of two specimens; None where they have no condition in common."""
    keys = common(*values)
    if not keys:
        return None
    more = float(np.mean([log(values[1][key].value / values[0][key].value) for key in keys])) > 0.0
    upper, lower = (1, 0) if more else (0, 1)
    found = Comparison(names[upper], names[lower], differences(values[lower], values[upper]))
    holds = Holds.ABOVE if upper == 0 else Holds.BELOW
    if not found.seen:
        holds = Holds.NO_DIFFERENCE
    elif found.mixed:
        holds = Holds.MIXED
    return Finding(
        Topic(quantity.topic),
        quantity,
        names,
        holds,
        found,
        conditions(quantity.over, keys),
        # The table gives the first specimen against the second; the detail is relative to the lower one.
        *_first_above_second(values, keys),
        "1",
        tests_of(*([each[key] for key in keys] for each in values)),
    )


def _first_above_second(values: tuple[Values, Values], keys: list[Key]) -> tuple[float, float]:
    mean = mean_effect([between(values[1][key].pair, values[0][key].pair) for key in keys])
    return mean.value, mean.std
