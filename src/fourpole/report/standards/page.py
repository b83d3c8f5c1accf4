"""The page of one standard: one file that opens offline."""

from __future__ import annotations

import re
from importlib import resources

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from fourpole.report.standards.requirement import Answer, Standard, answered, counts
from fourpole.study.results import Results
from fourpole.version import VERSION

#: What the answers are worth, in the page and in the terminal.
NOTE = (
    '"Not stated" is an answer: neither a test nor the campaign tells. The wording is ours. A clause marked "not read" '
    "was not read in the standard itself; hold it against your copy before you rely on it."
)
#: Class of the badge of an answer.
_BADGES = {Answer.MET.value: "ok", Answer.NOT_MET.value: "rejected", Answer.NOT_STATED.value: "warning"}
#: Characters that a page must not contain: control characters and lone surrogates.
_UNFIT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def render_standard(standard: Standard, results: Results) -> str:
    """The page as text; whatever the results state is escaped, and the page loads and runs nothing."""
    found = answered(standard, results)
    environment = Environment(
        loader=DictLoader({"page": _part("fourpole.report.standards", "standard.html")}),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("page").render(
        standard=standard,
        title=str(results.record.get("title") or "") or "Campaign without a title",
        counts=counts(found),
        requirements=found,
        badges=_BADGES,
        values=standard.values(results),
        note=NOTE,
        style=Markup(_part("fourpole.report", "page.css")),
        version=VERSION,
    )
    return _UNFIT.sub("\ufffd", text)


def _part(package: str, name: str) -> str:
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")
