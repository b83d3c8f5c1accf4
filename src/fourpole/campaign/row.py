"""tests.csv: its columns, and each row as a `Test`; each fault of a row is kept with its column."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time
from math import nan
from typing import TYPE_CHECKING

from fourpole import quantities as q
from fourpole import units
from fourpole.core.condition import Condition, Sameness
from fourpole.errors import CampaignError, Message, UnitError

if TYPE_CHECKING:
    from fourpole.campaign.schema import CampaignFile

#: Kind of quantity and allowed sign of each column of numbers, by the name of the column.
QUANTITIES: dict[str, tuple[str, str]] = {
    "pressure": ("pressure", "zero or positive"),
    "preload": ("force", "any"),
    "frequency": ("frequency", "positive"),
    "K1": ("stiffness", "positive"),
    "u(K1)": ("stiffness", "zero or positive"),
    "added_mass": ("mass", "zero or positive"),
    "u(added_mass)": ("mass", "zero or positive"),
    "temperature": ("temperature", "any"),
}
#: Columns of texts; all columns with a defined meaning, by their names in small letters.
_TEXTS = ("test", "file", "kind", "tyre", "rig", "excluded")
_NAMES = {name.casefold(): name for name in (*_TEXTS, *QUANTITIES, "window", "time", "mounting")} | {"specimen": "tyre"}
#: German names of columns, by the English one; an umlaut may be written as two letters.
_GERMAN = {word: name for name, words in {
    "test": "prüfung versuch messung",
    "file": "datei dateiname messdatei",
    "kind": "art prüfart versuchsart prüfungsart",
    "tyre": "probe prüfling prüfkörper reifen",
    "rig": "prüfstand",
    "excluded": "ausgeschlossen",
    "pressure": "druck luftdruck fülldruck reifendruck innendruck reifenfülldruck",
    "preload": "vorlast vorspannkraft",
    "frequency": "frequenz erregerfrequenz prüffrequenz",
    "added_mass": "zusatzmasse",
    "u(added_mass)": "u(zusatzmasse)",
    "temperature": "temperatur",
    "window": "fenster zeitfenster",
    "time": "zeit zeitpunkt uhrzeit",
    "mounting": "montage",
}.items() for word in words.split()}  # fmt: skip
#: German and further names of kinds, by the English one.
_KIND_WORDS = {word: kind for kind, words in {
    "static": "statisch quasistatisch",
    "dynamic": "dynamisch sinus sinusförmig sine",
    "calibration": "kalibrierung kalibrieren",
    "random": "rauschen zufall stochastisch",
    "sweep": "gleitsinus sinussweep",
}.items() for word in words.split()}  # fmt: skip
#: Roles of the columns that pass through to the results unchanged.
PASSED = ("extra", "time")
#: Columns that tests.csv must have.
_REQUIRED = ("test", "file", "kind", "tyre")
#: Largest number of columns; least similarity of a name that was meant as a required one.
_MOST_COLUMNS, _ALIKE = 1000, 0.6
#: Largest number of characters of a cell.
_MOST_TEXT = 1000
_KINDS = ("static", "dynamic", "calibration", "random", "sweep")
#: Kinds whose excitation has a band of frequencies.
OF_BAND = ("random", "sweep")
#: Head of the column of doubts on a guessed tests.csv, each until the cell that it is about is corrected.
DOUBTS = "doubts"
_BETWEEN = " | "
_ENTRY = re.compile(r"(?P<column>\w+) \[(?P<cell>.*?)\]: ")
#: Largest number of characters in a cell of doubts.
_MOST_DOUBTS = 1500


@dataclass(frozen=True)
class Column:
    """A column of tests.csv; its `role`: "text", "quantity", "window", "time", "extra" (of the user's own)."""

    label: str
    name: str
    role: str
    unit: str = ""
    kind: str = ""


def columns_of(header: list[str]) -> list[Column]:
    """The columns that the first row names; CampaignError if one is missing or named twice, or too many are."""
    if len(header) > _MOST_COLUMNS:
        raise CampaignError(f"tests.csv row 1: names {len(header)} columns, at most {_MOST_COLUMNS} are taken")
    english = {plain for label in header if (plain := _plain(label)) in _NAMES}
    columns = [_column(label, {_NAMES[plain] for plain in english}) for label in header]
    names = [column.name for column in columns if column.role not in PASSED]
    for name in names:
        if names.count(name) > 1:
            both = " and ".join(units.shown(column.label) for column in columns if column.name == name)
            raise CampaignError(f"tests.csv row 1: column '{name}' stands twice, as {both}: keep one of them")
    for name in _REQUIRED:
        if name not in names:
            near = units.nearest(name, header, _ALIKE)
            hint = f"; did you mean {units.shown(near)}?" if near else ""
            raise CampaignError(f"tests.csv row 1: column '{name}' is missing{hint}")
    labels = [column.label for column in columns if column.role in PASSED and column.label]
    if len(set(labels)) < len(labels):
        raise CampaignError("tests.csv row 1: two further columns have the same name: rename one of them")
    return columns


def _plain(label: str) -> str:
    """The name in a head of a column, in small letters."""
    return units.column_unit(label)[0].strip().casefold().replace(" ", "_")


def known_name(label: str) -> str:
    """Name of the column that a head of tests.csv means, in English; empty for a column of the user's own.

    Examples
    --------
    >>> known_name("Pressure [bar]"), known_name("Pruefung"), known_name("operator")
    ('pressure', 'test', '')
    """
    plain = _plain(label)
    return _NAMES.get(plain) or _german(plain, _GERMAN)


def _german(word: str, names: Mapping[str, str]) -> str:
    """What a German word stands for, with its umlauts or with two letters for each; empty if it is not known."""
    spelt = word.replace("ae", "ä").replace("oe", "ö").replace("ue", "ü")
    return names.get(word) or names.get(spelt, "")


def _column(label: str, english: Collection[str] = ()) -> Column:
    """The column with this head; CampaignError if it lacks its unit, or is probably misspelt.

    A German head beside the `english` one of the same column is one of the user's own.
    """
    written, unit = units.column_unit(label)
    plain = _plain(label)
    name = _NAMES.get(plain, written)
    if plain not in _NAMES and (german := known_name(label)):
        if german in english:
            return Column(label, label, "extra")
        name, label = german, label.replace(written, german, 1) if german == "time" else label
    elif plain not in _NAMES and (near := units.nearest(plain, _NAMES, 0.9)):
        raise CampaignError(
            f"tests.csv row 1: column {units.shown(label)} is not known; did you mean '{_NAMES[near]}'? "
            "(a column of your own needs a name less like it)"
        )
    if name in _TEXTS:
        return Column(label, name, "text")
    if name == "time":
        return Column(label, name, "time", unit or "s")
    if name == "mounting":
        return Column(name, name, "extra")
    if name not in QUANTITIES and name != "window":
        return Column(label, label, "extra")
    kind = "time" if name == "window" else QUANTITIES[name][0]
    if unit is None:
        example = {"temperature": "degC", "frequency": "Hz", "window": "s", "pressure": "bar"}.get(
            name, units.si_unit(kind)
        )
        raise CampaignError(f"tests.csv row 1: column '{written}' has no unit: write '{written} [{example}]'")
    try:
        units.to_si([1.0], unit, kind)
    except UnitError as error:
        raise CampaignError(f"tests.csv row 1: column {units.shown(label)}: {error}") from None
    return Column(label, name, "window" if name == "window" else "quantity", unit, kind)


@dataclass(frozen=True)
class Test:
    """One row of tests.csv in SI units; `faults` are the reasons why the row cannot be used, each
    with its column.

    A test whose column `excluded` has a reason is left out, and that is its problem. `fixed` says that the specimen is
    held on both sides and can be pulled; `band` has the lowest and the highest frequency [Hz] of random excitation;
    `workbook` is the name of the workbook that lists the test in place of tests.csv.
    """

    name: str
    row: int
    file: str = ""
    kind: str = ""
    tyre: str = ""
    rig: str = ""
    values: dict[str, float] = field(default_factory=dict)
    window: tuple[float, float] | None = None
    extra: dict[str, str] = field(default_factory=dict)
    faults: tuple[Message, ...] = ()
    excluded: bool = False
    fixed: bool = False
    band: tuple[float, float] | None = None
    workbook: str = ""

    @property
    def table(self) -> str:
        """Name of the file that lists the test."""
        return self.workbook or "tests.csv"

    @property
    def problem(self) -> str:
        """The reason why the row cannot be used; empty if it can."""
        return "; ".join(f"{self.table} row {self.row}: {fault}" for fault in self.faults)

    @property
    def added_mass(self) -> float:
        """The mass that is fixed to the moving mass [kg]; 0 for a blank cell."""
        return self.values.get("added_mass") or 0.0

    @property
    def mounting(self) -> str:
        """The label of the mounting of V1's sensor; the specimen where none is stated."""
        return self.extra.get("mounting") or self.tyre

    def value(self, name: str) -> float | None:
        """A number of the row: pressure [Pa], preload [N], frequency [Hz], K1 [N/m] ...; None for a blank cell."""
        return self.values.get(name)


def problem_of(test: Test) -> Message:
    """Why the row of a test cannot be used, as a value: the columns at fault, and the whole sentence."""
    return Message("tests.csv", ", ".join(f"{fault.code} {fault.site}" for fault in test.faults), test.problem)


def begun_at(tests: Sequence[Test]) -> list[float]:
    """Stated time at which each test began [s], or not-a-number.

    Tests that state one time for one recording began as long after it as their windows do.
    """
    stated = [(test.file, test.values.get("time", nan)) for test in tests]
    windows: dict[tuple[str, float], set[tuple[float, float] | None]] = {}
    for test, key in zip(tests, stated, strict=True):
        windows.setdefault(key, set()).add(test.window)
    return [
        key[1] + (test.window[0] if test.window is not None and len(windows[key]) > 1 else 0.0)
        for test, key in zip(tests, stated, strict=True)
    ]


def condition_of(test: Test, rule: Sameness) -> Condition:
    """The condition of a row of tests.csv on the axes of a rule; a blank cell is None."""
    values = (test.extra.get(axis.name) or None if axis.text else test.value(axis.name) for axis in rule.axes)
    return Condition(test.tyre, tuple(values))


def condition_words(test: Test, beside: Test | None = None, further: Sequence[str] = ()) -> str:
    """The condition of a test in words, as far as it differs from that of another test."""
    parts = [] if beside is not None and test.tyre == beside.tyre else [test.tyre]
    for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE):
        value = test.value(quantity.key)
        if value is not None and (beside is None or value != beside.value(quantity.key)):
            parts.append(f"{value / quantity.scale:.4g} {quantity.shown}")
    values = [(name, test.extra.get(name) or test.value(name)) for name in further]
    parts += [f"{name} {value}" for name, value in values if value is not None]
    return ", ".join(parts) or test.name


