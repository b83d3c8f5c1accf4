"""What the paper claims of its tyres is true of the virtual ones, and the reading of a claim can also fail."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough


def truth_of(place, **settings):
    """truth.csv of a campaign. Recordings are left out: the truth is drawn and computed without them."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("record_static", "record_dynamic"):
            patch.setattr(f"fourpole.virtual.simulate.{name}", lambda *_: [])
        patch.setattr("fourpole.virtual.simulate.write_recording", lambda *_: None)
        folder = simulate_campaign(place, **settings).folder
    return pl.read_csv(folder / "truth.csv", infer_schema_length=None)


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return truth_of(tmp_path_factory.mktemp("truth"))


def test_the_truth_is_the_same_with_recordings(tmp_path):
    few = {"pressures": [170e3], "preloads": [1000.0], "frequencies": [10.0, 24.0], "seed": 3}
    whole = simulate_campaign(tmp_path / "whole", **few).folder / "truth.csv"
    assert truth_of(tmp_path / "bare", **few).equals(pl.read_csv(whole, infer_schema_length=None))


def nonlinearity(tyre, pressure):
    """Largest departure from the line through 10 and 90 % of the load span, over the span."""
    x = np.linspace(0.0, tyre.deflection(3500.0, pressure), 1001)
    load = tyre.load(x, pressure)
    ends = tyre.deflection(np.array([350.0, 3150.0]), pressure)
    line = 350.0 + 2800.0 * (x - ends[0]) / (ends[1] - ends[0])
    return abs(load - line).max() / 3500.0


def tables(truth, tyres=(CROSS_PLY, RADIAL_PLY)):
    by_name = {tyre.name: tyre for tyre in tyres}
    dynamic = truth.filter(pl.col("frequency [Hz]").is_not_null()).rename({"TR [1]": "TR measured [1]"})
    static = truth.filter(pl.col("frequency [Hz]").is_null())
    index = [nonlinearity(by_name[name], p) for name, p in static.select("tyre", "pressure [Pa]").iter_rows()]
    return static.with_columns(pl.Series("nonlinearity [1]", index)), dynamic


def holding(results):
    return {number for number, holds, _ in results if holds}


def test_all_twelve_claims_hold_on_the_truth(truth, evaluate_claims):
    results = evaluate_claims(*tables(truth))
    assert [number for number, _, _ in results] == list(range(1, 13))
    assert holding(results) == set(range(1, 13)), results


def test_rows_in_another_order_give_the_same_verdicts(truth, evaluate_claims):
    shuffled = truth.sample(fraction=1.0, shuffle=True, seed=3)
    assert holding(evaluate_claims(*tables(shuffled))) == set(range(1, 13))


def test_tyres_exchanged_break_the_claims_that_tell_them_apart(truth, evaluate_claims):
    swap = {"cross-ply": "radial-ply", "radial-ply": "cross-ply"}
    static, dynamic = tables(truth)
    exchanged = evaluate_claims(*(part.with_columns(pl.col("tyre").replace(swap)) for part in (static, dynamic)))
    # 5 is said of both; C of the cross-ply also rises with frequency (6), and K2 behaves alike (8, 9)
    assert holding(exchanged) == {5, 6, 8, 9}


@pytest.mark.parametrize(
    ("number", "change"),
    [(4, {"c_p": -0.1}), (5, {"c_l": 0.02}), (6, {"r": -0.25}), (8, {"k_p": -0.15}), (9, {"n": -0.8})],
)
def test_another_law_of_the_radial_breaks_its_claim(tmp_path, evaluate_claims, number, change):
    tyres = (CROSS_PLY, replace(RADIAL_PLY, **change))
    frequencies = [10.0, 16.0, 17.0, 20.0, 24.0]
    changed = truth_of(tmp_path, clean=True, tyres=tyres, frequencies=frequencies)
    assert number not in holding(evaluate_claims(*tables(changed, tyres)))


def test_nothing_to_read_is_no_claim_that_holds(truth, evaluate_claims):
    static, dynamic = tables(truth)
    rejected = dynamic.with_columns(pl.lit("rejected").alias("verdict"))
    assert holding(evaluate_claims(static, rejected)) == {1, 2}
