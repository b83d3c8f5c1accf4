"""The campaigns below one folder, by the keys of their addresses. A key is looked up in a list; it is never a path."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any

from fourpole.campaign.folder import MOST_TESTS, MOST_TOML
from fourpole.core.checks import VERDICTS
from fourpole.errors import CampaignError, FileError, FourpoleError
from fourpole.io.documents import MOST_CHARACTERS, json_of, rows_of, toml_of
from fourpole.io.door import check_name, open_regular, read_bytes, sha256_of
from fourpole.io.published import LIST, MOST_LIST
from fourpole.io.recordings import endings
from fourpole.io.source import decode
from fourpole.units import shown

#: Levels of folders in which campaigns are looked for, largest number of campaigns, and of entries of a folder.
_DEPTH, _MOST, _MOST_ENTRIES = 3, 500, 100_000
#: Files that make a folder a campaign.
_STATEMENT = ("campaign.toml", "tests.csv")
#: Largest tests.csv of a form [byte].
MOST_TABLE = 20_000_000
#: Longest title that is shown, and longest name of a new folder [byte].
_LONGEST, _LONGEST_NAME = 200, 80
#: The folder of the results of a campaign, which is no campaign itself.
_RESULTS = "results"
#: Documents of campaigns are read one at a time, so that all pages together take the memory of one.
_READING = threading.Lock()


class NoCampaignError(CampaignError):
    """There is no campaign of this key."""


@dataclass(frozen=True)
class LeftOut:
    """A folder that is no campaign here, though it looks like one, and the reason."""

    name: str
    reason: str


@dataclass(frozen=True)
class Place:
    """A campaign in the workspace: the key of its address, its name as shown, and its folder."""

    key: str
    name: str
    folder: Path

    @property
    def results(self) -> Path:
        """The folder of its results."""
        return self.folder / _RESULTS

    @property
    def analysed(self) -> bool:
        """Whether it has a study.json, which need not be a right one."""
        return os.path.isfile(self.results / LIST)  # noqa: PTH113 - Path.is_file raises where a folder is closed


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
        Why campaign.toml or tests.csv cannot be read; empty if they can.
    results_fault : str
        Why study.json cannot be read; empty if it can, or if there is none.
    """

    title: str
    verdicts: dict[str, int]
    analysed: datetime | None
    changed: tuple[str, ...]
    stated: bool
    fault: str = ""
    results_fault: str = ""


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
        return [one for one in self.listed() if isinstance(one, Place)]

    def listed(self) -> list[Place | LeftOut]:
        """The campaigns, and the folders that are left out, by their names."""
        there = islice(_campaigns(self.root, _DEPTH), _MOST)
        listed = [LeftOut(self._name(folder), reason) if reason else self.place_of(folder) for folder, reason in there]
        return sorted(listed, key=lambda one: one.name.casefold())

    def find(self, key: str) -> Place:
        """The campaign of a key; NoCampaignError if there is none."""
        for place in self.campaigns():
            if place.key == key:
                return place
        raise NoCampaignError("there is no such campaign: it was moved or deleted, or the address is not whole")

    def new_folder(self, name: str) -> Path:
        """A free folder for a campaign of this name, not made yet; it can be one on every system."""
        clean = re.sub(r"[^\w .+-]+", "-", name).strip(" .-")
        clean = clean.encode()[:_LONGEST_NAME].decode(errors="ignore").strip(" .-") or "campaign"
        try:
            check_name(clean)
        except FileError:
            clean = f"campaign {clean}"
        if clean == _RESULTS:  # which would not be looked into
            clean = f"campaign {clean}"
        folder = self.root / clean
        while folder.exists():
            folder = self.root / f"{clean} {secrets.token_hex(2)}"
        return folder

    def place_of(self, folder: Path) -> Place:
        """The place of a folder that lies in the workspace."""
        name = self._name(folder)
        return Place(_key(name), name, folder)

    def _name(self, folder: Path) -> str:
        name = folder.relative_to(self.root).as_posix()
        return self.root.name if name == "." else name


def state_of(place: Place) -> State:
    """How far a campaign is, from its files; none of them needs to be right."""
    record, analysed, results_fault = _record(place)
    title, stated, fault = _title(place)
    verdicts, hashes = record.get("verdicts"), record.get("sha256")
    counts = verdicts.items() if isinstance(verdicts, dict) else ()
    changed: tuple[str, ...] = ()
    if isinstance(hashes, dict):
        changed = tuple(name for name in _STATEMENT if _hash(place.folder, name) != hashes.get(name))
    return State(
        title=title,
        verdicts={name: count for name, count in counts if name in VERDICTS and type(count) is int and count > 0},
        analysed=analysed,
        changed=changed,
        stated=stated,
        fault=fault or _table_fault(place),
        results_fault=results_fault,
    )


