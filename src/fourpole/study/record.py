"""The hashes in study.json of the files that were written beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fourpole.io.door import read_bytes, sha256_of
from fourpole.io.write import write_text
from fourpole.study.tables import TABLE_FILES

NAME = "study.json"
#: The tables that an analysis writes, and the model file, whose own seal holds if `fourpole fit` writes it anew.
HASHED = (*TABLE_FILES, "findings.csv", "model.json")
_MOST_BYTES = 2_000_000_000
#: Keys of study.json with what each holds.
KEYS = {
    "title": "title of the campaign",
    "settings": "route by which K* was found, number of Monte Carlo draws, and their seed",
    "conditions": "axes of a condition, with the differences that count as the same",
    "stated": "the campaign as it was understood, in SI: rigs, channels, specimens, report, limits",
    "versions": "versions of Python, Fourpole and the packages that results depend on",
    "origin": (
        "`version` of Fourpole; `commit` of its repository, null if it was installed without one; `changed`: whether "
        "files of the package differ from the commit, null if that is not known"
    ),
    "verdicts": "number of tests by verdict",
    "assumptions": "what was taken for values that the campaign does not state",
    "notes": "notes on the route and the rigs",
    "joint": "of each rig: what the joint route found; only after the joint route",
    "likelihood": "of each rig: values that its tests share, which likelihood.parquet refers to",
    "sha256": "SHA-256 of each file that was read, by its name in the campaign",
    "results": "SHA-256 of each table, and of model.json if the analysis made one, as they were written beside it",
}


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write study.json: the record, and the hash of each table that the folder has.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    hashes = {name: sha256_of(folder / name, max_bytes=_MOST_BYTES) for name in HASHED if (folder / name).is_file()}
    whole = {**record, "results": hashes}
    write_text(folder / NAME, json.dumps(whole, indent=2, ensure_ascii=False) + "\n")


def note_results(folder: Path) -> None:
    """Note the hashes again, after further files were written."""
    write_record(folder, read_record(folder))


def without_hashes(folder: Path) -> dict[str, Any]:
    """Content of study.json without the hashes of results, and without the commit of the program."""
    return {key: value for key, value in read_record(folder).items() if key not in ("results", "origin")}


def read_record(folder: Path) -> dict[str, Any]:
    """Content of study.json.

    Raises
    ------
    FileError, TableError
        If it cannot be read, or is empty.
    ValueError
        If it is no JSON object.
    """
    found = json.loads(read_bytes(folder / NAME, max_bytes=_MOST_BYTES))
    if not isinstance(found, dict):
        raise ValueError(f"{NAME} is no record of an analysis")
    return found
