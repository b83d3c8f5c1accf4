"""Figures as data: values of the tables, bands of the models, cards of the tests, and lines that can be told apart."""

import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.plot.conftest import RIG, STATED, changed, empty_results, results_of
from tests.plot.modelled import study_with_models, with_models
from tests.plot.test_figures import texts

from fourpole.core.confidence import NORMAL_95
from fourpole.core.routes import maxwell_arm
from fourpole.errors import CampaignError
from fourpole.fitting.query import response
from fourpole.plot import FIGURES, PAPER, SIZES, Style, draw, figure_data, figures_of, render
from fourpole.plot.data import MOST_LABELLED, Role
from fourpole.plot.layout import COLOUR_SCALE
from fourpole.plot.lineart import Kind, chains
from fourpole.plot.panels import _apart, _within
from fourpole.plot.part import Selection, select
from fourpole.plot.sheet import read_sheet
from fourpole.report.cards import make_cards
from fourpole.virtual import RADIAL_PLY

WITH_DATA = tuple(key for key, spec in FIGURES.items() if spec.data is not None)
OF_MODELS = ("model-choice", "spectrum", "amplitude", "map")
#: Figures whose points are no tests, or of what these results do not have.
UNLINKED = ("budget", "signals", "rig-found", "mass-gain", "model-choice", "spectrum", "amplitude", "modes")
AGAINST_FREQUENCY = ("first-stiffness", "first-tr", "stiffness", "storage-loss", "arm", "tr")
HEADS = {
    "|K*| [kN/m]": lambda t: np.hypot(t["Re K* [N/m]"], t["Im K* [N/m]"]) / 1e3,
    "loss angle [°]": lambda t: np.degrees(np.arctan2(t["Im K* [N/m]"], t["Re K* [N/m]"])),
    "K' [kN/m]": lambda t: t["Re K* [N/m]"].to_numpy() / 1e3,
    "K'' [kN/m]": lambda t: t["Im K* [N/m]"].to_numpy() / 1e3,
    "K2 [kN/m]": lambda t: t["K2 [N/m]"].to_numpy() / 1e3,
    "C [N s/m]": lambda t: t["C [N s/m]"].to_numpy(),
    "TR [1]": lambda t: t["TR measured [1]"].to_numpy(),
}


@pytest.fixture(scope="module")
def fitted():
    return study_with_models()


@pytest.fixture(scope="module")
def twelve():
    """Twelve pressures, two preloads, four specimens: nothing fits into labels."""
    tyres = [RADIAL_PLY.__class__(**{**vars(RADIAL_PLY), "name": f"tyre {at}"}) for at in range(4)]
    return results_of(tyres=tyres, pressures=np.linspace(100e3, 240e3, 12), frequencies=(10.0, 15.0, 18.0, 24.0))


@pytest.fixture(scope="module")
def twelve_fitted(twelve):
    return with_models(twelve, "kelvin", maps=False)


def every(data, *roles):
    return [(panel, one) for panel in data.panels for one in panel.series if one.role in roles]


@pytest.mark.parametrize("key", AGAINST_FREQUENCY)
@pytest.mark.sampled(4)
def test_the_values_are_those_of_the_tables(fitted, key):
    table = fitted.dynamic
    at = {name: row for row, name in enumerate(table["test"].to_list())}
    found = [pair for pair in every(figure_data(fitted, key), Role.POINTS) if "residual" not in pair[0].y.name]
    assert found
    for panel, one in found:
        rows = [at[test] for test in one.tests]
        np.testing.assert_allclose(one.x, table["frequency [Hz]"].to_numpy()[rows], rtol=1e-12)
        np.testing.assert_allclose(one.y, HEADS[panel.y.label](table)[rows], rtol=1e-12)


