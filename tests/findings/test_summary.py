"""The table of a page: which frequency, which rows, and their uncertainties."""

import numpy as np
import polars as pl
import pytest

from fourpole.findings.summary import summary
from fourpole.quantities import LOSS_ANGLE, MODULUS
from fourpole.study.results import Results


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
    return Results(static, table(rows), **more)


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
    assert storage.std == pytest.approx(1e4 / np.sqrt(3))


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
    (found,) = summary(results([row()], quantiles))
    assert found.intervals == {"k2": (1.1e5, 1.5e5), "c": (600.0, np.inf)}


def test_without_a_test_in_use_there_is_no_row():
    assert summary(results([row(verdict="rejected")])) == ()
