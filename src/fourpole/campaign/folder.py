"""A campaign folder: campaign.toml and tests.csv become a Campaign; each faulty row has the reason in `problem`."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fourpole import units
from fourpole.campaign.channels import did_you_mean
from fourpole.campaign.limits import Limits, read_limits
from fourpole.campaign.ordinary import doubtful_uncertainties
from fourpole.campaign.place import at_hand
from fourpole.campaign.report import logo_of
from fourpole.campaign.row import (
    DOUBTS,
    OF_BAND,
    PASSED,
    QUANTITIES,
    Column,
    Test,
    columns_of,
    condition_of,
    test_of_row,
)
from fourpole.campaign.schema import CampaignFile, parse_campaign
from fourpole.core.arrays import IntArray, short_repr
from fourpole.core.phasor import CHANNELS
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.io.child import read_apart
from fourpole.io.documents import delimiter_of, rows_of, toml_of
from fourpole.io.door import read_bytes
from fourpole.io.folders import why_no_campaign, why_no_folder, why_no_tests
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, SignalInfo
from fourpole.io.source import decode

#: The files that may list the tests, of which a campaign has one.
TESTS = ("tests.csv", "tests.xlsx")
#: The file with the limits that results are held against.
LIMITS = "limits.toml"
#: Largest size of campaign.toml and of tests.csv [byte].
MOST_TOML, MOST_TESTS = 1_000_000, 200_000_000
#: Largest number of unknown names and units that are compared with known ones.
_HINTED = 1000

#: Similarity from which a name is that of a known column with a slip of the pen.
_ALIKE = 0.6
#: Least and greatest value, by column, outside which all values of a campaign are probably in another unit [SI].
_PLAUSIBLE = {"pressure": (5e3, 2.5e6), "preload": (5.0, 1e6), "temperature": (0.0, 200.0)}
#: Usual values, by which the unit that was meant is found [SI].
_USUAL = {"pressure": (5e4, 1.5e6), "preload": (50.0, 1e5), "temperature": (-60.0, 150.0)}
#: The units that are tried in place of the stated one.
_MEANT = {"pressure": ("bar", "kPa", "psi"), "preload": ("kN", "N"), "temperature": ("K",)}


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


def condition_numbers(campaign: Campaign, tests: Sequence[Test]) -> IntArray:
    """Number of the condition of some dynamic tests among all of the campaign; negative for a rigid block."""
    rule, every = campaign.stated.sameness, campaign.of_kind("dynamic")
    numbers = rule.groups([condition_of(test, rule) for test in every]).tolist()
    number = {test.name: number for test, number in zip(every, numbers, strict=True)}
    return np.array([-1 if test.kind == "calibration" else number[test.name] for test in tests], dtype=int)


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
    if not (folder / "campaign.toml").exists():
        raise CampaignError(why_no_campaign(folder))
    table = tests_file(folder)
    sha256: dict[str, str] = {}
    with units.hints(_HINTED):
        stated = parse_campaign(statement_text(folder / "campaign.toml", MOST_TOML, sha256, strict=True))
    with _naming(table.name):
        columns, tests = _listed(statement_text(table, MOST_TESTS, sha256, strict=False), stated)
    if table.name != TESTS[0]:
        tests = [replace(test, workbook=table.name) for test in tests]
    extra = _checked_together(folder, columns, tests, stated)
    doubts = _doubts(columns, tests, stated)
    logo, path, limits = logo_of(folder, stated.report.logo), folder / LIMITS, Limits()
    if path.exists() or path.is_symlink():
        specimens = tuple(dict.fromkeys(test.tyre for test in tests))
        limits = read_limits(statement_text(path, MOST_TOML, sha256, strict=True), specimens)
    return Campaign(folder, stated, tuple(tests), extra, doubts, limits, logo, sha256)


def tests_file(folder: Path) -> Path:
    """The file of a campaign that lists its tests; CampaignError if there is none, or one too many."""
    there = [folder / name for name in TESTS if (folder / name).exists()]
    if not there:
        other = next((path.name for path in folder.iterdir() if path.name.casefold() in TESTS), "")
        spelt = f"{folder}: write the name of {units.shown(other)} in small letters: {other.casefold()}"
        raise CampaignError(spelt if other else why_no_tests(folder))
    if len(there) > 1:
        older = min(there, key=lambda path: path.stat().st_mtime)
        raise CampaignError(
            f"{folder}: {' and '.join(TESTS)} both list tests: remove one; {older.name} was saved first, so remove "
            "that if the other one is its successor"
        )
    return there[0]


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """Let messages on tests.csv name the file that lists the tests in its place."""
    try:
        yield
    except CampaignError as error:
        if name == TESTS[0]:
            raise
        raise CampaignError(str(error).replace(TESTS[0], name)) from None


def _listed(text: str, stated: CampaignFile) -> tuple[list[Column], list[Test]]:
    """Columns and tests of the text of tests.csv."""
    columns, rows = _table(text)
    with units.hints(_HINTED):  # not around what asks for the nearest name to decide, as the doubts of a campaign
        return columns, _tests([test_of_row(row, cells, columns, stated) for row, cells in rows], stated)


def _table(text: str) -> tuple[list[Column], list[tuple[int, list[str]]]]:
    """Columns of the text of tests.csv, and its rows, by their numbers, with points for decimal commas."""
    rows = list(_rows(text))
    if not rows:
        raise CampaignError("tests.csv: has no row of names; the first row is test,file,kind,tyre,pressure [bar],...")
    columns = columns_of(rows[0][1])
    if delimiter_of(text) == ";" and any(0 < _decimals(cell) != 3 for _, cells in rows[1:] for cell in cells):
        commas = [(row, [cell.replace(",", ".") if _decimals(cell) else cell for cell in cells]) for row, cells in rows]
        rows = [rows[0], *commas[1:]]
    return columns, rows[1:]


def _decimals(cell: str) -> int:
    """Number of digits behind the only comma of a number; three may be thousands. 0 for any other cell."""
    whole, _, part = cell.partition(",")
    return len(part) if whole.lstrip("+-").isdecimal() and part.isdecimal() else 0


def _doubts(columns: Sequence[Column], tests: Sequence[Test], stated: CampaignFile) -> tuple[str, ...]:
    """What is allowed as it is stated, but probably a slip."""
    rigs = {name: rig.values for name, rig in stated.all_rigs.items()}
    of_table = (*doubtful_columns(columns, stated), *doubtful_values(columns, tests))
    return (*of_table, *doubtful_uncertainties(stated.channels.by_role, rigs))


def doubtful_columns(columns: Sequence[Column], stated: CampaignFile) -> Iterator[str]:
    """Columns of the user's own, but for axes of the conditions, that were probably meant as known ones."""
    axes, present = {axis.name for axis in stated.conditions.axes}, {column.name for column in columns}
    for head in (column.label for column in columns if column.role == "extra" and column.label not in axes):
        name, unit = units.column_unit(head)
        alike = [known for known, (kind, _) in QUANTITIES.items() if unit is not None and units.is_unit(unit, kind)]
        near = [known for known in alike if known not in present]
        near = near or list(filter(None, [units.nearest(name, alike, _ALIKE)]))
        if near:
            best = units.nearest(name, near, 0.0) or near[0]
            yield (
                f"tests.csv: column {units.shown(head)} is taken as one of your own, so the analysis does not use it; "
                f"if '{best} [{unit}]' is meant, rename it"
            )


