"""campaign.toml and tests.csv as a form fills them in: comments and what the form does not show stay as they are."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Table

from fourpole import quantities as q
from fourpole.campaign.folder import MOST_TOML, check_statement
from fourpole.campaign.row import DOUBTS, still_open
from fourpole.errors import CampaignError, FourpoleError, TableError
from fourpole.io.documents import delimiter_of, rows_of, toml_of
from fourpole.io.door import read_bytes
from fourpole.io.lock import campaign_lock, staged
from fourpole.io.source import decode
from fourpole.io.write import write_text
from fourpole.served.workspace import MOST_TABLE, version_of
from fourpole.words import package_toml

_WORDS = package_toml("fourpole.served")
#: The roles of [channels], the keys of a channel and the values of the rig that the form shows, with what they are.
ROLES: dict[str, str] = _WORDS["roles"]
KEYS: dict[str, tuple[str, str]] = _WORDS["keys"]
RIG: dict[str, str] = _WORDS["rig"]
#: The column of tests.csv with the reason why a test is left out.
EXCLUDED = "excluded"
_DOUBT = re.compile(r"\s*#\s*doubt:\s*+(.*)$")
_ROW = re.compile(r"(?:^|; )tests\.csv row (\d+): ")
_PLACE = re.compile(r"^campaign\.toml: \[?([\w.\-]+)\]?:?(?: ([\w.]+)(?=[: ]))?")
#: A table and a key of campaign.toml, also as a comment that stands in its place.
_TABLE, _KEY = re.compile(r"\s*(?:#\s*)?\[(\w+)[\].]"), re.compile(r"\s*(?:#\s*)?(\w+)\s*=")
#: The parts of a value of the rig.
_PARTS = ("value", "unit", "std")
_QUOTED = re.compile(r"'([^']*)'")


class ConflictError(CampaignError):
    """Someone else has changed the statement meanwhile."""


@dataclass(frozen=True)
class Statement:
    """What the form shows.

    Attributes
    ----------
    version : str
        A mark of the files as they were read.
    text : str
        campaign.toml as it is.
    title : str
    channels : dict of str to dict of str to str
        Keys of each channel as texts, by role.
    clock : dict of str to str
        column and unit of the times, and sample_rate.
    rig : dict of str to (str, str, str)
        Value, unit and standard uncertainty of each value of [rig].
    blocked : bool
        Whether the far side of the specimen is held.
    simple : bool
        Whether the form can show the rig: there is one, or none.
    doubts : tuple of (str, str)
        The doubts that stand in campaign.toml as comments, each with the path of what it is about.
    heads : list of str
        Heads of tests.csv.
    rows : list of list of str
        Its cells.
    """

    version: str
    text: str
    title: str
    channels: dict[str, dict[str, str]]
    clock: dict[str, str]
    rig: dict[str, tuple[str, str, str]]
    blocked: bool
    simple: bool
    doubts: tuple[tuple[str, str], ...]
    heads: list[str]
    rows: list[list[str]]


@dataclass(frozen=True)
class FormFault:
    """What is wrong, in the words of the command line, and where: a path in campaign.toml, or row and column."""

    text: str
    path: str = ""
    row: int | None = None
    column: str = ""


def read_statement(folder: Path) -> Statement:
    """The statement of a folder; empty where a file is missing."""
    return _statement(version_of(folder), _text(folder, "campaign.toml"), _text(folder, "tests.csv"))


def _statement(version: str, text: str, table: str) -> Statement:
    stated: dict[str, Any] = {}
    with suppress(TableError):
        stated = toml_of(text, "campaign.toml")
    channels, rig = _table(stated, "channels"), _table(stated, "rig")
    heads, rows = _cells(table)
    return Statement(
        version=version,
        text=text,
        title=str(stated.get("title", "")),
        channels={role: _channel(channels.get(role)) for role in ROLES},
        clock={**_channel(channels.get("time")), "sample_rate": str(channels.get("sample_rate", ""))},
        rig={name: _value(rig.get(name)) for name in RIG},
        blocked=rig.get("output") == "blocked",
        simple="rigs" not in stated,
        doubts=tuple(_doubts(text)),
        heads=heads,
        rows=rows,
    )


def _doubts(text: str) -> Iterator[tuple[str, str]]:
    """The doubts in campaign.toml, each with the path of what stands below it: a channel, the rig, or a table."""
    open_, table = list[str](), ""
    for line in text.splitlines():
        if found := _DOUBT.match(line):
            open_.append(found[1])
        elif found := _TABLE.match(line) or _KEY.match(line):
            path = table = found[1] if found.re is _TABLE else table
            if found.re is _KEY and table == "channels":
                path = f"{table}.{'time' if found[1] == 'sample_rate' else found[1]}"
            yield from ((doubt, path) for doubt in open_)
            open_ = []
    yield from ((doubt, "") for doubt in open_)


def save(folder: Path, version: str, form: Mapping[str, Any]) -> str:
    """Write what the form states, both files together or none; returns the mark of the new files.

    Parameters
    ----------
    folder : Path
    version : str
        The mark of the files that the form was made of.
    form : mapping
        `text`, the whole of campaign.toml; or `title`, `channels`, `clock`, `rig`, `blocked`. `heads` and `rows` of
        tests.csv.

    Raises
    ------
    ConflictError
        If a file has changed since.
    CampaignError
        If campaign.toml is no TOML, or the form is not whole.
    """
    with campaign_lock(folder):
        return _save(folder, version, form)


def _save(folder: Path, version: str, form: Mapping[str, Any]) -> str:
    """Compare and write, under the lock of the campaign."""
    if version != version_of(folder):
        raise ConflictError(
            "someone else, or an editor, has changed this campaign since the page was opened: load it again"
        )
    text, table = _new(folder, form)
    with staged(folder) as new:
        write_text(new / "campaign.toml", text)
        if table is not None:
            write_text(new / "tests.csv", table)
    return version_of(folder)


def _new(folder: Path, form: Mapping[str, Any]) -> tuple[str, str | None]:
    """The texts of campaign.toml and tests.csv that a form states; None for a table that it does not state."""
    try:
        text = _stated(_text(folder, "campaign.toml"), form)
        former = _text(folder, "tests.csv")
        table = _written(form["heads"], form["rows"], delimiter_of(former)) if form.get("heads") else None
        f"{text}{table}".encode()  # a text with half a character cannot be written
        _check_readable(text, table or "")
    except FourpoleError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError):
        raise CampaignError("the form is not whole: load the page again") from None
    return text, table


def _check_readable(text: str, table: str) -> None:
    """CampaignError or TableError for new texts that this form could not read again, whatever they say."""
    for name, content, most in (("campaign.toml", text, MOST_TOML), ("tests.csv", table, MOST_TABLE)):
        if len(content.encode()) > most:
            raise CampaignError(f"{name}: has {len(content.encode()) / 1e6:.4g} MB, at most {most / 1e6:g} MB are read")
    for _ in rows_of(table, "tests.csv"):
        pass


def exclude(folder: Path, test: str, reason: str) -> None:
    """Write the reason why a test is left out into its row of tests.csv; an empty one takes it in again.

    Raises
    ------
    CampaignError
        If tests.csv has no such test.
    """
    with campaign_lock(folder):
        stated = read_statement(folder)
        heads, rows = stated.heads, stated.rows
        if "test" not in heads:
            raise CampaignError("tests.csv has no column test")
        if EXCLUDED not in heads:
            heads, rows = [*heads, EXCLUDED], [[*row, ""] for row in rows]
        name, column = heads.index("test"), heads.index(EXCLUDED)
        chosen = [row for row in rows if row[name] == test]
        if not chosen:
            raise CampaignError("there is no such test in tests.csv: it was renamed or removed")
        for row in chosen:
            row[column] = " ".join(reason.split())
        _save(folder, stated.version, {"heads": heads, "rows": rows})


def problems_of(folder: Path, form: Mapping[str, Any] | None = None) -> list[FormFault]:
    """All that is wrong with a statement as it is, or as a form would save it, each with its place; doubts last."""
    try:
        text, table = (_text(folder, "campaign.toml"), None) if form is None else _new(folder, form)
        table = _text(folder, "tests.csv") if table is None else table
        stated = _statement("", text, table)
        faults, tests, doubts = check_statement(folder, text, table)
    except FourpoleError as error:
        return [FormFault(str(error))]
    of_rows = [
        FormFault(f"tests.csv row {test.row}: {fault}", row=test.row, column=fault.code)
        for test in tests
        if not test.excluded
        for fault in test.faults
    ]
    return [*(_placed(one, stated) for one in faults), *of_rows, *(_placed(one, stated) for one in doubts)]


def _placed(text: str, stated: Statement) -> FormFault:
    """A fault with the place that its words name."""
    rows = _of_row(text)
    if rows:
        return rows[0]
    found = _PLACE.match(text)
    path = "" if found is None else ".".join(part for part in found.groups() if part)
    section, _, role = path.partition(".")
    values = {**stated.channels, "time": stated.clock}.get(role, {}) if section == "channels" else {}
    if section == "rig":
        values = dict(zip(_PARTS, stated.rig.get(role, ()), strict=False))
    quoted = _QUOTED.findall(text)
    keys = [key for key, value in values.items() if value in quoted]
    path = f"{path}.{keys[0]}" if keys else path
    return FormFault(text, path)


def _of_row(text: str) -> list[FormFault]:
    """The faults of a row, each at the cell that its words begin with."""
    marks = list(_ROW.finditer(text))
    found = []
    for at, mark in enumerate(marks):
        end = marks[at + 1].start() if at + 1 < len(marks) else len(text)
        said = text[mark.end() : end]
        column = re.match(r"([\w()]+)[: ]", said)
        found.append(
            FormFault(f"tests.csv row {mark[1]}: {said}", row=int(mark[1]), column=column[1] if column else "")
        )
    return found


def _text(folder: Path, name: str) -> str:
    """The text of a file of a campaign; empty where there is none, or nothing in it."""
    try:
        if (folder / name).lstat().st_size == 0:
            return ""
    except FileNotFoundError:
        return ""
    most = MOST_TOML if name.endswith(".toml") else MOST_TABLE
    return decode(read_bytes(folder / name, max_bytes=most, within=folder), name)[0].lstrip("\ufeff")


def _table(stated: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = stated.get(name)
    return found if isinstance(found, dict) else {}


def _channel(stated: Any) -> dict[str, str]:
    """The keys of a channel as texts."""
    if not isinstance(stated, dict):
        return dict.fromkeys(KEYS, "")
    return {key: _shown(stated.get(key)) for key in KEYS}


def _value(stated: Any) -> tuple[str, str, str]:
    """Value, unit and uncertainty of a value of the rig, however it is written."""
    if isinstance(stated, dict):
        return _shown(stated.get("value")), _shown(stated.get("unit")), _shown(stated.get("std"))
    number, _, unit = _shown(stated).partition(" ")
    return number, unit, ""


def _shown(value: Any) -> str:
    if value is None or value is False:
        return ""
    return "yes" if value is True else f"{value:.12g}" if isinstance(value, float) else str(value)


def _cells(text: str) -> tuple[list[str], list[list[str]]]:
    """Heads and cells of tests.csv, every row as long as the heads."""
    rows = [row for _, row in rows_of(text, "tests.csv")]
    if not rows:
        conditions = (q.PRESSURE, q.PRELOAD, q.FREQUENCY)
        return ["test", "file", "kind", "tyre", *(one.stated_head for one in conditions)], []
    width = max(map(len, rows))
    heads, *cells = [row + [""] * (width - len(row)) for row in rows]
    return [one.strip() for one in heads], [[one.strip() for one in row] for row in cells if any(map(str.strip, row))]


def _written(heads: Sequence[str], rows: Sequence[Sequence[str]], delimiter: str) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n", delimiter=delimiter)
    names = [str(one) for one in heads]
    writer.writerow(names)
    left = doubts_left(names, rows)
    for at, row in enumerate(rows):
        cells = [str(one) for one in row]
        if left and DOUBTS in names[: len(cells)]:
            cells[names.index(DOUBTS)] = left[at]
        if any(cell.strip() for cell in cells):
            writer.writerow(cells)
    return text.getvalue()


def doubts_left(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The doubts of each row of a form without those whose cell was changed; none where there is no such column."""
    names = [str(head).partition(" [")[0] for head in heads]
    if DOUBTS not in names:
        return []
    named = (dict(zip(names, map(str, row), strict=False)) for row in rows)
    return [still_open(cells.get(DOUBTS, ""), cells) for cells in named]


