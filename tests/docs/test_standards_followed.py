"""The pages on standards and on other software: each standard stands in code and page, and each named file exists."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from tests.sources import PACKAGE, modules

ROOT = Path(__file__).resolve().parents[2]
FOLLOWED = ROOT / "docs" / "standards-followed.md"
OTHERS = ROOT / "docs" / "other-software.md"
#: A standard by its number, without its edition.
NUMBER = re.compile(
    r"IEEE Std \d+|JCGM \d+|ILAC-G\d+|ISO(?:/IEC)? \d+(?:-\d+)?|SAE J\d+|ASTM [A-Z]\d+|TYDEX|FMI \d\.\d|"
    r"(?:RFC|DIN|VDI|IEC) \d+"
)
#: The same standard by another word: a docstring names its number instead.
ALIAS = re.compile(r"\bGUM\b|\bGuide 98\b")


def rows():
    """Standard -> files in its row of the table."""
    found = {}
    for line in FOLLOWED.read_text(encoding="utf-8").split("\n## ")[0].splitlines():
        cells = [cell.strip() for cell in line.split(" | ")]
        number = NUMBER.match(cells[0].removeprefix("| "))
        if number and len(cells) == 4:
            found[number[0]] = re.findall(r"`([\w/]+\.py)`", cells[2])
    return found


@cache
def texts():
    """Module -> its docstrings and all other texts."""
    return {
        place: "\n".join(
            one.value for one in module.nodes if isinstance(one, ast.Constant) and isinstance(one.value, str)
        )
        for place, module in modules().items()
    }


def test_the_table_is_read():
    assert {"JCGM 100", "IEEE Std 1057", "ISO/IEC 17025", "ILAC-G8", "TYDEX", "SAE J2704"} <= set(rows())


def test_every_standard_in_the_code_has_a_row():
    known = set(rows())
    named = {place: set(NUMBER.findall(text)) for place, text in texts().items()}
    missing = {file: names - known for file, names in named.items() if names - known}
    assert not missing, f"give these a row in {FOLLOWED.name}: {missing}"


@pytest.mark.parametrize(("standard", "files"), rows().items())
def test_every_row_names_modules_that_name_the_standard(standard, files):
    assert files
    for file in files:
        path = PACKAGE / file
        assert path.is_file(), f"{standard}: there is no {file}"
        assert standard in path.read_text(encoding="utf-8"), f"{file} does not name {standard}"


def test_the_guide_is_named_by_its_number():
    nameless = [place for place, text in texts().items() if ALIAS.search(text)]
    assert not nameless, "name JCGM 100, 101 or 102 with its clause"


@pytest.mark.parametrize("page", [FOLLOWED, OTHERS], ids=lambda page: page.stem)
def test_the_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    bases = (ROOT, PACKAGE)
    for file in re.findall(r"`((?:\w+/)+\w+\.py)`", text):
        assert any((base / file).is_file() for base in bases), file
    for target in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", text):
        assert (page.parent / target).is_file(), target


def test_packages_of_the_benchmark_have_the_versions_of_their_table():
    """The versions that docs/speed.md measured are those that the page describes."""
    measured = re.search(r"^AMD.*?; (.*)\.$", (ROOT / "docs" / "speed.md").read_text(encoding="utf-8"), flags=re.M)[1]
    versions = dict(re.findall(r"(\S+) (\d[\d.]*\d)", measured))
    text = OTHERS.read_text(encoding="utf-8")
    for name, link in {
        "lmfit": "lmfit",
        "scikit-rf": "scikit-rf",
        "pyvisco": "pyvisco",
        "impedance": "impedance.py",
    }.items():
        described = re.search(rf"\[{re.escape(link)}\]\([^)]*\) ([\d.]+\d)", text)[1]
        assert described == versions[name], name
