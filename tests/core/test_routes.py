"""The three routes, the arm, and why there is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.routes import (
    ROUTES,
    maxwell_arm,
    mobility_route,
    paper_d,
    relative_route,
    transmissibility_route,
    why_no_arm,
)

EPS = np.finfo(float).eps
OMEGA = 2 * np.pi * 12.0


@given(st.floats(1e4, 1e6), st.floats(1e3, 1e6), st.floats(10.0, 1e5), st.floats(0.5, 500.0))
def test_the_arm_is_found_again(k1, k2, c, omega):
    arm = 1 / (1 / k2 + 1 / (1j * omega * c))
    found_k2, found_c = maxwell_arm(k1 + arm, k1, omega)
    # K* - K1 loses |K*|/|arm|, the parts of 1/arm lose |1/arm| over each of them
    lost = 16 * EPS * (1 + k1 / abs(arm)) / abs(arm)
    assert found_k2 == pytest.approx(k2, rel=lost * k2)
    assert found_c == pytest.approx(c, rel=lost * omega * c)


def test_an_arm_that_is_not_passive_has_the_sign_that_says_so():
    k2, c = maxwell_arm([90e3 + 1e4j, 120e3 - 1e4j, 100e3 + 1e4j], 100e3, OMEGA)
    assert k2[0] < 0 < c[0]
    assert k2[1] > 0 > c[1]
    assert np.isinf(k2[2])
    assert c[2] == pytest.approx(1e4 / OMEGA)


def test_papers_d_is_below_one_where_the_arm_carries():
    stiffness = 100e3 + 1 / (1 / 50e3 + 1 / (1j * OMEGA * 600.0))
    assert 0 < paper_d(stiffness, 100e3) < 1
    assert paper_d(100e3, 100e3) == 1.0


@given(
    st.complex_numbers(min_magnitude=1e4, max_magnitude=1e6, allow_nan=False),
    st.complex_numbers(min_magnitude=10.0, max_magnitude=1e4, allow_nan=False),
)
def test_the_routes_agree_on_what_they_all_see(stiffness, rig_impedance):
    """Each route finds K* from what the others would be given, if tyre and rig together have a motion at all."""
    tyre = 1j * OMEGA / stiffness
    total = tyre + 1 / rig_impedance
    v1, v2 = total, 1 / rig_impedance  # for a unit force, which goes through the tyre
    worst = abs(tyre) + abs(v2)
    lost = 32 * EPS * (1 + worst / abs(tyre))
    assert mobility_route(v1, v2, OMEGA) == pytest.approx(stiffness, rel=lost)
    assert relative_route(1.0, v1, v2, OMEGA) == pytest.approx(stiffness, rel=lost)
    if abs(total) > 1e-3 * worst:  # V2/V1 is infinite where V1 vanishes
        lost *= 1 + worst / abs(total)
        assert transmissibility_route(v2 / v1, rig_impedance, OMEGA) == pytest.approx(stiffness, rel=lost)


def test_routes_broadcast():
    impedance = np.full((3, 1), 500j)
    ratio = np.linspace(1.1, 2.0, 4)
    assert transmissibility_route(ratio, impedance, OMEGA).shape == (3, 4)
    assert ROUTES == ("mobility", "relative", "transmissibility")


@pytest.mark.parametrize(
    ("stiffness", "k1", "says"),
    [
        (complex(np.nan, np.nan), 1e5, "K\\* could not be found"),
        (complex(np.inf, 0.0), 1e5, "K\\* could not be found"),
        (120e3 + 1e4j, np.nan, "no static stiffness K1 is known"),
        (-120e3 + 1e4j, 1e5, "K' = -120 kN/m is not positive; look for an inverted force"),
        (0j, 1e5, "K' = 0 kN/m is not positive"),
        (120e3 - 1e4j, 1e5, "no passive C exists: K'' = -10 kN/m is not positive"),
        (90e3 + 1e4j, 1e5, "no passive K2 exists: K' = 90 kN/m is not above the static K1 = 100 kN/m"),
        (100e3 + 1e4j, 1e5, "no passive K2 exists"),
        (100e3 + 0j, 1e5, "no passive C exists"),
    ],
)
def test_why_there_is_no_arm(stiffness, k1, says):
    k2, c = maxwell_arm(stiffness, k1, OMEGA)
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(why_no_arm(stiffness, k1, k2, c))


def test_no_reason_where_there_is_an_arm():
    k2, c = maxwell_arm(120e3 + 1e4j, 1e5, OMEGA)
    assert why_no_arm(120e3 + 1e4j, 1e5, k2, c) == ""
