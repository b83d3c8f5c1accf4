"""The four poles of a campaign: what is used, what is left out, and what a laboratory lacks."""

import shutil

import numpy as np
import polars as pl
import pytest
from tests.belted_rig import BeltedRig
from tests.conftest import Folder

from fourpole.core.specimen import Form
from fourpole.errors import CampaignError
from fourpole.study.twoports import measure_two_ports, two_port_table

FREQUENCIES = [20.0, 40.0, 60.0, 80.0, 100.0]
#: What a laboratory states that has none of the ordinary errors.
ZERO = '[unstated]\nordinary = "zero"'


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return BeltedRig().write(tmp_path_factory.mktemp("belted") / "campaign", FREQUENCIES)


@pytest.fixture
def belted(made, tmp_path):
    return Folder(shutil.copytree(made, tmp_path / "campaign"), made.parent / "cache")


@pytest.fixture(scope="module")
def measured(made):
    return measure_two_ports(made, cache=made.parent / "cache")


def rows_of(folder, keep):
    """Only some rows of tests.csv."""
    head, *rows = (folder.path / "tests.csv").read_text().splitlines()
    (folder.path / "tests.csv").write_text("\n".join([head, *filter(keep, rows)]) + "\n")


def test_recordings_give_the_poles_of_a_car_tyre_to_100_hz_within_1_percent(measured):
    (found,), lacks = measured
    truth = BeltedRig().truth(FREQUENCIES)
    size = np.maximum(np.abs(truth), np.abs(truth[:, :1, 1:]))
    assert np.max(np.abs(found.poles.stiffness - truth) / size) < 0.01
    assert lacks == []
    assert found.name == "car, 2.2 bar, 4000 N"
    assert found.reciprocal
    assert found.form_fits
    assert found.form.specimen.form is Form.BELT
    assert found.form.specimen.mass == pytest.approx(7.0, abs=4 * found.form.mass_std)
    assert all("no input_mass is stated" in note or "no tyre_mass is stated" in note for note in found.notes)


@pytest.mark.sampled(2)
def test_stated_masses_of_the_rig_are_taken_off_and_said(tmp_path):
    masses = """input_mass = { value = 1.5, unit = "kg", std = 0.001 }
tyre_mass = { value = 9, unit = "kg", std = 0.001 }"""
    rig = BeltedRig(input_mass=1.5, wheel_mass=9.0)
    (found,), _ = measure_two_ports(rig.write(tmp_path / "campaign", FREQUENCIES, statement=masses))
    truth = rig.truth(FREQUENCIES)
    assert np.max(np.abs(found.poles.stiffness - truth) / np.abs(truth).max(axis=(1, 2), keepdims=True)) < 0.01
    assert found.notes == (
        "the stated input_mass, 1.5 kg, is taken off k11",
        "the stated tyre_mass, 9 kg, is taken off k22",
    )


def test_a_specimen_that_is_not_reciprocal_is_told_and_gets_no_form(tmp_path):
    (found,), _ = measure_two_ports(BeltedRig(active=0.05).write(tmp_path / "campaign", FREQUENCIES))
    assert not found.reciprocal
    assert not found.form_fits
    assert found.form is None
    assert found.poles is found.measured
    table = two_port_table([found])
    assert table["k12 = k21"].to_list() == [False] * 5
    np.testing.assert_allclose(table["Re det [1]"], 1 / 1.05, atol=0.01)
    assert table["Re k11 of the form [N/m]"].null_count() == 5


def test_the_table_has_poles_uncertainties_and_form_in_si(measured):
    (found,), _ = measured
    table = two_port_table([found])
    poles = found.poles
    assert table.select("tyre", "pressure [Pa]", "preload [N]").row(0) == ("car", 2.2e5, 4000.0)
    for at, pole in enumerate(("k11", "k12", "k21", "k22")):
        values = table[f"Re {pole} [N/m]"] + 0
        np.testing.assert_array_equal(values, poles.stiffness.reshape(-1, 4)[:, at].real)
        np.testing.assert_array_equal(table[f"u(Im {pole}) [N/m]"], poles.std[:, at, 1])
        form = found.form.poles.reshape(-1, 4)[:, at]
        np.testing.assert_array_equal(table[f"Im {pole} of the form [N/m]"], form.imag)
    assert table["form"].unique().to_list() == ["belt"]
    assert not any(kind == pl.Null for kind, head in zip(table.dtypes, table.columns, strict=True) if " k" in head)


