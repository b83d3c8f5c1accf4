"""`init --pattern`: a stated pattern says what names mean, and nothing else is guessed from them."""

from __future__ import annotations

import pytest

from fourpole.errors import CampaignError
from fourpole.guess.pattern import read_pattern


def taken(pattern, file):
    tokens = read_pattern(pattern).tokens(file)
    return (
        None
        if tokens is None
        else {token.what: token.value if token.value == token.value else token.text for token in tokens}
    )


@pytest.mark.parametrize(
    ("pattern", "file", "expected"),
    [
        ("{specimen}_{pressure}bar_{frequency}Hz", "x/radial_1,7bar_10Hz.csv",
         {"tyre": "radial", "pressure": 170e3, "frequency": 10.0}),
        ("{specimen}_{pressure}bar", "a_b_1p7bar.csv", {"tyre": "a_b", "pressure": 170e3}),
        ("{specimen}/{pressure} kPa/{}_{preload}kN", "t/A 1/170 kPa/run7_1.5kN.csv",
         {"tyre": "A 1", "pressure": 170e3, "preload": 1500.0}),
        ("{_}-{specimen}-{pressure [psi]}", "2026-A-25.csv", {"tyre": "A", "pressure": pytest.approx(172368.9)}),
        ("{specimen}_{kind}_{repeat}", "A_statisch_3.csv", {"tyre": "A", "kind": "statisch", "repeat": 3.0}),
        ("{specimen} {temperature}°C {amplitude}mm {added_mass}kg", "A -20°C 0.5mm 10kg.csv",
         {"tyre": "A", "temperature": -20.0, "amplitude": 5e-4, "added_mass": 10.0}),
        ("{specimen}_{frequency}Hz", "A_5-200Hz.csv", {"tyre": "A", "band": 5.0}),
        ("{specimen}_{pressure}BAR", "A_2bar.csv", {"tyre": "A", "pressure": 200e3}),
        ("{specimen} {pressure}bar", "all.tdms#A 2bar", {"tyre": "A", "pressure": 200e3}),
        ("{specimen}#{pressure}bar", "A.tdms#2bar", {"tyre": "A", "pressure": 200e3}),
        ("{specimen}_{pressure}bar", "A_2psi.csv", None),
        ("{specimen}_{pressure}bar", "A_2bar_x.csv", None),
        ("{specimen}/{pressure}bar", "2bar.csv", None),
    ],
)  # fmt: skip
def test_what_a_name_states(pattern, file, expected):
    assert taken(pattern, file) == expected


@pytest.mark.parametrize(
    ("pattern", "says"),
    [
        ("{tire}_{pressure}bar", "there is no field '{tire}'; possible are {specimen}, {tyre}"),
        ("{pressure}_x", r"write {pressure}bar, or {pressure [bar]}"),
        ("{pressure}Hz", "has no unit of its kind"),
        ("{specimen}_{tyre}", "{specimen} stands twice"),
        ("abc", "has no field"),
        ("{specimen", "a } for each {"),
        ("", "a } for each {"),
    ],
)
def test_a_faulty_pattern_is_one_message(pattern, says):
    with pytest.raises(CampaignError) as caught:
        read_pattern(pattern)
    assert says in str(caught.value)


def test_many_fields_without_a_meaning_end_soon():
    assert taken("{}_{}_{}_{}_{}_{}_{}_{specimen}x", "_" * 390 + ".csv") is None
