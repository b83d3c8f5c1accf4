"""The run sheet: a campaign that can be read, in an order that can be run."""

from itertools import pairwise, product

import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.planning.expected import Guess
from fourpole.planning.plan import Run, plan_campaign
from fourpole.planning.runsheet import run_sheet

TOML = """
[unstated]
ordinary = "zero"
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


def planned_of(folder, rows, toml=TOML):
    (folder / "campaign.toml").write_text(toml)
    head = "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],temperature [degC],amplitude [mm],batch"
    (folder / "tests.csv").write_text("\n".join([head, *rows]) + "\n")
    return plan_campaign(read_campaign(folder), GUESS, Run())


def test_blocks_of_one_temperature_stand_together_and_the_tyre_is_brought_to_it(tmp_path):
    rows = [
        f"D{at},r/{at}.csv,dynamic,a,{pressure},1000,{frequency},{temperature + at % 3},,"
        for at, (temperature, pressure, frequency) in enumerate(product((20, 60), (1.35, 2.05), (10, 16, 24)))
    ]
    planned = planned_of(tmp_path, rows)
    assert planned.rigs[0].plan.statics == 4  # one static test per pressure and temperature
    for seed in range(6):
        sheet = run_sheet(planned, masses=[5.0], seed=seed)
        hot = (sheet["temperature [degC]"] > 40).to_list()
        assert sum(one != other for one, other in pairwise(hot)) == 1
        steps = sheet["instruction"].drop_nulls().to_list()
        assert len(steps) == 4 * 2  # a block per temperature, pressure and mass
        assert sum("bring the specimen to" in step for step in steps) == 4


def test_a_test_and_the_same_with_a_mass_are_one_condition_though_its_values_differ_a_little(tmp_path):
    """The amplitude of the deflection differs between the two; pressure, preload and temperature differ by less than
    the tolerances."""
    rows = [
        "D1,r/1.csv,dynamic,a,1.70,1000,10,20,1.0,x",
        "D2,r/2.csv,dynamic,a,1.72,1008,10,23,0.4,x",
        "D3,r/3.csv,dynamic,a,1.70,1000,16,20,1.1,x",
    ]
    planned = planned_of(tmp_path, rows)
    plan = planned.rigs[0].plan
    assert plan.tests.family.tolist() == [0, 0, 0]
    assert plan.statics == 1
    sheet = run_sheet(planned, masses=[10.0], seed=3)
    assert sum("preload spring" in step for step in sheet["instruction"].drop_nulls()) == 2  # one condition, two masses
    assert sum("set 1.7" in step for step in sheet["instruction"].drop_nulls()) == 1


def test_a_further_axis_of_the_campaign_parts_the_blocks(tmp_path):
    rows = [f"D{at},r/{at}.csv,dynamic,a,1.7,1000,{10 + at},20,,{'xy'[at % 2]}" for at in range(4)]
    toml = TOML + '[conditions]\naxes = ["batch"]\n'
    for seed in range(6):
        batches = run_sheet(planned_of(tmp_path, rows, toml), seed=seed)["batch"].to_list()
        assert batches in (["x", "x", "y", "y"], ["y", "y", "x", "x"])


def test_less_than_one_run_is_refused(planned):
    with pytest.raises(ValueError, match="at least once"):
        run_sheet(planned, repeats=0)