def test_the_uncertainty_of_size_and_angle_is_that_of_draws():
    """Against draws of correlated K' and K''."""
    correlated = [pl.lit(-0.6).alias("corr(Re,Im K*) [1]"), pl.lit(500.0).alias("u(Im K*) [N/m]")]
    results = changed(results_of(pressures=(170e3,)), lambda table: table.with_columns(correlated))
    row = results.dynamic.row(0, named=True)
    cov = np.array([[300.0**2, -0.6 * 300 * 500], [-0.6 * 300 * 500, 500.0**2]])
    drawn = np.random.default_rng(1).multivariate_normal([row["Re K* [N/m]"], row["Im K* [N/m]"]], cov, 40_000)
    k = drawn[:, 0] + 1j * drawn[:, 1]
    size, angle = (panel.series[0] for panel in figure_data(results, "stiffness").panels[::2])
    # The standard deviation of so many draws is known to 0.35 %.
    assert size.spread[0] * 1e3 == pytest.approx(np.abs(k).std(), rel=0.015)
    assert np.radians(angle.spread[0]) == pytest.approx(np.angle(k).std(), rel=0.015)


@pytest.mark.parametrize("key", [key for key in WITH_DATA if key not in UNLINKED])
@pytest.mark.sampled(6)
def test_points_and_loops_lead_to_the_cards_of_their_tests(fitted, key):
    cards = {card.test: card.key for card in make_cards(fitted)[0]}
    found = [(test, card) for _, one in every(figure_data(fitted, key), *Role) for test, card in
             zip(one.tests, one.cards, strict=True)]  # fmt: skip
    assert found
    assert all(cards[test] == card for test, card in found)
    svg = render(draw(fitted, key), key).decode()
    assert {f'<a xlink:href="#{card}"><title>{test}</title>' for test, card in found} == {
        part.split("</title>")[0] + "</title>" for part in svg.split("\n") for part in [part.strip()] if "<a " in part
    }


def test_a_name_cannot_leave_its_tooltip(fitted):
    named = pl.col("test").replace({"D1": 'D"1<script>&'})
    svg = render(draw(changed(fitted, lambda table: table.with_columns(named)), "tr"), "tr").decode()
    assert '<title>D"1&lt;script&gt;&amp;</title>' in svg.replace("&quot;", '"')
    assert "<script" not in svg


@pytest.mark.parametrize("key", ["stiffness", "arm"])
def test_the_band_is_that_of_the_model(fitted, key):
    """By derivatives of a finite difference of K*, with the covariance that the model has."""
    entry = fitted.models.models[0]
    data = figure_data(fitted, key)
    line = every(data, Role.MODEL)[0][1]
    k, cov = response(entry, 0, line.x)
    k1 = fitted.dynamic["K1 [N/m]"][0]
    omega = 2 * np.pi * line.x

    def value(change, k1=k1):
        return np.abs(k + change) if key == "stiffness" else maxwell_arm(k + change, np.full(k.size, k1), omega)[0]

    np.testing.assert_allclose(line.y, value(0) / 1e3, rtol=1e-12)
    by = np.stack([(value(step) - value(-step)) / 2 for step in (1.0, 1j)], axis=1)
    variance = np.einsum("ni,nij,nj->n", by, cov, by)
    if key == "stiffness":
        np.testing.assert_allclose(line.spread, NORMAL_95 * np.sqrt(variance) / 1e3, rtol=1e-6)
        return
    # K1 of the tests is in the band, and so is the second order, which is small here.
    by_k1 = (value(0, k1 + 1) - value(0, k1 - 1)) / 2
    variance += (by_k1 * fitted.dynamic["u(K1) [N/m]"][0]) ** 2
    assert np.all(line.spread * 1e3 >= 0.999 * NORMAL_95 * np.sqrt(variance))
    np.testing.assert_allclose(line.spread * 1e3, NORMAL_95 * np.sqrt(variance), rtol=0.2)


