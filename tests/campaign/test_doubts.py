"""What is allowed as it is stated, but is probably a slip, is said; what is usual is not."""

import pytest

from fourpole.campaign.folder import read_campaign

RIG = '[rig]\nmoving_mass = {{ value = 15, unit = "kg", std = {mass} }}\npreload_stiffness = "12 kN/m"\n'
CHANNELS = """
[channels]
time = {{ column = "t" }}
force_in = {{ column = "F1", unit = "N", std_gain = {gain}, std_phase = "{phase}" }}
motion_in = {{ column = "V1", unit = "m/s" }}
"""


@pytest.fixture
def doubts(tmp_path):
    def of(columns="", *, gain='"1 %"', phase="0.2 deg", mass=0.1, more=""):
        text = RIG.format(mass=mass) + CHANNELS.format(gain=gain, phase=phase) + more
        (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
        own = columns.split(",") if columns else []
        rows = [
            ",".join(["test", "file", "kind", "tyre", "preload [N]", *own]),
            "D1,a.csv,dynamic,x,1000" + ",1" * len(own),
        ]
        (tmp_path / "tests.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        return read_campaign(tmp_path).doubts

    return of


def test_a_usual_campaign_raises_no_doubt(doubts):
    assert doubts() == ()
    assert doubts("operator,batch,rim width [inch],camber [deg],humidity [%]") == ()


@pytest.mark.parametrize(
    ("column", "meant"),
    [
        ("add_mass [kg]", "added_mass [kg]"),
        ("weight [g]", "added_mass [g]"),
        ("inflation [psi]", "pressure [psi]"),
        ("room temp [degC]", "temperature [degC]"),
        ("speed [Hz]", "frequency [Hz]"),
    ],
)
def test_a_column_with_the_unit_of_a_known_one_that_is_missing_names_it(doubts, column, meant):
    (said,) = doubts(column)
    assert f"column '{column}'" in said
    assert f"if '{meant}' is meant, rename it" in said


def test_beside_the_known_column_another_of_its_kind_is_no_slip(doubts):
    assert doubts("temperature [degC],room [degC]") == ()


def test_an_axis_of_the_conditions_is_no_slip(doubts):
    assert doubts("extra mass [kg]", more='\n[conditions]\naxes = ["extra mass [kg]"]\n') == ()


def test_a_gain_beyond_a_half_is_asked_about_and_a_number_alone_explained(doubts):
    assert doubts(gain='"50 %"') == ()
    (said,) = doubts(gain="2")
    assert "force_in.std_gain is 200 %" in said
    assert 'if 2 % is meant, write "2 %"' in said
    (said,) = doubts(gain='"60 %"')
    assert said.endswith("is that so?")


def test_a_phase_and_a_mass_that_nobody_knows_are_asked_about(doubts):
    (said,) = doubts(phase="40 deg")
    assert "force_in.std_phase is 40 degrees" in said
    (said,) = doubts(mass=10)
    assert "rig.moving_mass has a standard uncertainty of 66.7 % of it" in said


@pytest.mark.parametrize(
    ("head", "cell", "meant"),
    [
        ("pressure [bar]", "210", "pressure [kPa]"),
        ("pressure [bar]", "32", "pressure [psi]"),
        ("pressure [kPa]", "2.1", "pressure [bar]"),
        ("temperature [degC]", "293", "temperature [K]"),
    ],
)
def test_values_that_no_test_has_ask_for_their_unit(tmp_path, doubts, head, cell, meant):
    doubts()
    rows = [f"test,file,kind,tyre,preload [N],{head}", f"D1,a.csv,dynamic,x,1000,{cell}"]
    (tmp_path / "tests.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (said,) = read_campaign(tmp_path).doubts
    assert f"column '{head}' states {cell}" in said
    assert f"write '{meant}'" in said


@pytest.mark.parametrize(
    ("head", "cell"),
    [("pressure [bar]", "16"), ("pressure [psi]", "32"), ("pressure [kPa]", "60"), ("temperature [degC]", "-40")],
)
def test_usual_values_ask_nothing(tmp_path, doubts, head, cell):
    doubts()
    rows = [f"test,file,kind,tyre,preload [N],{head}", f"D1,a.csv,dynamic,x,1000,{cell}"]
    (tmp_path / "tests.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert read_campaign(tmp_path).doubts == ()
