"""Limits and results: the decision rule, its probabilities against drawn values, and which results a limit concerns."""

import numpy as np
import polars as pl
import pytest

from fourpole import quantities as q
from fourpole.findings.conformity import Conformity, judged, outcome_of
from fourpole.study.study import Study

STATIC = {"test": pl.String, "tyre": pl.String, "construction": pl.String, "verdict": pl.String,
          "pressure [Pa]": pl.Float64, "preload [N]": pl.Float64, "K1 [N/m]": pl.Float64,
          "u(K1) [N/m]": pl.Float64}  # fmt: skip


def dynamic(at, tyre="a", pressure=2e5, frequency=15.0, re=2e5, u=1000.0, temperature=None, verdict="ok"):
    return {
        "test": f"D{at}", "tyre": tyre, "construction": "", "verdict": verdict, "pressure [Pa]": pressure,
        "preload [N]": 1000.0, "temperature [degC]": temperature, "frequency [Hz]": frequency, "Re K* [N/m]": re,
        "Im K* [N/m]": 4e4, "u(Re K*) [N/m]": u, "u(Im K*) [N/m]": 100.0, "corr(Re,Im K*) [1]": 0.0,
    }  # fmt: skip


def made(rows, *limits, static=(), quantiles=None):
    table = pl.DataFrame(list(rows), schema_overrides={"temperature [degC]": pl.Float64})
    more = {} if quantiles is None else {"quantiles": pl.DataFrame(quantiles)}
    return Study(pl.DataFrame(list(static), STATIC), table, record={"stated": {"limits": list(limits)}}, **more)


def storage(**limit):
    return {"quantity": "storage", **limit}


@pytest.mark.parametrize(
    ("re", "outcome"),
    [
        (1.9e5, Conformity.PASS),
        (1.9799e5, Conformity.PASS),
        (1.9801e5, Conformity.UNDECIDED),
        (2.0199e5, Conformity.UNDECIDED),
        (2.0201e5, Conformity.FAIL),
        (1.0e5, Conformity.FAIL),
    ],
)
def test_the_guard_band_is_u_on_either_side(re, outcome):
    (one,) = judged(made([dynamic(1, re=re)], storage(low=1.5e5, high=2e5)))
    assert one.outcome is outcome
    assert one.interval == pytest.approx((re - 2000.0, re + 2000.0))


def test_the_probability_is_that_of_drawn_values():
    (one,) = judged(made([dynamic(1, re=1.99e5)], storage(low=1.98e5, high=2e5)))
    drawn = np.random.default_rng(5).normal(1.99e5, 1000.0, 100_000)
    # the share of 100 000 draws is known to 0.0015; four of these
    assert one.probability == pytest.approx(np.mean((drawn > 1.98e5) & (drawn < 2e5)), abs=0.006)


def test_a_false_acceptance_is_rarer_than_one_in_forty():
    rng = np.random.default_rng(7)
    measured = rng.normal(2.001e5, 1000.0, 4000)  # just beyond the limit
    found = judged(made([dynamic(at, pressure=1e5 * 1.05**at, re=re) for at, re in enumerate(measured[:150])],
                        storage(high=2e5)))  # fmt: skip
    assert len(found) == 150
    assert sum(one.outcome is Conformity.PASS for one in found) <= 9  # 150 at 1.8 % are 2.7; P(> 9) is below 1e-3


def test_a_limit_concerns_its_condition_only():
    rows = [
        dynamic(1), dynamic(2, frequency=30.0), dynamic(3, pressure=2.5e5), dynamic(4, "b"),
        dynamic(5, re=9e9, verdict="rejected"),
    ]  # fmt: skip
    count = {
        6: len(judged(made(rows, storage(high=3e5), storage(high=3e5, specimen="b", frequency=30.0)))) + 1,
        3: len(judged(made(rows, storage(high=3e5, specimen="a")))),
        2: len(judged(made(rows, storage(high=3e5, specimen="a", pressure=2.01e5)))),
        1: len(judged(made(rows, storage(high=3e5, specimen="a", pressure=2e5, frequency=15.1)))),
    }
    assert count == {6: 6, 3: 3, 2: 2, 1: 1}


def test_a_limit_that_no_test_has_the_condition_of_is_undecided():
    (one,) = judged(made([dynamic(1)], storage(high=3e5, pressure=9e5)))
    assert (one.value, one.outcome) == (None, Conformity.UNDECIDED)


def test_k1_is_that_of_the_static_tests():
    static = [("S1", "a", "", "ok", 2e5, 1000.0, 1.6e5, 100.0), ("S2", "a", "", "ok", 2e5, 2000.0, 1.7e5, 100.0)]
    found = judged(made([dynamic(1)], {"quantity": "k1", "high": 1.65e5, "frequency": 15.0}, static=[
        dict(zip(STATIC, row, strict=True)) for row in static
    ]))  # fmt: skip
    assert [one.outcome for one in found] == [Conformity.PASS, Conformity.FAIL]
    assert outcome_of(found) is Conformity.FAIL


def test_a_skewed_interval_stands_in_place_of_u():
    open_above = pl.Series([None], dtype=pl.Float64)
    quantiles = {"test": ["D1"], q.QUANTITY.head: ["K2"], q.LOWER.head: [1e4], q.UPPER.head: open_above}
    row = {**dynamic(1), "K2 [N/m]": 5e4, "u(K2) [N/m]": 10.0}
    results = made([row], {"quantity": "k2", "high": 6e4}, quantiles=quantiles)
    (one,) = judged(results)
    assert (one.outcome, one.probability) == (Conformity.UNDECIDED, None)


def test_temperatures_are_told_apart():
    rows = [dynamic(1, temperature=20.0, re=1e5), dynamic(2, temperature=60.0, re=3e5)]
    (one,) = judged(made(rows, storage(high=2e5, temperature=20.0, specimen="a")))
    assert one.outcome is Conformity.PASS
    assert {each.outcome for each in judged(made(rows, storage(high=2e5, specimen="a")))} == {"pass", "fail"}


def test_a_k1_that_is_stated_with_the_dynamic_tests_is_held_against_its_limit():
    rows = [{**dynamic(at, frequency=f), "K1 [N/m]": 1.6e5, "u(K1) [N/m]": 500.0} for at, f in enumerate((10.0, 15.0))]
    (one,) = judged(made(rows, {"quantity": "k1", "high": 1.65e5}))
    assert (one.outcome, one.value.value, one.value.std) == (Conformity.PASS, 1.6e5, 500.0)
