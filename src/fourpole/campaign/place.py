"""Where a file of a campaign is: in its folder, or at a URL that tests.csv names."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fourpole import units
from fourpole.errors import FileError, FourpoleError
from fourpole.io.identity import Identity, identity_of
from fourpole.io.remote import fetched, is_elsewhere, local_path, remote_identity, scheme_of
from fourpole.io.signals import MAX_FILE_BYTES


def inside(folder: Path, file: str) -> Path:
    """Absolute path of a file of a campaign; the group in `file#group` is ignored.

    FileError if the path is outside the campaign folder after all links are resolved.
    """
    name = units.shown(file, 200)
    if is_elsewhere(file):
        raise FileError(f"file {name} is not on this machine: copy it into the campaign folder")
    if scheme_of(file):
        file = local_path(file)
    try:
        path = (folder / file).resolve()
        if "#" in file and not path.exists():
            path = (folder / file.rpartition("#")[0]).resolve()
        within = path.is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(f"file {name} cannot be looked up: {getattr(error, 'strerror', None) or error}") from None
    if not within:
        raise FileError(f"file {name} lies outside the campaign folder: copy it into the folder and name it from there")
    return path


@contextmanager
def at_hand(folder: Path, file: str) -> Iterator[Path]:
    """The path of a file of a campaign for the time of the context: of a copy, if a URL names it.

    FileError if it is outside the campaign folder, or the URL cannot be read.
    """
    if is_elsewhere(file):
        with fetched(file, max_bytes=MAX_FILE_BYTES) as path:
            yield path
    else:
        yield inside(folder, file)


def identity_at(folder: Path, file: str) -> Identity:
    """Identity of a file of a campaign without opening it; FileError or OSError if it cannot be looked up."""
    return remote_identity(file) if is_elsewhere(file) else identity_of(inside(folder, file))


def identity_or_none(folder: Path, file: str) -> Identity | None:
    """Identity of a file of a campaign without opening it; None if it cannot be looked up."""
    with suppress(FourpoleError, OSError, ValueError):
        return identity_at(folder, file)
    return None
