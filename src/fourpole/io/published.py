"""Results as one commit: study.json lists the files of a folder, and a reader takes only what it lists.

A writer puts each new file into the hidden folder `.store`, under the SHA-256 of its content. Replacing study.json is
the one step by which all of them become the results. Copies then take the usual names, and the store keeps the files of
this list and of the former one. A reader opens study.json, and takes each file from its usual name if it is as listed
there, else from the store: at any time, and wherever a writer was stopped, it finds the files of one analysis. It
changes nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
import stat
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from fourpole.errors import FileError, FourpoleError, ResultsWarning, TableError
from fourpole.io.documents import json_of
from fourpole.io.door import open_regular, read_bytes, sha256_of
from fourpole.io.lock import LOCK, campaign_lock, is_locked, opened_folder
from fourpole.io.seal import sealed
from fourpole.io.source import AnyPath
from fourpole.io.write import delete_folder, files_below, why, write_bytes

#: The list of the files, and the folder of their contents.
LIST, STORE = "study.json", ".store"
#: Keys of the list: SHA-256 and size [byte] of each file by its name.
_HASHES, _SIZES = "results", "sizes"
_HASH, _NEW = re.compile(r"[0-9a-f]{64}"), re.compile(r"new-[0-9a-f]{12}")
#: Names that results may have; a list with others does not make them be read or written.
_NAME = re.compile(r"(?:figures/)?[A-Za-z0-9][A-Za-z0-9_-]{0,99}\.(?:csv|parquet|json|html|pdf|svg|png)")
_MOST_BYTES = 2_000_000_000
#: Largest study.json [byte]: that of 100,000 tests has 12 MB. A document takes up to 30 times its room in memory.
MOST_LIST = 64_000_000
#: Number of times that results are read which another process renews meanwhile.
_TRIES = 5
#: Keys of which each study.json of Fourpole has one.
_OWN_KEYS = {"versions", "settings", "stated", _HASHES}
_AGAIN = "run fourpole analyse again"

_Result = TypeVar("_Result")


class Listed(NamedTuple):
    """A file as the list has it: its size [byte] and its SHA-256."""

    size: int
    sha256: str


class _RenewedError(FileError):
    """The results were renewed while they were read."""


@dataclass(frozen=True)
class Published:
    """The results of a folder, as its study.json stood when it was read.

    Attributes
    ----------
    folder : Path
        The folder.
    record : dict
        Content of study.json; empty without such a file.
    files : dict of str to Listed, or None
        The files by name; None for a folder without a list, which is read as it lies.
    mark : str
        SHA-256 of study.json.
    """

    folder: Path
    record: dict[str, Any]
    files: dict[str, Listed] | None = None
    mark: str = ""

    def has(self, name: str) -> bool:
        """Whether a file is among the results."""
        return (self.folder / name).is_file() if self.files is None else name in self.files

    def read(self, name: str, *, max_bytes: int = _MOST_BYTES) -> bytes:
        """The bytes of a file.

        Raises
        ------
        FileError
            If it is not among the results, or not as it is listed, neither under its name nor in the store.
        TableError
            If it is empty.
        """
        if self.files is None:
            return read_bytes(self.folder / name, max_bytes=max_bytes, label=name, within=self.folder)
        listed = self._listed(self.files, name)
        if listed.size > max_bytes:
            raise FileError(f"{name}: has {listed.size / 1e6:.4g} MB, more than the {max_bytes / 1e6:.4g} MB allowed")
        content = self._as_listed(self.folder / name, listed, max_bytes)
        if content is not None:
            return content
        content = self._as_listed(self.folder / STORE / listed.sha256, listed, max_bytes)
        if content is None:
            if not self._is_current():
                raise _RenewedError(f"{self.folder}: the results were renewed while they were read: run it again")
            raise FileError(f"{name} is not as {LIST} lists it: changed by hand, or half-written; {_AGAIN}")
        if not self._is_of_a_writer(self.folder / name) and self._is_current():
            warnings.warn(
                f"{name} is not as {LIST} lists it: changed by hand, or half-written; the copy that the analysis kept "
                f"is used in its place; {_AGAIN} to have it back",
                ResultsWarning,
                stacklevel=2,
            )
        return content

    def _as_listed(self, path: Path, listed: Listed, max_bytes: int) -> bytes | None:
        """The bytes of a file; None unless they are the listed ones."""
        with suppress(FileError, TableError), open_regular(path, max_bytes=max_bytes, within=self.folder) as file:
            if os.fstat(file.fileno()).st_size == listed.size:
                content = file.read()
                return content if hashlib.sha256(content).hexdigest() == listed.sha256 else None
        return None

    def _is_of_a_writer(self, path: Path) -> bool:
        """Whether a file is missing, or of the results before or after these: a writer is at work or was stopped."""
        if not path.exists():
            return True
        with suppress(FileError, TableError):
            found = sha256_of(path, max_bytes=_MOST_BYTES, within=self.folder)
            return (self.folder / STORE / found).exists()
        return False

    def sha256(self, name: str) -> str:
        """SHA-256 of a file, as listed; FileError if there is none."""
        if self.files is None:
            return sha256_of(self.folder / name, max_bytes=_MOST_BYTES, label=name, within=self.folder)
        return self._listed(self.files, name).sha256

    def _listed(self, files: Mapping[str, Listed], name: str) -> Listed:
        if name not in files:
            raise FileError(f"{name}: is not among the results in {self.folder}, by their {LIST}: {_AGAIN}")
        return files[name]

    def _is_current(self) -> bool:
        """Whether study.json still is as it was read."""
        with suppress(FileError, TableError):
            return sha256_of(self.folder / LIST, max_bytes=MOST_LIST, within=self.folder) == self.mark
        return True


def published(folder: AnyPath) -> Published:
    """The results of a folder.

    Raises
    ------
    FileError, TableError
        If study.json is not there, or cannot be read.
    """
    folder = Path(folder)
    content = read_bytes(folder / LIST, max_bytes=MOST_LIST, within=folder)
    try:
        record = json_of(content, LIST)
    except TableError:
        record = None
    if not isinstance(record, dict):
        raise TableError(f"{LIST} is not one that fourpole wrote: {_AGAIN}")
    for journal in folder.glob(".fourpole-*.tmp/journal.json"):
        text = "is of an older Fourpole that was stopped while it wrote; it is ignored: delete it, and"
        warnings.warn(f"{journal.parent}: {text} {_AGAIN}", ResultsWarning, stacklevel=2)
    return Published(folder, record, listed_in(record), hashlib.sha256(content).hexdigest())


def published_beside(path: AnyPath) -> Published:
    """The results of the folder of a file; without a study.json of Fourpole they have no record and no list."""
    folder = Path(path).parent
    found = published(folder) if (folder / LIST).exists() else Published(folder, {})
    return found if _OWN_KEYS & found.record.keys() else Published(folder, {})


def read_listed(path: AnyPath, *, max_bytes: int = _MOST_BYTES, results: Published | None = None) -> bytes:
    """The bytes of a file, which are those of the list if it is one of the `results` of its folder, by default now."""
    results, name = results or published_beside(path), Path(path).name
    if results.files is not None and name in results.files:
        return results.read(name, max_bytes=max_bytes)
    return read_bytes(path, max_bytes=max_bytes)


def consistently(folder: AnyPath, read: Callable[[Published], _Result]) -> _Result:
    """What a function reads of the results of a folder; it is called again if they are renewed meanwhile."""
    for _ in range(_TRIES - 1):
        with suppress(_RenewedError):
            return read(published(folder))
    return read(published(folder))


def listed_in(record: Mapping[str, Any]) -> dict[str, Listed] | None:
    """The files that a study.json lists; None if it has no list, as those of older versions."""
    hashes, sizes = record.get(_HASHES), record.get(_SIZES)
    if not isinstance(hashes, dict) or not isinstance(sizes, dict):
        return None
    return {
        name: Listed(size, sha256)
        for name, size in sizes.items()
        if type(size) is int
        and _NAME.fullmatch(name)
        and isinstance(sha256 := hashes.get(name), str)
        and _HASH.fullmatch(sha256)
    }


def is_complete(folder: AnyPath) -> bool:
    """Whether each result stands under its usual name, as it is listed."""
    with suppress(FourpoleError, OSError):
        results = published(folder)
        return all(
            sha256_of(results.folder / name, max_bytes=max(file.size, 1), within=folder) == file.sha256
            for name, file in (results.files or {}).items()
        )
    return False


def without_list(record: Mapping[str, Any]) -> dict[str, Any]:
    """The content of study.json that does not depend on which files stand beside it."""
    return {key: value for key, value in record.items() if key not in (_HASHES, _SIZES, "seal")}


@contextmanager
def publishing(folder: AnyPath, obsolete: Collection[str] = (), *, basis: str = "") -> Iterator[Path]:
    """A new folder; at the end of the context its files become results together, or none of them does.

    In a folder whose study.json has no list, they replace the files of the same name one by one.

    Parameters
    ----------
    folder : path
        The folder of the results, which exists.
    obsolete : collection of str
        Names of results that end unless the new folder has them; it may grow until the end of the context.
    basis : str
        SHA-256 of the dynamic.csv that the files were made of, which must still be the listed one; empty if of none.

    Raises
    ------
    FileError
        If a file cannot be written, or the results are no longer those of `basis`; they are the former ones then.
    """
    folder = Path(folder)
    store = folder / STORE
    _make(store, exist_ok=True)
    new, living = store / f"new-{secrets.token_hex(6)}", -1
    try:
        with campaign_lock(folder):
            _clear_unfinished(store)
            _make(new)
            living = opened_folder(new)
            is_locked(living)
        yield new
        with campaign_lock(folder):
            _publish(folder, new, obsolete, basis)
    except FourpoleError:
        raise
    except OSError as error:
        raise FileError(f"{folder}: cannot be written: {why(error)}; all files are the former ones") from error
    finally:
        if living >= 0:
            os.close(living)  # before it is deleted, which Windows wants
        delete_folder(new)


def write_result(path: AnyPath, content: bytes, *, basis: str = "") -> None:
    """Write one file; if its folder has a list of results, which may have this name, the file becomes one of them.

    With `basis`, the SHA-256 of dynamic.csv, it is an error if that is no longer the listed one.
    """
    place = Path(path)
    if published_beside(place).files is None or not _NAME.fullmatch(place.name):
        write_bytes(place, content)
        return
    with publishing(place.parent, basis=basis) as new:
        (new / place.name).write_bytes(content)


# ---- the steps of a writer


def _publish(folder: Path, new: Path, obsolete: Collection[str], basis: str) -> None:
    former = Published(folder, {})
    with suppress(FileError, TableError):  # damaged results are replaced as others are
        former = published(folder)
    listed = former.files or {}
    table = listed.get("dynamic.csv")
    if basis and table is not None and table.sha256 != basis:
        raise FileError(f"{folder}: the results were renewed meanwhile: run it again")
    names = [name for name in files_below(new) if name != LOCK]
    record = former.record
    if LIST in names:
        names.remove(LIST)
        record = json_of(read_bytes(new / LIST, max_bytes=_MOST_BYTES), LIST)
    elif former.files is None:
        _replace_each(folder, new, names, obsolete)
        return
    gone = [name for name in obsolete if name not in names]
    files = {name: file for name, file in listed.items() if name not in gone}
    files |= {name: _stored(new / name, folder / STORE) for name in names}
    _sync(folder / STORE)
    _write_list(folder, new, record, files)
    _complete(folder, files, gone)
    _clear(folder / STORE, {file.sha256 for file in (*files.values(), *listed.values())})


def _stored(path: Path, store: Path) -> Listed:
    """Move a file into the store, under its hash; what it holds is on the disk then."""
    with path.open("r+b") as file:  # a file that is only read cannot be synchronised on Windows
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]
        size = os.fstat(file.fileno()).st_size
        os.fsync(file.fileno())
    path.replace(store / sha256)
    return Listed(size, sha256)


def _write_list(folder: Path, new: Path, record: Mapping[str, Any], files: Mapping[str, Listed]) -> None:
    """Replace study.json: the step by which the files become the results. Nothing after it is an error."""
    whole = {
        **without_list(record),
        _HASHES: {name: file.sha256 for name, file in sorted(files.items())},
        _SIZES: {name: file.size for name, file in sorted(files.items())},
    }
    with (new / LIST).open("wb") as file:
        file.write(_laid_out(sealed(whole)).encode())
        file.flush()
        os.fsync(file.fileno())
    (new / LIST).replace(folder / LIST)
    _sync(folder)


def _laid_out(record: Mapping[str, Any]) -> str:
    """The text of study.json: a line for each entry, and for each test; with an indent Python's encoder is slow."""
    lines = [f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in record.items()]
    return "{\n" + ",\n".join(lines).replace('}, {"name": ', '},\n  {"name": ') + "\n}\n"


