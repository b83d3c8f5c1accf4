"""The figure of a model over the amplitude of the deflection shows the tests, the model and its frequencies."""

from functools import cache

import numpy as np
import polars as pl
import pytest
from tests.plot.modelled import elastomer

from fourpole.fitting.measured import measured_of, table_of
from fourpole.fitting.modelfile import model_of
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.models import profile
from fourpole.models.kraus import Kraus
from fourpole.plot import draw, figure_data, render
from fourpole.plot.data import Role
from fourpole.study.study import Study

LEVELS, FREQUENCY = np.array([0.1e-3, 0.5e-3, 2e-3]), np.geomspace(2.0, 50.0, 6)
TRUTH = [150e3, 250e3, 3e-3, 0.5, 80e3, 20e3, 0.5e-3, 0.55, 0.08, 0.05]


@pytest.fixture(scope="module")
def results():
    return over_amplitudes()


@cache
def over_amplitudes():
    """A mount whose K* depends on the amplitude, with its model."""
    f, x = (one.ravel() for one in np.meshgrid(FREQUENCY, LEVELS, indexing="ij"))
    k = Kraus(x).stiffness(TRUTH, 2 * np.pi * f)
    columns = {"tyre": ["mount"] * f.size, "test": [f"D{at}" for at in range(f.size)], "frequency [Hz]": f}
    columns |= {"amplitude [mm]": 1e3 * x, "Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}
    measured = measured_of(pl.DataFrame(columns), std=0.002, by_amplitude=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(profile, "_MOST_WORK", 0)  # intervals by profile likelihood would take seconds
        made = model_file(measured, fit_tyres(measured, "kraus"))
    return Study(pl.DataFrame(), table_of(measured), pl.DataFrame(), models=made)


def test_lines_are_the_model_s_and_points_the_tests(results):
    figure = draw(results, "amplitude")
    entry = results.models.models[0]
    storage, loss = figure.axes[:2]
    assert storage.get_xscale() == "log"
    lines = [line for line in storage.lines if line.get_label() == "_model"]
    assert len(lines) == 4
    x, shown = (np.asarray(one, dtype=float) for one in lines[0].get_data())
    exact = model_of(entry).at_amplitude(1e-3 * x).stiffness(entry.conditions[0].values, np.full(x.size, 4 * np.pi))
    assert shown == pytest.approx(exact.real / 1e3, rel=1e-6)
    assert (x.min(), x.max()) == pytest.approx((0.1, 2.0))
    assert [line.get_label() for line in loss.lines].count("_model") == 4


def test_the_figure_over_frequency_has_a_line_for_each_level(results):
    curves = [one for one in figure_data(results, "storage-loss").panels[0].series if one.role is Role.MODEL]
    assert [one.label for one in curves] == ["0.1 mm", "0.5 mm", "2 mm"]


def test_the_same_results_give_the_same_bytes(results):
    first, second = (render(draw(results, "amplitude"), "amplitude", "svg") for _ in range(2))
    assert first == second


def test_other_models_have_no_such_figure():
    assert draw(elastomer(), "amplitude") is None
