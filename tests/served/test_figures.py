"""Figures, model, plan and comparison as pages: what they answer is what the commands answer."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from urllib.parse import quote, urlencode

import pytest
from playwright.sync_api import Browser, Page, expect
from tests.served.barriers import barriers
from tests.served.server import Server
from tests.served.test_pages import LONG, opened, visiting
from tests.unlisted import unlisted

from fourpole.app.group import show
from fourpole.app.models import run_map
from fourpole.app.options import DataOptions
from fourpole.findings.compared import compare
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.query import Query, ask
from fourpole.report.compared import outcome
from fourpole.report.digits import cell
from fourpole.study.results import read_results

pytestmark = pytest.mark.thorough

POINT = {"tyre": "radial-ply", "pressure": "1.9 bar", "frequency": "13.7 Hz"}


@pytest.fixture(scope="module")
def mapped(server: Server, analysed: Path) -> Iterator[Server]:
    """The server with three further campaigns: one with a map of a tyre, one without models, one without results."""
    one, two, bare = folders = [server.root / name for name in ("one", "two", "bare")]
    for folder in (one, two):
        shutil.copytree(analysed, folder)
    show(run_map(one / "results", "zener", data=DataOptions(tyre=POINT["tyre"])), as_json=True)
    shutil.copytree(analysed, bare, ignore=shutil.ignore_patterns("results"))
    (two / "results" / "model.json").unlink()
    yield server
    for folder in folders:
        shutil.rmtree(folder)


@pytest.fixture(scope="module")
def window(browser: Browser, mapped: Server) -> Iterator[Page]:
    with opened(browser, mapped) as page:
        yield page


def page_of(server: Server, path: str, **query: str) -> str:
    status, content, _ = server.ask(f"{path}?{urlencode(query)}" if query else path)
    assert status == 200, content
    return content.decode()


def test_the_map_answers_what_the_command_answers(mapped: Server) -> None:
    folder = mapped.root / "one" / "results"
    state = {"pressure [Pa]": 1.9e5}
    (row,) = ask(read_model_file(folder / "map.json"), Query([13.7], state, POINT["tyre"]))
    shown = read_results(folder).shown
    found = mapped.document(f"/c/one/model/answer?{urlencode(POINT)}")
    assert found["fault"] == ""
    texts = {one["symbol"]: one["text"] for one in found["rows"]}
    for symbol, head in (("K′", "Re K* [N/m]"), ("K″", "Im K* [N/m]"), ("K2", "K2 [N/m]"), ("C", "C [N s/m]")):
        assert texts[symbol] == cell(row, head, shown)
    assert {"|K*|", "δ", "η", "K1", "TR"} <= texts.keys()
    panels = {one["symbol"]: one for one in found["curves"]["panels"]}
    grid = found["curves"]["frequency"]
    near = min(range(len(grid)), key=lambda at: abs(grid[at] - 13.7))
    (there,) = ask(read_model_file(folder / "map.json"), Query([grid[near]], state, POINT["tyre"]))
    assert panels["K′"]["y"][near] == pytest.approx(there["Re K* [N/m]"] / 1e3, rel=1e-5)
    assert panels["K′"]["half"][near] == pytest.approx(1.96 * there["u(Re K*) [N/m]"] / 1e3, rel=1e-3)
    assert all(text in page_of(mapped, "/c/one/model", **POINT) for text in texts.values())


def test_outside_the_tests_the_command_speaks(mapped: Server) -> None:
    outside = {**POINT, "pressure": "4 bar"}
    found = mapped.document(f"/c/one/model/answer?{urlencode(outside)}")
    assert "4 bar is outside what was measured" in found["fault"]
    assert found["rows"] == []
    beyond = mapped.document(f"/c/one/model/answer?{urlencode({**outside, 'beyond': '1'})}")
    assert beyond["fault"] == ""
    assert "outside what was measured" in beyond["remarks"][0]
    for wrong in ("much", "1 furlong", "nan bar", "9" * 400):
        found = mapped.document(f"/c/one/model/answer?{urlencode({**POINT, 'pressure': wrong})}")
        assert found["fault"]
    assert mapped.ask("/c/one/model/answer?tyre=nobody", headers={"Accept": "*/*"})[0] == 400


#: Kinds for vehicle simulations.
VEHICLE = ("statespace", "modelica", "tir", "table", "fmu")


@pytest.mark.parametrize("kind", ["mat", "tydex", "uff", "prony", "abaqus", "xlsx", "netcdf", *VEHICLE])
@pytest.mark.sampled(8)
def test_exports_are_offered_and_nothing_is_left_in_the_results(mapped: Server, kind: str) -> None:
    stated = {"specimen": "radial-ply"} if kind in VEHICLE else {}
    stated |= {"frequency": "15 Hz"} if kind == "tir" else {}
    before = set((mapped.root / "one").rglob("*"))
    shown = asked(mapped, kind, **stated)
    (name,) = re.findall(r'ask/files/([^"]+)" download', shown)
    status, content, headers = mapped.ask(f"/c/one/ask/files/{name}")
    assert status == 200, content
    assert len(content) > 100
    assert 'filename="one-' in headers["content-disposition"]
    assert set((mapped.root / "one").rglob("*")) == before


def asked(server: Server, kind: str, place: str = "one", **stated: str) -> str:
    """The page with the answer of an export."""
    status, content, _ = server.ask(f"/c/{place}/ask", "POST", {"command": "export", "to": kind, **stated})
    assert status == 204, content
    until = time.monotonic() + 60
    while b"At work" in (content := server.ask(f"/c/{place}/ask?command=export")[1]):
        assert time.monotonic() < until
        time.sleep(0.1)
    return unescape(content.decode())


@pytest.mark.parametrize(
    ("place", "kind", "stated", "why"),
    [
        ("two", "prony", {}, "model"),
        ("one", "nothing", {}, "no kind of file 'nothing'"),
        ("one", "prony", {"mode": "shear", "height": "10"}, "height"),
        ("one", "tir", {}, "--frequency"),
        ("one", "tir", {"frequency": "-1 Hz"}, "must be positive"),
        ("one", "statespace", {"of": "map", "at": "pressure=9 bar, preload=1 kN"}, "outside what was measured"),
        ("one", "statespace", {"at": "nonsense"}, "no operating point"),
    ],
)
@pytest.mark.sampled(6)
def test_an_export_that_cannot_be_says_why(
    mapped: Server, place: str, kind: str, stated: dict[str, str], why: str
) -> None:
    shown = asked(mapped, kind, place, **stated)
    assert why in shown
    assert "ask/files/" not in shown


def test_the_exports_are_those_that_the_results_have_what_they_need_for(mapped: Server) -> None:
    unlisted(mapped.root / "two" / "results")
    one, two = (page_of(mapped, f"/c/{name}") for name in ("one", "two"))
    assert 'name="to" value="mat"' in one
    assert 'name="to" value="mat"' in two
    assert one.count('name="to" value="fmu"') == 2  # of the fits and of the map
    assert 'name="to" value="fmu"' not in two
    assert "There are more when" in two
    tir = one[one.index('name="to" value="tir"') :]
    tir = tir[: tir.index("</form>")]
    assert {"--at", "--frequency", "--radius", "--specimen"} < {*re.findall(r"--[\w-]+", tir)}
    assert "--height" not in tir


def test_a_figure_of_any_quantity_over_any_axis(mapped: Server) -> None:
    page = page_of(mapped, "/c/one/explore", quantity="k2", over="pressure")
    assert "/c/one/tests/D1" in page
    assert "<svg" in page
    assert "K2 over pressure" in page
    assert "K2 [kN/m] over pressure [bar]" in page
    part = page_of(mapped, "/c/one/explore", quantity="k2", over="frequency", specimen="radial-ply", pressure="1.7 bar")
    tests = read_results(mapped.root / "one" / "results").dynamic
    for row in tests.iter_rows(named=True):
        there = f'<th scope="row" class="name"><a href="/c/one/tests/{row["test"]}">' in part
        assert there == (row["tyre"] == "radial-ply" and abs(row["pressure [Pa]"] / 1.7e5 - 1) < 0.02)
    assert "<svg" in page_of(mapped, "/c/one/explore", figure="nyquist")


def test_a_wrong_choice_is_said_on_the_page(mapped: Server) -> None:
    for query, why in (
        ({"quantity": "<b>"}, "no quantity &#39;&lt;b&gt;&#39;"),
        ({"quantity": "k2", "over": "colour"}, "no axis"),
        ({"figure": "nowhere"}, "no figure"),
        ({"specimen": "<i>x</i>"}, "&lt;i&gt;x&lt;/i&gt;"),
        ({"pressure": "9 bar"}, "bar"),
        ({"quantity": "cycle_loss", "over": "frequency"}, "hold nothing that this figure shows"),
    ):
        page = page_of(mapped, "/c/one/explore", **query)
        assert why in page.partition('role="alert"')[2]
        assert "<b>'" not in page


@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_a_figure_is_saved(mapped: Server, form: str, begin: bytes) -> None:
    status, content, headers = mapped.ask(f"/c/one/figure.{form}?quantity=c&over=pressure", headers={"Accept": "*/*"})
    assert status == 200
    assert content.startswith(begin)
    assert f"one-c-over-pressure.{form}" in headers["content-disposition"]


def test_the_plan_is_that_of_the_command(mapped: Server) -> None:
    page = page_of(mapped, "/c/one/plan/expected", wanted="0.01 %")
    assert "Wanted U of 0.02 % (u of 0.01 %) of K2 and C" in page
    assert "Each remedy alone" in page
    assert "U(K2) [%]" in page
    status, content, headers = mapped.ask("/c/one/plan/run-sheet.csv?added_mass=5%20kg&repeats=2")
    assert status == 200
    assert content.startswith(b"test,file,kind,tyre")
    assert b"-5kg" in content
    assert "one-tests.csv" in headers["content-disposition"]
    assert "is not known yet: guess its K1, K2 and C" in page_of(mapped, "/c/bare/plan/expected")
    guessed = {"k1": "180 kN/m", "k2": "120 kN/m", "c": "700 N s/m"}
    assert "U(K2) [%]" in page_of(mapped, "/c/bare/plan/expected", **guessed)
    for wrong in ({"wanted": "-1 %"}, {"cycles": "many"}, {"added_mass": "5 m"}, {"k1": "<b>"}):
        assert 'role="alert"' in page_of(mapped, "/c/one/plan/expected", **wrong)


def test_the_comparison_is_that_of_the_command(mapped: Server) -> None:
    page = page_of(mapped, "/compare", a="one", first="cross-ply", second="radial-ply")
    expected = compare(mapped.root / "one", specimens=("cross-ply", "radial-ply"))
    assert outcome(expected) in page
    both = page_of(mapped, "/compare", a="one", b="two")
    assert outcome(compare(mapped.root / "one", mapped.root / "two")) in both
    assert "Choose a second campaign" in page_of(mapped, "/compare", a="one")
    assert "there is no such campaign" in page_of(mapped, "/compare", a="nobody")
    assert 'role="alert"' in page_of(mapped, "/compare", a="one", first="cross-ply", second="cross-ply")


def test_options_of_a_command_are_those_that_it_has(mapped: Server) -> None:
    for options in (["--out=/tmp/x"], ["--model=a b"], ["--model=../x"], ["--share=--out"], ["x"], [7]):
        status, _, _ = mapped.ask("/c/two/run", "POST", {"command": "fit", "options": options})
        assert status == 400, options


@pytest.mark.sampled(2)
def test_the_sliders_answer_and_stand_in_the_address(window: Page) -> None:
    with visiting(window) as page:
        page.goto("/c/one/model?tyre=radial-ply")
        expect(page.locator("#curves svg")).to_have_count(4)
        first = page.locator("#answers").inner_text()
        slider = page.locator("[data-for=pressure]")
        slider.focus()
        for _ in range(20):
            page.keyboard.press("ArrowRight")
        expect(page.locator("#answers")).not_to_have_text(first)
        page.wait_for_url("**pressure=**")
        value = page.locator("[name=pressure]").input_value()
        said = slider.get_attribute("aria-valuetext")
        assert said == f"{value} bar"
        expect(page.locator("#answers")).to_have_attribute("aria-busy", "false")
        answer = page.locator("#answers").inner_text()
        page.reload()
        assert page.locator("[name=pressure]").input_value() == value
        assert page.locator("#answers").inner_text() == answer
        page.fill("[name=frequency]", "90")
        expect(page.locator("#fault")).to_contain_text("90 Hz is outside the measured band")
        page.get_by_label("Answer outside").check()
        expect(page.locator("#fault")).to_be_hidden()
        expect(page.locator("#remarks")).to_contain_text("octaves outside the measured band")


def test_without_a_map_a_condition_is_chosen(window: Page, mapped: Server) -> None:
    folder = unlisted(mapped.root / "one" / "results")
    shutil.move(folder / "map.json", folder / "map.away")
    try:
        with visiting(window) as page:
            page.goto("/c/one/model?tyre=radial-ply")
            first = page.locator("#answers").inner_text()
            chosen = page.locator("#condition option").nth(1).inner_text()
            page.select_option("#condition", chosen)
            page.wait_for_url("**pressure=2.4**")
            expect(page.locator("#answers")).not_to_have_text(first)
            expect(page.locator("#answers")).to_have_attribute("aria-busy", "false")
            answer = page.locator("#answers").inner_text()
            assert answer != first
            page.reload()
            assert page.locator("#condition").input_value() == chosen
            assert page.locator("#answers").inner_text() == answer
    finally:
        shutil.move(folder / "map.away", folder / "map.json")


@pytest.mark.sampled(2)
def test_a_model_is_fitted_from_the_page(window: Page, mapped: Server) -> None:
    fitted = unlisted(mapped.root / "two" / "results") / "model.json"
    with visiting(window) as page:
        page.goto("/c/two/model")
        expect(page.get_by_text("No model was fitted yet")).to_be_visible()
        page.select_option("[name=model]", "zener")
        page.get_by_role("button", name="Fit", exact=True).click()
        page.wait_for_url("**/run")
        expect(page.locator("#next")).to_have_text("Show the model", timeout=LONG)
    assert read_model_file(fitted).models[0].model == "zener"
    fitted.unlink()


@pytest.mark.sampled(6)
def test_an_export_is_made_and_offered_where_it_was_asked_for(window: Page) -> None:
    with visiting(window) as page:
        page.goto("/c/one")
        page.get_by_role("button", name="results.mat").press("Enter")
        link = page.get_by_role("link", name="Save results.mat")
        expect(link).to_be_focused(timeout=LONG)
        with page.expect_download() as saved:
            page.keyboard.press("Enter")
        assert saved.value.suggested_filename == "one-results.mat"
        page.get_by_role("button", name="prony.k").click()
        expect(page.locator("#answer")).to_contain_text("no elastic moduli", timeout=LONG)
        page.set_viewport_size({"width": 390, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert barriers(page) == []
        page.reload()
        expect(page.locator("#answer")).to_contain_text("no elastic moduli")


@pytest.mark.sampled(2)
def test_a_choice_shows_its_figure_at_once(window: Page) -> None:
    with visiting(window) as page:
        page.goto("/c/one/explore")
        page.select_option("[name=quantity]", "c")
        expect(page.locator("figcaption b")).to_contain_text("C over frequency")
        page.select_option("[name=over]", "pressure")
        expect(page.locator("figcaption b")).to_contain_text("C over pressure")
        assert "quantity=c&over=pressure" in page.url
        page.reload()
        expect(page.locator("figcaption b")).to_contain_text("C over pressure")
        page.select_option("[name=figure]", "rig-found")
        expect(page.locator("[name=quantity]")).to_be_disabled()
        expect(page.locator("figcaption b")).not_to_contain_text("C over")
        page.go_back()
        expect(page.locator("figcaption b")).to_contain_text("C over pressure")
        address = page.locator(".drawing a").first.get_attribute("xlink:href")
        assert "/tests/" in str(address)


@pytest.mark.parametrize(
    "address",
    ["/c/one/explore?quantity=k2&over=pressure", "/c/one/model", "/c/two/model", "/c/one/plan?wanted=0.01+%25",
     "/compare?a=one&first=cross-ply&second=radial-ply", "/c/bare/plan"],
)  # fmt: skip
@pytest.mark.sampled(6)
def test_no_page_keeps_anyone_out(window: Page, address: str) -> None:
    with visiting(window) as page:
        page.set_viewport_size({"width": 820, "height": 1180})
        page.goto(address)
        expect(page.locator("[aria-busy=true]")).to_have_count(0, timeout=LONG)
        for width in (820, 1280):
            page.set_viewport_size({"width": width, "height": 1180})
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert barriers(page) == []


def test_a_page_without_results_leads_to_the_run(mapped: Server) -> None:
    for part in ("explore", "model"):
        status, _, headers = mapped.ask(f"/c/bare/{part}")
        assert (status, headers["location"]) == (303, f"/c/{quote('bare')}/run")
