"""The joint route through whole campaigns in the time domain, held against the truth beside them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.faulty import invert_v2

from fourpole.core.routes import maxwell_arm
from fourpole.study import analyse
from fourpole.study.results import read_results
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign
from fourpole.words import cause_words

pytestmark = pytest.mark.thorough

PLAN = {
    "tyres": [RADIAL_PLY],
    "pressures": [170e3],
    "preloads": [1000.0, 2000.0],
    "frequencies": [10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0],
}
ROUGH = (0.03, float(np.deg2rad(1.0)))
LOOSE = {"moving_mass": 0.3, "preload_stiffness": 250.0, "preload_damping": 5.0}
#: Columns of results, of truth, and uncertainties.
PAIRS = (
    ("Re K* [N/m]", "Re K* [N/m]", "u(Re K*) [N/m]"),
    ("Im K* [N/m]", "Im K* [N/m]", "u(Im K*) [N/m]"),
    ("TR predicted [1]", "TR [1]", "u(TR) [1]"),
)


def simulated(path: Path, **settings: object) -> Path:
    return simulate_campaign(path, **{**PLAN, **settings}).folder


def errors(study, folder: Path) -> dict[str, np.ndarray]:
    """Relative error of each result of the tests with a tyre, and error over stated uncertainty."""
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None)
    table = study.dynamic.filter(pl.col("tyre") != "").join(truth, on="test", suffix=" true", how="inner")
    found = {}
    pairs = (*PAIRS, ("K2 [N/m]", "K2 [N/m]", "u(K2) [N/m]"), ("C [N s/m]", "C [N s/m]", "u(C) [N s/m]"))
    for column, true, std in pairs:
        right = f"{true} true" if f"{true} true" in table.columns else true
        off = table[column].to_numpy() - table[right].to_numpy()
        found[column] = np.abs(off / table[right].to_numpy())
        found[std] = np.abs(off / table[std].to_numpy())
    return found


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    """Sensors known to 3 % and 1 degree, each condition without and with 10 kg; its study."""
    folder = simulated(tmp_path_factory.mktemp("rough"), seed=3, sensors=ROUGH, rig_std=LOOSE, added_masses=(0.0, 10.0))
    return folder, analyse(folder, cache=folder / "cache")


@pytest.mark.statistical
@pytest.mark.parametrize(("signs", "seed"), [((1, 1), 7), ((1, -1), 6)])
@pytest.mark.sampled(2)
def test_a_misstated_rig_does_no_harm(tmp_path, signs, seed):
    """Mass and spring 2 % off, both up and opposite, good sensors: the paper's route has a hundred times these."""
    wrong = {"moving_mass": 0.02 * signs[0], "preload_stiffness": 0.02 * signs[1]}
    plan = {"tyres": [CROSS_PLY, RADIAL_PLY], "preloads": [1000.0]}
    folder = simulated(tmp_path, seed=seed, rig_error=wrong, rig_std=LOOSE, **plan)
    cache = tmp_path / "cache"
    found = errors(analyse(folder, cache=cache), folder)
    assert len(found["K2 [N/m]"]) == 16
    for column, most in (("K2 [N/m]", 1e-3), ("C [N s/m]", 1.5e-3), ("TR predicted [1]", 5e-4)):
        assert np.median(found[column]) < most, column
    assert np.median(errors(analyse(folder, route="mobility", cache=cache), folder)["C [N s/m]"]) > 0.03


@pytest.mark.sampled(4)
def test_one_weighed_mass_in_place_of_good_sensors(rough):
    folder, study = rough
    found = errors(study, folder)
    for column in ("K2 [N/m]", "C [N s/m]"):
        assert np.median(found[column]) < 3e-3
        assert np.percentile(found[column], 95) < 3e-2
    # 32 tests share their gains and their mass: five standard uncertainties of every value are out of all luck
    for _, _, std in PAIRS:
        assert found[std].max() < 5.0
    before, after = study.rigs[0].mass_gain["K'"]
    # the sensors leave 3 %, the mass whose uncertainty is blank 0.2 %
    assert before > 0.015
    assert 1e-3 < after < 2e-3


@pytest.mark.sampled(2)
def test_without_the_mass_the_uncertainty_is_large_and_honest(tmp_path):
    folder = simulated(tmp_path, seed=3, sensors=ROUGH, rig_std=LOOSE)
    study = analyse(folder)
    found = errors(study, folder)
    assert study.dynamic.select((pl.col("u(K2) [N/m]") / pl.col("K2 [N/m]")).median()).item() > 0.02
    assert max(found[std].max() for _, _, std in PAIRS) < 4.0
    unseen = study.rig.filter(pl.col("value").is_in(["gain V1", "phase V1"]))
    assert unseen["finding"].to_list() == ["not determined"] * 2
    assert unseen["seen from"].to_list() == [None] * 2


