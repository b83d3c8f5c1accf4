"""What figures show is what the tables say."""

from functools import cache, partial

import numpy as np
import polars as pl
import pytest
from matplotlib.colors import to_hex
from tests.plot.conftest import FREQUENCIES, PRESSURES, blank, changed, empty_results, results_of
from tests.plot.modelled import study_with_models

from fourpole.core.tyre import mobility
from fourpole.paper1982.companions import route_stiffness
from fourpole.paper1982.figures import crossings
from fourpole.plot import FIGURES, PAPER, Style, draw, figure_data, figures_of
from fourpole.plot.data import Place, Role, Tone
from fourpole.plot.layout import COLOUR_SCALE
from fourpole.plot.sheet import read_sheet
from fourpole.study.study import Study
from fourpole.virtual import CROSS_PLY, RADIAL_PLY

pytestmark = pytest.mark.thorough

SCHEMES = ("fig01", "fig02", "fig03", "fig04")
MODELS = ("model-choice", "spectrum", "amplitude", "map")
#: Figures without axes, or of what these results do not have.
OTHERS = ("rig", "signals", "modes")
DATA = tuple(key for key in FIGURES if key not in (*SCHEMES, *MODELS, *OTHERS))
TYRES = {"cross-ply": CROSS_PLY, "radial-ply": RADIAL_PLY}
LOW_HIGH = {"fig06": 1000.0, "fig07": 2000.0, "fig08": 1000.0, "fig09": 2000.0, "fig10": 1000.0, "fig11": 2000.0,
            "fig12": 1000.0, "fig13": 2000.0}  # fmt: skip


@pytest.fixture(scope="module")
def drawn(study):
    """Each figure of the study by its key, drawn once."""
    return cache(partial(draw, study))


def lines(ax, label):
    return [line for line in ax.lines if line.get_label() == label]


def points(ax, label="_points"):
    """All points of an axes as (N, 2), those with links too."""
    found = [line.get_xydata() for line in lines(ax, label)]
    found += [np.asarray(one.get_offsets()) for one in ax.collections if one.get_label() == label]
    return np.concatenate(found) if found else np.zeros((0, 2))


def texts(figure):
    found = [text.get_text() for text in figure.texts]
    for legend in figure.legends:
        found += [text.get_text() for text in legend.get_texts()]
    for ax in figure.axes:
        found += [text.get_text() for text in ax.texts]
        found += [ax.get_title(loc=loc) for loc in ("left", "right")] + [ax.get_xlabel(), ax.get_ylabel()]
    return [text for text in found if text]


def said(figure):
    return " ".join(text.get_text() for text in figure.texts).replace("\n", " ")


def panel(figure, title, right=None):
    (ax,) = [
        ax for ax in figure.axes if ax.get_title(loc="left") == title and right in (None, ax.get_title(loc="right"))
    ]
    return ax


def in_order(array):
    return array[np.lexsort(array.T[::-1])]


def reject(results: Study, names, **cells):
    this = pl.col("test").is_in(list(names))
    change = [pl.when(this).then(pl.lit("rejected")).otherwise(pl.col("verdict")).alias("verdict")]
    change += [pl.when(this).then(pl.lit(value)).otherwise(pl.col(name)).alias(name) for name, value in cells.items()]
    return changed(results, lambda table: table.with_columns(change))


def test_the_figures_by_question_come_first_and_the_papers_stand_apart(study):
    assert list(FIGURES)[:6] == ["first-stiffness", "first-tr", "stiffness", "storage-loss", "arm", "tr"]
    assert list(PAPER)[:14] == [f"fig{number:02d}" for number in range(1, 15)]
    assert list(PAPER)[14:] == ["tr-measured-predicted", "nyquist", "routes", "mobility"]
    usual = figures_of(study)
    assert not {*usual} & {*PAPER}
    assert figures_of(study, paper=True) == [*usual, *PAPER]
    assert not {*usual} & {*MODELS}  # these results have none
    assert {*figures_of(study_with_models())} >= {*MODELS}
    for key, spec in FIGURES.items():
        assert spec.key == key
        assert spec.title
        assert spec.caption.endswith(".")


