"""Whether a file is still the one that was read: by size, time of change and inode, without opening it."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

#: A file that changed this short a time before it was looked at may change again without a new time stamp [ns].
_SAME_STAMP = 2_000_000_000


@dataclass(frozen=True)
class Identity:
    """Size, time of change and inode of a file; for a file elsewhere its size and what the server calls its version.

    Attributes
    ----------
    size : int [byte]
        Size of the file.
    changed : int or str
        Time of the last change [ns], or a version as text.
    inode : int
        Number of the file in its file system; 0 where it has none.
    settled : bool
        Whether a later change would show: the file was not changed just before it was looked at.
    """

    size: int
    changed: int | str
    inode: int
    settled: bool = True

    @property
    def parts(self) -> tuple[int, int | str, int, bool]:
        """The values in the order of the class, for a file."""
        return self.size, self.changed, self.inode, self.settled


def identity_of(path: str | os.PathLike[str]) -> Identity:
    """Identity of a file of this machine; OSError if it cannot be looked up.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "a.csv")
    ...     _ = file.write_text("t,F1")
    ...     one = identity_of(file)
    ...     _ = file.write_text("t,V1,V2")
    ...     one == identity_of(file), one.size, one.settled
    (False, 4, False)
    """
    found = Path(path).stat()
    settled = found.st_mtime_ns < time.time_ns() - _SAME_STAMP
    return Identity(found.st_size, found.st_mtime_ns, found.st_ino, settled)
