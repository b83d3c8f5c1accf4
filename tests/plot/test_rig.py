"""The figures on rig, sensors and uncertainty show what their tables say."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.plot.conftest import results_of
from tests.plot.rig_found import MASSED, MISFIT, UNSTATED, VALUES, rig_table, with_rig_found
from tests.plot.test_figures import points, said, texts

from fourpole.plot import THEMES, Style, draw, figure_data, render
from fourpole.plot.data import Role, Tone
from fourpole.virtual import RADIAL_PLY

pytestmark = pytest.mark.thorough

KEYS = ("rig-found", "rig-residual", "mass-gain", "budget")


@pytest.fixture(scope="module")
def small():
    return results_of(pressures=(170e3,), preloads=(1000.0,))


def every(panel, *roles):
    return [one for one in panel.series if one.role in roles]


def rows_of(panel):
    """The points of a panel of names by the name of their row."""
    return {panel.names[round(one.y[0])]: one for one in every(panel, Role.POINTS)}


# ---- what the rig leaves


def test_the_residual_is_that_of_the_table_in_real_and_imaginary_part(small):
    data = figure_data(small, "rig-residual")
    rows = {row["test"]: row for row in small.residuals.rows(named=True)}
    for panel, part in zip(data.panels, ("Re", "Im"), strict=True):
        assert panel.y.label == f"{part} (F1/V2 − Zr) [N s/m]"
        found = [(test, *values) for one in every(panel, Role.POINTS)
                 for test, *values in zip(one.tests, one.x, one.y, one.spread, strict=True)]  # fmt: skip
        assert sorted(test for test, *_ in found) == sorted(rows)
        for test, x, y, std in found:
            row = rows[test]
            assert (x, y, std) == (row["frequency [Hz]"], row[f"{part} residual [N s/m]"], row[f"u({part}) [N s/m]"])
    assert "as stated: χ²/dof = 1.04" in " ".join(data.notes)
    assert "does not fit" not in " ".join(data.notes)


def test_a_misfit_is_drawn_with_the_rig_as_stated(small):
    # A rig that is stated 1 kg too light: what is left of it is -j omega.
    light = {"": {**small.record["stated"]["rigs"][""], "moving_mass": {"value": 14.0}}}
    hurt = with_rig_found(small, route="mobility", **MISFIT)
    hurt = replace(hurt, record={**hurt.record, "stated": {"rigs": light}})
    real, imaginary = figure_data(hurt, "rig-residual").panels
    (line,) = [one for one in imaginary.series if one.tone is Tone.ALARM]
    np.testing.assert_allclose(line.y, 2 * np.pi * line.x * 1.0, rtol=1e-9)
    (other,) = [one for one in real.series if one.tone is Tone.ALARM]
    np.testing.assert_allclose(other.y, 0.0, atol=1e-9)
    figure = draw(hurt, "rig-residual")
    assert figure.axes[1].get_ylim()[1] > line.y.max()
    assert "χ²/dof = 10" in said(figure)
    assert "does not fit" in said(figure)
    assert "mean with rig and sensors as stated" in texts(figure)


def test_each_added_mass_has_a_marker_and_a_tyre_its_colour(small):
    masses = [0.0, 10.0]
    results = replace(
        small,
        residuals=small.residuals.with_columns(pl.Series("added mass [kg]", [masses[at % 2] for at in range(12)])),
    )
    points = every(figure_data(results, "rig-residual").panels[0], Role.POINTS)
    assert {(one.marker, one.hollow, one.tyre) for one in points} == {
        (mass, bool(mass), tyre) for mass in (0, 1) for tyre in (0, 1)
    }
    assert {"0 kg added", "10 kg added"} <= set(texts(draw(results, "rig-residual")))


def test_an_outlier_is_a_cross_that_sets_no_axis(small):
    far = pl.when(pl.col("test") == "D3").then(900.0)
    rows = small.residuals.with_columns(
        far.otherwise(pl.col("Re residual [N s/m]")).alias("Re residual [N s/m]"),
        far.otherwise(pl.col("outlier [1]")).alias("outlier [1]"),
    )
    figure = draw(replace(small, residuals=rows), "rig-residual")
    assert len(points(figure.axes[0], "_rejected")) == 1
    assert figure.axes[0].get_ylim()[1] < 1.0
    assert "(F1/V2 − Zr) of 1 outlier beyond the axes" in said(figure)
    assert "outlier" in texts(figure)
    assert "an outlier is a test that does not go with the others" in said(figure)


def test_tests_without_v2_are_counted(small):
    blank = pl.when(pl.col("test") == "D1").then(None).otherwise(pl.col("Re residual [N s/m]"))
    rows = small.residuals.with_columns(blank.alias("Re residual [N s/m]"))
    assert "1 test has no F1 or no V2" in said(draw(replace(small, residuals=rows), "rig-residual")).replace(
        "Test", "test"
    )


# ---- the shared values


def test_values_stand_as_far_from_their_statement_as_the_table_says(small):
    (panel,) = figure_data(small, "rig-found").panels
    assert panel.names == ("rig", "moving mass m", "preload spring K3", "channels", "gain F1", "gain V1", "phase V1",
                           "gain V2", "ratios that K* needs", "gain F1/V1")  # fmt: skip
    assert [panel.names[at] for at in panel.heads] == ["rig", "channels", "ratios that K* needs"]
    dots = rows_of(panel)
    for name, (_, stated, prior, found, *_rest) in VALUES.items():
        shown = {"moving_mass": "moving mass m", "preload_stiffness": "preload spring K3"}.get(name, name)
        assert dots[shown].x[0] == pytest.approx((found - stated) / (2 * prior))
    wide = {one.y[0]: one.across[0] for one in every(panel, Role.RANGE)}
    assert wide[1] == pytest.approx(0.1)
    assert dict(zip(panel.names, panel.beside, strict=True))["moving mass m"] == "0.1"
    assert {"0.1", "0.3", "1"} <= set(texts(draw(small, "rig-found")))


def test_findings_differ_in_mark_and_colour_and_a_far_one_is_told(small):
    far = ("kg", 15.0, 0.01, 15.81, 0.81, 81.0, None, "contradicted")
    values = {**VALUES, "moving_mass": far, "preload_stiffness": (*VALUES["preload_stiffness"][:7], "not calibrated")}
    results = replace(small, rig=rig_table(values))
    dots = rows_of(figure_data(results, "rig-found").panels[0])
    assert len({(one.marker, one.tone, one.hollow) for one in dots.values()}) == 4
    assert dots["moving mass m"].texts == ("+41",)
    figure = draw(results, "rig-found")
    assert max(abs(end) for end in figure.axes[0].get_xlim()) < 8
    assert {"contradicts the statement", "found", "not determined: as stated", "+41"} <= set(texts(figure))


def test_what_nobody_stated_is_written_with_its_size(small):
    """There is no statement that it could be drawn against."""
    results = replace(small, rig=rig_table({**VALUES, **UNSTATED}))
    (panel,) = figure_data(results, "rig-found").panels
    assert panel.names[-3:] == ("specimens", "drift of radial", "δ drift of radial")
    dots = rows_of(panel)
    for name, words in (
        ("unstated frame", "+1.1e−05 ± 6e−07 m/N"),
        ("cross-talk V2 in F1", "+1.2 ± 0.1 %"),
        ("drift of radial", "−2.1 ± 0.2 %"),
        ("δ drift of radial", "+0.201 ± 0.023 °"),
    ):
        assert dots[name].texts == (words,)
    assert "not stated: size as written" in texts(draw(results, "rig-found"))


def test_two_rigs_have_a_panel_each(small):
    rig = pl.concat([rig_table(VALUES, "old"), rig_table(MASSED, "new <b>")])
    figure = draw(replace(small, rig=rig), "rig-found")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["rig old", "rig new <b>"]
    assert b"<b>" not in render(figure, "rig-found")


# ---- what a mass gained, and the budget


def test_the_gain_of_a_mass_stands_beside_its_points(small):
    (panel,) = figure_data(small, "mass-gain").panels
    assert [float(one.x[0]) for one in panel.series] == pytest.approx([11.2, 0.074, 17.2, 0.08])
    shown = [one.texts[0] for one in panel.series]
    assert shown[0] == "11 %"
    assert shown[1].startswith("0.074 %, ")
    assert shown[1].endswith("times smaller")
    assert draw(with_rig_found(small, gain_of_masses={}), "mass-gain") is None
    assert draw(with_rig_found(small, gain_of_masses="no table"), "mass-gain") is None


def medians(results, quantity=0):
    """The shares [%] of the sources of the first specimen by name, as the figure has them."""
    panel = figure_data(results, "budget").panels[quantity]
    points = next(one for one in panel.series if one.role is Role.POINTS)
    return {panel.names[round(y)]: float(x) for x, y in zip(points.x, points.y, strict=True)}


def test_the_budget_has_the_shares_of_the_table_the_largest_first(small):
    data = figure_data(small, "budget")
    assert [panel.title for panel in data.panels] == ["K2", "C", "K'", "K''"]
    assert {panel.x.label for panel in data.panels} == {"share of the variance [%]"}
    expected = {"K1 branch gap": 50.0, "sensor noise": 30.0, "gain V1": 15.0, "moving mass m": 5.0}
    assert medians(small) == pytest.approx(expected)
    assert list(medians(small)) == list(expected)
    assert data.keyed == (0, 1)


def test_small_sources_go_together_and_rejected_tests_do_not_count(small):
    results = with_rig_found(small, shares={"gain V1": 0.955} | {f"source {at}": 0.005 for at in range(9)})
    assert medians(results) == pytest.approx({"gain V1": 95.5, "9 others": 4.5})
    hurt = results.dynamic.with_columns(pl.when(pl.col("tyre") == "cross-ply").then(pl.lit("rejected"))
                                        .otherwise(pl.col("verdict")).alias("verdict"))  # fmt: skip
    data = figure_data(replace(results, dynamic=hurt), "budget")
    assert {one.tyre for panel in data.panels for one in panel.series} == {1}


def test_five_tyres_are_taken_together():
    tyres = [RADIAL_PLY.__class__(**{**vars(RADIAL_PLY), "name": f"tyre {at}"}) for at in range(5)]
    data = figure_data(results_of(tyres=tyres, pressures=(170e3,), preloads=(1000.0,)), "budget")
    assert {one.tyre for panel in data.panels for one in panel.series} == {-1}
    assert "tests of all 5 specimens together" in data.notes


@pytest.mark.parametrize("key", KEYS)
def test_nothing_but_numbers_that_are_none_is_drawn_all_the_same(small, key):
    nan = float("nan")
    rows = {name: (*cells[:3], nan, nan, None, None, "not determined") for name, cells in VALUES.items()}
    results = replace(
        small,
        rig=rig_table(rows),
        residuals=small.residuals.with_columns(pl.lit(float("nan")).alias("u(Re) [N s/m]")),
        budget=small.budget.with_columns(pl.lit(float("nan")).alias("share [1]")),
        record={**small.record, "joint": {"": {"chi2": "many", "dof": None}}},
    )
    figure = draw(results, key)
    assert (figure is None) == (key in {"mass-gain", "budget"})


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.sampled(4)
def test_they_are_drawn_on_each_paper_and_stay_light(study, key, theme):
    svg = render(draw(study, key, Style(theme)), key, style=Style(theme))
    assert THEMES[theme].paper.encode() in svg
    assert len(svg) < 250_000


@pytest.mark.sampled(2)
def test_a_fine_sweep_stays_light():
    many = results_of(tyres=(RADIAL_PLY,), pressures=(100e3, 170e3), frequencies=[8.0 * 1.03**at for at in range(60)])
    for key in ("budget", "rig-residual"):
        assert len(render(draw(many, key), key)) < 250_000
