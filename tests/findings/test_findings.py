"""Findings as data, on tables made for each: what is there is found, and nothing else."""

import numpy as np
import polars as pl
import pytest
from tests.findings.designed import LOADS, Tables, Tyre, rig_curve

from fourpole.core.checks import Code, Verdict
from fourpole.findings import Holds, findings, findings_table
from fourpole.findings.facts import Curve
from fourpole.findings.list import CheckRow, Reason, Tally, checks_by_test
from fourpole.findings.resonances import Crossing, Crossings, Prediction, Resonance, ResonanceOrder, peak
from fourpole.findings.trends import Comparison, Departure, Level, Trend
from fourpole.paper1982.claims import Claim, NoCommonState
from fourpole.study.study import Study

pytestmark = pytest.mark.thorough


def only(found, detail, quantity="", **about):
    """The one finding of a kind and a quantity whose detail has these attributes."""
    (one,) = (
        each
        for each in found
        if isinstance(each.detail, detail)
        and quantity in ("", each.quantity and each.quantity.column)
        and all(getattr(each.detail, name) == value for name, value in about.items())
    )
    return one


def found_in(tyres, **design):
    return findings(Tables(tyres, **design).results())


@pytest.mark.parametrize(
    ("k1", "holds"),
    [
        (130e3, Holds.BELOW),
        (70e3, Holds.ABOVE),
        (102e3, Holds.NO_DIFFERENCE),
        (lambda p, load: 80e3 if p < 140e3 else 130e3, Holds.MIXED),
    ],
)
def test_a_comparison_says_which_of_two_has_more(k1, holds):
    found = only(found_in({"A": Tyre(), "B": Tyre(k1=k1)}), Comparison, "K1")
    assert (found.specimens, found.holds, found.unit) == (("A", "B"), holds, "1")
    assert len(found.detail.effects) == len(found.conditions.keys) == 8
    if holds is Holds.ABOVE:
        assert found.effect == pytest.approx(100 / 70 - 1)
        assert found.std == pytest.approx(2**0.5 * 0.01 * 100 / 70, rel=1e-3)
    if holds is Holds.BELOW:
        assert found.effect == pytest.approx(100 / 130 - 1)
    assert found.tests == tuple(f"S{i}" for i in range(1, 9))


def test_a_difference_at_single_conditions_is_searched_for_with_less_chance():
    def k1(off):
        return lambda p, load: 100e3 * (1 + off * ((p, load) == (100e3, 1000.0)))

    # 8 conditions: 3.2 standard uncertainties instead of 2.
    for off, holds in ((0.044, Holds.NO_DIFFERENCE), (0.048, Holds.MIXED)):
        assert only(found_in({"A": Tyre(), "B": Tyre(k1=k1(off))}), Comparison, "K1").holds is holds


@pytest.mark.parametrize(
    ("change", "holds"),
    [
        (lambda x: 1 + 0.2 * x, Holds.RISES),
        (lambda x: 1 - 0.2 * x, Holds.FALLS),
        (lambda x: 1.0, Holds.NO_CHANGE),
        (lambda x: 1 - (x - 2 / 3) ** 2, Holds.MAXIMUM),
        (lambda x: 1 + (x - 1 / 3) ** 2, Holds.MINIMUM),
    ],
)
def test_a_trend_has_its_direction_and_size(change, holds):
    found = only(
        found_in({"A": Tyre(c=lambda p, load, f: 900 * change((p - 1e5) / 15e4))}), Trend, "C", axis="pressure"
    )
    assert found.holds is holds
    assert found.detail.ends == (100e3, 250e3)
    if holds is Holds.RISES:
        assert found.effect == pytest.approx(0.2 / 1.1)
    if found.detail.extremum:
        assert found.detail.extremum.place == {Holds.MAXIMUM: 200e3, Holds.MINIMUM: 150e3}[holds]


def test_a_trend_that_turns_depends_on_the_condition_and_has_its_zero():
    tyre = Tyre(k2=lambda p, load, f: 80e3 * (1 + 0.04 * (f - 17.0) * (p - 175e3) / 150e3))
    found = only(found_in({"A": tyre}), Trend, "K2", axis="pressure")
    assert (found.holds, found.detail.split_by) == (Holds.MIXED, "frequency")
    assert found.detail.zero == pytest.approx(17.0, abs=0.05)


