"""The reference cases and campaigns: read from the package, and held against what it finds."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from fourpole.errors import FileError, FourpoleError
from fourpole.io.source import reason
from fourpole.report.selftest.calculated import calculated
from fourpole.report.selftest.compared import Compared, failed, number, word
from fourpole.study.analysis import analyse
from fourpole.study.study import Study

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
