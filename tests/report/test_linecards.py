"""The card of a test with lines, and the few lines that tables and figures show."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from fourpole import quantities as q
from fourpole.core.checks import Code
from fourpole.plot.cards import dynamic_cards, shown_rows, strided
from fourpole.report.cards import make_cards
from fourpole.report.page import render_report
from fourpole.study.study import Study
from fourpole.study.tables import CHECKS, DYNAMIC, LINES, STATIC


@pytest.fixture(scope="module")
def results():
    """Two random tests of 200 lines, the first ten of each rejected, and a sine between them."""
    frequency = np.geomspace(5.0, 200.0, 200)
    tests = ["R1"] * 200 + ["D"] + ["R2 <b>"] * 200
    count = len(tests)
    table = pl.DataFrame(
        {
            "test": tests,
            "point": [*range(1, 201), 1, *range(1, 201)],
            "tyre": ["mount"] * count,
            q.FREQUENCY.head: [*frequency, 20.0, *frequency],
            q.STORAGE.head: np.linspace(1e5, 2e5, count),
            q.STORAGE.u_head: np.full(count, 1e3),
            q.VERDICT.head: (["rejected"] * 10 + ["ok"] * 190) + ["ok"] + (["rejected"] * 10 + ["ok"] * 190),
            q.REMARKS.head: [f"F1/V1 at {5 + at} Hz is known to 40 % only" if at < 10 else "" for at in range(200)]
            + [""] + [""] * 200,
        }
    )  # fmt: skip
    dynamic = pl.concat([pl.DataFrame(schema=DYNAMIC.columns), table], how="diagonal_relaxed")
    lines = table.filter(pl.col("test") != "D").select("test", "point", q.FREQUENCY.head)
    lines = lines.with_columns(pl.lit(0.9).alias(q.COHERENCES[0].head), pl.lit(50.0).alias(q.AVERAGES.head))
    lines = pl.concat([pl.DataFrame(schema=LINES.columns), lines], how="diagonal_relaxed")
    empty = pl.DataFrame(schema=STATIC.columns)
    checks = CHECKS.of_rows(
        [{"test": "R1", "point": at + 1, "code": Code.LINE.text, "verdict": "rejected"} for at in range(10)]
    )
    return Study(static=empty, dynamic=dynamic, lines=lines, checks=checks, previews=pl.DataFrame())


def test_a_test_with_lines_has_one_card(results):
    cards, _, keys = make_cards(results)
    assert [card.test for card in cards] == ["R1", "D", "R2 <b>"]
    assert [card.key for card in cards] == ["dynamic-1", "dynamic-201", "dynamic-202"]
    assert keys == dynamic_cards(results)
    first = cards[0]
    assert first.verdict == "warning"
    assert first.condition.endswith("5.000 to 200.0 Hz, 200 lines")
    assert [panel["title"] for panel in first.body["lines"]["panels"]] == ["K\u2032 with U (k = 2)", "coherence"]
    assert len(first.body["table"]["rows"]) == 12
    assert first.body["remarks"] == ["10 of 200 lines, as: F1/V1 at 5 Hz is known to 40 % only"]
    assert ["n", "50.0"] in first.body["facts"]


def test_figures_and_tables_show_some_lines_evenly_over_log_frequency(results):
    rows = shown_rows(results)
    assert 24 < rows.size <= 301
    some = strided(results)
    assert some.dynamic.height == rows.size
    assert set(some.dynamic["verdict"]) == {"ok"}
    assert set(dynamic_cards(some)) == {"dynamic-1", "dynamic-201", "dynamic-202"}
    steps = np.diff(np.log(some.dynamic.filter(pl.col("test") == "R1")[q.FREQUENCY.head].to_numpy()))
    assert steps.max() < 2.1 * steps.min()
    assert some.lines.height == rows.size - 1


def test_the_page_holds_each_recording_once_and_says_what_is_left_out(results):
    page = render_report(results, findings=(), figures={})
    assert page.count("<details id=") == 3
    assert f"{results.dynamic.height - shown_rows(results).size} more are in dynamic.csv" in page
    assert "10 of 200 lines" in page
    assert "<b>2" not in page
    assert "R2 <b>" not in page
