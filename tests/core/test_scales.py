"""K1 against K': plausible pairs are left alone; a V1 or a K1 of another unit is named."""

import numpy as np
import pytest

from fourpole.core.alone import check_scale, k1_exchanged
from fourpole.core.checks import Code
from fourpole.core.phasor import Phasors
from fourpole.core.routes import relative_route
from fourpole.words import remark_of, said

K1, OMEGA = 1e5, 2 * np.pi * 14.0


def made(ratio, loss, moved=1.8 - 0.5j, factor=1.0):
    """Phasors of a tyre of K' = `ratio` K1, whose V1 is recorded with a factor, and the K* that they show."""
    stiffness, v1 = ratio * K1 * (1 + 1j * loss), 0.07
    force = stiffness * (v1 - moved * v1) / (1j * OMEGA)
    phasors = Phasors.from_polar(14.0, abs(force), factor * v1, np.angle(force), abs(moved * v1), np.angle(moved))
    return phasors, complex(relative_route(force, factor * v1, moved * v1, OMEGA))


@pytest.mark.parametrize(("ratio", "loss"), [(1.02, 0.01), (1.3, 0.1), (2.0, 0.3), (6.0, 0.5), (0.85, 0.2)])
def test_a_plausible_pair_is_ok(ratio, loss):
    check = check_scale(*made(ratio, loss), K1)
    assert (check.code, check.verdict) == (Code.K1_RATIO, "ok")
    assert check.statistic == pytest.approx(ratio)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(-1.0, "inverted"), (1 / 9.80665, "9.81 times too small"), (9.80665, "9.81 times too large"),
     (1000.0, "as mm read as m"), (1e-3, "as m read as mm")],
)  # fmt: skip
def test_a_wrong_unit_or_sign_of_v1_is_named(factor, words):
    check = check_scale(*made(1.4, 0.25, factor=factor), K1)
    assert (check.code, check.verdict) == (Code.V1_SCALE, "warning")
    assert words in remark_of(check)


@pytest.mark.parametrize("unit", [9.80665, 1000.0])
def test_a_static_test_of_another_unit_is_named(unit):
    check = check_scale(*made(1.4, 0.2), K1 / unit)
    assert (check.code, check.verdict) == (Code.K1_RATIO, "warning")
    assert "kgf" in said(check).remedy


@pytest.mark.parametrize("unit", [2.0, 9.80665, 1000.0])
def test_a_static_test_above_the_dynamic_stiffness_is_named(unit):
    check = check_scale(*made(1.4, 0.2), K1 * unit, motion=False)
    assert (check.code, check.verdict) == (Code.K1_LARGE, "warning")
    assert f"{unit / 1.4:.3g} times K'" in remark_of(check)


def test_without_k1_there_is_no_check():
    assert check_scale(*made(1.4, 0.2), np.nan) is None


def specimens(k1, loss, rise):
    """K* of two specimens at two frequencies, whose (K' - K1)/K'' is `rise`."""
    k1, loss, rise = (np.array(one) for one in (k1, loss, rise))
    real = k1 / (1 - rise * loss)
    return np.array([real * (1 + 1j * loss), 1.01 * real * (1 + 1j * loss)])


@pytest.mark.parametrize(("rise", "loss"), [(0.9, (0.12, 0.15)), (4.7, (0.04, 0.05))])
@pytest.mark.parametrize("k1", [(1.3e5, 1.7e5), (2.4e5, 1.5e5)])
def test_exchanged_k1_of_two_specimens_is_seen(k1, rise, loss):
    stiffness = specimens(k1, loss, (rise, 1.05 * rise))
    assert k1_exchanged(stiffness, np.array([k1, k1])) is None
    one, other, usual = k1_exchanged(stiffness, np.array([k1[::-1]] * 2))
    assert abs(one - other) > 0.5 * usual
    assert usual == pytest.approx(rise, rel=0.15)


def test_two_unlike_specimens_have_not_exchanged_k1():
    """A hard rubber beside a soft one that creeps: no exchange makes them alike."""
    stiffness = specimens((1.3e5, 1.7e5), (0.05, 0.2), (1.0, 3.0))
    assert k1_exchanged(stiffness, np.array([(1.3e5, 1.7e5)] * 2)) is None
