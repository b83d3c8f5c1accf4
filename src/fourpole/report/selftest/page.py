"""The self-test as a page to print, sign and file, and as a table for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from markupsafe import Markup

from fourpole.report.html import packaged, rendered
from fourpole.report.selftest.compared import Compared
from fourpole.report.selftest.run import SelfTest

HEADS = ("check", "function", "value", "unit", "expected", "found", "difference", "tolerance", "verdict")
#: Digits of an expected and a found number on the page; the CSV file has all.
_SHOWN = 17


def verdict_of(good: bool) -> str:
    """The verdict in one word."""
    return "pass" if good else "FAIL"


def render_selftest(test: SelfTest, laboratory: str = "", operator: str = "") -> str:
    """The page as text. Whatever is stated is escaped, and the page loads and runs nothing.

    Parameters
    ----------
    test : SelfTest
    laboratory, operator : str
        Filled in where they are stated; otherwise lines to write on.
    """
    return rendered(
        {"page": packaged("selftest.html", "fourpole.report.selftest")},
        test=test,
        laboratory=laboratory,
        operator=operator,
        when=test.when.strftime("%Y-%m-%d %H:%M:%S UTC"),
        bad=sum(not one.good for one in test.values),
        groups=_grouped(test.values),
        failing=_grouped([one for one in test.values if not one.good]),
        share=shown_share,
        verdict=verdict_of,
        style=Markup(packaged("page.css") + packaged("selftest.css", "fourpole.report.selftest")),
        version=test.origin.version,
    )


def shown_share(share: float) -> str:
    """Largest difference over tolerance, as text."""
    return f"{share:.2g}" if share < float("inf") else "no number"


def selftest_csv(test: SelfTest) -> str:
    """All values as CSV, with all their digits."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(HEADS)
    writer.writerows(_cells(one) for one in test.values)
    return file.getvalue()


def _cells(one: Compared, *, short: bool = False) -> tuple[str, ...]:
    """A value as texts, in the order of `HEADS`."""
    numbers = ("" if number is None else f"{number:.2g}" for number in (one.difference, one.tolerance))
    expected = one.expected
    if short and one.tolerance is not None and len(expected) > _SHOWN + 2:
        expected = f"{float(expected):.{_SHOWN}g}"
    return (one.check, one.function, one.value, one.unit, expected, one.found, *numbers, verdict_of(one.good))


def _grouped(values: Iterable[Compared]) -> dict[str, list[tuple[str, ...]]]:
    """The cells of some values without their check, by their check."""
    groups: dict[str, list[tuple[str, ...]]] = {}
    for one in values:
        check, *cells = _cells(one, short=True)
        groups.setdefault(check, []).append(tuple(cells))
    return groups