def test_tr_of_the_model_is_a_smooth_resonance_through_the_tests():
    """K* of these tests is that of one Zener solid, so the model's TR is the exact one everywhere."""
    one = results_of(tyres=(RADIAL_PLY,), pressures=(170e3,), preloads=(1000.0,), frequencies=np.linspace(8, 30, 12))
    k1, k2, c = 120e3, 70e3, 900.0
    omega = 2 * np.pi * one.dynamic["frequency [Hz]"].to_numpy()
    stiffness = k1 + 1j * omega * c * k2 / (k2 + 1j * omega * c)
    ratio = np.abs(stiffness / (stiffness + 1j * omega * RIG.impedance(omega)))
    one = changed(one, lambda table: table.with_columns(
        pl.Series("Re K* [N/m]", stiffness.real), pl.Series("Im K* [N/m]", stiffness.imag),
        pl.Series("TR measured [1]", ratio), pl.lit(k1).alias("K1 [N/m]")))  # fmt: skip
    made = with_models(one, "zener", maps=False)
    rig = {
        "values": {
            name: {k: v[k] for k in ("value", "std", "unit")} for name, v in STATED[""].items() if name != "output"
        }
    }
    models = made.models.model_validate({**made.models.model_dump(mode="json", by_alias=True), "rig": rig})
    line = every(figure_data(replace(made, models=models), "tr"), Role.MODEL)[0][1]
    w = 2 * np.pi * line.x
    exact = k1 + 1j * w * c * k2 / (k2 + 1j * w * c)
    np.testing.assert_allclose(line.y, np.abs(exact / (exact + 1j * w * RIG.impedance(w))), rtol=1e-4)
    assert line.x.size > 100
    assert np.all(line.spread > 0)


@pytest.mark.parametrize("key", WITH_DATA)
@pytest.mark.parametrize("modelled", [False, True])
@pytest.mark.sampled(12)
def test_no_panel_has_more_than_six_lines_of_one_colour_without_a_label(twelve, twelve_fitted, key, modelled):
    results = twelve_fitted if modelled else twelve
    data = figure_data(results, key)
    if data is None:
        assert key in ("signals", "modes", *OF_MODELS)
        return
    for panel in data.panels:
        if panel.names:
            continue  # rows of names: each mark stands beside its own
        # A level tells lines apart as a colour does, and a marker points where the key has it.
        points = Role.POINTS if not modelled else None
        plain = Counter((one.tyre, str(one.level), one.marker if data.key and one.role is points else "")
                        for one in panel.series if one.role in (Role.LINE, Role.MODEL, points)
                        and not one.label)  # fmt: skip
        assert max(plain.values(), default=0) <= MOST_LABELLED, panel.title
        # In a carpet each line of the lattice has its number.
        assert sum(bool(one.label) for one in panel.series) <= MOST_LABELLED or key == "fig05"


def test_the_first_page_has_six_curves_at_most_and_says_so(twelve):
    for key in ("first-stiffness", "first-tr"):
        data = figure_data(twelve, key)
        assert all(len(panel.series) <= MOST_LABELLED for panel in data.panels)
        assert any("of 96 conditions shown" in note for note in data.notes)
        width, height = draw(twelve, key).get_size_inches()
        assert (width, round(float(height), 6)) == (7.0, 2.4)


def test_a_map_passes_through_the_tests(study):
    """Without a model the values at the tests are those of the table."""
    panel = figure_data(study, "pressure-frequency").panels[0]
    rows = study.dynamic.filter((pl.col("tyre") == "cross-ply") & (pl.col("preload [N]") == 1000.0))
    field = panel.field
    for row in rows.filter(pl.col("pressure [Pa]").is_in([100e3, 240e3])).rows(named=True):
        at = field.z[0 if row["pressure [Pa]"] == 100e3 else -1]
        value = np.interp(row["frequency [Hz]"], field.x, at)
        # Between the frequencies of its grid the map is linear; outside the common band there is none.
        if field.x[0] <= row["frequency [Hz]"] <= field.x[-1]:
            assert value == pytest.approx(np.hypot(row["Re K* [N/m]"], row["Im K* [N/m]"]) / 1e3, rel=2e-3)


def test_the_preloads_of_a_map_are_said_below_it_where_specimens_differ(study):
    """Beside the quantity they would leave no room for the names."""
    heavier = pl.when(pl.col("tyre") == "radial-ply").then(1.5).otherwise(1.0)
    dynamic = study.dynamic.with_columns(pl.col("preload [N]") * heavier)
    data = figure_data(replace(study, tables={**study.tables, "dynamic": dynamic}), "pressure-frequency")
    assert data.notes[-1] == "cross-ply at 1000 N; radial-ply at 1500 N"
    assert {panel.right for panel in data.panels} == {"|K*| [kN/m]", "loss angle [°]"}


