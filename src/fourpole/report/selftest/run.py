"""The whole self-test: its values, the machine, the hashes of the reference data; the page to sign and the table.

Its record is one of those that ISO/IEC 17025:2017, 7.11.2, asks for: software is validated before it is used.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import platform
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from importlib.resources.abc import Traversable

from markupsafe import Markup

from fourpole.io.origin import Origin, origin
from fourpole.report.html import packaged, rendered
from fourpole.report.selftest.cases import (
    Compared,
    Summary,
    campaign_names,
    cases,
    compared_campaign,
    compared_case,
    reference,
    summaries,
)

#: Packages that the results depend on.
_PACKAGES = ("numpy", "scipy", "polars", "pint", "pydantic", "matplotlib", "jinja2", "typer", "rich")


@dataclass(frozen=True)
class SelfTest:
    """The outcome of a self-test.

    Attributes
    ----------
    values : tuple of Compared
    origin : Origin
        The Fourpole that was tested.
    when : datetime
        Time at which the test began, in UTC.
    machine, system, python : str
    packages : dict of str to str
        Version of each package that the results depend on.
    sha256 : dict of str to str
        Hash of vectors.json and of each reference campaign.
    """

    values: tuple[Compared, ...]
    origin: Origin
    when: datetime
    machine: str = field(
        default_factory=lambda: f"{platform.node()} ({platform.machine()}, {os.cpu_count()} processors)"
    )
    system: str = field(default_factory=platform.platform)
    python: str = field(default_factory=lambda: f"{platform.python_implementation()} {platform.python_version()}")
    packages: dict[str, str] = field(default_factory=lambda: {name: version(name) for name in _PACKAGES})
    sha256: dict[str, str] = field(default_factory=lambda: dict(_hashes()))

    @property
    def good(self) -> bool:
        """Whether every value passes."""
        return all(one.good for one in self.values)

    @property
    def summaries(self) -> list[Summary]:
        """The checks with their values counted."""
        return summaries(self.values)


def self_test(progress: Callable[[int, int], None] | None = None) -> SelfTest:
    """Run all checks; nothing is written, and nothing outside the package is read.

    Parameters
    ----------
    progress : callable, optional
        Called with the number of cases and campaigns that are done, and of all.

    Returns
    -------
    SelfTest
    """
    when = datetime.now(UTC)
    jobs = [partial(compared_case, case) for case in cases()]
    jobs += [partial(compared_campaign, name) for name in campaign_names()]
    found: list[Compared] = []
    for done, job in enumerate(jobs, start=1):
        found += job()
        if progress is not None:
            progress(done, len(jobs))
    return SelfTest(tuple(found), origin(), when)


def _hashes() -> Iterator[tuple[str, str]]:
    """Hash of each part of the reference data; that of a campaign is over the names and contents of its files."""
    folder = reference()
    yield "vectors.json", hashlib.sha256(folder.joinpath("vectors.json").read_bytes()).hexdigest()
    for name in campaign_names():
        digest = hashlib.sha256()
        for path, file in sorted(_files(folder.joinpath("campaigns", name))):
            digest.update(f"{path} {hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
        yield f"campaigns/{name}", digest.hexdigest()


def _files(folder: Traversable, within: str = "") -> Iterator[tuple[str, Traversable]]:
    """All files below a folder, by their paths in it."""
    for one in folder.iterdir():
        if one.is_dir():
            yield from _files(one, f"{within}{one.name}/")
        else:
            yield f"{within}{one.name}", one


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
