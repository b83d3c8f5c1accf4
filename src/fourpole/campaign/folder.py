"""A campaign folder: campaign.toml and tests.csv become a Campaign; each faulty row has the reason in `problem`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, time
from pathlib import Path
from typing import Any

from fourpole import units
from fourpole.campaign.channels import did_you_mean
from fourpole.campaign.columns import PASSED, QUANTITIES, Column, columns_of, doubts_of
from fourpole.campaign.doubts import doubtful_uncertainties, doubtful_values
from fourpole.campaign.guessed import DOUBTS, still_open
from fourpole.campaign.limits import Limits, read_limits
from fourpole.campaign.particulars import logo_of
from fourpole.campaign.place import at_hand
from fourpole.campaign.schema import CampaignFile, parse_campaign
from fourpole.campaign.statement import MOST_TESTS, MOST_TOML, statement_text
from fourpole.core.arrays import short_repr
from fourpole.errors import CampaignError, FourpoleError, Message, TableError, UnitError
from fourpole.io.child import read_apart
from fourpole.io.documents import rows_of
from fourpole.io.folders import why_no_campaign, why_no_folder, why_no_tests
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, SignalInfo

#: The file with the limits that results are held against.
LIMITS = "limits.toml"
#: Largest number of characters of a cell.
_MOST_TEXT = 1000
#: Largest number of unknown names and units that are compared with known ones.
_HINTED = 1000

_KINDS = ("static", "dynamic", "calibration", "random", "sweep")
#: Kinds whose excitation has a band of frequencies.
_OF_BAND = ("random", "sweep")


@dataclass(frozen=True)
class Test:
    """One row of tests.csv in SI units; `faults` are the reasons why the row cannot be used, each
    with its column.

    A test whose column `excluded` has a reason is left out, and that is its problem. `fixed` says that the specimen is
    held on both sides and can be pulled; `band` has the lowest and the highest frequency [Hz] of random excitation.
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

    @property
    def problem(self) -> str:
        """The reason why the row cannot be used; empty if it can."""
        return "; ".join(f"tests.csv row {self.row}: {fault}" for fault in self.faults)

    @property
    def added_mass(self) -> float:
        """The mass that is fixed to the moving mass [kg]; 0 for a blank cell."""
        return self.values.get("added_mass") or 0.0

    def value(self, name: str) -> float | None:
        """A number of the row: pressure [Pa], preload [N], frequency [Hz], K1 [N/m] ...; None for a blank cell."""
        return self.values.get(name)


def problem_of(test: Test) -> Message:
    """Why the row of a test cannot be used, as a value: the columns at fault, and the whole sentence."""
    return Message("tests.csv", ", ".join(f"{fault.code} {fault.site}" for fault in test.faults), test.problem)


@dataclass(frozen=True, repr=False)
class Campaign:
    """A campaign as stated.

    Attributes
    ----------
    folder : Path
        The campaign folder.
    stated : CampaignFile
        The content of campaign.toml.
    tests : tuple of Test
        The rows of tests.csv, in its order.
    extra_columns : tuple of str
        Columns of tests.csv that pass through to the results.
    doubts : tuple of str
        What is allowed as it is stated, but probably a slip: columns and uncertainties.
    limits : Limits
        Content of limits.toml.
    logo : str
        The logo of [report] as a data: URL; empty without one.
    sha256 : dict of str to str
        SHA-256 of campaign.toml, tests.csv and limits.toml as they were read, by name.
    """

    folder: Path
    stated: CampaignFile
    tests: tuple[Test, ...]
    extra_columns: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    limits: Limits = field(default_factory=Limits)
    logo: str = ""
    sha256: Mapping[str, str] = field(default_factory=dict)

    __repr__ = short_repr

    def statement(self) -> dict[str, Any]:
        """What campaign.toml and limits.toml state, as plain data in SI units."""
        stated = self.stated.summary()
        if self.logo:
            stated["report"] = {**stated.get("report", {}), "logo": self.logo}
        if self.limits.limits:
            stated["limits"] = [limit.summary() for limit in self.limits.limits]
            stated["specification"] = self.limits.specification
        return stated

    def of_kind(self, kind: str) -> list[Test]:
        """Tests of a kind; the dynamic ones include rows of an unknown kind, so that results list every row."""
        return [test for test in self.tests if (test.kind == "static") == (kind == "static")]