def test_of_row(row: int, cells: list[str], columns: list[Column], stated: CampaignFile) -> Test:
    """The test of one row, whose `problem` lists all faults of the row; CampaignError for a test without a name."""
    where = f"tests.csv row {row}"
    test, texts, faults = _read_cells(row, cells, columns, stated)
    if DOUBTS in test.extra:
        named = {column.name: cell for column, cell in zip(columns, cells, strict=False)}
        test.extra[DOUBTS] = still_open(test.extra[DOUBTS], named)
    if not texts.get("test"):
        raise CampaignError(f"{where}: the test has no name: fill in the column 'test'")
    kind = texts.get("kind", "").casefold()
    texts["kind"] = _german(kind, _KIND_WORDS) or kind
    faults += [*_contradictions(texts, stated), *_wrong_values(test, texts["kind"], texts.get("tyre", ""), stated)]
    rigs, excluded = list(stated.all_rigs), texts.get("excluded", "")
    rig = texts.get("rig") or (rigs[0] if len(rigs) == 1 else "")
    if excluded:
        faults = [Message("excluded", "by hand", f"excluded: {units.shown(excluded, 300)[1:-1]}")]
    return replace(
        test, name=texts["test"], file=texts.get("file", ""), kind=texts["kind"], tyre=texts.get("tyre", ""), rig=rig,
        excluded=bool(excluded), faults=tuple(faults),
    )  # fmt: skip


