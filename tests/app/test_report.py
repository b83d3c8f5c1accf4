"""`fourpole report`: the statement of the report and its limits reach the page, and a PDF is printed beside it."""

import json

import pytest

from fourpole.app.cli import report
from fourpole.report import html

REPORT = '\n[report]\ncustomer = "Wheels <&> Co"\nunits = ["kPa"]\nlogo = "logo.svg"\n'
LIMITS = '[[limits]]\nquantity = "K1"\nhigh = "1 kN/m"\n'


@pytest.fixture
def stated(campaign, without_figures):
    """A campaign with a report, limits and a logo, whose pages are made without figures."""
    with (campaign / "campaign.toml").open("a") as file:
        file.write(REPORT)
    (campaign / "logo.svg").write_text("<svg/>")
    (campaign / "limits.toml").write_text(LIMITS)
    return campaign


def test_what_is_stated_stands_on_the_page(run, stated):
    done = run("analyse", stated, "--no-models")
    assert done.exit_code == 0
    assert "limits: FAIL: " in done.stdout
    page = (stated / "results" / "report.html").read_text(encoding="utf-8")
    assert "Wheels &lt;&amp;&gt; Co" in page
    assert "data:image/svg+xml;base64,PHN2Zy8+" in page
    assert "<b>FAIL</b>" in page
    assert "kPa" in page
    again = run("report", stated)
    assert (again.exit_code, again.stderr) == (0, "")
    (stated / "limits.toml").write_text(LIMITS.replace("1 kN/m", "9000 kN/m"))
    old = run("report", stated)
    assert "limits.toml changed since the analysis: run fourpole analyse" in old.stderr
    assert run("analyse", stated, "--no-models").exit_code == 0
    held = json.loads(run("analyse", stated, "--no-models", "--json").stdout)["limits"]
    assert {one["outcome"] for one in held} == {"pass"}
    assert held[0]["high"] == 9e6
    assert "<b>PASS</b>" in (stated / "results" / "report.html").read_text(encoding="utf-8")


@pytest.mark.sampled(2)
def test_a_program_gets_the_files_and_the_counts(run, stated, monkeypatch):
    assert run("analyse", stated, "--no-models", "--tables-only").exit_code == 0
    monkeypatch.setattr("fourpole.app.report.print_page", lambda page, path: path.write_bytes(b"%PDF"))
    monkeypatch.setattr("fourpole.app.report.browser", lambda: "chromium")
    made, folder = report(stated, pdf=True), stated / "results"
    assert made.files == [("report", folder / "report.html"), ("pdf", folder / "report.pdf")]
    assert all(path.is_file() for _, path in made.files)
    names = {what: str(path) for what, path in made.files}
    assert made.told == {**names, "figures": [], "verdicts": {"ok": 4, "warning": 0, "rejected": 0}}
    ran = run("report", stated, "--json")
    assert json.loads(ran.stdout)["report"] == str(folder / "report.html")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("limits.toml", LIMITS.replace("K1", "K7"), "limits.toml: limit 1: quantity: 'K7' is no quantity with limits"),
        ("limits.toml", LIMITS.replace("kN/m", "bar"), "limit 1: high: 'bar' is a pressure; a stiffness is needed"),
        ("logo.svg", "no picture", "[report] logo: 'logo.svg' is no PNG, JPEG or SVG image"),
    ],
)
def test_a_slip_is_said_by_check_and_analyse(run, stated, name, text, said):
    (stated / name).write_text(text)
    for command in ("check", "analyse"):
        ran = run(command, stated)
        assert ran.exit_code == 2
        assert said in ran.stderr


@pytest.mark.sampled(2)
def test_a_pdf_needs_a_browser_before_anything_is_made(run, stated, monkeypatch):
    assert run("analyse", stated, "--no-models").exit_code == 0
    page = stated / "results" / "report.html"
    former = page.stat().st_mtime_ns
    monkeypatch.setattr(html, "program_path", lambda name: None)
    monkeypatch.setattr(html, "_MAC", ())
    ran = run("report", stated, "--pdf")
    assert ran.exit_code == 2
    assert "no Chromium, Chrome or Edge" in ran.stderr
    assert page.stat().st_mtime_ns == former
