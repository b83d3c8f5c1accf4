"""Replaces some files of a folder together, as the two of a statement.

The new files are written into a hidden folder inside the folder, which is on the same disk, and then renamed into their
places one after the other. If one cannot be renamed, those before it are put back. A process that is killed just then
leaves files of both kinds, each of them whole. Results are more than that: see `fourpole.io.published`.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.source import AnyPath
from fourpole.io.write import delete_folder, files_below, hidden_folder, remove_leftovers, why


@contextmanager
def staged(folder: AnyPath, obsolete: Iterable[str] = (), *, last: str = "") -> Iterator[Path]:
    """A new folder; at the end of the context all its files replace those of the same name in `folder`.

    If anything fails, the files of `folder` are the former ones. Its other files are not touched.

    Parameters
    ----------
    folder : path
        A folder that exists.
    obsolete : iterable of str
        Files of `folder`, relative to it, that are deleted unless the new folder has them.
    last : str
        The file that is replaced last: it says what the others hold.

    Raises
    ------
    FileError
        If a file cannot be written or replaced.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with staged(folder, obsolete=["old.csv"]) as new:
    ...         _ = (new / "a.csv").write_text("K1 [N/m]")
    ...     [path.name for path in pathlib.Path(folder).iterdir()]
    ['a.csv']
    """
    folder = Path(folder)
    remove_leftovers(folder)
    hidden = hidden_folder(folder / "fourpole", str(folder))
    new, old = hidden / "new", hidden / "old"
    try:
        new.mkdir()
        yield new
        names = files_below(new)
        _exchange(folder, new, old, sorted(names, key=lambda name: name == last))
        for name in obsolete:
            with suppress(OSError):
                if name not in names:
                    (folder / name).unlink()
    finally:
        delete_folder(hidden)


def _exchange(folder: Path, new: Path, old: Path, names: Iterable[str]) -> None:
    """Rename the new files into their places; if one cannot be, the former ones are put back."""
    done: list[str] = []
    name = ""
    try:
        for name in names:
            place, kept = folder / name, old / name
            if place.is_dir():
                raise IsADirectoryError(None, "a folder is in its place")
            for needed in (place, kept):
                needed.parent.mkdir(parents=True, exist_ok=True)
            if place.exists():
                shutil.copy2(place, kept)
            done.append(name)
            (new / name).replace(place)
    except BaseException as error:
        for undone in done:
            with suppress(OSError):
                if (old / undone).exists():
                    (old / undone).replace(folder / undone)
                elif not (new / undone).exists():
                    (folder / undone).unlink()
        if isinstance(error, OSError):
            raise FileError(
                f"{folder / name}: cannot be written: {why(error)}; all files are the former ones"
            ) from error
        raise
