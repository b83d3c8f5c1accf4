"""Which Fourpole runs: its version, and the commit where it was installed from a repository."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fourpole.io.processes import output_of, program_path
from fourpole.version import VERSION

_COMMIT = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_PACKAGE = Path(__file__).resolve().parents[1]
#: Longest wait for git [s]; largest file of a repository that is read [byte].
_PATIENCE, _MOST_BYTES = 10.0, 10_000_000


@dataclass(frozen=True)
class Origin:
    """The program that runs.

    Attributes
    ----------
    version : str
    commit : str
        Commit of its repository in hexadecimal digits; empty if it was installed without one.
    changed : bool or None
        Whether files of the package differ from the commit; None if that is not known.
    """

    version: str
    commit: str = ""
    changed: bool | None = None

    @property
    def text(self) -> str:
        """Version and commit in words: "0.2.0 (commit 1a2b3c4d5e6f, files changed since)"."""
        if not self.commit:
            return self.version
        states = {True: ", files changed since", False: "", None: ", not known whether files changed since"}
        return f"{self.version} (commit {self.commit[:12]}{states[self.changed]})"

    @property
    def record(self) -> dict[str, str | bool | None]:
        """The attributes, as JSON has them."""
        return {"version": self.version, "commit": self.commit or None, "changed": self.changed}


@cache
def origin() -> Origin:
    """The version of this package, and its commit: of its own checkout, or as pip noted it.

    A repository that merely surrounds the package is not asked, as one of a project with a virtual environment.

    Examples
    --------
    >>> origin().version == VERSION
    True
    """
    return origin_of(_PACKAGE)


def origin_of(package: Path) -> Origin:
    """The origin of a package in this folder; see `origin`."""
    root = package.parent.parent
    if package.parent.name == "src" and (root / ".git").exists():
        own = re.search(r'^name\s*=\s*"([^"]+)"', _text(root / "pyproject.toml"), flags=re.M)
        if own and own[1] == "fourpole":
            commit = _head(root / ".git")
            return Origin(VERSION, commit, _changed(root) if commit else None)
    commit = _noted_by_pip(package)
    return Origin(VERSION, commit, False if commit else None)


def _text(path: Path) -> str:
    """A small text file; empty if it cannot be read."""
    try:
        if path.stat().st_size > _MOST_BYTES:
            return ""
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""


def _head(git: Path) -> str:
    """The commit that is checked out, from the files of the repository; empty if they do not tell."""
    # In a further work tree .git is a file, which names the folder of its own.
    folder = git.parent / _text(git).removeprefix("gitdir:").strip() if git.is_file() else git
    head = _text(folder / "HEAD").strip()
    name = head.removeprefix("ref:").strip()
    if head.startswith("ref:") and (".." in name or not re.fullmatch(r"refs/[\w./+@=-]+", name)):
        return ""
    if head.startswith("ref:"):  # of a branch, from a file of its own or the list of packed ones
        common = folder / (_text(folder / "commondir").strip() or ".")
        head = _text(folder / name).strip() or _text(common / name).strip()
        if not head:
            listed = _text(common / "packed-refs")
            packed = re.search(rf"^([0-9a-f]{{40,64}}) {re.escape(name)}$", listed, flags=re.M)
            head = packed[1] if packed else ""
    return head if _COMMIT.fullmatch(head) else ""


def _changed(root: Path) -> bool | None:
    """Whether files of the package differ from the commit, as git says; None without git."""
    program = program_path("git")
    if program is None:
        return None
    # A monitor of files would be a further program.
    command = [program, "-c", "core.fsmonitor=false", "-C", str(root), "status", "--porcelain", "--", "src/fourpole"]
    try:
        code, printed, _ = output_of(command, seconds=_PATIENCE, variables={"GIT_OPTIONAL_LOCKS": "0"})
    except OSError:
        return None
    return None if code else bool(printed.strip())


def _noted_by_pip(package: Path) -> str:
    """The commit that pip noted at the installation from a repository (PEP 610); empty without one."""
    for noted in package.parent.glob("fourpole-*.dist-info/direct_url.json"):
        try:
            commit = json.loads(_text(noted))["vcs_info"]["commit_id"]
        except (ValueError, KeyError, TypeError):
            continue
        if isinstance(commit, str) and _COMMIT.fullmatch(commit):
            return commit
    return ""
