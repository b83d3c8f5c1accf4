"""Two results compared: what cancels, what is seen, what is said of it."""

from __future__ import annotations

import re
from dataclasses import replace
from math import radians

import numpy as np
import polars as pl
import pytest
from tests.rig_errors import ERRORS

import fourpole
from fourpole import analyse
from fourpole.errors import CampaignError
from fourpole.findings.compared import COMPARED, DIFFERS, NOT_SEEN, compare
from fourpole.findings.points import QUANTITIES, Readings, differences, of_two_campaigns
from fourpole.study import read_results
from fourpole.study.study import Study
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough

FREQUENCIES = [11.0, 14.0, 18.0, 23.0]
SOFT = replace(RADIAL_PLY.changed(0.97), name="soft")


def with_serials(folder):
    """State a serial number of each sensor."""
    path = folder / "campaign.toml"
    path.write_text(re.sub(r'column = "(F1|V1|V2|F|x)"', r'column = "\1", serial = "SN \1"', path.read_text()))


def run(folder, seed, tyres=(RADIAL_PLY,), *, serials=True, **settings):
    settings = {"sensors": (5e-3, radians(0.2)), **settings}
    simulate_campaign(
        folder,
        seed=seed,
        tyres=tyres,
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=FREQUENCIES,
        rig_std={"moving_mass": 0.15, "preload_stiffness": 120.0, "preload_damping": 5.0},
        **settings,
    )
    if serials:
        with_serials(folder)
    study = analyse(folder, monte_carlo=0)
    study.write(folder / "results")
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of one tyre on one rig with the same sensors, a campaign of two tyres, and a run of a softer tyre."""
    place = tmp_path_factory.mktemp("compared")
    return {
        "one": run(place / "one", 11, **ERRORS),
        "two": run(place / "two", 12, **ERRORS),
        "both": run(place / "both", 15, (RADIAL_PLY, SOFT), **ERRORS),
        "changed": run(place / "changed", 16, (replace(SOFT, name="radial-ply"),), **ERRORS),
    }


def dynamic(compared):
    return compared.rows.filter(pl.col("quantity") != "K1")


@pytest.mark.sampled(6)
def test_the_error_of_common_sensors_cancels_and_that_of_others_does_not(runs, tmp_path):
    """The true values are equal. Sensors contribute 30 times more to u than noise does."""
    same, alone = (compare(runs["one"], runs["two"], independent=way) for way in (False, True))
    assert same.rows.height == alone.rows.height == 4 * 6 + 1
    assert np.sqrt(np.mean(dynamic(same)["z [1]"].to_numpy() ** 2)) < 1.6
    keys = ["quantity", "frequency [Hz]"]
    both = dynamic(same).join(dynamic(alone), on=keys)
    assert (both["u(difference)"] < 0.15 * both["u(difference)_right"]).mean() > 0.9
    assert (both["difference"] == both["difference_right"]).all()
    assert "sensors of F1, V1, V2, load, deflection (serial numbers); moving mass m" in same.common[0]
    assert alone.common == ("All errors are taken as independent, as asked for.",)
    other = compare(runs["one"], run(tmp_path / "other", 14, serials=False, rig_error=ERRORS["rig_error"]))
    assert np.sqrt(np.mean(dynamic(other)["z [1]"].to_numpy() ** 2)) < 2.0
    assert "errors of F1, V1, V2, load, deflection are taken as independent, as no serial number" in other.common[1]
    assert other.common[1].endswith("state their serial in [channels] of both.")
    for u, common in (("u(first)", same), ("u(second)", other)):  # the rig is common in both
        both = dynamic(common).filter(pl.col("quantity") == "|K*|")
        assert (both["u(difference)"] > 0.9 * both[u]).all() == (common is other)


@pytest.mark.parametrize(("a", "b", "specimens"), [("both", None, ("radial-ply", "soft")), ("one", "changed", None)])
@pytest.mark.sampled(2)
def test_a_specimen_that_is_three_per_cent_softer_is_seen(runs, a, b, specimens):
    found = compare(runs[a], runs[b] if b else None, specimens=specimens)
    rows = found.rows.filter(pl.col("quantity").is_in(["K1", "|K*|", "Re K*", "Im K*"]))
    assert set(rows["verdict"]) == {DIFFERS}
    share = (rows["difference"] / rows["first"]).to_numpy()
    tolerance = 4.0 * (rows["u(difference)"] / rows["first"]).to_numpy() + 1e-3
    assert np.all(np.abs(share + 0.03) < tolerance)
    angle = found.rows.filter(pl.col("quantity") == "loss angle")  # both parts of K* changed by the same factor
    assert np.all(np.abs(angle["z [1]"].to_numpy()) < 4.0)
    assert found.rows["z [1]"].abs().is_sorted(descending=True)


def test_without_a_budget_no_error_is_common_and_that_is_said(runs):
    one, two = (read_results(runs[name] / "results") for name in ("one", "two"))
    two = replace(two, tables={**two.tables, "budget": pl.DataFrame()})
    bare, alone = compare(one, two), compare(one, two, independent=True)
    assert "no budget.csv, so all errors are taken as independent" in bare.common[0]
    assert bare.rows.equals(alone.rows)


def test_in_one_campaign_the_covariance_of_the_campaign_is_used(runs):
    """u of a difference of K' is that of the sum of the parts which both do not share, from covariance.parquet."""
    found = compare(runs["both"], specimens=("radial-ply", "soft")).rows.filter(pl.col("quantity") == "Re K*")
    table = pl.read_parquet(runs["both"] / "results" / "covariance.parquet").join(
        pl.read_csv(runs["both"] / "results" / "dynamic.csv"), on="test"
    )
    for row in found.rows(named=True):
        one, two = (
            table.row(by_predicate=pl.col("test") == row[f"tests of {at}"], named=True) for at in ("first", "second")
        )
        parts = np.array(one["shared Re K* [N/m]"]) - np.array(two["shared Re K* [N/m]"])
        own = sum(each["u(Re K*) [N/m]"] ** 2 - np.sum(np.square(each["shared Re K* [N/m]"])) for each in (one, two))
        least = np.sqrt(parts @ parts + own)
        assert least * (1 - 1e-9) <= row["u(difference)"] < 1.5 * least


