"""The built site in a browser without a network: formulas, search, and nothing from outside."""

import os
import re
from pathlib import Path
from urllib.parse import quote_plus

import pytest
from tests.report.browser import launched

SITE = Path(__file__).parents[2] / "build" / "site"


@pytest.fixture(scope="module")
def site():
    """The folder that `make docs` writes; without it the test is skipped, and fails where CI=true."""
    if not (SITE / "index.html").is_file():
        reason = "there is no build/site/index.html: run make docs"
        if os.environ.get("CI", "").lower() in ("1", "true", "yes"):
            pytest.fail(reason)
        pytest.skip(reason)
    return SITE


@pytest.fixture(scope="module")
def browser():
    with launched() as browser:
        yield browser


@pytest.fixture
def visit(site, browser):
    """Open a page of the site, with the network cut; what it asked of other places is kept."""
    rooms = []

    def opened(name, width=1280):
        room = browser.new_context(offline=True, viewport={"width": width, "height": 900})
        rooms.append(room)
        page = room.new_page()
        page.outside, page.faults = [], []
        page.on("request", lambda one: None if one.url.startswith(("file:", "data:")) else page.outside.append(one.url))
        page.on("pageerror", lambda error: page.faults.append(str(error)))
        page.on("requestfailed", lambda one: page.faults.append(one.url))
        name, _, query = name.partition("?")
        page.goto(f"{(site / name).as_uri()}?{query}")
        return page

    yield opened
    for room in rooms:
        room.close()


KINDS = ["index.html", "guides.html", "how-sure-are-you.html", "api/made/fourpole.core.routes.html", "checks.html"]


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("width", [1280, 390])
def test_a_page_needs_nothing_from_outside_and_fits_its_window(visit, name, width):
    page = visit(name, width)
    page.wait_for_load_state("load")
    assert page.outside == []
    assert page.faults == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("h1").count() == 1


def test_formulas_are_drawn(visit):
    """A fraction is taller than a line of text, which it is only if the browser lays out MathML."""
    page = visit("api/made/fourpole.core.routes.html")
    formulas = page.locator("div.math > math")
    assert formulas.count() >= 3
    first = formulas.first
    assert first.locator("mfrac").count() == 1
    line = page.evaluate("parseFloat(getComputedStyle(document.querySelector('article p')).fontSize)")
    assert first.bounding_box()["height"] > 1.8 * line


def test_no_formula_is_left_as_it_was_written(site):
    left = [
        page.relative_to(site).as_posix()
        for page in site.rglob("*.html")
        if re.search(r'<code>[^<]*\\(frac|omega|mathrm)|class="math[^"]*">\s*\\[(\[]', page.read_text(encoding="utf-8"))
    ]
    assert left == []


def test_no_page_names_another_place_for_what_it_loads(site):
    outside = r'="(?:https?:)?//'
    loads = re.compile(
        rf'<(?:script|img|iframe|source)[^>]*\ssrc{outside}|<link[^>]*rel="stylesheet"[^>]*href{outside}'
    )
    assert [page.name for page in site.rglob("*.html") if loads.search(page.read_text(encoding="utf-8"))] == []


def test_the_search_finds_a_word_without_a_network(visit):
    page = visit("search.html?q=transmissibility")
    page.wait_for_selector("#search-results li a")
    assert page.locator("#search-results li").count() > 3
    assert page.outside == []


QUESTIONS = {
    "two masses": "theory/three-phasors.html",
    "why two masses": "theory/three-phasors.html",
    "sign of V2": "symbols.html",
    "what does u cover": "theory/uncertainty.html",
    "model discrepancy": "theory/models.html#model-discrepancy",
    "when not to use Fourpole": "start.html#when-not-to-use-fourpole",
    "how to cite": "citing.html",
    "which file format": "formats/README.html",
    "rejected test": "checks.html",
    "eq. (12)": "theory/equations-1982.html",
    "maxwell_arm": "api/made/fourpole.core.routes.html#fourpole.core.routes.maxwell_arm",
}


def test_the_search_ranks_the_page_that_answers_first(visit):
    first = {}
    for question in QUESTIONS:
        page = visit(f"search.html?q={quote_plus(question)}")
        page.wait_for_selector("#search-results li a")
        first[question] = page.locator("#search-results li a").first.get_attribute("href")
    assert first == QUESTIONS


def test_code_can_be_copied_without_its_prompts(visit):
    page = visit("python.html")
    button = page.locator("button.copybtn").first
    assert page.locator("button.copybtn").count() >= 3
    code = page.evaluate("id => document.querySelector(id).innerText", button.get_attribute("data-clipboard-target"))
    assert ">>> " in code