def doubtful_values(columns: Sequence[Column], tests: Sequence[Test]) -> Iterator[str]:
    """Columns all values of which were probably meant in another unit."""
    for column in columns:
        name, unit = column.name, column.unit
        if column.role != "quantity" or name not in _PLAUSIBLE:
            continue
        low, high = _PLAUSIBLE[name]
        sizes = sorted(abs(value) for test in tests if (value := test.value(name)))
        if not sizes or (sizes[0] <= high and sizes[-1] >= low):
            continue
        # a temperature has another zero in other units, so its numbers are those of the column only in degC
        scale = 1.0 if name == "temperature" else units.unit_scale(unit, column.kind)
        numbers = [size / scale for size in sizes]
        least, most = _USUAL[name]
        meant = ((other, units.to_si(numbers[:1], other, column.kind)[0]) for other in _MEANT[name])
        likely = next((other for other, value in meant if least <= value <= most), None)
        hint = f"if {likely} is meant, write '{name} [{likely}]'" if likely else "check its unit"
        span = f"{numbers[0]:.4g}" if numbers[0] == numbers[-1] else f"{numbers[0]:.4g} to {numbers[-1]:.4g}"
        yield f"tests.csv: column {units.shown(column.label)} states {span} {unit}: is that so? {hint}"


def _checked_together(
    folder: Path, columns: Sequence[Column], tests: list[Test], stated: CampaignFile
) -> tuple[str, ...]:
    """Heads of the columns that pass through; CampaignError if both files do not state what the tests need."""
    for fault in _lacking(stated, tests):
        raise CampaignError(fault)
    _check_files(folder, stated, tests)
    return _further_columns(columns, tests, stated)


def check_statement(folder: Path, text: str, table: str) -> tuple[list[str], list[Test], tuple[str, ...]]:
    """All that is wrong with the texts of campaign.toml and tests.csv, which need not be those in the folder.

    Returns
    -------
    (list of str, list of Test, tuple of str)
        Faults of the whole, the tests that could be read, with their faults, and the doubts if there is no fault.
    """
    faults: list[str] = []
    with units.hints(_HINTED):
        try:
            stated: CampaignFile | None = parse_campaign(text)
        except CampaignError as error:
            faults += error.faults or (str(error),)
            stated = _with_names(text)
        if stated is None:
            return faults, [], ()
        try:
            columns, rows = _table(table)
        except CampaignError as error:
            return [*faults, str(error)], [], ()
        tests = []
        for row, cells in rows:
            try:
                tests.append(test_of_row(row, cells, columns, stated))
            except CampaignError as error:
                faults.append(str(error))
    whole, faults = not faults, [*faults, *_same_names(tests)]
    if not whole:  # rows are checked against the names alone
        named = [[fault for fault in test.faults if fault.code not in ("rig", "preload")] for test in tests]
        tests = [replace(test, faults=tuple(kept)) for test, kept in zip(tests, named, strict=True)]
    elif not faults:
        faults += _lacking(stated, tests)
    if faults or any(test.problem and not test.excluded for test in tests):
        return faults, tests, ()
    try:
        tests = _tests(tests, stated)
        _checked_together(folder, columns, tests, stated)
    except CampaignError as error:
        return [str(error)], tests, ()
    return [], tests, _doubts(columns, tests, stated)