def _wrong_values(test: Test, kind: str, tyre: str, stated: CampaignFile) -> Iterator[Message]:
    """Faults of the values of a row that its kind or its specimen cannot have."""
    if kind in OF_BAND and test.band is None:
        needs = f"a {kind} test needs the band of its excitation: fill in frequency, as in 5:200 Hz"
        yield Message("frequency", "missing", needs)
    if kind in _KINDS and kind not in OF_BAND and test.band is not None:
        alone = f"frequency: a band is for kind {' or '.join(OF_BAND)}; a {kind} test has one number"
        yield Message("frequency", "band", alone)
    if kind == "calibration" and "added_mass" not in test.values:
        unweighed = "the mass in place of the specimen is not stated: fill in 'added_mass [kg]' with its weight"
        yield Message("added_mass", "missing", unweighed)
    preload, specimen = test.value("preload"), stated.all_specimens.get(tyre)
    fixed = specimen is not None and (tyre in stated.specimens if specimen.fixed is None else specimen.fixed)
    if preload is not None and preload <= 0 and not fixed:
        pulled = (
            f"preload: {preload:g} N must be positive for a specimen that only stands on the rig; one "
            "that can be pulled belongs under [specimens], with fixed = true"
        )
        yield Message("preload", "not positive", pulled)


