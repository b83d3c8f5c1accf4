"""The reference campaigns: analysed from the package, and held against their expected results."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

from fourpole.errors import FourpoleError
from fourpole.report.selftest.compared import Compared, failed, number, word
from fourpole.report.selftest.vectors import read_reference, reference
from fourpole.study.analysis import analyse
from fourpole.study.study import Study

_EXPECTED = "expected.csv"


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
            study = _analysed(folder, rows[0]["route"])
        except (FourpoleError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError) as error:
            yield failed(check, "analyse", "the analysis", f"{type(error).__name__}: {error}")
            return
    for row in rows:
        yield _compared(check, study, row)


def _analysed(folder: Path, route: str) -> Study:
    """The study of a campaign, in this thread."""
    return analyse(folder, route=route, workers=1)


def _compared(check: str, study: Study, row: dict[str, str]) -> Compared:
    """One row of expected.csv: the table, the value of its key column, and the column with the expected value."""
    function, value = f"{row['table']}, {row['row']}", row["column"]
    table = study.tables[row["table"]]
    found = [one for one in table.iter_rows(named=True) if _is_row(one, row)]
    if not found or value not in table.columns:
        return failed(check, function, value, "no such row or column")
    if not row["tolerance"]:
        return word(check, function, value, row["expected"], str(found[0][value]))
    if found[0][value] is None:
        return failed(check, function, value, "blank")
    unit = value.rpartition("[")[2].rstrip("]") if "[" in value else ""
    return number(check, function, value, unit, row["expected"], float(found[0][value]), float(row["tolerance"]))


def _is_row(one: dict[str, Any], row: dict[str, str]) -> bool:
    """Whether a row of a table is the one that is meant: "test=D1", or several with blanks between them."""
    wanted = (part.split("=", 1) for part in row["row"].split("; "))
    return all(str(one.get(head)) == value for head, value in wanted)
