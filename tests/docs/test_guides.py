"""Guides begin with their result: what stands there is what their examples print further down."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / "docs" / "how-sure-are-you.md"


def printed():
    """Name -> medians of u(K'), u(K''), u(K2), u(C) in %, as the guide's examples print them."""
    rows = re.findall(r"^([a-z][\w', ]+?) +((?:\d+\.\d+ *){8})$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: [float(cell) for cell in cells.split()][1::2] for name, cells in rows}


def table(path):
    """First cell without its links -> the percentages of the row."""
    rows = re.findall(
        r"^\| ([^|\n]*\w[^|\n]*) \|((?: [\d.]+ % \|){4})$", path.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {
        re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", name): [float(cell) for cell in re.findall(r"[\d.]+", cells)]
        for name, cells in rows
    }


def test_the_table_of_uncertainties_is_what_the_examples_print():
    found, stated = printed(), list(table(GUIDE).values())
    assert len(found) == 7
    assert len(stated) >= 5
    for row in stated:
        near = [pytest.approx(numbers, rel=0, abs=0.05 if row[0] > 1 else 0.0005) for numbers in found.values()]
        assert row in near


def test_getting_started_names_what_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    stated = re.search(r"are installed with it: ([\w\s,]+)\.", page)[1]
    assert set(re.split(r",\s|\sand\s", stated)) == {Requirement(text).name for text in project["dependencies"]}
    extras = {name for row in re.findall(r"^\| (`.+`) \|", page, re.M) for name in re.findall(r"`(\w+)`", row)}
    assert extras == set(project["optional-dependencies"]) - {"bench", "dev", "docs", "test"}


def test_examples_stand_in_fences():
    """Outside of a fence a prompt is three quotations, one within the other."""
    fence = re.compile(r"^(```+|~~~+).*?^\1`*[ \t]*$", re.MULTILINE | re.DOTALL)
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    loose = [page.name for page in pages if re.search(r"^>>>", fence.sub("", page.read_text(encoding="utf-8")), re.M)]
    assert loose == []
