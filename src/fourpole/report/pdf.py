"""The report as PDF, printed by the browser of this machine."""

from __future__ import annotations

import os
import shutil
import tempfile
from itertools import chain
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.processes import output_of, program_path

#: Names of browsers that print without a window, on the path, and their places on macOS and Windows.
_NAMES = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge",
    "microsoft-edge-stable", "msedge",
)  # fmt: skip
_MAC = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
_WINDOWS = (r"Google\Chrome\Application\chrome.exe", r"Microsoft\Edge\Application\msedge.exe")
_WINDOWS_ROOTS = ("PROGRAMFILES", "PROGRAMFILES(X86)", "LOCALAPPDATA")
#: Time after which printing is given up [s].
_SECONDS = 180


def browser() -> str:
    """The path of a Chromium, Chrome or Edge of this machine.

    Raises
    ------
    FileError
        If there is none.
    """
    roots = [root for name in _WINDOWS_ROOTS if (root := os.environ.get(name))]
    places = (*_MAC, *(f"{root}\\{rest}" for root in roots for rest in _WINDOWS))
    for place in chain(map(program_path, _NAMES), (place for place in places if Path(place).is_file())):
        if place:
            return place
    raise FileError(
        "no Chromium, Chrome or Edge is on this machine, which --pdf needs: install one, or open report.html in your "
        "browser and print it to a file"
    )


def print_page(page: Path, path: Path) -> None:
    """Print a page that opens offline into a PDF; what is folded on the page is open in print.

    Parameters
    ----------
    page : Path
        The HTML file.
    path : Path
        The PDF file; it is there only if the whole of it could be written.

    Raises
    ------
    FileError
        If there is no browser, or it did not print the page.
    """
    program = browser()
    # Chromium cannot set up its sandbox for the root user; the page has no script of others.
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    with tempfile.TemporaryDirectory(prefix="fourpole-") as folder:
        printed = Path(folder, "report.pdf")
        command = [
            program, "--headless", "--disable-gpu", "--no-first-run", "--disable-extensions", "--no-pdf-header-footer",
            "--disable-background-networking", "--disable-sync", f"--user-data-dir={Path(folder, 'profile')}",
            *(["--no-sandbox"] if root else []), f"--print-to-pdf={printed}", page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            code, _, said = output_of(command, seconds=_SECONDS)
        except TimeoutError:
            raise FileError(f"{program} did not print {page.name} within {_SECONDS} s") from None
        except OSError as error:
            raise FileError(f"{program} cannot be started: {error.strerror or error}") from None
        if not printed.is_file() or not printed.read_bytes().startswith(b"%PDF"):
            lines = said.decode(errors="replace").strip().splitlines()
            why = f": {lines[-1][:200]}" if lines else f", exit code {code}"
            raise FileError(f"{program} did not print {page.name}{why}")
        shutil.copyfile(printed, path)
