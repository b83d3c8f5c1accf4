"""An error of V1 that nobody states, with one mass: the models show it, and it is said as a hint."""

import numpy as np
import pytest
from tests.models.one_mass import as_recorded, broad, impossible, solved, zener

from fourpole.fitting.mapping import channel_hint
from fourpole.fitting.measured import Measured
from fourpole.models.causality import check_possible

KNOWN = 2e-3


def said(seed, tyres, **wrong):
    joint, _ = solved(seed, tyres, KNOWN, count=12, **wrong)
    data = as_recorded(joint, len(tyres))
    measured = [
        Measured("tyre", {}, tuple((f"D{at}", 1) for at in range(one.count)), one, recorded=one.recorded.item())
        for one in data
    ]
    return channel_hint(measured, [check_possible(one) for one in data])


@pytest.mark.parametrize("gain", [0.94, 1.06])
def test_a_gain_of_v1_is_named_with_its_size(gain):
    text = said(0, (zener, broad), gain=gain)
    assert "gain of V1" in text
    size = float(text.split("error of ")[1].split(" %")[0])
    assert size == pytest.approx(100 * (gain - 1), abs=2.0)


@pytest.mark.thorough
@pytest.mark.sampled(6)
def test_a_delay_of_v1_is_named():
    text = said(0, (zener, broad), delay=2e-3)
    assert "delay of V1" in text
    assert float(text.split("error of ")[1].split(" µs")[0]) == pytest.approx(2000.0, rel=0.3)


@pytest.mark.thorough
@pytest.mark.sampled(6)
def test_nothing_is_said_where_all_is_possible_or_no_error_helps():
    assert said(0, (zener, broad)) == ""
    assert said(0, (impossible, impossible)) == ""


def test_nothing_is_said_without_recordings():
    (one,) = as_recorded(solved(0, (impossible,), KNOWN)[0], 1)
    measured = Measured("tyre", {}, tuple((f"D{at}", 1) for at in range(9)), one)
    verdict = check_possible(one)
    assert not verdict.possible
    assert np.isfinite(verdict.chi2)
    assert channel_hint([measured], [verdict]) == ""
