"""The figure of four poles: what it shows, and that it can be read."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from tests.belted_rig import BeltedRig
from tests.plot.legible import illegible

from fourpole.campaign.row import Test as Row
from fourpole.core.allpoles import all_poles, reciprocal
from fourpole.core.specimenfit import fit_specimen
from fourpole.plot.layout import command_figure
from fourpole.plot.plan import two_port_figure
from fourpole.plot.style import Style, drawing
from fourpole.study.twoports import TwoPort

FREQUENCIES = np.arange(10.0, 101.0, 5.0)


def two_port(rig):
    measured = all_poles(*rig.recorded(FREQUENCIES, noise=2e-4))
    equal, chance = reciprocal(measured)
    form = fit_specimen(measured) if chance > 1e-3 else None
    return TwoPort(Row("D1", 2), "car, 2.2 bar, 4000 N", measured, equal if form else measured, chance, form)


@pytest.fixture(scope="module")
def kinds():
    rigs = {"belt": BeltedRig(), "massless": BeltedRig(belt=0.0), "active": BeltedRig(active=0.05)}
    return {name: two_port(rig) for name, rig in rigs.items()}


def texts(figure):
    return [text.get_text() for legend in figure.subfigs[0].legends for text in legend.get_texts()]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("belt", ["belt of 7 kg", "K* of its springs", "measured, 95 %"]),
        ("massless", ["massless spring", "measured, 95 %"]),
        ("active", ["measured, 95 %", "k21 measured, 95 %"]),
    ],
)
@pytest.mark.sampled(3)
def test_measured_poles_stand_with_the_form_that_describes_them(kinds, name, shown):
    with drawing(Style()):
        figure = two_port_figure([kinds[name]], Style())
        FigureCanvasAgg(figure)
        assert illegible(figure) == []
    assert sorted(texts(figure)) == sorted(shown)
    said = [ax.get_title(loc="left") for ax in figure.axes]
    assert said[::2][:3] == ["k11", "-k12", "k22"]
    assert said[-1].endswith("not reciprocal" if name == "active" else "reciprocal within the uncertainty")


def test_the_points_are_the_poles_with_their_intervals(kinds):
    found = kinds["belt"]
    with drawing(Style()):
        figure = two_port_figure([found], Style())
    for ax, at in zip(figure.axes[:6:2], (0, 1, 3), strict=True):
        (bars,) = ax.containers
        np.testing.assert_allclose(bars[0].get_ydata(), np.abs(found.poles.stiffness.reshape(-1, 4)[:, at]) / 1e3)
    # The phase of the points is on the branch of the curve: no jump of 360 degrees between them.
    (phase,) = figure.axes[5].containers
    assert np.max(np.abs(np.diff(phase[0].get_ydata()))) < 180


@pytest.mark.sampled(2)
def test_of_many_conditions_the_first_are_drawn_and_it_is_said(kinds):
    with drawing(Style()):
        figure = two_port_figure([kinds["belt"]] * 8, Style())
    said = [text.get_text() for part in figure.subfigs for text in part.texts]
    assert "car, 2.2 bar, 4000 N (6 of 8 conditions)" in said
    assert len(said) == 6


@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
@pytest.mark.sampled(3)
def test_it_is_written_in_each_format(kinds, form, begin):
    style = Style("dark")
    content = command_figure(two_port_figure([kinds["belt"]], style), "twoport", form, style)
    assert content.startswith(begin)
    assert len(content) > 10_000
