"""Isotherms become a master curve: shift factors, vertical shifts, gaps, and uncertainties that hold."""

import numpy as np
import pytest
from tests.models.isotherms import REFERENCE, fractional_zener, isotherm, isotherms, log_a

from fourpole.errors import ModelError
from fourpole.models.shift_law import LEVEL, LOSS, ONE_CURVE, overlaps
from fourpole.models.superposition import superpose

DECADE = np.log(10)


def test_noiseless_isotherms_give_the_shift_factors():
    found, rest = superpose(isotherms(noise=1e-6, seed=1), REFERENCE)
    assert not rest
    # Four relaxation times per decade follow a smooth curve to about 1e-4.
    assert found.log_a / DECADE == pytest.approx(log_a(found.temperatures) / DECADE, abs=0.005)
    assert found.log_a[found.reference] == 0.0
    assert found.std[found.reference] == 0.0
    assert found.converged


@pytest.mark.statistical
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.sampled(2)
def test_errors_of_the_shift_factors_are_as_large_as_their_uncertainties(stated):
    off = []
    for seed in range(8):
        found, _ = superpose(isotherms(seed, 0.02, (-10.0, 0.0, 10.0, 20.0, 35.0), stated=stated), REFERENCE)
        others = np.arange(found.log_a.size) != found.reference
        off.append(((found.log_a - log_a(found.temperatures)) / np.where(others, found.std, 1.0))[others])
        assert np.max(np.abs(off[-1] * found.std[others])) < 0.1 * DECADE
    # The shifts of one curve are correlated, so that a run counts as two independent errors at least.
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=3 * np.sqrt(1 / (2 * 2 * 8)))


def test_vertical_shifts_are_found_and_their_lack_is_told():
    t = (-10.0, 0.0, 10.0, 20.0, 35.0)
    b = {one: np.exp(-0.004 * (one - REFERENCE)) for one in t}
    rng = np.random.default_rng(3)
    curves = [isotherm(one, int(rng.integers(2**32)), 0.002, b=b[one]) for one in t]
    found, _ = superpose(curves, REFERENCE, vertical=True)
    others = np.arange(len(t)) != found.reference
    # Where K* is nearly a power of frequency, both shifts act alike; their uncertainties say so.
    assert np.all(np.abs(found.log_b - np.log([b[one] for one in t]))[others] < 3.5 * found.vertical_std[others])
    assert np.all(np.abs(found.log_a - log_a(t))[others] < 3.5 * found.std[others])
    assert np.all(found.vertical_std < 0.03)
    plain, _ = superpose(curves, REFERENCE)
    assert plain.needs_vertical
    assert np.all(np.abs(plain.log_a - log_a(t)) <= 3 * plain.std + 1e-9)


def test_an_isotherm_beyond_a_gap_has_no_shift_factor():
    found, rest = superpose(isotherms(1, 0.01, (-30.0, 0.0, 10.0, 20.0)), REFERENCE)
    assert [one.temperature for one in rest] == [-30.0]
    assert found.temperatures.tolist() == [0.0, 10.0, 20.0]


def test_an_isotherm_of_a_plateau_has_no_shift_factor():
    """K* does not depend on frequency there, so any shift fits."""

    def plateau(omega):
        return fractional_zener(omega, order=0.98)

    found, rest = superpose(isotherms(2, 0.01, (-10.0, 0.0, 20.0, 120.0, 150.0), material=plateau, stated=True), 0.0)
    assert 150.0 in [one.temperature for one in rest]
    assert np.all(found.std < 0.3 * DECADE)


def test_one_curve_has_no_complaint_and_a_loss_factor_of_another_material_has():
    found, _ = superpose(isotherms(4, 0.01), REFERENCE)
    assert {one.verdict for one in overlaps(found)} == {ONE_CURVE}
    odd = isotherms(4, 0.01)
    odd[2] = isotherm(10.0, 9, 0.01, material=lambda w: fractional_zener(w, order=0.5))
    found, _ = superpose(odd, REFERENCE)
    verdicts = [one.verdict for one in overlaps(found)]
    assert LOSS in verdicts[1:3] or LEVEL in verdicts[1:3]


def test_what_cannot_be_shifted_is_refused():
    with pytest.raises(ModelError, match="one temperature only"):
        superpose(isotherms(temperatures=(20.0,)))
    with pytest.raises(ModelError, match="three or more"):
        superpose([isotherm(20.0, points=2), isotherm(30.0)])
    with pytest.raises(ModelError, match="no isotherm at the reference temperature 90"):
        superpose(isotherms(noise=0.01, seed=0), 90.0)
    with pytest.raises(ModelError, match="measure at temperatures between"):
        superpose(isotherms(0, 0.01, (-40.0, 60.0)), 60.0)
