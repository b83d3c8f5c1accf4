"""Results of many campaigns in one data set: what is read, what is read again, what is left out."""

from __future__ import annotations

import json
import os
import shutil
from datetime import date
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.lab.conftest import campaign
from tests.rig_errors import ERRORS
from tests.unlisted import unlisted

from fourpole import analyse
from fourpole.errors import CampaignError
from fourpole.lab import SCHEMA, TABLES, difference, gather, scan

ORIGIN = ["schema", "campaign", "laboratory", "title", "date", "fourpole", "sha256"]


def listed(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_each_row_says_where_it_is_from_and_has_the_values_of_the_results(place):
    found = gather(place)
    assert (found.campaigns, found.read, found.tests, found.problems) == (("2024", "south/2025"), 2, 8, ())
    rows = scan(found.folder).collect()
    assert rows.columns[:7] == ORIGIN
    assert rows.unique(["campaign", "test", "point"]).height == rows.height == 8
    assert rows["schema"].unique().to_list() == [SCHEMA]
    own = rows.filter(pl.col("campaign") == "south/2025")
    results = pl.read_parquet(place / "south" / "2025" / "results" / "dynamic.parquet")
    for head in set(results.columns) - {"point"}:
        assert own[head].equals(results[head].cast(own[head].dtype)), head
    assert all(scan(found.folder, table).collect().height for table in TABLES)


def test_all_files_of_a_table_have_the_same_columns(place):
    """So that a reader needs no option for missing columns; further columns of tests.csv are one JSON object."""
    tests, stated = (place / "south" / "2025" / name for name in ("tests.csv", "campaign.toml"))
    stated.write_text(stated.read_text().replace("date = 2025-05-31\n", ""))
    head, *lines = tests.read_text().splitlines()
    tests.write_text(
        "\n".join([f"{head},camber [deg],time", *(f"{line},2,2025-03-0{4 - at % 4}" for at, line in enumerate(lines))])
    )
    analyse(place / "south" / "2025", monte_carlo=0).write(place / "south" / "2025" / "results")
    gather(place)
    schemas = {json.dumps(str(pl.read_parquet_schema(path))) for path in (place / "lab" / "tests").glob("*.parquet")}
    assert len(schemas) == 1
    rows = scan(place / "lab").filter(pl.col("campaign") == "south/2025").collect()
    assert {json.loads(text)["camber [deg]"] for text in rows["further"]} == {"2"}
    assert rows["date"].unique().to_list() == [date(2025, 3, 1)]


def test_laboratory_and_date_are_those_of_campaign_toml(place):
    path = place / "south" / "2025" / "campaign.toml"
    path.write_text('laboratory = "North hall"\n' + path.read_text())
    analyse(place / "south" / "2025", monte_carlo=0).write(place / "south" / "2025" / "results")
    gather(place)
    rows = scan(place / "lab", "static").filter(pl.col("campaign") == "south/2025").collect()
    assert rows.select("laboratory", "date").unique().rows() == [("North hall", date(2025, 5, 31))]


def test_unchanged_results_are_not_read_again(place):
    gather(place)
    for path in (place / "2024").rglob("dynamic.csv"):
        time = path.stat().st_mtime_ns
        path.write_text("x" * path.stat().st_size)  # of the same size and time: whoever reads it fails
        os.utime(path, ns=(time, time))
    again = gather(place)
    assert (again.read, again.unchanged, again.problems) == (0, 2, ())


def test_changed_new_and_removed_results_are_followed(place):
    gather(place)
    shutil.rmtree(place / "2024")
    campaign(place / "2026", 13)
    (place / "south" / "2025" / "results" / "study.json").touch()
    found = gather(place)
    assert (found.campaigns, found.read, found.unchanged, found.removed) == (("2026", "south/2025"), 2, 0, 1)
    names = scan(place / "lab").select("campaign").unique().collect()["campaign"].sort().to_list()
    assert names == ["2026", "south/2025"]
    assert len(list((place / "lab" / "tests").iterdir())) == 2


def test_results_that_cannot_be_read_are_named_and_the_others_stay(place):
    (place / "2024" / "results" / "study.json").write_text("{")
    found = gather(place)
    assert (found.campaigns, found.left_out) == (("south/2025",), 1)
    assert found.problems == ("2024: not taken: study.json is not one that fourpole wrote: run fourpole analyse again",)


def test_results_of_an_earlier_version_lack_columns_that_stay_empty(place):
    results = unlisted(place / "south" / "2025" / "results")
    table = pl.read_csv(results / "dynamic.csv").drop("deflection amplitude [m]")
    table.write_csv(results / "dynamic.csv")
    found = gather(place)
    assert found.problems == (
        "south/2025: tests is without deflection amplitude [m]: run fourpole analyse again to have them",
    )
    rows = scan(place / "lab").filter(pl.col("campaign") == "south/2025").collect()
    assert rows["deflection amplitude [m]"].null_count() == rows.height == 4
    table.drop("Re K* [N/m]").write_csv(results / "dynamic.csv")
    assert (
        "south/2025: not taken: dynamic.csv: has no column 'Re K* [N/m]': run fourpole analyse again"
        in gather(place).problems
    )


def test_a_data_set_of_another_version_is_written_anew_or_refused(place):
    gather(place)
    index = place / "lab" / "lab.json"
    document = json.loads(index.read_text())
    index.write_text(json.dumps({**document, "schema": SCHEMA - 1}))
    assert gather(place).read == 2
    index.write_text(json.dumps({**document, "schema": SCHEMA + 1}))
    before = listed(place / "lab")
    with pytest.raises(CampaignError, match="a newer Fourpole wrote this data set"):
        gather(place)
    index.write_text('{"format": "other"}')
    with pytest.raises(CampaignError, match="is not one that fourpole lab wrote: delete it"):
        gather(place)
    assert listed(place / "lab") == before


@pytest.mark.parametrize("where", ["write_table", "write_text"])
def test_a_stopped_run_leaves_the_former_data_set(place, monkeypatch, where):
    gather(place)
    before = {name: (place / "lab" / name).read_bytes() for name in listed(place / "lab")}
    (place / "south" / "2025" / "results" / "study.json").touch()

    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"fourpole.lab.dataset.{where}", stopped)
    with pytest.raises(KeyboardInterrupt):
        gather(place)
    assert {name: (place / "lab" / name).read_bytes() for name in listed(place / "lab")} == before


