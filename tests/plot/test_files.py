"""Files of figures: text that stays text, the same bytes each time, nothing left behind."""

import pickle
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ET
from concurrent.futures import Executor, Future

import matplotlib as mpl
import pytest
from tests.plot.conftest import empty_results, renamed, results_of
from tests.plot.modelled import against, study_with_models

from fourpole.errors import CampaignError
from fourpole.plot import THEMES, Style, draw, figures_of, render, save_figures, write_figure
from fourpole.plot.data import plain_text, short_names
from fourpole.virtual import RADIAL_PLY

SVG = "{http://www.w3.org/2000/svg}"
NASTY = ["$x^2$", "_a", "<script>alert(1)</script>", "\\frac{1}{2}", "a" * 300, "\x00\x1b]0;\u202etxet", "轮胎", "{}%s"]


def words(svg):
    return ["".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize("key", ["fig05", "fig14"])
@pytest.mark.sampled(8)
def test_a_name_is_text_whatever_it_says(name, key):
    results = renamed(results_of(pressures=(100e3, 170e3), frequencies=(10.0, 20.0)), {"radial-ply": name})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = draw(results, key)
        svg, png = render(figure, key), render(figure, key, "png")
    shown = plain_text(name)
    assert any(word in {shown, plain_text(name, 34)} for word in words(svg)), words(svg)
    assert b"<script" not in svg
    assert b"\x1b" not in svg
    assert png.startswith(b"\x89PNG")
    assert max(len(word) for word in words(svg)) < 140


def test_names_alike_in_what_is_shown_stay_apart():
    long = ["a" * 200 + end + "b" * 100 for end in "xyz"]
    shown = short_names([*long, "", " ", "short"])
    assert len(set(shown)) == len(shown)
    assert all(len(name) <= 28 for name in shown)
    assert shown[-1] == "short"


@pytest.mark.parametrize("key", ["fig02", "fig05"])
@pytest.mark.sampled(2)
def test_the_same_tables_give_the_same_bytes(study, key):
    for form in ("svg", "png", "pdf"):
        first, second = (render(draw(study, key), key, form) for _ in range(2))
        assert first == second
    assert first.startswith(b"%PDF")


def test_an_svg_has_text_in_a_family_that_every_browser_has(study):
    svg = render(draw(study, "fig08"), "fig08").decode()
    assert "C [N s/m]" in words(svg)
    assert "sans-serif" in svg
    assert "<image" not in svg
    assert "<dc:date>" not in svg
    # No address but those that name the format.
    assert "matplotlib.org" not in svg


def test_names_inside_an_svg_are_its_own(study):
    """Two figures in one page must not share the clip path or marker of the other."""
    ids = [
        {element.get("id") for element in ET.fromstring(render(draw(study, key), key)).iter()} - {None}
        for key in ("fig08", "fig09")
    ]
    assert all(ids)
    assert not ids[0] & ids[1]


def test_what_a_user_set_in_matplotlib_changes_nothing_and_is_kept(study):
    usual = render(draw(study, "fig08"), "fig08")
    with mpl.rc_context({"font.size": 30.0, "axes.grid": False, "svg.fonttype": "path", "axes.xmargin": 3.0}):
        before = mpl.rcParams.copy()
        assert render(draw(study, "fig08"), "fig08") == usual
        assert mpl.rcParams.copy() == before


@pytest.mark.sampled(4)
def test_drawing_needs_no_pyplot():
    code = (
        "import sys, matplotlib; before = matplotlib.rcParams.copy()\n"
        "import polars, fourpole.plot as plot\n"
        "from fourpole.study.study import Study\n"
        "nothing = Study(polars.DataFrame(), polars.DataFrame(), polars.DataFrame())\n"
        "plot.render(plot.draw(nothing, 'fig02'), 'fig02')\n"
        "assert matplotlib.rcParams.copy() == before\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("theme", THEMES)
def test_each_theme_draws_on_its_paper(study, theme):
    svg = render(draw(study, "fig14", Style(theme)), "fig14", style=Style(theme)).decode()
    assert THEMES[theme].paper in svg
    assert THEMES[theme].tyres[0].lower() in svg


@pytest.mark.thorough
@pytest.mark.sampled(8)
def test_all_figures_are_written_and_light(tmp_path):
    calls = []
    results = against(study_with_models(), "kelvin")
    written = save_figures(results, tmp_path / "figures", progress=lambda *at: calls.append(at))
    shown = figures_of(results)
    assert list(written) == [key for key in shown if key not in ("modes", "spectrum", "amplitude")]  # massless; one arm
    assert calls == [(at, len(shown)) for at in range(1, len(shown) + 1)]
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"{key}.svg" for key in written}  # PNG is written on demand
    for key, path in written.items():
        assert path == tmp_path / "figures" / f"{key}.svg"
        assert path.stat().st_size < 250_000
        ET.parse(path)


def test_figures_drawn_by_workers_are_the_same_files(study, tmp_path):
    """By an executor that runs each task on a pickled copy, as a process would."""

    class Copies(Executor):
        def submit(self, task, /, *given, **named):
            done = Future()
            work, given, named = pickle.loads(pickle.dumps((task, given, named)))  # noqa: S301
            done.set_result(work(*given, **named))
            return done

    keys, calls = ["fig02", "fig05", "fig08", "spectrum"], []
    here = save_figures(study, tmp_path / "here", keys=keys)
    there = save_figures(study, tmp_path / "there", keys=keys, executor=Copies(), progress=lambda *at: calls.append(at))
    assert list(here) == list(there) == keys[:3]
    assert calls == [(at, 4) for at in (1, 2, 3, 4)]
    for key in here:
        assert here[key].read_bytes() == there[key].read_bytes()


def test_a_figure_that_has_nothing_to_show_leaves_no_old_file(study, tmp_path):
    save_figures(study, tmp_path, keys=["fig02", "fig08"], formats=["svg", "png"])
    written = save_figures(empty_results(), tmp_path, keys=["fig02", "fig08"], formats=["svg", "png"])
    assert list(written) == ["fig02"]
    assert {path.name for path in tmp_path.iterdir()} == {"fig02.svg", "fig02.png"}


def test_one_figure_goes_where_it_is_told(study, tmp_path):
    style = Style("print")
    path = write_figure(draw(study, "fig08", style), "fig08", tmp_path / "my figure.PNG", style)
    assert path.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(CampaignError, match="choose one of svg, png, pdf"):
        write_figure(draw(study, "fig08"), "fig08", tmp_path / "figure.docx")


def test_what_is_unknown_is_said_before_anything_is_drawn(study, tmp_path):
    with pytest.raises(CampaignError, match="did you mean 'fig08'"):
        draw(study, "fig8")
    with pytest.raises(CampaignError, match="no figure 'zzz'"):
        save_figures(study, tmp_path, keys=["fig02", "zzz"])
    with pytest.raises(CampaignError, match="no format 'gif'"):
        save_figures(study, tmp_path, formats=["gif"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "settings", [{"theme": "pink"}, {"xlim": (1.0, 1.0)}, {"ylim": (0.0, float("nan"))}, {"xlim": (1.0,)}]
)
def test_a_style_that_cannot_be_is_refused(settings):
    with pytest.raises(CampaignError):
        Style(**settings)


@pytest.mark.sampled(2)
def test_three_hundred_tests_stay_light():
    many = results_of(
        tyres=(RADIAL_PLY,), pressures=(100e3, 150e3, 200e3), frequencies=[10.0 + 0.28 * at for at in range(50)]
    )
    for key in ("stiffness", "fig08", "routes", "mobility", "tr-measured-predicted"):
        assert len(render(draw(many, key), key)) < 250_000, key