def _stated(former: str, form: Mapping[str, Any]) -> str:
    """The text of campaign.toml with what the form states."""
    if "text" in form:
        text = str(form["text"])
        text.encode()  # half a character is no text
        _parsed(text)
        return text
    if "channels" not in form:
        return former
    document = _parsed(former, "; mend its text below")
    if form.get("title") or "title" in document:
        document["title"] = str(form.get("title", ""))
    _fill_rig(document, form)
    channels = _made(document, "channels")
    for role in ROLES:
        _fill(channels, role, form["channels"].get(role, {}))
    clock = {key: value for key, value in form["clock"].items() if key in ("column", "unit")}
    _fill(channels, "time", clock)
    _put(channels, "sample_rate", str(form["clock"].get("sample_rate", "")).strip())
    return _without_settled(tomlkit.dumps(document), form.get("settled", []))


def _parsed(text: str, hint: str = "") -> tomlkit.TOMLDocument:
    """The text of campaign.toml to be changed; CampaignError if it is no TOML, or nests too deep."""
    try:
        toml_of(text, "campaign.toml")  # first, for tomlkit has no bounds
        return tomlkit.parse(text)
    except (TableError, TOMLKitError) as error:
        why = str(error).removeprefix("campaign.toml: ").removeprefix("not valid TOML: ")
        raise CampaignError(f"campaign.toml: is no TOML: {why}{hint}") from None