@pytest.mark.sampled(2)
def test_ordinary_errors_that_are_stated_as_absent_make_the_poles_more_certain(belted):
    (usual,), _ = measure_two_ports(belted.path, cache=belted.cache)
    with (belted.path / "campaign.toml").open("a") as file:
        file.write(ZERO + "\n")
    (sure,), _ = measure_two_ports(belted.path, cache=belted.cache)
    assert np.all(sure.poles.std[:, 1] < usual.poles.std[:, 1])


@pytest.mark.parametrize(
    ("keep", "lack"),
    [
        (lambda row: not row.startswith("B"), "0 of 2 rigid blocks: add tests of kind = calibration"),
        (lambda row: not row.startswith("B2"), "1 of 2 rigid blocks: add tests of kind = calibration"),
        (lambda row: not row.startswith("D2"), "1 of 2 loads: add tests of the specimen with another weighed mass"),
        (lambda row: row.startswith("B"), "no test of a specimen: add tests of kind = dynamic"),
    ],
)
def test_a_laboratory_without_blocks_or_second_load_is_told_what_to_add(belted, keep, lack):
    rows_of(belted, keep)
    with pytest.raises(CampaignError, match=f"four poles cannot be found.*{lack}"):
        measure_two_ports(belted.path, cache=belted.cache)


def test_a_frequency_without_all_its_tests_is_left_out_and_said(belted):
    rows_of(belted, lambda row: not row.startswith("D2-40"))
    (found,), _ = measure_two_ports(belted.path, cache=belted.cache)
    np.testing.assert_allclose(found.poles.frequency, [20, 60, 80, 100], rtol=1e-4)
    assert any(note.startswith("40 Hz is left out: it has 1 of 2 loads") for note in found.notes)


def test_a_rejected_test_is_named_with_its_reason(belted):
    belted.recording("D2-40").unlink()
    (found,), _ = measure_two_ports(belted.path, cache=belted.cache)
    (note,) = [note for note in found.notes if note.startswith("test D2-40")]
    assert "left out: " in note
    assert len(found.poles.frequency) == 4


@pytest.mark.sampled(2)
def test_a_condition_that_lacks_something_does_not_stop_the_others(belted):
    text = (belted.path / "tests.csv").read_text()
    lines = [
        line.replace("D1-", "E1-", 1).replace(",car,2.2,", ",car,2.6,") for line in text.splitlines() if "D1-" in line
    ]
    (belted.path / "tests.csv").write_text(text + "\n".join(lines) + "\n")
    (found,), (lack,) = measure_two_ports(belted.path, cache=belted.cache)
    assert found.name == "car, 2.2 bar, 4000 N"
    assert lack.startswith("car, 2.6 bar, 4000 N: 1 of 2 loads")


def test_a_campaign_without_v2_or_with_a_blocked_output_is_told_so(belted):
    original = (belted.path / "campaign.toml").read_text()
    belted.edit("campaign.toml", 'motion_out = { column = "V2", unit = "m/s" }\n', "")
    with pytest.raises(CampaignError, match="motion_out is missing: four poles need F1, V1 and V2"):
        measure_two_ports(belted.path, cache=belted.cache)
    blocked = original.replace('moving_mass = "22 kg"\npreload_stiffness = "12 kN/m"', 'output = "blocked"')
    (belted.path / "campaign.toml").write_text(blocked)
    with pytest.raises(CampaignError, match="a blocked specimen does not show k22"):
        measure_two_ports(belted.path, cache=belted.cache)
