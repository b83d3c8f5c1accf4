"""Where a file of a campaign is: in its folder, or at a URL that tests.csv names; and whether a worker reads it."""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path, PureWindowsPath
from unicodedata import normalize

from fourpole import units
from fourpole.errors import FileError, FourpoleError
from fourpole.io import child
from fourpole.io.door import check_name, open_regular, path_for_library
from fourpole.io.identity import Identity, identity_of
from fourpole.io.recordings import format_of
from fourpole.io.remote import fetched, is_elsewhere, local_path, remote_identity, scheme_of
from fourpole.io.signals import MAX_FILE_BYTES

#: Files that are looked at for another spelling of a name, and the similarity from which they are one.
_MOST_BESIDE, _ALIKE = 5000, 0.85
_NUMBERS = re.compile(r"[0-9]+")


def inside(folder: Path, file: str) -> Path:
    """Absolute path of a file of a campaign; the group in `file#group` is ignored.

    FileError if the path is outside the campaign folder after all links are resolved; or, before anything is looked up,
    if its text alone shows that.
    """
    name = units.shown(file, 200)
    if is_elsewhere(file):
        raise FileError(f"file {name} is not on this machine: copy it into the campaign folder")
    if scheme_of(file):
        file = local_path(file)
    check_text(folder, file)
    try:
        path = (folder / file).resolve()
        if "#" in file and not path.exists():
            path = (folder / file.rpartition("#")[0]).resolve()
        within = path.is_relative_to(os.path.realpath(folder))
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(f"file {name} cannot be looked up: {getattr(error, 'strerror', None) or error}") from None
    if not within:
        raise FileError(f"file {name} lies outside the campaign folder: copy it into the folder and name it from there")
    return path


def group_of(path: Path, file: str) -> str:
    """The group that `file#group` names; empty where the file itself, which is at `path`, is named."""
    name, mark, group = file.rpartition("#")
    return group if mark and Path(name).name == path.name else ""


def check_text(folder: Path, file: str) -> None:
    """FileError if the text alone shows that a path names no file of a campaign: by `check_name`, or another drive."""
    check_name(file)
    if "#" in file:
        check_name(file.rpartition("#")[0])
    if not (":" in file or "\\" in file or file.startswith("/")):
        return
    windows = PureWindowsPath(file)
    if (windows.root or sys.platform == "win32") and windows.drive.lower() not in ("", folder.absolute().drive.lower()):
        raise FileError(
            f"file {units.shown(file, 200)} is on another drive: copy it into the folder, and name it from the "
            "campaign's folder, with / in place of \\"
        )


@contextmanager
def at_hand(folder: Path, file: str) -> Iterator[Path]:
    """The path of a file of a campaign for the time of the context: of a copy, if a URL names it.

    FileError if it is outside the campaign folder, the URL cannot be read, or the file was replaced meanwhile.
    """
    if is_elsewhere(file):
        with fetched(file, max_bytes=MAX_FILE_BYTES) as path:
            yield path
    else:
        path = inside(folder, file)
        name = units.shown(file, 200)[1:-1]
        try:
            there = path.exists()
        except OSError as error:
            raise FileError(f"{name} cannot be looked up: {error.strerror or error}") from None
        if not there:
            raise FileError(f"{name}: there is no such file; {_likely(folder, file)}")
        with (
            open_regular(path, max_bytes=MAX_FILE_BYTES, label=file, within=folder) as opened,
            path_for_library(path, opened, label=file) as same,
        ):
            yield same


def _likely(folder: Path, file: str) -> str:
    """What to do about a file that is not there: another spelling, if there is a file of it."""
    plain = file.replace("\\", "/")
    if plain != file:
        there = (folder / plain).exists()
        return f"write {units.shown(plain)}" if there else "name it from the campaign's folder, with / in place of \\"
    with suppress(OSError):
        name = Path(file).name
        names = [path.name for path in islice((folder / file).parent.iterdir(), _MOST_BESIDE)]
        if normalize("NFC", name) in {normalize("NFC", one) for one in names}:
            return "one of the same letters is, whose accents are characters of their own, as of macOS: rename it"
        numbers = _NUMBERS.findall(name)
        beside = [one for one in names if _NUMBERS.findall(one) == numbers]  # D1 is not meant by D2
        near = difflib.get_close_matches(name, beside, n=1, cutoff=_ALIKE)
        if near:
            return f"did you mean {units.shown(Path(file).with_name(near[0]).as_posix())}?"
    return "check its name"


def identity_or_none(folder: Path, file: str) -> Identity | None:
    """Identity of a file of a campaign without opening it; None if it cannot be looked up."""
    with suppress(FourpoleError, OSError, ValueError):
        return remote_identity(file) if is_elsewhere(file) else identity_of(inside(folder, file))
    return None


def is_guarded(folder: Path, file: str) -> bool:
    """Whether a file is elsewhere, or one that is read in a worker process: of a library's format, or large."""
    if is_elsewhere(file):
        return True
    try:
        path = inside(folder, file)
        return child.is_guarded(format_of(path, max_bytes=MAX_FILE_BYTES, label=file), path.stat().st_size)
    except (FourpoleError, OSError):
        return False  # whoever reads it says why
