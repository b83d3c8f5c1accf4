"""How tests are grouped into conditions."""

from dataclasses import replace

import numpy as np
import polars as pl
from tests.plot.conftest import FREQUENCIES, PRESSURES, changed, results_of

from fourpole.core.condition import FREQUENCY, Axis
from fourpole.plot.panels import Extent
from fourpole.plot.sheet import grouped, means, read_sheet, spread


def plain(value, digits):
    return f"{value:.{digits}g}"


def test_frequencies_that_scatter_are_one_and_are_named_as_they_were_set(study):
    sheet = read_sheet(study)
    assert sheet.frequencies.labels == tuple(f"{f:g} Hz" for f in FREQUENCIES)
    assert sheet.pressures.labels == ("1 bar", "1.35 bar", "1.7 bar", "2.05 bar", "2.4 bar")
    assert sheet.loads.labels == ("1000 N", "2000 N")
    assert np.all(np.bincount(sheet.frequency) == 2 * 2 * len(PRESSURES))


def test_a_fine_sweep_does_not_melt_into_one_group():
    values = np.linspace(10.0, 20.0, 201)
    groups, at = grouped(values, FREQUENCY, plain)
    for group in range(len(groups)):
        own = values[at == group]
        assert own.max() / own.min() <= 1 / 0.98 + 1e-9
    assert np.all(np.diff(at) >= 0)


def test_labels_take_the_digits_they_need():
    groups, _ = grouped(np.array([1000.0, 1020.0, 1040.5]), Axis("", relative=0.001), plain)
    assert len(set(groups.labels)) == 3


def test_blank_is_a_group_of_its_own_and_the_last():
    groups, at = grouped(np.array([np.nan, 2.0, 1.0]), FREQUENCY, plain)
    assert groups.labels == ("1", "2", "not stated")
    assert at.tolist() == [2, 1, 0]
    assert groups.stated() == 2


def test_a_test_without_frequency_is_in_no_group_of_frequencies(study):
    first = pl.when(pl.col("test") == "D1").then(None).otherwise(pl.col("frequency [Hz]")).alias("frequency [Hz]")
    sheet = read_sheet(changed(study, lambda table: table.with_columns(first)))
    assert sheet.frequency[0] == -1
    assert np.all(sheet.frequency[1:] >= 0)


def test_the_order_of_rows_changes_no_colour_within_a_table_order():
    results = results_of(frequencies=(10.0,))
    sheet = read_sheet(changed(results, lambda table: table.reverse()))
    assert sheet.names == ("cross-ply", "radial-ply")


def test_added_masses_are_told_apart(study):
    heavy = pl.when(pl.col("test") == "D1").then(10.0).otherwise(0.0).alias("added mass [kg]")
    sheet = read_sheet(changed(study, lambda table: table.with_columns(heavy)))
    assert sheet.settings == ("10 kg added", "0 kg added")
    assert sheet.setting[:2].tolist() == [0, 1]


def test_some_of_many_are_spread_with_both_ends():
    assert spread(3, 5) == [0, 1, 2]
    assert spread(20, 5) == [0, 5, 10, 14, 19]


def test_a_line_goes_through_the_mean_of_repeats():
    x, y = means(np.array([2.0, 1.0, 1.02]), np.array([5.0, 1.0, 3.0]), [7, 4, 4])
    np.testing.assert_allclose(x, [1.01, 2.0])
    np.testing.assert_allclose(y, [2.0, 5.0])


def test_axes_hold_values_and_bars():
    extent = Extent()
    extent.add(np.array([1.0, 2.0, np.nan]), np.array([0.1, 0.5, 1.0]))
    low, high = extent.limits()
    assert low < 0.9
    assert high > 2.5
    assert extent.outside((low, high)) == (0, 0)
    assert extent.outside((1.5, 3.0)) == (1, 0)
    assert extent.outside((0.95, 2.1)) == (0, 2)
    assert extent.limits(zero=True)[0] == 0.0


def warmed(results, degrees=(20.0, 60.0)):
    """The tests in turn at two temperatures, and the static ones likewise."""

    def warm(table):
        at = pl.Series("temperature [degC]", [degrees[row % 2] for row in range(table.height)], dtype=pl.Float64)
        return table.with_columns(at)

    tables = {**results.tables, "dynamic": warm(results.dynamic), "static": warm(results.static)}
    return replace(results, tables=tables)


def test_a_specimen_at_two_temperatures_is_two(study):
    sheet = read_sheet(warmed(study))
    assert set(sheet.names) == {
        f"{tyre} at {degrees} °C" for tyre in ("cross-ply", "radial-ply") for degrees in (20, 60)
    }
    assert set(sheet.static["tyre"].to_list()) <= set(sheet.names)
    hot = np.array([sheet.names[at].endswith("60 °C") for at in sheet.tyre])
    assert np.all(hot == (sheet.values("temperature [degC]") == 60.0))


def test_temperatures_within_five_kelvin_are_one(study):
    assert read_sheet(warmed(study, (20.0, 24.9))).names == ("cross-ply", "radial-ply")
    assert len(read_sheet(warmed(study, (20.0, 25.1))).names) == 4


def test_static_tests_that_state_no_temperature_do_not_tell_specimens_apart(study):
    def warm(table):
        return table.with_columns(pl.lit(20.0).alias("temperature [degC]"))

    assert read_sheet(changed(study, warm)).names == ("cross-ply", "radial-ply")
