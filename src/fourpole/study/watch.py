"""A folder that a logger writes into: each recording that is all there is judged by itself and with the rig as found.

The judgement is that of `analyse` on the recording, the static tests, and the last tests at its condition, with the rig
as the last analysis found it. The joint answer of all tests is a new analysis.
"""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import MOST_TESTS, Campaign, read_campaign, tests_file
from fourpole.campaign.ordinary import Stated
from fourpole.campaign.place import inside
from fourpole.campaign.row import Test, known_name
from fourpole.campaign.schema import RigFile
from fourpole.core.checks import Verdict
from fourpole.core.sources import Kind
from fourpole.errors import CampaignError, FourpoleError
from fourpole.guess.gather import FolderContents, gather_more, recording_files
from fourpole.guess.together import guess_more
from fourpole.guess.write import Row, quoted, tests_csv
from fourpole.io.documents import delimiter_of, rows_of
from fourpole.io.door import read_bytes
from fourpole.io.lock import campaign_lock, staged
from fourpole.io.source import decode
from fourpole.io.write import write_text
from fourpole.study.analysis import analyse
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.units import column_unit

#: Time for which a file must not change before it counts as all there [s].
SETTLED = 2.0
#: Time after which a file that cannot be read is answered as such, in case that it is still being written [s].
_PATIENCE = 3.5
#: Number of former tests at the condition of a recording with which it is compared.
_FORMER = 4


@dataclass(frozen=True)
class WatchedFile:
    """The judgement on one recording.

    Attributes
    ----------
    test, file : str
    verdict : Verdict
    remarks : tuple of str
        The reasons, with what to do.
    row : dict of str to value
        Its first row of static.csv or dynamic.csv, by the heads of the columns; empty if it was not analysed.
    doubts : tuple of str
        What was guessed of the test, and may be wrong.
    """

    test: str
    file: str
    verdict: str
    remarks: tuple[str, ...] = ()
    row: dict[str, Any] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()


@dataclass
class _File:
    """A file as it was last seen, since when it has been so, and whether that was answered."""

    state: tuple[int, int]
    since: float
    answered: bool = False


