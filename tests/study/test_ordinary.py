"""What the routes are given of the ordinary errors: channels, mountings and specimens, and parts of the rig."""

import shutil

import numpy as np
import polars as pl
import pytest
from tests.faulty import invert_v2

from fourpole import analyse
from fourpole.campaign import read_campaign
from fourpole.core.components import component
from fourpole.core.routes import ROUTES
from fourpole.core.sources import Kind
from fourpole.study import identify
from fourpole.virtual import RADIAL_PLY, simulate_campaign

EXACT = ", exact = true"
#: Highest frequency of the tests [Hz].
TOP = 18.0


@pytest.fixture
def setup(bench, monkeypatch):
    """What the joint route is given of three tests, one of them a calibration: a function, which ends before it."""
    whole = identify.setup_of

    class GivenError(Exception):
        pass

    def given(*arguments):
        raise GivenError(whole(*arguments)[0])

    monkeypatch.setattr(identify, "setup_of", given)

    def of(zero="", keys=None, mountings=None):
        for role, key in (keys or {}).items():
            bench.channels[role] = bench.channels[role].replace(EXACT, key)
        bench.columns = (*bench.columns, "added_mass [kg]", *(["mounting"] if mountings else []))
        last = [f",{label}" for label in mountings] if mountings else ["", "", ""]
        bench.dynamic("D1", f"1000,110000,{last[0]}", frequency=14.0)
        bench.dynamic("D2", f"1000,110000,10{last[1]}", frequency=TOP, mass=25.0)
        bench.dynamic("C1", f",,10{last[2]}", frequency=14.0)
        bench.rows[-1] = bench.rows[-1].replace(",dynamic,bush,", ",calibration,,")
        folder = bench.write()
        text = (folder / "campaign.toml").read_text()
        (folder / "campaign.toml").write_text(text.replace('[unstated]\nordinary = "zero"\n', zero))
        with pytest.raises(GivenError) as found:
            analyse(folder)
        return found.value.args[0]

    return of


def table(gain, angle):
    return complex(component(gain).std, component(angle).std)


def test_a_test_has_the_mounting_of_its_specimen(setup):
    assert setup()["mounting"].tolist() == ["bush", "bush", ""]


def test_a_column_states_other_mountings(setup):
    assert setup(mountings=["first", "", "second"])["mounting"].tolist() == ["first", "bush", "second"]


def test_unstated_channels_have_the_errors_of_the_table(setup):
    given = setup(keys=dict.fromkeys(("force_in", "motion_in", "motion_out"), ""))
    channels, mounting = given["channels"], table(Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE)
    remounting = table(Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE)
    for found, kind in ((channels.delay, Kind.DELAY), (channels.low_cut, Kind.LOW_CUT)):
        assert found.tolist() == [component(kind).std] * 3
    assert channels.slope == pytest.approx([component(Kind.SLOPE).std / TOP**2] * 3, rel=1e-6)
    assert channels.mounting.tolist() == [0, mounting, 0]
    assert channels.remounting.tolist() == [remounting, 0, remounting]
    assert channels.gain.tolist() == [0.01] * 3
    assert given["specimens"].block == table(Kind.BLOCK, Kind.ANGLE_BLOCK)
    assert given["specimens"].drift == table(Kind.DRIFT, Kind.ANGLE_DRIFT)


@pytest.mark.parametrize("case", ["exact", "zero"])
def test_exact_channels_and_zero_have_none(setup, case):
    every = dict.fromkeys(("force_in", "motion_in", "motion_out"), "")
    given = setup() if case == "exact" else setup('[unstated]\nordinary = "zero"\n', every)
    names = ("delay", "low_cut", "slope", "mounting", "remounting")
    assert not any(np.any(getattr(given["channels"], name)) for name in names)
    assert bool(given["specimens"].block) == (case == "exact")


def test_a_channel_that_is_not_stated_has_no_error(bench):
    bench.channels = {"time": '{ column = "t" }', "motion_in": '{ column = "V1", unit = "m/s" }'}
    bench.channels["force_in"] = '{ column = "F1", unit = "N" }'
    bench.dynamic("D1")
    folder = bench.write()
    text = (folder / "campaign.toml").read_text().replace("zero", "table")
    (folder / "campaign.toml").write_text(text)
    channels = identify.channel_uncertainty(read_campaign(folder), (), TOP)
    names = ("gain", "phase", "delay", "low_cut", "slope", "mounting", "remounting")
    assert not any(getattr(channels, name)[2] for name in names)
    assert channels.delay[0] == component(Kind.DELAY).std


def test_mounting_passes_through_to_the_results(bench):
    bench.columns = (*bench.columns, "Mounting")
    bench.dynamic("D1", "1000,110000,left")
    assert bench.found(route="relative")["mounting"] == "left"


@pytest.fixture(scope="module")
def unsaid(tmp_path_factory):
    """A laboratory that does not mention 1 kg of the tyre that moves with the wheel; its campaign.toml is ordinary."""
    plan = {"tyres": [RADIAL_PLY], "pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 14.0, 18.0, 24.0]}
    folder = simulate_campaign(tmp_path_factory.mktemp("unsaid"), **plan, seed=4, undeclared={"tyre_mass": 1.0}).folder
    path = folder / "campaign.toml"
    path.write_text(path.read_text().replace('ordinary = "zero"', 'ordinary = "table"'))
    return folder


@pytest.mark.parametrize("route", ROUTES)
def test_single_tests_count_a_mass_that_nobody_stated(unsaid, route):
    tables = analyse(unsaid, route=route).tables
    found = tables["dynamic"].join(pl.read_csv(unsaid / "truth.csv"), on="test", suffix=" true")
    for value, std, true in (("Re K* [N/m]", "u(Re K*) [N/m]", "Re K* [N/m] true"),
                             ("TR predicted [1]", "u(TR) [1]", "TR [1]")):  # fmt: skip
        assert ((found[value] - found[true]).abs() < 2.5 * found[std]).all()
    assert tables["budget"].filter(pl.col("source") == "belt mass of the specimen").height or route == "relative"
    of_balance = tables["checks"].filter(pl.col("code") == "F1 against V2")
    assert of_balance["test"].is_unique().all()
    assert of_balance.height == found.height


def test_what_a_wrong_sign_makes_is_no_mass(unsaid, tmp_path):
    folder = shutil.copytree(unsaid, tmp_path / "inverted")
    right = analyse(folder, route="mobility").dynamic
    invert_v2(folder)
    wrong = analyse(folder, route="mobility").dynamic
    assert set(wrong["verdict K*"]) == {"warning"}
    assert (wrong["u(Re K*) [N/m]"] < right["u(Re K*) [N/m]"]).all()
    assert wrong["Re K* [N/m]"].to_list() == right["Re K* [N/m]"].to_list()