def read_campaign(folder: str | Path) -> Campaign:
    """Read campaign.toml and tests.csv of a folder.

    Parameters
    ----------
    folder : path
        A campaign folder.

    Returns
    -------
    Campaign
        With every row of tests.csv; the attribute `problem` of a faulty row has the reason.

    Raises
    ------
    CampaignError
        If the campaign as a whole cannot be used.

    Examples
    --------
    >>> read_campaign("no such folder")
    Traceback (most recent call last):
    ...
    fourpole.errors.CampaignError: no such folder: there is no such folder
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CampaignError(units.shown(why_no_folder(folder), 400)[1:-1])
    for name, why in (("campaign.toml", why_no_campaign), ("tests.csv", why_no_tests)):
        if not (folder / name).exists():
            raise CampaignError(why(folder))
    sha256: dict[str, str] = {}
    with units.hints(_HINTED):
        stated = parse_campaign(statement_text(folder / "campaign.toml", MOST_TOML, sha256, strict=True))
    rows = list(_rows(statement_text(folder / "tests.csv", MOST_TESTS, sha256, strict=False)))
    if not rows:
        raise CampaignError("tests.csv: has no row of names; the first row is test,file,kind,tyre,pressure [bar],...")
    columns = columns_of(rows[0][1])
    with units.hints(_HINTED):  # not around what asks for the nearest name to decide, as the doubts below
        tests = _held([_test(row, cells, columns, stated) for row, cells in rows[1:]], stated)
    if not tests:
        raise CampaignError("tests.csv: lists no test below its row of names")
    _check_names(tests)
    _check_channels(stated, tests)
    _check_files(folder, stated, tests)
    mended = () if any(test.extra.get(DOUBTS) for test in tests) else (DOUBTS,)
    extra = tuple(one.label for one in columns if one.role in PASSED and one.label and one.label not in mended)
    for axis in stated.conditions.axes:
        if axis.name not in extra:
            raise CampaignError(
                f"campaign.toml: [conditions] axes: {units.shown(axis.name)} is no further column of tests.csv"
                + (did_you_mean(axis.name, extra) if extra else "; it has none")
            )
    doubts = (*doubts_of(columns, stated), *_doubtful(columns, tests), *doubtful_uncertainties(stated))
    logo = logo_of(folder, stated.report.logo)
    limits = _limits(folder, tests, sha256)
    return Campaign(folder, stated, tuple(tests), extra, doubts, limits, logo, sha256)


def _doubtful(columns: Sequence[Column], tests: Sequence[Test]) -> Iterator[str]:
    """Columns whose values were probably meant in another unit."""
    for column in columns:
        found = [value for one in tests if (value := one.values.get(column.name)) is not None]
        if column.role == "quantity" and found:
            yield from doubtful_values(column.label, column.name, column.unit or "", found)


def _limits(folder: Path, tests: Sequence[Test], sha256: dict[str, str]) -> Limits:
    """The limits of limits.toml; none without such a file."""
    path = folder / LIMITS
    specimens = tuple(dict.fromkeys(test.tyre for test in tests))
    if not (path.exists() or path.is_symlink()):
        return Limits()
    return read_limits(statement_text(path, MOST_TOML, sha256, strict=True), specimens)


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row with at least one filled cell; CampaignError for an open quotation mark."""
    before = width = 0
    try:
        for line, cells in rows_of(text, "tests.csv"):
            width = width or len(cells)
            if len(cells) != width and any("\n" in cell for cell in cells):
                raise CampaignError(
                    f"tests.csv row {before + 1}: a quotation mark is not closed on its line: close or remove it"
                )
            before = line
            if any(cell.strip() for cell in cells):
                yield line, [cell.strip() for cell in cells]
    except TableError as error:
        raise CampaignError(str(error)) from None


def _test(row: int, cells: list[str], columns: list[Column], stated: CampaignFile) -> Test:
    """The test of one row, whose `problem` lists all faults of the row; CampaignError for a test without a name."""
    where = f"tests.csv row {row}"
    test, texts, faults = _read_cells(row, cells, columns, stated)
    if DOUBTS in test.extra:
        named = {column.name: cell for column, cell in zip(columns, cells, strict=False)}
        test.extra[DOUBTS] = still_open(test.extra[DOUBTS], named)
    if not texts.get("test"):
        raise CampaignError(f"{where}: the test has no name: fill in the column 'test'")
    texts["kind"] = texts.get("kind", "").lower()
    faults += _contradictions(texts, stated)
    kind, band = texts["kind"], test.band
    if kind in _OF_BAND and band is None:
        needs = f"a {kind} test needs the band of its excitation: fill in frequency, as in 5:200 Hz"
        faults.append(Message("frequency", "missing", needs))
    if kind in _KINDS and kind not in _OF_BAND and band is not None:
        alone = f"frequency: a band is for kind {' or '.join(_OF_BAND)}; a {kind} test has one number"
        faults.append(Message("frequency", "band", alone))
    if kind == "calibration" and "added_mass" not in test.values:
        unweighed = "the mass in place of the tyre is not stated: fill in 'added_mass [kg]' with its weight"
        faults.append(Message("added_mass", "missing", unweighed))
    if not _can_have(test.value("preload"), texts.get("tyre", ""), stated):
        pulled = (
            f"preload: {test.value('preload'):g} N must be positive for a specimen that only stands on the rig; one "
            "that can be pulled belongs under [specimens], with fixed = true"
        )
        faults.append(Message("preload", "not positive", pulled))
    rigs, excluded = list(stated.all_rigs), texts.get("excluded", "")
    rig = texts.get("rig") or (rigs[0] if len(rigs) == 1 else "")
    if excluded:
        faults = [Message("excluded", "by hand", f"excluded: {units.shown(excluded, 300)[1:-1]}")]
    return replace(
        test, name=texts["test"], file=texts.get("file", ""), kind=texts["kind"], tyre=texts.get("tyre", ""), rig=rig,
        excluded=bool(excluded), faults=tuple(faults),
    )  # fmt: skip