def _complete(folder: Path, files: Mapping[str, Listed], gone: Iterable[str]) -> None:
    """Give each file its usual name; one that another program holds is told, and done by the next writer."""
    held = []
    for name, file in files.items():
        try:
            _copy(folder, name, file)
        except OSError as error:
            held.append(f"{name} ({why(error)})")
    for name in gone:
        try:
            with suppress(FileNotFoundError):
                _inner(folder, name).unlink()
        except OSError as error:
            held.append(f"{name} ({why(error)})")
    if held:
        warnings.warn(
            f"{folder}: {', '.join(held[:3])}{' and others' * (len(held) > 3)} cannot be replaced now: the results are "
            f"whole, and Fourpole reads them from {STORE}; close the program that uses the file, and run it again",
            ResultsWarning,
            stacklevel=4,
        )


def _copy(folder: Path, name: str, file: Listed) -> None:
    """Copy a file from the store to its name, unless it stands there."""
    place, kept = _inner(folder, name, make=True), folder / STORE / file.sha256
    with suppress(FileError, TableError):
        if sha256_of(place, max_bytes=max(file.size, 1), within=folder) == file.sha256:
            return
    if not kept.exists():
        return
    part = folder / STORE / f"new-{secrets.token_hex(6)}"
    try:
        shutil.copyfile(kept, part)
        part.replace(place)
    finally:
        part.unlink(missing_ok=True)


