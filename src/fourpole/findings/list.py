"""All findings of a campaign, in the order of the report; those on its verdicts and on masses are made here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import VERDICTS, Code, Verdict, worst_verdict
from fourpole.core.specimen import Form
from fourpole.face import load
from fourpole.findings.facts import (
    UNSTATED,
    Estimate,
    Facts,
    Finding,
    FindingConditions,
    Holds,
    Row,
    Setup,
    Topic,
    in_order,
    pairs,
)
from fourpole.findings.resonances import transmissibility
from fourpole.findings.trends import Comparison, Level, Trend, compare, cycle_losses, level_of, linearity, trend_of
from fourpole.fitting.rows import FoundBody, Key, bodies_in, keys_of
from fourpole.io.documents import json_of
from fourpole.quantities import DERIVED, K1, C, Quantity
from fourpole.study.study import Study
from fourpole.words import CASES, template


@dataclass(frozen=True)
class Inertia:
    """The mass of a specimen: its rows of specimens.csv, one for each condition without the frequency."""

    kind: ClassVar[str] = "inertia"
    bodies: tuple[FoundBody, ...]

    @property
    def form(self) -> Form:
        """A belt or a rod."""
        return self.bodies[0].form

    def ends(self, quantity: Quantity) -> tuple[Estimate, Estimate]:
        """The lowest and the highest value over the conditions; of equal ones the first, twice."""
        found = [Estimate(*body.pair(quantity)) for body in self.bodies]
        low, high = (pick(found, key=lambda one: one.value) for pick in (min, max))
        return low, high


def inertias(results: Study) -> list[Finding]:
    """The mass of each specimen that has one, on each rig; the effect is the mass [kg]."""
    groups: dict[tuple[str, str], list[FoundBody]] = {}
    for body in bodies_in(results.tables):
        groups.setdefault((body.tyre, str(body.row[q.RIG.head] or "")), []).append(body)
    return [_finding(tyre, rig, bodies) for (tyre, rig), bodies in groups.items()]


def _finding(tyre: str, rig: str, bodies: list[FoundBody]) -> Finding:
    axes = q.PRESSURE.head, q.PRELOAD.head
    keys = tuple(tuple(body.place.get(column, UNSTATED) for column in axes) for body in bodies)
    where, detail = FindingConditions(("pressure", "load"), keys, Setup(rig)), Inertia(tuple(bodies))
    mass, std = bodies[0].pair(q.BELT_MASS)
    return Finding(Topic.INERTIA, q.BELT_MASS, (tyre,), Holds.MEASURED, detail, where, mass, std, unit=q.BELT_MASS.unit)


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
    bad, warned = ([row for row in rows if row["verdict"] == holds] for holds in (Holds.REJECTED, Holds.WARNING))
    doubts = [*_of_verdict(Holds.REJECTED, bad, checks), *_of_verdict(Holds.WARNING, warned, checks)]
    lost = {
        row["test"] for row in rows if row["verdict"] == Verdict.OK and row.get(q.VERDICT_ARM.head) == Verdict.REJECTED
    }
    if lost:  # K* of these is ok
        why = Reason(None, template(Code.PASSIVE_ARM, "short", Verdict.REJECTED))
        doubts.append(Finding(Topic.TRUST, None, (), Holds.WARNING, why, tests=in_order(lost)))
    # A specimen that is not linear comes first, because all other checks assume a linear one.
    doubts.sort(key=lambda finding: not (isinstance(finding.detail, Reason) and finding.detail.code is Code.LINEARITY))
    return [Finding(Topic.TRUST, None, facts.tyres, tally.holds, tally, tests=used), *doubts]


def _of_verdict(holds: Holds, rows: Sequence[Row], checks: Mapping[str, Sequence[CheckRow]]) -> list[Finding]:
    """Tests of one verdict by its reason, the commonest reason first."""
    reasons: dict[Reason, set[str]] = {}
    alike: dict[object, Reason] = {}
    for row in rows:
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
    if checks.height:
        checks = checks.filter(pl.col(q.VERDICT.head).ne_missing(Verdict.OK) | pl.col(q.STATISTIC.head).is_null())
    for key, row in zip(keys_of(checks), checks.rows(named=True), strict=True):
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


#: Dynamic stiffness is K* (ISO 10846); K2 and C are the spring and the damper of its damped arm.
_MODULUS = replace(q.MODULUS, topic=Topic.DYNAMIC, more="is dynamically the stiffer")
_ANGLE = replace(q.LOSS_ANGLE, topic=Topic.LOSS, more="has the larger loss", start="The loss angle")
_K2 = replace(q.K2, topic=Topic.DAMPING, more="has the stiffer spring in the damped arm")
#: Functions of rooms above, from `Facts` to findings, by their places.
_FURTHER = ("fourpole.paper1982.claims.claims",)
#: Effects below this are too small to matter unless they exceed so many standard uncertainties.
_SMALL, _SURE = 0.01, 3.0


def findings(results: Study) -> list[Finding]:
    """Findings of a campaign, as data.

    Parameters
    ----------
    results : Study
        Tables of an analysed campaign: `Study.results`, or `read_results` of a folder.

    Returns
    -------
    list of Finding
        One specimen gives no comparison, two values give no trend. A difference is claimed where it exceeds two
        standard uncertainties, see `fourpole.findings.trends`; otherwise `holds` says that there is none. The order
        of rows in the tables has no influence.

    Examples
    --------
    >>> from fourpole import read_results  # doctest: +SKIP
    >>> for finding in findings(read_results("campaign/results")):  # doctest: +SKIP
    ...     print(finding.kind, finding.quantity, finding.specimens, finding.holds, finding.effect, finding.std)
    """
    facts = Facts.of(results)
    trust = verdicts(facts)
    if not (facts.used_static or facts.used_dynamic):
        return trust
    quantities = (_MODULUS, _ANGLE, C, _K2, *(quantity for quantity in DERIVED if quantity.topic))
    moving = [finding for quantity in quantities for finding in _quantity(facts, quantity)]
    static = [*_quantity(facts, K1), *linearity(facts)]
    mass = inertias(results)
    further = [finding for place in _FURTHER for finding in load(place)(facts)]
    return [*trust, *mass, *static, *moving, *cycle_losses(facts), *transmissibility(facts), *further]


def by_size(findings: Sequence[Finding]) -> list[Finding]:
    """Findings as a reader wants them: within a topic the largest effects first, without those too small to matter.

    Only differences between specimens and trends have a size. One below 1 % is left out unless it exceeds three of its
    standard uncertainties. Levels come after them; other findings keep their places before them.
    """
    kept = [finding for finding in findings if not _is_small(finding)]
    topics = list(dict.fromkeys(finding.topic for finding in kept))
    return sorted(kept, key=lambda finding: (topics.index(finding.topic), -_size(finding)))


def _size(finding: Finding) -> float:
    """The size of a relative effect, 0 for a level; infinite for a finding that has none."""
    if isinstance(finding.detail, Level):
        return 0.0
    sized = finding.effect is not None and isinstance(finding.detail, Comparison | Trend)
    return abs(finding.effect or 0.0) if sized else inf


def _is_small(finding: Finding) -> bool:
    size = _size(finding)
    return not isinstance(finding.detail, Level) and size < _SMALL and size <= _SURE * (finding.std or 0.0)


def _quantity(facts: Facts, quantity: Quantity) -> list[Finding]:
    """Comparisons, levels and trends of one quantity."""
    by_tyre = facts.by_tyre(quantity)
    means = {tyre: float(np.mean([measured.value for measured in by_tyre[tyre].values()])) for tyre in by_tyre}
    findings = [compare(quantity, (a, b), (by_tyre[a], by_tyre[b])) for a, b in pairs(means)]
    for tyre, values in by_tyre.items():
        findings.append(level_of(quantity, tyre, values))
        findings += [trend_of(quantity, tyre, values, axis) for axis in quantity.over]
    return [finding for finding in findings if finding is not None]
