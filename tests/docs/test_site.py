"""The built site in a browser without a network: formulas, search, and nothing from outside."""

import os
import re
from pathlib import Path
from urllib.parse import quote_plus

import pytest
from tests.report.browser import launched, renewed

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


@pytest.fixture(scope="module")
def window(browser):
    """A page that all tests use, one after the other, with the network cut."""
    with browser.new_context(offline=True) as room:
        yield room.new_page()


@pytest.fixture
def visit(site, window):
    """Open a page of the site; what it asked of other places is kept."""
    page = renewed(window)
    page.outside, page.faults = [], []
    listeners = {
        "request": lambda one: None if one.url.startswith(("file:", "data:")) else page.outside.append(one.url),
        "pageerror": lambda error: page.faults.append(str(error)),
        "requestfailed": lambda one: page.faults.append(one.url),
    }
    for event, listener in listeners.items():
        page.on(event, listener)

    def opened(name):
        name, _, query = name.partition("?")
        page.goto(f"{(site / name).as_uri()}?{query}")
        return page

    yield opened
    page.unroute_all()
    for event, listener in listeners.items():
        page.remove_listener(event, listener)


KINDS = ["index.html", "guides.html", "how-sure-are-you.html", "api/made/fourpole.core.routes.html", "checks.html"]


@pytest.mark.parametrize("name", KINDS)
def test_a_page_needs_nothing_from_outside_and_fits_its_window(visit, name):
    page = visit(name)
    page.wait_for_load_state("load")
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.outside == []
    assert page.faults == []
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
    page = visit("search.html")
    page.route(re.compile("/_static/(scripts|styles|vendor)/"), lambda route: route.abort())  # the looks of a page
    first = {}
    for question in QUESTIONS:
        page.goto(f"{page.url.partition('?')[0]}?q={quote_plus(question)}", wait_until="commit")
        page.wait_for_selector("#search-results li a", state="attached")
        first[question] = page.locator("#search-results li a").first.get_attribute("href")
    assert first == QUESTIONS


def test_code_can_be_copied_without_its_prompts(visit):
    page = visit("python.html")
    button = page.locator("button.copybtn").first
    assert page.locator("button.copybtn").count() >= 3
    code = page.evaluate("id => document.querySelector(id).innerText", button.get_attribute("data-clipboard-target"))
    assert ">>> " in code
