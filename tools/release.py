"""Make a release: check that all statements agree, run the tests, build, try the wheel, tag.

    python tools/release.py --dry-run    # without the tests and the tag; changed files are allowed
    python tools/release.py

Run it with the Python of .venv. It sends nothing anywhere: pushing the tag and publishing dist/ are steps of your own.
"""

from __future__ import annotations

import argparse
import os
import re
import runpy
import subprocess
import sys
import tempfile
import venv
from datetime import date
from pathlib import Path

import citation

ROOT = Path(__file__).resolve().parents[1]
VERSION = re.compile(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)")
SECTION = re.compile(r"^## \[(?P<name>[^\]]+)\](?: - (?P<day>\S+))?\n(?P<text>.*?)(?=^## |\Z)", re.M | re.S)


class StepError(Exception):
    """A step that did not succeed; its text says which, and what to do."""


def main(words: list[str] | None = None) -> int:
    """Run the steps; 0 if all succeeded, else 1."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--dry-run", action="store_true", help="no tests, no tag; files may be changed")
    dry = parser.parse_args(words).dry_run
    version = stated_version(ROOT)
    try:
        if faults := [*statement_faults(ROOT), *([] if dry else tree_faults(ROOT))]:
            raise StepError("\n".join(faults))
        say(f"The statements of version {version} agree.")
        if not dry:
            run("make", "test", cwd=ROOT)
            run("make", "every", cwd=ROOT)
        wheel = build(ROOT)
        try_wheel(wheel, version)
        if dry:
            say("Dry run: the tests were not run, and no tag was made.")
        else:
            run("git", "tag", "-a", f"v{version}", "-m", f"Fourpole {version}", cwd=ROOT)
            say(f"Made the tag v{version}. Push it, and publish the two files in dist/.")
    except StepError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def say(text: str) -> None:
    """Write a line at once, so that it stands before the output of the next step."""
    print(text, flush=True)


def run(*words: str | Path, cwd: Path, **more: str) -> str:
    """The output of a command, whose modules are not those of a checkout; an error if it fails."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | more
    say("$ " + " ".join(map(str, words)))
    done = subprocess.run(words, cwd=cwd, env=environment, text=True, stdout=subprocess.PIPE, check=False)
    if done.returncode:
        raise StepError(f"{words[0]} ended with exit code {done.returncode}\n{done.stdout}".rstrip())
    return done.stdout


def stated_version(root: Path) -> str:
    """The version of src/fourpole/version.py."""
    return str(runpy.run_path(str(root / "src" / "fourpole" / "version.py"))["VERSION"])


def tree_faults(root: Path) -> list[str]:
    """What keeps the checkout from being released: changed files, another branch, a tag that is there."""
    version, faults = stated_version(root), []
    if changed := run("git", "status", "--porcelain", cwd=root):
        faults.append(f"files are changed or new: commit or remove them\n{changed.rstrip()}")
    if (branch := run("git", "branch", "--show-current", cwd=root).strip()) != "main":
        faults.append(f"the branch is {branch or 'none'}: release from main")
    if run("git", "tag", "--list", f"v{version}", cwd=root).strip():
        faults.append(f"the tag v{version} exists: state the next version in src/fourpole/version.py")
    return faults


def statement_faults(root: Path) -> list[str]:
    """Where version.py, CHANGELOG.md, CITATION.cff and docs/citing.md contradict each other."""
    version = stated_version(root)
    if not VERSION.fullmatch(version):
        return [f"src/fourpole/version.py: {version!r} is not of the form 1.2.3"]
    return [*changelog_faults(root, version), *citation_faults(root, version)]


def sections_of(root: Path) -> list[re.Match[str]]:
    """The sections of CHANGELOG.md: name, day and text."""
    return list(SECTION.finditer((root / "CHANGELOG.md").read_text(encoding="utf-8")))


def changelog_faults(root: Path, version: str) -> list[str]:
    """The changelog must open with an empty section Unreleased, then this version with its day and its changes."""
    sections = sections_of(root)
    if [one["name"] for one in sections[:2]] != ["Unreleased", version]:
        return [f"CHANGELOG.md: the first sections must be [Unreleased] and [{version}]"]
    unreleased, released = sections[:2]
    faults = []
    if unreleased["text"].strip():
        faults.append(f"CHANGELOG.md: [Unreleased] is not empty; move its lines to [{version}]")
    if not released["text"].strip():
        faults.append(f"CHANGELOG.md: [{version}] is empty")
    if day_of(released["day"]) is None:
        faults.append(f"CHANGELOG.md: [{version}] needs its day, as in: ## [{version}] - 2026-11-23")
    return faults


def citation_faults(root: Path, version: str) -> list[str]:
    """CITATION.cff must state this version and the day of the changelog, and docs/citing.md must have its entry."""
    said, faults = citation.read_citation(root), []
    released, day = str(said["date-released"]), {one["name"]: one["day"] for one in sections_of(root)}.get(version)
    if str(said["version"]) != version:
        faults.append(f"CITATION.cff: version is {said['version']}, that of the program {version}")
    if day_of(released) != day_of(day):
        faults.append(f"CITATION.cff: date-released is {released}, CHANGELOG.md has {day}")
    page = (root / "docs" / "citing.md").read_text(encoding="utf-8")
    if citation.with_entry(page, citation.bibtex(said)) != page:
        faults.append("docs/citing.md: its entry is not that of CITATION.cff; run python tools/citation.py")
    return faults


def day_of(text: str | None) -> date | None:
    """A day in the form 2026-11-23; None if it is not one."""
    try:
        return date.fromisoformat(text or "")
    except ValueError:
        return None


def build(root: Path) -> Path:
    """Build sdist and wheel into dist/, and the wheel once more from the sdist: both must hold the same files."""
    for old in (root / "dist").glob("*"):
        old.unlink()
    run(sys.executable, "-m", "hatchling", "build", "-d", "dist", cwd=root)
    (wheel,), (sdist,) = (root / "dist").glob("*.whl"), (root / "dist").glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as folder:
        flags = ("--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", folder)
        run(sys.executable, "-m", "pip", "wheel", *flags, sdist, cwd=Path(folder))
        (again,) = Path(folder).glob("*.whl")
        if again.read_bytes() != wheel.read_bytes():
            raise StepError(f"the wheel built from {sdist.name} is not {wheel.name}")
    return wheel


def try_wheel(wheel: Path, version: str) -> None:
    """Install the wheel in an environment of its own, as a user would, and run its own test."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        venv.create(place / "env", with_pip=True)
        python = place / "env" / ("Scripts" if os.name == "nt" else "bin") / "python"
        run(python, "-m", "pip", "install", "--quiet", wheel, cwd=place)
        said = run(python, "-m", "fourpole", "--version", cwd=place).strip()
        if said.partition(" (")[0] != f"fourpole {version}":
            raise StepError(f"the installed wheel says {said!r}, not 'fourpole {version}'")
        say(run(python, "-m", "fourpole", "selftest", cwd=place).rstrip())


if __name__ == "__main__":
    sys.exit(main())