@pytest.mark.sampled(4)
def test_folders_studies_and_results_give_the_same(runs):
    by_folder = compare(runs["one"] / "results", str(runs["two"]))
    studies = [analyse(runs[name], monte_carlo=0) for name in ("one", "two")]
    assert fourpole.compare is compare
    by_study = compare(*studies)
    assert (by_folder.names, by_study.names) == (("one", "two"), ("first", "second"))
    np.testing.assert_allclose(by_study.rows["z [1]"], by_folder.rows["z [1]"], rtol=1e-6)
    assert len(repr(by_study)) < 1000
    whole = compare(analyse(runs["both"], monte_carlo=0), specimens=("soft", "radial-ply"))
    assert "the covariance that the campaign found" in whole.common[0]
    assert (whole.rows.filter(pl.col("quantity") == "K1")["difference"] > 0).all()


def test_a_statement_that_differs_is_not_common(runs, tmp_path):
    from shutil import copytree

    changed = copytree(runs["two"], tmp_path / "changed")
    path = changed / "results" / "study.json"
    path.write_text(path.read_text().replace('"column": "V1"', '"column": "V1b"'))
    found = compare(runs["one"], changed)
    assert "sensors of F1, V2, load, deflection (serial numbers);" in found.common[0]
    assert found.common[1] == "The statements of V1 differ: their errors are taken as independent."
    wider = dynamic(found).join(dynamic(compare(runs["one"], runs["two"])), on=["quantity", "frequency [Hz]"])
    of_modulus = wider.filter(pl.col("quantity") == "|K*|")
    assert (of_modulus["u(difference)"] > 2.0 * of_modulus["u(difference)_right"]).all()
    for name, hall in ((runs["one"], "North"), (changed, "South")):
        made = copytree(name, tmp_path / hall)
        study = made / "results" / "study.json"
        study.write_text(study.read_text().replace('"stated": {', f'"stated": {{"laboratory": "{hall} hall",', 1))
    halls = compare(tmp_path / "North", tmp_path / "South").common
    assert halls == ("The laboratories differ (North hall, South hall): all errors are taken as independent.",)


