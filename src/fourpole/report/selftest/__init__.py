"""The self-test: what the installed package computes, held against reference data that it carries.

`reference/vectors.json` has inputs and values with 50 digits; `reference/campaigns` has whole campaigns with their
expected results. tools/make_reference.py of the repository makes both, from physics without code of the package.

The record of the test is one of those that ISO/IEC 17025:2017, 7.11.2, asks for: software is validated before use.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib import resources
from importlib.metadata import version
from importlib.resources.abc import Traversable
from math import isfinite
from pkgutil import resolve_name
from typing import Any

import numpy as np
from markupsafe import Markup

from fourpole.core.arrays import FloatArray
from fourpole.core.chain import Geophone, HighPass, LowPass
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel, Recording
from fourpole.errors import FileError, FourpoleError
from fourpole.io.origin import Origin, origin
from fourpole.io.source import reason
from fourpole.report.html import packaged, rendered
from fourpole.study.analysis import analyse
from fourpole.study.study import Study
from fourpole.words import package_toml


@dataclass(frozen=True)
class Compared:
    """One value, expected and found.

    Attributes
    ----------
    check : str
        What is checked: the heading under which values are counted.
    function : str
        Function of the package, or campaign and test.
    value, unit : str
        Name and SI unit of the value.
    expected, found : str
        As text, because a verdict is compared as well as a number, and an expected number may have 50 digits.
    difference, tolerance : float or None
        Found less expected, and the largest difference that passes, in the unit; None for texts.
    good : bool
        Whether the value passes.
    """

    check: str
    function: str
    value: str
    unit: str
    expected: str
    found: str
    difference: float | None
    tolerance: float | None
    good: bool

    @property
    def share(self) -> float:
        """Size of the difference over the tolerance [1]; infinite for one that is no number or a wrong text."""
        if self.difference is None or not isfinite(self.difference) or not self.tolerance:
            return 0.0 if self.good else float("inf")
        return abs(self.difference) / self.tolerance


def number(check: str, function: str, value: str, unit: str, expected: str, found: float, tolerance: float) -> Compared:
    """A number held against an expected one; one that is not finite never passes."""
    difference = found - float(expected)
    good = isfinite(difference) and abs(difference) <= tolerance
    return Compared(check, function, value, unit, expected, repr(float(found)), difference, tolerance, good)


def word(check: str, function: str, value: str, expected: str, found: str) -> Compared:
    """A text held against an expected one."""
    return Compared(check, function, value, "", expected, found, None, None, found == expected)


def failed(check: str, function: str, value: str, why: str) -> Compared:
    """A value that could not be computed at all."""
    return Compared(check, function, value, "", "a value", why, None, None, False)


@dataclass(frozen=True)
class Summary:
    """All values of one check.

    Attributes
    ----------
    check : str
    count, bad : int
        Number of values, and of those that do not pass.
    largest : float [1]
        Largest difference over its tolerance.
    """

    check: str
    count: int
    bad: int
    largest: float


def summaries(found: Sequence[Compared]) -> list[Summary]:
    """The checks in their order, each with its values counted."""
    groups: dict[str, list[Compared]] = {}
    for one in found:
        groups.setdefault(one.check, []).append(one)
    return [
        Summary(check, len(rows), sum(not row.good for row in rows), max(row.share for row in rows))
        for check, rows in groups.items()
    ]


#: The objects and functions of calls.toml, which says what they are.
_CALLS: dict[str, dict[str, Any]] = package_toml("fourpole.report.selftest", "calls.toml")
#: Links of a measuring chain by their names in the cases.
_LINKS = {"low pass": LowPass, "high pass": HighPass, "geophone": Geophone}


def calculated(case: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a case by name; one with "Re" and "Im" in the case is complex."""
    function, (family, _, word) = case["function"], case["function"].rpartition(" ")
    function = function if function in _CALLS["functions"] else family
    calls = _CALLS["functions"][function]
    known, values = _Known(case, word), dict[str, Any]()
    for names, call in calls.items() if isinstance(calls, dict) else [(calls[0], [function, *calls[1:]])]:
        result = known.result(call)
        known.setdefault(names, result)
        parts = [names.format(one) for one in known["symbols"]] if "{" in names else names.split(", ")
        values |= zip(parts, _flat(result), strict=False)
    return values


class _Known(dict[str, Any]):
    """Inputs of a case, values that were calculated, and objects of calls.toml, made when they are first needed."""

    def __init__(self, case: Mapping[str, Any], word: str) -> None:
        super().__init__({**case, **case["inputs"], "word": word})
        self.update({name: np.array(series) for name, series in case.get("series", {}).items()})
        self.update({name[3:]: self[name] + 1j * self[f"Im {name[3:]}"] for name in [*self] if name[:3] == "Re "})
        if "frequency" in self:
            self["omega"] = 2 * np.pi * self["frequency"]

    def __missing__(self, name: str) -> Any:
        self[name] = self.result(_CALLS["objects"][name])
        return self[name]

    def result(self, call: Any) -> Any:
        """The result of a call or an argument; calls.toml says what they are."""
        if isinstance(call, str):
            return call[1:] if call[:1] == "=" else self[call]
        if isinstance(call, dict):
            return {key: self.result(part) for key, part in call.items() if self._is_stated(part)}
        if not isinstance(call, list):
            return call
        path, *arguments = call
        named = {key: one for part in arguments if isinstance(part, dict) for key, one in self.result(part).items()}
        if path == "of":
            owner = self.result(arguments[0])
            found = [getattr(owner, name) for name in arguments[1:]]
            return found if len(found) > 1 else found[0]
        given = [self.result(part) for part in arguments if not isinstance(part, dict)]
        if path == "list":
            return given
        if path == "inputs":
            return [self[name] for name in given[0]]
        if path[0] == ".":
            return getattr(given[0], path[1:])(*given[1:], **named)
        return resolve_name(path if path.startswith("numpy.") else f"fourpole.{path}")(*given, **named)

    def _is_stated(self, part: Any) -> bool:
        return not isinstance(part, str) or part[:1] == "=" or part in self or part in _CALLS["objects"]