class Watch:
    """Looks at a campaign's folder again and again.

    Parameters
    ----------
    folder : Path
        A campaign; its tests.csv may name recordings that are not there yet. Recordings that it does not name get a
        row of it, as `init` would guess it.
    clock : callable
        The time now [s].

    Raises
    ------
    CampaignError
        If the folder has no campaign.
    """

    def __init__(self, folder: Path, *, clock: Any = time.monotonic) -> None:
        self.folder, self._clock = folder, clock
        campaign = read_campaign(folder)
        named = {test.file for test in campaign.tests}
        self._files: dict[Path, _File] = {}
        self._known = FolderContents()
        for path, state in self._present():
            # What stands in tests.csv when the watch begins was there before; the rest is new.
            known = path.relative_to(folder).as_posix() in named
            self._files[path] = _File(state, clock() - (0 if not known else SETTLED), answered=known)

    def warm(self) -> None:
        """Judge a test that is there already, so that the first new one does not wait for libraries to load."""
        campaign = read_campaign(self.folder)
        there = [test for test in campaign.tests if test.kind != "static" and self._is_there(test)]
        for test in there[-1:]:
            gather_more(self.folder, [self.folder / test.file])
            self._judged(campaign, test, _former(self.folder), ())

    def _is_there(self, test: Test) -> bool:
        """Whether a test names a file of the campaign that is there."""
        with suppress(FourpoleError, OSError):
            return inside(self.folder, test.file).is_file() and (self.folder / test.file).is_file()
        return False

    def look(self) -> Iterator[WatchedFile]:
        """The judgements on recordings that have been all there since the last look, each once for each content."""
        now = self._clock()
        ready = [path for path, state in self._present() if self._is_ready(path, state, now)]
        if not ready:
            return
        campaign = read_campaign(self.folder)
        named = _by_file(campaign)
        strange = [path for path in ready if self._name(path) not in named]
        doubts: dict[str, tuple[str, ...]] = {}
        if strange:
            more = gather_more(self.folder, strange)
            yield from self._unreadable(strange, more)
            more.recordings = [recording for recording in more.recordings if not recording.problem]
            if more.recordings:
                rows = guess_more(self.folder, self._known, more)
                self._known.recordings += more.recordings
                doubts = add_rows(self.folder, rows)
                campaign = read_campaign(self.folder)
                named = _by_file(campaign)
        former = _former(self.folder)
        for path in ready:
            for test in named.get(self._name(path), []):
                judged = self._judged(campaign, test, former, doubts.get(test.name, ()))
                if judged.verdict == Verdict.REJECTED and not self._has_waited(path):
                    break  # it may still be written
                self._files[path].answered = True
                yield judged

    def _unreadable(self, paths: Sequence[Path], more: FolderContents) -> Iterator[WatchedFile]:
        """The judgements on files that cannot be read, when they have had time to become whole."""
        why = dict(more.left_out) | {each.file: each.problem for each in more.recordings if each.problem}
        good = {recording.file.partition("#")[0] for recording in more.recordings if not recording.problem}
        for path in paths:
            name = self._name(path)
            if name not in good and self._has_waited(path):
                reason = next((text for file, text in why.items() if file.partition("#")[0] == name), "is no recording")
                self._files[path].answered = True
                yield WatchedFile(
                    path.stem, name, Verdict.REJECTED, (f"{reason}; it is judged again when the file changes",)
                )

    def _name(self, path: Path) -> str:
        """Name of a file in tests.csv."""
        return path.relative_to(self.folder).as_posix()

    def _has_waited(self, path: Path) -> bool:
        return bool(self._clock() - self._files[path].since >= _PATIENCE)

    def _present(self) -> Iterable[tuple[Path, tuple[int, int]]]:
        for path in recording_files(self.folder):
            with suppress(OSError):
                stat = path.stat()
                yield path, (stat.st_size, stat.st_mtime_ns)

    def _is_ready(self, path: Path, state: tuple[int, int], now: float) -> bool:
        seen = self._files.get(path)
        if seen is None or seen.state != state:
            self._files[path] = _File(state, now)
            return False
        return not seen.answered and now - seen.since >= SETTLED

    def _judged(self, campaign: Campaign, test: Test, former: Study | None, doubts: tuple[str, ...]) -> WatchedFile:
        compared = [*_statics(campaign, test), *_alike(campaign, test, former)]
        names = {other.name for other in (*compared, test)}
        some = tuple(other for other in campaign.tests if other.name in names)
        try:
            study = analyse(
                replace(_with_rig(campaign, former), tests=some), cache=self.folder / "results" / "cache", workers=1
            )
        except FourpoleError as error:
            return WatchedFile(test.name, test.file, Verdict.REJECTED, (str(error),), doubts=doubts)
        result = study.tests[test.name]
        return WatchedFile(test.name, test.file, result.verdict, result.remarks, result.row, doubts)


def _former(folder: Path) -> Study | None:
    """The results of the last analysis, if there are any that can be read."""
    with suppress(FourpoleError):
        return read_results(folder / "results")
    return None


def _with_rig(campaign: Campaign, former: Study | None) -> Campaign:
    """The campaign with its one rig as the last analysis found it, where that fits."""
    rigs = campaign.stated.all_rigs
    if former is None or list(rigs) != [""] or not former.rigs or not former.rigs[0].fits:
        return campaign
    values = dict(rigs[""].values)
    for value in former.rigs[0].values:
        name = value.source.of if value.source.kind is Kind.RIG_VALUE else ""
        if name in values and value.found is not None and value.found_std is not None:
            values[name] = Stated(value.found, value.found_std, assumed=False)
    rig = RigFile.model_construct(values=values, output=rigs[""].output)
    return replace(campaign, stated=campaign.stated.model_copy(update={"rig": rig}))


def _by_file(campaign: Campaign) -> dict[str, list[Test]]:
    """The tests of each file, without the group of `file#group`."""
    tests: dict[str, list[Test]] = {}
    for test in campaign.tests:
        for name in dict.fromkeys((test.file, test.file.partition("#")[0])):
            tests.setdefault(name, []).append(test)
    return tests


def _statics(campaign: Campaign, test: Test) -> list[Test]:
    """The static tests that K1 of a test comes from: those of its specimen, at its pressure if there are any."""
    tests = [other for other in campaign.tests if other.tyre == test.tyre and other is not test]
    statics = [other for other in tests if other.kind == "static"]
    return [static for static in statics if _near(static.value("pressure"), test.value("pressure"))] or statics