def _read_cells(
    row: int, cells: list[str], columns: list[Column], stated: CampaignFile
) -> tuple[Test, dict[str, str], list[Message]]:
    """A test with the values of its cells, the texts of the row by name of column, and the faults of single cells."""
    test, texts, faults = Test("", row), dict[str, str](), list[Message]()
    if len(cells) != len(columns):
        many = f"has {len(cells)} cells, {len(columns)} columns are named"
        faults.append(Message("", "cells", f"{many}: check its commas; decimal commas need ; between the cells"))
    measured = {axis.name for axis in stated.conditions.axes if not axis.text}
    for column, whole in zip(columns, cells, strict=False):
        cell = whole[:_MOST_TEXT]
        if cell != whole:
            many = f"{units.shown(column.name)} has {len(whole)} characters, at most {_MOST_TEXT} are taken"
            faults.append(Message(column.name, "characters", many))
        try:
            if column.role == "text":
                texts[column.name] = cell
            elif column.name == "frequency" and column.role == "quantity" and _is_band(cell):
                test = replace(test, band=units.frequency_band(_united(cell, column.unit)))
            elif column.role == "window":
                test = replace(test, window=_window(cell, column.unit) if cell else None)
            else:
                _fill(test, cell, column, measured)
        except ValueError as error:
            faults.append(Message(column.name, "value", f"{column.name}: {error}"))
    return test, texts, faults


def _fill(test: Test, cell: str, column: Column, measured: set[str]) -> None:
    """Put the cell of a quantity or of a further column into a test; `measured` are the numeric axes of conditions."""
    if column.role == "quantity" and cell:
        test.values[column.name] = _number(cell, column)
    elif column.role == "time":
        test.extra[column.label] = cell
        if (moment := _moment(cell, column.unit)) is not None:
            test.values["time"] = moment
    elif column.role == "extra":
        test.extra[column.label] = cell
        if cell and column.label in measured:
            test.values[column.label] = _plain_number(cell)
            test.extra[column.label] = f"{test.values[column.label]:.15g}"


def _is_band(cell: str) -> bool:
    """Whether the cell of a frequency has two numbers."""
    bare = "".join(cell.split())
    number = re.fullmatch(r"[-+0-9.,eE]+", cell.strip())
    return number is None and re.search(r"\d[A-Za-z]*(:|\.\.|-|to)\d", bare) is not None


def _united(cell: str, unit: str) -> str:
    """A band with a unit, that of its column if it has none of its own."""
    return cell if re.search(r"[A-Za-z]\s*$", cell) else f"{cell} {unit}"


def _number(cell: str, column: Column) -> float:
    """SI value of a cell; UnitError if its sign is not allowed."""
    value = units.quantity(cell, column.kind, default_unit=column.unit)
    wanted = QUANTITIES[column.name][1]
    if (wanted == "positive" and value <= 0) or (wanted == "zero or positive" and value < 0):
        raise UnitError(f"{units.shown(cell)} must be {wanted}")
    return value


def _plain_number(cell: str) -> float:
    """Number in a cell of a numeric axis of [conditions], in the unit of its column; ValueError for a text."""
    try:
        return units.quantity(cell, "ratio", default_unit="1")
    except UnitError:
        raise ValueError(f"{units.shown(cell)} is no number, which [conditions] axes needs in this column") from None


def _moment(cell: str, unit: str) -> float | None:
    """Seconds of a date and time, of a time of day, or of a number with a unit; None for another text."""
    with suppress(UnitError):  # numbers come first, because "10" would be ten o'clock and "20240503" a date
        return units.quantity(cell, "time", default_unit=unit)
    with suppress(ValueError):
        moment = datetime.fromisoformat(cell)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    with suppress(ValueError):
        clock = time.fromisoformat(cell)
        return 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond
    return None


