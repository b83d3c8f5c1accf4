"""The first page of a report: what a customer needs, whatever the campaign holds."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from fourpole.core.joint.misfit import Candidate
from fourpole.core.sources import Source
from fourpole.findings.conformity import judged
from fourpole.findings.facts import Facts
from fourpole.quantities import K1, ShownUnits
from fourpole.report.digits import bar, newton, shown
from fourpole.report.front import (
    conformity_table,
    front_page,
    load_of_index,
    misfit_line,
    named_by_condition,
    short_names,
    verdict_line,
)
from fourpole.report.html import rendered
from fourpole.report.page import PARTS, render_report
from fourpole.report.rows import condition, words
from fourpole.study.rig_estimate import RigEstimate
from fourpole.study.study import Study

STATIC = pl.DataFrame(schema={"test": pl.String, "tyre": pl.String, "construction": pl.String, "verdict": pl.String})


def campaign(pressures=(1.7e5,), specimens=("A",), verdict="ok", preloads=(3000.0,), **record):
    """Results with one test at each condition."""
    rows = [
        {
            "test": f"D{at}", "tyre": name, "construction": "", "verdict": verdict, "remarks": "", "rig": "",
            "pressure [Pa]": p, "preload [N]": load, "frequency [Hz]": 14.0, "Re K* [N/m]": 2e5 + p / 10,
            "Im K* [N/m]": 5e4, "u(Re K*) [N/m]": 310.0, "u(Im K*) [N/m]": 80.0, "corr(Re,Im K*) [1]": 0.1,
            "deflection amplitude [m]": 1e-3,
        }
        for at, (name, load, p) in enumerate((n, f, p) for n in specimens for f in preloads for p in pressures)
    ]  # fmt: skip
    return Study(STATIC, pl.DataFrame(rows), record={"stated": record})


def test_a_row_is_named_by_all_of_its_condition():
    results = campaign(specimens=("A",))
    stated = {"specimens": {"A": {"load_index": "91 V", "size": "195/65 R 15", "serial": "<b>7"}}}
    page = front_page(Study(STATIC, results.dynamic, record={"stated": stated}))
    (row,) = page.table.rows
    named = (row.specimen, row.pressure, row.preload, row.frequency, row.deflection_amplitude, row.double, row.tests)
    assert named == ("A", "1.7", "3000", "14", "1", "2", 1)
    assert row.rated == f"{100 * 3000 / (615 * 9.80665):.2g}"
    storage = row.cells[[one.symbol for one in page.table.columns].index("K′")]
    assert (storage.text, storage.about) == ("217.0", "± 0.6")
    assert page.specimens[0].about == "size 195/65 R 15, load index 91 V, serial <b>7"


@pytest.mark.parametrize(("index", "kilograms"), [(0, 45), (60, 250), (91, 615), (100, 800), (140, 2500), (180, 8000)])
def test_load_indices_have_the_loads_of_the_standard(index, kilograms):
    assert load_of_index(index) == pytest.approx(kilograms * 9.80665)


def shown_page(results):
    """The first page as the template shows it."""
    return rendered({**PARTS, "page": PARTS["front"]}, front=front_page(results), front_figures=[], title="")


def test_twelve_conditions_have_a_row_each_and_more_are_ranges():
    twelve = front_page(campaign(1e5 + 1e4 * np.arange(12)))
    assert (len(twelve.table.rows), twelve.all_conditions) == (12, None)
    many = front_page(campaign(1e5 * 1.06 ** np.arange(15), preloads=(2000.0, 3000.0)))
    assert [(row.preload, row.tests) for row in many.table.rows] == [("2000", 15), ("3000", 15)]
    assert many.table.rows[0].pressure == "1–2.261"
    assert len(many.all_conditions.rows) == 30
    specimens = front_page(campaign(1e5 * 1.06 ** np.arange(15), [f"S{n}" for n in range(9)], preloads=(1e3, 2e3)))
    assert len(specimens.table.rows) == 9


def test_the_table_never_has_more_than_twelve_rows_and_says_what_it_leaves_out():
    results = campaign((1e5, 2e5), [f"S{n:02}" for n in range(40)])
    page = front_page(results)
    assert len(page.table.rows) == 12
    assert "28 more specimens stand on the second page." in shown_page(results)
    assert len(page.all_conditions.rows) == 80


def test_units_are_those_that_the_campaign_wants():
    wanted = {"units": {"pressure": "kPa", "stiffness": "N/mm"}}
    page = front_page(campaign(report=wanted))
    assert (page.table.places[0].unit, page.table.rows[0].pressure) == ("kPa", "170")
    assert [one.suffix for one in page.table.columns][:1] == ["N/mm"]


def test_without_limits_the_tests_are_counted():
    line = verdict_line(campaign(verdict="warning"), ())
    assert (line.kind, line.word) == ("warning", "1 used")
    assert "No limits are stated." in line.text


def test_the_worst_result_is_named_with_its_limit():
    results = campaign(limits=[{"quantity": "storage", "high": 2e5}, {"quantity": "loss", "high": 9e4}])
    line = verdict_line(results, judged(results))
    assert (line.kind, line.word) == ("rejected", "FAIL")
    said = (
        "1 of 2 results pass, 1 fail. K′ of A, 1.7 bar, 3000 N, 14 Hz is 217.0 ± 0.6 kN/m; the limits are −∞ to 200.0"
    )
    assert said in line.text
    table = conformity_table(results, judged(results))
    assert [row.outcome for row in table.rows] == ["fail", "pass"]
    assert "(guard band w = U; ILAC-G8:09/2019, 4.2.3)" in shown_page(results)


def test_equipment_that_ran_out_is_marked():
    listed = [{"name": "cell", "due": "2026-10-31"}, {"name": "meter", "due": "2027-01-01"}, {"name": "<i>x"}]
    page = front_page(campaign(report={"tested": "2026-11-02 to 2026-11-05", "equipment": listed}))
    assert [one.late for one in page.equipment] == ["run out when tested", "", ""]


def test_a_logo_that_is_no_image_is_left_out():
    for bad in ("http://x/y.png", "javascript:alert(1)", "data:text/html,x", 5):
        assert front_page(campaign(report={"logo": bad})).logo == ""


def test_a_campaign_without_a_dynamic_test_has_its_page():
    empty = campaign().dynamic.clear()
    assert "No test is in use" in render_report(Study(STATIC, empty), findings=(), figures={})


def test_a_pass_that_rests_on_tests_with_a_warning_says_so():
    limits = [{"quantity": "storage", "high": 3e5}]
    results = campaign(verdict="warning", limits=limits)
    held = judged(results)
    assert held[0].warned == ("D0",)
    assert "1 result rests on tests with a warning" in verdict_line(results, held).text
    assert conformity_table(results, held).rows[0].warned == "D0"
    assert "rest" not in verdict_line(campaign(limits=limits), judged(campaign(limits=limits))).text


def test_repeats_that_scatter_are_not_to_be_trusted():
    one = campaign().dynamic
    repeats = pl.concat([one, one.with_columns(pl.lit("D9").alias("test"), pl.col("Re K* [N/m]") * 1.1)])
    page = front_page(Study(STATIC, repeats))
    assert "Repeats scatter by up to 6" in page.doubts[0].text
    assert page.limits[0].startswith("The scatter of repeats makes most of U at 1 condition. Cheapest remedy:")
    assert front_page(campaign()).doubts == []


def test_a_range_with_an_open_interval_has_numbers_and_says_that_it_is_open():
    results = campaign(1e5 * 1.06 ** np.arange(15))
    table = results.dynamic.with_columns(
        pl.Series("K2 [N/m]", [7e4] * 14 + [4.9e6]), pl.Series("u(K2) [N/m]", [1e3] * 14 + [8e10])
    )
    heads = {"test": ["D14"], "quantity": ["K2"], "2.5 %": [6e4], "97.5 %": pl.Series([None], dtype=pl.Float64)}
    page = front_page(Study(STATIC, table, quantiles=pl.DataFrame(heads)))
    cell = page.table.rows[0].cells[[one.symbol for one in page.table.columns].index("K2")]
    assert (cell.text.split("–")[1], cell.about) == ("4900", "above 60")


def test_long_names_keep_both_ends_in_the_table():
    names = [f"Batch 2026-11 serial number {at:04} position left" for at in range(3)]
    page = front_page(campaign(specimens=[*names, f"{'x' * 299}7"]))
    shown = [row.name for row in page.table.rows]
    assert shown[:3] == names
    assert len(shown[3]) == 60
    assert shown[3].endswith("7")


def test_where_repeats_scatter_the_misfit_of_a_model_has_no_other_reason():
    verdict = SimpleNamespace(verdict=SimpleNamespace(possible=False))
    model = SimpleNamespace(tyre="A", discrepancy=0.07, conditions=[verdict])
    one = campaign().dynamic
    repeats = pl.concat([one, one.with_columns(pl.lit("D9").alias("test"), pl.col("Re K* [N/m]") * 1.1)])
    for table, reason in ((one, True), (repeats, False)):
        results = Study(STATIC, table, models=SimpleNamespace(models=[model]))
        said = " ".join(one.text for one in front_page(results).doubts)
        assert "by 7.0 % of |K*|" in said
        assert ("no massless, relaxing specimen" in said) == reason


def test_words_and_tables_have_the_units_that_the_campaign_wants():
    units = ShownUnits({"Pa": ("kPa", 1e3), "N": ("kgf", 9.80665), "N/m": ("N/mm", 1e3)})
    assert (bar(170e3, units), newton(9806.65, units), shown(K1, 2e5, units)) == ("170 kPa", "1000 kgf", "200 N/mm")
    row = {"K1 [N/m]": 2e5, "u(K1) [N/m]": 300.0, "pressure [Pa]": 170e3, "preload [N]": 980.665}
    assert words(K1, row, units) == "200.0 ± 0.6 N/mm"
    assert condition(row, units, dynamic=True) == "170 kPa, 100.0 kgf"
    assert bar(170e3, ShownUnits()) == "1.70 bar"


def test_each_condition_of_static_tests_alone_has_a_row():
    rows = [
        {"test": f"S{at}", "tyre": "A", "construction": "", "verdict": "ok", "pressure [Pa]": p, "preload [N]": 3000.0,
         "K1 [N/m]": 2e5 + p / 10, "u(K1) [N/m]": 500.0}
        for at, p in enumerate((1.5e5, 2e5, 2.5e5))
    ]  # fmt: skip
    page = front_page(Study(pl.DataFrame(rows), campaign().dynamic.clear()))
    assert [row.pressure for row in page.table.rows] == ["1.5", "2", "2.5"]


def test_a_rig_that_does_not_fit_leads_with_its_cause_and_what_to_do():
    results = campaign(verdict="rejected", specimens=("A", "B"))
    cause = Candidate("V2", 1.0, 0.0, "1", 9.0, Source.read("gain V2"), 1.0, "recorded", {"text": "V2 is inverted"})
    for error, of_page in ((1.0, "K* of 2 tests rests on these channels and is not shown here"), (0.0, "U below")):
        rig = RigEstimate("", fits=False, rig_error=error, candidates=(cause,), tied=1)
        line = misfit_line(results, rig)
        assert line.lead == "Rig and sensors do not fit."
        assert line.text.startswith("Best explained by V2 is inverted. ")
        assert of_page in line.text
        assert "What to do: " in line.text
        assert line.kind == ("rejected" if error else "warning")


def test_page_one_names_tests_by_what_they_have_in_common():
    facts = Facts.of(campaign((1e5, 2e5), specimens=("A", "B")))
    assert named_by_condition(facts, ["D0", "D2"]) == "the 2 tests at 1.00 bar"
    assert named_by_condition(facts, ["D3"]) == "the test of B at 2.00 bar"
    assert named_by_condition(facts, ["D0", "D3"]) == "2 of 4 tests"
    assert named_by_condition(facts, ["D0", "D1", "D2", "D3"]) == "all 4 tests"


@pytest.mark.parametrize(
    ("names", "shown"),
    [
        (["Sommer_B_1.8bar_8Hz", "Sommer_B_1.2bar_10Hz"], ["1.8bar_8Hz", "1.2bar_10Hz"]),
        (["Reifen 2026-11-02 a", "Reifen 2026-11-03 b"], ["2026-11-02 a", "2026-11-03 b"]),
        (["Kammer_-5_Grad_lang", "Kammer_-10_Grad"], ["-5_Grad_lang", "-10_Grad"]),
        (["Versuch 2,5bar", "Versuch 2,7bar"], ["2,5bar", "2,7bar"]),
        (["Wiederholung", "Wiederholung_2"], ["Wiederholung", "Wiederholung_2"]),
        (["D1", "D2"], ["D1", "D2"]),
        ([], []),
    ],
)
def test_names_lose_what_all_begin_with_but_no_part_of_a_number(names, shown):
    assert [*short_names(names).values()] == shown
