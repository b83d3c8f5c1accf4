"""The run sheet: a campaign that can be read, in an order that can be run."""

from itertools import pairwise

import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.planning.plan import Guess, Run, plan_campaign
from fourpole.planning.runsheet import run_sheet

TOML = """
[rig]
moving_mass = "15 kg"
preload_stiffness = "12.44 kN/m"
[channels]
sample_rate = "2 kHz"
force_in = { column = "F1", unit = "N" }
motion_in = { column = "V1", unit = "m/s" }
motion_out = { column = "V2", unit = "m/s" }
load = { column = "F", unit = "N" }
deflection = { column = "x", unit = "mm" }
[tyres.a]
[tyres.b]
"""
GUESS = Guess(110e3, 100e3, 800.0)


@pytest.fixture
def planned(tmp_path):
    lines = ["test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],u(added_mass) [kg],window [s],operator"]
    number = 0
    for tyre in "ab":
        for pressure in (1.35, 2.05):
            lines.append(f"S{number},rec/S{number}.csv,static,{tyre},{pressure},,,,,")
            for preload in (1000, 2000):
                for frequency in (10, 16, 24):
                    number += 1
                    lines.append(
                        f"D{number},rec/D{number}.csv,dynamic,{tyre},{pressure},{preload},{frequency},0.002,2..12,Ada"
                    )
    (tmp_path / "campaign.toml").write_text(TOML)
    (tmp_path / "tests.csv").write_text("\n".join(lines) + "\n")
    return plan_campaign(read_campaign(tmp_path), GUESS, Run())


@pytest.fixture
def sheet(planned):
    return run_sheet(planned, masses=[5.0, 10.0], repeats=2, seed=7)


def test_it_is_a_tests_csv_that_can_be_read(sheet, planned, tmp_path):
    sheet.write_csv(tmp_path / "tests.csv")
    again = read_campaign(tmp_path)
    assert not any(test.problem for test in again.tests)
    assert len(again.tests) == 4 + 24 * 3 * 2
    assert {test.window for test in again.of_kind("dynamic")} == {(2.0, 12.0)}
    assert set(again.extra_columns) == {"operator", "repeat", "instruction"}
    before = {test.name: test for test in planned.tests}
    for test in again.tests:
        if test.name in before:
            assert test.values.get("pressure") == pytest.approx(before[test.name].values["pressure"])
            assert test.file == before[test.name].file
    replanned = plan_campaign(again, GUESS, Run()).rigs[0].plan.tests
    assert len(replanned) == 144
    assert len(set(replanned.family)) == 8


def test_every_test_stands_once_per_mass_and_repeat(sheet):
    dynamic = sheet.filter(kind="dynamic")
    counts = dynamic.group_by("tyre", "pressure [bar]", "preload [N]", "frequency [Hz]", "added_mass [kg]").len()
    assert counts.height == 72
    assert set(counts["len"]) == {2}
    assert set(dynamic["repeat"]) == {"1", "2"}
    assert dynamic["file"].n_unique() == dynamic.height


def test_static_tests_come_before_the_dynamic_ones_of_a_tyre_and_are_conditioned(sheet):
    for tyre in "ab":
        kinds = sheet.filter(tyre=tyre)["kind"].to_list()
        assert kinds == sorted(kinds, reverse=True)
    assert sheet["tyre"].to_list() == sorted(sheet["tyre"], key=sheet["tyre"].to_list().index)  # one after the other
    said = sheet.filter(kind="static")["instruction"].to_list()
    assert all("condition: load well past 2000 N" in text and "bar" in text for text in said)


def test_each_tyre_is_warmed_up_once(sheet):
    warmed = sheet.filter(pl.col("instruction").str.contains("warm up: run at 16 Hz"))
    assert warmed["tyre"].to_list() == sheet["tyre"].unique(maintain_order=True).to_list()


def blocks(sheet, tyre):
    keys = ["pressure [bar]", "preload [N]", "added_mass [kg]"]
    rows = sheet.filter(tyre=tyre, kind="dynamic")
    at = [row for row in range(rows.height) if row == 0 or rows.select(keys).row(row) != rows.select(keys).row(row - 1)]
    return rows, at


def test_masses_change_as_rarely_as_can_be_and_the_preload_is_reset_when_they_do(sheet):
    for tyre in "ab":
        rows, starts = blocks(sheet, tyre)
        assert len(starts) == 12  # each block is run in one go
        masses = [rows["added_mass [kg]"][at] for at in starts]
        changes = [at for at, (one, other) in enumerate(pairwise(masses), 1) if one != other]
        assert len(changes) == 8  # two in each of four conditions, none between them
        for number in changes:
            row = rows.row(starts[number], named=True)
            apart = masses[number] - masses[number - 1]
            more = "less" if apart > 0 else "more"
            text = f"reset the preload spring ({abs(apart) * 9.80665:.1f} N {more} from it)"
            assert text in row["instruction"]
            assert f"{row['preload [N]']:g} N again" in row["instruction"]
        quiet = rows.with_row_index().filter(~pl.col("index").is_in(starts))
        assert quiet["instruction"].null_count() == quiet.height


def test_the_order_is_random_and_the_seed_gives_it_again(planned, sheet):
    assert run_sheet(planned, masses=[5.0, 10.0], repeats=2, seed=7).equals(sheet)
    assert not run_sheet(planned, masses=[5.0, 10.0], repeats=2, seed=8).equals(sheet)
    rows, starts = blocks(sheet, "a")
    orders = {tuple(rows["frequency [Hz]"][at : at + 3]) for start in starts for at in (start, start + 3)}
    assert len(orders) > 1


def test_less_than_one_run_is_refused(planned):
    with pytest.raises(ValueError, match="at least once"):
        run_sheet(planned, repeats=0)