@pytest.mark.parametrize(("key", "preload"), LOW_HIGH.items())
@pytest.mark.sampled(2)
def test_figures_6_to_13_carry_the_numbers_of_the_table(study, drawn, key, preload):
    quantity, scale = ("C [N s/m]", 1.0) if int(key[3:]) < 10 else ("K2 [N/m]", 1e-3)
    against = ("pressure [Pa]", 1e-5) if key in {"fig06", "fig07", "fig10", "fig11"} else ("frequency [Hz]", 1.0)
    figure = drawn(key)
    assert len([ax for ax in figure.axes if ax.get_label() != COLOUR_SCALE]) == 2
    for tyre in TYRES:
        ax = panel(figure, tyre)
        assert ax.get_title(loc="right") == f"{preload:.0f} N"
        rows = study.dynamic.filter((pl.col("tyre") == tyre) & (pl.col("preload [N]") == preload))
        expected = np.column_stack([rows[against[0]] * against[1], rows[quantity] * scale])
        np.testing.assert_allclose(in_order(points(ax)), in_order(expected), rtol=1e-12)
        # A curve is one frequency, or one pressure: its line has a knot at each value of the other.
        curves, knots = (
            (len(FREQUENCIES), len(PRESSURES)) if against[0][0] == "p" else (len(PRESSURES), len(FREQUENCIES))
        )
        assert [line.get_xydata().shape[0] for line in lines(ax, "_line")] == [knots] * curves


def test_more_preloads_have_a_row_each_and_the_lowest_its_own_figure():
    results = results_of(preloads=(1000.0, 1500.0, 2000.0), frequencies=(10.0, 20.0))
    low, others = draw(results, "fig06"), draw(results, "fig07")
    assert [ax.get_title(loc="right") for ax in low.axes[:-1]] == ["1000 N"] * 2
    assert [ax.get_title(loc="right") for ax in others.axes[:-1]] == ["1500 N", "1500 N", "2000 N", "2000 N"]
    assert draw(results_of(preloads=(1000.0,), frequencies=(10.0,)), "fig07") is None


def test_bars_are_the_uncertainties_of_the_table(study):
    ax = panel(draw(study, "fig08"), "radial-ply")
    rows = study.dynamic.filter((pl.col("tyre") == "radial-ply") & (pl.col("preload [N]") == 1000.0))
    low, high = (rows["C [N s/m]"] + k * rows["u(C) [N s/m]"] for k in (-2, 2))
    drawn = points(ax, "_bars")
    drawn = drawn[np.isfinite(drawn[:, 1]), 1].reshape(-1, 2)
    np.testing.assert_allclose(in_order(drawn), in_order(np.column_stack([low, high])), rtol=1e-12)


@pytest.mark.parametrize("tyre", TYRES)
def test_figure_5_is_a_carpet_that_gives_load_and_pressure(study, tyre):
    data, law = figure_data(study, "fig05"), TYRES[tyre]
    (part,) = [one for one in data.panels if one.title == tyre]
    curves = [one for one in part.series if one.place is Place.ABOVE]
    assert len(curves) == len(PRESSURES)
    # Each begins at zero load, set off in proportion to its pressure.
    offsets = np.array([one.x[0] for one in curves])
    per_bar = offsets[-1] / 1.4
    assert f"the offset is {per_bar:.3g} mm per bar above 1 bar" in data.notes
    np.testing.assert_allclose(offsets, per_bar * (np.array(PRESSURES) - PRESSURES[0]) * 1e-5, atol=1e-6)
    for one, pressure, offset in zip(curves, PRESSURES, offsets, strict=True):
        np.testing.assert_allclose(law.load((one.x - offset) * 1e-3, pressure), one.y * 1e3, atol=0.01)
    crosses = [one for one in part.series if one.place is not Place.ABOVE]
    assert len(crosses) >= 3
    for one in crosses:
        level = round(one.x[0])
        assert one.label == f"{level} mm"
        # Loads are interpolated between the 60 points of the curve.
        np.testing.assert_allclose(one.y, law.load(level * 1e-3, np.array(PRESSURES[: one.y.size])) * 1e-3, rtol=2e-3)
        np.testing.assert_allclose(one.x, level + offsets[: one.x.size], atol=1e-6)
    ax = panel(draw(study, "fig05"), tyre)
    assert {"1", "2.4 bar", crosses[0].label} <= {text.get_text() for text in ax.texts}
    assert ax.get_ylabel() in {"load [kN]", ""}


def test_figure_5_without_a_second_pressure_has_no_offset():
    data = figure_data(results_of(pressures=(170e3,), frequencies=(10.0,)), "fig05")
    assert {one.x.label for one in data.panels} == {"deflection [mm]"}
    assert all(one.place is Place.ABOVE for part in data.panels for one in part.series)


def crossed_at(part):
    """Frequencies at which lines go down from crossings."""
    return [one.x[0] for one in part.series if one.tone is Tone.INK]


