"""Recordings that are named by URL: which are allowed, what identifies them, and a copy on this machine to read.

The libraries that read recordings need files of this machine, so a copy is made where the recording is read, and is
removed after it. Credentials and the address of the server come from the environment, as s3fs takes them.

The statement of a campaign may come from anyone. A server is asked only if the user allows the URL: by --remote, by the
variable FOURPOLE_REMOTE, or in the user's own config.toml.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote, urlsplit

from fourpole.errors import FileError, FourpoleError
from fourpole.io.identity import Identity
from fourpole.io.processes import REMOTE
from fourpole.io.userfolders import CONFIG, configuration
from fourpole.units import shown

#: Schemes that need the extra `remote`, beside file://, which does not.
SCHEMES = ("s3",)
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")
#: Prefixes that allow every URL which is read at all.
EVERY = " ".join(f"{scheme}://" for scheme in SCHEMES)
#: Size of the parts in which a recording is copied [byte].
_BLOCK = 1 << 22
#: Seconds that a server may take to answer, and how often it is asked.
_PATIENCE = {"connect_timeout": 10, "read_timeout": 30, "retries": {"max_attempts": 3}}

_Answer = TypeVar("_Answer")


def allowed() -> str:
    """The prefixes of URLs that are allowed to this process and its children, with blanks between."""
    return os.environ.get(REMOTE, "")


def allow(prefixes: str) -> None:
    """Allow the URLs with these prefixes, and no others, to this process and its children."""
    if prefixes != allowed():
        os.environ[REMOTE] = prefixes


@contextmanager
def allowing(prefixes: str) -> Iterator[None]:
    """Allow the URLs with these prefixes, and no others, for the time of the context."""
    former = allowed()
    allow(prefixes)
    try:
        yield
    finally:
        allow(former)


def permission(files: Iterable[str]) -> str:
    """The prefixes that the user allows, for workers that read some files; empty if none of them is elsewhere."""
    return " ".join([*allowed().split(), *_configured()[0]]) if any(map(is_elsewhere, files)) else ""


def check_allowed(url: str) -> None:
    """FileError, with the remedy, unless the user allows a URL.

    If config.toml allows it, what that allows is allowed to the children of this process from then on.
    """
    if any(covers(prefix, url) for prefix in allowed().split()):
        return
    prefixes, why = _configured()
    if any(covers(prefix, url) for prefix in prefixes):
        allow(" ".join([*allowed().split(), *prefixes]))
        return
    bucket = shown("/".join(url.split("/", 3)[:3]) + "/", 100)[1:-1]
    raise FileError(
        f"recordings of {bucket} are read only if you allow it: by --remote, or in your own {CONFIG} by [remote] "
        f'allow = ["{bucket}"]{why and f" ({why})"}'
    )


def covers(prefix: str, url: str) -> bool:
    """Whether a URL is of a prefix, by whole parts of its path; a blank in the prefix may be %20.

    Examples
    --------
    >>> covers("s3://our-lab", "s3://our-lab/2026/D1.mf4"), covers("s3://our-lab", "s3://our-lab-2/D1.mf4")
    (True, False)
    """
    (scheme, mark, wanted), (other, _, place) = prefix.partition("://"), url.partition("://")
    whole = wanted.replace("%20", " ").strip("/")
    return bool(mark) and scheme.lower() == other.lower() and (not whole or f"{place}/".startswith(f"{whole}/"))


@cache
def _configured() -> tuple[list[str], str]:
    """The prefixes that config.toml allows, and the reason if it cannot be read."""
    try:
        stated = configuration().get("remote", {})
    except FourpoleError as error:
        return [], str(error)
    prefixes = stated.get("allow", []) if isinstance(stated, dict) else None
    if not isinstance(prefixes, list) or not all(isinstance(one, str) and "://" in one for one in prefixes):
        return [], f'{CONFIG}: [remote] allow is a list of prefixes, as ["s3://our-lab/"]'
    return [one.strip().replace(" ", "%20") for one in prefixes], ""


def scheme_of(file: str) -> str:
    """The scheme of a URL in lower case; empty for a path."""
    found = _URL.match(file)
    return found[1].lower() if found else ""


def is_elsewhere(file: str) -> bool:
    """Whether a file is named by a URL that is not of this machine."""
    return scheme_of(file) not in ("", "file")


def local_path(file: str) -> str:
    """The path of a file:// URL, with its group, as in file:///data/D1.mf4#run; FileError if it is of another machine.

    Examples
    --------
    >>> local_path("file:///data/warm%20tests/D1.mf4#run")
    '/data/warm tests/D1.mf4#run'
    """
    url, mark, group = file.partition("#")
    parts = urlsplit(url)
    path = unquote(parts.path)
    if parts.netloc not in ("", "localhost"):
        raise FileError(f"file {shown(file, 200)} names another machine: write file:///, and the whole path after it")
    _check_steps(file, path)
    if re.match(r"/[A-Za-z]:", path):  # a drive of Windows
        path = path[1:]
    return path + mark + group


def address_of(file: str) -> str:
    """The URL of a recording without its group; FileError for a scheme that is not allowed or a step upwards."""
    scheme = scheme_of(file)
    if scheme not in SCHEMES:
        raise FileError(
            f"file {shown(file, 200)}: {scheme}:// is not read; name a file of the folder, file:// or s3://"
        )
    _check_steps(file, unquote(file))
    url = file.rpartition("#")[0] if "#" in file else file
    bucket, _, key = url.partition("://")[2].partition("/")
    if not bucket or not key or key.endswith("/"):
        raise FileError(f"file {shown(file, 200)} names no object: write s3://BUCKET/FOLDER/FILE")
    return url


def _check_steps(file: str, path: str) -> None:
    if not path.isprintable():
        raise FileError(f"file {shown(file, 200)} has a character that is not printed: write its name anew")
    if ".." in re.split(r"[/\\]", path):
        raise FileError(f"file {shown(file, 200)} has a step upwards, '..': name the place itself")


def remote_identity(file: str) -> Identity:
    """Size and version of a recording elsewhere, as its server states them; FileError if it cannot be looked up."""
    found = _asked(file, lambda system, url: system.info(url))
    version = next((str(found[key]) for key in ("ETag", "etag", "LastModified", "mtime") if found.get(key)), "")
    return Identity(int(found.get("size") or 0), version, 0, settled=bool(version))


@contextmanager
def fetched(file: str, *, max_bytes: int) -> Iterator[Path]:
    """A copy of a recording on this machine, of the same name, for the time of the context.

    FileError if it is missing or too large, if there is no room for it, or if the extra `remote` is not installed.
    """
    name, size = shown(file, 200)[1:-1], remote_identity(file).size
    if size > max_bytes:
        raise FileError(f"{name}: has {size / 1e9:.4g} GB, more than the {max_bytes / 1e9:.4g} GB allowed; split it")
    with tempfile.TemporaryDirectory(prefix="fourpole-") as folder:
        if size > shutil.disk_usage(folder).free:
            raise FileError(f"{name}: has {size / 1e9:.4g} GB, more than is free in {folder}; free some space")
        path = Path(folder, re.sub(r'[<>:"|?*\\]', "_", Path(address_of(file)).name))  # as Windows allows
        _asked(file, lambda system, url: _copy(system, url, path, size))
        yield path


def _copy(system: Any, url: str, path: Path, size: int) -> None:
    """Copy an object of this size [byte] in blocks."""
    with system.open(url, "rb", block_size=_BLOCK, cache_type="none") as source, path.open("xb") as target:
        while block := source.read(_BLOCK):
            target.write(block)
            if target.tell() > size:
                break
    if path.stat().st_size != size:
        raise OSError("it changed while it was read")


def _asked(file: str, ask: Callable[[Any, str], _Answer]) -> _Answer:
    """What `ask` gets of a server, by its file system and the URL of the file; FileError if it may not, or cannot."""
    url, name = address_of(file), shown(file, 200)[1:-1]
    check_allowed(url)
    try:
        import fsspec
        import s3fs  # noqa: F401 - fsspec finds it by its name
    except ImportError:
        raise FileError(
            f"{name}: a URL is read by the libraries fsspec and s3fs, which are not installed; pip install "
            "'fourpole[remote]'"
        ) from None
    try:
        system = fsspec.filesystem(scheme_of(file), use_listings_cache=False, config_kwargs=_PATIENCE)
        return ask(system, url)
    except FileNotFoundError:
        raise FileError(f"{name}: there is no such object; check its name and the bucket") from None
    except PermissionError:
        raise FileError(
            f"{name}: access is denied; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
        ) from None
    except Exception as error:  # noqa: BLE001 - whatever the library raises for a server that fails
        why = shown(" ".join(str(error).split()) or type(error).__name__, 150)[1:-1]
        raise FileError(f"{name}: cannot be fetched: {why}; check the server, and run it again") from None
