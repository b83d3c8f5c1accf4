"""Which folder a command means, and what it says of a folder that is not what it needs."""

import pytest

from fourpole.campaign.folder import read_campaign
from fourpole.errors import CampaignError
from fourpole.io.folders import model_in, results_in


@pytest.fixture
def campaign(tmp_path):
    folder = tmp_path / "tyres"
    (folder / "results").mkdir(parents=True)
    (folder / "recordings").mkdir()
    (folder / "campaign.toml").write_text("", encoding="utf-8")
    (folder / "results" / "dynamic.csv").write_text("test\n", encoding="utf-8")
    return folder


def test_the_folder_of_a_campaign_means_its_results(campaign):
    assert results_in(campaign) == campaign / "results"
    assert results_in(str(campaign / "results")) == campaign / "results"


def test_a_file_and_a_missing_path_are_left_as_they_are(campaign):
    assert results_in(campaign / "results" / "dynamic.csv") == campaign / "results" / "dynamic.csv"
    assert results_in(campaign / "nothing") == campaign / "nothing"


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ("", "a campaign without results: run fourpole analyse"),
        ("recordings", "holds no results: run fourpole analyse"),
    ],
)
def test_a_campaign_without_results_names_the_command_that_makes_them(campaign, inner, said):
    (campaign / "results" / "dynamic.csv").unlink()
    with pytest.raises(CampaignError, match=said):
        results_in(campaign / inner)


def test_a_bare_folder_is_led_to_init(tmp_path):
    for read in (results_in, model_in, read_campaign):
        with pytest.raises(CampaignError, match="fourpole init"):
            read(tmp_path)


def test_a_folder_beside_the_campaign_names_it(campaign):
    with pytest.raises(CampaignError, match=r"holds results, not a campaign: name the campaign.s folder, .*tyres$"):
        read_campaign(campaign / "results")
    with pytest.raises(CampaignError, match=r"but .*tyres has: name that folder"):
        read_campaign(campaign.parent)


def test_the_model_of_a_campaign_is_that_of_fit_or_else_that_of_map(campaign):
    with pytest.raises(CampaignError, match="no model yet: run fourpole fit"):
        model_in(campaign)
    (campaign / "results" / "map.json").write_text("{}", encoding="utf-8")
    assert model_in(campaign).name == "map.json"
    (campaign / "results" / "model.json").write_text("{}", encoding="utf-8")
    assert model_in(campaign) == model_in(campaign / "results") == campaign / "results" / "model.json"