def test_what_is_found_is_close_to_the_truth(rough):
    folder, study = rough
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None).row(-1, named=True)
    rows = {row["value"]: row for row in study.rig.rows(named=True)}
    for value, true in (
        ("moving_mass", truth["moving mass [kg]"]),
        ("preload_stiffness", truth["preload stiffness [N/m]"]),
        ("preload_damping", truth["preload damping [N s/m]"]),
        ("gain F1/V1", (1 + truth["gain error F1 [1]"]) / (1 + truth["gain error V1 [1]"])),
        ("phase V2-V1", truth["phase error V2 [rad]"] - truth["phase error V1 [rad]"]),
    ):
        row = rows[value]
        assert row["finding"] == "found"
        assert row["posterior over prior [1]"] == pytest.approx(row["u(found)"] / row["u(stated)"])
        assert row["posterior over prior [1]"] < 0.1
        assert abs(row["found"] - true) < 5.0 * row["u(found)"], value


def test_the_budget_adds_up_to_the_uncertainties(rough):
    _, study = rough
    table = study.dynamic
    for quantity, std in (
        ("Re K*", "u(Re K*) [N/m]"),
        ("K2", "u(K2) [N/m]"),
        ("C", "u(C) [N s/m]"),
        ("TR", "u(TR) [1]"),
    ):
        of = study.budget.filter(pl.col("quantity") == quantity).group_by("test", maintain_order=True)
        sums = of.agg((pl.col("u") ** 2).sum().sqrt().alias("whole"), pl.col("share [1]").sum())
        both = table.join(sums, on="test")
        assert both.height == table.height
        np.testing.assert_allclose(both["whole"], both[std], rtol=1e-9)
        np.testing.assert_allclose(both["share [1]"], 1.0, rtol=1e-12)
    sources = set(study.budget["source"])
    assert {"sensor noise", "frequency", "gain V1", "phase F1", "moving_mass", "added mass 10 kg"} <= sources
    assert {"K1 fit", "K1 gains", "other sources"} <= sources
    of_result = study.budget.group_by("test", "quantity").agg(pl.len(), pl.col("source").last(), "u")
    assert of_result["len"].max() == 11
    for row in of_result.filter(len=11).rows(named=True):
        least = min(row["u"][:-1])
        assert row["source"] == "other sources"
        assert row["u"][-1] < least * np.sqrt(
            len(sources)
        )  # each of the others is smaller than the least that is named


@pytest.mark.parametrize("route", ["mobility", "relative", "transmissibility"])
def test_every_route_has_a_budget(noisy, route):
    study = noisy.analyse(route=route)
    of = study.budget.filter(pl.col("quantity") == "Im K*").group_by("test", maintain_order=True)
    whole = study.dynamic.join(of.agg((pl.col("u") ** 2).sum().sqrt().alias("whole")), on="test")
    np.testing.assert_allclose(whole["whole"], whole["u(Im K*) [N/m]"], rtol=1e-9)
    assert study.rig.height == study.residuals.height == 0
    assert study.rigs == ()


@pytest.mark.parametrize(
    ("part", "named", "words"),
    [
        ({"tyre_mass": 1.0}, "tyre mass", "an undeclared tyre mass would make it"),
        ({"frame_stiffness": 2e5}, "frame", "behind the preload spring"),
        ({"preload_loss_factor": 0.1}, "leaf friction", "a loss factor of 0.1"),
        ({"leaf_friction": 5.0}, "leaf friction", "dry friction of 5"),
    ],
    ids=lambda part: next(iter(part)) if isinstance(part, dict) else "",
)
@pytest.mark.sampled(6)
def test_an_undeclared_part_is_seen_and_no_value_is_calibrated(tmp_path, part, named, words):
    stated = {"moving_mass": 0.1, "preload_stiffness": 100.0, "preload_damping": 0.5}
    folder = simulated(tmp_path, seed=9, undeclared=part, rig_std=stated)
    study = analyse(folder)
    assert study.rigs[0].fits is False
    causes = study.rigs[0].causes
    assert named in [one.name for one in causes]
    assert any(words in cause_words(one) for one in causes)
    assert len(causes) <= 2
    assert "ok" not in study.dynamic["verdict"].to_list()
    assert "no value is called calibrated" in study.notes[0]
    assert not {"found"} & set(study.rig["finding"])
    mass = study.rig.filter(pl.col("value") == "moving_mass").row(0, named=True)
    true = pl.read_csv(folder / "truth.csv", infer_schema_length=None)["moving mass [kg]"][0]
    assert abs(mass["found"] - true) < 2.0 * mass["u(found)"]
    found = errors(study, folder)
    assert max(found[std].max() for _, _, std in PAIRS) < 4.0


