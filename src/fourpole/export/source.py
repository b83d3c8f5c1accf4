"""The tables of a results folder, their tests by condition, and texts that several formats need."""

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
from fourpole.fitting.accuracy import Accuracy
from fourpole.io.folders import results_in
from fourpole.plot.data import counted, distinct
from fourpole.plot.sheet import Sheet, read_sheet, texts
from fourpole.study.record import section
from fourpole.study.record import texts as items
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.units import column_unit, shown
from fourpole.words import first_of

#: Units and signs of all numbers, written into each exported file.
SIGNS = (
    "SI units; e^{+jwt}; amplitudes 0 to peak; V1 and V2 positive from the contact towards the foundation, F1 as it "
    "pushes that way; load positive in compression; u(x) is the standard uncertainty of x"
)
#: What messages call the source of an export of models.
MODEL_FILE = "the model file"
_NUMBER = re.compile(r"-?(0|[1-9]\d{0,14})(\.\d{1,15})?([eE][+-]?\d{1,2})?")
# fmt: off
_KEYWORDS = frozenset((
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
))
# fmt: on
_LISTED = 8
_PHASORS = "phasors.parquet"
#: Most characters of a name, without a number behind it.
_LONGEST_NAME = 50


class SheetRow(NamedTuple):
    """Tests of one tyre, pressure, preload, rig and added mass in rising frequency, each frequency once.

    The first five attributes are numbers of groups in the sheet; further tests at the same frequencies are conditions
    with `repeat` 1, 2 and so on.
    """

    tyre: int
    pressure: int
    load: int
    setting: int
    repeat: int
    rows: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class ExportTables(ByValue):
    """The results of an analysis, as exports need them.

    Attributes
    ----------
    results : Study
    phasors : polars.DataFrame
        Table of phasors.parquet; empty if there is no such file.
    made : datetime
        Time at which the analysis was written, UTC.
    """

    results: Study
    phasors: pl.DataFrame
    made: datetime

    @property
    def tables(self) -> dict[str, pl.DataFrame]:
        """The tables that the results have, by the name of their file without ending."""
        names = ("static", "dynamic", "rig", "residuals", "quantiles", "budget")
        named = {name: getattr(self.results, name) for name in names}
        return {name: typed(table) for name, table in named.items() if table.columns}

    @property
    def dynamic(self) -> pl.DataFrame:
        """Table of dynamic.csv."""
        return self.results.dynamic

    @cached_property
    def sheet(self) -> Sheet:
        """The tests grouped into tyres, pressures, loads, frequencies and settings."""
        return read_sheet(self.results)

    def section(self, name: str) -> dict[str, Any]:
        """A table of study.json; empty if it has no such table."""
        return section(self.results.record, name)

    def listed(self, name: str) -> list[str]:
        """A list of texts of study.json; empty if it has no such list."""
        return items(self.results.record.get(name))

    @property
    def json(self) -> str:
        """Content of study.json."""
        return json.dumps(self.results.record, ensure_ascii=False)

    @property
    def title(self) -> str:
        """The campaign's title."""
        title = self.results.record.get("title")
        return title if title and isinstance(title, str) else "Dynamic stiffness"

    @property
    def version(self) -> str:
        """Name and version of the program that analysed the campaign."""
        return f"fourpole {self.section('versions').get('fourpole', '')}".strip()

    @property
    def route(self) -> str:
        """Route to K* that the settings name."""
        return str(self.section("settings").get("route", ""))

    def texts(self, column: str) -> list[str]:
        """A column of dynamic.csv as texts; a blank cell is an empty text."""
        return texts(self.dynamic, column)

    @cached_property
    def repeats(self) -> tuple[int, ...]:
        """Number of used tests before each test in the same cell; -1 for tests that are in no cell."""
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
    def conditions(self) -> tuple[SheetRow, ...]:
        """The tests that are used, by condition."""
        rows: dict[tuple[int, int, int, int, int], list[int]] = {}
        for row, repeat in enumerate(self.repeats):
            if repeat >= 0:
                rows.setdefault((*self.place(row), repeat), []).append(row)
        frequency = self.sheet.values(q.FREQUENCY.head)
        return tuple(SheetRow(*key, tuple(sorted(rows[key], key=lambda row: frequency[row]))) for key in sorted(rows))

    def name_of(self, condition: SheetRow) -> str:
        """Name of a condition."""
        sheet = self.sheet
        parts = [sheet.labels[condition.tyre]]
        if sheet.pressures.stated() or len(sheet.pressures) > 1:
            parts.append(sheet.pressures.labels[condition.pressure])
        parts += [name for name in (sheet.name_of_load(condition.load),) if name]
        parts += [sheet.settings[condition.setting]] if sheet.settings else []
        parts += [f"repeat {condition.repeat + 1}"] if condition.repeat else []
        return ", ".join(parts)

    def left_out(self) -> tuple[str, ...]:
        """Notes on tests that no condition has: they are rejected, or their frequency is unknown."""
        out: dict[str, list[str]] = {"rejected": [], "without a frequency": []}
        for name, is_rejected, repeat in zip(self.texts("test"), self.sheet.rejected, self.repeats, strict=True):
            if is_rejected or repeat < 0:
                out["rejected" if is_rejected else "without a frequency"].append(name)
        return tuple(f"{counted(len(of), 'test')} {why} left out: {some(of)}" for why, of in out.items() if of)


