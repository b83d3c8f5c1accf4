"""The whole way by keyboard alone: from chosen files to an export, with a quiet console."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect
from tests.served.server import serving
from tests.served.test_pages import LONG, opened, visiting

from fourpole.campaign import read_campaign

pytestmark = pytest.mark.thorough

#: Values of the rig that the form asks for: value, unit and standard uncertainty.
RIG = {
    "moving mass": ("15", "kg", "0.01"),
    "preload spring": ("12.44", "kN/m", "0.02"),
    "preload damper": ("15", "N s/m", "0.5"),
}
#: Stops of the Tab key after which a part of a page counts as out of reach.
FARTHEST = 400


@pytest.fixture
def dropped(analysed: Path, tmp_path: Path) -> list[Path]:
    """Recordings of one specimen, whose names tell their conditions, and a file that is none."""
    with (analysed / "tests.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["tyre"] == "radial-ply"]
    files = []
    for row in rows:
        told = f"{row['preload [N]']}N_{row['frequency [Hz]']}Hz" if row["kind"] == "dynamic" else "static"
        files.append(tmp_path / f"radial_{row['pressure [bar]']}bar_{told}.csv")
        shutil.copy(analysed / row["file"], files[-1])
    files.append(tmp_path / "protocol.csv")
    files[-1].write_text("operator,weather\nA. Smith,rain\n")
    return files


def reach(page: Page, wanted: Locator) -> None:
    """Press Tab until a part of the page has the focus."""
    wanted.wait_for(timeout=LONG)
    for _ in range(FARTHEST):
        page.keyboard.press("Tab")
        if wanted.evaluate("one => one === document.activeElement"):
            return
    pytest.fail(f"the Tab key does not reach {wanted}")


def enter(page: Page, wanted: Locator, text: str = "") -> None:
    """Reach a part of the page, type a text, and press Enter."""
    reach(page, wanted)
    page.keyboard.type(text)
    page.keyboard.press("Enter")


def visit(page: Page, name: str) -> None:
    """Open a page of the campaign by its name in the navigation."""
    enter(page, page.get_by_role("link", name=name, exact=True).first)
    expect(page.locator("nav [aria-current=page]")).to_have_text(name)


@pytest.mark.sampled(8)
def test_from_files_to_an_export_by_keyboard(browser: Browser, dropped: list[Path], tmp_path: Path) -> None:
    root = tmp_path / "root"
    root.mkdir()
    with serving(root) as server, opened(browser, server) as window, visiting(window) as page:
        page.on("filechooser", lambda _: None)  # from here on choosers are not shown
        page.goto("/")
        reach(page, page.locator("#files"))
        with page.expect_file_chooser() as chooser:
            page.keyboard.press("Space")
        chooser.value.set_files(dropped)
        page.wait_for_url("**/run", timeout=LONG)
        state(page)
        assert read_campaign(root / "recordings").stated.all_rigs[""].values["moving_mass"].value == 15.0
        look(page)
        model(page)


def state(page: Page) -> None:
    """Correct the guess, and analyse."""
    enter(page, page.locator("#next"))
    expect(page.locator(".doubts").get_by_text("protocol.csv was left out")).to_be_visible()
    for name, values in RIG.items():
        for part, text in zip(("value", "unit", "std"), values, strict=True):
            reach(page, page.get_by_label(f"{name}: {part}"))
            page.keyboard.type(text)
    expect(page.locator("#chain")).to_contain_text("12.44 kN/m")
    enter(page, page.locator("#save-run"))
    page.wait_for_url("**/run")
    enter(page, page.locator("#next"))
    expect(page.locator("#front .verdict")).to_contain_text("0 rejected")


def look(page: Page) -> None:
    """Look at a recording, leave it out, and analyse again."""
    visit(page, "Tests")
    enter(page, page.locator(".tests-list a").first)
    first = page.url
    page.keyboard.press("ArrowRight")
    page.wait_for_url(lambda address: address != first)
    expect(page.locator("#signals svg")).to_have_count(3)
    expect(page.locator("#residual svg")).to_have_count(3)
    enter(page, page.get_by_label("Exclude this test, because"), "the tyre slipped")
    expect(page.get_by_text("Excluded: the tyre slipped.")).to_be_visible()
    test = page.url
    visit(page, "Run")
    enter(page, page.locator("#start"))
    enter(page, page.locator("#next"))
    expect(page.locator("#front .verdict")).to_contain_text("1 rejected")
    page.goto(test)
    expect(page.locator("#signals svg")).to_have_count(3)
    expect(page.locator("#residual")).to_have_count(0)


def model(page: Page) -> None:
    """Reach the fit, map, ask the map, load its address again, and export."""
    visit(page, "Model")
    reach(page, page.get_by_role("button", name="Fit again"))
    enter(page, page.get_by_role("button", name="Make the map"))
    page.wait_for_url("**/run")
    enter(page, page.locator("#next"))
    slider = page.locator("[data-for=pressure]")
    reach(page, slider)
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.wait_for_url("**pressure=**")
    expect(page.locator("#answers")).to_have_attribute("aria-busy", "false")
    value, answer = slider.get_attribute("aria-valuetext"), page.locator("#answers").inner_text()
    page.reload()
    assert slider.get_attribute("aria-valuetext") == value
    assert page.locator("#answers").inner_text() == answer
    visit(page, "Results")
    enter(page, page.get_by_role("button", name="results.mat"))
    expect(page.get_by_role("link", name="Save results.mat")).to_be_focused(timeout=LONG)
    with page.expect_download() as saved:
        page.keyboard.press("Enter")
    assert saved.value.suggested_filename == "recordings-results.mat"