def test_an_extremum_needs_four_points():
    tyre = Tyre(c=lambda p, load, f: 900 * (1 - ((p - 150e3) / 150e3) ** 2))
    for pressures, extremum in (((1e5, 1.5e5, 2e5), False), ((1e5, 1.5e5, 2e5, 2.5e5), True)):
        found = only(found_in({"A": tyre}, pressures=pressures), Trend, "C", axis="pressure")
        assert (found.detail.extremum is not None) is extremum


def test_a_trend_says_where_it_is_within_its_uncertainty():
    tyre = Tyre(k2=lambda p, load, f: 80e3 * (1 + (0.3 if f > 18.0 else 0.0) * (p - 175e3) / 150e3))
    found = only(found_in({"A": tyre}, noise=0.004), Trend, "K2", axis="pressure")
    assert [f for f, effect in found.detail.parts.items() if not effect.sign] == [10.0, 13.0, 16.0]


def test_two_values_are_a_difference_and_no_trend():
    tyre = Tyre(k1=lambda p, load: 90e3 + 20.0 * load)
    found = only(found_in({"A": tyre}), Trend, "K1", axis="load")
    assert (found.holds, found.detail.is_line, len(found.detail.effects)) == (Holds.RISES, False, 4)
    assert found.effect == pytest.approx(130 / 110 - 1)
    few = found_in({"A": tyre}, pressures=(100e3, 200e3), frequencies=(10.0, 20.0))
    assert not any(each.detail.is_line for each in few if isinstance(each.detail, Trend))


def test_what_was_not_varied_has_no_trend():
    tyre = Tyre(tr=rig_curve(15.0))
    unstated = found_in({"A": tyre}, pressures=(None,))
    assert not any("pressure" in each.kind for each in unstated)
    assert not any(each.conditions.values("pressure") for each in unstated if "pressure" in each.conditions.axes)
    single = found_in({"A": tyre}, pressures=(200e3,), loads=(1000.0,))
    assert {each.kind for each in single} == {"tests", "level", "trend with frequency", "resonance", "prediction"}
    assert only(single, Trend, "C").holds is Holds.NO_CHANGE


def test_without_k1_there_is_no_k2_and_without_v2_no_transmissibility():
    assert [each.kind for each in found_in({"A": Tyre(k1=None, loss=None)})] == ["tests"]
    topics = {str(each.topic) for each in found_in({"A": Tyre()})}
    assert not topics & {"resonance", "transmissibility"}


def test_without_k1_of_one_tyre_both_are_compared_by_k_star():
    results = Tables({"A": Tyre(), "B": Tyre(k1=None)}).results()
    known = pl.when(pl.col("tyre") == "A").then(150e3).otherwise(190e3)
    dynamic = results.dynamic.with_columns(known.alias("Re K* [N/m]"), pl.lit(1e3).alias("u(Re K*) [N/m]"))
    dynamic = dynamic.with_columns(pl.lit(4e4).alias("Im K* [N/m]"), pl.lit(1e3).alias("u(Im K*) [N/m]"))
    found = findings(Study(results.static, dynamic, results.previews))
    compared = only(found, Comparison, "|K*|")
    assert (compared.detail.upper, len(compared.detail.effects)) == ("B", 40)
    assert not [each for each in found if "B" in each.specimens and each.quantity and each.quantity.key in ("k1", "k2")]


def test_tyres_without_a_common_condition_are_not_compared():
    results = Tables({"A": Tyre(), "B": Tyre(k1=200e3)}).results()
    apart = [
        table.filter((pl.col("tyre") == "A") == (pl.col("pressure [Pa]") < 180e3))
        for table in (results.static, results.dynamic)
    ]
    assert not [each for each in findings(Study(*apart, results.previews)) if isinstance(each.detail, Comparison)]


def test_of_many_tyres_only_the_extremes_are_compared():
    tyres = {f"T{i}": Tyre(k1=100e3 + 5e3 * i, tr=rig_curve(14.0 + 0.5 * i)) for i in range(1, 9)}
    found = found_in(tyres)
    compared = only(found, Comparison, "K1").detail
    assert (compared.upper, compared.lower) == ("T8", "T1")
    assert len(found) < 20 * len(tyres)


