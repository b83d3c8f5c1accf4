"""ExportTables: what an export starts from, the tables of a results folder and how its tests are laid out."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue
from fourpole.errors import CampaignError, FileError
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.study.results import Results, read_results
from fourpole.units import column_unit, shown

__all__ = ["SIGNS", "Condition", "ExportTables", "field_names", "need", "read_source", "typed", "unit_of"]

#: What every number means, for those who have only the file.
SIGNS = (
    "SI units; e^{+jwt}; amplitudes 0 to peak; V1 and V2 positive from the contact towards the foundation, F1 as it "
    "pushes that way; load positive in compression; u(x) is the standard uncertainty of x"
)
_NUMBER = re.compile(r"-?(0|[1-9]\d{0,14})(\.\d{1,15})?([eE][+-]?\d{1,2})?")
# fmt: off
_KEYWORDS = frozenset((
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
))
# fmt: on
_LISTED = 8


class Condition(NamedTuple):
    """Tests of one tyre, pressure, load, rig and added mass in rising frequency, each frequency once.

    `repeat` counts the further tests at the same frequencies.
    """

    tyre: int
    pressure: int
    load: int
    setting: int
    repeat: int
    rows: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class ExportTables(ByValue):
    """The results of an analysis.

    Attributes
    ----------
    results : Results
    phasors : polars.DataFrame
        As in phasors.parquet; empty where there is none.
    made : datetime
        When the analysis was written, UTC.
    """

    results: Results
    phasors: pl.DataFrame
    made: datetime

    @property
    def tables(self) -> dict[str, pl.DataFrame]:
        """The tables that there are, by the name of their file."""
        named = {name: getattr(self.results, name) for name in ("static", "dynamic", "rig", "residuals")}
        named |= {name: getattr(self.results, name) for name in ("quantiles", "budget")}
        return {name: typed(table) for name, table in named.items() if table.columns}

    @property
    def dynamic(self) -> pl.DataFrame:
        """dynamic.csv."""
        return self.results.dynamic

    @cached_property
    def sheet(self) -> Sheet:
        """The tests grouped into tyres, pressures, loads, frequencies and settings."""
        return read_sheet(self.results)

    def text(self, name: str) -> str:
        """A text of study.json, which is not trusted."""
        value = self.results.record.get(name)
        return value if isinstance(value, str) else ""

    def section(self, name: str) -> dict[str, Any]:
        """A table of study.json."""
        value = self.results.record.get(name)
        return value if isinstance(value, dict) else {}

    def listed(self, name: str) -> list[str]:
        """A list of texts of study.json."""
        value = self.results.record.get(name)
        return [str(item) for item in value] if isinstance(value, list) else []

    @property
    def json(self) -> str:
        """study.json."""
        return json.dumps(self.results.record, ensure_ascii=False)

    @property
    def title(self) -> str:
        """The campaign's title."""
        return self.text("title") or "Dynamic stiffness"

    @property
    def version(self) -> str:
        """What analysed it."""
        return f"fourpole {self.section('versions').get('fourpole', '')}".strip()

    @property
    def route(self) -> str:
        """How K* was found."""
        return str(self.section("settings").get("route", ""))

    def texts(self, column: str) -> list[str]:
        """A column of dynamic.csv as texts."""
        return [text or "" for text in self.dynamic[column].to_list()]

    @cached_property
    def repeats(self) -> tuple[int, ...]:
        """How many used tests stand before each one in the same cell; -1 of tests that are in no cell."""
        sheet, before = self.sheet, dict[object, int]()
        found = []
        for row in range(self.dynamic.height):
            if sheet.rejected[row] or sheet.frequency[row] < 0:
                found.append(-1)
                continue
            cell = (*self.place(row), int(sheet.frequency[row]))
            found.append(before.get(cell, 0))
            before[cell] = found[-1] + 1
        return tuple(found)

    def place(self, row: int) -> tuple[int, int, int, int]:
        """Tyre, pressure, load and setting of a test."""
        sheet = self.sheet
        return int(sheet.tyre[row]), int(sheet.pressure[row]), int(sheet.load[row]), int(sheet.setting[row])

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """The tests that are used, by condition."""
        rows: dict[tuple[int, int, int, int, int], list[int]] = {}
        for row, repeat in enumerate(self.repeats):
            if repeat >= 0:
                rows.setdefault((*self.place(row), repeat), []).append(row)
        frequency = self.sheet.values(q.FREQUENCY.head)
        return tuple(Condition(*key, tuple(sorted(rows[key], key=lambda row: frequency[row]))) for key in sorted(rows))

    def name_of(self, condition: Condition, *, load: bool = True) -> str:
        """A condition in words, with its load or without."""
        sheet = self.sheet
        parts = [sheet.labels[condition.tyre]]
        if sheet.pressures.stated() or len(sheet.pressures) > 1:
            parts.append(sheet.pressures.labels[condition.pressure])
        parts += [name for name in (sheet.name_of_load(condition.load),) if name and load]
        parts += [sheet.settings[condition.setting]] if sheet.settings else []
        parts += [f"repeat {condition.repeat + 1}"] if condition.repeat else []
        return ", ".join(parts)

    def left_out(self) -> tuple[str, ...]:
        """What a grid cannot hold: tests that are rejected, or whose frequency is not known."""
        names = self.texts("test")
        rejected = [name for name, is_rejected in zip(names, self.sheet.rejected, strict=True) if is_rejected]
        unknown = [
            name
            for name, is_rejected, repeat in zip(names, self.sheet.rejected, self.repeats, strict=True)
            if repeat < 0 and not is_rejected
        ]
        return tuple(
            f"{counted(len(which), 'test')} {what} left out: {some(which)}"
            for which, what in ((rejected, "rejected"), (unknown, "without a frequency"))
            if which
        )


