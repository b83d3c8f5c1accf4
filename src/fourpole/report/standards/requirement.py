"""A requirement of a standard as data: clause, source, limit and how results answer it; and the page of a standard."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from markupsafe import Markup

from fourpole.core.checks import Verdict
from fourpole.report.html import packaged, rendered
from fourpole.study.study import Study
from fourpole.version import VERSION

#: What standards.toml says: a note, the words of what is measured, and the standards by their names.
STATED: dict[str, Any] = tomllib.loads(packaged("standards.toml", "fourpole.report.standards"))
#: What the answers are worth, in the page and in the terminal.
NOTE: str = STATED["note"]


class Answer(StrEnum):
    """Whether a requirement is met."""

    MET = "met"
    NOT_MET = "not met"
    NOT_STATED = "not stated"


@dataclass(frozen=True)
class Found:
    """What the results say of a requirement: the measured value in words, and the answer."""

    text: str
    answer: Answer


@dataclass(frozen=True)
class Requirement:
    """One requirement of a standard.

    Attributes
    ----------
    key : str
        Its name in JSON.
    clause : str
        Number of the clause; empty where it is not known.
    text : str
        The requirement in words of our own.
    limit : str
        The limit in words; empty where there is none, or it is not known.
    source : str
        Where clause, text and limit are from.
    measure : callable
        What the results say of it, with further arguments.
    given : tuple
        Those arguments.
    read : bool
        Whether the clause was read in the standard itself.
    """

    key: str
    clause: str
    text: str
    limit: str
    source: str
    measure: Callable[..., Found]
    given: tuple[Any, ...] = ()
    read: bool = False

    @property
    def place(self) -> str:
        """The clause with a mark if it was not read: "6.1, not read", or "clause not read"."""
        if not self.clause:
            return "clause not read"
        return self.clause if self.read else f"{self.clause}, not read"

    @property
    def origin(self) -> str:
        """Where the requirement is from."""
        return self.source if self.read else f"from secondary sources: {self.source}"


@dataclass(frozen=True)
class ValueTable:
    """The standard's own quantities: heads with units, and a row of texts for each condition."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Standard:
    """One standard.

    Attributes
    ----------
    key : str
        Its name in the command, as "sae-j1085".
    title : str
    terms : tuple of str
        How its quantities follow from those of Fourpole, as sentences.
    requirements : tuple of Requirement
    values : callable
        Its own quantities of the results.
    """

    key: str
    title: str
    terms: tuple[str, ...]
    requirements: tuple[Requirement, ...]
    values: Callable[[Study], ValueTable]


def answered(standard: Standard, results: Study) -> list[tuple[Requirement, Found]]:
    """Each requirement with what the results say of it."""
    return [(one, one.measure(results, *one.given)) for one in standard.requirements]


def counts(found: Sequence[tuple[Requirement, Found]]) -> dict[Answer, int]:
    """Number of requirements by answer."""
    return {answer: sum(one.answer is answer for _, one in found) for answer in Answer}


#: Class of the badge of an answer.
_BADGES = dict(zip(Answer, (Verdict.OK, Verdict.REJECTED, Verdict.WARNING), strict=True))


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
