"""Sentences on the number of tests used, and on rejected and warned tests."""

from __future__ import annotations

from fourpole.findings.finding import Finding, Holds
from fourpole.findings.verdicts import Doubt, Tally
from fourpole.report.words.phrases import counted, some

#: Tests that one sentence names; more are counted.
_MOST_NAMED = 10


def tally(finding: Finding, found: Tally) -> str:
    """The number of tests used, with a warning, and rejected, as a sentence."""
    many = found.total > 1
    if finding.holds is Holds.NO_TESTS:
        return "The campaign has no tests."
    if finding.holds is Holds.NONE_USED:
        if not many:
            return "The only test was rejected, so nothing can be said of it."
        return f"None of the {counted(found.total, 'test')} could be used: all were rejected."
    if finding.holds is Holds.ALL_USED:
        return f"{f'All {found.total} tests were' if many else 'The only test was'} used without a warning."
    return (
        f"Of {counted(found.total, 'test')} {found.total - found.rejected} could be used, {found.warning} of them with "
        f"a warning; {found.rejected or 'none'} {'was' if found.rejected <= 1 else 'were'} rejected."
    )


def doubt(finding: Finding, found: Doubt) -> str:
    """The tests that were rejected, or used with a warning, for one reason, as a sentence."""
    advice = "Do not trust" if finding.holds is Holds.REJECTED else "Use with care"
    count = len(finding.tests)
    of = f" ({count} tests)" if count > _MOST_NAMED else ""
    reason = found.code.short(finding.holds) if found.code else found.remark
    return f"{advice} {some(finding.tests, _MOST_NAMED)}{of}: {reason}."
