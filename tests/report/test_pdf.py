"""Printing the report: by a real browser, and what is said without one."""

import os
import sys
import time
from pathlib import Path

import pytest

from fourpole.errors import FileError
from fourpole.report import html

PAGE = "<!DOCTYPE html><title>t</title><p>K1"


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "report.html"
    path.write_text(PAGE)
    return path


def stands_in(monkeypatch, path, script):
    """A program in place of the browser."""
    path.write_text(f"#!{sys.executable}\n{script}")
    path.chmod(0o755)
    monkeypatch.setattr(html, "program_path", lambda name: str(path))


def test_a_page_becomes_a_pdf(page, tmp_path):
    try:
        html.browser()
    except FileError:
        pytest.skip("no browser is here")
    html.print_page(page, tmp_path / "out.pdf")
    content = (tmp_path / "out.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert content.rstrip().endswith(b"%%EOF")


def test_without_a_browser_the_remedy_is_said(monkeypatch):
    monkeypatch.setattr(html, "program_path", lambda name: None)
    monkeypatch.setattr(html, "_MAC", ())
    with pytest.raises(FileError, match=r"--pdf needs: install one, or open report\.html"):
        html.browser()


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("import sys; sys.exit('no display')", "did not print report.html: no display"),
        ("import sys; sys.exit(3)", "did not print report.html, exit code 3"),
        ("import time; time.sleep(30)", "did not print report.html within 1 s"),
    ],
)
def test_a_browser_that_fails_leaves_nothing(monkeypatch, page, tmp_path, script, said):
    stands_in(monkeypatch, tmp_path / "browser", script)
    monkeypatch.setattr(html, "_SECONDS", 1 if "sleep" in script else 60)
    with pytest.raises(FileError, match=said):
        html.print_page(page, tmp_path / "out.pdf")
    assert not (tmp_path / "out.pdf").exists()


def test_what_is_no_pdf_is_not_taken(monkeypatch, page, tmp_path):
    script = (
        "import sys\nfor one in sys.argv:\n if one.startswith('--print-to-pdf='): open(one[15:], 'w').write('<html>')"
    )
    stands_in(monkeypatch, tmp_path / "browser", script)
    with pytest.raises(FileError, match="did not print"):
        html.print_page(page, tmp_path / "out.pdf")


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no groups of processes here")
@pytest.mark.sampled(4)
def test_a_browser_that_hangs_is_ended_with_what_it_started(monkeypatch, page, tmp_path):
    noted = tmp_path / "pid"
    script = (
        "import pathlib, subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        f"pathlib.Path({str(noted)!r}).write_text(str(child.pid))\ntime.sleep(60)"
    )
    stands_in(monkeypatch, tmp_path / "browser", script)
    monkeypatch.setattr(html, "_SECONDS", 5)
    with pytest.raises(FileError, match="within 5 s"):
        html.print_page(page, tmp_path / "out.pdf")
    child = int(noted.read_text())
    for _ in range(100):  # the system needs a moment to end it
        state = Path(f"/proc/{child}/stat")
        if not state.exists() or state.read_text().split()[2] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the program that the browser started still runs")
