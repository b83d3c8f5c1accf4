"""Which tests share one K*, and how far they do at different temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole.campaign.folder import Campaign, Test, condition_of
from fourpole.campaign.schema import ConditionsFile
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import temperature_std
from fourpole.core.identification import Identification

#: Uncertainty of K* from the temperature of a test above which a note tells it [1].
_NOTED = 1e-4


def families(campaign: Campaign, tests: Sequence[Test]) -> np.ndarray:
    """Number of the condition of each test among all tests of the campaign; negative for a rigid block."""
    rule, every = campaign.stated.sameness, campaign.of_kind("dynamic")
    groups = rule.groups([condition_of(test, rule) for test in every]).tolist()
    number = {test.name: at for test, at in zip(every, groups, strict=True)}
    return np.array([-1 if test.kind == "calibration" else number[test.name] for test in tests])


def temperatures_apart(tests: Sequence[Test], family: np.ndarray, conditions: ConditionsFile) -> FloatArray:
    """Standard uncertainty (N,) of log K* for the temperature of each test apart from the mean of its condition [1]."""
    temperature = np.array([np.nan if (t := test.value("temperature")) is None else t for test in tests])
    return temperature_std(temperature, family, conditions.per_kelvin)


def at_mean_temperature(found: Identification, apart: FloatArray) -> Identification:
    """The result with the covariance of each condition at its mean temperature; K* of a test stays at its own."""
    moved = (apart * np.abs(found.stiffness))[:, None, None] ** 2 * np.eye(2)
    return replace(found, condition_covariance=found.condition_covariance + moved)


def temperature_note(apart: FloatArray, conditions: ConditionsFile) -> list[str]:
    """The note that tests of one condition had different temperatures, if this adds to the uncertainty of K*."""
    most, per_kelvin = float(apart.max(initial=0.0)), conditions.per_kelvin
    if most < _NOTED:
        return []
    stated = "stated" if conditions.temperature_sensitivity is not None else "assumed"
    text = (
        f"[conditions] tests of one condition were up to {most / per_kelvin:.2g} K from its mean temperature. Their K* "
        f"counts as uncertain by {100 * per_kelvin:.3g} %/K ({stated}: temperature_sensitivity), here by up to "
        f"{100 * most:.2g} %, between these tests"
    )
    return [text]