def _alike(campaign: Campaign, test: Test, former: Study | None) -> list[Test]:
    """The last tests that were used at the condition of a test."""
    used: set[str] = set()
    if former is not None and not former.dynamic.is_empty():
        used = set(former.dynamic.filter(pl.col(q.VERDICT.head) != Verdict.REJECTED)[q.TEST.head].to_list())
    names = ("pressure", "preload", "frequency", "temperature", "added_mass")
    alike = [
        other
        for other in campaign.tests
        if other.name in used
        and (other.kind, other.tyre, other.rig, other.band) == (test.kind, test.tyre, test.rig, test.band)
        and all(_near(other.value(name), test.value(name)) for name in names)
    ]
    return alike[-_FORMER:]


def _near(first: float | None, second: float | None) -> bool:
    if first is None or second is None:
        return first is second
    return abs(first - second) <= 0.01 * max(abs(first), abs(second))


def add_rows(folder: Path, rows: Sequence[Row]) -> dict[str, tuple[str, ...]]:
    """Write further rows into tests.csv, and specimens that are new into campaign.toml; returns the doubts of each.

    A specimen that the names do not tell is the campaign's, if it has one; else that of the last test. A recording that
    someone else has stated meanwhile gets no row.
    """
    with campaign_lock(folder):
        campaign = read_campaign(folder)
        stated = _by_file(campaign)
        new = _named(campaign, [guess for guess in rows if guess.file not in stated])
        if not new:
            return {}
        if (table := tests_file(folder)).name != "tests.csv":
            raise CampaignError(f"{table.name}: no row is written into a workbook: add it, or save it as tests.csv")
        tests = _text(folder, "tests.csv").lstrip("\ufeff")
        specimens = dict.fromkeys(guess.tyre for guess in new if guess.tyre)
        tables = [f"\n[tyres.{_key(name)}]\n" for name in specimens if name not in campaign.stated.all_specimens]
        with staged(folder) as place:
            write_text(place / "tests.csv", _joined(tests, tests_csv(new)))
            if tables:
                toml = _text(folder, "campaign.toml").rstrip()
                write_text(place / "campaign.toml", f"{toml}\n{''.join(tables)}")
        return {guess.name: tuple(text for _, text in guess.doubts) for guess in new}


def _named(campaign: Campaign, rows: Sequence[Row]) -> list[Row]:
    """The rows with names that no test of the campaign has, and with the specimen."""
    taken = {test.name for test in campaign.tests}
    last = next((test.tyre for test in reversed(campaign.tests) if test.tyre), "")
    specimens = list(campaign.stated.all_specimens)
    usual = specimens[0] if len(specimens) == 1 else last
    named = []
    for guess in rows:
        told = guess.tyre not in ("", "unnamed", Path(guess.file).stem) or not last
        tyre = "" if guess.kind == "calibration" else guess.tyre if told else usual
        name, number = guess.name, 2
        while name in taken:
            name, number = f"{guess.name}-{number}", number + 1
        taken.add(name)
        named.append(replace(guess, name=name, tyre=tyre))
    return named


def _text(folder: Path, name: str) -> str:
    return decode(read_bytes(folder / name, max_bytes=MOST_TESTS, within=folder), name)[0]


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else quoted(name)


def _joined(text: str, more: str) -> str:
    """A table with the rows of another below it; columns that it lacks are added at its end."""
    (heads, *rows), (others, *added) = (_cells(part) for part in (text, more))
    names, places = [_name(head) for head in heads], []
    for head in others:
        name = _name(head)
        if name not in names:
            heads, names = [*heads, head], [*names, name]
        place = names.index(name)
        # A cell may have a unit of its own, where the column has another.
        places.append((place, "" if heads[place] == head else column_unit(head)[1] or ""))
    table = [row + [""] * (len(heads) - len(row)) for row in rows]
    for cells in added:
        row = [""] * len(heads)
        for (place, unit), cell in zip(places, cells, strict=False):
            row[place] = f"{cell} {unit}" if cell and unit else cell
        table.append(row)
    made = io.StringIO()
    csv.writer(made, lineterminator="\n", delimiter=delimiter_of(text)).writerows([heads, *table])
    return made.getvalue()


def _name(head: str) -> str:
    """What a column is known by: its name in English, or one of the user's own."""
    return known_name(head) or column_unit(head)[0].casefold()


def _cells(text: str) -> list[list[str]]:
    """The cells of a table."""
    return [[cell.strip() for cell in row] for _, row in rows_of(text, "tests.csv")]
