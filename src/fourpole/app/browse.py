"""The command that shows the report in the browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path

from fourpole.app.console import out, say
from fourpole.errors import CampaignError


def run_open(folder: Path) -> None:
    """Show report.html of a results folder in the browser, and print its path."""
    page = folder / "report.html"
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder; name a campaign or its results")
    if not page.is_file():
        raise CampaignError(f"{folder}: has no report yet: run fourpole report {folder}")
    out(f"report: {page}")
    if not shown_in_browser(page.resolve().as_uri()):
        say("no browser could be started: open this file in one")


def shown_in_browser(address: str) -> bool:
    """Whether a browser was started; without a screen none is, for one in the terminal would take it over."""
    screen = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    try:
        return bool(screen or os.environ.get("BROWSER")) and webbrowser.open(address)
    except (webbrowser.Error, OSError):
        return False
