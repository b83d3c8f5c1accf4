"""Which files of a campaign are read in a worker process."""

from __future__ import annotations

from pathlib import Path

from fourpole.campaign.place import inside
from fourpole.errors import FourpoleError
from fourpole.io.recordings import format_of
from fourpole.io.remote import is_elsewhere
from fourpole.io.signals import MAX_FILE_BYTES


def by_library(folder: Path, file: str) -> bool:
    """Whether a file is elsewhere, or of a format that a library reads, which a damaged file may crash."""
    if is_elsewhere(file):
        return True
    try:
        return format_of(inside(folder, file), max_bytes=MAX_FILE_BYTES, label=file).by_library
    except FourpoleError:
        return False  # whoever reads it says why
