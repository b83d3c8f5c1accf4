"""Results below a folder become one Parquet data set; results that have not changed since are not read again."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.sources import Source
from fourpole.errors import CampaignError, FourpoleError
from fourpole.fitting.rows import keyed
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes
from fourpole.io.folders import make_folder, resolved
from fourpole.io.published import Published, consistently
from fourpole.io.staging import staged
from fourpole.io.write import write_table, write_text
from fourpole.lab.layout import CONDITIONS, FURTHER, INDEX, MOST_BYTES, ORIGIN, ROLE, SCHEMA, STATED, TABLES, LabTable
from fourpole.study.tables import read_table

_FORMAT, _STUDY = "fourpole lab", "study.json"
_TIME = "time"


@dataclass(frozen=True)
class Gathered:
    """What `gather` did.

    Attributes
    ----------
    folder : Path
        The data set.
    campaigns : tuple of str
        Names of the campaigns in it.
    read, unchanged, removed : int
        Number of campaigns whose results were read now, were read before, and are no longer there.
    tests : int
        Number of rows of the table `tests`.
    problems : tuple of str
        Results that were not taken, and columns that are empty, each with what to do.
    left_out : int
        Number of results that were not taken.
    """

    folder: Path
    campaigns: tuple[str, ...]
    read: int
    unchanged: int
    removed: int
    tests: int
    problems: tuple[str, ...]
    left_out: int


def gather(
    folder: str | Path, out: str | Path | None = None, *, progress: Callable[[int, int], None] | None = None
) -> Gathered:
    """Gather all results below a folder into one data set.

    Parameters
    ----------
    folder : path
        Each folder below it that holds study.json is taken. Links to folders are not followed.
    out : path, optional
        The data set; by default the folder `lab` in `folder`. Its files are replaced all together or not at all.
    progress : callable, optional
        Called with the number of results looked at and the number of all.

    Returns
    -------
    Gathered

    Raises
    ------
    CampaignError
        If there are no results, or a newer Fourpole wrote the data set.
    FileError
        If a file cannot be written.
    """
    folder = Path(folder)
    out = folder / "lab" if out is None else Path(out)
    places = _places(folder, out)
    make_folder(out)
    former, names = _former(out), _names(folder, places)
    index: dict[str, dict[str, Any]] = {}
    problems: list[str] = []
    read, obsolete = 0, list[str]()
    with staged(out, obsolete, last=INDEX) as new:
        for number, place in enumerate(places):
            if progress is not None:
                progress(number, len(places))
            name, seen = names[place], _seen(place)
            if name in former and _stands(former[name], seen, out):
                index[name] = former[name]
                continue
            try:
                taken = consistently(place, partial(_taken, name=name, new=new, problems=problems))
                index[name] = {"seen": seen, **taken}
                read += 1
            except FourpoleError as error:
                problems.append(f"{name}: not taken: {error}")
        obsolete += _unused(out, {entry["file"] for entry in index.values()})
        document = {"format": _FORMAT, "schema": SCHEMA, "folder": os.path.relpath(folder, out), "campaigns": index}
        write_text(new / INDEX, json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    if progress is not None:
        progress(len(places), len(places))
    return Gathered(
        folder=out,
        campaigns=tuple(index),
        read=read,
        unchanged=len(index) - read,
        removed=len(former.keys() - set(names.values())),
        tests=sum(entry["tests"] for entry in index.values()),
        problems=tuple(problems),
        left_out=len(places) - len(index),
    )


def _places(folder: Path, out: Path) -> list[Path]:
    """Folders with results below a folder, without the data set; CampaignError if there are none."""
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder; check its name")
    places = list(_results_below(folder, out))
    if not places:
        raise CampaignError(f"{folder}: no results below it: run fourpole analyse on its campaigns first")
    return places


def _results_below(folder: Path, out: Path) -> Iterator[Path]:
    """Folders with a study.json, in the order of their names; not below results, hidden folders or links."""
    for place, folders, files in os.walk(folder):
        here = Path(place)
        if _STUDY in files and not (here / _STUDY).is_symlink():
            folders.clear()
            yield here
        is_out = {name for name in folders if name == out.name and resolved(here / name) == resolved(out)}
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in is_out)


def _names(folder: Path, places: list[Path]) -> dict[Path, str]:
    """The name of the campaign of each results folder: its path below `folder`, without a last part `results`."""
    names: dict[Path, str] = {}
    for place in places:
        path = place.relative_to(folder).as_posix()
        campaign = path.removesuffix("/results") if path not in ("results", ".") else folder.resolve().name
        names[place] = path if campaign in names.values() else campaign
    return names


def _former(out: Path) -> dict[str, dict[str, Any]]:
    """The campaigns of the data set as it is; none if it is of another schema, which is then written anew."""
    path = out / INDEX
    if not path.exists():
        return {}
    try:
        document = json_of(read_bytes(path, max_bytes=MOST_BYTES, within=out), INDEX)
        schema, campaigns = int(document["schema"]), dict(document["campaigns"])
        if document["format"] != _FORMAT or any(not entry["seen"] or not entry["file"] for entry in campaigns.values()):
            raise ValueError
    except (ValueError, KeyError, TypeError, RecursionError):
        raise CampaignError(
            f"{path}: is not one that fourpole lab wrote: delete it, or name another folder with --out"
        ) from None
    if schema > SCHEMA:
        raise CampaignError(
            f"{path}: a newer Fourpole wrote this data set (schema {schema}, this one writes {SCHEMA}): update "
            "Fourpole, or name another folder with --out"
        )
    return campaigns if schema == SCHEMA else {}


def _seen(place: Path) -> dict[str, list[int]]:
    """Size [bytes] and time of change [ns] of each file that is read."""
    seen = {}
    for name in (_STUDY, *(f"{table.spec.name}{table.spec.endings[0]}" for table in TABLES.values())):
        with suppress(OSError):
            state = (place / name).stat()
            seen[name] = [state.st_size, state.st_mtime_ns]
    return seen


def _stands(entry: dict[str, Any], seen: dict[str, list[int]], out: Path) -> bool:
    """Whether the rows of a campaign are there, and of the results as they are."""
    there = all((out / table / entry["file"]).is_file() for table in TABLES)
    return there and entry["seen"] == seen and {CONDITIONS, STATED} <= entry.keys()


def _unused(out: Path, kept: set[str]) -> list[str]:
    """Files of the data set, relative to it, that no campaign has any more."""
    ours = re.compile(r".*-[0-9a-f]{8}\.parquet")
    return [
        f"{table}/{path.name}"
        for table in TABLES
        for path in (out / table).glob("*.parquet")
        if path.name not in kept and ours.fullmatch(path.name)
    ]


def _taken(results: Published, *, name: str, new: Path, problems: list[str]) -> dict[str, Any]:
    """Write the rows of one campaign into the new data set; returns its entry of the index."""
    record = results.record
    if not isinstance(record.get("stated"), dict):
        raise CampaignError(f"{_STUDY} is not one that fourpole wrote: run fourpole analyse again")
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", name)[:60].strip("-.")
    file = f"{slug}-{hashlib.sha256(name.encode()).hexdigest()[:8]}.parquet"
    tables = {name: read_table(results, table.spec, table.needed) for name, table in TABLES.items()}
    origin = _origin(record, name, results.mark, tables["tests"])
    made = {}
    for table, frame in tables.items():
        made[table], lacking = _rows(frame, TABLES[table], origin)
        if lacking:
            columns = ", ".join(lacking)
            problems.append(f"{name}: {table} is without {columns}: run fourpole analyse again to have them")
    for table, frame in made.items():
        (new / table).mkdir(exist_ok=True)
        write_table(new / table / file, frame)
    stated = {name: record[STATED].get(name) for name in ("laboratory", "rigs", "channels")}
    kept = {CONDITIONS: record.get(CONDITIONS), STATED: stated}
    return {"file": file, "sha256": origin["sha256"], "tests": made["tests"].height, **kept}


def _origin(record: dict[str, Any], name: str, sha256: str, tests: pl.DataFrame) -> dict[str, Any]:
    """Values of the first columns, which are the same in all rows of a campaign."""
    stated, versions = record["stated"], record.get("versions")
    return {
        "schema": SCHEMA,
        "campaign": name,
        "laboratory": str(stated.get("laboratory") or ""),
        "title": str(record.get("title") or ""),
        "date": _date(stated.get("date"), tests),
        "fourpole": str(versions.get("fourpole", "")) if isinstance(versions, dict) else "",
        "sha256": sha256,
    }


def _date(stated: object, tests: pl.DataFrame) -> date | None:
    """The date as campaign.toml states it, or of the first test that has a time; None without either."""
    times = [] if _TIME not in tests.columns else [time for time in tests[_TIME].to_list() if time]
    for text in (stated, *sorted(map(str, times))[:1]):
        with suppress(ValueError):
            return date.fromisoformat(str(text)[:10])
    return None


def _rows(frame: pl.DataFrame, table: LabTable, origin: dict[str, Any]) -> tuple[pl.DataFrame, list[str]]:
    """The rows with the columns of the data set, and the columns that the results lack."""
    if not frame.width:
        return pl.DataFrame(schema=dict(table.columns)), []
    _check_needed(frame, table)
    frame = keyed(frame) if q.POINT.head in table.columns else frame
    own = {head: kind for head, kind in table.columns.items() if head not in ORIGIN and head not in (FURTHER, ROLE)}
    lacking = [head for head in table.spec.columns if head not in frame.columns]
    rows = frame.select(
        *(pl.lit(origin[head], dtype=kind).alias(head) for head, kind in ORIGIN.items()),
        *(
            (pl.col(head).cast(kind) if head in frame.columns else pl.lit(None, dtype=kind).alias(head))
            for head, kind in own.items()
        ),
    )
    if FURTHER in table.columns:
        rows = rows.with_columns(pl.Series(FURTHER, _further(frame, own), dtype=pl.String))
    if ROLE in table.columns:
        roles = {text: Source.read(text).role.name.lower() for text in rows[q.SOURCE.head].unique() if text}
        rows = rows.with_columns(pl.col(q.SOURCE.head).replace_strict(roles, default=None).alias(ROLE))
    return rows, lacking


def _check_needed(frame: pl.DataFrame, table: LabTable) -> None:
    """CampaignError if results lack a column without which they are not taken."""
    needed = [head for head in table.needed if head not in frame.columns]
    if needed:
        raise CampaignError(f"{table.spec.name} has no column {needed[0]}: run fourpole analyse again")


def _further(frame: pl.DataFrame, own: dict[str, Any]) -> list[str | None]:
    """The other columns of each row as a JSON object; None where all of them are blank."""
    rows = (
        {head: str(value) for head, value in row.items() if head not in own and value is not None and value != ""}
        for row in frame.iter_rows(named=True)
    )
    return [json.dumps(row, ensure_ascii=False, sort_keys=True) if row else None for row in rows]