def test_figure_14_shows_two_pressures_and_where_the_tyres_cross(study):
    data = figure_data(study, "fig14")
    assert [one.title for one in data.panels] == ["1000 N", "2000 N"]
    for ax, part, preload in zip(draw(study, "fig14").axes, data.panels, (1000.0, 2000.0), strict=True):
        rows = study.dynamic.filter(pl.col("pressure [Pa]").is_in([100e3, 170e3]) & (pl.col("preload [N]") == preload))
        expected = rows.select("frequency [Hz]", "TR measured [1]").to_numpy()
        np.testing.assert_allclose(in_order(points(ax)), in_order(expected), rtol=1e-12)
        crossed = crossed_at(part)
        assert len(crossed) == 2
        assert all(17.0 < at < 19.5 for at in crossed)
        assert f"{crossed[0]:.1f} Hz (1 bar)" in part.corner
        assert ax.get_ylim()[0] == 0.0
    assert "2 of 5 pressures shown" in data.notes


def test_a_single_tyre_crosses_nothing():
    data = figure_data(results_of(tyres=(RADIAL_PLY,)), "fig14")
    assert not any(crossed_at(part) or part.corner for part in data.panels)


def test_crossings_are_found_between_the_points_in_common():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    other = np.array([0.5, 2.5]), np.array([1.0, 1.0])
    assert crossings((x, x), other) == [(1.0, 1.0)] or crossings((x, x + 0.25), other) == [(0.75, 1.0)]
    assert crossings((x, x + 0.25), other) == [(0.75, 1.0)]
    assert crossings((x, x + 5), other) == []
    assert crossings((x[:1], x[:1]), other) == []
    assert crossings((x, x), (x, x)) == []


@pytest.mark.parametrize("key", DATA)
@pytest.mark.sampled(4)
def test_every_axis_says_its_unit(drawn, key):
    figure = drawn(key)
    labels = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label]
    assert {"x" for ax in figure.axes if ax.get_xlabel()}
    assert labels
    assert all(label.endswith("]") and "[" in label for label in labels), labels


@pytest.mark.sampled(2)
def test_a_tyre_has_one_colour_and_a_pressure_one_marker_in_all_figures(study, drawn):
    colour = {tyre: to_hex(Style().colour(at)) for at, tyre in enumerate(TYRES)}
    markers = {}
    for key in DATA:
        for ax in drawn(key).axes:
            bar = lines(ax, "_tyre")
            if bar:
                assert [to_hex(line.get_color()) for line in bar] == [colour[ax.get_title(loc="left")]]
        for part in figure_data(study, key).panels:
            marks = [one for one in part.series if one.role is Role.POINTS]
            if part.tyre >= 0 and key != "pressure-frequency":
                assert {one.tyre for one in marks} <= {part.tyre}
            if key in {"fig08", "fig09", "fig12", "fig13"}:
                these = [one.marker for one in marks]
                assert markers.setdefault("pressures", these) == these
    assert len(set(markers["pressures"])) == len(PRESSURES)
    fourteenth = {one.marker for part in figure_data(study, "fig14").panels for one in part.series
                  if one.role is Role.POINTS}  # fmt: skip
    assert fourteenth == {markers["pressures"][0], markers["pressures"][2]}


def test_a_load_has_one_line_style(drawn):
    def styles(key):
        return {line.get_linestyle() for ax in drawn(key).axes for line in lines(ax, "_line")}

    assert styles("fig08") == styles("fig06") == styles("fig10") == {"-"}
    assert styles("fig09") == styles("fig07") == styles("fig13")
    assert styles("fig09") != styles("fig08")


def test_rejected_tests_are_crosses_and_are_counted(study):
    hurt = reject(study, ["D1", "D2"])
    hurt = reject(hurt, ["D3"], **{"C [N s/m]": None, "K2 [N/m]": None})
    figure = draw(hurt, "fig08")
    ax = panel(figure, "cross-ply")
    rows = hurt.dynamic.filter(pl.col("test").is_in(["D1", "D2"]))
    np.testing.assert_allclose(points(ax, "_rejected"), rows.select("frequency [Hz]", "C [N s/m]").to_numpy())
    assert len(points(ax)) == len(PRESSURES) * len(FREQUENCIES) - 3
    assert "3 tests rejected, 1 not shown: no value" in said(figure)
    assert "rejected test" in texts(figure)
    # K* of the third is still known.
    data = figure_data(hurt, "stiffness")
    lost = [one for panel in data.panels for one in panel.series if one.role is Role.REJECTED]
    assert sorted(test for one in lost for test in one.tests) == ["D1", "D1", "D2", "D2", "D3", "D3"]
    assert "3 tests rejected" in data.notes


