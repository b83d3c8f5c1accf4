"""The commands that hold results against a standard, and this installation against reference data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, progress, warn
from fourpole.errors import FileError
from fourpole.io.published import write_result
from fourpole.io.write import beside, write_text
from fourpole.report.selftest.cases import Compared
from fourpole.report.selftest.run import SelfTest, render_selftest, self_test, selftest_csv, shown_share, verdict_of
from fourpole.report.standards import PAGES, standard_named
from fourpole.report.standards.measures import NOTE, Found, Requirement, Standard, answered, counts, render_standard
from fourpole.study.study import Study

_REQUIREMENT_HEADS = ("requirement", "clause", "measured", "limit", "answer")


def run_standard(results: Study, folder: Path, name: str) -> Answer:
    """The requirements of a standard with their answers; writes its page beside the report."""
    standard = standard_named(name)
    found, page = answered(standard, results), folder / PAGES[standard.key]
    write_result(page, render_standard(standard, results).encode(), basis=results.dynamic_sha256)
    parts: list[Part] = [
        standard.title,
        Table(
            _REQUIREMENT_HEADS, [(one.text, one.place, item.text, one.limit, item.answer.value) for one, item in found]
        ),
        "",
        ", ".join(f"{count} {answer.value}" for answer, count in counts(found).items()),
        *standard.terms,
        NOTE,
        f"page: {page}",
    ]
    return Answer(parts, lambda: _standard_document(standard, found, results, page))


def _standard_document(
    standard: Standard, found: list[tuple[Requirement, Found]], results: Study, page: Path
) -> dict[str, Any]:
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


_PAGES = (".html", ".htm")
_CHECK_HEADS = ("check", "values", "difference over tolerance", "verdict")
_MOST_NAMED = 12


def run_selftest(file: Path | None = None, laboratory: str = "", operator: str = "") -> Answer:
    """Run the self-test and write page and table; exit code `SOME_REJECTED` if a value fails."""
    if file is not None and file.suffix.lower() not in _PAGES:
        raise FileError(f"{file}: the page is HTML: name a file that ends in .html; a table is written beside it")
    with progress("checking") as advance:
        test = self_test(advance)
    files = _written(test, file, laboratory, operator) if file is not None else []
    return Answer(_show(test, files), lambda: _selftest_document(test, files), code=OK if test.good else SOME_REJECTED)


def _written(test: SelfTest, page: Path, laboratory: str, operator: str) -> list[Path]:
    """Write the page, and the table of the same name beside it."""
    table = page.with_suffix(".csv")
    with beside(table) as new:
        write_text(new, selftest_csv(test))
        write_text(page, render_selftest(test, laboratory, operator))
    return [page, table]


def _show(test: SelfTest, files: list[Path]) -> Iterator[Part]:
    rows = [(one.check, str(one.count), shown_share(one.largest), verdict_of(not one.bad)) for one in test.summaries]
    yield Table(_CHECK_HEADS, rows, right=_CHECK_HEADS[1:3])
    bad = [one for one in test.values if not one.good]
    for one in bad[:_MOST_NAMED]:
        warn(f"{one.check}: {one.function}, {one.value}: {_difference(one)}")
    if len(bad) > _MOST_NAMED:
        warn(f"... and {len(bad) - _MOST_NAMED} more")
    yield ""
    passed = f"{len(test.values)} values, all pass" if test.good else f"{len(bad)} of {len(test.values)} values fail"
    yield f"Fourpole {test.origin.text}: {passed}"
    for path in files:
        yield f"written: {path}"


def _difference(one: Compared) -> str:
    """What was expected and found of a value that fails."""
    if one.difference is None:
        return f"expected {one.expected}, found {one.found}"
    unit = f" {one.unit}" if one.unit not in ("", "1") else ""
    return f"differs by {one.difference:.3g}{unit}, tolerance {one.tolerance:.2g}"


def _selftest_document(test: SelfTest, files: list[Path]) -> dict[str, Any]:
    """The test for programs."""
    return {
        "good": test.good,
        "fourpole": test.origin.record,
        "when": test.when.isoformat(timespec="seconds"),
        "machine": test.machine,
        "system": test.system,
        "python": test.python,
        "packages": test.packages,
        "sha256": test.sha256,
        "checks": [
            {"check": one.check, "values": one.count, "failed": one.bad, "largest": one.largest}
            for one in test.summaries
        ],
        "failed": [vars(one) for one in test.values if not one.good],
        "files": [str(path) for path in files],
    }
