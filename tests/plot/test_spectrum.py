"""The figure of a Prony series shows each arm at its time, with its interval, and nothing for other models."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plot.modelled import elastomer

from fourpole.fitting.modelfile import model_of
from fourpole.plot import draw, figure_data, render
from fourpole.plot.data import Role


@pytest.fixture(scope="module")
def results():
    return elastomer(model="prony:2")


def test_arms_stand_at_their_times_and_in_their_height(results):
    panel = figure_data(results, "spectrum").panels[2]
    entry = results.models.models[0]
    arms = model_of(entry).prony(entry.conditions[0].values)
    shown = next(one for one in panel.series if one.role is Role.POINTS and not one.hollow)
    active = arms.springs > 0
    assert shown.x == pytest.approx(1 / (2 * np.pi * arms.times[active]))
    assert shown.y == pytest.approx(arms.springs[active] / 1e3)
    assert panel.y.label == "K_i [kN/m]"
    zeros = [one for one in panel.series if one.hollow]
    assert sum(one.x.size for one in zeros) == int((~active).sum())
    wide = next(one for one in panel.series if one.role is Role.RANGE)
    at = [model_of(entry).symbols.index(f"K_{arm + 1}") for arm in range(arms.springs.size)]
    of_arms = [entry.conditions[0].intervals[place] for place in at]
    highs = [high / 1e3 for (_, high), on in zip(of_arms, active, strict=True) if on and high is not None]
    np.testing.assert_allclose(wide.y + wide.spread, highs)


@pytest.mark.sampled(4)
def test_the_same_results_give_the_same_bytes(results):
    first, second = (render(draw(results, "spectrum"), "spectrum", "svg") for _ in range(2))
    assert first == second


def test_other_models_have_no_spectrum():
    assert draw(elastomer(), "spectrum") is None
