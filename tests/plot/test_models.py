"""The figures of models and maps show what model.json, map.json and the table say."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from matplotlib.colors import to_hex
from tests.plot.conftest import empty_results, renamed, results_of
from tests.plot.modelled import edited, elastomer, named, study_with_models, with_models
from tests.plot.test_figures import in_order, lines, points, said, texts

from fourpole.fitting.modelfile import ToleranceFile, map_of
from fourpole.fitting.query import response
from fourpole.models.families import model_named
from fourpole.plot import Style, draw, figure_data, render
from fourpole.plot.data import Role
from fourpole.plot.part import Selection, select
from fourpole.plot.sheet import read_sheet
from fourpole.plot.states import _rows, whitened

pytestmark = pytest.mark.thorough

KEYS = ("storage-loss", "model-choice", "map")
TWO_SIDED_95 = 1.959964
PLACES = [("cross-ply", "1000 N"), ("radial-ply", "1000 N"), ("cross-ply", "2000 N"), ("radial-ply", "2000 N")]


@pytest.fixture(scope="module")
def fitted():
    return study_with_models()


@pytest.fixture(scope="module")
def tried():
    """One condition of one tyre, with every model tried on it."""
    return with_models(results_of(pressures=(170e3,), preloads=(1000.0,)), "auto", maps=False)


def rows_of(results, tyre, preload):
    return results.dynamic.filter((pl.col("tyre") == tyre) & (pl.col("preload [N]") == preload))


def bands(ax):
    """Vertices of the bands, (M, 2) each."""
    return [one.get_paths()[0].vertices for one in ax.collections if one.get_label() == "_band"]


# ---- the model through the data


def series(part, role):
    return [one for one in part.series if one.role is role]


def column(data, at):
    """The panels of one specimen from the top down."""
    return data.panels[at :: data.columns]


def test_each_tyre_has_its_points_and_a_line_for_each_condition(fitted):
    data = figure_data(fitted, "storage-loss")
    assert [one.title for one in data.panels[:2]] == ["cross-ply", "radial-ply"]
    assert [one.y.label for one in column(data, 0)] == [
        "K' [kN/m]",
        "K'' [kN/m]",
        "residual K' [1]",
        "residual K'' [1]",
    ]
    for at, tyre in enumerate(("cross-ply", "radial-ply")):
        rows = fitted.dynamic.filter(pl.col("tyre") == tyre)
        for part, (head, scale) in zip(column(data, at), (("Re K* [N/m]", 1e-3), ("Im K* [N/m]", 1e-3)), strict=False):
            points = series(part, Role.POINTS)
            found = np.concatenate([np.column_stack([one.x, one.y]) for one in points])
            expected = np.column_stack([rows["frequency [Hz]"], rows[head] * scale])
            np.testing.assert_allclose(in_order(found), in_order(expected), rtol=1e-12)
            assert len(series(part, Role.MODEL)) == 6  # three pressures at two preloads


def test_the_line_is_the_models_and_its_band_holds_95_percent(fitted):
    entry = fitted.models.models[0]
    one = entry.conditions[0]
    line = series(figure_data(fitted, "storage-loss").panels[0], Role.MODEL)[0]
    assert (line.x[0], line.x[-1]) == pytest.approx(one.band)
    truth = model_named(entry.model).stiffness(one.values, 2 * np.pi * line.x)
    np.testing.assert_allclose(line.y, truth.real * 1e-3, rtol=1e-12)
    _, covariance = response(entry, 0, line.x)
    np.testing.assert_allclose(line.spread, TWO_SIDED_95 * 1e-3 * np.sqrt(covariance[:, 0, 0]), rtol=1e-6)
    # The model discrepancy is in the band.
    assert np.all(line.spread > TWO_SIDED_95 * entry.discrepancy * line.y)


def test_what_is_drawn_is_the_line_with_its_band(fitted):
    """The curve is drawn through fewer points than it has; between these it is off by no more than the eye sees."""
    data = figure_data(fitted, "storage-loss")
    one, ax = series(data.panels[0], Role.MODEL)[0], draw(fitted, "storage-loss").axes[0]
    (drawn, *_) = lines(ax, "_model")
    reach = np.ptp(ax.get_ylim())
    np.testing.assert_allclose(np.interp(one.x, *drawn.get_data()), one.y, atol=1e-3 * reach)
    assert drawn.get_xdata().size < one.x.size
    low = bands(ax)[0][:, 1].min()
    assert low == pytest.approx(float((one.y - one.spread).min()), abs=1e-3 * reach)


def test_residuals_are_white():
    covariance = np.array([[4.0, 1.5], [1.5, 9.0]])
    turned = whitened(np.eye(2), np.stack([covariance, covariance])).T
    np.testing.assert_allclose(turned @ covariance @ turned.T, np.eye(2), atol=1e-12)
    # Each stays nearest to its own: the map is symmetric in standard units.
    scaled = turned @ np.diag([2.0, 3.0])
    np.testing.assert_allclose(scaled, scaled.T, atol=1e-12)


def test_what_the_model_leaves_is_in_standard_uncertainties_of_both():
    """On K* that the model made, with 1 % of noise that is stated, all but a few are within two."""
    data = figure_data(elastomer(), "storage-loss")
    left = np.concatenate([one.y for part in data.panels[2:] for one in series(part, Role.POINTS)])
    assert left.size == 80
    # Mean square of 80 values of variance 1, less 4 parameters and what the model's own uncertainty adds.
    assert np.mean(left**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 80))
    outside = int(np.sum(np.abs(left) > 2))
    assert f"{outside} of 80 are beyond ±2" in " ".join(data.notes)
    assert [one.y[0] for one in series(data.panels[2], Role.LINE)] == [0.0, -2.0, 2.0]


def test_a_table_without_tyre_and_tests_is_drawn_over_decades():
    figure = draw(elastomer(), "storage-loss")
    assert len(figure.axes) == 4
    assert figure.axes[0].get_title(loc="left") == "fractional"
    assert {ax.get_xscale() for ax in figure.axes} == {"log"}
    assert [ax.get_yscale() for ax in figure.axes] == ["log", "log", "linear", "linear"]
    line = series(figure_data(elastomer(), "storage-loss").panels[0], Role.MODEL)[0]
    np.testing.assert_allclose(np.diff(np.log(line.x)), np.log(1e7) / (line.x.size - 1), rtol=1e-6)
    marked = {text.get_text() for text in figure.axes[3].get_xticklabels()}
    assert {"0.01", "1", "1000"} <= marked
    assert not any("$" in text for text in marked)


def test_a_band_of_less_than_a_decade_is_linear(fitted):
    assert {ax.get_xscale() for ax in draw(fitted, "storage-loss").axes} == {"linear"}


def test_temperatures_are_written_at_their_curves():
    part = figure_data(elastomer((0.0, 20.0, 40.0)), "storage-loss").panels[0]
    assert [one.label for one in series(part, Role.MODEL)] == ["0 °C", "20 °C", "40 °C"]
    assert [one.x.size for one in series(part, Role.POINTS)] == [40, 40, 40]


def test_the_notes_name_the_model_and_its_discrepancy(fitted):
    entry = fitted.models.models[0]
    assert entry.discrepancy > 0
    told = " ".join(figure_data(fitted, "storage-loss").notes)
    assert f"zener (model discrepancy {100 * entry.discrepancy:.2g} %) of cross-ply" in told
    exact = figure_data(edited(fitted, discrepancy=0.0), "storage-loss")
    assert "model: zener" in exact.notes


@pytest.mark.parametrize(("absolute", "drawn"), [(0.0, False), (0.5, True)])
def test_the_tests_of_a_condition_lie_within_the_tolerance_of_its_own_axis(fitted, absolute, drawn):
    """A table without names of tests: its rows are found by the state."""
    dynamic = fitted.dynamic.with_columns(pl.lit(2.4).alias("camber [deg]"))
    sheet = read_sheet(replace(fitted, tables={**fitted.tables, "dynamic": dynamic}), texts_only=True)
    one = fitted.models.models[0].conditions[0].model_copy(update={"tests": []})
    file = fitted.models.model_copy(update={"axes": [ToleranceFile(column="camber [deg]", absolute=absolute)]})
    assert bool(_rows(one, {"camber [deg]": 2.0}, sheet, file).any()) is drawn


def test_of_a_test_with_several_points_those_in_the_band_are_drawn(fitted):
    """Three rows become points of one test; the third is rejected, and a fourth is beyond the band."""
    entry = fitted.models.models[0]
    state = entry.conditions[0]
    names = state.tests[:4]
    point = pl.col("test").replace_strict({name: at for at, name in enumerate(names, 1)}, default=1)
    dynamic = fitted.dynamic.with_columns(
        point.alias("point"),
        pl.when(pl.col("test") == names[2]).then(pl.lit("rejected")).otherwise("verdict").alias("verdict"),
        pl.when(pl.col("test") == names[3]).then(99.0).otherwise("frequency [Hz]").alias("frequency [Hz]"),
        pl.col("test").replace(dict.fromkeys(names, names[0])),
    )
    sheet = read_sheet(replace(fitted, tables={**fitted.tables, "dynamic": dynamic}), texts_only=True)
    one = state.model_copy(update={"tests": [names[0], *state.tests[4:]]})
    chosen = np.flatnonzero(_rows(one, {}, sheet, fitted.models))
    order = {name: at for at, name in enumerate(fitted.dynamic["test"].to_list())}
    assert chosen.tolist() == sorted(order[name] for name in (*names[:2], *state.tests[4:]))


@pytest.mark.sampled(2)
def test_a_tyre_keeps_its_colour(fitted):
    style = Style()
    for key in ("storage-loss", "map"):
        for ax in draw(fitted, key).axes:
            bar = lines(ax, "_tyre")
            at = ("cross-ply", "radial-ply").index(ax.get_title(loc="left")) if bar else None
            assert [to_hex(line.get_color()) for line in bar] == ([] if at is None else [to_hex(style.colour(at))])


def test_a_tyre_that_is_in_no_table_is_left_out(fitted):
    other = replace(fitted, models=named(fitted.models, {"cross-ply": "gone", "radial-ply": "radial-ply"}))
    data = figure_data(other, "storage-loss")
    assert [len(series(one, Role.MODEL)) for one in data.panels[:2]] == [0, 6]


# ---- which model, and why


@pytest.mark.sampled(4)
def test_candidates_stand_where_their_criteria_are(tried):
    entry = tried.models.models[0]
    panels = figure_data(tried, "model-choice").panels[:3]
    least = min(one.bic for one in entry.candidates)
    for panel, values in zip(
        panels,
        (
            [one.bic - least for one in entry.candidates],
            [one.chi2 / one.dof for one in entry.candidates],
            [one.cross_validation for one in entry.candidates],
        ),
        strict=True,
    ):
        found = [(float(one.x[0]), float(one.y[0])) for one in series(panel, Role.POINTS)]
        expected = [(value, at) for at, value in enumerate(values) if value is not None]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        assert panel.names == tuple(one.model for one in entry.candidates)
    missing = sum(one.cross_validation is None for one in entry.candidates)
    assert missing
    assert [text for text in panels[2].beside if text] == ["n"] * missing
    axes = draw(tried, "model-choice").axes
    assert axes[0].get_ylim()[0] > axes[0].get_ylim()[1]  # the best on top
    assert [ax.get_xlabel() for ax in axes[-3:]] == [panel.x.label for panel in panels]


def test_the_chosen_the_alike_and_the_non_causal_are_marked(tried):
    (entry,) = tried.models.models[:1]
    candidates = [one.model_copy(update={"causal": one.model != "kelvin"}) for one in entry.candidates]
    entry = entry.model_copy(update={"candidates": candidates})
    tried = replace(tried, models=tried.models.model_copy(update={"models": [entry, *tried.models.models[1:]]}))
    panel = figure_data(tried, "model-choice").panels[0]
    (best,) = [one for one in series(panel, Role.POINTS) if not one.hollow]
    assert entry.candidates[int(best.y[0])].model == entry.model
    assert best.tyre == 0
    triangles = [one for one in series(panel, Role.POINTS) if one.marker == 2]
    assert [entry.candidates[int(one.y[0])].model for one in triangles] == ["kelvin"]
    (alike,) = series(panel, Role.LINE)
    assert set(alike.x) == {6.0}
    figure = draw(tried, "model-choice")
    assert "not causal" in texts(figure)
    assert "BIC 6 above the best, up to which models are alike" in said(figure)


def test_a_model_that_was_asked_for_was_not_chosen(fitted):
    assert draw(fitted, "model-choice") is None


# ---- the map


@pytest.mark.parametrize(("row", "column", "scale"), [(0, "K2 [N/m]", 1e-3), (1, "C [N s/m]", 1.0)])
@pytest.mark.sampled(2)
def test_the_map_stands_beside_the_tests_of_its_frequencies(fitted, row, column, scale):
    figure = draw(fitted, "map")
    assert [(ax.get_title(loc="left"), ax.get_title(loc="right")) for ax in figure.axes[:4]] == PLACES
    assert "3 of 5 frequencies shown" in said(figure)
    near = pl.any_horizontal((pl.col("frequency [Hz]") - one).abs() < 0.1 for one in (10.0, 17.0, 24.0))
    for ax, (tyre, load) in zip(figure.axes[4 * row : 4 * row + 4], PLACES, strict=True):
        rows = rows_of(fitted, tyre, float(load.removesuffix(" N"))).filter(near)
        expected = np.column_stack([rows["pressure [Pa]"] * 1e-5, rows[column] * scale])
        np.testing.assert_allclose(in_order(points(ax)), in_order(expected), rtol=1e-12)
        assert len(lines(ax, "_model")) == 3
        assert ax.get_xlabel() == ("pressure [bar]" if row else "")


def test_a_curve_of_the_map_is_its_answer_with_its_95_percent(fitted):
    entry = fitted.maps.maps[0]
    curve = series(figure_data(fitted, "map").panels[0], Role.MODEL)[0]
    found = map_of(entry)
    frequency = max(found.band[0], 10.0 * (1 + 0.003 * np.sin(7.0)))
    points_ = np.column_stack([curve.x * 1e5, np.full(curve.x.size, 1000.0)])
    answer = found.ask(points_, np.full(curve.x.size, frequency))
    # The frequency is the median of a group of tests that run within 0.3 %.
    np.testing.assert_allclose(curve.y, answer.k2 * 1e-3, rtol=5e-3)
    np.testing.assert_allclose(curve.spread, TWO_SIDED_95 * 1e-3 * np.sqrt(answer.arm_covariance[:, 0, 0]), rtol=2e-2)


@pytest.mark.sampled(6)
def test_a_curve_ends_where_the_tests_do():
    whole = results_of(pressures=(100e3, 135e3, 170e3, 240e3), frequencies=(10.0, 17.0, 24.0))
    lacking = (pl.col("preload [N]") == 2000.0) & (pl.col("pressure [Pa]") > 150e3)
    results = with_models(replace(whole, dynamic=whole.dynamic.filter(~lacking)), "zener")
    for panel, load, end in zip(
        figure_data(results, "map").panels[::2], ("1000 N", "2000 N"), (2.4, 1.35), strict=False
    ):
        x = series(panel, Role.MODEL)[0].x
        assert (panel.title, panel.right) == ("cross-ply", load)
        assert x[0] == pytest.approx(1.0)
        # A step of the curve is a part in 40 of the pressures; along the slanting edge of the hull it may pass its
        # corner by what counts as the same preload.
        assert end - 1.4 / 40 <= x[-1] <= end + 0.02 * 0.7


def test_a_selected_specimen_has_its_map_alone(fitted):
    part = select(fitted, Selection(specimens=("radial-ply",), preloads=(2000.0,)))
    panels = figure_data(part, "map").panels
    assert [(one.title, one.right) for one in panels] == [("radial-ply", "2000 N"), ("", "")]
    assert {one.tyre for one in panels[0].series} == {1}


@pytest.mark.sampled(4)
def test_a_map_over_one_axis_is_a_curve_and_one_of_one_condition_none():
    one = with_models(results_of(preloads=(1000.0,), pressures=(100e3, 170e3, 240e3)), "zener")
    figure = draw(one, "map")
    assert [ax.get_title(loc="right") for ax in figure.axes[:2]] == ["", ""]
    assert len(figure.axes) == 4
    entries = [each.model_copy(update={"axes": [], "terms": [[]]}) for each in one.maps.maps]
    alone = one.maps.model_copy(update={"maps": entries})
    assert draw(replace(one, maps=alone), "map") is None


def test_a_map_that_is_not_causal_says_so(fitted):
    assert "model: zener" in figure_data(fitted, "map").notes
    entries = [one.model_copy(update={"causal": False}) for one in fitted.maps.maps]
    other = replace(fitted, maps=fitted.maps.model_copy(update={"maps": entries}))
    assert "model: zener (not causal)" in figure_data(other, "map").notes


def test_without_k2_the_map_shows_k_star():
    figure = draw(elastomer((0.0, 20.0, 40.0)), "map")
    assert [ax.get_ylabel() for ax in figure.axes] == ["K' [kN/m]", "K'' [kN/m]"]
    assert [ax.get_yscale() for ax in figure.axes] == ["log", "log"]
    assert figure.axes[1].get_xlabel() == "temperature [°C]"
    assert len(points(figure.axes[0])) == 3 * 3
    assert {"0.01 Hz", "100000 Hz"} <= set(texts(figure))
    assert "no K2 and C" in said(figure)


# ---- as every figure


@pytest.mark.parametrize("key", KEYS[1:])
def test_without_a_model_file_there_is_no_figure(fitted, key):
    assert draw(replace(fitted, models=None, maps=None), key) is None
    assert draw(empty_results(), key) is None
    none = fitted.models.model_copy(update={"models": []})
    assert draw(replace(fitted, models=none, maps=none), key) is None


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.sampled(3)
def test_every_axis_says_its_unit(fitted, tried, key):
    figure = draw(tried if key == "model-choice" else fitted, key)
    labels = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label]
    assert labels
    assert all(label.endswith("]") and "[" in label for label in labels), labels


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.sampled(3)
def test_key_and_notes_stay_off_the_panels(fitted, tried, key):
    """In print, the theme with the widest lines; themes differ in colours besides."""
    figure = draw(tried if key == "model-choice" else fitted, key, Style("print"))
    renderer = figure.canvas.get_renderer()
    width, _ = figure.get_size_inches() * figure.dpi
    lowest = min(ax.get_tightbbox(renderer).y0 for ax in figure.axes)
    assert min(ax.get_tightbbox(renderer).x0 for ax in figure.axes) >= 0
    boxes = [one.get_window_extent(renderer) for one in (*figure.legends, *figure.texts)]
    assert boxes
    for box in boxes:
        assert box.y1 <= lowest + 1
        assert 0 <= box.x0 <= box.x1 <= width
        assert box.y0 >= 0


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.sampled(3)
def test_names_are_text(fitted, tried, key):
    nasty = {"cross-ply": "<script>$x$", "radial-ply": "\x1b]0;a" + "b" * 200}
    results = tried if key == "model-choice" else fitted
    results = replace(renamed(results, nasty), models=named(results.models, nasty),
                      maps=named(results.maps, nasty) if results.maps else None)  # fmt: skip
    drawn = render(draw(results, key), key)
    assert b"<script" not in drawn
    assert b"\x1b" not in drawn
    assert b"&lt;script&gt;$x$" in drawn
    assert len(drawn) < 250_000


def test_limits_are_the_readers(fitted):
    figure = draw(fitted, "storage-loss", Style(xlim=(12.0, 20.0), ylim=(100.0, 200.0)))
    assert {ax.get_xlim() for ax in figure.axes} == {(12.0, 20.0)}
    assert {ax.get_ylim() for ax in figure.axes[:2]} == {(100.0, 200.0)}
    assert all(ax.get_ylim()[0] < 0 for ax in figure.axes[4:8])  # residuals
