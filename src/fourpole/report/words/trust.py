"""Which tests not to trust, and why."""

from __future__ import annotations

from collections.abc import Mapping

import polars as pl

from fourpole.report.words.facts import Facts, Finding, natural
from fourpole.report.words.phrases import counted, some

__all__ = ["trust"]

_MOST_NAMED = 10
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


def trust(facts: Facts) -> list[Finding]:
    """How many tests were used, and the rejected and warned ones by reason."""
    verdicts: dict[str, str] = {}
    reasons: dict[str, dict[str, set[str]]] = {"rejected": {}, "warning": {}}
    for row in pl.concat([table.select("test", "verdict", "remarks") for table in facts.tables]).rows():
        test, verdict, remarks = row
        if verdict == "rejected" or verdicts.get(test) != "rejected":
            verdicts[test] = verdict if verdict != "ok" else verdicts.get(test, "ok")
        if verdict in reasons:
            for reason in _reasons(remarks or ""):
                reasons[verdict].setdefault(reason, set()).add(test)
    counts = {verdict: sum(v == verdict for v in verdicts.values()) for verdict in ("ok", "warning", "rejected")}
    return [Finding("trust", _overall(counts)), *_grouped(reasons)]


def _overall(counts: Mapping[str, int]) -> str:
    total = sum(counts.values())
    if not total:
        return "The campaign has no tests."
    if counts["rejected"] == total:
        return (
            f"None of the {counted(total, 'test')} could be used: all were rejected."
            if total > 1
            else ("The only test was rejected, so nothing can be said of it.")
        )
    if counts["ok"] == total:
        return (
            f"All {total} tests were used without a warning."
            if total > 1
            else "The only test was used without a warning."
        )
    used = total - counts["rejected"]
    return (
        f"Of {counted(total, 'test')} {used} could be used, {counts['warning']} of them with a warning; "
        f"{counts['rejected'] or 'none'} {'was' if counts['rejected'] <= 1 else 'were'} rejected."
    )


def _grouped(reasons: Mapping[str, Mapping[str, set[str]]]) -> list[Finding]:
    said = {"rejected": "Do not trust", "warning": "Use with care"}
    findings = []
    for verdict, by_reason in reasons.items():
        for reason, tests in sorted(by_reason.items(), key=lambda item: (-len(item[1]), item[0])):
            names = tuple(sorted(tests, key=natural))
            of = f" ({len(names)} tests)" if len(names) > _MOST_NAMED else ""
            text = f"{said[verdict]} {some(names, _MOST_NAMED)}{of}: {reason}."
            findings.append(Finding("trust", text, names))
    return findings


def _reasons(remarks: str) -> list[str]:
    """The reasons in the remarks of a test; where none is known, the remarks' own beginning."""
    found = [reason for sign, reason in _REASONS if sign in remarks]
    if found:
        return found
    first = remarks.split("; ", maxsplit=1)[0].rstrip(".")
    if len(first) > _LONGEST:
        first = first[:_LONGEST].rstrip() + " ..."
    return [first or "no reason is given"]
