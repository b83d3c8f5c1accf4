"""Tests with two points each, from the tables to the report: a row is known by its test and its point."""

from dataclasses import replace

import polars as pl
import pytest

from fourpole import analyse, read_results
from fourpole.fitting.measured import read_measured
from fourpole.fitting.rows import KEY, keys_of
from fourpole.plot.catalogue import draw
from fourpole.report.cards import make_cards
from fourpole.report.page import render_report
from fourpole.report.words.limits import limits
from fourpole.study.tables import TABLES
from fourpole.virtual import RADIAL_PLY, simulate_campaign

POINTS = {"D1": ("D1", 1), "D2": ("D1", 2), "D3": ("D2", 1), "D4": ("D2", 2)}


def two_points(table):
    """The table with D1 to D4 as two points of D1 and of D2; of the static test it says nothing."""
    if "test" not in table.columns:
        return table
    key = pl.col("test")
    names = {name: test for name, (test, _) in POINTS.items()}
    points = {name: point for name, (_, point) in POINTS.items()}
    columns = [name for name in table.columns if name != "test"]
    return table.select(
        key.replace(names).alias("test"),
        key.replace_strict(points, default=1, return_dtype=pl.Int64).alias("point"),
        *columns,
    )


def drawn(figure):
    """All that lines and areas show, as text, for not-a-number is not equal to itself."""
    lines = [repr(line.get_xydata().tolist()) for ax in figure.axes for line in ax.lines]
    return lines + [
        repr(path.vertices.tolist()) for ax in figure.axes for one in ax.collections for path in one.get_paths()
    ]


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    campaign = simulate_campaign(
        folder, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 14.0, 18.0, 24.0]
    )
    study = analyse(campaign.folder)
    tables = {name: table if name == "static" else two_points(table) for name, table in study.tables.items()}
    return study, replace(study, tables=tables)


@pytest.fixture(scope="module")
def folders(studies, tmp_path_factory):
    return [study.write(tmp_path_factory.mktemp("results")) for study in studies]


def test_the_key_tells_rows_apart(studies):
    for name, spec in TABLES.items():
        table = studies[1].tables[name]
        assert not table.select(head for head in spec.key if head in table.columns).is_duplicated().any(), name


def test_points_are_read_back(folders):
    table = read_results(folders[1]).dynamic
    assert table.columns[:2] == list(KEY)
    assert keys_of(table) == list(POINTS.values())
    assert table.schema["point"] == pl.Int64


def test_models_get_the_same_covariance(folders):
    one, two = (read_measured(folder) for folder in folders)
    assert two.notes == one.notes
    for first, second in zip(one.conditions, two.conditions, strict=True):
        assert second.tests == ("D1", "D1", "D2", "D2")
        assert replace(second, keys=first.keys) == first


def test_the_same_sources_limit(folders):
    one, two = (limits(read_results(folder)) for folder in folders)
    assert [(limit.source, limit.share, limit.relative) for limit in two] == [
        (limit.source, limit.share, limit.relative) for limit in one
    ]


def test_each_point_has_its_own_card_and_signals(folders):
    one, two = (make_cards(read_results(folder))[0] for folder in folders)
    assert [card.test for card in two] == ["S1", "D1", "D1", "D2", "D2"]
    assert [card.body for card in two] == [card.body for card in one]


def test_figures_and_page_are_made(folders):
    one, two = (read_results(folder) for folder in folders)
    for name in ("stiffness", "budget", "rig-residual", "fig14"):
        first, second = draw(one, name), draw(two, name)
        assert (first is None) == (second is None)
        if first is not None:
            assert drawn(first) == drawn(second)
    page = render_report(two, findings=(), figures={})
    assert "dynamic-4" in page
    assert "dynamic-5" not in page


def test_a_test_counts_once(studies):
    assert sum(studies[0].counts.values()) == 5
    assert sum(studies[1].counts.values()) == 3