def _with_names(text: str) -> CampaignFile | None:
    """The specimens that a faulty campaign.toml names, for rows to be checked against; None if it is no TOML."""
    with suppress(TableError, CampaignError):
        stated = toml_of(text, "campaign.toml")
        tables = {name: stated[name] for name in ("tyres", "specimens") if isinstance(stated.get(name), dict)}
        names: dict[str, Any] = {name: {one: {} for one in table} for name, table in tables.items()}
        return parse_campaign({"channels": {}, **names})
    return None


def statement_text(path: Path, most: int, sha256: dict[str, str], *, strict: bool) -> str:
    """The text of a file of at most `most` bytes; CampaignError if `strict` and the text is not UTF-8.

    The text of a workbook is its first sheet as CSV. Its SHA-256 is put under its name.
    """
    try:
        content = read_bytes(path, max_bytes=most, label=path.name, within=path.parent)
        sha256[path.name] = hashlib.sha256(content).hexdigest()
        if path.suffix == ".xlsx":
            from fourpole.io.formats.workbook import first_table

            return str(read_apart(first_table, path, path.name, label=path.name))
        if strict:
            return content.decode("utf-8-sig")
        return decode(content, path.name)[0]
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CampaignError(f"{path.name}: line {line} is not UTF-8 text; save the file as UTF-8") from None
    except (FileError, TableError) as error:
        raise CampaignError(str(error)) from None


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


def _tests(tests: list[Test], stated: CampaignFile) -> list[Test]:
    """The tests, with `fixed` set for specimens that are held on both sides.

    So is a specimen that campaign.toml states as fixed, and one under [specimens] with a preload of zero or less.
    CampaignError if there is no test, or two have the same name.
    """
    if not tests:
        raise CampaignError("tests.csv: lists no test below its row of names")
    for fault in _same_names(tests):
        raise CampaignError(fault)
    pulled = {test.tyre for test in tests if not test.faults and test.values.get("preload", 1.0) <= 0}
    specimens = stated.all_specimens.items()
    fixed = {name for name, one in specimens if (name in pulled if one.fixed is None else one.fixed)}
    return [replace(test, fixed=True) if test.tyre in fixed else test for test in tests]


def _same_names(tests: Sequence[Test]) -> Iterator[str]:
    """A fault for each test that has the name of one above it."""
    seen: dict[str, int] = {}
    for test in tests:
        if seen.setdefault(test.name, test.row) != test.row:
            yield (
                f"tests.csv row {test.row}: test {units.shown(test.name)} stands in row {seen[test.name]} already: "
                "give each test a name of its own"
            )


def _further_columns(columns: Sequence[Column], tests: Sequence[Test], stated: CampaignFile) -> tuple[str, ...]:
    """Heads of the columns that pass through to the results; CampaignError if an axis of [conditions] is none."""
    mended = () if any(test.extra.get(DOUBTS) for test in tests) else (DOUBTS,)
    labels = [column.label for column in columns if column.role in PASSED]
    further = tuple(label for label in labels if label and label not in mended)
    for axis in stated.conditions.axes:
        if axis.name not in further:
            raise CampaignError(
                f"campaign.toml: [conditions] axes: {units.shown(axis.name)} is no further column of tests.csv"
                + (did_you_mean(axis.name, further) if further else "; it has none")
            )
    return further


def _lacking(stated: CampaignFile, tests: Sequence[Test]) -> Iterator[str]:
    """A fault for each channel that campaign.toml lacks and tests of some kind need."""
    needs = {
        "dynamic": ("motion_in",),
        "calibration": ("motion_in",),
        **dict.fromkeys(OF_BAND, ("force_in", "motion_in")),
        "static": ("load", "deflection"),
    }
    for kind, roles in needs.items():
        for role in roles:
            spared = role == "force_in" and stated.channels.motion_out is not None
            if any(test.kind == kind for test in tests) and stated.channels.named(role) is None and not spared:
                yield (
                    f"campaign.toml: [channels] {role} is missing, {kind} tests need it: "
                    f'{role} = {{ column = "...", unit = "..." }}'
                )


def _check_files(folder: Path, stated: CampaignFile, tests: list[Test]) -> None:
    """CampaignError if neither campaign.toml nor the first dynamic recording states the times, or a unit."""
    timeless = stated.channels.time is None and stated.channels.rate is None
    dynamic = {role: stated.channels.named(role) for role in CHANNELS}
    unitless = {role: channel.column for role, channel in dynamic.items() if channel and channel.has_no_unit}
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
        description: FileInfo = read_apart(survey_named, path, file, classes=(FileInfo, SignalInfo))
        return description


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
