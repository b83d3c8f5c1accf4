"""The units of [report] in campaign.toml: what is taken, and what each slip says."""

import json

import pytest

from fourpole import quantities as q
from fourpole.campaign.report import shown_units
from fourpole.campaign.schema import parse_campaign
from fourpole.errors import CampaignError
from fourpole.quantities import ShownUnits
from fourpole.study.study import Study

CHANNELS = '\n[channels]\ntime = { column = "t" }\nmotion_in = { column = "V1", unit = "m/s" }\n'


def stated(units):
    return parse_campaign(f"[report]\nunits = {units}\n{CHANNELS}")


@pytest.mark.parametrize("units", ['["psi", "kgf/mm"]', '{ pressure = "psi", stiffness = "kgf/mm" }'])
def test_a_list_and_a_table_say_the_same(units):
    shown = stated(units).report.shown
    assert shown.of(q.PRESSURE).label == "pressure [psi]"
    assert shown.text(q.PRESSURE, 32 * 6894.757293168) == "32 psi"
    assert shown.of(q.K1).label == shown.of(q.STORAGE).label.replace("K'", "K1") == "K1 [kgf/mm]"
    assert shown.of(q.K1).scale == pytest.approx(9806.65)
    assert shown.of(q.C) is q.C


def test_columns_keep_their_si_heads():
    assert stated('["kPa"]').report.shown.of(q.PRESSURE).head == q.PRESSURE.head


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ('["kPa", "psi"]', "'kPa' and 'psi' are both units of pressure"),
        ('["Hz"]', "'Hz' is a unit of no quantity that can be shown in another one"),
        ('["kPascal"]', "did you mean"),
        ('{ presure = "kPa" }', "did you mean 'pressure'?"),
        ('{ pressure = "N/mm" }', "'N/mm' is a stiffness; a pressure is needed"),
        ('"kPa"', 'write them as units = ["kPa", "N/mm"]'),
        ("[1]", "'1' is no unit"),
    ],
)
def test_a_slip_is_named_with_its_place_and_remedy(units, said):
    with pytest.raises(CampaignError) as caught:
        stated(units)
    assert str(caught.value).startswith("campaign.toml: [report] units: ")
    assert said in str(caught.value)


def test_an_unknown_key_names_the_nearest_known_one():
    with pytest.raises(CampaignError, match="did you mean 'units'"):
        parse_campaign(f'[report]\nunit = ["kPa"]\n{CHANNELS}')


def test_results_know_the_units_of_their_campaign():
    record = {"stated": stated('["kPa", "N s/mm"]').summary()}
    shown = Study(record=json.loads(json.dumps(record))).shown
    assert shown.of(q.PRESSURE).suffix == "kPa"
    assert shown.of(q.C).suffix == "N s/mm"
    assert shown.unit("N/m") == ("kN/m", 1e3)


@pytest.mark.parametrize("record", [{}, {"stated": 3}, {"stated": {"report": {"units": ["kPa"]}}}])
def test_a_record_without_units_shows_the_usual_ones(record):
    assert Study(record=record).shown == ShownUnits()


def test_units_of_a_record_that_are_none_are_left_out():
    assert shown_units({"pressure": "<b>", "stiffness": 3, "x": "kPa", "mass": "lb"}).of(q.ADDED_MASS).suffix == "lb"