@pytest.mark.parametrize(
    ("a", "b", "specimens", "said"),
    [
        ("one", None, None, "compare takes two results, or one with two specimens: --specimens X Y"),
        ("both", None, ("radial-ply", "rigid"), "both: has no specimen 'rigid': choose one of radial-ply, soft"),
        ("both", None, ("soft", "soft"), "--specimens names 'soft' twice"),
        ("one", "gone", None, "there is no such folder of results"),
        ("one", "one", None, "one and .*one are the same results"),
    ],
)
def test_what_cannot_be_compared_is_said(runs, a, b, specimens, said):
    with pytest.raises(CampaignError, match=said):
        compare(runs[a], None if b is None else runs.get(b, runs["one"] / b), specimens=specimens)


def test_no_condition_in_common_says_what_each_has(tmp_path, runs):
    low = tmp_path / "low"
    simulate_campaign(low, tyres=[RADIAL_PLY], pressures=[120e3], preloads=[1000.0], frequencies=[14.0])
    analyse(low, monte_carlo=0).write(low / "results")
    with pytest.raises(CampaignError, match=r"low has 1\.2 bar, 1000 N, 1\d(\.\d+)? Hz; one has 1\.7 bar"):
        compare(low, runs["one"])


def test_routes_that_differ_share_no_error(runs):
    mobility = analyse(runs["two"], monte_carlo=0, route="mobility")
    (said,) = compare(read_results(runs["one"] / "results"), mobility).common
    assert said.startswith("K* was found by different routes (joint, mobility), where one error acts differently")
    assert said.endswith("all errors are taken as independent.")


def test_specimens_on_different_rigs_share_no_error(runs):
    results = read_results(runs["both"] / "results")
    rig = pl.when(pl.col("tyre") == "soft").then(pl.lit("second")).otherwise(pl.lit("first")).alias("rig")
    apart = replace(results, tables={**results.tables, "dynamic": results.dynamic.with_columns(rig)})
    covariance = pl.read_parquet(runs["both"] / "results" / "covariance.parquet")
    apart = replace(apart, tables={**apart.tables, "covariance": covariance})
    found = compare(apart, specimens=("radial-ply", "soft"))
    assert found.common == (
        "radial-ply and soft were tested on different rigs: all errors of K* are taken as independent.",
    )


@pytest.mark.sampled(4)
def test_repeats_of_one_condition_are_one_row(tmp_path):
    folder = run(tmp_path / "twice", 3, repeats=2, added_masses=(0.0, 10.0), **ERRORS)
    found = compare(folder, run(tmp_path / "once", 4, **ERRORS))
    assert dynamic(found).height == 4 * 6
    assert all(len(tests.split("; ")) == 4 for tests in dynamic(found)["tests of first"])
    assert set(dynamic(found)["tests of second"].str.contains(";")) == {False}


def points(stiffness, k1, effect, u=100.0):
    """One point of K* with one error of two parts, which budget.csv has as unsigned numbers."""
    stiffness, count = np.atleast_1d(np.asarray(stiffness, dtype=complex)), np.size(stiffness)
    re, im = np.broadcast_to(effect.real, count), np.broadcast_to(effect.imag, count)
    loss = np.abs(im - stiffness.imag / stiffness.real * re) / stiffness.real
    tests = [f"D{at}" for at in range(count)]
    table = {"test": tests, "Re K* [N/m]": stiffness.real, "Im K* [N/m]": stiffness.imag, "K1 [N/m]": k1}
    arm = 1.0 / (stiffness - k1)
    omega = 2 * np.pi * 14.0
    table |= {"K2 [N/m]": 1 / arm.real, "C [N s/m]": -1 / (omega * arm.imag), "frequency [Hz]": 14.0}
    spread = np.hypot(u, np.abs(re)), np.hypot(u, np.abs(im))
    table |= {
        "u(Re K*) [N/m]": spread[0],
        "u(Im K*) [N/m]": spread[1],
        "corr(Re,Im K*) [1]": re * im / spread[0] / spread[1],
    }
    table |= {"u(K1) [N/m]": 50.0, "u(K2) [N/m]": 500.0, "u(C) [N s/m]": 5.0}
    budget = [
        {"test": test, "quantity": name, "source": "gain F1", "u": float(value)}
        for at, test in enumerate(tests)
        for name, value in (("Re K*", abs(re[at])), ("Im K*", abs(im[at])), ("loss factor", loss[at]))
    ]
    return Readings.of(pl.DataFrame(table), pl.DataFrame(budget), np.zeros(count, dtype=int))