@pytest.mark.sampled(4)
def test_declared_parts_are_handled(tmp_path):
    parts = {"tyre_mass": 1.0, "frame_stiffness": 2e5, "preload_loss_factor": 0.1, "input_mass": 0.5}
    folder = simulated(tmp_path, seed=9, declared=parts, rig_std=LOOSE)
    study = analyse(folder)
    assert study.rigs[0].fits
    assert set(parts) <= set(study.rig["value"])
    assert max(errors(study, folder)[std].max() for _, _, std in PAIRS) < 4.0


@pytest.mark.sampled(6)
def test_a_rigid_mass_in_place_of_the_tyre_does_as_well(tmp_path):
    weighed = {"calibration_masses": (5.0, 15.0), "preloads": [1000.0]}
    folder = simulated(tmp_path, seed=9, sensors=ROUGH, rig_std=LOOSE, **weighed)
    study = analyse(folder, cache=tmp_path / "cache")
    blocks = study.dynamic.filter(pl.col("tyre") == "")
    assert blocks.height == 16
    assert set(blocks["verdict"]) == {"ok"}
    assert "a rigid mass of 5 kg in place of the specimen" in blocks["remarks"][0]
    assert blocks.select("Re K* [N/m]", "K2 [N/m]", "TR predicted [1]").null_count().row(0) == (16, 16, 16)
    np.testing.assert_allclose(blocks["TR measured [1]"], 1.0, atol=1e-3)  # the gains found make it one
    found = errors(study, folder)
    assert np.median(found["Re K* [N/m]"]) < 1e-3
    assert max(found[std].max() for _, _, std in PAIRS) < 5.0
    alone = analyse(folder, route="mobility", cache=tmp_path / "cache").dynamic.filter(pl.col("tyre") == "")
    assert set(alone["verdict"]) == {"warning"}
    assert "serves the joint route only" in alone["remarks"][0]


# -- what the data allow ---------------------------------------------------------------------------------------------


def test_without_v2_it_is_the_mobility_route_and_says_so(noisy):
    text = (noisy.path / "campaign.toml").read_text()
    kept = [line for line in text.splitlines() if not line.startswith("motion_out")]
    (noisy.path / "campaign.toml").write_text("\n".join(kept))
    study = noisy.analyse()
    assert study.route == "mobility"
    assert set(study.dynamic["route"]) == {"mobility"}
    assert study.notes[0].startswith("no V2 is stated, so the rig cannot be checked")
    assert study.dynamic.equals(noisy.analyse(route="mobility").dynamic)


def test_where_v2_is_missing_in_some_tests_the_others_still_serve(noisy):
    noisy.change("D2", lambda table: table.drop("V2"))
    study = noisy.analyse()
    assert set(study.dynamic["route"]) == {"joint"}
    row = study.dynamic.row(1, named=True)
    assert row["verdict"] == "warning"
    assert row["TR predicted [1]"] is not None
    assert study.residuals.filter(pl.col("test") == "D2")["Re residual [N s/m]"].to_list() == [None]


def test_where_v2_is_missing_in_all_it_says_so(noisy):
    for test in ("D1", "D2", "D3", "D4"):
        noisy.change(test, lambda table: table.drop("V2"))
    study = noisy.analyse()
    assert set(study.dynamic["route"]) == {"mobility"}
    assert study.notes[0] == "[rig]: no test has a usable V2, so the rig cannot be checked: K* by the mobility route"


def test_a_specimen_of_a_bench_has_no_inertia_if_the_statement_is_complete(bench):
    bench.rig = '[rig]\noutput = "blocked"\n'
    bench.dynamic("D1", blocked=True)
    toml = bench.write() / "campaign.toml"
    assert analyse(bench.path).dynamic["K* of"].to_list() == ["springs"]
    toml.write_text(toml.read_text().replace('"zero"', '"table"'))
    assert analyse(bench.path).dynamic["K* of"].to_list() == ["driving point"]


def test_a_blocked_rig_says_so(bench):
    bench.rig = '[rig]\noutput = "blocked"\n'
    bench.dynamic("D1", blocked=True)
    study = bench.analyse()
    assert study.dynamic["route"].to_list() == ["mobility"]
    assert "the output is blocked" in study.notes[0]


