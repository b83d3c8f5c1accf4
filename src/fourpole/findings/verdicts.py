"""How many tests were used, and which tests not to trust, by reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import polars as pl

from fourpole.findings.facts import Facts, natural
from fourpole.findings.finding import Finding, Holds, Topic

__all__ = ["Doubt", "Tally", "verdicts"]

_LONGEST = 160
#: What a remark holds -> the reason in a few words; the first that fits.
_REASONS = (
    ("lifts off", "the tyre lifts off"),
    ("close to lifting off", "the tyre is close to lifting off"),
    ("is clipped", "a channel is clipped"),
    ("is stated (", "the recording turns at another frequency than is stated"),
    ("harmonics of the displacement", "the motion at the contact is no clean sine"),
    ("what the fit leaves of", "noise or an unsteady speed"),
    ("hardly moves at", "a channel hardly moves at the test frequency"),
    ("samples are missing", "samples are missing"),
    ("rig's own resonance", "the rig's own resonance hides the tyre"),
    ("what V2 and the rig need", "F1 and V2 contradict each other"),
    ("is not symmetric", "K2 or C is known too poorly"),
    ("K2 and C are left blank", "there is no K1, so K2 and C are blank"),
    ("is constant", "a channel is constant"),
    ("was left out", "a channel was left out"),
    ("record longer", "the recording is too short"),
    ("past the preload", "the load-deflection curve does not reach the preload"),
)


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


def verdicts(facts: Facts) -> list[Finding]:
    """How many tests were used; then the rejected and the warned ones by reason, the commonest reason first."""
    worst: dict[str, str] = {}
    reasons: dict[str, dict[str, set[str]]] = {"rejected": {}, "warning": {}}
    for test, verdict, remarks in _rows(facts):
        if verdict == "rejected" or worst.get(test) != "rejected":
            worst[test] = verdict if verdict != "ok" else worst.get(test, "ok")
        for reason in _reasons(remarks or "") if verdict in reasons else ():
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


def _reasons(remarks: str) -> list[str]:
    """The reasons in the remarks of a test; where none is known, the remarks' own beginning."""
    found = [reason for sign, reason in _REASONS if sign in remarks]
    if found:
        return found
    first = remarks.split("; ", maxsplit=1)[0].rstrip(".")
    if len(first) > _LONGEST:
        first = first[:_LONGEST].rstrip() + " ..."
    return [first or "no reason is given"]