@pytest.mark.sampled(6)
def test_scatter_beyond_the_stated_uncertainty_is_seen():
    """Noise far above u on lines of one tyre: the scatter says so."""
    none, wrong = (Holds.NO_DIFFERENCE, Holds.NO_CHANGE), 0
    for seed in range(100):
        found = found_in({"A": Tyre()}, loads=(1000.0,), noise=0.03, u=0.001, seed=seed)
        wrong += any(each.holds not in none for each in found if isinstance(each.detail, Trend))
    assert wrong <= 15  # nine trends, of which each is wrong in 4.6 % of the cases at most


@pytest.mark.sampled(2)
def test_a_trend_well_above_the_noise_is_found():
    tyre = Tyre(c=lambda p, load, f: 900.0 * (1 + 0.15 * (p - 100e3) / 150e3))
    for seed in range(20):
        found = only(found_in({"A": tyre}, noise=0.01, seed=seed), Trend, "C", axis="pressure")
        assert found.holds is Holds.RISES


def test_an_uncertainty_that_the_tests_share_is_not_taken_for_a_trend():
    # u grows along the pressure by as much as the values do, without any scatter.
    tables = Tables({"A": Tyre(c=lambda p, load, f: 900.0 * (1 + 0.02 * p / 250e3))})
    assert only(findings(tables.results()), Trend, "C", axis="pressure").holds is Holds.RISES
    results = tables.results()
    u = 900.0 * 0.03 * (pl.col("pressure [Pa]") - 100e3) / 150e3
    shared = Study(results.static, results.dynamic.with_columns(u.alias("u(C) [N s/m]")), results.previews)
    assert only(findings(shared), Trend, "C", axis="pressure").holds is Holds.NO_CHANGE


@pytest.mark.parametrize(
    ("share", "holds"),
    [
        (0.0099, Holds.NEARLY_LINEAR),
        (0.0101, Holds.NON_LINEAR),
        (0.0299, Holds.NON_LINEAR),
        (0.0301, Holds.MARKEDLY_NON_LINEAR),
    ],
)
def test_a_curve_is_linear_below_one_per_cent_and_markedly_not_above_three(share, holds):
    found = only(found_in({"A": Tyre(nonlinearity=share)}), Departure)
    assert (found.holds, found.effect) == (holds, share)


def test_a_level_is_the_mean_of_its_values():
    found = only(found_in({"A": Tyre(k1=lambda p, load: p)}, loads=(1000.0,)), Level, "K1")
    assert found.detail.numbers == pytest.approx([100e3, 150e3, 200e3, 250e3])
    assert (found.effect, found.unit) == (pytest.approx(175e3), "N/m")


def test_resonances_their_order_and_the_crossing_are_found_where_they_are():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(18.0))}
    found = found_in(tyres, frequencies=tuple(np.arange(11.0, 23.0)), loads=(1000.0,))
    at = {each.specimens[0]: each for each in found if isinstance(each.detail, Resonance)}
    assert at["A"].effect == pytest.approx(15.0, abs=0.2)
    assert at["B"].effect == pytest.approx(18.0, abs=0.2)
    for each in at.values():
        errors = [peak.doubt for peak in each.detail.peaks.values()]
        assert each.std == pytest.approx(np.mean(errors) / np.sqrt(3.0))
    order = only(found, ResonanceOrder)
    assert (order.holds, order.specimens, order.unit) == (Holds.BELOW, ("A", "B"), "Hz")
    assert order.effect == pytest.approx(-3.0, abs=0.3)
    crossing = only(found, Crossings)
    f = np.linspace(12.0, 22.0, 100001)
    gap = rig_curve(18.0)(0, 0, f) - rig_curve(15.0)(0, 0, f)
    assert crossing.holds is Holds.ONE_CROSSING
    assert crossing.effect == pytest.approx(f[np.flatnonzero(np.diff(np.sign(gap)))[0]], abs=0.1)
    assert {one.sign for one in crossing.detail.single.values()} == {-1}


def test_a_resonance_is_found_between_the_tested_frequencies():
    found = found_in({"A": Tyre(tr=rig_curve(15.3))}, pressures=(150e3,), loads=(1000.0,), frequencies=range(12, 19))
    assert only(found, Resonance).effect == pytest.approx(15.3, abs=0.05)


