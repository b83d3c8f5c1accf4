"""The JSON document of a model file, read strictly, before any of its content is used."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fourpole.errors import ModelError
from fourpole.io.door import read_bytes
from fourpole.io.seal import KEY, alterations
from fourpole.units import shown
from fourpole.version import VERSION as OWN_VERSION
from fourpole.words import first_of

FORMAT, VERSION = "fourpole-model", 1
MOST_BYTES = 50_000_000
#: Alterations that a message names, and the characters it has of each.
_MOST_NAMED, _LONGEST = 5, 200


def read_document(path: str | Path) -> dict[str, Any]:
    """The JSON document of a model file of this version, with its seal as it stands.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If it is no JSON, has a key twice or a number that is none, or is no model file of this version.
    """
    return document_of(read_bytes(path, max_bytes=MOST_BYTES), Path(path).name)


def document_of(content: bytes, name: str) -> dict[str, Any]:
    """The JSON document of a model file from its bytes; see `read_document`."""
    try:
        document = json.loads(content, object_pairs_hook=_once, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{name}: is no model file: not valid JSON ({error})") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ModelError(f"{name}: is no model file: fourpole fit or fourpole map write such files")
    stated = document.get("version")
    if type(stated) is int and stated > VERSION:
        raise ModelError(
            f"{name}: is of version {str(stated)[:12]}, this Fourpole ({OWN_VERSION}) reads up to {VERSION}: update it"
        )
    if type(stated) is not int or stated != VERSION:
        raise ModelError(f"{name}: has no version that is known: {shown(str(stated))}")
    return document


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object of these keys and values; ValueError if a key is there twice."""
    found = dict(pairs)
    if len(found) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {shown(twice)} is there twice in one object")
    return found


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def changes(name: str, document: dict[str, Any]) -> list[str]:
    """What was changed in a document since it was sealed; empty if nothing was. ModelError if that cannot be told."""
    try:
        return alterations(document)
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{name}: is no model file: {error}") from None


def check_seal(name: str, document: dict[str, Any]) -> None:
    """ModelError unless a document has a seal and is as it was sealed."""
    if KEY not in document:
        raise ModelError(
            f"{name}: is not sealed: it was changed, or is of a Fourpole from before seals. If you know that its "
            f"numbers are right, fourpole verify {name} --seal NEW writes a sealed copy; else run fourpole fit or map "
            "again"
        )
    found = changes(name, document)
    if found:
        raise ModelError(
            f"{name}: was changed after it was written: {listed(found)}. Take the file as it was written, or run "
            "fourpole fit or map again"
        )


def listed(found: list[str]) -> str:
    """The first alterations, and how many more there are."""
    return first_of([one[:_LONGEST] for one in found], _MOST_NAMED, "; ")
