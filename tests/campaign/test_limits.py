"""limits.toml: what is read of it, and what is said of a wrong one."""

import pytest

from fourpole.campaign.limits import read_limits
from fourpole.errors import CampaignError


def one(text):
    return read_limits(f"[[limits]]\n{text}", ("A", "B")).limits[0]


@pytest.mark.parametrize(
    ("name", "key"),
    [("K1", "k1"), ("|K*|", "modulus"), ("K'", "storage"), ("K''", "loss"), ("tan delta", "loss_factor"), ("c", "c")],
)
def test_quantities_go_by_their_symbols(name, key):
    low = {"loss_factor": "0.1", "c": "1 kN s/m"}.get(key, "2 N/mm")
    found = one(f'quantity = "{name}"\nlow = "{low}"')
    assert (found.quantity, found.high) == (key, None)
    assert found.low == {"loss_factor": 0.1, "c": 1000.0}.get(key, 2000.0)


def test_a_condition_is_in_si():
    stated = 'specimen = "A"\npressure = "2 bar"\npreload = "3 kN"\ntemperature = "23 °C"\nfrequency = "900 rpm"'
    found = one(f'quantity = "loss angle"\nhigh = "180 deg"\n{stated}')
    assert found.high == pytest.approx(3.14159265, rel=1e-8)
    place = (found.specimen, found.pressure, found.preload, found.temperature, found.frequency)
    assert place == ("A", 2e5, 3000.0, 23.0, 15.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('quantity = "K9"\nlow = "1 N/m"', "limit 1: quantity: 'K9' is no quantity with limits; they are K1"),
        ('quantity = "K1"', "has neither low nor high"),
        ('quantity = "K1"\nlow = "2 N/m"\nhigh = "1 N/m"', "low is not below high"),
        ('quantity = "K1"\nhigh = "2 bar"', "high: 'bar' is a pressure; a stiffness is needed"),
        ('quantity = "K1"\nhigh = "2 N/m"\nspecimen = "a"', "no 'a' in tests.csv"),
        ('quantity = "K1"\nhihg = "2 N/m"', "did you mean 'high'?"),
        ('quantity = 5\nhigh = "2 N/m"', "quantity: '5' is no quantity"),
        ('quantity = "K2"\nhigh = "2 N/m"\nfrequency = "0 Hz"', "frequency: '0 Hz' is not positive"),
        ('quantity = "K2"\nhigh = "2 N/m"\npressure = "-2 bar"', "pressure: '-2 bar' is not positive"),
    ],
)
def test_a_wrong_limit_is_named_with_the_remedy(text, said):
    with pytest.raises(CampaignError) as raised:
        one(text)
    assert said in str(raised.value)
    assert str(raised.value).startswith("limits.toml: limit 1: ")


@pytest.mark.parametrize("text", ["", "limits = 5", "[limits]\nquantity = 'K1'", "[[limit]]\nquantity = 'K1'", "[["])
def test_what_is_no_list_of_limits_is_said(text):
    with pytest.raises(CampaignError, match=r"limits\.toml: (write each limit as a table|not valid TOML)"):
        read_limits(text, ())


def test_the_specification_has_a_name():
    found = read_limits('specification = "Drawing 4711 B"\n[[limits]]\nquantity = "K1"\nlow = "1 N/m"', ())
    assert found.specification == "Drawing 4711 B"
    with pytest.raises(CampaignError, match="specification must be a text"):
        read_limits("specification = 5", ())
