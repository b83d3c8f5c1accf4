"""Tests of one condition at different temperatures, from campaign.toml to the covariance of the condition."""

import numpy as np
import pytest

from fourpole import quantities as q
from fourpole.campaign.row import Test as Row
from fourpole.campaign.schema import ConditionsFile, parse_campaign
from fourpole.core.condition import temperature_std
from fourpole.core.sources import Kind, Source
from fourpole.errors import CampaignError
from fourpole.study.identify import temperature_note
from fourpole.study.static import StaticRow, stiffness_for

TOML = """
[rig]
moving_mass = "15 kg"
preload_stiffness = "12.44 kN/m"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F", unit = "N" }
motion_in = { column = "v", unit = "m/s" }
[conditions]
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [('"1 %/K"', 0.01), ('"0.5 %/K"', 0.005), ('"0.02 1/K"', 0.02), ('"0 %/K"', 0.0), (None, 0.01)],
)
def test_the_sensitivity_is_read_with_its_unit(text, expected):
    line = "" if text is None else f"temperature_sensitivity = {text}"
    assert parse_campaign(TOML + line).conditions.per_kelvin == pytest.approx(expected)


@pytest.mark.parametrize("text", ['"1 %"', "0.01", '"-1 %/K"', '"fast/K"', "true"])
def test_a_sensitivity_without_its_unit_or_below_zero_is_refused(text):
    with pytest.raises(CampaignError, match=r"temperature_sensitivity: .*(1 %/K|negative)"):
        parse_campaign(TOML + f"temperature_sensitivity = {text}")


def test_the_uncertainty_grows_with_the_distance_from_the_mean_temperature_of_the_condition():
    stated = ConditionsFile(temperature_sensitivity="0.02 1/K")
    apart = temperature_std(np.array([20.0, 24.0, 60.0, np.nan]), np.array([0, 0, 1, 2]), stated.per_kelvin)
    assert apart == pytest.approx([0.04, 0.04, 0.0, 0.0])
    (note,) = temperature_note(apart, stated)
    assert "up to 2 K from its mean temperature" in note
    assert "2 %/K (stated: temperature_sensitivity)" in note
    assert not temperature_note(np.zeros(3), stated)


def test_k1_of_another_temperature_is_as_uncertain_as_it_is_far():
    def row(name, kind, temperature):
        values = {"preload": 1000.0, "temperature": temperature}
        return Row(name, 2, kind=kind, tyre="radial", values=values)

    columns = {q.K1.head: 180e3, q.K1.u_head: 900.0, q.K1_OF.head: "mean"}
    static = StaticRow(row("S1", "static", 20.0), 1000.0, columns, parts={Source(Kind.K1_FIT): 900.0})
    near, far, same = (stiffness_for(row("D", "dynamic", t), [static], per_kelvin=0.01) for t in (23.0, 30.0, 20.0))
    assert near.std == pytest.approx(np.hypot(900.0, 0.03 * 180e3))
    assert near.parts[Source(Kind.K1_TEMPERATURE)] == pytest.approx(0.03 * 180e3)
    assert not near.checks
    assert far.std == pytest.approx(np.hypot(900.0, 0.1 * 180e3))
    assert len(far.checks) == 1
    assert same.std == 900.0
