"""The table of a page: which frequency, which rows, and their uncertainties."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from fourpole.findings.summary import mean_of_repeats, summary
from fourpole.quantities import LOSS_ANGLE, MODULUS
from fourpole.study.study import Study


def table(rows):
    """dynamic.csv of rows: tyre, pressure, preload, frequency, Re, Im, u(Re), u(Im), corr, K1 in SI, verdict."""
    names = ("tyre", "pressure [Pa]", "preload [N]", "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]", "u(Re K*) [N/m]")
    names += ("u(Im K*) [N/m]", "corr(Re,Im K*) [1]", "K1 [N/m]", "verdict")
    made = pl.DataFrame([dict(zip(names, row, strict=True)) for row in rows])
    tests = pl.Series("test", [f"D{n}" for n in range(len(rows))])
    return made.with_columns(tests, pl.lit("").alias("construction"), (0.01 * pl.col("K1 [N/m]")).alias("u(K1) [N/m]"))


def results(rows, quantiles=None):
    static = pl.DataFrame(
        schema={"test": pl.String, "tyre": pl.String, "construction": pl.String, "verdict": pl.String}
    )
    more = {} if quantiles is None else {"quantiles": quantiles}
    return Study(static, table(rows), **more)


def row(tyre="a", preload=1000.0, frequency=14.0, re=2e5, im=5e4, u=(100.0, 50.0), corr=0.0, verdict="ok"):
    return (tyre, 1.7e5, preload, frequency, re, im, *u, corr, 1.5e5, verdict)


def test_the_frequency_is_the_one_nearest_to_fifteen_hertz_that_all_conditions_share():
    tested = {"a": (10.0, 14.0, 15.0), "b": (10.0, 14.0, 20.0)}
    found = summary(results([row(name, frequency=f) for name, each in tested.items() for f in each]))
    assert [one.frequency for one in found] == [(14.0, 14.0)] * 2
    assert [one.frequency[0] for one in summary(results([row("a", frequency=f) for f in (9.0, 16.0)]))] == [16.0]
    apart = summary(results([row("a", frequency=12.0), row("b", frequency=20.0)]))
    assert [one.frequency[0] for one in apart] == [12.0, 20.0]
    chosen = summary(results([row(frequency=f) for f in (10.0, 14.0)]), frequency=9.0)
    assert chosen[0].frequency == (10.0, 10.0)


def test_modulus_and_loss_angle_have_the_uncertainty_of_drawn_values():
    rng = np.random.default_rng(3)
    re, im, u, corr = 2e5, 9e4, (900.0, 400.0), 0.6
    covariance = [[u[0] ** 2, corr * u[0] * u[1]], [corr * u[0] * u[1], u[1] ** 2]]
    drawn = rng.multivariate_normal([re, im], covariance, 40_000) @ [1, 1j]
    (found,) = summary(results([row(re=re, im=im, u=u, corr=corr)]))
    modulus, angle = (found.values[one.key][0] for one in (MODULUS, LOSS_ANGLE))
    assert modulus.value == pytest.approx(abs(re + 1j * im), rel=1e-12)
    assert angle.value == pytest.approx(np.angle(re + 1j * im), rel=1e-12)
    # a standard deviation of 40 000 draws is known to 0.35 %; four of these
    assert modulus.std == pytest.approx(np.std(np.abs(drawn)), rel=0.014)
    assert angle.std == pytest.approx(np.std(np.angle(drawn)), rel=0.014)


def test_repeats_are_averaged_and_their_scatter_counts():
    (found,) = summary(results([row(re=2.0e5), row(re=2.1e5), row(re=1.9e5), row(re=9e5, verdict="rejected")]))
    assert found.tests == ("D0", "D1", "D2")
    storage, same = found.values["storage"]
    assert storage is same
    assert storage.value == pytest.approx(2.0e5)
    # Student's t of 2 degrees of freedom at 97.725 % is 4.527: value ± 2 u is a 95 % interval
    assert storage.std == pytest.approx(np.hypot(100.0, 0.5 * 4.5266 * 1e4 / np.sqrt(3)), rel=1e-4)
    sizes = np.hypot([2.0e5, 2.1e5, 1.9e5], 5e4)
    assert found.scatter == pytest.approx(sizes.std(ddof=1) / sizes.mean())


def test_static_tests_alone_have_rows_of_k1():
    heads = ("test", "tyre", "construction", "verdict", "pressure [Pa]", "preload [N]", "K1 [N/m]", "u(K1) [N/m]")
    static = pl.DataFrame([dict(zip(heads, ("S1", "a", "", "ok", 2e5, 3e3, 1.8e5, 1e3), strict=True))])
    (found,) = summary(Study(static, table([row(verdict="rejected")])))
    assert (found.specimen, found.pressure, found.frequency, found.tests) == ("a", (2e5, 2e5), None, ("S1",))
    assert found.values["k1"][0].pair == (1.8e5, 1e3)


@pytest.mark.parametrize("repeats", [2, 3, 6])
@pytest.mark.sampled(2)
def test_the_mean_of_few_scattering_repeats_is_within_two_u_of_the_truth(repeats):
    rng = np.random.default_rng(9)
    drawn = 2e5 + rng.normal(0.0, 500.0, (4000, 1)) + rng.normal(0.0, 4000.0, (4000, repeats))
    means = [mean_of_repeats([(value, 500.0, "D") for value in values]) for values in drawn]
    beyond = np.mean([one.value - 2e5 > 2.0 * one.std for one in means])
    assert beyond < 0.0325  # 2.275 % of 4000 draws, and four standard deviations of their number


def test_the_interval_of_repeats_is_about_their_mean_and_has_their_scatter():
    heads = ("test", "quantity", "unit", "2.5 %", "50 %", "97.5 %", "impassive share")
    quantiles = pl.DataFrame([dict(zip(heads, ("D0", "K2", "N/m", 0.8e5, 1e5, 1.3e5, 0.0), strict=True))])
    made = results([row(), row()], quantiles)
    table = made.dynamic.with_columns(pl.Series("K2 [N/m]", [1e5, 2e5]), pl.lit(1e4).alias("u(K2) [N/m]"))
    (found,) = summary(replace(made, dynamic=table))
    low, high = found.intervals["k2"]
    assert found.values["k2"][0].value == pytest.approx(1.5e5)
    assert low < 1e5
    assert high > 2e5
    assert high - 1.5e5 > 1.5e5 - low


def test_a_range_keeps_the_ends_of_all_intervals():
    heads = ("test", "quantity", "unit", "2.5 %", "50 %", "97.5 %", "impassive share")
    quantiles = pl.DataFrame([dict(zip(heads, ("D0", "K2", "N/m", 0.8e5, 1e5, None, 0.0), strict=True))])
    made = results([row(), row(preload=2000.0)], quantiles)
    table = made.dynamic.with_columns(pl.Series("K2 [N/m]", [1e5, 2e5]), pl.lit(1e4).alias("u(K2) [N/m]"))
    (found,) = summary(replace(made, dynamic=table), most=0)
    assert found.intervals == {"k2": (pytest.approx(0.8e5), np.inf)}


def test_more_conditions_than_wanted_are_one_row_of_ranges_each():
    rows = [row(name, preload=1000.0 + 500.0 * n, re=2e5 + 1e4 * n) for name in "ab" for n in range(7)]
    found = summary(results(rows))
    assert [one.specimen for one in found] == ["a", "b"]
    assert found[0].preload == (1000.0, 4000.0)
    assert [one.value for one in found[0].values["storage"]] == [2e5, 2.6e5]
    assert len(summary(results(rows), most=14)) == 14


def test_a_skewed_interval_takes_the_place_of_twice_the_uncertainty():
    heads = ("test", "quantity", "unit", "2.5 %", "50 %", "97.5 %", "impassive share")
    values = [("D0", "K2", "N/m", 1.1e5, 1.2e5, 1.5e5, 0.0), ("D0", "C", "N s/m", 600.0, 700.0, None, 0.0)]
    quantiles = pl.DataFrame([dict(zip(heads, one, strict=True)) for one in values])
    made = results([row()], quantiles)
    table = made.dynamic.with_columns(*(pl.lit(1.2e5).alias(head) for head in ("K2 [N/m]", "C [N s/m]")))
    (found,) = summary(replace(made, dynamic=table.with_columns(pl.lit(1e4).alias("u(K2) [N/m]"))))
    assert found.intervals == {"k2": (1.1e5, 1.5e5), "c": (600.0, np.inf)}


def test_without_a_test_in_use_there_is_no_row():
    assert summary(results([row(verdict="rejected")])) == ()
