"""Plans of campaigns whose recordings do not exist, and of a bare rig."""

import numpy as np
import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.core.plan import expect
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, RigError
from fourpole.planning.expected import Guess
from fourpole.planning.plan import AS_STATED, Run, bare_plan, plan, plan_campaign, plan_table, with_kg
from fourpole.study.study import Study

TOML = """
[unstated]
ordinary = "zero"
[rig]
moving_mass = { value = 15.0, unit = "kg", std = 0.1 }
preload_stiffness = "12.44 kN/m"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F1", unit = "N", std_gain = "0.5 %" }
motion_in = { column = "V1", unit = "m/s" }
motion_out = { column = "V2", unit = "m/s", exact = true }
load = { column = "F", unit = "N" }
deflection = { column = "x", unit = "mm" }
[tyres.a]
[tyres.b]
"""
HEAD = "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],added_mass [kg],note\n"
ROWS = """S1,r/S1.csv,static,a,1.7,,,,
D1,r/D1.csv,dynamic,a,1.7,1000,10,,first
D2,r/D2.csv,dynamic,a,1.7,1000,20,,
D3,r/D3.csv,dynamic,a,1.7,1000,20,10,
D4,r/D4.csv,dynamic,b,1.7,1000,10,,
"""
GUESS = Guess(110e3, 100e3, 800.0)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "campaign.toml").write_text(TOML)
    (tmp_path / "tests.csv").write_text(HEAD + ROWS)
    return tmp_path


def test_a_campaign_is_planned_as_it_states_itself(folder):
    planned = plan_campaign(read_campaign(folder), GUESS, Run(noise=2e-4, cycles=160))
    (item,) = planned.rigs
    plan = item.plan
    assert [test.name for test in item.tests] == ["D1", "D2", "D3", "D4"]
    assert plan.rig.std["moving_mass"] == 0.1
    assert plan.rig.std["preload_stiffness"] == pytest.approx(0.02 * 12440)
    np.testing.assert_allclose(plan.channels.gain, [0.005, 0.01, 0.0])
    np.testing.assert_allclose(plan.tests.noise, 1e-4)
    np.testing.assert_allclose(plan.tests.added_mass, [0, 0, 10, 0])
    np.testing.assert_allclose(plan.tests.added_mass_std, [0, 0, 0.02, 0])
    np.testing.assert_allclose(plan.tests.k1_std, 2200)
    assert plan.tests.family.tolist() == [0, 0, 0, 1]
    assert plan.statics == 2
    assert any("preload_stiffness" in note for note in planned.notes)
    assert any("K1" in note for note in planned.notes)


def test_an_excluded_test_is_planned_as_the_others(folder):
    tests = folder / "tests.csv"
    head, *rows = tests.read_text().splitlines()
    at = next(i for i, row in enumerate(rows) if ",dynamic," in row)
    lines = [f"{head},excluded", *(f"{row},{'the tyre slipped' if i == at else ''}" for i, row in enumerate(rows))]
    before = plan(folder, k1=110e3, k2=100e3, c=800.0).table()
    tests.write_text("\n".join(lines) + "\n")
    planned = plan(folder, k1=110e3, k2=100e3, c=800.0)
    assert planned.table().equals(before)
    name = rows[at].partition(",")[0]
    assert any(note.endswith(f"planned as the others: {name}") for note in planned.notes)


def test_k1_of_tests_csv_counts_where_none_is_guessed(folder):
    head = HEAD.replace("note", "K1 [kN/m],u(K1) [kN/m]")
    (folder / "tests.csv").write_text(head + "D1,r/D1.csv,dynamic,a,1.7,1000,10,,120,3\n")
    tests = plan_campaign(read_campaign(folder), Guess(None, 1e5, 800.0), Run()).rigs[0].plan.tests
    assert (tests.k1[0], tests.k1_std[0]) == (120e3, 3e3)
    tests = plan_campaign(read_campaign(folder), Guess(None, 1e5, 800.0, 0.001), Run()).rigs[0].plan.tests
    assert tests.k1_std[0] == pytest.approx(120)


def test_the_tyre_is_guessed_from_earlier_results(campaign_with_results):
    campaign = read_campaign(campaign_with_results)
    found = pl.read_csv(campaign_with_results / "results" / "dynamic.csv")
    planned = plan_campaign(campaign, Guess(), Run())
    assert any("results/dynamic.csv" in note for note in planned.notes)
    np.testing.assert_allclose(planned.rigs[0].plan.tests.k2, found["K2 [N/m]"].to_numpy())
    np.testing.assert_allclose(planned.rigs[0].plan.tests.k1_std, found["u(K1) [N/m]"].to_numpy())
    softer = plan_campaign(campaign, Guess(c=500.0), Run())
    assert set(softer.rigs[0].plan.tests.c) == {500.0}


