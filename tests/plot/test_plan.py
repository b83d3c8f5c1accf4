"""The figure of a plan."""

import numpy as np
import pytest

from fourpole.core.rig import Rig
from fourpole.errors import CampaignError
from fourpole.planning.expected import Guess
from fourpole.planning.plan import Run, bare_plan, plan_table
from fourpole.plot import Style
from fourpole.plot.layout import command_figure
from fourpole.plot.plan import draw_plan

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def frame():
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    return plan_table(bare_plan(rig, Guess(110e3, 100e3, 800.0), Run(), [10.0, 16.0, 24.0]), [5.0, 10.0])


def test_lines_show_the_table(frame):
    figure = draw_plan(frame, wanted=0.01)
    assert [ax.get_title() for ax in figure.axes] == ["U(K*) over K*", "U(K2) over K2", "U(C) over C"]
    for ax, column in zip(figure.axes, ("u(K*)/K* [1]", "u(K2)/K2 [1]", "u(C)/C [1]"), strict=True):
        assert (ax.get_xlabel(), ax.get_yscale()) == ("frequency (Hz)", "log")
        curves = [line for line in ax.get_lines() if line.get_label() == "_curve"]
        assert len(curves) == 6  # four routes, and the joint one with each mass
        shown = np.sort([line.get_ydata()[1] for line in curves])
        at = frame.filter(frame["frequency [Hz]"] == 16.0)
        stated = at.filter(plan="as stated")[column].to_list()
        masses = at.filter((at["plan"] != "as stated") & (at["route"] == "joint") & (at["added mass [kg]"] == 0))[
            column
        ]
        np.testing.assert_allclose(shown, 200 * np.sort([*stated, *masses]), rtol=1e-9)
        low, high = ax.get_ylim()
        assert low < min(line.get_ydata().min() for line in curves)
        assert high > max(line.get_ydata().max() for line in curves)
        assert any(np.allclose(line.get_ydata(), 2.0) for line in ax.get_lines() if line not in curves)
    assert "%" in figure.axes[0].get_ylabel()


@pytest.mark.parametrize(("theme", "form"), [("light", "svg"), ("dark", "png")])
@pytest.mark.sampled(2)
def test_the_same_plan_gives_the_same_file(frame, theme, form):
    style = Style(theme)
    first, second = (command_figure(draw_plan(frame, style=style), "plan", form, style) for _ in range(2))
    assert first == second


def test_another_format_is_refused(frame):
    with pytest.raises(CampaignError, match="svg, png, pdf"):
        command_figure(draw_plan(frame), "plan", "gif")