def test_links_are_not_followed_and_the_data_set_may_stand_elsewhere(place, tmp_path):
    campaigns = tmp_path / "only"
    campaigns.mkdir()
    shutil.copytree(place / "south" / "2025", campaigns / "2025")
    (campaigns / "linked").symlink_to(place / "2024", target_is_directory=True)
    found = gather(campaigns, tmp_path / "set")
    assert (found.folder, found.campaigns) == (tmp_path / "set", ("2025",))
    assert not (campaigns / "lab").exists()
    assert gather(campaigns / "2025", tmp_path / "one").campaigns == ("2025",)


def test_a_folder_without_results_says_what_to_do(tmp_path):
    with pytest.raises(CampaignError, match=r"no results below it: run fourpole analyse on its campaigns first"):
        gather(tmp_path)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(CampaignError, match="there is no data set: fourpole lab FOLDER writes one"):
        scan(tmp_path)
    with pytest.raises(CampaignError, match="no table 'test': choose one of tests, static"):
        scan(tmp_path, "test")


@pytest.mark.sampled(2)
def test_the_same_sensors_cancel_in_a_difference_and_other_sensors_do_not(place):
    """The true values are equal. Sensors contribute 30 times more to u than noise does."""
    campaign(place / "other", 14, serials=False, rig_error=ERRORS["rig_error"])  # sensors with errors of their own
    gather(place)
    same = difference(place / "lab", "2024", "south/2025")
    assert same.height == 4 * 5
    ratio = same["ratio same sensors"].to_numpy()
    assert np.sqrt(np.mean(ratio**2)) < 1.6  # 20 ratios, of which some 8 are independent: chi2(8)/8 < 2.5 at 99 %
    assert np.median(same["u same sensors"] / same["u independent"]) < 0.1
    other = difference(place / "lab", "south/2025", "other")
    assert np.sqrt(np.mean(other["ratio independent"].to_numpy() ** 2)) < 2.0
    assert np.sqrt(np.mean(other["ratio same sensors"].to_numpy() ** 2)) < 2.0  # the rig alone is common
    assert (other["u same sensors"] > 10 * same["u same sensors"]).sum() > 15


def test_values_are_compared_at_one_frequency(made, place):
    """The cam turns a little faster or slower than stated; K* changes by more than its noise then."""
    gather(place)
    found = difference(place / "lab", "2024", "south/2025").filter(pl.col("quantity") == "Re K*")
    one, two = (scan(place / "lab").filter(pl.col("campaign") == name).collect() for name in ("2024", "south/2025"))
    assert found["frequency [Hz]"].to_list() == one["frequency [Hz]"].to_list()
    slope = np.gradient(two["Re K* [N/m]"].to_numpy(), np.log(two["frequency [Hz]"].to_numpy()))
    moved = slope * np.log(two["frequency [Hz]"].to_numpy() / one["frequency [Hz]"].to_numpy())
    step = two["Re K* [N/m]"].to_numpy() - found["second"].to_numpy()
    np.testing.assert_allclose(step, moved, rtol=0.3, atol=1.0)  # a parabola over four points is near these slopes


def test_errors_are_not_common_after_different_routes(place):
    analyse(place / "2024", route="relative", monte_carlo=0).write(place / "2024" / "results")
    gather(place)
    found = difference(place / "lab", "2024", "south/2025")
    assert found.height
    assert found["u same sensors"].equals(found["u independent"])


def test_a_difference_names_a_campaign_that_is_not_there(place):
    gather(place)
    with pytest.raises(CampaignError, match="has no campaign 'spring'"):
        difference(Path(place / "lab"), "south/2025", "spring")