@pytest.mark.parametrize("effect", [900 + 200j, 900 - 200j, -300 + 700j])
def test_the_signs_of_an_error_are_told_by_the_loss_factor_and_it_cancels_in_all_quantities(effect):
    one, two = points(180e3 + 50e3j, 120e3, effect), points(181e3 + 50.2e3j, 120e3, effect)
    pair = (np.zeros(1, dtype=int),) * 2
    found = differences(one, two, pair, lambda name: name == "gain F1")
    for quantity in COMPARED[1:5]:
        at = QUANTITIES.index(quantity)
        own = 100.0 * np.linalg.norm(one.slopes[0, at, :2]) * np.sqrt(2.0)
        assert found.u[0, at] == pytest.approx(own, rel=0.05)
    alone = differences(one, two, pair, lambda name: False)
    assert np.all(alone.u[0, 3:5] > 1.3 * found.u[0, 3:5])


def test_an_error_is_not_common_where_k_star_differs_much():
    one, two = points(180e3 + 50e3j, 120e3, 900 + 200j), points(250e3 + 90e3j, 120e3, 900 + 200j)
    pair = (np.zeros(1, dtype=int),) * 2
    found, alone = (differences(one, two, pair, lambda _, way=way: way) for way in (True, False))
    assert found.unlike.tolist() == [True]
    np.testing.assert_allclose(found.u[:, 1:6], alone.u[:, 1:6])


def drawn(rng):
    """Errors of three sensors, of which gains are known to 1 % and phases to 0.5 degrees."""
    stds = {"gain": 1e-2, "phase": radians(0.5)}
    return {f"{what} {name}": std * rng.standard_normal() for what, std in stds.items() for name in ("F1", "V1", "V2")}


WIDE = {"sensors": (1e-2, radians(0.5)), "rig_error": ERRORS["rig_error"]}


@pytest.mark.statistical
@pytest.mark.sampled(6)
def test_runs_with_other_sensors_of_equal_text_seldom_differ(tmp_path):
    """4 pairs of 4 frequencies: all true values are equal, and the sensors of each run are drawn anew."""
    rng, seen = np.random.default_rng(1), []
    for pair in range(4):
        one, two = (
            run(tmp_path / f"{pair}-{at}", 2 * pair + at, serials=False, undeclared=drawn(rng), **WIDE) for at in (0, 1)
        )
        seen += (dynamic(compare(one, two))["verdict"] == DIFFERS).to_list()
    assert len(seen) == 4 * 4 * 6
    assert np.mean(seen) <= 0.05


@pytest.mark.sampled(2)
def test_a_half_per_cent_shows_where_both_used_the_same_sensors(tmp_path):
    sensors, tyre = drawn(np.random.default_rng(2)), replace(RADIAL_PLY.changed(0.995), name="radial-ply")
    runs = [
        run(tmp_path / "old", 1, undeclared=sensors, **WIDE),
        run(tmp_path / "new", 2, (tyre,), undeclared=sensors, **WIDE),
    ]
    found, alone = (compare(*runs, independent=way).rows.filter(pl.col("quantity") == "|K*|") for way in (False, True))
    assert set(found["verdict"]) == {DIFFERS}
    assert set(alone["verdict"]) == {NOT_SEEN}
    share = (found["difference"] / found["first"]).to_numpy()
    assert np.all(np.abs(share + 0.005) < 4.0 * (found["u(difference)"] / found["first"]).to_numpy())


