"""The figures on rig, sensors and uncertainty show what their tables say."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from matplotlib.colors import to_hex
from tests.plot.conftest import results_of
from tests.plot.rig_found import MASSED, MISFIT, UNSTATED, VALUES, rig_table, with_rig_found
from tests.plot.test_figures import lines, points, said, texts

from fourpole.plot import THEMES, Style, draw, figure_data, render
from fourpole.plot.data import Role
from fourpole.virtual import RADIAL_PLY

pytestmark = pytest.mark.thorough

KEYS = ("rig-found", "rig-residual", "mass-gain", "budget")


@pytest.fixture(scope="module")
def small():
    return results_of(pressures=(170e3,), preloads=(1000.0,))


def polygons(ax):
    """Stacked parts by source: height at each frequency [%]."""
    found = {}
    for part in ax.collections:
        if part.get_label().startswith("_"):
            low_high = part.get_paths()[0].get_extents()
            found[part.get_label()[1:]] = (low_high.y0, low_high.y1)
    return found


# ---- what the rig leaves


def test_the_residual_is_that_of_the_table_in_real_and_imaginary_part(small):
    real, imaginary = draw(small, "rig-residual").axes
    rows = small.residuals
    for ax, part in ((real, "Re"), (imaginary, "Im")):
        drawn = points(ax)
        expected = np.column_stack([rows["frequency [Hz]"], rows[f"{part} residual [N s/m]"]])
        np.testing.assert_allclose(drawn[np.lexsort(drawn.T)], expected[np.lexsort(expected.T)], rtol=1e-12)
        bars = points(ax, "_bars")
        heights = np.ptp(bars[np.isfinite(bars[:, 1]), 1].reshape(-1, 2), axis=1)
        np.testing.assert_allclose(heights, 2 * rows[f"u({part}) [N s/m]"][0])
        assert f"{part} (F1/V2 − Zr) [N s/m]" == ax.get_ylabel()
    assert "χ²/dof = 1.04" in real.get_title(loc="left")
    assert "does not fit" not in said(draw(small, "rig-residual"))


def test_a_misfit_is_drawn_with_the_rig_as_stated(small):
    # A rig that is stated 1 kg too light: what is left of it is -j omega.
    light = {"": {**small.record["stated"]["rigs"][""], "moving_mass": {"value": 14.0}}}
    hurt = with_rig_found(small, route="mobility", **MISFIT)
    hurt = replace(hurt, record={**hurt.record, "stated": {"rigs": light}})
    figure = draw(hurt, "rig-residual")
    real, imaginary = figure.axes
    assert "does not fit" in real.get_title(loc="left")
    assert "χ²/dof = 10" in real.get_title(loc="left")
    (line,) = lines(imaginary, "_misfit")
    x, y = line.get_data()
    np.testing.assert_allclose(y, 2 * np.pi * x * 1.0, rtol=1e-9)
    np.testing.assert_allclose(lines(real, "_misfit")[0].get_ydata(), 0.0, atol=1e-9)
    assert imaginary.get_ylim()[1] > y.max()
    assert "does not fit" in said(figure)
    assert "mean with rig and sensors as stated" in texts(figure)


def test_each_added_mass_has_a_marker_and_a_tyre_its_colour(small):
    masses = [0.0, 10.0]
    results = replace(
        small,
        residuals=small.residuals.with_columns(pl.Series("added mass [kg]", [masses[at % 2] for at in range(12)])),
    )
    figure = draw(results, "rig-residual")
    marks = {(line.get_marker(), to_hex(line.get_color())) for line in lines(figure.axes[0], "_points")}
    assert marks == {(mark, to_hex(Style().colour(tyre))) for mark in "o^" for tyre in (0, 1)}
    assert {"0 kg added", "10 kg added"} <= set(texts(figure))


def test_an_outlier_is_a_cross_that_sets_no_axis(small):
    far = pl.when(pl.col("test") == "D3").then(900.0)
    rows = small.residuals.with_columns(
        far.otherwise(pl.col("Re residual [N s/m]")).alias("Re residual [N s/m]"),
        far.otherwise(pl.col("outlier [1]")).alias("outlier [1]"),
    )
    figure = draw(replace(small, residuals=rows), "rig-residual")
    assert len(points(figure.axes[0], "_rejected")) == 1
    assert figure.axes[0].get_ylim()[1] < 1.0
    assert "real part of 1 outlier lies beyond the axes" in said(figure)
    assert "test that does not go with the others" in texts(figure)


def test_tests_without_v2_are_counted(small):
    blank = pl.when(pl.col("test") == "D1").then(None).otherwise(pl.col("Re residual [N s/m]"))
    rows = small.residuals.with_columns(blank.alias("Re residual [N s/m]"))
    assert "1 test has no F1 or no V2" in said(draw(replace(small, residuals=rows), "rig-residual")).replace(
        "Test", "test"
    )


# ---- the shared values


def test_values_stand_as_far_from_their_statement_as_the_table_says(small):
    (ax,) = draw(small, "rig-found").axes
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert labels == ["rig", "moving mass m", "preload spring K3", "channels", "gain F1", "gain V1", "phase V1",
                      "gain V2", "ratios that K* needs", "gain F1/V1"]  # fmt: skip
    dots = {round(y): x for line in lines(ax, "_value") for x, y in line.get_xydata()}
    for name, (_, stated, prior, found, *_rest) in VALUES.items():
        at = labels.index({"moving_mass": "moving mass m", "preload_stiffness": "preload spring K3"}.get(name, name))
        assert dots[at] == pytest.approx((found - stated) / prior)
    whiskers = {line.get_ydata()[0]: np.ptp(line.get_xdata()) / 2 for line in lines(ax, "_found")}
    assert whiskers[1] == pytest.approx(0.1)
    assert {text.get_text() for text in ax.texts} >= {"0.1", "0.3", "1"}


def test_findings_differ_in_mark_and_colour_and_a_far_one_is_told(small):
    far = ("kg", 15.0, 0.01, 15.81, 0.81, 81.0, None, "contradicted")
    values = {
        **VALUES,
        "moving_mass": far,
        "preload_stiffness": (*VALUES["preload_stiffness"][:7], "not calibrated"),
    }
    figure = draw(replace(small, rig=rig_table(values)), "rig-found")
    (ax,) = figure.axes
    marks = {(line.get_marker(), to_hex(line.get_markerfacecolor())) for line in lines(ax, "_value")}
    assert len(marks) == 4
    assert "+81" in texts(figure)
    assert max(abs(end) for end in ax.get_xlim()) < 7
    assert {"contradicts the statement", "found", "not determined: as stated"} <= set(texts(figure))


def test_what_nobody_stated_is_written_with_its_size(small):
    """There is no statement that it could be drawn against."""
    figure = draw(replace(small, rig=rig_table({**VALUES, **UNSTATED})), "rig-found")
    (ax,) = figure.axes
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert labels[-3:] == ["specimens", "drift of radial", "loss angle drift of radial"]
    written = {round(text.get_position()[1]): text.get_text() for text in ax.texts}
    for name, words in (
        ("unstated frame", "+1.1e−05 ± 3e−07 m/N"),
        ("cross-talk V2 in F1", "+1.2 ± 0.05 %"),
        ("drift of radial", "−2.1 ± 0.1 %"),
        ("loss angle drift of radial", "+0.0035 ± 0.0002 rad"),
    ):
        assert written[labels.index(name)] == words
    assert "not stated: size as written" in texts(figure)


def test_two_rigs_have_a_panel_each(small):
    rig = pl.concat([rig_table(VALUES, "old"), rig_table(MASSED, "new <b>")])
    figure = draw(replace(small, rig=rig), "rig-found")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["rig old", "rig new <b>"]
    assert b"<b>" not in render(figure, "rig-found")


# ---- what a mass gained, and the budget


def test_the_gain_of_a_mass_stands_beside_its_bars(small):
    (ax,) = draw(small, "mass-gain").axes
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([5.6, 0.037, 8.6, 0.04])
    shown = [text.get_text() for text in ax.texts]
    assert shown[0] == "5.6 %"
    assert shown[1].startswith("0.037 %, ")
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
def test_they_are_drawn_on_each_paper_and_stay_light(study, key, theme):
    svg = render(draw(study, key, Style(theme)), key, style=Style(theme))
    assert THEMES[theme].paper.encode() in svg
    assert len(svg) < 250_000


def test_a_fine_sweep_stays_light():
    many = results_of(tyres=(RADIAL_PLY,), pressures=(100e3, 170e3), frequencies=[8.0 * 1.03**at for at in range(60)])
    for key in ("budget", "rig-residual"):
        assert len(render(draw(many, key), key)) < 250_000
