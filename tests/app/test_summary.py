"""The table with which an analysis ends: within 80 columns and 25 lines, no number cut, ranges of many conditions."""

from dataclasses import replace

import pytest

from fourpole import analyse
from fourpole.app.summary import summary_lines
from fourpole.findings.facts import Estimate
from fourpole.findings.summary import SUMMARISED, SummaryRow
from fourpole.study.study import Study
from fourpole.virtual import simulate_campaign

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def lines_of(tmp_path_factory):
    def of(**stated):
        folder = tmp_path_factory.mktemp("campaign") / "c"
        simulate_campaign(folder, frequencies=[14.0], **stated)
        return summary_lines(analyse(folder))

    return of


@pytest.mark.parametrize("pressures", [[170e3], [130e3, 170e3, 210e3], [130e3 + 10e3 * n for n in range(9)]])
@pytest.mark.sampled(3)
def test_the_table_fits_a_terminal(lines_of, pressures):
    lines = lines_of(pressures=pressures, preloads=[1000.0])
    assert len(lines) <= 22
    assert max(map(len, lines)) <= 80
    ranges = 2 * len(pressures) > 12
    about = ", lowest to highest of all conditions" if ranges else "; ± is U (k = 2)"
    alike = {1: ", 1.7 bar, 1000 N", 9: ", 1000 N"}.get(len(pressures), "")  # a specimen has one row there
    assert lines[0] == f"At 14 Hz{alike}{about}:"
    conditions = [line for line in lines[2:] if line.startswith("cross" if alike else " ") and "[" not in line]
    assert conditions
    assert len(conditions) % (1 if alike else 2 * len(pressures)) == 0
    for line in conditions:
        assert "…" not in line
        assert ("±" in line) == (not ranges)
    heads = " ".join(line for line in lines if "[" in line)
    assert [part in heads for part in ("K1 [kN/m]", "|K*| [kN/m]", "δ [°]", "K2 [kN/m]", "C [N s/m]")] == [True] * 5


def test_many_specimens_have_a_line_each_as_far_as_they_fit(monkeypatch):
    known = {one.key: (Estimate(1.2345e5, 321.0),) * 2 for one in SUMMARISED}
    one = SummaryRow("", (2e5, 2e5), (3e3, 3e3), None, None, (15.0, 15.0), ("D1",), known, {})
    rows = tuple(replace(one, specimen=f"tyre {at} {'x' * 30} <{at}>") for at in range(60))
    monkeypatch.setattr("fourpole.app.summary.summary", lambda *_, **__: rows)
    lines = summary_lines(Study())
    assert len(lines) <= 22
    assert max(map(len, lines)) <= 80
    assert lines[0] == "At 15 Hz, 2 bar, 3000 N; ± is U (k = 2):"
    assert lines[-1].startswith("... and ")
    assert sum("tyre 3 " in line for line in lines) == sum("[" in line for line in lines)


def test_names_that_differ_in_the_middle_stay_apart(monkeypatch):
    known = {one.key: (Estimate(1.2345e5, 321.0),) * 2 for one in SUMMARISED}
    one = SummaryRow("", (2e5, 2e5), (3e3, 3e3), None, None, (15.0, 15.0), ("D1",), known, {})
    names = [f"Batch 2026-11\nserial number {at:04d} position left" for at in range(40)]
    monkeypatch.setattr("fourpole.app.summary.summary", lambda *_, **__: [replace(one, specimen=n) for n in names])
    lines = summary_lines(Study())
    assert len(lines) <= 22
    assert not any("\n" in line for line in lines)
    assert lines.count("Batch 2026-11 serial number 0003 position left") == 1


def test_static_tests_alone_end_with_k1(monkeypatch):
    value = Estimate(1.8e5, 500.0)
    one = SummaryRow("a", (2e5,) * 2, (3e3,) * 2, None, None, None, ("S1",), {"k1": (value,) * 2}, {"k1": 500.0})
    monkeypatch.setattr("fourpole.app.summary.summary", lambda *_, **__: [one])
    text = " ".join(summary_lines(Study()))
    assert "Static tests" in text
    assert "180.0±1.0" in text


def test_a_range_with_a_value_without_an_upper_limit_has_no_zero(monkeypatch):
    ends = (Estimate(7.1e4, 5e3), Estimate(4.9e6, 8e10))
    one = SummaryRow("a", (2e5, 3e5), (3e3,) * 2, None, None, (15.0, 15.0), ("D1", "D2"), {"k2": ends}, {"k2": 8e10})
    monkeypatch.setattr("fourpole.app.summary.summary", lambda *_, **__: [one])
    assert " ".join(summary_lines(Study())).split()[-1] == "71..4900"
