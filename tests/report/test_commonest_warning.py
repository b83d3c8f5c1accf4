"""From recordings to the page: a warning that several tests share stands there once, whatever is drawn."""

import csv

import pytest

from fourpole import analyse
from fourpole.core.checks import Code
from fourpole.findings import findings
from fourpole.findings.list import Reason
from fourpole.report.page import render_report
from fourpole.report.words.sentence import sentences
from fourpole.virtual import RADIAL_PLY, simulate_campaign
from fourpole.words import template


@pytest.fixture(scope="module")
def vague(tmp_path_factory):
    """A campaign whose three dynamic tests have K1 stated with a large uncertainty."""
    folder = simulate_campaign(
        tmp_path_factory.mktemp("vague"),
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[14.0, 16.0, 18.0],
    ).folder
    with (folder / "tests.csv").open() as file:
        head, *rows = csv.reader(file)
    cells = {"static": ["", ""], "dynamic": ["100000", "20000"]}
    rows = [[*head, "K1 [N/m]", "u(K1) [N/m]"], *([*row, *cells[row[head.index("kind")]]] for row in rows)]
    with (folder / "tests.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    return folder


def remarks_of(page: str) -> str:
    """The table of remarks on the page."""
    return page[page.index('id="remarks"') :].partition("</section>")[0]


def test_a_rejection_for_want_of_a_passive_arm_stands_once_with_its_tests(vague):
    stated = {name: (vague / name).read_text() for name in ("tests.csv", "campaign.toml")}
    (vague / "tests.csv").write_text(stated["tests.csv"].replace("100000", "300000"))
    (vague / "campaign.toml").write_text(stated["campaign.toml"] + '\n[analysis]\nasked = ["K2"]\n')
    try:
        results = analyse(vague, monte_carlo=0)
    finally:
        for name, text in stated.items():
            (vague / name).write_text(text)
    assert results.dynamic["verdict"].to_list() == ["rejected"] * 3
    assert len(set(results.dynamic["remarks"])) == 3
    found = findings(results)
    assert [(one.detail.code, one.tests) for one in found if isinstance(one.detail, Reason)] == [
        (Code.PASSIVE_ARM, ("D1", "D2", "D3"))
    ]
    remarks = remarks_of(render_report(results, findings=sentences(found), figures={}))
    assert remarks.count("<tr>") == 3
    assert remarks.count(template(Code.PASSIVE_ARM, "short", "rejected")) == 1


@pytest.mark.parametrize("monte_carlo", [0, 300])
def test_the_commonest_warning_stands_once_in_the_report(vague, monte_carlo):
    results = analyse(vague, monte_carlo=monte_carlo)
    assert results.dynamic["verdict"].to_list() == ["warning"] * 3
    found = findings(results)
    doubts = [(one.detail.code, one.tests) for one in found if isinstance(one.detail, Reason)]
    assert doubts == [(Code.UNCERTAINTY, ("D1", "D2", "D3"))]
    remarks = remarks_of(render_report(results, findings=sentences(found), figures={}))
    assert remarks.count(template(Code.UNCERTAINTY, "short")) == 1
    assert remarks.count("<tr>") == 2