def test_a_coarse_grid_only_brackets_the_resonance_and_the_crossing():
    coarse = found_in({"A": Tyre(tr=rig_curve(15.6, 0.05))}, loads=(1000.0,), frequencies=(10.0, 13.0, 16.0, 19.0))
    peaks = only(coarse, Resonance).detail.peaks.values()
    assert {(each.top, round(each.low), round(each.high)) for each in peaks} == {(None, 13, 19)}
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(18.0))}
    crossing = only(found_in(tyres, frequencies=(10.0, 14.0, 20.0, 24.0)), Crossings).detail.single.values()
    assert {(each.resolved, round(each.low), round(each.high)) for each in crossing} == {(False, 14, 20)}


def test_a_resonance_at_the_end_of_the_range_is_no_resonance_found():
    assert only(found_in({"A": Tyre(tr=rig_curve(30.0))}, loads=(1000.0,)), Resonance).holds is Holds.AT_HIGHEST


def test_equal_curves_neither_cross_nor_differ():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(15.02))}
    found = found_in(tyres, frequencies=tuple(np.arange(11.0, 23.0)), u=0.02)
    assert only(found, Crossings).holds is Holds.NO_CROSSING
    assert only(found, ResonanceOrder).holds is Holds.NO_DIFFERENCE


def test_added_mass_and_rig_make_a_set_up_of_their_own():
    parts = [
        Tables({"A": Tyre(tr=rig_curve(f))}, loads=(1000.0,), more={"added mass [kg]": mass}).results()
        for f, mass in ((17.0, 0.0), (14.0, 10.0))
    ]
    both = Study(parts[0].static, pl.concat([part.dynamic for part in parts]), parts[0].previews)
    masses = {each.conditions.setup.added_mass for each in findings(both) if isinstance(each.detail, Resonance)}
    assert masses == {0.0, 10.0}


def test_tests_off_the_prediction_are_named():
    results = Tables({"A": Tyre(tr=rig_curve(15.0))}).results()
    bad = pl.when(pl.col("test").is_in(["D3", "D12"])).then(1.2).otherwise(1.0)
    dynamic = results.dynamic.with_columns(pl.col("TR measured [1]") * bad)
    found = only(findings(Study(results.static, dynamic, results.previews)), Prediction)
    assert (found.holds, found.detail.beyond) == (Holds.BEYOND, ("D3", "D12"))
    assert len(found.tests) == 40


def test_tests_are_counted_by_their_worst_verdict():
    verdicts = {"D1": ("rejected", "x is clipped"), "S2": ("warning", "look")}
    found = found_in({"A": Tyre()}, verdicts=verdicts)
    tally = only(found, Tally)
    assert (tally.detail, tally.holds) == (Tally(42, 1, 1), Holds.SOME_USED)
    doubts = {each.holds: each.tests for each in found if isinstance(each.detail, Reason)}
    assert doubts == {Holds.REJECTED: ("D1",), Holds.WARNING: ("S2",)}


@pytest.mark.sampled(6)
def test_noise_is_not_taken_for_a_finding():
    """Of 26 findings on nothing but noise, each is right in 95 % of the cases at least, all in about 90 %."""
    none = {Holds.NO_DIFFERENCE, Holds.NO_CHANGE}
    wrong = 0
    for seed in range(40):
        found = found_in({"A": Tyre(), "B": Tyre()}, noise=0.01, seed=seed, loads=LOADS)
        wrong += any(each.holds not in none for each in found if isinstance(each.detail, Comparison | Trend))
    assert wrong <= 8  # four or so are due


def test_findings_compare_and_their_order_is_that_of_the_report():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(k1=120e3, tr=rig_curve(17.0))}
    first, again = (found_in(tyres) for _ in range(2))
    assert first == again
    topics = [list(type(each.topic)).index(each.topic) for each in first]
    assert topics == sorted(topics)


