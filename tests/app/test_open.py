"""open: the report in the browser, or its path where no browser can be started; how a browser is started."""

import ast
import os
import stat
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from tests.processes import environment

from fourpole.app import browse

NOTING = """#!{python}
import os, pathlib, sys
page = pathlib.Path(sys.argv[-1].removeprefix("file://"))
note = pathlib.Path({note!r})
held = repr((sys.argv[1:], os.getcwd(), sorted(os.environ), page.read_text() if page.is_file() else ""))
note.with_suffix(".new").write_text(held)
note.with_suffix(".new").rename(note)
{more}
"""


@pytest.fixture
def page(tmp_path):
    (tmp_path / "dynamic.csv").write_text("test\n")
    (tmp_path / "report.html").write_text("<!doctype html>")
    return tmp_path / "report.html"


@pytest.fixture
def browser(tmp_path, monkeypatch):
    """A program in place of the browser, which notes what it is given; returns what it noted."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    note = tmp_path / "note"

    def make(name="browser", more="", variable="BROWSER"):
        place = tmp_path / "bin" / name
        place.parent.mkdir(exist_ok=True)
        place.write_text(NOTING.format(python=sys.executable, note=str(note), more=more))
        place.chmod(0o755)
        monkeypatch.setenv("PATH", str(place.parent))
        if variable:
            monkeypatch.setenv(variable, str(place))
        return place

    def noted():
        until = time.monotonic() + 60
        while not note.is_file():
            assert time.monotonic() < until
            time.sleep(0.02)
        return ast.literal_eval(note.read_text())

    monkeypatch.setattr(browse, "_REFUSES", 30.0)  # a busy machine takes its time
    make.noted = noted
    return make


def test_the_report_is_shown_and_its_path_printed(run, page, browser):
    browser()
    ran = run("open", page.parent)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert ran.stdout == f"report: {page}\n"
    words, folder, names, _ = browser.noted()
    assert words == [page.as_uri()]
    assert folder == "/"
    assert "AWS_SECRET_ACCESS_KEY" not in names
    assert "HOME" in names


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ("{0} --new %s --last", ["--new", "ADDRESS", "--last"]),
        ("{0} --new &", ["--new", "ADDRESS"]),
        ("none{1}{0}", ["ADDRESS"]),
    ],
)
def test_the_variable_browser_is_followed(browser, monkeypatch, stated, words):
    monkeypatch.setenv("BROWSER", stated.format(browser(), os.pathsep))
    assert browse.shown_in_browser("http://127.0.0.1:1/")
    assert browser.noted()[0] == [word.replace("ADDRESS", "http://127.0.0.1:1/") for word in words]


def test_the_browser_of_the_desktop_is_started(browser, monkeypatch):
    monkeypatch.delenv("BROWSER", raising=False)
    monkeypatch.setenv("DISPLAY", ":7")
    browser("xdg-open", variable="")
    assert browse.shown_in_browser("http://127.0.0.1:1/")
    assert "DISPLAY" in browser.noted()[2]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="another program shows pages here")
def test_a_browser_that_fails_is_not_one_that_was_started(run, page, browser):
    browser(more="sys.exit(3)")
    ran = run("open", page.parent)
    assert ran.exit_code == 0
    assert "no browser could be started" in ran.stderr


def test_a_program_in_the_working_folder_is_no_browser(tmp_path, browser, monkeypatch):
    place = browser("xdg-open", variable="")
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.delenv("BROWSER", raising=False)
    monkeypatch.chdir(place.parent)
    monkeypatch.setenv("PATH", os.pathsep.join(["", ".", "bin"]))
    assert not browse.shown_in_browser("http://127.0.0.1:1/")
    monkeypatch.setenv("BROWSER", "./xdg-open")
    assert not browse.shown_in_browser("http://127.0.0.1:1/")


def test_without_a_screen_no_browser_is_started(browser, monkeypatch):
    browser("xdg-open", variable="")
    for name in ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert not browse.shown_in_browser("http://127.0.0.1:1/")


def test_a_token_is_on_no_command_line(tmp_path, browser, monkeypatch):
    """The page that leads there is the user's alone, and is gone after its time."""
    monkeypatch.setattr(browse, "_LEADS", 1.0)
    address = "http://127.0.0.1:1/?token=a-b_c&x=<1>"
    browser()
    assert browse.shown_in_browser(address)
    ((word,), _, _, content) = browser.noted()
    assert "a-b_c" not in word
    assert 'content="0;url=http://127.0.0.1:1/?token=a-b_c&amp;x=&lt;1&gt;"' in content
    way = Path(unquote(urlsplit(word).path))
    assert way.parent.parent == tmp_path
    until = time.monotonic() + 60
    while way.parent.exists():
        assert time.monotonic() < until
        time.sleep(0.05)


def test_the_page_that_leads_there_is_the_users_and_goes_with_the_command(tmp_path, browser):
    browser()
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom fourpole.app.browse import shown_in_browser\n"
        "assert shown_in_browser('http://127.0.0.1:1/?token=1')\n"
        f"(way,) = Path({str(tmp_path)!r}).glob('fourpole-*/open.html')\n"
        "print(oct(way.stat().st_mode), oct(way.parent.stat().st_mode))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment())
    assert ran.stdout.split() == [oct(stat.S_IFREG | 0o600), oct(stat.S_IFDIR | 0o700)]
    assert not list(tmp_path.glob("fourpole-*"))


@pytest.mark.parametrize("snap", [True, False])
def test_a_browser_of_a_snap_can_read_the_page_that_leads_there(tmp_path, browser, monkeypatch, snap):
    monkeypatch.setenv("XDG_RUNTIME_DIR", "relative")
    if snap:
        (tmp_path / "snap").mkdir()
    browser()
    assert browse.shown_in_browser("http://127.0.0.1:1/?token=1")
    way = Path(unquote(urlsplit(browser.noted()[0][0]).path))
    assert (way.parent.parent == tmp_path) is snap


def test_results_without_a_report_lead_to_it(run, page):
    page.unlink()
    ran = run("open", page.parent)
    assert ran.exit_code == 2
    assert f"run fourpole report {page.parent}" in ran.stderr


def test_a_campaign_without_results_leads_to_analyse(run, campaign):
    ran = run("open", campaign)
    assert ran.exit_code == 2
    assert f"run fourpole analyse {campaign} first" in ran.stderr
