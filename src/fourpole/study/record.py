"""study.json: all that it takes to repeat an analysis, and the list of its results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fourpole.io.published import LIST
from fourpole.io.write import write_text

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
    "results": "SHA-256 of each result by its name: tables, model files, figures, report",
    "sizes": "size of each result by its name [byte]; together with `results` it is the list by which results are read",
    "seal": "SHA-256 of all of this, by which `fourpole verify` sees a change",
}


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the record into the new folder of `publishing`, which adds the list of the results."""
    write_text(folder / LIST, json.dumps(record, indent=2, ensure_ascii=False) + "\n")
