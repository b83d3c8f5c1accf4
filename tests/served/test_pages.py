"""The app in a real browser: from dropped files to results, by mouse and by keyboard, in both themes."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from tests.report.browser import renewed, watched
from tests.served.barriers import barriers
from tests.served.server import Server, serving

from fourpole.campaign import read_campaign

pytestmark = pytest.mark.thorough

#: Time that an analysis on a busy machine may take [ms].
LONG = 120_000


@contextmanager
def opened(browser: Browser, server: Server) -> Iterator[Page]:
    """A page of a session of its own, which knows the token."""
    with browser.new_context(base_url=server.address) as room:
        name, value = server.cookie
        room.add_cookies([{"name": name, "value": value, "url": f"http://{server.host}"}])
        yield room.new_page()


@contextmanager
def visiting(window: Page) -> Iterator[Page]:
    """The page, renewed for a test, whose console must stay empty."""
    with watched(renewed(window)) as seen:
        yield window
    assert [*seen.console, *seen.errors] == []


@pytest.fixture(scope="module")
def window(browser: Browser, server: Server) -> Iterator[Page]:
    with opened(browser, server) as page:
        yield page


def campaign(page: Page) -> str:
    """Address of the first campaign of the home page."""
    page.goto("/")
    return str(page.locator("tbody th a").first.get_attribute("href"))


@pytest.mark.sampled(4)
def test_a_folder_without_campaigns_says_what_to_do(browser: Browser, empty_server: Server) -> None:
    with opened(browser, empty_server) as window, visiting(window) as page:
        page.goto("/")
        expect(page.get_by_text("There is no campaign yet")).to_be_visible()
        page.goto("/compare")
        expect(page.get_by_text("No campaign is analysed yet")).to_be_visible()


@pytest.mark.sampled(4)
def test_a_file_that_leads_to_the_address_opens_the_app(browser: Browser, server: Server, tmp_path: Path) -> None:
    """As `fourpole app` opens a browser; a link in a message of somebody else opens a page, too."""
    page_of_file = tmp_path / "app.html"
    page_of_file.write_text(f'<meta http-equiv="refresh" content="0; url={server.address}">')
    link = tmp_path / "link.html"
    link.write_text(f'<a href="http://{server.host}/compare">look at this</a>')
    with browser.new_context(base_url=server.address) as room, watched(page := room.new_page()) as seen:
        page.goto(page_of_file.as_uri())
        expect(page.get_by_role("heading", name="Campaigns")).to_be_visible()
        assert page.url == f"http://{server.host}/"
        page.goto(link.as_uri())
        page.get_by_role("link").click()
        expect(page.get_by_role("heading", name="Compare")).to_be_visible()
    assert [*seen.console, *seen.errors] == []


def test_a_browser_without_the_token_is_told_where_the_address_stands(browser: Browser, server: Server) -> None:
    with browser.new_context(base_url=server.address) as room:
        page = room.new_page()
        page.goto("/compare")
        expect(page.get_by_role("heading", name="Open the whole address first")).to_be_visible()
        expect(page.get_by_text("in the terminal where fourpole app runs")).to_be_visible()
        assert barriers(page) == []


def test_a_page_of_another_site_sees_and_changes_nothing(browser: Browser, server: Server, tmp_path: Path) -> None:
    """Its requests are refused though the browser knows the token."""
    (tmp_path / "evil.html").write_text("<title>evil</title>")
    script = """async (address) => {
      const said = [];
      for (const options of [{}, { mode: "no-cors", credentials: "include" },
        { method: "POST", mode: "no-cors", credentials: "include", body: "{}" }]) {
        try { said.push((await fetch(address, options)).type); } catch (error) { said.push("refused"); }
      }
      return said;
    }"""
    with opened(browser, server) as page:
        page.goto("/")
        page.goto((tmp_path / "evil.html").as_uri())
        found = page.evaluate(script, f"http://{server.host}/upload")
        assert set(found) <= {"refused", "opaque"}
        assert (
            page.evaluate(
                """(address) => new Promise((done) => {
              const one = document.createElement("script");
              one.src = address;
              one.onload = () => done("loaded");
              one.onerror = () => done("refused");
              document.body.append(one);
            })""",
                f"http://{server.host}/static/app.js",
            )
            == "refused"
        )


@pytest.mark.sampled(2)
def test_the_text_of_the_statement_is_mended(window: Page, server: Server) -> None:
    toml = next(server.root.rglob("campaign.toml"))
    before = toml.read_text()
    toml.write_text(f"title = 'x\n{before}")
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/statement")
        expect(page.locator("#problems li")).to_have_count(1)
        expect(page.locator("#form")).to_be_hidden()
        page.fill("#text", "title = 'x")
        page.click("#save-text")
        expect(page.locator("#problems")).to_contain_text("Not saved: campaign.toml: is no TOML")
        page.fill("#text", before)
        page.click("#save-text")
        expect(page.locator("[data-path='channels.force_in.unit']")).to_have_value("kN")
    assert toml.read_text() == before


@pytest.mark.sampled(4)
def test_a_wrong_entry_is_marked_in_the_words_of_the_command(window: Page, server: Server) -> None:
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/statement")
        toml = next(server.root.rglob("campaign.toml"))
        before, comment = toml.read_text(), "# the force cell was changed in May\n"
        toml.write_text(comment + before)
        page.reload()
        cell = page.locator("#tests tbody tr").nth(3).locator("input").nth(4)
        good = cell.input_value()
        cell.fill("much")
        page.click("#save")
        expect(page.locator("#problems")).to_contain_text("tests.csv row 5: pressure:")
        assert cell.get_attribute("aria-invalid") == "true"
        unit = page.locator("[data-path='channels.force_in.unit']")
        stated = unit.input_value()
        cell.fill(good)
        unit.fill("furlong")
        page.click("#save")
        expect(page.locator("#problems")).to_contain_text("furlong")
        assert unit.get_attribute("aria-invalid") == "true"
        unit.fill(stated)
        page.click("#save")
        expect(page.locator("#kept")).to_have_text("Saved.")
        assert toml.read_text() == comment + before
        toml.write_text(before)


@pytest.mark.sampled(4)
def test_all_faults_are_marked_while_the_form_is_filled_in(window: Page, server: Server) -> None:
    toml, table = next(server.root.rglob("campaign.toml")), next(server.root.rglob("tests.csv"))
    before = toml.read_text(), table.read_text()
    doubts = "\n# doubt: its unit\nforce_in ", "\n# doubt: its sign\nmotion_in "
    toml.write_text(before[0].replace("\nforce_in ", doubts[0]).replace("\nmotion_in ", doubts[1]))
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/statement")
        delay, unit = (page.locator(f"[data-path='channels.force_in.{key}']") for key in ("delay", "unit"))
        kind = page.locator("#tests tbody tr").nth(3).locator("input").nth(2)
        good = kind.input_value(), unit.input_value()
        for field, text in ((delay, "5"), (unit, "furlong"), (kind, "dynamik")):
            field.fill(text)
        expect(page.locator("#problems li")).to_have_count(2, timeout=LONG)  # a unit is checked when the keys are right
        delay.fill("")
        expect(page.locator(".wrong").first).to_contain_text("'furlong' is a length", timeout=LONG)
        expect(page.locator(".wrong").last).to_contain_text("did you mean 'dynamic'?")
        assert unit.get_attribute("aria-describedby") == page.locator(".wrong").first.get_attribute("id")
        assert barriers(page) == []
        page.set_viewport_size({"width": 390, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        settled = page.locator("[name=settled]")
        assert [settled.nth(at).is_checked() for at in (0, 1)] == [True, False]
        kind.fill(good[0])
        unit.fill(good[1])
        expect(page.locator(".wrong")).to_have_count(0, timeout=LONG)
        assert not settled.first.is_checked()
        settled.last.check()
        page.click("#save")
        expect(page.locator("#kept")).to_have_text("Saved.", timeout=LONG)
    assert toml.read_text() == before[0].replace("\nforce_in ", doubts[0])
    assert table.read_text() == before[1]
    toml.write_text(before[0])


@pytest.mark.sampled(6)
def test_the_demo_is_made_once_and_opened(empty_server: Server) -> None:
    server, demo = empty_server, empty_server.root / "fourpole-demo"
    first, second = (server.document("/demo", "POST", {}) for _ in range(2))
    assert first == second == {"next": "/c/fourpole-demo/run"}
    assert b"The demo is recorded" in server.ask(first["next"])[1]
    assert server.ask(first["next"], "DELETE")[0] == 204
    for body in ({"command": "demo"}, {"command": "demo", "options": []}):
        assert server.ask("/c/fourpole-demo/run", "POST", body)[0] in (400, 404)
    demo.mkdir(exist_ok=True)
    (demo / "campaign.toml").write_text("title = 'mine'\n")
    until = time.monotonic() + 30
    while server.document("/demo", "POST", {})["next"] != "/c/fourpole-demo":
        assert time.monotonic() < until
        time.sleep(0.1)
    assert (demo / "campaign.toml").read_text() == "title = 'mine'\n"
    shutil.rmtree(demo)


def test_rows_are_pasted_from_a_spreadsheet(window: Page) -> None:
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/statement")
        page.locator("#tests tbody tr").nth(0).locator("input").nth(3).focus()
        page.evaluate(
            """() => {
              const data = new DataTransfer();
              data.setData("text/plain", "one\\t1.5\\r\\ntwo\\t2.5\\r\\n");
              const paste = new ClipboardEvent("paste", { clipboardData: data, bubbles: true, cancelable: true });
              document.activeElement.dispatchEvent(paste);
            }"""
        )
        rows = page.locator("#tests tbody tr")
        assert [rows.nth(at).locator("input").nth(3).input_value() for at in (0, 1)] == ["one", "two"]
        assert [rows.nth(at).locator("input").nth(4).input_value() for at in (0, 1)] == ["1.5", "2.5"]
        page.goto("/")


def test_two_who_edit_are_told(server: Server) -> None:
    (page,) = set(re.findall('href="(/c/[^/"]+)"', server.ask("/")[1].decode()))
    status, content, _ = server.ask(f"{page}/statement", "PUT", {"version": "old", "heads": [], "rows": []})
    assert status == 409
    assert b"someone else" in content


@pytest.mark.sampled(4)
def test_a_test_is_excluded_with_a_reason_and_taken_in_again(window: Page, server: Server) -> None:
    with visiting(window) as page:
        table = next(server.root.rglob("tests.csv"))
        page.goto(f"{campaign(page)}/tests/D1")
        page.get_by_label("Exclude this test, because").fill("the tyre slipped on its rim")
        page.get_by_role("button", name="Exclude", exact=True).click()
        expect(page.get_by_text("Excluded: the tyre slipped on its rim.")).to_be_visible()
        assert "the tyre slipped on its rim" in table.read_text()
        page.get_by_role("button", name="Take it in again").click()
        expect(page.get_by_role("button", name="Exclude", exact=True)).to_be_visible()
        assert not any(test.excluded for test in read_campaign(table.parent).tests)


@pytest.mark.sampled(2)
def test_a_recording_is_looked_at_closer(window: Page) -> None:
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/tests/D2")
        pictures = page.locator("#signals svg")
        expect(pictures).to_have_count(3)
        whole = page.locator("#part").inner_text()
        page.get_by_role("button", name="Closer").click()
        expect(page.locator("#part")).not_to_have_text(whole)
        page.get_by_role("button", name="All").click()
        expect(page.locator("#part")).to_have_text(whole)
        box = pictures.first.bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 50)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 50)
        page.mouse.up()
        expect(page.locator("#part")).not_to_have_text(whole)
        expect(page.locator("#card svg")).not_to_have_count(0)


@pytest.mark.sampled(4)
def test_a_recording_is_judged_while_the_page_is_open(window: Page, server: Server) -> None:
    table = next(server.root.rglob("tests.csv"))
    before, recordings = table.read_text(), table.parent / "recordings"
    new = [recordings / "radial-ply_1.7bar_1000N_11Hz.csv", recordings / "cut short.csv"]
    with visiting(window) as page:
        page.goto(f"{campaign(page)}/watch")
        page.get_by_role("button", name="Start to watch").click()
        expect(page.locator("#phase")).to_have_text("watching", timeout=LONG)
        shutil.copy(recordings / "D9.csv", new[0])
        expect(page.locator("#last")).to_contain_text(new[0].stem, timeout=LONG)
        expect(page.locator("#last")).to_contain_text("Guessed: ")
        new[1].write_text("operator")
        expect(page.locator("#last")).to_contain_text("cut short", timeout=LONG)
        expect(page.locator("#last .v")).to_have_text("rejected")
        page.reload()
        expect(page.locator("#last a")).to_have_count(0)
        page.locator("#before a").first.click()
        expect(page.locator("#signals svg")).to_have_count(3)
        page.go_back()
        page.get_by_role("button", name="Stop").click()
        expect(page.locator("#phase")).to_have_text("stopped", timeout=LONG)
    for path in new:
        path.unlink()
    table.write_text(before)


@pytest.mark.sampled(2)
def test_results_by_keyboard_alone(window: Page) -> None:
    with visiting(window) as page:
        page.goto("/")
        for _ in range(12):
            page.keyboard.press("Tab")
            if page.evaluate("document.activeElement.closest('tbody th') !== null"):
                break
        page.keyboard.press("Enter")
        page.wait_for_url("**/c/*")
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") in ("main", "")
        page.goto(f"{page.url.partition('#')[0]}/tests/D1")
        page.keyboard.press("ArrowRight")
        page.wait_for_url("**/tests/D2")
        page.keyboard.press("ArrowLeft")
        page.wait_for_url("**/tests/D1")


@pytest.mark.sampled(2)
def test_a_point_of_a_figure_leads_to_its_recording(window: Page) -> None:
    with visiting(window) as page:
        page.goto(campaign(page))
        link = page.locator("#front .drawing a").first
        address = link.get_attribute("xlink:href")
        assert address is not None
        assert "/tests/" in address
        page.goto(address)
        expect(page.locator("#signals svg")).not_to_have_count(0)


@pytest.mark.parametrize("part", ["", "/tests", "/tests/D1", "/statement", "/run", None])
@pytest.mark.sampled(6)
def test_no_page_keeps_anyone_out(window: Page, part: str | None) -> None:
    with visiting(window) as page:
        address = "/" if part is None else f"{campaign(page)}{part}"
        page.set_viewport_size({"width": 820, "height": 1180})
        page.goto(address)
        page.wait_for_load_state("networkidle")
        for width in (820, 1280):
            page.set_viewport_size({"width": width, "height": 1180})
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert barriers(page) == []


def test_an_address_of_nothing_is_not_found(server: Server) -> None:
    assert server.ask("/c/nowhere")[0] == 404


@pytest.mark.sampled(8)
def test_sessions_do_not_disturb_each_other(analysed: Path, tmp_path: Path) -> None:
    for number in range(2):
        shutil.copytree(analysed, tmp_path / f"campaign {number}", ignore=shutil.ignore_patterns("results"))
        text = (tmp_path / f"campaign {number}" / "campaign.toml").read_text()
        (tmp_path / f"campaign {number}" / "campaign.toml").write_text(
            "\n".join(f'title = "number {number}"' if line.startswith("title") else line for line in text.splitlines())
        )
        table = tmp_path / f"campaign {number}" / "tests.csv"
        head, *rows = table.read_text().splitlines(keepends=True)
        table.write_text(head + "".join(row for row in rows if ",radial-ply,1.7," in row))
    with serving(tmp_path) as server:
        page = server.ask("/")[1].decode()
        addresses = sorted({part.split('"')[0] for part in page.split('href="')[1:] if part.startswith("/c/")})
        assert len(addresses) == 2
        for address in addresses:
            assert server.ask(f"{address}/run", "POST", {"command": "analyse", "options": ["--no-models"]})[0] == 204
        assert server.ask("/")[0] == 200
        assert not (tmp_path / "campaign 1" / "results" / "report.html").exists()  # it does not wait for their end
        for number, address in enumerate(addresses):
            wait_for(tmp_path / f"campaign {number}" / "results" / "report.html")
            assert f"number {number}" in server.ask(address)[1].decode()


def wait_for(path: Path) -> None:
    until = time.monotonic() + LONG / 1000
    while not path.exists() and time.monotonic() < until:
        time.sleep(0.2)
    assert path.exists()