def counted(number: int, noun: str) -> str:
    """A number of things."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def some(names: Sequence[str]) -> str:
    """Names of tests for a message."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(shown(name, 40)[1:-1] for name in names[:_LISTED]) + more


def read_source(folder: str | Path) -> ExportTables:
    """Read a results folder; CampaignError if it holds no results."""
    results = read_results(folder)
    phasors = Path(folder) / "phasors.parquet"
    try:
        frame = pl.read_parquet(phasors) if phasors.is_file() else pl.DataFrame()
        made = datetime.fromtimestamp((Path(folder) / "study.json").stat().st_mtime, UTC)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CampaignError(f"{folder}: cannot be read ({error}): run fourpole analyse again") from None
    return ExportTables(results, frame, made.replace(microsecond=0))


def typed(table: pl.DataFrame) -> pl.DataFrame:
    """Columns of text that hold plain numbers only, such as those that tests.csv had more, as numbers."""
    known = {"test", "tyre", "rig"}
    numeric = [
        name
        for name in table.columns
        if table.schema[name] == pl.String and name not in known and _all_numbers(table[name])
    ]
    blank = [pl.when(pl.col(name) == "").then(None).otherwise(pl.col(name)).alias(name) for name in numeric]
    return table.with_columns(blank).with_columns(pl.col(name).cast(pl.Float64) for name in numeric)


def _all_numbers(column: pl.Series) -> bool:
    """Whether nothing is lost as numbers: no blank column, no leading zero of a serial number."""
    found = [text for text in column.unique().to_list() if text]
    return bool(found) and all(_NUMBER.fullmatch(text) for text in found)


def unit_of(column: str) -> str:
    """The unit in a column's name; empty where there is none."""
    return column_unit(column)[1] or ""


def field_names(columns: Iterable[str], taken: Collection[str] = ()) -> dict[str, str]:
    """Names of letters, digits and underscores for columns, each different, without their units.

    Examples
    --------
    >>> list(field_names(["u(Re K*) [N/m]", "corr(K2,C) [1]", "phase F1-V1 [rad]", "2.5 %", "end"]).values())
    ['u_Re_K', 'corr_K2_C', 'phase_F1_V1', 'x2_5', 'x_end']
    """
    used = set(taken)
    names: dict[str, str] = {}
    for column in columns:
        plain = unicodedata.normalize("NFKD", column_unit(column)[0]).encode("ascii", "ignore").decode()
        name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")[:50] or "column"
        if name in _KEYWORDS:
            name = f"x_{name}"
        elif not name[0].isalpha():
            name = f"x{name}"
        free, number = name, 1
        while free in used:
            number += 1
            free = f"{name}_{number}"
        used.add(free)
        names[column] = free
    return names


def need(module: str, extra: str) -> Any:
    """A package that is not part of the base installation."""
    try:
        return import_module(module)
    except ImportError:
        raise FileError(
            f"this kind of file is written by the package {module.partition('.')[0]}, which is not installed: "
            f'pip install "fourpole[{extra}]"'
        ) from None
