"""The cache of demodulated recordings: an interrupted analysis continues from it, and so does one with another rig.

A file of the cache is found by the content of the recording and by the settings that its demodulation depends on:
neither the rig nor an uncertainty is among them. The index notes size, time of change and inode of each recording, with
the hash of its content. A recording that is as noted is not opened; of one that differs, the hash decides. Only the
process that analyses writes here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from fourpole.core.checks import Check
from fourpole.core.codes import Code
from fourpole.core.demodulation.corrections import Correction
from fourpole.core.demodulation.demodulate import Demodulation
from fourpole.core.demodulation.harmonics import Harmonics
from fourpole.core.demodulation.preview import Preview
from fourpole.core.phasor import Phasors
from fourpole.core.spectra.excited import Excited
from fourpole.errors import FileError
from fourpole.io.identity import Identity
from fourpole.io.packed import pack, unpack
from fourpole.io.write import write_bytes, write_text
from fourpole.study.outcome import Demodulated

#: This number is raised whenever demodulation or its checks change, so that older files of the cache are not used.
_VERSION = 16
_INDEX = "index.jsonl"
#: Files of the cache, and those of earlier versions of it.
_ENTRY, _FORMER = re.compile(r"[0-9a-f]{40}\.fpp"), re.compile(r"[0-9a-f]{40}\.json")
#: A file that was not used in this number of runs is deleted, and so are those used longest ago above this size [byte].
_RUNS, _MOST = 10, 2_000_000_000
_CLASSES = (Check, Code, Correction, Demodulated, Demodulation, Excited, Harmonics, Phasors, Preview)


def packed(done: Demodulated) -> bytes:
    """The bytes of what a recording gave; a preview is kept in single precision."""
    found = done.found
    if isinstance(found, Demodulation):
        shown = {name: np.asarray(value, dtype=np.float32) for name, value in vars(found.preview).items()}
        done = replace(done, found=replace(found, preview=Preview(**shown)))
    return pack(done)


def unpacked(content: bytes) -> Demodulated:
    """What a recording gave, from its bytes; ValueError if they are damaged."""
    done = unpack(content, _CLASSES)
    if not isinstance(done, Demodulated):
        raise ValueError("the bytes hold no demodulated recording")
    if not isinstance(done.found, Demodulation):
        return done
    shown = {name: np.asarray(value, dtype=float) for name, value in vars(done.found.preview).items()}
    return replace(done, found=replace(done.found, preview=Preview(**shown)))


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
        self._folder, self._verify = folder, verify
        self._index: dict[str, tuple[Identity, str]] = {}
        self._used: dict[str, int] = {}
        self._run = 1
        self._here: set[str] = set()
        self._journal: TextIO | None = None
        self._read()

    # --- what is known of a recording ------------------------------------------------------------------------------

    def hash_noted(self, file: str, identity: Identity | None) -> str:
        """Hash of a recording that is as the index notes it; empty if it differs, is not noted, or must be verified."""
        noted = self._index.get(file)
        if noted is None or identity is None or self._verify:
            return ""
        return noted[1] if noted[0] == identity and identity.settled else ""

    def is_noted(self, file: str) -> bool:
        """Whether the index has the recording, whatever its content was."""
        return file in self._index

    def note(self, file: str, identity: Identity | None, sha256: str) -> None:
        """Note the hash of a recording."""
        if identity is None or not sha256 or self._index.get(file) == (identity, sha256):
            return
        self._index[file] = identity, sha256
        with suppress(OSError):
            if self._journal is None:
                self._journal = (self._folder / _INDEX).open("a", encoding="utf-8")
            self._journal.write(json.dumps([file, list(identity.parts), sha256]) + "\n")
            self._journal.flush()

    # --- what it gave ------------------------------------------------------------------------------------------------

    def name(self, settings: Sequence[object], sha256: str) -> str:
        """Name of the file of a recording with this hash, demodulated with these settings."""
        content = json.dumps([_VERSION, sha256, *settings], sort_keys=True, default=repr)
        return hashlib.sha256(content.encode()).hexdigest()[:40] + ".fpp"

    def recall(self, name: str) -> Demodulated | None:
        """What is kept under a name; None if it is missing or damaged."""
        content = self.bytes_of(name)
        with suppress(ValueError, KeyError, TypeError, IndexError):
            return None if content is None else unpacked(content)
        return None

    def bytes_of(self, name: str) -> bytes | None:
        """The bytes that are kept under a name; None if it is missing."""
        if name not in self._here:
            return None
        with suppress(OSError):
            content = (self._folder / name).read_bytes()
            self._used[name] = self._run
            return content
        return None

    def keep(self, name: str, content: bytes) -> None:
        """Keep the bytes of a recording; a full disk changes no result."""
        with suppress(FileError):
            write_bytes(self._folder / name, content)
            self._here.add(name)
            self._used[name] = self._run

    # --- the folder --------------------------------------------------------------------------------------------------

    def _read(self) -> None:
        with suppress(OSError):
            self._here = {one.name for one in os.scandir(self._folder) if _ENTRY.fullmatch(one.name)}
            for line in (self._folder / _INDEX).read_text(encoding="utf-8", errors="replace").splitlines():
                with suppress(ValueError, TypeError, KeyError, AttributeError):  # the last line may be cut
                    self._take(json.loads(line))

    def _take(self, line: Any) -> None:
        if isinstance(line, dict):
            self._run = int(line["run"]) + 1
            self._used = {str(name): int(run) for name, run in line["used"].items()}
            return
        file, parts, sha256 = line
        self._index[str(file)] = Identity(*parts), str(sha256)

    def close(self) -> None:
        """Write the index anew, and delete the files that are too old or too many."""
        if self._journal is not None:
            with suppress(OSError):
                self._journal.close()
            self._journal = None
        self._prune()
        lines = [json.dumps({"run": self._run, "used": self._used})]
        lines += [json.dumps([file, list(one.parts), sha256]) for file, (one, sha256) in self._index.items()]
        with suppress(FileError):
            write_text(self._folder / _INDEX, "\n".join(lines) + "\n")

    def _prune(self) -> None:
        with suppress(OSError):
            sizes = {}
            for one in os.scandir(self._folder):
                if _FORMER.fullmatch(one.name):
                    Path(one.path).unlink()
                elif _ENTRY.fullmatch(one.name):
                    sizes[one.name] = one.stat().st_size
            self._used = {name: self._used.get(name, self._run) for name in sizes}
            total = sum(sizes.values())
            for name in sorted(sizes, key=lambda name: self._used[name]):
                age = self._run - self._used[name]
                if age >= _RUNS or (age and total > _MOST):
                    (self._folder / name).unlink(missing_ok=True)
                    total -= sizes[name]
                    del self._used[name]
