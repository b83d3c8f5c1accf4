"""Limits of axes, and how they are drawn."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from fourpole.plot.axis import PanelAxes
from fourpole.plot.layout import links, new_figure, with_titles
from fourpole.plot.panels import numbered, span


@pytest.mark.parametrize("spread", [0.0, 1e-12, 4e-7])
def test_values_that_are_one_but_for_their_error_have_room_for_a_tick(spread):
    low, high = span([15.0 * (1.0 + spread * np.arange(3))])
    assert low == pytest.approx(15.0 * 0.85, rel=1e-3)
    assert high == pytest.approx(15.0 * 1.15, rel=1e-3)


def logarithmic(ax):
    ax.set(xscale="log", yscale="log", xlim=(0.3, 70.0), ylim=(2e-4, 40.0))
    numbered(ax, "x", most=5)
    numbered(ax, "y", most=5)


#: What is done to axes; of the last ones, matplotlib draws the axis.
CHANGES = {
    "plain": lambda ax: ax.set(xlim=(-3.0, 7.5), ylim=(1e3, 2e3)),
    "logarithmic": logarithmic,
    "falling": lambda ax: ax.set(xlim=(7.0, -3.0), ylim=(2.5, 0.0)),
    "ends": lambda ax: ax.set(xlim=(0.1 + 0.2, 0.9), xticks=[0.3, 0.6, 0.9], ylim=(0.0, 1.0)),
    "without numbers": lambda ax: ax.tick_params(labelbottom=False, labelleft=False),
    "minor ticks": lambda ax: ax.minorticks_on(),
    "large numbers": lambda ax: ax.set(ylim=(0.0, 5e9)),
    "above": lambda ax: (ax.xaxis.tick_top(), ax.xaxis.set_label_position("top")),
    "both sides": lambda ax: ax.tick_params(labelright=True, right=True),
    "turned": lambda ax: ax.tick_params(axis="x", labelrotation=30),
    "placed label": lambda ax: ax.yaxis.set_label_coords(0.5, 0.5),
}


@pytest.mark.parametrize("change", CHANGES)
def test_an_axis_drawn_with_one_tick_is_that_of_matplotlib(change):
    def pixels(kind):
        figure = new_figure(3.0, 2.5)
        ax = figure.add_axes((0.25, 0.25, 0.6, 0.5), axes_class=kind)
        ax.set(xlabel="frequency [Hz]", ylabel="stiffness")
        ax.grid(visible=True)
        CHANGES[change](ax)
        figure.canvas.draw()
        again = np.asarray(figure.canvas.buffer_rgba()).copy()
        figure.canvas.draw()
        assert np.array_equal(again, figure.canvas.buffer_rgba())
        return again

    assert np.array_equal(pixels(PanelAxes), pixels(Axes))


def test_each_point_of_a_line_leads_to_its_own_card_or_none_does():
    line = f'<a xlink:href="{links(["d-1", "d-2"], ["D1", "D2"])}">\n<use x="1"/>\n{{}}</a>'
    assert with_titles(line.format('<use x="2"/>\n').encode()) == (
        b'<a xlink:href="#d-1"><title>D1</title>\n<use x="1"/></a>\n'
        b'<a xlink:href="#d-2"><title>D2</title>\n<use x="2"/></a>'
    )
    assert b"<a" not in with_titles(line.format("").encode())