def test_the_static_curves_begin_at_zero_load_and_carry_the_preloads(study):
    panel = figure_data(study, "static").panels[1]
    lines = [one for one in panel.series if one.role is Role.LINE]
    assert [one.label for one in lines] == ["1 bar", "1.35 bar", "1.7 bar", "2.05 bar", "2.4 bar"]
    for one in panel.series:
        pressure = {"S6": 100e3, "S7": 135e3, "S8": 170e3, "S9": 205e3, "S10": 240e3}[one.tests[0]]
        np.testing.assert_allclose(one.y, RADIAL_PLY.load(one.x * 1e-3, pressure), atol=1.0)
    assert [one.y.tolist() for one in panel.series if one.role is Role.POINTS] == [[1000.0, 2000.0]] * 5


def test_the_area_of_a_loop_is_the_energy_lost(study):
    panel = figure_data(study, "loops").panels[0]
    for one in panel.series:
        row = study.dynamic.filter(pl.col("test") == one.tests[0]).row(0, named=True)
        amplitude = np.max(one.x) * 1e-3
        area = abs(np.sum(one.x[:-1] * np.diff(one.y) - one.y[:-1] * np.diff(one.x))) / 2 * 1e-3
        # A polygon of 144 sides has 0.03 % less than its ellipse.
        assert area == pytest.approx(np.pi * row["Im K* [N/m]"] * amplitude**2, rel=5e-3)


# ---- the rig as it is stated


def test_the_own_rig_shows_what_is_stated_and_nothing_else(study):
    links = chains(study)[""]
    assert [(one.kind, one.name) for one in links] == [
        (Kind.SPECIMEN, "K*"),
        (Kind.MASS, "m"),
        (Kind.SPRING, "K3"),
        (Kind.FIXED, "foundation"),
    ]
    assert links[1].stated == ("moving mass m = 15 ± 0.02 kg",)
    assert links[2].stated == ("preload spring K3 = 12.44 ± 0.04 kN/m", "damper c3 = 15 ± 1 N s/m")
    words = set(re.findall(r"[\w]+", " ".join(texts(draw(study, "rig")))))
    assert words >= {"preload", "spring", "foundation"}
    assert not words & {"cam", "pen", "recorder", "leaf", "screw", "gear", "motor", "V1", "V2", "F1"}
    channels = {"force_in": {"column": "load <b>", "unit": "kN", "quantity": "force"}}
    stated = {"rigs": {"": {"output": "blocked"}}, "channels": channels}
    blocked = chains(replace(study, record={"stated": stated}))[""]
    assert [one.kind for one in blocked] == [Kind.SENSOR, Kind.SPECIMEN, Kind.FIXED]
    assert blocked[0].stated == ("force: column load <b> [kN]",)
    assert b"<b>" not in render(draw(replace(study, record={"stated": stated}), "rig"), "rig")


# ---- units, and some tests


def test_units_are_those_that_the_campaign_wants(fitted):
    stated = {
        **fitted.record["stated"],
        "report": {"units": {"pressure": "psi", "stiffness": "N/mm", "deflection": "um"}},
    }
    wanted = replace(fitted, record={**fitted.record, "stated": stated})
    for key in ("stiffness", "arm", "first-stiffness"):
        usual, own = (figure_data(one, key).panels[0] for one in (fitted, wanted))
        assert own.y.unit == "N/mm"
        for one, other in zip(usual.series, own.series, strict=True):
            np.testing.assert_allclose(other.y, one.y)  # a kN/m is a N/mm
            np.testing.assert_allclose(other.spread, one.spread)
    assert any("14.5 psi" in one.label for one in figure_data(wanted, "stiffness").panels[0].series)
    usual, own = (figure_data(one, "pressure-frequency").panels[0] for one in (fitted, wanted))
    np.testing.assert_allclose(own.field.y, usual.field.y * 1e5 / 6894.757, rtol=1e-6)
    np.testing.assert_allclose(own.series[0].y, usual.series[0].y * 1e5 / 6894.757, rtol=1e-6)
    assert (own.y.label, own.right) == ("pressure [psi]", "|K*| [N/mm]")
    assert figure_data(wanted, "pressure-frequency").notes[0] == "at 1000 N"
    loop, other = (figure_data(one, "loops").panels[0].series[0] for one in (fitted, wanted))
    np.testing.assert_allclose(other.x, 1e3 * loop.x)
    assert "preload spring K3 = 12.44 ± 0.04 N/mm" in chains(wanted)[""][2].stated