def test_the_table_has_a_row_per_finding_in_si():
    tyres = {"X": Tyre(construction="cross-ply"), "Y": Tyre(k1=120e3, construction="radial-ply")}
    found = found_in(tyres)
    table = findings_table(found)
    assert table.height == len(found)
    assert table.columns == [
        "kind", "quantity", "specimens", "condition", "effect", "u(effect)", "unit", "holds", "tests",
    ]  # fmt: skip
    row = table.filter((pl.col("kind") == "comparison") & (pl.col("quantity") == "K1")).row(0, named=True)
    assert row["specimens"] == "X; Y"
    assert row["condition"] == "pressure 100000 to 250000 Pa; load 1000 to 2000 N"
    assert row["effect"] == pytest.approx(100 / 120 - 1)
    assert row["holds"] == "first below second"
    assert row["tests"].startswith("S1; S2; ")
    claims = table.filter(pl.col("kind").str.starts_with("claim"))
    assert claims["kind"].to_list() == [f"claim {i}" for i in range(1, 13)]
    assert claims["holds"][0] == "does not hold"
    assert findings_table([]).height == 0


@pytest.mark.parametrize(("high", "resolved"), [(11.49, True), (11.51, False)])
def test_a_crossing_is_resolved_up_to_15_per_cent_between_the_frequencies(high, resolved):
    assert Crossing(10.5, 10.0, high, 1).resolved is resolved


@pytest.mark.parametrize(("least", "found"), [(0.708, True), (0.706, False)])
def test_a_parabola_needs_the_neighbours_within_half_power(least, found):
    curve = Curve((10.0, 11.0, 12.0), (2.0 * least, 2.0, 1.9), (0.01,) * 3)
    assert (peak(curve).top is not None) is found


def paper_pair(**changed):
    cross = {"k1": 150e3, "construction": "Cross-Ply, 4 plies", "tr": rig_curve(20.0), "nonlinearity": 0.04}
    return {
        "X": Tyre(**(cross | changed)),
        "Y": Tyre(construction="radial ply", tr=rig_curve(16.0), nonlinearity=0.008),
    }


def claims_of(tyres, **design):
    return [each for each in found_in(tyres, **design) if isinstance(each.detail, Claim)]


def test_claims_are_of_the_two_tyres_of_the_paper_only():
    claims = claims_of(paper_pair())
    assert [each.detail.number for each in claims] == list(range(1, 13))
    assert (claims[0].holds, claims[0].detail.names) == (Holds.TRUE, ("X", "Y"))
    for other in ("", "radial"):
        tyres = paper_pair()
        tyres["X"].construction = other
        assert not claims_of(tyres)
    assert not claims_of({**paper_pair(), "Z": Tyre()})
    assert not claims_of({"X": paper_pair()["X"]})


def test_a_mount_without_inflation_takes_no_part_in_the_claims():
    tyres, mount = Tables(paper_pair()).results(), Tables({"Z": Tyre()}, pressures=(None,)).results()
    both = Study(pl.concat([tyres.static, mount.static]), pl.concat([tyres.dynamic, mount.dynamic]), pl.DataFrame())
    found = [each for each in findings(both) if isinstance(each.detail, Claim)]
    assert [(each.holds, each.detail) for each in found] == [
        (each.holds, each.detail) for each in claims_of(paper_pair())
    ]


def test_a_claim_may_be_false_unsure_or_lack_its_tests():
    false = claims_of(paper_pair(k1=80e3, nonlinearity=0.01, tr=rig_curve(13.0)))
    assert {each.detail.number for each in false if each.holds is Holds.FALSE} >= {1, 2, 11, 12}
    assert false[0].effect == pytest.approx(-0.2)
    assert claims_of(paper_pair(k1=101e3))[0].holds is Holds.TRUE_UNSURE
    few = claims_of(paper_pair(), pressures=(150e3,), loads=(1000.0,), frequencies=(10.0, 12.0))
    assert [each.detail.number for each in few if each.holds is not Holds.NOT_EXAMINED] == [1, 2, 7]


def test_one_tyre_at_two_temperatures_is_compared_and_not_averaged():
    made = Tables({"A": Tyre(k1=146e3), "B": Tyre(k1=106e3)}).results()

    def warmed(table):
        warm = pl.when(pl.col("tyre") == "A").then(20.0).otherwise(60.0).alias("temperature [degC]")
        return table.with_columns(warm).with_columns(pl.lit("A").alias("tyre"))

    found = findings(Study(warmed(made.static), warmed(made.dynamic), pl.DataFrame()))
    compared = only(found, Comparison, "K1").detail
    assert (compared.upper, compared.lower) == ("A at 20 °C", "A at 60 °C")
    levels = {each.effect for each in found if isinstance(each.detail, Level) and each.quantity.key == "k1"}
    assert levels == {146e3, 106e3}


