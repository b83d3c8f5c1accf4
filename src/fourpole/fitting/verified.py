"""A model file once more: whether it and its table are as they were; its fits of some tyres put into another file."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from fourpole.errors import FileError, ModelError
from fourpole.fitting.document import check_seal, read_document
from fourpole.fitting.modelfile import ModelFile, checked
from fourpole.fitting.modelparts import EARLIER
from fourpole.io.door import sha256_of
from fourpole.io.seal import KEY

_MOST_BYTES = 1_000_000_000
#: Note in a copy that was sealed later.
_LATER = "the file was not sealed when it was written; whoever sealed it later vouches for its numbers"


class TableState(StrEnum):
    """The table of K* beside a model file, held against the hash that the model file has of its table."""

    SAME = "same"
    CHANGED = "changed"
    MISSING = "missing"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Verified:
    """A model file that is as it was written.

    Attributes
    ----------
    file : ModelFile
    written : str
        Time of writing in UTC; empty where the file has none.
    table : TableState
        The table that the file names, if it is in the same folder.
    """

    file: ModelFile
    written: str
    table: TableState


def verify(path: str | Path) -> Verified:
    """Check a model file, and the table beside it.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If it is no model file, contradicts itself, is not sealed, or was changed since it was sealed.
    """
    path = Path(path)
    document = read_document(path)
    file = checked(path.name, document)
    check_seal(path.name, document)
    return Verified(file, document[KEY].get("written", ""), _table_beside(path, file))


def seal_later(path: str | Path, target: str | Path) -> None:
    """Write a sealed copy of a file from before seals, in whose notes that stands.

    Raises
    ------
    ModelError
        If the file has a seal, or is none that could be read but for the seal.
    """
    path = Path(path)
    document = read_document(path)
    file = checked(path.name, document)
    if KEY in document:
        raise ModelError(f"{path.name}: has a seal; only a file without one can be sealed")
    origin = file.provenance.model_copy(update={"notes": [*file.provenance.notes, _LATER]})
    file.model_copy(update={"provenance": origin}).write(target)


def _table_beside(path: Path, file: ModelFile) -> TableState:
    """Whether the table in the folder of a model file is the one that the file was made from."""
    origin = file.provenance
    if not (origin.source and origin.sha256) or Path(origin.source).name != origin.source:
        return TableState.UNKNOWN
    try:
        found = sha256_of(path.parent / origin.source, max_bytes=_MOST_BYTES)
    except FileError:
        return TableState.MISSING
    return TableState.SAME if found == origin.sha256 else TableState.CHANGED


def renewed(former: ModelFile, made: ModelFile) -> ModelFile:
    """The entries of `made`, and those that `former` has of other tyres, each whole.

    The settings of the tyres that are kept stand under the key `EARLIER`.

    Raises
    ------
    ModelError
        If the two are not of one table of K*, or one is of fits and one of maps.
    """
    if former.kind != made.kind:
        raise ModelError(f"it is of kind {former.kind}")
    if not made.provenance.sha256 or former.provenance.sha256 != made.provenance.sha256:
        raise ModelError("it is of other results")
    kept = [tyre for tyre in former.tyres if tyre not in made.tyres]
    if not kept:
        return made
    was, now = former.provenance, made.provenance
    earlier = {tyre: {key: one for key, one in was.settings_of(tyre).items() if key != EARLIER} for tyre in kept}
    columns = {one.column for one in made.axes}
    content = {
        "models": list(({one.tyre: one for one in former.models} | {one.tyre: one for one in made.models}).values()),
        "maps": list(({one.tyre: one for one in former.maps} | {one.tyre: one for one in made.maps}).values()),
        "axes": [*made.axes, *(one for one in former.axes if one.column not in columns)],
        "provenance": now.model_copy(
            update={
                "settings": {**now.settings, EARLIER: earlier},
                "notes": list(dict.fromkeys([*now.notes, *was.notes])),
            }
        ),
    }
    return made.model_copy(update=content)
