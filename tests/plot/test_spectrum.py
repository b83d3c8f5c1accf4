"""The figure of a Prony series shows each arm at its time, with its interval, and nothing for other models."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plot.modelled import elastomer

from fourpole.fitting.modelfile import model_of
from fourpole.plot import draw, render


@pytest.fixture(scope="module")
def results():
    return elastomer(model="prony:2")


def test_arms_stand_at_their_times_and_in_their_height(results):
    figure = draw(results, "spectrum")
    assert figure is not None
    entry = results.models.models[0]
    arms = model_of(entry).prony(entry.conditions[0].values)
    (shown,) = (line for line in figure.axes[2].lines if line.get_label() == "_arm")
    active = arms.springs > 0
    assert np.asarray(shown.get_xdata()) == pytest.approx(1 / (2 * np.pi * arms.times[active]))
    assert np.asarray(shown.get_ydata()) == pytest.approx(arms.springs[active] / 1e3)
    assert figure.axes[2].get_ylabel() == "K_i [kN/m]"
    (zero,) = (line for line in figure.axes[2].lines if line.get_label() == "_zero")
    assert len(zero.get_xdata()) == int((~active).sum())


def test_the_same_results_give_the_same_bytes(results):
    first, second = (render(draw(results, "spectrum"), "spectrum", "svg") for _ in range(2))
    assert first == second


def test_other_models_have_no_spectrum():
    assert draw(elastomer(), "spectrum") is None
