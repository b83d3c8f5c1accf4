"""The condition of each row of tests.csv, by the campaign's own rule: `CampaignFile.sameness`.

The rule that says when two tests are of one condition is `core.condition.Sameness`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import Test
from fourpole.core.arrays import IntArray
from fourpole.core.condition import Condition, Sameness


def condition_of(test: Test, rule: Sameness) -> Condition:
    """The condition of a row of tests.csv on the axes of a rule; a blank cell is None."""
    values = (test.extra.get(axis.name) or None if axis.text else test.value(axis.name) for axis in rule.axes)
    return Condition(test.tyre, tuple(values))


def condition_numbers(campaign: Campaign, tests: Sequence[Test]) -> IntArray:
    """Number of the condition of some dynamic tests among all of the campaign; negative for a rigid block."""
    rule, every = campaign.stated.sameness, campaign.of_kind("dynamic")
    numbers = rule.groups([condition_of(test, rule) for test in every]).tolist()
    number = {test.name: number for test, number in zip(every, numbers, strict=True)}
    return np.array([-1 if test.kind == "calibration" else number[test.name] for test in tests], dtype=int)


def condition_words(test: Test, beside: Test | None = None, further: Sequence[str] = ()) -> str:
    """The condition of a test in words, as far as it differs from that of another test."""
    parts = [] if beside is not None and test.tyre == beside.tyre else [test.tyre]
    for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE):
        value = test.value(quantity.key)
        if value is not None and (beside is None or value != beside.value(quantity.key)):
            parts.append(f"{value / quantity.scale:.4g} {quantity.shown}")
    values = [(name, test.extra.get(name) or test.value(name)) for name in further]
    parts += [f"{name} {value}" for name, value in values if value is not None]
    return ", ".join(parts) or test.name
