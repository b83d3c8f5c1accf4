"""Zero and negative preload: of specimens that are held on both sides, not of tyres."""

import pytest

from fourpole.campaign.folder import read_campaign
from fourpole.core.recordingchecks import check_lift_off, check_mean_force

CAMPAIGN = """
[rig]
output = "blocked"
[channels]
time = {{ column = "t", unit = "s" }}
force_in = {{ column = "F", unit = "N" }}
motion_in = {{ column = "x", unit = "mm" }}
load = {{ column = "F", unit = "N" }}
deflection = {{ column = "x", unit = "mm" }}
[{kind}.mount]
{key}
"""


def campaign_of(folder, preloads, kind="specimens", key=""):
    (folder / "campaign.toml").write_text(CAMPAIGN.format(kind=kind, key=key), encoding="utf-8")
    rows = [f"D{at},D{at}.csv,dynamic,mount,{preload}" for at, preload in enumerate(preloads)]
    (folder / "tests.csv").write_text("\n".join(["test,file,kind,tyre,preload [N]", *rows, ""]), encoding="utf-8")
    return read_campaign(folder).tests


def test_a_specimen_with_a_preload_of_zero_or_less_is_held_on_both_sides(tmp_path):
    tests = campaign_of(tmp_path, [-50, 0, 100])
    assert [test.problem for test in tests] == ["", "", ""]
    assert [test.value("preload") for test in tests] == [-50.0, 0.0, 100.0]
    assert all(test.fixed for test in tests)


@pytest.mark.parametrize(("key", "fixed"), [("", False), ("fixed = true", True), ("fixed = false", False)])
def test_otherwise_it_is_as_stated(tmp_path, key, fixed):
    assert [test.fixed for test in campaign_of(tmp_path, [100], key=key)] == [fixed]


@pytest.mark.parametrize(("kind", "key"), [("tyres", ""), ("specimens", "fixed = false")])
def test_what_only_stands_on_the_rig_cannot_be_pulled(tmp_path, kind, key):
    good, bad = campaign_of(tmp_path, [100, -50], kind, key)
    assert good.problem == ""
    assert not good.fixed
    assert "-50 N must be positive" in bad.problem
    assert "fixed = true" in bad.problem


def test_a_tyre_that_is_bolted_down_can_be_pulled(tmp_path):
    (test,) = campaign_of(tmp_path, [-50], "tyres", "fixed = true")
    assert (test.problem, test.fixed) == ("", True)


@pytest.mark.parametrize("preload", [-50.0, 0.0, 10.0])
def test_a_fixed_specimen_does_not_lift_off(preload):
    assert check_lift_off(100.0, preload, fixed=True).verdict == "ok"
    assert check_lift_off(100.0, preload).verdict == "rejected"


def test_the_mean_force_of_a_pulled_specimen_is_compared_as_well():
    assert check_mean_force(-51.0, -50.0).verdict == "ok"
    assert check_mean_force(-70.0, -50.0).verdict == "warning"
    assert check_mean_force(1.0, 0.0).verdict == "ok"
