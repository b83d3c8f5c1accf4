"""Files that a browser sends become a campaign folder: counted before, bounded while they come, renamed at the end."""

from __future__ import annotations

import secrets
import shutil
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.door import check_name
from fourpole.served.workspace import Workspace
from fourpole.units import shown

#: Largest size of all files of an upload [byte], largest number of them, and of uploads at a time.
MOST_BYTES, MOST_FILES, _AT_ONCE = 2 * 1024**3, 10_000, 20
#: Longest name of a file or folder, and deepest folder.
_LONGEST, _DEEPEST = 120, 8
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
        or any(part.startswith(".") or part[-1] in " ." or len(part.encode()) > _LONGEST for part in parts)
    )
    if wrong:
        raise FileError(f"{shown(name, 80)} cannot be the name of a file here: rename it")
    check_name(name)
    return Path(*parts)