def in_units(results, **units):
    """The same results of a campaign that wants other units."""
    stated = {**results.record["stated"], "report": {"units": units}}
    return replace(results, record={**results.record, "stated": stated})


@pytest.mark.parametrize("key", [key for key in WITH_DATA if key not in PAPER])
def test_no_figure_by_question_has_a_unit_that_the_campaign_does_not_want(fitted, key):
    wanted = in_units(fitted, pressure="psi", stiffness="lbf/in", deflection="um", force="lbf")
    data = figure_data(wanted, key)
    if data is None:
        assert key in ("signals", "modes", "model-choice", "spectrum", "amplitude")
        return
    fields = [panel.field for panel in data.panels if panel.field is not None]
    shown = {axis.unit for panel in data.panels for axis in (panel.x, panel.y)} | {one.unit for one in fields}
    assert not shown & {"bar", "kN/m", "mm", "N", "kN"}
    said = " ".join([*data.notes, *(text for _, text in data.dashes), *(panel.right for panel in data.panels),
                     *(one.label for panel in data.panels for one in panel.series)])  # fmt: skip
    assert not re.search(r"\d (bar|kN/m|N/m|mm|N|kN)\b", said), said


@pytest.mark.parametrize("key", PAPER)
def test_the_figures_of_the_paper_keep_its_units(fitted, key):
    usual, wanted = (FIGURES[key].data and figure_data(one, key) for one in (fitted, in_units(fitted, pressure="psi")))
    assert [(one.x, one.y) for one in usual.panels] == [(one.x, one.y) for one in wanted.panels] if usual else True


def test_what_nothing_has_is_said_in_the_units_of_the_campaign(study):
    with pytest.raises(CampaignError, match=r"no test at 220 kPa: did you mean 205 kPa.* from 100 kPa to 240 kPa"):
        select(in_units(study, pressure="kPa"), Selection(pressures=(2.2e5,)))


def test_a_selection_keeps_colours_markers_and_cards(study):
    part = select(study, Selection(specimens=("radial-ply",), pressures=(171e3,), preloads=(2000.0,)))
    rows = part.dynamic
    assert set(rows["tyre"]) == {"radial-ply"}
    assert set(rows["pressure [Pa]"]) == {170e3}
    assert rows.height == 6
    one = figure_data(part, "stiffness").panels[0].series[0]
    whole = {card.test: card.key for card in make_cards(study)[0]}
    assert one.tyre == 1
    assert one.marker == 2
    assert [whole[test] for test in one.tests] == list(one.cards)
    assert read_sheet(part).names == read_sheet(study).names


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"specimens": ("radail-ply",)}, "no specimen 'radail-ply': did you mean 'radial-ply'"),
        ({"tests": ("D1x",)}, "no test 'D1x': did you mean"),
        ({"pressures": (2.2e5,)}, "no test at 2.2 bar: did you mean 2.05 bar"),
        ({"preloads": (900.0,)}, "no test at 900 N: did you mean 1000 N"),
        ({"temperatures": (20.0,)}, "the tests state no temperature"),
        ({"labels": {"zzz": "A"}}, "no specimen 'zzz': choose of cross-ply, radial-ply"),
        ({"specimens": ("cross-ply",), "tests": ("D100",)}, "no test has all that is stated"),
    ],
)
def test_what_nothing_has_is_said_with_the_nearest(study, stated, message):
    with pytest.raises(CampaignError, match=message):
        select(study, Selection(**stated))


