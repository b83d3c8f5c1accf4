"""open: the report in the browser, or its path where no browser can be started."""

import webbrowser

import pytest


@pytest.fixture
def page(tmp_path):
    (tmp_path / "dynamic.csv").write_text("test\n")
    (tmp_path / "report.html").write_text("<!doctype html>")
    return tmp_path / "report.html"


def test_the_report_is_shown_and_its_path_printed(run, page, monkeypatch):
    shown = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: shown.append(address) or True)
    ran = run("open", page.parent)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert ran.stdout == f"report: {page}\n"
    assert shown == [page.as_uri()]


def test_without_a_browser_the_path_is_enough(run, page, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    ran = run("open", page.parent)
    assert ran.exit_code == 0
    assert "no browser could be started" in ran.stderr


def test_results_without_a_report_lead_to_it(run, page):
    page.unlink()
    ran = run("open", page.parent)
    assert ran.exit_code == 2
    assert f"run fourpole report {page.parent}" in ran.stderr


def test_a_campaign_without_results_leads_to_analyse(run, campaign):
    ran = run("open", campaign)
    assert ran.exit_code == 2
    assert f"run fourpole analyse {campaign} first" in ran.stderr
