"""The page of one standard: one file that opens offline."""

from __future__ import annotations

from markupsafe import Markup

from fourpole.core.checks import Verdict
from fourpole.report.html import packaged, rendered
from fourpole.report.standards.requirement import Answer, Standard, answered, counts
from fourpole.study.study import Study
from fourpole.version import VERSION

#: What the answers are worth, in the page and in the terminal.
NOTE = (
    '"Not stated" is an answer: neither a test nor the campaign tells. The wording is ours. A clause marked "not read" '
    "was not read in the standard itself; hold it against your copy before you rely on it."
)
#: Class of the badge of an answer.
_BADGES = {
    Answer.MET.value: Verdict.OK,
    Answer.NOT_MET.value: Verdict.REJECTED,
    Answer.NOT_STATED.value: Verdict.WARNING,
}


def render_standard(standard: Standard, results: Study) -> str:
    """The page as text; whatever the results state is escaped, and the page loads and runs nothing."""
    found = answered(standard, results)
    return rendered(
        {"page": packaged("standard.html", "fourpole.report.standards")},
        standard=standard,
        title=str(results.record.get("title") or "") or "Campaign without a title",
        counts=counts(found),
        requirements=found,
        badges=_BADGES,
        values=standard.values(results),
        note=NOTE,
        style=Markup(packaged("page.css")),
        version=VERSION,
    )