def at_temperatures(**temperatures):
    """A cross-ply X and a radial-ply Y, each tested at some temperatures [°C]."""
    tyres = {"X": Tyre(k1=150e3, construction="cross-ply"), "Y": Tyre(construction="radial-ply")}
    parts = [
        Tables({name: tyres[name]}, more={"temperature [degC]": warm}).results()
        for name, each in temperatures.items()
        for warm in each
    ]
    warmth = [warm for each in temperatures.values() for warm in each]
    static = [p.static.with_columns(pl.lit(w).alias("temperature [degC]")) for p, w in zip(parts, warmth, strict=True)]
    return findings(Study(pl.concat(static), pl.concat([part.dynamic for part in parts])))


@pytest.mark.parametrize(
    ("temperatures", "pair"),
    [
        ({"X": (20.0, 60.0), "Y": (21.0, 64.0)}, ("X at 20 °C", "Y at 21 °C")),
        ({"X": (20.0, 60.0), "Y": (24.0, 61.0)}, ("X at 60 °C", "Y at 61 °C")),
        ({"X": (20.0, 60.0), "Y": (22.0,)}, ("X at 20 °C", "Y")),
        ({"X": (20.0, 60.0), "Y": (40.0,)}, None),
        ({"X": (20.0,), "Y": (26.0,)}, None),
    ],
)
@pytest.mark.sampled(2)
def test_the_papers_tyres_are_compared_at_the_temperature_nearest_to_each_other(temperatures, pair):
    found = at_temperatures(**temperatures)
    claims = [each for each in found if isinstance(each.detail, Claim)]
    assert len(claims) == (12 if pair else 0)
    without = [each for each in found if isinstance(each.detail, NoCommonState)]
    assert [(each.kind, each.specimens, each.holds) for each in without] == (
        [] if pair else [("claims", ("X", "Y"), Holds.NOT_EXAMINED)]
    )
    if pair:
        assert claims[0].specimens == pair
        assert (claims[0].detail.names, claims[0].detail.states[0]) == (("X", "Y"), pair[0][1:])
        assert claims[0].holds is Holds.TRUE


def test_a_doubt_has_the_code_of_its_check_or_the_remark():
    rows = [("D1", Code.CLIPPING.text, 1.0, "rejected", "turn it down"), ("D2", "of no version", 1.0, "warning", "")]
    checks = pl.DataFrame(rows, ["test", "code", "statistic", "verdict", "remedy"], orient="row")
    checks = checks.with_columns(channel=pl.lit("F1"))
    assert checks_by_test(checks)["D1"] == [CheckRow(Verdict.REJECTED, Code.CLIPPING, "turn it down", "F1")]
    verdicts = {"D1": ("rejected", "F1 is clipped"), "D2": ("warning", "look; again")}
    results = Tables({"A": Tyre()}, verdicts=verdicts).results()
    found = findings(Study(tables=results.tables, checks=checks))
    doubts = [each.detail for each in found if isinstance(each.detail, Reason)]
    assert doubts == [Reason(Code.CLIPPING), Reason(None, "look")]


def test_rejections_of_one_kind_are_one_reason():
    remark = "tests.csv row {}: tyre '{}' is not in campaign.toml; add [tyres.{}]"
    rejected = {f"D{n}": ("rejected", remark.format(n + 1, f"T {n}", n)) for n in range(1, 6)}
    rejected["D6"] = ("rejected", "tests.csv row 7: no file is named")
    fault = '{{"error": ["tests.csv", "{} {}"]}}'
    rows = [
        {"test": name, "code": Code.STATEMENT.text, "channel": "", "statistic": None, "verdict": "rejected",
         "remedy": "", "values": fault.format(*(("file", "missing") if name == "D6" else ("tyre", "unknown")))}
        for name in rejected
    ]  # fmt: skip
    tables = Tables({"A": Tyre()}, verdicts=rejected).results().tables
    found = findings(Study(tables=tables, checks=pl.DataFrame(rows, schema_overrides={"statistic": pl.Float64})))
    doubts = [each for each in found if isinstance(each.detail, Reason)]
    assert [each.tests for each in doubts] == [("D1", "D2", "D3", "D4", "D5"), ("D6",)]
    assert doubts[0].detail.remark.startswith("tests.csv row 2: tyre 'T 1'")
