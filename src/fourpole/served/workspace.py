"""The campaigns below one folder, by the keys of their addresses. A key is looked up in a list; it is never a path."""

from __future__ import annotations

import hashlib
import json
import re
import secrets
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.door import sha256_of
from fourpole.io.recordings import endings

#: Levels of folders in which campaigns are looked for, and their largest number.
_DEPTH, _MOST = 3, 500
#: Files that make a folder a campaign.
_STATEMENT = ("campaign.toml", "tests.csv")
#: Largest statement whose hash is compared [byte].
_MOST_BYTES = 200_000_000


class NoCampaignError(CampaignError):
    """There is no campaign of this key."""


@dataclass(frozen=True)
class Place:
    """A campaign in the workspace: the key of its address, its name as shown, and its folder."""

    key: str
    name: str
    folder: Path

    @property
    def results(self) -> Path:
        """The folder of its results."""
        return self.folder / "results"


@dataclass(frozen=True)
class State:
    """How far a campaign is.

    Attributes
    ----------
    title : str
        The title that it states; empty without one.
    verdicts : dict of str to int
        Number of tests by verdict; empty before an analysis.
    analysed : datetime or None
        When its results were written.
    changed : tuple of str
        Statements that are not those of the results.
    stated : bool
        Whether it has a statement; otherwise it is a folder of recordings.
    fault : str
        Why campaign.toml is no TOML; empty if it is.
    """

    title: str
    verdicts: dict[str, int]
    analysed: datetime | None
    changed: tuple[str, ...]
    stated: bool
    fault: str = ""


class Workspace:
    """A folder with campaigns in it or below it.

    Parameters
    ----------
    root : Path
        The folder; nothing outside it is read or written.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()

    def campaigns(self) -> list[Place]:
        """The campaigns, and the folders of recordings that may become one, by their names."""
        found = [self._place(folder) for folder in islice(_campaigns(self.root, _DEPTH), _MOST)]
        return sorted(found, key=lambda one: one.name.casefold())

    def find(self, key: str) -> Place:
        """The campaign of a key; NoCampaignError if there is none."""
        for place in self.campaigns():
            if place.key == key:
                return place
        raise NoCampaignError("there is no such campaign: it was moved or deleted, or the address is not whole")

    def new_folder(self, name: str) -> Path:
        """A free folder for a campaign of this name, not made yet."""
        clean = re.sub(r"[^\w .+-]+", "-", name).strip(" .-")[:80] or "campaign"
        folder = self.root / clean
        while folder.exists():
            folder = self.root / f"{clean} {secrets.token_hex(2)}"
        return folder

    def place_of(self, folder: Path) -> Place:
        """The place of a folder that lies in the workspace."""
        return self._place(folder)

    def _place(self, folder: Path) -> Place:
        name = folder.relative_to(self.root).as_posix()
        name = self.root.name if name == "." else name
        return Place(_key(name), name, folder)


def state_of(place: Place) -> State:
    """How far a campaign is, from its files; none of them needs to be right."""
    record: dict[str, Any] = {}
    analysed = None
    with suppress(OSError, ValueError):
        path = place.results / "study.json"
        record = json.loads(path.read_text(encoding="utf-8"))
        analysed = datetime.fromtimestamp(path.stat().st_mtime).astimezone()
    record = record if isinstance(record, dict) else {}
    title = fault = ""
    try:
        with suppress(OSError), (place.folder / _STATEMENT[0]).open("rb") as file:
            title = str(tomllib.load(file).get("title", ""))
    except ValueError as error:
        fault = str(error)
    verdicts, hashes = record.get("verdicts"), record.get("sha256")
    changed: tuple[str, ...] = ()
    if isinstance(hashes, dict):
        changed = tuple(name for name in _STATEMENT if _hash(place.folder / name) != hashes.get(name))
    stated = (place.folder / _STATEMENT[0]).is_file()
    return State(title, verdicts if isinstance(verdicts, dict) else {}, analysed, changed, stated, fault)


def version_of(folder: Path) -> str:
    """A mark of the statement as it is now, by which two who change it notice each other."""
    mark = hashlib.sha256()
    for name in _STATEMENT:
        mark.update(_hash(folder / name).encode() + b"\n")
    return mark.hexdigest()[:16]


def _hash(path: Path) -> str:
    with suppress(FourpoleError):
        return sha256_of(path, max_bytes=_MOST_BYTES)
    return ""


def _campaigns(folder: Path, depth: int) -> Iterator[Path]:
    """The campaigns in a folder or below it; hidden folders, links and folders of results are left out."""
    try:
        inside = sorted(folder.iterdir())
    except OSError:
        return
    if _may_be_one(inside):
        if not _is_linked(folder, inside):
            yield folder
        return
    for path in inside:
        if depth and not (path.name.startswith(".") or path.name == "results" or path.is_symlink()) and path.is_dir():
            yield from _campaigns(path, depth - 1)


def _may_be_one(inside: Sequence[Path]) -> bool:
    """Whether a folder states a campaign, or holds recordings."""
    return any((path.name in _STATEMENT or path.suffix.lower() in endings()) and path.is_file() for path in inside)


def _is_linked(folder: Path, inside: Sequence[Path]) -> bool:
    """Whether the statement or a part of the results is a link, which may lead out of the workspace."""
    results = folder / "results"
    parts = [path for path in inside if path.name in (*_STATEMENT, results.name)]
    for place in (results, results / "figures", results / "cache"):
        with suppress(OSError):
            parts += place.iterdir()
    return any(path.is_symlink() for path in parts)


def _key(name: str) -> str:
    """The part of an address that stands for a name: the name itself where it is plain, else with a short hash."""
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")
    return plain if plain == name else f"{plain or 'campaign'}~{hashlib.sha256(name.encode()).hexdigest()[:6]}"