def _record(place: Place) -> tuple[dict[str, Any], datetime | None, str]:
    """The content of study.json, when it was written, and why it cannot be read; nothing where it is missing."""
    if _is_missing(place.results):
        return {}, None, ""
    path = place.results / LIST
    try:
        if not place.results.is_dir():
            raise CampaignError("results: is no folder: move it away")
        if _is_missing(path):
            return {}, None, ""
        with _READING, open_regular(path, max_bytes=MOST_LIST, within=place.folder) as file:
            record = json_of(file.read(MOST_LIST), LIST)
            written = datetime.fromtimestamp(os.fstat(file.fileno()).st_mtime).astimezone()
    except (FourpoleError, OSError, ValueError, OverflowError) as error:
        return {}, None, _reason(error, path.name)
    if not isinstance(record, dict):
        return {}, None, f"{LIST} is not one that fourpole wrote"
    return record, written, ""


def _title(place: Place) -> tuple[str, bool, str]:
    """The title that a campaign states, whether it has a statement, and why that cannot be read."""
    path = place.folder / _STATEMENT[0]
    if _is_missing(path):
        return "", False, ""
    try:
        with _READING:
            content = read_bytes(path, max_bytes=MOST_TOML, within=place.folder)
            title = toml_of(content.decode("utf-8-sig"), path.name).get("title", "")
    except UnicodeDecodeError:
        return "", True, f"{path.name}: is not UTF-8 text; save the file as UTF-8"
    except (FourpoleError, OSError) as error:
        return "", True, _reason(error, path.name)
    return str(title)[:_LONGEST], True, ""


def _table_fault(place: Place) -> str:
    """Why tests.csv cannot be read as a table; empty if it can, or if there is none."""
    path = place.folder / _STATEMENT[1]
    if _is_missing(path):
        return ""
    try:
        with open_regular(path, max_bytes=MOST_TABLE, within=place.folder) as file:
            if os.fstat(file.fileno()).st_size > MOST_CHARACTERS:  # only then a cell can be too long
                with _READING:
                    for _ in rows_of(decode(file.read(MOST_TABLE), path.name)[0], path.name):
                        pass
    except (FourpoleError, OSError) as error:
        return _reason(error, path.name)
    return ""


def _is_missing(path: Path) -> bool:
    """Whether there is nothing; what cannot be looked up may be there."""
    try:
        path.lstat()
    except FileNotFoundError:
        return True
    except (OSError, ValueError):
        return False
    return False


def _reason(error: Exception, name: str) -> str:
    return str(error) if isinstance(error, FourpoleError) else f"{name}: {getattr(error, 'strerror', None) or error}"


def version_of(folder: Path) -> str:
    """A mark of the statement as it is now, by which two who change it notice each other."""
    mark = hashlib.sha256()
    for name in _STATEMENT:
        mark.update(_hash(folder, name).encode() + b"\n")
    return mark.hexdigest()[:16]


def _hash(folder: Path, name: str) -> str:
    with suppress(FourpoleError):
        return sha256_of(folder / name, max_bytes=MOST_TESTS, within=folder)
    return ""


def _campaigns(folder: Path, depth: int) -> Iterator[tuple[Path, str]]:
    """The campaigns in a folder or below it, each with the reason why it is left out, or an empty one.

    Hidden folders, links and folders of results are left out without a word.
    """
    inner: list[Path] = []
    try:
        with os.scandir(folder) as entries:
            for entry in islice(entries, _MOST_ENTRIES):
                if _makes_campaign(entry):
                    yield folder, _link_in(folder)
                    return
                if depth and not entry.name.startswith(".") and entry.name != _RESULTS and _is_folder(entry):
                    inner.append(folder / entry.name)
    except OSError as error:
        yield folder, f"cannot be looked into: {error.strerror or error}"
        return
    for path in sorted(inner):
        yield from _campaigns(path, depth - 1)


def _makes_campaign(entry: os.DirEntry[str]) -> bool:
    """Whether an entry of a folder states a campaign, or is a recording."""
    if entry.name in _STATEMENT:
        return True  # also one that cannot be read, which is told
    with suppress(OSError):
        return Path(entry.name).suffix.lower() in endings() and entry.is_file()
    return False


def _is_folder(entry: os.DirEntry[str]) -> bool:
    with suppress(OSError):
        return entry.is_dir(follow_symlinks=False)
    return False


def _link_in(folder: Path) -> str:
    """Why a campaign is left out: a link in its statement or results, which may lead out of the workspace."""
    results = folder / _RESULTS
    looked_for = {folder: (*_STATEMENT, results.name), results: (), results / "figures": (), results / "cache": ()}
    for place, names in looked_for.items():
        with suppress(OSError), os.scandir(place) as entries:
            for entry in entries:
                if entry.is_symlink() and (not names or entry.name in names):
                    path = (place / entry.name).relative_to(folder).as_posix()
                    return f"{shown(path)[1:-1]} is a link, which is not followed: put what it leads to in its place"
    return ""


def _key(name: str) -> str:
    """The part of an address that stands for a name: the name itself where it is plain, else with a short hash."""
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")
    if plain == name:
        return name
    # Half a character stands for a byte that is no text.
    return f"{plain or 'campaign'}~{hashlib.sha256(name.encode('utf-8', 'surrogatepass')).hexdigest()[:6]}"