def _flat(result: Any) -> Iterator[Any]:
    """The numbers of a result in their order."""
    if isinstance(result, tuple | list):
        for part in result:
            yield from _flat(part)
    else:
        yield from np.ravel(result)


def phasors_of(
    frequency: float,
    amplitudes: Sequence[complex],
    std: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    common: float = 0.0,
    frequency_std: float = 0.0,
    dof: float = np.inf,
) -> Phasors:
    """The amplitudes of a test, with noise of each and with noise that V1 and V2 have in common."""
    both = np.outer([0, 0, 1, 0, 1, 0], [0, 0, 1, 0, 1, 0]) + np.outer([0, 0, 0, 1, 0, 1], [0, 0, 0, 1, 0, 1])
    covariance = np.diag(np.repeat(std, 2) ** 2) + common**2 * both
    test = (np.array([one]) for one in (frequency, amplitudes, covariance, frequency_std, dof))
    return Phasors(*test)


def spread(covariance: FloatArray) -> list[float]:
    """Standard uncertainties of two values of a test, and their correlation."""
    one, other = np.sqrt(np.diag(covariance[0]))
    return [one, other, covariance[0, 0, 1] / (one * other)]


def recording_of(rate: float, channels: Mapping[str, Mapping[str, Any]], **samples: FloatArray) -> Recording:
    """A recording of channels with their measuring chains."""
    made = {}
    for role, stated in channels.items():
        chain = tuple(link(*stated[key]) for key, link in _LINKS.items() if key in stated)
        others = {key: value for key, value in stated.items() if key not in _LINKS}
        made[role] = Channel(samples[role], **others, chain=chain)
    return Recording(rate, made)


_EXPECTED = "expected.csv"


def reference() -> Traversable:
    """The folder of the reference data in the package."""
    return resources.files("fourpole.report.selftest").joinpath("reference")


def read_reference(*name: str) -> str:
    """The text of a file of the reference data; FileError if the installation has lost it."""
    try:
        return reference().joinpath(*name).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise FileError(
            f"{'/'.join(name)} of the reference data cannot be read ({reason(error)}): install Fourpole again"
        ) from None


def cases() -> list[dict[str, Any]]:
    """All cases of vectors.json: check, function, inputs, and values with 50 digits and their tolerances."""
    try:
        return list(json.loads(read_reference("vectors.json"))["cases"])
    except (ValueError, KeyError, TypeError):
        raise FileError("vectors.json of the reference data is damaged: install Fourpole again") from None


def compared_case(case: Mapping[str, Any]) -> Iterator[Compared]:
    """Each value of a case beside what the package finds; a fault of a function is a value that does not pass."""
    check, rows = case["check"], case["values"]
    function = f"{case['function']} ({case['about']})" if "about" in case else case["function"]
    try:
        values = calculated(case)
    except (FourpoleError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError) as error:
        yield failed(check, function, rows[0]["value"], f"{type(error).__name__}: {error}")
        return
    for row in rows:
        name = row["value"]
        value = complex(values[name[3:]] if name[:3] in ("Re ", "Im ") else values.get(name, float("nan")))
        part = value.imag if name[:3] == "Im " else value.real
        yield number(check, function, name, row["unit"], row["expected"], part, float(row["tolerance"]))


def campaign_names() -> list[str]:
    """Names of the reference campaigns."""
    folder = reference().joinpath("campaigns")
    return sorted(one.name for one in folder.iterdir() if one.is_dir()) if folder.is_dir() else []


def compared_campaign(name: str) -> Iterator[Compared]:
    """Each expected result of a reference campaign beside the one that an analysis finds; nothing is written."""
    check = f"campaign {name}"
    rows = list(csv.DictReader(read_reference("campaigns", name, _EXPECTED).splitlines()))
    if not rows:
        yield failed(check, _EXPECTED, "the table", "has no rows: install Fourpole again")
        return
    with resources.as_file(reference().joinpath("campaigns", name)) as folder:
        try:
            study = analyse(folder, route=rows[0]["route"], workers=1)
        except (FourpoleError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError) as error:
            yield failed(check, "analyse", "the analysis", f"{type(error).__name__}: {error}")
            return
    for row in rows:
        yield _compared(check, study, row)


def _compared(check: str, study: Study, row: dict[str, str]) -> Compared:
    """One row of expected.csv: the table, the value of its key column, and the column with the expected value."""
    function, value = f"{row['table']}, {row['row']}", row["column"]
    table = study.tables[row["table"]]
    wanted = [part.split("=", 1) for part in row["row"].split("; ")]  # "test=D1", or several
    found = [one for one in table.iter_rows(named=True) if all(str(one.get(head)) == text for head, text in wanted)]
    if not found or value not in table.columns:
        return failed(check, function, value, "no such row or column")
    if not row["tolerance"]:
        return word(check, function, value, row["expected"], str(found[0][value]))
    if found[0][value] is None:
        return failed(check, function, value, "blank")
    unit = value.rpartition("[")[2].rstrip("]") if "[" in value else ""
    return number(check, function, value, unit, row["expected"], float(found[0][value]), float(row["tolerance"]))


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
