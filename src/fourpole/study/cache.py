"""The cache of demodulated recordings: an interrupted analysis continues from it, and so does one with another rig.

An entry of the cache is found by the content of the recording and by the settings that its demodulation depends on:
neither the rig nor an uncertainty is among them. All entries are in one file. The index notes size, time of change and
inode of each recording, with the hash of its content. A recording that is as noted is not opened; of one that differs,
the hash decides. Only the process that analyses writes here.

Each entry and each line of the index has the signature of the user. What another user kept, what was edited or
exchanged is ignored without a word: the recording is reduced again.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from fourpole.core.checks import CHECK_CLASSES
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation, Harmonics
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.core.spectra.excited import Excited
from fourpole.errors import FileError, FourpoleError
from fourpole.io.door import read_bytes
from fourpole.io.identity import Identity
from fourpole.io.kernel import filling
from fourpole.io.packed import pack, unpack
from fourpole.io.records import Records
from fourpole.io.remote import is_elsewhere
from fourpole.io.userfolders import SIGNATURE_LENGTH, is_signed, signature
from fourpole.io.write import write_bytes
from fourpole.study.points import Demodulated

#: This number is raised whenever demodulation or its checks change, so that older entries are not used.
_VERSION = 20
_INDEX, _ENTRIES = "index.jsonl", "kept.fpp"
#: The index is appended without following a link, and without waiting for who reads a pipe.
_APPEND = os.O_APPEND | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
#: Files of earlier versions of the cache.
_FORMER = re.compile(r"[0-9a-f]{40}\.(json|fpp)")
#: An entry that was not used in this number of runs is deleted, and so are those used longest ago above a size [byte].
_RUNS, _MOST = 10, 2_000_000_000
#: Share of the file that deleted entries may have; above it the file is written anew.
_DELETED = 0.25
#: Largest entry of the cache, and largest index [byte].
_LARGEST = 200_000_000
#: Where the body of a line of the index begins: ["signature", body].
_BODY = 4 + 2 * SIGNATURE_LENGTH
_LINE = re.compile(rb'\["[0-9a-f]{64}",.+\]')
_CLASSES = (*CHECK_CLASSES, Correction, Demodulated, Demodulation, Excited, Harmonics, Phasors, Preview)


def packed(done: Demodulated) -> bytes:
    """The bytes of what a recording gave; a preview is kept in single precision."""
    if isinstance(done.found, Demodulation):
        shown = {name: np.asarray(value, dtype=np.float32) for name, value in vars(done.found.preview).items()}
        done = replace(done, found=replace(done.found, preview=Preview(**shown)))
    return pack(done)


def unpacked(content: bytes) -> Demodulated:
    """What a recording gave, from its bytes; ValueError if they are damaged."""
    done = unpack(content, _CLASSES)
    if not isinstance(done, Demodulated):
        raise ValueError("the bytes hold no demodulated recording")
    return done


class Cache:
    """The folder of the cache, for one analysis.

    Parameters
    ----------
    folder : Path
        A folder that exists. A cache that cannot be read or written changes no result.
    verify : bool
        Whether the content of each recording is hashed, even if it is as noted.
    """

    def __init__(self, folder: Path, *, verify: bool = False) -> None:
        self._folder, self._verify, self._filling = folder, verify, filling()
        self._index: dict[str, tuple[Identity, str]] = {}
        self._used: dict[str, int] = {}
        self._run = 1
        self._entries = Records(folder / _ENTRIES, "entry")
        self._journal: TextIO | None = None
        self._begun = False
        self._read()
        self._lost = not self._index and bool(self._entries.size)

    # --- what is known of a recording ------------------------------------------------------------------------------

    def hash_noted(self, file: str, identity: Identity | None) -> str:
        """Hash of a recording that is as the index notes it; empty if it differs, is not noted, or must be verified."""
        noted = self._index.get(file)
        if noted is None or identity is None or self._verify:
            return ""
        return noted[1] if noted[0] == identity and identity.settled else ""

    def may_have(self, file: str) -> bool:
        """Whether the index has the recording, whatever its content was, or the index of the kept files is lost."""
        return file in self._index or (self._lost and not is_elsewhere(file))

    def note(self, file: str, identity: Identity | None, sha256: str) -> None:
        """Note the hash of a recording."""
        if identity is None or not sha256 or self._index.get(file) == (identity, sha256):
            return
        self._index[file] = identity, sha256
        with suppress(OSError):
            if not self._begun:
                self._begun = True
                self._write_index(self._run - 1)
                self._journal = os.fdopen(os.open(self._folder / _INDEX, os.O_WRONLY | _APPEND), "a", encoding="utf-8")
            elif self._journal is not None:
                self._journal.write(self._line([file, list(identity.parts), sha256]))
                self._journal.flush()

    # --- what it gave ------------------------------------------------------------------------------------------------

    def name(self, settings: Sequence[object], sha256: str) -> str:
        """Name of the entry of a recording with this hash, demodulated with these settings."""
        content = json.dumps([_VERSION, self._filling, sha256, *settings], sort_keys=True, default=repr)
        return hashlib.sha256(content.encode()).hexdigest()[:40]

    def recall(self, name: str) -> Demodulated | None:
        """What is kept under a name; None if it is missing or damaged."""
        content = self.bytes_of(name)
        with suppress(ValueError, KeyError, TypeError, IndexError):
            return None if content is None else unpacked(content)
        return None

    def bytes_of(self, name: str) -> bytes | None:
        """The bytes that are kept under a name; None unless this user's Fourpole kept them under it."""
        content = self._entries.content(name)
        if content is not None:
            self._used[name] = self._run
        return content

    def keep(self, name: str, content: bytes) -> None:
        """Keep the packed bytes of a recording under a name; a full disk changes no result."""
        if len(content) <= _LARGEST and self.bytes_of(name) != content:
            self._entries.add(name, content)
            self._used[name] = self._run

    # --- the folder --------------------------------------------------------------------------------------------------

    def _read(self) -> None:
        with suppress(OSError, FourpoleError):
            content = read_bytes(self._folder / _INDEX, max_bytes=_LARGEST, within=self._folder)
            for line in map(bytes.rstrip, io.BytesIO(content)):
                signed, body = line[2 : _BODY - 2], line[_BODY:-1]
                if not (_LINE.fullmatch(line) and is_signed(body, bytes.fromhex(signed.decode()), *self._purpose)):
                    return  # it was cut, or is of another user or folder, as the lines after it may be
                noted = json.loads(body)
                if isinstance(noted, dict):
                    self._run = int(noted["run"]) + 1
                    self._used = {str(name): int(run) for name, run in noted["used"].items()}
                else:
                    file, parts, sha256 = noted
                    self._index[str(file)] = Identity(*parts), str(sha256)

    @cached_property
    def _purpose(self) -> tuple[str, ...]:
        """What a line of the index is for: this folder, since its recordings are known by their names and inodes."""
        return "index", str(_VERSION), os.path.realpath(self._folder)

    def _line(self, value: Any) -> str:
        """A line of the index with its signature."""
        body = json.dumps(value)
        return f'["{signature(body.encode(), *self._purpose).hex()}",{body}]\n'

    def _write_index(self, run: int) -> None:
        """Write the index anew, in one step: what stands in its place may be a link or a pipe."""
        lines = [self._line({"run": run, "used": self._used})]
        lines += [self._line([file, list(noted.parts), sha]) for file, (noted, sha) in self._index.items()]
        with suppress(FileError):
            write_bytes(self._folder / _INDEX, "".join(lines).encode())

    def close(self) -> None:
        """Write the index anew, and delete the entries that are too old or too many."""
        if self._journal is not None:
            with suppress(OSError):
                self._journal.close()
            self._journal = None
        with suppress(OSError, FileError):
            self._prune()
        self._entries.close()
        self._write_index(self._run)

    def _prune(self) -> None:
        for file in os.scandir(self._folder):
            if _FORMER.fullmatch(file.name):
                Path(file.path).unlink()
        sizes = self._entries.sizes
        self._used = {name: self._used.get(name, self._run) for name in sizes}
        total, kept = sum(sizes.values()), dict(self._used)
        for name in sorted(sizes, key=self._used.__getitem__):
            age = self._run - self._used[name]
            if age >= _RUNS or (age and total > _MOST):
                total -= sizes[name]
                del kept[name]
        if (self._entries.size > _MOST and len(kept) < len(sizes)) or total < (1 - _DELETED) * self._entries.size:
            self._entries.keep(kept)
            self._used = kept
