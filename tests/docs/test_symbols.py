"""The page of symbols: its columns are those of the result tables, its names in Python exist, its units agree."""

import re
from importlib import import_module
from pathlib import Path

import pytest

import fourpole
from fourpole.core.identify import Identification
from fourpole.core.joint.solve import Solution
from fourpole.core.loadcurve import Tangent
from fourpole.core.rig import PARAMETERS
from fourpole.models.ramp import Loop, Ramp
from fourpole.quantities import COHERENCES, ESTIMATES, QUANTITIES

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "symbols.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line.startswith("| ")]
HOMES = {"Identification": Identification, "Tangent": Tangent, "Solution": Solution, "Ramp": Ramp, "Loop": Loop}
CODE = re.compile(r"`([^`]+)`")


def test_every_column_is_one_of_the_result_tables():
    heads = {head for one in QUANTITIES for head in one.heads}
    heads |= {one.head for one in COHERENCES} | {part for one in ESTIMATES for part in one.parts}
    named = [code for code in CODE.findall(PAGE) if re.search(r" \[.+\]$", code)]
    assert len(named) > 20
    assert [code for code in named if code not in heads and code != "added_mass [kg]"] == []  # that is of tests.csv
    units = {head: one.unit for one in QUANTITIES for head in one.heads}
    off = [
        row for row in ROWS if len(row) == 5 for code in CODE.findall(row[3]) if code in units and units[code] != row[2]
    ]
    assert off == []


@pytest.mark.parametrize("name", sorted({code for row in ROWS for code in CODE.findall(row[-1]) if "." in code}))
def test_every_name_in_python_exists(name):
    first, _, rest = name.partition(".")
    if first == "core":
        module, _, last = name.rpartition(".")
        assert hasattr(import_module(f"fourpole.{module}"), last)
    elif first == "stiffness":
        assert rest in ("real", "imag")
    else:
        home = HOMES.get(first) or getattr(fourpole, first)
        assert hasattr(home, rest) or rest in getattr(home, "__dataclass_fields__", {})


def test_every_part_of_a_rig_is_there():
    assert [name for name in PARAMETERS if f"`{name}`" not in PAGE] == []