@pytest.mark.parametrize(
    ("pressure", "preload", "temperature", "k2"),
    [
        (1.72, 1005, 22, 1e5),  # within all tolerances of the test at 20 °C: the smaller frequency decides
        (1.70, 1000, 58, 2e5),  # the temperature alone tells the two apart
        (2.40, 1000, 20, 3e5),
        (2.00, 1000, 20, 1e5),  # ln(2.0/1.7) < ln(2.4/2.0)
    ],
)
def test_the_nearest_earlier_test_is_that_of_the_same_condition(
    folder, monkeypatch, pressure, preload, temperature, k2
):
    results = folder / "results"
    results.mkdir()
    head = (
        "test,tyre,pressure [Pa],preload [N],temperature [degC],frequency [Hz],K1 [N/m],u(K1) [N/m],K2 [N/m],C [N s/m]"
    )
    rows = (
        "E1,a,170000,1000,20,10,110e3,1e3,1e5,800",
        "E2,a,170000,1000,60,10,110e3,1e3,2e5,800",
        "E3,a,240000,1000,20,10,110e3,1e3,3e5,800",
        "E4,a,170000,1000,20,30,110e3,1e3,4e5,800",
        "E5,b,170000,1000,20,10,110e3,1e3,5e5,800",
    )
    (results / "dynamic.csv").write_text("\n".join([head, *rows]) + "\n")
    found = Study(dynamic=pl.read_csv(results / "dynamic.csv"))
    monkeypatch.setattr("fourpole.planning.expected.read_results", lambda _: found)
    head = HEAD.replace("note", "temperature [degC]")
    (folder / "tests.csv").write_text(f"{head}D1,r/1.csv,dynamic,a,{pressure},{preload},11,,{temperature}\n")
    (item,) = plan_campaign(read_campaign(folder), Guess(), Run()).rigs
    assert item.plan.tests.k2.tolist() == [k2]


@pytest.fixture(scope="module")
def campaign_with_results(tmp_path_factory):
    from fourpole import analyse
    from fourpole.virtual import RADIAL_PLY, simulate_campaign

    folder = tmp_path_factory.mktemp("earlier") / "campaign"
    simulate_campaign(folder, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[12.0, 20.0])
    analyse(folder).write(folder / "results")
    return folder


@pytest.mark.parametrize(
    ("old", "new", "guess", "said"),
    [
        ("", "", Guess(110e3, None, 800.0), "specimen 'a' is not known yet: guess its K1, K2 and C, K2 at least"),
        ("1000,20,,", "1000,,,", GUESS, "row 4: frequency .* is blank"),
        ("dynamic,b", "dynamic,c", GUESS, "row 6: tyre 'c' is not in campaign.toml"),
        (ROWS, "S1,r/S1.csv,static,a,1.7,,,,\n", GUESS, "nothing to plan"),
    ],
)
def test_what_cannot_be_planned_is_said(folder, old, new, guess, said):
    text = HEAD + (ROWS.replace(old, new, 1) if old else ROWS)
    (folder / "tests.csv").write_text(text)
    with pytest.raises(CampaignError, match=said):
        plan_campaign(read_campaign(folder), guess, Run())


def test_a_plan_needs_a_rig(folder):
    (folder / "campaign.toml").write_text("[channels]" + TOML.partition("[channels]")[2])
    with pytest.raises(RigError, match="moving_mass"):
        plan_campaign(read_campaign(folder), GUESS, Run())


def test_the_tyre_must_not_lift_off():
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    planned = bare_plan(rig, GUESS, Run(eccentricity=5e-3), [10.0, 24.0], preload=400.0)
    assert any("lift off in D2:" in note for note in planned.notes)
    assert not any("lift" in note for note in bare_plan(rig, GUESS, Run(), [10.0], preload=400.0).notes)


def test_the_table_has_a_row_for_each_plan_route_and_test(folder):
    planned = plan_campaign(read_campaign(folder), GUESS, Run())
    frame = plan_table(planned, [5.0])
    assert frame.filter(plan=AS_STATED).group_by("route").len()["len"].to_list() == [4, 4, 4, 4]
    added = frame.filter(pl.col("plan") == with_kg(5.0))
    assert added.filter(route="joint").height == 7  # the three tests without a mass once more
    assert set(added.filter(route="mobility")["added mass [kg]"]) == {5.0}
    plan = planned.rigs[0].plan
    found = expect(plan.tests, plan.rig, "relative", channels=plan.channels)
    row = frame.filter(plan=AS_STATED, route="relative", test="D2").row(0, named=True)
    assert row["u(C) [N s/m]"] == pytest.approx(np.sqrt(found.arm_covariance[1, 1, 1]))
    assert row["u(C)/C [1]"] == pytest.approx(row["u(C) [N s/m]"] / 800.0)
    assert row["u(C) from K1 [N s/m]"] < row["u(C) [N s/m]"]
    assert not frame.select(pl.all().is_null().any()).row(0, named=True)["u(C) [N s/m]"]


def test_a_campaign_without_v2_has_one_route(folder):
    toml = "\n".join(line for line in TOML.splitlines() if "motion_out" not in line)
    (folder / "campaign.toml").write_text(toml)
    frame = plan_table(plan_campaign(read_campaign(folder), GUESS, Run()), [5.0])
    assert set(frame["route"]) == {"mobility"}


def test_random_tests_and_sweeps_are_said_not_to_be_planned(folder):
    rows = (folder / "tests.csv").read_text()
    band = "R1,r/R1.csv,random,a,1.7,1000,5:200,,\n"
    (folder / "tests.csv").write_text(rows + band)
    planned = plan_campaign(read_campaign(folder), GUESS, Run())
    assert any("R1: random tests and sweeps are not planned" in note for note in planned.notes)
    assert "R1" not in plan_table(planned, (10.0,))["test"].to_list()
    (folder / "tests.csv").write_text(HEAD + band)
    with pytest.raises(CampaignError, match="a plan is for sines"):
        plan_campaign(read_campaign(folder), GUESS, Run())
