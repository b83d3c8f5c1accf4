"""Python as an engineer uses it in a notebook: what objects show of themselves, one test, figures, pandas."""

import ast
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest

import fourpole
from fourpole.core.digits import notebook_html, outline_svg
from fourpole.errors import CampaignError
from fourpole.study.results import read_results
from fourpole.study.study import Study

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebooks" / "first-look.ipynb"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two pressures of two tyres; the recording of D2 is missing."""
    folder = tmp_path_factory.mktemp("notebook")
    made = fourpole.simulate_campaign(
        folder, pressures=[170e3, 210e3], preloads=[1000.0], frequencies=[10.0, 16.0, 24.0]
    )
    (made.folder / "recordings" / "D2.csv").unlink()
    return fourpole.analyse(made.folder)


class _Well(HTMLParser):
    """Checks that tags are closed in order, and that nothing is loaded."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        assert tag not in ("script", "link", "iframe", "style", "img")
        assert not {"src", "href"} & dict(attrs).keys()
        self.seen.append(tag)
        if tag not in ("br", "polyline"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag != "polyline":
            assert self.open.pop() == tag


def checked(html):
    found = _Well()
    found.feed(html)
    assert found.open == []
    assert len(html) < 60_000
    return html


@pytest.mark.sampled(2)
def test_a_study_shows_its_tests_and_the_range_of_each_condition(study):
    html = checked(study._repr_html_())
    assert "16 tests: 15 ok, 0 warning, 1 rejected; joint route" in html
    assert "cross-ply, 1.7 bar, 1000 N" in html
    assert "K2 [kN/m]" in html
    assert checked(Study(record=study.record, tables=study.tables)._repr_html_()) == html


def test_an_empty_result_shows_itself():
    assert "0 tests" in checked(Study()._repr_html_())


def test_texts_of_files_are_escaped():
    html = checked(notebook_html("<b>x", ["<script>"], ["<i>"], [["a & <b>"]] * 20, after=outline_svg(np.arange(5.0))))
    assert "&lt;script&gt;" in html
    assert "a &amp; &lt;b&gt;" in html
    assert "... and 8 more" in html


def test_an_outline_without_values_is_empty():
    assert outline_svg(np.full(9, np.nan)) == ""
    assert outline_svg(np.zeros(0)) == ""
    assert "nan" not in outline_svg(np.array([1.0, np.nan, 2.0]))


def test_one_test_has_its_row_amplitudes_checks_and_recording(study):
    test = study.tests["D1"]
    assert (test.kind, test.verdict, test.remarks) == ("dynamic", "ok", ())
    row = study.dynamic.row(by_predicate=pl.col("test") == "D1", named=True)
    assert test.row == row
    assert abs(test.phasors.force_in[0]) == pytest.approx(row["F1 [N]"], rel=1e-12)
    assert test.checks["test"].unique().to_list() == ["D1"]
    assert test.preview.height == 1
    recording = test.recording()
    found = fourpole.demodulate(recording).phasors
    assert abs(found.mobility) == pytest.approx(abs(test.phasors.mobility[0]), rel=1e-6)
    for one in (test, test.phasors, recording):
        checked(one._repr_html_())
    assert len(repr(test)) < 1000


def test_a_rejected_test_says_why(study):
    test = study.tests["D2"]
    assert test.verdict == "rejected"
    assert "there is no such file" in repr(test)
    with pytest.raises(CampaignError, match=r"test 'D2' has no amplitudes: .*there is no such file"):
        test.phasors  # noqa: B018


def test_a_name_that_is_not_there_leads_to_the_nearest_one(study):
    with pytest.raises(KeyError, match="did you mean 'D12'"):
        study.tests["d12"]
    assert "D99" not in study.tests
    assert list(study.tests)[:2] == [study.campaign.tests[0].name, study.campaign.tests[1].name]


def test_a_static_test_has_a_curve_and_no_recording(study):
    name = next(one.name for one in study.tests.values() if one.kind == "static")
    assert study.tests[name].preview.height == 1
    with pytest.raises(CampaignError, match="is static"):
        study.tests[name].recording()


def test_fits_and_maps_show_their_parameters(study):
    fit = study.fit("zener")[0]
    html = checked(fit._repr_html_())
    assert "zener for cross-ply" in html
    assert re.search(r"K1 \[kN/m\].*± ", html, re.DOTALL)


@pytest.mark.sampled(2)
def test_figures_by_quantity_show_and_save_themselves(study, tmp_path):
    drawn = study.plot("K2")
    assert drawn.key == "arm"
    assert drawn._repr_svg_().startswith("<?xml")
    assert drawn.save(tmp_path / "k2.png").read_bytes()[1:4] == b"PNG"
    assert study.write(tmp_path / "r")
    assert read_results(tmp_path / "r").plot("TR").key == "tr"
    panels = study.tests["D1"].recording().plot()
    assert [ax.get_ylabel().split("\n")[1] for ax in panels.figure.axes] == ["[N]", "[mm/s]", "[mm/s]"]
    with pytest.raises(CampaignError, match="no figure 'K9': name a quantity"):
        study.plot("K9")


def test_pandas_takes_a_table_without_further_packages(study):
    frame = pd.DataFrame(study.dynamic.to_dict(as_series=False))
    assert list(frame.columns) == study.dynamic.columns
    assert frame["K2 [N/m]"].dtype == float
    assert frame["K2 [N/m]"].mean() == pytest.approx(study.dynamic["K2 [N/m]"].mean(), rel=1e-12)


@pytest.mark.sampled(4)
def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path, monkeypatch):
    """Each code cell in order, in one namespace; what its last line gives shows itself."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    names: dict[str, object] = {}
    shown = []
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert (cell["outputs"], cell["execution_count"]) == ([], None)
        source = "".join(cell["source"])
        lines = ast.parse(source)
        last = lines.body.pop() if isinstance(lines.body[-1], ast.Expr) and not source.endswith(";") else None
        exec(compile(lines, cell["id"], "exec"), names)  # noqa: S102 - the project's own notebook
        if last is not None:
            value = eval(compile(ast.Expression(last.value), cell["id"], "eval"), names)  # noqa: S307
            shown.append(value)
            for how in ("_repr_html_", "_repr_svg_"):
                assert not hasattr(value, how) or getattr(value, how)()
    assert len(shown) >= 8
    assert (tmp_path / "first-look" / "results" / "study.json").is_file()
    assert (tmp_path / "tr.png").is_file()
