"""The campaigns below one folder, by the keys of their addresses, and files that a browser sends to become one."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
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


#: Largest size of all files of an upload [byte], largest number of them, and of uploads at a time.
MOST_BYTES, MOST_FILES, _AT_ONCE = 2 * 1024**3, 10_000, 20
#: Longest name of a file or folder, and deepest folder.
_LONGEST_PART, _DEEPEST = 120, 8
#: An upload that has not moved for this time is given up [s].
_PATIENCE = 900.0
_HIDDEN = ".fourpole-upload-"


@dataclass(eq=False)
class Upload:
    """Files on their way: their paths and sizes as announced, and the hidden folder that they go into."""

    name: str
    folder: Path
    files: dict[int, tuple[Path, int]]
    moved: float = field(default_factory=time.monotonic)
    arrived: set[int] = field(default_factory=set)


class Uploads:
    """Uploads of a workspace, by their tickets.

    Parameters
    ----------
    workspace : Workspace
        Where the campaigns are made, by this server alone: what former ones left of uploads is deleted.
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._open: dict[str, Upload] = {}
        for left in workspace.root.glob(f"{_HIDDEN}*"):
            shutil.rmtree(left, ignore_errors=True)

    def begin(self, name: str, files: Sequence[tuple[str, int]]) -> tuple[str, dict[int, str]]:
        """A ticket for files with these names and sizes, and the reasons why some of them are not taken, by number.

        Raises
        ------
        FileError
            If they are too many or too large, or none of the names can be that of a file of the campaign.
        """
        self._give_up()
        if len(self._open) >= _AT_ONCE:
            raise FileError("too many uploads at a time: wait until one of them is done")
        if not files:
            raise FileError("there is no file to take")
        if len(files) > MOST_FILES:
            raise FileError(f"{len(files)} files are too many: at most {MOST_FILES} at a time")
        total = sum(max(0, size) for _, size in files)
        if total > MOST_BYTES:
            raise FileError(
                f"{total / 1e9:.1f} GB are too much: at most {MOST_BYTES / 1024**3:.0f} GiB at a time. Put the files "
                "into a folder below the one that fourpole app was started with instead"
            )
        paths, refused = _sorted(files)
        if not paths:
            raise FileError(next(iter(refused.values())))
        folder = self._workspace.root / f"{_HIDDEN}{secrets.token_hex(8)}"
        folder.mkdir()
        ticket = secrets.token_urlsafe(24)
        self._open[ticket] = Upload(name, folder, paths)
        return ticket, refused

    async def take(self, ticket: str, number: int, body: AsyncIterator[bytes]) -> None:
        """Write one file as it comes; FileError, and no file, if it is not as long as announced."""
        upload = self._found(ticket)
        if number not in upload.files:
            raise FileError("this file was not announced")
        path, size = upload.files[number]
        target = upload.folder / path
        done = 0
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            new = target.open("xb")
        except OSError as error:
            raise FileError(f"{shown(path.name)} cannot be taken: {error.strerror or error}") from None
        try:
            with new as file:
                async for part in body:
                    done += len(part)
                    if done > size:
                        break
                    file.write(part)
                    upload.moved = time.monotonic()
        except BaseException:
            target.unlink(missing_ok=True)
            raise
        if done != size:
            target.unlink(missing_ok=True)
            raise FileError(f"{shown(path.name)} is not as long as announced: send it again")
        upload.arrived.add(number)

    def finish(self, ticket: str) -> Path:
        """The campaign folder, with all files in it; FileError if some are missing."""
        upload = self._found(ticket)
        missing = len(upload.files) - len(upload.arrived)
        if missing:
            raise FileError(f"{missing} of {len(upload.files)} files have not arrived: send them again")
        target = self._workspace.new_folder(upload.name)
        upload.folder.rename(target)
        del self._open[ticket]
        return target

    def drop(self, ticket: str) -> None:
        """Forget an upload and delete what came of it."""
        upload = self._open.pop(ticket, None)
        if upload is not None:
            shutil.rmtree(upload.folder, ignore_errors=True)

    def close(self) -> None:
        """Forget all uploads."""
        for ticket in list(self._open):
            self.drop(ticket)

    def _found(self, ticket: str) -> Upload:
        if ticket not in self._open:
            raise FileError("this upload is over, or was given up: begin again")
        return self._open[ticket]

    def _give_up(self) -> None:
        for ticket, upload in list(self._open.items()):
            if time.monotonic() - upload.moved > _PATIENCE:
                with suppress(OSError):
                    self.drop(ticket)


def _sorted(files: Sequence[tuple[str, int]]) -> tuple[dict[int, tuple[Path, int]], dict[int, str]]:
    """The places and sizes of files, and the reasons why some are not taken; both by number."""
    taken: dict[int, tuple[Path, int]] = {}
    refused: dict[int, str] = {}
    names: set[str] = set()
    folders: set[str] = set()
    for number, (name, size) in enumerate(files):
        try:
            path = _path(name)
        except FileError as error:
            refused[number] = str(error)
            continue
        folded = path.as_posix().casefold()
        above = {place.as_posix() for place in Path(folded).parents}
        if folded in names or folded in folders or above & names:
            refused[number] = f"{shown(name, 80)} has the name of another of the files: rename it"
            continue
        names.add(folded)
        folders |= above
        taken[number] = path, size
    return taken, refused


def _path(name: str) -> Path:
    """A file's place in its campaign, from the name that a browser gave it.

    FileError for a name that is a path to elsewhere, or that some system cannot have.
    """
    parts = [part for part in name.replace("\\", "/").split("/") if part]
    wrong = (
        not parts
        or len(parts) > _DEEPEST
        or name.startswith(("/", "\\"))
        or any(not character.isprintable() or character in '<>:"|?*' for character in name)
        or any(part.startswith(".") or part[-1] in " ." or len(part.encode()) > _LONGEST_PART for part in parts)
    )
    if wrong:
        raise FileError(f"{shown(name, 80)} cannot be the name of a file here: rename it")
    check_name(name)
    return Path(*parts)