def stated(serial="SN 1", *, mounting=(None,), budget=("gain V1",), part=2.5e-3, rig="bench", **keys):
    """Results that hold what is stated of V1 and the rig, the mountings of the tests, and the sources of the budget."""
    channel = {"column": "V1", "std_gain [1]": 0.01, "std_phase [rad]": 0.01, "mounting gain [1]": part, **keys}
    channel |= {"serial": serial} if serial else {}
    mass = {"moving_mass": {"value": 15.0, "std": 0.1}}
    dynamic = pl.DataFrame({"test": list(map(str, mounting)), "tyre": "radial", "mounting": list(mounting)})
    tables = {"dynamic": dynamic.cast(pl.String), "budget": pl.DataFrame({"source": list(budget)})}
    return Study(tables=tables, record={"stated": {"channels": {"motion_in": channel}, "rigs": {rig: mass}}})


@pytest.mark.parametrize(
    ("first", "second", "gain", "delay"),
    [
        ({}, {}, 1 - 0.25**2, 1),
        ({"part": 0.0}, {"part": 0.0}, 1, 1),
        ({"serial": ""}, {"serial": ""}, 0, 0),
        ({"serial": ""}, {}, 0, 0),
        ({"serial": "SN 2"}, {}, 0, 0),
        ({"range": "1 m/s"}, {}, 1 - 0.25**2, 1),
        ({"gain": 2.0}, {}, 0, 0),
        ({"mounting": ("a",)}, {"mounting": ("a",)}, 1, 1),
        ({"mounting": ("a",)}, {"mounting": ("b",)}, 1 - 0.25**2, 1),
        ({"mounting": ("a", None)}, {"mounting": ("a",)}, 1 - 0.25**2, 1),
        ({"budget": ("gain V1", "mounting gain V1")}, {}, (1 - 0.25**2) ** 0.5, 1),
        ({"budget": ("mounting gain V1",)}, {"budget": ("mounting gain V1",)}, 1, 1),
        ({"budget": ("gain with one mass F1",)}, {}, 1 - 0.25**2, 1),
    ],
)
def test_what_two_campaigns_have_in_common_of_a_sensor(first, second, gain, delay):
    correlation, _ = of_two_campaigns(stated(**first), stated(**second))
    assert correlation("gain V1") == pytest.approx(gain)
    assert correlation("delay V1") == delay
    for never in (
        "gain drift V1",
        "gain F1",
        "cross-talk V2 in V1",
        "K1 gains",
        "sensor noise",
        "gain with one mass V1",
    ):
        assert correlation(never) == 0.0
    same = first.get("mounting") == second.get("mounting") == ("a",)
    assert correlation("mounting gain V1") == float(same)


def test_a_mounting_and_a_rig_of_another_name_are_told():
    _, said = of_two_campaigns(stated(), stated())
    assert said[0].startswith(
        "Taken as common are the errors of the sensors of V1 (serial numbers); moving mass m of the rig"
    )
    assert said[1].startswith("The part of a mounting in gain and phase of V1 is taken as independent")
    for other, common in (("bench", 1.0), ("tower", 0.0)):
        assert of_two_campaigns(stated(), stated(rig=other))[0]("moving_mass") == common


@pytest.mark.statistical
@pytest.mark.sampled(12)
def test_the_ratios_of_runs_without_a_difference_have_the_spread_of_chance(tmp_path):
    """6 pairs of runs with drawn errors that both share; K' and K'' of 4 frequencies are nearly independent."""
    found = []
    for pair in range(6):
        rng = np.random.default_rng(pair)
        drawn = {name: value * float(rng.uniform(-1.0, 1.0)) for name, value in ERRORS["undeclared"].items()}
        errors = {**ERRORS, "undeclared": drawn}
        one, two = (run(tmp_path / str(at), 2 * pair + at, **errors) for at in (0, 1))
        rows = compare(one, two).rows.filter(pl.col("quantity").is_in(["Re K*", "Im K*"]))
        found += rows["z [1]"].to_list()
        assert set(rows["verdict"]) <= {DIFFERS, NOT_SEEN}
    assert 0.7 < np.sqrt(np.mean(np.square(found))) < 1.3  # 48 ratios, whose rms is known to 10 %
