"""Named contents in one file, to which they are appended: of several with one name the last counts.

Each record has a mark, its name, the length of its content, the signature of the user, and the content. A record that
was cut, as the last one of a process that was killed, ends the file: it and what follows are ignored.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from fourpole.errors import FileError, FourpoleError
from fourpole.io.door import open_regular
from fourpole.io.userfolders import is_signed, signature
from fourpole.io.write import replacing

#: The file is appended without following a link, and without waiting for who reads a pipe.
_APPEND = os.O_APPEND | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
#: Mark, name, length of the content [byte], signature.
_HEAD, _MARK = struct.Struct("<4s20sQ32s"), b"FPR1"
#: Largest file that is read [byte].
_LARGEST = 64_000_000_000


class Records:
    """The contents of a file, by names of 40 hexadecimal digits.

    Parameters
    ----------
    path : Path
        The file, which need not exist; one that is none of records is replaced at the first content that is added.
    purpose : str
        What the contents are for; it is part of their signatures.
    """

    def __init__(self, path: Path, purpose: str) -> None:
        self._path, self._purpose = path, purpose
        self._reading: BinaryIO | None = None
        self._writing: int | None = None
        self._places: dict[str, tuple[int, int]] = {}
        self.size, self._whole = 0, False
        with suppress(FourpoleError, OSError):
            self._find(self._opened())

    @property
    def sizes(self) -> dict[str, int]:
        """Length of the content of each name [byte]."""
        return {name: length for name, (_, length) in self._places.items()}

    def _opened(self) -> BinaryIO:
        if self._reading is None:
            self._reading = open_regular(self._path, max_bytes=_LARGEST, within=self._path.parent)
        return self._reading

    def _find(self, file: BinaryIO) -> None:
        """Find the records; the file may be appended if they are all that it has, and no other name leads to it."""
        state = os.fstat(file.fileno())
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            mark, name, length, _ = _HEAD.unpack(head)
            end = self.size + _HEAD.size + length
            if mark != _MARK or end > state.st_size:
                break
            self._places[name.hex()] = self.size, length
            self.size = end
            file.seek(end)
        self._whole = self.size == state.st_size and state.st_nlink == 1

    def content(self, name: str) -> bytes | None:
        """The content of a name; None if there is none, or it is not as this user's Fourpole wrote it."""
        if name not in self._places:
            return None
        with suppress(FourpoleError, OSError):
            record = self._record(name)
            if is_signed(record[_HEAD.size :], record[_HEAD.size - 32 : _HEAD.size], self._purpose, name):
                return record[_HEAD.size :]
        return None

    def _record(self, name: str) -> bytes:
        place, length = self._places[name]
        file = self._opened()
        file.seek(place)
        return file.read(_HEAD.size + length)

    def add(self, name: str, content: bytes) -> None:
        """Append a content; a full disk changes nothing but that it is not kept."""
        head = _HEAD.pack(_MARK, bytes.fromhex(name), len(content), signature(content, self._purpose, name))
        with suppress(OSError, FileError):
            if self._writing is None:
                if not self._whole:
                    self.keep(self._places)
                self._writing = os.open(self._path, os.O_WRONLY | _APPEND)
            if os.write(self._writing, head + content) < len(head + content):
                self.close()
                self._whole = False
                return
            self._places[name] = self.size, len(content)
            self.size += len(head + content)

    def keep(self, names: Iterable[str]) -> None:
        """Write the file anew, with these names alone; FileError or OSError if it cannot be written."""
        kept, at = {}, 0
        with replacing(self._path) as new:
            for name in sorted(names, key=lambda name: self._places[name]):
                record = self._record(name)
                new.write(record)
                kept[name] = at, len(record) - _HEAD.size
                at += len(record)
            self.close()  # a system may not replace what is open
        self._places, self.size, self._whole = kept, at, True

    def close(self) -> None:
        """Close the file."""
        if self._reading is not None:
            self._reading.close()
        if self._writing is not None:
            os.close(self._writing)
        self._reading = self._writing = None

    def __del__(self) -> None:
        self.close()