def _inner(folder: Path, name: str, *, make: bool = False) -> Path:
    """The place of a file of the folder; OSError if a folder on the way is a link."""
    place = folder
    for part in Path(name).parts[:-1]:
        place /= part
        if make:
            with suppress(FileExistsError):
                place.mkdir()
        if not stat.S_ISDIR(place.lstat().st_mode):
            raise NotADirectoryError(None, f"{place.name} is no folder, but a file or a link")
    return place / Path(name).name


def _replace_each(folder: Path, new: Path, names: Iterable[str], obsolete: Iterable[str]) -> None:
    """Replace the files of a folder without a list, one after the other."""
    for name in names:
        (new / name).replace(_inner(folder, name, make=True))
    for name in obsolete:
        with suppress(OSError):
            if name not in names:
                _inner(folder, name).unlink()


# ---- the store


def _make(folder: Path, *, exist_ok: bool = False) -> None:
    """Make a folder; FileError if it is a link, or cannot be made."""
    try:
        folder.mkdir(exist_ok=exist_ok)
        if not stat.S_ISDIR(folder.lstat().st_mode):
            raise NotADirectoryError(None, "it is no folder, but a file or a link: delete it")
    except (OSError, ValueError) as error:
        raise FileError(f"{folder}: cannot be written: {why(error)}") from None


def _clear_unfinished(store: Path) -> None:
    """Delete the new folders of writers that were killed: nobody holds their lock."""
    for path in store.iterdir():
        if _NEW.fullmatch(path.name):
            with suppress(OSError, FileError):
                if not path.is_dir() or path.is_symlink():
                    path.unlink()
                    continue
                lock = opened_folder(path)
                try:
                    killed = is_locked(lock)
                finally:
                    os.close(lock)
                if killed:
                    delete_folder(path)


def _clear(store: Path, kept: Collection[str]) -> None:
    """Delete the contents that neither this list nor the former one has; what remains, the next writer deletes."""
    with suppress(OSError):
        for path in store.iterdir():
            if _HASH.fullmatch(path.name) and path.name not in kept:
                path.unlink()


def _sync(folder: Path) -> None:
    """Have the names of a folder on the disk, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