def test_labels_and_colours_are_the_readers(study):
    stated = Selection(labels={"radial-ply": "Tyre <A>"}, colours={"radial-ply": "#123456"})
    for key in ("stiffness", "fig08"):
        svg = render(draw(select(study, stated), key), key).decode()
        assert "Tyre &lt;A&gt;" in svg
        assert "#123456" in svg
        assert "radial-ply" not in svg


def test_models_of_other_conditions_leave_with_their_tests(fitted):
    part = select(fitted, Selection(tests=("D1",)))
    assert sum(len(entry.conditions) for entry in part.models.models) == 1
    assert len(every(figure_data(part, "tr"), Role.POINTS)) == 1


@pytest.mark.parametrize(("size", "expected"), [("journal", (3.5, None)), ("slide", (10.0, 5.625))])
@pytest.mark.sampled(2)
def test_a_figure_has_the_size_that_is_asked_for(fitted, size, expected):
    for key in ("stiffness", "tr", "first-stiffness"):
        width, height = draw(fitted, key, Style(size=SIZES[size])).get_size_inches()
        assert width == expected[0]
        whole = [ax.get_ylabel() for ax in draw(fitted, key).axes if ax.get_ylabel()]
        if size == "journal":  # one panel in a row, each with its label, those of a specimen below each other
            panels = [ax for ax in draw(fitted, key, Style(size=SIZES[size])).axes if ax.get_label() != COLOUR_SCALE]
            assert len({round(ax.get_position().x0, 6) for ax in panels}) == 1
            labels = [ax.get_ylabel() for ax in panels]
            assert labels == whole * (len(labels) // len(whole))
        assert expected[1] is None or height == pytest.approx(expected[1])


def test_panels_with_other_abscissas_have_their_own_numbers(study):
    figure = draw(study, "static", Style(size=SIZES["journal"]))
    assert [ax.get_xlabel() for ax in figure.axes] == ["deflection [mm]"] * 2
    assert len({ax.get_xlim() for ax in figure.axes}) == 2
    assert all(ax.xaxis.get_tick_params()["labelbottom"] for ax in figure.axes)


# ---- the rest


def test_nothing_is_no_figure():
    assert [figure_data(empty_results(), key) for key in WITH_DATA] == [None] * len(WITH_DATA)
    with pytest.raises(CampaignError, match="is drawn, not made of data"):
        figure_data(empty_results(), "fig01")


def test_every_figure_with_axes_is_data():
    """The others are line art of rigs."""
    assert {*FIGURES} - {*WITH_DATA} == {"rig", "fig01", "fig02", "fig03", "fig04"}
    assert all((spec.data is None) != (spec.draw is None) for spec in FIGURES.values())


@pytest.mark.sampled(4)
def test_data_needs_no_matplotlib():
    code = (
        "import sys, polars\n"
        "from fourpole.study.study import Study\n"
        "from fourpole.plot import states, frequency, loops, maps, models, over, part, rig\n"
        "from fourpole.paper1982 import figures, companions\n"
        "assert not [name for name in sys.modules if name.startswith('matplotlib')]\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_places_move_apart_in_order():
    places = _apart(np.array([0.1, 0.5, 0.52, 0.53]), 0.1)
    assert np.all(np.diff(places) >= 0.1 - 1e-12)
    assert places[0] == 0.1
    assert _within(np.array([-0.2, 0.0, 0.05, 1.3]), 0.1).tolist() == pytest.approx([0.05, 0.15, 0.25, 0.95])
    assert places[1:].mean() == pytest.approx(np.mean([0.5, 0.52, 0.53]))


def test_one_test_has_no_curve():
    one = with_models(results_of(tyres=(RADIAL_PLY,), pressures=(170e3,), preloads=(1000.0,)), "kelvin", maps=False)
    alone = select(one, Selection(tests=("D1",)))
    assert every(figure_data(alone, "stiffness"), Role.POINTS)
    assert figures_of(alone)[0] == "first-stiffness"
