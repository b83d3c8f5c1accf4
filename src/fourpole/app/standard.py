"""The command that holds results against a standard."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fourpole.answer import Answer, Part, Table
from fourpole.io.published import write_result
from fourpole.report.standards import PAGES, standard_named
from fourpole.report.standards.requirement import NOTE, Found, Requirement, Standard, answered, counts, render_standard
from fourpole.study.study import Study

_HEADS = ("requirement", "clause", "measured", "limit", "answer")


def run_standard(results: Study, folder: Path, name: str) -> Answer:
    """The requirements of a standard with their answers; writes its page beside the report."""
    standard = standard_named(name)
    found, page = answered(standard, results), folder / PAGES[standard.key]
    write_result(page, render_standard(standard, results).encode(), basis=results.dynamic_sha256)
    parts: list[Part] = [
        standard.title,
        Table(_HEADS, [(one.text, one.place, item.text, one.limit, item.answer.value) for one, item in found]),
        "",
        ", ".join(f"{count} {answer.value}" for answer, count in counts(found).items()),
        *standard.terms,
        NOTE,
        f"page: {page}",
    ]
    return Answer(parts, lambda: _document(standard, found, results, page))


def _document(standard: Standard, found: list[tuple[Requirement, Found]], results: Study, page: Path) -> dict[str, Any]:
    """The answers for programs."""
    values = standard.values(results)
    return {
        "standard": standard.key,
        "title": standard.title,
        "requirements": [
            {
                "key": one.key,
                "clause": one.clause,
                "read": one.read,
                "requirement": one.text,
                "limit": one.limit,
                "source": one.source,
                "measured": item.text,
                "answer": item.answer.value,
            }
            for one, item in found
        ],
        "terms": list(standard.terms),
        "values": [dict(zip(values.heads, row, strict=True)) for row in values.rows],
        "page": str(page),
    }