def _can_have(preload: float | None, specimen: str, stated: CampaignFile) -> bool:
    """Whether a specimen can have a preload [N]: one that is zero or negative only if it is held on both sides."""
    one = stated.all_specimens.get(specimen)
    fixed = one is not None and (specimen in stated.specimens if one.fixed is None else one.fixed)
    return fixed or preload is None or preload > 0


def _held(tests: list[Test], stated: CampaignFile) -> list[Test]:
    """The tests, with `fixed` set for specimens that are held on both sides.

    So is a specimen that campaign.toml states as fixed, and one under [specimens] with a preload of zero or less.
    """
    pulled = {one.tyre for one in tests if not one.problem and one.values.get("preload", 1.0) <= 0}
    fixed = {name for name, one in stated.all_specimens.items() if one.fixed or (one.fixed is None and name in pulled)}
    return [replace(one, fixed=True) if one.tyre in fixed else one for one in tests]


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
    try:
        return units.quantity(cell, "time", default_unit=unit)
    except UnitError:  # numbers come first, because "10" would be ten o'clock and "20240503" a date
        pass
    try:
        moment = datetime.fromisoformat(cell)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except ValueError:
        pass
    try:
        clock = time.fromisoformat(cell)
        return 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond
    except ValueError:
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
            named = "a calibration has a rigid mass in place of the tyre: leave the column 'tyre' blank"
            yield Message("tyre", "calibration", named)
    elif not tyre:
        yield Message("tyre", "missing", "the tyre is not named: fill in the column 'tyre'")
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


def _check_names(tests: list[Test]) -> None:
    """CampaignError if two tests have the same name."""
    seen: dict[str, int] = {}
    for test in tests:
        if test.name in seen:
            raise CampaignError(
                f"tests.csv row {test.row}: test {units.shown(test.name)} stands in row {seen[test.name]} already: "
                "give each test a name of its own"
            )
        seen[test.name] = test.row


def _check_channels(stated: CampaignFile, tests: list[Test]) -> None:
    """CampaignError if campaign.toml lacks a channel that the tests of some kind need."""
    needs = {
        "dynamic": ("motion_in",),
        "calibration": ("motion_in",),
        **dict.fromkeys(_OF_BAND, ("force_in", "motion_in")),
        "static": ("load", "deflection"),
    }
    for kind, roles in needs.items():
        for role in roles:
            if any(test.kind == kind for test in tests) and stated.channels.named(role) is None:
                raise CampaignError(
                    f"campaign.toml: [channels] {role} is missing, {kind} tests need it: "
                    f'{role} = {{ column = "...", unit = "..." }}'
                )


def _without_unit(stated: CampaignFile) -> dict[str, str]:
    """Column of each dynamic channel without a unit and a sensitivity in campaign.toml, by role."""
    named = {role: stated.channels.named(role) for role in ("force_in", "motion_in", "motion_out")}
    return {role: channel.column for role, channel in named.items() if channel is not None and channel.has_no_unit}


def _check_files(folder: Path, stated: CampaignFile, tests: list[Test]) -> None:
    """CampaignError if neither campaign.toml nor the first dynamic recording states the times, or a unit."""
    timeless = stated.channels.time is None and stated.channels.rate is None
    unitless = _without_unit(stated)
    first = next((test for test in tests if test.kind == "dynamic" and not test.problem), None)
    if first is None or not (timeless or unitless):
        return
    try:
        signals = _survey(folder, first.file).signals
    except FourpoleError:
        return  # the analysis of the test reports the fault of its file
    if timeless:
        _check_times(first.file, signals)
    _check_units(first.file, signals, unitless)


def _survey(folder: Path, file: str) -> FileInfo:
    """The description of a recording of a campaign."""
    with at_hand(folder, file) as path:
        found: FileInfo = read_apart(survey_named, path, file, classes=(FileInfo, SignalInfo))
        return found


def survey_named(path: Path, label: str) -> FileInfo:
    """The description of a file with a name for messages, as a worker process runs it."""
    return survey(path, label=label)


def _check_times(file: str, signals: Sequence[SignalInfo]) -> None:
    """CampaignError if no signal of a recording has a rate or a duration."""
    if all(signal.rate is None and signal.duration is None for signal in signals):
        raise CampaignError(
            f"campaign.toml: [channels] time is missing, and {units.shown(file)} does not know its times: "
            'time = { column = "t", unit = "s" }, or sample_rate = "2 kHz"'
        )


def _check_units(file: str, signals: Sequence[SignalInfo], unitless: dict[str, str]) -> None:
    """CampaignError if a recording lacks the unit of a column for which campaign.toml states none."""
    with_unit = {signal.name for signal in signals if signal.unit}
    for role, column in unitless.items():
        if column not in with_unit:
            raise CampaignError(
                f'campaign.toml: [channels] {role}: unit is missing: write it, as unit = "N", or give a sensitivity '
                f"for volts ({units.shown(file)} states none)"
            )
