"""The mass of a specimen as a finding and in words: with U, ranges over conditions, and nothing without a mass."""

from dataclasses import replace

import polars as pl
import pytest
from tests.plot.conftest import results_of
from tests.report.test_front import campaign

from fourpole import quantities as q
from fourpole.app.summary import summary_lines
from fourpole.findings import findings
from fourpole.findings.facts import findings_table
from fourpole.findings.list import inertias
from fourpole.report.front import front_page
from fourpole.report.page import render_report
from fourpole.report.words.sentence import inertia_table, sentences
from fourpole.virtual import RADIAL_PLY


def found(form="belt", pressures=(1.7e5, 2.2e5)):
    """Results with a mass at some pressures; the frequency rises with the pressure."""
    rows = [
        {
            "tyre": "A", "rig": "", "pressure [Pa]": p, "preload [N]": 3000.0, "form": form,
            **dict(zip(q.BELT_MASS.heads, (7.0, 0.1), strict=True)),
            **dict(zip(q.BELT_FREE.heads, (80.0 * p / 1.7e5, 0.5), strict=True)),
            **dict(zip(q.BELT_HELD.heads, (88.0 * p / 1.7e5, 0.6), strict=True)),
            **dict(zip(q.BELT_SHARE.heads, (0.2, 0.02) if form == "belt" else (None, None), strict=True)),
            q.BELT_EXPONENT.head: 0.1, q.BELT_EVIDENCE.head: 35.2,
        }
        for p in pressures
    ]  # fmt: skip
    results = campaign(pressures)
    return replace(results, tables={**results.tables, "specimens": pl.DataFrame(rows, infer_schema_length=None)})


def test_a_belt_is_a_finding_with_its_standard_uncertainty_and_its_conditions():
    (one,) = [each for each in findings(found()) if each.kind == "inertia"]
    assert (one.specimens, one.effect, one.std, one.unit) == (("A",), 7.0, 0.1, "kg")
    row = findings_table([one]).row(0, named=True)
    assert row["condition"] == "pressure 170000 to 220000 Pa; load 3000 N"
    assert inertias(campaign()) == []


BELT = (
    "A has a belt of 7.00 ± 0.20 kg (± is U, k = 2). With the rim held it moves at 80.0 ± 1.0 to 103.5 ± 1.0 Hz with "
    "the contact free, and at 88.0 ± 1.2 to 113.9 ± 1.2 Hz with the contact held, too. The spring at the contact has "
    "0.20 ± 0.04 times the stiffness of the spring at the rim."
)


@pytest.mark.parametrize(
    ("form", "said"), [("belt", BELT), ("rod", "A has a mass of 7.00 ± 0.20 kg, spread along it (± is U, k = 2).")]
)
def test_the_sentence_has_ranges_with_u(form, said):
    (text,) = [one.text for one in sentences(inertias(found(form)))]
    assert text.startswith(said)
    assert "nan" not in text


def test_page_one_and_the_terminal_have_it_in_a_line():
    assert front_page(found(pressures=(1.7e5,))).inertia == [
        "A: a belt of 7.00 ± 0.20 kg, 80.0 ± 1.0 Hz with the rim held"
    ]
    assert front_page(campaign()).inertia == []
    lines = summary_lines(found())
    line = "A: a belt of 7.00 ± 0.20 kg, 80.0 ± 1.0 to 103.5 ± 1.0 Hz with the rim held; K* is that of its springs"
    assert " ".join(" ".join(lines[-2:]).split()) == line
    assert max(map(len, lines)) <= 80


def test_the_table_has_a_row_for_each_condition():
    table = inertia_table(found())
    assert [(row.place, row.cells[1], row.evidence) for row in table.rows] == [
        ("1.70 bar, 3000 N", "80.0 ± 1.0 Hz", "35.2"), ("2.20 bar, 3000 N", "103.5 ± 1.0 Hz", "35.2"),
    ]  # fmt: skip
    assert inertia_table(found("rod")).rows[0].cells[3] == "–"
    assert inertia_table(campaign()) is None
    results = results_of(tyres=(RADIAL_PLY,), pressures=(1.7e5,), preloads=(3000.0,), frequencies=(14.0, 20.0))
    heavy = replace(results, tables={**results.tables, "specimens": found().tables["specimens"]})
    page = render_report(heavy, findings=sentences(inertias(heavy)), figures={})
    assert page.count('id="h-inertia"') == 1
    assert "A: a belt of 7.00 ± 0.20 kg" in page
    assert "h-inertia" not in render_report(results, findings=[], figures={})
