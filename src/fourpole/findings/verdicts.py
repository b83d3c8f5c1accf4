"""The number of tests that were used; the tests that were rejected or used with a warning, by reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import VERDICTS, Code, Verdict, worst_verdict
from fourpole.findings.facts import Facts, Row, in_order
from fourpole.findings.finding import Finding, Holds, Topic
from fourpole.fitting.rows import Key, keys_of
from fourpole.io.documents import json_of
from fourpole.words import CASES, template

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
class Reason:
    """Why tests were rejected or have a warning: the code of a check, or the start of the remark if there is none."""

    kind: ClassVar[str] = "doubt"
    code: Code | None
    remark: str = ""


@dataclass(frozen=True)
class CheckRow:
    """A check that gave a warning or a rejection, or could not be made: a row of checks.csv."""

    verdict: Verdict
    code: Code | None
    remedy: str
    channel: str = ""
    values: str = ""

    @property
    def cause(self) -> str:
        """The cause in a few words; empty if the check has no short form."""
        return template(self.code, "short", self.verdict) if self.code else ""

    @property
    def kind(self) -> tuple[object, ...]:
        """What checks have in common that differ in numbers and names only."""
        values = json_of(self.values, q.VALUES.head) if self.values else {}
        return self.code, self.channel, repr([values.get(case) for case in CASES])


def kind_of(checks: Sequence[CheckRow], remarks: str) -> tuple[object, ...]:
    """What the tests with these checks and remarks have in common that differ in numbers and names only."""
    return tuple(check.kind for check in checks) or (remarks,)


def verdicts(facts: Facts) -> list[Finding]:
    """The number of tests by verdict; then the rejected and the warned ones by reason, the commonest reason first."""
    rows = [row for table in facts.rows for row in table]
    by_test: dict[str, list[str]] = {}
    for row in rows:
        by_test.setdefault(row["test"], []).append(row["verdict"])
    worst = {test: worst_verdict(each) for test, each in by_test.items()}
    tally = Tally(*(list(worst.values()).count(verdict) for verdict in VERDICTS))
    used = in_order(test for test, verdict in worst.items() if verdict != Verdict.REJECTED)
    checks = checks_by_test(facts.results.checks)
    doubts = [*_of_verdict(Holds.REJECTED, rows, checks), *_of_verdict(Holds.WARNING, rows, checks)]
    # A specimen that is not linear comes first, because all other checks assume a linear one.
    doubts.sort(key=lambda finding: not (isinstance(finding.detail, Reason) and finding.detail.code is Code.LINEARITY))
    return [Finding(Topic.TRUST, None, facts.tyres, tally.holds, tally, tests=used), *doubts]


def _of_verdict(holds: Holds, rows: Sequence[Row], checks: Mapping[str, Sequence[CheckRow]]) -> list[Finding]:
    """The tests of a verdict by reason, the commonest reason first."""
    reasons: dict[Reason, set[str]] = {}
    alike: dict[object, Reason] = {}
    for row in (row for row in rows if row["verdict"] == holds):
        for doubt, kind in _doubts(checks.get(row["test"], ()), row["verdict"], row["remarks"] or ""):
            reasons.setdefault(doubt if doubt.code else alike.setdefault(kind, doubt), set()).add(row["test"])
    order = sorted(
        reasons, key=lambda doubt: (-len(reasons[doubt]), doubt.code.text if doubt.code else "", doubt.remark)
    )
    return [Finding(Topic.TRUST, None, (), holds, doubt, tests=in_order(reasons[doubt])) for doubt in order]


def _doubts(checks: Sequence[CheckRow], verdict: str, remarks: str) -> Sequence[tuple[Reason, object]]:
    """The reasons of a verdict with their kinds: the checks that gave it, or the first remark without a short form.

    A specimen that is not linear is a reason of a rejection, too.
    """
    reasons = [check for check in checks if check.verdict == verdict or check.code is Code.LINEARITY]
    short = [(Reason(check.code), check.kind) for check in reasons if check.cause]
    return short or [(Reason(None, _beginning(remarks)), kind_of(reasons, remarks))]


def checks_by_point(checks: pl.DataFrame) -> dict[Key, list[CheckRow]]:
    """The rows of checks.csv that are not plainly ok, by test and point; empty if the results have no checks.csv."""
    by_point: dict[Key, list[CheckRow]] = {}
    for key, row in zip(keys_of(checks), checks.rows(named=True), strict=True):
        if row[q.VERDICT.head] != Verdict.OK or row[q.STATISTIC.head] is None:
            texts = (row[q.REMEDY.head] or "", row[q.CHANNEL.head] or "", row.get(q.VALUES.head) or "")
            check = CheckRow(Verdict.read(row[q.VERDICT.head]), Code.read(row[q.CODE.head]), *texts)
            by_point.setdefault(key, []).append(check)
    return by_point


def checks_by_test(checks: pl.DataFrame) -> dict[str, list[CheckRow]]:
    """The same by test."""
    by_test: dict[str, list[CheckRow]] = {}
    for (test, _), rows in checks_by_point(checks).items():
        by_test.setdefault(test, []).extend(rows)
    return by_test


def _beginning(remarks: str) -> str:
    """The first remark on a test, cut after 160 characters."""
    first = remarks.split("; ", maxsplit=1)[0].rstrip(".")
    if len(first) > _LONGEST:
        first = first[:_LONGEST].rstrip() + " ..."
    return first or "no reason is given"