def test_a_rejected_value_far_off_sets_no_axis_and_is_told(study):
    figure = draw(reject(study, ["D1"], **{"C [N s/m]": 1e6}), "fig08")
    assert figure.axes[0].get_ylim()[1] < 3000
    assert "C of 1 rejected test beyond the axes" in said(figure)


def test_all_tests_rejected_still_shows_them(study):
    figure = draw(reject(study, study.dynamic["test"].to_list()), "fig12")
    assert sum(len(points(ax, "_rejected")) for ax in figure.axes) == 60
    assert sum(len(points(ax)) for ax in figure.axes) == 0


def test_a_bar_longer_than_the_data_leaves_the_axis_on_the_data(study):
    long = pl.when(pl.col("test") == "D1").then(5e4).otherwise(pl.col("u(C) [N s/m]")).alias("u(C) [N s/m]")
    plain = draw(study, "fig08").axes[0].get_ylim()
    figure = draw(changed(study, lambda table: table.with_columns(long)), "fig08")
    assert figure.axes[0].get_ylim()[1] < plain[1] * 1.2
    assert "1 uncertainty bar leaves the axes" in said(figure)


def test_a_value_known_to_nothing_sets_no_axis(study):
    this = pl.col("test") == "D1"
    wild = [pl.when(this).then(value).otherwise(pl.col(name)).alias(name)
            for name, value in (("K2 [N/m]", 1e9), ("u(K2) [N/m]", 5e9))]  # fmt: skip
    figure = draw(changed(study, lambda table: table.with_columns(wild)), "fig12")
    assert figure.axes[0].get_ylim()[1] < 500
    assert "1 value beyond the axes" in said(figure)


@pytest.mark.parametrize("key", [*DATA, *MODELS, *OTHERS])
def test_nothing_to_show_is_none(key):
    assert draw(empty_results(), key) is None


@pytest.mark.parametrize("key", SCHEMES)
def test_schemes_need_no_tests(key):
    assert draw(empty_results(), key) is not None


def test_the_models_name_their_parts_and_the_rig_its_values(study):
    assert {"K1", "K2", "C", "F1, V1", "F2', V2'"} <= set(texts(draw(study, "fig01")))
    stated = set(texts(draw(study, "fig02")))
    assert {"K1", "K2", "C", "m = 15 kg", "K3 = 12.44 kN/m", "c3 = 15 N s/m", "F1, V1", "V2", "F3, V3 = 0"} <= stated
    assert {"K3", "m"} <= set(texts(draw(empty_results(), "fig02")))
    assert any("1 mm" in text for text in texts(draw(study, "fig04")))
    assert "force transducer" in texts(draw(study, "fig03"))


def test_the_routes_agree_where_the_rig_is_exact(study):
    found = route_stiffness(study, read_sheet(study))
    expected = study.dynamic["Re K* [N/m]"].to_numpy() + 1j * study.dynamic["Im K* [N/m]"].to_numpy()
    assert set(found) == {"mobility", "relative", "transmissibility"}
    for value in found.values():
        # Near |T| = 1 the routes lose digits, as differences of nearly equal numbers do.
        np.testing.assert_allclose(value, expected, rtol=1e-9)
    assert "mobility route (in use)" in texts(draw(study, "routes"))


def test_without_v2_there_is_one_route_and_tr_is_the_predicted_one(study):
    results = blank(study, "V2 [m/s]", "phase V2-V1 [rad]", "TR measured [1]")
    assert draw(results, "routes") is None
    assert draw(results, "tr-measured-predicted") is None
    figure = draw(results, "fig14")
    assert figure.axes[0].get_ylabel() == "TR predicted [1]"
    assert "V2 was not measured" in said(figure)


def test_without_k1_there_is_k_star_all_the_same(study):
    results = blank(study, "K1 [N/m]", "K2 [N/m]", "C [N s/m]", "u(K2) [N/m]", "u(C) [N s/m]")
    assert draw(results, "fig06") is None
    assert draw(results, "stiffness") is not None
    mobility_figure = draw(results, "mobility")
    assert not any(lines(ax, "_model") for ax in mobility_figure.axes)


def test_a_specimen_without_pressure_has_curves_against_frequency(study):
    results = blank(results_of(pressures=(170e3,)), "pressure [Pa]")
    assert draw(results, "fig06") is None
    ax = panel(draw(results, "fig08"), "radial-ply")
    assert len(points(ax)) == len(FREQUENCIES)
    assert draw(results, "fig14") is not None