def _window(cell: str, unit: str) -> tuple[float, float]:
    """First and last time of a window such as "2..12" [s]; UnitError for another text."""
    start, dots, stop = cell.partition("..")
    if not dots:
        raise UnitError(f"{units.shown(cell)} is no window: write it as 2..12")
    low, high = (units.quantity(part.strip(), "time", default_unit=unit) for part in (start, stop))
    if not high > low:
        raise UnitError(f"{units.shown(cell)} ends before it starts")
    return low, high


def _contradictions(texts: dict[str, str], stated: CampaignFile) -> Iterator[Message]:
    """Faults of a row: names that campaign.toml lacks, and cells that must be filled in or left blank."""
    kind = texts["kind"]
    if kind not in _KINDS:
        near = units.nearest(kind, _KINDS)
        hint = f"; did you mean '{near}'?" if near else f"; it must be {' or '.join(_KINDS)}"
        yield Message("kind", "unknown", f"kind {units.shown(kind)} is not known{hint}")
    tyre, rig = texts.get("tyre", ""), texts.get("rig", "")
    if kind == "calibration":
        if tyre:
            named = "a calibration has a rigid mass in place of the specimen: leave the column 'tyre' blank"
            yield Message("tyre", "calibration", named)
    elif not tyre:
        yield Message("tyre", "missing", "the specimen is not named: fill in the column 'tyre'")
    elif tyre not in stated.all_specimens:
        yield _unknown("tyre", "tyres", tyre, stated.all_specimens)
    if rig and rig not in stated.all_rigs:
        yield _unknown("rig", "rigs", rig, stated.all_rigs)
    if not rig and len(stated.all_rigs) > 1 and kind != "static":
        yield Message("rig", "missing", "several rigs are stated: name one of them in the column 'rig'")
    if not texts.get("file"):
        yield Message("file", "missing", "no recording is named: fill in the column 'file'")


def _unknown(column: str, section: str, name: str, known: Iterable[str]) -> Message:
    """The fault that campaign.toml has no table of this name."""
    near = units.nearest(name, tuple(known))
    hint = f"did you mean {units.shown(near)}?" if near else f"add [{section}.{_key(name)}]"
    return Message(column, "unknown", f"{column} {units.shown(name)} is not in campaign.toml; {hint}")


def _key(name: str) -> str:
    """A name as a key of TOML, in quotation marks where it needs them."""
    text = units.shown(name)[1:-1]
    return text if re.fullmatch(r"[A-Za-z0-9_-]+", text) else json.dumps(text, ensure_ascii=False)


def doubts_cell(doubts: Iterable[tuple[str, str, str]]) -> str:
    """The cell with some doubts: column, the cell that was guessed in it, and text; without a column, the text alone.

    Examples
    --------
    >>> doubts_cell([("pressure", "1.7", "'1p7' taken as bar"), ("preload", "", "not known")])
    "pressure [1.7]: '1p7' taken as bar | preload []: not known"
    """
    whole = ""
    for column, cell, text in doubts:
        doubt = (f"{column} [{cell}]: {text}" if column else text).replace(_BETWEEN, " / ")
        if len(whole) + len(_BETWEEN) + len(doubt) > _MOST_DOUBTS:
            break
        whole += f"{_BETWEEN if whole else ''}{doubt}"
    return whole


def still_open(doubts: str, cells: Mapping[str, str]) -> str:
    """A cell of doubts without those whose cell is no longer as it was guessed; `cells` are by name of column.

    Examples
    --------
    >>> still_open("pressure [1.7]: '1p7' taken as bar | preload []: not known", {"pressure": "1.7", "preload": "1000"})
    "pressure [1.7]: '1p7' taken as bar"
    """
    kept = []
    for doubt in doubts.split(_BETWEEN):
        entry = _ENTRY.match(doubt)
        if entry is None or cells.get(entry["column"], entry["cell"]) == entry["cell"]:
            kept.append(doubt)
    return _BETWEEN.join(kept)


def columns_in_doubt(doubts: str) -> tuple[str, ...]:
    """The columns that a cell of doubts is about; a doubt without a column counts as "other"."""
    entries = map(_ENTRY.match, doubts.split(_BETWEEN)) if doubts.strip() else ()
    return tuple(dict.fromkeys("other" if entry is None else entry["column"] for entry in entries))
