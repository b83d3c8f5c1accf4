"""How many tests were used, and which tests not to trust, by reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import polars as pl

from fourpole.core.checks import Code
from fourpole.findings.facts import Facts, natural
from fourpole.findings.finding import Finding, Holds, Topic

__all__ = ["Doubt", "ShortCheck", "Tally", "short_checks", "verdicts"]

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
        """All tests."""
        return self.ok + self.warning + self.rejected

    @property
    def holds(self) -> Holds:
        """How many of them were used."""
        if not self.total:
            return Holds.NO_TESTS
        if self.rejected == self.total:
            return Holds.NONE_USED
        return Holds.ALL_USED if self.ok == self.total else Holds.SOME_USED


@dataclass(frozen=True)
class Doubt:
    """Why some tests were rejected, or are used with a warning."""

    kind: ClassVar[str] = "doubt"
    reason: str


@dataclass(frozen=True)
class ShortCheck:
    """A check with something to say: its verdict, its cause in a few words (empty where it has none), what to do."""

    verdict: str
    cause: str
    remedy: str


def verdicts(facts: Facts) -> list[Finding]:
    """How many tests were used; then the rejected and the warned ones by reason, the commonest reason first."""
    worst: dict[str, str] = {}
    reasons: dict[str, dict[str, set[str]]] = {"rejected": {}, "warning": {}}
    short = short_checks(facts.results.checks)
    for test, verdict, remarks in _rows(facts):
        if verdict == "rejected" or worst.get(test) != "rejected":
            worst[test] = verdict if verdict != "ok" else worst.get(test, "ok")
        causes = [one.cause for one in short.get(test, []) if one.verdict == verdict and one.cause]
        for reason in causes or [_beginning(remarks or "")] if verdict in reasons else ():
            reasons[verdict].setdefault(reason, set()).add(test)
    counts = list(worst.values())
    tally = Tally(*(counts.count(verdict) for verdict in ("ok", "warning", "rejected")))
    used = tuple(sorted((test for test, verdict in worst.items() if verdict != "rejected"), key=natural))
    found = [Finding(Topic.TRUST, None, facts.tyres, tally.holds, tally, tests=used)]
    for verdict, by_reason in reasons.items():
        for reason, tests in sorted(by_reason.items(), key=lambda item: (-len(item[1]), item[0])):
            names = tuple(sorted(tests, key=natural))
            found.append(Finding(Topic.TRUST, None, (), Holds(verdict), Doubt(reason), tests=names))
    return found


def _rows(facts: Facts) -> Iterable[tuple[str, str, str]]:
    return pl.concat([table.select("test", "verdict", "remarks") for table in facts.tables]).iter_rows()


def short_checks(checks: pl.DataFrame) -> dict[str, list[ShortCheck]]:
    """The checks of checks.csv that have something to say, by test; none where the results are of an older version."""
    found: dict[str, list[ShortCheck]] = {}
    for row in checks.rows(named=True):
        if row["verdict"] != "ok" or row["statistic"] is None:
            code = Code.read(row["code"])
            short = ShortCheck(row["verdict"], code.short(row["verdict"]) if code else "", row["remedy"] or "")
            found.setdefault(row["test"], []).append(short)
    return found


def _beginning(remarks: str) -> str:
    """The first of the remarks of a test, cut where it is long; it stands where no check has a short form."""
    first = remarks.split("; ", maxsplit=1)[0].rstrip(".")
    if len(first) > _LONGEST:
        first = first[:_LONGEST].rstrip() + " ..."
    return first or "no reason is given"
