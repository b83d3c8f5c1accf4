"""Results below a folder become one Parquet data set; two campaigns of it compared, as `fourpole compare` does.

Results that have not changed since are not read again. The columns of its tables are the same in each file.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.sources import Source
from fourpole.errors import CampaignError, FourpoleError
from fourpole.findings.compared import RATIO, compared_by
from fourpole.findings.points import MOUNTING, none, of_two_campaigns
from fourpole.fitting.rows import keyed, rule_in
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes
from fourpole.io.folders import make_folder, resolved
from fourpole.io.lock import staged
from fourpole.io.published import Published, consistently
from fourpole.io.write import write_table, write_text
from fourpole.study import tables as of_study
from fourpole.study.study import Study
from fourpole.study.tables import TableSpec, read_table

#: Version of the data set. A change of a column's name or meaning, or of the files' places, raises it.
SCHEMA = 1
#: The index of a data set, the keys of a campaign's rule of one condition and of its rig and sensors in it, and its
#: largest size [byte].
INDEX, CONDITIONS, STATED, MOST_BYTES = "lab.json", "conditions", "stated", 1_000_000_000
#: Columns that stand first in each table and say where a row is from.
ORIGIN: dict[str, Any] = {
    "schema": pl.Int64,
    "campaign": pl.String,
    "laboratory": pl.String,
    "title": pl.String,
    "date": pl.Date,
    "fourpole": pl.String,
    "sha256": pl.String,
}
#: Columns of tests.csv that the results have no column for: a JSON object, head -> text.
FURTHER = "further"
#: Column of `budget`: the object to which the error belongs, as "channel" or "rig".
ROLE = "role"


@dataclass(frozen=True)
class LabTable:
    """One table of the data set.

    Attributes
    ----------
    spec : TableSpec
        The result table whose rows it has.
    columns : mapping of str to polars type
        All its columns.
    needed : tuple of str
        Columns without which results are not taken; another column that results lack is left empty.
    """

    spec: TableSpec
    columns: Mapping[str, Any]
    needed: tuple[str, ...]


def _table(spec: TableSpec, *needed: q.Quantity, further: Mapping[str, Any], keyed: bool = True) -> LabTable:
    first = {q.TEST.head: pl.String, q.POINT.head: pl.Int64} if keyed else {}
    # a list in place of an array of fixed length, which not every reader knows
    plain = {head: pl.List(pl.Float64) if isinstance(kind, pl.Array) else kind for head, kind in spec.columns.items()}
    return LabTable(spec, {**ORIGIN, **first, **plain, **further}, tuple(quantity.head for quantity in needed))


#: Tables of the data set by name.
TABLES: dict[str, LabTable] = {
    "tests": _table(
        of_study.DYNAMIC,
        *(q.TEST, q.TYRE, q.FREQUENCY, q.STORAGE, q.LOSS),
        further={"time": pl.String, FURTHER: pl.String},
    ),
    "static": _table(
        of_study.STATIC,
        *(q.TEST, q.TYRE, q.PRELOAD, q.K1),
        further={q.TEMPERATURE.head: pl.Float64, FURTHER: pl.String},
        keyed=False,
    ),
    "rig": _table(of_study.RIG, q.VALUE, q.UNIT, further={}, keyed=False),
    "budget": _table(of_study.BUDGET, q.TEST, q.QUANTITY, q.SOURCE, q.U, further={ROLE: pl.String}),
    "covariance": _table(of_study.COVARIANCE, q.TEST, q.OWN_COVARIANCE, further={}),
}


def scan(folder: str | Path, table: str = "tests") -> pl.LazyFrame:
    """A table of a data set, which is read when it is collected.

    Parameters
    ----------
    folder : path
        A data set that `gather` or `fourpole lab` wrote.
    table : str
        One of `TABLES`.

    Raises
    ------
    CampaignError
        If there is no such table, or the folder holds no data set.
    """
    if table not in TABLES:
        raise CampaignError(f"no table {table!r}: choose one of {', '.join(TABLES)}")
    if not any(Path(folder, table).glob("*.parquet")):
        raise CampaignError(f"{folder}: there is no data set: fourpole lab FOLDER writes one")
    return pl.scan_parquet(Path(folder, table) / "*.parquet")


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
    """The rows with the columns of the data set, and the columns that the results lack.

    CampaignError if they lack a column without which they are not taken.
    """
    if not frame.width:
        return pl.DataFrame(schema=dict(table.columns)), []
    for head in table.needed:
        if head not in frame.columns:
            raise CampaignError(f"{table.spec.name} has no column {head}: run fourpole analyse again")
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


def _further(frame: pl.DataFrame, own: dict[str, Any]) -> list[str | None]:
    """The other columns of each row as a JSON object; None where all of them are blank."""
    rows = (
        {head: str(value) for head, value in row.items() if head not in own and value is not None and value != ""}
        for row in frame.iter_rows(named=True)
    )
    return [json.dumps(row, ensure_ascii=False, sort_keys=True) if row else None for row in rows]


#: Cases of what two campaigns share.
_WAYS = ("independent", "same sensors")
_VALUES = (q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)


def difference(folder: str | Path, first: str, second: str) -> pl.DataFrame:
    r"""The second campaign less the first, at each condition and frequency that both have.

    .. math:: u^2 = \sum_s (u_{1s}^2 + u_{2s}^2 - 2 r_s u_{1s} u_{2s})

    over the sources s of the budgets. Two cases are given. If the campaigns are independent, r = 0. For "same sensors",
    r is by the rule of `fourpole.compare`: 1 for the errors of sensors with one serial number in both, of a rig that
    both state alike, and of weighed masses of one size, and for the gains of load and deflection in K1.

    Parameters
    ----------
    folder : path
        A data set of `gather`.
    first, second : str
        Names of the campaigns.

    Returns
    -------
    polars.DataFrame
        A row for each of K', K'', the loss factor, K2 and C at each condition and frequency of `first` that `second`
        has too, by the rule of one condition of both campaigns; repeats are averaged. Values of the second are brought
        to the frequency of the first by the slope over the neighbouring frequencies. `ratio` is the difference over its
        uncertainty: beyond 2 or -2, errors do not explain it (about 5 % of all ratios are, where nothing differs).

    Raises
    ------
    CampaignError
        If there is no such data set or campaign.

    Notes
    -----
    With r = 1 an error is taken to act in the same direction in both campaigns, which holds for the same route, rig and
    condition. Where K* differs by more than 20 %, no error of the dynamic test is taken as common, and none at all if
    the campaigns found K* by different routes. It is the computation of `fourpole.compare`.
    """
    names = scan(folder).select("campaign").unique().collect()["campaign"].sort().to_list()
    for name in (first, second):
        if name not in names:
            raise CampaignError(f"{folder}: has no campaign {name!r}: choose one of {', '.join(names)}")
    was, now = (_study(Path(folder), name) for name in (first, second))
    used = pl.col(q.VERDICT.head) != Verdict.REJECTED
    routes = [set(study.dynamic.filter(used)[q.ROUTE.head]) for study in (was, now)]
    common = of_two_campaigns(was, now)[0] if routes[0] == routes[1] else none
    tables = [compared_by(was, now, errors, _VALUES) for errors in (none, common)]
    shown = tables[0].select(
        pl.col("specimen").alias(q.TYRE.head),
        *(quantity.head for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE, q.FREQUENCY)),
        *("quantity", "unit", "first", "second", "difference"),
    )
    return shown.with_columns(
        *(table["u(difference)"].alias(f"u {way}") for way, table in zip(_WAYS, tables, strict=True)),
        *(table[RATIO].alias(f"ratio {way}") for way, table in zip(_WAYS, tables, strict=True)),
    )


def _study(folder: Path, campaign: str) -> Study:
    """The results of one campaign of a data set, with its rule of one condition."""
    content = read_bytes(folder / INDEX, max_bytes=MOST_BYTES, within=folder)
    entry = json_of(content, INDEX)["campaigns"].get(campaign, {})
    record = {name: entry.get(name) for name in (CONDITIONS, STATED)}
    tables = {name: scan(folder, name).filter(pl.col("campaign") == campaign).collect() for name in TABLES}
    further = [json_of(text, FURTHER) if text else {} for text in tables["tests"][FURTHER].to_list()]
    heads = dict.fromkeys(head for row in further for head in row)
    axes = {MOUNTING, *(axis.column for axis in rule_in(record).further)}
    columns = [
        pl.Series(head, [row.get(head) for row in further], dtype=pl.String)
        for head in heads
        if head.removesuffix(" (tests.csv)") in axes
    ]
    return Study(tables={**tables, "dynamic": tables["tests"].with_columns(columns)}, record=record)