def test_one_test_is_as_stated_and_says_so(noisy):
    rows = (noisy.path / "tests.csv").read_text().splitlines()
    (noisy.path / "tests.csv").write_text("\n".join(rows[:3]) + "\n")
    study = noisy.analyse()
    assert study.dynamic["route"].to_list() == ["joint"]
    assert study.notes[0] == "[rig]: one test only: rig and channels are taken as you stated them"


@pytest.mark.sampled(2)
def test_each_rig_is_found_by_itself(tmp_path):
    """Two rigs of one campaign, and the same as two campaigns."""
    folder = simulated(tmp_path / "one", seed=4, preloads=[1000.0])
    text = (folder / "campaign.toml").read_text()
    rig = text[text.index("[rig]") : text.index("[channels]")]
    both = rig.replace("[rig]", "[rigs.north]") + rig.replace("[rig]", "[rigs.south]")
    (folder / "campaign.toml").write_text(text.replace(rig, both))
    rows = (folder / "tests.csv").read_text().splitlines()
    named = [rows[0] + ",rig", *(f"{row},{'north' if i % 2 else 'south'}" for i, row in enumerate(rows[1:]))]
    (folder / "tests.csv").write_text("\n".join(named) + "\n")
    study = analyse(folder, cache=tmp_path / "cache")
    assert [rig.rig for rig in study.rigs] == ["north", "south"]
    assert study.rig["rig"].unique(maintain_order=True).to_list() == ["north", "south"]
    (folder / "tests.csv").write_text(
        "\n".join([named[0], *(row for row in named[1:] if row.endswith("south"))]) + "\n"
    )
    alone = analyse(folder, cache=tmp_path / "cache").dynamic
    mine = study.dynamic.filter(pl.col("rig") == "south")
    assert mine.select("Re K* [N/m]", "C [N s/m]").equals(alone.select("Re K* [N/m]", "C [N s/m]"))


def test_a_calibration_that_cannot_be_one_is_a_row_that_says_why(noisy):
    rows = (noisy.path / "tests.csv").read_text().splitlines()
    rows[0] += ",added_mass [kg]"
    rows[1:] = [row + "," for row in rows[1:]]
    rows[3] = rows[3].replace(",dynamic,", ",calibration,")
    (noisy.path / "tests.csv").write_text("\n".join(rows) + "\n")
    row = noisy.analyse().dynamic.row(1, named=True)
    assert row["verdict"] == "rejected"
    assert "leave the column 'tyre' blank" in row["remarks"]
    assert "the mass in place of the specimen is not stated" in row["remarks"]


# -- the order, the files --------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
def test_the_order_of_the_tests_does_not_matter(rough, tmp_path):
    folder, study = rough
    other = shutil.copytree(folder, tmp_path / "other")
    rows = (folder / "tests.csv").read_text().splitlines()
    (other / "tests.csv").write_text("\n".join([rows[0], *rows[:0:-1]]) + "\n")
    both = study.dynamic.join(analyse(other, cache=other / "cache").dynamic, on="test", suffix=" turned")
    for column in ("Re K* [N/m]", "Im K* [N/m]", "u(Re K*) [N/m]", "C [N s/m]"):
        np.testing.assert_allclose(both[f"{column} turned"], both[column], rtol=1e-6)


def test_what_is_written_is_read_back(rough, tmp_path):
    _, study = rough
    read = read_results(study.write(tmp_path / "results"))
    for name in ("rig", "residuals", "budget"):
        kept, again = getattr(study, name), getattr(read, name)
        assert again.columns == kept.columns
        blank = pl.col(pl.String).fill_null("")
        assert again.with_columns(blank).equals(kept.with_columns(blank))
    assert read.rigs == study.rigs
    assert read.record["joint"] == json.loads(json.dumps(study.record["joint"]))


def test_a_run_by_another_route_leaves_no_old_tables(noisy, tmp_path):
    noisy.analyse().write(tmp_path / "results")
    assert (tmp_path / "results" / "rig.csv").exists()
    assert (tmp_path / "results" / "residuals.csv").exists()
    noisy.analyse(route="mobility").write(tmp_path / "results")
    assert not (tmp_path / "results" / "rig.csv").exists()
    assert not (tmp_path / "results" / "residuals.csv").exists()
    assert (tmp_path / "results" / "budget.csv").exists()


# -- where uncertainty is not normal ---------------------------------------------------------------------------------


