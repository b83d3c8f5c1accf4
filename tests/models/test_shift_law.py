"""WLF and Arrhenius by their shift factors: constants, intervals, choice, another reference temperature."""

import numpy as np
import pytest
from tests.models.isotherms import C1, C2, log_a

from fourpole.errors import ModelError
from fourpole.models.shift_law import GAS_CONSTANT, ShiftLaw, fit_laws

T = np.array([-10.0, 0.0, 10.0, 20.0, 35.0, 50.0, 65.0])
AT = 3


def drawn(rng, values, correlated=0.02):
    """Shift factors with the errors of a chain of overlaps: steps add up from the reference."""
    count = T.size
    steps = np.zeros((count, count))
    for at in range(count):
        steps[at, min(at, AT) : max(at, AT)] = np.sign(at - AT) * correlated
    return values + steps @ rng.standard_normal(count), steps @ steps.T


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_the_intervals_of_the_constants_hold_in_95_of_100():
    rng = np.random.default_rng(11)
    hits, runs = np.zeros(2), 60
    for _ in range(runs):
        values, covariance = drawn(rng, log_a(T), 0.05)
        law = next(one for one in fit_laws(T, values, covariance, AT).laws if one.name == "WLF")
        hits += (law.intervals[:, 0] <= [C1, C2]) & (law.intervals[:, 1] >= [C1, C2])
    assert np.all(np.abs(hits / runs - 0.95) < 3.3 * np.sqrt(0.95 * 0.05 / runs))


def test_the_law_that_made_the_shift_factors_is_chosen():
    rng = np.random.default_rng(5)
    choice = fit_laws(T, *drawn(rng, log_a(T)), AT)
    assert (choice.best.name, choice.decided) == ("WLF", True)
    energy = 120e3 / GAS_CONSTANT * (1 / (T + 273.15) - 1 / 293.15)
    choice = fit_laws(T, *drawn(rng, energy), AT)
    arrhenius = next(one for one in choice.laws if one.name == "Arrhenius")
    assert choice.best is arrhenius or not choice.decided
    assert abs(arrhenius.values[0] - 120e3) < 4 * arrhenius.std[0]
    assert arrhenius.intervals[0, 0] < 120e3 < arrhenius.intervals[0, 1]


def test_shift_factors_that_tell_nothing_leave_it_open():
    choice = fit_laws(T, *drawn(np.random.default_rng(8), log_a(T), 2.0), AT)
    assert not choice.decided


def test_another_reference_temperature_gives_the_same_ratios():
    law = ShiftLaw("WLF", 20.0, np.array([C1, C2]), np.array([[0.1, 1.0], [1.0, 12.0]]))
    moved = law.at_reference(-10.0)
    assert moved.log_a(50.0) == pytest.approx(law.log_a(50.0) - law.log_a(-10.0))
    # The uncertainty of a ratio does not depend on the reference: here between -10 and 20 degC.
    assert moved.log_a_std(20.0) == pytest.approx(law.log_a_std(-10.0))
    with pytest.raises(ModelError, match=r"the WLF law ends at -81\.6 degC"):
        law.at_reference(-90.0)


def test_a_law_that_misfits_is_less_certain():
    bent = log_a(T) + 0.3 * np.sin(T / 7)
    _, covariance = drawn(np.random.default_rng(0), log_a(T))
    law = fit_laws(T, bent, covariance, AT).best
    assert not law.fits
    honest = fit_laws(T, *drawn(np.random.default_rng(0), log_a(T)), AT).best
    assert np.all(law.std > 2 * honest.std)