def _fill_rig(document: tomlkit.TOMLDocument, form: Mapping[str, Any]) -> None:
    if "rigs" in document or not (form["blocked"] or any(value for value, _, _ in form["rig"].values())):
        if "rigs" not in document:
            document.pop("rig", None)
        return
    rig = _made(document, "rig")
    if form["blocked"]:
        rig["output"] = "blocked"
    else:
        rig.pop("output", None)
    for name in RIG:
        value, unit, std = (str(one).strip() for one in form["rig"].get(name, ("", "", "")))
        if not value:
            rig.pop(name, None)
        elif _value(rig.unwrap().get(name)) != (value, unit, std):
            if std:
                table = tomlkit.inline_table()
                table |= {"value": _typed(value), "unit": unit, "std": _typed(std)}
                rig[name] = table
            else:
                rig[name] = f"{value} {unit}".strip()


def _made(document: tomlkit.TOMLDocument, name: str) -> Table | OutOfOrderTableProxy:
    """A table of campaign.toml, new where there is none; it may stand in several parts."""
    if name not in document:
        document[name] = tomlkit.table()
    found = document[name]
    if not isinstance(found, Table | OutOfOrderTableProxy):
        raise CampaignError(f"campaign.toml: {name}: must be a table; mend its text below")
    return found