def test_intervals_are_drawn_where_linear_propagation_fails(bench):
    """Sensors of 1 % at an arm that is a small part of K*: K2 and C are skew, and said in quantiles."""
    for role in ("force_in", "motion_in", "motion_out"):
        bench.channels[role] = bench.channels[role].replace("exact = true", 'std_gain = 0.05, std_phase = "3 deg"')
    bench.columns = (*bench.columns, "u(K1) [N/m]")
    bench.dynamic("D1", "1000,110000,1000")
    for route in ("joint", "mobility"):
        study = bench.analyse(route=route)
        rows = {row["quantity"]: row for row in study.quantiles.rows(named=True)}
        assert set(rows) == {"K2", "C"}
        for row in rows.values():
            assert row["2.5 %"] < row["50 %"] < (row["97.5 %"] if row["97.5 %"] is not None else np.inf)
        assert study.quantiles.equals(bench.analyse(route=route).quantiles)
        assert bench.analyse(route=route, monte_carlo=0).quantiles.height == 0


@pytest.mark.parametrize("route", ["joint", "mobility", "relative", "transmissibility"])
def test_k2_is_not_exact_where_its_first_derivative_vanishes(bench, route):
    """K' - K1 = K'' at 17.9 Hz, so that dK2/dK1 = 0; K1 is known to 2 %, the rest is exact."""
    bench.columns = (*bench.columns, "u(K1) [N/m]")
    frequency = bench.k2 / (2 * np.pi * bench.c)
    bench.dynamic("D1", "1000,110000,2200", frequency=frequency)
    study = bench.analyse(route=route)
    row = study.dynamic.row(0, named=True)
    stiffness = row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]
    drawn = row["K1 [N/m]"] + row["u(K1) [N/m]"] * np.random.default_rng(1982).standard_normal(100_000)
    k2, c = maxwell_arm(stiffness, drawn, 2 * np.pi * row["frequency [Hz]"])
    assert row["u(K2) [N/m]"] > 0.75 * np.std(k2)
    assert row["u(C) [N s/m]"] > 0.75 * np.std(c)
    # the square of a normal deviation: both ends of its interval are above the value, and the table has them
    ends = study.quantiles.filter(quantity="K2").row(0, named=True)
    assert [ends["2.5 %"], ends["97.5 %"]] == pytest.approx(np.quantile(k2, [0.025, 0.975]), rel=1e-3)
    of_k2 = study.budget.filter(quantity="K2")
    assert np.sqrt((of_k2["u"] ** 2).sum()) == pytest.approx(row["u(K2) [N/m]"], rel=1e-9)
    assert dict(of_k2.select("source", "share [1]").rows())["K1 stated"] > 0.99


def test_k2_and_c_scatter_as_stated_where_k1_and_k_star_are_drawn(rough):
    """Every row: K', K'' and K1 normal with their stated uncertainties give at most 4/3 of u(K2) and of u(C)."""
    _, study = rough
    rng = np.random.default_rng(1982)
    for row in study.dynamic.rows(named=True):
        storage, loss = row["u(Re K*) [N/m]"], row["u(Im K*) [N/m]"]
        cross = row["corr(Re,Im K*) [1]"] * storage * loss
        off = rng.multivariate_normal([0.0, 0.0], [[storage**2, cross], [cross, loss**2]], 20_000)
        k1 = row["K1 [N/m]"] + row["u(K1) [N/m]"] * rng.standard_normal(20_000)
        stiffness = row["Re K* [N/m]"] + off[:, 0] + 1j * (row["Im K* [N/m]"] + off[:, 1])
        k2, c = maxwell_arm(stiffness, k1, 2 * np.pi * row["frequency [Hz]"])
        assert row["u(K2) [N/m]"] > 0.75 * np.std(k2), row["test"]
        assert row["u(C) [N s/m]"] > 0.75 * np.std(c), row["test"]


@pytest.mark.sampled(3)
def test_an_inverted_v2_beside_a_weighed_mass_is_named_and_no_row_is_used(tmp_path):
    """The search for each test's own departure is lost there: its steps must stay numbers."""
    made = simulate_campaign(
        tmp_path, seed=3, pressures=[135e3, 205e3], preloads=[1000.0, 2000.0], frequencies=[10.0, 14.0, 18.0, 24.0],
        added_masses=(0.0, 10.0),
    )  # fmt: skip
    invert_v2(made.folder)
    found = analyse(made.folder)
    assert set(found.dynamic["verdict"]) == {"rejected"}
    assert any("V2 with its sign inverted" in note for note in found.notes)
