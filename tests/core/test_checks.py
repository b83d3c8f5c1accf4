"""The codes of the checks, and verdicts."""

import numpy as np
import pytest

from fourpole.core.checks import Check, Code, Verdict, judged, worst_verdict


def test_names_on_disk_are_unique_and_another_name_is_no_code():
    assert len({code.text for code in Code}) == len(Code)
    assert all(Code.read(code.text) is code for code in Code)
    assert Code.read("weather") is None


def test_a_statistic_at_its_limit_is_within_it():
    low, at_warn, between, at_reject, beyond = (
        judged(Code.DISTORTION, statistic, 0.2, 0.5) for statistic in (0.1, 0.2, np.nextafter(0.2, 1), 0.5, 0.51)
    )
    verdicts = [each.verdict for each in (low, at_warn, between, at_reject, beyond)]
    assert verdicts == ["ok", "ok", "warning", "warning", "rejected"]
    assert [each.limit for each in (low, between, beyond)] == [0.2, 0.2, 0.5]


def test_worst_verdict():
    assert worst_verdict([]) == "ok"
    assert worst_verdict(["ok", "ok"]) == "ok"
    assert worst_verdict(["ok", "warning"]) == "warning"
    assert worst_verdict(iter(["warning", "rejected", "ok"])) == "rejected"
    assert worst_verdict(["ok", "good", None]) == "rejected"


def test_a_check_that_is_ok_beyond_its_limit_fails_any_test():
    """The fixture of tests/conftest.py looks at each check that a test makes."""
    with pytest.raises(AssertionError, match="amplitudes"):
        Check(Code.AMPLITUDES, Verdict.OK, 40.0, 2.0)
    with pytest.raises(AssertionError, match="mains"):
        Check(Code.MAINS, Verdict.OK, 0.1, 1.0)