def some(names: Sequence[str]) -> str:
    """The first names of tests for a message, and the number of the others."""
    return first_of([shown(name, 40)[1:-1] for name in names], _LISTED)


def read_source(folder: str | Path) -> ExportTables:
    """Read a results folder; CampaignError if it has no results."""
    folder = results_in(folder)
    results = read_results(folder)
    files = results.files
    try:
        frame = pl.read_parquet(files.read(_PHASORS)) if files and files.has(_PHASORS) else pl.DataFrame()
        made = datetime.fromtimestamp((Path(folder) / "study.json").stat().st_mtime, UTC)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CampaignError(f"{folder}: cannot be read ({error}): run fourpole analyse again") from None
    return ExportTables(results, frame, made.replace(microsecond=0))


def typed(table: pl.DataFrame) -> pl.DataFrame:
    """The table with text columns of plain numbers only as number columns, such as further columns of tests.csv."""
    known = {"test", "tyre", "rig"}
    numeric = [
        name
        for name in table.columns
        if table.schema[name] == pl.String and name not in known and _all_numbers(table[name])
    ]
    blank = [pl.when(pl.col(name) == "").then(None).otherwise(pl.col(name)).alias(name) for name in numeric]
    return table.with_columns(blank).with_columns(pl.col(name).cast(pl.Float64) for name in numeric)


def _all_numbers(column: pl.Series) -> bool:
    """Whether all texts of a column are numbers without leading zeros, which a serial number may have."""
    found = [text for text in column.unique().to_list() if text]
    return bool(found) and all(_NUMBER.fullmatch(text) for text in found)


def unit_of(column: str) -> str:
    """The unit in the head of a column; empty if it has none."""
    return column_unit(column)[1] or ""


def field_names(columns: Iterable[str], taken: Collection[str] = ()) -> dict[str, str]:
    """A different name of letters, digits and underscores for each column, without its unit; none is in `taken`.

    Examples
    --------
    >>> list(field_names(["u(Re K*) [N/m]", "corr(K2,C) [1]", "phase F1-V1 [rad]", "2.5 %", "end"]).values())
    ['u_Re_K', 'corr_K2_C', 'phase_F1_V1', 'x2_5', 'x_end']
    """
    columns = list(columns)
    names = identifiers([column_unit(column)[0] for column in columns], _KEYWORDS, taken=taken, otherwise="column")
    return dict(zip(columns, names, strict=True))


def identifiers(
    texts: Iterable[str], reserved: Collection[str], *, taken: Collection[str] = (), otherwise: str = "x"
) -> list[str]:
    """A different name of ASCII letters, digits and underscores for each text.

    None is one of the `reserved` words of a language, or in `taken`; `otherwise` names a text that has no such sign.
    """
    plain = (_identifier(text, otherwise) for text in texts)
    return list(distinct((f"x_{one}" if one in reserved else one for one in plain), "_", taken=taken))


def _identifier(text: str, otherwise: str) -> str:
    """The text in letters, digits and underscores, beginning with a letter."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")[:_LONGEST_NAME] or otherwise
    return name if name[0].isalpha() else f"x{name}"


def ascii_line(text: str) -> str:
    """A text in one line of printable ASCII; accents are dropped, and other characters become question marks."""
    plain = unicodedata.normalize("NFKD", " ".join(text.split()))
    plain = "".join(sign for sign in plain if not unicodedata.combining(sign))
    return "".join(sign if sign.isprintable() else "?" for sign in plain.encode("ascii", "replace").decode())


def accuracy_columns(accuracy: Accuracy) -> dict[str, float | str]:
    """Cells of a table of a model that say how near it is to K* as measured, by column."""
    return {"discrepancy [1]": accuracy.discrepancy, "accuracy": accuracy.text}


def filled(template: str, **values: Any) -> str:
    """A file of the folder `templates` with these values filled in."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("fourpole.export"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    return made.get_template(template).render(**values)


def need(module: str, extra: str) -> Any:
    """Import a package of an extra; FileError with the command that installs it if it is missing."""
    try:
        return import_module(module)
    except ImportError:
        raise FileError(
            f"this kind of file is written by the package {module.partition('.')[0]}, which is not installed: "
            f'pip install "fourpole[{extra}]"'
        ) from None
