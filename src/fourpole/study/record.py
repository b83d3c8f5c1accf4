"""study.json: all that it takes to repeat an analysis, and the list of its results."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

from fourpole.campaign.folder import Campaign
from fourpole.campaign.report import shown_units
from fourpole.campaign.row import Test
from fourpole.errors import FileError, TableError
from fourpole.fitting.rows import axes_record
from fourpole.io.folders import resolved
from fourpole.io.origin import origin
from fourpole.io.published import LIST, published_beside
from fourpole.io.write import write_text
from fourpole.quantities import ShownUnits
from fourpole.version import VERSION

#: Keys of study.json with what each holds.
KEYS = {
    "title": "title of the campaign",
    "settings": "route by which K* was found, number of Monte Carlo draws, and their seed",
    "conditions": "axes of a condition, with the differences that count as the same",
    "stated": "the campaign as it was understood, in SI: rigs, channels, logger, specimens, report, limits",
    "versions": "versions of Python, Fourpole and the packages that results depend on",
    "kernel": "what fitted the sines: `c`, the library in C, or `numpy`; a cluster's workers may have the other one",
    "origin": (
        "`version` of Fourpole; `commit` of its repository, null if it was installed without one; `changed`: whether "
        "files of the package differ from the commit, null if that is not known"
    ),
    "verdicts": "number of tests by verdict",
    "assumptions": "what was taken for values that the campaign does not state",
    "notes": "notes on the route and the rigs",
    "campaign": "path of the campaign's folder, from that of the results if they lie in it",
    "tests": "rows of tests.csv as they were understood, in SI",
    "joint": "of each rig: what the joint route found; only after the joint route",
    "likelihood": "of each rig: values that its tests share, which likelihood.parquet refers to",
    "sha256": "SHA-256 of each file that was read, by its name in the campaign",
    "results": "SHA-256 of each result by its name: tables, model files, figures, report",
    "sizes": "size of each result by its name [byte]; together with `results` it is the list by which results are read",
    "seal": "SHA-256 of all of this, by which `fourpole verify` sees a change",
}


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the record into the new folder of `publishing`, which adds the list of the results."""
    write_text(folder / LIST, json.dumps(record, ensure_ascii=False))


def units_beside(path: Path) -> ShownUnits:
    """The units that the campaign of some results wants, by their folder or a file in it; the usual ones without."""
    folder = path if path.is_dir() else path.parent
    try:
        record = published_beside(folder / LIST).record
    except (FileError, TableError):
        return ShownUnits()
    return shown_units(section(record, "stated", "report").get("units"))


def section(value: object, *path: str) -> dict[str, Any]:
    """The table at a path of nested tables, as of study.json; empty if there is none."""
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def stated_blocked(record: object, rig: str) -> bool:
    """Whether campaign.toml states that the far side of a rig does not move: output = "blocked"."""
    return section(record, "stated", "rigs", rig).get("output") == "blocked"


def texts(value: object) -> list[str]:
    """The items of a list as texts; empty if the value is no list."""
    return [str(item) for item in value] if isinstance(value, list) else []


@cache
def _libraries() -> dict[str, str]:
    """Versions of the libraries that results depend on; to look them up takes as long as to reduce a recording."""
    from importlib.metadata import version  # slow to load

    return {name: version(name) for name in ("numpy", "scipy", "polars", "pint", "pydantic")}


def assumptions_of(campaign: Campaign) -> list[str]:
    """Notes on what is taken for values that campaign.toml and tests.csv do not state."""
    assumed = [
        f"tests.csv: {name} is stated without u({name}), taken as {taken}"
        for name, taken in (("K1", "2 %"), ("added_mass", "0.2 % of it"))
        if any(test.value(name) and test.value(f"u({name})") is None for test in campaign.of_kind("dynamic"))
    ]
    return [*campaign.stated.assumptions(), *assumed]


def study_record(campaign: Campaign, further: Mapping[str, Any]) -> dict[str, Any]:
    """The record of an analysis: what the campaign and this installation determine, and `further` entries."""
    tests = [  # what a row of tests.csv does not state is left out
        {
            part.name: value
            for part in fields(test)
            if part.name != "faults" and (value := getattr(test, part.name)) not in ("", None, False, {}, ())
        }
        for test in campaign.tests
    ]
    record = {
        **further,
        "title": campaign.stated.title,
        "conditions": {"axes": axes_record(campaign.stated.sameness)},
        "stated": campaign.statement(),
        "versions": {"python": platform.python_version(), "fourpole": VERSION} | _libraries(),
        "origin": origin().record,
        "assumptions": assumptions_of(campaign),
        "tests": tests,
    }
    return {key: record[key] for key in KEYS if key in record}


def tests_of(record: Mapping[str, Any]) -> list[Test]:
    """The rows of tests.csv in a record of study.json; none in that of an older version."""
    rows = record.get("tests")
    known = {part.name for part in fields(Test)}
    return [_test(row, known) for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def _test(row: Mapping[str, Any], known: set[str]) -> Test:
    stated: dict[str, Any] = {"name": "", "row": 0, **{name: value for name, value in row.items() if name in known}}
    for name in ("window", "band"):
        stated[name] = tuple(stated[name]) if stated.get(name) else None
    return Test(**stated)


def place_of(campaign: Path, results: Path) -> str:
    """The path of a campaign for study.json: from the results if they lie in its folder, so that both can be moved."""
    campaign, results = resolved(campaign), resolved(results)
    return os.path.relpath(campaign, results) if campaign in results.parents else str(campaign)
