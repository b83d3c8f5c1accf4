"""The codes of the checks, their sentences and verdicts."""

import numpy as np
import pytest

from fourpole.core.checks import VERDICTS, Verdict, judged, reported, worst_verdict
from fourpole.core.codes import Code
from fourpole.core.remarks import interval_words, remark_of


@pytest.mark.parametrize("code", Code)
def test_every_code_says_what_it_looks_at_and_has_a_sentence(code):
    assert code.about
    assert Code.read(code.text) is code
    for verdict in VERDICTS:
        cause, remedy = code.says(verdict)
        assert cause
        assert not remedy or cause.endswith((": ", "; ", "{why}"))
        assert not remedy.endswith((".", " "))


def test_names_on_disk_are_unique_and_another_name_is_no_code():
    assert len({code.text for code in Code}) == len(Code)
    assert Code.read("weather") is None


def test_a_statistic_at_its_limit_is_within_it():
    low, at_warn, between, at_reject, beyond = (
        judged(Code.DISTORTION, statistic, 0.2, 0.5) for statistic in (0.1, 0.2, np.nextafter(0.2, 1), 0.5, 0.51)
    )
    verdicts = [each.verdict for each in (low, at_warn, between, at_reject, beyond)]
    assert verdicts == ["ok", "ok", "warning", "warning", "rejected"]
    assert [each.limit for each in (low, between, beyond)] == [0.2, 0.2, 0.5]


def test_a_rejection_may_have_words_of_its_own():
    assert Code.LIFT_OFF.short("rejected") != Code.LIFT_OFF.short("warning")
    assert Code.CLIPPING.short("rejected") == Code.CLIPPING.short("warning")


def test_braces_in_a_file_name_stand_as_they_are():
    assert "{0} {x}.csv" in remark_of(reported(Code.MEMORY, Verdict.REJECTED, file="{0} {x}.csv"))


def test_worst_verdict():
    assert worst_verdict([]) == "ok"
    assert worst_verdict(["ok", "ok"]) == "ok"
    assert worst_verdict(["ok", "warning"]) == "warning"
    assert worst_verdict(iter(["warning", "rejected", "ok"])) == "rejected"
    assert worst_verdict(["ok", "good", None]) == "rejected"


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (1e5, 2e5, " between 1e+05 N/m and 2e+05 N/m (95 % by Monte Carlo)"),
        (1e5, np.inf, " between 1e+05 N/m and no upper limit (95 % by Monte Carlo)"),
        (np.inf, np.inf, " without a limit"),
    ],
)
def test_an_interval_by_monte_carlo_in_words(low, high, said):
    assert interval_words(low, high, "N/m") == said


def test_the_parts_cut_off_in_words():
    start, both = (
        remark_of(reported(Code.STEADY, Verdict.OK, before=2.0, after=after, length=9.0)) for after in (0.0, 1.5)
    )
    assert start.startswith("the first 2 s (lead-in, run-up) of 9 s")
    assert both.startswith("the first 2 s (lead-in, run-up) and the last 1.5 s (run-down) of 9 s")
