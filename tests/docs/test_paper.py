"""The paper has the sections, the length and the references that its journal asks for."""

import re
from pathlib import Path

PAPER = Path(__file__).parents[2] / "paper"
#: The sections in the order of the journal's guide for authors.
SECTIONS = [
    *("Summary", "Statement of need", "State of the field", "Software design", "Research impact statement"),
    *("AI usage disclosure", "Acknowledgements", "References"),
]


def body():
    """The text below the metadata."""
    return (PAPER / "paper.md").read_text(encoding="utf-8").split("---\n", 2)[2]


def test_the_paper_has_the_sections_in_their_order():
    assert re.findall(r"^# (.+)$", body(), re.MULTILINE) == SECTIONS


def test_the_paper_has_the_length_that_is_asked_for():
    assert 750 <= len(body().split()) <= 1750


def test_each_reference_is_cited_and_each_citation_has_its_reference():
    held = re.findall(r"^@\w+\{(\w+),", (PAPER / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(held) == sorted(set(held))
    assert set(re.findall(r"@(\w+)", body())) == set(held)
