"""What the joint route is given of the ordinary errors: channels, mountings and specimens."""

import numpy as np
import pytest

from fourpole import analyse
from fourpole.campaign import read_campaign
from fourpole.core.components import component
from fourpole.core.sources import Kind
from fourpole.study import identify

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