def _fill(channels: Table | OutOfOrderTableProxy, role: str, keys: Mapping[str, str]) -> None:
    """Set the keys of a channel that the form shows; a channel without a column is taken out."""
    wanted = {key: str(keys.get(key, "")).strip() for key in KEYS if key in keys}
    if not wanted.get("column"):
        channels.pop(role, None)
        return
    if role not in channels:
        channels[role] = tomlkit.inline_table()
    channel = channels[role]
    if not isinstance(channel, InlineTable | Table):
        raise CampaignError(f"campaign.toml: channels.{role}: must be a table; mend its text below")
    for key, text in wanted.items():
        _put(channel, key, text)


def _put(table: Table | InlineTable | OutOfOrderTableProxy, key: str, text: str) -> None:
    """Set a key to a text, a number or yes; the same value is left as it is written."""
    if _shown(table.unwrap().get(key)) == text:
        return
    if not text:
        table.pop(key, None)
    else:
        table[key] = True if key == "invert" else text if key in ("column", "unit") else _typed(text)


def _typed(text: str) -> float | int | str:
    """A number where the text is one."""
    try:
        return int(text) if re.fullmatch(r"[+-]?\d+", text) else float(text)
    except ValueError:
        return text


def _without_settled(text: str, settled: Sequence[str]) -> str:
    """The text without the comments of doubts that were settled."""
    gone = {str(one) for one in settled}
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if not ((found := _DOUBT.match(line)) and found[1].rstrip("\n") in gone))
