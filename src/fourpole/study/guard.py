"""Which files of a campaign are read in a worker process."""

from __future__ import annotations

from pathlib import Path

from fourpole.campaign.place import inside
from fourpole.errors import FourpoleError
from fourpole.io import child
from fourpole.io.recordings import format_of
from fourpole.io.remote import is_elsewhere
from fourpole.io.signals import MAX_FILE_BYTES


def is_guarded(folder: Path, file: str) -> bool:
    """Whether a file is elsewhere, or one that is read in a worker process: of a library's format, or large."""
    if is_elsewhere(file):
        return True
    try:
        path = inside(folder, file)
        return child.is_guarded(format_of(path, max_bytes=MAX_FILE_BYTES, label=file), path.stat().st_size)
    except (FourpoleError, OSError):
        return False  # whoever reads it says why