def test_the_curve_of_the_model_passes_through_the_measured_mobility(study):
    part = figure_data(study, "mobility").panels[0]
    curve, marked = (next(one for one in part.series if one.role is role) for role in (Role.MODEL, Role.POINTS))
    # K2 and C are interpolated, so away from the ends only nearly.
    np.testing.assert_allclose(curve.y[[0, -1]], marked.y[[0, -1]], rtol=1e-9)
    row = study.dynamic.row(0, named=True)
    whole = mobility(complex(row["Re K* [N/m]"], row["Im K* [N/m]"]), 2 * np.pi * row["frequency [Hz]"], mass=15.0,
                     preload_stiffness=12440.0, preload_damping=15.0)  # fmt: skip
    assert curve.y[0] == pytest.approx(whole.real * 1e3, rel=1e-9)


def test_nyquist_is_imaginary_over_real(study):
    data = figure_data(study, "nyquist")
    assert "3 of 5 pressures shown" in data.notes
    rows = study.dynamic.filter((pl.col("tyre") == "radial-ply") & pl.col("pressure [Pa]").is_in([100e3, 170e3, 240e3]))
    expected = rows.select(pl.col("Re K* [N/m]") * 1e-3, pl.col("Im K* [N/m]") * 1e-3).to_numpy()
    found = points(panel(draw(study, "nyquist"), "radial-ply"))
    np.testing.assert_allclose(in_order(found), in_order(expected), rtol=1e-12)


@pytest.mark.parametrize("key", DATA)
@pytest.mark.sampled(2)
def test_one_test_is_enough(key):
    results = results_of(tyres=(RADIAL_PLY,), pressures=(170e3,), preloads=(1000.0,), frequencies=(14.0,))
    figure = draw(results, key)
    assert (figure is None) == (key in {"fig07", "fig09", "fig11", "fig13", "pressure-frequency"})


def test_limits_are_the_readers(study):
    figure = draw(study, "fig08", Style(xlim=(12.0, 20.0), ylim=(700.0, 900.0)))
    assert all(ax.get_xlim() == (12.0, 20.0) and ax.get_ylim() == (700.0, 900.0) for ax in figure.axes)
    assert "beyond the axes" in said(figure)


@pytest.mark.parametrize("key", ["fig06", "fig08", "fig14", "stiffness", "tr-measured-predicted", "routes"])
@pytest.mark.parametrize("case", ["two", "many"])
@pytest.mark.sampled(6)
def test_key_and_notes_stay_off_the_panels(study, key, case):
    if case == "many":
        named = [CROSS_PLY.__class__(**{**vars(RADIAL_PLY), "name": f"a tyre of the long name {n}"}) for n in range(9)]
        study = results_of(tyres=named, pressures=np.linspace(100e3, 240e3, 12), frequencies=(10.0, 18.0))
        study = reject(study, ["D1", "D30"])
    figure = draw(study, key)
    renderer = figure.canvas.get_renderer()
    width, _ = figure.get_size_inches() * figure.dpi
    lowest = min(ax.get_tightbbox(renderer).y0 for ax in figure.axes if ax.get_label() != COLOUR_SCALE)
    boxes = [legend.get_window_extent(renderer) for legend in figure.legends]
    boxes += [text.get_window_extent(renderer) for text in figure.texts]
    assert boxes
    for box in boxes:
        assert box.y1 <= lowest + 1
        assert box.x0 >= 0
        assert box.x1 <= width
        assert box.y0 >= 0
    for one in boxes:
        assert not any(one.overlaps(other) for other in boxes if other is not one)


@pytest.mark.parametrize(("key", "what"), [("mobility", "mobility"), ("fig14", "TR")])
def test_what_an_added_mass_changes_is_drawn_without_it(study, key, what):
    """Every condition once more with 10 kg: the same points, and the reason why the others are not there."""
    added = study.dynamic.with_columns(
        pl.col("test") + "m",
        pl.lit(10.0).alias("added mass [kg]"),
        *(pl.col(name) * 2.0 for name in ("R [m/(N s)]", "I [m/(N s)]", "TR measured [1]")),
    )
    both = changed(study, lambda table: pl.concat([table, added]))
    alone, together = draw(study, key), draw(both, key)
    for before, after in zip(alone.axes, together.axes, strict=True):
        np.testing.assert_array_equal(points(after), points(before))
    said = " ".join(text.get_text() for text in together.texts)
    assert f"ests with an added mass have another {what} and are left out" in said
