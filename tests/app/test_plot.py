"""`fourpole plot`: what a figure shows and how it looks, by options."""

import json

import pytest
from matplotlib import image

from fourpole.plot import PAPER


@pytest.fixture(scope="module")
def results(run, small_campaign, tmp_path_factory):
    """Results of three tests of one tyre, which is called radial-ply."""
    folder = tmp_path_factory.mktemp("plot") / "results"
    assert run("analyse", small_campaign, "--no-models", "--tables-only", "--out", folder).exit_code == 0
    return folder


def test_figures_are_listed_with_what_they_show(run, results):
    shown, told = run("plot", results).stdout, json.loads(run("plot", results, "--json").stdout)
    assert told["figures"]["loops"] in shown
    assert "loops" in shown
    assert "What passes through?" in shown
    assert "fig08" not in shown


@pytest.mark.sampled(2)
def test_a_condition_a_size_and_a_format(run, results, tmp_path):
    path = tmp_path / "tr.png"
    ran = run("plot", results, "tr", "--pressure", "1.7 bar", "--size", "89x60 mm", "--dpi", "200", "--out", path)
    assert ran.exit_code == 0, ran.stderr
    height, width = image.imread(path).shape[:2]
    assert (width, height) == (int(200 * 89 / 25.4), int(200 * 60 / 25.4))
    assert run("plot", results, "tr", "--size", "journal", "--out", path).exit_code == 0
    assert image.imread(path).shape[1] == 3.5 * 300
    assert run("plot", results, "tr", "--out", tmp_path / "tr.pdf").exit_code == 0
    assert (tmp_path / "tr.pdf").read_bytes().startswith(b"%PDF")


def test_colours_and_labels(run, results, tmp_path):
    path = tmp_path / "a.svg"
    options = ("--colour", "radial-ply=#ABCDEF", "--label", "radial-ply=Tyre A")
    ran = run("plot", results, "stiffness", *options, "--out", path)
    assert ran.exit_code == 0, ran.stderr
    assert "#abcdef" in path.read_text()
    assert "Tyre A" in path.read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--specimen", "radail-ply"), "did you mean 'radial-ply'?"),
        (("--pressure", "1.8 bar"), "did you mean 1.7 bar?"),
        (("--pressure", "1.7"), "--pressure: '1.7' has no unit"),
        (("--preload", "2000 bar"), "--preload: "),
        (("--test", "D99"), "no test 'D99': choose of D1, D2, D3, S1"),
        (("--size", "jurnal"), "did you mean journal?"),
        (("--size", "89x60"), "no size"),
        (("--size", "0x60 mm"), "give 1 to 100 in"),
        (("--dpi", "5"), "dpi is 5"),
        (("--colour", "radial-ply=nvy"), "did you mean navy?"),
        (("--colour", "radial"), "no SPECIMEN=VALUE"),
        (("--label", "radail-ply=A"), "did you mean 'radial-ply'?"),
        (("--theme", "pink"), "no theme 'pink'"),
    ],
)
def test_a_slip_is_one_message_with_the_nearest(run, results, options, message, tmp_path):
    path = tmp_path / "a.svg"
    ran = run("plot", results, "tr", *options, "--out", path)
    assert ran.exit_code == 2
    assert message in ran.stderr.replace("\n       ", " ").replace("\n", " ")
    assert "Traceback" not in ran.stderr
    assert not path.exists()


@pytest.mark.sampled(6)
def test_the_papers_figures_are_drawn_where_they_are_asked_for(run, results):
    figures = results / "figures"
    assert run("plot", results, "--paper").exit_code == 0
    drawn = {path.stem for path in figures.glob("*.svg")}
    assert {"fig02", "fig03", "fig05", "fig08", "fig14"} <= drawn & set(PAPER)
    assert run("report", results).exit_code == 0
    assert not {path.stem for path in figures.glob("*.svg")} & set(PAPER)
    assert run("report", results, "--paper").exit_code == 0
    assert {path.stem for path in figures.glob("*.svg")} >= {"fig14", "stiffness"}
    assert run("plot", results, "--paper", "--out", "a.svg").exit_code == 2
