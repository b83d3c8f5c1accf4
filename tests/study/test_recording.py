"""`read_recording`: one file by itself, with stated columns or with a campaign's."""

import numpy as np
import pytest

from fourpole import analyse, demodulate, read_campaign, read_recording, simulate_campaign
from fourpole.errors import CampaignError, FileError, TableError

COLUMNS = {"time": "t", "force_in": "F1 [kN]", "motion_in": "V1 [mm/s]"}


@pytest.fixture
def file(tmp_path):
    t = np.arange(400) / 200.0
    table = np.stack([t, np.cos(63 * t), np.sin(63 * t)], axis=1)
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,F1,V1", comments="")
    return tmp_path / "run.csv"


def test_a_column_named_with_its_unit_becomes_si(file):
    recording = read_recording(file, COLUMNS)
    assert recording.sample_rate == pytest.approx(200.0)
    assert sorted(recording.channels) == ["force_in", "motion_in"]
    assert abs(recording.channels["force_in"].samples).max() == pytest.approx(1e3)
    assert recording.channels["motion_in"].quantity == "velocity"


def test_a_role_takes_the_keys_of_campaign_toml(file):
    stated = {**COLUMNS, "motion_in": {"column": "V1", "unit": "mm/s", "invert": True, "delay": "1 ms"}}
    channel = read_recording(str(file), stated).channels["motion_in"]
    assert channel.delay == 1e-3
    np.testing.assert_array_equal(channel.samples, -read_recording(file, COLUMNS).channels["motion_in"].samples)


def test_a_sample_rate_stands_in_for_a_time(file):
    recording = read_recording(file, {"sample_rate": "400 Hz", "motion_in": "V1 [m/s]"})
    assert recording.duration == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("channels", "error", "words"),
    [
        ({**COLUMNS, "force": "F1 [N]"}, CampaignError, "unknown key; did you mean 'force_in'"),
        ({**COLUMNS, "force_in": "F1 [mm]"}, CampaignError, "force_in"),
        ({**COLUMNS, "force_in": "F1"}, TableError, "states no unit"),
        ({**COLUMNS, "force_in": "F9 [N]"}, TableError, "F9"),
        ({"time": "t", "force_in": "F1 [N]"}, CampaignError, "motion_in is missing"),
    ],
)
def test_what_is_wrong_is_said(file, channels, error, words):
    with pytest.raises(error, match=words):
        read_recording(file, channels)


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        read_recording(tmp_path / "no.csv", COLUMNS)


def test_with_a_campaign_it_is_what_analyse_reads(tmp_path):
    made = simulate_campaign(tmp_path / "c", pressures=[170e3], preloads=[1000.0], frequencies=[14.0])
    study, campaign = analyse(made.folder), read_campaign(made.folder)
    test = next(test for test in campaign.tests if test.kind == "dynamic")
    for file in (test.file, campaign.folder / test.file):
        found = demodulate(read_recording(file, campaign), near=test.value("frequency")).phasors
        row = study.dynamic.filter(study.dynamic["test"] == test.name)
        assert abs(found.force_in.item()) == pytest.approx(row["F1 [N]"].item(), rel=1e-9)
