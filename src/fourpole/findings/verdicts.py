"""The number of tests that were used; the tests that were rejected or used with a warning, by reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import polars as pl

from fourpole.core.checks import VERDICTS, worst_verdict
from fourpole.core.codes import Code
from fourpole.core.wording import without_numbers
from fourpole.findings.facts import Facts, natural
from fourpole.findings.finding import Finding, Holds, Topic

#: Number of characters of a remark that are shown if its check has no short form.
_LONGEST = 160


@dataclass(frozen=True)
class Tally:
    """Number of tests by verdict; a static test with several preloads counts by its worst."""

    kind: ClassVar[str] = "tests"
    ok: int
    warning: int
    rejected: int

    @property
    def total(self) -> int:
        """Number of all tests."""
        return self.ok + self.warning + self.rejected

    @property
    def holds(self) -> Holds:
        """Whether all, some or none of the tests were used."""
        if not self.total:
            return Holds.NO_TESTS
        if self.rejected == self.total:
            return Holds.NONE_USED
        return Holds.ALL_USED if self.ok == self.total else Holds.SOME_USED


@dataclass(frozen=True)
class Doubt:
    """Why tests were rejected or have a warning: the code of a check, or the start of the remark if there is none."""

    kind: ClassVar[str] = "doubt"
    code: Code | None
    remark: str = ""


@dataclass(frozen=True)
class CheckRow:
    """A check that gave a warning or a rejection, or could not be made: its verdict, code and remedy."""

    verdict: str
    code: Code | None
    remedy: str

    @property
    def cause(self) -> str:
        """The cause in a few words; empty if the check has no short form."""
        return self.code.short(self.verdict) if self.code else ""


def verdicts(facts: Facts) -> list[Finding]:
    """The number of tests by verdict; then the rejected and the warned ones by reason, the commonest reason first."""
    rows = pl.concat([table.select("test", "verdict", "remarks") for table in facts.tables]).rows()
    by_test: dict[str, list[str]] = {}
    for test, verdict, _ in rows:
        by_test.setdefault(test, []).append(verdict)
    worst = {test: worst_verdict(found) for test, found in by_test.items()}
    tally = Tally(*(list(worst.values()).count(verdict) for verdict in VERDICTS))
    used = tuple(sorted((test for test, verdict in worst.items() if verdict != "rejected"), key=natural))
    found = [Finding(Topic.TRUST, None, facts.tyres, tally.holds, tally, tests=used)]
    checks = checks_by_test(facts.results.checks)
    doubts: list[Finding] = []
    for holds in (Holds.REJECTED, Holds.WARNING):
        reasons: dict[Doubt, set[str]] = {}
        alike: dict[str, Doubt] = {}
        for test, verdict, remarks in rows:
            for doubt in _doubts(checks.get(test, ()), verdict, remarks or "") if verdict == holds else ():
                first = doubt if doubt.code else alike.setdefault(without_numbers(doubt.remark, names=True), doubt)
                reasons.setdefault(first, set()).add(test)
        order = sorted(reasons, key=lambda one: (-len(reasons[one]), one.code.text if one.code else "", one.remark))
        doubts += [Finding(Topic.TRUST, None, (), holds, one, tests=_sorted(reasons[one])) for one in order]
    return found + sorted(doubts, key=_place)


def _place(doubt: Finding) -> bool:
    """Sort key of a doubt: a specimen that is not linear comes first, because all other checks assume a linear one."""
    return not (isinstance(doubt.detail, Doubt) and doubt.detail.code is Code.LINEARITY)


def _sorted(tests: set[str]) -> tuple[str, ...]:
    return tuple(sorted(tests, key=natural))


def _doubts(checks: Sequence[CheckRow], verdict: str, remarks: str) -> list[Doubt]:
    """The reasons of a verdict: the checks that gave it, or the first remark if no check has a short form.

    A specimen that is not linear is a reason of a rejection, too.
    """
    reasons = [one for one in checks if one.verdict == verdict or one.code is Code.LINEARITY]
    found = [Doubt(one.code) for one in reasons if one.cause]
    return found or [Doubt(None, _beginning(remarks))]


def checks_by_test(checks: pl.DataFrame) -> dict[str, list[CheckRow]]:
    """The rows of checks.csv that are not plainly ok, by test; empty if the results have no checks.csv."""
    found: dict[str, list[CheckRow]] = {}
    for row in checks.rows(named=True):
        if row["verdict"] != "ok" or row["statistic"] is None:
            one = CheckRow(row["verdict"], Code.read(row["code"]), row["remedy"] or "")
            found.setdefault(row["test"], []).append(one)
    return found


def _beginning(remarks: str) -> str:
    """The first remark on a test, cut after 160 characters."""
    first = remarks.split("; ", maxsplit=1)[0].rstrip(".")
    if len(first) > _LONGEST:
        first = first[:_LONGEST].rstrip() + " ..."
    return first or "no reason is given"
