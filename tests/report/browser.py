"""A real browser for the tests of pages: Chromium of this machine, headless, with all that a page does written down."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Dialog, Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def executable() -> str:
    """Where Chromium is; without it the test is skipped, and fails where CI=true."""
    for name in NAMES:
        if found := shutil.which(name):
            return found
    reason = f"none of {', '.join(NAMES)} is on the path: run make chromium, or install one"
    if os.environ.get("CI", "").lower() in ("1", "true", "yes"):
        pytest.fail(reason)
    pytest.skip(reason)


@contextmanager
def launched() -> Iterator[Browser]:
    """A browser for a while."""
    path = executable()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Seen:
    """What a page did: nothing of it should be there but its own file."""

    console: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    dialogs: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def assert_quiet(self, path: Path) -> None:
        assert self.console == []
        assert self.errors == []
        assert self.dialogs == []
        assert set(self.requests) == {path.as_uri()}


@contextmanager
def watched(page: Page) -> Iterator[Seen]:
    """What a page does for a while; data: URLs are no requests."""
    seen = Seen()

    def answered(dialog: Dialog) -> None:
        if dialog.type == "beforeunload":  # of a form that is not saved
            dialog.accept()
        else:
            seen.dialogs.append(dialog.message)
            dialog.dismiss()

    listeners = {
        "console": lambda message: seen.console.append(message.text),
        "pageerror": lambda error: seen.errors.append(str(error)),
        "dialog": answered,
        "request": lambda one: None if one.url.startswith("data:") else seen.requests.append(one.url),
    }
    for event, listener in listeners.items():
        page.on(event, listener)
    try:
        yield seen
    finally:
        for event, listener in listeners.items():
            page.remove_listener(event, listener)


def renewed(page: Page) -> Page:
    """The same page, as wide as a screen and in light: to open something in it costs less than in a new one."""
    page.set_viewport_size({"width": 1280, "height": 900})
    page.emulate_media(color_scheme="light", media="screen")
    return page
