"""The command that compares two runs or two specimens."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fourpole.answer import Answer, Part, Table
from fourpole.errors import CampaignError
from fourpole.findings.compared import DIFFERS, NOT_SEEN, Comparison, compare
from fourpole.io.write import write_table, write_text
from fourpole.report.compared import outcome, render_compared, shown_rows

#: Rows that the terminal shows of each verdict.
_MOST = 20


def run_compare(
    first: Path,
    second: Path | None,
    specimens: tuple[str, str] | None,
    file: Path | None,
    page: Path | None,
    *,
    independent: bool,
) -> Answer:
    """The differences, the largest first; all rows and the page are written where they are wanted."""
    if file is not None and file.suffix.lower() != ".csv":
        raise CampaignError(f"--out {file}: the file of all rows is CSV: name it FILE.csv; --page is the HTML page")
    compared = compare(first, second, specimens=specimens, independent=independent)
    if file is not None:
        write_table(file, compared.rows)
    if page is not None:
        write_text(page, render_compared(compared))
    files = [(what, path) for what, path in (("rows", file), ("page", page)) if path is not None]
    return Answer(_show(compared), lambda: _document(compared), files)


def _show(compared: Comparison) -> Iterator[Part]:
    rows = shown_rows(compared)
    yield f"{compared.names[1]} less {compared.names[0]}; ± is U (k = 2), z the difference over u"
    for seen, heading in ((True, DIFFERS), (False, NOT_SEEN)):
        part = [row for row in rows if row.seen is seen]
        if part:
            yield ""
            yield f"{heading} ({len(part)} of {len(rows)}):"
            cells = [(row.where, row.quantity, row.first, row.second, row.difference, row.z) for row in part[:_MOST]]
            heads = ("condition", "of", *map(_short, compared.names), "difference", "z")
            yield Table(heads, cells, right=heads[2:])
            if len(part) > _MOST:
                yield f"... and {len(part) - _MOST} more with smaller ratios: --out FILE.csv, --page FILE.html"
    yield ""
    yield outcome(compared)
    yield from compared.common


def _short(name: str) -> str:
    """A name of a column, as narrow as its numbers."""
    return name if len(name) <= 8 else f"{name[:7]}…"


def _document(compared: Comparison) -> dict[str, Any]:
    """The comparison for programs, in SI."""
    return {
        "first": compared.names[0],
        "second": compared.names[1],
        "common": list(compared.common),
        "beyond": compared.beyond,
        "rows": compared.rows.to_dicts(),
    }
